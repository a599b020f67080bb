//! The memory of plans between samples: what is promised, and the plan that keeps it.

use alloc::vec::Vec;

use super::AssuranceStatus;
use super::choice::ChoiceMemory;
use super::deviation::Deviation;
use super::settings::DECISIONS;
use crate::error::{Error, ErrorKind, length};
use crate::plan::{BackupPlan, Course, Failure, Plan, SearchProgress, TOLERANCES};
use crate::scalar::all_finite;

/// The part of a [`FilterState`](crate::filter::FilterState) that belongs to plans: the promises and the plan that keeps
/// them.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PlanState {
    /// Status of the guarantee.
    pub status: AssuranceStatus,
    /// Why there is no plan, if the promise was refused or the guarantee lost.
    pub(super) failure: Option<Failure>,
    /// One per barrier; `None` if nothing is promised, or nothing any longer.
    pub(super) promises: Vec<Option<Promise>>,
    /// The plan; before the decision, one from before [`Filter::rearm`](crate::filter::Filter::rearm).
    pub(super) plan: Plan,
    /// If the plan was lost: when, in s, and when another one is next searched for.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub(super) lost: Option<[f64; 2]>,
    /// The search for another plan.
    pub(super) regained: SearchProgress,
    /// The plan's share of the last input, beside u_ref or the answer of the rows; 0 if no plan was needed.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub(super) share: f64,
    /// What is comfortable, and when a plan behind u_ref is next sought.
    pub(super) memory: ChoiceMemory,
    /// The time in s at which the filter next tries to prolong a plan that ends.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub(super) prolong_at: f64,
    /// Time of the last sample in s, and how long its input was to be held.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub(super) sample: Option<[f64; 2]>,
    /// What may arrive of each input at that time, before the input of that sample, if it is followed late: the least and the
    /// largest.
    pub(super) arrived: Vec<[f64; 2]>,
    /// The measurements on which the plan rests: of the point of each barrier that follows one; empty for a plant alone.
    pub(super) courses: Vec<Option<Course>>,
    /// The time in s between the last two samples, and how many intervals in a row have been about as long; 0 before there
    /// is one.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub(super) interval: f64,
    pub(super) alike: u32,
    /// The deviation of the plant from the model, observed since the promise was given.
    pub(super) deviation: Deviation,
}

impl PlanState {
    /// Whether the guarantee holds, or may be regained.
    pub(super) fn is_followed(&self) -> bool {
        match self.status {
            AssuranceStatus::Assured => true,
            AssuranceStatus::Undecided | AssuranceStatus::Refused => false,
            AssuranceStatus::Lost | AssuranceStatus::Irregular | AssuranceStatus::Expired => {
                self.promises.iter().any(Option::is_some)
            }
        }
    }

    /// Records a sample at `t`, whose input is to be held for `hold` s.
    pub(super) fn note(&mut self, t: f64, hold: f64) {
        if let Some([last, _]) = self.sample
            && t > last
        {
            let interval = t - last;
            self.alike = if is_like(interval, self.interval) { self.alike.saturating_add(1) } else { 1 };
            self.interval = interval;
        }
        self.sample = Some([t, hold]);
    }

    /// Forgets what was promised. Keeps a plan that was followed, to continue with it, and the time of the last sample.
    pub(crate) fn rearm(&mut self) {
        let Self { status, promises, plan, sample, arrived, interval, alike, .. } = core::mem::take(self);
        self.arrived = arrived;
        let is_over = |[t, _]: [f64; 2]| promises.iter().flatten().all(|promise| promise.until <= t);
        let is_followed = match status {
            AssuranceStatus::Assured => !sample.is_none_or(is_over),
            _ => status == AssuranceStatus::Undecided,
        };
        if is_followed {
            (self.plan, self.sample) = (plan, sample);
            (self.interval, self.alike) = (interval, alike);
        }
    }

    /// The plan that keeps the promises, if there is one.
    pub(super) fn backup_plan(&self) -> Option<&BackupPlan> {
        (self.status == AssuranceStatus::Assured).then_some(&self.plan.backup_plan)
    }

    /// Until when in s the plan keeps the promises.
    pub(super) fn until(&self) -> f64 {
        let ends = self.courses.iter().flatten().map(|course| course.until);
        ends.fold(self.plan.backup_plan.until, f64::min)
    }

    /// Whether the plan accounts for every point until `t`.
    pub(super) fn reaches(&self, t: f64) -> bool {
        self.courses.iter().flatten().all(|course| course.until >= t - round_off(t))
    }

    /// How long in s the input of the last sample was to be held, if there was one.
    pub(super) fn last_hold(&self) -> Option<f64> {
        self.sample.map(|[_, hold]| hold)
    }

    /// When the input of the last sample began to act, in s.
    pub(super) fn last_time(&self) -> Option<f64> {
        self.sample.map(|[t, _]| t)
    }

    /// As [`Filter::usual_hold`](crate::filter::Filter::usual_hold), for plans of this `period` and with this declared `jitter`.
    pub(super) fn usual_hold(&self, t: f64, (period, jitter): (f64, f64)) -> f64 {
        let PlanState { status, sample, alike, interval, .. } = *self;
        let Some([last, held]) = sample else { return period };
        let passed = t - last;
        // Where samples are declared to come so late or soon, one says nothing of the next.
        if jitter > 0.0 && passed <= (1.0 + jitter) * period + round_off(t) {
            return period;
        }
        let is_same = (passed - held).abs() <= TOLERANCES.on_time * held + round_off(t);
        let is_usual =
            passed < DECISIONS.quicker * held && alike + 1 >= DECISIONS.alike && is_like(passed, interval);
        match status {
            _ if is_same => held,
            AssuranceStatus::Undecided => period,
            _ if is_like(passed, held) => held.max((1.0 + DECISIONS.headroom) * passed),
            _ if passed > held && passed.is_finite() || passed > 0.0 && is_usual => passed,
            _ => held,
        }
    }

    /// Whether a sample at `t` comes no later than the previous one announced, but for `jitter` as a part of the hold, and
    /// whether times are precise enough to distinguish samples.
    pub(super) fn in_time(&self, t: f64, hold: f64, jitter: f64) -> bool {
        let Some([last, held]) = self.sample else { return false };
        let round_off = round_off(t);
        let late = jitter * held + round_off;
        // NaN counts as out of time.
        last <= t && t <= last + held + late && round_off <= DECISIONS.distinct * hold.min(held)
    }

    /// Whether the plan was made for the sample at `t`.
    pub(super) fn is_regular(&self, t: f64, hold: f64) -> bool {
        let PlanState { plan, sample, .. } = self;
        sample.is_some_and(|[last, held]| {
            let tolerance = TOLERANCES.on_time * held + round_off(t);
            plan.backup_plan.is_uniform
                && (t == last || t >= last + held - tolerance)
                && (hold - held).abs() <= TOLERANCES.on_time * held
        })
    }

    /// Checks a memory to be restored into a filter with as many barriers as `follows`, which says of each whether it follows
    /// a measured point. The model has as many states and inputs as `dims` says. `is_fresh`: the filter has had no sample yet.
    ///
    /// # Errors
    ///
    /// A plan of another filter, or one that is damaged.
    pub(super) fn check(
        &self,
        dims: [usize; 2],
        follows: &[bool],
        is_fresh: bool,
        horizon: Option<f64>,
    ) -> Result<(), Error> {
        let PlanState {
            status,
            promises,
            plan,
            lost,
            regained,
            share,
            memory,
            prolong_at,
            sample,
            arrived,
            courses,
            interval,
            ..
        } = self;
        let refuse = |field: &str, message: &str| Err(Error::new(ErrorKind::Dimension, field, message));
        if *status != AssuranceStatus::Undecided {
            length("promises", promises.len(), follows.len())?;
        }
        if *status == AssuranceStatus::Undecided && !is_fresh {
            return refuse("status", "is undecided, beside samples that were decided on");
        }
        if self.is_followed() || *status == AssuranceStatus::Undecided && !plan.is_empty() {
            if let Some(flaw) = plan.flaw(dims, *status == AssuranceStatus::Assured) {
                return refuse("plan", flaw);
            }
            if !(0.0..=1.0).contains(share) {
                return refuse("share", "is not a part, must be 0 to 1");
            }
            if memory.is_flawed() || regained.is_flawed() {
                return refuse("memory", "is not of a filter, or not finite");
            }
            if prolong_at.is_nan() || plan.is_finite() && horizon.is_none() {
                return refuse("plan", "ends in motion, which needs a horizon and a time to extend it");
            }
            let is_promise = |p: &Promise| {
                let is_timed = p.from.is_finite() && p.firm.is_finite() && !p.until.is_nan();
                is_timed && p.margin >= 0.0 && p.reserve >= 0.0
            };
            if !promises.iter().flatten().all(is_promise) {
                return refuse("promises", "have a time or a margin that is not a number");
            }
            if !sample.is_some_and(|[t, hold]| t.is_finite() && hold.is_finite() && hold > 0.0) {
                return refuse("sample", "has no time, must have one beside a plan");
            }
            if self.is_followed() && !self.deviation.fits(dims[0]) {
                return refuse("deviation", "is not of a plant with as many states");
            }
            if !arrived.is_empty() && arrived.len() != dims[1] || !all_finite(arrived.as_flattened()) {
                return refuse("arrived", "is not of a plant with as many inputs, or not finite");
            }
            let is_course = |course: &Course| {
                course.since.is_finite() && all_finite(&course.point) && !course.until.is_nan()
            };
            // Before a decision the plan of an earlier one rests on nothing.
            let is_alone = !follows.contains(&true) || *status == AssuranceStatus::Undecided;
            let are_theirs = courses.iter().map(Option::is_some).eq(follows.iter().copied());
            let are_courses = are_theirs || courses.is_empty() && is_alone;
            if !are_courses || !courses.iter().flatten().all(is_course) {
                return refuse("courses", "are not those of the barriers, or not finite");
            }
            if !interval.is_finite() {
                return refuse("interval", "is not finite");
            }
            if lost.iter().flatten().any(|t| !t.is_finite()) {
                return refuse("lost", "is at a time that is not finite");
            }
        }
        Ok(())
    }
}

/// h ≥ 0 from one time in s until another, and the margin that plans keep.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Promise {
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub(super) from: f64,
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub(super) until: f64,
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub(super) margin: f64,
    /// From when in s the margin has to be there: a state that begins at the edge of a set has a period to leave the edge.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub(super) firm: f64,
    /// What new plans keep, ≥ 0: a reserve if it exceeds the margin.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub(super) reserve: f64,
}

/// Whether two intervals of a measured clock are meant to be the same.
pub(super) fn is_like(interval: f64, other: f64) -> bool {
    (interval - other).abs() <= DECISIONS.jitter * other
}

/// Round-off of a difference of the time `t` from another, in s.
pub(super) fn round_off(t: f64) -> f64 {
    DECISIONS.time_round_off * t.abs()
}
