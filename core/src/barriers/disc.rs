//! Discs: the paper's form and the distance-shaped one, at rest, moving, or around a point that is a state.

use crate::barrier::Barrier;
use crate::dynamics::Region;
use crate::elementary;
use crate::error::{Error, finite, positive};
use crate::scalar::Scalar;

/// The place of a disc.
#[derive(Clone, Copy, Debug)]
enum Centre {
    /// A point that moves at constant velocity: at `start` at t = 0, at `start + velocity · t` later.
    Given { start: [f64; 2], velocity: [f64; 2] },
    /// The two states from this one on.
    State(usize),
}

impl Centre {
    fn at_rest(centre: [f64; 2]) -> Result<Self, Error> {
        let start = [finite("centre[1]", centre[0])?, finite("centre[2]", centre[1])?];
        Ok(Self::Given { start, velocity: [0.0; 2] })
    }

    fn moving(self, velocity: [f64; 2]) -> Result<Self, Error> {
        let velocity = [finite("velocity[1]", velocity[0])?, finite("velocity[2]", velocity[1])?];
        Ok(match self {
            Self::Given { start, .. } => Self::Given { start, velocity },
            Self::State(_) => self,
        })
    }

    /// Squared distance of the position (the first two states) from the point at time `t`, in m².
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn distance_squared<S: Scalar, const NX: usize>(&self, t: S, x: &[S; NX]) -> S {
        let away = match self {
            // At rest there is nothing to multiply.
            Self::Given { start, velocity: [0.0, 0.0] } => [x[0] - start[0], x[1] - start[1]],
            Self::Given { start, velocity } => {
                [x[0] - start[0] - t * velocity[0], x[1] - start[1] - t * velocity[1]]
            }
            Self::State(first) => [x[0] - x[*first], x[1] - x[first + 1]],
        };
        away[0].squared() + away[1].squared()
    }

    /// The time in s from `t` on at which the point is nearest to the position of `x`, which does not move; and whether it
    /// goes away from there for ever.
    fn passes<const NX: usize>(&self, t: f64, x: &[f64; NX]) -> (f64, bool) {
        match self {
            Self::Given { start, velocity } if *velocity != [0.0; 2] => {
                let way: f64 = (0..2).map(|i| (x[i] - start[i]) * velocity[i]).sum();
                let square: f64 = velocity.iter().map(|v| v * v).sum();
                (t.max(way / square), true)
            }
            _ => (t, false),
        }
    }

    /// The least distance in m of the point from a position in `region` between the two times.
    fn nearest(&self, time: [f64; 2], region: &Region) -> Option<f64> {
        let Self::Given { start, velocity } = self else { return None };
        // Seen from the point, the region moves against the way of the point.
        let mut seen = *region;
        for (i, side) in seen.sides.iter_mut().enumerate() {
            let way = time.map(|t| start[i] + t * velocity[i]);
            *side = [side[0] - way[0].max(way[1]), side[1] - way[0].min(way[1])];
        }
        Some(seen.distance([0.0; 2]))
    }
}

/// Interior of a disc, the paper's form: h = R² − d², in m².
///
/// The first two states are the position. The gradient vanishes at the centre, where the barrier
/// cannot be influenced (the filter reports `NoAuthority`).
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

    /// The same disc around the point whose coordinates are the states number `first` and the next,
    /// counted from 0, in place of its centre and velocity; see
    /// [`WithPoint`](crate::dynamics::WithPoint).
    pub fn following(self, first: usize) -> Self {
        Self { centre: Centre::State(first), ..self }
    }
}

impl<const NX: usize> Barrier<NX> for QuadraticDisc {
    const ONE_SIDED_CURVATURE: bool = true;

    #[cfg_attr(not(feature = "small"), inline(always))]
    fn value<S: Scalar>(&self, t: S, x: &[S; NX]) -> S {
        -self.centre.distance_squared(t, x) + self.radius * self.radius
    }

    fn highest(&self, time: [f64; 2], region: &Region) -> Option<f64> {
        let nearest = self.centre.nearest(time, region)?;
        Some((self.radius - nearest) * (self.radius + nearest))
    }

    fn range_from(&self, t: f64, x: &[f64; NX]) -> Option<[f64; 2]> {
        let (nearest, leaves) = self.centre.passes(t, x);
        Some([if leaves { f64::NEG_INFINITY } else { self.value(t, x) }, self.value(nearest, x)])
    }
}

/// Interior of a disc, distance-shaped and smooth: h = √(R² + b²) − √(d² + b²), in m.
///
/// The first two states are the position. h has the zero set of the disc, a gradient of length
/// d/√(d² + b²) < 1, and curvature at most 1/b; it vanishes only at the centre.
#[derive(Clone, Copy, Debug)]
pub struct DistanceDisc {
    centre: Centre,
    smoothing: f64,
    /// √(R² + b²).
    level: f64,
}

impl DistanceDisc {
    /// A disc around `centre` (m) with `radius` R > 0 (m) and `smoothing` b > 0 (m; R is a good
    /// choice, smaller is closer to the true distance and sharper at the centre).
    ///
    /// # Errors
    ///
    /// A coordinate that is not finite, a radius or smoothing that is not finite or ≤ 0.
    pub fn new(centre: [f64; 2], radius: f64, smoothing: f64) -> Result<Self, Error> {
        let centre = Centre::at_rest(centre)?;
        let level = elementary::hypot(positive("radius", radius)?, positive("smoothing", smoothing)?);
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

    /// The same disc around the point whose coordinates are the states number `first` and the next,
    /// counted from 0, in place of its centre and velocity; see
    /// [`WithPoint`](crate::dynamics::WithPoint).
    pub fn following(self, first: usize) -> Self {
        Self { centre: Centre::State(first), ..self }
    }
}

impl<const NX: usize> Barrier<NX> for DistanceDisc {
    const ONE_SIDED_CURVATURE: bool = true;

    #[cfg_attr(not(feature = "small"), inline(always))]
    fn value<S: Scalar>(&self, t: S, x: &[S; NX]) -> S {
        -(self.centre.distance_squared(t, x) + self.smoothing * self.smoothing).sqrt() + self.level
    }

    fn steepness(&self) -> Option<f64> {
        Some(1.0)
    }

    fn highest(&self, time: [f64; 2], region: &Region) -> Option<f64> {
        let nearest = self.centre.nearest(time, region)?;
        Some(self.level - elementary::sqrt(nearest * nearest + self.smoothing * self.smoothing))
    }

    fn range_from(&self, t: f64, x: &[f64; NX]) -> Option<[f64; 2]> {
        let (nearest, leaves) = self.centre.passes(t, x);
        Some([if leaves { f64::NEG_INFINITY } else { self.value(t, x) }, self.value(nearest, x)])
    }
}
