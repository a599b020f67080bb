//! Rules on `ModelStructure` (FMI 2.0.4, section 2.2.8). Indices count from 1.

use std::collections::{BTreeSet, HashSet};

use punctual_modeldescription::{Causality, Initial};

use crate::validate::finding::Findings;
use crate::validate::model::{Model, Unknowns};
use crate::validate::schema::brief;

/// Names shown of a longer list.
const SHOWN: usize = 8;

pub(super) fn check(model: &Model<'_>, findings: &mut Findings) {
    for (name, unknowns) in [
        ("Outputs", &model.outputs),
        ("Derivatives", &model.derivatives),
        ("InitialUnknowns", &model.initial_unknowns),
    ] {
        indices(model, name, unknowns, findings);
    }
    let outputs = model.variables.iter().enumerate().filter(|(_, v)| v.causality == Causality::Output);
    let outputs: BTreeSet<u32> = outputs.map(|(i, _)| index(i)).collect();
    complete(model, "structure.outputs", "Outputs", &model.outputs, &outputs, findings);
    derivatives(model, findings);
    let wanted = initial_unknowns(model);
    let rule = "structure.initial-unknowns";
    complete(model, rule, "InitialUnknowns", &model.initial_unknowns, &wanted, findings);
    sorted(model, findings);
    unsaid(model, findings);
}

fn index(position: usize) -> u32 {
    u32::try_from(position + 1).unwrap_or(u32::MAX)
}

fn indices(model: &Model<'_>, name: &str, unknowns: &Unknowns<'_>, findings: &mut Findings) {
    let most = model.variables.len();
    for unknown in &unknowns.list {
        if let Some(index) = unknown.index.filter(|index| model.at(*index).is_none()) {
            let message = format!("{name}: index is {index}; must be that of a variable, 1 to {most}");
            findings.add("structure.index", unknown.mark.clone(), message);
        }
        let dependencies = unknown.dependencies.as_deref().unwrap_or_default();
        for index in dependencies.iter().flatten().filter(|index| model.at(**index).is_none()) {
            let message = format!("{name}: dependencies name variable {index}; must be 1 to {most}");
            findings.add("structure.dependencies", unknown.mark.clone(), message);
        }
        match (&unknown.dependencies, &unknown.kinds) {
            (None, Some(_)) => {
                let message = format!("{name}: there is dependenciesKind, but no dependencies");
                findings.add("structure.dependencies", unknown.mark.clone(), message);
            }
            (Some(list), Some(kinds)) if list.len() != kinds.len() => {
                let (n, k) = (list.len(), kinds.len());
                let message =
                    format!("{name}: {n} dependencies, but {k} words in dependenciesKind; must be as many");
                findings.add("structure.dependencies", unknown.mark.clone(), message);
            }
            _ => {}
        }
        if name == "InitialUnknowns" {
            for kind in
                unknown.kinds.iter().flatten().filter(|kind| !["dependent", "constant"].contains(kind))
            {
                let message =
                    format!("{name}: dependenciesKind {:?}; allowed here: dependent, constant", brief(kind));
                findings.add("structure.dependencies", unknown.mark.clone(), message);
            }
        }
    }
}

/// Whether a list holds the variables wanted, each once, and no other.
fn complete(
    model: &Model<'_>,
    rule: &str,
    name: &str,
    unknowns: &Unknowns<'_>,
    wanted: &BTreeSet<u32>,
    findings: &mut Findings,
) {
    let mut seen = HashSet::new();
    for unknown in &unknowns.list {
        let Some(index) = unknown.index else { continue };
        let Some(variable) = model.at(index) else { continue };
        let variable = brief(variable.name);
        if !seen.insert(index) {
            let message = format!("{name} lists {variable:?} (index {index}) twice");
            findings.add(rule, unknown.mark.clone(), message);
        } else if !wanted.contains(&index) {
            let message = format!("{name} lists {variable:?} (index {index}), which does not belong there");
            findings.add(rule, unknown.mark.clone(), message);
        }
    }
    let missing: Vec<u32> = wanted.iter().copied().filter(|index| !seen.contains(index)).collect();
    if !missing.is_empty() {
        let names: Vec<_> = missing
            .iter()
            .take(SHOWN)
            .filter_map(|index| Some(format!("{:?} (index {index})", brief(model.at(*index)?.name))))
            .collect();
        let more = missing.len().saturating_sub(SHOWN);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        let message = format!("{name} does not list {}{more}", names.join(", "));
        findings.add(rule, unknowns.mark.clone(), message);
    }
}

fn derivatives(model: &Model<'_>, findings: &mut Findings) {
    for unknown in &model.derivatives.list {
        let Some(variable) = unknown.index.and_then(|index| model.at(index)) else { continue };
        if variable.derivative.is_none() {
            let message =
                format!("Derivatives lists {:?}, which has no attribute derivative", brief(variable.name));
            findings.add("structure.derivatives", unknown.mark.clone(), message);
        }
    }
}

/// Outputs that are computed in initialization, calculated parameters, and so states and derivatives.
fn initial_unknowns(model: &Model<'_>) -> BTreeSet<u32> {
    let computed = |initial: Option<Initial>| matches!(initial, Some(Initial::Approx | Initial::Calculated));
    let mut wanted = BTreeSet::new();
    for (position, variable) in model.variables.iter().enumerate() {
        let output = variable.causality == Causality::Output && computed(variable.effective_initial());
        if output || variable.causality == Causality::CalculatedParameter {
            wanted.insert(index(position));
        }
    }
    for listed in model.derivatives.list.iter().filter_map(|unknown| unknown.index) {
        let state = model.at(listed).and_then(|variable| variable.derivative);
        for index in [Some(listed), state].into_iter().flatten() {
            if model.at(index).is_some_and(|variable| computed(variable.effective_initial())) {
                wanted.insert(index);
            }
        }
    }
    wanted
}

fn sorted(model: &Model<'_>, findings: &mut Findings) {
    for pair in model.initial_unknowns.list.windows(2) {
        if let (Some(before), Some(after)) = (pair[0].index, pair[1].index)
            && before > after
        {
            let message =
                format!("InitialUnknowns has index {after} after {before}; must be sorted by index");
            findings.add("structure.order", pair[1].mark.clone(), message);
            return;
        }
    }
}

fn unsaid(model: &Model<'_>, findings: &mut Findings) {
    let inputs = model.variables.iter().any(|variable| variable.causality == Causality::Input);
    let unsaid = model.outputs.list.iter().filter(|unknown| unknown.dependencies.is_none()).count();
    if inputs && unsaid > 0 {
        let all = model.outputs.list.len();
        let message = format!(
            "{unsaid} of {all} Outputs have no dependencies, which means that they depend on every input; importers \
             then see algebraic loops (dependencies=\"\" says: on none)"
        );
        findings.add("structure.unsaid", model.outputs.mark.clone(), message);
    }
}
