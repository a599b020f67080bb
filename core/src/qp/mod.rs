//! The quadratic programme `min ½‖u − u_ref‖²` under affine rows and bounds: linear algebra only.
//!
//! ```text
//! minimise ½‖u − u_ref‖²  subject to  a_iᵀ u ≥ b_i (i = 1 … m),  u_min ≤ u ≤ u_max
//! ```
//!
//! - u_ref feasible: it is returned unchanged, bit for bit.
//! - one row: closed form, with or without bounds (module `single_row`), no allocation.
//! - several rows: an interior-point method (module `interior_point`), which allocates.
//!
//! Bounds are never relaxed. Rows that cannot be met within them are violated as little as possible,
//! and the status says so.

mod interior_point;
mod single_row;

use crate::MAX_INPUTS;

/// One row aᵀu ≥ b.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// a; zeros above the number of inputs.
    pub normal: [f64; MAX_INPUTS],
    /// b.
    pub floor: f64,
}

impl Row {
    /// 0ᵀu ≥ 0.
    pub const ZERO: Self = Self { normal: [0.0; MAX_INPUTS], floor: 0.0 };

    /// aᵀu − b: ≥ 0 where the row holds.
    pub fn slack(&self, u: &[f64]) -> f64 {
        dot(&self.normal, u) - self.floor
    }

    /// The size of the terms whose difference the slack is: Σ|a_i u_i| + |b|.
    pub fn size(&self, u: &[f64]) -> f64 {
        self.normal.iter().zip(u).map(|(a, v)| (a * v).abs()).sum::<f64>() + self.floor.abs()
    }

    /// The slack counted as round-off: 1e-12 of its [`Self::size`].
    pub fn round_off(&self, u: &[f64]) -> f64 {
        1e-12 * self.size(u)
    }

    /// Whether the row holds at `u` up to [`Self::round_off`].
    pub fn holds(&self, u: &[f64]) -> bool {
        self.slack(u) >= -self.round_off(u)
    }
}

/// Σ a_i b_i over the shorter of the two.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// `row` times the power of two that brings the largest component of its normal to 1 ..< 2: exact, and
/// out of reach of overflow. `None` where the normal vanishes (is zero or subnormal).
fn scaled(row: &Row) -> Option<Row> {
    const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
    let largest = row.normal.iter().fold(0.0, |s: f64, a| s.max(a.abs()));
    if largest < f64::MIN_POSITIVE {
        return None;
    }
    let scale = 1.0 / f64::from_bits(largest.to_bits() & EXPONENT);
    Some(Row { normal: row.normal.map(|a| a * scale), floor: row.floor * scale })
}

/// How far the rows moved `u`: its distance from the reference within the bounds.
fn distance_from_clamped(u: &[f64], bounds: &Bounds, u_ref: &[f64]) -> f64 {
    u.iter().zip(u_ref).enumerate().fold(0.0, |d: f64, (i, (v, r))| d.hypot(v - bounds.clamp(i, *r)))
}

/// Bounds on u; ±infinity where there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Lower bounds, unit of u.
    pub min: [f64; MAX_INPUTS],
    /// Upper bounds, unit of u.
    pub max: [f64; MAX_INPUTS],
}

impl Bounds {
    /// No bounds.
    pub const NONE: Self = Self { min: [f64::NEG_INFINITY; MAX_INPUTS], max: [f64::INFINITY; MAX_INPUTS] };

    /// `value` moved into the bounds of component `i`; not-a-number becomes the point nearest 0.
    pub fn clamp(&self, i: usize, value: f64) -> f64 {
        let value = if value.is_nan() { 0.0 } else { value };
        value.max(self.min[i]).min(self.max[i])
    }

    /// Whether every component of `u` lies within its bounds.
    pub fn contain(&self, u: &[f64]) -> bool {
        u.iter().enumerate().all(|(i, v)| self.min[i] <= *v && *v <= self.max[i])
    }
}

/// Which method produced the answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Solver {
    /// None was needed: u_ref was feasible.
    #[default]
    Unchanged,
    /// The closed form for one row.
    ClosedForm,
    /// The interior-point method.
    InteriorPoint,
}

/// What the returned input is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The minimiser.
    Optimal,
    /// A row cannot be met within the bounds: the bounded input of least violation.
    Infeasible,
    /// A row cannot be met because its normal is too small: meeting it would change u by more than the
    /// correction limit. The bounded input of least violation; u_ref where there are no bounds.
    Degenerate,
    /// The interior-point method did not converge: u_ref within its bounds.
    Failed,
}

/// How a solve went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Solution {
    /// What the returned input is.
    pub outcome: Outcome,
    /// Which method produced it.
    pub solver: Solver,
    /// Iterations of the interior-point method, else 0.
    pub iterations: u32,
}

/// Solves the programme into `u`, which has the length of `u_ref` (finite, 1 to [`MAX_INPUTS`]).
///
/// `correction_limit` > 0 bounds how far the rows may move u from the reference within its bounds: one
/// that needs more is degenerate.
pub fn solve(rows: &[Row], bounds: &Bounds, u_ref: &[f64], correction_limit: f64, u: &mut [f64]) -> Solution {
    for (i, (ui, r)) in u.iter_mut().zip(u_ref).enumerate() {
        *ui = bounds.clamp(i, *r);
    }
    if rows.iter().all(|row| row.slack(u) >= 0.0) {
        return Solution { outcome: Outcome::Optimal, solver: Solver::Unchanged, iterations: 0 };
    }
    match rows {
        [row] => {
            let outcome = single_row::solve(row, bounds, u_ref, correction_limit, u);
            Solution { outcome, solver: Solver::ClosedForm, iterations: 0 }
        }
        _ => interior_point::solve(rows, bounds, u_ref, correction_limit, u),
    }
}
