//! Rules on variables and declared types that both versions of the standard share (FMI 2.0.4, section 2.2.7;
//! FMI 3.0.2, section 2.4.7), and the properties that they need.

use super::{Check, Place, brief};
use crate::{Causality, Initial, InitialRule, Unit, Variability, is_structured_name};
use std::collections::{HashMap, HashSet};

/// The properties of a declared type that the rules need.
pub(crate) trait AnyType {
    fn name(&self) -> &str;
    /// The name of the type in the standard.
    fn type_name(&self) -> &'static str;
    fn unit(&self) -> Option<&str>;
    fn display_unit(&self) -> Option<&str>;
    /// Least and greatest value.
    fn range(&self) -> (Option<f64>, Option<f64>);
    /// Names and values of an enumeration.
    fn items(&self) -> Vec<(&str, i64)>;
}

/// The properties of a variable that the rules need.
pub(crate) trait AnyVariable {
    /// The floating-point types.
    const FLOATS: &'static str;
    /// A remark for a variable that is continuous but may not be.
    const CONTINUOUS: &'static str;

    fn name(&self) -> &str;
    fn causality(&self) -> Causality;
    fn variability(&self) -> Variability;
    fn initial(&self) -> Option<Initial>;
    /// With the default filled in.
    fn effective_initial(&self) -> Option<Initial>;
    /// The rule on `initial` for a pair; `None` if the pair is not legal.
    fn legal(&self, causality: Causality, variability: Variability) -> Option<InitialRule>;
    /// The name of the type in the standard.
    fn type_name(&self) -> &'static str;
    fn is_float(&self) -> bool;
    fn needs_start(&self) -> bool;
    fn has_start(&self) -> bool;
    /// The start values as numbers.
    fn starts(&self) -> Vec<f64>;
    /// The start values of an enumeration.
    fn chosen(&self) -> Vec<i64>;
    fn declared_type(&self) -> Option<&str>;
    fn unit(&self) -> Option<&str>;
    fn display_unit(&self) -> Option<&str>;
    fn range(&self) -> (Option<f64>, Option<f64>);
}

/// The units defined, with their display units.
pub(super) struct Units<'a>(HashMap<&'a str, HashSet<&'a str>>);

impl<'a> Units<'a> {
    pub(super) fn new(units: &'a [Unit]) -> Self {
        let display = |unit: &'a Unit| unit.display_units.iter().map(|d| d.name.as_str()).collect();
        Self(units.iter().map(|unit| (unit.name.as_str(), display(unit))).collect())
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

/// What variables can refer to, and what is known of the previous variables.
pub(super) struct Scope<'a, T> {
    pub(super) units: Units<'a>,
    /// Declared types by name, each with its index.
    types: HashMap<&'a str, (usize, &'a T)>,
    /// For each name, the number of the first variable that has it, from 1.
    names: HashMap<&'a str, usize>,
    independent: Option<&'a str>,
    structured: bool,
}

impl<'a, T: AnyType> Scope<'a, T> {
    pub(super) fn new(units: &'a [Unit], types: &'a [T], structured: bool) -> Self {
        Self {
            units: Units::new(units),
            types: types.iter().enumerate().map(|(t, of)| (of.name(), (t, of))).collect(),
            names: HashMap::new(),
            independent: None,
            structured,
        }
    }

    /// The unit of a variable, possibly that of its declared type.
    pub(super) fn unit_of<V: AnyVariable>(&self, variable: &'a V) -> Option<&'a str> {
        let declared = || variable.declared_type().and_then(|name| self.types.get(name));
        variable.unit().or_else(|| declared()?.1.unit())
    }

    /// Whether some previous variable was independent.
    pub(super) fn is_independent_known(&self) -> bool {
        self.independent.is_some()
    }
}

impl Check<'_> {
    pub(super) fn types<T: AnyType>(&mut self, types: &[T], units: &Units<'_>, variables: &HashSet<&str>) {
        let mut seen = HashSet::new();
        for (t, declared) in types.iter().enumerate() {
            let (name, place) = (declared.name(), Place::Type(t));
            if !seen.insert(name) {
                self.add("type.unique", place, format!("the type {name:?} is defined twice"));
            }
            if variables.contains(name) {
                let message = format!("the type {name:?} has the name of a variable; names must differ");
                self.add("type.unique", place, message);
            }
            units.check(declared.unit(), declared.display_unit(), place, self);
            if let (Some(min), Some(max)) = declared.range()
                && (min.is_nan() || max.is_nan() || min > max)
            {
                let message =
                    format!("the type {name:?} has min = {min} and max = {max}; must be min <= max");
                self.add("variable.range", place, message);
            }
            let (mut names, mut values) = (HashSet::new(), HashMap::new());
            for (i, (item, value)) in declared.items().into_iter().enumerate() {
                if !names.insert(item) {
                    let message = format!("the type {name:?} has the item {item:?} twice");
                    self.add("type.items", Place::Item(t, i), message);
                }
                if let Some(other) = values.insert(value, item) {
                    let message =
                        format!("the items {other:?} and {item:?} of {name:?} have the same value {value}");
                    self.add("type.items", Place::Item(t, i), message);
                }
            }
        }
    }

    /// Checks one variable, except for what only one version of the standard has.
    pub(super) fn variable<'a, V: AnyVariable, T: AnyType>(
        &mut self,
        v: usize,
        variable: &'a V,
        scope: &mut Scope<'a, T>,
    ) {
        let place = Place::Variable(v);
        self.name(place, v, variable.name(), scope);
        self.combination(v, variable);
        self.start(v, variable);
        let declared = self.declared_type(v, variable, scope);
        self.range(v, variable, declared);
        let unit = variable.unit().or_else(|| declared.and_then(AnyType::unit));
        scope.units.check(unit, variable.display_unit(), place, self);
        if variable.causality() == Causality::Independent {
            if let Some(other) = scope.independent.replace(variable.name()) {
                let message = format!("{other:?} is independent too; at most one variable may be");
                self.add("variable.independent", place, message);
            }
            if !variable.is_float() {
                let message =
                    format!("the independent variable is {}; must be {}", variable.type_name(), V::FLOATS);
                self.add("variable.independent", place, message);
            }
        }
    }

    /// Checks a name of the variable at an index; it may be an alias.
    pub(super) fn name<'a, T>(&mut self, place: Place, v: usize, name: &'a str, scope: &mut Scope<'a, T>) {
        if let Some(other) = scope.names.insert(name, v + 1) {
            let message = format!("the name {:?} is also that of variable {other} (from 1)", brief(name));
            self.add("variable.unique", place, message);
        }
        let wrong = if name.is_empty() {
            "is empty"
        } else if name.contains(['\t', '\n', '\r']) {
            "holds a tab or a line break"
        } else if scope.structured && !is_structured_name(name) {
            "does not follow variableNamingConvention = structured: identifiers such as a.b[1,2].'c d' or der(x)"
        } else {
            return;
        };
        self.add("variable.name", place, format!("the name {:?} {wrong}", brief(name)));
    }

    fn combination<V: AnyVariable>(&mut self, v: usize, variable: &V) {
        let (causality, variability) = (variable.causality(), variable.variability());
        let place = Place::Variable(v);
        let pair = format!("causality = {} with variability = {}", causality.as_str(), variability.as_str());
        if variability == Variability::Continuous && !variable.is_float() {
            let (of, said) = (variable.type_name(), V::CONTINUOUS);
            let message = format!("{of} variables cannot have variability = continuous{said}");
            self.add("variable.continuous", place, message);
            return;
        }
        let Some(rule) = variable.legal(causality, variability) else {
            let legal: Vec<_> = Variability::ALL
                .iter()
                .filter(|v| variable.legal(causality, **v).is_some())
                .map(|v| v.as_str())
                .collect();
            let legal = if legal.is_empty() { "none".to_owned() } else { legal.join(", ") };
            let message = format!("{pair} is not allowed; allowed variability: {legal}");
            self.add("variable.combination", place, message);
            return;
        };
        if let Some(initial) = variable.initial().filter(|initial| !rule.allowed.contains(initial)) {
            let allowed: Vec<_> = rule.allowed.iter().map(|initial| initial.as_str()).collect();
            let allowed = if allowed.is_empty() { "none".to_owned() } else { allowed.join(", ") };
            let message =
                format!("{pair} does not go with initial = {}; allowed: {allowed}", initial.as_str());
            self.add("variable.combination", place, message);
        }
    }

    fn start<V: AnyVariable>(&mut self, v: usize, variable: &V) {
        // An illegal combination has already been reported, and further findings on it would be noise.
        let Some(rule) = variable.legal(variable.causality(), variable.variability()) else { return };
        if variable.initial().is_some_and(|initial| !rule.allowed.contains(&initial)) {
            return;
        }
        let because = match (variable.causality(), variable.effective_initial()) {
            (Causality::Input, _) => "it is an input".to_owned(),
            (Causality::Independent, _) => "it is the independent variable".to_owned(),
            (_, initial) => format!("initial = {}", initial.map_or("", Initial::as_str)),
        };
        let given = variable.has_start() || self.is_unread(Place::Start(v), "start");
        if variable.needs_start() && !given {
            let message = format!("has no start value; must have one, because {because}");
            self.add("variable.start", Place::Variable(v), message);
        }
        if !variable.needs_start() && given {
            let message = format!("has a start value; must have none, because {because}");
            self.add("variable.start", Place::Start(v), message);
        }
    }

    fn declared_type<'t, V: AnyVariable, T: AnyType>(
        &mut self,
        v: usize,
        variable: &V,
        scope: &Scope<'t, T>,
    ) -> Option<&'t T> {
        let name = variable.declared_type()?;
        let Some(&(t, declared)) = scope.types.get(name) else {
            let message = format!("declaredType {:?} is not among TypeDefinitions", brief(name));
            self.add("type.defined", Place::Variable(v), message);
            return None;
        };
        let (found, wanted) = (declared.type_name(), variable.type_name());
        if found != wanted && !self.is_unread(Place::Type(t), "type") {
            let message = format!("declaredType {name:?} is a type of {found}; must be of {wanted}");
            self.add("type.defined", Place::Variable(v), message);
            return None;
        }
        Some(declared)
    }

    fn range<V: AnyVariable, T: AnyType>(&mut self, v: usize, variable: &V, declared: Option<&T>) {
        let (own, given) = (variable.range(), declared.map(AnyType::range).unwrap_or_default());
        let min = own.0.or(given.0).unwrap_or(f64::NEG_INFINITY);
        let max = own.1.or(given.1).unwrap_or(f64::INFINITY);
        if min.is_nan() || max.is_nan() || min > max {
            let message = format!("has min = {min} and max = {max}; must be min <= max");
            self.add("variable.range", Place::Variable(v), message);
            return;
        }
        let outside = |start: &f64| start.is_nan() || *start < min || *start > max;
        if let Some(start) = variable.starts().into_iter().find(outside) {
            let message = format!("start is {start}; must be in [{min}, {max}]");
            self.add("variable.range", Place::Start(v), message);
        }
        let Some(declared) = declared else { return };
        let items = declared.items();
        let is_item = |start: &i64| items.iter().any(|(_, value)| value == start);
        if let Some(start) = variable.chosen().into_iter().find(|start| !is_item(start)) {
            let items: Vec<_> =
                items.iter().take(20).map(|(name, value)| format!("{value} {name}")).collect();
            let message =
                format!("start is {start}; must be a value of {}: {}", declared.name(), items.join(", "));
            self.add("variable.enumeration", Place::Start(v), message);
        }
    }
}
