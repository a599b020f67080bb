//! Conditions on a description of FMI 3.0 to be written. The first violation found is reported.

use super::{DataType, Integer, ModelDescription, TypeDefinition, VariableKind};
use crate::rules::{Check, Unread, Violation, fmi3};
use crate::validate::{Paths, categories, header, items, line, name, numbers, text, units};
use crate::xsd::Number;
use crate::{Error, RULES, Severity};

impl ModelDescription {
    /// Checks every rule that [`to_xml`](Self::to_xml) checks.
    ///
    /// # Errors
    ///
    /// - A required text is empty, a text has a character that XML 1.0 cannot represent, or a text of one
    ///   line has a line break or tab.
    /// - A date is not in UTC; a factor of a base unit or a nominal value is not positive; a bound is NaN or
    ///   infinite on the wrong side; a start value is infinite without such a bound.
    /// - A number does not fit its type.
    /// - A rule of [`RULES`](crate::RULES) is broken.
    /// - There is no variable, or an enumeration has no items or no type.
    pub fn validate(&self) -> Result<(), Error> {
        let mut broken = None;
        let mut report = |violation: Violation| {
            let harmless = RULES.iter().any(|row| row.0 == violation.rule && row.1 == Severity::Warning);
            // A flag that contradicts another is refused too.
            if !harmless || violation.rule == "interface.flags" {
                broken.get_or_insert(violation);
            }
        };
        fmi3::description(self, &mut Check { unread: &Unread::new(), report: &mut report });
        if let Some(Violation { rule, place, message }) = broken {
            return Err(Error::rule(rule, self.paths(|paths| paths.of(place)), message));
        }
        header("instantiation_token", &self.header())?;
        units(&self.units)?;
        for (t, declared) in self.types.iter().enumerate() {
            name(format!("types[{t}].name"), &declared.name)?;
            definition(declared)?;
        }
        categories(&self.log_categories)?;
        if self.variables.is_empty() {
            return Err(Error::invalid("variables", "empty", "at least one variable"));
        }
        for (v, variable) in self.variables.iter().enumerate() {
            name(format!("variables[{v}].name"), &variable.name)?;
            let path = |field: &str| format!("variables[{:?}].{field}", variable.name);
            text(path("description"), &variable.description)?;
            kind(&path, &variable.kind)?;
            if variable.kind.data_type() == DataType::Enumeration && variable.declared_type.is_none() {
                let allowed = "the name of one of the description's types";
                return Err(Error::invalid(path("declared_type"), "missing", allowed));
            }
            for (a, alias) in variable.aliases.iter().enumerate() {
                name(path(&format!("aliases[{a}].name")), &alias.name)?;
                text(path(&format!("aliases[{:?}].description", alias.name)), &alias.description)?;
            }
        }
        Ok(())
    }
}

impl ModelDescription {
    /// Provides the paths of places for errors.
    pub(super) fn paths<T>(&self, with: impl FnOnce(&Paths<'_>) -> T) -> T {
        with(&Paths {
            interfaces: &["model_exchange", "co_simulation", "scheduled_execution"],
            units: &self.units,
            of_type: &|t| &self.types[t].name,
            of_variable: &|v| &self.variables[v].name,
        })
    }
}

fn definition(declared: &TypeDefinition) -> Result<(), Error> {
    let path = |field: &str| format!("types[{:?}].{field}", declared.name);
    text(path("description"), &declared.description)?;
    kind(&path, &declared.kind)?;
    let of_variable = declared.kind.as_float().is_some_and(|of| of.derivative.is_some() || of.reinit);
    if of_variable || declared.kind.starts() > 0 {
        let allowed = "no start value, no derivative, no reinit";
        return Err(Error::invalid(path("kind"), "that of a variable", allowed));
    }
    items(&path, declared.kind.data_type() == DataType::Enumeration, &declared.items)
}

/// Checks the type-specific bounds, start values and texts.
fn kind(path: &impl Fn(&str) -> String, kind: &VariableKind) -> Result<(), Error> {
    let of = kind.data_type();
    let quantity = |quantity: &Option<String>| {
        quantity.as_deref().map_or(Ok(()), |quantity| line(path("quantity"), quantity))
    };
    if let Some(float) = kind.as_float() {
        numbers(path, float.min, float.max, float.nominal, &float.start)?;
        quantity(&float.quantity)?;
        let all =
            [float.min, float.max, float.nominal].into_iter().flatten().chain(float.start.iter().copied());
        let fits = |x: &f64| f64::from(*x as f32) == *x;
        if of == DataType::Float32
            && let Some(number) = all.into_iter().find(|x| !fits(x))
        {
            let allowed = format!("a number of 32 bits, such as {:?}", f64::from(number as f32));
            return Err(Error::invalid(path("kind"), Number(number), allowed));
        }
    }
    if let (Some(Integer { quantity: of_what, min, max, start }), Some((least, most))) =
        (kind.as_integer(), of.limits())
    {
        quantity(of_what)?;
        for (field, value) in [("min", min), ("max", max)]
            .into_iter()
            .filter_map(|(f, v)| v.map(|v| (f, v)))
            .chain(start.iter().map(|&value| ("start", value)))
        {
            if !(least..=most).contains(&value) {
                let allowed = format!("a value of {}, {least} to {most}", of.as_str());
                return Err(Error::invalid(path(field), value, allowed));
            }
        }
    }
    match kind {
        VariableKind::String(of) => of.start.iter().try_for_each(|start| text(path("start"), start)),
        VariableKind::Binary(of) => {
            of.mime_type.as_deref().map_or(Ok(()), |mime_type| line(path("mime_type"), mime_type))
        }
        _ => Ok(()),
    }
}
