//! What the standard says of a description beyond the schema (FMI 2.0.4, sections 2.2 and 4.3).

mod structure;
mod variables;

use std::collections::HashMap;

use punctual_modeldescription::is_c_identifier;

use super::finding::Findings;
use super::model::{Kind, Model};

/// Checks every rule.
pub(super) fn check(model: &Model<'_>, findings: &mut Findings) {
    interface(model, findings);
    experiment(model, findings);
    units(model, findings);
    types(model, findings);
    variables::check(model, findings);
    structure::check(model, findings);
}

fn interface(model: &Model<'_>, findings: &mut Findings) {
    if model.guid.is_some_and(|guid| guid.trim().is_empty()) {
        findings.add(
            "interface.guid",
            model.mark.clone(),
            "guid is empty; must be a text that no other FMU has",
        );
    }
    let Some(interface) = model.interface() else {
        let message = "there is no CoSimulation element; this program looks at co-simulation only";
        findings.add("interface.co-simulation", model.mark.clone(), message);
        return;
    };
    for other in &model.interfaces[1..] {
        findings.add(
            "interface.co-simulation",
            other.mark.clone(),
            "CoSimulation is there again; must be there once",
        );
    }
    if let Some(name) = interface.identifier.filter(|name| !is_c_identifier(name)) {
        let message = format!(
            "modelIdentifier is {name:?}; must be a C identifier (letters, digits, underscores, no digit first), \
             since it names the library"
        );
        findings.add("interface.identifier", interface.mark.clone(), message);
    }
    if interface.serialise_state && !interface.get_and_set_state {
        let message = "canSerializeFMUstate is true, so canGetAndSetFMUstate must be true; it is false";
        findings.add("interface.flags", interface.mark.clone(), message);
    }
}

fn experiment(model: &Model<'_>, findings: &mut Findings) {
    let Some(experiment) = &model.experiment else { return };
    let mut complain = |message: String| findings.add("experiment.times", experiment.mark.clone(), message);
    let named = [("startTime", experiment.start), ("stopTime", experiment.stop)];
    for (name, value) in named {
        if let Some(value) = value.filter(|value| !value.is_finite()) {
            complain(format!("{name} is {value}; must be finite"));
        }
    }
    let start = experiment.start.unwrap_or(0.0);
    if let Some(stop) = experiment.stop.filter(|stop| *stop <= start) {
        complain(format!("stopTime is {stop}; must be greater than startTime = {start}"));
    }
    for (name, value) in [("stepSize", experiment.step), ("tolerance", experiment.tolerance)] {
        if let Some(value) = value.filter(|value| !value.is_finite() || *value <= 0.0) {
            complain(format!("{name} is {value}; must be finite and > 0"));
        }
    }
}

fn units(model: &Model<'_>, findings: &mut Findings) {
    let mut seen = HashMap::new();
    for unit in &model.units {
        if seen.insert(unit.name, ()).is_some() {
            let message = format!("the unit {:?} is defined twice", unit.name);
            findings.add("unit.unique", unit.mark.clone(), message);
        }
        let mut displayed = HashMap::new();
        for (name, mark) in &unit.display {
            if displayed.insert(*name, ()).is_some() {
                let message = format!("the unit {:?} has the display unit {name:?} twice", unit.name);
                findings.add("unit.unique", mark.clone(), message);
            }
        }
    }
}

fn types(model: &Model<'_>, findings: &mut Findings) {
    let variables: HashMap<&str, ()> = model.variables.iter().map(|v| (v.name, ())).collect();
    let units = variables::Units::new(model);
    let mut seen = HashMap::new();
    for declared in &model.types {
        let name = declared.name;
        if seen.insert(name, ()).is_some() {
            findings.add("type.unique", declared.mark.clone(), format!("the type {name:?} is defined twice"));
        }
        if variables.contains_key(name) {
            let message = format!("the type {name:?} has the name of a variable; names must differ");
            findings.add("type.unique", declared.mark.clone(), message);
        }
        units.check(declared.unit, declared.display_unit, &declared.mark, findings);
        if let (Some(min), Some(max)) = (declared.min, declared.max)
            && (min.is_nan() || max.is_nan() || min > max)
        {
            let message = format!("the type {name:?} has min = {min} and max = {max}; must be min <= max");
            findings.add("variable.range", declared.mark.clone(), message);
        }
        if declared.kind == Some(Kind::Enumeration) {
            let (mut names, mut values) = (HashMap::new(), HashMap::new());
            for (item, value, mark) in &declared.items {
                if names.insert(*item, ()).is_some() {
                    let message = format!("the type {name:?} has the item {item:?} twice");
                    findings.add("type.items", mark.clone(), message);
                }
                if let Some(other) = value.and_then(|value| values.insert(value, *item)) {
                    let value = value.unwrap_or_default();
                    let message =
                        format!("the items {other:?} and {item:?} of {name:?} have the same value {value}");
                    findings.add("type.items", mark.clone(), message);
                }
            }
        }
    }
}
