//! Writes the file `modelDescription.xml` of FMI 3.0, in the order of `fmi3ModelDescription.xsd`.
//!
//! Attributes at the schema's default are omitted, except causality, variability and initial, so that a
//! reader of the file need not know the table of defaults.

use super::{
    Alias, CoSimulation, DataType, Dimension, Interface, ModelDescription, ModelExchange, ModelStructure,
    TypeDefinition, Unknown, Variable, VariableKind,
};
use crate::xml::{Header, categories_and_experiment, container, optional, unless_default, unless_empty};
use crate::xsd::Number;
use crate::{Error, UnknownList, xml};
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};
use std::fmt::Display;

/// The value of `fmiVersion`.
pub(super) const VERSION: &str = "3.0";

impl ModelDescription {
    /// The content of `modelDescription.xml`: UTF-8 without byte order mark, indented by two blanks.
    ///
    /// The same description always gives the same text.
    ///
    /// # Errors
    ///
    /// Those of [`validate`](Self::validate).
    pub fn to_xml(&self) -> Result<String, Error> {
        self.validate()?;
        xml::text(self)
    }

    pub(super) fn header(&self) -> Header<'_> {
        Header {
            version: VERSION,
            model_name: &self.model_name,
            token: ("@instantiationToken", &self.instantiation_token),
            description: &self.description,
            author: &self.author,
            model_version: &self.version,
            copyright: &self.copyright,
            license: &self.license,
            generation_tool: &self.generation_tool,
            generation_date_and_time: self.generation_date_and_time.as_deref(),
            variable_naming_convention: self.variable_naming_convention,
        }
    }
}

/// A list of elements, each with the name of its type.
#[derive(Serialize)]
struct List<'a, T> {
    #[serde(rename = "$value")]
    elements: &'a [T],
}

impl Serialize for ModelDescription {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut element = serializer.serialize_struct("fmiModelDescription", 20)?;
        self.header().write(&mut element)?;
        optional(&mut element, "ModelExchange", self.model_exchange.as_ref())?;
        optional(&mut element, "CoSimulation", self.co_simulation.as_ref())?;
        optional(&mut element, "ScheduledExecution", self.scheduled_execution.as_ref())?;
        xml::units(&mut element, &self.units)?;
        let types = container(self.types.as_slice(), |elements| List { elements });
        optional(&mut element, "TypeDefinitions", types)?;
        categories_and_experiment(&mut element, &self.log_categories, self.default_experiment)?;
        element.serialize_field("ModelVariables", &List { elements: &self.variables })?;
        element.serialize_field("ModelStructure", &self.structure)?;
        element.end()
    }
}

impl Interface {
    fn write<E: SerializeStruct>(&self, element: &mut E) -> Result<(), E::Error> {
        element.serialize_field("@modelIdentifier", &self.model_identifier)?;
        for (name, flag) in [
            ("@needsExecutionTool", self.needs_execution_tool),
            ("@canBeInstantiatedOnlyOncePerProcess", self.can_be_instantiated_only_once_per_process),
            ("@canGetAndSetFMUState", self.can_get_and_set_state),
            ("@canSerializeFMUState", self.can_serialize_state),
            ("@providesDirectionalDerivatives", self.provides_directional_derivatives),
            ("@providesAdjointDerivatives", self.provides_adjoint_derivatives),
            ("@providesPerElementDependencies", self.provides_per_element_dependencies),
        ] {
            unless_default(element, name, flag)?;
        }
        Ok(())
    }
}

impl Serialize for Interface {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut element = serializer.serialize_struct("ScheduledExecution", 8)?;
        self.write(&mut element)?;
        element.end()
    }
}

impl Serialize for ModelExchange {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut element = serializer.serialize_struct("ModelExchange", 10)?;
        self.interface.write(&mut element)?;
        unless_default(&mut element, "@needsCompletedIntegratorStep", self.needs_completed_integrator_step)?;
        let evaluates = self.provides_evaluate_discrete_states;
        unless_default(&mut element, "@providesEvaluateDiscreteStates", evaluates)?;
        element.end()
    }
}

impl Serialize for CoSimulation {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut element = serializer.serialize_struct("CoSimulation", 17)?;
        self.interface.write(&mut element)?;
        let variable_step = self.can_handle_variable_step;
        unless_default(&mut element, "@canHandleVariableCommunicationStepSize", variable_step)?;
        optional(&mut element, "@fixedInternalStepSize", self.fixed_internal_step.map(Number))?;
        unless_default(&mut element, "@maxOutputDerivativeOrder", self.max_output_derivative_order)?;
        let smoothness = self.recommended_intermediate_input_smoothness;
        unless_default(&mut element, "@recommendedIntermediateInputSmoothness", smoothness)?;
        let early = self.can_return_early_after_intermediate_update;
        for (name, flag) in [
            ("@providesIntermediateUpdate", self.provides_intermediate_update),
            ("@mightReturnEarlyFromDoStep", self.might_return_early),
            ("@canReturnEarlyAfterIntermediateUpdate", early),
            ("@hasEventMode", self.has_event_mode),
            ("@providesEvaluateDiscreteStates", self.provides_evaluate_discrete_states),
        ] {
            unless_default(&mut element, name, flag)?;
        }
        element.end()
    }
}

impl Serialize for TypeDefinition {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut element = serializer.serialize_struct(self.kind.data_type().definition(), 12)?;
        element.serialize_field("@name", &self.name)?;
        unless_empty(&mut element, "@description", &self.description)?;
        self.kind.attributes(&mut element)?;
        if !self.items.is_empty() {
            element.serialize_field("Item", &self.items)?;
        }
        element.end()
    }
}

impl Serialize for Variable {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut element = serializer.serialize_struct(self.kind.data_type().as_str(), 24)?;
        element.serialize_field("@name", &self.name)?;
        element.serialize_field("@valueReference", &self.value_reference)?;
        unless_empty(&mut element, "@description", &self.description)?;
        element.serialize_field("@causality", self.causality.as_str())?;
        element.serialize_field("@variability", self.variability.as_str())?;
        let set_often = self.can_handle_multiple_set;
        optional(&mut element, "@canHandleMultipleSetPerTimeInstant", set_often)?;
        optional(&mut element, "@clocks", container(self.clocks.as_slice(), joined))?;
        unless_default(&mut element, "@intermediateUpdate", self.intermediate_update)?;
        optional(&mut element, "@previous", self.previous)?;
        optional(&mut element, "@declaredType", self.declared_type.as_ref())?;
        optional(&mut element, "@initial", self.effective_initial().map(crate::Initial::as_str))?;
        self.kind.attributes(&mut element)?;
        self.kind.start_attribute(&mut element)?;
        if let Some(of) = self.kind.as_float() {
            optional(&mut element, "@derivative", of.derivative)?;
            unless_default(&mut element, "@reinit", of.reinit)?;
        }
        element.serialize_field("Dimension", &self.dimensions)?;
        self.kind.start_elements(&mut element)?;
        element.serialize_field("Alias", &self.aliases)?;
        element.end()
    }
}

/// A list of values, separated by blanks.
fn joined<T: Display>(values: &[T]) -> String {
    values.iter().map(T::to_string).collect::<Vec<_>>().join(" ")
}

/// The start values, joined into one attribute.
fn starts<T>(values: &[T], word: impl Fn(&T) -> String) -> Option<String> {
    container(values, |values| values.iter().map(word).collect::<Vec<_>>().join(" "))
}

/// A number of this type, with the fewest digits that read back as the same.
fn number(of: DataType, value: f64) -> String {
    if of == DataType::Float32 && value.is_finite() {
        format!("{:?}", value as f32)
    } else {
        Number(value).to_string()
    }
}

impl VariableKind {
    /// Writes the attributes that declared types share.
    fn attributes<E: SerializeStruct>(&self, element: &mut E) -> Result<(), E::Error> {
        let number = |value: f64| number(self.data_type(), value);
        if let Some(of) = self.as_float() {
            optional(element, "@quantity", of.quantity.as_ref())?;
            optional(element, "@unit", of.unit.as_ref())?;
            optional(element, "@displayUnit", of.display_unit.as_ref())?;
            unless_default(element, "@relativeQuantity", of.relative_quantity)?;
            unless_default(element, "@unbounded", of.unbounded)?;
            optional(element, "@min", of.min.map(number))?;
            optional(element, "@max", of.max.map(number))?;
            optional(element, "@nominal", of.nominal.map(number))?;
        }
        if let Some(of) = self.as_integer() {
            optional(element, "@quantity", of.quantity.as_ref())?;
            optional(element, "@min", of.min)?;
            optional(element, "@max", of.max)?;
        }
        match self {
            Self::Binary(of) => {
                optional(element, "@mimeType", of.mime_type.as_ref())?;
                optional(element, "@maxSize", of.max_size)
            }
            Self::Clock(of) => {
                unless_default(element, "@canBeDeactivated", of.can_be_deactivated)?;
                optional(element, "@priority", of.priority)?;
                let variability = of.interval_variability.map(super::IntervalVariability::as_str);
                optional(element, "@intervalVariability", variability)?;
                optional(element, "@intervalDecimal", of.interval_decimal.map(Number))?;
                optional(
                    element,
                    "@shiftDecimal",
                    (of.shift_decimal != 0.0).then_some(Number(of.shift_decimal)),
                )?;
                unless_default(element, "@supportsFraction", of.supports_fraction)?;
                optional(element, "@resolution", of.resolution)?;
                optional(element, "@intervalCounter", of.interval_counter)?;
                unless_default(element, "@shiftCounter", of.shift_counter)
            }
            _ => Ok(()),
        }
    }

    /// Writes the start values that go into an attribute.
    fn start_attribute<E: SerializeStruct>(&self, element: &mut E) -> Result<(), E::Error> {
        let text = match (self, self.as_float(), self.as_integer()) {
            (Self::Boolean(of), ..) => starts(&of.start, bool::to_string),
            (_, Some(of), _) => starts(&of.start, |&value| number(self.data_type(), value)),
            (_, _, Some(of)) => starts(&of.start, i128::to_string),
            _ => None,
        };
        optional(element, "@start", text)
    }

    /// Writes the start values that go into separate elements.
    fn start_elements<E: SerializeStruct>(&self, element: &mut E) -> Result<(), E::Error> {
        #[derive(Serialize)]
        struct Start<T> {
            #[serde(rename = "@value")]
            value: T,
        }
        let hexadecimal =
            |bytes: &Vec<u8>| bytes.iter().map(|byte| format!("{byte:02X}")).collect::<String>();
        match self {
            Self::String(of) => {
                let list: Vec<_> = of.start.iter().map(|value| Start { value }).collect();
                element.serialize_field("Start", &list)
            }
            Self::Binary(of) => {
                let list: Vec<_> = of.start.iter().map(|b| Start { value: hexadecimal(b) }).collect();
                element.serialize_field("Start", &list)
            }
            _ => Ok(()),
        }
    }
}

impl Serialize for Dimension {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut element = serializer.serialize_struct("Dimension", 2)?;
        optional(&mut element, "@start", self.start)?;
        optional(&mut element, "@valueReference", self.value_reference)?;
        element.end()
    }
}

impl Serialize for Alias {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut element = serializer.serialize_struct("Alias", 3)?;
        element.serialize_field("@name", &self.name)?;
        unless_empty(&mut element, "@description", &self.description)?;
        optional(&mut element, "@displayUnit", self.display_unit.as_ref())?;
        element.end()
    }
}

impl Serialize for ModelStructure {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut element = serializer.serialize_struct("ModelStructure", UnknownList::ALL.len())?;
        for list in UnknownList::ALL {
            let unknowns: &[Unknown] = self.list(list);
            element.serialize_field(list.element(), unknowns)?;
        }
        element.end()
    }
}
