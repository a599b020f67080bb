//! Several rows: the interior-point solver clarabel. The only file that names it.
//!
//! Settings are pinned: equilibration is off, because clarabel fixes its scaling from the first data
//! it sees; rows are scaled to unit length here instead. A solver is built for every solve, so the
//! answer depends on nothing but its arguments. Its accuracy on u is about 1e-6 of the data, not
//! round-off; it allocates. Infeasible rows are relaxed together with an exact (L1) penalty.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus};

use super::{Bounds, Outcome, Row, Solution, Solver, dot};

/// Weight of a violated row (of unit length) against ½‖u − u_ref‖²: the multipliers of feasible
/// problems stay far below it for corrections up to 1e6.
const PENALTY: f64 = 1e8;

/// Largest violation of a scaled row that the relaxed problem counts as met.
const MET: f64 = 1e-6;

pub(super) fn solve(rows: &[Row], bounds: &Bounds, u_ref: &[f64], limit: f64, u: &mut [f64]) -> Solution {
    let mut iterations = 0;
    let mut answer = |relaxed, u: &mut [f64]| {
        let (found, used) = attempt(rows, bounds, u_ref, relaxed, u);
        iterations += used;
        found
    };
    let exact = answer(false, u);
    let outcome = if exact && distance(u, u_ref) <= limit {
        Outcome::Optimal
    } else if answer(true, u) && distance(u, u_ref) <= limit {
        if rows.iter().all(|row| scaled_slack(row, u) >= -MET) {
            Outcome::Optimal
        } else {
            Outcome::Infeasible
        }
    } else {
        for (i, ui) in u.iter_mut().enumerate() {
            *ui = bounds.clamp(i, u_ref[i]);
        }
        if exact { Outcome::Degenerate } else { Outcome::Failed }
    };
    Solution { outcome, solver: Solver::InteriorPoint, iterations }
}

fn distance(u: &[f64], u_ref: &[f64]) -> f64 {
    u.iter().zip(u_ref).fold(0.0, |d: f64, (a, b)| d.hypot(a - b))
}

fn norm(row: &Row, m: usize) -> f64 {
    row.normal[..m].iter().fold(0.0, |n: f64, v| n.hypot(*v))
}

fn scaled_slack(row: &Row, u: &[f64]) -> f64 {
    let size = norm(row, u.len());
    if size > 0.0 { row.slack(u) / size } else { -row.floor }
}

/// One call of clarabel in v = u − u_ref; with `relaxed`, one slack per row is added to v.
/// Writes `u` and returns true where it converged.
fn attempt(rows: &[Row], bounds: &Bounds, u_ref: &[f64], relaxed: bool, u: &mut [f64]) -> (bool, u32) {
    let m = u.len();
    let slacks = if relaxed { rows.len() } else { 0 };
    let variables = m + slacks;
    // Constraints in the form G v + s = d, s ≥ 0.
    let (mut is, mut js, mut values, mut d) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut entry = |i: usize, j: usize, value: f64| {
        is.push(i);
        js.push(j);
        values.push(value);
    };
    for (k, row) in rows.iter().enumerate() {
        let size = norm(row, m);
        let scale = if size > 0.0 { 1.0 / size } else { 1.0 };
        for (j, a) in row.normal[..m].iter().enumerate() {
            entry(d.len(), j, -a * scale);
        }
        if relaxed {
            entry(d.len(), m + k, -1.0);
        }
        d.push((dot(&row.normal, u_ref) - row.floor) * scale);
    }
    for k in 0..slacks {
        entry(d.len(), m + k, -1.0);
        d.push(0.0);
    }
    for (i, r) in u_ref.iter().enumerate() {
        if bounds.max[i].is_finite() {
            entry(d.len(), i, 1.0);
            d.push(bounds.max[i] - r);
        }
        if bounds.min[i].is_finite() {
            entry(d.len(), i, -1.0);
            d.push(r - bounds.min[i]);
        }
    }
    let diagonal: Vec<f64> = (0..variables).map(|j| if j < m { 1.0 } else { 0.0 }).collect();
    let indices: Vec<usize> = (0..variables).collect();
    let p = CscMatrix::new_from_triplets(variables, variables, indices.clone(), indices, diagonal);
    let q: Vec<f64> = (0..variables).map(|j| if j < m { 0.0 } else { PENALTY }).collect();
    let g = CscMatrix::new_from_triplets(d.len(), variables, is, js, values);
    let settings =
        DefaultSettings { verbose: false, equilibrate_enable: false, ..DefaultSettings::default() };
    let cones = [NonnegativeConeT(d.len())];
    let Ok(mut solver) = DefaultSolver::new(&p, &q, &g, &d, &cones, settings) else { return (false, 0) };
    solver.solve();
    let converged = matches!(solver.solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved)
        && solver.solution.x.iter().all(|v| v.is_finite());
    if converged {
        for (i, ui) in u.iter_mut().enumerate() {
            *ui = bounds.clamp(i, u_ref[i] + solver.solution.x[i]);
        }
    }
    (converged, solver.solution.iterations)
}
