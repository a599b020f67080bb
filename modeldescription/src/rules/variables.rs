//! Rules on variables, one by one and among each other (FMI 2.0.4, section 2.2.7).

use super::{Check, Place, brief};
use crate::{
    BaseType, Causality, Initial, InitialRule, ModelDescription, ScalarType, SimpleType, Variability,
    Variable, VariableKind, is_structured_name,
};
use std::collections::{HashMap, HashSet};

/// The units defined, with their display units.
pub(super) struct Units<'a>(HashMap<&'a str, HashSet<&'a str>>);

impl<'a> Units<'a> {
    pub(super) fn new(description: &'a ModelDescription) -> Self {
        let display = |unit: &'a crate::Unit| unit.display_units.iter().map(|d| d.name.as_str()).collect();
        Self(description.units.iter().map(|unit| (unit.name.as_str(), display(unit))).collect())
    }

    pub(super) fn check(
        &self,
        unit: Option<&str>,
        display: Option<&str>,
        place: Place,
        check: &mut Check<'_>,
    ) {
        let known = unit.and_then(|unit| self.0.get(unit));
        if let Some(unit) = unit.filter(|_| known.is_none()) {
            let message = format!("the unit {:?} is not among UnitDefinitions", brief(unit));
            check.add("unit.defined", place, message);
            return;
        }
        let Some(display) = display else { return };
        match (unit, known) {
            (Some(unit), Some(known)) if !known.contains(display) => {
                let message = format!("the unit {unit:?} has no display unit {:?}", brief(display));
                check.add("unit.defined", place, message);
            }
            (None, _) => {
                let message = format!("there is a display unit {:?}, but no unit", brief(display));
                check.add("unit.defined", place, message);
            }
            _ => {}
        }
    }
}

/// Declared types by name, each with its position.
type Types<'a> = HashMap<&'a str, (usize, &'a SimpleType)>;

impl Check<'_> {
    pub(super) fn variables(&mut self) {
        let description = self.description;
        let units = Units::new(description);
        let types: Types<'_> =
            description.types.iter().enumerate().map(|(t, of)| (of.name.as_str(), (t, of))).collect();
        let mut names: HashMap<&str, usize> = HashMap::new();
        let mut independent = None;
        for (v, variable) in description.variables.iter().enumerate() {
            let place = Place::Variable(v);
            if let Some(other) = names.insert(&variable.name, v + 1) {
                let name = brief(&variable.name);
                let message = format!("the name {name:?} is also that of variable {other} (from 1)");
                self.add("variable.unique", place, message);
            }
            self.name(v, variable);
            self.combination(v, variable);
            self.start(v, variable);
            let declared = self.declared_type(v, variable, &types);
            self.range(v, variable, declared);
            let unit = variable.kind.unit().or_else(|| declared.and_then(|of| of.kind.unit()));
            units.check(unit, variable.kind.display_unit(), place, self);
            self.derivative(v, variable);
            if variable.causality == Causality::Independent {
                if let Some(other) = independent.replace(variable.name.as_str()) {
                    let message = format!("{other:?} is independent too; at most one variable may be");
                    self.add("variable.independent", place, message);
                }
                let found = variable.kind.scalar_type();
                if found != ScalarType::Real {
                    let message = format!("the independent variable is {}; must be Real", found.as_str());
                    self.add("variable.independent", place, message);
                }
            }
        }
        self.aliases();
    }

    fn name(&mut self, v: usize, variable: &Variable) {
        let name = variable.name.as_str();
        let wrong = if name.is_empty() {
            "is empty"
        } else if name.contains(['\t', '\n', '\r']) {
            "holds a tab or a line break"
        } else if self.is_structured() && !is_structured_name(name) {
            "does not follow variableNamingConvention = structured: identifiers such as a.b[1,2].'c d' or der(x)"
        } else {
            return;
        };
        self.add("variable.name", Place::Variable(v), format!("the name {:?} {wrong}", brief(name)));
    }

    fn combination(&mut self, v: usize, variable: &Variable) {
        let (causality, variability) = (variable.causality, variable.variability);
        let (place, of) = (Place::Variable(v), variable.kind.scalar_type());
        let pair = format!("causality = {} with variability = {}", causality.as_str(), variability.as_str());
        if variability == Variability::Continuous && of != ScalarType::Real {
            let said = "(which is the default)";
            let message = format!("{} variables cannot have variability = continuous {said}", of.as_str());
            self.add("variable.continuous", place, message);
            return;
        }
        let Some(rule) = InitialRule::of(causality, variability) else {
            let legal: Vec<_> = Variability::ALL
                .iter()
                .filter(|v| InitialRule::of(causality, **v).is_some())
                .map(|v| v.as_str())
                .collect();
            let message = format!("{pair} is not allowed; allowed variability: {}", legal.join(", "));
            self.add("variable.combination", place, message);
            return;
        };
        if let Some(initial) = variable.initial.filter(|initial| !rule.allowed.contains(initial)) {
            let allowed: Vec<_> = rule.allowed.iter().map(|initial| initial.as_str()).collect();
            let allowed = if allowed.is_empty() { "none".to_owned() } else { allowed.join(", ") };
            let message =
                format!("{pair} does not go with initial = {}; allowed: {allowed}", initial.as_str());
            self.add("variable.combination", place, message);
        }
    }

    fn start(&mut self, v: usize, variable: &Variable) {
        // An illegal combination is told already; further findings on it would be noise.
        let Some(rule) = InitialRule::of(variable.causality, variable.variability) else { return };
        if variable.initial.is_some_and(|initial| !rule.allowed.contains(&initial)) {
            return;
        }
        let because = match (variable.causality, variable.effective_initial()) {
            (Causality::Input, _) => "it is an input".to_owned(),
            (Causality::Independent, _) => "it is the independent variable".to_owned(),
            (_, initial) => format!("initial = {}", initial.map_or("", Initial::as_str)),
        };
        let given = variable.kind.has_start() || self.is_unread(Place::Start(v), "start");
        if variable.needs_start() && !given {
            let message = format!("has no start value; must have one, because {because}");
            self.add("variable.start", Place::Variable(v), message);
        }
        if !variable.needs_start() && given {
            let message = format!("has a start value; must have none, because {because}");
            self.add("variable.start", Place::Start(v), message);
        }
    }

    fn declared_type<'t>(
        &mut self,
        v: usize,
        variable: &Variable,
        types: &Types<'t>,
    ) -> Option<&'t SimpleType> {
        let name = variable.kind.declared_type()?;
        let Some(&(t, declared)) = types.get(name) else {
            let message = format!("declaredType {:?} is not among TypeDefinitions", brief(name));
            self.add("type.defined", Place::Variable(v), message);
            return None;
        };
        let (found, wanted) = (declared.kind.scalar_type(), variable.kind.scalar_type());
        if found != wanted && !self.is_unread(Place::Type(t), "type") {
            let (found, wanted) = (found.as_str(), wanted.as_str());
            let message = format!("declaredType {name:?} is a type of {found}; must be of {wanted}");
            self.add("type.defined", Place::Variable(v), message);
            return None;
        }
        Some(declared)
    }

    fn range(&mut self, v: usize, variable: &Variable, declared: Option<&SimpleType>) {
        let (own, given) = (variable.kind.range(), declared.map(|of| of.kind.range()).unwrap_or_default());
        let min = own.0.or(given.0).unwrap_or(f64::NEG_INFINITY);
        let max = own.1.or(given.1).unwrap_or(f64::INFINITY);
        if min.is_nan() || max.is_nan() || min > max {
            let message = format!("has min = {min} and max = {max}; must be min <= max");
            self.add("variable.range", Place::Variable(v), message);
            return;
        }
        let Some(start) = variable.kind.start_number() else { return };
        if start.is_nan() || start < min || start > max {
            let message = format!("start is {start}; must be in [{min}, {max}]");
            self.add("variable.range", Place::Start(v), message);
        }
        if let (VariableKind::Enumeration(_), Some(declared)) = (&variable.kind, declared)
            && !declared.items.iter().any(|item| f64::from(item.value) == start)
        {
            let items: Vec<_> =
                declared.items.iter().take(20).map(|item| format!("{} {}", item.value, item.name)).collect();
            let message =
                format!("start is {start}; must be a value of {}: {}", declared.name, items.join(", "));
            self.add("variable.enumeration", Place::Start(v), message);
        }
    }

    fn derivative(&mut self, v: usize, variable: &Variable) {
        let VariableKind::Real(crate::Real { derivative: Some(index), .. }) = variable.kind else { return };
        let message = match self.description.at(index) {
            None => {
                let most = self.description.variables.len();
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

    fn aliases(&mut self) {
        let mut first: HashMap<(BaseType, u32), &Variable> = HashMap::new();
        let mut set: HashMap<(BaseType, u32), &Variable> = HashMap::new();
        for (v, variable) in self.description.variables.iter().enumerate() {
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

/// Whether an importer sets the variable.
fn is_settable(variable: &Variable) -> bool {
    matches!(variable.causality, Causality::Parameter | Causality::Input)
}
