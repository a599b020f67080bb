//! Errors of a model: which part is wrong, and why.

use alloc::string::String;
use core::fmt;

/// An error in a model: which part cannot be used, and what is wrong with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    field: String,
    message: String,
}

impl Error {
    pub(crate) fn new(field: impl Into<String>, message: impl Into<String>) -> Self {
        Self { field: field.into(), message: message.into() }
    }

    /// The part: `states[1]`, `derivatives.v`, or `expression` for a barrier's expression.
    pub fn field(&self) -> &str {
        &self.field
    }

    /// The reason, as a text for the reader.
    pub fn message(&self) -> &str {
        &self.message
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.field, self.message)
    }
}

impl core::error::Error for Error {}
