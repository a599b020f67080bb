//! Maps values to pixels along one axis: the range shown, its ticks and their labels.

use punctual_core::elementary;

/// An axis in numbers.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    /// The values at both ends (powers of ten if logarithmic); `low < high`.
    pub(super) low: f64,
    /// See `low`.
    pub(super) high: f64,
    /// Whether values are drawn logarithmically.
    pub(super) logarithmic: bool,
    /// Ticks with their labels.
    pub(super) ticks: Vec<(f64, String)>,
}

impl Axis {
    /// A linear axis that shows at least `low` to `high` with about `count` ticks. With `widen` the ends move
    /// out to the next tick.
    pub(super) fn linear(low: f64, high: f64, count: usize, widen: bool) -> Self {
        let (mut low, mut high) = if low < high {
            (low, high)
        } else {
            // A constant is shown in the middle of a range as wide as its magnitude.
            let half = if low == 0.0 { 1.0 } else { low.abs() / 2.0 };
            (low - half, low + half)
        };
        let step = nice_step((high - low) / count.max(1) as f64);
        if widen {
            low = (low / step + 1e-9).floor() * step;
            high = (high / step - 1e-9).ceil() * step;
        }
        let first = (low / step - 1e-9).ceil() as i64;
        let last = (high / step + 1e-9).floor() as i64;
        let ticks = (first..=last).map(|i| i as f64 * step).map(|v| (v, label(v, step))).collect();
        Self { low, high, logarithmic: false, ticks }
    }

    /// A logarithmic axis that shows at least `low` to `high` (0 < low ≤ high), with its ends at powers of
    /// ten.
    pub(super) fn logarithmic(low: f64, high: f64) -> Self {
        let mut from = (elementary::log10(low) + 1e-9).floor() as i32;
        let mut to = (elementary::log10(high) - 1e-9).ceil() as i32;
        if from >= to {
            (from, to) = (from - 1, from + 1);
        }
        let every = ((to - from) as usize).div_ceil(8);
        let ticks = (from..=to)
            .step_by(every)
            .map(|e| (elementary::powi(10.0, e), format!("10{}", superscript(e))))
            .collect();
        Self { low: elementary::powi(10.0, from), high: elementary::powi(10.0, to), logarithmic: true, ticks }
    }

    /// The position of `value`: 0 at the low end, 1 at the high end; NaN if it has none.
    pub(super) fn fraction(&self, value: f64) -> f64 {
        if self.logarithmic {
            if value == 0.0 {
                return f64::NAN;
            }
            let (low, high) = (elementary::log10(self.low), elementary::log10(self.high));
            (elementary::log10(value.abs()) - low) / (high - low)
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }
}

/// The number closest to `rough` (> 0) among 1, 2 or 5 times a power of ten.
fn nice_step(rough: f64) -> f64 {
    let power = elementary::powf(10.0, elementary::log10(rough).floor());
    let factor = match rough / power {
        f if f < 1.5 => 1.0,
        f if f < 3.5 => 2.0,
        f if f < 7.5 => 5.0,
        _ => 10.0,
    };
    factor * power
}

/// A tick label with the digits that `step` requires and a true minus sign.
fn label(value: f64, step: f64) -> String {
    let largest = value.abs().max(step);
    let text = if largest >= 1e6 || step < 1e-4 {
        let text = format!("{value:.2e}");
        let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
        let exponent = exponent.parse().unwrap_or(0);
        if value == 0.0 { "0".to_owned() } else { format!("{mantissa}·10{}", superscript(exponent)) }
    } else {
        // Steps are 1, 2 or 5 times a power of ten.
        let digits = (-(elementary::log10(step) + 1e-9).floor()).max(0.0);
        format!("{value:.*}", digits as usize)
    };
    let zero = text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.');
    if zero { text.trim_start_matches('-').to_owned() } else { text.replace('-', "−") }
}

/// An integer in superscript digits.
pub(super) fn superscript(number: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raise = |c: char| c.to_digit(10).map_or('⁻', |d| DIGITS[d as usize]);
    number.to_string().chars().map(raise).collect()
}

/// The least and the greatest finite value.
pub fn extent(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    values.into_iter().filter(|v| v.is_finite()).fold(None, |range, v| match range {
        None => Some((v, v)),
        Some((low, high)) => Some((low.min(v), high.max(v))),
    })
}

/// The values at two percentiles (0 to 100) of the finite values.
pub(super) fn percentiles(values: impl IntoIterator<Item = f64>, low: f64, high: f64) -> Option<(f64, f64)> {
    let mut sorted: Vec<f64> = values.into_iter().filter(|v| v.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let at =
        |percent: f64| sorted[((percent.clamp(0.0, 100.0) / 100.0 * last as f64).round() as usize).min(last)];
    Some((at(low), at(high)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<&str> {
        axis.ticks.iter().map(|(_, label)| label.as_str()).collect()
    }

    #[test]
    fn linear_ticks_are_round_numbers() {
        assert_eq!(labels(&Axis::linear(0.0, 20.0, 5, false)), ["0", "5", "10", "15", "20"]);
        let axis = Axis::linear(-0.3, 0.3, 6, true);
        assert_eq!(labels(&axis), ["−0.3", "−0.2", "−0.1", "0.0", "0.1", "0.2", "0.3"]);
        assert_eq!(labels(&Axis::linear(0.0, 1e-3, 2, false)), ["0.0000", "0.0005", "0.0010"]);
        let wide = Axis::linear(-3.0, 47.0, 5, true);
        assert_eq!((wide.low, wide.high), (-10.0, 50.0));
        assert_eq!(labels(&Axis::linear(0.0, 4e6, 4, false))[1], "1·10⁶");
    }

    #[test]
    fn constants_and_zeros_get_a_range() {
        assert_eq!(
            (Axis::linear(0.0, 0.0, 4, false).low, Axis::linear(4.0, 4.0, 4, false).high),
            (-1.0, 6.0)
        );
        assert!(Axis::logarithmic(3.0, 3.0).low < 3.0);
    }

    #[test]
    fn logarithmic_axes_end_at_powers_of_ten() {
        let axis = Axis::logarithmic(0.02, 31_950.0);
        assert_eq!((axis.low, axis.high), (0.01, 100_000.0));
        assert_eq!(labels(&axis)[0], "10⁻²");
        assert!((axis.fraction(-10.0) - 3.0 / 7.0).abs() < 1e-12);
        assert!(axis.fraction(0.0).is_nan());
    }

    #[test]
    fn percentiles_leave_out_the_extremes() {
        let values = (0..=1000).map(f64::from).chain([1e9, f64::NAN]);
        let (low, high) = percentiles(values, 1.0, 99.0).unwrap();
        assert!((9.0..=11.0).contains(&low) && (989.0..=992.0).contains(&high), "{low} {high}");
        assert_eq!(percentiles([f64::NAN], 0.0, 100.0), None);
    }
}
