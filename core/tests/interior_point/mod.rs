//! The interior-point solver clarabel as the judge of the QP. It takes every row as hard and knows no weights.
//!
//! Settings are pinned: equilibration is off, because clarabel fixes its scaling from the first data
//! it sees; here rows are scaled to unit length and u to the least correction instead. A solver is
//! built for every solve, so the answer depends on nothing but its arguments. Its accuracy on u is
//! about 1e-6 of the correction, not round-off; it allocates. Infeasible rows are relaxed together
//! with an exact (L1) penalty.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus};

use punctual_core::qp::{Bounds, Outcome, Row};

/// Weight of a violated row against ½‖u − u_ref‖², both in units of the least correction needed: an
/// exact penalty up to multipliers of this size. The second is for the rare problem on which the first
/// does not converge; far larger ones often do not.
const PENALTIES: [f64; 2] = [1e4, 1e2];

/// Largest violation of a row of unit length that counts as met, as a part of its terms and 1.
const MET: f64 = 1e-6;

/// Writes the answer to `u`; says what it means.
pub(crate) fn solve(rows: &[Row], bounds: &Bounds, u_ref: &[f64], limit: f64, u: &mut [f64]) -> Outcome {
    if bounds.contain(u_ref) && rows.iter().all(|row| row.slack(u_ref) >= 0.0) {
        u.copy_from_slice(u_ref);
        return Outcome::Optimal;
    }
    // A row whose normal vanishes says nothing about u: it holds or it does not.
    let lost = rows.iter().any(|row| scaled(row).is_none() && row.floor > 0.0);
    let units: Vec<Row> = rows.iter().filter_map(of_unit_length).collect();
    let mut converged = false;
    let mut answer = |rows: &[Row], penalties: &[Option<f64>], u: &mut [f64]| {
        let found = penalties.iter().any(|&penalty| attempt(rows, bounds, u_ref, penalty, u));
        converged |= found;
        found && distance_from_clamped(u, bounds, u_ref) <= limit
    };
    let relaxed = PENALTIES.map(Some);
    let met = |rows: &[Row], u: &[f64]| rows.iter().all(|row| row.slack(u) >= -MET * size(row, u));
    let within_reach = |row: &&Row| row.floor - dot(&row.normal, u_ref) <= limit;
    if answer(&units, &[None], u) && met(&units, u) {
        if lost { Outcome::IllConditioned } else { Outcome::Optimal }
    } else if answer(&units, &relaxed, u) {
        match (met(&units, u), lost) {
            (_, true) => Outcome::IllConditioned,
            (true, false) => Outcome::Optimal,
            (false, false) => Outcome::Infeasible,
        }
    } else {
        // Some row asks for more than the limit: meet the others.
        let near: Vec<Row> = units.iter().filter(within_reach).copied().collect();
        let far = near.len() < units.len();
        if !(far && answer(&near, &relaxed, u)) {
            for (i, ui) in u.iter_mut().enumerate() {
                *ui = bounds.clamp(i, u_ref[i]);
            }
        }
        if far || lost || converged { Outcome::IllConditioned } else { Outcome::Failed }
    }
}

/// `row` times a power of two, so that it cannot overflow; `None` where its normal vanishes.
fn scaled(row: &Row) -> Option<Row> {
    let largest = row.normal.iter().fold(0.0, |most: f64, a| most.max(a.abs()));
    let scale = 2.0_f64.powi(-(largest.log2().floor() as i32)).min(f64::MAX);
    (largest > 0.0).then(|| Row { normal: row.normal.map(|a| a * scale), floor: row.floor * scale })
}

/// Distance by which the rows moved `u`, from the reference within the bounds.
fn distance_from_clamped(u: &[f64], bounds: &Bounds, u_ref: &[f64]) -> f64 {
    let parts = u.iter().zip(u_ref).enumerate();
    parts.fold(0.0, |d: f64, (i, (v, r))| d.hypot(v - bounds.clamp(i, *r)))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// `row` with a normal of length 1, `None` where it vanishes.
fn of_unit_length(row: &Row) -> Option<Row> {
    let Row { normal, floor } = scaled(row)?;
    let norm = normal.iter().map(|a| a * a).sum::<f64>().sqrt();
    Some(Row { normal: normal.map(|a| a / norm), floor: floor / norm })
}

/// The size of the terms of a slack, at least 1.
fn size(row: &Row, u: &[f64]) -> f64 {
    row.normal.iter().zip(u).fold(1.0 + row.floor.abs(), |s, (a, v)| s + (a * v).abs())
}

/// One call of clarabel in v = u − u_ref for rows of unit length; with a penalty, one slack per row
/// is added to v. Writes `u` and returns true where it converged.
fn attempt(rows: &[Row], bounds: &Bounds, u_ref: &[f64], penalty: Option<f64>, u: &mut [f64]) -> bool {
    let m = u.len();
    let slacks = if penalty.is_some() { rows.len() } else { 0 };
    let variables = m + slacks;
    // The unit of v and of the slacks: no correction is smaller than the largest violation at u_ref. It
    // makes the solver's absolute tolerances relative to the answer.
    let outside = u_ref.iter().enumerate().map(|(i, r)| (r - bounds.max[i]).max(bounds.min[i] - r));
    let missing = rows.iter().map(|row| row.floor - dot(&row.normal, u_ref));
    let unit = outside.chain(missing).fold(0.0, f64::max);
    if !(unit > 0.0 && unit.is_finite()) {
        return false;
    }
    // Constraints in the form G v + s = d, s ≥ 0.
    let (mut is, mut js, mut values, mut d) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut entry = |i: usize, j: usize, value: f64| {
        is.push(i);
        js.push(j);
        values.push(value);
    };
    for (k, row) in rows.iter().enumerate() {
        for (j, a) in row.normal[..m].iter().enumerate() {
            entry(d.len(), j, -a);
        }
        if penalty.is_some() {
            entry(d.len(), m + k, -1.0);
        }
        d.push((dot(&row.normal, u_ref) - row.floor) / unit);
    }
    for k in 0..slacks {
        entry(d.len(), m + k, -1.0);
        d.push(0.0);
    }
    for (i, r) in u_ref.iter().enumerate() {
        if bounds.max[i].is_finite() {
            entry(d.len(), i, 1.0);
            d.push((bounds.max[i] - r) / unit);
        }
        if bounds.min[i].is_finite() {
            entry(d.len(), i, -1.0);
            d.push((r - bounds.min[i]) / unit);
        }
    }
    // Minimise ½vᵀPv + qᵀv: the slacks have the penalty for their price.
    let diagonal: Vec<f64> = (0..variables).map(|j| if j < m { 1.0 } else { 0.0 }).collect();
    let indices: Vec<usize> = (0..variables).collect();
    let p = CscMatrix::new_from_triplets(variables, variables, indices.clone(), indices, diagonal);
    let q: Vec<f64> = (0..variables).map(|j| if j < m { 0.0 } else { penalty.unwrap_or(0.0) }).collect();
    let g = CscMatrix::new_from_triplets(d.len(), variables, is, js, values);
    let settings =
        DefaultSettings { verbose: false, equilibrate_enable: false, ..DefaultSettings::default() };
    let cones = [NonnegativeConeT(d.len())];
    let Ok(mut solver) = DefaultSolver::new(&p, &q, &g, &d, &cones, settings) else { return false };
    solver.solve();
    let converged = matches!(solver.solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved)
        && solver.solution.x.iter().all(|v| v.is_finite());
    if converged {
        for (i, ui) in u.iter_mut().enumerate() {
            *ui = bounds.clamp(i, u_ref[i] + unit * solver.solution.x[i]);
        }
    }
    converged
}
