//! The safety filter: from time, state and reference input to a safe input and a report.
//!
//! [`SafetyFilter::step`] reads in the order of the mathematics: evaluate the derivatives of every
//! barrier, move its phase, build its row, solve the quadratic program, report. What is remembered
//! between samples is [`FilterState`], plain data; everything else can be rebuilt without changing a
//! bit of the result.

mod builder;
mod channel;
mod errors;
mod hold;
mod integrator;
mod outlook;
mod questions;
mod report;
mod sampling;
mod search;
mod sensitivity;

pub use crate::convergence::{
    FixedTimeSettings as BarrierSettings, Infeasible, Method, Phase, ProfileKind, Refusal,
};
pub use builder::FilterBuilder;
use channel::Channel;
pub use channel::{Begin, End, Strictness};
use errors::{MeasurementErrors, Slopes};
pub use integrator::Integrator;
use outlook::{Outlook, defect, means};
pub use report::{BarrierReport, Report, Status};
pub use sampling::Sampling;
pub use sensitivity::{BarrierDerivative, NoDerivative, SampleDerivative};

use crate::convergence::sampled::PeriodBound;
use crate::convergence::{FixedTimeState, Unmet};
use crate::error::{Error, ErrorKind, length, positive};
use crate::lie::{DerivativeSource, Derivatives};
use crate::qp::{self, Bounds, Enforcement, Outcome, Problem, Residuals, Row};
use crate::scalar::all_finite;
use crate::{MAX_INPUTS, MAX_RELATIVE_DEGREE, MAX_ROWS};
use search::{Condition, Held};

/// What a filter remembers between samples: one promise per barrier, and what [`Sampling`] needs.
#[derive(Debug, Default, PartialEq)]
pub struct FilterState {
    /// In the order of the barriers.
    pub barriers: Vec<FixedTimeState>,
    /// Time of the last sample with valid inputs, in s.
    pub time: Option<f64>,
    /// The measured sampling period in s, under [`Sampling::Measured`] from the second sample on.
    pub period: Option<f64>,
    /// The input handed out at [`Self::time`]; zeros above the number of inputs.
    pub input: [f64; MAX_INPUTS],
}

impl Clone for FilterState {
    fn clone(&self) -> Self {
        Self { barriers: self.barriers.clone(), ..*self }
    }

    /// Reuses the memory, which a derived `Clone` would not: a step must not allocate.
    fn clone_from(&mut self, source: &Self) {
        let Self { barriers, time, period, input } = source;
        self.barriers.clone_from(barriers);
        (self.time, self.period, self.input) = (*time, *period, *input);
    }
}

/// How often a sample adds the instants at which its answer breaks a promise, and is solved again.
const ROUNDS: u32 = 3;

/// Of steps in a row that do not meet a constraint, so many of the first look far around for an input, and then every
/// such one.
const WIDE: (u32, u32) = (8, 16);

/// Periods that differ by less than this part of them are one.
const SAME_PERIOD: f64 = 1e-6;

/// How much further from u_ref, or 1, an instant may move the input.
const MUCH_FURTHER: f64 = 4.0;

/// Scratch memory of a step; what it holds from the step before changes no bit of the next.
struct Workspace {
    derivatives: Derivatives,
    rows: Vec<Row>,
    enforcement: Vec<Enforcement>,
    demands: Vec<PeriodBound>,
    /// What the input held over the period has to meet.
    conditions: Vec<Condition>,
    next: FilterState,
    /// The state from which each barrier is held, one after the other.
    predicted: Vec<f64>,
    /// Of each barrier by each measurement error.
    slopes: Vec<Slopes>,
    /// Of each barrier what its derivatives say of h until the next sample.
    outlooks: Vec<Outlook>,
    /// One state.
    scratch: Vec<f64>,
    report: Report,
    qp: qp::Workspace,
}

/// Turns barriers with deadlines into a filter on the input: `min ½‖u − u_ref‖²` under one row per
/// barrier and the input bounds.
///
/// # Requirements
///
/// The plant is control-affine and every barrier has the relative degree it was declared with;
/// inputs are held between samples ([`Sampling`]). A barrier's guarantee
/// needs every step satisfied ([`Status::is_satisfied`]); [`BarrierReport::guaranteed`] says whether
/// its theorem's conditions have held so far.
///
/// # References
///
/// The paper, section III; the module [`crate::convergence`].
pub struct SafetyFilter {
    state_dim: usize,
    input_dim: usize,
    channels: Vec<Channel>,
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
    /// For how long the next input will be held, in s, if somebody said so.
    expected: Option<f64>,
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
    /// # use punctual_core::{barriers::DistanceDisc, filter::*, plants::PointMass};
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
        std::mem::swap(&mut self.state, &mut self.workspace.next);
        Ok(&self.workspace.report)
    }

    /// What [`Self::step`] would return, without remembering the sample.
    ///
    /// # Errors
    ///
    /// As for [`Self::step`].
    pub fn peek(&mut self, t: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Result<&Report, Error> {
        self.sample(t, x, u_ref, u)?;
        Ok(&self.workspace.report)
    }

    fn sample(&mut self, t: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Result<(), Error> {
        length("x", x.len(), self.state_dim)?;
        length("u_ref", u_ref.len(), self.input_dim)?;
        length("u", u.len(), self.input_dim)?;
        let begin = t + self.delay;
        let acting = if self.delay > 0.0 { self.acting() } else { [0.0; MAX_INPUTS] };
        let Workspace {
            derivatives,
            rows,
            enforcement,
            demands,
            conditions,
            next,
            predicted,
            slopes,
            outlooks,
            scratch,
            report,
            qp,
        } = &mut self.workspace;
        next.clone_from(&self.state);
        report.reset(t);
        if !t.is_finite() || !all_finite(x) || !all_finite(u_ref) {
            report.status = Status::InvalidInput;
            report.barriers.fill(BarrierReport::BLANK);
            abstain(&self.state, &self.bounds, next, report, u);
            return Ok(());
        }

        let period = self.sampling.period(&self.state, t, self.first_period, self.expected);
        let since = self.state.time.map_or(0.0, |last| (t - last).max(0.0));
        let hold = period.unwrap_or(since).max(self.period_max);
        let measures = matches!(self.sampling, Sampling::Measured { .. });
        let long = self.sampling.longest(hold, self.expected.is_some() || self.period_max > 0.0);
        let mut sampled = period;
        // Within the capacity: a step does not allocate.
        conditions.clear();
        // Slices of one length, so that indices need no check.
        let count = self.channels.len();
        let demands = &mut demands[..count];
        let (promises, reports) = (&mut next.barriers[..count], &mut report.barriers[..count]);
        for i in 0..count {
            let channel = &self.channels[i];
            // Evaluate: h and its derivatives along the plant, where the input begins to act.
            channel.source.evaluate(t, x, derivatives);
            let h = derivatives.drift[0];
            let mut from = x;
            if self.delay > 0.0 || period.is_some() {
                let own = &mut predicted[i * x.len()..(i + 1) * x.len()];
                own.copy_from_slice(x);
                if self.delay > 0.0 {
                    channel.source.predict(own, &acting[..u.len()], self.delay);
                    channel.source.evaluate(begin, own, derivatives);
                }
                from = own;
            }
            if !channel.in_force(promises, i, t, h) {
                (rows[i], demands[i], outlooks[i]) = (Row::ZERO, PeriodBound::ZERO, Outlook::NONE);
                if let Some(duration) = period {
                    conditions.push(Condition { channel: i, demand: PeriodBound::ZERO, duration });
                }
                reports[i] = BarrierReport { h, ..BarrierReport::BLANK };
                reports[i].remember(&promises[i]);
                continue;
            }
            let promise = &mut promises[i];
            let n = channel.promise.relative_degree();
            if let Some(status) = defect(derivatives) {
                report.status = status;
                reports[i] = BarrierReport { h, ..BarrierReport::BLANK };
                continue;
            }
            // Phase: anchor, approach, arrival, stay; and the least h⁽ⁿ⁾ that keeps the promise.
            let stack = &derivatives.drift[..n];
            let mut unsure = [0.0; MAX_RELATIVE_DEGREE];
            if !self.errors.is_exact() {
                let slopes = &mut slopes[i * self.errors.count()..][..self.errors.count()];
                unsure = self.errors.of_derivatives(&*channel.source, t, x, u.len(), slopes);
            }
            let lowest: [f64; MAX_RELATIVE_DEGREE] =
                std::array::from_fn(|k| derivatives.drift[k] - unsure[k]);
            channel.anchor(
                promise,
                (begin, self.delay),
                &lowest[..n],
                (period.map_or(0.0, |_| hold), measures),
            );
            let means = means(derivatives, n, &self.bounds, promise, hold, u.len());
            let mut demand = channel.promise.advance_by(promise, begin, stack, &unsure, &means);
            if channel.promise.restart(promise, begin, &lowest[..n], period.map_or(0.0, |_| hold)) {
                demand = channel.promise.advance_by(promise, begin, stack, &unsure, &means);
            }
            let mut deadline_unreachable = promise.phase == Phase::Late;
            if deadline_unreachable || self.bounded {
                let (now, time_left) = ((begin, from), demand.time_left);
                deadline_unreachable = channel.is_lost(promise, now, &self.bounds, time_left);
                if deadline_unreachable && channel.postpone(promise, now, &self.bounds, &lowest[..n], period)
                {
                    demand = channel.promise.advance_by(promise, begin, stack, &unsure, &means);
                    deadline_unreachable = false;
                }
            }
            // Row: L_f^n h + L_g L_f^(n−1) h u ≥ that floor.
            let row = Row { normal: derivatives.row, floor: demand.floor - derivatives.drift[n] };
            rows[i] = row;
            enforcement[i] = channel.enforcement(promise);
            if let Some(period) = period {
                match channel.promise.over_period(promise, begin, stack, period) {
                    Some(demand) => demands[i] = demand,
                    None => sampled = None,
                }
                conditions.push(Condition { channel: i, demand: demands[i], duration: period });
            }
            outlooks[i] = Outlook::new(derivatives, n);
            reports[i] = BarrierReport { deadline_unreachable, ..BarrierReport::of(promise, h, demand, row) };
            if !row.floor.is_finite() {
                report.status = Status::Singular;
            }
        }
        if report.status != Status::Unchanged {
            abstain(&self.state, &self.bounds, next, report, u);
            return Ok(());
        }

        // Solve; where h would break its promise between the samples, once more with that instant as a row.
        report.period = sampled.unwrap_or(0.0);
        if sampled.is_none() {
            conditions.clear();
        }
        let held_from = |i: usize| match self.delay > 0.0 || period.is_some() {
            true => &predicted[i * x.len()..][..x.len()],
            false => x,
        };
        if let Some(period) = sampled.filter(|period| self.period_max > *period * (1.0 + SAME_PERIOD)) {
            // The next sample may come then, or at the end of the longest step.
            for i in 0..count.min(MAX_ROWS - count) {
                let Outlook { n, drift, .. } = &outlooks[i];
                if *n == 0 {
                    continue;
                }
                let demand =
                    self.channels[i].promise.over_period(&promises[i], begin, &drift[..*n], self.period_max);
                if let Some(demand) = demand.filter(|_| *n > 0 && period > 0.0) {
                    conditions.push(Condition { channel: i, demand, duration: self.period_max });
                }
            }
        }
        let last = self.state.time.map(|_| &self.state.input[..u.len()]);
        // Where rows have not been met for some steps, looking far around at each would find what it found before.
        let widens = |b: &FixedTimeState| b.unmet.is_none_or(|u| u.steps < WIDE.0 || u.steps % WIDE.1 == 0);
        let widens = self.state.barriers.iter().all(widens);
        let listed = conditions.len();
        let (mut round, mut allowed) = (0, f64::INFINITY);
        let mut solution;
        loop {
            let total = conditions.len().max(count);
            for (i, condition) in conditions.iter().enumerate() {
                let channel = condition.channel;
                enforcement[i] = enforcement[channel];
                rows[i] = match i < listed {
                    true => reports[channel].row,
                    false => outlooks[channel].row_at(condition, &reports[channel].row.normal),
                };
            }
            let (rows, enforcement) = (&mut rows[..total], &enforcement[..total]);
            let (bounds, correction_limit) = (&self.bounds, self.correction_limit);
            let found = (!conditions.is_empty()).then(|| {
                let problem = Held {
                    channels: &self.channels,
                    conditions: &*conditions,
                    t: begin,
                    x: &predicted[..],
                    bounds,
                    u_ref,
                    enforcement,
                    correction_limit,
                    errors: &self.errors,
                    slopes: &slopes[..],
                    widens,
                };
                problem.solve(rows, last, qp, u)
            });
            report.predicted = matches!(found, Some(Some(_)));
            solution = match found.flatten() {
                Some(solution) => solution,
                None => {
                    (0..count).for_each(|i| rows[i] = reports[i].row);
                    let (rows, enforcement) = (&rows[..count], &enforcement[..count]);
                    let problem =
                        Problem { enforcement, ..Problem::new(rows, bounds, u_ref, correction_limit) };
                    qp.solve(&problem, u)
                }
            };
            for i in 0..count {
                let held = hold::Hold { source: &*self.channels[i].source, t: begin, x: held_from(i), u };
                outlooks[i].look(&promises[i], &held, &reports[i].row.normal, [hold, long], scratch);
            }
            // An input that turns the plant by many radians makes any prediction true.
            let distance = u.iter().zip(u_ref).fold(0.0, |d: f64, (v, r)| d.hypot(v - r));
            let met = matches!(solution.outcome, Outcome::Optimal) && distance <= allowed;
            if conditions.len() > listed && !met {
                // That instant cannot be had as well: the flag says so.
                conditions.truncate(listed);
                round = ROUNDS;
                continue;
            }
            // With n = 1 the model hardly turns, and an instant soon after the sample takes what it takes.
            let turns = outlooks[..count].iter().any(|outlook| outlook.n > 1 && outlook.lowest.is_some());
            if turns {
                allowed = MUCH_FURTHER * u_ref.iter().fold(distance.max(1.0), |s: f64, r| s.max(r.abs()));
            }
            let before = conditions.len();
            if round < ROUNDS && met && report.predicted {
                for (i, outlook) in outlooks[..count].iter().enumerate() {
                    conditions.extend(outlook.condition(i, &promises[i]).filter(|_| before + i < MAX_ROWS));
                }
            }
            if conditions.len() == before {
                break;
            }
            round += 1;
        }
        if matches!(self.sampling, Sampling::Measured { .. }) && self.state.time.is_some_and(|last| t > last)
        {
            next.period = period;
        }
        next.time = Some(t);
        next.input[..u.len()].copy_from_slice(u);
        report.solver = solution.solver;
        report.iterations = solution.iterations;
        report.status = match solution.outcome {
            Outcome::Optimal if u == u_ref => Status::Unchanged,
            Outcome::Optimal => Status::Filtered,
            Outcome::Infeasible => Status::Infeasible,
            Outcome::IllConditioned => Status::NoAuthority,
            Outcome::Failed => Status::SolverFailed,
        };
        let mut blocked = false;
        for i in 0..count {
            let (row, promise, report_b) = (&rows[i], &mut promises[i], &mut reports[i]);
            if matches!(promise.phase, Phase::Waiting | Phase::Released) {
                continue;
            }
            promise.guaranteed &= outlooks[i].lowest.is_none();
            if let Some(period) = period.filter(|_| report.predicted) {
                report_b.sampling_loss = demands[i].loss(report_b.row.slack(u), period);
            }
            if report.predicted {
                report_b.row = *row;
            }
            report_b.slack = row.slack(u);
            let soft = matches!(enforcement[i], Enforcement::Soft { .. });
            let met = report.status.is_satisfied() && !soft || row.holds(u);
            // A row without what the errors may do is not the one of the theorem.
            promise.guaranteed &= report.predicted || self.errors.is_exact();
            report_b.guaranteed = promise.guaranteed;
            promise.unmet = (!met).then(|| Unmet::after(promise.unmet, t, report_b.h));
            if let Some(unmet) = promise.unmet {
                promise.guaranteed = false;
                (report_b.guaranteed, report_b.unmet_steps) = (false, unmet.steps);
                blocked = true;
            }
        }
        if blocked {
            let barrier = |row: usize| conditions.get(row).map_or(row, |condition| condition.channel);
            report.find_deadlocks(t, &next.barriers, qp.active(), barrier);
        }
        Ok(())
    }

    /// The input that acts until that of the present step does.
    fn acting(&self) -> [f64; MAX_INPUTS] {
        match self.state.time {
            Some(_) => self.state.input,
            None => std::array::from_fn(|i| self.bounds.clamp(i, 0.0)),
        }
    }

    /// Forgets the anchors: the next sample with valid inputs starts every deadline anew.
    pub fn rearm(&mut self) {
        self.state.barriers.fill(FixedTimeState::default());
        (self.state.time, self.state.period) = (None, None);
        self.state.input.fill(0.0);
    }

    /// What the filter remembers.
    pub fn state(&self) -> &FilterState {
        &self.state
    }

    /// Puts back what [`Self::state`] returned: the filter goes on exactly as it would have then.
    ///
    /// # Errors
    ///
    /// A state with another number of barriers.
    pub fn restore(&mut self, state: &FilterState) -> Result<(), Error> {
        length("barriers", state.barriers.len(), self.channels.len())?;
        self.state.clone_from(state);
        Ok(())
    }

    /// The report of the last [`Self::step`] or [`Self::peek`].
    pub fn report(&self) -> &Report {
        &self.workspace.report
    }

    /// How far `u`, the answer of the last [`Self::step`] or [`Self::peek`] to `u_ref`, is from satisfying the
    /// conditions of optimality of its qp: small multiples of 1e-16 for a pointwise step, up to the 1e-9 at which
    /// the search stops where it looked over the period ([`Report::predicted`]; of the rows linearised at `u`).
    /// `None` where no program was solved. Costs another solve: a check, not for every step. Behind an [`Integrator`]
    /// u and u_ref are those of the rate.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length.
    pub fn residuals(&mut self, u_ref: &[f64], u: &[f64]) -> Result<Option<Residuals>, Error> {
        length("u_ref", u_ref.len(), self.input_dim)?;
        length("u", u.len(), self.input_dim)?;
        let Workspace { rows, enforcement, conditions, report, qp, .. } = &mut self.workspace;
        use Status::{InvalidInput, Singular, SolverFailed, WrongRelativeDegree};
        let unsolved = matches!(report.status, InvalidInput | Singular | WrongRelativeDegree | SolverFailed);
        if unsolved || report.time.is_nan() {
            return Ok(None);
        }
        let count = conditions.len().max(self.channels.len());
        let problem = Problem {
            enforcement: &enforcement[..count],
            ..Problem::new(&rows[..count], &self.bounds, u_ref, self.correction_limit)
        };
        qp.solve(&problem, &mut [0.0; MAX_INPUTS][..u.len()]);
        Ok(Some(qp.residuals(&problem, u)))
    }

    /// The names of the barriers, in the order of the report.
    pub fn barrier_names(&self) -> impl Iterator<Item = &str> {
        self.channels.iter().map(|c| c.name.as_str())
    }

    /// Gives barrier number `index` a new deadline in s, finite, > 0, that counts from the next sample: its
    /// promise starts anew there, from the derivatives h then has, at once. Until then the input of the last sample
    /// keeps the old promise, and the new profile starts with a zero error, so that no guarantee has a gap.
    ///
    /// # Errors
    ///
    /// No such barrier; a deadline out of range.
    pub fn set_deadline(&mut self, index: usize, deadline: f64) -> Result<(), Error> {
        let channel = self.channel(index)?;
        let named = |e: Error| e.within(&channel.name);
        channel.promise = channel.promise.clone().with_deadline(deadline).map_err(named)?;
        channel.begin = Begin::AtOnce;
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
        let (exact, count) = (self.errors.is_exact(), dims.1);
        let channel = self.channel(index)?;
        let named = |e: Error| e.within(&channel.name);
        if !exact {
            errors::check(&*source, count).map_err(named)?;
        }
        length("x", source.state_dim(), dims.0).map_err(named)?;
        length("u", source.input_dim(), dims.1).map_err(named)?;
        let (found, wanted) = (source.relative_degree(), channel.source.relative_degree());
        if found != wanted {
            let message = format!("is {found}, must stay {wanted}");
            return Err(named(Error::new(ErrorKind::RelativeDegree, "relative_degree", message)));
        }
        channel.source = source;
        self.state.barriers[index] = FixedTimeState::default();
        Ok(())
    }

    /// Says for how long the input of the next sample will be held, in s, finite, > 0, or that nobody knows (`None`): for
    /// whoever is told, such as a co-simulation slave by the size of its step. [`Sampling::Measured`] then goes by it.
    /// It is asked at every sample, and not part of [`Self::state`].
    ///
    /// # Errors
    ///
    /// A time out of range.
    pub fn expect_hold(&mut self, hold: Option<f64>) -> Result<(), Error> {
        self.expected = hold.map(|hold| positive("hold", hold)).transpose()?;
        Ok(())
    }

    fn channel(&mut self, index: usize) -> Result<&mut Channel, Error> {
        let count = self.channels.len();
        let message = || format!("is {index}, must be < {count}, the number of barriers");
        self.channels.get_mut(index).ok_or_else(|| Error::new(ErrorKind::Range, "barrier", message()))
    }

    /// Why barrier `index` goes by another method than the configured one since its anchor
    /// ([`BarrierReport::fallback`]); `None` where it does not. Computed anew: not for every step.
    pub fn refusal(&self, index: usize) -> Option<Refusal> {
        self.channels.get(index)?.promise.refusal(self.state.barriers.get(index)?)
    }

    /// The relative degree of each barrier, in the order of the report.
    pub fn relative_degrees(&self) -> impl Iterator<Item = usize> + '_ {
        self.channels.iter().map(|c| c.source.relative_degree())
    }
}

/// A sample that enforces nothing: the admissible input nearest 0. The promises stay as they were in
/// `state`, but those already given lose their guarantee.
fn abstain(state: &FilterState, bounds: &Bounds, next: &mut FilterState, report: &mut Report, u: &mut [f64]) {
    next.clone_from(state);
    for (promise, b) in next.barriers.iter_mut().zip(&mut report.barriers) {
        promise.guaranteed = false;
        b.remember(promise);
    }
    for (i, ui) in u.iter_mut().enumerate() {
        *ui = bounds.clamp(i, 0.0);
    }
}
