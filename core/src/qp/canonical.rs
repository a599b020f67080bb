//! The minimiser from its active rows and bounds, by one computation that depends on nothing else. So a guess of
//! the active ones changes the time that an answer takes, and not its bits.
//!
//! With the active normals N = Q R (module [`factors`](super::factors)) and their slacks s at u_ref,
//! `u = u_ref − Q R⁻ᵀ s` and `λ = −R⁻¹ R⁻ᵀ s`. Where every λ is positive, every other row and bound holds with room
//! to spare, and the normals are far from dependent, u satisfies the conditions of Karush, Kuhn and Tucker strictly.
//! It is the minimiser, and no other set of rows and bounds is active in it. So [`solve`] gives the same u for a set
//! from the last answer and for one that a method found.

use super::factors::Factors;
use super::{Active, Constraint, Enforcement, Problem, Row};
use crate::elementary::{self, dot};

/// Multipliers and slacks count as strict from this part of their terms on: far above round-off, so that a method
/// that is exact up to round-off cannot find another set.
const STRICT: f64 = 1e-8;

/// A normal counts as independent of those before it from this part of it outside their span on: round-off in the
/// multipliers grows with its inverse square, and stays a hundred times below [`STRICT`].
const INDEPENDENT: f64 = 1e-3;

/// Sizes that neither overflow nor lose digits when squared.
const SIZES: core::ops::Range<f64> = 1e-140..1e140;

/// Solves into `u` for the active rows and bounds `guess`, in any order, and writes their multipliers; false, with
/// both as they were, where that is not strictly the minimiser, or weights or an active soft row are involved.
pub(super) fn solve<const N: usize>(p: &Problem, guess: &mut [Active], u: &mut [f64]) -> bool {
    let dim = u.len();
    if p.weights.is_some() || guess.is_empty() || guess.len() > dim {
        return false;
    }
    let mut active = [Constraint::Row(0); N];
    let active = &mut active[..guess.len()];
    for (to, from) in active.iter_mut().zip(&*guess) {
        *to = from.constraint;
    }
    active.sort_unstable();
    let mut u_ref = [0.0; N];
    u_ref[..dim].copy_from_slice(p.u_ref);

    // Factorise the active normals.
    let mut factors = Factors::<N>::EMPTY;
    factors.clear(dim);
    let mut norms = [0.0; N];
    for (&constraint, norm) in active.iter().zip(&mut norms) {
        let Some((normal, _)) = affine(p, constraint) else { return false };
        *norm = elementary::sqrt(dot(&normal, &normal));
        if !SIZES.contains(norm) {
            return false;
        }
        let projection = factors.project(&normal, *norm);
        if projection.square < (INDEPENDENT * *norm) * (INDEPENDENT * *norm) {
            return false;
        }
        factors.append(&projection);
    }
    // Solve for u and the multipliers. The second pass corrects the round-off of the slacks: u_ref may be far larger
    // than u.
    let (mut found, mut multipliers) = (u_ref, [0.0; N]);
    for _ in 0..2 {
        let mut y = [0.0; N];
        for (y, &constraint) in y.iter_mut().zip(&*active) {
            let Some((normal, floor)) = affine::<N>(p, constraint) else { return false };
            *y = floor - dot(&normal, &found);
        }
        factors.solve_transposed(&mut y);
        for (i, found) in found[..dim].iter_mut().enumerate() {
            *found += factors.component(i, &y);
        }
        factors.solve(&mut y);
        for (to, y) in multipliers.iter_mut().zip(&y) {
            *to += y;
        }
    }
    // Bounds are met exactly; all else has to hold strictly.
    for &constraint in &*active {
        match constraint {
            Constraint::Row(_) => {}
            Constraint::Lower(i) => found[i] = p.bounds.min[i],
            Constraint::Upper(i) => found[i] = p.bounds.max[i],
        }
    }
    if !is_strict(p, active, (&found, &u_ref), (&multipliers, &norms)) {
        return false;
    }
    u.copy_from_slice(&found[..dim]);
    for ((to, &constraint), &multiplier) in guess.iter_mut().zip(&*active).zip(&multipliers) {
        *to = Active { constraint, multiplier };
    }
    true
}

/// The row or bound as aᵀu ≥ b; `None` for a soft row.
fn affine<const N: usize>(p: &Problem, constraint: Constraint) -> Option<([f64; N], f64)> {
    let mut normal = [0.0; N];
    let floor = match constraint {
        Constraint::Row(k) => {
            if matches!(p.enforcement.get(k), Some(Enforcement::Soft { .. })) {
                return None;
            }
            let row = p.rows.get(k)?;
            normal.copy_from_slice(&row.normal[..N]);
            row.floor
        }
        // A component that this problem does not have: the guess is from another one.
        Constraint::Lower(i) | Constraint::Upper(i) if i >= p.u_ref.len() => return None,
        Constraint::Lower(i) => {
            normal[i] = 1.0;
            p.bounds.min[i]
        }
        Constraint::Upper(i) => {
            normal[i] = -1.0;
            -p.bounds.max[i]
        }
    };
    Some((normal, floor))
}

/// Whether `u`, held by `active`, satisfies the conditions with room to spare.
fn is_strict<const N: usize>(
    p: &Problem,
    active: &[Constraint],
    (u, u_ref): (&[f64; N], &[f64; N]),
    (multipliers, norms): (&[f64; N], &[f64; N]),
) -> bool {
    let dim = p.u_ref.len();
    let moved: f64 = (0..dim).map(|i| (u[i] - u_ref[i]) * (u[i] - u_ref[i])).sum();
    let length = elementary::sqrt(moved);
    let size = u.iter().chain(u_ref).fold(0.0, |s: f64, v| s.max(v.abs()));
    if !(SIZES.contains(&length) && length + STRICT * size <= (1.0 - STRICT) * p.correction_limit) {
        return false;
    }
    let pulls = multipliers.iter().zip(norms).take(active.len());
    let rows = p.rows.iter().enumerate().all(|(k, row)| {
        let Row { normal, floor } = row;
        let terms = normal[..N].iter().fold(0.0, |s: f64, a| s + a.abs()) * size + floor.abs();
        let slack = dot(&normal[..N], u) - floor;
        if active.contains(&Constraint::Row(k)) {
            row.holds(u)
        } else {
            slack > STRICT * terms || terms == 0.0
        }
    });
    let room = |i: usize, slack: f64, bound: Constraint| {
        slack > STRICT * size || active.contains(&bound) && u[i].is_finite()
    };
    pulls.clone().all(|(multiplier, norm)| *multiplier * norm > STRICT * (length + size))
        && rows
        && (0..dim).all(|i| {
            room(i, u[i] - p.bounds.min[i], Constraint::Lower(i))
                && room(i, p.bounds.max[i] - u[i], Constraint::Upper(i))
        })
}
