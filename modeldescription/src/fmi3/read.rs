//! Reads a model description of FMI 3.0 from its XML, tolerating defects, as [`crate::Located`] does for 2.0.

use super::{
    Alias, Binary, Clock, CoSimulation, DIMENSION, DataType, Dimension, EnumerationItem, Float, Integer,
    Interface, IntervalVariability, ModelDescription, ModelExchange, ModelStructure, NO_CLOCK, Plain,
    TypeDefinition, Unknown, Variable, VariableKind,
};
use crate::notes::{At, Notes, children};
use crate::rules::{Check, Place, Violation, fmi3};
use crate::xsd::{boolean, double, float, hexadecimal, integer, unsigned, words};
use crate::{Causality, Initial, NamingConvention, UnknownList, Variability};
use roxmltree::{Document, Node};

/// The elements of the interfaces, in the order of [`Place::Interface`].
pub(super) const INTERFACES: [&str; 3] = ["ModelExchange", "CoSimulation", "ScheduledExecution"];

/// A model description of FMI 3.0, and the positions of its parts in the text.
#[derive(Debug, Default)]
pub struct Located {
    /// The content.
    pub description: ModelDescription,
    /// The start values of the variables as written; those of texts and bytes are separated by blanks.
    pub starts: Vec<Option<String>>,
    pub(super) notes: Notes,
}

impl Located {
    /// Reads a document.
    pub fn read(document: &Document<'_>) -> Self {
        let mut read = Self::default();
        read.root(document.root_element());
        read
    }

    /// The offset of a part in the text, in bytes. If the part is missing, the
    /// offset of the part that should contain it.
    pub fn position(&self, place: Place) -> usize {
        self.notes.position(place)
    }

    /// Reports every broken rule of [`RULES`](crate::RULES).
    pub fn check(&self, report: &mut dyn FnMut(Violation)) {
        fmi3::description(&self.description, &mut Check { unread: &self.notes.unread, report });
    }

    /// Whether a required attribute is missing, or a present one is not a value of its type.
    pub fn is_unread(&self, place: Place, attribute: &'static str) -> bool {
        self.notes.is_unread(place, attribute)
    }

    fn root(&mut self, root: Node<'_, '_>) {
        // The attributes of the root.
        let mut at = self.notes.enter(Place::Root, root);
        self.description = ModelDescription {
            model_name: at.text("modelName"),
            instantiation_token: at.required("instantiationToken", |text| Some(text.to_owned())),
            description: at.text("description"),
            author: at.text("author"),
            version: at.text("version"),
            copyright: at.text("copyright"),
            license: at.text("license"),
            generation_tool: at.text("generationTool"),
            generation_date_and_time: at.optional("generationDateAndTime"),
            variable_naming_convention: at
                .value("variableNamingConvention", NamingConvention::parse)
                .unwrap_or_default(),
            ..ModelDescription::default()
        };
        // The interfaces.
        let [exchange, co_simulation, scheduled] = INTERFACES.map(|element| children(root, element).next());
        self.description.model_exchange = exchange.map(|node| self.model_exchange(node));
        self.description.co_simulation = co_simulation.map(|node| self.co_simulation(node));
        self.description.scheduled_execution = scheduled.map(|node| self.interface(2, node));
        // The lists that variables refer to, and the experiment.
        self.description.units = self.notes.units(root);
        let types = children(root, "TypeDefinitions").flat_map(|list| list.children());
        let types = types.filter_map(|node| Some((data_type(node, DataType::definition)?, node)));
        self.description.types =
            types.enumerate().map(|(t, (of, node))| self.definition(t, of, node)).collect();
        self.description.log_categories = self.notes.categories(root);
        self.description.default_experiment = self.notes.experiment(root);
        // The variables, and the structure over them.
        let variables = children(root, "ModelVariables").flat_map(|list| list.children());
        let variables = variables.filter_map(|node| Some((data_type(node, DataType::as_str)?, node)));
        self.description.variables =
            variables.enumerate().map(|(v, (of, node))| self.variable(v, of, node)).collect();
        let structure = children(root, "ModelStructure").next();
        let [outputs, derivatives, clocked_states, initial_unknowns, event_indicators] =
            UnknownList::ALL.map(|list| self.unknowns(root, structure, list));
        self.description.structure =
            ModelStructure { outputs, derivatives, clocked_states, initial_unknowns, event_indicators };
    }

    fn interface(&mut self, index: usize, node: Node<'_, '_>) -> Interface {
        let place = Place::Interface(index);
        self.notes.interface(place, node);
        let mut at = self.notes.at(place, Some(node));
        Interface {
            model_identifier: at.required("modelIdentifier", |text| Some(text.to_owned())),
            needs_execution_tool: at.flag("needsExecutionTool"),
            can_be_instantiated_only_once_per_process: at.flag("canBeInstantiatedOnlyOncePerProcess"),
            can_get_and_set_state: at.flag("canGetAndSetFMUState"),
            can_serialize_state: at.flag("canSerializeFMUState"),
            provides_directional_derivatives: at.flag("providesDirectionalDerivatives"),
            provides_adjoint_derivatives: at.flag("providesAdjointDerivatives"),
            provides_per_element_dependencies: at.flag("providesPerElementDependencies"),
        }
    }

    fn model_exchange(&mut self, node: Node<'_, '_>) -> ModelExchange {
        let interface = self.interface(0, node);
        let mut at = self.notes.at(Place::Interface(0), Some(node));
        ModelExchange {
            interface,
            needs_completed_integrator_step: at.flag("needsCompletedIntegratorStep"),
            provides_evaluate_discrete_states: at.flag("providesEvaluateDiscreteStates"),
        }
    }

    fn co_simulation(&mut self, node: Node<'_, '_>) -> CoSimulation {
        let interface = self.interface(1, node);
        let mut at = self.notes.at(Place::Interface(1), Some(node));
        CoSimulation {
            interface,
            can_handle_variable_step: at.flag("canHandleVariableCommunicationStepSize"),
            fixed_internal_step: at.value("fixedInternalStepSize", double),
            max_output_derivative_order: at.value("maxOutputDerivativeOrder", unsigned).unwrap_or(0),
            recommended_intermediate_input_smoothness: at
                .value("recommendedIntermediateInputSmoothness", integer)
                .unwrap_or(0),
            provides_intermediate_update: at.flag("providesIntermediateUpdate"),
            might_return_early: at.flag("mightReturnEarlyFromDoStep"),
            can_return_early_after_intermediate_update: at.flag("canReturnEarlyAfterIntermediateUpdate"),
            has_event_mode: at.flag("hasEventMode"),
            provides_evaluate_discrete_states: at.flag("providesEvaluateDiscreteStates"),
        }
    }

    fn definition(&mut self, t: usize, of: DataType, node: Node<'_, '_>) -> TypeDefinition {
        let mut at = self.notes.enter(Place::Type(t), node);
        let (name, description) = (at.text("name"), at.text("description"));
        let kind = at.kind(of, &[]);
        // An item without a value is skipped.
        let valued =
            children(node, "Item").filter_map(|n| Some((n, n.attribute("value").and_then(integer)?)));
        let items = valued.enumerate().map(|(i, (node, value))| {
            let at = self.notes.enter(Place::Item(t, i), node);
            EnumerationItem { name: at.text("name"), value, description: at.text("description") }
        });
        let items = items.collect();
        TypeDefinition { name, description, kind, items }
    }

    fn variable(&mut self, v: usize, of: DataType, node: Node<'_, '_>) -> Variable {
        let place = Place::Variable(v);
        // The start values: words of an attribute, or elements.
        let elements: Vec<Node<'_, '_>> = children(node, "Start").collect();
        let start = if let Some(attribute) = node.attribute_node("start") {
            self.notes.mark(Place::Start(v), attribute.range().start);
            (!matches!(of, DataType::String | DataType::Binary)).then(|| attribute.value().to_owned())
        } else {
            None
        };
        let values: Vec<&str> = match of {
            DataType::String | DataType::Binary => {
                if let Some(first) = elements.first() {
                    self.notes.mark(Place::Start(v), first.range().start);
                }
                elements.iter().filter_map(|n| n.attribute("value")).collect()
            }
            _ => start.as_deref().map(|text| words(text).collect()).unwrap_or_default(),
        };
        self.starts.push(start.clone().or_else(|| (!values.is_empty()).then(|| values.join(" "))));
        let kind = self.notes.at(place, Some(node)).kind(of, &values);
        // An attribute without a word is present but has no value.
        if start.is_some() && values.is_empty() {
            self.notes.miss(Place::Start(v), "start");
        }
        let aliases = children(node, "Alias").enumerate().map(|(a, node)| {
            let at = self.notes.enter(Place::Alias(v, a), node);
            Alias {
                name: at.text("name"),
                description: at.text("description"),
                display_unit: at.optional("displayUnit"),
            }
        });
        let aliases = aliases.collect();
        let dimensions = children(node, "Dimension").map(|node| {
            let mut at = self.notes.at(place, Some(node));
            Dimension {
                start: at.of_dimension("start", integer),
                value_reference: at.of_dimension("valueReference", unsigned),
            }
        });
        let dimensions = dimensions.collect();
        if node.attribute("clocks").is_some_and(|text| words(text).next().is_none()) {
            self.notes.miss(place, NO_CLOCK);
        }
        let mut at = self.notes.enter(place, node);
        let causality = at.value("causality", Causality::parse).unwrap_or(Causality::Local);
        let variability = at.value("variability", Variability::parse);
        Variable {
            name: at.required("name", |text| Some(text.to_owned())),
            value_reference: at.required("valueReference", unsigned),
            description: at.text("description"),
            causality,
            variability: variability.unwrap_or_else(|| Variable::default_variability(causality, of)),
            initial: at.value("initial", Initial::parse),
            declared_type: at.optional("declaredType"),
            kind,
            dimensions,
            aliases,
            clocks: at.value("clocks", |text| words(text).map(unsigned).collect()).unwrap_or_default(),
            previous: at.value("previous", unsigned),
            intermediate_update: at.flag("intermediateUpdate"),
            can_handle_multiple_set: at.value("canHandleMultipleSetPerTimeInstant", boolean),
        }
    }

    fn unknowns(
        &mut self,
        root: Node<'_, '_>,
        structure: Option<Node<'_, '_>>,
        list: UnknownList,
    ) -> Vec<Unknown> {
        let found = || structure.into_iter().flat_map(move |n| children(n, list.element()));
        self.notes.list_at(list, found().next(), structure, root);
        let unknown = |(u, node)| {
            let (value_reference, dependencies, dependency_kinds) =
                self.notes.unknown(Place::Unknown(list, u), node, "valueReference");
            Unknown { value_reference, dependencies, dependency_kinds }
        };
        found().enumerate().map(unknown).collect()
    }
}

/// The type that an element denotes, in one of its two spellings.
fn data_type(node: Node<'_, '_>, spelling: fn(DataType) -> &'static str) -> Option<DataType> {
    DataType::ALL.iter().copied().find(|of| node.has_tag_name(spelling(*of)))
}

impl At<'_, '_, '_> {
    /// Reads the attributes of a type, and the start values of a variable.
    fn kind(&mut self, of: DataType, starts: &[&str]) -> VariableKind {
        use VariableKind as K;
        let integers = |at: &mut Self| at.integers(of, starts);
        match of {
            DataType::Float32 => K::Float32(self.floats(float, starts)),
            DataType::Float64 => K::Float64(self.floats(double, starts)),
            DataType::Int8 => K::Int8(integers(self)),
            DataType::UInt8 => K::UInt8(integers(self)),
            DataType::Int16 => K::Int16(integers(self)),
            DataType::UInt16 => K::UInt16(integers(self)),
            DataType::Int32 => K::Int32(integers(self)),
            DataType::UInt32 => K::UInt32(integers(self)),
            DataType::Int64 => K::Int64(integers(self)),
            DataType::UInt64 => K::UInt64(integers(self)),
            DataType::Enumeration => K::Enumeration(integers(self)),
            DataType::Boolean => K::Boolean(Plain { start: self.starts(starts, boolean) }),
            DataType::String => K::String(Plain { start: self.starts(starts, |text| Some(text.to_owned())) }),
            DataType::Binary => K::Binary(Binary {
                mime_type: self.optional("mimeType"),
                max_size: self.value("maxSize", integer),
                start: self.starts(starts, hexadecimal),
            }),
            DataType::Clock => K::Clock(Clock {
                can_be_deactivated: self.flag("canBeDeactivated"),
                priority: self.value("priority", unsigned),
                interval_variability: self.value("intervalVariability", IntervalVariability::parse),
                interval_decimal: self.value("intervalDecimal", double),
                shift_decimal: self.value("shiftDecimal", double).unwrap_or(0.0),
                supports_fraction: self.flag("supportsFraction"),
                resolution: self.value("resolution", integer),
                interval_counter: self.value("intervalCounter", integer),
                shift_counter: self.value("shiftCounter", integer).unwrap_or(0),
            }),
        }
    }

    fn floats(&mut self, parse: fn(&str) -> Option<f64>, starts: &[&str]) -> Float {
        Float {
            quantity: self.optional("quantity"),
            unit: self.optional("unit"),
            display_unit: self.optional("displayUnit"),
            relative_quantity: self.flag("relativeQuantity"),
            unbounded: self.flag("unbounded"),
            min: self.value("min", parse),
            max: self.value("max", parse),
            nominal: self.value("nominal", parse),
            start: self.starts(starts, parse),
            derivative: self.value("derivative", unsigned),
            reinit: self.flag("reinit"),
        }
    }

    fn integers(&mut self, of: DataType, starts: &[&str]) -> Integer {
        let limits = of.limits().unwrap_or_default();
        let parse = |text: &str| integer::<i128>(text).filter(|x| (limits.0..=limits.1).contains(x));
        Integer {
            quantity: self.optional("quantity"),
            min: self.value("min", parse),
            max: self.value("max", parse),
            start: self.starts(starts, parse),
        }
    }

    /// Reads the start values of a variable. If one of them cannot be read, this is noted and there are none.
    fn starts<T>(&mut self, starts: &[&str], parse: impl Fn(&str) -> Option<T>) -> Vec<T> {
        let values: Option<Vec<T>> = starts.iter().map(|text| parse(text)).collect();
        values.unwrap_or_else(|| {
            if let Place::Variable(v) = self.place {
                self.notes.miss(Place::Start(v), "start");
            }
            Vec::new()
        })
    }

    /// Reads an attribute of a dimension. If it cannot be read, this is noted for the variable.
    fn of_dimension<T>(&mut self, name: &str, parse: impl FnOnce(&str) -> Option<T>) -> Option<T> {
        let value = parse(self.attribute(name)?);
        if value.is_none() {
            self.notes.miss(self.place, DIMENSION);
        }
        value
    }
}
