//! Conditions on a description to be written: the rules of the standard ([`rules`](crate::rules)), those of
//! the XML schema, and a few of our own, such as that no two variables share their memory.
//!
//! The first violation found is reported. Dependencies are checked when they are translated, in `structure`.

use crate::calendar::is_utc_instant;
use crate::names::{forbidden_character, is_one_line};
use crate::rules::{Check, Place, Unread, Violation, fmi2};
use crate::variable::variable_path;
use crate::xml::Header;
use crate::xsd::Number;
use crate::{
    BaseType, EnumerationItem, Error, LogCategory, ModelDescription, Real, ScalarType, Unit, VariableKind,
};
use std::collections::HashMap;

impl ModelDescription {
    /// Checks every rule that [`to_xml`](Self::to_xml) checks.
    ///
    /// # Errors
    ///
    /// - A rule of [`RULES`](crate::RULES) on descriptions is broken.
    /// - A required text is empty, a text has a character that XML 1.0 cannot represent, or a text of one
    ///   line has a line break or tab.
    /// - A date is not in UTC; a factor of a base unit or a nominal value is not positive; a bound is NaN or
    ///   infinite on the wrong side; a start value is infinite without such a bound.
    /// - Value references of one base type are not unique.
    /// - There is no variable, or an enumeration has no items or no type.
    /// - A dependency does not exist.
    pub fn validate(&self) -> Result<(), Error> {
        let mut broken = None;
        let mut report = |violation: Violation| {
            // The check below refuses all aliases. A step may be longer than the experiment.
            if !(violation.rule.starts_with("variable.alias") || violation.rule == "experiment.step") {
                broken.get_or_insert(violation);
            }
        };
        fmi2::description(self, &mut Check { unread: &Unread::new(), report: &mut report });
        if let Some(Violation { rule, place, message }) = broken {
            let paths = Paths {
                interfaces: &["co_simulation"],
                units: &self.units,
                of_type: &|t| &self.types[t].name,
                of_variable: &|v| &self.variables[v].name,
            };
            return Err(Error::rule(rule, paths.of(place), message));
        }
        header("guid", &self.header())?;
        source_files(self)?;
        units(&self.units)?;
        if let Some(unit) = self.units.iter().find(|unit| unit.display_units.iter().any(|of| of.inverse)) {
            let path = format!("units[{:?}].display_units.inverse", unit.name);
            return Err(Error::invalid(path, true, "false, as FMI 2.0 has no inverse units"));
        }
        types(self)?;
        categories(&self.log_categories)?;
        variables(self)?;
        self.structure().map(drop)
    }
}

/// The names that the paths of places contain.
pub(crate) struct Paths<'a> {
    /// The interfaces; the last one applies to all further ones.
    pub(crate) interfaces: &'a [&'a str],
    pub(crate) units: &'a [Unit],
    /// The name of the declared type at an index.
    pub(crate) of_type: &'a dyn Fn(usize) -> &'a str,
    /// The name of the variable at an index.
    pub(crate) of_variable: &'a dyn Fn(usize) -> &'a str,
}

impl Paths<'_> {
    /// The path of a place in an error.
    pub(crate) fn of(&self, place: Place) -> String {
        let of_unit = |u: usize| format!("units[{:?}]", self.units[u].name);
        let of_type = |t: usize| format!("types[{:?}]", (self.of_type)(t));
        let of_variable = |v: usize| format!("variables[{:?}]", (self.of_variable)(v));
        match place {
            Place::Interface(i) => {
                self.interfaces.get(i).or(self.interfaces.last()).copied().unwrap_or_default().to_owned()
            }
            Place::ModelExchange => "model_exchange".to_owned(),
            Place::Experiment => "default_experiment".to_owned(),
            Place::Category(c) => format!("log_categories[{c}]"),
            Place::Unit(u) => of_unit(u),
            Place::DisplayUnit(u, d) => format!("{}.display_units[{d}]", of_unit(u)),
            Place::Type(t) => of_type(t),
            Place::Item(t, i) => format!("{}.items[{i}]", of_type(t)),
            Place::Variable(v) => of_variable(v),
            Place::Start(v) => format!("{}.start", of_variable(v)),
            Place::Alias(v, a) => format!("{}.aliases[{a}]", of_variable(v)),
            Place::Terminal(t) => format!("terminals[{t}]"),
            Place::Member(t, m) => format!("terminals[{t}].members[{m}]"),
            Place::Unknowns(list) => format!("structure.{}", list.as_str()),
            Place::Unknown(list, u) => format!("structure.{}[{u}]", list.as_str()),
            Place::Root => "description".to_owned(),
        }
    }
}

/// Checks the texts of the root; `token` is the path of the text that links description and library.
pub(crate) fn header(token: &str, header: &Header<'_>) -> Result<(), Error> {
    required("model_name", header.model_name)?;
    line(token, header.token.1)?;
    text("model_name", header.model_name)?;
    text("description", header.description)?;
    text("author", header.author)?;
    line("version", header.model_version)?;
    text("copyright", header.copyright)?;
    text("license", header.license)?;
    line("generation_tool", header.generation_tool)?;
    match header.generation_date_and_time {
        Some(instant) if !is_utc_instant(instant) => {
            let allowed = "an instant in UTC as YYYY-MM-DDThh:mm:ssZ";
            Err(Error::invalid("generation_date_and_time", format!("{instant:?}"), allowed))
        }
        _ => Ok(()),
    }
}

fn source_files(description: &ModelDescription) -> Result<(), Error> {
    let exchange = description.model_exchange.iter().flat_map(|of| &of.source_files);
    let exchange = exchange.map(|name| ("model_exchange.source_files", name));
    let co_simulation = description.co_simulation.source_files.iter();
    for (path, name) in exchange.chain(co_simulation.map(|name| ("co_simulation.source_files", name))) {
        required(path, name)?;
        line(path, name)?;
    }
    Ok(())
}

/// Checks the names and scales of units.
pub(crate) fn units(units: &[Unit]) -> Result<(), Error> {
    for (u, unit) in units.iter().enumerate() {
        name(format!("units[{u}].name"), &unit.name)?;
        let path = |field: &str| format!("units[{:?}].{field}", unit.name);
        if let Some(base) = unit.base {
            positive(path("base.factor"), base.factor)?;
            finite(path("base.offset"), base.offset)?;
        }
        for display in &unit.display_units {
            name(path("display_units.name"), &display.name)?;
            finite(path("display_units.offset"), display.offset)?;
        }
    }
    Ok(())
}

/// Checks the texts of log categories.
pub(crate) fn categories(categories: &[LogCategory]) -> Result<(), Error> {
    for (c, category) in categories.iter().enumerate() {
        name(format!("log_categories[{c}].name"), &category.name)?;
        text(format!("log_categories[{:?}].description", category.name), &category.description)?;
    }
    Ok(())
}

fn types(description: &ModelDescription) -> Result<(), Error> {
    for (t, declared) in description.types.iter().enumerate() {
        name(format!("types[{t}].name"), &declared.name)?;
        let path = |field: &str| format!("types[{:?}].{field}", declared.name);
        text(path("description"), &declared.description)?;
        kind(&path, &declared.kind)?;
        if declared.kind.declared_type().is_some() || declared.kind.has_start() {
            return Err(Error::invalid(
                path("kind"),
                "that of a variable",
                "no declared type, no start value",
            ));
        }
        items(&path, declared.kind.scalar_type() == ScalarType::Enumeration, &declared.items)?;
    }
    Ok(())
}

/// Checks the items of a declared type; only an enumeration has any.
pub(crate) fn items<V>(
    path: &impl Fn(&str) -> String,
    is_enumeration: bool,
    items: &[EnumerationItem<V>],
) -> Result<(), Error> {
    match (is_enumeration, items.is_empty()) {
        (true, true) => return Err(Error::invalid(path("items"), "empty", "at least one item")),
        (false, false) => {
            return Err(Error::invalid(path("items"), "given", "nothing, as this is no enumeration"));
        }
        _ => {}
    }
    for (i, item) in items.iter().enumerate() {
        name(path(&format!("items[{i}].name")), &item.name)?;
        text(path(&format!("items[{:?}].description", item.name)), &item.description)?;
    }
    Ok(())
}

fn variables(description: &ModelDescription) -> Result<(), Error> {
    if description.variables.is_empty() {
        return Err(Error::invalid("variables", "empty", "at least one variable"));
    }
    let mut references = HashMap::<(BaseType, u32), &str>::new();
    for (v, variable) in description.variables.iter().enumerate() {
        name(format!("variables[{v}].name"), &variable.name)?;
        let path = |field: &str| variable_path(variable, field);
        let base_type = variable.kind.base_type();
        if let Some(other) = references.insert((base_type, variable.value_reference), &variable.name) {
            let value = format!("{} ({base_type:?})", variable.value_reference);
            return Err(Error::invalid(path("value_reference"), value, format!("not the one of {other:?}")));
        }
        text(path("description"), &variable.description)?;
        kind(&path, &variable.kind)?;
        if matches!(&variable.kind, VariableKind::Enumeration(of) if of.declared_type.is_none()) {
            let allowed = "the name of one of the description's types";
            return Err(Error::invalid(path("declared_type"), "missing", allowed));
        }
    }
    Ok(())
}

/// Checks the type-specific bounds, start value and texts.
fn kind(path: &impl Fn(&str) -> String, kind: &VariableKind) -> Result<(), Error> {
    match kind {
        VariableKind::Real(Real { quantity, min, max, nominal, start, .. }) => {
            numbers(path, *min, *max, *nominal, start.as_slice())?;
            quantity.as_deref().map_or(Ok(()), |quantity| line(path("quantity"), quantity))
        }
        VariableKind::Integer(of) | VariableKind::Enumeration(of) => {
            of.quantity.as_deref().map_or(Ok(()), |quantity| line(path("quantity"), quantity))
        }
        VariableKind::Boolean(_) => Ok(()),
        VariableKind::String(of) => of.start.as_deref().map_or(Ok(()), |start| text(path("start"), start)),
    }
}

/// Checks bounds, nominal value and start values of a floating-point number.
pub(crate) fn numbers(
    path: &impl Fn(&str) -> String,
    min: Option<f64>,
    max: Option<f64>,
    nominal: Option<f64>,
    starts: &[f64],
) -> Result<(), Error> {
    bound(path("min"), min, f64::NEG_INFINITY)?;
    bound(path("max"), max, f64::INFINITY)?;
    for start in starts {
        if !(start.is_finite() || (start.is_infinite() && [min, max].contains(&Some(*start)))) {
            let allowed = "finite, or infinite where the bound on that side is";
            return Err(Error::invalid(path("start"), Number(*start), allowed));
        }
    }
    nominal.map_or(Ok(()), |nominal| positive(path("nominal"), nominal))
}

fn bound(path: String, value: Option<f64>, infinity: f64) -> Result<(), Error> {
    match value {
        Some(x) if !(x.is_finite() || x == infinity) => {
            Err(Error::invalid(path, Number(x), format!("finite or {}", Number(infinity))))
        }
        _ => Ok(()),
    }
}

pub(crate) fn positive(path: impl Into<String>, value: f64) -> Result<(), Error> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(Error::invalid(path, Number(value), "finite and greater than 0"))
}

fn finite(path: impl Into<String>, value: f64) -> Result<(), Error> {
    if value.is_finite() { Ok(()) } else { Err(Error::invalid(path, Number(value), "finite")) }
}

/// Checks that a name is not empty and has one line.
pub(crate) fn name(path: String, name: &str) -> Result<(), Error> {
    required(path.as_str(), name)?;
    line(path, name)
}

pub(crate) fn required(path: impl Into<String>, value: &str) -> Result<(), Error> {
    if value.is_empty() { Err(Error::invalid(path, "\"\"", "a non-empty text")) } else { Ok(()) }
}

pub(crate) fn text(path: impl Into<String>, value: &str) -> Result<(), Error> {
    match forbidden_character(value) {
        Some(c) => {
            let value = format!("{value:?}");
            Err(Error::invalid(path, value, format!("characters of XML 1.0, not U+{:04X}", u32::from(c))))
        }
        None => Ok(()),
    }
}

pub(crate) fn line(path: impl Into<String>, value: &str) -> Result<(), Error> {
    let path = path.into();
    if !is_one_line(value) {
        return Err(Error::invalid(path, format!("{value:?}"), "one line without tabs"));
    }
    text(path, value)
}
