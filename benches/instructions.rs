//! Repeats one piece of work a given number of times, for benches/instructions.sh to count:
//! `instructions CASE TIMES`. Without arguments: every case once.

use std::hint::black_box;

use punctual_core::filter::FilterBuilder;
use punctual_core::lie::{self, DerivativeSource, Derivatives};
use punctual_core::qp::{Bounds, Outcome, Problem, Row, Workspace};
use punctual_reference::plants::{PointMass, Unicycle};
use support::{ByHand, Integrators, SAFE, T, X, anchored, disc, goal, goal_and_obstacles, promise};

mod support;

/// A name and the work, to be done a number of times.
type Case = (&'static str, fn(u32));

const CASES: [Case; 13] = [
    ("by-hand", by_hand),
    ("step-point-mass", |times| step(goal(PointMass), [0.0; 2], times)),
    ("step-unicycle", |times| step(goal(Unicycle), [0.0; 2], times)),
    ("step-10-obstacles", |times| step(goal_and_obstacles(10), SAFE, times)),
    ("step-60-obstacles", |times| step(goal_and_obstacles(60), SAFE, times)),
    // Two rows active of eleven; the second alternates between two such answers.
    ("qp-same", |times| qp([[0.1, -0.2]; 2], times)),
    ("qp-other", |times| qp([[0.1, -0.2], [8.0, 9.0]], times)),
    ("jets-2", |times| jets::<4>(2, times)),
    ("jets-4", |times| jets::<8>(4, times)),
    ("jets-8", |times| jets::<16>(8, times)),
    ("promise-2", |times| advance(2, times)),
    ("promise-4", |times| advance(4, times)),
    ("promise-8", |times| advance(8, times)),
];

fn by_hand(times: u32) {
    let filter = ByHand::anchored();
    for _ in 0..times {
        black_box(filter.step(black_box(T), black_box(&X), black_box(&[0.0; 2])));
    }
}

fn step(builder: FilterBuilder, u_ref: [f64; 2], times: u32) {
    let mut filter = anchored(builder);
    let mut u = [0.0; 2];
    for _ in 0..times {
        let report = filter.step(black_box(T), black_box(&X), black_box(&u_ref), &mut u);
        assert!(report.expect("right dimensions").status.is_satisfied());
    }
}

/// Solves for the references in turn.
fn qp(references: [[f64; 2]; 2], times: u32) {
    let row = |normal: [f64; 2], floor: f64| {
        let mut row = Row { floor, ..Row::ZERO };
        row.normal[..2].copy_from_slice(&normal);
        row
    };
    let mut rows = vec![row([0.7, 0.3], 0.8), row([-0.2, 1.0], 0.5)];
    rows.push(row([-0.7, -0.1], -4.0));
    rows.push(row([0.2, -0.9], -4.0));
    rows.extend((0..7_u8).map(f64::from).map(|angle| row([angle.cos(), angle.sin()], -30.0)));
    let (mut workspace, mut u) = (Workspace::default(), [0.0; 2]);
    for i in 0..times {
        let u_ref = references[i as usize % 2];
        let p = Problem::new(black_box(&rows), &Bounds::NONE, black_box(&u_ref), 1e6);
        let solution = workspace.solve(&p, &mut u);
        assert!(solution.outcome == Outcome::Optimal && workspace.active().len() == 2);
    }
}

fn jets<const NX: usize>(n: usize, times: u32) {
    let source: Box<dyn DerivativeSource> =
        lie::along(Integrators::<NX>, disc(), n).expect("a relative degree in range");
    let (x, mut out) = (Integrators::<NX>::state(), Derivatives::ZERO);
    for _ in 0..times {
        source.evaluate(black_box(T), black_box(&x), &mut out);
        black_box(&out);
    }
}

fn advance(n: usize, times: u32) {
    let (promise, mut state, h) = promise(n);
    for _ in 0..times {
        black_box(promise.advance(black_box(&mut state), black_box(T), black_box(&h[..n])));
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match &arguments[..] {
        [case, times] => {
            let (_, work) = CASES.iter().find(|(name, _)| name == case).expect("a case of the list");
            work(times.parse().expect("a number of times"));
        }
        // Cargo passes options of its own.
        _ => CASES.iter().for_each(|(_, work)| work(1)),
    }
}
