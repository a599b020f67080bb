//! How much of the promise survives where the plant is another bicycle than the filter's, and what restores it.

use punctual_core::dynamics::{DynPlant, Erased};
use punctual_core::filter::{BarrierSettings, FilterBuilder, Integrator, SafetyFilter, Sampling};
use punctual_core::plants::{Bicycle, KinematicBicycle, SmallSlipBicycle, Steering};

use super::distance;
use super::starts::{DEADLINE, starts};

/// A car: the distance of the axles from the centre of mass in m, the largest slip angle in rad (a steering angle of
/// 0.83 rad), the largest acceleration in m/s² and the largest rate of either angle in rad/s.
const LENGTH: f64 = 1.5;
const SLIP: f64 = 0.5;
const ACCELERATION: f64 = 40.0;
const RATE: f64 = 4.0;

/// The bicycle that a filter believes in.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Model {
    Simplified,
    SmallSlip,
    Kinematic,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Remedy {
    margin: f64,
    rate: f64,
    disturbance: f64,
}

const NONE: Remedy = Remedy { margin: 0.02, rate: 5.0, disturbance: 0.0 };

/// A filter, with the angle that it integrates itself.
struct Controlled {
    filter: SafetyFilter,
    angle: Option<Integrator>,
}

fn kinematic() -> KinematicBicycle {
    KinematicBicycle::new(LENGTH, LENGTH).expect("a valid bicycle")
}

fn small_slip() -> SmallSlipBicycle {
    SmallSlipBicycle::new(LENGTH).expect("a valid bicycle")
}

/// The largest angle that steers: δ for the kinematic bicycle, β for the others.
fn largest(model: Model) -> f64 {
    if model == Model::Kinematic { kinematic().steering_angle(SLIP) } else { SLIP }
}

fn controlled(model: Model, remedy: Remedy, step: f64) -> Controlled {
    let settings = BarrierSettings {
        rate: Some(remedy.rate),
        stay_rate: Some(remedy.rate),
        margin: remedy.margin,
        disturbance: remedy.disturbance,
        ..BarrierSettings::within(DEADLINE)
    };
    let (states, second) = if model == Model::Simplified { (4, SLIP) } else { (5, RATE) };
    let builder = SafetyFilter::builder(states, 2);
    let filter = match model {
        Model::Simplified => {
            let bicycle = Bicycle::new(LENGTH).expect("a valid bicycle");
            builder.barrier("goal", bicycle, distance(), settings)
        }
        Model::SmallSlip => builder.barrier("goal", small_slip().with_rate(), distance(), settings),
        Model::Kinematic => builder.barrier("goal", kinematic(), distance(), settings),
    };
    let filter = filter
        .and_then(|b| b.sampling(Sampling::Measured { first: Some(step) }))
        .and_then(|b| b.bounds(&[-ACCELERATION, -second], &[ACCELERATION, second]))
        .and_then(FilterBuilder::build)
        .expect("a valid filter");
    let limit = largest(model);
    let angle = (model != Model::Simplified)
        .then(|| Integrator::new(&filter, (4, 1), [-limit, limit], 10.0).expect("a valid integrator"));
    Controlled { filter, angle }
}

/// What 100 runs came to.
#[derive(Clone, Copy, Debug, Default)]
struct Outcome {
    on_time: usize,
    /// Inside at every sample from the deadline to 2T.
    inside: usize,
    /// Least h at these samples, in m.
    least: f64,
    /// Runs with a step that was not satisfied.
    unmet: usize,
    /// Largest |a| of half of the runs, in m/s².
    peak: f64,
    /// Largest |β| of half of the runs, in rad.
    slip: f64,
}

/// From these starts, a filter for `model` and the plant `plant`, whose second input is the angle of the filter.
fn runs(model: Model, plant: &dyn DynPlant, remedy: Remedy, step: f64, starts: &[[f64; 4]]) -> Outcome {
    let mut outcome = Outcome { least: f64::INFINITY, ..Outcome::default() };
    let (mut peaks, mut slips) = (Vec::new(), Vec::new());
    for start in starts {
        let Controlled { mut filter, mut angle } = controlled(model, remedy, step);
        let (mut x, mut u) = (*start, [0.0; 2]);
        let (mut on_time, mut least, mut unmet) = (false, f64::INFINITY, false);
        let (mut peak, mut slip) = (0.0_f64, 0.0_f64);
        for k in 0..=(2.0 * DEADLINE / step).round() as usize {
            let t = k as f64 * step;
            let u_ref = [-x[3], 0.0];
            let report = match &mut angle {
                Some(angle) => angle.step(&mut filter, t, step, &x, &u_ref, &mut u),
                None => filter.step(t, &x, &u_ref, &mut u),
            };
            let report = report.expect("a valid sample");
            let h = report.barriers[0].h;
            // Half a step, so that round-off in t cannot move the sample at the deadline.
            on_time |= h >= 0.0 && t < DEADLINE + step / 2.0;
            if t > DEADLINE - step / 2.0 {
                least = least.min(h);
            }
            unmet |= !report.status.is_satisfied();
            peak = peak.max(u[0].abs());
            slip = slip.max(u[1].abs());
            plant.rk4_step(&mut x, &u, step).expect("a valid step");
        }
        outcome.on_time += usize::from(on_time);
        outcome.inside += usize::from(least >= 0.0);
        outcome.unmet += usize::from(unmet);
        outcome.least = outcome.least.min(least);
        peaks.push(peak);
        slips.push(if model == Model::Kinematic { kinematic().slip_angle(slip) } else { slip });
    }
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[(values.len() - 1) / 2]
    };
    (outcome.peak, outcome.slip) = (median(peaks), median(slips));
    outcome
}

fn plants() -> [(&'static str, Box<dyn DynPlant>); 3] {
    let simplified = Bicycle::new(LENGTH).expect("a valid bicycle");
    [
        ("simplified", Box::new(Erased(simplified))),
        ("small slip", Box::new(Erased(small_slip()))),
        ("kinematic", Box::new(kinematic().steered(Steering::SlipAngle))),
    ]
}

#[test]
#[allow(clippy::print_stdout, reason = "the figures of the documentation")]
fn table_of_bicycles_and_models() {
    let starts = starts();
    let remedies = [
        NONE,
        Remedy { margin: 0.2, ..NONE },
        Remedy { margin: 0.5, ..NONE },
        Remedy { margin: 1.0, ..NONE },
        Remedy { rate: 2.0, ..NONE },
        Remedy { rate: 10.0, ..NONE },
        Remedy { rate: 20.0, ..NONE },
        Remedy { disturbance: 5.0, ..NONE },
        Remedy { disturbance: 10.0, ..NONE },
        Remedy { disturbance: 20.0, ..NONE },
        Remedy { margin: 0.5, rate: 10.0, ..NONE },
    ];
    for step in [0.01, 0.001] {
        for (name, plant) in plants() {
            for remedy in remedies {
                let found = runs(Model::Simplified, &*plant, remedy, step, &starts);
                println!("{step} simplified on {name} {remedy:?}: {found:?}");
            }
            let found = runs(Model::SmallSlip, &*plant, NONE, step, &starts);
            println!("{step} small slip on {name}: {found:?}");
        }
        let steered = kinematic().steered(Steering::Angle);
        let found = runs(Model::Kinematic, &steered, NONE, step, &starts);
        println!("{step} kinematic on kinematic: {found:?}");
    }
}
