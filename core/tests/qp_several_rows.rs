//! The quadratic program with several rows: against exact enumeration, its properties, known answers.

use crate::enumeration;
use crate::interior_point;
use crate::quadratic;

use nalgebra::DVector;
use proptest::prelude::*;
use punctual_core::MAX_ROWS;
use punctual_core::qp::{
    Active, Bounds, Constraint, Enforcement, Outcome, Problem, Row, Solver, Workspace, solve,
};
use quadratic::{bounds, config, row};

const NO_LIMIT: f64 = 1e6;

/// Error of the active-set method: round-off, magnified by rows that are nearly parallel.
const ROUND_OFF: f64 = 1e-9;

/// The same for a known sine of their angle.
const EXACT: f64 = 1e-12;

/// Error of the interior-point method on u: it stops at a duality gap of 1e-8 (relative), and a gap δ
/// of ½‖u − u_ref‖² bounds the argument only by √(2δ) = 1.4e-4.
const GAP: f64 = 1.4e-4;

/// The rows and the finite bounds, as one list of unit rows.
fn all_rows(rows: &[Row], b: &Bounds, m: usize) -> Vec<(DVector<f64>, f64)> {
    let mut list = Vec::new();
    for row in rows {
        let normal = DVector::from_column_slice(&row.normal[..m]);
        let norm = normal.norm();
        list.push((normal / norm, row.floor / norm));
    }
    for i in 0..m {
        let mut axis = DVector::zeros(m);
        axis[i] = 1.0;
        if b.max[i].is_finite() {
            list.push((-&axis, -b.max[i]));
        }
        if b.min[i].is_finite() {
            list.push((axis, b.min[i]));
        }
    }
    list
}

/// Rows of length 1 to 4, two to four of them, in two or three inputs, maybe bounded.
fn several() -> impl Strategy<Value = (Vec<Row>, Bounds, Vec<f64>)> {
    let one = (prop::collection::vec(-1.0..1.0, 3), 1.0..4.0, -6.0..6.0);
    let parts = prop::collection::vec((quadratic::interval(), -10.0..10.0), 2..=3);
    (prop::collection::vec(one, 2..=4), parts, any::<bool>()).prop_filter_map(
        "a direction",
        |(rows, parts, bounded)| {
            let m = parts.len();
            let rows: Option<Vec<Row>> = rows
                .iter()
                .map(|(direction, length, floor): &(Vec<f64>, f64, f64)| {
                    let norm = direction[..m].iter().map(|v| v * v).sum::<f64>().sqrt();
                    let normal: Vec<f64> = direction[..m].iter().map(|v| v / norm * length).collect();
                    (norm > 0.1).then(|| row(&normal, *floor))
                })
                .collect();
            let (min, max): (Vec<f64>, Vec<f64>) = parts.iter().map(|p| p.0).unzip();
            let b = if bounded { bounds(&min, &max) } else { Bounds::NONE };
            Some((rows?, b, parts.iter().map(|p| p.1).collect()))
        },
    )
}

proptest! {
    #![proptest_config(config(400))]

    #[test]
    fn several_rows_equal_enumeration((rows, b, u_ref) in several()) {
        let m = u_ref.len();
        let list = all_rows(&rows, &b, m);
        let reference = DVector::from_column_slice(&u_ref);
        let mut u = vec![f64::NAN; m];
        let solution = solve(&rows, &b, &u_ref, NO_LIMIT, &mut u);
        prop_assert!(b.contain(&u), "{u:?}");
        let found = DVector::from_column_slice(&u);
        let least_slack = list.iter().map(|(a, floor)| a.dot(&found) - floor).fold(f64::INFINITY, f64::min);
        let from = std::array::from_fn(|i| u_ref.get(i).map_or(0.0, |v| *v).into());
        match enumeration::minimiser(&enumeration::constraints(&rows, &b, m), m, &from, 1e-24) {
            Some(wanted) => {
                prop_assert_eq!(solution.outcome, Outcome::Optimal, "wanted {:?}", wanted.u);
                prop_assert!(least_slack >= -ROUND_OFF * (1.0 + found.norm()), "slack {least_slack:e}");
                let sine = wanted.sine;
                let wanted = DVector::from_fn(m, |i, _| wanted.u[i].value());
                let (error, size) = ((&found - &wanted).norm(), 1.0 + (&wanted - &reference).norm());
                prop_assert!(error <= EXACT * size / sine, "{found} {wanted} error {error:e}, sine {sine}");
            }
            None => {
                // Nearly parallel rows can meet farther out than enumeration resolves.
                if solution.outcome == Outcome::Optimal {
                    prop_assert!(least_slack >= -ROUND_OFF * (1.0 + found.norm()), "slack {least_slack:e}");
                } else {
                    prop_assert_eq!(solution.outcome, Outcome::Infeasible);
                }
            }
        }
    }

    #[test]
    fn the_same_problem_gives_the_same_bits((rows, b, u_ref) in several(), (others, _, _) in several()) {
        let mut first = vec![f64::NAN; u_ref.len()];
        let mut second = vec![0.5; u_ref.len()];
        let one = solve(&rows, &b, &u_ref, NO_LIMIT, &mut first);
        solve(&others, &b, &u_ref, NO_LIMIT, &mut second);
        let two = solve(&rows, &b, &u_ref, NO_LIMIT, &mut second);
        prop_assert_eq!(one, two);
        let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        prop_assert_eq!(bits(&first), bits(&second));
    }

    /// Whatever the workspace solved before: the same, or much the same, or something else.
    #[test]
    fn a_warm_start_changes_no_bit((rows, b, u_ref) in several(), (others, _, _) in several(), step in 0.0..0.2) {
        let mut workspace = Workspace::default();
        let before = Problem::new(&rows, &b, &u_ref, NO_LIMIT);
        workspace.solve(&before, &mut vec![f64::NAN; u_ref.len()]);
        let moved: Vec<f64> = u_ref.iter().map(|v| v + step).collect();
        for rows in [&rows, &rows, &others, &rows] {
            let p = Problem::new(rows, &b, &moved, NO_LIMIT);
            let (mut warm, mut cold) = (vec![f64::NAN; moved.len()], vec![f64::NAN; moved.len()]);
            let mut fresh = Workspace::default();
            let (one, two) = (workspace.solve(&p, &mut warm), fresh.solve(&p, &mut cold));
            prop_assert_eq!((one.outcome, one.solver), (two.outcome, two.solver));
            let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            prop_assert_eq!(bits(&warm), bits(&cold), "{:?} {:?}", warm, cold);
            prop_assert_eq!(workspace.active(), fresh.active());
        }
    }

    #[test]
    fn extreme_data_give_a_finite_input_within_bounds((rows, b, u_ref, limit) in quadratic::extreme(0)) {
        let mut u = vec![f64::NAN; u_ref.len()];
        let solution = solve(&rows, &b, &u_ref, limit, &mut u);
        prop_assert!(u.iter().all(|v| v.is_finite()), "{u:?} {solution:?}");
        prop_assert!(b.contain(&u), "{u:?} {solution:?}");
    }

    /// The interior-point method finds the same within its own accuracy.
    #[test]
    fn both_methods_agree((rows, b, u_ref) in several()) {
        let p = Problem::new(&rows, &b, &u_ref, NO_LIMIT);
        let (mut u, mut v) = (vec![f64::NAN; u_ref.len()], vec![f64::NAN; u_ref.len()]);
        let one = Workspace::default().solve(&p, &mut u);
        let two = interior_point::solve(&rows, &b, &u_ref, NO_LIMIT, &mut v);
        if one.outcome == Outcome::Optimal {
            prop_assert_eq!(two, Outcome::Optimal);
            let (u, v) = (DVector::from_vec(u), DVector::from_vec(v));
            let size = 1.0 + (&u - DVector::from_vec(u_ref)).norm();
            prop_assert!((&u - &v).norm() <= GAP * size, "{u} {v}");
        }
    }

    /// The order of rows that can all be met does not matter.
    #[test]
    fn permuting_rows_changes_round_off_only((mut rows, b, u_ref) in several()) {
        let (mut u, mut v) = (vec![f64::NAN; u_ref.len()], vec![f64::NAN; u_ref.len()]);
        let one = solve(&rows, &b, &u_ref, NO_LIMIT, &mut u);
        rows.reverse();
        let two = solve(&rows, &b, &u_ref, NO_LIMIT, &mut v);
        prop_assert_eq!(one.outcome, two.outcome);
        if one.outcome == Outcome::Optimal {
            let (u, v) = (DVector::from_vec(u), DVector::from_vec(v));
            let size = 1.0 + u.norm();
            prop_assert!((&u - &v).norm() <= ROUND_OFF * size, "{u} {v}");
        }
    }

    /// A row twice, or in other units, is the same problem.
    #[test]
    fn scaling_a_row_changes_nothing((rows, b, u_ref) in several(), exponent in -200..200) {
        let mut u = vec![f64::NAN; u_ref.len()];
        let mut v = u.clone();
        let one = solve(&rows, &b, &u_ref, NO_LIMIT, &mut u);
        let mut in_other_units = rows.clone();
        let factor = 2.0_f64.powi(exponent);
        in_other_units[0].normal = rows[0].normal.map(|a| a * factor);
        in_other_units[0].floor *= factor;
        let two = solve(&in_other_units, &b, &u_ref, NO_LIMIT, &mut v);
        prop_assert_eq!(one, two);
        prop_assert_eq!(u, v);
    }
}

#[test]
fn a_feasible_reference_is_returned_bit_for_bit() {
    let u_ref = [0.1 + 0.2, -0.0];
    let mut u = [f64::NAN; 2];
    let rows = [row(&[1.0, 0.0], 0.0), row(&[0.0, 1.0], -1.0)];
    let solution = solve(&rows, &Bounds::NONE, &u_ref, NO_LIMIT, &mut u);
    assert_eq!((solution.outcome, solution.solver), (Outcome::Optimal, Solver::Unchanged));
    assert_eq!(u.map(f64::to_bits), u_ref.map(f64::to_bits));
}

/// Two rows and a bound active: found in rounds at first, then at once, until another set is active.
#[test]
fn the_last_answer_s_rows_are_tried_first() {
    let mut workspace = Workspace::default();
    let b = bounds(&[-1.0; 3], &[1.0; 3]);
    let mut rounds = Vec::new();
    for (second, third) in [(0.75, 0.75), (0.7, 0.6), (0.0, 0.6)] {
        let rows = [row(&[1.0, 1.0, 0.0], 1.0 + second), row(&[1.0, 0.0, 1.0], 1.0 + third)];
        let p = Problem::new(&rows, &b, &[3.0, 0.0, 0.0], NO_LIMIT);
        let wanted = [1.0, second, third];
        let mut u = [f64::NAN; 3];
        let solution = workspace.solve(&p, &mut u);
        assert_eq!((solution.outcome, solution.solver), (Outcome::Optimal, Solver::DualActiveSet));
        assert!(u.iter().zip(wanted).all(|(a, w)| (a - w).abs() <= 1e-15), "{u:?} for {wanted:?}");
        rounds.push(solution.iterations > 0);
    }
    assert_eq!(rounds, [true, false, true]);
}

/// A soft row pulls with its penalty and no more, whatever the unit of the row.
#[test]
fn a_soft_row_yields_beyond_its_penalty() {
    for (penalty, wanted) in [(5.0, 3.0), (3.0, 3.0), (2.0, 2.0), (0.5, 0.5)] {
        for unit in [1.0, 1e-6, 1e6] {
            let rows = [row(&[unit, 0.0], 3.0 * unit)];
            let enforcement = [Enforcement::Soft { penalty }];
            let p = Problem::new(&rows, &Bounds::NONE, &[0.0; 2], NO_LIMIT);
            let p = Problem { enforcement: &enforcement, ..p };
            let mut u = [f64::NAN; 2];
            assert_eq!(Workspace::default().solve(&p, &mut u).outcome, Outcome::Optimal);
            assert!((u[0] - wanted).abs() <= 1e-15 * wanted && u[1] == 0.0, "{penalty} {unit}: {u:?}");
        }
    }
}

/// min (u₁² + 4 u₂²) under u₁ + u₂ ≥ 5: the dear input moves a quarter as far.
#[test]
fn weights_make_an_input_dear() {
    let rows = [row(&[1.0, 1.0], 5.0), row(&[0.0, 1.0], -1.0)];
    let p = Problem::new(&rows, &Bounds::NONE, &[0.0; 2], NO_LIMIT);
    let p = Problem { weights: Some(&[1.0, 4.0]), ..p };
    let mut u = [f64::NAN; 2];
    let mut workspace = Workspace::default();
    workspace.solve(&p, &mut u);
    assert!((u[0] - 4.0).abs() <= 4e-15 && (u[1] - 1.0).abs() <= 1e-15, "{u:?}");
    let active: Vec<Active> = workspace.active().to_vec();
    assert_eq!(active.len(), 1);
    assert!(active[0].constraint == Constraint::Row(0) && (active[0].multiplier - 4.0).abs() <= 4e-15);
    let residuals = workspace.residuals(&p, &u);
    assert!(residuals.stationarity <= 1e-15 && residuals.complementarity <= 1e-15, "{residuals:?}");
}

#[test]
fn more_rows_than_fit_are_met_up_to_the_largest_number() {
    // Tangents of a circle of radius 1 seen from outside.
    let rows: Vec<Row> = (0..MAX_ROWS)
        .map(|k| {
            let angle = k as f64 * std::f64::consts::TAU / MAX_ROWS as f64;
            row(&[angle.cos(), angle.sin()], -1.0)
        })
        .collect();
    let mut u = [f64::NAN; 2];
    let solution = solve(&rows, &Bounds::NONE, &[3.0, 4.0], NO_LIMIT, &mut u);
    assert_eq!((solution.outcome, solution.solver), (Outcome::Optimal, Solver::DualActiveSet));
    assert!(rows.iter().all(|row| row.holds(&u)) && (u[0].hypot(u[1]) - 1.0).abs() < 2e-3, "{u:?}");
}

/// A barrier that cannot be influenced does not switch the others off.
#[test]
fn a_vanishing_row_leaves_the_others_in_force() {
    for vanishing in [row(&[0.0, 0.0], 1.0), row(&[1e-310, 0.0], 1.0), row(&[1e-200, 1e-200], 1.0)] {
        let mut u = [f64::NAN; 2];
        let rows = [vanishing, row(&[1.0, 0.0], 3.0)];
        let solution = solve(&rows, &Bounds::NONE, &[0.5, 0.5], NO_LIMIT, &mut u);
        assert_eq!(solution.outcome, Outcome::IllConditioned, "{vanishing:?}");
        assert!(u == [3.0, 0.5], "{vanishing:?} {u:?}");
    }
    // The others hold already: the reference is left as it is.
    for vanishing in [row(&[0.0, 0.0], 1.0), row(&[1e-310, 0.0], 1.0), row(&[1e-200, 1e-200], 1.0)] {
        let mut u = [f64::NAN; 2];
        let rows = [vanishing, row(&[1.0, 0.0], 0.25)];
        let solution = solve(&rows, &Bounds::NONE, &[0.5, 0.5], NO_LIMIT, &mut u);
        assert_eq!((solution.outcome, u), (Outcome::IllConditioned, [0.5, 0.5]), "{vanishing:?}");
    }
    // One that asks for nothing is no defect.
    let mut u = [f64::NAN; 2];
    let rows = [row(&[0.0, 0.0], -1.0), row(&[1.0, 0.0], 3.0)];
    let solution = solve(&rows, &Bounds::NONE, &[0.5, 0.5], NO_LIMIT, &mut u);
    assert_eq!(solution.outcome, Outcome::Optimal);
}
