//! TOML text to a typed value, with errors that name the field.

use std::fmt;

use serde::Serialize;
use serde::de::DeserializeOwned;
use toml::de::DeTable;

use super::found;

/// Most characters of a line of an error, far more than any allowed name or number needs.
const LONGEST_LINE: usize = 600;

/// A configuration that cannot be used: the field, the value found, the values allowed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConfigurationError {
    field: String,
    message: String,
}

impl ConfigurationError {
    /// An error about `field` (a dotted path such as `barrier[0].deadline`; empty for the whole file).
    pub fn new(field: impl Into<String>, message: impl Into<String>) -> Self {
        Self { field: shortened(&field.into()), message: shortened(&message.into()) }
    }

    /// The dotted path of the field, empty where the error concerns the file as a whole.
    pub fn field(&self) -> &str {
        &self.field
    }

    /// The defect, with the value found and the range allowed.
    pub fn message(&self) -> &str {
        &self.message
    }
}

impl fmt::Display for ConfigurationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.field.is_empty() {
            f.write_str(&self.message)
        } else {
            write!(f, "{}: {}", self.field, self.message)
        }
    }
}

impl std::error::Error for ConfigurationError {}

/// `text` with lines that a person can read, since quotations from a file may be of any length.
fn shortened(text: &str) -> String {
    let line = |line: &str| match line.char_indices().nth(LONGEST_LINE) {
        Some((end, _)) => format!("{}...", &line[..end]),
        None => line.to_owned(),
    };
    text.split('\n').map(line).collect::<Vec<_>>().join("\n")
}

/// Reads a value from TOML text. Types used here deny unknown fields, so that a misspelt key is
/// an error and not a silent default.
///
/// # Errors
///
/// Text that is not TOML (with line and column), an unknown or missing key, a value of the wrong
/// type, a list with too many entries: each with the path of the field and the line.
pub fn read_toml<T: DeserializeOwned>(text: &str) -> Result<T, ConfigurationError> {
    let table = DeTable::parse(text).map_err(|e| {
        let hint = e.span().map_or("", |place| hint(text, place.start));
        ConfigurationError::new("", format!("{}{hint}", e.to_string().trim_end()))
    })?;
    found::read(table.get_ref()).map_err(|refusal| {
        let line = refusal.place.map_or_else(String::new, |place| {
            let before = text.get(..place.start).unwrap_or_default();
            format!(" (line {})", before.matches('\n').count() + 1)
        });
        ConfigurationError::new(refusal.path, refusal.message + &line)
    })
}

/// What to write instead, where the text cannot be read from the byte `at` on.
fn hint(text: &str, at: usize) -> &'static str {
    let (before, rest) = text.split_at_checked(at).unwrap_or_default();
    if rest.starts_with("True") || rest.starts_with("False") {
        "; TOML writes true and false in small letters"
    } else if rest.starts_with(',') && before.ends_with(|c: char| c.is_ascii_digit()) {
        "; a decimal point is ."
    } else if before.is_empty() && rest.starts_with('{') {
        "; this looks like JSON, must be TOML"
    } else {
        ""
    }
}

/// A value as TOML text.
///
/// # Errors
///
/// A value that TOML has no form for, such as one that is missing in a list.
pub fn write_toml<T: Serialize>(value: &T) -> Result<String, ConfigurationError> {
    toml::to_string(value).map_err(|e| ConfigurationError::new("", e.to_string()))
}
