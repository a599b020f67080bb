//! Cost of the C interface in a step: `cargo bench --bench abi`.
//!
//! The same filter, from the same configuration, runs once in process (`Filter::step`) and through the
//! shared library as an importer loads it, once by FMI 2.0 and once by FMI 3.0 with arrays. Steps are of about 1 ms on the way to the disc, where the row is
//! active. After a thousand of them both go back to their first state, which costs a thousandth of it. "doStep
//! adds" is the difference to the filter in process, measured in turns, so that a busy machine slows both. "instantiate"
//! is a new instance and its end.

#![allow(missing_docs, reason = "criterion_group! makes an undocumented function")]

use std::fmt::Write as _;
use std::hint::black_box;
use std::time::{Duration, Instant};

use api::{API, three};
use criterion::{Criterion, criterion_group, criterion_main};
use fmu::Fmu;
use punctual_core::filter::{Filter, FilterState};
use slave::Slave;
use support::{SAFE, T, X};

#[path = "../tests/abi/api.rs"]
#[allow(dead_code, reason = "a benchmark uses a part")]
mod api;
#[path = "../tests/abi/fmu.rs"]
#[allow(dead_code, reason = "a benchmark uses a part")]
mod fmu;
#[path = "../tests/abi/slave.rs"]
#[allow(dead_code, reason = "a benchmark uses a part")]
mod slave;
#[path = "../tests/abi/fmi3/slave.rs"]
#[allow(dead_code, reason = "a benchmark uses a part")]
mod slave3;
mod support;

/// The step size in s, 2⁻¹⁰ so that times are exact, and the number of steps from [`T`] on until both go back.
const H: f64 = 0.000_976_562_5;
const STEPS: u32 = 1000;
/// Steps of one turn in the difference: some tenths of a millisecond.
const TURN: u64 = 500;

/// A point mass on the way to the disc, with a box or obstacles beside the way.
fn configuration(sampling: &str, bounded: bool, obstacles: usize) -> String {
    let bounds = if bounded { "bounds = { u_x = [-60.0, 60.0], u_y = [-60.0, 60.0] }\n" } else { "" };
    let mut text = format!(
        "kind = \"filter\"\nsampling = \"{sampling}\"\n{bounds}plant.model = \"point_mass\"\n\
         experiment.step_size = {H:?}\n[[barrier]]\nname = \"goal\"\ncentre = [45.0, 45.0]\nradius = 2.0\n\
         deadline = 10.0\n"
    );
    for i in 0..obstacles {
        let (x, y) = (-20.0 + 8.0 * (i % 10) as f64, 60.0 + 8.0 * (i / 10) as f64);
        let _ = write!(
            text,
            "[[barrier]]\nname = \"o{i}\"\nshape = \"obstacle\"\ncentre = [{x:?}, {y:?}]\nradius = 2.0\n\
             deadline = 10.0\n"
        );
    }
    text
}

/// The filter in process, and the state it goes back to.
struct Plain {
    filter: Filter,
    start: FilterState,
    u_ref: [f64; 2],
    u: [f64; 2],
    k: u32,
}

impl Plain {
    fn new(fmu: &Fmu, u_ref: [f64; 2]) -> Self {
        let mut filter = fmu.filter().build().expect("a valid filter");
        let mut u = [0.0; 2];
        filter.step(0.0, &[0.0; 4], &[0.0; 2], &mut u).expect("right dimensions");
        filter.step(T - H, &X, &u_ref, &mut u).expect("right dimensions");
        let start = filter.state().clone();
        Self { filter, start, u_ref, u, k: 0 }
    }

    fn step(&mut self) {
        if self.k == STEPS {
            self.filter.restore(&self.start).expect("as many barriers");
            self.k = 0;
        }
        let t = T + H * f64::from(self.k);
        self.k += 1;
        let report = self.filter.step(black_box(t), black_box(&X), black_box(&self.u_ref), &mut self.u);
        black_box(report.expect("right dimensions").status);
    }
}

/// The communication point after `k` steps, which is counted on; after all of them `back` goes back to the first.
fn next(k: &mut u32, back: impl FnOnce()) -> f64 {
    if *k == STEPS {
        back();
        *k = 0;
    }
    *k += 1;
    T + H * f64::from(*k - 1)
}

/// The filter behind the shared library, and the state it goes back to.
struct Shared<'a> {
    slave: Slave<'a>,
    start: api::State,
    inputs: [f64; 6],
    outputs: [u32; 2],
    k: u32,
}

impl<'a> Shared<'a> {
    fn new(fmu: &'a Fmu, u_ref: [f64; 2]) -> Self {
        let slave = Slave::ready(fmu);
        slave.set_inputs(&[0.0; 6]);
        slave.step(0.0, T - H);
        let inputs = [X[0], X[1], X[2], X[3], u_ref[0], u_ref[1]];
        slave.set_inputs(&inputs);
        slave.step(T - H, H);
        let (start, outputs) = (slave.state(), ["u.u_x", "u.u_y"].map(|name| fmu.reference(name)));
        Self { slave, start, inputs, outputs, k: 0 }
    }

    /// The next communication point.
    fn time(&mut self) -> f64 {
        next(&mut self.k, || self.slave.restore(self.start))
    }

    fn step(&mut self) {
        let t = self.time();
        self.slave.step(black_box(t), H);
    }

    /// Makes a cycle of an importer: inputs, step, outputs.
    fn cycle(&mut self) -> [f64; 2] {
        let t = self.time();
        let (component, references) = (self.slave.component, [0, 1, 2, 3, 4, 5]);
        self.slave.ok((API.set_real)(component, references.as_ptr(), 6, black_box(self.inputs.as_ptr())));
        self.slave.step(t, H);
        let mut u = [0.0; 2];
        self.slave.ok((API.get_real)(component, self.outputs.as_ptr(), 2, u.as_mut_ptr()));
        u
    }
}

/// The filter behind the functions of FMI 3.0.
struct Arrays<'a> {
    slave: slave3::Slave<'a>,
    start: api::State,
    inputs: [f64; 6],
    /// The references of `x` and `u_ref`, and of `u`.
    references: ([u32; 2], u32),
    k: u32,
}

impl<'a> Arrays<'a> {
    fn new(fmu: &'a Fmu, u_ref: [f64; 2]) -> Self {
        let slave = slave3::Slave::ready(fmu);
        slave.set_inputs(&[0.0; 6]);
        slave.step(0.0, T - H);
        let inputs = [X[0], X[1], X[2], X[3], u_ref[0], u_ref[1]];
        slave.set_inputs(&inputs);
        slave.step(T - H, H);
        let [x, u_ref, u] = ["x", "u_ref", "u"].map(|name| fmu.item(name).reference());
        let start = slave.state();
        Self { slave, start, inputs, references: ([x, u_ref], u), k: 0 }
    }

    /// The next communication point.
    fn time(&mut self) -> f64 {
        let Self { slave, start, k, .. } = self;
        next(k, || slave.ok((three::API.set_state)(slave.instance, *start)))
    }

    fn step(&mut self) {
        let t = self.time();
        self.slave.step(black_box(t), H);
    }

    /// Makes a cycle of an importer: inputs, step, outputs.
    fn cycle(&mut self) -> [f64; 2] {
        let t = self.time();
        let (instance, (inputs, output)) = (self.slave.instance, self.references);
        let values = black_box(self.inputs.as_ptr());
        self.slave.ok((three::API.set_float64)(instance, inputs.as_ptr(), 2, values, 6));
        self.slave.step(t, H);
        let mut u = [0.0; 2];
        self.slave.ok((three::API.get_float64)(instance, &raw const output, 1, u.as_mut_ptr(), 2));
        u
    }
}

/// The time that `step` takes longer than `plain`, over `n` steps in turns.
fn added(n: u64, mut step: impl FnMut(), mut plain: impl FnMut()) -> Duration {
    let (mut with, mut without) = (Duration::ZERO, Duration::ZERO);
    for done in (0..n).step_by(TURN as usize) {
        let turn = TURN.min(n - done);
        with += timed(turn, &mut step);
        without += timed(turn, &mut plain);
    }
    with.saturating_sub(without)
}

fn timed(n: u64, mut work: impl FnMut()) -> Duration {
    let start = Instant::now();
    (0..n).for_each(|_| work());
    start.elapsed()
}

fn interface(c: &mut Criterion) {
    let sizes = [
        ("goal", false, 0, [0.0; 2]),
        ("goal, box", true, 0, [0.0; 2]),
        ("10 obstacles", false, 10, SAFE),
        ("60 obstacles", false, 60, SAFE),
    ];
    for sampling in ["pointwise", "measured"] {
        for (size, bounded, obstacles, u_ref) in sizes {
            let text = configuration(sampling, bounded, obstacles);
            let (fmu, of_fmi3) = (Fmu::new(&text), Fmu::of_fmi3(&text, true));
            let (mut plain, mut shared) = (Plain::new(&fmu, u_ref), Shared::new(&fmu, u_ref));
            let mut arrays = Arrays::new(&of_fmi3, u_ref);
            for _ in 0..=STEPS {
                plain.step();
                let bits = [shared.cycle(), arrays.cycle(), plain.u].map(|u| u.map(f64::to_bits));
                assert_eq!(bits, [bits[2]; 3], "{size}: the library and the filter in process differ");
            }
            let mut group = c.benchmark_group(format!("{size}, {sampling}"));
            group.bench_function("in process", |b| b.iter(|| plain.step()));
            group.bench_function("doStep", |b| b.iter(|| shared.step()));
            group.bench_function("set, doStep, get", |b| b.iter(|| shared.cycle()));
            group.bench_function("fmi3DoStep", |b| b.iter(|| arrays.step()));
            group.bench_function("set, fmi3DoStep, get", |b| b.iter(|| arrays.cycle()));
            group.bench_function("doStep adds", |b| {
                b.iter_custom(|n| added(n, || shared.step(), || plain.step()));
            });
            group.bench_function("fmi3DoStep adds", |b| {
                b.iter_custom(|n| added(n, || arrays.step(), || plain.step()));
            });
            group.bench_function("instantiate", |b| b.iter(|| drop(Slave::new(&fmu))));
            group.bench_function("instantiate, FMI 3.0", |b| b.iter(|| drop(slave3::Slave::new(&of_fmi3))));
        }
    }
}

criterion_group!(benches, interface);
criterion_main!(benches);
