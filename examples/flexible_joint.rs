//! Relative degree four: an arm on a flexible joint. The motor turns the arm through a spring, so that
//! its torque enters only the fourth derivative of the arm's angle. The arm must point into a window
//! by a deadline and stay there, against gravity.
//!
//! Run with `cargo run --example flexible_joint`.
#![expect(clippy::print_stdout, reason = "an example shows its result")]

use std::sync::Arc;

use punctual_core::barrier::Barrier;
use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::{BarrierSettings, Filter};
use punctual_core::lie;
use punctual_core::scalar::Scalar;
use punctual_reference::simulation::{Schedule, closed_loop};

/// M. W. Spong's single-link arm, in unit-free numbers of a small robot. State: angle q of the arm
/// from hanging (rad), its rate, angle of the motor (rad), its rate; input: motor torque in N m.
#[derive(Clone, Copy)]
struct Arm {
    gravity: f64,       // m g l / I, 1/s²
    stiffness: f64,     // k / I, 1/s²
    motor_side: f64,    // k / J, 1/s²
    motor_inverse: f64, // 1 / J, 1/(kg m²)
}

const ARM: Arm = Arm { gravity: 10.0, stiffness: 100.0, motor_side: 100.0, motor_inverse: 10.0 };

impl ControlAffine<4, 1> for Arm {
    fn drift<S: Scalar>(&self, x: &[S; 4]) -> [S; 4] {
        let twist = x[0] - x[2];
        [x[1], -x[0].sin() * self.gravity - twist * self.stiffness, x[3], twist * self.motor_side]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 4]) -> [[S; 1]; 4] {
        [[S::zero()], [S::zero()], [S::zero()], [S::from(self.motor_inverse)]]
    }
}

/// The arm points to `target` (rad) within `width` (rad): h = √(2) w − √((q − target)² + w²).
#[derive(Clone, Copy)]
struct Window {
    target: f64,
    width: f64,
}

impl Barrier<4> for Window {
    fn value<S: Scalar>(&self, _t: S, x: &[S; 4]) -> S {
        -((x[0] - self.target).squared() + self.width * self.width).sqrt() + self.width.hypot(self.width)
    }
}

fn main() -> Result<(), punctual_core::Error> {
    const DEADLINE: f64 = 3.0; // s
    let window = Window { target: 1.5, width: 0.2 };
    // `FilterBuilder::barrier` does both steps by itself: it asks for the relative degree, and builds the source
    // for it.
    let found = lie::detected(&ARM, &window);
    assert_eq!(found, lie::RelativeDegree::Uniform(4));
    let source = lie::along(Arc::new(ARM), window, 4)?;
    let settings = BarrierSettings::within(DEADLINE).margin(0.02);
    let mut filter = Filter::from_sources(4, 1).source("window", source, settings)?.build()?;

    // 6 s in steps of 1 ms, hanging at rest. The wanted input damps the motor and does nothing else, so that
    // gravity pulls the arm down all the time.
    let schedule = Schedule { step: 0.001, steps: 6000, substeps: 1 };
    let damping = |_: f64, x: &[f64; 4]| [-2.0 * x[3]];
    let (mut arrival, mut outside, mut peak, mut rows) = (None, 0.0_f64, 0.0_f64, 0);
    println!("    t       arm     motor    torque         h");
    closed_loop(&mut filter, &ARM, [0.0; 4], schedule, damping, |t, x, u, report| {
        let b = &report.barriers[0];
        if rows % 500 == 0 {
            println!("{t:5.1} {:9.3} {:9.3} {:9.3} {:9.3}", x[0], x[2], u[0], b.h);
        }
        rows += 1;
        assert!(report.status.is_satisfied(), "at {t} s: {:?}", report.status);
        arrival = b.arrival_time;
        peak = peak.max(u[0].abs());
        if t >= DEADLINE {
            outside = outside.max((x[0] - window.target).abs() - window.width);
        }
    })?;

    let arrival = arrival.expect("the arm arrives");
    println!("arrived at {arrival:.3} s; largest torque {peak:.2} N m");
    assert!(arrival <= DEADLINE && outside == 0.0, "the promise");
    Ok(())
}
