//! One sample, in the order of the mathematics: evaluate, advance, rows, solve, report.

use super::hold::Hold;
use super::outlook::{self, Outlook};
use super::search::{PeriodProblem, Requirement};
use super::{BarrierReport, Rows, SAME_PERIOD, Sampling, Status, Workspace};
use crate::convergence::{FixedTimeState, Unmet};
use crate::elementary;
use crate::error::{Error, length};
use crate::qp::{Enforcement, Outcome, Problem, Solution, Solver};
use crate::{MAX_INPUTS, MAX_ROWS};

/// How many times at most a sample adds the instants at which its answer breaks a promise, and is solved again.
const ROUNDS: u32 = 3;

/// The same of a brief search.
const BRIEF_ROUNDS: u32 = 1;

/// How many times a sample adds instants at most; never to pointwise rows.
pub(crate) fn rounds(sampling: Sampling, is_brief: bool) -> u32 {
    match sampling {
        Sampling::Pointwise => 0,
        _ if is_brief => BRIEF_ROUNDS,
        _ => ROUNDS,
    }
}

/// The most rows of a sample: for each barrier one, one at the longest step if that is `given`, and one for each of the `rounds`
/// in which instants are added.
pub(crate) fn most(barriers: usize, given: bool, rounds: u32) -> usize {
    (barriers * (1 + usize::from(given) + rounds as usize)).min(MAX_ROWS)
}

/// Steps that search widely for an input if they do not meet a constraint: the first 8 in a row, then every 16th.
const WIDE: (u32, u32) = (8, 16);

/// Largest distance from u_ref to which an added instant may move the input, in units of the largest of the distance before,
/// |u_ref| and 1.
const MUCH_FURTHER: f64 = 4.0;

/// Time and place of a sample, and the hold of its input.
pub(crate) struct Moment<'a> {
    /// Time of the sample in s.
    pub(crate) t: f64,
    /// Time in s from the sample until its input acts.
    pub(crate) delay: f64,
    /// Time in s from which its input acts.
    pub(crate) begin: f64,
    pub(crate) x: &'a [f64],
    pub(crate) u_ref: &'a [f64],
    /// The period in s that the rows look over; `None` for the pointwise constraint.
    pub(crate) period: Option<f64>,
    /// The longest time in s that the input is expected to be held.
    pub(crate) hold: f64,
    /// The longest time in s that a hold of `hold` s may turn out to last.
    pub(crate) long: f64,
    /// Whether the period is measured.
    pub(crate) measures: bool,
    /// Whether any input has a bound: without one, nothing is ruled out.
    pub(crate) bounded: bool,
}

impl Moment<'_> {
    /// The hold in s that margins and rates account for; 0 for the pointwise constraint.
    pub(crate) fn covered(&self) -> f64 {
        self.period.map_or(0.0, |_| self.hold)
    }
}

impl Rows {
    /// Takes a sample: writes its input to `u`, its report and the state after it to the workspace.
    pub(crate) fn sample(&mut self, t: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) -> Result<(), Error> {
        length("u", u.len(), self.input_dim)?;
        if !self.prepare(t, x, u_ref)? {
            self.workspace.report.barriers.fill(BarrierReport::BLANK);
            self.abstain(Status::InvalidInput, u);
            return Ok(());
        }
        if !self.workspace.next.is_armed(t, self.arm_after) {
            self.wait(t, x, u_ref, u);
            return Ok(());
        }
        let moment = self.moment(t, x, u_ref);
        match self.rows(&moment) {
            Err(status) => self.abstain(status, u),
            Ok(()) => {
                self.require_longest(&moment);
                let solution = self.solve(&moment, u);
                self.report_on(&moment, solution, u);
            }
        }
        Ok(())
    }

    /// Clears the report, and begins the state after the sample. Returns whether all numbers are finite.
    fn prepare(&mut self, t: f64, x: &[f64], u_ref: &[f64]) -> Result<bool, Error> {
        length("x", x.len(), self.state_dim)?;
        length("u_ref", u_ref.len(), self.input_dim)?;
        self.workspace.next.clone_rows_from(&self.state);
        self.workspace.report.reset(t);
        self.note_start(t);
        let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
        Ok(t.is_finite() && finite(x) && finite(u_ref))
    }

    /// Takes a sample whose input `u` something else has decided: writes its report and the state after it to the workspace.
    pub(crate) fn observe(&mut self, t: f64, x: &[f64], u: &[f64]) -> Result<(), Error> {
        let is_valid = self.prepare(t, x, u)?;
        let mut failed = (!is_valid).then_some(Status::InvalidInput);
        if is_valid {
            let moment = self.moment(t, x, u);
            failed = self.rows(&moment).err();
            if failed.is_none() {
                self.workspace.search.clear();
                self.workspace.qp.clear();
                let (mut outcome, rows) = (Outcome::Optimal, &mut self.workspace.rows);
                for (slot, row) in self.slots.iter_mut().zip(rows) {
                    (slot.now.lowest, *row) = (None, slot.now.row);
                    if slot.now.in_force && !row.holds(u) {
                        outcome = Outcome::Infeasible;
                    }
                }
                self.report_on(&moment, Solution { outcome, solver: Solver::Unchanged, iterations: 0 }, u);
            }
        } else {
            self.workspace.report.barriers.fill(BarrierReport::BLANK);
        }
        if let Some(status) = failed {
            let mut none = [0.0; MAX_INPUTS];
            self.abstain(status, &mut none[..u.len()]);
            self.workspace.next.input[..u.len()].copy_from_slice(u);
        }
        Ok(())
    }

    pub(super) fn moment<'a>(&self, t: f64, x: &'a [f64], u_ref: &'a [f64]) -> Moment<'a> {
        let period = self.sampling.period(&self.state, t, self.first_period, self.expected);
        let since = self.state.time.map_or(0.0, |last| (t - last).max(0.0));
        let hold = period.unwrap_or(since).max(self.period_max);
        let reported = self.expected.is_some() || self.period_max > 0.0;
        Moment {
            t,
            delay: self.delay,
            begin: t + self.delay,
            x,
            u_ref,
            period,
            hold,
            long: self.sampling.longest(hold, reported),
            measures: matches!(self.sampling, Sampling::Measured { .. }),
            bounded: self.bounded,
        }
    }

    /// Evaluates every barrier, moves its promise to the sample, and forms its row (docs/theory.md, sections 1 and 6 to 8).
    /// If not all have a row over the period, none is required.
    ///
    /// # Errors
    ///
    /// Derivatives or a row that cannot carry a constraint.
    fn rows(&mut self, moment: &Moment) -> Result<(), Status> {
        let Workspace { next, report, requirements, search, .. } = &mut self.workspace;
        // Within the capacity: a step does not allocate.
        requirements.clear();
        search.evaluations.plants.forget();
        let (mut found, mut is_sampled) = (Ok(()), moment.period.is_some());
        let promises = &mut next.barriers[..];
        for (i, slot) in self.slots.iter_mut().enumerate() {
            let report = &mut report.barriers[i];
            let plants = &mut search.evaluations.plants;
            let h = slot.evaluate(moment, (&self.state, &self.bounds), plants);
            let deadline_unreachable = match slot.advance(promises, i, h, moment, &self.bounds, &self.errors)
            {
                Ok(is_unreachable) => is_unreachable,
                Err(status) => {
                    *report = BarrierReport { h, ..BarrierReport::BLANK };
                    found = Err(status);
                    continue;
                }
            };
            if slot.now.in_force {
                is_sampled &= slot.form_row(&promises[i], moment);
                report.begin(&promises[i], h, &slot.now.bound, &slot.now.row, deadline_unreachable);
                if !slot.now.row.floor.is_finite() {
                    found = Err(Status::Singular);
                }
            } else {
                *report = BarrierReport { h, ..BarrierReport::BLANK };
                report.remember(&promises[i]);
            }
            if let Some(ahead) = moment.period {
                requirements.push(Requirement::new(i, slot.now.period_bound, ahead, slot.degree()));
            }
        }
        found?;
        report.period = moment.period.filter(|_| is_sampled).unwrap_or(0.0);
        if !is_sampled {
            requirements.clear();
        }
        Ok(())
    }

    /// Requires (S) at the end of the longest step too, if that is longer than the period (docs/theory.md, section 7).
    fn require_longest(&mut self, moment: &Moment) {
        let Workspace { next, report, requirements, .. } = &mut self.workspace;
        if report.period <= 0.0 || self.period_max <= report.period * (1.0 + SAME_PERIOD) {
            return;
        }
        let room = MAX_ROWS - self.slots.len();
        for (i, (slot, promise)) in self.slots.iter().zip(&next.barriers).enumerate().take(room) {
            if let Some(bound) = slot.over(promise, moment, self.period_max) {
                requirements.push(Requirement::new(i, bound, self.period_max, slot.degree()));
            }
        }
    }

    /// Solves. If h would break its promise between the samples, solves again with that instant as a row
    /// (`docs/theory.md#between-samples`).
    fn solve(&mut self, moment: &Moment, u: &mut [f64]) -> Solution {
        let listed = self.workspace.requirements.len();
        let rounds = rounds(self.sampling, self.brief_search);
        let (mut round, mut allowed) = (0, f64::INFINITY);
        loop {
            let solution = self.solve_once(moment, listed, u);
            let breaks = self.look(moment, u);
            // An answer that is too far out does not count: an input that turns the plant by many radians makes any
            // prediction come true.
            let distance =
                || u.iter().zip(moment.u_ref).fold(0.0, |d: f64, (v, r)| elementary::hypot(d, v - r));
            let met = matches!(solution.outcome, Outcome::Optimal)
                && (allowed == f64::INFINITY || distance() <= allowed);
            if self.workspace.requirements.len() > listed && !met {
                // That instant cannot be met as well: solve without it; the report says so.
                self.workspace.requirements.truncate(listed);
                round = ROUNDS;
                continue;
            }
            // Limit how far an instant may move the input. With n = 1 there is no limit: the model hardly turns, and an
            // instant soon after the sample may need a large input.
            if breaks && self.slots.iter().any(|slot| slot.now.lowest.is_some() && slot.degree() > 1) {
                let size = moment.u_ref.iter().fold(distance().max(1.0), |s: f64, r| s.max(r.abs()));
                allowed = MUCH_FURTHER * size;
            }
            let again = breaks && round < rounds && met && self.workspace.report.predicted;
            if !(again && self.require_instants()) {
                return solution;
            }
            round += 1;
        }
    }

    /// Solves the QP: over the period if all barriers have a row over it and a model to predict with
    /// (`docs/theory.md#prediction`), otherwise pointwise. The first `listed` requirements start from the pointwise rows.
    fn solve_once(&mut self, moment: &Moment, listed: usize, u: &mut [f64]) -> Solution {
        let is_brief = self.is_brief();
        let Workspace { rows, enforcement, requirements, report, search, qp, .. } = &mut self.workspace;
        search.clear();
        let (bounds, correction_limit, u_ref) = (&self.bounds, self.correction_limit, moment.u_ref);
        // Over the period.
        if !requirements.is_empty() {
            for (i, requirement) in requirements.iter().enumerate() {
                enforcement[i] = self.slots[requirement.barrier].now.enforcement;
            }
            // If rows have not been met for some steps, a wide search at every step would find nothing new.
            let widens =
                |b: &FixedTimeState| b.unmet.is_none_or(|u| u.steps < WIDE.0 || u.steps % WIDE.1 == 0);
            let problem = PeriodProblem {
                slots: &self.slots,
                requirements,
                listed,
                t: moment.begin,
                bounds,
                u_ref,
                enforcement: &enforcement[..requirements.len()],
                correction_limit,
                errors: &self.errors,
                widens: self.state.barriers.iter().all(widens),
                is_brief,
                curvature: self.state.curvature_before(moment.t).as_ref(),
            };
            let last = self.state.time.map(|_| &self.state.input[..u.len()]);
            if let Some(solution) = problem.solve(&mut rows[..requirements.len()], last, search, qp, u) {
                report.predicted = true;
                return solution;
            }
        }
        // Pointwise, if there is no row over the period or no prediction.
        report.predicted = false;
        for (i, slot) in self.slots.iter().enumerate() {
            (rows[i], enforcement[i]) = (slot.now.row, slot.now.enforcement);
        }
        let count = self.slots.len();
        let problem = Problem::new(&rows[..count], bounds, u_ref, correction_limit);
        qp.solve(&Problem { enforcement: &enforcement[..count], ..problem }, u)
    }

    /// Checks every instant until the next sample under the held input `u`. Returns whether a promise is broken at one.
    fn look(&mut self, moment: &Moment, u: &[f64]) -> bool {
        let Workspace { next, scratch, search, .. } = &mut self.workspace;
        let mut breaks = false;
        for (i, (slot, promise)) in self.slots.iter_mut().zip(&next.barriers).enumerate() {
            slot.now.lowest = None;
            if !slot.now.in_force {
                continue;
            }
            if let Some(span) = outlook::span(promise, moment.begin, [moment.hold, moment.long]) {
                let held = Hold {
                    source: slot.source.predict(),
                    t: moment.begin,
                    x: &slot.now.from,
                    u,
                    shortfall: slot.now.shortfall.as_ref(),
                    is_brief: self.brief_search,
                };
                // The first requirements are those of the barriers over the period.
                let known = moment.period.and_then(|period| Some((period, search.predicted(i, u)?)));
                let outlook = Outlook { known, ..slot.outlook() };
                slot.now.lowest = outlook.look(promise, &held, &slot.now.row.normal, span, scratch);
                breaks |= slot.now.lowest.is_some();
            }
        }
        breaks
    }

    /// Requires the instants at which the answer breaks a promise. Returns whether there are any.
    fn require_instants(&mut self) -> bool {
        let Workspace { next, requirements, .. } = &mut self.workspace;
        let before = requirements.len();
        for (i, (slot, promise)) in self.slots.iter().zip(&next.barriers).enumerate() {
            let requirement = slot.outlook().requirement(i, promise, slot.now.lowest);
            requirements.extend(requirement.filter(|_| before + i < MAX_ROWS));
        }
        requirements.len() > before
    }

    /// Reports the step, and records for each promise whether it was met and is still guaranteed (docs/theory.md, section
    /// 7).
    fn report_on(&mut self, moment: &Moment, solution: Solution, u: &[f64]) {
        let Workspace { next, report, rows, requirements, search, qp, .. } = &mut self.workspace;
        if moment.measures && self.state.time.is_some_and(|last| moment.t > last) {
            next.period = moment.period;
        }
        next.time = Some(moment.t);
        next.curvatures = [*self.state.curvature_before(moment.t), search.curvature];
        next.input[..u.len()].copy_from_slice(u);
        report.solver = solution.solver;
        report.iterations = solution.iterations;
        report.status = match solution.outcome {
            Outcome::Optimal if u == moment.u_ref => Status::Unchanged,
            Outcome::Optimal => Status::Filtered,
            Outcome::Infeasible => Status::Infeasible,
            Outcome::IllConditioned => Status::NoAuthority,
            Outcome::Failed => Status::SolverFailed,
        };
        // Each barrier: its slack, its loss, and whether its guarantee continues.
        let (status, predicted) = (report.status, report.predicted);
        let mut blocked = false;
        for (i, slot) in self.slots.iter().enumerate().filter(|(_, slot)| slot.now.in_force) {
            let (row, promise, report) = (&rows[i], &mut next.barriers[i], &mut report.barriers[i]);
            if let Some(period) = moment.period.filter(|_| predicted) {
                report.sampling_loss = slot.now.period_bound.loss(slot.now.row.slack(u), period);
                report.row = *row;
            }
            report.slack = row.slack(u);
            let soft = matches!(slot.now.enforcement, Enforcement::Soft { .. });
            let met = status.is_satisfied() && !soft || row.holds(u);
            // With measurement errors, only the predicted rows contain them and are those of the theorem.
            let is_kept = slot.now.lowest.is_none()
                && (predicted || self.errors.is_exact())
                && !self.state.is_crowded();
            promise.on_course &= met && is_kept;
            promise.unmet = (!met).then(|| Unmet::after(promise.unmet, moment.t, report.h));
            report.on_course = promise.on_course;
            report.unmet_steps = promise.unmet.map_or(0, |unmet| unmet.steps);
            blocked |= !met;
        }
        if blocked {
            let barrier = |row: usize| requirements.get(row).map_or(row, |requirement| requirement.barrier);
            report.find_deadlocks(moment.t, &next.barriers, qp.active(), barrier);
        }
    }

    /// Records the first sample, if the filter is armed later. A sample before it is the first of another run.
    #[inline]
    fn note_start(&mut self, t: f64) {
        let start = &mut self.workspace.next.start;
        if self.arm_after > 0.0 && t.is_finite() && start.is_none_or(|start| t < start) {
            *start = Some(t);
        }
    }

    /// Lets u_ref pass within its bounds, since the filter is not armed yet.
    fn wait(&mut self, t: f64, x: &[f64], u_ref: &[f64], u: &mut [f64]) {
        let Workspace { next, report, .. } = &mut self.workspace;
        report.status = Status::NotArmed;
        for ((slot, b), promise) in self.slots.iter_mut().zip(&mut report.barriers).zip(&next.barriers) {
            slot.source.evaluate(t, x, &mut slot.now.derivatives);
            *b = BarrierReport { h: slot.now.derivatives.drift[0], ..BarrierReport::BLANK };
            b.remember(promise);
        }
        for (i, u) in u.iter_mut().enumerate() {
            *u = self.bounds.clamp(i, u_ref[i]);
        }
        next.input[..u.len()].copy_from_slice(u);
    }

    /// Enforces nothing and returns the admissible input nearest 0. Promises stay as they were, but lose their guarantee.
    fn abstain(&mut self, status: Status, u: &mut [f64]) {
        let Workspace { next, report, .. } = &mut self.workspace;
        report.status = status;
        // Clocks that have started continue; so do deadlines, if the inputs were valid.
        let start = next.start;
        let starts: [Option<f64>; MAX_ROWS] = core::array::from_fn(|i| next.barriers.get(i)?.start_time);
        next.clone_rows_from(&self.state);
        next.start = start;
        for (promise, start) in next.barriers.iter_mut().zip(starts) {
            promise.start_time = start;
        }
        for (promise, b) in next.barriers.iter_mut().zip(&mut report.barriers) {
            promise.on_course = false;
            b.remember(promise);
        }
        for (i, ui) in u.iter_mut().enumerate() {
            *ui = self.bounds.clamp(i, 0.0);
            // Before the first input it is known without.
            if self.state.time.is_some() || next.input[i] != 0.0 {
                next.input[i] = *ui;
            }
        }
    }

    /// The inputs that act from the sample at `t` on until its own does, each with the time in s for which it does.
    pub(crate) fn acting(&self, t: f64) -> impl Iterator<Item = (f64, [f64; MAX_INPUTS])> + Clone + use<'_> {
        self.state.acting(&self.bounds, t, self.delay)
    }
}
