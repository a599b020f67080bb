//! Your own plant and barrier: a cart with air drag that must be beyond a line by a deadline and stay
//! there, while its driver wants to go backwards all the time.
//!
//! Run with `cargo run --example own_plant`.
#![expect(clippy::print_stdout, reason = "an example shows its result")]

use punctual_core::barrier::Barrier;
use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::{BarrierSettings, Filter};
use punctual_core::scalar::Scalar;
use punctual_reference::simulation::{Schedule, closed_loop};

/// State: position in m and velocity in m/s; input: acceleration in m/s².
struct Cart {
    drag: f64, // 1/m
}

impl ControlAffine<2, 1> for Cart {
    fn drift<S: Scalar>(&self, x: &[S; 2]) -> [S; 2] {
        // |v| made smooth, since derivatives are taken through it.
        let speed = (x[1].squared() + 0.01).sqrt();
        [x[1], -x[1] * speed * self.drag]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 2]) -> [[S; 1]; 2] {
        [[S::zero()], [S::one()]]
    }
}

/// h = position − line, in m: the set to reach is everything beyond the line.
struct Beyond {
    line: f64,
}

impl Barrier<2> for Beyond {
    fn value<S: Scalar>(&self, _t: S, x: &[S; 2]) -> S {
        x[0] - self.line
    }
}

fn main() -> Result<(), punctual_core::Error> {
    const DEADLINE: f64 = 5.0; // s
    let cart = || Cart { drag: 0.05 };
    let settings = BarrierSettings::within(DEADLINE).margin(0.05);
    let mut filter = Filter::builder(cart()).barrier("line", Beyond { line: 20.0 }, settings)?.build()?;

    // 10 s in steps of 10 ms from rest at 0; the driver wants to go at -1 m/s.
    let schedule = Schedule { step: 0.01, steps: 1000, substeps: 1 };
    let driver = |_t: f64, x: &[f64; 2]| [-1.0 - x[1]];
    let (mut arrival, mut least_after, mut rows) = (None, f64::INFINITY, 0);
    println!("    t  position     speed    wanted      safe         h");
    closed_loop(&mut filter, &cart(), [0.0, 0.0], schedule, driver, |t, x, u, report| {
        let line = &report.barriers[0];
        if rows % 100 == 0 {
            println!("{t:5.1} {:9.3} {:9.3} {:9.3} {:9.3} {:9.3}", x[0], x[1], driver(t, x)[0], u[0], line.h);
        }
        rows += 1;
        assert!(report.status.is_satisfied(), "at {t} s: {:?}", report.status);
        arrival = line.arrival_time;
        if t >= DEADLINE {
            least_after = least_after.min(line.h);
        }
    })?;

    let arrival = arrival.expect("the cart arrives");
    println!("arrived at {arrival:.2} s; least h from the deadline on: {least_after:.3} m");
    assert!(arrival <= DEADLINE && least_after >= 0.0, "the promise");
    Ok(())
}
