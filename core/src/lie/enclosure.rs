//! An enclosure of all states to which a held input leads within a time.

use crate::interval::Interval;

/// Largest number of trials. The second knows which states begin to move, the others what those move.
const TRIALS: u32 = 8;

/// Encloses the states until `dt` s after `x`, where their rate is `rate`, and their rates until then: `[i][0]` and `[i][1]`
/// of `states`. `rates` writes the latter to `[i][1]` for the former. Returns whether it succeeded.
///
/// A box that contains x + \[0, dt\] ẋ(box) contains the path (Picard and Lindelöf).
///
/// Source: R. E. Moore, R. B. Kearfott and M. J. Cloud, *Introduction to Interval Analysis*, SIAM (2009), section 10.4.
#[cfg_attr(not(feature = "small"), inline(always))]
pub fn enclose(
    x: &[f64],
    dt: f64,
    rate: &[f64],
    states: &mut [[Interval; 2]],
    mut rates: impl FnMut(&mut [[Interval; 2]]),
) -> bool {
    /// Part of its width by which a trial is widened at either end.
    const WIDER: f64 = 0.5;
    for ((state, x), rate) in states.iter_mut().zip(x).zip(rate) {
        state[0] = Interval::new(-WIDER, 1.0 + WIDER) * (rate * dt) + *x;
    }
    for _ in 0..TRIALS {
        rates(states);
        let mut holds = true;
        for ([state, rate], x) in states.iter_mut().zip(x) {
            let (low, high) = (x + dt * rate.low.min(0.0), x + dt * rate.high.max(0.0));
            holds &= state.low <= low && high <= state.high;
            *state = Interval::new(low, high);
        }
        if holds {
            return true;
        }
        for [state, _] in states.iter_mut() {
            let wider = WIDER * (state.high - state.low);
            *state = Interval::new(state.low - wider, state.high + wider);
        }
    }
    false
}

/// The greater of two lower bounds on a quantity that begins at `h`, has its values from `low` up and its rate in `slope`
/// for `dt` s. The second follows from the mean value theorem, and is greater if much of what moves h cancels.
#[cfg_attr(not(feature = "small"), inline(always))]
pub fn sharper(low: f64, h: f64, slope: Interval, dt: f64) -> f64 {
    let risen = h + dt * slope.low.min(0.0);
    // NaN is not a bound.
    if risen > low { risen } else { low }
}
