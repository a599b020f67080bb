//! The derivatives of a barrier, as the filter asks for them, from any source.

use alloc::boxed::Box;
use alloc::sync::Arc;
use core::any::Any;

use super::{Ahead, Derivatives};
use crate::MAX_RELATIVE_DEGREE;
use crate::interval::Interval;
use crate::jet::Tangent;

/// A source of the derivatives of one barrier. [`along`](super::along()) makes one from the traits,
/// [`external`](super::external()) takes derivatives that are computed elsewhere, and users can implement their own.
///
/// The first four methods are all that a filter needs. The others return the further abilities of a source:
///
/// | method | for |
/// |---|---|
/// | [`predict`](Self::predict) | constraints over the sampling period ([`Sampling`](crate::filter::Sampling)), delayed inputs |
/// | [`directional`](Self::directional) | [`Filter::differentiate`](crate::filter::Filter::differentiate) |
/// | [`predict_directional`](Self::predict_directional) | the same over the sampling period, and measurement errors |
/// | [`highest`](Self::highest) | deadlines that are lost ([`reach`](crate::reach)) |
/// | [`shared`](Self::shared) | the speed of filters with several barriers along one plant |
pub trait DerivativeSource: Send {
    /// n, in 1 ..= [`MAX_RELATIVE_DEGREE`].
    fn relative_degree(&self) -> usize;

    /// Number of states.
    fn state_dim(&self) -> usize;

    /// Number of inputs.
    fn input_dim(&self) -> usize;

    /// Writes the derivatives at time `t` (s) and state `x` (of [`Self::state_dim`] components).
    fn evaluate(&self, t: f64, x: &[f64], out: &mut Derivatives);

    /// The source as one that knows the plant, if it does. The default does not.
    fn predict(&self) -> Option<&dyn Predict> {
        None
    }

    /// The source as one that differentiates along a direction, if it does. The default does not.
    fn directional(&self) -> Option<&dyn Directional> {
        None
    }

    /// The source as one that differentiates its predictions along a direction, if it does. The default does not.
    fn predict_directional(&self) -> Option<&dyn PredictDirectional> {
        None
    }

    /// The source as one that shares work with others along the same plant, if it does. The default does not.
    fn shared(&self) -> Option<&dyn SharedPlant> {
        None
    }

    /// The source as one whose barrier follows a measured point, if it does. The default does not.
    fn follows(&self) -> Option<&dyn Follows> {
        None
    }

    /// An upper bound on h between `time[0]` and `time[1]` s after `t` and `x`, under any input with `bounds[0]` ≤ u ≤
    /// `bounds[1]`; for [`crate::reach`]. The default knows none.
    fn highest(&self, _t: f64, _x: &[f64], _bounds: [&[f64]; 2], _time: [f64; 2]) -> Option<f64> {
        None
    }
}

/// The predictions of a source with a model of the plant, under a held input.
pub trait Predict {
    /// Moves `x` by `duration` ≥ 0 seconds under the held input `u`.
    fn flow(&self, x: &mut [f64], u: &[f64], duration: f64);

    /// Writes the derivatives of h `duration` ≥ 0 seconds after `t` and `x` under the held input `u`, at time `t +
    /// duration`.
    fn ahead(&self, t: f64, x: &[f64], u: &[f64], duration: f64, out: &mut Ahead);

    /// Writes what [`Self::ahead`] does for k < n, which is what a row over the period uses. The other numbers of `out` are
    /// meaningless.
    fn ahead_of_row(&self, t: f64, x: &[f64], u: &[f64], duration: f64, out: &mut Ahead) {
        self.ahead(t, x, u, duration, out);
    }

    /// Writes the values that [`Self::ahead`] does for k ≤ n, without gradients.
    fn values_ahead(
        &self,
        t: f64,
        x: &[f64],
        u: &[f64],
        duration: f64,
        out: &mut [f64; MAX_RELATIVE_DEGREE + 1],
    ) {
        let mut ahead = Ahead::ZERO;
        self.ahead(t, x, u, duration, &mut ahead);
        *out = ahead.value;
    }

    /// Writes what [`Self::values_ahead`] does for k < n, with the same bits. The other numbers of `out` are meaningless.
    fn values_of_row(
        &self,
        t: f64,
        x: &[f64],
        u: &[f64],
        duration: f64,
        out: &mut [f64; MAX_RELATIVE_DEGREE + 1],
    ) {
        self.values_ahead(t, x, u, duration, out);
    }

    /// Writes ẋ at `x` under `u`.
    fn rate(&self, x: &[f64], u: &[f64], out: &mut [f64]);

    /// Writes the expansion of every state, starting at `x`, under the held input `u`. The default has none and writes NaN,
    /// which no plan accepts.
    fn path(&self, _x: &[f64], _u: &[f64], out: &mut [Expansion]) {
        out.fill([f64::NAN; EXPANSION_ORDERS]);
    }

    /// Whether h at a given state depends on component `state` of it: false only where it certainly does not. The default is true.
    fn reads(&self, state: usize) -> bool {
        let _ = state;
        true
    }

    /// h at time `t` (s) and state `x`.
    fn value(&self, t: f64, x: &[f64]) -> f64;

    /// Writes the expansion of h along `path`, which holds the expansions of all states, starting at `t`. The default has none
    /// and writes NaN.
    fn value_along(&self, _t: f64, _path: &[Expansion], out: &mut Expansion) {
        out.fill(f64::NAN);
    }

    /// Writes enclosures of the first `orders` coefficients, 1 to [`EXPANSION_ORDERS`] − 1, of ẋ under `u`: as a series in
    /// time that begins anywhere on a stretch of a path, from the enclosures of the expansions of all states that begin
    /// there. Returns whether it did. The default has none; curvature of the plant's motion between the instants at which it
    /// is evaluated then remains unseen.
    fn rates_over(&self, _path: &[ExpansionOver], _u: &[f64], _orders: usize, _out: &mut [RateOver]) -> bool {
        false
    }

    /// An enclosure of h on such a stretch, for the enclosed times (s). The default has none; curvature of h between the
    /// instants at which it is evaluated then remains unseen.
    fn value_over(&self, _time: Interval, _path: &[ExpansionOver]) -> Option<Interval> {
        None
    }

    /// The same for the last coefficient of the expansion of h that begins anywhere on that stretch.
    fn last_over(&self, _time: Interval, _path: &[ExpansionOver]) -> Option<Interval> {
        None
    }

    /// A lower bound on h until `duration` s after `t` and `x` under the held input `u`, including narrow dips in between. A
    /// bound below `wanted` is as near to the least value as can be had. −∞ if nothing bounds h. The default knows none.
    fn lowest_held(&self, _t: f64, _x: &[f64], _u: &[f64], _duration: f64, _wanted: f64) -> Option<f64> {
        None
    }

    /// Writes ẋ with its derivatives along two directions of x and u, on enclosures of them. Returns whether it did. The
    /// default has none; no plan then accounts for an uncertain plant.
    fn second_rates(&self, _x: &[Second], _u: &[Second], _out: &mut [Second]) -> bool {
        false
    }

    /// h with its derivatives along two directions of x, on enclosures of time (s) and of x. The default has none.
    fn second_value(&self, _time: Interval, _x: &[Second]) -> Option<Second> {
        None
    }

    /// Whether h at the state `x` is the same at all times, by its enclosures. The default does not know.
    fn is_still(&self, _x: &[f64]) -> Option<bool> {
        None
    }

    /// The least value of h from `t` on while the state remains `x`; for sets that move. The default knows none.
    fn lowest_from(&self, _t: f64, _x: &[f64]) -> Option<f64> {
        None
    }
}

/// A barrier that follows a measured point, for plans: the plant and the point apart. A point is its two coordinates and its
/// velocity.
pub trait Follows {
    /// The component of a filter's x at which the point begins.
    fn first(&self) -> usize;

    /// Which plant it is, without the point.
    fn plant(&self) -> PlantId;

    /// The plant without the point, whose states alone are x; it has no barrier, and its h is 0.
    fn alone(&self) -> &dyn Predict;

    /// The most by which h changes per metre by which the point is moved, if that has a bound.
    fn steepness(&self) -> Option<f64>;

    /// h at time `t` (s) and at the states `x` of the plant.
    fn value(&self, t: f64, x: &[f64], point: &[f64; 4]) -> f64;

    /// As [`Predict::value_along`].
    fn value_along(&self, t: f64, path: &[Expansion], point: &[Expansion; 4], out: &mut Expansion);

    /// As [`Predict::value_over`].
    fn value_over(&self, time: Interval, path: &[ExpansionOver], point: &[ExpansionOver; 4]) -> Interval;

    /// As [`Predict::last_over`].
    fn last_over(&self, time: Interval, path: &[ExpansionOver], point: &[ExpansionOver; 4]) -> Interval;

    /// As [`Predict::second_value`].
    fn second_value(&self, time: Interval, x: &[Second], point: &[Second; 4]) -> Second;
}

/// Which plant a source is along: one object in memory, which all of its sources share. Two objects are two plants, even if
/// their numbers are the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlantId {
    address: usize,
    dims: [usize; 2],
}

impl PlantId {
    /// The identity of `plant`, used with so many components of x and inputs.
    pub fn of<P: ?Sized>(plant: &Arc<P>, dims: [usize; 2]) -> Self {
        Self { address: Arc::as_ptr(plant).cast::<()>().addr(), dims }
    }
}

/// The part of a source's work that depends on the plant alone, so that barriers of one relative degree along one plant need
/// it only once. Sharing does not change a bit of the numbers.
///
/// Rooms hold what one method writes for another. Only sources of one relative degree along one [plant](Self::plant), whose
/// rooms are of the same types, know their contents.
pub trait SharedPlant {
    /// Which plant it is.
    fn plant(&self) -> PlantId;

    /// Rooms for [`Self::motion`] and for [`Self::motion_ahead`].
    fn rooms(&self) -> [Box<dyn Any + Send>; 2];

    /// Writes the motion of the states from `x` at u = 0, with its derivatives along u.
    fn motion(&self, x: &[f64], room: &mut dyn Any);

    /// Writes what [`DerivativeSource::evaluate`] does, from the motion that begins at time `t`.
    fn evaluate_along(&self, t: f64, motion: &dyn Any, out: &mut Derivatives);

    /// Writes the motion that begins `duration` ≥ 0 seconds after `x` under the held input `u`, with its derivatives along
    /// u.
    fn motion_ahead(&self, x: &[f64], u: &[f64], duration: f64, room: &mut dyn Any);

    /// Writes what [`Predict::ahead_of_row`] does, from the motion ahead, which begins at time `t`.
    fn ahead_of_row_along(&self, t: f64, motion: &dyn Any, out: &mut Ahead);
}

/// A quantity as a function of time since an instant: its first Taylor coefficients there, of τ⁰, τ¹ …
pub type Expansion = [f64; EXPANSION_ORDERS];

/// Enclosures of the coefficients of an [`Expansion`] that begins anywhere on a stretch of time.
pub type ExpansionOver = [Interval; EXPANSION_ORDERS];

/// The same for its rate, which has one coefficient less.
pub type RateOver = [Interval; EXPANSION_ORDERS - 1];

/// Number of coefficients of a rate that suffice for most of a plan, at a fifth of the cost of all.
pub(crate) const FEW_ORDERS: usize = 4;

/// Number of coefficients of an [`Expansion`]. With ten, a vehicle that turns by half a radian is resolved to 1e-9.
pub const EXPANSION_ORDERS: usize = 10;

/// The derivatives of h at an instant, differentiated along a direction.
pub trait Directional {
    /// Writes the derivative along `direction` of h⁽⁰⁾ … h⁽ⁿ⁾ at time `t`, state `x` and input `u`, and of the gradient of
    /// each with respect to u.
    fn evaluate_directional(&self, t: f64, x: &[f64], u: &[f64], direction: Direction, out: &mut Ahead);
}

/// The predictions of [`Predict`], differentiated along a direction.
pub trait PredictDirectional {
    /// Moves `x` as [`Predict::flow`] does, and the direction `dx` by the derivative of that.
    fn flow_directional(&self, x: &mut [f64], dx: &mut [f64], u: &[f64], duration: f64);

    /// Writes the derivative along `direction` of what [`Predict::ahead`] writes.
    fn ahead_directional(
        &self,
        t: f64,
        x: &[f64],
        u: &[f64],
        direction: Direction,
        duration: f64,
        out: &mut Ahead,
    );
}

/// The direction of a derivative: how state and input move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction<'a> {
    /// The direction of the state, with as many components.
    pub x: &'a [f64],
    /// The direction of the input, or of the reference input, with as many components.
    pub u: &'a [f64],
}

/// An enclosure of a number, of its derivatives along two directions, and of its second derivative along both.
pub type Second = Tangent<Tangent<Interval>>;
