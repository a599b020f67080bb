//! The derivatives of a promise's floors with respect to the derivatives of h.
//!
//! At a sample that does not anchor, [`FixedTime::advance`] and [`FixedTime::over_period`] compute the floors from h⁽⁰⁾ …
//! h⁽ⁿ⁻¹⁾ with fixed anchor, margin and rates. They are linear functions. At a sample that anchors, the anchor is h itself;
//! margin and the repeated root follow it:
//!
//! ```text
//! e = h − μ(h),   r' = (∂r/∂e(0)) e(0)',
//! ρ' = −Σ_j y_j' E_{n−1−j}(ρ) / Y_n'(ρ),
//! Y_n'(ρ) = −Σ_j y_j ρ^{n−1−j}/(n−1−j)!   for the root of (R),
//! ```
//!
//! where the prime is the derivative along a direction, except that of Y_n, which is the one with respect to ρ
//! (`docs/theory.md#input-sensitivity`). Where a phase changes, a maximum has two candidates or a profile has a kink, it is
//! the derivative of the piece in force.
//!
//! A set is kept with a rate, a margin and a pull that are chosen at the sample ([`keep`](super::stay::keep)), by cases and
//! roots of polynomials. Their change is a difference quotient of that choice alone: a few numbers, no search, no plant.

use super::comparison::Stack;
use super::condition::AnchorChange;
use super::fixed_time::FixedTime;
use super::sampled::{self, PeriodBound};
use super::state::FixedTimeState;
use super::stay::Means;
use crate::MAX_RELATIVE_DEGREE;
use crate::elementary;

/// Differences for the change of a chosen rate, as a part of the size of h and its derivatives, and as a part of h itself:
/// the choice is smooth on the scale of the former, and near the edge on that of the latter.
const DIFFERENCE: [f64; 2] = [1e-5, 1e-4];

/// The derivatives of a [`DerivativeBound`](super::DerivativeBound), of the margin and of a [`PeriodBound`] along one
/// direction: each in the unit of its number, over that of the direction.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct BoundDerivative {
    /// Derivative of the floor under h⁽ⁿ⁾.
    pub floor: f64,
    /// Derivative of the lower bound on h.
    pub profile: f64,
    /// Derivative of μ.
    pub margin: f64,
    /// Derivative of the sampled form if a period was given; otherwise zero.
    pub sampled: PeriodBound,
}

impl BoundDerivative {
    const ZERO: Self = Self {
        floor: 0.0,
        profile: 0.0,
        margin: 0.0,
        sampled: PeriodBound { attenuation: 0.0, ..PeriodBound::ZERO },
    };

    /// Adds `per` times the difference of two bounds.
    fn add(&mut self, less: &Self, more: &Self, per: f64) {
        self.floor += per * (more.floor - less.floor);
        self.profile += per * (more.profile - less.profile);
        let (sum, less, more) = (&mut self.sampled, &less.sampled, &more.sampled);
        for (sum, (less, more)) in sum.weights.iter_mut().zip(less.weights.iter().zip(&more.weights)) {
            *sum += per * (more - less);
        }
        sum.floor += per * (more.floor - less.floor);
        sum.attenuation += per * (more.attenuation - less.attenuation);
    }
}

impl FixedTime {
    /// The derivative along `dh` of the floors that [`Self::advance`] and, over `period`, [`Self::over_period`] give at time
    /// `t` (s), where `h` holds h⁽⁰⁾ … h⁽ⁿ⁻¹⁾. `state` has been moved to that sample; `anchors` says whether it was anchored
    /// there, at `h` itself, with the deadline held constant. `errors` and `means` are those of `Self::advance_by`; the
    /// errors are held constant, and the means move by `moves`.
    ///
    /// `None` if the condition does not know it: at the anchor of a custom profile that does not give its
    /// [derivative](super::profile::Profile::directional), and under most custom [conditions](super::condition).
    pub fn differentiate(
        &self,
        state: &FixedTimeState,
        anchors: bool,
        t: f64,
        [h, dh]: [&[f64]; 2],
        (errors, [means, moves]): (&Stack, [&Means; 2]),
        period: Option<f64>,
    ) -> Option<BoundDerivative> {
        let (n, disturbance) = (self.n, self.settings.disturbance);
        let (h, dh) = (&h[..n], &dh[..n]);
        let change = if anchors { Some(self.anchor_change(state, [h, dh])?) } else { None };
        let margin = change.map_or(0.0, |change| change.margin);
        if self.keeps(state) && !self.keeps_evenly(state) {
            return Some(self.kept_change(state, t, [h, dh], (errors, means, moves), margin, period));
        }
        let mut de = [0.0; MAX_RELATIVE_DEGREE];
        de[..n].copy_from_slice(dh);
        de[0] -= margin;
        self.in_force(state, t, h, |condition, at| {
            let [floor, lower] = condition.bound_change(at, change.as_ref(), &de[..n])?;
            let sampled = match period {
                Some(period) => {
                    let change = change.as_ref();
                    sampled::over_period_change(condition, at, change, [h, dh], period, disturbance)?
                }
                None => PeriodBound { attenuation: 0.0, ..PeriodBound::ZERO },
            };
            Some(BoundDerivative { floor, profile: lower + margin, margin, sampled })
        })
    }

    /// The derivative of the bounds of a set that is kept with a rate and a margin chosen at the sample, as the requested
    /// margin moves by `margin`. Linear in all that moves.
    fn kept_change(
        &self,
        state: &FixedTimeState,
        t: f64,
        [h, dh]: [&[f64]; 2],
        (errors, means, moves): (&Stack, &Means, &Means),
        margin: f64,
        period: Option<f64>,
    ) -> BoundDerivative {
        // The numbers on which the choice depends: h … h⁽ⁿ⁻¹⁾, the margin, and the means; each with its size and its change.
        let rate = state.stay_rate;
        let power = |k: usize| elementary::powi(rate, k as i32);
        let size = h
            .iter()
            .enumerate()
            .fold(means.drift.abs() / power(self.n), |s: f64, (k, v)| s.max(v.abs() / power(k)));
        let near = |k: usize| if k == 0 { DIFFERENCE[1] * h[0].abs() } else { f64::INFINITY };
        let of_h = (0..self.n).map(|k| ((DIFFERENCE[0] * size * power(k)).min(near(k)), dh[k]));
        let of_drift = DIFFERENCE[0] * size * power(self.n);
        let others = [
            (DIFFERENCE[1] * state.margin, margin),
            (of_drift, moves.drift),
            (of_drift, moves.reach),
            (DIFFERENCE[0], moves.weight),
        ];
        let mut sum = BoundDerivative::ZERO;
        for (j, (by, change)) in of_h.chain(others).enumerate() {
            if change == 0.0 || by.is_nan() || by <= 0.0 {
                continue;
            }
            let moved = |by: f64| {
                let (mut state, mut means, mut at) = (*state, *means, [0.0; MAX_RELATIVE_DEGREE]);
                at[..self.n].copy_from_slice(h);
                match j.checked_sub(self.n) {
                    None => at[j] += by,
                    Some(0) => state.margin += by,
                    Some(1) => means.drift += by,
                    Some(2) => means.reach += by,
                    Some(_) => means.weight += by,
                }
                self.kept(&state, t, &at[..self.n], errors, &means, period)
            };
            // Across the end of a phase only one side belongs to the piece in force; if neither does, the choice is held
            // constant.
            let known = match [moved(-by), moved(by)] {
                [Some(less), Some(more)] => Some((less, more, 2.0 * by)),
                [None, Some(more)] => moved(0.0).map(|here| (here, more, by)),
                [Some(less), None] => moved(0.0).map(|here| (less, here, by)),
                [None, None] => None,
            };
            if let Some((less, more, by)) = known {
                sum.add(&less, &more, change / by);
            }
        }
        BoundDerivative { margin, ..sum }
    }

    /// The bounds at `t` and `h` of a set that is kept. `None` if that ends the phase.
    fn kept(
        &self,
        state: &FixedTimeState,
        t: f64,
        h: &[f64],
        errors: &Stack,
        means: &Means,
        period: Option<f64>,
    ) -> Option<BoundDerivative> {
        let mut moved = *state;
        let bound = self.advance_by(&mut moved, t, h, errors, means);
        let is_same = (moved.phase, moved.anchor_time) == (state.phase, state.anchor_time);
        let sampled = match period.filter(|_| is_same) {
            Some(period) => self.over_period(&moved, t, h, period)?,
            None => PeriodBound::ZERO,
        };
        let (floor, profile) = (bound.floor, bound.profile);
        is_same.then_some(BoundDerivative { floor, profile, margin: moved.margin, sampled })
    }

    /// The derivative of the anchor that `state` has just been given at `h`.
    fn anchor_change(&self, state: &FixedTimeState, h: [&[f64]; 2]) -> Option<AnchorChange> {
        let mut change =
            self.approach.condition().anchor_change(&state.at_anchor(self.n), h, state.period)?;
        if state.phase.keeps() {
            // The rate of a kept set is not that of the method.
            change.rate = 0.0;
        }
        Some(change)
    }
}
