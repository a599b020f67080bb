//! The safety filter: from time, state and reference input to a safe input and a report.
//!
//! A [`Filter`] has rows, one per barrier. On request it also has an integrator before one of its inputs, and backup plans:
//!
//! | module | owns |
//! |---|---|
//! | `rows` | the constraints of a sample, the QP under them, its derivative |
//! | `integrator` | an input that is commanded as the integral of one of the filter's own inputs |
//! | `backup` | the plan behind every input, and the guarantee that rests on it |
//! | `state` | all that is remembered between samples: plain data; everything else can be rebuilt without changing a bit |

#[cfg(feature = "plan")]
mod backup;
mod builder;
mod integrator;
mod questions;
mod report;
mod rows;
mod sampling;
mod state;

pub use crate::convergence::{
    FixedTimeSettings as BarrierSettings, Infeasible, Method, Phase, ProfileKind, Refusal,
};
#[cfg(feature = "plan")]
pub use crate::plan::Motion;
#[cfg(feature = "plan")]
pub use backup::{
    Appraisal, Assurance, AssuranceStatus, Bears, Driver, PlanState, Planning, Plans, Reason, Remedy,
    TabledPlan, UncertaintyKind,
};
pub use builder::FilterBuilder;
pub use integrator::Integration;
pub use report::{BarrierReport, Report, Status};
pub use rows::{BarrierDerivative, Begin, Curvature, End, NoDerivative, SampleDerivative, Strictness};
pub use sampling::Sampling;
use state::MOST_LATE;
pub use state::{FilterState, MAX_SENT, Sent};

use alloc::boxed::Box;

#[cfg(feature = "plan")]
use crate::MAX_INPUTS;
use crate::convergence::FixedTimeState;
use crate::dynamics::ControlAffine;
use crate::error::{Error, ErrorKind, length, positive};
use crate::lie::{DerivativeSource, Direction};
#[cfg(feature = "plan")]
use backup::Backup;
use integrator::Integrator;
use rows::{BarrierSlot, Rows, SharedPlants};

/// Round-off of a time that is a sum of steps, as a part of that time.
const SAME_TIME: f64 = 1e-12;

/// Two periods count as equal if they differ by less than this part of their size.
const SAME_PERIOD: f64 = 1e-6;

/// A filter on the input, made of barriers with deadlines. It solves `min ½‖u − u_ref‖²` under one row per barrier and the
/// input bounds. [With plans](Self::with_plans) every input has a verified backup plan behind it.
///
/// # Requirements
///
/// The plant is control-affine, and every barrier has the relative degree that it was declared with. Inputs are held between
/// samples ([`Sampling`]). By the rows alone, a barrier's guarantee needs every step satisfied ([`Status::is_satisfied`]);
/// [`BarrierReport::on_course`] says whether the conditions of its theorem have held so far. With plans the guarantee is
/// [`BarrierReport::guaranteed`].
///
/// # References
///
/// The paper, section III; the module [`crate::convergence`]; `docs/theory.md#backup-plan` for plans.
pub struct Filter {
    rows: Rows,
    integrator: Option<Integrator>,
    #[cfg(feature = "plan")]
    backup: Option<Box<Backup>>,
    /// The time in s for which the next input will be held, if known. Used with an integrator or with plans.
    expected: Option<f64>,
}

impl Filter {
    /// Starts a filter for `plant`, along which all its barriers are.
    pub fn builder<P, const NX: usize, const NU: usize>(plant: P) -> FilterBuilder<P, NX, NU>
    where
        P: ControlAffine<NX, NU>,
    {
        FilterBuilder::new(plant, [NX, NU])
    }

    /// Starts a filter for `state_dim` states and `input_dim` inputs, whose barriers are [sources](FilterBuilder::source) of
    /// derivatives: of models that are known at run time only, or of derivatives computed elsewhere.
    pub fn from_sources(state_dim: usize, input_dim: usize) -> FilterBuilder {
        FilterBuilder::new((), [state_dim, input_dim])
    }

    /// Puts an integrator between the filter and its plant. Call it before adding plans.
    ///
    /// # Errors
    ///
    /// The index of a state or an input that does not exist; limits that are not min ≤ max; bounds of the rate that exclude
    /// 0; a delayed filter; a gain out of range; a filter that already has an integrator or plans.
    pub fn with_integrator(mut self, of: Integration) -> Result<Self, Error> {
        #[cfg(feature = "plan")]
        if self.backup.is_some() {
            let message = "comes after the plans, must come before them";
            return Err(Error::new(ErrorKind::Unsupported, "integrator", message));
        }
        if self.integrator.is_some() {
            return Err(Error::new(
                ErrorKind::Unsupported,
                "integrator",
                "is a second one, must be the only one",
            ));
        }
        let integrator = Integrator::new(&self.rows, of)?;
        self.rows.state.integrated = integrator.limited(0.0);
        self.integrator = Some(integrator);
        // A hold that was known before is that of the integral.
        self.expected = self.rows.expected.take();
        Ok(self)
    }

    /// Computes the safe input at time `t` and remembers the sample. The first call with valid inputs anchors every barrier:
    /// its deadline counts from that `t`.
    ///
    /// - `t`: time in s; later calls pass later times (an earlier one counts as the anchor's).
    /// - `x`: the state, in the plant's order and units.
    /// - `u_ref`: the input that the controller in charge asks for.
    /// - `u`: receives the safe input, which is always finite and within the bounds.
    ///
    /// Does not allocate, except for plans. Numerical outcomes (infeasible, no control authority, NaN inputs) are reported
    /// as [`Status`], never as an error.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length; an integrated input whose hold is not known ([`Self::expect_hold`]).
    ///
    /// ```
    /// # use punctual_core::{barriers::DistanceDisc, filter::*};
    /// # use punctual_core::plants::PointMass;
    /// let mut filter = Filter::builder(PointMass)
    ///     .barrier("goal", DistanceDisc::new([45.0, 45.0], 2.0, 2.0)?, BarrierSettings::within(10.0))?
    ///     .build()?;
    /// let mut u = [0.0; 2];
    /// let error = filter.step(0.0, &[0.0; 3], &[0.0; 2], &mut u).unwrap_err();
    /// assert_eq!(error.to_string(), "x: has 3 components, must have 4");
    /// # Ok::<(), punctual_core::Error>(())
    /// ```
    pub fn step(&mut self, t: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Result<&Report, Error> {
        self.sample(t, x, u_ref, u)?;
        let Rows { state, workspace, .. } = &mut self.rows;
        state.take_rows(&mut workspace.next);
        #[cfg(feature = "plan")]
        if let Some(backup) = &mut self.backup {
            core::mem::swap(&mut state.plan, &mut workspace.next.plan);
            backup.forget();
        }
        Ok(&workspace.report)
    }

    /// Remembers a sample whose input `u` something else has decided, such as a [follower](crate::follower), and reports on it:
    /// [`Self::step`] for a filter without integrator and plans, without solving anything. The status says whether every row holds
    /// at the sample under `u`.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length; a filter with an integrator or plans, which decide themselves.
    pub fn observe(&mut self, t: f64, x: &[f64], u: &[f64]) -> Result<&Report, Error> {
        if self.counts_holds() {
            let message = "is from elsewhere, must not be for a filter with an integrator or plans";
            return Err(Error::new(ErrorKind::Unsupported, "u", message));
        }
        let Self { rows, .. } = self;
        rows.observe(t, x, u)?;
        if rows.delay > 0.0 && t.is_finite() {
            rows.workspace.next.send(t, rows.delay, u);
        }
        let Rows { state, workspace, .. } = rows;
        state.take_rows(&mut workspace.next);
        Ok(&workspace.report)
    }

    /// Computes what [`Self::step`] would, without remembering the sample. With plans, the same step afterwards costs
    /// nothing.
    ///
    /// # Errors
    ///
    /// As for [`Self::step`].
    pub fn peek(&mut self, t: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Result<&Report, Error> {
        self.sample(t, x, u_ref, u)?;
        Ok(&self.rows.workspace.report)
    }

    /// Takes a sample, in the order rows, plan, integrator. Writes its input to `u`, and its report and the state after it
    /// to the workspace.
    fn sample(&mut self, t: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Result<(), Error> {
        let hold = self.hold(t)?;
        let Self { rows, integrator, .. } = self;
        #[cfg(feature = "plan")]
        if let Some(backup) = &mut self.backup {
            length("x", x.len(), rows.state_dim - usize::from(integrator.is_some()))?;
            length("u_ref", u_ref.len(), rows.input_dim)?;
            length("u", u.len(), rows.input_dim)?;
            if backup.recall(t, hold, x, u_ref, u) {
                return Ok(());
            }
            rows.is_backed = backup.is_behind(&rows.state.plan, t + rows.delay, hold, integrator.is_some());
        }
        // The rows, on the state of the model.
        match integrator {
            None => rows.sample(t, x, u_ref, u)?,
            Some(own) => {
                own.begin(rows, hold, x, u_ref)?;
                rows.sample(t, &own.x[0], &own.u_ref[0], u)?;
            }
        }
        // The plan behind their answer, or the input that replaces it.
        #[cfg(feature = "plan")]
        if let Some(backup) = &mut self.backup {
            backup.sample((rows, integrator.as_ref()), t, hold, x, u_ref, u);
        }
        // The mean of the integral replaces the rate, which a plan has to remember.
        #[cfg(feature = "plan")]
        let inside = self.backup.as_ref().map(|_| core::array::from_fn(|i| u.get(i).copied().unwrap_or(0.0)));
        if let Some(own) = integrator {
            rows.workspace.next.integrated = own.finish(rows.state.integrated, hold, u);
        }
        if rows.delay > 0.0 && t.is_finite() {
            rows.workspace.next.send(t, rows.delay, u);
        }
        #[cfg(feature = "plan")]
        if let (Some(backup), Some(inside)) = (&mut self.backup, inside) {
            backup.remember((t, hold), x, u_ref, u, inside);
        }
        Ok(())
    }

    /// Whether plans or an integrator need to know how long inputs are held ([`Self::expect_hold`]).
    pub fn counts_holds(&self) -> bool {
        #[cfg(feature = "plan")]
        if self.backup.is_some() {
            return true;
        }
        self.integrator.is_some()
    }

    /// Sets the time in s, finite, > 0, for which the input of the next sample will be held; `None` if it is not known. It
    /// is for callers that know it, such as a co-simulation slave from its step size. It is not part of [`Self::state`].
    ///
    /// Plans use it, or else their own period. An integrator uses it too, or else the sampling period. A filter with
    /// neither, under [`Sampling::Measured`], enforces its rows over this time at every sample.
    ///
    /// # Errors
    ///
    /// A time out of range.
    pub fn expect_hold(&mut self, hold: Option<f64>) -> Result<(), Error> {
        let hold = hold.map(|hold| positive("hold", hold)).transpose()?;
        *(if self.counts_holds() { &mut self.expected } else { &mut self.rows.expected }) = hold;
        Ok(())
    }

    /// The time in s for which the input at `t` will be held, where an integrator or plans use it; otherwise 0.
    fn hold(&self, t: f64) -> Result<f64, Error> {
        #[cfg(feature = "plan")]
        if let Some(backup) = &self.backup {
            return Ok(self.expected.unwrap_or(backup.period()));
        }
        match (&self.integrator, self.expected) {
            (None, _) => Ok(0.0),
            (Some(_), Some(hold)) => Ok(hold),
            (Some(_), None) => {
                let Rows { sampling, state, first_period, .. } = &self.rows;
                let period = sampling.period(state, t, *first_period, None).filter(|period| *period > 0.0);
                period.filter(|period| period.is_finite()).ok_or_else(|| {
                    let message = "is not known, must be given by `expect_hold` or as a sampling period";
                    Error::new(ErrorKind::Range, "hold", message)
                })
            }
        }
    }

    /// Computes the derivative of what [`Self::peek`] returns as x and u_ref move along `direction`. Remembers nothing; the
    /// report is that of the sample.
    ///
    /// The derivative is exact for the piece in force. The input is a piecewise smooth function: where the active rows, the
    /// active bounds, a phase or the better of two searches change, it has a kink or a jump. The derivative is that of the
    /// piece on which the sample was computed. A later deadline that was found at this sample
    /// ([`Infeasible::Earliest`]) is held constant. If more rows are active than the inputs can
    /// follow, the first ones count.
    ///
    /// Two parts are difference quotients. The change of the rate and of the margin chosen for a set that is kept
    /// ([`stay::keep`](crate::convergence::stay::keep)) is accurate to about 1e-8. All derivatives but that of h are
    /// accurate to about 1e-4 where the input depends on more than the rows: with [measurement
    /// errors](FilterBuilder::measurement_errors), where an instant between two samples counts, and where the search over
    /// the period did not end at the nearest input. Next to a kink they are those of the rows linearised at the answer, with
    /// errors and instants held constant.
    ///
    /// With plans, the piece is u_ref, the answer of the rows, the plan's own input, or a compromise between these. The
    /// plan's own input is held constant, since it was fixed at an earlier sample. If the plan is new, or its input comes
    /// from feedback, the derivative is the one that it would have as an existing plan. The value of an integrated input
    /// after the step moves by twice as much as its mean.
    ///
    /// By status:
    ///
    /// - [`Unchanged`](Status::Unchanged), [`SolverFailed`](Status::SolverFailed): the direction of u_ref, 0 in components
    ///   held by a bound.
    /// - [`Filtered`](Status::Filtered), [`Infeasible`](Status::Infeasible) and [`NoAuthority`](Status::NoAuthority): (8)
    ///   with the active rows, including those that hold back a row that cannot be met. Rows that were given up or left out
    ///   take no part. For a single row that cannot be met: 0 in the components at their bounds, the direction of u_ref in
    ///   the others.
    /// - [`InvalidInput`](Status::InvalidInput), [`Singular`](Status::Singular) and
    ///   [`WrongRelativeDegree`](Status::WrongRelativeDegree), where the input is a constant: all zero.
    /// - [`NotArmed`](Status::NotArmed): the direction of u_ref, 0 in components held by a bound; h as always.
    ///
    /// Does not allocate if `out` has been used with this filter before. A return value other than `None` says why the
    /// derivative is not known; `out` is then meaningless.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length; a direction that is not finite.
    ///
    /// ```
    /// # use punctual_core::{barriers::DistanceDisc, filter::*, lie::Direction};
    /// # use punctual_core::plants::PointMass;
    /// let mut filter = Filter::builder(PointMass)
    ///     .barrier("goal", DistanceDisc::new([45.0, 0.0], 2.0, 2.0)?, BarrierSettings::within(10.0))?
    ///     .build()?;
    /// let mut derivative = SampleDerivative::default();
    /// // Wanted sideways: the row, which is on the x axis, lets it pass. Wanted forwards: it makes up for it.
    /// for (du_ref, wanted) in [([0.0, 1.0], [0.0, 1.0]), ([1.0, 0.0], [0.0, 0.0])] {
    ///     let direction = Direction { x: &[0.0; 4], u: &du_ref };
    ///     let unknown =
    ///         filter.differentiate(0.0, &[0.0; 4], &[0.0; 2], direction, &mut derivative)?;
    ///     assert_eq!(unknown, None);
    ///     // Over the period of a tenth of a second the disc is a little round.
    ///     assert!((0..2).all(|i| (derivative.u[i] - wanted[i]).abs() < 1e-3), "{:?}", derivative.u);
    /// }
    /// # Ok::<(), punctual_core::Error>(())
    /// ```
    pub fn differentiate(
        &mut self,
        t: f64,
        x: &[f64],
        u_ref: &[f64],
        direction: Direction,
        out: &mut SampleDerivative,
    ) -> Result<Option<NoDerivative>, Error> {
        let hold = self.hold(t)?;
        #[cfg(feature = "plan")]
        let inside = match &self.backup {
            None => [0.0; MAX_INPUTS],
            Some(_) => {
                let mut u = [0.0; MAX_INPUTS];
                let inputs = self.rows.input_dim;
                self.sample(t, x, u_ref, &mut u[..inputs])?;
                self.backup.as_mut().and_then(|backup| backup.forget()).unwrap_or(u)
            }
        };
        let Self { rows, integrator, .. } = self;
        let unknown = match integrator {
            None => rows.differentiate(t, x, u_ref, direction, out),
            Some(own) => {
                own.begin(rows, hold, x, u_ref)?;
                own.begin_direction(rows, hold, direction)?;
                let ([x, dx], [u_ref, du_ref]) = (&own.x, &own.u_ref);
                rows.differentiate(t, x, u_ref, Direction { x: dx, u: du_ref }, out)
            }
        }?;
        #[cfg(feature = "plan")]
        if let Some(backup) = self.backup.as_ref().filter(|_| unknown.is_none()) {
            let of = (&*rows, integrator.as_ref());
            let carried = backup.carry(of, (t, hold), (x, u_ref), &inside, direction, out);
            if carried.is_some() {
                return Ok(carried);
            }
        }
        if let Some(own) = integrator {
            out.u[own.of.input] *= hold / 2.0;
        }
        Ok(unknown)
    }

    /// Forgets the anchors: the next sample with valid inputs starts every deadline again. An integrated input keeps its
    /// value. The time until the filter is [armed](FilterBuilder::arm_after) still counts from its first sample.
    ///
    /// With plans, the next valid sample decides what is promised. If it finds no other plan, the current one is followed as
    /// long as it keeps what is promised then. While x is not finite, the current plan is followed until there is a valid
    /// sample. If that sample is inside a set, the set has to be kept from there on, even one that was meant to be left once
    /// more before its deadline.
    pub fn rearm(&mut self) {
        let state = &mut self.rows.state;
        state.barriers.fill(FixedTimeState::default());
        (state.time, state.period, state.curvatures) = (None, None, [None; 2]);
        // Behind a delay it still acts, and what follows late still arrives.
        #[cfg(feature = "plan")]
        let is_late = self.backup.as_ref().is_some_and(|backup| backup.lags());
        #[cfg(not(feature = "plan"))]
        let is_late = false;
        if self.rows.delay == 0.0 && !is_late {
            state.input.fill(0.0);
        }
        #[cfg(feature = "plan")]
        if let Some(backup) = &mut self.backup {
            state.plan.rearm();
            backup.restart(&state.plan);
        }
    }

    /// The memory of the filter between samples.
    pub fn state(&self) -> &FilterState {
        &self.rows.state
    }

    /// Restores a state that [`Self::state`] returned: the filter continues exactly as it would have then. Rows accept the
    /// numbers of a state from elsewhere as they are: wrong numbers break promises, but the input stays finite and within
    /// its bounds. Plans are checked.
    ///
    /// # Errors
    ///
    /// A state with another number of barriers; more inputs on their way than [`MAX_SENT`], or none behind an actuation delay;
    /// a plan of another filter, or one that is damaged.
    pub fn restore(&mut self, state: &FilterState) -> Result<(), Error> {
        length("barriers", state.barriers.len(), self.rows.slots.len())?;
        if state.sent.len() > MAX_SENT {
            let message = format!("has {} entries, must have at most {MAX_SENT}", state.sent.len());
            return Err(Error::new(ErrorKind::Dimension, "sent", message));
        }
        if self.rows.delay > 0.0 && state.time.is_some() && state.sent.is_empty() {
            let message = format!("is empty, must have the inputs of the last {} s", self.rows.delay);
            return Err(Error::new(ErrorKind::Dimension, "sent", message));
        }
        #[cfg(feature = "plan")]
        if let Some(backup) = &self.backup {
            backup.check(&self.rows, state)?;
        }
        self.rows.state.clone_rows_from(state);
        let integrated = self.integrator.as_ref().map_or(0.0, |own| own.limited(state.integrated));
        self.rows.state.integrated = integrated;
        #[cfg(feature = "plan")]
        if let Some(backup) = &mut self.backup {
            self.rows.state.plan.clone_from(&state.plan);
            backup.restart(&self.rows.state.plan);
        }
        Ok(())
    }

    /// [`Self::restore`] without allocating, for a filter without plans: `write` fills a state of its own, whose lists have the room
    /// that they need, and returns whether to take it over. Returns whether it was.
    #[doc(hidden)]
    pub fn restore_by(&mut self, write: impl FnOnce(&mut FilterState) -> bool) -> bool {
        let Rows { state, workspace, delay, .. } = &mut self.rows;
        let next = &mut workspace.next;
        next.clone_rows_from(state);
        let is_whole = write(next)
            && next.barriers.len() == state.barriers.len()
            && next.sent.len() <= MAX_SENT
            && !(*delay > 0.0 && next.time.is_some() && next.sent.is_empty());
        if is_whole {
            next.integrated = self.integrator.as_ref().map_or(0.0, |own| own.limited(next.integrated));
            state.clone_rows_from(next);
        }
        is_whole
    }

    /// The report of the last [`Self::step`] or [`Self::peek`], on the input that it returned.
    pub fn report(&self) -> &Report {
        &self.rows.workspace.report
    }

    /// The number of the input that is integrated, if one is.
    pub fn integrated_input(&self) -> Option<usize> {
        self.integrator.as_ref().map(|own| own.of.input)
    }

    /// The integrated input at the end of the last step, in its unit; 0 where none is integrated.
    pub fn integrated(&self) -> f64 {
        self.rows.state.integrated
    }

    /// What [`Self::integrated`] would be after the sample of the last [`Self::peek`].
    pub fn next_integrated(&self) -> f64 {
        self.rows.workspace.next.integrated
    }

    /// Sets the [integrated input](Self::integrated) to the nearest value within its limits. Does nothing if none is
    /// integrated.
    pub fn set_integrated(&mut self, value: f64) {
        let Some(own) = &self.integrator else { return };
        self.rows.state.integrated = own.limited(value);
        #[cfg(feature = "plan")]
        if let Some(backup) = &mut self.backup {
            backup.forget();
        }
    }

    /// Gives barrier number `index` a new deadline in s, finite, > 0, counted from the next sample. Its promise starts again
    /// there, from the derivatives that h then has. Until then the input of the last sample keeps the old promise, and the
    /// new profile starts with a zero error: the guarantee has no gap.
    ///
    /// # Errors
    ///
    /// No such barrier; a deadline out of range, or within the actuation delay; a filter with plans.
    pub fn set_deadline(&mut self, index: usize, deadline: f64) -> Result<(), Error> {
        let delay = self.rows.delay;
        let slot = self.replaced("deadline", index)?;
        let named = |e: Error| e.within(&slot.name);
        let promise = slot.promise.clone().with_deadline(deadline).map_err(named)?;
        builder::check_deadline(deadline, delay).map_err(named)?;
        slot.promise = promise;
        slot.begin = Begin::AtOnce;
        self.rows.state.barriers[index] = FixedTimeState::default();
        Ok(())
    }

    /// Replaces the set of barrier number `index`, for example when a goal was moved. Its promise starts again at the next
    /// sample, as with [`Self::set_deadline`]. The source is along the model, which includes the integral of an integrated
    /// input.
    ///
    /// # Errors
    ///
    /// No such barrier; a source of other dimensions or another relative degree; a filter with plans.
    pub fn set_source(&mut self, index: usize, source: Box<dyn DerivativeSource>) -> Result<(), Error> {
        let Rows { state_dim, measured, input_dim, .. } = self.rows;
        let dims = [state_dim - measured, measured, input_dim];
        let exact = self.rows.errors.is_exact();
        let slot = self.replaced("source", index)?;
        let named = |e: Error| e.within(&slot.name);
        if !exact {
            rows::check_errors(&*source).map_err(named)?;
        }
        builder::check_dims(&*source, dims).map_err(named)?;
        let (found, wanted) = (source.relative_degree(), slot.source.relative_degree());
        if found != wanted {
            let message = format!("is {found}, must stay {wanted}");
            return Err(named(Error::new(ErrorKind::RelativeDegree, "relative_degree", message)));
        }
        slot.source = source;
        self.rows.workspace.search.evaluations.plants = SharedPlants::of(&mut self.rows.slots);
        self.rows.state.barriers[index] = FixedTimeState::default();
        self.rows.state.curvatures = [None; 2];
        Ok(())
    }

    /// Barrier number `index`, whose `field` is to be replaced.
    fn replaced(&mut self, field: &str, index: usize) -> Result<&mut BarrierSlot, Error> {
        #[cfg(feature = "plan")]
        if self.backup.is_some() {
            let message = "cannot be replaced where plans are followed: what is promised was decided with it; build another filter";
            return Err(Error::new(ErrorKind::Unsupported, field, message));
        }
        let _ = field;
        let count = self.rows.slots.len();
        let message = || format!("is {index}, must be < {count}, the number of barriers");
        self.rows.slots.get_mut(index).ok_or_else(|| Error::new(ErrorKind::Range, "barrier", message()))
    }
}
