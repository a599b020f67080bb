//! Compares two ways to keep the same deadline: the paper's repeated root on its quadratic disc, and the
//! reference profile on a distance-shaped one. Set, start and deadline are the same. The ways differ in the
//! effort, and in whether the deadline survives sampling.
//!
//! Run with `cargo run --example compare_methods`.
#![expect(clippy::print_stdout, reason = "an example shows its result")]

use punctual_core::barrier::Barrier;
use punctual_core::barriers::{DistanceDisc, QuadraticDisc};
use punctual_core::filter::{BarrierSettings, Filter, Method, Sampling};
use punctual_core::plants::Unicycle;
use punctual_reference::simulation::{Schedule, closed_loop};

const CENTRE: [f64; 2] = [45.0, 45.0]; // m
const RADIUS: f64 = 2.0; // m
const DEADLINE: f64 = 10.0; // s
const STEP: f64 = 0.001; // s

/// Result of a run until twice the deadline.
struct Run {
    /// First sample inside, in s.
    arrival: f64,
    /// Largest distance from the disc from the deadline on, in m; 0 inside.
    outside: f64,
    /// Largest acceleration (m/s²) and turning rate (rad/s) before arrival.
    peak: [f64; 2],
}

/// Runs the unicycle from rest in the origin.
fn run(
    barrier: impl Barrier<4> + Send + 'static,
    settings: BarrierSettings,
    sampling: Sampling,
    nominal: fn(&[f64; 4]) -> [f64; 2],
) -> Result<Run, punctual_core::Error> {
    let mut filter =
        Filter::builder(Unicycle).barrier("goal", barrier, settings)?.sampling(sampling)?.build()?;
    let schedule = Schedule { step: STEP, steps: (2.0 * DEADLINE / STEP).round() as usize, substeps: 1 };
    let mut run = Run { arrival: f64::INFINITY, outside: 0.0, peak: [0.0; 2] };
    closed_loop(
        &mut filter,
        &Unicycle,
        [0.0; 4],
        schedule,
        |_, x| nominal(x),
        |t, x, u, report| {
            if let Some(arrival) = report.barriers[0].arrival_time {
                run.arrival = arrival;
            } else {
                run.peak = [0, 1].map(|i| run.peak[i].max(u[i].abs()));
            }
            if t >= DEADLINE {
                let distance = (x[0] - CENTRE[0]).hypot(x[1] - CENTRE[1]);
                run.outside = run.outside.max(distance - RADIUS);
            }
        },
    )?;
    Ok(run)
}

fn main() -> Result<(), punctual_core::Error> {
    let root = BarrierSettings::within(DEADLINE).method(Method::RepeatedRoot);
    let paper = run(QuadraticDisc::new(CENTRE, RADIUS)?, root, Sampling::Pointwise, |_| [0.0; 2])?;

    // Damping keeps the arrival gentle; the constraint is enforced over the sampling period, the default.
    let profile = BarrierSettings::within(DEADLINE).margin(0.02);
    let ours =
        run(DistanceDisc::new(CENTRE, RADIUS, RADIUS)?, profile, Sampling::default(), |x| [-x[3], 0.0])?;

    println!("method              arrival  outside after deadline  peak acceleration  peak turning rate");
    for (name, run) in [("repeated root", &paper), ("reference profile", &ours)] {
        let Run { arrival, outside, peak } = run;
        println!(
            "{name:<18} {arrival:>6.3} s {outside:>21.3} m {:>13.1} m/s² {:>12.1} rad/s",
            peak[0], peak[1]
        );
    }

    assert!(paper.arrival > DEADLINE, "sampling costs the repeated root its deadline");
    assert!(ours.arrival <= DEADLINE && ours.outside == 0.0, "the reference profile keeps it");
    assert!(ours.peak[0] < 10.0, "with what a car can do");
    assert!(paper.peak[0] > 100.0 * ours.peak[0], "at a hundredth of the effort");
    Ok(())
}
