//! The simple types of XML Schema that the FMI 2.0 schema uses.

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
    /// Whether the text is such a value; if not, what is allowed.
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
            Self::DateTime => (date_time(text), "a date and time such as 2026-01-31T23:59:59Z".to_owned()),
            Self::OneOf(list) => (list.contains(&text), format!("one of {}", one_of(list))),
            Self::Words(list) => {
                (words(text).all(|word| list.contains(&word)), format!("words out of {}", one_of(list)))
            }
            Self::Version => (text == "2.0", "\"2.0\"".to_owned()),
        };
        if good { Ok(()) } else { Err(allowed) }
    }
}

/// White space of XML, which is less than that of Unicode.
fn trimmed(text: &str) -> &str {
    text.trim_matches([' ', '\t', '\n', '\r'])
}

/// The words of a list.
pub(in crate::validate) fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split([' ', '\t', '\n', '\r']).filter(|word| !word.is_empty())
}

/// An `xs:boolean`.
pub(in crate::validate) fn boolean(text: &str) -> Option<bool> {
    match trimmed(text) {
        "true" | "1" => Some(true),
        "false" | "0" => Some(false),
        _ => None,
    }
}

/// An `xs:int`.
pub(in crate::validate) fn int(text: &str) -> Option<i32> {
    trimmed(text).parse().ok()
}

/// An `xs:unsignedInt`.
pub(in crate::validate) fn unsigned(text: &str) -> Option<u32> {
    let text = trimmed(text);
    // "-0" is one too.
    if text.strip_prefix('-').is_some_and(|rest| !rest.is_empty() && rest.bytes().all(|b| b == b'0')) {
        return Some(0);
    }
    text.parse().ok()
}

/// An `xs:double`. Rust reads more than that: `inf`, `infinity`, `nan`.
pub(in crate::validate) fn double(text: &str) -> Option<f64> {
    match trimmed(text) {
        "INF" => Some(f64::INFINITY),
        "-INF" => Some(f64::NEG_INFINITY),
        "NaN" => Some(f64::NAN),
        text if text.bytes().all(|b| b.is_ascii_digit() || b"+-.eE".contains(&b)) => text.parse().ok(),
        _ => None,
    }
}

/// An `xs:dateTime`: `[-]YYYY-MM-DDThh:mm:ss[.f][Z|(+|-)hh:mm]`.
fn date_time(text: &str) -> bool {
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
        && number(year).is_some_and(|year| year > 0)
        && within(month, 1, 12)
        && within(day, 1, days_in_month(number(year).unwrap_or(0), number(month).unwrap_or(0)));
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

fn number(text: &str) -> Option<u64> {
    if text.bytes().all(|b| b.is_ascii_digit()) { text.parse().ok() } else { None }
}

/// Two digits between the bounds.
fn within(text: &str, least: u64, most: u64) -> bool {
    text.len() == 2 && number(text).is_some_and(|number| (least..=most).contains(&number))
}

fn days_in_month(year: u64, month: u64) -> u64 {
    let leap = year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    match month {
        2 => 28 + u64::from(leap),
        4 | 6 | 9 | 11 => 30,
        _ => 31,
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
