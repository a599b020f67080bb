//! Reference barriers.
//!
//! The two discs below have the same safe set and very different behaviour. The quadratic one is the
//! paper's: far away its value grows with d², while its gradient at the boundary is only 2R, so a
//! vehicle that follows a profile of it arrives at enormous speed. The distance-shaped one has a
//! gradient of length ≤ 1 everywhere; it is the one to use.

use nalgebra::SVector;

use crate::barrier::Barrier;
use crate::error::{Error, finite, positive};
use crate::scalar::Scalar;

/// Squared distance of the position (the first two states) from `centre`, in m².
fn distance_squared<S: Scalar, const NX: usize>(x: &SVector<S, NX>, centre: &[f64; 2]) -> S {
    (x[0] - centre[0]).squared() + (x[1] - centre[1]).squared()
}

fn checked_centre(centre: [f64; 2]) -> Result<[f64; 2], Error> {
    Ok([finite("centre[1]", centre[0])?, finite("centre[2]", centre[1])?])
}

/// Interior of a disc, the paper's form: h = R² − d², in m².
///
/// The first two states are the position. The gradient vanishes at the centre, where the barrier
/// cannot be influenced (the filter reports it as degenerate).
#[derive(Clone, Copy, Debug)]
pub struct QuadraticDisc {
    centre: [f64; 2],
    radius: f64,
}

impl QuadraticDisc {
    /// A disc around `centre` (m) with `radius` > 0 (m).
    ///
    /// # Errors
    ///
    /// A coordinate that is not finite, a radius that is not finite or ≤ 0.
    pub fn new(centre: [f64; 2], radius: f64) -> Result<Self, Error> {
        Ok(Self { centre: checked_centre(centre)?, radius: positive("radius", radius)? })
    }
}

impl<const NX: usize> Barrier<NX> for QuadraticDisc {
    fn value<S: Scalar>(&self, _t: S, x: &SVector<S, NX>) -> S {
        -distance_squared(x, &self.centre) + self.radius * self.radius
    }
}

/// Interior of a disc, distance-shaped and smooth: h = √(R² + ε²) − √(d² + ε²), in m.
///
/// The first two states are the position. h has the zero set of the disc, a gradient of length
/// d/√(d² + ε²) < 1, and curvature at most 1/ε; it vanishes only at the centre.
#[derive(Clone, Copy, Debug)]
pub struct DistanceDisc {
    centre: [f64; 2],
    radius: f64,
    smoothing: f64,
}

impl DistanceDisc {
    /// A disc around `centre` (m) with `radius` R > 0 (m) and `smoothing` ε > 0 (m; R is a good
    /// choice, smaller is closer to the true distance and sharper at the centre).
    ///
    /// # Errors
    ///
    /// A coordinate that is not finite, a radius or smoothing that is not finite or ≤ 0.
    pub fn new(centre: [f64; 2], radius: f64, smoothing: f64) -> Result<Self, Error> {
        Ok(Self {
            centre: checked_centre(centre)?,
            radius: positive("radius", radius)?,
            smoothing: positive("smoothing", smoothing)?,
        })
    }
}

impl<const NX: usize> Barrier<NX> for DistanceDisc {
    fn value<S: Scalar>(&self, _t: S, x: &SVector<S, NX>) -> S {
        -(distance_squared(x, &self.centre) + self.smoothing * self.smoothing).sqrt()
            + self.radius.hypot(self.smoothing)
    }
}
