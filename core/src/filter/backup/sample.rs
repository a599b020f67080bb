//! A sample of a filter with plans: what is promised, whether it is kept, and the input that has a plan behind it.

use alloc::vec::Vec;

use super::choice::{ChoiceMemory, Chosen, Piece, Wish};
use super::deviation::Deviation;
use super::first::{First, least_factor};
use super::planning::Planning;
use super::settings::DECISIONS;
use super::state::{PlanState, Promise, round_off};
use super::{Assurance, AssuranceStatus, Driver, Plans};
use crate::MAX_INPUTS;
use crate::convergence::FixedTimeState;
use crate::filter::integrator::Integrator;
use crate::filter::rows::{BarrierSlot, End, Rows, Workspace};
use crate::filter::{BarrierReport, Infeasible, Phase, Status};
use crate::plan::{
    BackupPlan, Course, Failure, Plan, Planner, SearchProgress, TOLERANCES, Uncertainty, slopes,
};
use crate::qp::Bounds;
use crate::scalar::all_finite;

/// A sample in progress: the rows have answered, and the plans decide.
pub(super) struct Decision<'a> {
    pub(super) rows: &'a mut Rows,
    pub(super) integrator: Option<&'a Integrator>,
    pub(super) plans: &'a Plans,
    pub(super) bounds: &'a Bounds,
    /// What is not known of the plant, if anything is declared.
    pub(super) uncertainty: Option<&'a Uncertainty>,
    /// Time and state of the sample.
    pub(super) measured: (f64, &'a [f64]),
    /// Number of states of the model, and the points measured at this sample.
    pub(super) states: usize,
    pub(super) courses: Vec<Option<Course>>,
    pub(super) assurance: &'a mut Assurance,
    /// How the input varies with the sample.
    pub(super) piece: &'a mut Piece,
}

/// When the input of a sample begins to act, the model's state there, and how long it is held, in s.
#[derive(Clone, Copy)]
pub(super) struct At<'a> {
    pub(super) t: f64,
    pub(super) hold: f64,
    pub(super) x: &'a [f64],
}

/// A very first sample and what was found for it. A master evaluates a sample again for another u_ref, and the search does not
/// depend on that where every input has bounds.
pub(in crate::filter) struct Decided {
    asked: Asked,
    found: Result<(f64, First), Failure>,
}

/// What a search at a very first sample depends on besides the filter.
#[derive(PartialEq)]
struct Asked {
    at: [f64; 4],
    x: Vec<f64>,
}

impl Asked {
    /// `None` of other samples, and beside points: those searches depend on more.
    fn of(planning: &Planning<'_>, At { t, hold, x }: At<'_>, u: &[f64]) -> Option<Self> {
        let (Rows { state, .. }, before) = (planning.rows, planning.before());
        let is_first = state.time.is_none() && state.start.is_none() && before.plan.is_empty();
        let is_bounded =
            (0..u.len()).all(|i| planning.bounds.min[i].is_finite() && planning.bounds.max[i].is_finite());
        let (measured, of) = planning.measured?;
        (is_first && is_bounded && planning.courses.is_empty())
            .then(|| Self { at: [t, hold, measured, of.len() as f64], x: [x, of].concat() })
    }
}

impl Decision<'_> {
    fn planning(&self) -> Planning<'_> {
        let Self { rows, integrator, plans, bounds, uncertainty, measured, states, courses, .. } = self;
        Planning {
            rows,
            integrator: *integrator,
            plans,
            bounds,
            uncertainty: *uncertainty,
            measured: Some(*measured),
            states: *states,
            courses,
        }
    }

    fn before(&self) -> &PlanState {
        &self.rows.state.plan
    }

    fn now(&self) -> &PlanState {
        &self.rows.workspace.next.plan
    }

    fn next(&mut self) -> &mut PlanState {
        &mut self.rows.workspace.next.plan
    }

    /// Turns the answer `u` of the rows, whose report and state are in the workspace, into that of the whole filter.
    pub(super) fn sample(&mut self, at: At<'_>, u_ref: &[f64], u: &mut [f64]) {
        let At { t, hold, x } = at;
        let Workspace { next, .. } = &mut self.rows.workspace;
        next.plan.clone_from(&self.rows.state.plan);
        // Not by the report's status: u_ref may be NaN.
        if next.plan.status == AssuranceStatus::Undecided
            && !next.is_armed(self.measured.0, self.rows.arm_after)
        {
            (*self.assurance, *self.piece) = (Assurance::default(), Piece::ROWS);
            return;
        }
        let mut rows = [0.0; MAX_INPUTS];
        rows[..u.len()].copy_from_slice(u);
        let are_points = self.courses.iter().flatten().all(|course| all_finite(&course.point));
        let is_valid = t.is_finite() && all_finite(x) && are_points;
        if t.is_finite() && (is_valid || self.now().sample.is_some()) {
            self.next().arrived = self.planning().arriving(self.measured.0);
            self.see(t, is_valid.then_some(x));
            self.next().note(t, hold);
        }
        let mut is_regular = self.before().is_regular(t, hold);
        if self.now().status == AssuranceStatus::Undecided && is_valid {
            // A plan made at a sample suits that sample.
            is_regular |= self.decide(at, u);
        } else if self.before().is_followed() {
            self.judge(at, is_valid);
        }
        (self.assurance.driver, *self.piece, self.assurance.reason) = (Driver::Rows, Piece::ROWS, None);
        self.release();
        let undeclared = if is_valid { self.undeclared(at, u) } else { None };
        let is_over = self.now().promises.iter().flatten().all(|promise| promise.until <= t);
        if self.now().status == AssuranceStatus::Assured && !is_over {
            self.assurance.driver = match is_valid {
                true => self.choose(at, u_ref, u, is_regular),
                false => self.go_on(at, u),
            };
        } else if self.now().status == AssuranceStatus::Undecided && !self.now().plan.is_empty() {
            if self.planning().in_time(t, hold) {
                self.assurance.driver = self.go_on(at, u);
            } else {
                self.next().plan = Plan::default();
            }
        }
        self.confirm_stays(at, u);
        if self.now().status == AssuranceStatus::Assured
            && is_valid
            && let Some(failure) = self.exposed(at, u)
        {
            self.end(AssuranceStatus::Lost, Some(failure));
        }
        if self.now().status == AssuranceStatus::Assured
            && is_valid
            && let Some(failure) = self.unguarded(at)
        {
            self.end(AssuranceStatus::Lost, Some(failure));
        }
        if let Some(failure) = undeclared
            && self.now().status == AssuranceStatus::Assured
        {
            self.end(AssuranceStatus::Lost, Some(failure));
        }
        // After anything else than a law or a plan from here, the plant need not be in a tube.
        if self.uncertainty.is_some() && self.now().status != AssuranceStatus::Assured {
            self.next().plan.backup_plan.forget();
        }
        let next = &self.rows.workspace.next.plan;
        let is_assured = next.status == AssuranceStatus::Assured;
        (self.assurance.status, self.assurance.failure) = (next.status, next.failure);
        self.assurance.until = is_assured.then_some(if is_over { f64::INFINITY } else { next.until() });
        self.assurance.reason = self.assurance.reason.filter(|_| is_assured);
        if is_assured || u != &rows[..u.len()] {
            self.report_on(&rows[..u.len()], u);
        }
    }

    /// Decides at the first sample what is promised, and whether a plan keeps it. If none does, the barriers that [accept a
    /// later deadline](Infeasible::Earliest) get the earliest one for which there is a plan. Returns whether the plan was
    /// made here.
    fn decide(&mut self, at: At<'_>, u: &[f64]) -> bool {
        let At { t, hold, x } = at;
        let asked = Asked::of(&self.planning(), at, u);
        let known =
            self.rows.workspace.decided.take().filter(|decided| asked.as_ref() == Some(&decided.asked));
        let found = known.map_or_else(|| self.found(at, u), |decided| decided.found);
        self.rows.workspace.decided = asked.map(|asked| Decided { asked, found: found.clone() });
        match found {
            Ok((factor, First { promises, plan, let_go, is_old })) => {
                self.let_go(&let_go);
                let courses = self.planning().rests_on(t, &promises);
                let next = self.next();
                (next.promises, next.plan, next.courses) = (promises, plan, courses);
                next.deviation = Deviation::from(t, x);
                next.memory = ChoiceMemory::beside(&next.plan.backup_plan);
                self.prolong_next(t);
                self.end(AssuranceStatus::Assured, None);
                self.postpone(t, hold, factor);
                !is_old
            }
            Err(failure) => {
                // The rows go for the first alternatives.
                let others: Vec<usize> = self.planning().choices().next().unwrap_or_default();
                let promises = self.planning().promises(t, x, |_| 1.0);
                self.let_go(&others);
                let next = self.next();
                (next.promises, next.plan) = (promises, Plan::default());
                self.end(AssuranceStatus::Refused, Some(failure));
                true
            }
        }
    }

    /// What is promised at the first sample, with the factor on the deadlines that yield, and its plan.
    fn found(&self, At { t, hold, x }: At<'_>, u: &[f64]) -> Result<(f64, First), Failure> {
        let planning = self.planning();
        let search = |promises, shorter: &[f64]| planning.first(promises, (t, hold), x, u, shorter);
        let promises = planning.promises(t, x, |_| 1.0);
        let mut found = search(promises, &DECISIONS.shorter).map(|first| (1.0, first));
        let yields = |slot: &BarrierSlot| slot.promise.settings().infeasible == Infeasible::Earliest;
        if found.is_err() && planning.rows.slots.iter().any(yields) {
            let promised =
                |factor: f64| planning.promises(t, x, |slot| if yields(slot) { factor } else { 1.0 });
            let later = |factor: f64| search(promised(factor), &[]).ok().map(|first| (factor, first));
            let sooner = |factor: f64, (before, first): &(f64, First)| {
                let (promises, plan) = (promised(factor), &first.plan);
                planning
                    .beside(promises, (t, hold), x, u, plan, factor / before)
                    .ok()
                    .map(|first| (factor, first))
            };
            let later = least_factor(planning.longest(Plans::LONGEST, yields), None, later, sooner);
            found = later.map_or(found, Ok);
        }
        if planning.is_jittery() && hold < planning.rows.delay * (1.0 - TOLERANCES.on_time) {
            found = Err(Failure::Overtaken);
        }
        // Until its first input acts, a filter can only look on.
        let acting: Vec<_> = planning.rows.acting(self.measured.0).collect();
        found.and_then(|(factor, first)| {
            planning.waits(&first.promises, self.measured, &acting).map(|()| (factor, first))
        })
    }

    /// Lets the barriers of alternatives go that are not taken.
    fn let_go(&mut self, barriers: &[usize]) {
        let Workspace { next, report, .. } = &mut self.rows.workspace;
        for &i in barriers {
            (next.barriers[i].phase, next.barriers[i].unmet) = (Phase::Released, None);
            report.barriers[i] = BarrierReport { h: report.barriers[i].h, ..BarrierReport::BLANK };
            report.barriers[i].remember(&next.barriers[i]);
        }
    }

    /// Restarts the rows at the first sample, with deadlines `factor` times as long for the barriers that accept this. The
    /// rows keep more margin than the plans, so that a plan backs their answer at the edge of a set too.
    fn postpone(&mut self, t: f64, hold: f64, factor: f64) {
        let Rows { slots, state, workspace, delay, .. } = &mut *self.rows;
        let delay = *delay;
        let Workspace { next, report, .. } = workspace;
        let states = next.barriers.iter_mut().zip(&state.barriers).zip(&next.plan.promises);
        for ((slot, ((state, before), promise)), b) in slots.iter().zip(states).zip(&mut report.barriers) {
            let settings = slot.promise.settings();
            let later = factor > 1.0 && settings.infeasible == Infeasible::Earliest && b.h < 0.0;
            state.least_margin = promise.map_or(0.0, |promise| DECISIONS.ample * promise.margin);
            if !slot.now.in_force || !(later || state.least_margin > settings.margin) {
                continue;
            }
            let FixedTimeState { deadline, arrival, on_course, gain, unmet, .. } = *state;
            // Deadlines count from the sample, promises from where its input acts.
            let deadline = if later { factor * slot.promise.deadline() - delay } else { deadline };
            slot.promise.anchor(state, t, &slot.now.derivatives.drift[..slot.degree()], deadline, hold);
            (state.arrival, state.gain, state.unmet) = (arrival, gain, unmet);
            if later {
                // Once, whatever the rows made of it.
                state.postponed = before.postponed + 1;
                (b.time_left, b.deadline_unreachable) = (state.deadline, false);
            } else {
                state.on_course = on_course;
            }
            b.remember(state);
        }
    }

    /// Compares the plant at `t` with where the model has led since the last sample. `x` is the state, if measured.
    fn see(&mut self, t: f64, x: Option<&[f64]>) {
        let before = self.before();
        let Some([last, _]) = before.sample.filter(|[last, _]| t > *last && before.is_followed()) else {
            return;
        };
        let (u, mut led) =
            (&self.rows.state.input[..self.rows.input_dim], self.now().deviation.state.clone());
        let is_led = self.planning().planned(&self.now().promises, (last, t - last), u, |planner| {
            planner.run(&mut led, u);
            Ok(())
        });
        // If nothing is promised, nothing can be missed.
        if is_led.is_ok() {
            let period = self.plans.period;
            self.next().deviation.see(t, x, led, period);
        }
    }

    /// Judges a promise that was followed: whether the sample came in time, and whether anything was missed before it.
    fn judge(&mut self, At { t, hold, x }: At<'_>, is_valid: bool) {
        // A promise that expired was kept until then.
        let has_expired = self.before().status == AssuranceStatus::Expired;
        let lost = |status| if has_expired { AssuranceStatus::Expired } else { status };
        match (self.planning().in_time(t, hold), is_valid.then(|| self.missed(t, x)).flatten()) {
            (true, None) if is_valid => self.end(AssuranceStatus::Assured, None),
            (true, None) => {}
            (false, None) => self.end(lost(AssuranceStatus::Irregular), None),
            // Lost for good.
            (_, failure) => {
                self.end(lost(AssuranceStatus::Lost), failure);
                self.next().promises.fill(None);
            }
        }
    }

    /// What was missed, or may have been, until `t` since a plan was last followed, with the state at `x`: a set that was
    /// left, or a promise that began meanwhile.
    fn missed(&self, t: f64, x: &[f64]) -> Option<Failure> {
        let PlanState { status, sample, lost, .. } = self.before();
        let seen = sample.map_or(t, |[last, held]| match status {
            AssuranceStatus::Assured => last + held * (1.0 + DECISIONS.jitter),
            // There was a plan, but for a plant that deviates from the model.
            AssuranceStatus::Lost if lost.is_none() => last + held * (1.0 + DECISIONS.jitter),
            _ => last,
        });
        // A promise covers all times: the same time measured again was not promised.
        if t <= seen + round_off(t) {
            return None;
        }
        // A measured state says less than the plan of an uncertain plant, which covers the time until now.
        if self.uncertainty.is_some() && *status == AssuranceStatus::Assured {
            return None;
        }
        let promises = self.now().promises.iter().zip(self.planning().models_seen());
        promises.enumerate().find_map(|(barrier, (promise, model))| {
            let Promise { from, until, .. } = (*promise)?;
            let h = model.value(t, x);
            // A promise that begins at this sample is checked now.
            let begins = t - 2.0 * TOLERANCES.on_time * self.plans.period;
            match from <= t && t < until {
                // NaN counts as outside.
                true if h.is_nan() || h < 0.0 => Some(Failure::Broken { barrier, time: t, slack: h }),
                true if seen < from && from < begins => Some(Failure::Missed { barrier }),
                _ => None,
            }
        })
    }

    /// Ends the promise of each set that was released on arrival.
    fn release(&mut self) {
        let Rows { slots, workspace: Workspace { next, report, .. }, .. } = &mut *self.rows;
        for ((promise, slot), b) in next.plan.promises.iter_mut().zip(slots).zip(&report.barriers) {
            if !matches!(slot.end, End::Never | End::At(_)) && b.phase == Phase::Released {
                *promise = None;
            }
        }
    }

    /// Begins a stay again that may be broken between this sample and the next one: before its time no plan accounts for it.
    fn confirm_stays(&mut self, At { t, hold, x }: At<'_>, u: &[f64]) {
        let promises = &self.now().promises;
        let mut inside = [0.0; MAX_INPUTS];
        inside[..u.len()].copy_from_slice(u);
        let is_open = |(i, promise): (usize, &Option<Promise>)| {
            let is_early = promise.is_some_and(|promise| promise.from > self.measured.0);
            let next = &self.rows.workspace.next.barriers[i];
            if !is_early || next.since.is_none() {
                return None;
            }
            let mut alone = alloc::vec![None; promises.len()];
            alone[i] = promise.map(|promise| Promise {
                from: t,
                until: f64::INFINITY,
                margin: 0.0,
                reserve: 0.0,
                ..promise
            });
            let stays = self.uncertainty.is_none()
                && self.rows.delay == 0.0
                && self
                    .planning()
                    .planned(&alone, (t, hold), u, |planner| planner.holds(t, x, &[(hold, inside)]))
                    .is_ok();
            (!stays).then_some(i)
        };
        let broken: Vec<usize> = promises.iter().enumerate().filter_map(is_open).collect();
        for i in broken {
            self.rows.workspace.next.barriers[i].since = None;
        }
    }

    /// Why the plant is not the one that was declared, if the last plan was for an uncertain one.
    fn undeclared(&mut self, At { t, hold, x }: At<'_>, u: &[f64]) -> Option<Failure> {
        // A point that strayed once is not trusted before it moves as declared again.
        if let Some(failure) = self.planning().strayed(&self.before().courses) {
            let courses = self.courses.clone();
            self.next().courses = courses;
            return Some(failure);
        }
        let of = self.uncertainty?;
        let planned = self.planning().planned(&self.now().promises, (t, hold), u, |planner| {
            let PlanState { status, plan, deviation, .. } = self.before();
            match status {
                AssuranceStatus::Assured => planner.is_declared(plan, t, x),
                // Nor is a plant that was lost, before it moves as declared again.
                AssuranceStatus::Lost if self.rows.delay == 0.0 && !of.lags() && of.jitter == 0.0 => {
                    let (since, input) = (deviation.since, &self.rows.state.input[..self.rows.input_dim]);
                    match since < t && self.before().last_time() == Some(since) {
                        true => planner.was_declared((since, &deviation.state), input, (t, x)),
                        false => Ok(()),
                    }
                }
                _ => Ok(()),
            }
        });
        planned.err().filter(|failure| matches!(failure, Failure::Undeclared { .. }))
    }

    /// What is missed before the input of the sample acts, where no plan says that nothing is: it was lost, or an exact plant is
    /// not where it led.
    fn unguarded(&self, At { hold, x, .. }: At<'_>) -> Option<Failure> {
        let status = self.before().status;
        let is_there = self.uncertainty.is_some() || !self.now().deviation.is_displaced(hold, x);
        // The first plan was decided on with that time.
        if status == AssuranceStatus::Undecided || status == AssuranceStatus::Assured && is_there {
            return None;
        }
        let mut promises = self.now().promises.clone();
        promises.iter_mut().flatten().for_each(|promise| (promise.margin, promise.reserve) = (0.0, 0.0));
        let acting: Vec<_> = self.rows.acting(self.measured.0).collect();
        self.planning().waits(&promises, self.measured, &acting).err()
    }

    /// What may be missed before the next sample under `u`, if the plant continues to deviate from the model as observed.
    fn exposed(&self, At { t, hold, x }: At<'_>, u: &[f64]) -> Option<Failure> {
        // Every deviation that was declared is in the plan.
        if self.uncertainty.is_some() {
            return None;
        }
        let mut promises = self.now().promises.clone();
        let differs = self.now().deviation.after(hold, x)?;
        let mut slope = x.to_vec();
        for (promise, model) in promises.iter_mut().zip(self.planning().models()) {
            let Some(kept) = promise.as_mut().filter(|promise| promise.from < t + hold) else {
                *promise = None;
                continue;
            };
            slopes(&*model, t, x, &mut slope);
            let falls: f64 = slope.iter().zip(&differs).map(|(slope, differs)| slope.abs() * differs).sum();
            (kept.margin, kept.reserve, kept.firm) = (DECISIONS.gusts * falls, 0.0, t);
        }
        let mut held = [0.0; MAX_INPUTS];
        held[..u.len()].copy_from_slice(u);
        match self.planning().planned(&promises, (t, hold), u, |planner| planner.holds(t, x, &[(hold, held)]))
        {
            Err(Failure::Broken { barrier, time, slack }) => Some(Failure::Drift { barrier, time, slack }),
            _ => None,
        }
    }

    fn end(&mut self, status: AssuranceStatus, failure: Option<Failure>) {
        let next = self.next();
        (next.status, next.failure) = (status, failure);
    }

    /// Sets when the filter next tries to prolong the current plan.
    fn prolong_next(&mut self, t: f64) {
        let at = self.planning().next_prolonging(t, self.now().until());
        self.next().prolong_at = at;
    }

    /// Looks for a plan that ends later than the current one, if it is due.
    fn prolong(&mut self, At { t, hold, x }: At<'_>, u: &[f64]) {
        let PlanState { promises, plan, prolong_at, .. } = self.now();
        let is_due = match self.planning().is_nearly_over(t) {
            Some(is_nearly_over) => is_nearly_over && (t >= *prolong_at || *prolong_at == f64::INFINITY),
            None => t >= *prolong_at,
        };
        if !is_due {
            return;
        }
        let mut promises = promises.clone();
        if self.planning().is_nearly_over(t).is_some() {
            // A plan that nothing else prolonged may use its reserve up.
            promises.iter_mut().flatten().for_each(|promise| promise.reserve = 0.0);
        }
        let planning = self.planning();
        let longer = planning
            .planned(&promises, (t, hold), u, |planner| planner.beyond(&plan.backup_plan).search(t, x))
            .ok()
            .map(|plan| PlanState { plan, courses: planning.rests_on(t, &promises), ..PlanState::default() })
            .filter(|longer| longer.until() > self.now().until());
        if let Some(PlanState { plan, courses, .. }) = longer {
            let next = self.next();
            (next.plan, next.courses) = (plan, courses);
        }
        self.prolong_next(t);
    }

    /// Chooses the input and remembers the plan behind it. `u` first holds the answer of the rows. `is_regular` says whether
    /// the plan was made for this sample.
    fn choose(&mut self, at: At<'_>, u_ref: &[f64], u: &mut [f64], is_regular: bool) -> Driver {
        self.prolong(at, u);
        let At { t, hold, x } = at;
        let (planning, mut memory) = (self.planning(), self.now().memory.clone());
        let (wish, wanted) = planning.wanted(hold, u_ref);
        let wish = Wish {
            wish: &wish[..u.len()],
            wanted: &wanted[..u.len()],
            rows: u,
            reached: self.now().promises.iter().flatten().all(|promise| promise.from <= t),
        };
        // A law that goes on rests on what was measured when it was checked.
        let law = |plan: &BackupPlan| plan.tracking().map(core::ptr::from_ref);
        let last = law(&self.before().plan.backup_plan);
        let goes_on = |plan: &BackupPlan| last.is_some() && law(plan) == last;
        let is_known = self.before().reaches(self.planning().next_by(t, hold));
        let search = |planning: Planning<'_>, memory: &mut ChoiceMemory| {
            planning.planned(&self.now().promises, (t, hold), u, |planner| {
                let planner = planner.irregular(!is_regular).hurried(planning.plans.search_budget);
                let chosen = planning.chosen(&planner, (t, x), wish, memory)?;
                let chosen = planning.smoothed(&planner, (t, x), chosen, wish.reached);
                // It may end later than what is known of a point.
                if goes_on(&chosen.backup_plan) && !is_known { Err(Failure::NoRest) } else { Ok(chosen) }
            })
        };
        let mut found = search(planning, &mut memory);
        let (promises, before) = (&self.now().promises, &self.before().courses);
        let (mut courses, mut regained) = (planning.rests_on(t, promises), SearchProgress::default());
        if found.is_err() && !before.is_empty() && is_known {
            // What was known before still holds, until then. Meanwhile another plan is sought that reaches farther.
            memory = self.now().memory.clone();
            let known = Planning { courses: before, ..planning };
            found = search(known, &mut memory);
            // The last deadline may be gone since then, and a plan is kept no farther than from now on.
            let before = known.rests_on(t, promises);
            let plan = &self.now().plan;
            if found.is_ok() && is_regular && !plan.is_finite() {
                regained.clone_from(&self.now().regained);
                let farther = planning.planned(promises, (t, hold), u, |planner| {
                    let planner = planner.hurried(planning.plans.search_budget);
                    planner.regained(plan, t, x, &mut regained).map_err(|_| Failure::Nothing)
                });
                match farther {
                    Ok(plan) => {
                        let backup_plan = plan.backup_plan.clone();
                        let (driver, piece) = (Driver::Plan, Piece::PLAN);
                        found = Ok(Chosen { driver, piece, share: 1.0, backup_plan, plan: Some(plan) });
                        regained = SearchProgress::default();
                    }
                    Err(_) => courses = before,
                }
            } else {
                courses = before;
            }
        }
        match found {
            Ok(chosen) => {
                let Chosen { driver, piece, share, backup_plan, plan } = chosen;
                memory.note([self.before().share, share], driver);
                u.copy_from_slice(&backup_plan.inputs[0].1[..u.len()]);
                self.assurance.reason = memory.reason.filter(|_| *u != wanted[..u.len()]);
                *self.piece = piece;
                let courses = if goes_on(&backup_plan) { self.before().courses.clone() } else { courses };
                let next = self.next();
                (next.memory, next.share) = (memory, share);
                (next.lost, next.regained) = (None, regained);
                if let Some(plan) = plan {
                    next.plan = plan;
                }
                (next.plan.backup_plan, next.courses) = (backup_plan, courses);
                driver
            }
            Err(failure) => self.regain(at, failure, u, is_regular),
        }
    }

    /// Looks for another plan if the current one no longer keeps the promises, for the reason `failure`.
    fn regain(&mut self, at: At<'_>, failure: Failure, u: &mut [f64], is_regular: bool) -> Driver {
        let At { t, hold, x } = at;
        // A plan that ends at an equilibrium is sought by a few steps per sample, if samples come as expected.
        let is_spread = is_regular && !self.now().plan.is_finite();
        let (mut regained, mut goes_on) = (self.now().regained.clone(), false);
        let (planning, plan) = (self.planning(), &self.now().plan);
        let found = match self.before().lost {
            Some([_, next]) if t < next => Err(failure),
            _ => {
                // A lost plan is sought without its reserve.
                let mut promises = self.now().promises.clone();
                promises.iter_mut().flatten().for_each(|promise| promise.reserve = 0.0);
                planning.planned(&promises, (t, hold), u, |planner| match is_spread {
                    true => planner
                        .hurried(planning.plans.search_budget)
                        .regained(plan, t, x, &mut regained)
                        .map_err(|left| {
                            goes_on = left;
                            failure
                        }),
                    false => planner.beyond(&plan.backup_plan).search(t, x),
                })
            }
        };
        let courses = planning.rests_on(t, &self.now().promises);
        let next = self.next();
        next.regained = regained;
        match found {
            Ok(plan) => {
                next.courses = courses;
                u.copy_from_slice(&plan.backup_plan.inputs[0].1[..u.len()]);
                (next.plan, next.share) = (plan, 1.0);
                (next.lost, next.regained) = (None, SearchProgress::default());
                self.prolong_next(t);
                *self.piece = Piece::PLAN;
                Driver::Plan
            }
            Err(longer) => {
                // A plan that has expired was kept.
                let is_at_its_end = next.plan.backup_plan.until <= t + 0.5 * hold || !next.reaches(t + hold);
                let PlanState { status, lost, .. } = *self.before();
                let (status, failure) = match is_regular {
                    _ if lost.is_some() => (status, failure),
                    _ if is_at_its_end => (AssuranceStatus::Expired, longer),
                    true => (AssuranceStatus::Lost, failure),
                    false => (AssuranceStatus::Irregular, failure),
                };
                self.end(status, Some(failure));
                // Less and less often, since a search takes long.
                if lost.is_none_or(|[_, next]| t >= next) {
                    let since = lost.map_or(t, |[since, _]| since);
                    let pause = if goes_on { 0.0 } else { (t - since).max(hold).max(self.plans.period) };
                    self.next().lost = Some([since, t + pause]);
                }
                self.come_near(at, u)
            }
        }
    }

    /// The input once the guarantee is lost: that of the plan's law if it nearly keeps the promise from here, otherwise the
    /// answer of the rows.
    fn come_near(&mut self, At { t, hold, x }: At<'_>, u: &mut [f64]) -> Driver {
        let nearly = |planner: &Planner<'_>| planner.nearly(&self.now().plan, t, x);
        match self.planning().planned(&self.now().promises, (t, hold), u, nearly) {
            Ok(input) => {
                u.copy_from_slice(&input[..u.len()]);
                *self.piece = Piece::PLAN;
                Driver::Plan
            }
            Err(_) => Driver::Rows,
        }
    }

    /// Continues with the plan as it is while the state of the plant is unknown.
    fn go_on(&mut self, At { t, hold, .. }: At<'_>, u: &mut [f64]) -> Driver {
        let plan = &self.now().plan;
        let inputs = &plan.backup_plan.inputs;
        let next = inputs.iter().find(|(end, _)| *end > t + 0.5 * hold);
        // Past its end, the plant leaves an equilibrium that only feedback holds.
        let is_over = next.is_none() && !plan.stays() || !self.now().reaches(t + hold);
        if let Some((_, input)) = next.or(inputs.last()) {
            for (i, u) in u.iter_mut().enumerate() {
                *u = self.bounds.clamp(i, input[i]);
            }
        }
        // An uncertain plant stays near a plan by measurements alone.
        let is_lost = is_over || !self.before().is_regular(t, hold) || self.uncertainty.is_some();
        if is_lost && self.now().status == AssuranceStatus::Undecided {
            self.next().plan = Plan::default();
        } else if is_lost {
            let is_blind = is_over || self.uncertainty.is_some();
            self.end(if is_blind { AssuranceStatus::Lost } else { AssuranceStatus::Irregular }, None);
        }
        Driver::Plan
    }

    /// Rewrites report and state of the rows, which answered `rows`, for the input `u` actually applied. If the guarantee
    /// holds, a plan is behind `u`.
    fn report_on(&mut self, rows: &[f64], u: &[f64]) {
        let (driver, is_assured) = (self.assurance.driver, self.assurance.is_assured());
        let Workspace { next, report, .. } = &mut self.rows.workspace;
        next.input[..u.len()].copy_from_slice(u);
        report.status = match (report.status, driver) {
            (Status::InvalidInput, _) => Status::InvalidInput,
            (status, _) if !is_assured => {
                if status.is_satisfied() {
                    Status::Infeasible
                } else {
                    status
                }
            }
            (_, Driver::Reference) => Status::Unchanged,
            (_, Driver::Eased) => Status::Filtered,
            (status, Driver::Rows) if status.is_satisfied() => status,
            _ => Status::Backup,
        };
        for ((b, state), promise) in
            report.barriers.iter_mut().zip(&mut next.barriers).zip(&next.plan.promises)
        {
            if u != rows {
                (b.on_course, state.on_course) = (false, false);
                b.slack = b.row.slack(u);
            }
            // Plans count from the first state, rows from the first complete sample: a promise may end before its row.
            let stands = promise.as_ref().is_some_and(|promise| report.time < promise.until);
            if is_assured && stands && b.phase != Phase::Released {
                b.guaranteed = true;
                (b.unmet_steps, state.unmet) = (0, None);
                (b.blocked_by, b.deadlocked) = (None, false);
            }
        }
    }
}
