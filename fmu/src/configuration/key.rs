//! The keys that a file may have: name, kind of value, unit, range, default and meaning, a row each.
//!
//! The checks read their ranges here. The tables of docs/configuration.md and the schema for editors
//! (docs/punctual.schema.json) are made of these rows, and `tests/tidy` compares.

use super::{Range, over_seconds};

/// The unit of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// This unit; `1` where there is none.
    Is(&'static str),
    /// The unit of the barrier's h.
    OfH,
    /// The unit of the derivative of h that the inputs enter.
    OfHighestDerivative,
    /// The unit of something else, in words.
    Of(&'static str),
}

impl Unit {
    /// The unit's name at a barrier with h in the unit `h` and of relative degree `degree`.
    pub fn of_barrier(self, h: &str, degree: usize) -> String {
        match self {
            Self::Is(unit) | Self::Of(unit) => unit.to_owned(),
            Self::OfH => h.to_owned(),
            Self::OfHighestDerivative => over_seconds(h, degree),
        }
    }
}

/// The kind of value of a key.
#[derive(Clone, Copy, Debug)]
pub enum Value {
    /// A number.
    Number(Unit, Range),
    /// Two numbers, `[1.0, 2.0]`.
    Pair(Unit, Range),
    /// Numbers along the axes of the plane or of space: two or three.
    Place(Unit, Range),
    /// Numbers, as many as there are.
    Numbers(Unit, Range),
    /// Pairs of numbers, as many as there are.
    Pairs(Unit, Range),
    /// A table of numbers by name.
    NumberByName(Unit, Range),
    /// A table of pairs by name.
    PairByName(Unit),
    /// A whole number, from the first to the last.
    Count(u64, u64),
    /// `true` or `false`.
    Flag,
    /// Any text.
    Text,
    /// C identifiers, as many as there are.
    Names,
    /// A C identifier.
    Name,
    /// One of these texts.
    Word(&'static [&'static str]),
    /// A table of texts by name.
    TextByName,
    /// A text, or a table of texts by name.
    TextOrByName,
    /// A table.
    Table(&'static Section),
    /// A table of tables by name.
    TableByName(&'static Section),
    /// A list of tables.
    Tables(&'static Section),
}

/// A key of a file.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// The key.
    pub name: &'static str,
    /// The kind of its value.
    pub value: Value,
    /// The default in words; empty where it depends on other keys. `None`: the key must be given.
    pub default: Option<&'static str>,
    /// Meaning, in Markdown of docs/configuration.md.
    pub meaning: &'static str,
}

impl Key {
    /// A key in one line.
    pub(super) const fn new(
        name: &'static str,
        value: Value,
        default: Option<&'static str>,
        meaning: &'static str,
    ) -> Self {
        Self { name, value, default, meaning }
    }
}

/// A table of a file.
#[derive(Debug)]
pub struct Section {
    /// Its name in docs/configuration.md and in the schema.
    pub name: &'static str,
    /// Its keys, in the order of the documentation.
    pub keys: fn() -> Vec<&'static Key>,
}
