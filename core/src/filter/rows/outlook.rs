//! The outlook of a sample: whether the held input keeps the promise at every instant until the next sample
//! (`docs/theory.md#between-samples`).

use super::errors::Shortfall;
use super::hold::{Hold, Lowest};
use super::search::Requirement;
use super::{FixedTimeState, Phase, SAME_PERIOD};
use crate::convergence::sampled::PeriodBound;
use crate::elementary::dot;
use crate::qp::Row;
use crate::{MAX_INPUTS, MAX_RELATIVE_DEGREE};

/// The part of h that must be left for h to count as far from its edge.
const CLEAR: f64 = 0.5;

/// The evolution of h until the next sample, as the derivatives at a sample predict it.
#[derive(Clone, Copy)]
pub(super) struct Outlook<'a> {
    pub(super) n: usize,
    /// h⁽⁰⁾ … h⁽ⁿ⁻¹⁾, then L_fⁿh.
    pub(super) drift: &'a [f64; MAX_RELATIVE_DEGREE + 1],
    /// How far h may fall short of it.
    pub(super) shortfall: Option<&'a Shortfall>,
    /// h⁽⁰⁾ … h⁽ⁿ⁻¹⁾ that many seconds later under the held input, by the model, if known.
    pub(super) known: Option<(f64, &'a [f64; MAX_RELATIVE_DEGREE])>,
}

/// The interval (s after the sample at `t`) on which a promise requires h ≥ 0 while an input is held for `hold` s, if there
/// is one. In a set that is kept, the hold may last as long as `long` (s).
#[cfg_attr(not(feature = "small"), inline(always))]
pub(super) fn span(promise: &FixedTimeState, t: f64, [hold, long]: [f64; 2]) -> Option<[f64; 2]> {
    match promise.phase {
        Phase::Stay => Some([0.0, long]),
        Phase::Approach => {
            let from = (promise.anchor_time + promise.deadline - t).max(0.0);
            // The deadline at the very end of the hold is within it.
            (from <= hold * (1.0 + SAME_PERIOD)).then(|| [from.min(hold), hold])
        }
        _ => None,
    }
}

impl Outlook<'_> {
    /// h⁽ʲ⁾ `s` seconds later by the Taylor polynomial of order `n` of h, with h⁽ⁿ⁾ = `highest`.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn forecast(&self, n: usize, j: usize, highest: f64, s: f64) -> f64 {
        // Horner's scheme.
        (j..n).rev().fold(highest, |sum, k| self.drift[k] + sum * s / (k + 1 - j) as f64)
    }

    /// The shortfall `s` seconds later.
    fn short(&self, s: f64) -> f64 {
        self.shortfall.map_or(0.0, |shortfall| shortfall.at(s)[0])
    }

    /// The most by which the terms of that polynomial after the first can move h.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn moved<const N: usize>(&self, highest: f64, s: f64) -> f64 {
        let (mut power, mut sum) = (1.0, 0.0);
        for k in 1..=N {
            power *= s / k as f64;
            sum += power * if k == N { highest } else { self.drift[k] }.abs();
        }
        sum
    }

    /// The row of `requirement`, which is on h alone, to the order n; `normal` is that of h⁽ⁿ⁾.
    pub(super) fn row_at(&self, requirement: &Requirement, normal: &[f64; MAX_INPUTS]) -> Row {
        let s = requirement.ahead;
        let power = (1..=self.n).fold(1.0, |power, k| power * s / k as f64);
        let floor = (requirement.bound.floor - self.forecast(self.n, 0, self.drift[self.n], s)) / power;
        Row { normal: *normal, floor }
    }

    /// The instant of the [`span`] at which the promise is broken along the model, if it is.
    pub(super) fn look(
        &self,
        promise: &FixedTimeState,
        held: &Hold,
        normal: &[f64; MAX_INPUTS],
        span: [f64; 2],
        scratch: &mut [f64],
    ) -> Option<Lowest> {
        // With n known to the compiler the short loops unroll.
        match self.n {
            1 => self.look_to::<1>(promise, held, normal, span, scratch),
            2 => self.look_to::<2>(promise, held, normal, span, scratch),
            3 => self.look_to::<3>(promise, held, normal, span, scratch),
            4 => self.look_to::<4>(promise, held, normal, span, scratch),
            5 => self.look_to::<5>(promise, held, normal, span, scratch),
            6 => self.look_to::<6>(promise, held, normal, span, scratch),
            7 => self.look_to::<7>(promise, held, normal, span, scratch),
            _ => self.look_to::<8>(promise, held, normal, span, scratch),
        }
    }

    /// [`Self::look`] for n = `N`.
    fn look_to<const N: usize>(
        &self,
        promise: &FixedTimeState,
        held: &Hold,
        normal: &[f64; MAX_INPUTS],
        [from, hold]: [f64; 2],
        scratch: &mut [f64],
    ) -> Option<Lowest> {
        /// Round-off, as a part of the size of h.
        const ROUND_OFF: f64 = 1e-12;
        // The value at the end of the hold is the least: a shortfall grows.
        let h = self.drift[0] - self.short(hold);
        let highest = self.drift[N] + dot(normal, held.u);
        let is_far = h > 0.0 && self.moved::<N>(highest, hold) <= (1.0 - CLEAR) * h;
        let floor = if is_far { held.floor(hold) } else { None };
        if floor.map_or(is_far && self.agrees::<N>(held, highest, h, hold), |floor| floor >= 0.0) {
            return None;
        }
        let size = promise.anchor[0].abs() + promise.margin + h.abs();
        let lowest = held
            .lowest(from, hold, scratch)
            .unwrap_or_else(|| self.lowest_of_polynomial(highest, from, hold));
        // NaN does not keep a promise.
        (lowest.h < -ROUND_OFF * size || lowest.h.is_nan()).then_some(lowest)
    }

    /// Whether the derivatives at the end of the hold, where h is far from its edge, are as predicted: for sources without
    /// enclosures. They count as such if known earlier ones are, provided that the error grows with the power n + 1 of the
    /// time. With n = 1, a set that moves faster than the samples shows in no derivative that is known here; a turn by
    /// radians shows at the end of the hold.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn agrees<const N: usize>(&self, held: &Hold, highest: f64, h: f64, hold: f64) -> bool {
        if N == 1 {
            return false;
        }
        let allowed = 0.5 * CLEAR * h;
        if let Some((s, known)) = self.known.filter(|(s, _)| *s <= hold) {
            let part = s / hold;
            let allowed = (0..N).fold(allowed * part, |allowed, _| allowed * part);
            if self.is_near::<N>(&known[..N], s, highest, allowed) {
                return true;
            }
        }
        held.derivatives(hold).is_none_or(|end| self.is_near::<N>(&end[..=N], hold, highest, allowed))
    }

    /// Whether `derivatives` of h are as predicted `s` seconds later, up to an effect on h of `allowed`.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn is_near<const N: usize>(&self, derivatives: &[f64], s: f64, highest: f64, allowed: f64) -> bool {
        let mut power = 1.0;
        derivatives.iter().enumerate().all(|(k, h)| {
            power *= if k == 0 { 1.0 } else { s / k as f64 };
            power * (h - self.forecast(N, k, highest, s)).abs() <= allowed
        })
    }

    /// The lowest h without a model, to the order n.
    fn lowest_of_polynomial(&self, highest: f64, from: f64, to: f64) -> Lowest {
        /// Number of intervals between the instants examined.
        const INSTANTS: u32 = 16;
        let at = |i: u32| from + (to - from) * f64::from(i) / f64::from(INSTANTS);
        (0..=INSTANTS)
            .map(|i| Lowest { h: self.forecast(self.n, 0, highest, at(i)) - self.short(at(i)), at: at(i) })
            .fold(Lowest { h: f64::INFINITY, at: from }, Lowest::or)
    }

    /// The requirement that keeps the promise of `barrier` at the instant at which it is broken. There is none for the
    /// sample itself.
    pub(super) fn requirement(
        &self,
        barrier: usize,
        promise: &FixedTimeState,
        lowest: Option<Lowest>,
    ) -> Option<Requirement> {
        let ahead = lowest.map(|lowest| lowest.at).filter(|at| *at > 0.0)?;
        let mut weights = [0.0; MAX_RELATIVE_DEGREE];
        weights[0] = 1.0;
        // Measurement errors are part of every row over a time.
        let floor = self.disturbed(ahead) + self.aim(promise, ahead);
        let bound = PeriodBound { weights, floor, ..PeriodBound::ZERO };
        Some(Requirement::new(barrier, bound, ahead, self.n))
    }

    /// The h aimed at for that instant.
    fn aim(&self, promise: &FixedTimeState, ahead: f64) -> f64 {
        match promise.phase {
            Phase::Stay => 0.5 * promise.margin.min(self.drift[0] - self.disturbed(ahead)).max(0.0),
            _ => promise.margin,
        }
    }

    /// The derivative of the floor of [`Self::requirement`] as h moves by `dh` and the margin by `margin`.
    pub(super) fn aim_change(&self, promise: &FixedTimeState, ahead: f64, margin: f64, dh: f64) -> f64 {
        match promise.phase {
            Phase::Stay if self.aim(promise, ahead) <= 0.0 => 0.0,
            Phase::Stay if self.drift[0] - self.disturbed(ahead) < promise.margin => 0.5 * dh,
            Phase::Stay => 0.5 * margin,
            _ => margin,
        }
    }

    /// What the disturbance subtracts from h until then.
    fn disturbed(&self, ahead: f64) -> f64 {
        self.shortfall.map_or(0.0, |shortfall| shortfall.of_disturbance(self.n, ahead))
    }
}
