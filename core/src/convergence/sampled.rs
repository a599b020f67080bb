//! The constraint in the form for an input that is held over a period δ.
//!
//! With ψ = (D + a_1) ⋯ (D + a_{n−1}) e the constraint is ψ̇ + a_n ψ ≥ 0. Its integral over the period,
//!
//! ```math
//! \psi(t + \delta) \ge \exp(-a_n\delta)\, \psi(t), \tag{S}
//! ```
//!
//! depends on the state to which the held input leads, which a model predicts. If (S) holds at every sample, ψ ≥ 0 at every
//! sample; for n = 1 that is e ≥ 0. In between e dips by an amount of second order in δ (`docs/theory.md#held-inputs`). The
//! pointwise constraint loses Mδ/aⁿ, of first order, with M the slope of (D + a)ⁿ e. With ψ_n⁻ the shortfall of the
//! pointwise constraint at the start of the period and Λ = a_1 ⋯ a_{n−1}, the dip is about
//!
//! ```math
//! \psi \ge -\frac{\psi_n^-\,\delta}{4}, \qquad e \ge -\frac{\psi_n^-\,\delta}{4\,\Lambda} \qquad \text{for } n > 1. \tag{5}
//! ```
//!
//! [`PeriodBound::loss`] is (5): an estimate to leading order, not a bound, as only the mean slope is seen.
//!
//! [`margin`] is twice (5) for the steepest part of the profile, plus a part of its size for round-off: what a promise needs
//! in addition to its given margin (`docs/theory.md#sampling-margin`). What the plant adds (its own drift, turning
//! gradients) is seen only later, as [`PeriodBound::loss`].
//!
//! (S) does not limit δ against 1/a: for aδ > 1 the profile is followed only on the average of its samples. It needs no
//! root, keeps the sign of a (the repeated root has a < 0) and holds across the deadline, since r⁽ⁿ⁻¹⁾ is continuous there.

use super::comparison::{Stack, binomial, factorial};
use super::condition::{AnchorChange, Condition, Rates, Sample};
use super::operator::Split;
use super::profile::Profile;
use crate::elementary;
use crate::{MAX_INPUTS, MAX_RELATIVE_DEGREE};

/// (S) for one period: Σ_k `weights[k]` h⁽ᵏ⁾(t + δ) ≥ `floor`, k < n.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeriodBound {
    /// The coefficients of ψ, those of (D + a)ⁿ⁻¹ for one rate, in 1/s^(n−1−k); zeros from n on.
    pub weights: Stack,
    /// The least value at the end of the period, `[h]`/sⁿ⁻¹.
    pub floor: f64,
    /// Λ: ψ ≥ −c gives e ≥ −c/Λ, in 1/sⁿ⁻¹: aⁿ⁻¹ for a > 0. For a ≤ 0, where errors grow until the deadline, it is (n − 1)!
    /// exp(aτ)/τⁿ⁻¹ with the time τ until then.
    pub attenuation: f64,
    /// exp(−aδ): `floor` contains Σ_k `weights[k]` h⁽ᵏ⁾(t) times this.
    pub decay: f64,
}

/// A [`PeriodBound`], evaluated with the derivatives at the end of the period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighted {
    /// Its slack, in the unit of h⁽ⁿ⁾.
    pub value: f64,
    /// The size of the terms that add up to the slack.
    pub terms: f64,
    /// Its gradient with respect to the input.
    pub normal: [f64; MAX_INPUTS],
}

impl PeriodBound {
    /// The bound that requires nothing.
    pub const ZERO: Self =
        Self { weights: [0.0; MAX_RELATIVE_DEGREE], floor: 0.0, attenuation: 1.0, decay: 0.0 };

    /// Whether it is [`Self::ZERO`].
    pub fn is_zero(&self) -> bool {
        self.weights == [0.0; MAX_RELATIVE_DEGREE]
    }

    /// The bound as a row on h⁽ⁿ⁾, divided by `divisor`: from h⁽ᵏ⁾ at the end of the period, k < n, and their gradients with
    /// respect to `inputs` inputs.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub fn weighted(
        &self,
        value: &[f64],
        gradient: &[[f64; MAX_INPUTS]],
        inputs: usize,
        divisor: f64,
    ) -> Weighted {
        let (mut sum, mut terms, mut normal) = (-self.floor, self.floor.abs(), [0.0; MAX_INPUTS]);
        let per = 1.0 / divisor;
        for (k, value) in value.iter().enumerate() {
            let weight = self.weights[k];
            sum += weight * value;
            terms += (weight * value).abs();
            for (a, d) in normal[..inputs].iter_mut().zip(&gradient[k]) {
                *a += weight * per * d;
            }
        }
        Weighted { value: sum * per, terms: terms * per, normal }
    }

    /// (5): how far e may fall below 0 within the `period` (s), `[h]`, if the pointwise constraint has the slack `slack`
    /// (`[h]`/sⁿ) at its start. For n = 1 the dip has vanished at the end of the period.
    pub fn loss(&self, slack: f64, period: f64) -> f64 {
        (-slack).max(0.0) * period / 4.0 / self.attenuation
    }
}

/// The margin, in the unit of e, that inputs held for `period` > 0 seconds are expected to need along `profile` from the
/// derivatives `anchor` (e⁽⁰⁾ … e⁽ⁿ⁻¹⁾) within `deadline` > 0 seconds, with `attenuation` as in [`PeriodBound`].
pub fn margin(profile: &dyn Profile, anchor: &[f64], deadline: f64, attenuation: f64, period: f64) -> f64 {
    // A profile of a few samples is followed only on average; the cost is bounded by its own size.
    let (size, _) = size(anchor, deadline);
    let loss = steepest(profile, anchor, deadline).slope.abs() * period / 2.0 * period / 4.0 / attenuation;
    (2.0 * loss).min(LARGEST_MARGIN * size) + ROUND_OFF * size
}

/// The panel in which a profile is steepest.
struct Steepest {
    /// The number of the panel.
    panel: usize,
    /// The mean slope of r⁽ⁿ⁾ over it.
    slope: f64,
}

/// Number of parts of the deadline that are examined.
const PANELS: usize = 32;

fn panel_start(deadline: f64, i: usize) -> f64 {
    deadline / PANELS as f64 * i as f64
}

fn steepest(profile: &dyn Profile, anchor: &[f64], deadline: f64) -> Steepest {
    let at = |i: usize| profile.evaluate(anchor, deadline, panel_start(deadline, i))[anchor.len()];
    // The last panel ends where r⁽ⁿ⁾ drops to zero.
    let mut steepest = Steepest { panel: 0, slope: 0.0 };
    let mut left = at(0);
    for panel in 0..PANELS - 1 {
        let right = at(panel + 1);
        let slope = (right - left) / panel_start(deadline, 1);
        if slope.abs() > steepest.slope.abs() {
            steepest = Steepest { panel, slope };
        }
        left = right;
    }
    steepest
}

/// The largest |e⁽ᵏ⁾| Tᵏ, and its k.
fn size(anchor: &[f64], deadline: f64) -> (f64, usize) {
    let mut largest = (0.0, 0);
    for (k, e) in anchor.iter().enumerate() {
        let size = (e * elementary::powi(deadline, k as i32)).abs();
        if size > largest.0 {
            largest = (size, k);
        }
    }
    largest
}

/// The derivative of [`margin`] as the anchor (`anchor[0]`) moves along a direction (`anchor[1]`); `None` if the profile
/// does not know its own derivative.
pub(super) fn margin_change(
    profile: &dyn Profile,
    [anchor, direction]: [&[f64]; 2],
    deadline: f64,
    attenuation: f64,
    period: f64,
) -> Option<f64> {
    let n = anchor.len();
    let Steepest { panel, slope } = steepest(profile, anchor, deadline);
    let at = |i: usize| Some(profile.directional(anchor, direction, deadline, panel_start(deadline, i))?[n]);
    let slope_change = (at(panel + 1)? - at(panel)?) * slope.signum() / panel_start(deadline, 1);
    let (size, k) = size(anchor, deadline);
    let size_change = anchor[k].signum() * direction[k] * elementary::powi(deadline, k as i32);
    let per_slope = 2.0 * (period / 2.0 * period / 4.0 / attenuation);
    let capped = slope.abs() * per_slope >= LARGEST_MARGIN * size;
    let held = if capped { LARGEST_MARGIN * size_change } else { slope_change * per_slope };
    Some(held + ROUND_OFF * size_change)
}

/// Largest margin for held inputs, as a part of the anchor's size.
const LARGEST_MARGIN: f64 = 0.01;

/// Margin for the accumulated tolerance of sampled rows, as a part of the anchor's size.
pub(super) const ROUND_OFF: f64 = 1e-8;

/// The attenuation of a [`PeriodBound`] of (D + a)ⁿ.
pub(super) fn attenuation(rate: f64, n: usize, time_left: f64) -> f64 {
    let order = n as i32 - 1;
    if rate > 0.0 {
        elementary::powi(rate, order)
    } else {
        factorial(n - 1) * elementary::exp(rate * time_left) / elementary::powi(time_left, order)
    }
}

/// The derivative of [`attenuation`] with respect to the rate.
fn attenuation_change(rate: f64, n: usize, time_left: f64) -> f64 {
    let order = n as i32 - 1;
    match n {
        1 if rate > 0.0 => 0.0,
        _ if rate > 0.0 => f64::from(order) * elementary::powi(rate, order - 1),
        _ => time_left * attenuation(rate, n, time_left),
    }
}

/// The operator of (S).
struct Cascade {
    weights: Stack,
    /// The rate of the last factor, 1/s.
    last: f64,
    attenuation: f64,
}

impl Cascade {
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn of(rates: &Rates, n: usize, time_left: f64) -> Self {
        match *rates {
            Rates::Each(rates) => {
                let Split { weights, last } = rates.without_last();
                Self { weights, last, attenuation: weights[0] }
            }
            Rates::Repeated(rate) => {
                let (mut weights, mut power) = ([0.0; MAX_RELATIVE_DEGREE], 1.0);
                for k in (0..n).rev() {
                    weights[k] = binomial(n - 1, k) * power;
                    power *= rate;
                }
                Self { weights, last: rate, attenuation: attenuation(rate, n, time_left) }
            }
        }
    }

    fn decay(&self, period: f64) -> f64 {
        elementary::exp(-self.last * period)
    }
}

/// [`Condition::over_period`].
pub(super) fn over_period<C: Condition + ?Sized>(
    condition: &C,
    at: &Sample,
    h: &[f64],
    period: f64,
    disturbance: f64,
) -> Option<PeriodBound> {
    // With n known to the compiler the short loops unroll.
    match at.degree() {
        1 => over_period_of_degree::<C, 1>(condition, at, h, period, disturbance),
        2 => over_period_of_degree::<C, 2>(condition, at, h, period, disturbance),
        3 => over_period_of_degree::<C, 3>(condition, at, h, period, disturbance),
        4 => over_period_of_degree::<C, 4>(condition, at, h, period, disturbance),
        5 => over_period_of_degree::<C, 5>(condition, at, h, period, disturbance),
        6 => over_period_of_degree::<C, 6>(condition, at, h, period, disturbance),
        7 => over_period_of_degree::<C, 7>(condition, at, h, period, disturbance),
        _ => over_period_of_degree::<C, 8>(condition, at, h, period, disturbance),
    }
}

/// [`over_period`] for n = `N`.
fn over_period_of_degree<C: Condition + ?Sized, const N: usize>(
    condition: &C,
    at: &Sample,
    h: &[f64],
    period: f64,
    disturbance: f64,
) -> Option<PeriodBound> {
    let h: &[f64; N] = h.first_chunk()?;
    let at = &Sample { anchor: at.anchor.first_chunk::<N>()?, ..*at };
    let cascade = Cascade::of(&condition.rates(at)?, N, at.time_left(period));
    // The target of h: μ + r and its derivatives.
    let target = |elapsed: f64| {
        let mut r = condition.profile(at, elapsed);
        r[0] += at.margin;
        r
    };
    let (now, then) = (target(at.elapsed), target(at.elapsed + period));
    let (decay, weights) = (cascade.decay(period), cascade.weights);
    let undisturbed: f64 = (0..N).map(|k| weights[k] * (then[k] + decay * (h[k] - now[k]))).sum();
    let floor = undisturbed + at.pull * period + disturbed(&weights[..N], disturbance, period);
    Some(PeriodBound { weights, floor, attenuation: cascade.attenuation, decay })
}

/// The derivative of [`over_period`] as h (`h[0]`) moves along `h[1]`, and the anchor by `change` if this is its sample. All
/// zero if the condition is not linear. `None` if it is not known.
pub(super) fn over_period_change(
    condition: &dyn Condition,
    at: &Sample,
    change: Option<&AnchorChange>,
    [h, dh]: [&[f64]; 2],
    period: f64,
    disturbance: f64,
) -> Option<PeriodBound> {
    let n = at.degree();
    let mut out = PeriodBound { attenuation: 0.0, ..PeriodBound::ZERO };
    let Some(rates) = condition.rates(at) else { return Some(out) };
    let cascade = Cascade::of(&rates, n, at.time_left(period));
    let (decay, weights) = (cascade.decay(period), cascade.weights);
    let target = |elapsed: f64| match change {
        Some(change) => {
            let mut r = condition.profile_change(at, change, elapsed)?;
            r[0] += change.margin;
            Some(r)
        }
        None => Some([0.0; MAX_RELATIVE_DEGREE + 1]),
    };
    let (now, then) = (target(at.elapsed)?, target(at.elapsed + period)?);
    out.floor = (0..n).map(|k| weights[k] * (then[k] + decay * (dh[k] - now[k]))).sum();
    let by_rate = change.map_or(0.0, |change| change.rate);
    if by_rate != 0.0 {
        // Only the repeated root has a rate that moves, and its target is the margin alone.
        let rate = cascade.last;
        for k in 0..n {
            out.weights[k] = power_change(rate, n - 1, k) * by_rate;
            let target = if k == 0 { at.margin } else { 0.0 };
            let (error, slope) = (h[k] - target, -period * by_rate * decay);
            out.floor += out.weights[k] * (target + decay * error) + weights[k] * slope * error;
        }
        out.floor += disturbed_change(&weights[..n], &out.weights, disturbance, period);
        out.attenuation = attenuation_change(rate, n, at.time_left(period)) * by_rate;
    }
    Some(out)
}

/// The derivative with respect to a of C(n, j) a^{n−j}, the coefficient of e⁽ʲ⁾ in (D + a)ⁿ e.
pub(super) fn power_change(rate: f64, n: usize, j: usize) -> f64 {
    let power = n - j;
    if power == 0 { 0.0 } else { binomial(n, j) * power as f64 * elementary::powi(rate, power as i32 - 1) }
}

/// The most by which Σ `weights[k]` h⁽ᵏ⁾ at the end of the period, k < n, can fall below its prediction under
/// disturbances of h⁽ⁿ⁾ up to `bound`: each h⁽ᵏ⁾ by up to W δ^{n−k}/(n−k)!.
fn disturbed(weights: &[f64], bound: f64, period: f64) -> f64 {
    if bound == 0.0 {
        return 0.0;
    }
    let (n, mut grown, mut sum) = (weights.len(), bound, 0.0);
    for k in (0..n).rev() {
        grown *= period / (n - k) as f64;
        sum += weights[k].abs() * grown;
    }
    sum
}

/// The derivative of [`disturbed`] as `weights` change by `change`.
fn disturbed_change(weights: &[f64], change: &Stack, bound: f64, period: f64) -> f64 {
    let n = weights.len();
    let signed: Stack = core::array::from_fn(|k| if k < n { change[k] * weights[k].signum() } else { 0.0 });
    let part = |keep: fn(f64) -> f64| disturbed(&signed.map(keep)[..n], bound, period);
    part(|w| w.max(0.0)) - part(|w| w.min(0.0))
}

#[cfg(test)]
mod tests {
    use super::super::comparison::lower_terms;
    use super::super::fixed_time::FixedTime;
    use super::super::hermite::Hermite;
    use super::super::settings::FixedTimeSettings;
    use super::super::state::FixedTimeState;
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
            let bound = promise.advance(&mut state, 0.5, &moved[..n]);
            let period = 1e-6;
            let sampled = promise.over_period(&state, 0.5, &moved[..n], period).expect("linear");
            // Moving along h⁽ⁿ⁾ = floor, Σ weights h⁽ᵏ⁾ grows by Σ weights h⁽ᵏ⁺¹⁾ δ.
            let next = |k: usize| if k + 1 < n { moved[k + 1] } else { bound.floor };
            let reached: f64 = (0..n).map(|k| sampled.weights[k] * (moved[k] + period * next(k))).sum();
            let scale = lower_terms(state.rate, &moved[..n]).abs() + bound.floor.abs() + 1.0;
            // The remainder is of second order in the period, with rates of order a = 10.
            let error = (reached - sampled.floor) / period;
            assert!(error.abs() < 1e-3 * scale, "n {n}: {error} of {scale}");
        }
    }

    #[test]
    fn the_loss_is_that_of_an_even_slope() {
        // (D + 2)² e = −c + 2cτ/δ over a period: ψ dips by cδ/4, e by no more than cδ/8.
        let bound = PeriodBound { attenuation: 2.0, ..PeriodBound::ZERO };
        assert_eq!(bound.loss(-8.0, 0.1), 8.0 * 0.1 / 4.0 / 2.0);
        assert_eq!(bound.loss(3.0, 0.1), 0.0);
        // n = 2: ψ = −c for a time τ at the rate −a makes e = −c (e^{aτ} − 1)/a, less than c τ e^{aτ}.
        let growing = PeriodBound { attenuation: attenuation(-0.2, 2, 3.0), ..bound }.loss(-8.0, 0.1);
        let exact = 0.2 * ((0.6_f64).exp() - 1.0) / 0.2;
        assert!(growing > exact && growing < 2.0 * exact, "{growing} for {exact}");
    }

    /// n = 2 from rest at −1 within 1 s: r = −(1 − s)²(1 + 2s), r‴ = −12, so the dip with a = 4 and
    /// δ = 0.1 is 12 · 0.1²/8/4, and the margin twice that.
    #[test]
    fn the_margin_is_that_of_the_profile() {
        let found = margin(&Hermite, &[-1.0, 0.0], 1.0, 4.0, 0.1);
        assert!(
            (found - (2.0 * 12.0 * 0.01 / 32.0_f64).min(LARGEST_MARGIN) - ROUND_OFF).abs() < 1e-12,
            "{found}"
        );
        let half = margin(&Hermite, &[-1.0, 0.0], 1.0, 4.0, 0.05);
        assert!((half - 2.0 * 12.0 * 0.0025 / 32.0 - ROUND_OFF).abs() < 1e-12, "{half}");
    }
}
