//! Reference barriers.
//!
//! The two discs below have the same safe set and very different behaviour. The quadratic one is the
//! paper's: far away its value grows with d², while its gradient at the boundary is only 2R, so a
//! vehicle that follows a profile of it arrives at enormous speed. The distance-shaped one has a
//! gradient of length ≤ 1 everywhere; it is the one to use. Both can move at a constant velocity, and
//! [`Outside`] turns a goal into an obstacle.

use nalgebra::SVector;

use crate::barrier::Barrier;
use crate::error::{Error, finite, positive};
use crate::scalar::Scalar;

/// A point that moves at constant velocity: at `start` at t = 0, at `start + velocity · t` later.
#[derive(Clone, Copy, Debug)]
struct Centre {
    start: [f64; 2],
    velocity: [f64; 2],
}

impl Centre {
    fn at_rest(centre: [f64; 2]) -> Result<Self, Error> {
        let start = [finite("centre[1]", centre[0])?, finite("centre[2]", centre[1])?];
        Ok(Self { start, velocity: [0.0; 2] })
    }

    fn moving(self, velocity: [f64; 2]) -> Result<Self, Error> {
        let velocity = [finite("velocity[1]", velocity[0])?, finite("velocity[2]", velocity[1])?];
        Ok(Self { velocity, ..self })
    }

    /// Squared distance of the position (the first two states) from the point at time `t`, in m².
    #[inline]
    fn distance_squared<S: Scalar, const NX: usize>(&self, t: S, x: &SVector<S, NX>) -> S {
        let away = |i: usize| {
            let from_start = x[i] - self.start[i];
            // At rest there is nothing to multiply.
            if self.velocity[i] == 0.0 { from_start } else { from_start - t * self.velocity[i] }
        };
        away(0).squared() + away(1).squared()
    }
}

/// What lies outside another barrier's set: h = −h of the inside.
///
/// `Outside(DistanceDisc::new(..)?)` is an obstacle: kept clear of if the start is outside, left by the
/// deadline if not. At the centre of the disc the gradient vanishes.
#[derive(Clone, Copy, Debug)]
pub struct Outside<B>(pub B);

impl<B: Barrier<NX>, const NX: usize> Barrier<NX> for Outside<B> {
    #[inline]
    fn value<S: Scalar>(&self, t: S, x: &SVector<S, NX>) -> S {
        -self.0.value(t, x)
    }
}

/// Interior of a disc, the paper's form: h = R² − d², in m².
///
/// The first two states are the position. The gradient vanishes at the centre, where the barrier
/// cannot be influenced (the filter reports it as degenerate).
#[derive(Clone, Copy, Debug)]
pub struct QuadraticDisc {
    centre: Centre,
    radius: f64,
}

impl QuadraticDisc {
    /// A disc around `centre` (m) with `radius` > 0 (m).
    ///
    /// # Errors
    ///
    /// A coordinate that is not finite, a radius that is not finite or ≤ 0.
    pub fn new(centre: [f64; 2], radius: f64) -> Result<Self, Error> {
        Ok(Self { centre: Centre::at_rest(centre)?, radius: positive("radius", radius)? })
    }

    /// The same disc with its centre moving at `velocity` (m/s): where it was given at t = 0 on the
    /// filter's time axis, whenever the filter starts.
    ///
    /// # Errors
    ///
    /// A velocity that is not finite.
    pub fn moving(self, velocity: [f64; 2]) -> Result<Self, Error> {
        Ok(Self { centre: self.centre.moving(velocity)?, ..self })
    }
}

impl<const NX: usize> Barrier<NX> for QuadraticDisc {
    #[inline]
    fn value<S: Scalar>(&self, t: S, x: &SVector<S, NX>) -> S {
        -self.centre.distance_squared(t, x) + self.radius * self.radius
    }
}

/// Interior of a disc, distance-shaped and smooth: h = √(R² + ε²) − √(d² + ε²), in m.
///
/// The first two states are the position. h has the zero set of the disc, a gradient of length
/// d/√(d² + ε²) < 1, and curvature at most 1/ε; it vanishes only at the centre.
#[derive(Clone, Copy, Debug)]
pub struct DistanceDisc {
    centre: Centre,
    smoothing: f64,
    /// √(R² + ε²).
    level: f64,
}

impl DistanceDisc {
    /// A disc around `centre` (m) with `radius` R > 0 (m) and `smoothing` ε > 0 (m; R is a good
    /// choice, smaller is closer to the true distance and sharper at the centre).
    ///
    /// # Errors
    ///
    /// A coordinate that is not finite, a radius or smoothing that is not finite or ≤ 0.
    pub fn new(centre: [f64; 2], radius: f64, smoothing: f64) -> Result<Self, Error> {
        let centre = Centre::at_rest(centre)?;
        let level = positive("radius", radius)?.hypot(positive("smoothing", smoothing)?);
        Ok(Self { centre, smoothing, level })
    }

    /// The same disc with its centre moving at `velocity` (m/s): where it was given at t = 0 on the
    /// filter's time axis, whenever the filter starts.
    ///
    /// # Errors
    ///
    /// A velocity that is not finite.
    pub fn moving(self, velocity: [f64; 2]) -> Result<Self, Error> {
        Ok(Self { centre: self.centre.moving(velocity)?, ..self })
    }
}

impl<const NX: usize> Barrier<NX> for DistanceDisc {
    #[inline]
    fn value<S: Scalar>(&self, t: S, x: &SVector<S, NX>) -> S {
        -(self.centre.distance_squared(t, x) + self.smoothing * self.smoothing).sqrt() + self.level
    }
}
