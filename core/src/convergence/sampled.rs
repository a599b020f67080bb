//! The constraint in the form for an input that is held over a period δ.
//!
//! With ψ = (D + a)ⁿ⁻¹ e the constraint (D + a)ⁿ e ≥ 0 is ψ̇ + aψ ≥ 0. Enforced only at the samples, the
//! held input lets it fall to −Mδ in between (M bounds |d/dt (D + a)ⁿ e|), and e to −Mδ/aⁿ. Its integral
//! over the period,
//!
//! ```text
//! ψ(t + δ) ≥ e^{−aδ} ψ(t),                                                    (S)
//! ```
//!
//! depends on the state that the held input leads to, which a model predicts. If (S) holds at every
//! sample, ψ ≥ 0 at every sample; for n = 1 that is e ≥ 0 at every sample, exactly. Within a period
//! e^{aτ}ψ can dip below both its ends, where (D + a)ⁿ e is negative first and positive later: a function
//! of slope at most M whose integral is ≥ 0 dips by at most Mδ²/8. With c₋ = max(0, −(D + a)ⁿ e) at the
//! start of the period and an even slope, Mδ = 2c₋ and
//!
//! ```text
//! ψ ≥ −c₋ δ/4,  e ≥ −c₋ δ/(4 aⁿ⁻¹)      for a > 0, n > 1,                     (5)
//! ```
//!
//! of second order in δ where the pointwise constraint loses Mδ/aⁿ. [`SampledDemand::loss`] is (5): an
//! estimate to leading order, not a bound, since the slope is only seen through its mean.
//!
//! (S) says nothing about the size of δ against 1/a: for aδ > 1 the profile is followed only at its
//! samples' average. It needs no root, keeps the sign of a (the repeated root has a < 0) and holds across
//! the deadline, since r⁽ⁿ⁻¹⁾ is continuous there.

use super::comparison::{Stack, binomial};
use super::fixed_time::{FixedTime, FixedTimeState, Method, Phase};
use super::hermite::HermiteProfile;
use crate::MAX_RELATIVE_DEGREE;

/// (S) for one period: Σ_k `weights[k]` h⁽ᵏ⁾(t + δ) ≥ `floor`, k < n.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampledDemand {
    /// The coefficients of (D + a)ⁿ⁻¹, in 1/s^(n−1−k); zeros from n on.
    pub weights: Stack,
    /// The least value at the end of the period, `[h]`/sⁿ⁻¹.
    pub floor: f64,
    /// a in 1/s.
    pub rate: f64,
}

impl SampledDemand {
    /// Asks for nothing.
    pub const ZERO: Self = Self { weights: [0.0; MAX_RELATIVE_DEGREE], floor: 0.0, rate: 0.0 };

    /// (5): how far e may fall below 0 within the `period` (s), `[h]`, where the pointwise constraint
    /// has the slack `slack` (`[h]`/sⁿ) at its start, for relative degree `n`. Not a number for a ≤ 0,
    /// where errors grow and no margin is enough.
    pub fn loss(&self, slack: f64, period: f64, n: usize) -> f64 {
        if n == 1 {
            // ψ = e: the dip is within the period, and gone at its end.
            return (-slack).max(0.0) * period / 4.0;
        }
        if self.rate <= 0.0 {
            return f64::NAN;
        }
        (-slack).max(0.0) * period / 4.0 / self.rate.powi(n as i32 - 1)
    }
}

impl FixedTime {
    /// (S) from the sample at `t` (s), which `state` has been moved to with
    /// [`advance`](Self::advance) and where `h` holds h⁽⁰⁾ … h⁽ⁿ⁻¹⁾, over `period` > 0 seconds.
    /// `None` on the approach of the first-order condition, which is not linear in e.
    pub fn over_period(
        &self,
        state: &FixedTimeState,
        t: f64,
        h: &[f64],
        period: f64,
    ) -> Option<SampledDemand> {
        let n = self.n;
        let (rate, follows) = match state.phase {
            Phase::Stay | Phase::Left => (self.settings.stay_rate, false),
            _ if matches!(self.settings.method, Method::FirstOrder(_)) => return None,
            _ => (state.rate, self.settings.method == Method::ReferenceProfile),
        };
        let mut weights = [0.0; MAX_RELATIVE_DEGREE];
        for (k, weight) in weights[..n].iter_mut().enumerate() {
            *weight = binomial(n - 1, k) * rate.powi((n - 1 - k) as i32);
        }
        // What h is compared with: μ + r and its derivatives.
        let profile = follows.then(|| HermiteProfile::new(&state.anchor[..n], state.deadline));
        let target = |elapsed: f64| {
            let mut r = profile.map_or([0.0; MAX_RELATIVE_DEGREE + 1], |profile| profile.evaluate(elapsed));
            r[0] += self.settings.margin;
            r
        };
        let elapsed = (t - state.anchor_time).max(0.0);
        let (now, then) = (target(elapsed), target(elapsed + period));
        let decay = (-rate * period).exp();
        let floor = (0..n).map(|k| weights[k] * (then[k] + decay * (h[k] - now[k]))).sum();
        Some(SampledDemand { weights, floor, rate })
    }
}

#[cfg(test)]
mod tests {
    use super::super::comparison::lower_terms;
    use super::super::fixed_time::FixedTimeSettings;
    use super::*;

    /// (S) is the integral of the pointwise constraint: for δ → 0 its difference quotient tends to it.
    #[test]
    fn short_periods_give_the_pointwise_constraint() {
        let h = [-3.0, 2.0, 0.5, -1.0];
        for n in 1..=4 {
            let promise = FixedTime::new(n, FixedTimeSettings::within(2.0)).expect("valid");
            let mut state = FixedTimeState::default();
            promise.advance(&mut state, 0.0, &h[..n]);
            let moved = [-1.0, 1.0, 0.25, 3.0];
            let demand = promise.advance(&mut state, 0.5, &moved[..n]);
            let period = 1e-6;
            let sampled = promise.over_period(&state, 0.5, &moved[..n], period).expect("linear");
            // Moving along h⁽ⁿ⁾ = floor, Σ weights h⁽ᵏ⁾ grows by Σ weights h⁽ᵏ⁺¹⁾ δ.
            let next = |k: usize| if k + 1 < n { moved[k + 1] } else { demand.floor };
            let reached: f64 = (0..n).map(|k| sampled.weights[k] * (moved[k] + period * next(k))).sum();
            let scale = lower_terms(sampled.rate, &moved[..n]).abs() + demand.floor.abs() + 1.0;
            // The remainder is of second order in the period, with rates of order a = 10.
            let error = (reached - sampled.floor) / period;
            assert!(error.abs() < 1e-3 * scale, "n {n}: {error} of {scale}");
        }
    }

    #[test]
    fn the_loss_is_that_of_an_even_slope() {
        // (D + 2)² e = −c + 2cτ/δ over a period: ψ dips by cδ/4, e by no more than cδ/8.
        let demand = SampledDemand { rate: 2.0, ..SampledDemand::ZERO };
        assert_eq!(demand.loss(-8.0, 0.1, 2), 8.0 * 0.1 / 4.0 / 2.0);
        assert_eq!(demand.loss(3.0, 0.1, 2), 0.0);
        assert!(SampledDemand { rate: -0.2, ..demand }.loss(-8.0, 0.1, 2).is_nan());
    }
}
