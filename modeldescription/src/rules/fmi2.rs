//! Rules specific to FMI 2.0 (FMI 2.0.4, sections 2.2.7, 2.2.8 and 4.3.1), and the properties of its
//! variables that the shared rules need.

#[cfg(feature = "read")]
use super::UnknownList;
#[cfg(feature = "read")]
use super::structure::{Listed, Numbering};
use super::variables::{AnyType, AnyVariable, Scope};
use super::{Check, Place, brief};
#[cfg(feature = "read")]
use crate::structure::{index, initial_unknowns as initial_unknowns_of};
use crate::{
    BaseType, Causality, Initial, InitialRule, ModelDescription, NamingConvention, ScalarType, SimpleType,
    Variability, Variable, VariableKind,
};
#[cfg(feature = "read")]
use crate::{ModelStructure, Unknown};
use std::collections::HashMap;

impl AnyType for SimpleType {
    fn name(&self) -> &str {
        &self.name
    }

    fn type_name(&self) -> &'static str {
        self.kind.scalar_type().as_str()
    }

    fn unit(&self) -> Option<&str> {
        self.kind.unit()
    }

    fn display_unit(&self) -> Option<&str> {
        self.kind.display_unit()
    }

    fn range(&self) -> (Option<f64>, Option<f64>) {
        self.kind.range()
    }

    fn items(&self) -> Vec<(&str, i64)> {
        let enumeration = self.kind.scalar_type() == ScalarType::Enumeration;
        let items = self.items.iter().filter(|_| enumeration);
        items.map(|item| (item.name.as_str(), item.value.into())).collect()
    }
}

impl AnyVariable for Variable {
    const FLOATS: &'static str = "Real";
    const CONTINUOUS: &'static str = " (which is the default)";

    fn name(&self) -> &str {
        &self.name
    }

    fn causality(&self) -> Causality {
        self.causality
    }

    fn variability(&self) -> Variability {
        self.variability
    }

    fn initial(&self) -> Option<Initial> {
        self.initial
    }

    fn effective_initial(&self) -> Option<Initial> {
        Self::effective_initial(self)
    }

    fn legal(&self, causality: Causality, variability: Variability) -> Option<InitialRule> {
        InitialRule::of(causality, variability)
    }

    fn type_name(&self) -> &'static str {
        self.kind.scalar_type().as_str()
    }

    fn is_float(&self) -> bool {
        self.kind.scalar_type() == ScalarType::Real
    }

    fn needs_start(&self) -> bool {
        Self::needs_start(self)
    }

    fn has_start(&self) -> bool {
        self.kind.has_start()
    }

    fn starts(&self) -> Vec<f64> {
        self.kind.start_number().into_iter().collect()
    }

    fn chosen(&self) -> Vec<i64> {
        match &self.kind {
            VariableKind::Enumeration(of) => of.start.map(i64::from).into_iter().collect(),
            _ => Vec::new(),
        }
    }

    fn declared_type(&self) -> Option<&str> {
        self.kind.declared_type()
    }

    fn unit(&self) -> Option<&str> {
        self.kind.unit()
    }

    fn display_unit(&self) -> Option<&str> {
        self.kind.display_unit()
    }

    fn range(&self) -> (Option<f64>, Option<f64>) {
        self.kind.range()
    }
}

/// Checks every rule on a description.
pub(crate) fn description(description: &ModelDescription, check: &mut Check<'_>) {
    check.token("interface.guid", "guid", &description.guid);
    let co_simulation = &description.co_simulation;
    let mut interface = |place, name: &str, serialises, restores| {
        check.identifier(place, name);
        check.flags(place, ("canSerializeFMUstate", serialises), ("canGetAndSetFMUstate", restores));
    };
    if let Some(of) = &description.model_exchange {
        interface(
            Place::ModelExchange,
            &of.model_identifier,
            of.can_serialize_state,
            of.can_get_and_set_state,
        );
    }
    let (serialises, restores) = (co_simulation.can_serialize_state, co_simulation.can_get_and_set_state);
    interface(Place::Interface(0), &co_simulation.model_identifier, serialises, restores);
    check.experiment(description.default_experiment);
    check.categories(&description.log_categories);
    check.units(&description.units);
    let structured = description.variable_naming_convention == NamingConvention::Structured;
    let mut scope = Scope::new(&description.units, &description.types, structured);
    let names = description.variables.iter().map(|v| v.name.as_str()).collect();
    check.types(&description.types, &scope.units, &names);
    for (v, variable) in description.variables.iter().enumerate() {
        check.variable(v, variable, &mut scope);
        check.derivative(v, variable, description);
    }
    check.aliases(&description.variables);
}

/// Checks every rule on a structure that was read.
#[cfg(feature = "read")]
pub(crate) fn structure(description: &ModelDescription, structure: &ModelStructure, check: &mut Check<'_>) {
    use UnknownList::{Derivatives, InitialUnknowns, Outputs};
    let numbering = Numbering {
        attribute: "index",
        of_list: UnknownList::as_str,
        word: "index",
        wanted: format!("that of a variable, 1 to {}", description.variables.len()),
        dependency: "variable",
        wanted_dependency: format!("1 to {}", description.variables.len()),
        find: &|index| description.at(index).map(|v| v.name.as_str()),
    };
    let lists = [
        (Outputs, &structure.outputs),
        (Derivatives, &structure.derivatives),
        (InitialUnknowns, &structure.initial_unknowns),
    ];
    let lists = lists.map(|(list, unknowns)| (list, unknowns.iter().map(Listed::from).collect::<Vec<_>>()));
    for (list, unknowns) in &lists {
        check.numbers(*list, unknowns, &numbering);
    }
    let [(_, outputs), (_, derivatives), (_, initial_unknowns)] = &lists;
    let variables = description.variables.iter().enumerate();
    let wanted = variables.filter(|(_, v)| v.causality == Causality::Output).map(|(i, _)| index(i)).collect();
    check.complete("structure.outputs", Outputs, outputs, (&wanted, &wanted), &numbering);
    for (u, unknown) in derivatives.iter().enumerate() {
        let Some(variable) = description.at(unknown.number) else { continue };
        if variable.state().is_none() {
            check.no_derivative(u, &variable.name, "Derivatives");
        }
    }
    if description.model_exchange.is_some() {
        let wanted = description.derivatives().into_iter().map(index).collect();
        let all = (0..description.variables.len()).map(index).collect();
        check.complete("structure.states", Derivatives, derivatives, (&wanted, &all), &numbering);
    }
    let wanted = initial_unknowns_of(description, derivatives.iter().map(|unknown| unknown.number));
    check.complete(
        "structure.initial-unknowns",
        InitialUnknowns,
        initial_unknowns,
        (&wanted, &wanted),
        &numbering,
    );
    check.sorted(&structure.initial_unknowns);
    let inputs = description.variables.iter().any(|v| v.causality == Causality::Input);
    check.unsaid("Outputs", outputs, inputs);
}

#[cfg(feature = "read")]
impl<'a> From<&'a Unknown> for Listed<'a> {
    fn from(unknown: &'a Unknown) -> Self {
        Self {
            number: unknown.index,
            dependencies: unknown.dependencies.as_deref(),
            kinds: unknown.dependency_kinds.as_deref(),
        }
    }
}

impl Check<'_> {
    fn derivative(&mut self, v: usize, variable: &Variable, description: &ModelDescription) {
        let Some(index) = variable.state() else { return };
        let message = match description.at(index) {
            None => {
                let most = description.variables.len();
                format!("derivative is {index}; must be the index of a variable, 1 to {most}")
            }
            Some(Variable { kind: VariableKind::Real(_), variability: Variability::Continuous, .. }) => {
                return;
            }
            Some(state) => {
                format!("derivative names {:?}, which is not a continuous Real", brief(&state.name))
            }
        };
        self.add("variable.derivative", Place::Variable(v), message);
    }

    #[cfg(feature = "read")]
    fn sorted(&mut self, unknowns: &[Unknown]) {
        let mut before = 0;
        for (u, unknown) in unknowns.iter().enumerate() {
            let (after, place) = (unknown.index, Place::Unknown(UnknownList::InitialUnknowns, u));
            if self.is_unread(place, "index") {
                continue;
            }
            if before > after {
                let message =
                    format!("InitialUnknowns has index {after} after {before}; must be sorted by index");
                self.add("structure.order", place, message);
                return;
            }
            before = after;
        }
    }

    fn aliases(&mut self, variables: &[Variable]) {
        let mut first: HashMap<(BaseType, u32), &Variable> = HashMap::new();
        let mut set: HashMap<(BaseType, u32), &Variable> = HashMap::new();
        for (v, variable) in variables.iter().enumerate() {
            let place = Place::Variable(v);
            if self.is_unread(place, "valueReference") {
                continue;
            }
            let reference = variable.value_reference;
            let key = (variable.kind.base_type(), reference);
            let Some(other) = first.get(&key) else {
                first.insert(key, variable);
                if is_settable(variable) {
                    set.insert(key, variable);
                }
                continue;
            };
            let with = format!("has the value reference {reference} of {:?}", brief(&other.name));
            if is_settable(variable)
                && let Some(setter) = set.insert(key, variable)
            {
                let message = format!(
                    "has the value reference {reference} of {:?}, and both can be set; of all {} variables with one \
                     value reference at most one may be a parameter or an input",
                    brief(&setter.name),
                    variable.kind.scalar_type().as_str()
                );
                self.add("variable.alias-set", place, message);
            }
            if let (Some(a), Some(b)) = (other.kind.start_number(), variable.kind.start_number())
                && a != b
            {
                let message = format!("{with}, so both are one, but starts at {b} and the other at {a}");
                self.add("variable.alias", Place::Start(v), message);
            }
            if let (Some(a), Some(b)) = (other.kind.unit(), variable.kind.unit())
                && a != b
            {
                let message = format!("{with}, so both are one, but its unit is {b:?} and the other's {a:?}");
                self.add("variable.alias", place, message);
            }
        }
    }
}

/// Whether an importer can set the variable.
fn is_settable(variable: &Variable) -> bool {
    matches!(variable.causality, Causality::Parameter | Causality::Input)
}
