//! `ModelStructure` of FMI 3.0: computed variables and their dependencies, all by value reference (FMI 3.0.2,
//! section 2.4.8).

use super::Variable;
use crate::{Causality, UnknownList};
use serde::Serialize;

/// The content of `ModelStructure`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ModelStructure {
    /// All outputs.
    pub outputs: Vec<Unknown>,
    /// The derivatives of continuous states, in the order that the functions for continuous states use.
    pub derivatives: Vec<Unknown>,
    /// The states that change at clock ticks.
    pub clocked_states: Vec<Unknown>,
    /// The unknowns of initialization: outputs that are not exact, calculated parameters, and states and
    /// derivatives computed during initialization.
    pub initial_unknowns: Vec<Unknown>,
    /// The event indicators, for model exchange.
    pub event_indicators: Vec<Unknown>,
}

/// A computed variable and its dependencies, as value references.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Unknown {
    /// The value reference of the variable.
    #[serde(rename = "@valueReference")]
    pub value_reference: u32,
    /// The value references of its dependencies. `None` (the attribute is absent) means all, empty means
    /// none.
    #[serde(rename = "@dependencies", skip_serializing_if = "Option::is_none")]
    pub dependencies: Option<Vec<u32>>,
    /// The kind of each dependency, in the terms of the standard, if declared.
    #[serde(rename = "@dependenciesKind", skip_serializing_if = "Option::is_none")]
    pub dependency_kinds: Option<Vec<String>>,
}

impl Unknown {
    /// A variable without declared dependencies.
    pub fn new(value_reference: u32) -> Self {
        Self { value_reference, ..Self::default() }
    }
}

impl ModelStructure {
    /// The lists that follow from the variables, in their order. Each variable with `derivative` counts as
    /// the derivative of a continuous state, unless it or the state is an input. No dependencies are
    /// declared, and there are no clocked states and no event indicators.
    pub fn of(variables: &[Variable]) -> Self {
        let is_input = |reference: u32| {
            variables.iter().any(|v| v.value_reference == reference && v.causality == Causality::Input)
        };
        let is_derivative =
            |v: &&Variable| v.state().is_some_and(|state| !is_input(state) && !is_input(v.value_reference));
        let list = |of: Vec<&Variable>| of.iter().map(|v| Unknown::new(v.value_reference)).collect();
        let derivatives: Vec<&Variable> = variables.iter().filter(is_derivative).collect();
        let is_unknown = |v: &&Variable| {
            let of_state =
                |d: &&Variable| [Some(d.value_reference), d.state()].contains(&Some(v.value_reference));
            v.is_initial_unknown() || v.is_computed() && derivatives.iter().any(of_state)
        };
        Self {
            outputs: list(variables.iter().filter(|v| v.causality == Causality::Output).collect()),
            initial_unknowns: list(variables.iter().filter(is_unknown).collect()),
            derivatives: list(derivatives),
            ..Self::default()
        }
    }

    /// The list of this kind.
    pub fn list(&self, list: UnknownList) -> &[Unknown] {
        match list {
            UnknownList::Outputs => &self.outputs,
            UnknownList::Derivatives => &self.derivatives,
            UnknownList::ClockedStates => &self.clocked_states,
            UnknownList::InitialUnknowns => &self.initial_unknowns,
            UnknownList::EventIndicators => &self.event_indicators,
        }
    }
}
