//! Staying inside: (D + a)ⁿ e ≥ 0 with a > 0 from a start with e ≥ 0.
//!
//! By the comparison lemma e ≥ e^{−aτ} P(τ), so e ≥ 0 for ever if every coefficient c_k(a) of P is ≥ 0
//! at the start. For n = 1 that is e ≥ 0; for n = 2 it is a ≥ −ė/e.
//!
//! **The rates that do.** The k! c_k are an Appell sequence in a:
//!
//! ```math
//! A_k(a) = k!\, c_k(a) = \sum_{j\le k} \binom{k}{j} a^{k-j} e^{(j)}, \qquad \frac{dA_k}{da} = k\, A_{k-1}. \tag{A}
//! ```
//!
//! So where A_0 … A_{k−1} are ≥ 0 on a ray [a_{k−1}, ∞), A_k does not fall on it,
//! and A_0 … A_k are ≥ 0 on a smaller ray [a_k, ∞), or nowhere if A_k is a negative constant. By
//! induction the rates ≥ 0 with all c_k ≥ 0 are a ray [a_min, ∞), and there is none if and only if the
//! first derivative that is not zero is negative. Every rate above [`smallest_rate`] will do as well.

use super::comparison::scaled_coefficient;
use super::polynomial::first;

/// Whether the stay constraint with `rate` > 0 keeps e ≥ 0 for ever from the derivatives `e`
/// (e⁽⁰⁾ … e⁽ⁿ⁻¹⁾): all A_k ≥ 0.
#[inline(always)]
pub fn is_invariant(rate: f64, e: &[f64]) -> bool {
    let mut all = true;
    for k in 0..e.len() {
        all = all && scaled_coefficient(rate, e, k) >= 0.0;
    }
    all
}

/// The smallest rate a ≥ 0 in 1/s with [`is_invariant`]; `None` if no finite rate has it. For n = 2,
/// max(0, −ė/e).
///
/// The rate returned satisfies [`is_invariant`] to the last bit; the number below it does not, but for
/// round-off of the A_k.
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
    is_invariant(f64::MAX, e).then(|| first(0.0, f64::MAX, |rate| is_invariant(rate, e)))
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
