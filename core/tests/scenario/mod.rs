//! Filters, plants and barriers that the tests of the filter share.

#![allow(dead_code, reason = "each test binary uses its part")]

use std::array::from_fn;

use punctual_core::barrier::Barrier;
use punctual_core::barriers::{DistanceDisc, QuadraticDisc};
use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::{BarrierSettings, Filter};
use punctual_core::plants::PointMass;
use punctual_core::scalar::Scalar;

/// A chain of `N` integrators, u in the last.
#[derive(Clone, Copy)]
pub(crate) struct Integrator<const N: usize>;

impl<const N: usize> ControlAffine<N, 1> for Integrator<N> {
    fn drift<S: Scalar>(&self, x: &[S; N]) -> [S; N] {
        from_fn(|i| if i + 1 < N { x[i + 1] } else { S::zero() })
    }
    fn input_map<S: Scalar>(&self, _x: &[S; N]) -> [[S; 1]; N] {
        from_fn(|i| from_fn(|_| if i + 1 == N { S::one() } else { S::zero() }))
    }
}

/// h = x₁.
pub(crate) struct NonNegative;

impl<const NX: usize> Barrier<NX> for NonNegative {
    fn value<S: Scalar>(&self, _t: S, x: &[S; NX]) -> S {
        x[0]
    }
}

/// The paper's disc in the paper's form.
pub(crate) fn quadratic_disc() -> QuadraticDisc {
    QuadraticDisc::new([45.0, 45.0], 2.0).expect("valid disc")
}

/// The paper's disc, distance-shaped.
pub(crate) fn distance_disc() -> DistanceDisc {
    DistanceDisc::new([45.0, 45.0], 2.0, 2.0).expect("valid disc")
}

/// A filter with one barrier of relative degree 2, "goal".
pub(crate) fn one<P, B>(plant: P, barrier: B, settings: BarrierSettings) -> Filter
where
    P: ControlAffine<4, 2> + Send + Sync + 'static,
    B: Barrier<4> + Send + 'static,
{
    Filter::builder(plant)
        .barrier("goal", barrier, settings)
        .and_then(punctual_core::filter::FilterBuilder::build)
        .expect("valid filter")
}

/// The point mass and the distance-shaped disc.
pub(crate) fn goal(settings: BarrierSettings) -> Filter {
    one(PointMass, distance_disc(), settings)
}

/// Damping of the point mass: u_ref = −(v_x, v_y).
pub(crate) fn damping(_t: f64, x: &[f64; 4]) -> [f64; 2] {
    [-x[2], -x[3]]
}

/// Damping of the unicycle and the bicycle: u_ref = (−v, 0).
pub(crate) fn speed_damping(_t: f64, x: &[f64; 4]) -> [f64; 2] {
    [-x[3], 0.0]
}
