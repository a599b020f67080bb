//! Arithmetic of [`Expansion`]s: polynomials in the time since their start.

use crate::elementary::powf;
use crate::interval::Interval;
use crate::lie::{EXPANSION_ORDERS, Expansion, ExpansionOver};
use crate::scalar::Scalar;

/// Highest power.
const DEGREE: usize = EXPANSION_ORDERS - 1;

/// The value after `dt` s.
pub(super) fn at(expansion: &Expansion, dt: f64) -> f64 {
    expansion.iter().rev().fold(0.0, |sum, c| sum * dt + c)
}

/// The derivative after `dt` s, per second.
pub(super) fn slope(expansion: &Expansion, dt: f64) -> f64 {
    (1..EXPANSION_ORDERS).rev().fold(0.0, |sum, k| sum * dt + k as f64 * expansion[k])
}

/// The mean over the first `dt` s.
pub(super) fn mean(expansion: &Expansion, dt: f64) -> f64 {
    (0..EXPANSION_ORDERS).rev().fold(0.0, |sum, k| sum * dt + expansion[k] / (k + 1) as f64)
}

/// The same polynomial in the time since `dt` s after its start.
pub(super) fn shifted(expansion: &Expansion, dt: f64) -> Expansion {
    let mut c = *expansion;
    for first in 0..DEGREE {
        for k in (first..DEGREE).rev() {
            c[k] += c[k + 1] * dt;
        }
    }
    c
}

/// The sum of the last two terms after `dt` s.
pub(super) fn last_terms(expansion: &Expansion, dt: f64) -> f64 {
    let power = (0..DEGREE - 1).fold(1.0, |power, _| power * dt);
    power * (expansion[DEGREE - 1].abs() + expansion[DEGREE].abs() * dt)
}

/// The longest time, up to `most` s, after which neither of the last two terms is larger than `allowed`.
pub(super) fn reach(expansion: &Expansion, allowed: f64, most: f64) -> f64 {
    if last_terms(expansion, most) <= allowed {
        return most;
    }
    let until = |k: usize| powf(allowed / expansion[k].abs(), 1.0 / k as f64);
    most.min(until(DEGREE - 1)).min(until(DEGREE))
}

/// A lower bound on the values within `dt` s: the least Bernstein coefficient, `b_j = Σ_{k ≤ j} C(j, k) / C(n, k) a_k` with
/// a_k = c_k dtᵏ.
///
/// Source: G. Farin, *Curves and Surfaces for CAGD*, section 6.1 (convex hull property).
pub(super) fn least(expansion: &Expansion, dt: f64) -> f64 {
    let (mut scaled, mut power) = (*expansion, 1.0);
    for (scaled, all) in scaled.iter_mut().zip(CHOICES[DEGREE]) {
        *scaled *= power / all;
        power *= dt;
    }
    let coefficient = |j: usize| -> f64 {
        let terms = CHOICES[j].iter().zip(&scaled).take(j + 1);
        terms.map(|(choices, a)| choices * a).sum()
    };
    (0..EXPANSION_ORDERS).map(coefficient).fold(f64::INFINITY, f64::min)
}

/// The coefficients of the expansion that starts anywhere within `dt` s. Each is that from the middle, give or take the
/// effect of the higher ones over half of `dt`.
pub(super) fn over(expansion: &Expansion, dt: f64) -> ExpansionOver {
    let (middle, half) = (shifted(expansion, 0.5 * dt), 0.5 * dt);
    core::array::from_fn(|k| {
        let wide = (k + 1..EXPANSION_ORDERS)
            .rev()
            .fold(0.0, |sum, j| (sum + CHOICES[j][k] * middle[j].abs()) * half);
        Interval::new(middle[k] - wide, middle[k] + wide)
    })
}

/// An upper bound on the residual of a state's expansion against its rate within `dt` s. The coefficients of the expansion
/// are within `expansion`, the first coefficients of the rate within `rate`.
///
/// Their difference r has zero coefficients at the start. So r(τ) = τᵏ r_k(s) at some s in 0 ... τ, for every k up to which
/// the rate is smooth, by Taylor's theorem with the Lagrange remainder. The least of these bounds counts.
pub(super) fn missed(rate: &[Interval], expansion: &ExpansionOver, dt: f64) -> f64 {
    let (mut least, mut power) = (f64::INFINITY, 1.0);
    for (k, rate) in rate.iter().enumerate() {
        let differs = (*rate - expansion[k + 1] * (k + 1) as f64).abs().high;
        least = least.min(power * differs);
        power *= dt;
    }
    least
}

/// C(n, k) at `[n][k]`.
const CHOICES: [[f64; EXPANSION_ORDERS]; EXPANSION_ORDERS] = {
    let mut table = [[0.0; EXPANSION_ORDERS]; EXPANSION_ORDERS];
    let mut n = 0;
    while n < EXPANSION_ORDERS {
        table[n][0] = 1.0;
        let mut k = 1;
        while k <= n {
            table[n][k] = table[n - 1][k - 1] + table[n - 1][k];
            k += 1;
        }
        n += 1;
    }
    table
};

#[cfg(test)]
mod tests {
    use super::*;

    /// (1 − τ)⁹ and others: known values, slopes and bounds.
    const FALLS: Expansion = [1.0, -9.0, 36.0, -84.0, 126.0, -126.0, 84.0, -36.0, 9.0, -1.0];

    #[test]
    fn polynomials_are_what_they_are() {
        assert!((at(&FALLS, 0.5) - 0.5_f64.powi(9)).abs() < 1e-12);
        assert!((slope(&FALLS, 0.5) + 9.0 * 0.5_f64.powi(8)).abs() < 1e-12);
        let later = shifted(&FALLS, 0.25);
        for dt in [0.0, 0.1, 0.3, 0.75] {
            assert!((at(&later, dt) - (0.75 - dt).powi(9)).abs() < 1e-12);
        }
        assert!((last_terms(&FALLS, 0.5) - (9.0 / 256.0 + 1.0 / 512.0)).abs() < 1e-12);
    }

    #[test]
    fn no_value_is_below_the_least_coefficient() {
        // All Bernstein coefficients of (1 - τ)⁹ on [0, 1] are 0 but the first.
        assert!(least(&FALLS, 1.0).abs() < 1e-12);
        let mut wave = [0.0; EXPANSION_ORDERS];
        for seed in 0..200_u64 {
            for (k, c) in wave.iter_mut().enumerate() {
                *c = ((seed * 7919 + k as u64 * 104_729) % 1009) as f64 / 500.0 - 1.0;
            }
            let lowest =
                (0..=1000).map(|k| at(&wave, 1.2 * f64::from(k) / 1000.0)).fold(f64::INFINITY, f64::min);
            assert!(least(&wave, 1.2) <= lowest + 1e-12, "{wave:?}");
        }
        // A line is its own bound.
        assert_eq!(least(&[3.0, -2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0), 1.0);
    }

    #[test]
    fn every_later_begin_is_enclosed() {
        let found = over(&FALLS, 0.8);
        for i in 0..=100 {
            let later = shifted(&FALLS, 0.8 * f64::from(i) / 100.0);
            for (found, wanted) in found.iter().zip(later) {
                // A hundred operations on numbers up to a few hundred.
                assert!(found.low <= wanted + 1e-11 && wanted <= found.high + 1e-11, "{found:?} {wanted}");
            }
        }
        // The bounds of a line are its ends.
        let line = [3.0, -2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(over(&line, 1.0)[0], Interval::new(1.0, 3.0));
    }

    #[test]
    fn the_last_terms_are_as_small_as_allowed() {
        let dt = reach(&FALLS, 1e-6, 10.0);
        assert!(last_terms(&FALLS, dt) <= 2.1e-6 && last_terms(&FALLS, 1.1 * dt) > 1e-6);
        assert_eq!(reach(&[5.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1e-9, 7.0), 7.0);
    }
}
