//! Rules on variables, one by one and among each other (FMI 2.0.4, section 2.2.7).

use std::collections::{HashMap, HashSet};

use punctual_modeldescription::{BaseType, Causality, Initial, InitialRule, Variability, is_structured_name};

use crate::validate::finding::{Findings, Mark};
use crate::validate::model::{Kind, Model, SimpleType, Variable};
use crate::validate::schema::brief;

/// The units defined, with their display units.
pub(super) struct Units<'a>(HashMap<&'a str, HashSet<&'a str>>);

impl<'a> Units<'a> {
    pub(super) fn new(model: &Model<'a>) -> Self {
        let display = |unit: &crate::validate::model::Unit<'a>| unit.display.iter().map(|d| d.0).collect();
        Self(model.units.iter().map(|unit| (unit.name, display(unit))).collect())
    }

    pub(super) fn check(
        &self,
        unit: Option<&str>,
        display: Option<&str>,
        mark: &Mark,
        findings: &mut Findings,
    ) {
        let known = unit.and_then(|unit| self.0.get(unit));
        if let Some(unit) = unit.filter(|_| known.is_none()) {
            let message = format!("the unit {:?} is not among UnitDefinitions", brief(unit));
            findings.add("unit.defined", mark.clone(), message);
            return;
        }
        if let Some(display) = display {
            match (unit, known) {
                (Some(unit), Some(known)) if !known.contains(display) => {
                    let message = format!("the unit {unit:?} has no display unit {:?}", brief(display));
                    findings.add("unit.defined", mark.clone(), message);
                }
                (None, _) => {
                    let message = format!("there is a display unit {:?}, but no unit", brief(display));
                    findings.add("unit.defined", mark.clone(), message);
                }
                _ => {}
            }
        }
    }
}

pub(super) fn check(model: &Model<'_>, findings: &mut Findings) {
    let units = Units::new(model);
    let types: HashMap<&str, &SimpleType<'_>> = model.types.iter().map(|t| (t.name, t)).collect();
    let mut names: HashMap<&str, usize> = HashMap::new();
    let mut independent = None;
    for (index, variable) in model.variables.iter().enumerate() {
        if let Some(other) = names.insert(variable.name, index + 1) {
            let message =
                format!("the name {:?} is also that of variable {other} (from 1)", brief(variable.name));
            findings.add("variable.unique", variable.mark.clone(), message);
        }
        name(model, variable, findings);
        combination(variable, findings);
        start(variable, findings);
        let declared = declared_type(variable, &types, findings);
        range(variable, declared, findings);
        let unit = variable.unit.or_else(|| declared.and_then(|t| t.unit));
        units.check(unit, variable.display_unit, &variable.mark, findings);
        derivative(model, variable, findings);
        if variable.causality == Causality::Independent {
            if let Some(other) = independent.replace(variable.name) {
                let message = format!("{other:?} is independent too; at most one variable may be");
                findings.add("variable.independent", variable.mark.clone(), message);
            }
            if variable.kind != Kind::Real {
                let message = format!("the independent variable is {}; must be Real", variable.kind.name());
                findings.add("variable.independent", variable.mark.clone(), message);
            }
        }
    }
    aliases(model, findings);
}

fn name(model: &Model<'_>, variable: &Variable<'_>, findings: &mut Findings) {
    let name = variable.name;
    let wrong = if name.is_empty() {
        "is empty"
    } else if name.contains(['\t', '\n', '\r']) {
        "holds a tab or a line break"
    } else if model.structured && !is_structured_name(name) {
        "does not follow variableNamingConvention = structured: identifiers such as a.b[1,2].'c d' or der(x)"
    } else {
        return;
    };
    findings.add("variable.name", variable.mark.clone(), format!("the name {:?} {wrong}", brief(name)));
}

fn combination(variable: &Variable<'_>, findings: &mut Findings) {
    let (causality, variability) = (variable.causality, variable.variability);
    let pair = format!("causality = {} with variability = {}", causality.as_str(), variability.as_str());
    if variability == Variability::Continuous && variable.kind != Kind::Real {
        let said = "(which is the default)";
        let message =
            format!("{} variables cannot have variability = continuous {said}", variable.kind.name());
        findings.add("variable.continuous", variable.mark.clone(), message);
        return;
    }
    let Some(rule) = InitialRule::of(causality, variability) else {
        let all = [
            Variability::Constant,
            Variability::Fixed,
            Variability::Tunable,
            Variability::Discrete,
            Variability::Continuous,
        ];
        let legal: Vec<_> = all
            .into_iter()
            .filter(|v| InitialRule::of(causality, *v).is_some())
            .map(Variability::as_str)
            .collect();
        let message = format!("{pair} is not allowed; allowed variability: {}", legal.join(", "));
        findings.add("variable.combination", variable.mark.clone(), message);
        return;
    };
    if let Some(initial) = variable.initial.filter(|initial| !rule.allowed.contains(initial)) {
        let allowed: Vec<_> = rule.allowed.iter().map(|initial| initial.as_str()).collect();
        let allowed = if allowed.is_empty() { "none".to_owned() } else { allowed.join(", ") };
        let message = format!("{pair} does not go with initial = {}; allowed: {allowed}", initial.as_str());
        findings.add("variable.combination", variable.mark.clone(), message);
    }
}

fn start(variable: &Variable<'_>, findings: &mut Findings) {
    // An illegal combination is told already; what follows from it would be noise.
    let Some(rule) = InitialRule::of(variable.causality, variable.variability) else { return };
    if variable.initial.is_some_and(|initial| !rule.allowed.contains(&initial)) {
        return;
    }
    let initial = variable.effective_initial();
    let needed =
        variable.causality == Causality::Input || matches!(initial, Some(Initial::Exact | Initial::Approx));
    let because = match (variable.causality, initial) {
        (Causality::Input, _) => "it is an input".to_owned(),
        (Causality::Independent, _) => "it is the independent variable".to_owned(),
        (_, initial) => format!("initial = {}", initial.map_or("", Initial::as_str)),
    };
    if needed && variable.start.is_none() {
        let message = format!("has no start value; must have one, because {because}");
        findings.add("variable.start", variable.mark.clone(), message);
    }
    if !needed && variable.start.is_some() {
        let message = format!("has a start value; must have none, because {because}");
        findings.add("variable.start", variable.start_mark.clone(), message);
    }
}

fn declared_type<'t, 'a>(
    variable: &Variable<'_>,
    types: &HashMap<&str, &'t SimpleType<'a>>,
    findings: &mut Findings,
) -> Option<&'t SimpleType<'a>> {
    let name = variable.declared_type?;
    let Some(declared) = types.get(name).copied() else {
        let message = format!("declaredType {:?} is not among TypeDefinitions", brief(name));
        findings.add("type.defined", variable.mark.clone(), message);
        return None;
    };
    match declared.kind {
        Some(kind) if kind != variable.kind => {
            let (found, wanted) = (kind.name(), variable.kind.name());
            let message = format!("declaredType {name:?} is a type of {found}; must be of {wanted}");
            findings.add("type.defined", variable.mark.clone(), message);
            None
        }
        _ => Some(declared),
    }
}

fn range(variable: &Variable<'_>, declared: Option<&SimpleType<'_>>, findings: &mut Findings) {
    let min = variable.min.or_else(|| declared.and_then(|t| t.min)).unwrap_or(f64::NEG_INFINITY);
    let max = variable.max.or_else(|| declared.and_then(|t| t.max)).unwrap_or(f64::INFINITY);
    if min.is_nan() || max.is_nan() || min > max {
        let message = format!("has min = {min} and max = {max}; must be min <= max");
        findings.add("variable.range", variable.mark.clone(), message);
        return;
    }
    let Some(start) = variable.start_number() else { return };
    if start.is_nan() || start < min || start > max {
        let message = format!("start is {start}; must be in [{min}, {max}]");
        findings.add("variable.range", variable.start_mark.clone(), message);
    }
    if variable.kind == Kind::Enumeration
        && let Some(declared) = declared
        && !declared.items.iter().any(|(_, value, _)| value.map(f64::from) == Some(start))
    {
        let items: Vec<_> = declared
            .items
            .iter()
            .take(20)
            .filter_map(|(name, value, _)| Some(format!("{} {name}", (*value)?)))
            .collect();
        let message = format!("start is {start}; must be a value of {}: {}", declared.name, items.join(", "));
        findings.add("variable.enumeration", variable.start_mark.clone(), message);
    }
}

fn derivative(model: &Model<'_>, variable: &Variable<'_>, findings: &mut Findings) {
    let Some(index) = variable.derivative else { return };
    let complain = |findings: &mut Findings, message: String| {
        findings.add("variable.derivative", variable.mark.clone(), message);
    };
    match model.at(index) {
        None => {
            let most = model.variables.len();
            complain(
                findings,
                format!("derivative is {index}; must be the index of a variable, 1 to {most}"),
            );
        }
        Some(state) if state.kind != Kind::Real || state.variability != Variability::Continuous => {
            complain(
                findings,
                format!("derivative names {:?}, which is not a continuous Real", brief(state.name)),
            );
        }
        Some(_) => {}
    }
}

/// Whether an importer sets the variable.
fn is_settable(variable: &Variable<'_>) -> bool {
    matches!(variable.causality, Causality::Parameter | Causality::Input)
}

fn aliases(model: &Model<'_>, findings: &mut Findings) {
    let mut first: HashMap<(BaseType, u32), &Variable<'_>> = HashMap::new();
    let mut set: HashMap<(BaseType, u32), &Variable<'_>> = HashMap::new();
    for variable in &model.variables {
        let Some(reference) = variable.reference else { continue };
        let key = (variable.kind.base(), reference);
        let Some(other) = first.get(&key) else {
            first.insert(key, variable);
            if is_settable(variable) {
                set.insert(key, variable);
            }
            continue;
        };
        let with = format!("has the value reference {reference} of {:?}", brief(other.name));
        if is_settable(variable)
            && let Some(setter) = set.insert(key, variable)
        {
            let message = format!(
                "has the value reference {reference} of {:?}, and both can be set; of all {} variables with one value \
                 reference at most one may be a parameter or an input",
                brief(setter.name),
                variable.kind.name()
            );
            findings.add("variable.alias-set", variable.mark.clone(), message);
        }
        if let (Some(a), Some(b)) = (other.start_number(), variable.start_number())
            && a != b
        {
            let message = format!("{with}, so both are one, but starts at {b} and the other at {a}");
            findings.add("variable.alias", variable.start_mark.clone(), message);
        }
        if other.unit.is_some() && variable.unit.is_some() && other.unit != variable.unit {
            let (a, b) = (other.unit.unwrap_or_default(), variable.unit.unwrap_or_default());
            let message = format!("{with}, so both are one, but its unit is {b:?} and the other's {a:?}");
            findings.add("variable.alias", variable.mark.clone(), message);
        }
    }
}
