//! Numbers of a configuration that are also parameters of the FMU: one row each.

use std::borrow::Cow;

use super::ConfigurationError;

/// Size from which an input bound means "no bound": a finite number that every importer can read.
pub const UNBOUNDED: f64 = 1e30;

/// The values a number may take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Smallest value, if there is one.
    pub min: Option<f64>,
    /// Largest value, if there is one.
    pub max: Option<f64>,
}

impl Range {
    /// Any finite number.
    pub const FINITE: Self = Self { min: None, max: None };
    /// Finite and positive: at least 1e-9 of the unit. A model description knows inclusive bounds only.
    pub const POSITIVE: Self = Self { min: Some(1e-9), max: None };
    /// Finite and ≥ 0.
    pub const NON_NEGATIVE: Self = Self { min: Some(0.0), max: None };

    /// Whether `value` is finite and within the range.
    pub fn contains(&self, value: f64) -> bool {
        value.is_finite()
            && self.min.is_none_or(|min| value >= min)
            && self.max.is_none_or(|max| value <= max)
    }

    /// The value within it that is nearest to `value`.
    pub fn nearest(&self, value: f64) -> f64 {
        let raised = self.min.map_or(value, |min| value.max(min));
        self.max.map_or(raised, |max| raised.min(max))
    }

    /// The range in words, e.g. "finite and >= 0".
    pub fn describe(&self) -> String {
        let mut words = "finite".to_owned();
        for (sign, bound) in [(">=", self.min), ("<=", self.max)] {
            if let Some(bound) = bound {
                words += &format!(" and {sign} {}", number(bound));
            }
        }
        words
    }

    /// Checks `value`, naming `field`.
    ///
    /// # Errors
    ///
    /// A value that is not finite or outside the range.
    pub fn check(&self, field: &str, value: f64) -> Result<(), ConfigurationError> {
        if self.contains(value) {
            return Ok(());
        }
        Err(ConfigurationError::new(field, format!("is {}, must be {}", number(value), self.describe())))
    }
}

/// A number for people: with an exponent where it would have many zeros.
pub(super) fn number(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || (1e-4..1e7).contains(&size) { value.to_string() } else { format!("{value:e}") }
}

/// Reaches a parameter's number in a completed configuration of type `C`; `None` in one without it.
type Access<C> = Box<dyn Fn(&mut C) -> Option<&mut f64> + Send>;

/// One number of a configuration: its name as an FMU variable, its path in the file, unit, range and meaning.
/// Validation, the model description and the FMU's accessors all read this row.
pub struct Parameter<C> {
    /// The variable's name, e.g. `goal.deadline`.
    pub name: String,
    /// The path in the configuration file, e.g. `barrier[0].deadline`.
    pub path: String,
    /// The unit.
    pub unit: Cow<'static, str>,
    /// The allowed range.
    pub range: Range,
    /// Meaning, for a human.
    pub description: String,
    /// Whether it may change in a run: the block reads it from the values at every step.
    pub tunable: bool,
    access: Access<C>,
}

impl<C> Parameter<C> {
    pub(super) fn new(
        (name, path): (String, String),
        unit: impl Into<Cow<'static, str>>,
        range: Range,
        description: impl Into<String>,
        access: impl Fn(&mut C) -> Option<&mut f64> + Send + 'static,
    ) -> Self {
        Self {
            name,
            path,
            unit: unit.into(),
            range,
            description: description.into(),
            tunable: false,
            access: Box::new(access),
        }
    }

    /// The same, as one that may change in a run.
    pub(super) fn tunable(self) -> Self {
        Self { tunable: true, ..self }
    }

    /// The value in `configuration`; not a number where the configuration does not have it.
    pub fn get(&self, configuration: &mut C) -> f64 {
        (self.access)(configuration).copied().unwrap_or(f64::NAN)
    }

    /// Writes the value into `configuration`, unchecked, if that has it.
    pub fn set(&self, configuration: &mut C, value: f64) {
        if let Some(number) = (self.access)(configuration) {
            *number = value;
        }
    }

    /// Checks the value in `configuration`.
    pub(super) fn check(&self, configuration: &mut C) -> Result<(), ConfigurationError> {
        self.range.check(&self.path, self.get(configuration))
    }
}

/// `configuration` with the numbers of `rows` replaced by `values`, in order.
///
/// # Errors
///
/// A value outside the range of its row.
pub fn updated<C: Clone>(
    configuration: &C,
    rows: &[Parameter<C>],
    values: &[f64],
) -> Result<C, ConfigurationError> {
    let mut configuration = configuration.clone();
    for (row, &value) in rows.iter().zip(values) {
        row.range.check(&row.name, value)?;
        row.set(&mut configuration, value);
    }
    Ok(configuration)
}
