//! Cost of the quadratic program by itself: `cargo bench --bench qp`.

#![allow(missing_docs, reason = "criterion_group! makes an undocumented function")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use punctual_core::qp::{Bounds, Outcome, Problem, Row, Workspace};

fn row(normal: [f64; 2], floor: f64) -> Row {
    let mut row = Row { floor, ..Row::ZERO };
    row.normal[..2].copy_from_slice(&normal);
    row
}

/// A row that u_ref violates, and `others` that hold there and at the answer.
fn goal_and(others: usize) -> Vec<Row> {
    let around = |k: usize| {
        let angle = k as f64;
        row([angle.cos(), angle.sin()], -3.0 - angle)
    };
    std::iter::once(row([0.7, 0.3], 0.8)).chain((0..others).map(around)).collect()
}

fn programs(c: &mut Criterion) {
    let mut bounds = Bounds::NONE;
    bounds.min[..2].fill(-1.25);
    bounds.max[..2].fill(1.25);
    let mut tight = bounds;
    tight.max[0] = 0.9;
    let two = vec![row([0.7, 0.3], 0.8), row([-0.2, 1.0], 0.5)];
    let contradictory = vec![row([1.0, 0.1], 2.0), row([-1.0, 0.0], 0.5)];
    let cases = [
        ("one row", goal_and(0), Bounds::NONE),
        ("one row, bounds", goal_and(0), bounds),
        ("two rows", two.clone(), Bounds::NONE),
        ("two rows, bounds", two.clone(), bounds),
        ("one row of two, a bound active", vec![two[0], row([1.0, 0.0], -1.0)], tight),
        ("1 + 10 rows", goal_and(10), Bounds::NONE),
        ("1 + 10 rows, bounds", goal_and(10), bounds),
        ("60 rows", goal_and(59), Bounds::NONE),
        ("60 rows, bounds", goal_and(59), bounds),
        ("infeasible, bounds", contradictory, bounds),
    ];
    let u_ref = [0.1, -0.2];
    let mut workspace = Workspace::new();
    for (name, rows, bounds) in &cases {
        let mut u = [0.0; 2];
        let outcome = workspace.solve(&Problem::new(rows, bounds, &u_ref, 1e6), &mut u).outcome;
        let wanted = if name.starts_with("infeasible") { Outcome::Infeasible } else { Outcome::Optimal };
        assert_eq!(outcome, wanted, "{name}");
        c.bench_function(&format!("qp/{name}"), |b| {
            b.iter(|| {
                let p = Problem::new(black_box(rows), bounds, black_box(&u_ref), 1e6);
                workspace.solve(&p, &mut u).iterations
            });
        });
    }
    let (_, rows, bounds) = &cases[3];
    let p = Problem::new(rows, bounds, &u_ref, 1e6);
    let mut u = [0.0; 2];
    workspace.solve(&p, &mut u);
    c.bench_function("qp/residuals", |b| b.iter(|| workspace.residuals(&p, black_box(&u))));
}

criterion_group!(benches, programs);
criterion_main!(benches);
