//! The safety filter: from time, state and reference input to a safe input and a report.
//!
//! A step is in `step`, in the order of the mathematics: evaluate the derivatives of every barrier, move its
//! phase, build its row, solve the QP, report. [`FilterState`] is all that is remembered between samples: plain
//! data. Everything else can be rebuilt without changing a bit of the result.

#[cfg(feature = "plan")]
mod assured;
mod builder;
#[cfg(feature = "plan")]
mod deviation;
mod errors;
mod hold;
mod integrator;
mod outlook;
mod questions;
mod report;
mod sampling;
mod search;
mod sensitivity;
mod shared;
mod slot;
mod step;

pub use crate::convergence::{
    FixedTimeSettings as BarrierSettings, Infeasible, Method, Phase, ProfileKind, Refusal,
};
#[cfg(feature = "plan")]
pub use assured::{Assurance, AssuredFilter, Commitment, Driver, Pace, Reason, Standing};
pub use builder::FilterBuilder;
pub use integrator::{IntegratedFilter, Integration};
pub use report::{BarrierReport, Report, Status};
pub use sampling::Sampling;
pub use search::Bend;
pub use sensitivity::{BarrierDerivative, NoDerivative, SampleDerivative};
pub use slot::{Begin, End, Strictness};

use alloc::boxed::Box;
use alloc::vec::Vec;

use crate::MAX_INPUTS;
use crate::convergence::FixedTimeState;
use crate::error::{Error, ErrorKind, length, positive};
use crate::lie::DerivativeSource;
use crate::qp::{self, Bounds, Enforcement, Problem, Residuals, Row};
use errors::MeasurementErrors;
use search::Requirement;
use shared::SharedPlants;
use slot::BarrierSlot;

/// The memory of a filter between samples: one promise per barrier, the times that [`Sampling`] needs, and where the search
/// for the next input begins.
///
/// With the feature `serde` it can be written to a file, bit for bit (serde_json needs its feature `float_roundtrip` for
/// that). Infinities are words in formats for people, as JSON has none. [`SafetyFilter::restore`] checks what is read.
#[derive(Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FilterState {
    /// Promises, in the order of the barriers.
    pub barriers: Vec<FixedTimeState>,
    /// Time of the last sample with valid inputs, in s.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub time: Option<f64>,
    /// The measured sampling period in s, under [`Sampling::Measured`] from the second sample on.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub period: Option<f64>,
    /// The input handed out at [`Self::time`], or last while not armed; zeros above the number of inputs.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub input: [f64; MAX_INPUTS],
    /// Time of the first sample in s, valid or not, where the filter is [armed later](FilterBuilder::arm_after) than that.
    #[cfg_attr(feature = "serde", serde(default, with = "crate::real"))]
    pub start: Option<f64>,
    /// How the active row bent at the sample before [`Self::time`] and at that, where one alone was active: the search over the
    /// period begins from the former if that sample is taken again, else from the latter. Promises do not depend on it.
    #[cfg_attr(feature = "serde", serde(default))]
    pub bends: [Option<Bend>; 2],
}

impl Clone for FilterState {
    fn clone(&self) -> Self {
        Self { barriers: self.barriers.clone(), ..*self }
    }

    /// Reuses the memory, which a derived `Clone` would not: a step must not allocate.
    fn clone_from(&mut self, source: &Self) {
        let Self { barriers, time, period, input, start, bends } = source;
        self.barriers.clone_from(barriers);
        (self.time, self.period, self.input, self.start) = (*time, *period, *input, *start);
        self.bends = *bends;
    }
}

impl FilterState {
    /// Whether a filter that is armed `after` seconds from its first sample is so at `t`: once it is, it stays so.
    #[inline]
    fn is_armed(&self, t: f64, after: f64) -> bool {
        let reached = |start: f64| t - start >= after - SAME_TIME * t.abs().max(after);
        after == 0.0 || self.time.is_some() || self.start.is_none_or(reached)
    }

    /// The bend of the active row from which the search at `t` begins.
    #[inline]
    fn bend_before(&self, t: f64) -> &Option<Bend> {
        let [before, last] = &self.bends;
        if self.time.is_some_and(|time| t > time) { last } else { before }
    }

    /// Becomes `next`, which keeps memory alone.
    #[inline(always)]
    fn take(&mut self, next: &mut Self) {
        core::mem::swap(&mut self.barriers, &mut next.barriers);
        (self.time, self.period, self.input, self.start) = (next.time, next.period, next.input, next.start);
        self.bends = next.bends;
    }
}

/// Round-off of a time that is a sum of steps, as a part of it.
const SAME_TIME: f64 = 1e-12;

/// Periods that differ by less than this part of them count as equal.
const SAME_PERIOD: f64 = 1e-6;

/// Scratch memory of a step; its contents change no bit of the next one.
struct Workspace {
    /// Rows of the QP, each with its enforcement.
    rows: Vec<Row>,
    enforcement: Vec<Enforcement>,
    /// Bounds that the input held over the period has to meet.
    requirements: Vec<Requirement>,
    next: FilterState,
    /// Room for one state.
    scratch: Vec<f64>,
    report: Report,
    search: search::Scratch,
    qp: qp::Workspace,
}

/// A filter on the input, made of barriers with deadlines: `min ½‖u − u_ref‖²` under one row per barrier
/// and the input bounds.
///
/// # Requirements
///
/// The plant is control-affine and every barrier has the relative degree it was declared with;
/// inputs are held between samples ([`Sampling`]). A barrier's guarantee
/// needs every step satisfied ([`Status::is_satisfied`]); [`BarrierReport::on_course`] says whether
/// its theorem's conditions have held so far.
///
/// # References
///
/// The paper, section III; the module [`crate::convergence`].
pub struct SafetyFilter {
    state_dim: usize,
    input_dim: usize,
    slots: Vec<BarrierSlot>,
    bounds: Bounds,
    /// Whether an input has a bound: without any nothing is ruled out.
    bounded: bool,
    correction_limit: f64,
    sampling: Sampling,
    delay: f64,
    errors: MeasurementErrors,
    /// The period in s that [`Sampling::Measured`] starts from.
    first_period: f64,
    /// The longest time in s between two samples, 0 where it is not given.
    period_max: f64,
    /// The time in s from the first sample until the filter is armed.
    arm_after: f64,
    /// The time in s for which the next input will be held, if somebody said so.
    expected: Option<f64>,
    /// Whether a plan stands behind the next step, so that rows need not be met.
    is_backed: bool,
    state: FilterState,
    workspace: Workspace,
}

impl SafetyFilter {
    /// Starts a filter for a plant with `state_dim` states and `input_dim` inputs.
    pub fn builder(state_dim: usize, input_dim: usize) -> FilterBuilder {
        FilterBuilder::new(state_dim, input_dim)
    }

    /// Computes the safe input at time `t` and remembers the sample. The first call with valid inputs
    /// anchors every barrier: its deadline counts from that `t`.
    ///
    /// - `t`: time in s; later calls pass later times (an earlier one counts as the anchor's).
    /// - `x`: the state, in the plant's order and units.
    /// - `u_ref`: the input wanted by whoever is in control.
    /// - `u`: receives the safe input: always finite and within the bounds.
    ///
    /// Does not allocate. Numerical outcomes (infeasible, no control authority, not-a-number
    /// inputs) are the report's [`Status`], never an error.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length.
    ///
    /// ```
    /// # use punctual_core::{barriers::DistanceDisc, filter::*};
    /// # use punctual_core::plants::PointMass;
    /// let mut filter = SafetyFilter::builder(4, 2)
    ///     .barrier("goal", PointMass, DistanceDisc::new([45.0, 45.0], 2.0, 2.0)?, BarrierSettings::within(10.0))?
    ///     .build()?;
    /// let mut u = [0.0; 2];
    /// let error = filter.step(0.0, &[0.0; 3], &[0.0; 2], &mut u).unwrap_err();
    /// assert_eq!(error.to_string(), "x: has 3 components, must have 4");
    /// # Ok::<(), punctual_core::Error>(())
    /// ```
    pub fn step(&mut self, t: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Result<&Report, Error> {
        self.sample(t, x, u_ref, u)?;
        self.state.take(&mut self.workspace.next);
        Ok(&self.workspace.report)
    }

    /// Computes what [`Self::step`] would, without remembering the sample.
    ///
    /// # Errors
    ///
    /// As for [`Self::step`].
    pub fn peek(&mut self, t: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Result<&Report, Error> {
        self.sample(t, x, u_ref, u)?;
        Ok(&self.workspace.report)
    }

    /// Forgets the anchors: the next sample with valid inputs starts every deadline anew. The time until the filter is
    /// [armed](FilterBuilder::arm_after) counts from its first sample all the same.
    pub fn rearm(&mut self) {
        self.state.barriers.fill(FixedTimeState::default());
        (self.state.time, self.state.period, self.state.bends) = (None, None, [None; 2]);
        self.state.input.fill(0.0);
    }

    /// The memory of the filter between samples.
    pub fn state(&self) -> &FilterState {
        &self.state
    }

    /// Restores a state that [`Self::state`] returned: the filter goes on exactly as it would have then. The numbers of a
    /// state from elsewhere are taken as they are. Wrong ones break promises; the input stays finite and within its bounds.
    ///
    /// # Errors
    ///
    /// A state with another number of barriers.
    pub fn restore(&mut self, state: &FilterState) -> Result<(), Error> {
        length("barriers", state.barriers.len(), self.slots.len())?;
        self.state.clone_from(state);
        Ok(())
    }

    /// The report of the last [`Self::step`] or [`Self::peek`].
    pub fn report(&self) -> &Report {
        &self.workspace.report
    }

    /// The residuals of `u`, the answer of the last [`Self::step`] or [`Self::peek`] to `u_ref`, in the conditions of
    /// optimality of its QP. They are small multiples of 1e-16 for a pointwise step. Where the step looked over the
    /// period ([`Report::predicted`]) they are of the rows linearised at `u`, and up to the 1e-9 at which the search
    /// stops. `None` where no QP was solved. Costs another solve: a check, not for every step.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length.
    pub fn residuals(&mut self, u_ref: &[f64], u: &[f64]) -> Result<Option<Residuals>, Error> {
        length("u_ref", u_ref.len(), self.input_dim)?;
        length("u", u.len(), self.input_dim)?;
        let Workspace { rows, enforcement, requirements, report, qp, .. } = &mut self.workspace;
        if report.status.is_abstention() || report.time.is_nan() {
            return Ok(None);
        }
        let count = requirements.len().max(self.slots.len());
        let problem = Problem {
            enforcement: &enforcement[..count],
            ..Problem::new(&rows[..count], &self.bounds, u_ref, self.correction_limit)
        };
        qp.solve(&problem, &mut [0.0; MAX_INPUTS][..u.len()]);
        Ok(Some(qp.residuals(&problem, u)))
    }

    /// The names of the barriers, in the order of the report.
    pub fn barrier_names(&self) -> impl Iterator<Item = &str> {
        self.slots.iter().map(|slot| slot.name.as_str())
    }

    /// Gives barrier number `index` a new deadline in s, finite, > 0, that counts from the next sample. Its promise
    /// starts anew there, from the derivatives that h then has. Until then the input of the last sample keeps the old
    /// promise, and the new profile starts with a zero error: no guarantee has a gap.
    ///
    /// # Errors
    ///
    /// No such barrier; a deadline out of range.
    pub fn set_deadline(&mut self, index: usize, deadline: f64) -> Result<(), Error> {
        let slot = self.slot(index)?;
        let named = |e: Error| e.within(&slot.name);
        slot.promise = slot.promise.clone().with_deadline(deadline).map_err(named)?;
        slot.begin = Begin::AtOnce;
        self.state.barriers[index] = FixedTimeState::default();
        Ok(())
    }

    /// Replaces the set of barrier number `index`, such as a goal that was moved: its promise starts anew
    /// at the next sample, as with [`Self::set_deadline`].
    ///
    /// # Errors
    ///
    /// No such barrier; a source of other dimensions or another relative degree.
    pub fn set_source(&mut self, index: usize, source: Box<dyn DerivativeSource>) -> Result<(), Error> {
        let dims = (self.state_dim, self.input_dim);
        let exact = self.errors.is_exact();
        let slot = self.slot(index)?;
        let named = |e: Error| e.within(&slot.name);
        if !exact {
            errors::check(&*source).map_err(named)?;
        }
        length("x", source.state_dim(), dims.0).map_err(named)?;
        length("u", source.input_dim(), dims.1).map_err(named)?;
        let (found, wanted) = (source.relative_degree(), slot.source.relative_degree());
        if found != wanted {
            let message = format!("is {found}, must stay {wanted}");
            return Err(named(Error::new(ErrorKind::RelativeDegree, "relative_degree", message)));
        }
        slot.source = source;
        self.workspace.search.evaluations.plants = SharedPlants::of(&mut self.slots);
        self.state.barriers[index] = FixedTimeState::default();
        self.state.bends = [None; 2];
        Ok(())
    }

    /// Sets the time in s, finite, > 0, for which the input of the next sample will be held; `None` where nobody
    /// knows. It is for whoever is told, such as a co-simulation slave by the size of its step.
    /// [`Sampling::Measured`] then goes by it at every sample. It is not part of [`Self::state`].
    ///
    /// # Errors
    ///
    /// A time out of range.
    pub fn expect_hold(&mut self, hold: Option<f64>) -> Result<(), Error> {
        self.expected = hold.map(|hold| positive("hold", hold)).transpose()?;
        Ok(())
    }

    fn slot(&mut self, index: usize) -> Result<&mut BarrierSlot, Error> {
        let count = self.slots.len();
        let message = || format!("is {index}, must be < {count}, the number of barriers");
        self.slots.get_mut(index).ok_or_else(|| Error::new(ErrorKind::Range, "barrier", message()))
    }

    /// The reason why barrier `index` goes by another method than the configured one since its anchor
    /// ([`BarrierReport::fallback`]); `None` where it does not. Computed anew: not for every step.
    pub fn refusal(&self, index: usize) -> Option<Refusal> {
        self.slots.get(index)?.promise.refusal(self.state.barriers.get(index)?)
    }

    /// The relative degree of each barrier, in the order of the report.
    pub fn relative_degrees(&self) -> impl Iterator<Item = usize> + '_ {
        self.slots.iter().map(|slot| slot.source.relative_degree())
    }
}
