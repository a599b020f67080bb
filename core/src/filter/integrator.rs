//! Dynamic extension inside the filter: an integrator whose state is commanded and not measured.

use alloc::boxed::Box;
use alloc::vec::Vec;

use super::{FilterState, NoDerivative, Report, SafetyFilter, SampleDerivative};
use crate::error::{Error, ErrorKind, length, positive};
use crate::lie::{DerivativeSource, Direction};
use crate::qp::Bounds;

/// A filter with an integrator between it and its plant. The filter inside is one of a plant whose state
/// [`Integration::state`] has the input [`Integration::input`] for its derivative, such as `SmallSlipBicycleWithRate` or
/// `KinematicBicycle` of the reference plants. The plant outside takes that state as its input. So x lacks it, and u and
/// u_ref have it in the place of its rate.
///
/// Over each period the filter's model has it change evenly. The plant is given its mean over the period, to be held;
/// the two differ by O(δ²) in the state at the end. The wish v for it becomes the rate `gain` (v − value), or the rate
/// that leads there within the period where that is less.
///
/// ```
/// # use punctual_core::{barriers::DistanceDisc, filter::*};
/// # use punctual_core::plants::SmallSlipBicycle;
/// let goal = DistanceDisc::new([45.0, 45.0], 2.0, 2.0)?;
/// let model = SmallSlipBicycle::new(10.0)?.with_rate();
/// let filter = SafetyFilter::builder(5, 2)
///     .barrier("goal", model, goal, BarrierSettings::within(10.0))?
///     .build()?;
/// // β, the last state, is the integral of input 1, and within 0.5 rad.
/// let beta = Integration { state: 4, input: 1, limits: [-0.5, 0.5], gain: 10.0 };
/// let mut filter = IntegratedFilter::new(filter, beta)?;
/// let mut u = [0.0; 2];
/// let report = filter.step(0.0, 0.01, &[0.0, 0.0, 0.5, 3.0], &[0.0; 2], &mut u)?;
/// assert!(report.status.is_satisfied());
/// assert_eq!(u[1], filter.value() / 2.0);
/// # Ok::<(), punctual_core::Error>(())
/// ```
pub struct IntegratedFilter {
    pub(super) filter: SafetyFilter,
    pub(super) of: Integration,
    /// The filter's bounds on the rate; those of a sample are tighter.
    pub(super) rates: [f64; 2],
    value: f64,
    /// Scratch: the filter's state and its direction.
    x: [Vec<f64>; 2],
    /// Scratch: the filter's u_ref and its direction.
    u_ref: [Vec<f64>; 2],
}

/// The input that an [`IntegratedFilter`] integrates.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Integration {
    /// The number of the filter's state that is integrated, counted from 0.
    pub state: usize,
    /// The number of the input that is its derivative, counted from 0.
    pub input: usize,
    /// Least and largest value of the state, in its unit; ±infinity where there is none. The value begins with the number
    /// nearest 0 within them.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub limits: [f64; 2],
    /// How fast the value follows the wish for it, 1/s, finite, > 0.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub gain: f64,
}

impl IntegratedFilter {
    /// Puts the integrator `of` before the plant of `filter`.
    ///
    /// # Errors
    ///
    /// A state or an input that there is not; limits that are not min ≤ max; bounds of the rate that exclude 0; a delayed
    /// filter; a gain out of range.
    pub fn new(filter: SafetyFilter, of: Integration) -> Result<Self, Error> {
        let Integration { state, input, limits, gain } = of;
        for (field, index, count) in [("state", state, filter.state_dim), ("input", input, filter.input_dim)]
        {
            if index >= count {
                let message = format!("is {index}, must be < {count}");
                return Err(Error::new(ErrorKind::Range, field, message));
            }
        }
        let [min, max] = limits;
        // Not-a-number fails too.
        if !(min <= max && min < f64::INFINITY && max > f64::NEG_INFINITY) {
            let message = format!("is [{min}, {max}], must be [min, max] with min <= max");
            return Err(Error::new(ErrorKind::Range, "limits", message));
        }
        let Bounds { min, max } = &filter.bounds;
        let rates = [min[input], max[input]];
        if rates[0] > 0.0 || rates[1] < 0.0 {
            let message = format!("is [{}, {}] for the rate, must contain 0", rates[0], rates[1]);
            return Err(Error::new(ErrorKind::Range, "bounds", message));
        }
        if filter.delay > 0.0 {
            let message = format!("is {}, must be 0 with an integrator", filter.delay);
            return Err(Error::new(ErrorKind::Unsupported, "actuation_delay", message));
        }
        positive("gain", gain)?;
        let x = [vec![0.0; filter.state_dim], vec![0.0; filter.state_dim]];
        let u_ref = [vec![0.0; filter.input_dim], vec![0.0; filter.input_dim]];
        let mut own = Self { filter, of, rates, value: 0.0, x, u_ref };
        own.set_value(0.0);
        Ok(own)
    }

    /// The filter inside, on the rate: to look at.
    pub fn filter(&self) -> &SafetyFilter {
        &self.filter
    }

    /// As [`SafetyFilter::rearm`]; the value stays.
    pub fn rearm(&mut self) {
        self.filter.rearm();
    }

    /// As [`SafetyFilter::set_deadline`].
    ///
    /// # Errors
    ///
    /// No such barrier; a deadline out of range.
    pub fn set_deadline(&mut self, index: usize, deadline: f64) -> Result<(), Error> {
        self.filter.set_deadline(index, deadline)
    }

    /// As [`SafetyFilter::set_source`]; the source has the state with the integral.
    ///
    /// # Errors
    ///
    /// No such barrier; a source of other dimensions or another relative degree.
    pub fn set_source(&mut self, index: usize, source: Box<dyn DerivativeSource>) -> Result<(), Error> {
        self.filter.set_source(index, source)
    }

    /// Puts back the state of the [filter](Self::filter) and the [`value`](Self::value).
    ///
    /// # Errors
    ///
    /// A state with another number of barriers.
    pub fn restore(&mut self, state: &FilterState, value: f64) -> Result<(), Error> {
        self.filter.restore(state)?;
        self.set_value(value);
        Ok(())
    }

    /// The number of the input that is integrated.
    pub fn input(&self) -> usize {
        self.of.input
    }

    /// The integral: the value at the end of the last step.
    pub fn value(&self) -> f64 {
        self.value
    }

    /// Puts back a [`Self::value`]; the nearest within the limits.
    pub fn set_value(&mut self, value: f64) {
        self.value = self.limited(value);
    }

    fn limited(&self, value: f64) -> f64 {
        value.max(self.of.limits[0]).min(self.of.limits[1])
    }

    /// Computes the safe input as [`SafetyFilter::step`] does, for an input that is held for `hold` seconds, finite,
    /// above 0. The report's rows are those of the filter, on the rate.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length; a time to hold that is out of range.
    pub fn step(
        &mut self,
        t: f64,
        hold: f64,
        x: &[f64],
        u_ref: &[f64],
        u: &mut [f64],
    ) -> Result<&Report, Error> {
        self.begin(hold, x, u_ref)?;
        self.filter.step(t, &self.x[0], &self.u_ref[0], u)?;
        self.value = self.finish(hold, u);
        Ok(self.filter.report())
    }

    /// The input of [`Self::step`], and the value after it, without remembering the sample.
    ///
    /// # Errors
    ///
    /// As for [`Self::step`].
    pub fn peek(&mut self, t: f64, hold: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Result<f64, Error> {
        self.peek_rate(t, hold, x, u_ref, u)?;
        Ok(self.finish(hold, u))
    }

    /// As [`SafetyFilter::differentiate`], of the result of [`Self::peek`]. The value after the step moves by twice as much
    /// as its mean.
    ///
    /// # Errors
    ///
    /// As for [`Self::step`]; a direction that is not finite.
    pub fn differentiate(
        &mut self,
        t: f64,
        hold: f64,
        x: &[f64],
        u_ref: &[f64],
        direction: Direction,
        out: &mut SampleDerivative,
    ) -> Result<Option<NoDerivative>, Error> {
        let unknown = self.differentiate_rate(t, hold, x, u_ref, direction, out)?;
        out.u[self.of.input] *= hold / 2.0;
        Ok(unknown)
    }

    /// The derivative of the filter's own answer, with the rate.
    pub(super) fn differentiate_rate(
        &mut self,
        t: f64,
        hold: f64,
        x: &[f64],
        u_ref: &[f64],
        direction: Direction,
        out: &mut SampleDerivative,
    ) -> Result<Option<NoDerivative>, Error> {
        self.begin(hold, x, u_ref)?;
        length("dx", direction.x.len(), x.len())?;
        length("du_ref", direction.u.len(), u_ref.len())?;
        insert(&mut self.x[1], direction.x, self.of.state, 0.0);
        self.u_ref[1].copy_from_slice(direction.u);
        self.u_ref[1][self.of.input] *= self.follows(hold);
        let ([x, dx], [u_ref, du_ref]) = (&self.x, &self.u_ref);
        self.filter.differentiate(t, x, u_ref, Direction { x: dx, u: du_ref }, out)
    }

    /// The rate for `hold` s of each unit between the value and the wish for it, in 1/s.
    pub(super) fn follows(&self, hold: f64) -> f64 {
        self.of.gain.min(1.0 / hold)
    }

    /// The filter's own answer, with the rate.
    pub(super) fn peek_rate(
        &mut self,
        t: f64,
        hold: f64,
        x: &[f64],
        u_ref: &[f64],
        u: &mut [f64],
    ) -> Result<(), Error> {
        self.begin(hold, x, u_ref)?;
        self.filter.peek(t, &self.x[0], &self.u_ref[0], u).map(|_| ())
    }

    /// Completes state, wish and bounds of the filter for a sample.
    fn begin(&mut self, hold: f64, x: &[f64], u_ref: &[f64]) -> Result<(), Error> {
        let hold = positive("hold", hold)?;
        let follows = self.follows(hold);
        let Self { filter, of: Integration { state, input, limits, .. }, value, .. } = self;
        let (state, input, value) = (*state, *input, *value);
        length("x", x.len(), filter.state_dim - 1)?;
        length("u_ref", u_ref.len(), filter.input_dim)?;
        insert(&mut self.x[0], x, state, value);
        self.u_ref[0].copy_from_slice(u_ref);
        self.u_ref[0][input] = (u_ref[input] - value) * follows;
        // 0 is within these too, since the value is within its limits.
        filter.bounds.min[input] = self.rates[0].max((limits[0] - value) / hold);
        filter.bounds.max[input] = self.rates[1].min((limits[1] - value) / hold);
        filter.bounded = filter.bounds != Bounds::NONE;
        Ok(())
    }

    /// The rate for `hold` s if nothing but the bounds were in the way of the `wish` for the value.
    #[cfg(feature = "plan")]
    pub(super) fn wanted(&self, hold: f64, wish: f64) -> f64 {
        let ends = self.of.limits.map(|limit| (limit - self.value) / hold);
        let rate = (wish - self.value) * self.follows(hold);
        rate.max(self.rates[0].max(ends[0])).min(self.rates[1].min(ends[1]))
    }

    /// How that rate moves with the `wish`, in 1/s: not at all beyond the bounds.
    #[cfg(feature = "plan")]
    pub(super) fn moves(&self, hold: f64, wish: f64) -> f64 {
        let follows = self.follows(hold);
        if self.wanted(hold, wish) == (wish - self.value) * follows { follows } else { 0.0 }
    }

    /// Puts the mean over `hold` s in the place of the rate; returns the value then.
    pub(super) fn finish(&self, hold: f64, u: &mut [f64]) -> f64 {
        let rate = u[self.of.input];
        u[self.of.input] = self.limited(self.value + rate * hold / 2.0);
        self.limited(self.value + rate * hold)
    }
}

/// `to` = `from` with `value` put in at `place`.
pub(super) fn insert(to: &mut [f64], from: &[f64], place: usize, value: f64) {
    to[..place].copy_from_slice(&from[..place]);
    to[place] = value;
    to[place + 1..].copy_from_slice(&from[place..]);
}
