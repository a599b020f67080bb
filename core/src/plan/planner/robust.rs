//! Plans for an uncertain plant: a nominal plan, a feedback law along it, and the tube that shows what the law keeps.
//!
//! A search first leaves a part of every bound to the feedback. The tube around its plan says how much the feedback needs, and
//! how much h loses; the next search leaves that. A few rounds settle, since the tube hardly depends on the plan.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::Planner;
use crate::MAX_INPUTS;
use crate::plan::check::{Grid, Walk};
use crate::plan::settings::{SETTINGS, SearchSettings};
use crate::plan::tube::{Lacks, Tracking, Tube, Uncertainty, gains};
use crate::plan::{BackupPlan, Failure, Plan, Requirement, highest};
use crate::qp::Bounds;

/// What is not known of the plant, its bounds, of which the nominal plan leaves a part, and how far in s a plan has to reach
/// past the last deadline and the sample.
#[derive(Clone, Copy)]
pub(crate) struct Uncertain<'a> {
    pub(crate) of: &'a Uncertainty,
    pub(crate) bounds: &'a Bounds,
    pub(crate) horizon: f64,
    /// How long in s after its sample an input begins to act; if not at once, the sample from which a plan is sought, its
    /// state, and the inputs that act until then, each with the time for which it does.
    pub(crate) delay: f64,
    pub(crate) measured: Option<(f64, &'a [f64])>,
    pub(crate) acting: &'a [(f64, [f64; MAX_INPUTS])],
    /// The input that acts at the sample, before its own.
    pub(crate) before: [f64; MAX_INPUTS],
    /// What may arrive of each input there, if inputs are followed late; otherwise, or if empty, that input.
    pub(crate) arrived: &'a [[f64; 2]],
    /// The time in s after which samples are expected, and when the last input began to act.
    pub(crate) period: f64,
    pub(crate) last: Option<f64>,
}

impl Uncertain<'_> {
    /// By how much in s an input may come late; 0 if it comes as expected.
    fn latest(&self) -> f64 {
        if self.of.jitter > 0.0 { (1.0 + self.of.jitter) * self.period } else { 0.0 }
    }
}

/// The part of half the width of its bounds that the first search leaves of an input.
const FIRST_RESERVE: f64 = 0.2;
/// The largest part that a search leaves.
const MOST_RESERVE: f64 = 0.7;
/// The numbers of holds of a law, if they were all as long as the longest one, that are tried in turn. A law holds its inputs
/// longer and longer, since what is far ahead is planned anew before: with few holds a check is short, with many a law is
/// quicker.
const HOLDS: [usize; 2] = [250, 800];
/// The least ratio of the number of samples of a hold to that of the one before, until it is the longest.
const LONGER: f64 = 1.25;
/// A plan that ends sooner than this part of the horizon after the last deadline is prolonged by its law.
const SHORT: f64 = 0.7;
/// The search for a plan that leaves room: a short one, since another room is tried if it finds none.
const CAUTIOUS: SearchSettings =
    SearchSettings { beside_grids: 1, beside_rounds: [(3, 3), (1, 8)], tightened: 4, ..SETTINGS };
/// Rounds of search and tube.
const ROUNDS: u32 = 8;
/// Factor on what the last round lacked.
const MORE: f64 = 1.2;
/// The loss of h, as a part of the largest |h| along the plan, from which on a tube runs away: no other plan mends that. Plans that are
/// found lose less than 1 in the first round.
const AWAY: f64 = 10.0;
/// Steps uphill in the search for the largest h of a set, and halvings of such a step.
const CLIMBS: [u32; 2] = [60, 30];

/// What a nominal search is asked for beside the requirements.
#[derive(Clone)]
struct Asks {
    /// The part of every bound that it leaves to the feedback, in the unit of the input.
    reserve: Vec<f64>,
    /// How much more margin each requirement gets, in the unit of h, and from when in s.
    raised: Vec<f64>,
    since: Vec<f64>,
}

impl Asks {
    /// Half way to `other`.
    fn between(&self, other: &Self) -> Self {
        let half = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).collect();
        let (reserve, raised) = (half(&self.reserve, &other.reserve), half(&self.raised, &other.raised));
        Self { reserve, raised, since: self.since.clone() }
    }
}

impl<'a> Planner<'a> {
    /// The same planner for an uncertain plant.
    #[must_use]
    pub(crate) fn uncertain(self, uncertain: Option<Uncertain<'a>>) -> Self {
        Self { uncertain, ..self }
    }

    /// Searches for a plan from `x` at `t` that the uncertain plant keeps.
    ///
    /// # Errors
    ///
    /// Why the last trial fails.
    pub(super) fn search_robust(&self, uncertain: Uncertain<'_>, t: f64, x: &[f64]) -> Result<Plan, Failure> {
        let reach = self.reaches(uncertain);
        // What a round leaves to the feedback, and how much more margin it asks for.
        let mut asks = Asks {
            reserve: reach.iter().map(|reach| FIRST_RESERVE * reach).collect(),
            raised: vec![0.0; self.requirements.len()],
            since: vec![f64::INFINITY; self.requirements.len()],
        };
        let (mut failure, mut last): (Option<Failure>, Option<(Asks, Plan)>) = (None, None);
        for _ in 0..ROUNDS {
            let bounds = narrowed(uncertain.bounds, &asks.reserve);
            // A state near the edge of a set has until then to leave it.
            let raised = self.requirements.iter().zip(asks.raised.iter().zip(&asks.since));
            let raised = raised.filter(|(_, (more, _))| **more > 0.0).map(|(r, (more, since))| Requirement {
                reserve: r.reserve.max(r.margin) + more,
                from: r.from.max(*since),
                ..*r
            });
            let requirements: Vec<Requirement<'_>> =
                self.requirements.iter().copied().chain(raised).collect();
            let nominal = Planner { uncertain: None, bounds: &bounds, requirements: &requirements, ..*self };
            // What no state of a set has needs no search.
            let is_vain = last.as_ref().is_some_and(|(_, before)| {
                requirements[self.requirements.len()..].iter().any(|r| lacks_room(r, x, before))
            });
            let found = if is_vain { Err(Failure::Spreads) } else { nominal.search(t, x) };
            let plan = match found {
                Ok(plan) => plan,
                // Half of the last step may be possible.
                Err(nearest) => match &last {
                    Some((last, _)) => {
                        asks = asks.between(last);
                        failure.get_or_insert(nearest);
                        continue;
                    }
                    None => return Err(nearest),
                },
            };
            let (lacks, found) = match self.tracked(uncertain, &plan, (t, x), 1.0, true)? {
                Ok(backup_plan) => return Ok(Plan { backup_plan, reserve: asks.reserve, ..plan }),
                Err(lacks) => (lacks, asks.clone()),
            };
            let sizes = self.sizes(&plan);
            if lacks.falls.iter().zip(&sizes).any(|(fall, size)| *fall > AWAY * size) {
                return Err(Failure::Spreads);
            }
            failure = lacks.failure;
            for (raised, missing) in asks.raised.iter_mut().zip(&lacks.missing) {
                *raised += MORE * missing;
            }
            for (since, lacked) in asks.since.iter_mut().zip(&lacks.since) {
                *since = since.min(*lacked);
            }
            for ((reserve, over), reach) in asks.reserve.iter_mut().zip(&lacks.reserve).zip(&reach) {
                if *over > 0.0 {
                    *reserve = (*reserve + MORE * over + 0.01 * reach).min(MOST_RESERVE * reach);
                }
            }
            last = Some((found, plan));
        }
        Err(failure.unwrap_or(Failure::Spreads))
    }

    /// The largest |h| of every requirement along `plan`.
    fn sizes(&self, plan: &Plan) -> Vec<f64> {
        let size = |requirement: &Requirement<'_>| {
            let along = plan.reference.iter().flat_map(|r| r.times.iter().zip(&r.states));
            let h = along.map(|(t, x)| requirement.model.value(*t, x).abs());
            h.fold(requirement.margin.max(f64::MIN_POSITIVE), f64::max)
        };
        self.requirements.iter().map(size).collect()
    }

    /// `nominal`, a plan from `x` at `t`, with the law that keeps its requirements for the uncertain plant: that of `plan`, if
    /// it has one.
    ///
    /// # Errors
    ///
    /// What the first instant lacks that is not met.
    pub(super) fn kept(
        &self,
        plan: &Plan,
        nominal: BackupPlan,
        t: f64,
        x: &[f64],
    ) -> Result<BackupPlan, Failure> {
        let Some(uncertain) = self.uncertain else { return Ok(nominal) };
        let tracking = plan.backup_plan.tracking.clone();
        let nominal = Plan { backup_plan: BackupPlan { tracking, ..nominal }, ..plan.clone() };
        self.tracked(uncertain, &nominal, (t, x), 1.0, false)?
            .map_err(|lacks| lacks.failure.unwrap_or(Failure::Spreads))
    }

    /// The same planner for a sample at `t` and `x` whose input acts once all of `acting` has, each for its time in s.
    #[must_use]
    pub(crate) fn delayed(self, acting: &'a [(f64, [f64; MAX_INPUTS])], t: f64, x: &'a [f64]) -> Self {
        let delay = acting.iter().map(|(dt, _)| dt).sum();
        let uncertain = self.uncertain.map(|of| Uncertain { delay, measured: Some((t, x)), acting, ..of });
        Self { uncertain, ..self }
    }

    /// A plan for the model from `x` at `t`, near `plan`, that leaves a part of every bound to a feedback.
    ///
    /// # Errors
    ///
    /// Why the nearest trial fails.
    pub(crate) fn cautious(&self, plan: &Plan, t: f64, x: &[f64]) -> Result<Plan, Failure> {
        let uncertain = self.uncertain.ok_or(Failure::Nothing)?;
        let reserve: Vec<f64> = self.reaches(uncertain).iter().map(|reach| FIRST_RESERVE * reach).collect();
        let bounds = narrowed(uncertain.bounds, &reserve);
        let settings = &CAUTIOUS;
        Planner { uncertain: None, bounds: &bounds, settings, ..*self }.beside(plan, 1.0).search(t, x)
    }

    /// The laws along `plan` from `x` at `t`: the one that it has, or those that a search tries first, with about `holds` holds.
    pub(crate) fn laws(
        &self,
        plan: &Plan,
        holds: usize,
        t: f64,
        x: &[f64],
    ) -> Result<Vec<Tracking>, Failure> {
        let uncertain = self.uncertain.ok_or(Failure::Nothing)?;
        let samples = self.samples(plan, self.until_of(uncertain, plan, t), t)?;
        let before = plan.backup_plan.tracking.as_deref();
        let longest = before.map_or(samples.div_ceil(holds), |before| self.longest(before));
        Ok(self.laws_of(uncertain, plan, (t, x), (samples, longest)))
    }

    /// Whether `law` along `plan`, which begins at `x`, keeps every requirement for the uncertain plant.
    ///
    /// # Errors
    ///
    /// The first thing that it lacks.
    pub(crate) fn bears(&self, plan: &Plan, law: &Tracking, x: &[f64]) -> Result<(), Failure> {
        let uncertain = self.uncertain.ok_or(Failure::Nothing)?;
        let until = self.until_of(uncertain, plan, law.times[0]);
        match self.checked(uncertain, plan, law.clone(), (until, x), (1.0, false))? {
            Ok(_) => Ok(()),
            Err(lacks) => Err(lacks.failure.unwrap_or(Failure::Spreads)),
        }
    }

    /// Whether any of the [laws](Self::laws) along `plan` from `x` at `t` keeps every requirement for the uncertain plant.
    ///
    /// # Errors
    ///
    /// The first thing that the last one lacks.
    pub(crate) fn any_bears(&self, plan: &Plan, holds: usize, t: f64, x: &[f64]) -> Result<(), Failure> {
        let mut failure = Failure::Spreads;
        for law in self.laws(plan, holds, t, x)? {
            match self.bears(plan, &law, x) {
                Ok(()) => return Ok(()),
                Err(found) => failure = found,
            }
        }
        Err(failure)
    }

    /// The time in s until which `plan` from `t` on has to be kept.
    fn until_of(&self, uncertain: Uncertain<'_>, plan: &Plan, t: f64) -> f64 {
        match plan.is_finite() {
            true => plan.backup_plan.until,
            false => (self.last(t) + uncertain.horizon).max(self.before.map_or(t, |before| before.until)),
        }
    }

    /// The number of samples from `t` to `until`.
    fn samples(&self, plan: &Plan, until: f64, t: f64) -> Result<usize, Failure> {
        // A plan that ends in motion is known until then only.
        let part = if plan.is_finite() { 1.0 - 1e-9 } else { 1.0 };
        let samples = ((until - t) / self.period * part) as usize + 1;
        if samples > self.settings.most_samples { Err(Failure::TooLong) } else { Ok(samples) }
    }

    /// The number of samples in the longest hold of `law`.
    fn longest(&self, law: &Tracking) -> usize {
        ((law.longest_hold() / self.period + 0.5) as usize).max(1)
    }

    /// The laws along `plan` from `x` at `t` for so many `samples`, with holds of up to `longest` ones: with the gains that it has, if
    /// it has any.
    fn laws_of(
        &self,
        uncertain: Uncertain<'_>,
        plan: &Plan,
        (t, x): (f64, &[f64]),
        (samples, longest): (usize, usize),
    ) -> Vec<Tracking> {
        let slack = self.tolerances.on_time * self.period;
        // Where samples may come late, each hold has one.
        let (jitter, whole) = (uncertain.of.jitter, uncertain.of.jitter as usize);
        let quickest = whole.saturating_add(1 + usize::from(jitter > whole as f64)).min(samples);
        let times: Vec<f64> =
            begins(samples, [quickest, longest]).into_iter().map(|k| t + k as f64 * self.period).collect();
        let (states, inputs) = self.reference(plan, &times, x);
        let gains = match plan.backup_plan.tracking.as_deref() {
            Some(before) => {
                let kept = |k: usize| before.gain_at(times[k], slack).map(<[f64]>::to_vec);
                (0..inputs.len()).map(kept).collect::<Option<Vec<_>>>().into_iter().collect()
            }
            None => gains(self.plant, (&times, &states, &inputs), &self.reaches(uncertain)),
        };
        let law = |mut gains: Vec<Vec<f64>>| {
            // One state is known where it begins, each of a set is measured there.
            if uncertain.of.start.iter().all(|start| *start == 0.0) {
                gains[0].clear();
            }
            Tracking { times: times.clone(), inputs: inputs.clone(), gains, ..Tracking::default() }
        };
        gains.into_iter().map(law).collect()
    }

    /// The backup plan of `plan` from `x` at `t`, with the law that keeps every requirement for the uncertain plant. Gains
    /// are those that it has, if it has any. Its first input needs no feedback, since the state is measured there.
    ///
    /// # Errors
    ///
    /// Inside: what it lacks, if everything is recorded. Outside: why it ends before.
    fn tracked(
        &self,
        uncertain: Uncertain<'_>,
        plan: &Plan,
        (t, x): (f64, &[f64]),
        strictness: f64,
        records: bool,
    ) -> Result<Result<BackupPlan, Box<Lacks>>, Failure> {
        let until = self.until_of(uncertain, plan, t);
        let samples = self.samples(plan, until, t)?;
        let longest = match plan.backup_plan.tracking.as_deref() {
            // As quick as the law that is kept.
            Some(before) => vec![self.longest(before)],
            None => HOLDS.iter().map(|holds| samples.div_ceil(*holds)).collect(),
        };
        let (mut least, mut failure) = (None, Failure::Spreads);
        for longest in longest {
            // What the quickest law lacks counts.
            least = None;
            for law in self.laws_of(uncertain, plan, (t, x), (samples, longest)) {
                match self.checked(uncertain, plan, law, (until, x), (strictness, records)) {
                    Ok(Ok(backup_plan)) => return Ok(Ok(backup_plan)),
                    Ok(Err(lacks)) => {
                        let size = self.size_of(uncertain, &lacks);
                        if least.as_ref().is_none_or(|(before, _)| size < *before) {
                            least = Some((size, lacks));
                        }
                    }
                    Err(ends) => failure = ends,
                }
            }
        }
        least.map(|(_, lacks)| Err(lacks)).ok_or(failure)
    }

    /// How much `lacks` is: of each requirement as a part of what h loses, of each input as a part of its bounds, in all.
    fn size_of(&self, uncertain: Uncertain<'_>, lacks: &Lacks) -> f64 {
        let parts = lacks.missing.iter().zip(&lacks.falls).map(|(missing, fall)| missing / fall);
        let over = lacks.reserve.iter().zip(self.reaches(uncertain)).map(|(over, reach)| over / reach);
        // Nothing is missing where nothing falls.
        parts.chain(over).filter(|part| !part.is_nan()).sum()
    }

    /// The states at these `times`, and the inputs held between, of the nominal `plan` from `x`.
    fn reference(&self, plan: &Plan, times: &[f64], x: &[f64]) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
        let nu = self.dims[1];
        let model = self.model(self.period);
        let (mut z, mut u) = (x.to_vec(), vec![0.0; nu]);
        let (mut states, mut inputs) = (vec![z.clone()], Vec::with_capacity(times.len() - 1));
        let end = plan.backup_plan.inputs.last().map_or(times[0], |(end, _)| *end);
        for hold in times.windows(2) {
            match &plan.stopping {
                Some(stopping) if 0.5 * (hold[0] + hold[1]) > end => stopping.input(&model, &z, &mut u),
                // To the last bit what is asked for now.
                _ if inputs.is_empty() => u.copy_from_slice(&plan.backup_plan.inputs[0].1[..nu]),
                _ => u.copy_from_slice(&plan.backup_plan.mean(hold[0], hold[1])[..nu]),
            }
            model.flow(&mut z, &u, hold[1] - hold[0]);
            inputs.push(u.clone());
            states.push(z.clone());
        }
        (states, inputs)
    }

    /// The backup plan that follows `law` until `until`, if every requirement is met in the tube around its reference, which
    /// begins at `x`.
    ///
    /// # Errors
    ///
    /// As for [`Self::tracked`].
    fn checked(
        &self,
        uncertain: Uncertain<'_>,
        plan: &Plan,
        law: Tracking,
        (until, x): (f64, &[f64]),
        (strictness, records): (f64, bool),
    ) -> Result<Result<BackupPlan, Box<Lacks>>, Failure> {
        let Tracking { times, inputs, gains, .. } = law;
        let model = self.model(self.period);
        let (mut tube, begin) = self.measured(uncertain)?;
        tube.records = records;
        let x = begin.as_deref().unwrap_or(x);
        let grid = Grid { period: self.period, even: true };
        let mut walk = Walk::new(model, self.tolerances, self.requirements, strictness, grid, (times[0], x))?
            .after(&plan.backup_plan)
            .within(tube)?;
        let (mut states, mut radii) = (Vec::with_capacity(inputs.len()), Vec::with_capacity(inputs.len()));
        for k in 0..inputs.len() {
            states.push(walk.state().to_vec());
            radii.extend(walk.tube().map(|tube| tube.radii()));
            let gain = Some(&gains[k][..]).filter(|gain| !gain.is_empty());
            walk.hold_in_tube(&inputs[k], gain, times[k + 1])?;
            // A sample may come within the hold.
            if uncertain.latest() > 0.0
                && let (Some(radii), Some(tube)) = (radii.last_mut(), walk.tube())
            {
                *radii = tube.widest();
            }
        }
        let (backup_plan, tube) = walk.finish();
        let lacks = tube.map(|tube| Box::new(tube.lacks)).unwrap_or_default();
        if lacks.failure.is_some() {
            return Ok(Err(lacks));
        }
        let tracking = Tracking { times, inputs, states, gains, radii };
        Ok(Ok(BackupPlan {
            until: until.min(backup_plan.until),
            tracking: Some(Arc::new(tracking)),
            ..backup_plan
        }))
    }

    /// The tube in which the plant is when the input of a sample begins to act; if that is later, the reference there too.
    ///
    /// # Errors
    ///
    /// There is none.
    pub(super) fn measured<'b>(
        &'b self,
        uncertain: Uncertain<'b>,
    ) -> Result<(Tube<'b>, Option<Vec<f64>>), Failure> {
        let Uncertain { of, bounds, delay, measured, acting, before, arrived, period, .. } = uncertain;
        let arrives = |i: usize| arrived.get(i).copied().unwrap_or([before[i]; 2]);
        let arrives: Vec<[f64; 2]> = (0..self.dims[1]).map(arrives).collect();
        let tube = Tube::around(self.plant, (of, [delay, period]), bounds, self.dims, self.requirements)
            .ok_or(Failure::Spreads)?
            .acted_on(&arrives);
        let Some((t, x)) = measured else { return Ok((tube, None)) };
        let grid = Grid { period: delay, even: false };
        let mut walk = Walk::new(self.model(delay), self.tolerances, &[], 1.0, grid, (t, x))?.within(tube)?;
        let mut end = t;
        for (dt, u) in acting {
            end += dt;
            walk.hold_in_tube(&u[..self.dims[1]], None, end)?;
        }
        let begin = walk.state().to_vec();
        walk.finish().1.map(|tube| (*tube, Some(begin))).ok_or(Failure::Spreads)
    }

    /// Whether the plant is at `x` at `t` where the law of `plan` is known to keep it.
    ///
    /// # Errors
    ///
    /// By how much it is not.
    pub(crate) fn is_declared(&self, plan: &Plan, t: f64, x: &[f64]) -> Result<(), Failure> {
        let (Some(_), Some(tracking)) = (self.uncertain, &plan.backup_plan.tracking) else { return Ok(()) };
        match self.seen(tracking, t).and_then(|(k, z)| tracking.escaped((k, &z), x)) {
            Some((state, beyond)) => Err(Failure::Undeclared { state, beyond }),
            None => Ok(()),
        }
    }

    /// Whether a plant that was measured at `from` at `since`, and received `u` from then on, can be measured at `x` at `t`: for
    /// inputs that act at once, as they are asked.
    ///
    /// # Errors
    ///
    /// By how much it cannot; no bound was found.
    pub(crate) fn was_declared(
        &self,
        (since, from): (f64, &[f64]),
        u: &[f64],
        (t, x): (f64, &[f64]),
    ) -> Result<(), Failure> {
        let Some(uncertain) = self.uncertain else { return Ok(()) };
        let (tube, _) = self.measured(Uncertain { measured: None, ..uncertain })?;
        let grid = Grid { period: t - since, even: true };
        let walk = Walk::new(self.model(t - since), self.tolerances, &[], 1.0, grid, (since, from))?;
        let mut walk = walk.within(tube)?;
        walk.hold_in_tube(u, None, t)?;
        let (states, radii) = (vec![walk.state().to_vec()], walk.tube().map(|tube| vec![tube.radii()]));
        let reached = Tracking { states, radii: radii.unwrap_or_default(), ..Tracking::default() };
        match reached.escaped((0, &reached.states[0]), x) {
            Some((state, beyond)) => Err(Failure::Undeclared { state, beyond }),
            None => Ok(()),
        }
    }

    /// The hold of `law` at `t`, and its reference there: at the beginning of a hold, or anywhere if samples may be late.
    fn seen(&self, law: &Tracking, t: f64) -> Option<(usize, Vec<f64>)> {
        let slack = self.tolerances.on_time * self.period;
        let is_late = self.uncertain.is_some_and(|uncertain| uncertain.latest() > 0.0);
        let k = if is_late { law.during(t, slack) } else { law.at(t, slack) }?;
        let mut z = law.states[k].clone();
        if t > law.times[k] + slack {
            Self { period: t - law.times[k], ..*self }.run(&mut z, &law.inputs[k]);
        }
        Some((k, z))
    }

    /// The remainder of `plan` from `x` at `t` by its law, for an uncertain plant: at one of its samples by the feedback, within a hold
    /// by the input that is held.
    ///
    /// # Errors
    ///
    /// There is no law; the plan has ended; the plant is not where it was declared to be; or the next sample comes after the
    /// end of the hold.
    pub(super) fn followed(&self, plan: &Plan, t: f64, x: &[f64]) -> Option<Result<BackupPlan, Failure>> {
        let uncertain = self.uncertain?;
        let Some(tracking) = plan.backup_plan.tracking.as_ref() else { return Some(Err(Failure::NoRest)) };
        Some(self.is_declared(plan, t, x).and_then(|()| {
            let slack = self.tolerances.on_time * self.period;
            let mut inputs = plan.backup_plan.inputs.clone();
            inputs.retain(|(end, _)| *end > t + slack);
            let latest = uncertain.latest();
            let end = tracking.times.last().copied().unwrap_or(t);
            // A law for samples that come late says what to do until the latest, wherever in a hold that is.
            let covers = |(of_hold, _): &&mut (f64, _)| match latest > 0.0 {
                true => self.period <= latest + slack && t + latest <= end + slack,
                false => t + self.period <= of_hold + slack,
            };
            let Some(hold) = inputs.first_mut().filter(covers) else { return Err(Failure::NoRest) };
            let begins = |k: usize| uncertain.last.is_none_or(|last| last < tracking.times[k] - slack);
            if let Some((k, z)) = self.seen(tracking, t).filter(|(k, _)| latest == 0.0 || begins(*k)) {
                tracking.input((k, &z), x, &mut hold.1[..self.dims[1]]);
                for (i, u) in hold.1.iter_mut().enumerate().take(self.dims[1]) {
                    *u = uncertain.bounds.clamp(i, *u);
                }
            }
            Ok(BackupPlan { inputs, ..plan.backup_plan.clone() })
        }))
    }

    /// `kept`, what is left of `plan` from `x` at `t` by its law. Once that has become short: where the law leads the model
    /// from here, as a reference of its own, with an end as late as that of any new plan.
    pub(crate) fn prolonged(&self, plan: &Plan, kept: BackupPlan, t: f64, x: &[f64]) -> BackupPlan {
        let (Some(uncertain), Some(tracking)) = (self.uncertain, &kept.tracking) else { return kept };
        if plan.is_finite() || kept.until >= self.last(t) + SHORT * uncertain.horizon {
            return kept;
        }
        let (model, mut at, mut z) = (self.model(self.period), t, x.to_vec());
        let mut inputs = kept.inputs.clone();
        for (end, u) in &mut inputs {
            let u = &mut u[..self.dims[1]];
            if at > t
                && let Some((k, reference)) = self.seen(tracking, at)
            {
                tracking.input((k, &reference), &z, u);
                model.clamp(u);
            }
            model.flow(&mut z, u, *end - at);
            at = *end;
        }
        let from_here = Plan { backup_plan: BackupPlan { inputs, ..kept.clone() }, ..plan.clone() };
        match self.tracked(uncertain, &from_here, (t, x), self.tolerances.kept, false) {
            Ok(Ok(prolonged)) => prolonged,
            _ => kept,
        }
    }

    /// Half the widths of the bounds of the inputs.
    fn reaches(&self, uncertain: Uncertain<'_>) -> Vec<f64> {
        let planner = Planner { bounds: uncertain.bounds, ..*self };
        (0..self.dims[1]).map(|i| planner.model(self.period).reach(i, self.size)).collect()
    }
}

/// Whether no state is known that meets `requirement` with its reserve: none uphill of the start `x`, or of where `before` leads.
fn lacks_room(requirement: &Requirement<'_>, x: &[f64], before: &Plan) -> bool {
    let Requirement { model, from, reserve, .. } = *requirement;
    let end = before.reference.as_ref().and_then(|reference| reference.states.last());
    [Some(x), end.map(Vec::as_slice)]
        .into_iter()
        .flatten()
        .all(|x| highest(model, (from, x), reserve, CLIMBS) < reserve * (1.0 - 1e-9))
}

/// The samples at which the holds of a law begin, of `samples` samples, and the end of the last. After the first they get
/// longer, from `least` to `longest` samples.
fn begins(samples: usize, [least, longest]: [usize; 2]) -> Vec<usize> {
    let (mut begins, mut length) = (vec![0, 1], least as f64);
    while begins.last().is_some_and(|last| *last < samples) {
        begins.push(begins[begins.len() - 1] + length as usize);
        length = (length * LONGER).min(longest.max(least) as f64);
    }
    begins
}

/// `bounds` without `reserve` at either side.
pub(crate) fn narrowed(bounds: &Bounds, reserve: &[f64]) -> Bounds {
    let mut narrowed = *bounds;
    for (i, reserve) in reserve.iter().enumerate() {
        narrowed.min[i] += reserve;
        narrowed.max[i] -= reserve;
    }
    narrowed
}
