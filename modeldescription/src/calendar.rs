//! The parts of the Gregorian calendar that dates in the description and the archive need.

/// The days of a month (1 to 12) of a year; 0 for a month that does not exist.
pub(crate) fn days_in_month(year: u64, month: u64) -> u64 {
    let leap = year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    match month {
        2 => 28 + u64::from(leap),
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => 0,
    }
}

/// Whether a text is an instant in UTC of the form `YYYY-MM-DDThh:mm:ssZ`.
pub(crate) fn is_utc_instant(text: &str) -> bool {
    const SHAPE: &[u8] = b"0000-00-00T00:00:00Z";
    let bytes = text.as_bytes();
    let shaped = bytes.len() == SHAPE.len()
        && bytes.iter().zip(SHAPE).all(|(b, s)| if *s == b'0' { b.is_ascii_digit() } else { b == s });
    let number = |from: usize, to: usize| text.get(from..to).and_then(|t| t.parse::<u64>().ok()).unwrap_or(0);
    shaped
        && number(0, 4) > 0
        && (1..=days_in_month(number(0, 4), number(5, 7))).contains(&number(8, 10))
        && number(11, 13) < 24
        && number(14, 16) < 60
        && number(17, 19) < 60
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn utc_instants() {
        assert!(["2026-01-31T23:59:59Z", "2024-02-29T00:00:00Z"].into_iter().all(is_utc_instant));
        let bad = [
            "",
            "2026-01-31",
            "2026-01-31T23:59:59",
            "2026-01-31T24:00:00Z",
            "2025-02-29T00:00:00Z",
            "2026-13-01T00:00:00Z",
            "2026-00-01T00:00:00Z",
            "0000-01-01T00:00:00Z",
            "2026-01-31T23:59:59\u{e4}",
        ];
        assert!(!bad.into_iter().any(is_utc_instant));
    }
}
