//! Staying inside: (D + a)ⁿ e ≥ 0 with a > 0 from a start with e ≥ 0.
//!
//! By the comparison lemma e ≥ e^{−aτ} P(τ), so e ≥ 0 for ever if every coefficient c_k(a) of P is ≥ 0
//! at the start. For n = 1 that is e ≥ 0; for n = 2 it is a ≥ −ė/e.

use super::comparison::coefficients;

/// Whether the stay constraint with `rate` > 0 keeps e ≥ 0 for ever from the derivatives `e`
/// (e⁽⁰⁾ … e⁽ⁿ⁻¹⁾): all c_k ≥ 0.
pub fn is_invariant(rate: f64, e: &[f64]) -> bool {
    coefficients(rate, e)[..e.len()].iter().all(|&c| c >= 0.0)
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
}
