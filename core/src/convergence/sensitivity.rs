//! The change of a promise's floors with the derivatives of h.
//!
//! At a sample that does not anchor, [`FixedTime::advance`] and [`FixedTime::over_period`] compute the floors from
//! h⁽⁰⁾ … h⁽ⁿ⁻¹⁾ with anchor, margin and rates as they are. They are linear functions, but for the first-order
//! condition. At a sample that anchors, the anchor is h itself; margin and the repeated root follow it:
//!
//! ```text
//! e = h − μ(h),   r' = (∂r/∂e(0)) e(0)',
//! ρ' = −Σ_j y_j' E_{n−1−j}(ρ) / Y_n'(ρ),
//! Y_n'(ρ) = −Σ_j y_j ρ^{n−1−j}/(n−1−j)!   for the root of (R),
//! ```
//!
//! where the prime is the derivative along a direction, but that of Y_n the one by ρ
//! (`docs/theory.md#input-sensitivity`). Where a phase changes, a maximum has two candidates or a profile a kink, it
//! is the derivative of the piece in force.

use super::condition::AnchorChange;
use super::fixed_time::FixedTime;
use super::sampled::{self, PeriodBound};
use super::state::FixedTimeState;
use crate::MAX_RELATIVE_DEGREE;

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
    /// Derivative of the sampled form, where a period was given; else zero.
    pub sampled: PeriodBound,
}

impl FixedTime {
    /// The derivative along `dh` of the floors that [`Self::advance`] and, over `period`, [`Self::over_period`] give
    /// at time `t` (s), where `h` holds h⁽⁰⁾ … h⁽ⁿ⁻¹⁾. `state` has been moved to that sample; `anchors` says whether
    /// it was anchored there, at `h` itself, with a deadline that does not depend on h.
    ///
    /// `None` where the condition does not know it: at the anchor of a profile of one's own that does not give its
    /// [derivative](super::profile::Profile::directional), and under most [conditions](super::condition) of one's own.
    pub fn differentiate(
        &self,
        state: &FixedTimeState,
        anchors: bool,
        t: f64,
        [h, dh]: [&[f64]; 2],
        period: Option<f64>,
    ) -> Option<BoundDerivative> {
        let (n, disturbance) = (self.n, self.settings.disturbance);
        let (h, dh) = (&h[..n], &dh[..n]);
        let change = if anchors { Some(self.anchor_change(state, [h, dh])?) } else { None };
        let margin = change.map_or(0.0, |change| change.margin);
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
