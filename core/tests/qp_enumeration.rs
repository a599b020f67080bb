//! The active-set method against enumeration in double-double arithmetic: `PUNCTUAL_QP_CASES` random
//! programs of every class, a few thousand by default. Prints the largest errors (`--nocapture`).

#![allow(clippy::print_stdout, reason = "the figures are read from the output")]

use crate::enumeration;
use crate::quadratic;

use enumeration::{Found, Point, constraints, least_violation, minimiser, softened};
use punctual_core::qp::{Bounds, Enforcement, Outcome, Problem, Row, Workspace};
use quadratic::random::Random;
use quadratic::row;

/// Cases of a test.
fn cases(default: u64) -> u64 {
    std::env::var("PUNCTUAL_QP_CASES").map_or(default, |n| n.parse().expect("PUNCTUAL_QP_CASES is a number"))
}

/// Error of u in units of its size and of 1/sine of the angle between active rows: some dozen operations,
/// and more where rows that are not active are nearly parallel too.
const ERROR: f64 = 1e-12;

/// Stationarity and signs of the multipliers, as parts of their terms: multipliers of nearly parallel rows
/// are large and cancel.
const RESIDUAL: f64 = 1e-12;

#[derive(Clone, Copy, Debug)]
enum Class {
    /// Any normals and floors of order 1.
    General,
    /// Small whole numbers: degenerate vertices, duplicate, opposite and vanishing differences.
    Whole,
    /// Copies of the first row turned by 1e-2 to 1e-9 and in other units.
    Parallel,
    /// Rows in units from 1e-8 to 1e8, inputs too.
    Scaled,
}

struct Case {
    rows: Vec<Row>,
    bounds: Bounds,
    u_ref: Vec<f64>,
    limit: f64,
}

fn case(random: &mut Random, class: Class) -> Case {
    let m = 1 + random.below(3);
    let count = 1 + random.below(6);
    let whole = |random: &mut Random, range: usize| random.below(2 * range + 1) as f64 - range as f64;
    let number = |random: &mut Random, range: usize| match class {
        Class::Whole => whole(random, range),
        _ => random.within(range as f64),
    };
    let mut rows: Vec<Row> = Vec::new();
    while rows.len() < count {
        let normal: Vec<f64> = (0..m).map(|_| number(random, 3)).collect();
        if normal.iter().any(|a| a.abs() > 0.01) {
            rows.push(row(&normal, number(random, 6)));
        }
    }
    if let Class::Parallel = class {
        for k in 1..count {
            if random.below(3) > 0 {
                let factor = random.within(3.0);
                let turn = 10_f64.powi(-2 - random.below(8) as i32);
                let first = rows[0];
                for i in 0..m {
                    rows[k].normal[i] = factor * (first.normal[i] + turn * random.within(1.0));
                }
                rows[k].floor = factor * (first.floor + turn * random.within(1.0));
            }
        }
    }
    let mut bounds = Bounds::NONE;
    let mut u_ref = Vec::new();
    let bounded = random.below(3) > 0;
    for i in 0..m {
        let (low, width) = (number(random, 5), number(random, 4).abs());
        if bounded {
            let sides = random.below(5);
            bounds.min[i] = if sides == 0 { f64::NEG_INFINITY } else { low };
            bounds.max[i] = if sides == 1 { f64::INFINITY } else { low + width };
        }
        u_ref.push(number(random, 6));
    }
    let mut limit = 1e6;
    if let Class::Scaled = class {
        let unit = 10_f64.powi(random.below(17) as i32 - 8);
        limit *= unit;
        for i in 0..m {
            (bounds.min[i], bounds.max[i], u_ref[i]) =
                (bounds.min[i] * unit, bounds.max[i] * unit, u_ref[i] * unit);
        }
        for row in &mut rows {
            let factor = 10_f64.powi(random.below(17) as i32 - 8);
            row.normal.iter_mut().for_each(|a| *a *= factor);
            row.floor *= factor * unit;
        }
    }
    Case { rows, bounds, u_ref, limit }
}

fn point(u: &[f64]) -> Point {
    std::array::from_fn(|i| u.get(i).map_or(0.0, |v| *v).into())
}

fn distance(u: &[f64], to: &Point) -> f64 {
    u.iter().zip(to).fold(0.0, |d: f64, (v, w)| d.hypot((enumeration::Twofold::from(*v) - *w).value()))
}

/// The size of u, of u_ref and of the distances of the rows from 0.
fn size(case: &Case, found: &Found) -> f64 {
    let m = case.u_ref.len();
    let u = found.u[..m].iter().map(|v| v.value().abs());
    let rows = found.set.iter().filter_map(|&k| case.rows.get(k));
    let offsets = rows.map(|row| row.floor.abs() / row.normal.iter().fold(0.0, |s: f64, a| s.max(a.abs())));
    u.chain(case.u_ref.iter().map(|v| v.abs())).chain(offsets).fold(f64::MIN_POSITIVE, f64::max)
}

/// Of a class: programs, with an answer, unequal statuses, the largest errors of u relative to its size
/// and to size / sine, the largest residual.
#[derive(Debug, Default)]
struct Tally {
    programs: u64,
    feasible: u64,
    rounds: u64,
    most_rounds: u32,
    /// Infeasible by less than round-off, and solved up to round-off.
    marginal: u64,
    wrong: u64,
    error: f64,
    error_times_sine: f64,
    residual: f64,
}

fn run(class: Class, count: u64) -> Tally {
    let mut random = Random::new(2507 + class as u64);
    let mut tally = Tally::default();
    let mut workspace = Workspace::default();
    for number in 0..count {
        let case = case(&mut random, class);
        let Case { rows, bounds, u_ref, limit } = &case;
        let m = u_ref.len();
        let p = Problem::new(rows, bounds, u_ref, *limit);
        let mut u = vec![f64::NAN; m];
        let solution = workspace.solve(&p, &mut u);
        assert!(bounds.contain(&u), "{number}: {u:?}");
        let found = minimiser(&constraints(rows, bounds, m), m, &point(u_ref), 1e-24);
        tally.programs += 1;
        tally.rounds += u64::from(solution.iterations);
        tally.most_rounds = tally.most_rounds.max(solution.iterations);
        let clamped: Vec<f64> = u_ref.iter().enumerate().map(|(i, r)| bounds.clamp(i, *r)).collect();
        let wanted = match &found {
            None => Outcome::Infeasible,
            Some(found) if distance(&clamped, &found.u) > *limit => Outcome::IllConditioned,
            Some(_) => Outcome::Optimal,
        };
        // What cannot be met may also be out of reach.
        let fits = solution.outcome == wanted
            || (wanted, solution.outcome) == (Outcome::Infeasible, Outcome::IllConditioned)
                && matches!(class, Class::Parallel);
        // Nearly parallel rows may contradict each other by less than round-off.
        let marginal = (wanted, solution.outcome) == (Outcome::Infeasible, Outcome::Optimal)
            && rows.iter().all(|row| row.holds(&u));
        if marginal {
            tally.marginal += 1;
        } else if !fits {
            tally.wrong += 1;
            if tally.wrong <= 3 {
                println!("{class:?} {number}: {solution:?}, wanted {wanted:?}\n{rows:?} {u_ref:?} {u:?}");
                println!("{:?} {:?}", &bounds.min[..m], &bounds.max[..m]);
                println!("{:?}", found.map(|f| (f.u.map(|v| v.value()), f.set, f.sine)));
            }
        } else if let (Some(found), Outcome::Optimal) = (&found, wanted) {
            tally.feasible += 1;
            let error = distance(&u, &found.u) / size(&case, found);
            tally.error = tally.error.max(error);
            tally.error_times_sine = tally.error_times_sine.max(error * found.sine);
            let residuals = workspace.residuals(&p, &u);
            let terms = residuals.stationarity.max(residuals.negativity);
            tally.residual = tally.residual.max(terms);
        }
    }
    println!("{class:?}: {tally:?}");
    tally
}

#[test]
fn programs_equal_enumeration() {
    for class in [Class::General, Class::Whole, Class::Parallel, Class::Scaled] {
        let tally = run(class, cases(10_000) / 4);
        assert_eq!(tally.wrong, 0, "{class:?}: unequal statuses");
        assert!(tally.error_times_sine <= ERROR && tally.residual <= RESIDUAL, "{class:?}: {tally:?}");
    }
}

/// Within finite bounds, so that a least violation exists.
#[test]
fn infeasible_rows_are_violated_least_in_their_order() {
    let mut random = Random::new(25);
    let mut workspace = Workspace::default();
    let (mut infeasible, mut worst) = (0, 0.0_f64);
    let count = cases(8_000) / 8;
    for number in 0..count {
        let class = if number % 2 == 0 { Class::General } else { Class::Whole };
        let mut case = case(&mut random, class);
        let m = case.u_ref.len();
        for i in 0..m {
            case.bounds.min[i] = case.bounds.min[i].max(-6.0);
            case.bounds.max[i] = case.bounds.max[i].min(6.0);
        }
        let Case { rows, bounds, u_ref, .. } = &case;
        // Priorities backwards for a part: the order of the oracle's list.
        let backwards = number % 3 == 0;
        let priorities: Vec<Enforcement> = (0..rows.len() as u32)
            .map(|k| Enforcement::Hard { priority: if backwards { 100 - k } else { 1 } })
            .collect();
        let mut ordered = rows.clone();
        if backwards {
            ordered.reverse();
        }
        let p = Problem { enforcement: &priorities, ..Problem::new(rows, bounds, u_ref, 1e6) };
        let mut u = vec![f64::NAN; m];
        let single = rows.len() == 1;
        let solution = workspace.solve(&p, &mut u);
        if solution.outcome == Outcome::Optimal {
            continue;
        }
        infeasible += 1;
        assert_eq!(solution.outcome, Outcome::Infeasible, "{number}: {rows:?} {u_ref:?}");
        let list = constraints(&ordered, bounds, m);
        let (wanted, relaxed) = least_violation(&list, rows.len(), m, &point(u_ref), 1e-18);
        for (k, relaxed) in relaxed.iter().enumerate() {
            let k = if backwards { rows.len() - 1 - k } else { k };
            assert_eq!(
                workspace.relaxed().contains(k),
                *relaxed,
                "{number}: row {k} of {rows:?} {u_ref:?} {u:?}"
            );
        }
        // One row alone goes to the vertex, also along components that do not matter to it.
        let error = distance(&u, &wanted);
        worst = if single { worst } else { worst.max(error) };
        assert!(
            single || error <= 1e-8,
            "{number}: error {error:e}\n{rows:?} {u_ref:?} {bounds:?}\n{u:?} wanted {:?}",
            wanted.map(|v| v.value())
        );
    }
    println!("least violation: {infeasible} of {count} infeasible, largest error {worst:e}");
    assert!(infeasible > count / 10);
}

#[test]
fn soft_rows_yield_at_their_penalty() {
    let mut random = Random::new(7);
    let mut workspace = Workspace::default();
    let (mut compared, mut worst) = (0, 0.0_f64);
    let count = cases(8_000) / 8;
    for number in 0..count {
        let class = if number % 2 == 0 { Class::General } else { Class::Whole };
        let Case { mut rows, bounds, u_ref, .. } = case(&mut random, class);
        let m = u_ref.len();
        rows.truncate(4);
        let soft = 1 + random.below(rows.len());
        let penalties: Vec<f64> = (0..soft).map(|_| 0.01 + random.within(4.0).abs()).collect();
        let enforcement: Vec<Enforcement> =
            penalties.iter().map(|&penalty| Enforcement::Soft { penalty }).collect();
        let norm = |row: &Row| row.normal.iter().map(|a| a * a).sum::<f64>().sqrt();
        let caps: Vec<f64> = penalties.iter().zip(&rows).map(|(penalty, row)| penalty / norm(row)).collect();
        let p = Problem { enforcement: &enforcement, ..Problem::new(&rows, &bounds, &u_ref, 1e6) };
        let mut u = vec![f64::NAN; m];
        let solution = workspace.solve(&p, &mut u);
        let wanted = softened(&constraints(&rows, &bounds, m), &caps, m, &point(&u_ref), 1e-14);
        match wanted {
            Some(wanted) => {
                compared += 1;
                assert_eq!(solution.outcome, Outcome::Optimal, "{number}: {p:?}");
                let error = distance(&u, &wanted);
                worst = worst.max(error);
                assert!(
                    error <= 1e-8,
                    "{number}: error {error:e} {p:?}\n{u:?} wanted {:?}",
                    wanted.map(|v| v.value())
                );
                let residuals = workspace.residuals(&p, &u);
                assert!(residuals.stationarity <= 1e-12, "{number}: {residuals:?} {p:?}");
            }
            None => assert_eq!(solution.outcome, Outcome::Infeasible, "{number}: {p:?}"),
        }
    }
    println!("soft rows: {compared} of {count} compared, largest error {worst:e}");
    assert!(compared > count / 2);
}
