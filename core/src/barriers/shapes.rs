//! Half-planes, ellipses, rectangles, and bounds on states. The first two states are the position.

use core::f64::consts::SQRT_2;

use crate::barrier::Barrier;
use crate::dynamics::Region;
use crate::elementary;
use crate::error::{Error, ErrorKind, finite, positive};
use crate::scalar::Scalar;

fn point(field: &str, value: [f64; 2]) -> Result<[f64; 2], Error> {
    Ok([finite(&format!("{field}[1]"), value[0])?, finite(&format!("{field}[2]"), value[1])?])
}

fn lengths(field: &str, value: [f64; 2]) -> Result<[f64; 2], Error> {
    Ok([positive(&format!("{field}[1]"), value[0])?, positive(&format!("{field}[2]"), value[1])?])
}

/// One side of a line: h = nᵀ(p − q), in m, with a unit normal n that points into the safe set and a point
/// q of the line.
#[derive(Clone, Copy, Debug)]
pub struct HalfPlane {
    normal: [f64; 2],
    point: [f64; 2],
}

impl HalfPlane {
    /// The side of the line through `through` (m) that `normal` points to; its length does not matter.
    ///
    /// # Errors
    ///
    /// A component that is not finite; a normal of length 0.
    pub fn new(normal: [f64; 2], through: [f64; 2]) -> Result<Self, Error> {
        let normal = point("normal", normal)?;
        let length = elementary::hypot(normal[0], normal[1]);
        if length == 0.0 {
            return Err(Error::new(ErrorKind::Range, "normal", "is [0, 0], must have a direction"));
        }
        Ok(Self { normal: normal.map(|n| n / length), point: point("centre", through)? })
    }
}

impl<const NX: usize> Barrier<NX> for HalfPlane {
    const ONE_SIDED_CURVATURE: bool = true;

    fn value<S: Scalar>(&self, _t: S, x: &[S; NX]) -> S {
        (x[0] - self.point[0]) * self.normal[0] + (x[1] - self.point[1]) * self.normal[1]
    }

    fn highest(&self, _time: [f64; 2], region: &Region) -> Option<f64> {
        let [n, q] = [self.normal, self.point];
        Some(region.along(n)[1] - (n[0] * q[0] + n[1] * q[1]))
    }
}

/// Axes turned by an angle, in which a shape is straight.
#[derive(Clone, Copy, Debug)]
struct Axes {
    centre: [f64; 2],
    /// Cosine and sine of the angle.
    direction: [f64; 2],
}

impl Axes {
    fn new(centre: [f64; 2], angle: f64) -> Result<Self, Error> {
        let (sine, cosine) = elementary::sin_cos(finite("angle", angle)?);
        Ok(Self { centre: point("centre", centre)?, direction: [cosine, sine] })
    }

    /// The position relative to the centre along the two axes, in m.
    fn along<S: Scalar, const NX: usize>(&self, x: &[S; NX]) -> [S; 2] {
        let (away, [c, s]) = ([x[0] - self.centre[0], x[1] - self.centre[1]], self.direction);
        [away[0] * c + away[1] * s, away[1] * c - away[0] * s]
    }

    /// The least size of each of [`Self::along`] over `region`.
    fn least(&self, region: &Region) -> [f64; 2] {
        let [c, s] = self.direction;
        [[c, s], [-s, c]].map(|axis| {
            let centre = axis[0] * self.centre[0] + axis[1] * self.centre[1];
            let [low, high] = region.along(axis);
            (low - centre).max(centre - high).max(0.0)
        })
    }
}

/// Interior of an ellipse with half axes A, B, distance-shaped and smooth:
/// h = b (√2 − √(ξ²/A² + η²/B² + 1)) with b = min(A, B), in m. For A = B = R it is the
/// [`DistanceDisc`](super::DistanceDisc) with smoothing R.
#[derive(Clone, Copy, Debug)]
pub struct Ellipse {
    axes: Axes,
    half_axes: [f64; 2],
}

impl Ellipse {
    /// An ellipse around `centre` (m) with the `half_axes` (m, > 0), the first of them at `angle` (rad) from
    /// the x axis.
    ///
    /// # Errors
    ///
    /// A number that is not finite, a half axis ≤ 0.
    pub fn new(centre: [f64; 2], half_axes: [f64; 2], angle: f64) -> Result<Self, Error> {
        Ok(Self { axes: Axes::new(centre, angle)?, half_axes: lengths("half_axes", half_axes)? })
    }
}

impl<const NX: usize> Barrier<NX> for Ellipse {
    const ONE_SIDED_CURVATURE: bool = true;

    fn value<S: Scalar>(&self, _t: S, x: &[S; NX]) -> S {
        let [along, across] = self.axes.along(x);
        let [a, b] = self.half_axes;
        let level = (along / a).squared() + (across / b).squared();
        (-(level + 1.0).sqrt() + SQRT_2) * a.min(b)
    }

    fn highest(&self, _time: [f64; 2], region: &Region) -> Option<f64> {
        let ([along, across], [a, b]) = (self.axes.least(region), self.half_axes);
        let level = elementary::hypot(elementary::hypot(along / a, across / b), 1.0);
        Some((SQRT_2 - level) * a.min(b))
    }
}

/// Interior of a rectangle with rounded corners, distance-shaped and smooth:
/// h = b (2^¼ − ((ξ/A)⁴ + (η/B)⁴ + 1)^¼) with b = min(A, B), in m.
///
/// [`Self::new`] lies within the true rectangle of half sides A, B, for a goal or a room; `around` contains it,
/// its corners on the boundary, for an obstacle. Between the two is a factor 2^¼ = 1.19.
#[derive(Clone, Copy, Debug)]
pub struct Rectangle {
    axes: Axes,
    half_sides: [f64; 2],
}

impl Rectangle {
    /// Within the rectangle around `centre` (m) with the `half_sides` (m, > 0), the first of them at `angle`
    /// (rad) from the x axis.
    ///
    /// # Errors
    ///
    /// A number that is not finite, a half side ≤ 0.
    pub fn new(centre: [f64; 2], half_sides: [f64; 2], angle: f64) -> Result<Self, Error> {
        Ok(Self { axes: Axes::new(centre, angle)?, half_sides: lengths("half_sides", half_sides)? })
    }

    /// The same shape, enlarged until it contains the true rectangle.
    pub fn around(self) -> Self {
        Self { half_sides: self.half_sides.map(|side| side * elementary::powf(2.0, 0.25)), ..self }
    }
}

impl<const NX: usize> Barrier<NX> for Rectangle {
    const ONE_SIDED_CURVATURE: bool = true;

    fn value<S: Scalar>(&self, _t: S, x: &[S; NX]) -> S {
        let [along, across] = self.axes.along(x);
        let [a, b] = self.half_sides;
        let level = (along / a).squared().squared() + (across / b).squared().squared();
        (-(level + 1.0).sqrt().sqrt() + elementary::powf(2.0, 0.25)) * a.min(b)
    }

    fn highest(&self, _time: [f64; 2], region: &Region) -> Option<f64> {
        let ([along, across], [a, b]) = (self.axes.least(region), self.half_sides);
        let level = elementary::powi(along / a, 4) + elementary::powi(across / b, 4);
        Some((elementary::powf(2.0, 0.25) - elementary::powf(level + 1.0, 0.25)) * a.min(b))
    }
}

/// A bound on one state: h = bound − x_i or x_i − bound, in the unit of the state.
#[derive(Clone, Copy, Debug)]
pub struct StateBound {
    state: usize,
    sign: f64,
    bound: f64,
}

impl StateBound {
    /// State number `state`, counted from 0, ≤ `bound`.
    ///
    /// # Errors
    ///
    /// A bound that is not finite.
    pub fn at_most(state: usize, bound: f64) -> Result<Self, Error> {
        Ok(Self { state, sign: -1.0, bound: finite("bound", bound)? })
    }

    /// State number `state`, counted from 0, ≥ `bound`.
    ///
    /// # Errors
    ///
    /// A bound that is not finite.
    pub fn at_least(state: usize, bound: f64) -> Result<Self, Error> {
        Ok(Self { state, sign: 1.0, bound: finite("bound", bound)? })
    }
}

impl<const NX: usize> Barrier<NX> for StateBound {
    const ONE_SIDED_CURVATURE: bool = true;

    /// Not a number for a state that the plant does not have.
    fn value<S: Scalar>(&self, _t: S, x: &[S; NX]) -> S {
        match x.get(self.state) {
            Some(value) => (*value - self.bound) * self.sign,
            None => S::from(f64::NAN),
        }
    }

    fn highest(&self, _time: [f64; 2], region: &Region) -> Option<f64> {
        let axis = [[1.0, 0.0], [0.0, 1.0]].get(self.state)?.map(|n| n * self.sign);
        Some(region.along(axis)[1] - self.sign * self.bound)
    }
}

/// One state of bounded size, or two neighbouring ones of bounded length, such as a speed limit:
/// h = √(L² + b²) − √(x_i² + x_{i+1}² + b²) with b = L/2, in their unit.
#[derive(Clone, Copy, Debug)]
pub struct NormBound {
    first: usize,
    count: usize,
    limit: f64,
}

impl NormBound {
    /// The states number `first` and the next, counted from 0, of length ≤ `limit` > 0.
    ///
    /// # Errors
    ///
    /// A limit that is not finite or ≤ 0.
    pub fn new(first: usize, limit: f64) -> Result<Self, Error> {
        Ok(Self { first, count: 2, limit: positive("bound", limit)? })
    }

    /// State number `state`, counted from 0, of size ≤ `limit` > 0.
    ///
    /// # Errors
    ///
    /// A limit that is not finite or ≤ 0.
    pub fn of_one(state: usize, limit: f64) -> Result<Self, Error> {
        Ok(Self { count: 1, ..Self::new(state, limit)? })
    }
}

impl<const NX: usize> Barrier<NX> for NormBound {
    const ONE_SIDED_CURVATURE: bool = true;

    /// Not a number for states that the plant does not have.
    fn value<S: Scalar>(&self, _t: S, x: &[S; NX]) -> S {
        let smoothing = 0.5 * self.limit;
        if NX < self.count || self.first > NX - self.count {
            return S::from(f64::NAN);
        }
        let mut square = x[self.first].squared();
        if self.count == 2 {
            square += x[self.first + 1].squared();
        }
        -(square + smoothing * smoothing).sqrt() + elementary::hypot(self.limit, smoothing)
    }
}

#[cfg(test)]
mod tests {

    use alloc::borrow::ToOwned;
    use alloc::string::ToString;

    use super::*;

    fn h(barrier: &impl Barrier<4>, x: [f64; 4]) -> f64 {
        barrier.value(0.0, &x)
    }

    #[test]
    fn the_sets_are_where_they_should_be() {
        let half = HalfPlane::new([3.0, 4.0], [1.0, 1.0]).expect("valid");
        assert!((h(&half, [4.0, 5.0, 0.0, 0.0]) - 5.0).abs() < 1e-15);
        let turned = core::f64::consts::FRAC_PI_6;
        let (c, s) = (turned.cos(), turned.sin());
        let ellipse = Ellipse::new([1.0, -2.0], [3.0, 2.0], turned).expect("valid");
        let inner = Rectangle::new([1.0, -2.0], [3.0, 2.0], turned).expect("valid");
        // Ends of the axes are on the boundary of the ellipse and of the inner rectangle.
        for (along, across) in [(3.0, 0.0), (-3.0, 0.0), (0.0, 2.0), (0.0, -2.0)] {
            let x = [1.0 + c * along - s * across, -2.0 + s * along + c * across, 9.0, 9.0];
            assert!(h(&ellipse, x).abs() < 1e-14 && h(&inner, x).abs() < 1e-14, "{x:?}");
            assert!(h(&inner.around(), x) > 0.1);
        }
        // Corners are outside both, and on the boundary of the one around.
        let corner = [1.0 + 3.0 * c - 2.0 * s, -2.0 + 3.0 * s + 2.0 * c, 9.0, 9.0];
        assert!(h(&ellipse, corner) < -0.1 && h(&inner, corner) < -0.1);
        assert!(h(&inner.around(), corner).abs() < 1e-14);
        let disc = super::super::DistanceDisc::new([1.0, -2.0], 2.0, 2.0).expect("valid");
        let round = Ellipse::new([1.0, -2.0], [2.0; 2], 0.3).expect("valid");
        let x = [4.0, 5.0, 0.0, 0.0];
        assert!((h(&disc, x) - h(&round, x)).abs() < 1e-14);
    }

    #[test]
    fn bounds_on_states() {
        let x = [0.0, 0.0, 3.0, -4.0];
        assert_eq!(h(&StateBound::at_most(2, 5.0).expect("valid"), x), 2.0);
        assert_eq!(h(&StateBound::at_least(3, -5.0).expect("valid"), x), 1.0);
        assert!(h(&StateBound::at_most(4, 5.0).expect("valid"), x).is_nan());
        let speed = NormBound::new(2, 5.0).expect("valid");
        assert!(h(&speed, x).abs() < 1e-15 && h(&speed, [0.0; 4]) > 0.0);
        assert_eq!(h(&NormBound::of_one(3, 4.0).expect("valid"), x), 0.0);
        assert!(Barrier::<3>::value(&speed, 0.0, &[0.0, 0.0, 1.0]).is_nan());
    }

    #[test]
    fn numbers_out_of_range_are_refused() {
        let message = |e: Error| e.to_string();
        let refused = HalfPlane::new([0.0; 2], [0.0; 2]).map(|_| ()).map_err(message);
        assert_eq!(refused, Err("normal: is [0, 0], must have a direction".to_owned()));
        let refused = Ellipse::new([0.0; 2], [1.0, 0.0], 0.0).map(|_| ()).map_err(message);
        assert_eq!(refused, Err("half_axes[2]: is 0, must be finite and > 0".to_owned()));
        let refused = Rectangle::new([0.0; 2], [1.0; 2], f64::NAN).map(|_| ()).map_err(message);
        assert_eq!(refused, Err("angle: is NaN, must be finite".to_owned()));
        let refused = NormBound::new(0, -1.0).map(|_| ()).map_err(message);
        assert_eq!(refused, Err("bound: is -1, must be finite and > 0".to_owned()));
    }
}
