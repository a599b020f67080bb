//! The paper's method for any order: (D + a)ⁿ e ≥ 0 with the constant rate a for which the bound reaches zero at T.
//!
//! P(T) = 0 in the comparison lemma is, with y_j = e⁽ʲ⁾(0) Tʲ/j!, ρ = aT and E_m(ρ) = Σ_{i≤m} ρⁱ/i!,
//!
//! ```math
//! Y_n(\rho) = \sum_{j<n} y_j\, E_{n-1-j}(\rho) = \sum_{i<n} (y_0 + \dots + y_{n-1-i})\, \frac{\rho^i}{i!} = 0. \tag{R}
//! ```
//!
//! For n = 2: ρ = −(e(0) + ė(0)T)/e(0), the paper's c = a/T. A root is *admissible* if T is the last zero of P on τ > 0
//! and P is positive after it, so that the bound exp(−aτ) P(τ) stays ≥ 0 after T.
//!
//! Let e(0) < 0. The largest real root of (R) is admissible, so an admissible rate exists if and only if (R) has a real
//! root. For even n every T > 0 has one. For odd n the deadlines that have one are a ray [T_min, ∞), or there is none
//! ([`deadlines`]); for n = 1 there is none. `docs/theory.md#admissible-rate` has the proof.
//!
//! [`rate`] takes the largest root: the least anti-stable one, and always admissible. [`admissibility`] judges any
//! other.
//!
//! # Requirements
//!
//! From rest the rate is negative (ρ = −1, −1.59607, −2.18061 for n = 2, 4, 6): the error dynamics are
//! **anti-stable**. Sampling errors grow like exp(|a|τ), and the constraint keeps asking e to grow after T. So it
//! overshoots the deadline by a few samples and must be followed by a stay constraint. It is here as the paper's
//! method; the reference profile has none of this.
//!
//! (R) is solved in the dimensionless ρ, its coefficients divided by the largest, so scales of e and T do not matter.
//! What remains is the condition of the root, [`uncertainty`]: sums y_0 + … + y_k that cancel, or two roots that
//! nearly meet. With T near T_min the root is as uncertain as the square root of the unit round-off, and round-off
//! decides whether it exists.
//!
//! # References
//!
//! The paper, theorem 1 and equation (14), for n = 2; the rest is this project's.

use core::fmt;

use super::comparison::{Stack, coefficients, factorial, lower_bound, lower_terms};
use super::condition::{Abilities, AnchorChange, Anchored, Anchoring, Bound, Condition, Rates, Sample};
use super::fixed_time::Refusal;
use super::polynomial::{self, Roots};
use super::profile::Derivatives;
use super::sampled;
use crate::MAX_RELATIVE_DEGREE;
use crate::elementary;

/// Why a repeated root has no admissible rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Reason {
    /// n = 1: the bound e(0) exp(−aτ) reaches zero for no rate.
    FirstOrder,
    /// e(0) ≥ 0: there is nothing to reach.
    Inside,
    /// The polynomial (R) has no real root.
    NoRealRoot,
    /// The data, or the rate itself, are not finite numbers.
    NotFinite,
}

/// The deadlines T > 0 for which an admissible rate exists.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Deadlines {
    /// None, however long.
    None,
    /// This one, in s, and every longer one.
    From(f64),
    /// All.
    All,
}

/// No admissible rate exists for this anchor and deadline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoAdmissibleRate {
    /// The reason.
    pub reason: Reason,
    /// The deadlines that would have one from the same anchor.
    pub deadlines: Deadlines,
}

impl fmt::Display for NoAdmissibleRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("no admissible rate: ")?;
        f.write_str(match self.reason {
            Reason::FirstOrder => "at relative degree 1 the bound never reaches zero",
            Reason::Inside => "the barrier is not negative at the anchor",
            Reason::NoRealRoot => "the polynomial of the repeated root has no real root",
            Reason::NotFinite => "the derivatives or the rate are not finite",
        })?;
        match self.deadlines {
            Deadlines::From(t) => write!(f, "; one exists for deadlines from {t} s"),
            Deadlines::None if self.reason == Reason::NoRealRoot => f.write_str(" for any deadline"),
            _ => Ok(()),
        }
    }
}

impl core::error::Error for NoAdmissibleRate {}

/// Whether a real root of (R) keeps its promise after the deadline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Admissibility {
    /// T is the last zero of P and P is positive after it.
    Admissible,
    /// c_{n−1} < 0: P falls without bound.
    NegativeLeading,
    /// P has a zero after T.
    LaterZero,
}

/// The admissible rate a in 1/s: the largest real root of (R) divided by T. `e` holds e⁽⁰⁾ … e⁽ⁿ⁻¹⁾ at
/// the anchor (n up to [`MAX_RELATIVE_DEGREE`]), `deadline` is T > 0 in s.
///
/// # Errors
///
/// There is none: n = 1, e(0) ≥ 0, no real root (odd n only), data or a rate that are not finite.
///
/// ```
/// use punctual_core::convergence::repeated_root::{Deadlines, Reason, deadlines, rate};
///
/// assert_eq!(rate(&[-5.0, 0.0], 10.0), Ok(-0.1));
/// let none = rate(&[-5.0, 0.0, 0.0], 10.0).unwrap_err();
/// assert_eq!((none.reason, none.deadlines), (Reason::NoRealRoot, Deadlines::None));
/// // T² (ė(0)² − e(0)ë(0)) ≥ e(0)²: from T = 2 on.
/// assert_eq!(deadlines(&[-4.0, 2.0, 0.0]), Deadlines::From(2.0));
/// ```
pub fn rate(e: &[f64], deadline: f64) -> Result<f64, NoAdmissibleRate> {
    let none = |reason| NoAdmissibleRate { reason, deadlines: deadlines(e) };
    let rate = match e {
        _ if !e.iter().all(|v| v.is_finite()) => return Err(none(Reason::NotFinite)),
        [_] => return Err(none(Reason::FirstOrder)),
        _ if e[0] >= 0.0 => return Err(none(Reason::Inside)),
        [e0, e1] => -(e0 + e1 * deadline) / (e0 * deadline),
        _ => {
            let roots = scaled_roots(e, deadline).ok_or(none(Reason::NotFinite))?;
            roots.largest().ok_or(none(Reason::NoRealRoot))? / deadline
        }
    };
    if rate.is_finite() { Ok(rate) } else { Err(none(Reason::NotFinite)) }
}

/// All real roots ρ = aT of (R) in rising order, whatever the sign of e(0); `None` if the data are not
/// finite.
pub fn scaled_roots(e: &[f64], deadline: f64) -> Option<Roots> {
    let y = scaled(e, deadline)?;
    let n = e.len();
    let mut r = [0.0; MAX_RELATIVE_DEGREE];
    let mut sum = 0.0;
    for j in 0..n {
        sum += y[j];
        r[n - 1 - j] = sum / factorial(n - 1 - j);
    }
    Some(polynomial::real_roots(&r[..n]))
}

/// Judges a root of (R): `rate` in 1/s, `e` and `deadline` as for [`rate`].
///
/// The zeros of P after T are those of its Taylor expansion at T, divided by τ − T.
pub fn admissibility(rate: f64, e: &[f64], deadline: f64) -> Admissibility {
    let (n, s) = (e.len(), rate * deadline);
    let y = scaled(e, deadline).unwrap_or([f64::NAN; MAX_RELATIVE_DEGREE]);
    // P in s = τ/T, then in z = s − 1 by repeated synthetic division.
    let mut p = [0.0; MAX_RELATIVE_DEGREE];
    for (k, pk) in p[..n].iter_mut().enumerate() {
        *pk = (0..=k).map(|j| y[j] * elementary::powi(s, (k - j) as i32) / factorial(k - j)).sum();
    }
    for start in 0..n {
        for k in (start..n - 1).rev() {
            p[k] += p[k + 1];
        }
    }
    if !p[..n].iter().rfind(|&&c| c != 0.0).is_some_and(|&c| c > 0.0) {
        return Admissibility::NegativeLeading;
    }
    let later = polynomial::real_roots(&p[1..n]).largest().is_some_and(|z| z > 0.0);
    if later { Admissibility::LaterZero } else { Admissibility::Admissible }
}

/// The deadlines for which [`rate`] has an answer at the anchor `e`.
pub fn deadlines(e: &[f64]) -> Deadlines {
    let n = e.len();
    if n < 2 || !e.iter().all(|v| v.is_finite()) || e[0] >= 0.0 {
        return Deadlines::None;
    }
    if n.is_multiple_of(2) {
        return Deadlines::All;
    }
    let mut c = [0.0; MAX_RELATIVE_DEGREE];
    for j in 0..n {
        c[n - 1 - j] = e[j] / (factorial(j) * factorial(n - 1 - j));
    }
    let mut shortest = f64::INFINITY;
    for &v in polynomial::real_roots(&c[..n]).as_slice() {
        // c_{n−1} = 0 at v; leaving it out removes a root that round-off would put near infinity.
        let p = coefficients(v, e);
        let first = polynomial::real_roots(&p[..n - 1]).as_slice().iter().copied().find(|&t| t > 0.0);
        shortest = first.map_or(shortest, |t| shortest.min(t));
    }
    if shortest.is_finite() { Deadlines::From(shortest) } else { Deadlines::None }
}

/// First-order bound on the error of `rate` that round-off causes, in 1/s: 4nε Σ |y_j| E_{n−1−j}(|ρ|) / (|Y_n'(ρ)|
/// T), ε the unit round-off. Infinite at a double root; also if the data are not finite.
///
/// The data, y_j, their partial sums and the value of Y_n each contribute up to about n roundings, of
/// half ε each.
pub fn uncertainty(rate: f64, e: &[f64], deadline: f64) -> f64 {
    let (n, s) = (e.len(), rate * deadline);
    let Some(y) = scaled(e, deadline) else { return f64::INFINITY };
    let power = |x: f64, k: usize| elementary::powi(x, k as i32) / factorial(k);
    let size: f64 = (0..n).map(|j| y[j].abs() * (0..n - j).map(|i| power(s.abs(), i)).sum::<f64>()).sum();
    // Y_n' = Y_n − c_{n−1} T^{n−1}, and Y_n = 0.
    let slope: f64 = (0..n).map(|j| y[j] * power(s, n - 1 - j)).sum();
    4.0 * n as f64 * f64::EPSILON * size / (slope.abs() * deadline)
}

/// The derivative in 1/s of a simple root `rate` of (R) as the anchor `e` moves along `direction`; not finite at a double
/// root.
fn rate_change(rate: f64, e: &[f64], direction: &[f64], deadline: f64) -> f64 {
    let (n, s) = (e.len(), rate * deadline);
    let power = |k: usize| elementary::powi(s, k as i32) / factorial(k);
    let y = |e: &[f64], j: usize| e[j] * elementary::powi(deadline, j as i32) / factorial(j);
    let change: f64 = (0..n).map(|j| y(direction, j) * (0..n - j).map(power).sum::<f64>()).sum();
    // Y_n' = Y_n − c_{n−1} T^{n−1}, and Y_n = 0.
    let slope: f64 = (0..n).map(|j| y(e, j) * power(n - 1 - j)).sum();
    // Y_n' = Σ y_j E_{n−2−j} is that sum with the sign changed.
    change / (slope * deadline)
}

/// The condition of [`Method::RepeatedRoot`](super::Method::RepeatedRoot): (D + a)ⁿ (h − μ) ≥ 0.
#[derive(Clone, Copy, Debug)]
pub struct RepeatedRoot;

/// Round-off of the bound ahead, as a part of its terms.
const MARGIN_TOLERANCE: f64 = 1e-12;

impl Condition for RepeatedRoot {
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn bound(&self, at: &Sample) -> Bound {
        // The e to which the constraint, active from here on, leads at the deadline: errors grow with a negative rate.
        let ahead = lower_bound(at.rate, at.e, at.time_left(0.0));
        let scale = MARGIN_TOLERANCE * (at.anchor[0].abs() + at.margin);
        Bound {
            floor: -lower_terms(at.rate, at.e),
            lower: lower_bound(at.rate, at.anchor, at.elapsed),
            applies: at.on_course && ahead >= -at.margin - scale,
        }
    }

    fn abilities(&self) -> Abilities {
        Abilities { hands_over: true, ..Abilities::default() }
    }

    fn anchor(&self, at: &Anchoring) -> Anchored {
        let kept =
            Anchored { margin: at.margin, rate: at.stay_rate, fallback: false, applies: !at.is_past() };
        if at.is_past() || at.keeps {
            return kept;
        }
        match rate(&at.error(at.margin)[..at.h.len()], at.deadline) {
            Ok(rate) => Anchored { rate, ..kept },
            Err(_) => Anchored { fallback: true, applies: false, ..kept },
        }
    }

    fn refusal(&self, at: &Sample) -> Option<Refusal> {
        rate(at.anchor, at.deadline).err().map(Refusal::NoAdmissibleRate)
    }

    fn rates(&self, at: &Sample) -> Option<Rates> {
        Some(Rates::Repeated(at.rate))
    }

    fn anchor_change(&self, at: &Sample, [_, dh]: [&[f64]; 2], _period: f64) -> Option<AnchorChange> {
        let mut change = AnchorChange::default();
        change.anchor[..dh.len()].copy_from_slice(dh);
        if at.has_time() && !at.fallback {
            change.rate = rate_change(at.rate, at.anchor, dh, at.deadline);
        }
        Some(change)
    }

    fn profile_change(&self, _at: &Sample, _change: &AnchorChange, _elapsed: f64) -> Option<Derivatives> {
        Some([0.0; MAX_RELATIVE_DEGREE + 1])
    }

    fn bound_change(&self, at: &Sample, change: Option<&AnchorChange>, de: &[f64]) -> Option<[f64; 2]> {
        let n = at.degree();
        let [anchor, rate] = change.map_or([0.0; 2], |change| [change.anchor[0], change.rate]);
        let by_rate: f64 = (0..n).map(|j| sampled::power_change(at.rate, n, j) * at.e[j]).sum();
        // The bound starts at the anchor itself.
        Some([-lower_terms(at.rate, de) - by_rate * rate, anchor])
    }
}

/// y_j = e⁽ʲ⁾ Tʲ/j!, divided by the largest of them; `None` if that is 0 or not finite.
fn scaled(e: &[f64], deadline: f64) -> Option<Stack> {
    let mut y = [0.0; MAX_RELATIVE_DEGREE];
    for (j, yj) in y[..e.len()].iter_mut().enumerate() {
        *yj = e[j] * elementary::powi(deadline, j as i32) / factorial(j);
    }
    let largest = y.iter().fold(0.0, |m: f64, v| if v.is_nan() { f64::INFINITY } else { m.max(v.abs()) });
    (largest.is_finite() && largest > 0.0).then(|| y.map(|v| v / largest))
}

#[cfg(test)]
mod tests {
    use super::super::comparison::lower_bound;
    use alloc::string::ToString;

    use super::*;

    #[test]
    fn bound_vanishes_at_the_deadline_and_grows_after() {
        for (e, t) in [([-4046.0, 0.0], 10.0), ([-3.0, 8.0], 2.0), ([-1e-3, -40.0], 0.5)] {
            let a = rate(&e, t).expect("admissible below zero");
            let size = e[0].abs() + e[1].abs() * t;
            // A handful of operations on numbers of that size.
            assert!(lower_bound(a, &e, t).abs() <= 1e-12 * size * (-a * t).exp(), "{e:?}");
            assert!(coefficients(a, &e)[1] > 0.0);
        }
    }

    #[test]
    fn the_closed_form_of_order_two_is_the_root_of_the_polynomial() {
        for (e, t) in [([-4046.0, 0.0], 10.0), ([-3.0, 8.0], 2.0), ([-1e-3, -40.0], 0.5)] {
            let a = rate(&e, t).expect("admissible below zero");
            let roots = scaled_roots(&e, t).expect("finite");
            assert_eq!(roots.as_slice().len(), 1);
            assert!((roots.as_slice()[0] / t - a).abs() <= uncertainty(a, &e, t), "{e:?}");
        }
    }

    #[test]
    fn reasons() {
        let reason = |e: &[f64], t| rate(e, t).map_err(|none| none.reason);
        assert_eq!(reason(&[-5.0, 0.0], 10.0), Ok(-0.1));
        assert_eq!(reason(&[-5.0], 10.0), Err(Reason::FirstOrder));
        assert_eq!(reason(&[0.0, 1.0], 10.0), Err(Reason::Inside));
        assert_eq!(reason(&[3.0, -1.0, 2.0], 10.0), Err(Reason::Inside));
        assert_eq!(reason(&[-3.0, 0.0, 0.0], 10.0), Err(Reason::NoRealRoot));
        assert_eq!(reason(&[-3.0, f64::NAN], 10.0), Err(Reason::NotFinite));
        assert_eq!(reason(&[-3.0, 0.0, 1e300], 1e100), Err(Reason::NotFinite));
        assert_eq!(reason(&[-5e-324, 1e300], 10.0), Err(Reason::NotFinite));
        assert_eq!(
            rate(&[-4.0, 2.0, 0.0], 1.0).unwrap_err().to_string(),
            "no admissible rate: the polynomial of the repeated root has no real root; \
             one exists for deadlines from 2 s"
        );
        assert_eq!(
            rate(&[-4.0, 0.0, 0.0], 1.0).unwrap_err().to_string(),
            "no admissible rate: the polynomial of the repeated root has no real root for any deadline"
        );
    }
}
