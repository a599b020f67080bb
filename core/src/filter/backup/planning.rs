//! The input to planning: the promises of the barriers along the plant, and how plans for them are found. Nothing here is
//! remembered.

use alloc::vec::Vec;
use core::ops::Deref;

use super::Plans;
use super::settings::{DECISIONS, DecisionSettings};
use super::state::{PlanState, Promise};
use crate::MAX_INPUTS;
use crate::filter::integrator::{Integrator, insert};
use crate::filter::rows::{BarrierSlot, Rows};
use crate::filter::{Begin, End, Integration, Strictness};
use crate::lie::Predict;
use crate::plan::{
    Course, Failure, Integral, Limit, Motion, Moving, Planner, Requirement, SETTINGS, TOLERANCES, Uncertain,
    Uncertainty, highest, narrowed, slopes,
};
use crate::qp::Bounds;

/// The planner of a filter ([`Filter::planning`](crate::filter::Filter::planning)): its barriers along the plant, the
/// integrator, and how plans are made. It remembers no query.
#[derive(Clone, Copy)]
pub struct Planning<'a> {
    pub(super) rows: &'a Rows,
    pub(super) integrator: Option<&'a Integrator>,
    pub(super) plans: &'a Plans,
    /// The bounds of the model's inputs; in the rows those of an integrated one are tighter.
    pub(super) bounds: &'a Bounds,
    /// What is not known of the plant, if anything is declared.
    pub(super) uncertainty: Option<&'a Uncertainty>,
    /// Time and model state of the sample from which a plan is sought, if its input acts later.
    pub(super) measured: Option<(f64, &'a [f64])>,
    /// Number of states of the model; measured points, which follow them in x, do not count.
    pub(super) states: usize,
    /// The measurements on which plans rest: of the point of each barrier that follows one. Empty for a plant alone.
    pub(super) courses: &'a [Option<Course>],
}

/// A barrier along the plant, for prediction.
pub(super) enum Model<'a> {
    Own(&'a dyn Predict),
    Moving(Moving<'a>),
}

impl<'a> Deref for Model<'a> {
    type Target = dyn Predict + 'a;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::Own(model) => *model,
            Self::Moving(moving) => moving,
        }
    }
}

impl<'a> Planning<'a> {
    /// The memory before the sample.
    pub(super) fn before(&self) -> &'a PlanState {
        &self.rows.state.plan
    }

    /// The memory after the sample, as far as it is known.
    pub(super) fn now(&self) -> &'a PlanState {
        &self.rows.workspace.next.plan
    }

    /// Whether a sample at `t` comes in time. A measured clock may be late, unless a tube says where the plant is until then.
    pub(super) fn in_time(&self, t: f64, hold: f64) -> bool {
        let jitter = self.uncertainty.map_or(DECISIONS.jitter, |of| of.jitter.max(TOLERANCES.on_time));
        // Behind a delay, samples that are declared to come late must not send two inputs on their way at once.
        let (delay, slack) = (self.rows.delay, TOLERANCES.on_time * hold);
        let last = self.before().last_time().unwrap_or(f64::NEG_INFINITY);
        let follows =
            delay == 0.0 || !self.is_jittery() || t - last >= delay - slack && hold >= delay - slack;
        follows && !self.rows.state.is_crowded() && self.before().in_time(t, hold, jitter)
    }

    /// Whether samples are declared to come late.
    pub(super) fn is_jittery(&self) -> bool {
        self.uncertainty.is_some_and(|of| of.jitter > 0.0)
    }

    /// The model's state for the measured `x`.
    pub(super) fn state(&self, x: &[f64]) -> Vec<f64> {
        let mut inside = self.inside(x);
        inside.truncate(self.states);
        inside
    }

    /// What the rows know of the measured `x`: the state, and the points that follow it.
    pub(super) fn inside(&self, x: &[f64]) -> Vec<f64> {
        self.with(x, self.rows.state.integrated)
    }

    /// The points in `x`, measured at `t`.
    pub(super) fn courses(&self, t: f64, x: &[f64]) -> Vec<Option<Course>> {
        if self.states == self.rows.state_dim {
            return Vec::new();
        }
        let inside = self.inside(x);
        let course = |slot: &BarrierSlot| {
            let first = slot.source.follows()?.first();
            let point = core::array::from_fn(|i| inside[first + i]);
            Some(Course { since: t, point, until: f64::INFINITY })
        };
        self.rows.slots.iter().map(course).collect()
    }

    /// The measurements on which a plan from `t` on for `promises` rests, each with how far the plan reaches: as far past the
    /// last deadline and the sample as a search does.
    pub(super) fn rests_on(&self, t: f64, promises: &[Option<Promise>]) -> Vec<Option<Course>> {
        let last = promises.iter().flatten().map(|promise| promise.from).filter(|t| t.is_finite());
        let until = last.fold(t, f64::max) + self.ahead();
        let dated = |course: &Course| Course { until: course.until.min(until), ..*course };
        self.courses.iter().map(|course| course.as_ref().map(dated)).collect()
    }

    /// When in s the next sample comes at the latest, if the input of that at `t` is held for `hold` s.
    pub(super) fn next_by(&self, t: f64, hold: f64) -> f64 {
        let late = self.uncertainty.map_or(0.0, |of| of.jitter) * self.plans.period;
        t + if late > 0.0 { hold.max(self.plans.period + late) } else { hold }
    }

    /// How far in s past the last deadline and the sample a plan accounts for points.
    fn ahead(&self) -> f64 {
        self.plans.horizon.map_or(DECISIONS.uncertain_horizon, |horizon| SETTINGS.ample * horizon)
    }

    /// How far the point of a barrier has strayed since the measurement on which the plan rests: the first that is farther
    /// away than it can be.
    pub(super) fn strayed(&self, before: &[Option<Course>]) -> Option<Failure> {
        let beyond = |barrier: usize| {
            let (before, now) = (before.get(barrier).copied().flatten()?, self.courses[barrier]?);
            let round_off = DECISIONS.covered * now.point[..2].iter().map(|c| 1.0 + c.abs()).sum::<f64>();
            let beyond = before.strays(&self.plans.motion_of(barrier)?, &now);
            // NaN has strayed.
            (beyond > round_off || beyond.is_nan()).then_some(Failure::Strays { barrier, beyond })
        };
        (0..self.courses.len()).find_map(beyond)
    }

    /// When in s an input of a sample at `t` begins to act, and the model's state there: `x`, moved on by the delay under the
    /// inputs that still act. Plans begin there.
    pub(super) fn acts(&self, t: f64, x: &[f64]) -> (f64, Vec<f64>) {
        let (mut x, delay) = (x.to_vec(), self.rows.delay);
        if delay > 0.0
            && let Some(plant) = self.plant()
        {
            let dims = [self.states, self.rows.input_dim];
            for (dt, u) in self.rows.acting(t) {
                Planner::new(plant, dims, self.bounds, &[], dt, 1.0).run(&mut x, &u[..dims[1]]);
            }
        }
        (t + delay, x)
    }

    /// What may arrive of each input at a sample at `t`, the least and the largest, if inputs are followed late.
    pub(super) fn arriving(&self, t: f64) -> Vec<[f64; 2]> {
        let Some(of) = self.uncertainty.filter(|of| of.lags()) else { return Vec::new() };
        let (Rows { state, bounds, .. }, PlanState { arrived, sample, .. }) = (self.rows, self.before());
        let none: [f64; MAX_INPUTS] = core::array::from_fn(|i| bounds.clamp(i, 0.0));
        // What arrived is known from sample to sample, and before the first input. Otherwise it is within its bounds.
        let is_first = state.time.is_none() && state.start.is_none() && state.acting_at(bounds, t) == none;
        let (mut arriving, mut since) = (arrived.clone(), None);
        match sample {
            Some([last, _]) if !arrived.is_empty() => since = Some(last - self.rows.delay),
            _ if arrived.is_empty() && is_first => arriving = none.map(|none| [none; 2]).to_vec(),
            _ => arriving = self.bounds.min.iter().zip(&self.bounds.max).map(|(a, b)| [*a, *b]).collect(),
        }
        arriving.truncate(self.rows.input_dim);
        for (dt, asked) in since.into_iter().flat_map(|last| state.acting(bounds, last, t - last)) {
            for (i, (arrives, asked)) in arriving.iter_mut().zip(asked).enumerate() {
                let [low, high] = arrives.map(|arrived| arrived - asked);
                let [least, largest] = of.remains(i, dt, 0.0);
                let low = asked + (low * least).min(low * largest);
                *arrives = [low, asked + (high * least).max(high * largest)];
            }
        }
        arriving
    }

    /// Whether `promises` that begin once all of `acting` has acted, each for its time in s, are kept from the sample (its time
    /// and state) on until then.
    ///
    /// # Errors
    ///
    /// Why they are not.
    pub(super) fn waits(
        &self,
        promises: &[Option<Promise>],
        (t, x): (f64, &[f64]),
        acting: &[(f64, [f64; MAX_INPUTS])],
    ) -> Result<(), Failure> {
        let delay: f64 = acting.iter().map(|(dt, _)| dt).sum();
        if delay <= 0.0 {
            return Ok(());
        }
        let acts = t + delay;
        let begun = |promise: &Option<Promise>| {
            promise.filter(|promise| promise.from <= acts).map(|promise| Promise { from: t, ..promise })
        };
        let begun: Vec<_> = promises.iter().map(begun).collect();
        if begun.iter().all(Option::is_none) {
            return Ok(());
        }
        let u = acting.first().map_or(&[][..], |(_, u)| &u[..self.rows.input_dim]);
        self.planned(&begun, (t, delay), u, |planner| planner.holds(t, x, acting))
    }

    /// The direction of that state if the measured state moves along `dx`.
    pub(super) fn direction(&self, dx: &[f64]) -> Vec<f64> {
        self.with(dx, 0.0)
    }

    /// `x` with `value` inserted for the integral.
    fn with(&self, x: &[f64], value: f64) -> Vec<f64> {
        let mut inside = x.to_vec();
        if let Some(own) = self.integrator {
            inside.push(0.0);
            insert(&mut inside, x, own.of.state, value);
        }
        inside
    }

    /// `u_ref` as the input asked of the model, and that within its bounds.
    pub(super) fn wanted(&self, hold: f64, u_ref: &[f64]) -> ([f64; MAX_INPUTS], [f64; MAX_INPUTS]) {
        let mut wish = [0.0; MAX_INPUTS];
        wish[..u_ref.len()].copy_from_slice(u_ref);
        if let Some(own) = self.integrator {
            wish[own.of.input] = own.wanted(self.rows.state.integrated, hold, u_ref[own.of.input]);
        }
        let within = |i: usize| if i < u_ref.len() { self.rows.bounds.clamp(i, wish[i]) } else { 0.0 };
        (wish, core::array::from_fn(within))
    }

    /// The direction of that input within its bounds, as `u_ref` moves along `du_ref`.
    pub(super) fn moves(&self, hold: f64, u_ref: &[f64], du_ref: &[f64]) -> [f64; MAX_INPUTS] {
        let mut moves = [0.0; MAX_INPUTS];
        moves[..du_ref.len()].copy_from_slice(du_ref);
        if let Some(own) = self.integrator {
            moves[own.of.input] *= own.moves(self.rows.state.integrated, hold, u_ref[own.of.input]);
        }
        // Beyond its bounds an input does not move.
        let (wish, wanted) = self.wanted(hold, u_ref);
        for (moves, (wish, wanted)) in moves.iter_mut().zip(wish.iter().zip(&wanted)) {
            *moves = if wish == wanted { *moves } else { 0.0 };
        }
        moves
    }

    /// The integral whose mean the plant receives, if there is one.
    fn integral(&self) -> Option<Integral> {
        self.integrator.map(|own| Integral { state: own.of.state, input: own.of.input })
    }

    /// The plant, for prediction.
    fn plant(&self) -> Option<&'a dyn Predict> {
        let alone = |slot: &'a BarrierSlot| match slot.source.follows() {
            Some(follows) => Some(follows.alone()),
            None => slot.source.predict(),
        };
        self.rows.slots.iter().find_map(alone)
    }

    /// Every barrier along the plant, for prediction.
    pub(super) fn models(&self) -> impl Iterator<Item = Model<'a>> + use<'a> {
        self.models_within(|motion| motion)
    }

    /// The same if no barrier that follows a point is farther away than where it may be seen: what is missed in them is
    /// missed for certain.
    pub(super) fn models_seen(&self) -> impl Iterator<Item = Model<'a>> + use<'a> {
        self.models_within(|motion| Motion { position_error: -motion.position_error, ..Motion::default() })
    }

    fn models_within(&self, change: fn(Motion) -> Motion) -> impl Iterator<Item = Model<'a>> + use<'a> {
        let (courses, plans) = (self.courses, self.plans);
        self.rows.slots.iter().enumerate().filter_map(move |(i, slot)| match slot.source.follows() {
            Some(follows) => {
                let course = courses.get(i).copied().flatten()?;
                Moving::new(follows, course, &change(plans.motion_of(i)?)).map(Model::Moving)
            }
            None => slot.source.predict().map(Model::Own),
        })
    }

    /// The promises from `x` at `t`, where the input of the sample begins to act. Each deadline counts from the sample itself,
    /// multiplied by the factor of its barrier.
    pub(super) fn promises(
        &self,
        t: f64,
        x: &[f64],
        factor: impl Fn(&BarrierSlot) -> f64,
    ) -> Vec<Option<Promise>> {
        let promise = |(slot, model): (&BarrierSlot, Model<'_>)| {
            let model = &*model;
            // Not the h of the report, which is missing if u_ref is NaN.
            let h = model.value(t, x);
            // Slightly earlier, so that round-off of a time leaves no gap.
            let after = |seconds: f64| t - self.rows.delay + seconds - TOLERANCES.on_time * self.plans.period;
            let deadline = slot.promise.settings().deadline.map(|deadline| factor(slot) * deadline);
            let from = match (slot.begin, deadline) {
                // What begins later may be left again until its deadline, wherever it begins.
                (Begin::At(begin), deadline) if begin > 0.0 => after(deadline.unwrap_or(begin).max(begin)),
                (Begin::AfterArrival(_), deadline) => after(deadline?),
                // NaN is required at once, so that the check finds it.
                _ if h.is_nan() || h >= self.unseen(model, t, x) => t,
                (_, Some(deadline)) => after(deadline),
                (_, None) if h >= 0.0 => t,
                (_, None) => return None,
            };
            let until = match slot.end {
                End::Never => f64::INFINITY,
                End::At(seconds) => t - self.rows.delay + seconds,
                End::OnArrival | End::AfterStay(_) => from + self.visit(slot)?,
                // With that of the other, which `link` sets.
                End::AfterArrival(_) => f64::INFINITY,
            };
            let soft = matches!(slot.strictness, Strictness::Soft(_));
            let margin = margin(model, t, x, h);
            let firm = if from == t && h < DECISIONS.ample * margin { after(self.plans.period) } else { t };
            // Half of the user's margin, so that a plan backs the rows, which aim at all of it.
            let reserve = slot.promise.settings().margin / DECISIONS.ample;
            // A set that is kept from now on may be nearer to its edge.
            let reserve = if from == t { reserve.min(h / DECISIONS.ample) } else { reserve };
            (!soft && until > from).then_some(Promise { from, until, margin, firm, reserve })
        };
        let mut promises: Vec<_> = self.rows.slots.iter().zip(self.models()).map(promise).collect();
        self.link(&mut promises, t);
        promises
    }

    /// How long in s a visit is planned to last: a sample longer than it has to, so that some sample sees it.
    pub(super) fn visit(&self, slot: &BarrierSlot) -> Option<f64> {
        let late = self.uncertainty.map_or(0.0, |of| of.jitter);
        Some(slot.end.visit()? + (1.0 + late) * self.plans.period)
    }

    /// Makes those of `promises` from `t` on agree that begin or end with the arrival of another: what begins then is
    /// promised after the other one, which is reached before; what ends then is promised until the other one is there.
    pub(super) fn link(&self, promises: &mut [Option<Promise>], t: f64) {
        let slots = &self.rows.slots;
        // Each barrier was added after the one with which it begins.
        for (i, slot) in slots.iter().enumerate().rev() {
            let (Begin::AfterArrival(other), Some(Promise { from, .. })) = (slot.begin, promises[i]) else {
                continue;
            };
            let visit = self.visit(&slots[other]);
            let latest = from - visit.unwrap_or(0.0);
            if let Some(first) = promises[other].as_mut().filter(|first| first.from > latest) {
                first.from = latest.max(t);
                first.until = visit.map_or(first.until, |visit| first.from + visit);
            }
        }
        for (i, slot) in slots.iter().enumerate() {
            if let Begin::AfterArrival(other) = slot.begin
                && promises[other].is_none()
            {
                promises[i] = None;
            }
            if let (End::AfterArrival(other), Some(promise)) = (slot.end, promises[i]) {
                // Rows see the arrival at that sample, or at the next one.
                let until = promises[other].map(|other| other.from + 2.0 * self.plans.period);
                promises[i] = until.map(|until| Promise { until, ..promise });
            }
        }
    }

    /// By how much h may be lower than at the measured state `x`.
    fn unseen(&self, model: &dyn Predict, t: f64, x: &[f64]) -> f64 {
        let Some(Uncertainty { errors, start, .. }) = self.uncertainty else { return 0.0 };
        let mut gradient = x.to_vec();
        slopes(model, t, x, &mut gradient);
        // Twice, since h may be curved.
        let unseen = errors.iter().zip(start).map(|(error, start)| error + start);
        gradient.iter().zip(unseen).map(|(slope, unseen)| 2.0 * slope.abs() * unseen).sum()
    }

    /// `promises` with each deadline at `part` of its time from the sample whose input acts from `t` on, but not before it
    /// begins. Promises without a deadline are unchanged.
    pub(super) fn sooner(&self, promises: &[Option<Promise>], t: f64, part: f64) -> Vec<Option<Promise>> {
        let sooner = |(promise, slot): (&Option<Promise>, &BarrierSlot)| {
            let mut promise = (*promise)?;
            if promise.from > t && slot.promise.settings().deadline.is_some() {
                let sample = t - self.rows.delay;
                let begin = if let Begin::At(begin) = slot.begin { sample + begin } else { sample };
                promise.from = (sample + part * (promise.from - sample)).max(begin.min(promise.from));
                if let Some(visit) = self.visit(slot) {
                    promise.until = promise.from + visit;
                }
            }
            Some(promise)
        };
        let mut sooner: Vec<_> = promises.iter().zip(&self.rows.slots).map(sooner).collect();
        self.link(&mut sooner, t);
        sooner
    }

    /// `longest`, or the largest factor for which no deadline chosen by `scales` comes after the end of its barrier.
    pub(super) fn longest(&self, longest: f64, scales: impl Fn(&BarrierSlot) -> bool) -> f64 {
        let ends = self.rows.slots.iter().filter(|slot| scales(slot)).filter_map(|slot| {
            match (slot.end, slot.promise.settings().deadline) {
                (End::At(end), Some(deadline)) => Some(end / deadline),
                _ => None,
            }
        });
        ends.fold(longest, f64::min)
    }

    /// Two promises that no state keeps at a time at which both are in force.
    pub(super) fn contradiction(&self, promises: &[Option<Promise>], t: f64) -> Option<Failure> {
        let slots = &self.rows.slots;
        self.plans.apart.iter().find_map(|&[a, b]| {
            let (p, q) = (promises.get(a).copied().flatten()?, promises.get(b).copied().flatten()?);
            // A set that is released on arrival has to be reached at some unknown time before its deadline.
            let [of_p, of_q] = [(a, p), (b, q)].map(|(i, promise)| match slots[i].end {
                End::OnArrival | End::AfterStay(_) => (t, promise.until),
                _ => (promise.from, promise.until),
            });
            let is_apart = match [a, b].map(|i| slots[i].end.visit().is_some()) {
                [true, true] => false,
                [true, false] => q.from <= t && q.until >= of_p.1,
                [false, true] => p.from <= t && p.until >= of_q.1,
                [false, false] => of_p.0.max(of_q.0) < of_p.1.min(of_q.1),
            };
            let contains = |i: usize, promise: Promise| {
                promise.from <= t && slots[i].promise.settings().deadline.is_some()
            };
            let [first, second] = if contains(b, q) && !contains(a, p) { [b, a] } else { [a, b] };
            let contained = contains(first, if first == a { p } else { q });
            is_apart.then_some(Failure::Apart { barriers: [first, second], contained })
        })
    }

    /// Whether it is certain that no input keeps one of the deadlines of `promises` from `x` at `t`.
    pub(super) fn is_ruled_out(&self, promises: &[Option<Promise>], t: f64, x: &[f64]) -> bool {
        promises.iter().enumerate().any(|(i, promise)| {
            let after = promise.filter(|p| p.from > t && p.from.is_finite()).map(|p| p.from - t);
            // Where a point will be is not known to the rows.
            let after = after.filter(|_| self.rows.slots[i].source.follows().is_none());
            after.is_some_and(|after| self.rows.is_ruled_out(i, (t, x), after))
        })
    }

    /// Runs `f` with the planner for `promises`, for samples that are `period` s apart.
    pub(super) fn planned<R>(
        &self,
        promises: &[Option<Promise>],
        (t, period): (f64, f64),
        u: &[f64],
        f: impl FnOnce(&Planner<'_>) -> Result<R, Failure>,
    ) -> Result<R, Failure> {
        let Some(plant) = self.plant() else { return Err(Failure::Nothing) };
        let (models, courses): (Vec<Model<'_>>, _) = (self.models().collect(), self.rests_on(t, promises));
        let mut requirements: Vec<Requirement<'_>> = models
            .iter()
            .zip(promises)
            .enumerate()
            .filter_map(|(barrier, (model, promise))| {
                let Promise { from, until, margin, firm, reserve } = (*promise)?;
                let until = courses.get(barrier).copied().flatten().map_or(until, |of| until.min(of.until));
                let model = &**model;
                Some(Requirement { barrier, is_limit: false, model, from, until, margin, firm, reserve })
            })
            .collect();
        if requirements.is_empty() {
            return Err(Failure::Nothing);
        }
        let size = u.iter().fold(1.0, |m: f64, u| m.max(2.0 * u.abs()));
        let dims = [self.states, self.rows.input_dim];
        let limits = self.limits(plant);
        requirements.extend(limits.iter().zip(promises.len()..).map(|(limit, barrier)| {
            let (from, until) = (t, f64::INFINITY);
            Requirement {
                barrier,
                is_limit: true,
                model: limit,
                from,
                until,
                // A value at the limit may differ from it by round-off.
                margin: -DECISIONS.limit_round_off * limit.limit.abs(),
                firm: t,
                reserve: 0.0,
            }
        }));
        // The nominal plan leaves what the feedback needs.
        let bounds = match self.uncertainty {
            Some(_) => &narrowed(self.bounds, &self.now().plan.reserve),
            None => self.bounds,
        };
        let measured = self.measured.filter(|_| self.rows.delay > 0.0);
        let acting: Vec<_> = measured.map(|(t, _)| self.rows.acting(t).collect()).unwrap_or_default();
        let uncertain = self.uncertainty.map(|of| {
            let horizon = self.plans.horizon.unwrap_or(DECISIONS.uncertain_horizon);
            let sample = measured.map_or(t, |(t, _)| t);
            Uncertain {
                of,
                bounds: self.bounds,
                horizon,
                delay: self.rows.delay,
                measured,
                acting: &acting,
                before: self.rows.state.acting_at(&self.rows.bounds, sample),
                arrived: &self.now().arrived,
                period: self.plans.period,
                last: self.before().last_time(),
            }
        });
        let mut planner = Planner::new(plant, dims, bounds, &requirements, period, size)
            .usually(self.plans.period)
            .uncertain(uncertain);
        if let Some(integral) = self.integral() {
            planner = planner.integrated(integral);
        }
        f(&planner.led(&self.plans.policies).until(self.plans.horizon))
    }

    /// The limits of the integral as barriers along `plant`.
    pub(super) fn limits<'b>(&self, plant: &'b dyn Predict) -> Vec<Limit<'b>> {
        let Some(own) = self.integrator else { return Vec::new() };
        let Integration { state, limits: [min, max], .. } = own.of;
        let sides = [(1.0, min), (-1.0, max)].into_iter().filter(|(_, limit)| limit.is_finite());
        sides.map(|(sign, limit)| Limit { plant, state, sign, limit }).collect()
    }

    /// [`Self::trajectory`] under `inputs`, each with its end in s, from the model's state `x`.
    pub(super) fn along(
        &self,
        inputs: &[(f64, [f64; MAX_INPUTS])],
        t: f64,
        x: &[f64],
        step: f64,
    ) -> Vec<(f64, Vec<f64>, [f64; MAX_INPUTS])> {
        let (mut at, mut x, mut trajectory) = (t, x.to_vec(), Vec::new());
        let Some(plant) = self.plant() else { return trajectory };
        for (end, u) in inputs {
            let (begin, steps) = (at, ((end - at) / step) as usize + 1);
            for k in 1..=steps {
                trajectory.push((at, x.clone(), *u));
                let next = begin + (end - begin) * k as f64 / steps as f64;
                plant.flow(&mut x, &u[..self.rows.input_dim], next - at);
                at = next;
            }
        }
        trajectory.extend(inputs.last().map(|(_, u)| (at, x, *u)));
        trajectory
    }

    /// Whether a plan for an uncertain plant, or beside points, has nearly ended: every new plan postpones the end, and there
    /// was none. `None` for other plans, for those that end in motion, and for an uncertain plant with a horizon of the user's.
    pub(super) fn is_nearly_over(&self, t: f64) -> Option<bool> {
        let PlanState { plan, courses, .. } = self.now();
        let is_beside_points = !courses.is_empty() && !plan.is_finite();
        let is_uncertain = self.plans.horizon.is_none() && plan.backup_plan.tracking().is_some();
        let over = t + DECISIONS.nearly_over * self.ahead();
        (is_beside_points || is_uncertain).then_some(self.now().until() <= over)
    }

    /// The time in s at which the filter next tries to prolong a plan that ends at `until`, seen from `t`: when the plan has
    /// become as short as allowed, and then more and more often until its end.
    pub(super) fn next_prolonging(&self, t: f64, until: f64) -> f64 {
        let is_nearly_over = self.is_nearly_over(t);
        let Some(horizon) = self.plans.horizon.filter(|_| is_nearly_over.is_none()) else {
            let is_over = is_nearly_over == Some(true);
            return if is_over { t + DECISIONS.sooner * (until - t) } else { f64::INFINITY };
        };
        let last = self.now().promises.iter().flatten().map(|promise| promise.from).fold(t, f64::max);
        let is_last = self.now().promises.iter().flatten().all(|promise| promise.until <= until);
        match until - horizon {
            _ if is_last => f64::INFINITY,
            due if last < due => due,
            _ => t + DECISIONS.sooner * (until - t),
        }
    }
}

/// The margin that plans keep for a barrier with the value `h` at `t` and `x`.
fn margin(model: &dyn Predict, t: f64, x: &[f64], h: f64) -> f64 {
    let DecisionSettings { margin, resolved: [least, part], room, climbs, climb_halvings, .. } = DECISIONS;
    let mut gradient = x.to_vec();
    slopes(model, t, x, &mut gradient);
    let resolved: f64 = x.iter().zip(&gradient).map(|(x, g)| g.abs() * (least + part * x.abs())).sum();
    // NaN fails this comparison on purpose.
    let wanted = (margin * h.abs()).max(resolved);
    let highest = highest(model, (t, x), wanted / room, [climbs, climb_halvings]);
    if highest > 0.0 { wanted.min(room * highest) } else { wanted }
}
