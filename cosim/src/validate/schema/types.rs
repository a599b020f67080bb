//! The simple types of XML Schema that the schemas of FMI use, and the texts that each accepts.

use punctual_modeldescription::xsd::{boolean, double, hexadecimal, integer, is_date_time, words};

/// The type of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Value {
    /// `xs:string`.
    Text,
    /// `xs:normalizedString`: a parser replaces its line breaks by blanks.
    Line,
    /// `xs:boolean`.
    Boolean,
    /// An integer type such as `xs:int`, by its least and greatest value.
    Whole(i128, i128),
    /// `xs:double` or `xs:float`.
    Double,
    /// `xs:hexBinary`.
    Bytes,
    /// A list of values of another type.
    List(&'static Value),
    /// `xs:dateTime`.
    DateTime,
    /// One of these words.
    OneOf(&'static [&'static str]),
    /// A list of these words.
    Words(&'static [&'static str]),
    /// The version of the standard: exactly this one, or for FMI 3.0 any that its schema accepts.
    Version(&'static str),
}

/// `xs:int`.
pub(super) const INT: Value = Value::Whole(i32::MIN as i128, i32::MAX as i128);
/// `xs:unsignedInt`.
pub(super) const UNSIGNED: Value = Value::Whole(0, u32::MAX as i128);

impl Value {
    /// Accepts a text that is such a value; otherwise returns what is allowed.
    pub(super) fn accepts(self, text: &str) -> Result<(), String> {
        let one_of = |words: &[&str]| words.join(", ");
        let (good, allowed) = match self {
            Self::Text | Self::Line => (true, String::new()),
            Self::Boolean => (boolean(text).is_some(), "true, false, 1 or 0".to_owned()),
            Self::Whole(least, most) => {
                let good = integer(text).is_some_and(|value: i128| (least..=most).contains(&value));
                let bits = most.ilog2() + 2;
                (
                    good,
                    if least == 0 {
                        format!("an integer, 0 to {most}")
                    } else {
                        format!("an integer of {bits} bits")
                    },
                )
            }
            Self::Double => (double(text).is_some(), "a number such as 1.5e-3, INF, -INF or NaN".to_owned()),
            Self::Bytes => {
                (hexadecimal(text).is_some(), "bytes in hexadecimal digits, such as 0FA0".to_owned())
            }
            Self::List(of) => match words(text).find_map(|word| of.accepts(word).err()) {
                None => (true, String::new()),
                Some(allowed) => {
                    let several =
                        allowed.replacen("an integer", "integers", 1).replacen("a number", "numbers", 1);
                    (false, format!("{several}, with blanks between them"))
                }
            },
            Self::DateTime => (is_date_time(text), "a date and time such as 2026-01-31T23:59:59Z".to_owned()),
            Self::OneOf(list) => (list.contains(&text), format!("one of {}", one_of(list))),
            Self::Words(list) => {
                (words(text).all(|word| list.contains(&word)), format!("words out of {}", one_of(list)))
            }
            Self::Version(version) => (text == version || is_fmi3(version, text), format!("{version:?}")),
        };
        if good { Ok(()) } else { Err(allowed) }
    }
}

/// Whether a text is a version of FMI 3: `3.MINOR` or `3.MINOR.PATCH`; a draft has a suffix after a dash.
fn is_fmi3(wanted: &str, text: &str) -> bool {
    let Some(rest) = text.strip_prefix("3.").filter(|_| wanted.starts_with('3')) else { return false };
    let (numbers, suffix) = rest.split_once('-').map_or((rest, None), |(head, tail)| (head, Some(tail)));
    let parts: Vec<&str> = numbers.split('.').collect();
    let is_number = |part: &&str| {
        !part.is_empty()
            && part.bytes().all(|b| b.is_ascii_digit())
            && (part.len() == 1 || !part.starts_with('0'))
    };
    parts.len() <= 2 && parts.iter().all(is_number) && suffix.is_none_or(|suffix| !suffix.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_xml_schema() {
        let cases: [(Value, &[&str], &[&str]); 10] = [
            (Value::Boolean, &["true", "0", " 1 "], &["True", "yes", ""]),
            (INT, &["-5", "+5", "2147483647"], &["2147483648", "1.0", "", "x"]),
            (UNSIGNED, &["0", "4294967295", "-0"], &["-1", "4294967296", "-", "1e3"]),
            (Value::List(&UNSIGNED), &["", "1 2  3"], &["1,2", "a"]),
            (
                Value::Double,
                &["1.", ".5", "-1e-3", "INF", "-INF", "NaN"],
                &["inf", "nan", "1,5", "", "+INF", "e"],
            ),
            (
                Value::DateTime,
                &[
                    "2026-02-28T00:00:00Z",
                    "2024-02-29T23:59:59.5+14:00",
                    "2026-01-01T24:00:00",
                    "-0001-01-01T00:00:00",
                ],
                &[
                    "2026-02-29T00:00:00Z",
                    "2026-01-01",
                    "2026-01-01T25:00:00Z",
                    "2026-01-01T00:00:00Q",
                    "26-01-01T00:00:00",
                ],
            ),
            (Value::Whole(-128, 127), &["-128", "127", "-0"], &["128", "-129", "0x1"]),
            (Value::Bytes, &["", "0fA0"], &["0fA", "0g"]),
            (
                Value::Version("3.0"),
                &["3.0", "3.0.2", "3.12", "3.0-alpha.2"],
                &["3", "3.", "3.01", "3.0.0.1", "2.0", "3.0-", "3.x"],
            ),
            (Value::Words(&["fixed", "dependent"]), &["", "fixed fixed"], &["fixed free"]),
        ];
        for (value, good, bad) in cases {
            for text in good {
                assert!(value.accepts(text).is_ok(), "{value:?} {text:?}");
            }
            for text in bad {
                assert!(value.accepts(text).is_err(), "{value:?} {text:?}");
            }
        }
    }
}
