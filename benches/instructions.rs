//! Repeats one piece of work a given number of times, for benches/instructions.sh to count:
//! `instructions CASE TIMES`. Without arguments: every case once.

use std::sync::Arc;

use std::hint::black_box;

use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::{FilterBuilder, Sampling};
use punctual_core::lie::{self, DerivativeSource, Derivatives};
use punctual_core::plants::{Bicycle, PointMass, Unicycle};
use punctual_core::qp::{Bounds, Outcome, Problem, Row, Workspace};
use punctual_cosim::coupling::{InProcess, Own, Simulation, System, alone};
use punctual_fmu::configuration::{Configuration, FilterConfiguration};
use support::{
    ByHand, Drive, Integrators, SAFE, T, X, anchored, disc, goal, goal_and_obstacles, obstructed, promise,
};

mod support;

/// A name and the work, to be done a number of times.
type Case = (&'static str, fn(u32));

const CASES: [Case; 34] = [
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
    // The default: the constraint over the measured period, along a closed loop.
    ("held-point-mass-1ms", |times| held(PointMass, 0, 1.0e-3, times)),
    ("held-point-mass-10ms", |times| held(PointMass, 0, 10.0e-3, times)),
    ("held-point-mass-50ms", |times| held(PointMass, 0, 50.0e-3, times)),
    ("held-point-mass-1ms-10", |times| held(PointMass, 10, 1.0e-3, times)),
    ("held-point-mass-10ms-10", |times| held(PointMass, 10, 10.0e-3, times)),
    ("held-point-mass-50ms-10", |times| held(PointMass, 10, 50.0e-3, times)),
    ("held-unicycle-1ms", |times| held(Unicycle, 0, 1.0e-3, times)),
    ("held-unicycle-10ms", |times| held(Unicycle, 0, 10.0e-3, times)),
    ("held-unicycle-50ms", |times| held(Unicycle, 0, 50.0e-3, times)),
    ("held-unicycle-1ms-10", |times| held(Unicycle, 10, 1.0e-3, times)),
    ("held-unicycle-10ms-10", |times| held(Unicycle, 10, 10.0e-3, times)),
    ("held-unicycle-50ms-10", |times| held(Unicycle, 10, 50.0e-3, times)),
    ("held-bicycle-1ms", |times| held(bicycle(), 0, 1.0e-3, times)),
    ("held-bicycle-10ms", |times| held(bicycle(), 0, 10.0e-3, times)),
    ("held-bicycle-50ms", |times| held(bicycle(), 0, 50.0e-3, times)),
    ("held-bicycle-1ms-10", |times| held(bicycle(), 10, 1.0e-3, times)),
    ("held-bicycle-10ms-10", |times| held(bicycle(), 10, 10.0e-3, times)),
    ("held-bicycle-50ms-10", |times| held(bicycle(), 10, 50.0e-3, times)),
    ("batch-row", batch_row),
    // On the way to the set, and inside.
    ("campaign-step", |times| campaign_step([45.0; 2], times)),
    ("campaign-step-inside", |times| campaign_step([0.0; 2], times)),
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

fn bicycle() -> Bicycle {
    Bicycle::new(10.0).expect("valid bicycle")
}

fn held<P: ControlAffine<4, 2> + Copy + Send + Sync + 'static>(
    plant: P,
    obstacles: usize,
    period: f64,
    times: u32,
) {
    let builder = obstructed(plant, obstacles).sampling(Sampling::default()).expect("valid settings");
    let mut drive = Drive::recorded(builder, &plant, period);
    for _ in 0..times {
        black_box(drive.step());
    }
}

/// The filter of a unicycle, which starts at the origin, with one goal, as a file describes it.
fn described(centre: [f64; 2], stop_time: f64) -> FilterConfiguration {
    let text = format!(
        "kind = \"filter\"\nplant = {{ model = \"unicycle\" }}\n\
         experiment = {{ step_size = 0.001, stop_time = {stop_time:?} }}\n\
         [[barrier]]\nname = \"goal\"\ncentre = {centre:?}\nradius = 2.0\ndeadline = 10.0\nmargin = 0.02\n"
    );
    let configuration = Configuration::parse(&text);
    match configuration.expect("a valid configuration") {
        Configuration::Filter(filter) => filter,
        _ => unreachable!("the kind is a filter"),
    }
}

/// What a row of `punctual.FilterBatch` costs without Python: its memory goes into a loop and back.
fn batch_row(times: u32) {
    const ROWS: usize = 10;
    let mut own = described([45.0; 2], 1.0).build_loop().expect("a filter");
    let mut memories = vec![own.state().clone(); ROWS];
    let mut u = [0.0; 2];
    for i in 0..times as usize {
        let (row, sample) = (i % ROWS, i / ROWS);
        let t = 0.001 * sample as f64;
        let x = [6.0 * t, 0.1 * row as f64, 0.8, 6.0];
        own.restore(&memories[row]).expect("its own memory");
        own.step(black_box(t), black_box(&x), &[0.0; 2], &mut u).expect("right dimensions");
        memories[row].clone_from(own.state());
    }
}

/// So many steps of a filter and its plant in process, recorded as campaigns do.
fn campaign_step(centre: [f64; 2], times: u32) {
    let filter = Configuration::Filter(described(centre, 0.001 * f64::from(times)));
    let (text, configurations) = alone(filter).expect("a filter that runs alone");
    let signals = ["status", "u.a", "u.omega"].map(|name| format!("filter.{name}"));
    let system = System::parse(&text).expect("a valid system").recording(signals.to_vec());
    let models: Vec<_> = configurations.into_iter().map(|c| Own::new(c).expect("a product")).collect();
    let descriptions: Vec<_> = models.iter().map(|model| &model.description).collect();
    let instance = |c: usize| models[c].instance("it");
    let mut simulation: Simulation<InProcess> =
        Simulation::assembled(&system, &descriptions, instance).expect("a simulation");
    let outcome = simulation.run_unrecorded(|_, row| _ = black_box(row)).expect("a run");
    assert_eq!(outcome.statistics.steps, u64::from(times));
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
        lie::along(Arc::new(Integrators::<NX>), disc(), n).expect("a relative degree in range");
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
