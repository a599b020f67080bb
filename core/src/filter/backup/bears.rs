//! What a plan from a first sample bears of a plant that is not the model.

use alloc::vec::Vec;

use super::Planning;
use super::first::First;
use super::settings::DECISIONS;
use super::state::Promise;
use crate::elementary;
use crate::lie::Predict;
use crate::plan::{Plan, Planner, Tracking, Uncertainty, slopes};

/// How much of each kind of uncertainty a plan from a first sample bears if it is declared, each alone: at least that much, since a
/// tube may be wider than what the plant can do, and another plan may bear more. 0 where it bears none that was tried.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Bears {
    /// What may be added to the rate of each state, in its unit per s.
    pub rates: Vec<f64>,
    /// How far each state may be from its measured value, in its unit.
    pub errors: Vec<f64>,
    /// The part of each input that may be missing or too much, 0 to 1.
    pub gains: Vec<f64>,
    /// The time constant in s with which each input may be followed.
    pub lags: Vec<f64>,
    /// How long in s after its sample an input may act: at most 16 periods, the longest that is tried. `None` if a delay is
    /// declared.
    pub delay: Option<f64>,
}

/// What is declared of a plant, by kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum UncertaintyKind {
    /// When samples come.
    Jitter,
    /// How late inputs are followed.
    Lags,
    /// Which part of inputs arrives.
    Gains,
    /// How far measurements are off.
    Errors,
    /// What is added to rates.
    Rates,
}

impl UncertaintyKind {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Jitter, Self::Lags, Self::Gains, Self::Errors, Self::Rates];
}

/// With how much less a promise would be kept that is refused for an uncertain plant.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Remedy {
    /// Without any one of these kinds.
    pub without: Vec<UncertaintyKind>,
    /// With this part of all that is declared, < 1.
    pub part: Option<f64>,
}

/// The parts of all that is declared which are tried.
const PARTS: [f64; 5] = [0.8, 0.6, 0.4, 0.2, 0.1];
/// How much more than required the plan keeps, tried in turn: as many changes of h as there are if every state is off by this part
/// of what it moves in a second. A plan for the requirements themselves goes as near to the sets as it may, and bears next to nothing.
const ROOM: [f64; 3] = [0.15, 0.05, 0.015];
/// The number of states along the plan at which these changes are taken.
const PLACES: usize = 8;
/// The number of holds of the law that is tried, if they were all as long as the longest. With more a plan bears a little more, and
/// an answer takes as much longer.
const HOLDS: usize = 60;
/// The same where that law does not do.
const MORE_HOLDS: usize = 250;
/// The first size tried, as a part of the largest rate of a state (over a second for an error); of a gain as it is.
const FIRST: f64 = 0.04;
/// The largest number of times that it is doubled or halved.
const SCALES: i32 = 10;
/// The ratio of two sizes up to which the answer is exact.
const STEP: f64 = core::f64::consts::SQRT_2;
/// The largest part of an input that may be missing.
const MOST: f64 = 0.99;
/// The longest time constant in s that is tried: an input that is followed later has hardly any effect.
const LATEST: f64 = 10.0;

impl Planning<'_> {
    /// What a plan that a first sample at `t` and `x` might find bears, for a plant that is the model but for one thing. `None`
    /// without a plan, behind an integrator, for a plant without derivatives on enclosures, and if it is declared how the plant
    /// differs. Remembers nothing.
    pub fn bears(&self, t: f64, x: &[f64]) -> Option<Bears> {
        let (measured, courses) = (self.state(x), self.courses(t, x));
        let own = Planning { measured: Some((t, &measured)), courses: &courses, ..*self };
        let (acts, state) = self.acts(t, &measured);
        let promises = own.promises(acts, &state, |_| 1.0);
        let first = own.first(promises, (acts, self.plans.period), &state, &[], &DECISIONS.shorter).ok()?;
        self.borne_by(&first, t, x)
    }

    /// The same near the plan `first` from there.
    pub(super) fn borne_by(&self, first: &First, t: f64, x: &[f64]) -> Option<Bears> {
        if self.integrator.is_some() || self.uncertainty.is_some() {
            return None;
        }
        let (measured, courses) = (self.state(x), self.courses(t, x));
        let (acts, x) = self.acts(t, &measured);
        let [states, inputs] = [self.states, self.rows.input_dim];
        let none = Uncertainty::nothing([states, inputs]);
        let measured_at = Some((t, &measured[..]));
        let own = Planning { measured: measured_at, courses: &courses, uncertainty: Some(&none), ..*self };
        let (promises, at) = (&first.promises, (acts, self.plans.period));
        let plan = own.cautious(first, at, &x);
        let keeps = |uncertainty: &Uncertainty, law: &Tracking| {
            let planning = Planning { uncertainty: Some(uncertainty), ..own };
            planning.planned(promises, at, &[], |planner| planner.bears(&plan, law, &x)).is_ok()
        };
        // A law that does not keep the model itself keeps nothing.
        let of = |holds| {
            let laws = |planner: &Planner<'_>| planner.laws(&plan, holds, acts, &x);
            let mut laws = own.planned(promises, at, &[], laws).unwrap_or_default();
            laws.retain(|law| keeps(&none, law));
            laws
        };
        let laws = of(HOLDS);
        if laws.is_empty() {
            return None;
        }
        let largest_of = |laws: &[Tracking], first: f64, most: f64, with: &dyn Fn(&mut Uncertainty, f64)| {
            let is_kept = |law: &Tracking, size: f64| {
                let mut more = none.clone();
                with(&mut more, size);
                size <= most && keeps(&more, law)
            };
            laws.iter().fold(0.0, |best, law| more_than(best, first, |size| is_kept(law, size)))
        };
        let largest = |first: f64, most: f64, with: &dyn Fn(&mut Uncertainty, f64)| {
            largest_of(&laws, first, most, with)
        };
        // Where inputs change much from hold to hold, only a quick law follows them late.
        let late = |with: &dyn Fn(&mut Uncertainty, f64)| match largest(self.plans.period, LATEST, with) {
            0.0 => largest_of(&of(MORE_HOLDS), self.plans.period, LATEST, with),
            found => found,
        };
        let typical = |i: usize| FIRST * plan.backup_plan.largest_rate(i).max(f64::MIN_POSITIVE);
        let each = |count: usize, size: &dyn Fn(usize) -> f64| (0..count).map(size).collect::<Vec<f64>>();
        Some(Bears {
            rates: each(states, &|i| largest(typical(i), f64::INFINITY, &|more, size| more.rates[i] = size)),
            errors: each(states, &|i| {
                largest(typical(i), f64::INFINITY, &|more, size| more.errors[i] = size)
            }),
            gains: each(inputs, &|i| {
                largest(FIRST, MOST, &|more, size| more.gains[i] = [1.0 - size, 1.0 + size])
            }),
            lags: each(inputs, &|i| late(&|more, size| more.lags[i] = [0.0, size])),
            delay: (self.rows.delay == 0.0).then(|| own.delay_borne(promises, &plan, (t, &measured))),
        })
    }

    /// What keeps every promise from `x` at `t` if less is declared. `None` if nothing is declared, or nothing of this was found. It takes
    /// a search for each kind. Remembers nothing.
    pub fn remedy(&self, t: f64, x: &[f64]) -> Option<Remedy> {
        let declared = self.uncertainty.filter(|_| self.integrator.is_none())?;
        let (measured, courses) = (self.state(x), self.courses(t, x));
        let own = Planning { measured: Some((t, &measured)), courses: &courses, ..*self };
        let (acts, x) = self.acts(t, &measured);
        let at = (acts, self.plans.period);
        let promises = || own.promises(acts, &x, |_| 1.0);
        let without = |kind: &UncertaintyKind| {
            let mut less = declared.clone();
            match kind {
                UncertaintyKind::Jitter => less.jitter = 0.0,
                UncertaintyKind::Lags => less.lags.fill([0.0; 2]),
                UncertaintyKind::Gains => less.gains.fill([1.0; 2]),
                UncertaintyKind::Errors => less.errors.fill(0.0),
                UncertaintyKind::Rates => less.rates.fill(0.0),
            }
            less
        };
        let is_found = |of: &Uncertainty| {
            let own = Planning { uncertainty: Some(of), ..own };
            own.first(promises(), at, &x, &[], &DECISIONS.shorter).is_ok()
        };
        let matters = UncertaintyKind::ALL.into_iter().filter(|kind| without(kind) != *declared);
        let without = matters.filter(|kind| is_found(&without(kind))).collect();
        // Beside a plan for the model.
        let exact = Planning { uncertainty: None, ..own };
        let first = exact.first(promises(), at, &x, &[], &DECISIONS.shorter).ok()?;
        let plan = own.cautious(&first, at, &x);
        let scaled = |part: &f64| {
            let mut less = declared.clone();
            less.rates.iter_mut().chain(&mut less.errors).for_each(|size| *size *= part);
            less.gains.iter_mut().flatten().for_each(|gain| *gain = 1.0 + part * (*gain - 1.0));
            less.lags.iter_mut().flatten().for_each(|lag| *lag *= part);
            less.jitter *= part;
            less
        };
        let is_kept = |part: &f64| {
            let less = scaled(part);
            let own = Planning { uncertainty: Some(&less), ..own };
            own.planned(&first.promises, at, &[], |planner| planner.any_bears(&plan, HOLDS, acts, &x)).is_ok()
        };
        let part = PARTS.into_iter().find(is_kept);
        Some(Remedy { without, part }).filter(|remedy| !remedy.without.is_empty() || part.is_some())
    }

    /// A plan near that of `first` which leaves room to every set, and a part of every bound; or that plan if none is found.
    fn cautious(&self, first: &First, at: (f64, f64), x: &[f64]) -> Plan {
        let First { promises, plan, .. } = first;
        let end = plan.backup_plan.inputs.last().map_or(at.0, |(end, _)| *end);
        let way = self.along(&plan.backup_plan.inputs, at.0, x, (end - at.0) / PLACES as f64);
        let places = way.iter().step_by(way.len().div_ceil(PLACES).max(1));
        let mut gradient = x.to_vec();
        let mut change = |model: &dyn Predict| {
            let at = |(t, x, _): &(f64, Vec<f64>, _)| {
                slopes(model, *t, x, &mut gradient);
                let moves = (0..x.len()).map(|i| gradient[i].abs() * plan.backup_plan.largest_rate(i));
                moves.sum::<f64>()
            };
            places.clone().map(at).fold(0.0, f64::max)
        };
        let changes: Vec<f64> = self.models().map(|model| change(&*model)).collect();
        let with_room = |room: &f64| {
            let mut wanted = promises.clone();
            for ((promise, model), change) in wanted.iter_mut().zip(self.models()).zip(&changes) {
                let Some(promise) = promise else { continue };
                // A state near the edge of a set has until later to leave it.
                let h = if promise.from == at.0 { model.value(at.0, x) } else { f64::INFINITY };
                promise.reserve = promise.reserve.max((room * change).min(h / DECISIONS.ample));
            }
            self.planned(&wanted, at, &[], |planner| planner.cautious(plan, at.0, x)).ok()
        };
        ROOM.iter().find_map(with_room).unwrap_or_else(|| plan.clone())
    }

    /// The longest of a few delays, in s, with which `plan` from `x` at `t` is kept if it begins that much later.
    fn delay_borne(&self, promises: &[Option<Promise>], plan: &Plan, (t, x): (f64, &[f64])) -> f64 {
        // Until then nothing changes.
        let u = self.rows.state.acting_at(&self.rows.bounds, t);
        let keeps = |delay: &f64| {
            let (mut state, acting) = (x.to_vec(), [(*delay, u)]);
            let run = |planner: &Planner<'_>| {
                planner.run(&mut state, &u[..self.rows.input_dim]);
                Ok(())
            };
            let is_run = self.planned(promises, (t, *delay), &[], run).is_ok();
            let mut later = plan.clone();
            later.backup_plan.inputs.iter_mut().for_each(|(end, _)| *end += delay);
            let bears = |planner: &Planner<'_>| {
                planner.delayed(&acting, t, x).any_bears(&later, HOLDS, t + delay, &state)
            };
            is_run
                && self.waits(promises, (t, x), &acting).is_ok()
                && self.planned(promises, (t + delay, self.plans.period), &[], bears).is_ok()
        };
        let periods = |k: i32| elementary::powi(2.0, k) * self.plans.period;
        (-3..=4).rev().map(periods).find(keeps).unwrap_or(0.0)
    }
}

/// The largest size that `is_kept`, up to a step: from `first` on, or from `best` if that is kept by another law; at least `best`.
fn more_than(best: f64, first: f64, is_kept: impl Fn(f64) -> bool) -> f64 {
    let upwards = |from: f64, factor: f64| {
        let larger = (1..=SCALES).map(|k| from * elementary::powi(factor, k));
        larger.take_while(|size| is_kept(*size)).last().unwrap_or(from)
    };
    if best > 0.0 {
        return upwards(best, STEP);
    }
    let least = (0..=SCALES).map(|k| first * elementary::powi(0.5, k)).find(|size| is_kept(*size));
    let Some(mut size) = least else { return 0.0 };
    if size == first {
        size = upwards(size, 2.0);
    }
    if is_kept(STEP * size) { STEP * size } else { size }
}
