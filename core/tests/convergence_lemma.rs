//! The comparison lemma against an independent integrator, the Hermite profile against exact rationals.
//!
//! `roots/hermite.py` wrote `roots/hermite.csv`.

use proptest::prelude::*;
use punctual_core::convergence::comparison::{factorial, lower_bound, lower_terms};
use punctual_core::convergence::hermite::Hermite;
use punctual_core::convergence::profile::Profile;

/// One step of the classical Runge–Kutta method for e⁽ⁿ⁾ = `top`(τ, e).
fn rk4(e: &[f64], tau: f64, step: f64, top: impl Fn(f64, &[f64]) -> f64) -> Vec<f64> {
    let slope = |tau: f64, e: &[f64]| -> Vec<f64> {
        let mut d = e[1..].to_vec();
        d.push(top(tau, e));
        d
    };
    let moved = |d: &[f64], by: f64| -> Vec<f64> { e.iter().zip(d).map(|(e, d)| e + by * d).collect() };
    let k1 = slope(tau, e);
    let k2 = slope(tau + step / 2.0, &moved(&k1, step / 2.0));
    let k3 = slope(tau + step / 2.0, &moved(&k2, step / 2.0));
    let k4 = slope(tau + step, &moved(&k3, step));
    (0..e.len()).map(|j| e[j] + step / 6.0 * (k1[j] + 2.0 * (k2[j] + k3[j]) + k4[j])).collect()
}

/// e at τ = 1 from `e` under (D + a)ⁿ e = `excess`(τ), with `steps` steps.
fn integrated(a: f64, e: &[f64], steps: u32, excess: impl Fn(f64) -> f64) -> f64 {
    let (mut e, step) = (e.to_vec(), 1.0 / f64::from(steps));
    for k in 0..steps {
        e = rk4(&e, f64::from(k) * step, step, |tau, e| excess(tau) - lower_terms(a, e));
    }
    e[0]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

    /// (L) is a lower bound for any excess ≥ 0, and exact without one. The tolerance is the integrator's own
    /// error, of order 4: the difference of N and 2N steps is 15 times the error of the better.
    #[test]
    fn the_bound_holds_and_is_attained(
        e in prop::collection::vec(-1.0..1.0_f64, 1..=8),
        a in -3.0..3.0_f64,
        excess in prop::array::uniform3(0.0..5.0_f64),
    ) {
        let bound = lower_bound(a, &e, 1.0);
        let size = lower_bound(a.abs(), &e.iter().map(|v| v.abs()).collect::<Vec<_>>(), 1.0)
            * (a.abs() - a).exp();
        let mut found = [0.0; 2];
        for (found, size_of_excess) in found.iter_mut().zip([0.0, 1.0]) {
            let push = |tau: f64| size_of_excess * (excess[0] + excess[1] * (1.0 + (9.0 * excess[2] * tau).sin()));
            let coarse = integrated(a, &e, 200, push);
            *found = integrated(a, &e, 400, push);
            let method = (*found - coarse).abs();
            // 400 steps of round-off beside the method's error.
            let allowed = method + 1e-12 * (1.0 + size + found.abs());
            if size_of_excess == 0.0 {
                prop_assert!((*found - bound).abs() <= allowed, "{} for {}, {}", found, bound, allowed);
            } else {
                prop_assert!(*found >= bound - allowed, "{} under {}, {}", found, bound, allowed);
            }
        }
        // For (D + a)⁻ⁿ has a positive impulse response, more excess is more e.
        prop_assert!(found[1] >= found[0] - 1e-9 * (1.0 + size));
    }

    /// r minimises ∫ (r⁽ⁿ⁾)² among the functions with the same ends: it is orthogonal to every variation, so
    /// its derivative of order 2n vanishes; here by the n-th difference of r⁽ⁿ⁾, a polynomial of degree n − 1.
    #[test]
    fn the_profile_is_the_smoothest(e in prop::collection::vec(-1.0..1.0_f64, 1..=8)) {
        let n = e.len();
        let values: Vec<f64> = (0..=n).map(|i| Hermite.evaluate(&e, 1.0, 0.1 * i as f64)[n]).collect();
        let mut differences = values.clone();
        for _ in 0..n {
            differences = differences.windows(2).map(|w| w[1] - w[0]).collect();
        }
        // Each value is a sum of products of factorials: their round-off, times 2ⁿ for the differences.
        let size = values.iter().fold(0.0, |m: f64, v| m.max(v.abs())) + factorial(2 * n);
        prop_assert!(differences[0].abs() <= 1e-13 * 2_f64.powi(n as i32) * size, "{:?}", values);
    }
}

/// Round-off in parts of the sum of the magnitudes of all terms of r⁽ᵏ⁾ in the factored form: each is a
/// product of six factors, three of them powers, and the sums add up to eight each.
const ROUND_OFF: f64 = 16.0 * f64::EPSILON;

#[test]
fn the_profile_equals_exact_rationals() {
    let rows = include_str!("roots/hermite.csv");

    for row in rows.lines() {
        let number = |text: &str| text.parse::<f64>().expect("a number");
        let fields: Vec<Vec<f64>> = row.split(',').map(|f| f.split(' ').map(number).collect()).collect();
        let [deadline, elapsed, e, wanted, size] = &fields[..] else { panic!("{row}") };
        let found = Hermite.evaluate(e, deadline[0], elapsed[0]);
        for k in 0..=e.len() {
            let error = (found[k] - wanted[k]).abs();
            assert!(error <= ROUND_OFF * size[k], "{row}: order {k}, {} for {}", found[k], wanted[k]);
        }
    }
    assert_eq!(rows.lines().count(), 96);
}
