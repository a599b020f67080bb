//! The reference profile: a polynomial that leaves the anchor with the given derivatives and lands flat on zero at the
//! deadline.
//!
//! With s = τ/T and y_j = e⁽ʲ⁾(0) Tʲ/j!, the two-point Hermite interpolant of degree 2n − 1 is
//!
//! ```math
//! \begin{aligned}
//! r(\tau) &= (1-s)^n \sum_{k<n} q_k s^k, \\
//! q_k &= \sum_{j\le k} y_j \binom{n-1+k-j}{k-j} \qquad \text{for } \tau < T, \qquad r = 0 \text{ from } T \text{ on}.
//! \end{aligned} \tag{H}
//! ```
//!
//! r⁽ʲ⁾(0) = e⁽ʲ⁾(0) and r⁽ʲ⁾(T) = 0 for j < n. Among all such r it has the least ∫ (r⁽ⁿ⁾)². It exists for every n,
//! every T > 0 and all initial data, with no root to find (`docs/theory.md#hermite-profile`). The factored form keeps
//! its relative accuracy near s = 1, where the monomial form cancels.

use super::profile::{Derivatives, Profile};
use crate::MAX_RELATIVE_DEGREE;

/// The profile (H), the default.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hermite;

impl Hermite {
    /// [`Profile::evaluate`] for n = `N`.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn of_degree<const N: usize>(anchor: &[f64; N], deadline: f64, elapsed: f64) -> Derivatives {
        let n = N;
        let mut r = [0.0; MAX_RELATIVE_DEGREE + 1];
        if elapsed >= deadline {
            return r;
        }
        let mut scale = 1.0;
        for j in 0..n {
            r[j] = anchor[j] * scale;
            scale *= deadline / (j + 1) as f64;
        }
        // The binomial coefficients in (H) are those of (1 − s)⁻ⁿ: n sums over all terms before.
        for _ in 0..n {
            for k in 1..n {
                r[k] += r[k - 1];
            }
        }
        let per_deadline = 1.0 / deadline;
        let (s, left) = (elapsed * per_deadline, (deadline - elapsed) * per_deadline);
        // Coefficients of powers of σ: q(s + σ) by repeated division, then n factors (1 − s) − σ.
        for k in 1..n {
            for i in (k - 1..n - 1).rev() {
                r[i] += s * r[i + 1];
            }
        }
        for _ in 0..n {
            for k in (1..=n).rev() {
                r[k] = left * r[k] - r[k - 1];
            }
            r[0] *= left;
        }
        let mut scale = 1.0;
        for k in 1..=n {
            scale *= k as f64 * per_deadline;
            r[k] *= scale;
        }
        r
    }
}

impl Profile for Hermite {
    /// Entries above n are 0.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn evaluate(&self, anchor: &[f64], deadline: f64, elapsed: f64) -> Derivatives {
        const { assert!(MAX_RELATIVE_DEGREE <= 8, "the degrees below") };
        // With n known to the compiler the short loops unroll.
        macro_rules! by_degree {
            ($($n:literal),*) => {
                match anchor.len() {
                    $($n if $n <= MAX_RELATIVE_DEGREE => anchor.first_chunk::<$n>().map(|a| Self::of_degree(a, deadline, elapsed)),)*
                    _ => None,
                }
            };
        }
        by_degree!(1, 2, 3, 4, 5, 6, 7, 8).unwrap_or([0.0; MAX_RELATIVE_DEGREE + 1])
    }

    /// Linear in the anchor.
    fn directional(
        &self,
        _anchor: &[f64],
        direction: &[f64],
        deadline: f64,
        elapsed: f64,
    ) -> Option<Derivatives> {
        Some(self.evaluate(direction, deadline, elapsed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degree_two_is_the_known_cubic() {
        // r = h₀ (1 − 3s² + 2s³) + h₁ T (s − 2s² + s³) for h₀ = −5, h₁ = 3, T = 2.
        let (h0, h1, t) = (-5.0, 3.0, 2.0);
        for tau in [0.0, 0.3, 1.1, 1.9999] {
            let s: f64 = tau / t;
            let exact = [
                h0 * (1.0 - 3.0 * s.powi(2) + 2.0 * s.powi(3)) + h1 * t * (s - 2.0 * s.powi(2) + s.powi(3)),
                (h0 * (-6.0 * s + 6.0 * s.powi(2)) + h1 * t * (1.0 - 4.0 * s + 3.0 * s.powi(2))) / t,
                (h0 * (-6.0 + 12.0 * s) + h1 * t * (-4.0 + 6.0 * s)) / (t * t),
            ];
            let found = Hermite.evaluate(&[h0, h1], t, tau);
            for k in 0..3 {
                // A dozen operations on numbers of order 10.
                assert!(
                    (found[k] - exact[k]).abs() < 1e-13,
                    "tau {tau}, order {k}: {} {}",
                    found[k],
                    exact[k]
                );
            }
        }
    }

    #[test]
    fn meets_both_ends_for_every_order() {
        let data = [-7.0, 2.0, -1.5, 0.4, 3.0, -2.0, 0.1, 5.0];
        for n in 1..=MAX_RELATIVE_DEGREE {
            let t = 1.7;
            let at = |elapsed: f64| Hermite.evaluate(&data[..n], t, elapsed);
            let start = at(0.0);
            // Near the end the derivative of order k is O((1 − s)^{n−k}) of the largest one.
            let end = at(t * (1.0 - 1e-9));
            // Every derivative is a sum of terms up to the size of the largest one.
            let size = start.iter().fold(1.0, |m: f64, r| m.max(r.abs()));
            for k in 0..n {
                assert!((start[k] - data[k]).abs() < 1e-14 * size, "n {n} k {k}: {start:?}");
                assert!(end[k].abs() < 1e-7 * size, "n {n} k {k}: {end:?}");
            }
            assert_eq!(at(t), [0.0; MAX_RELATIVE_DEGREE + 1]);
        }
    }
}
