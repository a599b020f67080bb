//! Compiles only if nothing below the core uses std, since there can be only one panic handler.
#![no_std]
#![forbid(unsafe_code)]

use core::array::from_fn;

use punctual_core::Error;
use punctual_core::barriers::DistanceDisc;
use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::{BarrierSettings, Filter};
use punctual_core::scalar::Scalar;

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    loop {}
}

/// Two double integrators.
struct PointMass;

impl ControlAffine<4, 2> for PointMass {
    fn drift<S: Scalar>(&self, x: &[S; 4]) -> [S; 4] {
        [x[2], x[3], S::zero(), S::zero()]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 4]) -> [[S; 2]; 4] {
        from_fn(|i| from_fn(|j| if i == j + 2 { S::one() } else { S::zero() }))
    }
}

/// A filter that reaches a disc: that of docs/rust.md, whose lines these are.
///
/// # Errors
///
/// None: the numbers are in range.
pub fn filter() -> Result<Filter, Error> {
    let goal = DistanceDisc::new([45.0, 45.0], 2.0, 2.0)?;
    let mut filter = Filter::builder(PointMass)
        .barrier("goal", goal, BarrierSettings::within(10.0))?
        .bounds(&[-4.0, -4.0], &[4.0, 4.0])?
        .build()?;
    filter.expect_hold(Some(0.01))?;
    Ok(filter)
}

/// One step of it.
///
/// # Errors
///
/// None: the lengths are right.
pub fn step(filter: &mut Filter, t: f64, x: &[f64; 4], wanted: &[f64; 2]) -> Result<[f64; 2], Error> {
    let mut u = [0.0; 2];
    filter.step(t, x, wanted, &mut u)?;
    Ok(u)
}
