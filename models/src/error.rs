//! Errors of a model: the part that is wrong, and why.

use std::fmt;

/// A model that cannot be used: which part of it, and what is wrong with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    field: String,
    message: String,
}

impl Error {
    pub(crate) fn new(field: impl Into<String>, message: impl Into<String>) -> Self {
        Self { field: field.into(), message: message.into() }
    }

    /// The part: `states[1]`, `derivatives.v`, or `expression` for that of a barrier.
    pub fn field(&self) -> &str {
        &self.field
    }

    /// The reason, for a human.
    pub fn message(&self) -> &str {
        &self.message
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.field, self.message)
    }
}

impl std::error::Error for Error {}
