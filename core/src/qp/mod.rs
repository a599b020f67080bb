//! The quadratic program (QP) `min ½‖u − u_ref‖²` under affine rows and bounds: linear algebra only.
//!
//! ```text
//! minimise ½ (u − u_ref)ᵀ W (u − u_ref)  subject to  a_iᵀ u ≥ b_i (i = 1 … m),  u_min ≤ u ≤ u_max
//! ```
//!
//! with a diagonal W > 0, the identity by default.
//!
//! - u_ref feasible: it is returned unchanged, bit for bit.
//! - one row active and no bound, W = 1: closed form, whatever the number of rows (module `one_active`).
//! - one row, W = 1: closed form, with or without bounds (module `single_row`).
//! - else: a dual active-set method (module `dual_active_set`), exact up to round-off.
//!
//! None of these allocates. A wrong answer would show in [`Workspace::residuals`].
//!
//! Bounds are never relaxed. Hard rows that cannot be met within them are violated as little as possible. Each,
//! in the order of priority and then of the list, is violated as little as those before it allow. Among the inputs
//! that do so the one nearest to u_ref is returned. Soft rows ([`Enforcement::Soft`]) yield to every hard one.
//! [`Solution::outcome`] says whether rows were relaxed, [`Workspace::relaxed`] which.
//!
//! A row whose normal vanishes, or that would move u by more than the correction limit, is ill-conditioned:
//! where there are several rows it is left out and the others are met.
//!
//! A workspace starts warm: where several rows or bounds are active it tries those of its last answer first. The
//! answer has the same bits either way (module `canonical`); only [`Solution::iterations`] differs.

mod canonical;
mod dual_active_set;
mod factors;
mod kkt;
mod one_active;
mod row_set;
pub(crate) mod sensitivity;
mod single_row;

pub use kkt::Residuals;

use crate::elementary::{self, dot};
use crate::{MAX_INPUTS, MAX_ROWS};
use dual_active_set::DualActiveSet;
use one_active::Answer;
pub use row_set::RowSet;

/// A slack up to this part of its terms is round-off.
const ROUND_OFF: f64 = 1e-12;

/// One row aᵀu ≥ b.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Row {
    /// a; zeros above the number of inputs.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub normal: [f64; MAX_INPUTS],
    /// b.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub floor: f64,
}

impl Row {
    /// 0ᵀu ≥ 0.
    pub const ZERO: Self = Self { normal: [0.0; MAX_INPUTS], floor: 0.0 };

    /// The linear function with the `value` and the gradient `normal` at `u`, as a row.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(crate) fn linear<const M: usize>(normal: &[f64; M], value: f64, u: &[f64; M]) -> Self {
        let mut row = Self::ZERO;
        row.normal[..M].copy_from_slice(normal);
        row.floor = dot(normal, u) - value;
        row
    }

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
        ROUND_OFF * self.size(u)
    }

    /// Whether the row holds at `u` up to [`Self::round_off`].
    pub fn holds(&self, u: &[f64]) -> bool {
        self.slack(u) >= -self.round_off(u)
    }
}

/// The power of two that brings the largest component of `normal` to 1 ..< 2: multiplying by it is exact.
/// `None` where the normal vanishes (is zero or subnormal).
fn power_of_two(normal: &[f64]) -> Option<f64> {
    const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
    // Exponents compare, and change sign, as whole numbers; 2^1023 has no normal inverse and goes to 2 ..< 4.
    let largest = normal.iter().fold(0, |s, a| (a.to_bits() & EXPONENT).max(s));
    const ONE: u64 = 1 << 52;
    (largest > 0).then(|| f64::from_bits((EXPONENT - ONE).saturating_sub(largest).max(ONE)))
}

/// `row` times [`power_of_two`], so that it cannot overflow.
fn scaled(row: &Row) -> Option<Row> {
    let scale = power_of_two(&row.normal)?;
    Some(Row { normal: row.normal.map(|a| a * scale), floor: row.floor * scale })
}

/// Distance by which the rows moved `u`, from the reference within the bounds.
fn distance_from_clamped(u: &[f64], bounds: &Bounds, u_ref: &[f64]) -> f64 {
    u.iter()
        .zip(u_ref)
        .enumerate()
        .fold(0.0, |d: f64, (i, (v, r))| elementary::hypot(d, v - bounds.clamp(i, *r)))
}

/// Bounds on u; ±infinity where there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Bounds {
    /// Lower bounds, unit of u.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub min: [f64; MAX_INPUTS],
    /// Upper bounds, unit of u.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub max: [f64; MAX_INPUTS],
}

impl Bounds {
    /// No bounds.
    pub const NONE: Self = Self { min: [f64::NEG_INFINITY; MAX_INPUTS], max: [f64::INFINITY; MAX_INPUTS] };

    /// `value` moved into the bounds of component `i`; NaN becomes the point nearest 0.
    pub fn clamp(&self, i: usize, value: f64) -> f64 {
        let value = if value.is_nan() { 0.0 } else { value };
        value.max(self.min[i]).min(self.max[i])
    }

    /// The largest component of `u`, as a part of the way from the middle of its bounds to one of them; 0 where none has both.
    pub fn part(&self, u: &[f64]) -> f64 {
        let parts = u.iter().zip(self.min.iter().zip(&self.max)).map(|(u, (min, max))| {
            let part = (u - (max + min) / 2.0).abs() / ((max - min) / 2.0);
            if part.is_finite() { part } else { 0.0 }
        });
        parts.fold(0.0, f64::max)
    }

    /// [`Self::contain`], unrolled.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(crate) fn contain_all<const M: usize>(&self, u: &[f64; M]) -> bool {
        let mut all = true;
        for i in 0..M {
            all &= (self.min[i] <= u[i]) & (u[i] <= self.max[i]);
        }
        all
    }

    /// Whether every component of `u` lies within its bounds.
    pub fn contain(&self, u: &[f64]) -> bool {
        u.iter().enumerate().all(|(i, v)| self.min[i] <= *v && *v <= self.max[i])
    }
}

/// Strictness with which a row is enforced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Enforcement {
    /// Met wherever bounds and the rows of higher priority allow. The smaller number goes first; of equal
    /// ones the row listed first.
    Hard {
        /// 0 first.
        priority: u32,
    },
    /// Exact (L1) penalty: the row yields once it costs more than this distance in u. Its multiplier, for a
    /// normal of length 1, does not exceed `penalty`.
    Soft {
        /// Distance in units of u (of √W u where there are weights), > 0.
        penalty: f64,
    },
}

/// One QP.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// Rows, at most [`MAX_ROWS`].
    pub rows: &'a [Row],
    /// Bounds, never relaxed.
    pub bounds: &'a Bounds,
    /// u_ref: finite, 1 to [`MAX_INPUTS`] components.
    pub u_ref: &'a [f64],
    /// The diagonal of W, finite and > 0, in 1/(unit of u)²; `None` for ones.
    pub weights: Option<&'a [f64]>,
    /// Enforcement of each row; rows beyond its end are hard with priority 0.
    pub enforcement: &'a [Enforcement],
    /// Largest distance, > 0 in units of u, by which the rows may move u from the reference within its bounds. A
    /// row that needs more is ill-conditioned.
    pub correction_limit: f64,
}

impl<'a> Problem<'a> {
    /// Hard rows of equal priority, W = 1.
    pub fn new(rows: &'a [Row], bounds: &'a Bounds, u_ref: &'a [f64], correction_limit: f64) -> Self {
        Self { rows, bounds, u_ref, weights: None, enforcement: &[], correction_limit }
    }
}

/// Method that produced the answer. The numbers are stable.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
#[repr(u8)]
pub enum Solver {
    /// None was needed: u_ref was feasible.
    #[default]
    Unchanged = 0,
    /// A closed form, for one row or where one is active.
    ClosedForm = 1,
    /// The dual active-set method.
    DualActiveSet = 3,
}

/// Meaning of the returned input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The minimiser.
    Optimal,
    /// A hard row cannot be met within the bounds: the bounded input of least violation.
    Infeasible,
    /// A row cannot be met because its normal is too small: meeting it would change u by more than the
    /// correction limit. One row alone: the bounded input of least violation, u_ref where there are no
    /// bounds. Several: the row is left out, the others are met as they can be.
    IllConditioned,
    /// The method did not converge: u_ref within its bounds.
    Failed,
}

/// Outcome and effort of a solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Solution {
    /// Meaning of the returned input.
    pub outcome: Outcome,
    /// Method that produced it.
    pub solver: Solver,
    /// Rounds of the active-set method, else 0; 0 too where the rows
    /// and bounds of the workspace's last answer were those of this one.
    pub iterations: u32,
}

/// A row or bound that can be active.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Constraint {
    /// A row, by its place in the list.
    Row(usize),
    /// The lower bound of a component.
    Lower(usize),
    /// The upper bound of a component.
    Upper(usize),
}

/// One active row or bound: W (u − u_ref) is the sum of all normals times their multipliers. The normal of
/// an upper bound is −1 in its component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Active {
    /// The row or bound.
    pub constraint: Constraint,
    /// Multiplier of the normal as given. ≥ 0 up to round-off, but for the rows and bounds that forbid a hard row.
    pub multiplier: f64,
}

/// The memory of a solve, to be used again and again. Its memory of the last answer makes the next one faster
/// where the same rows and bounds are active, and changes no bit of it.
#[derive(Clone)]
pub struct Workspace {
    // The method for the number of inputs, rounded up. For two inputs it takes a third of the time of the last one.
    #[cfg(not(feature = "small"))]
    two: DualActiveSet<2>,
    #[cfg(not(feature = "small"))]
    four: DualActiveSet<4>,
    #[cfg(not(feature = "small"))]
    twelve: DualActiveSet<12>,
    any: DualActiveSet<MAX_INPUTS>,
    active: [Active; MAX_ROWS + MAX_INPUTS],
    active_len: usize,
    relaxed: RowSet,
    ill_conditioned: RowSet,
}

impl Default for Workspace {
    fn default() -> Self {
        Self::new()
    }
}

impl Workspace {
    /// A workspace for any problem.
    pub const fn new() -> Self {
        Self {
            #[cfg(not(feature = "small"))]
            two: DualActiveSet::EMPTY,
            #[cfg(not(feature = "small"))]
            four: DualActiveSet::EMPTY,
            #[cfg(not(feature = "small"))]
            twelve: DualActiveSet::EMPTY,
            any: DualActiveSet::EMPTY,
            active: [Active { constraint: Constraint::Row(0), multiplier: 0.0 }; MAX_ROWS + MAX_INPUTS],
            active_len: 0,
            relaxed: RowSet::EMPTY,
            ill_conditioned: RowSet::EMPTY,
        }
    }

    /// Solves into `u`, which has the length of `u_ref`. The result is finite and within the bounds.
    ///
    /// # Panics
    ///
    /// More than [`MAX_ROWS`] rows.
    pub fn solve(&mut self, p: &Problem, u: &mut [f64]) -> Solution {
        assert!(p.rows.len() <= MAX_ROWS, "{} rows, must be at most {MAX_ROWS}", p.rows.len());
        // The guess: the active rows and bounds of the last answer, none if something yielded in it.
        let guess = if (self.relaxed | self.ill_conditioned).is_empty() { self.active_len } else { 0 };
        (self.active_len, self.relaxed, self.ill_conditioned) = (0, RowSet::EMPTY, RowSet::EMPTY);
        // u_ref itself, or one active row.
        if let Some(answer) = one_active::solve(p, u) {
            let mut solver = Solver::Unchanged;
            if let Answer::Row(row, multiplier) = answer {
                self.note_active(row, multiplier);
                solver = Solver::ClosedForm;
            }
            return Solution { outcome: Outcome::Optimal, solver, iterations: 0 };
        }
        // u_ref within its bounds.
        for (i, (ui, r)) in u.iter_mut().zip(p.u_ref).enumerate() {
            *ui = p.bounds.clamp(i, *r);
        }
        if p.rows.iter().all(|row| row.slack(u) >= 0.0) {
            self.take_over(p, u, 0.0);
            return Solution { outcome: Outcome::Optimal, solver: Solver::Unchanged, iterations: 0 };
        }
        // One hard row with bounds.
        let soft = || p.enforcement.iter().any(|e| matches!(e, Enforcement::Soft { .. }));
        if let [row] = p.rows
            && p.weights.is_none()
            && !soft()
        {
            let (outcome, multiplier) = single_row::solve(row, p.bounds, p.u_ref, p.correction_limit, u);
            match outcome {
                Outcome::Optimal => self.take_over(p, u, multiplier),
                Outcome::Infeasible => self.relaxed = RowSet::of(0),
                Outcome::IllConditioned | Outcome::Failed => self.ill_conditioned = RowSet::of(0),
            }
            return Solution { outcome, solver: Solver::ClosedForm, iterations: 0 };
        }
        // Several: from the guess, else by the dual active-set method.
        #[cfg(not(feature = "small"))]
        let Self { two, four, twelve, .. } = self;
        let Self { any, active, active_len, relaxed, ill_conditioned, .. } = self;
        let (outcome, iterations);
        macro_rules! solve_with {
            ($method:ident, $n:expr) => {{
                if canonical::solve::<{ $n }>(p, &mut active[..guess], u) {
                    *active_len = guess;
                    (outcome, iterations) = (Outcome::Optimal, 0);
                } else {
                    (outcome, iterations) = $method.solve(p, u);
                    (*relaxed, *ill_conditioned) = ($method.relaxed, $method.ill_conditioned);
                    for (to, found) in active.iter_mut().zip($method.active(p)) {
                        *to = found;
                        *active_len += 1;
                    }
                    if outcome == Outcome::Optimal {
                        canonical::solve::<{ $n }>(p, &mut active[..*active_len], u);
                    }
                }
            }};
        }
        match u.len() {
            #[cfg(not(feature = "small"))]
            ..=2 => solve_with!(two, 2),
            #[cfg(not(feature = "small"))]
            3..=4 => solve_with!(four, 4),
            #[cfg(not(feature = "small"))]
            5..=12 => solve_with!(twelve, 12),
            _ => solve_with!(any, MAX_INPUTS),
        }
        Solution { outcome, solver: Solver::DualActiveSet, iterations }
    }

    /// Notes the active constraints of an answer found without a method: the first row, by its multiplier, and the
    /// bounds that hold `u`.
    fn take_over(&mut self, p: &Problem, u: &[f64], multiplier: f64) {
        let mut push = |constraint, multiplier: f64| {
            self.active[self.active_len] = Active { constraint, multiplier };
            self.active_len += 1;
        };
        if multiplier > 0.0 {
            push(Constraint::Row(0), multiplier);
        } else if u == p.u_ref {
            return;
        }
        for (i, &v) in u.iter().enumerate() {
            let pull = p.rows.first().map_or(0.0, |row| multiplier * row.normal[i]);
            let held = p.weights.map_or(1.0, |w| w[i]) * (v - p.u_ref[i]) - pull;
            if held > 0.0 && v == p.bounds.min[i] {
                push(Constraint::Lower(i), held);
            } else if held < 0.0 && v == p.bounds.max[i] {
                push(Constraint::Upper(i), -held);
            }
        }
    }

    /// Notes that `row` alone is active, with its `multiplier`, in an answer that was found elsewhere.
    pub(crate) fn note_active(&mut self, row: usize, multiplier: f64) {
        (self.relaxed, self.ill_conditioned) = (RowSet::EMPTY, RowSet::EMPTY);
        self.active[0] = Active { constraint: Constraint::Row(row), multiplier };
        self.active_len = 1;
    }

    /// Forgets the last answer.
    pub(crate) fn clear(&mut self) {
        (self.relaxed, self.ill_conditioned) = (RowSet::EMPTY, RowSet::EMPTY);
        self.active_len = 0;
    }

    /// The active rows and bounds of the last solve, soft rows at their largest multiplier last. Empty after
    /// one row that cannot be met.
    pub fn active(&self) -> &[Active] {
        &self.active[..self.active_len]
    }

    /// The rows of the last solve that were relaxed because they cannot be met ([`Outcome::Infeasible`]).
    pub fn relaxed(&self) -> RowSet {
        self.relaxed
    }

    /// The rows of the last solve that were ill-conditioned ([`Outcome::IllConditioned`]).
    pub fn ill_conditioned(&self) -> RowSet {
        self.ill_conditioned
    }

    /// The residuals of `u` in the conditions of optimality, with the active rows of the last solve, which was of
    /// `p`.
    pub fn residuals(&self, p: &Problem, u: &[f64]) -> Residuals {
        Residuals::of(p, u, self.active())
    }
}

/// Solves one QP of hard rows with W = 1 into `u`, as [`Workspace::solve`] does. A workspace saves the cost of
/// making one.
///
/// # Panics
///
/// As [`Workspace::solve`].
pub fn solve(rows: &[Row], bounds: &Bounds, u_ref: &[f64], correction_limit: f64, u: &mut [f64]) -> Solution {
    Workspace::default().solve(&Problem::new(rows, bounds, u_ref, correction_limit), u)
}
