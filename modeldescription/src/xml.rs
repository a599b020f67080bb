//! From the public types to the elements of `modelDescription.xml`, their private twins with the fields
//! in the order of the XML schema.
//!
//! Attributes at the default of the schema are left out, except causality, variability and initial: a reader of
//! the file should not have to know the table of defaults.

mod element;

use crate::number::Number;
use crate::structure::{Structure, Unknown};
use crate::{BaseUnit, Error, ModelDescription, NamingConvention, Variable, VariableKind};
use element::{
    Base, Category, CoSimulation, DefaultExperiment, IndexedUnknown, Item, Items, Kind, LogCategories,
    ModelStructure, ModelVariables, Root, ScalarVariable, SimpleType, TypeDefinitions, Unit, UnitDefinitions,
    Unknowns,
};
use serde::Serialize;
use std::collections::BTreeSet;

impl ModelDescription {
    /// The content of `modelDescription.xml`: UTF-8 without byte order mark, two blanks of indentation.
    ///
    /// The same description always gives the same text.
    ///
    /// # Errors
    ///
    /// Those of [`validate`](Self::validate).
    pub fn to_xml(&self) -> Result<String, Error> {
        self.validate()?;
        let structure = Structure::of(self)?;
        let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
        let mut serializer = quick_xml::se::Serializer::new(&mut text);
        serializer.indent(' ', 2);
        Root::new(self, &structure).serialize(serializer).map_err(Error::xml)?;
        text.push('\n');
        Ok(text)
    }
}

/// A container with its children, or none at all, since the schema allows no empty containers.
fn container<C, T>(children: Vec<T>, container: impl FnOnce(Vec<T>) -> C) -> Option<C> {
    (!children.is_empty()).then(|| container(children))
}

impl<'a> Root<'a> {
    fn new(d: &'a ModelDescription, structure: &Structure) -> Self {
        let units = d.units.iter().map(|unit| Unit { name: &unit.name, base: Base::new(&unit.base) });
        let types = d.enumerations.iter().map(SimpleType::new);
        let categories =
            d.log_categories.iter().map(|c| Category { name: &c.name, description: &c.description });
        Self {
            fmi_version: "2.0",
            model_name: &d.model_name,
            guid: &d.guid,
            description: &d.description,
            author: &d.author,
            version: &d.version,
            copyright: &d.copyright,
            license: &d.license,
            generation_tool: &d.generation_tool,
            generation_date_and_time: d.generation_date_and_time.as_deref(),
            variable_naming_convention: match d.variable_naming_convention {
                NamingConvention::Flat => "flat",
                NamingConvention::Structured => "structured",
            },
            co_simulation: CoSimulation::new(&d.co_simulation),
            units: container(units.collect(), |units| UnitDefinitions { units }),
            types: container(types.collect(), |types| TypeDefinitions { types }),
            log_categories: container(categories.collect(), |categories| LogCategories { categories }),
            default_experiment: d.default_experiment.as_ref().map(DefaultExperiment::new),
            variables: ModelVariables { variables: d.variables.iter().map(ScalarVariable::new).collect() },
            structure: ModelStructure {
                outputs: Unknowns::new(&structure.outputs),
                initial_unknowns: Unknowns::new(&structure.initial_unknowns),
            },
        }
    }
}

impl<'a> CoSimulation<'a> {
    fn new(slave: &'a crate::CoSimulation) -> Self {
        Self {
            model_identifier: &slave.model_identifier,
            needs_execution_tool: slave.needs_execution_tool,
            can_handle_variable_step: slave.can_handle_variable_step,
            can_interpolate_inputs: slave.can_interpolate_inputs,
            max_output_derivative_order: slave.max_output_derivative_order,
            can_run_asynchronously: slave.can_run_asynchronously,
            can_be_instantiated_only_once_per_process: slave.can_be_instantiated_only_once_per_process,
            can_not_use_memory_management_functions: slave.can_not_use_memory_management_functions,
            can_get_and_set_state: slave.can_get_and_set_state,
            can_serialize_state: slave.can_serialize_state,
            provides_directional_derivative: slave.provides_directional_derivative,
        }
    }
}

impl Base {
    fn new(base: &BaseUnit) -> Self {
        let BaseUnit { kg, m, s, a, k, mol, cd, rad, factor, offset } = *base;
        let factor = (factor != 1.0).then_some(Number(factor));
        let offset = (offset != 0.0).then_some(Number(offset));
        Self { kg, m, s, a, k, mol, cd, rad, factor, offset }
    }
}

impl<'a> SimpleType<'a> {
    fn new(declared: &'a crate::EnumerationType) -> Self {
        let item = |item: &'a crate::EnumerationItem| Item {
            name: &item.name,
            value: item.value,
            description: &item.description,
        };
        let enumeration = Items { items: declared.items.iter().map(item).collect() };
        Self { name: &declared.name, description: &declared.description, enumeration }
    }
}

impl DefaultExperiment {
    fn new(experiment: &crate::DefaultExperiment) -> Self {
        Self {
            start_time: Number(experiment.start_time),
            stop_time: experiment.stop_time.map(Number),
            tolerance: experiment.tolerance.map(Number),
            step_size: experiment.step_size.map(Number),
        }
    }
}

impl<'a> ScalarVariable<'a> {
    fn new(variable: &'a Variable) -> Self {
        Self {
            name: &variable.name,
            value_reference: variable.value_reference,
            description: &variable.description,
            causality: variable.causality.as_str(),
            variability: variable.variability.as_str(),
            initial: variable.effective_initial().map(crate::Initial::as_str),
            kind: Kind::new(&variable.kind),
        }
    }
}

impl<'a> Kind<'a> {
    fn new(kind: &'a VariableKind) -> Self {
        match kind {
            VariableKind::Real { start, min, max, nominal, quantity, unit } => Self::Real {
                quantity: quantity.as_deref(),
                unit: unit.as_deref(),
                min: min.map(Number),
                max: max.map(Number),
                nominal: nominal.map(Number),
                start: start.map(Number),
            },
            VariableKind::Integer { start, min, max } => {
                Self::Integer { min: *min, max: *max, start: *start }
            }
            VariableKind::Boolean { start } => Self::Boolean { start: *start },
            VariableKind::String { start } => Self::String { start: start.as_deref() },
            VariableKind::Enumeration { declared_type, start } => {
                Self::Enumeration { declared_type, start: *start }
            }
        }
    }
}

impl Unknowns {
    fn new(unknowns: &[Unknown]) -> Option<Self> {
        let list =
            |indices: &BTreeSet<usize>| indices.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ");
        let unknowns = unknowns
            .iter()
            .map(|u| IndexedUnknown { index: u.index, dependencies: u.dependencies.as_ref().map(list) });
        container(unknowns.collect(), |unknowns| Self { unknowns })
    }
}
