//! The quadratic program with one row: known answers, enumeration of active sets, extreme data.
//! Several rows: `qp_several_rows.rs`.

use crate::quadratic;

use proptest::prelude::*;
use punctual_core::qp::{Bounds, Outcome, Row, Solver, solve};
use quadratic::{bounds, config, row, terms};

/// A correction limit that no problem of moderate size reaches.
const NO_LIMIT: f64 = 1e12;

/// Allowed error of u relative to [`conditioning`]: a few dozen operations, each rounded to 1.1e-16
/// of its result.
const ROUND_OFF: f64 = 1e-14;

/// Whether the row holds up to the round-off of its terms, at u or at the reference it came from.
fn met(row: &Row, u: &[f64], u_ref: &[f64]) -> bool {
    row.slack(u) >= -1e-12 * (terms(row, u) + terms(row, u_ref))
}

/// Factor by which round-off in aᵀu can move u: the largest term over the smallest slope.
fn conditioning(row: &Row, b: &Bounds, u_ref: &[f64]) -> f64 {
    let m = u_ref.len();
    let finite = |v: &f64| v.is_finite();
    let largest = b.min[..m].iter().chain(&b.max[..m]).filter(|v| finite(v)).chain(u_ref);
    let largest = largest.fold(1.0, |s: f64, v| s.max(v.abs()));
    let steepest = row.normal[..m].iter().fold(0.0, |s: f64, a| s.max(a.abs()));
    let flattest = row.normal[..m].iter().filter(|a| **a != 0.0).fold(f64::INFINITY, |s, a| s.min(a.abs()));
    (largest * steepest + row.floor.abs()) / flattest + largest
}

/// The minimiser by brute force: every component at its lower bound, its upper bound or free, the row
/// active; the best of the feasible candidates. `None` if there is none.
fn enumerated(row: &Row, b: &Bounds, u_ref: &[f64], tolerance: f64) -> Option<Vec<f64>> {
    let m = u_ref.len();
    let mut best: Option<(f64, Vec<f64>)> = None;
    for code in 0..3_usize.pow(m as u32) {
        let place = |i: usize| code / 3_usize.pow(i as u32) % 3;
        let fixed = |i: usize| [b.min[i], b.max[i], u_ref[i]][place(i)];
        let mut u: Vec<f64> = (0..m).map(fixed).collect();
        let free: f64 = (0..m).filter(|i| place(*i) == 2).map(|i| row.normal[i].powi(2)).sum();
        if !u.iter().all(|v| v.is_finite()) {
            continue;
        }
        if free > 0.0 {
            let lambda = -row.slack(&u) / free;
            for i in (0..m).filter(|i| place(*i) == 2) {
                u[i] += lambda * row.normal[i];
            }
        }
        let inside = (0..m).all(|i| b.min[i] - tolerance <= u[i] && u[i] <= b.max[i] + tolerance);
        if !inside || !met(row, &u, u_ref) {
            continue;
        }
        let cost = u.iter().zip(u_ref).map(|(a, r)| (a - r).powi(2)).sum();
        if best.as_ref().is_none_or(|(c, _)| cost < *c) {
            best = Some((cost, u));
        }
    }
    best.map(|(_, u)| u)
}

/// max_i |u_i − clamp(r_i + λ a_i)| with the λ ≥ 0 that fits: 0 exactly for a minimiser.
fn stationarity(row: &Row, b: &Bounds, u_ref: &[f64], u: &[f64]) -> f64 {
    let moved = |i: usize| (u[i] - u_ref[i]) / row.normal[i];
    let free = |i: usize| b.min[i] < u[i] && u[i] < b.max[i];
    let steepest_free = (0..u.len())
        .filter(|&i| free(i) && row.normal[i] != 0.0)
        .max_by(|&i, &j| row.normal[i].abs().total_cmp(&row.normal[j].abs()));
    let lambda = match steepest_free {
        Some(i) => moved(i),
        None => (0..u.len()).filter(|&i| row.normal[i] != 0.0).map(moved).fold(0.0, f64::max),
    };
    let wanted = |i: usize| b.clamp(i, u_ref[i] + lambda.max(0.0) * row.normal[i]);
    (0..u.len()).fold(-lambda.min(0.0), |e: f64, i| e.max((u[i] - wanted(i)).abs()))
}

proptest! {
    #![proptest_config(config(2000))]

    #[test]
    fn one_row_equals_enumeration((row, b, u_ref) in quadratic::one_row(4)) {
        let m = u_ref.len();
        let mut u = vec![f64::NAN; m];
        let solution = solve(&[row], &b, &u_ref, NO_LIMIT, &mut u);
        let tolerance = ROUND_OFF * conditioning(&row, &b, &u_ref);
        prop_assert!(b.contain(&u), "{u:?}");

        let clamped: Vec<f64> = (0..m).map(|i| b.clamp(i, u_ref[i])).collect();
        if row.slack(&clamped) >= 0.0 {
            prop_assert_eq!((solution.solver, solution.outcome), (Solver::Unchanged, Outcome::Optimal));
            prop_assert_eq!(u, clamped);
            return Ok(());
        }
        prop_assert_eq!((solution.solver, solution.iterations), (Solver::ClosedForm, 0));
        if row.normal == Row::ZERO.normal {
            prop_assert_eq!(solution.outcome, Outcome::IllConditioned);
            prop_assert_eq!(u, clamped);
            return Ok(());
        }
        match enumerated(&row, &b, &u_ref, tolerance) {
            Some(reference) => {
                prop_assert_eq!(solution.outcome, Outcome::Optimal, "reference {:?}", reference);
                for (i, (found, wanted)) in u.iter().zip(&reference).enumerate() {
                    prop_assert!(
                        (found - wanted).abs() <= tolerance,
                        "u[{i}] = {found:e}, wanted {wanted:e}, tolerance {tolerance:e}"
                    );
                }
                prop_assert!(met(&row, &u, &u_ref), "slack {:e}", row.slack(&u));
                let residual = stationarity(&row, &b, &u_ref, &u);
                prop_assert!(residual <= tolerance, "KKT residual {residual:e} > {tolerance:e}");
            }
            None => {
                prop_assert_eq!(solution.outcome, Outcome::Infeasible);
                for i in 0..m {
                    let best = match row.normal[i] {
                        a if a > 0.0 => b.max[i],
                        a if a < 0.0 => b.min[i],
                        _ => clamped[i],
                    };
                    prop_assert_eq!(u[i], best, "least violation is at a vertex");
                }
            }
        }
    }

    /// From a chosen point on the row, a multiplier and bounds that hold some components back, the
    /// reference follows; the solver must find the point again.
    #[test]
    fn manufactured_problems_are_solved(
        normal in prop::collection::vec(prop_oneof![-8.0..-0.125, 0.125..8.0], 1..=6),
        at in prop::collection::vec(-5.0..5.0, 6),
        place in prop::collection::vec(0..3_usize, 6),
        lambda in 0.01..10.0,
        held in 0.0..4.0,
    ) {
        let m = normal.len();
        let u_star = &at[..m];
        let mut b = Bounds::NONE;
        let mut u_ref = vec![0.0; m];
        for i in 0..m {
            // λa pulls towards the bound in its direction; u_ref beyond it by `held` when there.
            let towards = normal[i] > 0.0;
            u_ref[i] = u_star[i] - lambda * normal[i];
            // One component must be free, or λ is not unique and the row may hold already.
            match place[i].max(usize::from(i == 0)) {
                0 if towards => { b.max[i] = u_star[i]; u_ref[i] += held; }
                0 => { b.min[i] = u_star[i]; u_ref[i] -= held; }
                // The bound on the other side, out of reach.
                1 if towards => b.min[i] = u_star[i] - held - 1.0,
                1 => b.max[i] = u_star[i] + held + 1.0,
                _ => {}
            }
        }
        let mut row = row(&normal, 0.0);
        row.floor = row.slack(u_star);
        let mut u = vec![0.0; m];
        let solution = solve(&[row], &b, &u_ref, NO_LIMIT, &mut u);
        prop_assert_eq!((solution.outcome, solution.solver), (Outcome::Optimal, Solver::ClosedForm));
        let tolerance = ROUND_OFF * conditioning(&row, &b, &u_ref);
        for i in 0..m {
            prop_assert!((u[i] - u_star[i]).abs() <= tolerance, "u[{i}] = {}, wanted {}", u[i], u_star[i]);
        }
    }

    #[test]
    fn a_feasible_reference_is_returned_bit_for_bit((row, b, wild) in quadratic::one_row(4)) {
        let u_ref: Vec<f64> = wild.iter().enumerate().map(|(i, r)| b.clamp(i, *r)).collect();
        let mut u = vec![f64::NAN; u_ref.len()];
        let floor = row.floor.min(Row { floor: 0.0, ..row }.slack(&u_ref));
        let solution = solve(&[Row { floor, ..row }], &b, &u_ref, NO_LIMIT, &mut u);
        prop_assert_eq!((solution.outcome, solution.solver), (Outcome::Optimal, Solver::Unchanged));
        let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        prop_assert_eq!(bits(&u), bits(&u_ref));
    }

    /// Any finite data, from 1e-308 to 1e300 and of both signs.
    #[test]
    fn extreme_data_give_a_finite_input_within_bounds(
        (rows, b, u_ref, limit) in quadratic::extreme(1),
    ) {
        let mut u = vec![f64::NAN; u_ref.len()];
        let solution = solve(&rows, &b, &u_ref, limit, &mut u);
        prop_assert!(u.iter().all(|v| v.is_finite()), "{u:?} {solution:?}");
        prop_assert!(b.contain(&u), "{u:?} {solution:?}");
        if solution.outcome == Outcome::Optimal {
            prop_assert!(met(&rows[0], &u, &u_ref), "slack {:e} of {:e}", rows[0].slack(&u), terms(&rows[0], &u));
        }
    }
}

#[test]
fn a_vanishing_normal_is_ill_conditioned_and_leaves_the_reference() {
    let u_ref = [3.0, -4.0];
    let least = f64::from_bits(1);
    for normal in [[0.0, 0.0], [-0.0, 0.0], [least, 0.0], [0.0, -least], [1e-310, 1e-310], [1e-300, 0.0]] {
        let mut u = [f64::NAN; 2];
        let solution = solve(&[row(&normal, 1.0)], &Bounds::NONE, &u_ref, 1e6, &mut u);
        assert_eq!(solution.outcome, Outcome::IllConditioned, "{normal:?}");
        assert_eq!(u, u_ref, "{normal:?}");
        // Bounded: the least violation, in the direction that is left.
        let solution = solve(&[row(&normal, 1.0)], &bounds(&[-5.0; 2], &[5.0; 2]), &u_ref, 1e6, &mut u);
        assert!(!matches!(solution.outcome, Outcome::Optimal | Outcome::Failed), "{normal:?}");
        for i in 0..2 {
            let best = if normal[i] == 0.0 { u_ref[i] } else { 5.0_f64.copysign(normal[i]) };
            assert_eq!(u[i], best, "{normal:?}");
        }
    }
}

#[test]
fn a_vanishing_normal_that_asks_for_nothing_is_met() {
    let mut u = [f64::NAN; 2];
    let solution = solve(&[row(&[0.0, 0.0], -1.0)], &Bounds::NONE, &[3.0, -4.0], 1e6, &mut u);
    assert_eq!((solution.outcome, u), (Outcome::Optimal, [3.0, -4.0]));
}

#[test]
fn the_correction_limit_divides_filtered_from_ill_conditioned() {
    for (limit, outcome, wanted) in [(10.0, Outcome::Optimal, 10.0), (9.999, Outcome::IllConditioned, 0.0)] {
        let mut u = [f64::NAN];
        // u ≥ 10 from 0 needs a correction of exactly 10.
        let solution = solve(&[row(&[2.0], 20.0)], &Bounds::NONE, &[0.0], limit, &mut u);
        assert_eq!((solution.outcome, u[0]), (outcome, wanted), "limit {limit}");
    }
}

/// The distance that u moves counts, not the multiplier: a component at its bound moves no further.
#[test]
fn the_correction_limit_does_not_count_components_at_their_bounds() {
    // u₁ stops at 1, then u₂ makes up the missing 1e-3 with a slope of 1e-8: λ = 1e5 · 1e8.
    let row = row(&[1.0, 1e-8], 1.0 + 1e-3);
    let mut u = [f64::NAN; 2];
    let solution = solve(&[row], &bounds(&[-1.0, -1e6], &[1.0, 1e6]), &[0.0; 2], 1e6, &mut u);
    assert_eq!(solution.outcome, Outcome::Optimal, "{u:?}");
    assert_eq!(u[0], 1.0);
    // 1.001 − 1 is known to 2.2e-16, and the slope magnifies that by 1e8.
    assert!((u[1] - 1e5).abs() <= 2.3e-8, "{u:?}");
}

#[test]
fn a_reference_outside_its_bounds_is_brought_back_first() {
    let b = bounds(&[-1.0, -1.0], &[1.0, 1.0]);
    let mut u = [f64::NAN; 2];
    let solution = solve(&[row(&[1.0, 0.0], -3.0)], &b, &[-7.0, 2.0], 1e6, &mut u);
    assert_eq!((solution.outcome, solution.solver, u), (Outcome::Optimal, Solver::Unchanged, [-1.0, 1.0]));
    // r₁ = −7 stays at −1 until λ = 6; until then only u₂ moves, from 0 to 1 at λ = 1; then u₁.
    let solution = solve(&[row(&[1.0, 1.0], 0.5)], &b, &[-7.0, 0.0], 1e6, &mut u);
    assert_eq!((solution.outcome, u), (Outcome::Optimal, [-0.5, 1.0]));
}

#[test]
fn clamping_turns_not_a_number_into_the_point_nearest_zero() {
    let b = bounds(&[2.0, -3.0, -1.0], &[4.0, -2.0, 1.0]);
    assert_eq!([0, 1, 2].map(|i| b.clamp(i, f64::NAN)), [2.0, -2.0, 0.0]);
}
