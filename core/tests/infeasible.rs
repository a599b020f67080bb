//! Every way in which constraints cannot be met: the report and the input that comes back. With
//! `PUNCTUAL_TABLES=1` and `--nocapture` the cases are printed as tables.

#![allow(clippy::print_stdout, reason = "the cases are read from the output")]

use crate::quadratic;

use punctual_core::barriers::HalfPlane;
use punctual_core::filter::{BarrierSettings, Filter, FilterBuilder, Sampling, Status, Strictness};
use punctual_core::plants::PointMass;
use punctual_core::qp::{Bounds, Enforcement, Outcome, Problem, Row, Workspace};
use quadratic::{bounds, row};

const NO_LIMIT: f64 = 1e6;
/// Round-off of a handful of operations on numbers up to 100.
const ROUND_OFF: f64 = 1e-12;

/// Prints a line of a table where tables are wanted.
fn tell(line: &str) {
    if std::env::var_os("PUNCTUAL_TABLES").is_some() {
        println!("{line}");
    }
}

/// A program, and what must come of it.
struct Case {
    name: &'static str,
    rows: Vec<Row>,
    bounds: Bounds,
    u_ref: [f64; 2],
    enforcement: Vec<Enforcement>,
    outcome: Outcome,
    u: [f64; 2],
    /// Violation of each row, in its own unit.
    violations: Vec<f64>,
}

fn hard(priorities: &[u32]) -> Vec<Enforcement> {
    priorities.iter().map(|&priority| Enforcement::Hard { priority }).collect()
}

fn cases() -> Vec<Case> {
    let unit = || bounds(&[-1.0; 2], &[1.0; 2]);
    let opposite = || vec![row(&[1.0, 0.0], 1.0), row(&[-1.0, 0.0], 1.0)];
    vec![
        Case {
            name: "one row beyond the bounds",
            rows: vec![row(&[1.0, 1.0], 5.0)],
            bounds: unit(),
            u_ref: [0.0, 0.0],
            enforcement: hard(&[0]),
            outcome: Outcome::Infeasible,
            u: [1.0, 1.0],
            violations: vec![3.0],
        },
        Case {
            name: "an input that is fixed",
            rows: vec![row(&[1.0, 0.0], 1.0)],
            bounds: bounds(&[0.5, -1.0], &[0.5, 1.0]),
            u_ref: [0.0, 0.25],
            enforcement: hard(&[0]),
            outcome: Outcome::Infeasible,
            u: [0.5, 0.25],
            violations: vec![0.5],
        },
        Case {
            name: "two rows beyond the bounds",
            rows: vec![row(&[1.0, 0.0], 5.0), row(&[0.0, -2.0], 5.0)],
            bounds: unit(),
            u_ref: [0.25, 0.5],
            enforcement: hard(&[0, 0]),
            outcome: Outcome::Infeasible,
            u: [1.0, -1.0],
            violations: vec![4.0, 3.0],
        },
        Case {
            name: "opposite rows: the first is met",
            rows: opposite(),
            bounds: Bounds::NONE,
            u_ref: [0.25, 7.0],
            enforcement: hard(&[0, 0]),
            outcome: Outcome::Infeasible,
            u: [1.0, 7.0],
            violations: vec![0.0, 2.0],
        },
        Case {
            name: "opposite rows: the second has priority",
            rows: opposite(),
            bounds: Bounds::NONE,
            u_ref: [0.25, 7.0],
            enforcement: hard(&[1, 0]),
            outcome: Outcome::Infeasible,
            u: [-1.0, 7.0],
            violations: vec![2.0, 0.0],
        },
        Case {
            // u₁ = 2 as close to 5 as it gets; u₂ = 3; u₁ ≤ 0.5 comes last.
            name: "a row given up stays at its least violation",
            rows: vec![row(&[1.0, 0.0], 5.0), row(&[0.0, 1.0], 3.0), row(&[-1.0, 0.0], -0.5)],
            bounds: bounds(&[-2.0; 2], &[2.0, f64::INFINITY]),
            u_ref: [0.0, 0.0],
            enforcement: hard(&[0, 0, 0]),
            outcome: Outcome::Infeasible,
            u: [2.0, 3.0],
            violations: vec![3.0, 0.0, 1.5],
        },
        Case {
            name: "three priorities",
            rows: vec![row(&[1.0, 0.0], 2.0), row(&[-1.0, 0.0], 0.0), row(&[0.0, 1.0], 4.0)],
            bounds: bounds(&[-3.0; 2], &[3.0; 2]),
            u_ref: [-1.0, 0.0],
            enforcement: hard(&[2, 0, 1]),
            outcome: Outcome::Infeasible,
            u: [0.0, 3.0],
            violations: vec![2.0, 0.0, 1.0],
        },
        Case {
            name: "a soft row beside a hard one that is lost",
            rows: vec![row(&[1.0, 0.0], 5.0), row(&[0.0, 1.0], 0.75)],
            bounds: unit(),
            u_ref: [0.0, 0.0],
            enforcement: vec![Enforcement::Hard { priority: 0 }, Enforcement::Soft { penalty: 0.5 }],
            outcome: Outcome::Infeasible,
            u: [1.0, 0.5],
            violations: vec![4.0, 0.25],
        },
        Case {
            name: "a row that no input moves",
            rows: vec![row(&[0.0, 0.0], 1.0)],
            bounds: unit(),
            u_ref: [0.25, 0.5],
            enforcement: hard(&[0]),
            outcome: Outcome::IllConditioned,
            u: [0.25, 0.5],
            violations: vec![1.0],
        },
    ]
}

#[test]
fn programs_that_cannot_be_met() {
    tell("| program | rows | bounds | priority | status | u | violation |\n|---|---|---|---|---|---|---|");
    let mut workspace = Workspace::default();
    for c in cases() {
        let mut u = [f64::NAN; 2];
        let p = Problem::new(&c.rows, &c.bounds, &c.u_ref, NO_LIMIT);
        let outcome = workspace.solve(&Problem { enforcement: &c.enforcement, ..p }, &mut u).outcome;
        let violations: Vec<f64> = c.rows.iter().map(|row| (-row.slack(&u)).max(0.0)).collect();
        let text = |row: &Row| format!("{:?}·u ≥ {}", &row.normal[..2], row.floor);
        let strictness = |e: &Enforcement| match e {
            Enforcement::Hard { priority } => priority.to_string(),
            Enforcement::Soft { penalty } => format!("soft, {penalty}"),
        };
        tell(&format!(
            "| {} | {} | {:?} to {:?} | {} | {outcome:?} | {u:?} | {violations:?} |",
            c.name,
            c.rows.iter().map(text).collect::<Vec<_>>().join("; "),
            &c.bounds.min[..2],
            &c.bounds.max[..2],
            c.enforcement.iter().map(strictness).collect::<Vec<_>>().join("; "),
        ));
        assert_eq!(outcome, c.outcome, "{}", c.name);
        assert!(c.bounds.contain(&u), "{}: {u:?}", c.name);
        let near = |a: &[f64], b: &[f64]| {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= ROUND_OFF)
        };
        assert!(near(&u, &c.u), "{}: {u:?}", c.name);
        assert!(near(&violations, &c.violations), "{}: {violations:?}", c.name);
        for (i, (violation, enforcement)) in violations.iter().zip(&c.enforcement).enumerate() {
            let lost = *violation > ROUND_OFF && matches!(enforcement, Enforcement::Hard { .. });
            let named = workspace.relaxed().contains(i) || workspace.ill_conditioned().contains(i);
            assert_eq!(named, lost, "{}: row {i}", c.name);
        }
    }
}

/// A filter at a state, and what its step must report.
struct Situation {
    name: &'static str,
    filter: FilterBuilder<PointMass, 4, 2>,
    x: [f64; 4],
    limit: f64,
    status: Status,
    u: [f64; 2],
    /// Of each barrier, in m/s².
    violations: Vec<f64>,
}

/// The half-plane on the side of `normal` of a line through (x, 0).
fn side(normal: f64, x: f64) -> HalfPlane {
    HalfPlane::new([normal, 0.0], [x, 0.0]).expect("valid half-plane")
}

/// x ≤ 1 m, slowly, and x ≥ 2 m within 1 s: from rest 1 m/s² is allowed and 6 · 2/1² m/s² needed.
fn wall_before_goal(priorities: Option<[u32; 2]>) -> FilterBuilder<PointMass, 4, 2> {
    let slow = BarrierSettings::within(1.0).rate(1.0).stay_rate(1.0);
    let [goal, wall] = priorities.map_or([Strictness::KeepFirst; 2], |p| p.map(Strictness::Priority));
    Filter::builder(PointMass)
        .barrier("goal", side(1.0, 2.0), BarrierSettings::within(1.0))
        .and_then(|b| b.strictness(goal))
        .and_then(|b| b.barrier("wall", side(-1.0, 1.0), slow))
        .and_then(|b| b.strictness(wall))
        .expect("valid barriers")
}

fn situations() -> Vec<Situation> {
    let one = |name: &str, barrier, seconds: f64| {
        let settings = BarrierSettings::within(seconds);
        Filter::builder(PointMass).barrier(name, barrier, settings).expect("valid barrier")
    };
    vec![
        Situation {
            // 12 m/s² from rest, 2 m in 1 s.
            name: "a deadline that the bounds do not allow",
            filter: one("goal", side(1.0, 2.0), 1.0),
            x: [0.0; 4],
            limit: 3.0,
            status: Status::Infeasible,
            u: [3.0, 0.0],
            violations: vec![9.0],
        },
        Situation {
            name: "a wall that is kept before a goal behind it",
            filter: wall_before_goal(None),
            x: [0.0; 4],
            limit: 20.0,
            status: Status::Infeasible,
            u: [1.0, 0.0],
            violations: vec![11.0, 0.0],
        },
        Situation {
            name: "the same, with priority for the goal",
            filter: wall_before_goal(Some([0, 1])),
            x: [0.0; 4],
            limit: 20.0,
            status: Status::Infeasible,
            u: [12.0, 0.0],
            violations: vec![0.0, 11.0],
        },
        Situation {
            // Kept at h = 0.5 m, ḣ = −3 m/s, it asks for −u ≥ −2aḣ − a²h = 10 with the largest rate, ten times the one given.
            name: "too fast towards a wall",
            filter: {
                let slow = BarrierSettings::within(1.0).rate(1.0).stay_rate(1.0);
                let wall = Filter::builder(PointMass).barrier("wall", side(-1.0, 1.0), slow);
                wall.expect("valid barrier")
            },
            x: [0.5, 0.0, 3.0, 0.0],
            limit: 2.0,
            status: Status::Infeasible,
            u: [-2.0, 0.0],
            violations: vec![8.0],
        },
    ]
}

#[test]
fn steps_that_cannot_be_met() {
    tell("| step | state | abs u ≤ | status | u | violation | steps not met | blocked by |");
    tell("|---|---|---|---|---|---|---|---|");
    for s in situations() {
        let built = s.filter.sampling(Sampling::Pointwise);
        let built =
            built.and_then(|b| b.bounds(&[-s.limit; 2], &[s.limit; 2])).and_then(FilterBuilder::build);
        let mut filter = built.expect("valid filter");
        let mut u = [f64::NAN; 2];
        let report = filter.step(0.0, &s.x, &[0.0; 2], &mut u).expect("right dimensions").clone();
        let violations: Vec<f64> = report.barriers.iter().map(|b| (-b.slack).max(0.0)).collect();
        let names: Vec<&str> = filter.barrier_names().collect();
        let of = |f: &dyn Fn(usize) -> String| {
            (0..names.len()).map(|i| format!("{}: {}", names[i], f(i))).collect::<Vec<_>>().join(", ")
        };
        tell(&format!(
            "| {} | {:?} | {} | {:?} | {u:?} | {} | {} | {} |",
            s.name,
            s.x,
            s.limit,
            report.status,
            of(&|i| format!("{}", violations[i])),
            of(&|i| report.barriers[i].unmet_steps.to_string()),
            of(&|i| report.barriers[i].blocked_by.map_or("-", |j| names[j]).to_owned()),
        ));
        assert_eq!(report.status, s.status, "{}", s.name);
        assert!(u.iter().zip(s.u).all(|(a, b)| (a - b).abs() <= ROUND_OFF), "{}: {u:?}", s.name);
        for (i, wanted) in s.violations.iter().enumerate() {
            assert!((violations[i] - wanted).abs() <= ROUND_OFF, "{}: {violations:?}", s.name);
        }
        for (b, violation) in report.barriers.iter().zip(&violations) {
            assert_eq!(b.unmet_steps > 0, *violation > ROUND_OFF, "{}: {report:?}", s.name);
            assert!(b.unmet_steps == 0 || !b.on_course, "{}: {report:?}", s.name);
        }
    }
}
