//! Rules on `ModelStructure` (FMI 2.0.4, section 2.2.8). Indices count from 1.

use super::{Check, Place, UnknownList, brief};
use crate::structure::index;
use crate::{Causality, Initial, ModelStructure, Real, Unknown, Variable, VariableKind};
use std::collections::{BTreeSet, HashSet};

/// Most names shown of a longer list.
const SHOWN: usize = 8;

pub(super) fn check(check: &mut Check<'_>, structure: &ModelStructure) {
    use UnknownList::{Derivatives, InitialUnknowns, Outputs};
    for (list, unknowns) in [
        (Outputs, &structure.outputs),
        (Derivatives, &structure.derivatives),
        (InitialUnknowns, &structure.initial_unknowns),
    ] {
        check.indices(list, unknowns);
    }
    let variables = check.description.variables.iter().enumerate();
    let outputs =
        variables.filter(|(_, v)| v.causality == Causality::Output).map(|(i, _)| index(i)).collect();
    check.complete("structure.outputs", Outputs, &structure.outputs, &outputs);
    check.derivatives(&structure.derivatives);
    let wanted = check.initial_unknowns(&structure.derivatives);
    check.complete("structure.initial-unknowns", InitialUnknowns, &structure.initial_unknowns, &wanted);
    check.sorted(&structure.initial_unknowns);
    check.unsaid(&structure.outputs);
}

impl Check<'_> {
    fn indices(&mut self, list: UnknownList, unknowns: &[Unknown]) {
        let (description, name) = (self.description, list.as_str());
        let most = description.variables.len();
        for (u, unknown) in unknowns.iter().enumerate() {
            let place = Place::Unknown(list, u);
            if !self.is_unread(place, "index") && description.at(unknown.index).is_none() {
                let index = unknown.index;
                let message = format!("{name}: index is {index}; must be that of a variable, 1 to {most}");
                self.add("structure.index", place, message);
            }
            let readable = !self.is_unread(place, "dependencies");
            let dependencies = unknown.dependencies.as_deref().unwrap_or_default();
            for index in dependencies.iter().filter(|index| readable && description.at(**index).is_none()) {
                let message = format!("{name}: dependencies name variable {index}; must be 1 to {most}");
                self.add("structure.dependencies", place, message);
            }
            match (&unknown.dependencies, &unknown.dependency_kinds) {
                (None, Some(_)) => {
                    let message = format!("{name}: there is dependenciesKind, but no dependencies");
                    self.add("structure.dependencies", place, message);
                }
                (Some(list), Some(kinds)) if list.len() != kinds.len() => {
                    let (n, k) = (list.len(), kinds.len());
                    let message = format!(
                        "{name}: {n} dependencies, but {k} words in dependenciesKind; must be as many"
                    );
                    self.add("structure.dependencies", place, message);
                }
                _ => {}
            }
            if list == UnknownList::InitialUnknowns {
                for kind in unknown.dependency_kinds.iter().flatten() {
                    if !["dependent", "constant"].contains(&kind.as_str()) {
                        let message = format!(
                            "{name}: dependenciesKind {:?}; allowed here: dependent, constant",
                            brief(kind)
                        );
                        self.add("structure.dependencies", place, message);
                    }
                }
            }
        }
    }

    /// Checks that a list holds the variables wanted, each once, and no other.
    fn complete(
        &mut self,
        rule: &'static str,
        list: UnknownList,
        unknowns: &[Unknown],
        wanted: &BTreeSet<u32>,
    ) {
        let (description, name) = (self.description, list.as_str());
        let mut seen = HashSet::new();
        for (u, unknown) in unknowns.iter().enumerate() {
            let (index, place) = (unknown.index, Place::Unknown(list, u));
            let Some(variable) = description.at(index) else { continue };
            let variable = brief(&variable.name);
            if !seen.insert(index) {
                self.add(rule, place, format!("{name} lists {variable:?} (index {index}) twice"));
            } else if !wanted.contains(&index) {
                let message =
                    format!("{name} lists {variable:?} (index {index}), which does not belong there");
                self.add(rule, place, message);
            }
        }
        let missing: Vec<u32> = wanted.iter().copied().filter(|index| !seen.contains(index)).collect();
        if !missing.is_empty() {
            let names: Vec<_> = missing
                .iter()
                .take(SHOWN)
                .filter_map(|index| {
                    Some(format!("{:?} (index {index})", brief(&description.at(*index)?.name)))
                })
                .collect();
            let more = missing.len().saturating_sub(SHOWN);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            let message = format!("{name} does not list {}{more}", names.join(", "));
            self.add(rule, Place::Unknowns(list), message);
        }
    }

    fn derivatives(&mut self, unknowns: &[Unknown]) {
        for (u, unknown) in unknowns.iter().enumerate() {
            let Some(variable) = self.description.at(unknown.index) else { continue };
            if state_of(variable).is_none() {
                let message = format!(
                    "Derivatives lists {:?}, which has no attribute derivative",
                    brief(&variable.name)
                );
                self.add("structure.derivatives", Place::Unknown(UnknownList::Derivatives, u), message);
            }
        }
    }

    /// Outputs that are computed in initialization, calculated parameters, and states and derivatives computed
    /// then.
    fn initial_unknowns(&self, derivatives: &[Unknown]) -> BTreeSet<u32> {
        let description = self.description;
        let computed = |variable: &Variable| {
            matches!(variable.effective_initial(), Some(Initial::Approx | Initial::Calculated))
        };
        let variables = description.variables.iter().enumerate();
        let mut wanted: BTreeSet<u32> =
            variables.filter(|(_, v)| v.is_initial_unknown()).map(|(i, _)| index(i)).collect();
        for listed in derivatives.iter().map(|unknown| unknown.index) {
            let state = description.at(listed).and_then(state_of);
            for index in [Some(listed), state].into_iter().flatten() {
                if description.at(index).is_some_and(computed) {
                    wanted.insert(index);
                }
            }
        }
        wanted
    }

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

    fn unsaid(&mut self, outputs: &[Unknown]) {
        let inputs = self.description.variables.iter().any(|v| v.causality == Causality::Input);
        let unsaid = outputs.iter().filter(|unknown| unknown.dependencies.is_none()).count();
        if inputs && unsaid > 0 {
            let all = outputs.len();
            let message = format!(
                "{unsaid} of {all} Outputs have no dependencies, which means that they depend on every input; importers \
                 then see algebraic loops (dependencies=\"\" says: on none)"
            );
            self.add("structure.unsaid", Place::Unknowns(UnknownList::Outputs), message);
        }
    }
}

/// The index of the state that a variable is the derivative of.
fn state_of(variable: &Variable) -> Option<u32> {
    if let VariableKind::Real(Real { derivative, .. }) = variable.kind { derivative } else { None }
}
