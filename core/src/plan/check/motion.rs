//! Extrapolation of a number that has nearly died away, from its values at the ends of a few windows of time.

use alloc::vec::Vec;

use crate::interval::Interval;

/// The extrapolated motion of a number, window by window: a constant creep plus a series that dies away.
#[derive(Clone, Copy)]
pub(super) struct Motion {
    /// Change per window, and the error bound on that.
    creep: f64,
    unsure: f64,
    /// The sum of the series, and the most that it reaches on the way.
    end: f64,
    series: f64,
}

impl Motion {
    /// The motion of a number with the values `last` at the ends of the last four windows and at their start. The first
    /// three changes and the last three give two estimates of the creep, whose difference is part of its error bound. `None`
    /// if the changes do not die away.
    pub(super) fn of(last: [f64; 5], round_off: f64) -> Option<Self> {
        let change = |k: usize| last[k + 1] - last[k];
        let [before, now] = [0, 1].map(|k| told_apart([change(k), change(k + 1), change(k + 2)], round_off));
        let ([other, ..], [creep, unsure, end, series]) = (before?, now?);
        Some(Self { creep, unsure: unsure + (creep - other).abs(), end, series })
    }

    /// The most by which it moves in `windows` windows. A creep towards the inside counts too, since it may be a slow series
    /// that will end.
    pub(super) fn to_come(self, windows: f64) -> f64 {
        self.series + (self.creep.abs() + self.unsure) * windows
    }

    /// Where a number that is at `x` will be after a `part` of the next `windows` windows.
    pub(super) fn at(&self, x: f64, part: f64, windows: f64) -> f64 {
        x + (self.end + self.creep * windows) * part
    }

    /// Encloses a number that is at `x` from one number of windows on to another.
    pub(super) fn over(&self, x: f64, [from, to]: [f64; 2]) -> Interval {
        let (a, b, wide) = (self.creep * from, self.creep * to, self.series + self.unsure * to);
        Interval::new(x + a.min(b) - wide, x + a.max(b) + wide)
    }
}

/// Splits three successive changes by Aitken's process, on the assumption that they are a geometric series plus a constant
/// creep. Returns the creep, what round-off may hide of it, the sum of the series to come, and the most that it reaches on
/// the way. `None` if the differences between the changes do not die away.
fn told_apart([first, before, now]: [f64; 3], round_off: f64) -> Option<[f64; 4]> {
    let (bent, bends) = (before - first, now - before);
    if bends.abs() <= round_off {
        return Some([if now.abs() <= round_off { 0.0 } else { now }, 0.0, 0.0, 0.0]);
    }
    let dies_away = bends.abs() < bent.abs();
    dies_away.then(|| {
        let ratio = bends / bent;
        let decays = bends * ratio / (ratio - 1.0);
        let unsure = 2.0 * round_off / ((1.0 - ratio) * (1.0 - ratio));
        let next = decays * ratio;
        [now - decays, unsure, next / (1.0 - ratio), next.abs() / (1.0 - ratio.abs())]
    })
}

/// The extrapolated states at the ends of as many `intervals` of the next `windows` windows.
pub(super) fn states_along(
    ahead: &[(f64, Motion)],
    windows: f64,
    intervals: u32,
) -> impl Iterator<Item = Vec<f64>> {
    (0..=intervals).map(move |instant| {
        let part = f64::from(instant) / f64::from(intervals);
        ahead.iter().map(|(x, motion)| motion.at(*x, part, windows)).collect()
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::Motion;

    /// The most by which a number moves in a million windows.
    fn to_come(last: [f64; 5], round_off: f64) -> Option<f64> {
        Motion::of(last, round_off).map(|motion| motion.to_come(1e6))
    }

    proptest! {
        /// For a geometric series above a creep, both of any sign and size, what is to come is known.
        #[test]
        fn a_decay_and_a_creep_are_told_apart(
            decays in -1.0..1.0_f64,
            creep in -1.0..1.0_f64,
            ratio in -0.95..0.95_f64,
            windows in 10..1000_u32,
        ) {
            let series = |k: u32| decays * (0..k).map(|_| ratio).product::<f64>();
            let h = |k: u32| series(k) + creep * f64::from(k);
            let motion = Motion::of([0, 1, 2, 3, 4].map(h), 1e-14).expect("a decay and a creep");
            let moves = motion.to_come(f64::from(windows));
            let moved = (0..=windows).map(|k| (h(4 + k) - h(4)).abs()).fold(0.0, f64::max);
            prop_assert!(moves >= moved, "{moves} {moved}");
            // No more than each by itself, plus what round-off of 1e-14 hides in a creep.
            let apart = series(4).abs() * (1.0 - ratio) / (1.0 - ratio.abs());
            let apart = apart + creep.abs() * f64::from(windows);
            prop_assert!(moves <= apart + 1e-9 * f64::from(windows), "{moves} {apart}");
            // And where it is in between.
            let half = windows / 2;
            for [from, to] in [[0, half], [half, windows]] {
                let over = motion.over(h(4), [f64::from(from), f64::from(to)]);
                for k in from..=to {
                    prop_assert!(over.low <= h(4 + k) && h(4 + k) <= over.high, "{over:?} {}", h(4 + k));
                }
            }
        }
    }

    #[test]
    fn what_gathers_pace_or_is_no_number_has_no_end() {
        assert_eq!(to_come([0.5, 0.0, -1.0, -2.5, -5.0], 0.0), None);
        assert_eq!(to_come([0.0, 0.0, 1.0, 1.0, 0.0], 0.0), None);
        assert_eq!(to_come([f64::NAN, 1.0, 1.5, 1.75, 1.875], 0.0), None);
        assert_eq!(to_come([0.0, 1.0, 2.0, 2.5, f64::NEG_INFINITY], 0.0), None);
        assert_eq!(to_come([1.0; 5], 1e-14), Some(0.0));
    }

    /// A fast decay above a slow one does not hide a creep as large as the slow one.
    #[test]
    fn what_two_decays_hide_is_not_taken_as_known() {
        let power = |base: f64, k: u32| (0..k).map(|_| base).product::<f64>();
        // The last three changes alone say that h rises.
        let h = |k: u32| -2.58e-3 * power(0.984, k) + 3.68e-5 * power(0.483, k) - 9.08e-7 * f64::from(k);
        assert!(to_come([0, 1, 2, 3, 4].map(h), 1e-14).expect("a decay and a creep") > 0.9);
    }
}
