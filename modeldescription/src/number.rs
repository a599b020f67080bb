//! Doubles as `xs:double` text that reads back as exactly the same bits (NaN payloads aside).

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
            // `Debug` changes to an exponent where `Display` would print hundreds of zeros.
            x => write!(f, "{x:?}"),
        }
    }
}

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
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
