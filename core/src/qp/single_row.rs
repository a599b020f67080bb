//! One row and bounds: exact, without iteration to a tolerance.
//!
//! The Karush-Kuhn-Tucker conditions of `min ½‖u − r‖²` under aᵀu ≥ b and bounds give
//! `u_i(λ) = clamp(r_i + λ a_i)` for a multiplier λ ≥ 0, and aᵀu(λ) is continuous, piecewise linear
//! and non-decreasing in λ. So λ is found by walking the at most dim u breakpoints at which a
//! component reaches its bound. Without bounds there is no breakpoint and λ = (b − aᵀr)/‖a‖².

use super::{Bounds, Outcome, Row};

/// Solves into `u`; called where the row does not hold at the clamped `u_ref`.
pub(super) fn solve(row: &Row, bounds: &Bounds, u_ref: &[f64], limit: f64, u: &mut [f64]) -> Outcome {
    let m = u.len();
    let a = &row.normal[..m];
    // Rows may have any size: walk with a unit normal.
    let norm = a.iter().fold(0.0, |n: f64, v| n.hypot(*v));
    if norm == 0.0 {
        return Outcome::Degenerate;
    }
    let unit = |i: usize| a[i] / norm;
    let floor = row.floor / norm;
    // The multiplier at which component i stops moving.
    let stop = |i: usize| match unit(i) {
        d if d > 0.0 => (bounds.max[i] - u_ref[i]) / d,
        d if d < 0.0 => (bounds.min[i] - u_ref[i]) / d,
        _ => f64::INFINITY,
    };
    // A reference outside its bounds moves only once λ has brought it back to them.
    let start = |i: usize| match unit(i) {
        d if d > 0.0 => ((bounds.min[i] - u_ref[i]) / d).max(0.0),
        d if d < 0.0 => ((bounds.max[i] - u_ref[i]) / d).max(0.0),
        _ => f64::INFINITY,
    };
    let set = |lambda: f64, u: &mut [f64]| {
        for (i, ui) in u.iter_mut().enumerate() {
            *ui = if unit(i) == 0.0 {
                bounds.clamp(i, u_ref[i])
            } else if lambda >= stop(i) {
                if unit(i) > 0.0 { bounds.max[i] } else { bounds.min[i] }
            } else {
                bounds.clamp(i, u_ref[i] + lambda * unit(i))
            };
        }
    };
    let mut lambda = 0.0;
    loop {
        // On the way to the next breakpoint aᵀu(λ) grows with the slope of the moving components.
        let (mut value, mut slope, mut next) = (0.0, 0.0, f64::INFINITY);
        for i in 0..m {
            let d = unit(i);
            if d == 0.0 {
                continue;
            }
            if lambda < start(i) {
                value += d * bounds.clamp(i, u_ref[i]);
                next = f64::min(next, start(i));
            } else if lambda < stop(i) {
                value += d * u_ref[i];
                slope += d * d;
                next = f64::min(next, stop(i));
            } else {
                value += d * if d > 0.0 { bounds.max[i] } else { bounds.min[i] };
            }
        }
        let solution = if slope > 0.0 { (floor - value) / slope } else { f64::INFINITY };
        if solution <= next && solution.is_finite() {
            if solution > limit {
                return Outcome::Degenerate.with_best(row, bounds, u_ref, u);
            }
            set(solution.max(lambda), u);
            return Outcome::Optimal;
        }
        if next.is_infinite() {
            if slope > 0.0 {
                return Outcome::Degenerate.with_best(row, bounds, u_ref, u);
            }
            // Every component that can help is at its bound.
            set(f64::INFINITY, u);
            return if row.holds(u) { Outcome::Optimal } else { Outcome::Infeasible };
        }
        lambda = next;
    }
}

impl Outcome {
    /// Leaves in `u` the input of least violation: at the bound that helps where there is one, else
    /// the clamped reference.
    fn with_best(self, row: &Row, bounds: &Bounds, u_ref: &[f64], u: &mut [f64]) -> Self {
        for (i, ui) in u.iter_mut().enumerate() {
            let best = match row.normal[i] {
                d if d > 0.0 => bounds.max[i],
                d if d < 0.0 => bounds.min[i],
                _ => u_ref[i],
            };
            *ui = if best.is_finite() { best } else { bounds.clamp(i, u_ref[i]) };
        }
        self
    }
}
