//! u_ref itself, or one active row in closed form: the answer of most QPs.
//!
//! The point of a row's plane nearest to u_ref, `u = u_ref + λ a` with λ = (b − aᵀu_ref)/‖a‖², has a
//! multiplier λ > 0. Where it also satisfies all other rows and the bounds, it satisfies every condition of
//! Karush, Kuhn and Tucker, so it is the minimiser. The row to try is the one furthest from u_ref, since no other
//! can be the only active one.

use core::array::from_fn;

use super::{Enforcement, Problem, ROUND_OFF, Row};

/// Squared lengths and slacks in this range can neither overflow nor lose digits on the way.
const SIZES: core::ops::Range<f64> = 1e-150..1e150;

/// The active row, if there is one.
pub(super) enum Answer {
    /// Nothing: u_ref satisfies every row and bound.
    Reference,
    /// A row, with its multiplier.
    Row(usize, f64),
}

/// Solves into `u`; `None`, with `u` as it was, where more than a row is active, or numbers are out of [`SIZES`],
/// or something has to yield.
#[inline]
pub(super) fn solve(p: &Problem, u: &mut [f64]) -> Option<Answer> {
    // More of them are rare, and left to the active set.
    // With the number of inputs known to the compiler the sums unroll.
    macro_rules! by_inputs {
        ($($m:literal),*) => {
            match u.len() {
                $($m => solve_for::<$m>(p, u),)*
                _ => None,
            }
        };
    }
    by_inputs!(1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12)
}

fn solve_for<const M: usize>(p: &Problem, u: &mut [f64]) -> Option<Answer> {
    let u_ref: &[f64; M] = p.u_ref.first_chunk()?;
    if !p.bounds.contain_all(u_ref) {
        return None;
    }
    // Find the row furthest from u_ref: its distance² as a fraction, by slack and ‖a‖².
    let (mut active, mut slack, mut length) = (None, 0.0, 1.0);
    for (k, row) in p.rows.iter().enumerate() {
        let found = slack_at(row, u_ref);
        if found >= 0.0 {
            continue;
        }
        let size = sum::<M>(|i| row.normal[i] * row.normal[i]);
        if found * found * length > slack * slack * size {
            (active, slack, length) = (Some(k), found, size);
        } else if active.is_none() {
            // Out of range, or not a number.
            return None;
        }
    }
    let Some(active) = active else {
        u.copy_from_slice(u_ref);
        return Some(Answer::Reference);
    };
    let soft = matches!(p.enforcement.get(active), Some(Enforcement::Soft { .. }));
    let in_range = SIZES.contains(&length) && SIZES.contains(&(slack * slack));
    if soft || !in_range || p.weights.is_some() {
        return None;
    }
    // Go to the nearest point of its plane.
    let (row, per_square) = (&p.rows[active], 1.0 / length);
    let along = |from: &[f64; M], multiplier: f64| from_fn(|i| from[i] + multiplier * row.normal[i]);
    let mut multiplier = -slack * per_square;
    let mut on_row: [f64; M] = along(u_ref, multiplier);
    // Correct the round-off of the slack: u_ref may be far larger than u.
    let rest = -slack_at(row, &on_row) * per_square;
    multiplier += rest;
    on_row = along(&on_row, rest);
    // There every other row and the bounds have to hold.
    let holds = slack_at(row, &on_row)
        >= -ROUND_OFF * (row.floor.abs() + sum::<M>(|i| (row.normal[i] * on_row[i]).abs()));
    let near = multiplier * multiplier * length <= p.correction_limit * p.correction_limit;
    if !(holds && near && p.bounds.contain_all(&on_row)) {
        return None;
    }
    for (k, row) in p.rows.iter().enumerate() {
        if k != active && !matches!(slack_at(row, &on_row), 0.0..) {
            return None;
        }
    }
    u.copy_from_slice(&on_row);
    Some(Answer::Row(active, multiplier))
}

/// The sum of M terms, unrolled.
#[cfg_attr(not(feature = "small"), inline(always))]
fn sum<const M: usize>(term: impl Fn(usize) -> f64) -> f64 {
    let mut sum = 0.0;
    for i in 0..M {
        sum += term(i);
    }
    sum
}

/// [`Row::slack`].
#[cfg_attr(not(feature = "small"), inline(always))]
fn slack_at<const M: usize>(row: &Row, u: &[f64; M]) -> f64 {
    sum::<M>(|i| row.normal[i] * u[i]) - row.floor
}
