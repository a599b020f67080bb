//! How much of the promise survives where the plant is another bicycle than the filter's, and what restores it.

use punctual_core::dynamics::{DynPlant, Erased};
use punctual_core::filter::{BarrierSettings, FilterBuilder, Integrator, SafetyFilter, Sampling};
use punctual_reference::plants::{Bicycle, KinematicBicycle, SmallSlipBicycle, Steering};

use super::distance;
use super::starts::{DEADLINE, starts};

/// Largest acceleration in m/s², and largest rate of the slip or steering angle in rad/s.
const ACCELERATION: f64 = 40.0;
const RATE: f64 = 4.0;

/// How fast the angle follows what is wanted, which is 0, in 1/s.
const GAIN: f64 = 2.0;

/// A vehicle.
#[derive(Clone, Copy, Debug)]
struct Vehicle {
    /// Distance of either axle from the centre of mass, in m.
    length: f64,
    /// Largest slip angle in rad.
    slip: f64,
}

/// It turns on a circle of 3 m; a steering angle of 0.83 rad.
const CAR: Vehicle = Vehicle { length: 1.5, slip: 0.5 };

/// The paper's, on a circle of 20 m.
const LONG: Vehicle = Vehicle { length: 10.0, slip: 0.5 };

/// The same with a steering angle of 1.38 rad, on a circle of 8.3 m.
const AGILE: Vehicle = Vehicle { length: 10.0, slip: 1.2 };

impl Vehicle {
    fn simplified(self) -> Bicycle {
        Bicycle::new(self.length).expect("a valid bicycle")
    }

    fn small_slip(self) -> SmallSlipBicycle {
        SmallSlipBicycle::new(self.length).expect("a valid bicycle")
    }

    fn kinematic(self) -> KinematicBicycle {
        KinematicBicycle::new(self.length, self.length).expect("a valid bicycle")
    }

    /// The plants whose input is the slip angle.
    fn plants(self) -> [(&'static str, Box<dyn DynPlant>); 3] {
        [
            ("simplified", Box::new(Erased(self.simplified()))),
            ("small slip", Box::new(Erased(self.small_slip()))),
            ("kinematic", Box::new(self.kinematic().steered(Steering::SlipAngle))),
        ]
    }
}

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

fn controlled(vehicle: Vehicle, model: Model, remedy: Remedy, step: f64) -> Controlled {
    let settings = BarrierSettings {
        rate: Some(remedy.rate),
        stay_rate: Some(remedy.rate),
        margin: remedy.margin,
        disturbance: remedy.disturbance,
        ..BarrierSettings::within(DEADLINE)
    };
    let (states, second) = if model == Model::Simplified { (4, vehicle.slip) } else { (5, RATE) };
    let builder = SafetyFilter::builder(states, 2);
    let filter = match model {
        Model::Simplified => builder.barrier("goal", vehicle.simplified(), distance(), settings),
        Model::SmallSlip => builder.barrier("goal", vehicle.small_slip().with_rate(), distance(), settings),
        Model::Kinematic => builder.barrier("goal", vehicle.kinematic(), distance(), settings),
    };
    let filter = filter
        .and_then(|b| b.sampling(Sampling::Measured { first: Some(step) }))
        .and_then(|b| b.bounds(&[-ACCELERATION, -second], &[ACCELERATION, second]))
        .and_then(FilterBuilder::build)
        .expect("a valid filter");
    let limit = match model {
        Model::Kinematic => vehicle.kinematic().steering_angle(vehicle.slip),
        _ => vehicle.slip,
    };
    let angle = (model != Model::Simplified)
        .then(|| Integrator::new(&filter, (4, 1), [-limit, limit], GAIN).expect("a valid integrator"));
    Controlled { filter, angle }
}

/// What the runs came to.
#[derive(Clone, Copy, Debug, Default)]
struct Outcome {
    on_time: usize,
    /// Inside at every sample from the deadline to 2T.
    inside: usize,
    /// Least h at these samples, in m.
    least: f64,
    /// Runs in which a step before the deadline was not satisfied: what is promised there is nothing.
    unmet: usize,
    /// Largest |a| of half of the runs, in m/s².
    peak: f64,
}

/// From these starts, a filter for `model` and the plant `plant`, whose second input is the angle of the filter.
fn runs(
    (vehicle, model, remedy): (Vehicle, Model, Remedy),
    plant: &dyn DynPlant,
    step: f64,
    starts: &[[f64; 4]],
) -> Outcome {
    let mut outcome = Outcome { least: f64::INFINITY, ..Outcome::default() };
    let mut peaks = Vec::new();
    for start in starts {
        let Controlled { mut filter, mut angle } = controlled(vehicle, model, remedy, step);
        let (mut x, mut u) = (*start, [0.0; 2]);
        let (mut on_time, mut least, mut unmet) = (false, f64::INFINITY, false);
        let mut peak = 0.0_f64;
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
            unmet |= t < DEADLINE && !report.status.is_satisfied();
            peak = peak.max(u[0].abs());
            plant.rk4_step(&mut x, &u, step).expect("a valid step");
        }
        outcome.on_time += usize::from(on_time);
        outcome.inside += usize::from(least >= 0.0);
        outcome.unmet += usize::from(unmet);
        outcome.least = outcome.least.min(least);
        peaks.push(peak);
    }
    peaks.sort_by(f64::total_cmp);
    outcome.peak = peaks[(peaks.len() - 1) / 2];
    outcome
}

/// With the car nothing is lost by the model: the promise of a filter for the simplified bicycle holds on the finer
/// plants too, with the margin, and so does that of filters that know them and integrate the angle themselves.
#[test]
fn a_car_is_kept_by_whichever_model() {
    let starts = &starts()[..20];
    let kept = |outcome: Outcome| (outcome.on_time, outcome.inside) == (starts.len(), starts.len());
    for (name, plant) in CAR.plants() {
        let found = runs((CAR, Model::Simplified, NONE), &*plant, 0.01, starts);
        assert!(kept(found) && found.least >= 0.0, "simplified on {name}: {found:?}");
        if name != "simplified" {
            let found = runs((CAR, Model::SmallSlip, NONE), &*plant, 0.01, starts);
            assert!(kept(found), "small slip on {name}: {found:?}");
        }
    }
    let steered = CAR.kinematic().steered(Steering::Angle);
    let found = runs((CAR, Model::Kinematic, NONE), &steered, 0.01, starts);
    assert!(kept(found), "kinematic on kinematic: {found:?}");
}

/// The table of the documentation: of 100 starts (in `tests/nightly`, else one) on time, inside, least h, with an unmet
/// step, median peak.
#[test]
#[allow(clippy::print_stdout, reason = "the figures of the documentation")]
fn table_of_bicycles() {
    let all = std::env::var_os("PUNCTUAL_TABLES").is_some();
    let starts = &starts()[..if all { 100 } else { 1 }];
    let remedies = [
        ("none", NONE),
        ("margin 0.5 m", Remedy { margin: 0.5, ..NONE }),
        ("rate 10/s", Remedy { rate: 10.0, ..NONE }),
        ("disturbance 5 m/s2", Remedy { disturbance: 5.0, ..NONE }),
    ];
    for (step, remedies) in [(0.01, &remedies[..]), (0.001, &remedies[..1])] {
        for vehicle in [CAR, LONG, AGILE] {
            let row = |what: &str, name: &str, found: Outcome| {
                let Outcome { on_time, inside, least, unmet, peak } = found;
                println!(
                    "{step} {vehicle:?} {what} on {name}: {on_time} {inside} {least:.3} {unmet} {peak:.1}"
                );
            };
            for (name, plant) in vehicle.plants() {
                for (remedy, settings) in remedies {
                    let found = runs((vehicle, Model::Simplified, *settings), &*plant, step, starts);
                    row(&format!("simplified, {remedy}"), name, found);
                }
                row("small slip", name, runs((vehicle, Model::SmallSlip, NONE), &*plant, step, starts));
            }
            let steered = vehicle.kinematic().steered(Steering::Angle);
            row("kinematic", "kinematic", runs((vehicle, Model::Kinematic, NONE), &steered, step, starts));
        }
    }
}
