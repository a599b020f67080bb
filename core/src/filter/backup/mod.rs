//! Backup plans: the first sample decides what a filter promises, and the promise is kept within the bounds whatever u_ref
//! is (`docs/theory.md#backup-plan`).
//!
//! | module | owns |
//! |---|---|
//! | `state` | the memory: the promises, the plan that keeps them, the time of the last sample |
//! | `status` | the report on a step |
//! | `planning` | the planner for a set of promises |
//! | `first` | the plan of a first sample, and the earliest deadlines that a plan keeps |
//! | `schedule` | what a first sample may promise: alternatives, and the times of visits |
//! | `sample` | a sample: what is promised, whether it is kept, and which source drives the plant |
//! | `choice` | the input: the candidates, in order |
//! | `bears` | what a plan bears of a plant that is not the model |
//! | `table` | a plan for a set of first states, as a table for [`crate::follower`] |
//! | `deviation` | the observed deviation of the plant from the model |
//! | `settings` | the numbers that decide on a guarantee |

mod bears;
mod choice;
mod deviation;
mod first;
mod planning;
mod sample;
mod schedule;
mod settings;
mod state;
mod status;
mod table;

use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

use super::integrator::Integrator;
use super::rows::{BarrierSlot, Rows};
use super::{Begin, End, Filter, FilterState, MOST_LATE, NoDerivative, SampleDerivative};
use crate::MAX_INPUTS;
use crate::error::{Error, ErrorKind, length, non_negative, positive};
use crate::interval::Interval;
use crate::lie::{Direction, Predict, Second, SharedPlant};
use crate::plan::{BackupPlan, Motion, Policy, Uncertainty};
use crate::qp::Bounds;
pub use bears::{Bears, Remedy, UncertaintyKind};
use choice::Piece;
pub use first::Appraisal;
pub use planning::Planning;
pub(super) use sample::Decided;
use sample::{At, Decision};
use settings::DECISIONS;
pub use state::PlanState;
pub use status::{Assurance, AssuranceStatus, Driver, Reason};
pub use table::TabledPlan;

/// How a filter makes plans ([`Filter::with_plans`]). A plain number is a period, with plans that end at an equilibrium.
pub struct Plans {
    /// The time in s for which an input is held, finite, > 0.
    period: f64,
    /// How far a plan that does not end at an equilibrium has to reach, in s; `None` if every plan has to end at one.
    horizon: Option<f64>,
    /// The largest number of quadratic programs of a search at a sample after the first.
    search_budget: u32,
    policies: Vec<Policy>,
    /// Pairs of barriers whose sets have no state in common.
    apart: Vec<[usize; 2]>,
    /// Groups of alternatives, each the barriers that it consists of.
    alternatives: Vec<Vec<Vec<usize>>>,
    /// What may be added to the rate of each state, and which part of each input arrives; empty for nothing and all.
    rates: Vec<f64>,
    gains: Vec<[f64; 2]>,
    /// The time constant in s with which each input is followed; empty for at once.
    lags: Vec<[f64; 2]>,
    /// How far each state may be from its measured value; empty if the rows know.
    errors: Vec<f64>,
    /// By how much of a period a sample may come late; 0 if samples come as expected.
    jitter: f64,
    /// How the points move that barriers follow, by the number of the barrier.
    motions: Vec<(usize, Motion)>,
}

impl From<f64> for Plans {
    fn from(period: f64) -> Self {
        Self::every(period)
    }
}

impl Plans {
    /// The longest deadlines tried for a barrier that accepts a later one, in units of those configured.
    pub const LONGEST: f64 = 16.0;
    /// The default of [`Self::search_budget`].
    pub const SEARCH_BUDGET: u32 = 3;

    /// Plans for inputs that are held for `period` s, finite, > 0.
    pub fn every(period: f64) -> Self {
        Self {
            period,
            horizon: None,
            search_budget: Self::SEARCH_BUDGET,
            policies: Vec::new(),
            apart: Vec::new(),
            alternatives: Vec::new(),
            rates: Vec::new(),
            gains: Vec::new(),
            lags: Vec::new(),
            errors: Vec::new(),
            jitter: 0.0,
            motions: Vec::new(),
        }
    }

    /// Sets the time in s, finite, > 0, that a plan without an equilibrium at its end has to reach past the last deadline
    /// and the sample. Promises are then kept [until the end of the plan](Assurance::until). Default `None`: a plan has to
    /// end at an equilibrium. For plants without an equilibrium, such as an aeroplane, and for sets that move for ever. The
    /// filter tries to prolong such a plan before it ends.
    #[must_use]
    pub fn horizon(self, horizon: impl Into<Option<f64>>) -> Self {
        Self { horizon: horizon.into(), ..self }
    }

    /// Adds a policy from which a search for a plan begins: for promises that no search keeps by itself, such as a passage
    /// through a gap. It writes the input at a time in s and a state, both those of the model.
    #[must_use]
    pub fn policy(mut self, policy: impl Fn(f64, &[f64], &mut [f64]) + Send + 'static) -> Self {
        self.policies.push(Box::new(policy));
        self
    }

    /// Sets the largest number of quadratic programs, > 0, of a search for a plan at one sample; the search continues at the
    /// next. It limits the searches for a lost plan and for one behind u_ref. Some searches run to their end regardless:
    /// that of the first sample, of a sample that comes at another time than expected, and of a plan with a
    /// [horizon](Self::horizon).
    #[must_use]
    pub fn search_budget(self, programs: u32) -> Self {
        Self { search_budget: programs, ..self }
    }

    /// Declares what may be added to the rate of each state at any time, finite, ≥ 0, in its unit per s: a wind, a slope, or
    /// what the model leaves out. Every promise is then kept for all such plants. Default: nothing.
    #[must_use]
    pub fn uncertain_rates(self, rates: &[f64]) -> Self {
        Self { rates: rates.to_vec(), ..self }
    }

    /// Declares which part of each input arrives, from the least to the largest, 0 < least ≤ largest: constant or not.
    /// Default: `[1.0, 1.0]` each, all of it.
    #[must_use]
    pub fn uncertain_gains(self, gains: &[[f64; 2]]) -> Self {
        Self { gains: gains.to_vec(), ..self }
    }

    /// Declares the time constant in s with which what arrives of each input follows what is asked, from the least to the
    /// largest, 0 ≤ least ≤ largest: u̇ = (u_asked − u)/τ, as a motor does. Before the first sample 0 was asked, or the nearest
    /// admissible input. Default: `[0.0, 0.0]` each, at once.
    #[must_use]
    pub fn uncertain_lags(self, lags: &[[f64; 2]]) -> Self {
        Self { lags: lags.to_vec(), ..self }
    }

    /// Declares how far each state may be from its measured value, finite, ≥ 0, in its unit. Default: those of
    /// [the filter](super::FilterBuilder::measurement_errors), for which its rows allow too; these are for plans alone.
    #[must_use]
    pub fn measurement_errors(self, errors: &[f64]) -> Self {
        Self { errors: errors.to_vec(), ..self }
    }

    /// Declares that samples come at any time up to `part` of a period, finite, ≥ 0, later than the period after the last one:
    /// a clock that is measured, or a loop that is sometimes slow. Default 0: every period.
    #[must_use]
    pub fn jitter(self, part: f64) -> Self {
        Self { jitter: part, ..self }
    }

    /// Declares how the point moves that barrier number `barrier` [follows](crate::lie::following): its acceleration, and the
    /// errors with which it is measured. Every promise is then kept however it moves within that. Without it no plan accounts
    /// for such a barrier. The promise has an [end](Assurance::until), which is postponed again and again: 3 s past the last
    /// deadline and the sample, or as far as the [horizon](Self::horizon).
    ///
    /// ```
    /// # use punctual_core::{barriers::*, filter::*, lie, plants::Unicycle};
    /// // x = (x_p, y_p, θ, v, p_x, p_y, v_x, v_y): a cyclist at p.
    /// let clear = Outside(DistanceDisc::new([0.0, 0.0], 2.0, 1.0)?.following(4));
    /// let mut filter = Filter::builder(Unicycle)
    ///     .following::<_, 8>("cyclist", clear, BarrierSettings::keeping())?
    ///     .bounds(&[-4.0, -1.5], &[4.0, 1.5])?
    ///     .sampling(Sampling::Period(0.02))?
    ///     .build()?
    ///     .with_plans(Plans::every(0.02).motion(0, Motion { acceleration: 0.3, ..Motion::default() }))?;
    /// let (x, mut u) = ([0.0, 0.0, 0.0, 1.0, 6.0, -9.0, 0.0, 0.8], [0.0; 2]);
    /// assert!(filter.step(0.0, &x, &[4.0, 0.0], &mut u)?.is_assured());
    /// # Ok::<(), punctual_core::Error>(())
    /// ```
    #[must_use]
    pub fn motion(mut self, barrier: usize, motion: Motion) -> Self {
        self.motions.retain(|(of, _)| *of != barrier);
        self.motions.push((barrier, motion));
        self
    }

    fn motion_of(&self, barrier: usize) -> Option<Motion> {
        self.motions.iter().find(|(of, _)| *of == barrier).map(|(_, motion)| *motion)
    }

    /// Declares that the sets of each pair of barriers, given by their numbers, have no state in common at any time.
    /// Promises that need both at once are then refused without a search ([`Failure::Apart`](crate::plan::Failure::Apart)).
    /// Nothing else depends on it.
    #[must_use]
    pub fn apart(self, pairs: Vec<[usize; 2]>) -> Self {
        Self { apart: pairs, ..self }
    }

    /// Adds a choice: of these alternatives, each the numbers of the barriers that it consists of, one is promised. The first
    /// sample decides which, and lets the barriers of the others [go](crate::filter::Phase::Released). Every other barrier is
    /// promised anyway. Default: no choice.
    ///
    /// ```
    /// # use punctual_core::{barriers::DistanceDisc, filter::*};
    /// # use punctual_core::plants::PointMass;
    /// // To one of two places within 8 s: the second is nearer.
    /// let disc = |x| DistanceDisc::new([x, 0.0], 1.0, 1.0);
    /// let mut filter = Filter::builder(PointMass)
    ///     .barrier("far", disc(50.0)?, BarrierSettings::within(8.0))?
    ///     .barrier("near", disc(-10.0)?, BarrierSettings::within(8.0))?
    ///     .bounds(&[-2.0; 2], &[2.0; 2])?
    ///     .sampling(Sampling::Period(0.02))?
    ///     .build()?
    ///     .with_plans(Plans::every(0.02).one_of(&[&[0], &[1]]))?;
    /// let mut u = [0.0; 2];
    /// let report = filter.step(0.0, &[0.0; 4], &[0.0; 2], &mut u)?;
    /// assert!(report.is_assured() && report.barriers[1].guaranteed && report.barriers[0].phase == Phase::Released);
    /// # Ok::<(), punctual_core::Error>(())
    /// ```
    #[must_use]
    pub fn one_of(mut self, alternatives: &[&[usize]]) -> Self {
        self.alternatives.push(alternatives.iter().map(|barriers| barriers.to_vec()).collect());
        self
    }

    /// # Errors
    ///
    /// A period, horizon or budget out of range.
    fn check(&self) -> Result<(), Error> {
        positive("period", self.period)?;
        self.horizon.map(|horizon| positive("horizon", horizon)).transpose()?;
        for (i, rate) in self.rates.iter().enumerate() {
            non_negative(&format!("uncertain_rates[{}]", i + 1), *rate)?;
        }
        for (i, error) in self.errors.iter().enumerate() {
            non_negative(&format!("measurement_errors[{}]", i + 1), *error)?;
        }
        for (i, [least, most]) in self.gains.iter().enumerate() {
            let field = format!("uncertain_gains[{}]", i + 1);
            if positive(&field, *least)? > positive(&field, *most)? {
                let message = format!("is [{least}, {most}], must be least <= largest");
                return Err(Error::new(ErrorKind::Range, &field, message));
            }
        }
        for (i, [least, most]) in self.lags.iter().enumerate() {
            let field = format!("uncertain_lags[{}]", i + 1);
            if non_negative(&field, *least)? > non_negative(&field, *most)? {
                let message = format!("is [{least}, {most}], must be least <= largest");
                return Err(Error::new(ErrorKind::Range, &field, message));
            }
        }
        non_negative("jitter", self.jitter)?;
        for (barrier, Motion { acceleration, position_error, velocity_error }) in &self.motions {
            let fields = [
                ("acceleration", acceleration),
                ("position_error", position_error),
                ("velocity_error", velocity_error),
            ];
            for (field, value) in fields {
                non_negative(&format!("motion[{}].{field}", barrier + 1), *value)?;
            }
        }
        match self.search_budget {
            0 => Err(Error::new(ErrorKind::Range, "search_budget", "is 0, must be at least 1")),
            _ => Ok(()),
        }
    }
}

impl Filter {
    /// Makes the filter promise only what a backup plan keeps. Its inputs are held for the period of `plans`.
    ///
    /// At the first sample it searches for a plan from there, in the model and within the bounds. If one is found, every
    /// barrier that [can be](Planning::promised) is promised, whatever u_ref comes. If none is found, the promise is
    /// refused, and the filter continues by its rows. Once promised, every input has a verified plan behind it. The input is
    /// u_ref wherever a plan is found behind that. Otherwise it is a compromise, with the answer of the rows once every set
    /// has been reached; or, if nothing else keeps the promise, the next input of the plan itself.
    ///
    /// Assumptions: the plant is the model, its state is measured exactly, and samples are one period apart. With
    /// [rates](Plans::uncertain_rates), [gains](Plans::uncertain_gains), [lags](Plans::uncertain_lags), [measurement
    /// errors](crate::filter::FilterBuilder::measurement_errors) or [late samples](Plans::jitter) declared, every plant within
    /// them keeps the promise. It then
    /// has an [end](Assurance::until), which is postponed again and again. If the plant
    /// was seen to differ from the model, and 1.5 times that difference could take it out of a set before the next sample,
    /// the guarantee is lost for that sample. A sample may be repeated at the same time, come early, or come late by a
    /// twentieth of a hold. If the time to the next sample changes and is [known](Self::expect_hold), a plan is sought for
    /// the new one; if none is found, the guarantee is lost. A sample that comes later suspends it until the next one. While
    /// x is not finite, the plan continues as it is. A barrier that [begins later](Begin::At) is promised
    /// from then on; with a deadline, from its deadline on, wherever it begins. One that begins with
    /// [another's arrival](Begin::AfterArrival) is promised from its deadline on, and the other one before that. A filter with
    /// a bound on the disturbance of a barrier, or a delay of more than 250 periods, cannot be assured yet, and is refused. Sets must not move, unless [it is
    /// known](crate::barrier::Barrier::range_from) how low h gets: at an equilibrium each set is checked at eight later
    /// times, up to a day, and no plan is found if it has moved. With a [horizon](Plans::horizon) they may move, and the
    /// plant needs no equilibrium: the promise then has an [end](Assurance::until), which is postponed again and again.
    /// States must be those of the plant. What others
    /// move belongs to barriers that follow it, with its [motion](Plans::motion).
    ///
    /// Plans account for the mean that a plant with an [integrator](Self::with_integrator) receives over each period, and
    /// keep the limits of the integral. The search allocates, and so do the plans.
    ///
    /// ```
    /// # use punctual_core::{barriers::DistanceDisc, filter::*};
    /// # use punctual_core::plants::Unicycle;
    /// let goal = DistanceDisc::new([20.0, 10.0], 2.0, 1.0)?;
    /// let mut filter = Filter::builder(Unicycle)
    ///     .barrier("goal", goal, BarrierSettings::within(8.0))?
    ///     .bounds(&[-5.0, -2.0], &[5.0, 2.0])?
    ///     .sampling(Sampling::Period(0.02))?
    ///     .build()?
    ///     .with_plans(0.02)?;
    /// let (x, mut u) = ([0.0, 0.0, 1.0, 0.0], [0.0; 2]);
    /// let report = filter.step(0.0, &x, &[-5.0, 0.0], &mut u)?;
    /// assert!(report.is_assured() && report.barriers[0].guaranteed);
    /// # Ok::<(), punctual_core::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// A number of `plans` out of range; a filter that already has plans. A filter that cannot be assured: a barrier without
    /// a model that can be run ahead, or with another plant than the first one; one
    /// without a deadline that begins on another's arrival, or without a horizon one that moves for ever; a bound on the disturbance of a barrier;
    /// a delay of more than 250 periods; an integrator, measured quantities beside the states, or a source without derivatives on enclosures for an
    /// uncertain plant. [`Self::obstacles`] lists them all.
    pub fn with_plans(mut self, plans: impl Into<Plans>) -> Result<Self, Error> {
        let mut plans = plans.into();
        plans.check()?;
        if self.backup.is_some() {
            return Err(Error::new(ErrorKind::Unsupported, "plans", "are there already, must be given once"));
        }
        if let Some(obstacle) = self.obstacles(&plans).into_iter().next() {
            return Err(obstacle);
        }
        let uncertainty = self.uncertainty(&plans)?;
        if self.follows() && plans.horizon.is_none() && uncertainty.is_none() {
            // A set that moves on may have to be followed.
            plans.horizon = Some(DECISIONS.following_horizon);
        }
        let states = self.model_states();
        let mut bounds = self.rows.bounds;
        if let Some(own) = &self.integrator {
            [bounds.min[own.of.input], bounds.max[own.of.input]] = own.rates;
        }
        self.backup = Some(Box::new(Backup::new(plans, states, bounds, uncertainty)));
        // A hold that was known before is that of the plans.
        self.expected = self.expected.or(self.rows.expected.take());
        Ok(self)
    }

    /// Whether a barrier follows a measured point.
    fn follows(&self) -> bool {
        self.rows.slots.iter().any(|slot| slot.source.follows().is_some())
    }

    /// The number of states of the model: with points that barriers follow, x has the points after them.
    fn model_states(&self) -> usize {
        self.rows.state_dim - if self.follows() { self.rows.measured } else { 0 }
    }

    /// Every reason why the filter cannot have `plans`; empty if [`Self::with_plans`] accepts them.
    pub fn obstacles(&self, plans: &Plans) -> Vec<Error> {
        let mut found = Vec::new();
        let rows = &self.rows;
        let refused = |field: &str, message: String| Error::new(ErrorKind::Unsupported, field, message);
        let most = if plans.jitter > 0.0 { 1.0 } else { MOST_LATE };
        if rows.delay > most * plans.period {
            let (late, times) = match most > 1.0 {
                true => ("", format!("{most} times ")),
                false => (", where samples come late", String::new()),
            };
            let message =
                format!("is {}, must be <= {times}period = {} for a plan{late}", rows.delay, plans.period);
            found.push(refused("actuation_delay", message));
        }
        let is_declared =
            [plans.errors.is_empty(), plans.rates.is_empty(), plans.gains.is_empty(), plans.lags.is_empty()]
                .contains(&false)
                || plans.jitter > 0.0;
        let is_uncertain = is_declared || !rows.errors.is_exact();
        if is_uncertain && self.integrator.is_some() {
            let message = "stands before an uncertain plant, for which no plan accounts yet";
            found.push(refused("integrator", message.into()));
        }
        if is_uncertain && rows.measured > 0 && !self.follows() {
            let message = "follow the states of an uncertain plant, for which no plan accounts yet";
            found.push(refused("measured", message.into()));
        }
        let is_erring = !rows.errors.is_exact() || plans.errors.iter().any(|error| *error > 0.0);
        for (barrier, _) in &plans.motions {
            if rows.slots.get(*barrier).is_none_or(|slot| slot.source.follows().is_none()) {
                let message = format!("is of barrier {barrier}, which follows no point");
                found.push(refused("motion", message));
            }
        }
        for group in &plans.alternatives {
            let unknown = group.iter().flatten().find(|i| **i >= rows.slots.len());
            if group.is_empty() || unknown.is_some() {
                let message = match unknown {
                    Some(i) => format!("has barrier {i}, must have some of {} from 0", rows.slots.len()),
                    None => "is empty, must have at least one alternative".into(),
                };
                found.push(refused("one_of", message));
            }
        }
        let states = self.model_states();
        for (i, slot) in rows.slots.iter().enumerate() {
            let mut refuse =
                |field: &str, message: String| found.push(refused(field, message).within(&slot.name));
            let settings = slot.promise.settings();
            if settings.disturbance > 0.0 {
                refuse("disturbance", format!("is {}, must be 0 for a plan", settings.disturbance));
            }
            match (slot.begin, settings.deadline) {
                (Begin::AtOnce | Begin::At(_), _) | (Begin::AfterArrival(_), Some(_)) => {}
                (Begin::AfterArrival(_), None) => {
                    let message = "is the arrival of another barrier, which needs a deadline for a plan: when it arrives is open";
                    refuse("begin", message.into());
                }
            }
            if is_erring && !matches!(slot.end, End::Never | End::At(_)) {
                refuse("end", "is on arrival, which a measurement with errors does not tell".into());
            }
            if let Some(follows) = slot.source.follows() {
                match plans.motion_of(i) {
                    None => refuse("motion", "is not declared: how the point moves that it follows".into()),
                    Some(motion) if motion != Motion::default() && follows.steepness().is_none() => {
                        refuse("motion", "needs a set whose h changes by a bounded amount per m".into());
                    }
                    _ => {}
                }
            } else if slot.source.predict().is_none() {
                refuse("source", "has no model to run ahead".into());
            } else if self.follows() && slot.source.state_dim() > states {
                refuse("source", "depends on what is measured beside the plant, and follows no point".into());
            } else if plans.horizon.is_none() && slot.end == End::Never && leaves(slot, states) {
                let message = "moves with time, so that no plan ends; with a horizon one may end earlier";
                refuse("source", message.into());
            }
        }
        found.extend(one_plant(rows).err());
        // Measured quantities, and a source without a model, were named above.
        if (rows.measured == 0 || self.follows())
            && rows.slots.iter().all(|slot| slot.source.predict().is_some())
        {
            found.extend(self.uncertainty(plans).err());
        }
        found
    }

    /// What is not known of the plant, if anything is declared.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length; a source without derivatives on enclosures.
    fn uncertainty(&self, plans: &Plans) -> Result<Option<Uncertainty>, Error> {
        let (state_dim, Rows { input_dim, errors, slots, .. }) = (&self.model_states(), &self.rows);
        if !plans.rates.is_empty() {
            length("uncertain_rates", plans.rates.len(), *state_dim)?;
        }
        if !plans.gains.is_empty() {
            length("uncertain_gains", plans.gains.len(), *input_dim)?;
        }
        if !plans.lags.is_empty() {
            length("uncertain_lags", plans.lags.len(), *input_dim)?;
        }
        if !plans.errors.is_empty() {
            length("measurement_errors", plans.errors.len(), *state_dim)?;
        }
        let (rates, gains) = (plans.rates.iter().copied(), plans.gains.iter().copied());
        let own = plans.errors.iter().copied().chain(core::iter::repeat(0.0));
        let uncertainty = Uncertainty {
            rates: rates.chain(core::iter::repeat(0.0)).take(*state_dim).collect(),
            errors: errors
                .sizes(self.rows.state_dim)
                .into_iter()
                .zip(own)
                .map(|(rows, own)| rows.max(own))
                .take(*state_dim)
                .collect(),
            gains: gains.chain(core::iter::repeat([1.0; 2])).take(*input_dim).collect(),
            lags: plans.lags.iter().copied().chain(core::iter::repeat([0.0; 2])).take(*input_dim).collect(),
            jitter: plans.jitter,
            ..Uncertainty::nothing([*state_dim, *input_dim])
        };
        if uncertainty.is_nothing() {
            return Ok(None);
        }
        let (x, u) = (alloc::vec![Second::from(0.0); *state_dim], alloc::vec![Second::from(0.0); *input_dim]);
        let mut rates = x.clone();
        let lacks = |slot: &&BarrierSlot| {
            if let Some(follows) = slot.source.follows() {
                return !follows.alone().second_rates(&x, &u, &mut rates);
            }
            slot.source.predict().is_none_or(|model| {
                !model.second_rates(&x, &u, &mut rates) || model.second_value(Interval::ALL, &x).is_none()
            })
        };
        match slots.iter().find(lacks) {
            None => Ok(Some(uncertainty)),
            Some(slot) => {
                let message = "has no derivatives on enclosures, which a plan for an uncertain plant needs";
                Err(Error::new(ErrorKind::Unsupported, "source", message).within(&slot.name))
            }
        }
    }

    /// Whether the promises are kept, and which source chose the last input; `None` without plans.
    pub fn assurance(&self) -> Option<&Assurance> {
        self.backup.as_ref().map(|backup| &backup.assurance)
    }

    /// The plan that keeps the promises after the last step, if there is one.
    pub fn plan(&self) -> Option<&BackupPlan> {
        self.backup.as_ref()?;
        self.rows.state.plan.backup_plan()
    }

    /// The planner, for queries; `None` for a filter without plans.
    pub fn planning(&self) -> Option<Planning<'_>> {
        Some(self.backup.as_ref()?.planning((&self.rows, self.integrator.as_ref())))
    }

    /// How long in s the input at `t` is held if samples continue as before: as long as the previous one, and with an
    /// inexact clock slightly longer than any so far. A sample in between changes nothing until eight in a row came as soon.
    /// The period at first, after [`Self::rearm`] if the sample comes at another time than expected, and as long as samples come
    /// within a declared [jitter](Plans::jitter). `None` without plans.
    pub fn usual_hold(&self, t: f64) -> Option<f64> {
        let Plans { period, jitter, .. } = self.backup.as_ref()?.plans;
        Some(self.rows.state.plan.usual_hold(t + self.rows.delay, (period, jitter)))
    }

    /// How long in s the last input was to be held, as far as known; without plans, the measured sampling period.
    pub fn last_hold(&self) -> Option<f64> {
        match &self.backup {
            Some(_) => self.rows.state.plan.last_hold(),
            None => self.rows.state.period,
        }
    }
}

/// The plans of a filter, and the assurance reported at the last sample.
pub(super) struct Backup {
    plans: Plans,
    /// Number of states of the model.
    states: usize,
    /// The bounds of the model's inputs; at a sample those of an integrated one are tighter.
    bounds: Bounds,
    /// What is not known of the plant.
    uncertainty: Option<Uncertainty>,
    /// The sample that the reports refer to.
    preview: Option<Preview>,
    /// How the input of that sample varies with it.
    piece: Piece,
    assurance: Assurance,
}

/// A sample that was computed ahead, its input, and the input of the model.
struct Preview {
    t: f64,
    hold: f64,
    x: Vec<f64>,
    u_ref: Vec<f64>,
    u: [f64; MAX_INPUTS],
    inside: [f64; MAX_INPUTS],
}

impl Backup {
    fn new(plans: Plans, states: usize, bounds: Bounds, uncertainty: Option<Uncertainty>) -> Self {
        Self {
            plans,
            states,
            bounds,
            uncertainty,
            preview: None,
            piece: Piece::ROWS,
            assurance: Assurance::default(),
        }
    }

    pub(super) fn period(&self) -> f64 {
        self.plans.period
    }

    /// Whether an input is followed late.
    pub(super) fn lags(&self) -> bool {
        self.uncertainty.as_ref().is_some_and(Uncertainty::lags)
    }

    fn planning<'a>(&'a self, (rows, integrator): (&'a Rows, Option<&'a Integrator>)) -> Planning<'a> {
        Planning {
            rows,
            integrator,
            plans: &self.plans,
            bounds: &self.bounds,
            uncertainty: self.uncertainty.as_ref(),
            measured: None,
            states: self.states,
            courses: &[],
        }
    }

    /// Whether a plan backs the step at `t`, so that the rows need not be met.
    pub(super) fn is_behind(&self, plan: &PlanState, t: f64, hold: f64, integrates: bool) -> bool {
        plan.is_followed()
            && plan.lost.is_none()
            && plan.in_time(t, self.planned_hold(hold, integrates), DECISIONS.jitter)
    }

    /// The hold that plans assume for an input that is held for `hold` s.
    fn planned_hold(&self, hold: f64, integrates: bool) -> f64 {
        let shortest = if integrates { DECISIONS.shortest_integrated } else { DECISIONS.shortest };
        hold.max(shortest * self.plans.period)
    }

    /// Turns the answer `u` of the rows into that of the whole filter.
    pub(super) fn sample(
        &mut self,
        (rows, integrator): (&mut Rows, Option<&Integrator>),
        t: f64,
        hold: f64,
        x: &[f64],
        u_ref: &[f64],
        u: &mut [f64],
    ) {
        let hold = self.planned_hold(hold, integrator.is_some());
        let planning = self.planning((rows, integrator));
        let (measured, courses) = (&planning.state(x)[..], planning.courses(t, x));
        let (acts, x) = planning.acts(t, measured);
        let Self { plans, states, bounds, uncertainty, assurance, piece, .. } = self;
        let (states, uncertainty, measured) = (*states, uncertainty.as_ref(), (t, measured));
        let mut decision = Decision {
            rows,
            integrator,
            plans,
            bounds,
            uncertainty,
            measured,
            states,
            courses,
            assurance,
            piece,
        };
        decision.sample(At { t: acts, hold, x: &x }, u_ref, u);
        rows.workspace.report.assurance = Some(self.assurance);
    }

    /// Writes the input of the last computed sample if it has these arguments. Returns whether it has.
    pub(super) fn recall(&mut self, t: f64, hold: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> bool {
        let preview = self.preview.take().filter(|preview| preview.is_at(t, hold, x, u_ref));
        if let Some(preview) = &preview {
            u.copy_from_slice(&preview.u[..u.len()]);
        }
        self.preview = preview;
        self.preview.is_some()
    }

    /// Remembers the sample that the reports refer to, with the input `u` of the plant and `inside` of the model.
    pub(super) fn remember(
        &mut self,
        (t, hold): (f64, f64),
        x: &[f64],
        u_ref: &[f64],
        u: &[f64],
        inside: [f64; MAX_INPUTS],
    ) {
        let mut preview = Preview { t, hold, x: x.to_vec(), u_ref: u_ref.to_vec(), u: inside, inside };
        preview.u[..u.len()].copy_from_slice(u);
        self.preview = Some(preview);
    }

    /// Forgets the last computed sample; returns its input of the model.
    pub(super) fn forget(&mut self) -> Option<[f64; MAX_INPUTS]> {
        self.preview.take().map(|preview| preview.inside)
    }

    /// Continues from the memory `plan`.
    pub(super) fn restart(&mut self, plan: &PlanState) {
        self.preview = None;
        let (status, failure) = (plan.status, plan.failure);
        let until = plan.backup_plan().map(|_| plan.until());
        self.assurance = Assurance { status, driver: Driver::Rows, failure, until, reason: None };
    }

    /// Checks a memory that is to be restored.
    ///
    /// # Errors
    ///
    /// A plan of another filter, or one that is damaged.
    pub(super) fn check(&self, rows: &Rows, state: &FilterState) -> Result<(), Error> {
        let is_fresh = state.time.is_none();
        let follows: Vec<bool> = rows.slots.iter().map(|slot| slot.source.follows().is_some()).collect();
        state.plan.check([self.states, rows.input_dim], &follows, is_fresh, self.plans.horizon)
    }

    /// Turns the derivative `out` of the rows' answer into that of the input actually applied; `inside` is the model's.
    /// Returns why there is none.
    pub(super) fn carry(
        &self,
        (rows, integrator): (&Rows, Option<&Integrator>),
        (t, hold): (f64, f64),
        (x, u_ref): (&[f64], &[f64]),
        inside: &[f64; MAX_INPUTS],
        direction: Direction,
        out: &mut SampleDerivative,
    ) -> Option<NoDerivative> {
        let Piece { rows: part, wish, held } = self.piece;
        if part == 1.0 && !held.contains(&true) {
            return None;
        }
        let planning = self.planning((rows, integrator));
        let wished = planning.moves(hold, u_ref, direction.u);
        let du = core::array::from_fn(|i| if held[i] { 0.0 } else { part * out.u[i] + wish * wished[i] });
        let x = &planning.inside(x)[..];
        let dx = &planning.direction(direction.x)[..];
        rows.carry(t, (x, dx), (&inside[..rows.input_dim], du), out).err()
    }
}

impl Preview {
    /// Whether it is the sample with these arguments, bit for bit.
    fn is_at(&self, t: f64, hold: f64, x: &[f64], u_ref: &[f64]) -> bool {
        let same = |a: &[f64], b: &[f64]| a.iter().map(|v| v.to_bits()).eq(b.iter().map(|v| v.to_bits()));
        same(&[self.t, self.hold], &[t, hold]) && same(&self.x, x) && same(&self.u_ref, u_ref)
    }
}

/// A number for state `i` of a trial, at which no model has a special case.
fn trial_state(i: usize, trial: usize) -> f64 {
    ((i * 37 + trial * 101 + 13) % 89) as f64 / 31.0 - 1.2
}

/// Whether h changes with time alone, at some states, and no bounds on that change are known.
fn leaves(slot: &BarrierSlot, states: usize) -> bool {
    moves(slot, states, |model, x| model.lowest_from(0.0, x).is_none_or(|least| least == f64::NEG_INFINITY))
}

/// Whether h changes with time alone, at some states that are `meant`. It is evaluated at a few times in s, and over all times at once
/// if it has enclosures.
fn moves(slot: &BarrierSlot, states: usize, meant: impl Fn(&dyn Predict, &[f64]) -> bool) -> bool {
    let Some(model) = slot.source.predict() else { return false };
    (0..DECISIONS.trials).any(|trial| {
        let x: Vec<f64> = (0..states).map(|i| trial_state(i, trial)).collect();
        let values = DECISIONS.times.map(|t| model.value(t, &x));
        let moves =
            values.iter().any(|h| (h - values[0]).abs() > DECISIONS.unmoved * (1.0 + values[0].abs()))
                || model.is_still(&x) == Some(false);
        moves && meant(model, &x)
    })
}

/// Checks that all barriers are along one plant: one plan serves all of them.
fn one_plant(rows: &Rows) -> Result<(), Error> {
    let plant = |slot: &BarrierSlot| match slot.source.follows() {
        Some(follows) => Some(follows.plant()),
        None => slot.source.shared().map(SharedPlant::plant),
    };
    let mut modelled = rows.slots.iter().filter(|slot| slot.source.predict().is_some());
    let Some(first) = modelled.next() else { return Ok(()) };
    match modelled.find(|slot| plant(slot).is_none() || plant(slot) != plant(first)) {
        None => Ok(()),
        Some(slot) => {
            let message = format!(
                "is along another plant than that of {}; a plan needs one plant for all barriers",
                first.name
            );
            Err(Error::new(ErrorKind::Unsupported, "source", message).within(&slot.name))
        }
    }
}
