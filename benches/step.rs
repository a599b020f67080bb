//! Cost of one filter step and of its parts: `cargo bench --bench step`.
//!
//! `qp.rs` measures the quadratic program by itself. The states are on the way to the disc, where the row is
//! active, so that every step solves its quadratic program. Those with obstacles are also measured from a
//! reference input that needs no solving. "by hand" is the computation of the first step, written out for that
//! one plant, barrier and order.

#![allow(missing_docs, reason = "criterion_group! makes an undocumented function")]

use std::sync::Arc;

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use punctual_core::filter::{BarrierSettings, FilterBuilder, Sampling, Status};
use punctual_core::lie::{self, Derivatives};
use punctual_core::plants::{Bicycle, PointMass, Unicycle};
use support::{ByHand, Integrators, SAFE, T, X, anchored, disc, goal, goal_and_obstacles, headed, promise};

mod support;

fn bicycle() -> Bicycle {
    Bicycle::new(10.0).expect("valid bicycle")
}

/// Times `step` at one sample again and again; `status` is its expected status.
fn bench_filter(c: &mut Criterion, name: &str, builder: FilterBuilder, u_ref: [f64; 2], status: Status) {
    let mut filter = anchored(builder);
    let start = filter.state().clone();
    let mut u = [0.0; 2];
    let report = filter.step(T, &X, &u_ref, &mut u).expect("right dimensions");
    assert_eq!(report.status, status, "{name}");
    filter.restore(&start).expect("as many barriers");
    c.bench_function(name, |b| {
        b.iter(|| {
            let report = filter.step(black_box(T), black_box(&X), black_box(&u_ref), &mut u);
            report.expect("right dimensions").status
        });
    });
}

fn steps(c: &mut Criterion) {
    let by_hand = ByHand::anchored();
    let mut u = [0.0; 2];
    anchored(goal(PointMass)).step(T, &X, &[0.0; 2], &mut u).expect("right dimensions");
    for (found, wanted) in by_hand.step(T, &X, &[0.0; 2]).iter().zip(u) {
        // A few dozen operations on numbers of order 10.
        assert!((found - wanted).abs() < 1e-12, "by hand {found}, by the filter {wanted}");
    }
    c.bench_function("step/by hand", |b| {
        b.iter(|| by_hand.step(black_box(T), black_box(&X), black_box(&[0.0; 2])));
    });

    let mut filtered = |name, builder| bench_filter(c, name, builder, [0.0; 2], Status::Filtered);
    filtered("step/point mass", goal(PointMass));
    filtered("step/unicycle", goal(Unicycle));
    filtered("step/bicycle", goal(bicycle()));
    let bounded = goal(bicycle()).bounds(&[-60.0, -20.0], &[60.0, 20.0]).expect("valid bounds");
    filtered("step/bicycle, bounded", bounded);
    let two = headed(bicycle()).barrier("again", disc(), BarrierSettings::within(9.0));
    filtered("step/bicycle, two barriers", two.expect("valid settings").erased());
    filtered("step/10 obstacles", goal_and_obstacles(10));
    filtered("step/60 obstacles", goal_and_obstacles(60));
    let boxed = |builder: FilterBuilder| builder.bounds(&[-200.0; 2], &[200.0; 2]).expect("valid bounds");
    filtered("step/point mass, box", boxed(goal(PointMass)));
    filtered("step/10 obstacles, box", boxed(goal_and_obstacles(10)));
    // The default: the constraint over the sampling period, with the state at its end predicted.
    let held = |builder: FilterBuilder| builder.sampling(Sampling::Period(0.001)).expect("valid period");
    filtered("step/point mass, over the period", held(goal(PointMass)));
    filtered("step/10 obstacles, over the period", held(goal_and_obstacles(10)));
    for (name, obstacles) in [("step/safe, 10 obstacles", 10), ("step/safe, 60 obstacles", 60)] {
        bench_filter(c, name, goal_and_obstacles(obstacles), SAFE, Status::Unchanged);
    }
}

fn jets(c: &mut Criterion) {
    let cases = [
        ("jets/point mass", lie::along(Arc::new(PointMass), disc(), 2), &X[..]),
        ("jets/unicycle", lie::along(Arc::new(Unicycle), disc(), 2), &X),
        ("jets/bicycle", lie::along(Arc::new(bicycle()), disc(), 2), &X),
        (
            "jets/integrators, order 2",
            lie::along(Arc::new(Integrators::<4>), disc(), 2),
            &Integrators::<4>::state(),
        ),
        (
            "jets/integrators, order 4",
            lie::along(Arc::new(Integrators::<8>), disc(), 4),
            &Integrators::<8>::state(),
        ),
        (
            "jets/integrators, order 8",
            lie::along(Arc::new(Integrators::<16>), disc(), 8),
            &Integrators::<16>::state(),
        ),
    ];
    for (name, source, x) in cases {
        let source = source.expect("a relative degree in range");
        let mut out = Derivatives::ZERO;
        c.bench_function(name, |b| {
            b.iter(|| {
                source.evaluate(black_box(T), black_box(x), &mut out);
                out.row[0]
            });
        });
    }
}

fn promises(c: &mut Criterion) {
    for (name, n) in [("promise/order 2", 2), ("promise/order 4", 4), ("promise/order 8", 8)] {
        let (promise, mut state, h) = promise(n);
        c.bench_function(name, |b| {
            b.iter(|| promise.advance(black_box(&mut state), black_box(T), black_box(&h[..n])));
        });
    }
}

criterion_group!(benches, steps, jets, promises);
criterion_main!(benches);
