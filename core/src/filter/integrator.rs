//! Dynamic extension inside the filter: an integrator whose state is commanded and not measured.

use super::{NoDerivative, Report, SafetyFilter, SampleDerivative};
use crate::error::{Error, ErrorKind, length, positive};
use crate::qp::Bounds;

/// An integrator between a filter and its plant. The filter is one of a plant whose state `state` has the input
/// `input` for its derivative, such as `SmallSlipBicycleWithRate` or
/// `KinematicBicycle` of the reference plants; the plant outside takes that state as its input. So
/// x lacks it, and u and u_ref have it in the place of its rate.
///
/// Over each period the filter's model has it change evenly. The plant is given its mean over the period, to be held;
/// the two differ by O(δ²) in the state at the end. The wish v for it becomes the rate `gain` (v − value), or the rate
/// that leads there within the period where that is less.
///
/// ```
/// # use punctual_core::{barriers::DistanceDisc, filter::*};
/// # use punctual_reference::plants::SmallSlipBicycle;
/// let goal = DistanceDisc::new([45.0, 45.0], 2.0, 2.0)?;
/// let model = SmallSlipBicycle::new(10.0)?.with_rate();
/// let mut filter = SafetyFilter::builder(5, 2)
///     .barrier("goal", model, goal, BarrierSettings::within(10.0))?
///     .build()?;
/// // β, the last state, is the integral of input 1, and within 0.5 rad.
/// let mut beta = Integrator::new(&filter, (4, 1), [-0.5, 0.5], 10.0)?;
/// let mut u = [0.0; 2];
/// let report = beta.step(&mut filter, 0.0, 0.01, &[0.0, 0.0, 0.5, 3.0], &[0.0; 2], &mut u)?;
/// assert!(report.status.is_satisfied());
/// assert_eq!(u[1], beta.value() / 2.0);
/// # Ok::<(), punctual_core::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Integrator {
    state: usize,
    input: usize,
    limits: [f64; 2],
    /// The filter's bounds on the rate; those of a sample are tighter.
    rates: [f64; 2],
    gain: f64,
    value: f64,
    /// Scratch: the filter's state and its direction.
    x: [Vec<f64>; 2],
    /// Scratch: the filter's u_ref and its direction.
    u_ref: [Vec<f64>; 2],
}

impl Integrator {
    /// An integrator for a `filter` whose state number `place.0` is the integral of its input number `place.1`, both
    /// counted from 0. The value stays within `limits` and begins with the one nearest 0. `gain` in 1/s, finite, > 0.
    ///
    /// # Errors
    ///
    /// A place that is none; limits that are not min ≤ max; bounds of the rate that exclude 0; a delayed filter; a gain
    /// out of range.
    pub fn new(
        filter: &SafetyFilter,
        (state, input): (usize, usize),
        limits: [f64; 2],
        gain: f64,
    ) -> Result<Self, Error> {
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
        let x = [vec![0.0; filter.state_dim], vec![0.0; filter.state_dim]];
        let u_ref = [vec![0.0; filter.input_dim], vec![0.0; filter.input_dim]];
        let mut own =
            Self { state, input, limits, rates, gain: positive("gain", gain)?, value: 0.0, x, u_ref };
        own.set_value(0.0);
        Ok(own)
    }

    /// The number of the input that is integrated.
    pub fn input(&self) -> usize {
        self.input
    }

    /// The integral: the value at the end of the last step.
    pub fn value(&self) -> f64 {
        self.value
    }

    /// Restores a value that [`Self::value`] returned, or the nearest within the limits.
    pub fn set_value(&mut self, value: f64) {
        self.value = self.limited(value);
    }

    fn limited(&self, value: f64) -> f64 {
        value.max(self.limits[0]).min(self.limits[1])
    }

    /// Computes the safe input as [`SafetyFilter::step`] does, for an input that is held for `hold` seconds, finite,
    /// above 0. The report's rows are those of the filter, on the rate.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length; a time to hold that is out of range.
    pub fn step<'f>(
        &mut self,
        filter: &'f mut SafetyFilter,
        t: f64,
        hold: f64,
        x: &[f64],
        u_ref: &[f64],
        u: &mut [f64],
    ) -> Result<&'f Report, Error> {
        self.begin(filter, hold, x, u_ref)?;
        let report = filter.step(t, &self.x[0], &self.u_ref[0], u)?;
        let after = self.finish(hold, u);
        self.value = after;
        Ok(report)
    }

    /// Computes what [`Self::step`] would, and the value after it, without remembering the sample.
    ///
    /// # Errors
    ///
    /// As for [`Self::step`].
    pub fn peek(
        &mut self,
        filter: &mut SafetyFilter,
        t: f64,
        hold: f64,
        x: &[f64],
        u_ref: &[f64],
        u: &mut [f64],
    ) -> Result<f64, Error> {
        self.begin(filter, hold, x, u_ref)?;
        filter.peek(t, &self.x[0], &self.u_ref[0], u)?;
        Ok(self.finish(hold, u))
    }

    /// Computes the derivative of what [`Self::peek`] gives, as [`SafetyFilter::differentiate`] does. The value after
    /// the step moves by twice what its mean does.
    ///
    /// # Errors
    ///
    /// As for [`Self::step`]; a direction that is not finite.
    pub fn differentiate(
        &mut self,
        filter: &mut SafetyFilter,
        (t, hold): (f64, f64),
        [x, dx]: [&[f64]; 2],
        [u_ref, du_ref]: [&[f64]; 2],
        out: &mut SampleDerivative,
    ) -> Result<Option<NoDerivative>, Error> {
        self.begin(filter, hold, x, u_ref)?;
        length("dx", dx.len(), x.len())?;
        length("du_ref", du_ref.len(), u_ref.len())?;
        insert(&mut self.x[1], dx, self.state, 0.0);
        self.u_ref[1].copy_from_slice(du_ref);
        self.u_ref[1][self.input] *= self.gain.min(1.0 / hold);
        let ([x, dx], [u_ref, du_ref]) = (&self.x, &self.u_ref);
        let unknown = filter.differentiate(t, [x, dx], [u_ref, du_ref], out)?;
        out.u[self.input] *= hold / 2.0;
        Ok(unknown)
    }

    /// Completes state, wish and bounds of the filter for a sample.
    fn begin(&mut self, filter: &mut SafetyFilter, hold: f64, x: &[f64], u_ref: &[f64]) -> Result<(), Error> {
        length("x", x.len(), filter.state_dim - 1)?;
        length("u_ref", u_ref.len(), filter.input_dim)?;
        let hold = positive("hold", hold)?;
        insert(&mut self.x[0], x, self.state, self.value);
        self.u_ref[0].copy_from_slice(u_ref);
        let wish = &mut self.u_ref[0][self.input];
        *wish = (*wish - self.value) * self.gain.min(1.0 / hold);
        // 0 is within these too, since the value is within its limits.
        filter.bounds.min[self.input] = self.rates[0].max((self.limits[0] - self.value) / hold);
        filter.bounds.max[self.input] = self.rates[1].min((self.limits[1] - self.value) / hold);
        filter.bounded = filter.bounds != Bounds::NONE;
        Ok(())
    }

    /// Puts the mean over `hold` s in the place of the rate; returns the value then.
    fn finish(&self, hold: f64, u: &mut [f64]) -> f64 {
        let rate = u[self.input];
        u[self.input] = self.limited(self.value + rate * hold / 2.0);
        self.limited(self.value + rate * hold)
    }
}

/// `to` = `from` with `value` put in at `place`.
fn insert(to: &mut [f64], from: &[f64], place: usize, value: f64) {
    to[..place].copy_from_slice(&from[..place]);
    to[place] = value;
    to[place + 1..].copy_from_slice(&from[place..]);
}
