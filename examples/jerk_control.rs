//! Relative degree three: a lift that is driven by its jerk must be above a level by a deadline and stay there,
//! while its operator wants it down. The paper's repeated root does not exist here: for n = 3 there is never one
//! from rest. The reference profile needs none.
//!
//! Run with `cargo run --example jerk_control`.
#![expect(clippy::print_stdout, reason = "an example shows its result")]

use punctual_core::barrier::Barrier;
use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::{BarrierSettings, Filter};
use punctual_core::scalar::Scalar;
use punctual_reference::simulation::{Schedule, closed_loop};

/// State: height in m, speed in m/s, acceleration in m/s²; input: jerk in m/s³.
#[derive(Clone, Copy)]
struct Lift;

impl ControlAffine<3, 1> for Lift {
    fn drift<S: Scalar>(&self, x: &[S; 3]) -> [S; 3] {
        [x[1], x[2], S::zero()]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 3]) -> [[S; 1]; 3] {
        [[S::zero()], [S::zero()], [S::one()]]
    }
}

/// h = height − level, in m.
struct Above {
    level: f64,
}

impl Barrier<3> for Above {
    fn value<S: Scalar>(&self, _t: S, x: &[S; 3]) -> S {
        x[0] - self.level
    }
}

fn main() -> Result<(), punctual_core::Error> {
    const DEADLINE: f64 = 10.0; // s
    let settings = BarrierSettings::within(DEADLINE).margin(0.01);
    let mut filter = Filter::builder(Lift).barrier("level", Above { level: 20.0 }, settings)?.build()?;
    assert_eq!(filter.relative_degrees().collect::<Vec<_>>(), [3], "found, not declared");

    // 20 s in steps of 1 ms, from rest at 0. The wanted motion is down at 1 m/s.
    let schedule = Schedule { step: 0.001, steps: 20_000, substeps: 1 };
    let down = |_: f64, x: &[f64; 3]| [-4.0 * (x[1] + 1.0) - 4.0 * x[2]];
    let (mut arrival, mut least_after, mut peak, mut rows) = (None, f64::INFINITY, 0.0_f64, 0);
    println!("    t    height     speed     accel.      jerk         h");
    closed_loop(&mut filter, &Lift, [0.0; 3], schedule, down, |t, x, u, report| {
        let b = &report.barriers[0];
        if rows % 1000 == 0 {
            println!("{t:5.1} {:9.3} {:9.3} {:9.3} {:9.3} {:9.3}", x[0], x[1], x[2], u[0], b.h);
        }
        rows += 1;
        assert!(report.status.is_satisfied(), "at {t} s: {:?}", report.status);
        arrival = b.arrival_time;
        if arrival.is_none() {
            peak = peak.max(u[0].abs());
        }
        if t >= DEADLINE {
            least_after = least_after.min(b.h);
        }
    })?;

    let arrival = arrival.expect("the lift arrives");
    println!(
        "arrived at {arrival:.3} s; least h from the deadline on {least_after:.4} m; largest jerk on the way {peak:.2} m/s³"
    );
    assert!(arrival <= DEADLINE && least_after >= 0.0, "the promise");
    Ok(())
}
