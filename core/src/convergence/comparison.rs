//! The comparison lemma, any order.
//!
//! Let (D + a)ⁿ e ≥ 0 on [0, τ] for a real rate a, with D = d/dt. Then
//!
//! ```math
//! \begin{aligned}
//! e(\tau) &\ge \exp(-a\tau)\, P(\tau), \qquad P(\tau) = \sum_{k<n} c_k \tau^k, \\
//! c_k &= \frac{1}{k!} \sum_{j\le k} \binom{k}{j} a^{k-j} e^{(j)}(0),
//! \end{aligned} \tag{L}
//! ```
//!
//! with equality where the constraint is active throughout. The proof is in `docs/theory.md#comparison-lemma`.
//!
//! # References
//!
//! The paper, theorem 1, for n = 2; the general order is this project's.

use crate::MAX_RELATIVE_DEGREE;
use crate::elementary;

/// One number per derivative order below n, `[e]`/s^k; zeros from n on.
pub type Stack = [f64; MAX_RELATIVE_DEGREE];

/// `PASCAL[n][k]` = C(n, k), exact; zeros for k > n.
const PASCAL: [[f64; MAX_RELATIVE_DEGREE + 1]; MAX_RELATIVE_DEGREE + 1] = {
    let mut c = [[0.0; MAX_RELATIVE_DEGREE + 1]; MAX_RELATIVE_DEGREE + 1];
    let mut n = 0;
    while n < c.len() {
        c[n][0] = 1.0;
        let mut k = 1;
        while k <= n {
            c[n][k] = c[n - 1][k - 1] + c[n - 1][k];
            k += 1;
        }
        n += 1;
    }
    c
};

/// The binomial coefficient C(n, k), 0 for k > n.
///
/// # Panics
///
/// If n or k is above [`MAX_RELATIVE_DEGREE`].
#[cfg_attr(not(feature = "small"), inline(always))]
pub fn binomial(n: usize, k: usize) -> f64 {
    PASCAL[n][k]
}

/// k! as a float.
#[inline]
pub fn factorial(k: usize) -> f64 {
    (1..=k).map(|i| i as f64).product()
}

/// The part of (D + a)ⁿ e below the highest derivative: Σ_{j<n} C(n, j) a^{n−j} e⁽ʲ⁾, where
/// `e` holds e⁽⁰⁾ … e⁽ⁿ⁻¹⁾ and its length is n.
#[cfg_attr(not(feature = "small"), inline(always))]
pub fn lower_terms(rate: f64, e: &[f64]) -> f64 {
    let (n, mut sum) = (e.len(), 0.0);
    for j in 0..n {
        sum = (sum + binomial(n, j) * e[j]) * rate;
    }
    sum
}

/// A_k = k! c_k = Σ_{j≤k} C(k, j) a^{k−j} e⁽ʲ⁾(0) for `k` below the length of `e`.
#[cfg_attr(not(feature = "small"), inline(always))]
pub(super) fn scaled_coefficient(rate: f64, e: &[f64], k: usize) -> f64 {
    let mut sum = 0.0;
    for j in 0..k + 1 {
        sum = sum * rate + binomial(k, j) * e[j];
    }
    sum
}

/// The coefficients c_0 … c_{n−1} of P in (L); `e` holds e⁽⁰⁾(0) … e⁽ⁿ⁻¹⁾(0).
pub fn coefficients(rate: f64, e: &[f64]) -> Stack {
    let mut c = [0.0; MAX_RELATIVE_DEGREE];
    for k in 0..e.len() {
        c[k] = scaled_coefficient(rate, e, k) / factorial(k);
    }
    c
}

/// The lower bound exp(−aτ) P(τ) of (L) at `elapsed` = τ ≥ 0.
pub fn lower_bound(rate: f64, e: &[f64], elapsed: f64) -> f64 {
    let c = coefficients(rate, e);
    let p = c[..e.len()].iter().rev().fold(0.0, |sum, &ck| sum * elapsed + ck);
    elementary::exp(-rate * elapsed) * p
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn binomials_and_operator() {
        assert_eq!([0, 1, 2, 3, 4, 5].map(|k| binomial(5, k)), [1.0, 5.0, 10.0, 10.0, 5.0, 1.0]);
        // (D + 2)³ e without its highest term: 3·2 e⁽²⁾ + 3·4 e⁽¹⁾ + 8 e at (1, 10, 100).
        assert_eq!(lower_terms(2.0, &[1.0, 10.0, 100.0]), 600.0 + 120.0 + 8.0);
    }

    #[test]
    fn bound_is_the_solution_of_the_active_constraint() {
        // e = (1 + 2τ − τ²) e^{−aτ} satisfies (D + a)³ e = 0, so (L) is an equality.
        let a = 0.7;
        let e = [1.0, 2.0 - a, -2.0 - 4.0 * a + a * a];
        let c = coefficients(a, &e);
        for (found, wanted) in c.iter().zip([1.0, 2.0, -1.0]) {
            assert!((found - wanted).abs() < 1e-15, "{c:?}");
        }
        let tau: f64 = 1.7;
        let exact = (1.0 + 2.0 * tau - tau * tau) * (-a * tau).exp();
        assert!((lower_bound(a, &e, tau) - exact).abs() < 1e-15);
    }
}
