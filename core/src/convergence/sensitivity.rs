//! How what a promise asks for changes with the derivatives of h.
//!
//! At a sample that does not anchor, the floors are what [`FixedTime::advance`] and
//! [`FixedTime::over_period`] compute from h⁽⁰⁾ … h⁽ⁿ⁻¹⁾ with anchor, margin and rates as they are: linear
//! functions, but for the first-order condition. At a sample that anchors, the anchor is h itself; margin
//! and the repeated root follow it:
//!
//! ```text
//! e = h − μ(h),   r' = (∂r/∂e₀) e₀',
//! s' = −Σ_j y_j' E_{n−1−j}(s) / (dR/ds),   dR/ds = −Σ_j y_j s^{n−1−j}/(n−1−j)!   for the root of (R),
//! ```
//!
//! where the prime is the derivative along a direction. Where a phase changes, a maximum has two candidates or a
//! profile a kink, it is the derivative of the piece in force.

use super::comparison::{Stack, binomial, lower_terms};
use super::fixed_time::FixedTime;
use super::profile::Derivatives;
use super::sampled::SampledDemand;
use super::settings::Method;
use super::state::{FixedTimeState, Phase};
use super::{repeated_root, sampled};
use crate::MAX_RELATIVE_DEGREE;

/// The derivatives of a [`Demand`](super::Demand), of the margin and of a [`SampledDemand`] along one
/// direction: each in the unit of what it is the derivative of, over that of the direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DemandDerivative {
    /// Of the floor under h⁽ⁿ⁾.
    pub floor: f64,
    /// Of the lower bound on h.
    pub profile: f64,
    /// Of μ.
    pub margin: f64,
    /// Of the sampled form, where a period was given.
    pub sampled: SampledDemand,
}

/// What of a promise changes with h at its anchor.
#[derive(Default)]
struct Change {
    anchor: Stack,
    margin: f64,
    rate: f64,
}

impl FixedTime {
    /// The derivative along `dh` of what [`Self::advance`] and, over `period`, [`Self::over_period`] ask for
    /// at time `t` (s), where `h` holds h⁽⁰⁾ … h⁽ⁿ⁻¹⁾ and `state` has been moved to; `anchors`: by being
    /// anchored at this very sample, with a deadline that does not depend on h.
    ///
    /// `None` where it is not known: at the anchor of a profile of one's own that does not give its
    /// [derivative](super::profile::Profile::along), and under a [condition](super::condition) of one's own.
    pub fn differentiate(
        &self,
        state: &FixedTimeState,
        anchors: bool,
        t: f64,
        [h, dh]: [&[f64]; 2],
        period: Option<f64>,
    ) -> Option<DemandDerivative> {
        if self.has_condition() {
            return None;
        }
        let change = if anchors { self.anchor_along(state, h, dh)? } else { Change::default() };
        let n = self.n;
        let elapsed = (t - state.anchor_time).max(0.0);
        let (mut e, mut de) = ([0.0; MAX_RELATIVE_DEGREE], [0.0; MAX_RELATIVE_DEGREE]);
        e[..n].copy_from_slice(&h[..n]);
        de[..n].copy_from_slice(&dh[..n]);
        e[0] -= state.margin;
        de[0] -= change.margin;
        let (floor, profile) = match (state.phase, self.settings.method) {
            (Phase::Stay | Phase::Left, _) => (-lower_terms(state.stay_rate, &de[..n]), 0.0),
            (_, Method::RepeatedRoot) => {
                let by_rate: f64 = (0..n).map(|j| power_along(state.rate, n, j) * e[j]).sum();
                // The bound starts at the anchor itself.
                (-lower_terms(state.rate, &de[..n]) - by_rate * change.rate, change.anchor[0])
            }
            (_, Method::FirstOrder(exponent)) => {
                let [by_anchor, by_error] = exponent.floor_along(state.anchor[0], state.deadline, e[0]);
                (by_anchor * change.anchor[0] + by_error * de[0], change.anchor[0])
            }
            (_, Method::ReferenceProfile) => {
                let dr = self.profile_along(state, &change, anchors, elapsed)?;
                (0..n).for_each(|k| de[k] -= dr[k]);
                let terms = match &self.settings.rates {
                    Some(rates) => rates.lower_terms(&de[..n]),
                    None => lower_terms(state.rate, &de[..n]),
                };
                (dr[n] - terms, dr[0])
            }
        };
        let sampled = match period {
            Some(period) => self.over_period_along(state, &change, anchors, t, [h, dh], period)?,
            None => SampledDemand { attenuation: 0.0, ..SampledDemand::ZERO },
        };
        Some(DemandDerivative { floor, profile: profile + change.margin, margin: change.margin, sampled })
    }

    /// How the anchor that `state` has just been given at `h` changes.
    fn anchor_along(&self, state: &FixedTimeState, h: &[f64], dh: &[f64]) -> Option<Change> {
        let n = self.n;
        let mut change = Change::default();
        let ahead = state.deadline > 0.0;
        if self.settings.method == Method::ReferenceProfile && ahead && state.period > 0.0 {
            let (profile, deadline, period) = (self.built_in(), state.deadline, state.period);
            let attenuation = self.attenuation(state.rate, deadline);
            change.margin =
                sampled::margin_along(profile, [&h[..n], &dh[..n]], deadline, attenuation, period)?;
        }
        change.anchor[..n].copy_from_slice(&dh[..n]);
        change.anchor[0] -= change.margin;
        if self.settings.method == Method::RepeatedRoot && ahead && !state.fallback {
            let direction = &change.anchor[..n];
            change.rate =
                repeated_root::rate_along(state.rate, &state.anchor[..n], direction, state.deadline);
        }
        Some(change)
    }

    /// How the profile in force and its derivatives change, without the margin.
    fn profile_along(
        &self,
        state: &FixedTimeState,
        change: &Change,
        anchors: bool,
        elapsed: f64,
    ) -> Option<Derivatives> {
        if !anchors || state.deadline <= 0.0 {
            return Some([0.0; MAX_RELATIVE_DEGREE + 1]);
        }
        let n = self.n;
        let profile = self.in_force(state);
        profile.along([&state.anchor[..n], &change.anchor[..n]], state.deadline, elapsed)
    }

    fn over_period_along(
        &self,
        state: &FixedTimeState,
        change: &Change,
        anchors: bool,
        t: f64,
        [h, dh]: [&[f64]; 2],
        period: f64,
    ) -> Option<SampledDemand> {
        let n = self.n;
        let none = SampledDemand { attenuation: 0.0, ..SampledDemand::ZERO };
        // Not linear in e, and not used.
        let Some(demand) = self.over_period(state, t, h, period) else { return Some(none) };
        let stays = matches!(state.phase, Phase::Stay | Phase::Left);
        let follows = !stays && self.settings.method == Method::ReferenceProfile;
        let elapsed = (t - state.anchor_time).max(0.0);
        let (mut now, mut then) = ([0.0; MAX_RELATIVE_DEGREE + 1], [0.0; MAX_RELATIVE_DEGREE + 1]);
        if follows {
            now = self.profile_along(state, change, anchors, elapsed)?;
            then = self.profile_along(state, change, anchors, elapsed + period)?;
        }
        now[0] += change.margin;
        then[0] += change.margin;
        let last = match &self.settings.rates {
            Some(rates) if follows => rates.without_last().last,
            _ if stays => state.stay_rate,
            _ => state.rate,
        };
        let decay = (-last * period).exp();
        let weighted = |k: usize| demand.weights[k] * (then[k] + decay * (dh[k] - now[k]));
        let mut out = SampledDemand { floor: (0..n).map(weighted).sum(), ..none };
        let rate = if stays { 0.0 } else { change.rate };
        if rate != 0.0 {
            // Of the repeated root only, whose target is the margin alone.
            for k in 0..n {
                out.weights[k] = power_along(state.rate, n - 1, k) * rate;
                let target = if k == 0 { state.margin } else { 0.0 };
                let (error, slope) = (h[k] - target, -period * rate * decay);
                out.floor += out.weights[k] * (target + decay * error) + demand.weights[k] * slope * error;
            }
            out.floor += self.disturbed_along(&demand.weights, &out.weights, period);
            let time_left = (state.deadline - elapsed).max(period);
            out.attenuation = sampled::attenuation_along(state.rate, n, time_left) * rate;
        }
        Some(out)
    }
}

/// The derivative by a of C(n, j) a^{n−j}, the coefficient of e⁽ʲ⁾ in (D + a)ⁿ e.
fn power_along(rate: f64, n: usize, j: usize) -> f64 {
    let power = n - j;
    if power == 0 { 0.0 } else { binomial(n, j) * power as f64 * rate.powi(power as i32 - 1) }
}
