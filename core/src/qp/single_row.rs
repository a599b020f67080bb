//! One row and bounds: exact, without iteration to a tolerance.
//!
//! The Karush-Kuhn-Tucker conditions of `min ½‖u − r‖²` under aᵀu ≥ b and bounds give
//! `u_i(λ) = clamp(r_i + λ a_i)` for a multiplier λ ≥ 0, and aᵀu(λ) is continuous, piecewise linear
//! and non-decreasing in λ. So λ is found by walking the breakpoints, at most 2 dim u, at which a component
//! leaves or reaches a bound. Without bounds there is none and λ = (b − aᵀr)/‖a‖².

use core::array::from_fn;

use super::{Bounds, Outcome, Row, distance_from_clamped, power_of_two, scaled};
use crate::MAX_INPUTS;

/// A component of the normal below this part of the largest one cannot influence the row: its square
/// would underflow.
const NEGLIGIBLE: f64 = 1e-150;

/// Solves into `u`; called where the row does not hold at the clamped `u_ref`. Returns the multiplier too,
/// 0 unless the row holds.
pub(super) fn solve(row: &Row, bounds: &Bounds, u_ref: &[f64], limit: f64, u: &mut [f64]) -> (Outcome, f64) {
    let m = u.len();
    let Some(Row { normal: a, floor }) = scaled(row) else {
        least_violation(row, bounds, u_ref, u);
        return (Outcome::IllConditioned, 0.0);
    };
    let moves = |i: usize| a[i].abs() >= NEGLIGIBLE;
    // The multipliers between which component i moves: a reference outside its bounds moves only once
    // λ has brought it back to them.
    let span: [(f64, f64); MAX_INPUTS] = from_fn(|i| match a[i] {
        _ if i >= m || !moves(i) => (f64::INFINITY, f64::INFINITY),
        d if d > 0.0 => (((bounds.min[i] - u_ref[i]) / d).max(0.0), (bounds.max[i] - u_ref[i]) / d),
        d => (((bounds.max[i] - u_ref[i]) / d).max(0.0), (bounds.min[i] - u_ref[i]) / d),
    });
    let at = |lambda: f64, i: usize| {
        if !moves(i) || lambda < span[i].0 {
            bounds.clamp(i, u_ref[i])
        } else if lambda < span[i].1 {
            bounds.clamp(i, u_ref[i] + lambda * a[i])
        } else if a[i] > 0.0 {
            bounds.max[i]
        } else {
            bounds.min[i]
        }
    };
    // Walk the breakpoints.
    let mut lambda = 0.0;
    loop {
        // On the way to the next breakpoint aᵀu(λ) grows with the slope of the moving components.
        let (mut value, mut slope, mut next) = (0.0, 0.0, f64::INFINITY);
        for i in 0..m {
            let (start, stop) = span[i];
            if moves(i) && start <= lambda && lambda < stop {
                value += a[i] * u_ref[i];
                slope += a[i] * a[i];
                next = f64::min(next, stop);
            } else {
                value += a[i] * at(lambda, i);
                if lambda < start {
                    next = f64::min(next, start);
                }
            }
        }
        let solution = if slope > 0.0 { (floor - value) / slope } else { f64::INFINITY };
        if solution <= next && solution.is_finite() {
            for (i, ui) in u.iter_mut().enumerate() {
                *ui = at(solution.max(lambda), i);
            }
            // λ is known to the round-off of the terms at u_ref, which may be far larger than those at u.
            let met = row.slack(u) >= -row.round_off(u) - row.round_off(u_ref);
            if met && distance_from_clamped(u, bounds, u_ref) <= limit {
                return (Outcome::Optimal, solution.max(lambda) * power_of_two(&row.normal).unwrap_or(1.0));
            }
            least_violation(row, bounds, u_ref, u);
            return (Outcome::IllConditioned, 0.0);
        }
        if next.is_infinite() {
            // Every component that can help is at its bound, or too flat to get there.
            let outcome = match least_violation(row, bounds, u_ref, u) {
                false => Outcome::IllConditioned,
                true if slope == 0.0 && row.holds(u) => Outcome::Optimal,
                true => Outcome::Infeasible,
            };
            return (outcome, 0.0);
        }
        lambda = next;
    }
}

/// Leaves in `u` the input of least violation: at the bound that helps where there is one, else the
/// clamped reference. Returns whether there is one for every component of the row.
fn least_violation(row: &Row, bounds: &Bounds, u_ref: &[f64], u: &mut [f64]) -> bool {
    let mut bounded = true;
    for (i, ui) in u.iter_mut().enumerate() {
        let best = match row.normal[i] {
            d if d > 0.0 => bounds.max[i],
            d if d < 0.0 => bounds.min[i],
            _ => bounds.clamp(i, u_ref[i]),
        };
        bounded &= best.is_finite();
        *ui = if best.is_finite() { best } else { bounds.clamp(i, u_ref[i]) };
    }
    bounded
}
