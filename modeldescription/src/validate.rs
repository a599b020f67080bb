//! The rules of FMI 2.0.4 for a model description that the types do not enforce.
//!
//! The first violation found is reported. Dependencies are checked where they are translated, in
//! `structure`.

use crate::calendar::is_utc_instant;
use crate::names::{forbidden_character, is_c_identifier, is_one_line, is_structured_name};
use crate::number::Number;
use crate::structure::Structure;
use crate::{
    BaseType, Causality, DefaultExperiment, EnumerationType, Error, InitialRule, ModelDescription,
    NamingConvention, Variability, Variable, VariableKind,
};
use std::collections::{HashMap, HashSet};
use std::fmt::Display;

impl ModelDescription {
    /// Checks every rule that [`to_xml`](Self::to_xml) checks.
    ///
    /// # Errors
    ///
    /// - A required text is empty, a text has a character that XML 1.0 cannot carry, or a text of one
    ///   line has a line break or tab.
    /// - A model identifier is not a C identifier, a date not in UTC, a name not of the convention.
    /// - Names of variables, types, items, units or log categories, or value references of one base
    ///   type, are not unique; a variable is named like a type.
    /// - Causality, variability, initial and type do not go together.
    /// - A start value is missing, superfluous, out of range or not finite; a range is empty.
    /// - A unit, a type or a dependency does not exist.
    /// - A state can be serialised but not got and set.
    /// - An experiment has a stop before its start, or a step or tolerance that is not positive.
    pub fn validate(&self) -> Result<(), Error> {
        header(self)?;
        units(self)?;
        enumerations(self)?;
        let categories: Vec<_> = self.log_categories.iter().map(|c| c.name.as_str()).collect();
        unique_names("log_categories", &categories)?;
        for category in &self.log_categories {
            text(format!("log_categories[{:?}].description", category.name), &category.description)?;
        }
        if let Some(experiment) = &self.default_experiment {
            default_experiment(experiment)?;
        }
        variables(self)?;
        Structure::of(self).map(drop)
    }
}

/// The path of a field of a variable in an error.
pub(crate) fn variable_path(variable: &Variable, field: &str) -> String {
    format!("variables[{:?}].{field}", variable.name)
}

fn header(description: &ModelDescription) -> Result<(), Error> {
    required("model_name", &description.model_name)?;
    required("guid", &description.guid)?;
    line("guid", &description.guid)?;
    text("model_name", &description.model_name)?;
    text("description", &description.description)?;
    text("author", &description.author)?;
    line("version", &description.version)?;
    text("copyright", &description.copyright)?;
    text("license", &description.license)?;
    line("generation_tool", &description.generation_tool)?;
    if let Some(instant) = &description.generation_date_and_time
        && !is_utc_instant(instant)
    {
        let allowed = "an instant in UTC as YYYY-MM-DDThh:mm:ssZ";
        return Err(Error::invalid("generation_date_and_time", format!("{instant:?}"), allowed));
    }
    let slave = &description.co_simulation;
    if !is_c_identifier(&slave.model_identifier) {
        let value = format!("{:?}", slave.model_identifier);
        let allowed = "a C identifier: ASCII letters, digits and underscores, no digit first";
        return Err(Error::invalid("co_simulation.model_identifier", value, allowed));
    }
    if slave.can_serialize_state && !slave.can_get_and_set_state {
        let allowed = "false unless can_get_and_set_state is true";
        return Err(Error::invalid("co_simulation.can_serialize_state", true, allowed));
    }
    Ok(())
}

fn units(description: &ModelDescription) -> Result<(), Error> {
    let names: Vec<_> = description.units.iter().map(|unit| unit.name.as_str()).collect();
    unique_names("units", &names)?;
    for unit in &description.units {
        let path = |field: &str| format!("units[{:?}].base.{field}", unit.name);
        positive(path("factor"), unit.base.factor)?;
        finite(path("offset"), unit.base.offset)?;
    }
    Ok(())
}

fn enumerations(description: &ModelDescription) -> Result<(), Error> {
    let names: Vec<_> = description.enumerations.iter().map(|e| e.name.as_str()).collect();
    unique_names("enumerations", &names)?;
    for enumeration in &description.enumerations {
        let path = |field: &str| format!("enumerations[{:?}].{field}", enumeration.name);
        text(path("description"), &enumeration.description)?;
        if enumeration.items.is_empty() {
            return Err(Error::invalid(path("items"), "empty", "at least one item"));
        }
        let items: Vec<_> = enumeration.items.iter().map(|item| item.name.as_str()).collect();
        unique_names(&path("items"), &items)?;
        let mut values = HashMap::new();
        for item in &enumeration.items {
            let path = |field: &str| path(&format!("items[{:?}].{field}", item.name));
            text(path("description"), &item.description)?;
            if let Some(other) = values.insert(item.value, &item.name) {
                return Err(Error::invalid(path("value"), item.value, format!("not the one of {other:?}")));
            }
        }
    }
    Ok(())
}

fn default_experiment(experiment: &DefaultExperiment) -> Result<(), Error> {
    finite("default_experiment.start_time", experiment.start_time)?;
    if let Some(stop) = experiment.stop_time
        && !(stop.is_finite() && stop > experiment.start_time)
    {
        let allowed = format!("finite and greater than {}", Number(experiment.start_time));
        return Err(Error::invalid("default_experiment.stop_time", Number(stop), allowed));
    }
    experiment.step_size.map_or(Ok(()), |h| positive("default_experiment.step_size", h))?;
    experiment.tolerance.map_or(Ok(()), |t| positive("default_experiment.tolerance", t))
}

fn variables(description: &ModelDescription) -> Result<(), Error> {
    if description.variables.is_empty() {
        return Err(Error::invalid("variables", "empty", "at least one variable"));
    }
    let names: Vec<_> = description.variables.iter().map(|v| v.name.as_str()).collect();
    unique_names("variables", &names)?;
    let types: HashSet<_> = description.enumerations.iter().map(|e| e.name.as_str()).collect();
    let mut references = HashMap::<(BaseType, u32), &str>::new();
    let mut independent = None;
    for (position, variable) in description.variables.iter().enumerate() {
        let name = variable.name.as_str();
        let path = |field| variable_path(variable, field);
        let name_path = || format!("variables[{position}].name");
        if types.contains(name) {
            return Err(Error::invalid(name_path(), format!("{name:?}"), "not the name of a type"));
        }
        if description.variable_naming_convention == NamingConvention::Structured && !is_structured_name(name)
        {
            let allowed = "a structured name such as a, a.b[1] or der(a)";
            return Err(Error::invalid(name_path(), format!("{name:?}"), allowed));
        }
        let base_type = variable.kind.base_type();
        if let Some(other) = references.insert((base_type, variable.value_reference), name) {
            let value = format!("{} ({base_type:?})", variable.value_reference);
            return Err(Error::invalid(path("value_reference"), value, format!("not the one of {other:?}")));
        }
        if variable.causality == Causality::Independent
            && let Some(other) = independent.replace(name)
        {
            let allowed = format!("not independent, as {other:?} already is");
            return Err(Error::invalid(path("causality"), "independent", allowed));
        }
        text(path("description"), &variable.description)?;
        combination(variable)?;
        start_presence(variable)?;
        kind(description, variable)?;
    }
    Ok(())
}

/// Causality, variability, initial and type go together.
fn combination(variable: &Variable) -> Result<(), Error> {
    let (causality, variability) = (variable.causality, variable.variability);
    let path = |field| variable_path(variable, field);
    let Some(rule) = InitialRule::of(causality, variability) else {
        use Variability::{Constant, Continuous, Discrete, Fixed, Tunable};
        let legal: Vec<_> = [Constant, Fixed, Tunable, Discrete, Continuous]
            .into_iter()
            .filter(|v| InitialRule::of(causality, *v).is_some())
            .map(Variability::as_str)
            .collect();
        let allowed = format!("{} for causality {}", legal.join(" or "), causality.as_str());
        return Err(Error::invalid(path("variability"), variability.as_str(), allowed));
    };
    if let Some(initial) = variable.initial
        && !rule.allowed.contains(&initial)
    {
        let legal: Vec<_> = rule.allowed.iter().map(|i| i.as_str()).collect();
        let legal = if legal.is_empty() { "nothing".to_owned() } else { legal.join(" or ") };
        let allowed = format!("{legal} for {} {}", variability.as_str(), causality.as_str());
        return Err(Error::invalid(path("initial"), initial.as_str(), allowed));
    }
    if variability == Variability::Continuous && variable.kind.base_type() != BaseType::Real {
        let allowed = "not continuous, as the variable is not Real";
        return Err(Error::invalid(path("variability"), variability.as_str(), allowed));
    }
    Ok(())
}

/// A start value is there exactly if causality and initial ask for one.
fn start_presence(variable: &Variable) -> Result<(), Error> {
    let path = || variable_path(variable, "start");
    let why = match variable.effective_initial() {
        Some(initial) => format!("initial is {}", initial.as_str()),
        None => format!("causality is {}", variable.causality.as_str()),
    };
    match (variable.needs_start(), variable.kind.has_start()) {
        (true, false) => Err(Error::invalid(path(), "missing", format!("a value, as {why}"))),
        (false, true) => Err(Error::invalid(path(), "given", format!("nothing, as {why}"))),
        _ => Ok(()),
    }
}

/// What depends on the type: range, start value, unit, declared type.
fn kind(description: &ModelDescription, variable: &Variable) -> Result<(), Error> {
    let path = |field| variable_path(variable, field);
    match &variable.kind {
        VariableKind::Real { start, min, max, nominal, quantity, unit } => {
            bound(path("min"), *min, f64::NEG_INFINITY)?;
            bound(path("max"), *max, f64::INFINITY)?;
            range(variable, start.map(Number), min.map(Number), max.map(Number))?;
            if let Some(start) = start
                && !(start.is_finite() || (start.is_infinite() && [*min, *max].contains(&Some(*start))))
            {
                let allowed = "finite, or infinite where the bound on that side is";
                return Err(Error::invalid(path("start"), Number(*start), allowed));
            }
            nominal.map_or(Ok(()), |nominal| positive(path("nominal"), nominal))?;
            quantity.as_deref().map_or(Ok(()), |quantity| line(path("quantity"), quantity))?;
            match unit {
                Some(name) if !description.units.iter().any(|unit| unit.name == *name) => {
                    let value = format!("{name:?}");
                    Err(Error::invalid(path("unit"), value, "the name of one of the description's units"))
                }
                _ => Ok(()),
            }
        }
        VariableKind::Integer { start, min, max } => range(variable, *start, *min, *max),
        VariableKind::Boolean { .. } => Ok(()),
        VariableKind::String { start } => start.as_deref().map_or(Ok(()), |start| text(path("start"), start)),
        VariableKind::Enumeration { declared_type, start } => {
            let Some(declared) = description.enumerations.iter().find(|e| e.name == *declared_type) else {
                let allowed = "the name of one of the description's enumerations";
                return Err(Error::invalid(path("declared_type"), format!("{declared_type:?}"), allowed));
            };
            start.map_or(Ok(()), |start| item(path("start"), start, declared))
        }
    }
}

fn item(path: String, start: i32, declared: &EnumerationType) -> Result<(), Error> {
    if declared.items.iter().any(|item| item.value == start) {
        return Ok(());
    }
    let values: Vec<_> = declared.items.iter().map(|item| item.value.to_string()).collect();
    Err(Error::invalid(path, start, format!("one of {} (items of {:?})", values.join(", "), declared.name)))
}

/// `min <= max`, and `start` between them; NaN is between nothing.
fn range<T: PartialOrd + Display + Copy>(
    variable: &Variable,
    start: Option<T>,
    min: Option<T>,
    max: Option<T>,
) -> Result<(), Error> {
    let path = |field| variable_path(variable, field);
    if let (Some(min), Some(max)) = (min, max)
        && min > max
    {
        return Err(Error::invalid(path("max"), max, format!("at least {min}, the min")));
    }
    let Some(start) = start else { return Ok(()) };
    if min.is_none_or(|min| min <= start) && max.is_none_or(|max| start <= max) {
        return Ok(());
    }
    let allowed = match (min, max) {
        (Some(min), Some(max)) => format!("{min} to {max}"),
        (Some(min), None) => format!("at least {min}"),
        (None, Some(max)) => format!("at most {max}"),
        (None, None) => return Ok(()),
    };
    Err(Error::invalid(path("start"), start, allowed))
}

fn bound(path: String, value: Option<f64>, infinity: f64) -> Result<(), Error> {
    match value {
        Some(x) if !(x.is_finite() || x == infinity) => {
            Err(Error::invalid(path, Number(x), format!("finite or {}", Number(infinity))))
        }
        _ => Ok(()),
    }
}

fn positive(path: impl Into<String>, value: f64) -> Result<(), Error> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(Error::invalid(path, Number(value), "finite and greater than 0"))
}

fn finite(path: impl Into<String>, value: f64) -> Result<(), Error> {
    if value.is_finite() { Ok(()) } else { Err(Error::invalid(path, Number(value), "finite")) }
}

/// Names in one list: not empty, one line, no two equal.
fn unique_names(list: &str, names: &[&str]) -> Result<(), Error> {
    let mut positions = HashMap::new();
    for (position, name) in names.iter().enumerate() {
        let path = || format!("{list}[{position}].name");
        required(path(), name)?;
        line(path(), name)?;
        if let Some(first) = positions.insert(name, position) {
            let allowed = format!("unique, but {list}[{first}] has the same");
            return Err(Error::invalid(path(), format!("{name:?}"), allowed));
        }
    }
    Ok(())
}

fn required(path: impl Into<String>, value: &str) -> Result<(), Error> {
    if value.is_empty() { Err(Error::invalid(path, "\"\"", "a non-empty text")) } else { Ok(()) }
}

fn text(path: impl Into<String>, value: &str) -> Result<(), Error> {
    match forbidden_character(value) {
        Some(c) => {
            let value = format!("{value:?}");
            Err(Error::invalid(path, value, format!("characters of XML 1.0, not U+{:04X}", u32::from(c))))
        }
        None => Ok(()),
    }
}

fn line(path: impl Into<String>, value: &str) -> Result<(), Error> {
    let path = path.into();
    if !is_one_line(value) {
        return Err(Error::invalid(path, format!("{value:?}"), "one line without tabs"));
    }
    text(path, value)
}
