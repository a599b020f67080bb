//! Staying inside: (D + a)ⁿ e ≥ 0 with a > 0 from a start with e ≥ 0.
//!
//! It keeps e ≥ 0 for ever if all coefficients c_k(a) of the comparison lemma are ≥ 0 at the start
//! (`docs/theory.md#stay-condition`). For n = 1 that is e ≥ 0; for n = 2 it is e ≥ 0 and a ≥ −ė/e. The k! c_k are an
//! Appell sequence in a,
//!
//! ```math
//! A_k(a) = k!\, c_k(a) = \sum_{j\le k} \binom{k}{j} a^{k-j} e^{(j)}, \qquad \frac{dA_k}{da} = k\, A_{k-1}. \tag{A}
//! ```
//!
//! So the rates ≥ 0 that suffice are a ray [a_min, ∞), with a_min of [`smallest_rate`]. There is none if and only if the
//! first nonzero derivative is negative. A rate that suffices at one sample suffices at the next: the rate may be chosen
//! again at every sample (`docs/theory.md#rate-for-every-sample`). The least h⁽ⁿ⁾ that a rate requires,
//!
//! ```math
//! \varphi(a) = -\sum_{j<n} \binom{n}{j} a^{n-j} e^{(j)}, \qquad \frac{d\varphi}{da} = -n\,A_{n-1}(a) \le 0, \tag{W}
//! ```
//!
//! falls with a: a larger rate brakes later and harder. [`keep`] uses the gentle rate if it can. It uses a larger one if the
//! gentle rate requires more than the inputs can do and the state is not about to leave the set.
//!
//! With e = h − μ, all A_k(a) ≥ 0 says μ ≤ A_k(a; h)/aᵏ for all k < n. The least of them, `affordable_margin`, is the
//! largest margin with which the condition holds.

use core::array::from_fn;

use super::comparison::{lower_terms, scaled_coefficient};
use super::condition::{AnchorChange, Bound, Condition, Rates, Sample};
use super::polynomial::first_near;
use super::profile::Derivatives;
use super::settings::FixedTimeSettings;
use super::state::FixedTimeState;
use crate::MAX_RELATIVE_DEGREE;
use crate::elementary;

/// Whether the stay constraint with `rate` > 0 keeps e ≥ 0 for ever from the derivatives `e`
/// (e⁽⁰⁾ … e⁽ⁿ⁻¹⁾): all A_k ≥ 0.
#[cfg_attr(not(feature = "small"), inline(always))]
pub fn is_invariant(rate: f64, e: &[f64]) -> bool {
    let mut all = true;
    for k in 0..e.len() {
        all = all && scaled_coefficient(rate, e, k) >= 0.0;
    }
    all
}

/// The smallest rate a ≥ 0 in 1/s with [`is_invariant`]; `None` if no finite rate has it. For n = 2, max(0, −ė/e).
///
/// The rate returned satisfies [`is_invariant`] to the last bit; the number below it does not, except for round-off of the
/// A_k.
///
/// ```
/// use punctual_core::convergence::stay::smallest_rate;
///
/// assert_eq!(smallest_rate(&[2.0, -3.0]), Some(1.5));
/// assert_eq!(smallest_rate(&[2.0, 3.0]), Some(0.0));
/// assert_eq!(smallest_rate(&[0.0, -3.0]), None);
/// ```
pub fn smallest_rate(e: &[f64]) -> Option<f64> {
    if is_invariant(0.0, e) {
        return Some(0.0);
    }
    // Exact for n = 2, where A_1 = a e + ė.
    let guess = e.get(1).map_or(0.0, |rate| -rate / e[0]);
    is_invariant(f64::MAX, e).then(|| first_near(guess, 0.0, f64::MAX, |rate| is_invariant(rate, e)))
}

/// The largest μ for which h − μ satisfies [`is_invariant`] with `rate` > 0; negative if none ≥ 0 does. `h` holds h⁽⁰⁾ …
/// h⁽ⁿ⁻¹⁾.
#[inline]
pub(super) fn affordable_margin(rate: f64, h: &[f64]) -> f64 {
    let (mut least, mut power) = (h[0], 1.0);
    for k in 1..h.len() {
        power *= rate;
        let margin = scaled_coefficient(rate, h, k) / power;
        // Not `f64::min`, which would drop NaN.
        if margin < least || margin.is_nan() {
            least = margin;
        }
    }
    least
}

/// The influence of plant and inputs on h⁽ⁿ⁾ at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Means {
    /// L_fⁿh, `[h]`/sⁿ: h⁽ⁿ⁾ without an input.
    pub drift: f64,
    /// The most that inputs within their bounds add to it, `[h]`/sⁿ; infinite without bounds.
    pub reach: f64,
    /// ‖L_gL_f^{n−1}h‖ as a part of its largest value since the anchor or the arrival, 0 ..= 1: how well h can be influenced
    /// now.
    pub weight: f64,
    /// The longest time in s for which the input may be held, 0 if it is not known.
    pub hold: f64,
}

impl Means {
    /// Nothing is known: every h⁽ⁿ⁾ is available at once.
    pub const UNKNOWN: Self = Self { drift: 0.0, reach: f64::INFINITY, weight: 1.0, hold: 0.0 };
}

/// The constraint that keeps the set from a sample on: (D + a)ⁿ (h − μ) ≥ pull.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Keep {
    /// a in 1/s.
    pub rate: f64,
    /// μ ≥ 0, `[h]`.
    pub margin: f64,
    /// The part of the floor that leads back to the requested margin, `[h]`/sⁿ, ≥ 0.
    pub pull: f64,
    /// Whether the lemma holds with these: h ≥ μ from now on.
    pub is_invariant: bool,
}

/// Largest rate times hold: a faster error changes more within two samples than an input can counteract.
pub const LARGEST_RATE_TIMES_HOLD: f64 = 0.5;

/// The rate of least peak, in units of the smallest rate, for n = 2. Braking from ė then takes ¾ ė²/e; with the smallest
/// rate it takes ė²/e; a constant ½ ė²/e would just suffice.
const OVER_SMALLEST: f64 = 1.5;

/// The part of the margin that suffices to keep the gentle rate.
const ENOUGH: f64 = 0.5;

/// Largest rate, in units of the requested one, if no period limits it.
const LARGEST_RATE_OVER_BASE: f64 = 10.0;

/// Chooses how to keep h ≥ 0 from the derivatives `h` (h⁽⁰⁾ … h⁽ⁿ⁻¹⁾): with `margin` μ and rate `base` > 0 if they suffice,
/// otherwise with a smaller margin and a larger rate.
///
/// 1. The rate is `base` if that affords half the margin; the margin is then all that it affords.
/// 2. Otherwise the margin is half the requested one, or what is affordable at the largest rate that samples can follow. The
///    rate is the smallest that suffices, for n = 2 1.5 times that.
/// 3. The rate is raised if it requires more than the bounds allow (`means.reach`). If h can hardly be influenced
///    (`means.weight`) or comes back by itself, it is raised until the floor is lower by the amount by which the plant
///    itself pulls h⁽ⁿ⁾ down. At a disc's centre the gradient vanishes and only h⁽ⁿ⁾ is negative, though the state is not
///    about to leave.
/// 4. If margin is missing, `pull` requires what the gentle rate and all of the margin would.
///
/// The reasons are in `docs/theory.md#rate-for-every-sample`.
pub fn keep<const N: usize>(h: &[f64; N], margin: f64, base: f64, means: &Means) -> Keep {
    let by_hold = LARGEST_RATE_TIMES_HOLD / means.hold;
    let limit = if means.hold > 0.0 { by_hold.max(base) } else { base * LARGEST_RATE_OVER_BASE };
    // 1. The gentle rate, with the margin that it affords. Small dips into the margin do not change the rate.
    let at_base = affordable_margin(base, h);
    let is_gentle = at_base >= ENOUGH * margin;
    let affordable = if is_gentle { at_base } else { affordable_margin(limit, h) };
    let kept = elementary::clamp(affordable, 0.0, if is_gentle { margin } else { ENOUGH * margin });
    let mut e = *h;
    e[0] -= kept;
    let e = &e;
    let is_invariant = affordable >= 0.0;
    if !is_invariant {
        // Not even the largest rate affords a margin ≥ 0: as hard as necessary, if any rate suffices.
        let rate = smallest_rate(e).map_or(limit, |rate| rate.max(base));
        return Keep { rate, margin: kept, pull: 0.0, is_invariant };
    }
    // 2. The smallest rate that suffices, if the gentle one does not.
    let over_smallest = if N == 2 { OVER_SMALLEST } else { 1.0 };
    let smallest = || smallest_rate(e).map_or(limit, |rate| over_smallest * rate);
    let gentle = if is_gentle { base } else { elementary::clamp(smallest(), base, limit) };
    let floor = |rate: f64| -lower_terms(rate, e);
    let possible = means.drift + means.reach;
    // 3. The plant's own pull is dealt with later if h can hardly be influenced, or comes back by itself.
    let strength = elementary::powi(means.weight, 2) * outwards(e, base);
    let eased = |wanted: f64| {
        let relieved = means.drift.min(0.0) + wanted.max(0.0);
        if wanted > relieved { relieved + strength * (wanted - relieved) } else { wanted }
    };
    let wanted = floor(gentle);
    let most = eased(wanted).min(possible);
    let rate = if wanted <= most {
        gentle
    } else {
        // It has to stay that low for a part of the hold: the larger the part, the less h follows an input.
        let ahead = if most < possible { ahead(e, most, (1.0 - strength) * means.hold) } else { *e };
        let is_met = |rate: f64| floor(rate).max(-lower_terms(rate, &ahead)) <= most;
        let guess = rate_of_floor(most, e).max(rate_of_floor(most, &ahead));
        if is_met(limit) { first_near(guess, gentle, limit, is_met) } else { limit }
    };
    // 4. The gentle rate with all of the margin, as far as that is possible.
    let back = -lower_terms(base, e) + elementary::powi(base, N as i32) * (margin - kept);
    let pull = if kept < margin { (eased(back).min(possible) - floor(rate)).max(0.0) } else { 0.0 };
    Keep { rate, margin: kept, pull, is_invariant }
}

/// The condition of a set that is kept: (D + a)ⁿ (h − μ) ≥ pull. Rate, margin and pull are chosen again at every sample
/// ([`keep`]) and are then those of the [`Sample`].
#[derive(Clone, Copy, Debug)]
pub struct Stay<'a>(pub &'a FixedTimeSettings);

impl Stay<'_> {
    /// Chooses how the set is kept from the derivatives `h`, which are at least `lowest`, and writes the choice to `state`.
    pub(super) fn choose<const N: usize>(
        &self,
        state: &mut FixedTimeState,
        h: &[f64; N],
        lowest: &[f64; N],
        means: &Means,
    ) {
        let means = Means { drift: means.drift - self.0.disturbance, ..*means };
        let keep_from = |h: &[f64; N]| keep(h, state.margin, self.base_rate(h, &means), &means);
        let is_exact = lowest == h;
        let mut chosen = keep_from(h);
        let is_kept = |rate: f64| affordable_margin(rate, lowest) >= 0.0;
        if !is_exact && !is_kept(chosen.rate) {
            chosen = keep_from(lowest);
        }
        (state.stay_rate, state.stay_margin, state.pull) = (chosen.rate, chosen.margin, chosen.pull);
        // Errors are bounded to first order only, so half of the margin has to be left for the rest.
        let is_covered = || is_kept(chosen.rate) && chosen.margin >= ENOUGH * state.margin;
        state.on_course = chosen.is_invariant && (is_exact || is_covered());
    }

    /// Pulls back from outside, with the gentle rate and all of the margin. Nothing is promised.
    pub(super) fn pull_back<const N: usize>(
        &self,
        state: &mut FixedTimeState,
        lowest: &[f64; N],
        means: &Means,
    ) {
        state.on_course = false;
        (state.stay_rate, state.stay_margin, state.pull) = (self.base_rate(lowest, means), state.margin, 0.0);
    }

    /// Whether the gentle rate keeps h ≥ `margin` from the derivatives `h`.
    pub(super) fn can_keep<const N: usize>(&self, h: &[f64; N], margin: f64, means: &Means) -> bool {
        let mut e = *h;
        e[0] -= margin;
        h[0] >= 0.0 && is_invariant(self.base_rate(h, means), &e)
    }

    /// Whether rate and margin in `state` are constants that do not depend on the sample.
    pub(super) fn is_even(&self, state: &FixedTimeState) -> bool {
        let settings = self.0;
        let rate = settings
            .stay_rate
            .or(settings.rate)
            .or(settings.deadline.map(|deadline| FixedTimeSettings::default_rate(deadline, state.period)));
        state.stay_margin == state.margin && rate == Some(state.stay_rate)
    }

    /// The rate in 1/s with which the set is kept if nothing requires a larger one.
    fn base_rate<const N: usize>(&self, h: &[f64; N], means: &Means) -> f64 {
        /// The part of the largest h⁽ⁿ⁾ within the bounds that is used if there is time.
        const COMFORTABLE: f64 = 0.5;
        let settings = self.0;
        if let Some(rate) = settings.stay_rate.or(settings.rate) {
            return rate;
        }
        let by_time = match settings.deadline {
            Some(deadline) => FixedTimeSettings::default_rate(deadline, means.hold),
            None => f64::INFINITY,
        };
        let brakes = COMFORTABLE * (means.drift + means.reach);
        let by_brakes = match N <= 2 && brakes.is_finite() && brakes > 0.0 && h[0] > 0.0 {
            true if N == 1 => brakes / h[0],
            true => elementary::sqrt(brakes / h[0]),
            false if by_time.is_finite() => by_time,
            false => FixedTimeSettings::DEFAULT_KEEP_RATE,
        };
        let by_hold = LARGEST_RATE_TIMES_HOLD / means.hold;
        let rate = by_time.min(by_brakes);
        if means.hold > 0.0 { rate.min(by_hold) } else { rate }
    }
}

impl Condition for Stay<'_> {
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn bound(&self, at: &Sample) -> Bound {
        Bound { floor: at.pull - lower_terms(at.rate, at.e), lower: 0.0, applies: at.on_course }
    }

    fn rates(&self, at: &Sample) -> Option<Rates> {
        Some(Rates::Repeated(at.rate))
    }

    fn profile_change(&self, _at: &Sample, _change: &AnchorChange, _elapsed: f64) -> Option<Derivatives> {
        Some([0.0; MAX_RELATIVE_DEGREE + 1])
    }

    fn bound_change(&self, at: &Sample, _change: Option<&AnchorChange>, de: &[f64]) -> Option<[f64; 2]> {
        Some([-lower_terms(at.rate, de), 0.0])
    }
}

/// The part of e that is being lost, for n = 2: 0 if ė ≥ a e, 1 if ė ≤ 0. For other n it is 1.
#[inline]
fn outwards(e: &[f64], rate: f64) -> f64 {
    let back = if e.len() == 2 { e[1] / (rate * e[0]) } else { 0.0 };
    // Not `clamp`, which keeps NaN: 0/0 at rest on the boundary.
    if back > 0.0 { (1.0 - back).max(0.0) } else { 1.0 }
}

/// The rate from which φ ≤ `floor`, up to round-off: for n = 2 the larger zero of e a² + 2ė a + floor. NaN if there is none,
/// and for n > 2.
fn rate_of_floor(floor: f64, e: &[f64]) -> f64 {
    match *e {
        [e] => -floor / e,
        [e, rate] => (elementary::sqrt(rate * rate - e * floor) - rate) / e,
        _ => f64::NAN,
    }
}

/// The derivatives `e`, `hold` s later, with e⁽ⁿ⁾ = `highest`.
fn ahead<const N: usize>(e: &[f64; N], highest: f64, hold: f64) -> [f64; N] {
    // Horner's scheme, from the highest derivative.
    from_fn(|j| (j..N).rev().fold(highest, |sum, i| e[i] + sum * hold / (i + 1 - j) as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degree_two_condition() {
        assert!(is_invariant(2.0, &[1.0, -2.0]));
        assert!(!is_invariant(2.0, &[1.0, -2.1]));
        assert!(is_invariant(2.0, &[0.0, 1.0]));
        assert!(!is_invariant(2.0, &[-1e-9, 100.0]));
        assert!(!is_invariant(2.0, &[f64::NAN, 1.0]));
    }

    #[test]
    fn smallest_rate_of_known_cases() {
        // e = (1, −2, x): A_1 = a − 2, A_2 = a² − 4a + x = (a − 2)² + x − 4.
        assert_eq!(smallest_rate(&[1.0, -2.0, 4.0]), Some(2.0));
        assert_eq!(smallest_rate(&[1.0, -2.0, -5.0]), Some(5.0));
        assert_eq!(smallest_rate(&[1.0, -2.0, 400.0]), Some(2.0));
        assert_eq!(smallest_rate(&[0.0, 0.0, 1.0, -6.0]), Some(2.0));
        assert_eq!(smallest_rate(&[0.0; 8]), Some(0.0));
        assert_eq!(smallest_rate(&[0.0, 0.0, -1e-300, 1e300]), None);
        assert_eq!(smallest_rate(&[-1e-300, 1.0]), None);
        assert_eq!(smallest_rate(&[1.0, f64::NAN]), None);
        // It exists, but no double holds it.
        assert_eq!(smallest_rate(&[1e-300, -1e300]), None);
    }
}
