//! The values of a TOML text for serde, with refusals in plain words: where, what was found, what is allowed.

use std::fmt::{self, Display};
use std::ops::Range;

use punctual_models::{is_in_name, nearest};
use serde::de::value::{MapAccessDeserializer, StrDeserializer};
use serde::de::{
    DeserializeOwned, DeserializeSeed, Deserializer, Error as _, Expected, IntoDeserializer, MapAccess,
    SeqAccess, Unexpected, Visitor,
};
use serde::forward_to_deserialize_any;
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

/// A value that cannot be used, on its way out of the tables around it.
#[derive(Debug, Default)]
pub(super) struct Refusal {
    /// The path of the value as far as it is known, such as `[0].deadline`.
    pub(super) path: String,
    pub(super) message: String,
    /// The bytes of the text that it is about.
    pub(super) place: Option<Range<usize>>,
    /// Where a table is found for a list of tables or the other way round: what was meant, and its header as far as it is
    /// known, which is the path without positions.
    meant: Option<(Meant, String)>,
}

/// What a header is for.
#[derive(Debug)]
enum Meant {
    ListOfTables,
    Table,
}

impl Refusal {
    fn at(mut self, place: Range<usize>) -> Self {
        self.place.get_or_insert(place);
        self
    }

    /// The same refusal, as the surroundings see it: `outer` is a key or `[position]`.
    fn within(mut self, outer: &str) -> Self {
        let dot = if self.path.is_empty() || self.path.starts_with('[') { "" } else { "." };
        self.path = format!("{outer}{dot}{}", self.path);
        if let Some((_, header)) = self.meant.as_mut().filter(|_| !outer.starts_with('[')) {
            let dot = if header.is_empty() { "" } else { "." };
            *header = format!("{outer}{dot}{header}");
        }
        self
    }

    /// The same refusal, once its path is whole: with the header that was meant.
    fn reported(mut self) -> Self {
        self.message += &match &self.meant {
            Some((Meant::ListOfTables, header)) => format!("; a list of tables is written [[{header}]]"),
            Some((Meant::Table, header)) => format!("; one table is written [{header}]"),
            None => String::new(),
        };
        self
    }
}

/// A key in a path: in quotes where it has more than letters, digits, underscores and hyphens.
fn shown(key: &str) -> String {
    let bare = !key.is_empty() && key.chars().all(|c| is_in_name(c) || c == '-');
    if bare { key.to_owned() } else { format!("{key:?}") }
}

/// What was found, in words.
fn found(unexpected: &Unexpected<'_>) -> String {
    match unexpected {
        Unexpected::Str(text) => format!("{text:?}"),
        Unexpected::Float(number) => format!("{number:?}"),
        Unexpected::Signed(number) => number.to_string(),
        Unexpected::Unsigned(number) => number.to_string(),
        Unexpected::Bool(flag) => flag.to_string(),
        Unexpected::Seq => "a list".to_owned(),
        Unexpected::Map => "a table".to_owned(),
        other => other.to_string(),
    }
}

/// What a type of Rust wants, in words.
fn wanted(expected: &dyn Expected) -> String {
    let text = expected.to_string();
    match text.as_str() {
        "f64" => "a number".to_owned(),
        "u32" | "u64" | "usize" => "a whole number >= 0".to_owned(),
        "a boolean" => "true or false".to_owned(),
        "a string" => "a text in quotes".to_owned(),
        "a sequence" => "a list".to_owned(),
        "a map" => "a table".to_owned(),
        _ if text.starts_with("struct ") || text.starts_with("internally tagged enum ") => {
            "a table".to_owned()
        }
        // The words of a type of ours.
        _ => text,
    }
}

/// The texts that are allowed, in words.
fn one_of(words: &[&str]) -> String {
    let words: Vec<_> = words.iter().map(|word| format!("{word:?}")).collect();
    match &words[..] {
        [one] => one.clone(),
        [rest @ .., last] => format!("{} or {last}", rest.join(", ")),
        [] => "left out".to_owned(),
    }
}

impl Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.path, self.message)
    }
}

impl std::error::Error for Refusal {}

impl serde::de::Error for Refusal {
    fn custom<T: Display>(message: T) -> Self {
        Self { message: message.to_string(), ..Self::default() }
    }

    fn invalid_type(unexpected: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::custom(format!("is {}, must be {}", found(&unexpected), wanted(expected)))
    }

    fn invalid_value(unexpected: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::invalid_type(unexpected, expected)
    }

    fn invalid_length(length: usize, expected: &dyn Expected) -> Self {
        // serde says how many in the midst of other words.
        let text = expected.to_string();
        let most = text.split(|c: char| !c.is_ascii_digit()).find(|digits| !digits.is_empty());
        Self::custom(format!("has {length} entries, must have {}", most.unwrap_or("another number")))
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Self {
        Self::custom(format!("is {variant:?}, must be {}{}", one_of(expected), nearest(variant, expected)))
    }

    fn unknown_field(field: &str, expected: &'static [&'static str]) -> Self {
        let near = nearest(field, expected);
        let message = match near.as_str() {
            "" => format!("is an unknown key; the keys are {}", expected.join(", ")),
            near => format!("is an unknown key{near}"),
        };
        Self::custom(message).within(&shown(field))
    }

    fn missing_field(field: &'static str) -> Self {
        Self::custom("missing, it must be given").within(field)
    }

    fn duplicate_field(field: &'static str) -> Self {
        Self::custom("is given twice, must be given once").within(field)
    }
}

/// Reads a value from the tables of a text.
pub(super) fn read<T: DeserializeOwned>(table: &DeTable<'_>) -> Result<T, Refusal> {
    T::deserialize(MapAccessDeserializer::new(Entries::of(table))).map_err(Refusal::reported)
}

/// A value.
struct Found<'a>(&'a Spanned<DeValue<'a>>);

impl Found<'_> {
    /// The refusal of this value where something else is wanted.
    fn refused(&self, wanted: &dyn Expected) -> Refusal {
        let found = match self.0.get_ref() {
            DeValue::String(text) => Unexpected::Str(text),
            DeValue::Integer(number) => Unexpected::Other(number.as_str()),
            DeValue::Float(number) => Unexpected::Other(number.as_str()),
            DeValue::Boolean(flag) => Unexpected::Bool(*flag),
            DeValue::Datetime(_) => Unexpected::Other("a date or time"),
            DeValue::Array(_) => Unexpected::Seq,
            DeValue::Table(_) => Unexpected::Map,
        };
        Refusal::invalid_type(found, wanted)
    }
}

impl<'a> Found<'a> {
    /// Adds to a refusal of a table or a list what was meant.
    fn meant(&self, refusal: Refusal) -> Refusal {
        let tables = |list: &toml::de::DeArray<'_>| {
            !list.is_empty() && list.iter().all(|entry| matches!(entry.get_ref(), DeValue::Table(_)))
        };
        let meant = match self.0.get_ref() {
            DeValue::Table(_) => Some(Meant::ListOfTables),
            DeValue::Array(list) if tables(list) => Some(Meant::Table),
            _ => None,
        };
        Refusal { meant: meant.map(|meant| (meant, String::new())), ..refusal }
    }

    fn list<V: Visitor<'a>>(&self, visitor: V, fixed: bool) -> Result<V::Value, Refusal> {
        let DeValue::Array(list) = self.0.get_ref() else {
            return Err(self.meant(self.refused(&visitor)));
        };
        let items = Items { rest: list.iter(), next: 0, fixed };
        visitor.visit_seq(items)
    }

    fn table<V: Visitor<'a>>(&self, visitor: V) -> Result<V::Value, Refusal> {
        let DeValue::Table(table) = self.0.get_ref() else {
            return Err(self.meant(self.refused(&visitor)));
        };
        visitor.visit_map(Entries::of(table))
    }
}

impl<'de> Deserializer<'de> for Found<'de> {
    type Error = Refusal;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        let refuse = |message: String| Err(Refusal::custom(message));
        match self.0.get_ref() {
            DeValue::Array(_) => self.list(visitor, false),
            DeValue::Table(_) => self.table(visitor),
            DeValue::String(text) => visitor.visit_str(text),
            DeValue::Boolean(flag) => visitor.visit_bool(*flag),
            DeValue::Datetime(_) => Err(self.refused(&visitor)),
            DeValue::Integer(number) => {
                let (digits, radix) = (number.as_str(), number.radix());
                match (i64::from_str_radix(digits, radix), u64::from_str_radix(digits, radix)) {
                    (Ok(number), _) => visitor.visit_i64(number),
                    (_, Ok(number)) => visitor.visit_u64(number),
                    _ => refuse(format!(
                        "is {number}, which is too large for a whole number; write it with a decimal point"
                    )),
                }
            }
            DeValue::Float(number) => match number.as_str().parse::<f64>() {
                Ok(value) if value.is_finite() || number.as_str().ends_with(['f', 'n']) => {
                    visitor.visit_f64(value)
                }
                _ => refuse(format!("is {number}, must be at most {:e} in size", f64::MAX)),
            },
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        self.list(visitor, false)
    }

    /// A list with a fixed number of entries.
    fn deserialize_tuple<V: Visitor<'de>>(self, length: usize, visitor: V) -> Result<V::Value, Refusal> {
        match self.0.get_ref() {
            DeValue::Array(list) if list.len() == length => self.list(visitor, true),
            DeValue::Array(list) => {
                let message = match list.len() {
                    1 => format!("has 1 entry, must have {length}"),
                    found => format!("has {found} entries, must have {length}"),
                };
                Err(Refusal::custom(message))
            }
            _ => Err(self.refused(&format!("a list with {length} entries").as_str())),
        }
    }

    /// A list whose entries are counted as those of one with a fixed number, which the visitor knows.
    fn deserialize_tuple_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: usize,
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        self.list(visitor, true)
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        self.table(visitor)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        self.table(visitor)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        words: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        let DeValue::String(text) = self.0.get_ref() else {
            return Err(self.refused(&one_of(words).as_str()));
        };
        let word: StrDeserializer<'_, Refusal> = text.as_ref().into_deserializer();
        visitor.visit_enum(word)
    }

    fn deserialize_ignored_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        visitor.visit_unit()
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit unit_struct
        identifier
    }
}

/// The entries of a list.
struct Items<'a> {
    rest: std::slice::Iter<'a, Spanned<DeValue<'a>>>,
    next: usize,
    /// Whether the number of entries is fixed. These are counted from 1, as FMI counts the components of a vector.
    fixed: bool,
}

impl<'de> SeqAccess<'de> for Items<'de> {
    type Error = Refusal;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Refusal> {
        let Some(value) = self.rest.next() else { return Ok(None) };
        let place = format!("[{}]", self.next + usize::from(self.fixed));
        self.next += 1;
        let read = seed.deserialize(Found(value));
        read.map(Some).map_err(|e| e.at(value.span()).within(&place))
    }
}

/// The keys and values of a table.
struct Entries<'a> {
    rest: Box<dyn Iterator<Item = (&'a Spanned<DeString<'a>>, &'a Spanned<DeValue<'a>>)> + 'a>,
    /// The key read last and its value.
    last: Option<(&'a str, Found<'a>)>,
}

impl<'a> Entries<'a> {
    fn of(table: &'a DeTable<'a>) -> Self {
        Self { rest: Box::new(table.iter()), last: None }
    }
}

impl<'de> MapAccess<'de> for Entries<'de> {
    type Error = Refusal;

    fn next_key_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Refusal> {
        let Some((key, value)) = self.rest.next() else { return Ok(None) };
        self.last = Some((key.get_ref(), Found(value)));
        let name: StrDeserializer<'_, Refusal> = key.get_ref().as_ref().into_deserializer();
        seed.deserialize(name).map(Some).map_err(|e| e.at(key.span()))
    }

    fn next_value_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<T::Value, Refusal> {
        let (key, found) = self.last.take().ok_or_else(|| Refusal::custom("is a value without a key"))?;
        let place = found.0.span();
        seed.deserialize(found).map_err(|e| e.at(place).within(&shown(key)))
    }
}
