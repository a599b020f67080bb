//! The builder of a filter. It checks every number, so that no step can fail on one.

use alloc::borrow::ToOwned;
use alloc::boxed::Box;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;

use super::rows::{
    self, BarrierSlot, MeasurementErrors, Requirement, Rows, Scratch, SharedPlants, Workspace,
};
use super::{
    BarrierReport, BarrierSettings, Begin, End, Filter, FilterState, MOST_LATE, Report, Sampling, Sent,
    Strictness,
};
use crate::barrier::Barrier;
use crate::convergence::condition::Condition;
use crate::convergence::profile::Profile;
use crate::convergence::{FixedTime, FixedTimeState};
use crate::dynamics::{ControlAffine, WithPoint};
use crate::error::{Error, ErrorKind, length, non_negative, positive};
use crate::lie::{self, DerivativeSource};
use crate::qp::{self, Bounds, Enforcement, Row};
use crate::{MAX_INPUTS, MAX_RELATIVE_DEGREE, MAX_ROWS};

/// A plant with barriers and bounds, for a [`Filter`]. All barriers are along the one plant `P`, with `NX` states and `NU`
/// inputs. Without type arguments it is a builder of barriers from [sources](Filter::from_sources) alone.
///
/// [`profile`](Self::profile), [`condition`](Self::condition), [`window`](Self::window) and
/// [`strictness`](Self::strictness) belong to the barrier added last.
pub struct FilterBuilder<P = (), const NX: usize = 0, const NU: usize = 0> {
    plant: Arc<P>,
    parts: Parts,
}

/// What a builder collects, whatever the plant.
struct Parts {
    /// Number of states of the plant, of measured quantities after them in x, and of inputs.
    state_dim: usize,
    measured: usize,
    input_dim: usize,
    slots: Vec<BarrierSlot>,
    bounds: Bounds,
    correction_limit: f64,
    brief_search: bool,
    sampling: Sampling,
    period_max: f64,
    arm_after: f64,
    delay: f64,
    errors: Vec<f64>,
}

impl FilterBuilder {
    /// The ‖u − u_ref‖ beyond which a row counts as out of reach of the inputs, in units of u.
    pub const DEFAULT_CORRECTION_LIMIT: f64 = 1e6;
}

impl<P, const NX: usize, const NU: usize> FilterBuilder<P, NX, NU> {
    pub(super) fn new(plant: P, [state_dim, input_dim]: [usize; 2]) -> Self {
        let parts = Parts {
            state_dim,
            measured: 0,
            input_dim,
            slots: Vec::new(),
            bounds: Bounds::NONE,
            correction_limit: FilterBuilder::DEFAULT_CORRECTION_LIMIT,
            brief_search: false,
            sampling: Sampling::default(),
            period_max: 0.0,
            arm_after: 0.0,
            delay: 0.0,
            errors: Vec::new(),
        };
        Self { plant: Arc::new(plant), parts }
    }

    /// Adds a barrier along the plant; `name` is for messages and reports. Its relative degree is detected on built-in sample
    /// states ([`lie::detected`]).
    ///
    /// # Errors
    ///
    /// A relative degree that does not exist or is not uniform (details in [`Error::relative_degree`]); settings outside
    /// their ranges.
    ///
    /// ```
    /// # use punctual_core::{barriers::DistanceDisc, filter::*};
    /// # use punctual_core::plants::SmallSlipBicycle;
    /// let goal = DistanceDisc::new([45.0, 45.0], 2.0, 2.0)?;
    /// let refused = Filter::builder(SmallSlipBicycle::new(10.0)?)
    ///     .barrier("goal", goal, BarrierSettings::within(10.0))
    ///     .err()
    ///     .map(|error| error.to_string());
    /// assert_eq!(
    ///     refused.as_deref(),
    ///     Some(
    ///         "goal.relative_degree: is mixed: u[2] enters derivative 1, u[1] enters derivative 2 of h; one \
    ///          constraint cannot use both, so put an integrator before the input that enters first \
    ///          (dynamics::IntegratedInput)"
    ///     )
    /// );
    /// # Ok::<(), punctual_core::Error>(())
    /// ```
    pub fn barrier<B>(self, name: &str, barrier: B, settings: BarrierSettings) -> Result<Self, Error>
    where
        P: ControlAffine<NX, NU> + Send + Sync + 'static,
        B: Barrier<NX> + Send + 'static,
    {
        let n = lie::detected(&*self.plant, &barrier).require(None).map_err(|e| e.within(name))?;
        let source = lie::along(Arc::clone(&self.plant), barrier, n)?;
        self.source(name, source, settings)
    }

    /// Adds a barrier of the declared relative degree `n`. It is compared with the one found at the states `samples` at t =
    /// 0: for a plant or barrier whose domain the built-in samples miss.
    ///
    /// To use a barrier against that finding, make its source with [`lie::along`] and [`Self::plant`], and add it with
    /// [`Self::source`], which checks at run time only.
    ///
    /// # Errors
    ///
    /// As for [`Self::barrier`]; the relative degree found is not `n`.
    pub fn barrier_of_degree<B>(
        self,
        name: &str,
        barrier: B,
        (n, samples): (usize, &[[f64; NX]]),
        settings: BarrierSettings,
    ) -> Result<Self, Error>
    where
        P: ControlAffine<NX, NU> + Send + Sync + 'static,
        B: Barrier<NX> + Send + 'static,
    {
        let found = lie::relative_degree(&*self.plant, &barrier, 0.0, samples);
        let n = found.require(Some(n)).map_err(|e| e.within(name))?;
        let source = lie::along(Arc::clone(&self.plant), barrier, n)?;
        self.source(name, source, settings)
    }

    /// The plant, for sources that share it with the barriers added here.
    pub fn plant(&self) -> Arc<P> {
        Arc::clone(&self.plant)
    }

    /// The same builder without the plant in its type, for a plant that is chosen at run time. Further barriers are
    /// [sources](Self::source).
    pub fn erased(self) -> FilterBuilder {
        FilterBuilder { plant: Arc::new(()), parts: self.parts }
    }

    /// Adds a barrier of any relative degree, from any source of its derivatives (such as [`lie::along`]).
    ///
    /// # Errors
    ///
    /// Dimensions that are not the filter's; settings outside their ranges.
    pub fn source(
        mut self,
        name: &str,
        source: Box<dyn DerivativeSource>,
        settings: BarrierSettings,
    ) -> Result<Self, Error> {
        self.parts.add(name, source, settings)?;
        Ok(self)
    }

    /// Adds a barrier that follows a measured point: one of the plant [beside a point](WithPoint), of `EXTENDED` = `NX` + 4
    /// states. The position and the velocity of its own point are appended to x. What is known of how the point moves is
    /// for [plans](super::Plans::motion); rows take its velocity as constant.
    ///
    /// # Errors
    ///
    /// As for [`Self::barrier`].
    pub fn following<B, const EXTENDED: usize>(
        mut self,
        name: &str,
        barrier: B,
        settings: BarrierSettings,
    ) -> Result<Self, Error>
    where
        P: ControlAffine<NX, NU> + Send + Sync + 'static,
        B: Barrier<EXTENDED> + Send + 'static,
    {
        let beside = WithPoint::<_, NX>(Arc::clone(&self.plant));
        let n = lie::detected::<_, _, EXTENDED, NU>(&beside, &barrier).require(None);
        let n = n.map_err(|e| e.within(name))?;
        let first = self.parts.state_dim + self.parts.measured;
        self.parts.measured += 4;
        let source = lie::following::<_, _, NX, EXTENDED, NU>(self.plant(), barrier, n, first)?;
        self.source(name, source, settings)
    }

    /// Appends `count` numbers to x, after the states of the plant: quantities that only some barriers depend on, such as the
    /// position and velocity of a point that one [follows](lie::following), or derivatives from
    /// [elsewhere](lie::external()). Default: 0.
    ///
    /// ```
    /// use std::sync::Arc;
    ///
    /// # use punctual_core::{barriers::{DistanceDisc, Outside}, filter::*, lie};
    /// # use punctual_core::plants::Unicycle;
    /// // x = (x_p, y_p, θ, v, p_x, p_y, v_x, v_y): a goal, and a vehicle at p to keep away from, as `following` adds it.
    /// let clear = Outside(DistanceDisc::new([0.0, 0.0], 2.0, 2.0)?.following(4));
    /// let builder = Filter::builder(Unicycle).measured(4);
    /// let source = lie::following::<_, _, 4, 8, 2>(builder.plant(), clear, 2, 4)?;
    /// let filter = builder
    ///     .barrier("goal", DistanceDisc::new([45.0, 45.0], 2.0, 2.0)?, BarrierSettings::within(10.0))?
    ///     .source("clear", source, BarrierSettings::keeping())?
    ///     .build()?;
    /// # Ok::<(), punctual_core::Error>(())
    /// ```
    #[must_use]
    pub fn measured(mut self, count: usize) -> Self {
        self.parts.measured = count;
        self
    }

    /// Makes room for so many barriers in all, where memory is short: they are not moved as more are added.
    #[must_use]
    pub fn room_for(mut self, barriers: usize) -> Self {
        self.parts.slots.reserve_exact(barriers.saturating_sub(self.parts.slots.len()));
        self
    }

    /// Makes the last barrier added follow a custom profile ([`FixedTime::with_profile`]).
    ///
    /// # Errors
    ///
    /// No barrier yet; a barrier with another method than the reference profile.
    ///
    /// ```
    /// # use punctual_core::{barriers::DistanceDisc, convergence::profile::Hermite, filter::*};
    /// # use punctual_core::plants::PointMass;
    /// use punctual_core::convergence::profile::Profile;
    ///
    /// // Arrive in nine tenths of the time.
    /// let early = |anchor: &[f64], deadline: f64, elapsed: f64| Hermite.evaluate(anchor, 0.9 * deadline, elapsed);
    /// let filter = Filter::builder(PointMass)
    ///     .barrier("goal", DistanceDisc::new([45.0, 45.0], 2.0, 2.0)?, BarrierSettings::within(10.0))?
    ///     .profile(early)?
    ///     .build()?;
    /// # Ok::<(), punctual_core::Error>(())
    /// ```
    pub fn profile(mut self, profile: impl Profile + Send + Sync + 'static) -> Result<Self, Error> {
        let Some(slot) = self.parts.slots.last_mut() else {
            return Err(Error::new(ErrorKind::Dimension, "profile", "there is no barrier yet to follow it"));
        };
        let named = |e: Error| e.within(&slot.name);
        slot.promise = slot.promise.clone().with_profile(profile).map_err(named)?;
        Ok(self)
    }

    /// Replaces the last barrier's method by a custom constraint ([`FixedTime::with_condition`]), such as one of the crate
    /// `punctual-reference`.
    ///
    /// # Errors
    ///
    /// No barrier yet; settings that the constraint would override.
    ///
    /// ```
    /// # use punctual_core::{barriers::DistanceDisc, filter::*};
    /// # use punctual_core::plants::PointMass;
    /// use punctual_reference::baselines::Exponential;
    ///
    /// let filter = Filter::builder(PointMass)
    ///     .barrier("goal", DistanceDisc::new([45.0, 45.0], 2.0, 2.0)?, BarrierSettings::within(10.0))?
    ///     .condition(Exponential::repeated(2, 1.5)?)?
    ///     .build()?;
    /// # Ok::<(), punctual_core::Error>(())
    /// ```
    pub fn condition(mut self, condition: impl Condition + Send + Sync + 'static) -> Result<Self, Error> {
        let Some(slot) = self.parts.slots.last_mut() else {
            return Err(Error::new(ErrorKind::Dimension, "condition", "there is no barrier yet to have it"));
        };
        let named = |e: Error| e.within(&slot.name);
        slot.promise = slot.promise.clone().with_condition(condition).map_err(named)?;
        Ok(self)
    }

    /// Sets when the last barrier added begins and ceases to be enforced. Default: at once and never.
    ///
    /// ```
    /// # use punctual_core::{barriers::DistanceDisc, filter::*};
    /// # use punctual_core::plants::PointMass;
    /// // In A by 5 s, then in B by 10 s.
    /// let disc = |x| DistanceDisc::new([x, 0.0], 2.0, 2.0);
    /// let filter = Filter::builder(PointMass)
    ///     .barrier("A", disc(20.0)?, BarrierSettings::within(5.0))?
    ///     .window(Begin::AtOnce, End::OnArrival)?
    ///     .barrier("B", disc(-20.0)?, BarrierSettings::within(10.0))?
    ///     .window(Begin::AfterArrival(0), End::Never)?
    ///     .build()?;
    /// # Ok::<(), punctual_core::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// No barrier yet; a time out of range; an end before the deadline, which would promise nothing; beginning with the
    /// arrival of a barrier that was not added before, or ending with its own.
    pub fn window(mut self, begin: Begin, end: End) -> Result<Self, Error> {
        self.parts.set_window(begin, end)?;
        Ok(self)
    }

    /// Sets how the last barrier added is treated if not all can be met. Default: [`Strictness::KeepFirst`].
    ///
    /// # Errors
    ///
    /// No barrier yet; a penalty that is not finite or ≤ 0.
    pub fn strictness(mut self, strictness: Strictness) -> Result<Self, Error> {
        let Some(slot) = self.parts.slots.last_mut() else {
            return Err(Error::new(
                ErrorKind::Dimension,
                "strictness",
                "there is no barrier yet to have one",
            ));
        };
        if let Strictness::Soft(penalty) = strictness {
            positive("penalty", penalty).map_err(|e| e.within(&slot.name))?;
        }
        slot.strictness = strictness;
        Ok(self)
    }

    /// Bounds the input: `min[i]` ≤ u_i ≤ `max[i]`, in units of u; ±infinity for no bound. Default: none.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length, NaN, a lower bound above its upper bound, a lower bound of +infinity or an upper bound
    /// of −infinity.
    pub fn bounds(mut self, min: &[f64], max: &[f64]) -> Result<Self, Error> {
        length("u_min", min.len(), self.parts.input_dim)?;
        length("u_max", max.len(), self.parts.input_dim)?;
        // `build` refuses more inputs than that.
        for (i, (&low, &high)) in min.iter().zip(max).enumerate().take(MAX_INPUTS) {
            let range = |field: &str, message: String| {
                Err(Error::new(ErrorKind::Range, format!("{field}[{}]", i + 1), message))
            };
            if low.is_nan() || low == f64::INFINITY {
                return range("u_min", format!("is {low}, must be a number or -infinity"));
            }
            if high.is_nan() || high == f64::NEG_INFINITY {
                return range("u_max", format!("is {high}, must be a number or +infinity"));
            }
            if low > high {
                return range("u_min", format!("is {low}, must be <= u_max[{}] = {high}", i + 1));
            }
            self.parts.bounds.min[i] = low;
            self.parts.bounds.max[i] = high;
        }
        Ok(self)
    }

    /// Sets the ‖u − u_ref‖ beyond which a row counts as out of reach of the inputs; finite, > 0, in units of u.
    /// Default: [`FilterBuilder::DEFAULT_CORRECTION_LIMIT`].
    ///
    /// # Errors
    ///
    /// A limit that is not finite or ≤ 0.
    pub fn correction_limit(mut self, limit: f64) -> Result<Self, Error> {
        self.parts.correction_limit = positive("correction_limit", limit)?;
        Ok(self)
    }

    /// Sets whether the search for an input that meets the rows over the period is brief, for a loop whose longest step has to be
    /// known: it takes at most 700 predictions of each barrier and 80 quadratic programs, and not some thousands. A row that needs a
    /// longer one counts as not met, and the input is the best that was found. Promises need each step met, as always. Default:
    /// `false`.
    #[must_use]
    pub fn brief_search(mut self, is_brief: bool) -> Self {
        self.parts.brief_search = is_brief;
        self
    }

    /// Chooses how to account for inputs that are held between samples. Default: [`Sampling::Measured`].
    ///
    /// # Errors
    ///
    /// A period that is not finite or ≤ 0.
    pub fn sampling(mut self, sampling: Sampling) -> Result<Self, Error> {
        self.parts.sampling = sampling.validated()?;
        Ok(self)
    }

    /// Sets the longest time in s that may pass between two samples, finite, > 0. Promises then hold for steps of any length
    /// up to it. A longer step suspends them until the next sample shows that they can be given again. Default: the period
    /// that [`Sampling`] assumes.
    ///
    /// # Errors
    ///
    /// A time that is not finite or ≤ 0.
    pub fn period_max(mut self, longest: f64) -> Result<Self, Error> {
        self.parts.period_max = positive("period_max", longest)?;
        Ok(self)
    }

    /// Sets the time in s, finite, ≥ 0, from the filter's first sample until it is armed: every deadline counts from the
    /// first sample with valid inputs after that. Default: 0, the first sample itself. For a loop that passes zeros, or has
    /// to settle, before it is under way.
    ///
    /// Until then nothing is asked and nothing is promised: the input is u_ref within its bounds, the status
    /// [`NotArmed`](super::Status::NotArmed). From then on every bit is that of a filter whose first sample came then.
    /// [`Filter::rearm`] does not make it wait again.
    ///
    /// # Errors
    ///
    /// A time that is not finite or < 0.
    pub fn arm_after(mut self, seconds: f64) -> Result<Self, Error> {
        self.parts.arm_after = non_negative("arm_after", seconds)?;
        Ok(self)
    }

    /// Sets the time in s, finite, ≥ 0, from a sample until its input acts: one communication step under a master that first
    /// exchanges all values (Jacobi). Default: 0.
    ///
    /// Until then the inputs of earlier samples act, one after another; before the first, 0 or the nearest admissible input. The
    /// delay may span up to 250 samples: at more of them than a filter [remembers](super::MAX_SENT) nothing is guaranteed. The
    /// constraint is enforced from the predicted state at t + delay on. In every barrier report all values but
    /// [`h`](super::BarrierReport::h) refer to that time. Deadlines count from the first sample itself.
    ///
    /// # Errors
    ///
    /// A delay that is not finite or < 0.
    pub fn actuation_delay(mut self, delay: f64) -> Result<Self, Error> {
        self.parts.delay = non_negative("actuation_delay", delay)?;
        Ok(self)
    }

    /// Bounds the errors of the measured state: |x̂_i − x_i| ≤ `errors[i]` at every sample, finite, ≥ 0, in the unit
    /// of x_i. The promises then hold for the true state, to first order in the errors. Default: none.
    ///
    /// Needs a prediction over the period, and a method that allows for errors: the reference profile, or a custom condition
    /// that says so. `deadline_unreachable` then stays false until the deadline has passed, and there are no directional
    /// derivatives. A step takes about four times the work per measured state.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length, an error that is not finite or < 0.
    pub fn measurement_errors(mut self, errors: &[f64]) -> Result<Self, Error> {
        length("measurement_errors", errors.len(), self.parts.state_dim + self.parts.measured)?;
        for (i, &error) in errors.iter().enumerate() {
            non_negative(&format!("measurement_errors[{}]", i + 1), error)?;
        }
        self.parts.errors = errors.to_vec();
        Ok(self)
    }

    /// Builds the filter, not yet anchored.
    ///
    /// # Errors
    ///
    /// No barrier, or more than [`MAX_ROWS`]; no state or input, or more than [`MAX_INPUTS`] inputs. An actuation delay that
    /// spans more than 250 given sampling periods or a deadline, or over which a source cannot predict. Measurement errors with a delay, without a
    /// prediction over the period, with a method that does not allow for them, or with a source that gives no derivatives
    /// along a direction.
    pub fn build(self) -> Result<Filter, Error> {
        self.parts.build()
    }
}

/// Checks that an input that is `delay` s late can act before a `deadline`.
pub(super) fn check_deadline(deadline: f64, delay: f64) -> Result<(), Error> {
    match deadline <= delay {
        true => {
            let message = format!("is {deadline}, must be > actuation_delay = {delay}: no input acts before");
            Err(Error::new(ErrorKind::Range, "deadline", message))
        }
        false => Ok(()),
    }
}

/// The number of inputs on their way to make room for.
fn room_for_sent(delay: f64, period: f64) -> usize {
    if delay > 0.0 { (delay / period).min(MOST_LATE) as usize + 3 } else { 0 }
}

impl Filter {
    /// The most bytes that building a filter without integrator, measurement errors and plans allocates, besides its sources:
    /// for so many barriers and states, a delay with the sampling, and whether the longest period is given.
    #[doc(hidden)]
    pub fn memory(
        (barriers, states): (usize, usize),
        (delay, sampling, brief_search): (f64, Sampling, bool),
        period_max: bool,
    ) -> usize {
        /// What an allocation takes beyond its bytes.
        const ROUNDING: usize = 2 * size_of::<usize>();
        let period = if let Sampling::Period(period) = sampling { period } else { 0.0 };
        let sent = room_for_sent(delay, period);
        let numbers = states * size_of::<f64>() + ROUNDING;
        let state = barriers * size_of::<FixedTimeState>() + sent * size_of::<Sent>() + 2 * ROUNDING;
        let row = size_of::<Row>() + size_of::<Enforcement>() + size_of::<Requirement>();
        let each = size_of::<BarrierSlot>() + size_of::<BarrierReport>() + 2 * numbers;
        size_of::<Self>()
            + barriers * each
            + 3 * state
            + rows::most(barriers, period_max, rows::rounds(sampling, brief_search)) * row
            + SharedPlants::MEMORY
            + 12 * ROUNDING
    }
}

/// Checks that a source is along a plant of `states` and `inputs`, and depends on no more than the quantities measured
/// beside them.
///
/// # Errors
///
/// Other dimensions.
pub(super) fn check_dims(
    source: &dyn DerivativeSource,
    [states, measured, inputs]: [usize; 3],
) -> Result<(), Error> {
    let needed = source.state_dim();
    length("x", needed, if needed > states { needed.min(states + measured) } else { states })?;
    length("u", source.input_dim(), inputs)
}

impl Parts {
    fn add(
        &mut self,
        name: &str,
        source: Box<dyn DerivativeSource>,
        settings: BarrierSettings,
    ) -> Result<(), Error> {
        check_dims(&*source, [self.state_dim, self.measured, self.input_dim]).map_err(|e| e.within(name))?;
        let promise = FixedTime::new(source.relative_degree(), settings).map_err(|e| e.within(name))?;
        self.slots.push(BarrierSlot::new(name, source, promise));
        Ok(())
    }

    fn set_window(&mut self, begin: Begin, end: End) -> Result<(), Error> {
        let Some(index) = self.slots.len().checked_sub(1) else {
            return Err(Error::new(ErrorKind::Dimension, "window", "there is no barrier yet to have one"));
        };
        let slot = &mut self.slots[index];
        let named = |e: Error| e.within(&slot.name);
        let range = |field: &str, message: String| Err(named(Error::new(ErrorKind::Range, field, message)));
        let mut opens = 0.0;
        match begin {
            Begin::AtOnce => {}
            Begin::At(seconds) => {
                opens = non_negative("begin", seconds).map_err(named)?;
                let deadline = slot.promise.deadline();
                if opens >= deadline {
                    return range("begin", format!("is {opens}, must be < deadline = {deadline}"));
                }
            }
            Begin::AfterArrival(other) if other >= index => {
                return range("begin", format!("waits for barrier {other}, must be one added before"));
            }
            Begin::AfterArrival(_) => {}
        }
        match end {
            End::At(seconds) if positive("end", seconds).map_err(named)? <= opens => {
                return range("end", format!("is {seconds}, must be > begin = {opens}"));
            }
            End::AfterStay(seconds) => _ = positive("end", seconds).map_err(named)?,
            End::AfterArrival(other) if other == index => {
                return range("end", format!("waits for barrier {other} itself, must be another one"));
            }
            _ => {}
        }
        // After the arrival of another barrier, the deadline counts from there.
        let deadline = slot.promise.deadline();
        if let (Begin::AtOnce | Begin::At(_), End::At(seconds)) = (begin, end)
            && deadline.is_finite()
            && seconds < deadline
        {
            return range(
                "end",
                format!("is {seconds}, must be >= deadline = {deadline}, the promise to keep"),
            );
        }
        (slot.begin, slot.end) = (begin, end);
        Ok(())
    }

    fn build(self) -> Result<Filter, Error> {
        let Self {
            state_dim: states,
            measured,
            input_dim,
            mut slots,
            bounds,
            correction_limit,
            brief_search,
            sampling,
            period_max,
            arm_after,
            delay,
            errors,
        } = self;
        let state_dim = states + measured;
        // Dimensions.
        let dimension = |field, message| Err(Error::new(ErrorKind::Dimension, field, message));
        if slots.is_empty() {
            return dimension("barriers", "is empty, must have at least 1".to_owned());
        }
        if let Some((slot, other)) = slots.iter().find_map(|slot| match slot.end {
            End::AfterArrival(other) if other >= slots.len() => Some((slot, other)),
            _ => None,
        }) {
            let message = format!("waits for barrier {other}, must be one of {} from 0", slots.len());
            return Err(Error::new(ErrorKind::Range, "end", message).within(&slot.name));
        }
        if slots.len() > MAX_ROWS {
            return dimension(
                "barriers",
                format!("has {} entries, must have at most {MAX_ROWS}", slots.len()),
            );
        }
        if state_dim == 0 {
            return dimension("x", "has 0 components, must have at least 1".to_owned());
        }
        if input_dim == 0 || input_dim > MAX_INPUTS {
            return dimension("u", format!("has {input_dim} components, must have 1 to {MAX_INPUTS}"));
        }
        let deadlines = slots.iter().map(|slot| slot.promise.deadline());
        let first_period = sampling.first(deadlines.fold(f64::INFINITY, f64::min));
        // The inputs on their way are remembered, and every source has to predict over the delay.
        let period = if let Sampling::Period(period) = sampling { period } else { first_period };
        let sent = delay / period;
        if sent > MOST_LATE
            && let Sampling::Period(_) = sampling
        {
            let message = format!("is {delay}, must be <= {MOST_LATE} times sampling_period = {period}");
            return Err(Error::new(ErrorKind::Range, "actuation_delay", message));
        }
        for slot in &slots {
            check_deadline(slot.promise.deadline(), delay).map_err(|e| e.within(&slot.name))?;
        }
        if delay > 0.0
            && let Some(slot) = slots.iter().find(|slot| slot.source.predict().is_none())
        {
            let message = "the barrier's source of derivatives cannot predict the state";
            return Err(Error::new(ErrorKind::Unsupported, "actuation_delay", message).within(&slot.name));
        }
        // Measurement errors.
        let errors = MeasurementErrors::new(&errors);
        if !errors.is_exact() {
            rows::check_all_errors(&mut slots, sampling, delay)?;
        }
        for slot in &mut slots {
            slot.now.from = vec![0.0; state_dim];
            slot.now.slopes = vec![[0.0; MAX_RELATIVE_DEGREE]; errors.count()];
        }
        // State and workspace, allocated once: a step does not allocate.
        let barriers = vec![FixedTimeState::default(); slots.len()];
        let sent = Vec::with_capacity(room_for_sent(delay, period));
        let state = FilterState { barriers, sent, ..FilterState::default() };
        let most_rows = rows::most(slots.len(), period_max > 0.0, rows::rounds(sampling, brief_search));
        let workspace = Workspace {
            rows: vec![Row::ZERO; most_rows],
            enforcement: vec![Enforcement::Hard { priority: 0 }; most_rows],
            requirements: Vec::with_capacity(most_rows),
            next: state.clone(),
            scratch: vec![0.0; state_dim],
            report: Report::new(slots.len()),
            search: Scratch::new(SharedPlants::of(&mut slots)),
            qp: qp::Workspace::new(),
            #[cfg(feature = "plan")]
            decided: None,
        };
        let rows = Rows {
            state_dim,
            measured,
            input_dim,
            slots,
            bounded: bounds != Bounds::NONE,
            bounds,
            correction_limit,
            sampling,
            delay,
            errors,
            first_period,
            period_max,
            arm_after,
            expected: None,
            is_backed: false,
            brief_search,
            state,
            workspace,
        };
        Ok(Filter {
            rows,
            integrator: None,
            #[cfg(feature = "plan")]
            backup: None,
            expected: None,
        })
    }
}
