//! The one error type of the crate. It does not show which dependency failed.

use std::fmt;
use std::io;

/// An error in writing a description or an archive.
///
/// The message names the field, its value and the allowed values, for example `variables["x.v"].start is
/// 11.0; allowed: 0.0 to 10.0`.
#[derive(Debug)]
pub struct Error {
    kind: Box<Kind>,
}

#[derive(Debug)]
enum Kind {
    Invalid {
        path: String,
        value: String,
        allowed: String,
    },
    Rule {
        rule: &'static str,
        path: String,
        message: String,
    },
    Xml {
        reason: String,
    },
    #[cfg_attr(
        not(feature = "archive"),
        expect(dead_code, reason = "only archives are written to somewhere")
    )]
    Io {
        doing: String,
        source: io::Error,
    },
}

impl Error {
    pub(crate) fn invalid(
        path: impl Into<String>,
        value: impl fmt::Display,
        allowed: impl Into<String>,
    ) -> Self {
        let (path, value, allowed) = (path.into(), value.to_string(), allowed.into());
        Self { kind: Box::new(Kind::Invalid { path, value, allowed }) }
    }

    /// The error for a broken rule of [`RULES`](crate::RULES).
    pub(crate) fn rule(rule: &'static str, path: String, message: String) -> Self {
        Self { kind: Box::new(Kind::Rule { rule, path, message }) }
    }

    pub(crate) fn xml(reason: impl fmt::Display) -> Self {
        Self { kind: Box::new(Kind::Xml { reason: reason.to_string() }) }
    }

    #[cfg(feature = "archive")]
    pub(crate) fn io(doing: impl Into<String>, source: impl Into<io::Error>) -> Self {
        Self { kind: Box::new(Kind::Io { doing: doing.into(), source: source.into() }) }
    }

    /// True if a field of the description or a path in the archive has a forbidden value.
    /// [`path`](Self::path) then gives the field. If a rule of the standard is broken,
    /// [`broken_rule`](Self::broken_rule) gives it, otherwise [`value`](Self::value) and
    /// [`allowed`](Self::allowed) give details.
    pub fn is_invalid(&self) -> bool {
        matches!(*self.kind, Kind::Invalid { .. } | Kind::Rule { .. })
    }

    /// The name of the broken rule of [`RULES`](crate::RULES).
    pub fn broken_rule(&self) -> Option<&'static str> {
        match *self.kind {
            Kind::Rule { rule, .. } => Some(rule),
            _ => None,
        }
    }

    /// True if the archive could not be written to its destination.
    pub fn is_io(&self) -> bool {
        matches!(*self.kind, Kind::Io { .. })
    }

    /// The invalid field, for example `variables["x.v"].start`.
    pub fn path(&self) -> Option<&str> {
        match &*self.kind {
            Kind::Invalid { path, .. } | Kind::Rule { path, .. } => Some(path),
            _ => None,
        }
    }

    /// The value found; texts are quoted, and an absent value reads `missing`.
    pub fn value(&self) -> Option<&str> {
        match &*self.kind {
            Kind::Invalid { value, .. } => Some(value),
            _ => None,
        }
    }

    /// A description of the allowed values.
    pub fn allowed(&self) -> Option<&str> {
        match &*self.kind {
            Kind::Invalid { allowed, .. } => Some(allowed),
            _ => None,
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &*self.kind {
            Kind::Invalid { path, value, allowed } => write!(f, "{path} is {value}; allowed: {allowed}"),
            Kind::Rule { path, message, .. } => write!(f, "{path}: {message}"),
            Kind::Xml { reason } => write!(f, "cannot write the model description: {reason}"),
            Kind::Io { doing, .. } => write!(f, "cannot {doing}"),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match &*self.kind {
            Kind::Io { source, .. } => Some(source),
            _ => None,
        }
    }
}
