//! The simple types of XML Schema that the FMI 2.0 schema uses, and the texts that they accept.

use punctual_modeldescription::xsd::{boolean, double, int, is_date_time, unsigned, words};

/// The type of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Value {
    /// `xs:string`.
    Text,
    /// `xs:normalizedString`: a parser makes blanks of its line breaks.
    Line,
    /// `xs:boolean`.
    Boolean,
    /// `xs:int`.
    Int,
    /// `xs:unsignedInt`.
    Unsigned,
    /// A list of `xs:unsignedInt`.
    UnsignedList,
    /// `xs:double`.
    Double,
    /// `xs:dateTime`.
    DateTime,
    /// One of these words.
    OneOf(&'static [&'static str]),
    /// A list of these words.
    Words(&'static [&'static str]),
    /// The version of the standard.
    Version,
}

impl Value {
    /// Accepts a text that is such a value; else says what is allowed.
    pub(super) fn accepts(self, text: &str) -> Result<(), String> {
        let one_of = |words: &[&str]| words.join(", ");
        let (good, allowed) = match self {
            Self::Text | Self::Line => (true, String::new()),
            Self::Boolean => (boolean(text).is_some(), "true, false, 1 or 0".to_owned()),
            Self::Int => (int(text).is_some(), "an integer of 32 bits".to_owned()),
            Self::Unsigned => (unsigned(text).is_some(), "an integer, 0 to 4294967295".to_owned()),
            Self::UnsignedList => (
                words(text).all(|word| unsigned(word).is_some()),
                "integers, 0 to 4294967295, with blanks between them".to_owned(),
            ),
            Self::Double => (double(text).is_some(), "a number such as 1.5e-3, INF, -INF or NaN".to_owned()),
            Self::DateTime => (is_date_time(text), "a date and time such as 2026-01-31T23:59:59Z".to_owned()),
            Self::OneOf(list) => (list.contains(&text), format!("one of {}", one_of(list))),
            Self::Words(list) => {
                (words(text).all(|word| list.contains(&word)), format!("words out of {}", one_of(list)))
            }
            Self::Version => (text == "2.0", "\"2.0\"".to_owned()),
        };
        if good { Ok(()) } else { Err(allowed) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_xml_schema() {
        let cases: [(Value, &[&str], &[&str]); 7] = [
            (Value::Boolean, &["true", "0", " 1 "], &["True", "yes", ""]),
            (Value::Int, &["-5", "+5", "2147483647"], &["2147483648", "1.0", "", "x"]),
            (Value::Unsigned, &["0", "4294967295", "-0"], &["-1", "4294967296", "-", "1e3"]),
            (Value::UnsignedList, &["", "1 2  3"], &["1,2", "a"]),
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
