//! The smallest rate of the stay constraint, on random data of any order.

use proptest::prelude::*;
use punctual_core::convergence::comparison::{binomial, coefficients, lower_bound};
use punctual_core::convergence::polynomial::real_roots;
use punctual_core::convergence::stay::{is_invariant, smallest_rate};

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(1000) })]

    /// The rate is the largest real zero of any A_k = k! c_k above the ones before, found here with the
    /// finder of all real roots, and every larger rate does as well.
    #[test]
    fn it_is_the_largest_zero_of_the_coefficients(
        data in prop::collection::vec(-1.0..1.0_f64, 1..=8),
        log_time in -3.0..3.0_f64,
    ) {
        let time = 10_f64.powf(log_time);
        let mut e: Vec<f64> = data.iter().enumerate().map(|(j, v)| v / time.powi(j as i32)).collect();
        e[0] = e[0].abs();
        prop_assume!(e[0] > 1e-3);
        let rate = smallest_rate(&e).expect("e₀ > 0");
        prop_assert!(is_invariant(rate, &e));
        let mut wanted = 0.0_f64;
        for k in 1..e.len() {
            let a: Vec<f64> = (0..=k).map(|i| binomial(k, i) * e[k - i]).collect();
            wanted = real_roots(&a).largest().map_or(wanted, |root| wanted.max(root));
        }
        // The zero that decides is simple or the round-off of its polynomial decides: √ε at a double one.
        prop_assert!((rate - wanted).abs() <= 1e-6 * wanted.max(1.0 / time), "{} for {}", rate, wanted);
        for factor in [1.0 + 1e-6, 1.5, 10.0, 1e6] {
            prop_assert!(is_invariant(rate * factor + 1e-6 / time, &e), "{} × {}", rate, factor);
        }
        // It keeps its promise: the bound of the lemma stays ≥ 0 (each of its terms does).
        prop_assert!(coefficients(rate, &e).iter().all(|&c| c >= 0.0));
        for k in 0..50 {
            prop_assert!(lower_bound(rate, &e, time * 0.01 * 1.3_f64.powi(k)) >= 0.0);
        }
    }

    /// n = 2 in closed form.
    #[test]
    fn order_two_in_closed_form(e0 in 1e-6..1e9_f64, e1 in -1e9..1e9_f64) {
        let rate = smallest_rate(&[e0, e1]).expect("e₀ > 0");
        let wanted = (-e1 / e0).max(0.0);
        // a e₀ + e₁ ≥ 0 in floating point: one rounding of the quotient, one of the product.
        prop_assert!((rate - wanted).abs() <= 2.0 * f64::EPSILON * wanted, "{} for {}", rate, wanted);
    }
}
