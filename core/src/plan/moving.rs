//! A barrier that follows a measured point, as plans see it: a function of time and of the states of the plant.
//!
//! A point that was measured at c, with the velocity v, is τ s later within
//!
//! ```math
//! |c(t) - c - v \tau| \le \rho(\tau) = \varepsilon + \varepsilon' \tau + \frac{1}{2} a \tau^2, \tag{1}
//! ```
//!
//! with the errors ε and ε′ of the two measurements, and the bound a on its acceleration. If h changes by at most σ per metre by
//! which the point is moved, then
//!
//! ```math
//! h(t, x, c(t)) \ge h(t, x, c + v \tau) - \sigma \rho(\tau). \tag{2}
//! ```
//!
//! So plans keep the right side. Without errors the points that (1) allows from a later measurement are among those from an
//! earlier one, and a plan that was checked before stays one.

use core::ops::{Add, Mul};

use crate::elementary;
use crate::interval::Interval;
use crate::jet::Tangent;
use crate::lie::{Ahead, EXPANSION_ORDERS, Expansion, ExpansionOver, Follows, Predict, RateOver, Second};

/// What is known of how a measured point moves, for [`Plans::motion`](crate::filter::Plans::motion).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Motion {
    /// By how much its velocity changes at most, in m/s², finite, ≥ 0. Default 0: it goes on as it was measured.
    pub acceleration: f64,
    /// How far it may be from where it is measured, in m, finite, ≥ 0. Default 0.
    pub position_error: f64,
    /// How far its velocity may be from the one measured, in m/s, finite, ≥ 0. Default 0.
    pub velocity_error: f64,
}

impl Motion {
    /// How far in m the point may be, `seconds` after it was measured, from where it would be at constant velocity.
    pub(crate) fn radius(&self, seconds: f64) -> f64 {
        let Self { acceleration, position_error, velocity_error } = *self;
        position_error + (velocity_error + 0.5 * acceleration * seconds) * seconds
    }
}

/// A measurement of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Course {
    /// When, in s.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub(crate) since: f64,
    /// Its two coordinates in m, and its velocity in m/s.
    pub(crate) point: [f64; 4],
    /// Until when, in s, a plan keeps its barrier; infinite if that is not yet known.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub(crate) until: f64,
}

impl Course {
    /// The point at `t` if it goes on with the same velocity.
    fn at(&self, t: f64) -> [f64; 4] {
        let ([x, y, v_x, v_y], after) = (self.point, t - self.since);
        [x + v_x * after, y + v_y * after, v_x, v_y]
    }

    /// By how much in m the point `later` is farther away than `motion` allows; ≤ 0 if it is not.
    pub(crate) fn strays(&self, motion: &Motion, later: &Self) -> f64 {
        let (expected, found) = (self.at(later.since), later.point);
        let away = elementary::hypot(found[0] - expected[0], found[1] - expected[1]);
        away - motion.radius(later.since - self.since) - motion.position_error
    }
}

/// The barrier `of` while its point moves on as `course` says, within `motion`.
#[derive(Clone, Copy)]
pub(crate) struct Moving<'a> {
    of: &'a dyn Follows,
    course: Course,
    /// The coefficients of σρ in the time since the measurement.
    falls: [f64; 3],
}

impl<'a> Moving<'a> {
    /// `None` where h has no bound on its change, unless the motion is known exactly.
    pub(crate) fn new(of: &'a dyn Follows, course: Course, motion: &Motion) -> Option<Self> {
        let Motion { acceleration, position_error, velocity_error } = *motion;
        let radii = [position_error, velocity_error, 0.5 * acceleration];
        let falls = match of.steepness() {
            Some(steepness) => radii.map(|radius| steepness * radius),
            None if *motion == Motion::default() => [0.0; 3],
            None => return None,
        };
        Some(Self { of, course, falls })
    }

    /// The coefficients, `after` s later, of what the point may take off h.
    fn falls<T>(&self, after: T) -> [T; 3]
    where
        T: Copy + From<f64> + Add<Output = T> + Mul<Output = T>,
    {
        let [at_once, steadily, faster] = self.falls.map(T::from);
        let slower = faster * after;
        [at_once + (steadily + slower) * after, steadily + slower + slower, faster]
    }

    /// Enclosures of the point at the enclosed `time`.
    fn enclosed(&self, time: Interval) -> [Interval; 4] {
        let ([x, y, v_x, v_y], after) = (self.course.point, time - self.course.since);
        [after * v_x + x, after * v_y + y, v_x.into(), v_y.into()]
    }

    /// The expansions of a point that is at `at`.
    fn path_from<T: Copy + From<f64>>(at: [T; 4]) -> [[T; EXPANSION_ORDERS]; 4] {
        core::array::from_fn(|i| {
            let mut path = [T::from(0.0); EXPANSION_ORDERS];
            path[0] = at[i];
            if i < 2 {
                path[1] = at[i + 2];
            }
            path
        })
    }
}

impl Predict for Moving<'_> {
    fn flow(&self, x: &mut [f64], u: &[f64], duration: f64) {
        self.of.alone().flow(x, u, duration);
    }

    fn ahead(&self, _: f64, _: &[f64], _: &[f64], _: f64, out: &mut Ahead) {
        *out = Ahead::ZERO;
    }

    fn rate(&self, x: &[f64], u: &[f64], out: &mut [f64]) {
        self.of.alone().rate(x, u, out);
    }

    fn path(&self, x: &[f64], u: &[f64], out: &mut [Expansion]) {
        self.of.alone().path(x, u, out);
    }

    fn value(&self, t: f64, x: &[f64]) -> f64 {
        self.of.value(t, x, &self.course.at(t)) - self.falls(t - self.course.since)[0]
    }

    fn value_along(&self, t: f64, path: &[Expansion], out: &mut Expansion) {
        self.of.value_along(t, path, &Self::path_from(self.course.at(t)), out);
        for (out, falls) in out.iter_mut().zip(self.falls(t - self.course.since)) {
            *out -= falls;
        }
    }

    fn rates_over(&self, path: &[ExpansionOver], u: &[f64], orders: usize, out: &mut [RateOver]) -> bool {
        self.of.alone().rates_over(path, u, orders, out)
    }

    fn value_over(&self, time: Interval, path: &[ExpansionOver]) -> Option<Interval> {
        let h = self.of.value_over(time, path, &Self::path_from(self.enclosed(time)));
        Some(h - self.falls(time - self.course.since)[0])
    }

    fn last_over(&self, time: Interval, path: &[ExpansionOver]) -> Option<Interval> {
        // What the point may take off h has three coefficients only.
        Some(self.of.last_over(time, path, &Self::path_from(self.enclosed(time))))
    }

    fn second_rates(&self, x: &[Second], u: &[Second], out: &mut [Second]) -> bool {
        self.of.alone().second_rates(x, u, out)
    }

    fn second_value(&self, time: Interval, x: &[Second]) -> Option<Second> {
        let known =
            |value: Interval| Second { value: Tangent { value, ..Tangent::from(0.0) }, ..Second::from(0.0) };
        let mut h = self.of.second_value(time, x, &self.enclosed(time).map(known));
        h.value.value -= self.falls(time - self.course.since)[0];
        Some(h)
    }

    fn is_still(&self, _: &[f64]) -> Option<bool> {
        Some(self.course.point[2..] == [0.0; 2] && self.falls[1..] == [0.0; 2])
    }

    fn lowest_from(&self, t: f64, x: &[f64]) -> Option<f64> {
        match self.is_still(x) {
            Some(true) => Some(self.value(t, x)),
            _ => Some(f64::NEG_INFINITY),
        }
    }
}
