//! Derives the model description of FMI 3.0 from that of FMI 2.0 and the arrays.

use punctual_modeldescription::fmi3::{
    CoSimulation, Dimension, EnumerationItem, Float, Integer, Interface, ModelDescription, ModelStructure,
    Plain, Terminal, TerminalMember, Terminals, TypeDefinition, Unknown, Variable, VariableKind,
};
use punctual_modeldescription::{self as fmi2, Causality, Variability};

use super::Product;
use super::arrays::{Item, TIME};
use crate::configuration::Configuration;

impl Product {
    /// The model description of an FMU of FMI 3.0.
    pub fn model_description_of_fmi3(&self) -> ModelDescription {
        let of_fmi2 = self.model_description();
        let interface = Interface {
            model_identifier: of_fmi2.co_simulation.model_identifier,
            can_get_and_set_state: true,
            can_serialize_state: true,
            provides_directional_derivatives: true,
            provides_adjoint_derivatives: true,
            provides_per_element_dependencies: true,
            ..Interface::default()
        };
        let variables: Vec<_> = self.items.iter().map(|item| self.variable_of(item)).collect();
        let mut structure = ModelStructure::of(&variables);
        for unknown in &mut structure.outputs {
            self.depend(unknown, |output| output.dependencies.as_ref());
        }
        for unknown in &mut structure.initial_unknowns {
            self.depend(unknown, |output| {
                output.initial_dependencies.as_ref().or(output.dependencies.as_ref())
            });
        }
        ModelDescription {
            model_name: of_fmi2.model_name,
            instantiation_token: of_fmi2.guid,
            description: of_fmi2.description,
            author: of_fmi2.author,
            version: of_fmi2.version,
            license: of_fmi2.license,
            generation_tool: of_fmi2.generation_tool,
            variable_naming_convention: of_fmi2.variable_naming_convention,
            co_simulation: Some(CoSimulation {
                interface,
                can_handle_variable_step: true,
                ..CoSimulation::default()
            }),
            units: units(&variables),
            types: of_fmi2.types.into_iter().map(enumeration).collect(),
            log_categories: of_fmi2.log_categories,
            default_experiment: of_fmi2.default_experiment,
            variables,
            structure,
            ..ModelDescription::default()
        }
    }

    /// The terminals: `vehicle` connects plant, filter and controller, `wanted` a controller and a filter.
    /// They match by the members that both sides have.
    pub fn terminals(&self) -> Terminals {
        let vehicle = ("vehicle", "the state measured, and the input");
        let wanted = ("wanted", "the input that is wanted");
        let groups: &[(_, &[&str])] = match self.configuration {
            Configuration::Filter(_) => &[(vehicle, &["x", "u"]), (wanted, &["u_ref"])],
            Configuration::Plant(_) => &[(vehicle, &["x", "u"])],
            Configuration::Controller(_) => &[(vehicle, &["x"]), (wanted, &["u_ref"])],
        };
        let terminal = |((name, description), families): &((&str, &str), &[&str])| {
            let belongs = |item: &&Item| {
                let family = item.name.split_once('.').map_or(&*item.name, |(family, _)| family);
                families.contains(&family)
            };
            let member = |item: &Item| TerminalMember::signal(&*item.name, &*item.name);
            Terminal {
                name: (*name).to_owned(),
                matching_rule: "bus".to_owned(),
                description: (*description).to_owned(),
                members: self.items.iter().filter(belongs).map(member).collect(),
                ..Terminal::default()
            }
        };
        Terminals { terminals: groups.iter().map(terminal).filter(|t| !t.members.is_empty()).collect() }
    }

    /// Adds the dependencies of `unknown`: those of any of its scalars, as given by `dependencies`.
    fn depend(&self, unknown: &mut Unknown, dependencies: impl Fn(&fmi2::Variable) -> Option<&Vec<u32>>) {
        let Some(scalars) =
            self.variables.get(self.item_of(unknown.value_reference as usize).scalars.clone())
        else {
            return;
        };
        let Some(all) = scalars.iter().map(&dependencies).collect::<Option<Vec<_>>>() else { return };
        let mut references: Vec<u32> =
            all.into_iter().flatten().map(|&on| self.item_of(on as usize).reference()).collect();
        references.sort_unstable();
        references.dedup();
        unknown.dependencies = Some(references);
    }

    fn variable_of(&self, item: &Item) -> Variable {
        let Some(scalars) = self.variables.get(item.scalars.clone()) else { return time(item.reference()) };
        let first = &scalars[0];
        let (causality, variability) = (first.causality, first.variability);
        let mut variable =
            Variable::new(&*item.name, item.reference(), causality, variability, kind(scalars));
        variable.description = description(item, scalars);
        variable.dimensions = item.dimensions.iter().map(|length| Dimension::fixed(*length as u64)).collect();
        if let fmi2::VariableKind::Enumeration(of) = &first.kind {
            variable.declared_type.clone_from(&of.declared_type);
        }
        variable
    }
}

fn time(reference: u32) -> Variable {
    let kind = VariableKind::Float64(Float { unit: Some("s".to_owned()), ..Float::default() });
    let mut time = Variable::new(TIME, reference, Causality::Independent, Variability::Continuous, kind);
    time.description = "the communication point".to_owned();
    time
}

fn enumeration(of: fmi2::SimpleType) -> TypeDefinition {
    let item = |i: fmi2::EnumerationItem| EnumerationItem {
        name: i.name,
        value: i64::from(i.value),
        description: i.description,
    };
    TypeDefinition {
        name: of.name,
        description: of.description,
        kind: VariableKind::Enumeration(Integer::default()),
        items: of.items.into_iter().map(item).collect(),
    }
}

/// The units of `variables`.
fn units(variables: &[Variable]) -> Vec<fmi2::Unit> {
    super::units(variables.iter().filter_map(|v| v.kind.as_float()?.unit.as_deref()))
}

/// The common value of all; `None` if they differ.
fn common<T: PartialEq>(mut all: impl Iterator<Item = Option<T>>) -> Option<T> {
    let first = all.next()??;
    all.all(|other| other.as_ref() == Some(&first)).then_some(first)
}

/// The type of one or more scalars of the same type, with unit and range if they share them.
fn kind(scalars: &[fmi2::Variable]) -> VariableKind {
    let integer = |of: &fmi2::Integer| Integer {
        quantity: of.quantity.clone(),
        min: of.min.map(i128::from),
        max: of.max.map(i128::from),
        start: of.start.map(i128::from).into_iter().collect(),
    };
    match &scalars[0].kind {
        fmi2::VariableKind::Real(_) => {
            let reals = || {
                scalars.iter().filter_map(|v| match &v.kind {
                    fmi2::VariableKind::Real(real) => Some(real),
                    _ => None,
                })
            };
            VariableKind::Float64(Float {
                quantity: common(reals().map(|real| real.quantity.clone())),
                unit: common(reals().map(|real| real.unit.clone())),
                min: common(reals().map(|real| real.min)),
                max: common(reals().map(|real| real.max)),
                start: reals().filter_map(|real| real.start).collect(),
                ..Float::default()
            })
        }
        fmi2::VariableKind::Integer(of) => VariableKind::Int32(integer(of)),
        fmi2::VariableKind::Enumeration(of) => VariableKind::Enumeration(integer(of)),
        fmi2::VariableKind::Boolean(of) => {
            VariableKind::Boolean(Plain { start: of.start.into_iter().collect() })
        }
        fmi2::VariableKind::String(of) => {
            VariableKind::String(Plain { start: of.start.clone().into_iter().collect() })
        }
    }
}

/// The description of a scalar; for an array, that of each element with its name and unit.
fn description(item: &Item, scalars: &[fmi2::Variable]) -> String {
    if item.dimensions.is_empty() {
        return scalars[0].description.clone();
    }
    let element = |v: &fmi2::Variable| {
        let name = v.name.strip_prefix(&item.name).unwrap_or(&v.name).trim_start_matches('.');
        let unit = v.kind.unit().unwrap_or("1");
        format!("{name} in {unit}: {}", v.description)
    };
    scalars.iter().map(element).collect::<Vec<_>>().join("; ")
}
