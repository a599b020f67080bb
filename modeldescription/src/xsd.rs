//! The simple types of XML Schema that the schemas of FMI use, written and read.
//!
//! Doubles are written so that they read back with exactly the same bits (except for NaN payloads).

use crate::calendar::days_in_month;
use serde::{Serialize, Serializer};
use std::fmt;

/// A double that displays and serialises as `xs:double`: shortest digits that round-trip, `INF`,
/// `-INF` or `NaN`.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(crate) struct Number(pub(crate) f64);

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            x if x.is_nan() => f.write_str("NaN"),
            f64::INFINITY => f.write_str("INF"),
            f64::NEG_INFINITY => f.write_str("-INF"),
            // `Debug` uses exponents where `Display` would print hundreds of zeros.
            x => write!(f, "{x:?}"),
        }
    }
}

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Serialises a field that is a number.
pub(crate) fn number<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    Number(*value).serialize(serializer)
}

/// Serialises a field that is an optional number.
pub(crate) fn optional<S: Serializer>(value: &Option<f64>, serializer: S) -> Result<S::Ok, S::Error> {
    value.map(Number).serialize(serializer)
}

/// Whether a flag or number has the schema's default, false or 0.
pub(crate) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Whether a factor has the schema's default.
pub(crate) fn is_one(value: &f64) -> bool {
    *value == 1.0
}

/// White space in XML, which is a subset of that in Unicode.
const BLANKS: [char; 4] = [' ', '\t', '\n', '\r'];

fn trimmed(text: &str) -> &str {
    text.trim_matches(BLANKS)
}

/// The words of a list.
pub fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(BLANKS).filter(|word| !word.is_empty())
}

/// An `xs:boolean`.
pub fn boolean(text: &str) -> Option<bool> {
    match trimmed(text) {
        "true" | "1" => Some(true),
        "false" | "0" => Some(false),
        _ => None,
    }
}

/// An integer of this type: `xs:int`, `xs:unsignedLong` and the like.
pub fn integer<T: TryFrom<i128>>(text: &str) -> Option<T> {
    T::try_from(trimmed(text).parse::<i128>().ok()?).ok()
}

/// An `xs:int`.
pub fn int(text: &str) -> Option<i32> {
    integer(text)
}

/// An `xs:unsignedInt`.
pub fn unsigned(text: &str) -> Option<u32> {
    integer(text)
}

/// An `xs:float`, as a double.
pub fn float(text: &str) -> Option<f64> {
    // The digits are rounded only once, to 32 bits.
    double(text)?;
    trimmed(text).parse::<f32>().ok().map(f64::from)
}

/// An `xs:hexBinary`.
pub fn hexadecimal(text: &str) -> Option<Vec<u8>> {
    let digits: Vec<u8> =
        trimmed(text).chars().map(|c| u8::try_from(c.to_digit(16)?).ok()).collect::<Option<_>>()?;
    let (pairs, rest) = digits.as_chunks::<2>();
    rest.is_empty().then(|| pairs.iter().map(|[high, low]| high << 4 | low).collect())
}

/// An `xs:double`. Rust's parser also accepts words that the schema does not: `inf`, `infinity`, `nan`.
pub fn double(text: &str) -> Option<f64> {
    match trimmed(text) {
        "INF" => Some(f64::INFINITY),
        "-INF" => Some(f64::NEG_INFINITY),
        "NaN" => Some(f64::NAN),
        text if text.bytes().all(|b| b.is_ascii_digit() || b"+-.eE".contains(&b)) => text.parse().ok(),
        _ => None,
    }
}

/// An `xs:dateTime`: `[-]YYYY-MM-DDThh:mm:ss[.f][Z|(+|-)hh:mm]`.
pub fn is_date_time(text: &str) -> bool {
    let text = trimmed(text);
    let text = text.strip_prefix('-').unwrap_or(text);
    let Some((date, rest)) = text.split_once('T') else { return false };
    let (time, zone) = match rest.find(['Z', '+', '-']) {
        Some(at) => rest.split_at(at),
        None => (rest, ""),
    };
    let parts: Vec<&str> = date.split('-').collect();
    let [year, month, day] = parts[..] else { return false };
    let dated = year.len() >= 4
        && digits(year).is_some_and(|year| year > 0)
        && within(month, 1, 12)
        && within(day, 1, days_in_month(digits(year).unwrap_or(0), digits(month).unwrap_or(0)));
    let (time, fraction) = time.split_once('.').unwrap_or((time, "0"));
    let parts: Vec<&str> = time.split(':').collect();
    let [hour, minute, second] = parts[..] else { return false };
    let timed = (within(hour, 0, 23) && within(minute, 0, 59) && within(second, 0, 59)
        || (hour, minute, second) == ("24", "00", "00"))
        && !fraction.is_empty()
        && fraction.bytes().all(|b| b.is_ascii_digit());
    let zoned = matches!(zone, "" | "Z")
        || zone.get(1..).and_then(|zone| zone.split_once(':')).is_some_and(|(hour, minute)| {
            within(hour, 0, 13) && within(minute, 0, 59) || (hour, minute) == ("14", "00")
        }) && !zone.starts_with('Z');
    dated && timed && zoned
}

fn digits(text: &str) -> Option<u64> {
    if text.bytes().all(|b| b.is_ascii_digit()) { text.parse().ok() } else { None }
}

/// Whether a text consists of two digits within the bounds.
fn within(text: &str, least: u64, most: u64) -> bool {
    text.len() == 2 && digits(text).is_some_and(|number| (least..=most).contains(&number))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finite_numbers_read_back_exactly() {
        let samples =
            [0.0, -0.0, 0.1, 1.0 / 3.0, -2.5e-7, 1e16, 5e-324, f64::MIN_POSITIVE, f64::MAX, f64::MIN];
        for x in samples {
            let text = Number(x).to_string();
            assert_eq!(text.parse::<f64>().map(f64::to_bits), Ok(x.to_bits()), "{text}");
            assert!(text.len() < 30, "{text}");
        }
    }

    #[test]
    fn special_numbers_are_spelled_as_in_xml_schema() {
        let texts = [f64::INFINITY, f64::NEG_INFINITY, f64::NAN].map(|x| Number(x).to_string());
        assert_eq!(texts, ["INF", "-INF", "NaN"]);
    }
}
