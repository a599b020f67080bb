//! The paper's method: (D + a)ⁿ e ≥ 0 with the constant rate a for which the bound reaches zero at T.
//!
//! P(T) = 0 in the comparison lemma is, with y_j = e⁽ʲ⁾(0) Tʲ/j!, s = aT and E_m(s) = Σ_{i≤m} sⁱ/i!,
//!
//! ```text
//! Σ_{j<n} y_j E_{n−1−j}(s) = 0.                                              (R)
//! ```
//!
//! For n = 2: s = −(e₀ + e₁T)/e₀, the paper's c = a/T = (−e₀ − e₁T)/(e₀T²). The root is admissible if
//! T is the last zero of P and c_{n−1} ≥ 0; for n = 2 that is e₀ < 0.
//!
//! From rest the rate is −1/T: the error dynamics are **anti-stable**. Sampling errors grow like
//! e^{|a|τ}, and the constraint keeps asking h to grow after T; so it overshoots the deadline by a few
//! samples and must be followed by a stay constraint. It is here as the paper's baseline.
//!
//! # References
//!
//! The paper, theorem 1 and equation (14).

/// The admissible rate a in 1/s, `None` if there is none (e₀ ≥ 0, or a rate that is not finite).
/// `e` = (e, ė) at the anchor, `deadline` T > 0 in s.
///
/// Relative degree 2 only: orders above need the real roots of (R), which are not implemented yet;
/// [`FixedTime`](super::FixedTime) refuses them.
pub fn rate(e: [f64; 2], deadline: f64) -> Option<f64> {
    if e[0] >= 0.0 {
        return None;
    }
    let rate = -(e[0] + e[1] * deadline) / (e[0] * deadline);
    rate.is_finite().then_some(rate)
}

#[cfg(test)]
mod tests {
    use super::super::comparison::{coefficients, lower_bound};
    use super::*;

    #[test]
    fn bound_vanishes_at_the_deadline_and_grows_after() {
        for (e, t) in [([-4046.0, 0.0], 10.0), ([-3.0, 8.0], 2.0), ([-1e-3, -40.0], 0.5)] {
            let a = rate(e, t).expect("admissible below zero");
            let size = e[0].abs() + e[1].abs() * t;
            assert!(lower_bound(a, &e, t).abs() <= 1e-12 * size * (-a * t).exp(), "{e:?}");
            assert!(coefficients(a, &e)[1] > 0.0);
        }
    }

    #[test]
    fn from_rest_the_rate_is_minus_one_over_the_deadline() {
        assert_eq!(rate([-5.0, 0.0], 10.0), Some(-0.1));
    }

    #[test]
    fn there_is_none_inside() {
        assert_eq!(rate([0.0, 1.0], 10.0), None);
        assert_eq!(rate([3.0, -1.0], 10.0), None);
    }
}
