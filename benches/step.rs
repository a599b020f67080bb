//! Cost of one filter step and of its parts: `cargo bench --bench step`.
//!
//! The quadratic programme by itself: `programme.rs`. The states are on the way to the disc, where the row is active, so that every step solves its
//! quadratic programme.

#![allow(missing_docs, reason = "criterion_group! makes an undocumented function")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use punctual_core::barriers::DistanceDisc;
use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::{BarrierSettings, FilterBuilder, SafetyFilter, Status};
use punctual_core::lie::{self, Derivatives};
use punctual_core::plants::{Bicycle, PointMass, Unicycle};

/// A time and state at which the row is active after anchoring at the origin at time 0.
const T: f64 = 4.0;
const X: [f64; 4] = [15.0, 15.5, 0.8, 6.0];

fn disc() -> DistanceDisc {
    DistanceDisc::new([45.0, 45.0], 2.0, 2.0).expect("valid disc")
}

fn bicycle() -> Bicycle {
    Bicycle::new(10.0).expect("valid bicycle")
}

fn builder<P>(plant: P) -> FilterBuilder
where
    P: ControlAffine<4, 2> + Send + 'static,
{
    SafetyFilter::builder(4, 2)
        .barrier("goal", plant, disc(), BarrierSettings::within(10.0))
        .expect("valid settings")
}

/// Times `step` at one sample again and again.
fn bench_filter(c: &mut Criterion, name: &str, builder: FilterBuilder) {
    let mut filter = builder.build().expect("valid filter");
    let mut u = [0.0; 2];
    filter.step(0.0, &[0.0; 4], &[0.0; 2], &mut u).expect("right dimensions");
    let anchored = filter.state().clone();
    let report = filter.step(T, &X, &[0.0; 2], &mut u).expect("right dimensions");
    assert_eq!(report.status, Status::Filtered, "{name}");
    filter.restore(&anchored).expect("as many barriers");
    c.bench_function(name, |b| {
        b.iter(|| {
            let report = filter.step(black_box(T), black_box(&X), black_box(&[0.0; 2]), &mut u);
            report.expect("right dimensions").status
        });
    });
}

fn steps(c: &mut Criterion) {
    bench_filter(c, "step/point mass", builder(PointMass));
    bench_filter(c, "step/unicycle", builder(Unicycle));
    bench_filter(c, "step/bicycle", builder(bicycle()));
    let bounded = builder(bicycle()).bounds(&[-60.0, -20.0], &[60.0, 20.0]).expect("valid bounds");
    bench_filter(c, "step/bicycle, bounded", bounded);
    let two = builder(bicycle()).barrier("again", bicycle(), disc(), BarrierSettings::within(9.0));
    bench_filter(c, "step/bicycle, two barriers", two.expect("valid settings"));
}

fn jets(c: &mut Criterion) {
    let cases = [
        ("jets/point mass", lie::along(PointMass, disc(), 2)),
        ("jets/unicycle", lie::along(Unicycle, disc(), 2)),
        ("jets/bicycle", lie::along(bicycle(), disc(), 2)),
        ("jets/bicycle, order 8", lie::along(bicycle(), disc(), 8)),
    ];
    for (name, source) in cases {
        let source = source.expect("a relative degree in range");
        let mut out = Derivatives::ZERO;
        c.bench_function(name, |b| {
            b.iter(|| {
                source.evaluate(black_box(T), black_box(&X), &mut out);
                out.row[0]
            });
        });
    }
}

criterion_group!(benches, steps, jets);
criterion_main!(benches);
