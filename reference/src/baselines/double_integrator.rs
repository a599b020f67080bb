//! A known example for the tests of methods with a braking backup: ẍ = u with |u| ≤ 2 m/s² in front of a
//! wall.

use punctual_core::barrier::Barrier;
use punctual_core::dynamics::{ControlAffine, rk4_step};
use punctual_core::qp::Bounds;
use punctual_core::scalar::Scalar;

use super::backup::{Backup, Brake, Stoppable};

/// Bound on the input in m/s².
pub(super) const LIMIT: f64 = 2.0;
/// Position of the wall in m.
pub(super) const WALL: f64 = 10.0;
/// Sampling period in s.
pub(super) const PERIOD: f64 = 0.02;

#[derive(Clone, Copy, Debug)]
pub(super) struct Line;

impl ControlAffine<2, 1> for Line {
    fn drift<S: Scalar>(&self, x: &[S; 2]) -> [S; 2] {
        [x[1], S::zero()]
    }

    fn input_map<S: Scalar>(&self, _x: &[S; 2]) -> [[S; 1]; 2] {
        [[S::zero()], [S::one()]]
    }
}

/// h = `WALL` − x.
#[derive(Clone, Copy, Debug)]
pub(super) struct Before;

impl Barrier<2> for Before {
    fn value<S: Scalar>(&self, _t: S, x: &[S; 2]) -> S {
        -x[0] + WALL
    }
}

pub(super) fn backup() -> Backup<Line, Brake<1>, Before, Stoppable<Before, 1>> {
    let brake = Brake { speeds: [1], gain: 20.0, limit: LIMIT };
    let mut bounds = Bounds::NONE;
    (bounds.min[0], bounds.max[0]) = (-LIMIT, LIMIT);
    let terminal = Stoppable { set: Before, brake };
    let backup =
        Backup { plant: Line, law: brake, safe: Before, terminal, bounds, period: PERIOD, horizon: 60 };
    backup.validated().expect("valid")
}

/// `steps` states from `x` on, with the inputs that `step` returns.
pub(super) fn driven(
    mut x: [f64; 2],
    steps: usize,
    mut step: impl FnMut(f64, &[f64; 2]) -> [f64; 1],
) -> Vec<([f64; 2], [f64; 1])> {
    (0..steps)
        .map(|k| {
            let (at, u) = (x, step(k as f64 * PERIOD, &x));
            x = rk4_step(&Line, &x, &u, PERIOD);
            (at, u)
        })
        .collect()
}
