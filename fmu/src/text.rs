//! Formats numbers for the reader, in every text that is not machine-readable: four significant digits, and
//! no unit 1.

/// Digits after the first one.
const MORE: usize = 3;

/// The largest relative round-off of a number: within it of a short number, the short number is shown.
const ROUND_OFF: f64 = 1e-9;

/// From here on, whole numbers use exponent notation, as other numbers do from 10⁴ on.
const LONG: f64 = 1e6;

/// A number for the reader: four significant digits, or all digits of a whole number below 10⁶; exponent
/// notation if it helps.
pub fn number(value: f64) -> String {
    if !value.is_finite() {
        return value.to_string();
    }
    // Adding 0 removes the sign of -0.
    if value.abs() < LONG && value.floor() == value {
        return (value + 0.0).to_string();
    }
    let rounded = format!("{value:.MORE$e}");
    let (mantissa, exponent) = rounded.split_once('e').unwrap_or((&rounded, "0"));
    match exponent.parse() {
        Ok(exponent @ -4..=3) => {
            let digits = usize::try_from(MORE as i32 - exponent).unwrap_or_default();
            trimmed(&format!("{value:.digits$}")).to_owned()
        }
        _ => format!("{}e{exponent}", trimmed(mantissa)),
    }
}

/// A [`number`] that is not below `value`, which is finite: for a value that must be reached, such as a
/// deadline.
pub fn number_above(value: f64) -> String {
    let text = number(value);
    if text.parse().is_ok_and(|read: f64| read < value - ROUND_OFF * value.abs()) {
        number(value + half_unit(value))
    } else {
        text
    }
}

/// A [`number`] that is not above `value`, which is finite: for a time until which something is certain.
pub fn number_below(value: f64) -> String {
    let text = number(value);
    if text.parse().is_ok_and(|read: f64| read > value + ROUND_OFF * value.abs()) {
        number(value - half_unit(value))
    } else {
        text
    }
}

/// Half a unit of the last digit shown.
fn half_unit(value: f64) -> f64 {
    let text = format!("{value:e}");
    let exponent = text.split_once('e').and_then(|(_, exponent)| exponent.parse().ok());
    exponent.map_or(0.0, |exponent: i32| format!("5e{}", exponent - MORE as i32 - 1).parse().unwrap_or(0.0))
}

/// A [`number`] with its unit, if it has one.
pub fn quantity(value: f64, unit: &str) -> String {
    match shown_unit(unit) {
        "" => number(value),
        unit => format!("{} {unit}", number(value)),
    }
}

/// The unit for display, which is empty for 1.
pub fn shown_unit(unit: &str) -> &str {
    if unit == "1" { "" } else { unit }
}

/// A name with the unit of its numbers, as for an axis: "h (m)"; only the name if there is no unit.
pub fn labelled(name: &str, unit: &str) -> String {
    match shown_unit(unit) {
        "" => name.to_owned(),
        unit => format!("{name} ({unit})"),
    }
}

fn trimmed(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let cases = [
            (0.0, "0"),
            (-0.0, "0"),
            (10.0, "10"),
            (-31_949.775_4, "-3.195e4"),
            (-31_949.0, "-31949"),
            (0.001, "0.001"),
            (1.0 / 3.0, "0.3333"),
            (0.020_006_1, "0.02001"),
            (0.000_571, "0.000571"),
            (1.5e-9, "1.5e-9"),
            (9999.4, "9999"),
            (9999.96, "1e4"),
            (1_000_099_999_996.595, "1e12"),
            (123_456_789.0, "1.235e8"),
            (f64::MIN_POSITIVE, "2.225e-308"),
            (f64::INFINITY, "inf"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }

    /// For numbers of every size, the text reads back to within half a unit of the fourth digit, and it is
    /// short.
    #[test]
    fn numbers_keep_four_digits() {
        let mut bits = 1_u64;
        for _ in 0..100_000 {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let mantissa = 1.0 + (bits >> 11) as f64 / (1_u64 << 53) as f64;
            let value = mantissa * 10_f64.powi(i32::from((bits >> 3) as u8) - 128);
            let text = number(-value);
            let read: f64 = text.parse().expect("a number");
            assert!((read + value).abs() <= 0.5e-3 * value * (1.0 + 1e-9), "{value:e} is shown as {text}");
            assert!(text.len() <= 11, "{text}");
            let [above, below] = [number_above, number_below].map(|shown| shown(value));
            let [high, low] = [&above, &below].map(|text| text.parse::<f64>().expect("a number"));
            let off = ROUND_OFF * value;
            assert!(low <= value + off && value <= high + off, "{below} <= {value:e} <= {above}");
            assert!(high - low <= 1.001e-3 * value, "{below} and {above}");
        }
    }

    #[test]
    fn a_unit_of_1_is_not_shown() {
        assert_eq!(["1", "", "m"].map(|unit| quantity(0.5, unit)), ["0.5", "0.5", "0.5 m"]);
        assert_eq!(["1", "", "m"].map(|unit| labelled("h", unit)), ["h", "h", "h (m)"]);
    }
}
