//! Custom reference profiles, checked before they are trusted.
//!
//! Let r be n − 1 times continuously differentiable with r⁽ⁿ⁾ piecewise continuous, r⁽ʲ⁾(0) = e⁽ʲ⁾(0) for j < n, and
//! r ≥ 0 from T on. Enforcing
//!
//! ```math
//! \prod_{i\le n} (D + a_i)\, (e - r) \ge 0, \qquad a_i > 0 \tag{P}
//! ```
//!
//! keeps e ≥ r for ever (`docs/theory.md#profile`), and so e ≥ 0 from T on. [`Hermite`] is one such r. Another may leave
//! faster, arrive inside, or wait.
//!
//! **The check.** Whether a function is the derivative of another is decided by the fundamental theorem, independently of
//! how either was written: r⁽ᵏ⁻¹⁾(b) − r⁽ᵏ⁻¹⁾(a) against ∫ r⁽ᵏ⁾ by Gauss' rule with five nodes (exact to degree 9). The rule
//! on the two halves shows its own error, and ten times that error is allowed; so a kink inside a panel is not mistaken for
//! a contradiction.
//!
//! # Requirements
//!
//! The check samples: a violation narrower than a panel (T/64, until 3T) may pass. Its tolerance is
//! [`TOLERANCE`] of the largest r⁽ᵏ⁾ met, in units of the panel.

use core::fmt;

pub use super::hermite::Hermite;
use crate::MAX_RELATIVE_DEGREE;
use crate::elementary;

/// r and its derivatives, `[e]`/s^k; entries above the order in use are ignored.
pub type Derivatives = [f64; MAX_RELATIVE_DEGREE + 1];

/// A trajectory of e from every anchor into the set: a function of the time since the anchor. It leaves with the derivatives
/// of the anchor and is ≥ 0 from the deadline on.
pub trait Profile {
    /// r⁽⁰⁾ … r⁽ⁿ⁾ at `elapsed` = τ ≥ 0 in s, from the derivatives `anchor` (e⁽⁰⁾ … e⁽ⁿ⁻¹⁾) within
    /// `deadline` = T > 0 in s; at a jump of r⁽ⁿ⁾, its value after it. The same arguments give the same bits.
    fn evaluate(&self, anchor: &[f64], deadline: f64, elapsed: f64) -> Derivatives;

    /// The derivative of [`Self::evaluate`] as the anchor moves along `direction`; for
    /// [`FixedTime::differentiate`](super::FixedTime::differentiate). The default does not know it.
    fn directional(
        &self,
        _anchor: &[f64],
        _direction: &[f64],
        _deadline: f64,
        _elapsed: f64,
    ) -> Option<Derivatives> {
        None
    }
}

impl<F: Fn(&[f64], f64, f64) -> Derivatives> Profile for F {
    fn evaluate(&self, anchor: &[f64], deadline: f64, elapsed: f64) -> Derivatives {
        self(anchor, deadline, elapsed)
    }
}

/// The profile of least peak |r⁽ⁿ⁾| that lands flat on zero, for n = 1 and 2; for higher orders the
/// Hermite profile.
///
/// n = 1: r = e (1 − s) with s = τ/T. n = 2: r̈ = K/T² until s₁T and −K/T² from then on. With y₀ = e and y₁ = ėT,
///
/// ```text
/// K = −2 sign(y₀ + y₁/2) (|y₀ + y₁/2| + √((y₀ + y₁/2)² + y₁²/4)),   s₁ = ½ − y₁/(2K).                (B)
/// ```
///
/// `docs/theory.md#least-peak` has the proof.
#[derive(Clone, Copy, Debug, Default)]
pub struct LowPeak;

impl Profile for LowPeak {
    fn evaluate(&self, anchor: &[f64], deadline: f64, elapsed: f64) -> Derivatives {
        let mut r = [0.0; MAX_RELATIVE_DEGREE + 1];
        let s = elapsed / deadline;
        match *anchor {
            _ if elapsed >= deadline => {}
            [e] => (r[0], r[1]) = (e * (1.0 - s), -e / deadline),
            [e, de] => {
                let v = de * deadline;
                let w = e + v / 2.0;
                let a = -2.0 * (w + elementary::hypot(w, v / 2.0).copysign(w));
                // At a = 0 both pieces are zero.
                let values = if a != 0.0 && s < 0.5 - v / (2.0 * a) {
                    [e + s * (v + s * a / 2.0), v + s * a, a]
                } else {
                    [-a * (1.0 - s) * (1.0 - s) / 2.0, a * (1.0 - s), -a]
                };
                (r[0], r[1], r[2]) = (values[0], values[1] / deadline, values[2] / (deadline * deadline));
            }
            _ => return Hermite.evaluate(anchor, deadline, elapsed),
        }
        r
    }

    /// Linear except for n = 2, where (B) gives K' (2K + 4w) = 2y₁y₁' − 4Kw' with w = y₀ + y₁/2.
    fn directional(
        &self,
        anchor: &[f64],
        direction: &[f64],
        deadline: f64,
        elapsed: f64,
    ) -> Option<Derivatives> {
        let ([e, de], [e_directional, de_directional]) = (anchor, direction) else {
            return Some(self.evaluate(direction, deadline, elapsed));
        };
        let mut r = [0.0; MAX_RELATIVE_DEGREE + 1];
        if elapsed >= deadline {
            return Some(r);
        }
        let s = elapsed / deadline;
        let (v, v_directional) = (de * deadline, de_directional * deadline);
        let (w, w_directional) = (e + v / 2.0, e_directional + v_directional / 2.0);
        let a = -2.0 * (w + elementary::hypot(w, v / 2.0).copysign(w));
        let a_directional = (2.0 * v * v_directional - 4.0 * a * w_directional) / (2.0 * a + 4.0 * w);
        let values = if a != 0.0 && s < 0.5 - v / (2.0 * a) {
            [
                e_directional + s * (v_directional + s * a_directional / 2.0),
                v_directional + s * a_directional,
                a_directional,
            ]
        } else {
            [-a_directional * (1.0 - s) * (1.0 - s) / 2.0, a_directional * (1.0 - s), -a_directional]
        };
        (r[0], r[1], r[2]) = (values[0], values[1] / deadline, values[2] / (deadline * deadline));
        Some(r)
    }
}

/// Relative tolerance of the check: far above round-off of a formula of a hundred operations, far below
/// any mistake in one.
pub const TOLERANCE: f64 = 1e-9;

/// A defect of a profile.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ProfileError {
    /// r⁽ᵏ⁾ is not finite at `elapsed`.
    NotFinite {
        /// k.
        order: usize,
        /// τ in s.
        elapsed: f64,
    },
    /// r⁽ᵏ⁾(0) is not e⁽ᵏ⁾(0).
    Anchor {
        /// k.
        order: usize,
        /// r⁽ᵏ⁾(0).
        found: f64,
        /// e⁽ᵏ⁾(0).
        wanted: f64,
    },
    /// r < 0 at or after the deadline.
    BelowZero {
        /// τ in s.
        elapsed: f64,
        /// r(τ).
        value: f64,
    },
    /// r⁽ᵏ⁾ is not the derivative of r⁽ᵏ⁻¹⁾.
    Inconsistent {
        /// k.
        order: usize,
        /// The middle of the panel, τ in s.
        elapsed: f64,
        /// Mean of r⁽ᵏ⁾ over the panel.
        found: f64,
        /// Difference quotient of r⁽ᵏ⁻¹⁾ over it.
        wanted: f64,
    },
}

impl fmt::Display for ProfileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite { order, elapsed } => {
                write!(f, "derivative {order} of the profile is not finite at {elapsed} s")
            }
            Self::Anchor { order, found, wanted } => {
                write!(f, "derivative {order} of the profile starts at {found}, the anchor has {wanted}")
            }
            Self::BelowZero { elapsed, value } => {
                write!(f, "the profile is {value} at {elapsed} s, must be >= 0 from the deadline on")
            }
            Self::Inconsistent { order, elapsed, found, wanted } => write!(
                f,
                "derivative {order} of the profile is {found} on average about {elapsed} s, \
                 the derivative before it changes by {wanted} per second"
            ),
        }
    }
}

impl core::error::Error for ProfileError {}

/// A profile from one anchor.
struct Anchored<'a> {
    profile: &'a dyn Profile,
    anchor: &'a [f64],
    deadline: f64,
}

/// Checks that `profile` leaves from `anchor` (e⁽⁰⁾ … e⁽ⁿ⁻¹⁾), that each derivative up to r⁽ⁿ⁾ is that of the one before,
/// and that it is ≥ 0 from `deadline` = T > 0 s on, until 3T.
///
/// # Errors
///
/// The first [`ProfileError`] met, in the order of time.
pub fn check(profile: &dyn Profile, anchor: &[f64], deadline: f64) -> Result<(), ProfileError> {
    /// Number of parts of a panel that does not fit.
    const SHORT: u32 = 64;
    let n = anchor.len();
    let panel = deadline / 64.0;
    let profile = Anchored { profile, anchor, deadline };
    let start = profile.finite(0.0)?;
    // Sizes of r⁽ᵏ⁾ Tᵏ decide what is round-off: a derivative that should vanish has no size itself.
    let size = |r: &Derivatives| {
        (0..=n)
            .fold(f64::MIN_POSITIVE, |m: f64, k| m.max((r[k] * elementary::powi(deadline, k as i32)).abs()))
    };
    // It leaves from the anchor.
    let mut largest = size(&start);
    for (order, (&found, &wanted)) in start.iter().zip(anchor).enumerate() {
        if (found - wanted).abs() * elementary::powi(deadline, order as i32) > TOLERANCE * largest {
            return Err(ProfileError::Anchor { order, found, wanted });
        }
    }
    let mut left = start;
    for i in 0..3 * 64 {
        // The panels meet at T exactly, where r⁽ⁿ⁾ may jump.
        let (a, b) = (panel * f64::from(i), panel * f64::from(i + 1));
        let right = profile.finite(b)?;
        largest = largest.max(size(&right));
        let whole = profile.mean(a, b)?;
        let middle = a + (b - a) / 2.0;
        let (first, second) = (profile.mean(a, middle)?, profile.mean(middle, b)?);
        // Each derivative has the mean that the previous one implies.
        for order in 1..=n {
            let found = first[order] / 2.0 + second[order] / 2.0;
            let wanted = (right[order - 1] - left[order - 1]) / (b - a);
            let round_off = TOLERANCE * largest / (elementary::powi(deadline, order as i32 - 1) * (b - a));
            if (found - wanted).abs() <= 10.0 * (found - whole[order]).abs() + round_off {
                continue;
            }
            // A kink may lie where the two rules happen to agree, but not where much shorter ones agree as well.
            let short = (b - a) / f64::from(SHORT);
            let mut refined = 0.0;
            for i in 0..SHORT {
                let from = a + short * f64::from(i);
                refined += profile.mean(from, from + short)?[order] / f64::from(SHORT);
            }
            if (refined - wanted).abs() > 10.0 * (refined - found).abs() + round_off {
                return Err(ProfileError::Inconsistent { order, elapsed: middle, found, wanted });
            }
        }
        if b >= deadline && right[0] < -TOLERANCE * largest {
            return Err(ProfileError::BelowZero { elapsed: b, value: right[0] });
        }
        left = right;
    }
    Ok(())
}

impl Anchored<'_> {
    fn finite(&self, elapsed: f64) -> Result<Derivatives, ProfileError> {
        let r = self.profile.evaluate(self.anchor, self.deadline, elapsed);
        match r[..=self.anchor.len()].iter().position(|v| !v.is_finite()) {
            Some(order) => Err(ProfileError::NotFinite { order, elapsed }),
            None => Ok(r),
        }
    }

    /// The mean of every derivative over [a, b] by Gauss' rule with five nodes.
    fn mean(&self, a: f64, b: f64) -> Result<Derivatives, ProfileError> {
        /// Nodes on [−1, 1] and half the weights.
        const RULE: [(f64, f64); 5] = [
            (-0.906_179_845_938_664, 0.118_463_442_528_094_54),
            (-0.538_469_310_105_683_1, 0.239_314_335_249_683_24),
            (0.0, 0.284_444_444_444_444_44),
            (0.538_469_310_105_683_1, 0.239_314_335_249_683_24),
            (0.906_179_845_938_664, 0.118_463_442_528_094_54),
        ];
        let mut sum = [0.0; MAX_RELATIVE_DEGREE + 1];
        for (node, weight) in RULE {
            let r = self.finite(a + (b - a) * (0.5 + 0.5 * node))?;
            for k in 0..=self.anchor.len() {
                sum[k] += weight * r[k];
            }
        }
        Ok(sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn peak(profile: &dyn Profile, anchor: &[f64], deadline: f64) -> f64 {
        let n = anchor.len();
        let at = |i: u32| profile.evaluate(anchor, deadline, deadline * f64::from(i) / 1000.0)[n].abs();
        (0..1000).map(at).fold(0.0, f64::max)
    }

    #[test]
    fn low_peaks_are_profiles_and_lower_than_the_polynomial() {
        // From rest 4/T² against 6/T².
        assert!((peak(&LowPeak, &[-1.0, 0.0], 2.0) - 1.0).abs() < 1e-12);
        assert!((peak(&Hermite, &[-1.0, 0.0], 2.0) - 1.5).abs() < 1e-12);
        for deadline in [0.3, 2.0, 50.0] {
            for anchor in [
                &[-3.0][..],
                &[-5.0, 0.0],
                &[-5.0, 3.0],
                &[-5.0, -3.0],
                &[-1.0, 40.0],
                &[-1.0, 1.0],
                &[0.0, 0.0],
                &[0.0, 1.0],
                &[2.0, -4.0],
            ] {
                assert_eq!(check(&LowPeak, anchor, deadline), Ok(()), "{anchor:?} in {deadline}");
                let (low, polynomial) = (peak(&LowPeak, anchor, deadline), peak(&Hermite, anchor, deadline));
                assert!(low <= polynomial * (1.0 + 1e-12), "{anchor:?} in {deadline}: {low} {polynomial}");
            }
        }
    }
}
