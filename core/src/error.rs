//! The crate's one error type, for misuse. Numerical outcomes are statuses, not errors.

mod degree;

use alloc::boxed::Box;
use alloc::string::String;
use core::fmt;

pub use degree::RelativeDegree;

/// The kind of misuse that an [`Error`] reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ErrorKind {
    /// A number outside its allowed range, or not finite.
    Range,
    /// A slice of the wrong length.
    Dimension,
    /// The input enters another derivative of the barrier than the one needed, or none.
    RelativeDegree,
    /// A combination that is not implemented.
    Unsupported,
}

/// Misuse of the library: the field, the value given and the range allowed.
#[derive(Clone, Debug, PartialEq)]
pub struct Error {
    kind: ErrorKind,
    field: String,
    message: String,
    degree: Option<Box<RelativeDegree>>,
}

impl Error {
    /// An error about `field`; `message` says what was found and what is allowed, such as "is -1, must be > 0".
    pub fn new(kind: ErrorKind, field: impl Into<String>, message: impl Into<String>) -> Self {
        Self { kind, field: field.into(), message: message.into(), degree: None }
    }

    pub(crate) fn with_relative_degree(mut self, found: RelativeDegree) -> Self {
        self.degree = Some(Box::new(found));
        self
    }

    /// The relative degree found, where that is the defect.
    pub fn relative_degree(&self) -> Option<&RelativeDegree> {
        self.degree.as_deref()
    }

    /// The kind of misuse.
    pub fn kind(&self) -> ErrorKind {
        self.kind
    }

    /// The field or argument concerned, e.g. `deadline` or `u_max[1]`.
    pub fn field(&self) -> &str {
        &self.field
    }

    /// The value found and the range allowed, without the field's name.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// The same error, its field prefixed with `path` and a dot.
    #[must_use]
    pub fn within(mut self, path: &str) -> Self {
        self.field = format!("{path}.{}", self.field);
        self
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.field, self.message)
    }
}

impl core::error::Error for Error {}

/// `Ok(value)` if `value` is finite and > 0.
///
/// # Errors
///
/// Otherwise, an error that names `field`.
pub fn positive(field: &str, value: f64) -> Result<f64, Error> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(Error::new(ErrorKind::Range, field, format!("is {value}, must be finite and > 0")))
    }
}

/// `Ok(value)` if `value` is finite and ≥ 0.
///
/// # Errors
///
/// Otherwise, an error that names `field`.
pub fn non_negative(field: &str, value: f64) -> Result<f64, Error> {
    if value.is_finite() && value >= 0.0 {
        Ok(value)
    } else {
        Err(Error::new(ErrorKind::Range, field, format!("is {value}, must be finite and >= 0")))
    }
}

/// `Ok(value)` if `value` is finite.
///
/// # Errors
///
/// Otherwise, an error that names `field`.
pub fn finite(field: &str, value: f64) -> Result<f64, Error> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(Error::new(ErrorKind::Range, field, format!("is {value}, must be finite")))
    }
}

/// `Ok(())` if `found` equals `wanted`.
///
/// # Errors
///
/// Otherwise, an error that names `field`.
#[inline]
pub fn length(field: &str, found: usize, wanted: usize) -> Result<(), Error> {
    #[cold]
    fn wrong(field: &str, found: usize, wanted: usize) -> Error {
        Error::new(ErrorKind::Dimension, field, format!("has {found} components, must have {wanted}"))
    }
    if found == wanted { Ok(()) } else { Err(wrong(field, found, wanted)) }
}
