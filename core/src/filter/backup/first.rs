//! The first sample: the plan on which the promises rest, and the earliest deadlines that a plan keeps.

use alloc::vec::Vec;
use core::cell::Cell;

use super::bears::Bears;
use super::planning::Planning;
use super::schedule::{Choice, Order};
use super::settings::{DECISIONS, DecisionSettings};
use super::state::Promise;
use crate::MAX_INPUTS;
use crate::elementary;
use crate::filter::AssuranceStatus;
use crate::plan::{BackupPlan, Failure, Plan, Planner};

/// The result of a first sample: what is promised, and by which plan.
#[derive(Clone)]
pub(in crate::filter) struct First {
    pub(super) promises: Vec<Option<Promise>>,
    pub(super) plan: Plan,
    /// The barriers of the alternatives that are not taken.
    pub(super) let_go: Vec<usize>,
    /// Whether the plan is from before the filter was armed again.
    pub(super) is_old: bool,
}

/// What plans can do from a state.
#[derive(Debug)]
#[non_exhaustive]
pub struct Appraisal {
    /// The plan for the deadlines themselves.
    ///
    /// # Errors
    ///
    /// Why the nearest trial fails.
    pub plan: Result<BackupPlan, Failure>,
    /// The least factor on every deadline with which a plan is found, and that plan; `None` without a deadline.
    pub earliest: Option<(f64, BackupPlan)>,
    /// What the plan for the deadlines themselves bears.
    pub bears: Option<Bears>,
}

impl Planning<'_> {
    /// The plan that a first sample at `t` and `x` would find, with every deadline `factor` times as long. Remembers
    /// nothing. `factor`: finite, > 0.
    ///
    /// # Errors
    ///
    /// Why the nearest trial fails.
    pub fn plan_from(&self, t: f64, x: &[f64], factor: f64) -> Result<BackupPlan, Failure> {
        let (measured, courses) = (self.state(x), self.courses(t, x));
        let own = Planning { measured: Some((t, &measured)), courses: &courses, ..*self };
        let (t, x) = self.acts(t, &measured);
        let promises = own.promises(t, &x, |_| factor);
        own.first(promises, (t, self.plans.period), &x, &[], &DECISIONS.shorter)
            .map(|First { promises, plan, .. }| own.dated(plan.backup_plan, t, &promises))
    }

    /// What [`Self::plan_from`] finds for the deadlines themselves, [`Self::earliest_deadline`], and what that plan
    /// [bears](Self::bears), with one search for all.
    pub fn appraise(&self, t: f64, x: &[f64], longest: f64) -> Appraisal {
        let (measured, courses) = (self.state(x), self.courses(t, x));
        let own = Planning { measured: Some((t, &measured)), courses: &courses, ..*self };
        let (acts, state) = self.acts(t, &measured);
        let promises = own.promises(acts, &state, |_| 1.0);
        let has_deadline = self.rows.slots.iter().any(|slot| slot.promise.settings().deadline.is_some());
        let later = |first| if has_deadline { self.least(t, x, longest, first) } else { None };
        match own.first(promises, (acts, self.plans.period), &state, &[], &DECISIONS.shorter) {
            Ok(first) => Appraisal {
                bears: self.borne_by(&first, t, x),
                plan: Ok(own.dated(first.plan.backup_plan.clone(), acts, &first.promises)),
                earliest: later(Some(first)),
            },
            Err(failure) => Appraisal { plan: Err(failure), earliest: later(None), bears: None },
        }
    }

    /// Whether a first sample at `t` and `x` could promise each barrier. Not promised are: a soft barrier, one that ends
    /// before its deadline, and one without a deadline that begins at once and whose set does not contain `x`.
    pub fn promised(&self, t: f64, x: &[f64]) -> impl Iterator<Item = bool> + use<> {
        let courses = self.courses(t, x);
        let own = Planning { courses: &courses, ..*self };
        let (t, x) = self.acts(t, &self.state(x));
        own.promises(t, &x, |_| 1.0).into_iter().map(|promise| promise.is_some())
    }

    /// The least factor by which every deadline has to be multiplied so that a plan from `x` at `t` is found, and that plan.
    /// The factor is accurate to a fiftieth, or less if a plan arrives sooner than it has to. The search goes no further
    /// than `longest` times the deadlines, nor to a deadline after the end of its barrier.
    pub fn earliest_deadline(&self, t: f64, x: &[f64], longest: f64) -> Option<(f64, BackupPlan)> {
        let (measured, courses) = (self.state(x), self.courses(t, x));
        let own = Planning { measured: Some((t, &measured)), courses: &courses, ..*self };
        let (acts, state) = self.acts(t, &measured);
        let promises = own.promises(acts, &state, |_| 1.0);
        let first = own.first(promises, (acts, self.plans.period), &state, &[], &DECISIONS.shorter);
        self.least(t, x, longest, first.ok())
    }

    /// The same if [none is found](Self::plan_from) for the deadlines themselves; these are not tried again.
    pub fn later_deadline(&self, t: f64, x: &[f64], longest: f64) -> Option<(f64, BackupPlan)> {
        self.least(t, x, longest, None)
    }

    /// The model's states along `backup_plan` from the measured state `x` at `t`, in steps of at most `step` s, finite, > 0.
    /// Each comes with the input that is held from there until the next. The last is the equilibrium, with the input that
    /// holds it.
    pub fn trajectory(
        &self,
        backup_plan: &BackupPlan,
        t: f64,
        x: &[f64],
        step: f64,
    ) -> Vec<(f64, Vec<f64>, [f64; MAX_INPUTS])> {
        let x = self.state(x);
        let (acts, begin) = self.acts(t, &x);
        let trajectory = self.along(&backup_plan.inputs, acts, &begin, step);
        // What is on its way acts before.
        let mut end = t;
        let acting = self.rows.acting(t).filter(|_| acts > t).map(|(dt, u)| {
            end += dt;
            (end, u)
        });
        let mut before = self.along(&acting.collect::<Vec<_>>(), t, &x, step);
        before.pop();
        before.extend(trajectory);
        before
    }

    /// [`Self::earliest_deadline`]; `first` was found for the deadlines themselves.
    pub(super) fn least(
        &self,
        t: f64,
        x: &[f64],
        longest: f64,
        first: Option<First>,
    ) -> Option<(f64, BackupPlan)> {
        let (measured, courses) = (self.state(x), self.courses(t, x));
        let own = Planning { measured: Some((t, &measured)), courses: &courses, ..*self };
        let (t, x) = self.acts(t, &measured);
        let x = &x[..];
        let promised = |factor: f64| own.promises(t, x, |_| factor);
        let arrived = |factor: f64, First { promises, plan, .. }: First| {
            (factor * own.arrival(&promises, &plan, t, x), plan)
        };
        // An uncertain plant that runs away from a plan runs farther from a longer one.
        let runs_away = Cell::new(false);
        let find = |factor: f64| {
            if runs_away.get() {
                return None;
            }
            let found = own.first(promised(factor), (t, self.plans.period), x, &[], &[]);
            runs_away.set(matches!(found, Err(Failure::Spreads)));
            Some(arrived(factor, found.ok()?))
        };
        let sooner = |factor: f64, (before, plan): &(f64, Plan)| {
            let found =
                own.beside(promised(factor), (t, self.plans.period), x, &[], plan, factor / before).ok()?;
            Some(arrived(factor, found))
        };
        let found = first.map(|first| arrived(1.0, first));
        let (factor, plan) = least_factor(self.longest(longest, |_| true), found, find, sooner)?;
        Some((factor, own.dated(plan.backup_plan, t, &promised(factor))))
    }

    /// `plan` for `promises` from `t` on, with the time until which it keeps them.
    fn dated(&self, mut plan: BackupPlan, t: f64, promises: &[Option<Promise>]) -> BackupPlan {
        let ends = self.rests_on(t, promises).into_iter().flatten().map(|course| course.until);
        plan.until = ends.fold(plan.until, f64::min);
        plan
    }

    /// The first plan for `asked`, or for what may be promised in its place. A search for other deadlines than those asked, with
    /// nothing `shorter`, tries the best order of visits alone.
    pub(super) fn first(
        &self,
        asked: Vec<Option<Promise>>,
        at: (f64, f64),
        x: &[f64],
        u: &[f64],
        shorter: &[f64],
    ) -> Result<First, Failure> {
        let Some(ways) = self.ways(&asked, at.0, x) else {
            return self.first_of(asked, at, x, u, shorter);
        };
        let (mut nearest, mut waiting) = (None, Vec::new());
        let search = |promises| self.first_of(promises, at, x, u, shorter);
        // More time for what is not reached.
        let repaired = |order: &Order, failure| match failure {
            Failure::Broken { barrier, .. } => order.slower_to(barrier, at.0, self.plans.period),
            _ => None,
        };
        // The best order of every way, before any is repaired.
        for Choice { latest, let_go, is_possible, orders } in ways {
            if is_possible {
                match search(latest.clone()) {
                    Ok(first) => return Ok(First { let_go, ..first }),
                    Err(failure) => _ = nearest.get_or_insert(failure),
                }
            }
            let mut orders = orders.into_iter();
            let mut slower = None;
            if let Some(order) = orders.next()
                && let Some(promises) = self.at_times(&latest, &order, at.0)
            {
                match search(promises) {
                    Ok(first) => return Ok(First { let_go, ..first }),
                    Err(failure) => {
                        nearest.get_or_insert(failure);
                        slower = repaired(&order, failure);
                    }
                }
            }
            let repairs = DECISIONS.repairs;
            let others = slower
                .map(|order| (order, repairs - 1))
                .into_iter()
                .chain(orders.map(move |order| (order, repairs)));
            waiting.push((latest, let_go, others));
        }
        for (latest, let_go, others) in waiting.into_iter().filter(|_| !shorter.is_empty()) {
            for (mut order, repairs) in others {
                for _ in 0..=repairs {
                    let Some(promises) = self.at_times(&latest, &order, at.0) else { break };
                    let failure = match search(promises) {
                        Ok(first) => return Ok(First { let_go, ..first }),
                        Err(failure) => failure,
                    };
                    nearest.get_or_insert(failure);
                    let Some(slower) = repaired(&order, failure) else { break };
                    order = slower;
                }
            }
        }
        Err(nearest.unwrap_or(Failure::Nothing))
    }

    /// The first plan for `promises`: with their reserve; otherwise without; otherwise for deadlines shortened to one of the
    /// parts `shorter`; otherwise the current plan.
    fn first_of(
        &self,
        mut promises: Vec<Option<Promise>>,
        at: (f64, f64),
        x: &[f64],
        u: &[f64],
        shorter: &[f64],
    ) -> Result<First, Failure> {
        if let Some(failure) = self.contradiction(&promises, at.0) {
            return Err(failure);
        }
        let search =
            |promises: &[Option<Promise>]| self.planned(promises, at, u, |planner| planner.search(at.0, x));
        let mut found = search(&promises);
        if found.is_err() && promises.iter().flatten().any(|promise| promise.reserve > promise.margin) {
            promises.iter_mut().flatten().for_each(|promise| promise.reserve = 0.0);
            // A tube that runs away does so without a reserve too.
            if !matches!(found, Err(Failure::Spreads)) {
                found = search(&promises);
            }
        }
        if let Err(Failure::Broken { .. } | Failure::Unsteady | Failure::Spreads) = found
            && self.plans.horizon.is_none()
            && self.visits(&promises) == 0
            && !self.is_ruled_out(&promises, at.0, x)
        {
            // A plan that keeps an earlier deadline keeps a later one, though another search may find it. One that makes a visit
            // earlier does not make it later.
            // One that ends before the deadlines themselves does not keep them.
            let reaches = |plan: &Plan| promises.iter().flatten().all(|p| p.from < plan.backup_plan.until);
            let mut earlier = shorter
                .iter()
                .filter_map(|part| search(&self.sooner(&promises, at.0, *part)).ok().filter(reaches));
            found = earlier.next().map_or(found, Ok);
        }
        let let_go = Vec::new();
        let Err(failure) = found else {
            return found.map(|plan| First { promises, plan, let_go, is_old: false });
        };
        let old = &self.before().plan;
        // A law in a tube was checked for what was promised then.
        let is_bound = self.uncertainty.is_some();
        if self.before().status != AssuranceStatus::Undecided || old.is_empty() || is_bound {
            return Err(failure);
        }
        promises.iter_mut().flatten().for_each(|promise| promise.reserve = 0.0);
        let is_irregular = !self.before().is_regular(at.0, at.1);
        let tail = |planner: &Planner<'_>| planner.irregular(is_irregular).tail(old, at.0, x);
        match self.planned(&promises, at, u, tail) {
            // A plan that ends sooner does not reach it.
            Ok(backup_plan) if promises.iter().flatten().all(|promise| promise.from < backup_plan.until) => {
                let mut plan = old.clone();
                plan.backup_plan = backup_plan;
                Ok(First { promises, plan, let_go, is_old: true })
            }
            _ => Err(failure),
        }
    }

    /// A plan for `promises` near `plan`. The deadlines of `promises` are `factor` times those that `plan` was made for. The
    /// search looks only near that plan, and not at all where there was a choice.
    pub(super) fn beside(
        &self,
        mut promises: Vec<Option<Promise>>,
        at: (f64, f64),
        x: &[f64],
        u: &[f64],
        plan: &Plan,
        factor: f64,
    ) -> Result<First, Failure> {
        let chooses = !self.plans.alternatives.is_empty() || self.visits(&promises) > 1;
        if chooses || self.is_ruled_out(&promises, at.0, x) {
            return Err(Failure::Nothing);
        }
        promises.iter_mut().flatten().for_each(|promise| promise.reserve = 0.0);
        let search = |planner: &Planner<'_>| planner.beside(plan, factor).search(at.0, x);
        let plan = self.planned(&promises, at, u, search)?;
        Ok(First { promises, plan, let_go: Vec::new(), is_old: false })
    }

    /// `plan` keeps `promises` from `x` at `t`. Returns the part of the time until their deadlines that it needs for all of
    /// them, at most 1.
    pub(super) fn arrival(&self, promises: &[Option<Promise>], plan: &Plan, t: f64, x: &[f64]) -> f64 {
        let end = plan.backup_plan.inputs.last().map_or(t, |(end, _)| *end);
        let trajectory = self.along(
            &plan.backup_plan.inputs,
            t,
            x,
            self.plans.period.max((end - t) / DECISIONS.most_points),
        );
        let mut part = 0.0_f64;
        for ((promise, slot), model) in promises.iter().zip(&self.rows.slots).zip(self.models()) {
            let Some(promise) = promise.filter(|p| p.from > t && slot.promise.settings().deadline.is_some())
            else {
                continue;
            };
            let least = promise.margin.max(promise.reserve);
            let before = trajectory.iter().take_while(|(at, ..)| *at < promise.from);
            let outside = before.enumerate().filter(|(_, (at, x, _))| {
                let h = model.value(*at, x);
                h.is_nan() || h < least
            });
            let arrival = outside.last().and_then(|(k, _)| trajectory.get(k + 1)).map_or(t, |(at, ..)| *at);
            // Deadlines count from the sample.
            let sample = t - self.rows.delay;
            part = part.max((arrival - sample) / (promise.from - sample));
        }
        let keeps = |part: f64| {
            let sooner = self.sooner(promises, t, part);
            let keeps = |planner: &Planner<'_>| match planner.keeps(plan, t, x) {
                true => Ok(()),
                false => Err(Failure::Nothing),
            };
            self.planned(&sooner, (t, self.plans.period), &[], keeps).is_ok()
        };
        DECISIONS
            .arrived
            .into_iter()
            .map(|late| late * part)
            .find(|part| *part > 0.0 && *part < 1.0 && keeps(*part))
            .unwrap_or(1.0)
    }
}

/// The least factor for which `find` finds something, to a fiftieth, and the result; `None` beyond `longest`. `found` is the
/// result for factor 1. What is found with a factor, or near it for a smaller one, is assumed to be found with every larger
/// one. `sooner` looks near an earlier result.
pub(super) fn least_factor<T>(
    longest: f64,
    mut found: Option<(f64, T)>,
    find: impl Fn(f64) -> Option<(f64, T)>,
    sooner: impl Fn(f64, &(f64, T)) -> Option<(f64, T)>,
) -> Option<(f64, T)> {
    let DecisionSettings { factors: [least, most], fine, wide, searches, .. } = DECISIONS;
    // Double the factor until something is found. Then halve it, and reduce it by less whenever nothing is found nearby.
    let longest = longest.min(most);
    let (mut low, mut high) = (0.0, 1.0);
    while found.is_none() && high < longest {
        (low, high) = (high, (2.0 * high).min(longest));
        found = find(high);
    }
    let (mut found, mut part, mut searches) = (found?, 0.5, searches);
    loop {
        let between = elementary::sqrt(low * found.0);
        if fine * part < 1.0 && found.0 > least {
            let factor = part * found.0;
            match if factor > low { sooner(factor, &found) } else { None } {
                Some(nearer) => found = nearer,
                None => part = elementary::sqrt(part),
            }
        } else if searches > 0 && low > 0.0 && wide * low < found.0 {
            // Another trajectory may arrive sooner than any near the one found.
            searches -= 1;
            match find(between) {
                Some(nearer) => (found, part) = (nearer, 0.5),
                None => low = between,
            }
        } else {
            break;
        }
    }
    Some(found)
}
