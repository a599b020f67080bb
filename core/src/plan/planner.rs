//! Which trials are made, in which order, and what is kept between samples.

mod renewal;
mod robust;

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::check::{CheckTolerances, Grid, TOLERANCES, Walk};
use super::law::{Gain, Reference, StoppingController};
use super::model::{Model, slopes};
use super::search::{Descent, Search, Trajectory};
use super::settings::{SETTINGS, SearchSettings};
use super::{BackupPlan, Failure, Integral, Plan, Policy, Requirement};
use crate::lie::Predict;
use crate::qp::Bounds;
use crate::{MAX_INPUTS, elementary};

pub(crate) use renewal::SearchProgress;
pub(crate) use robust::{Uncertain, narrowed};

/// What a first guess does by default: stop the plant, or, if there is no equilibrium, hold the input nearest to 0.
struct Guide(Option<StoppingController>);

impl Guide {
    fn stays(&self) -> bool {
        self.0.as_ref().is_none_or(StoppingController::stays)
    }

    /// The input of the equilibrium.
    fn equilibrium_input(&self, model: &Model<'_>) -> Vec<f64> {
        let mut u = vec![0.0; model.inputs()];
        match &self.0 {
            Some(stopping) => u.copy_from_slice(&stopping.input),
            None => model.clamp(&mut u),
        }
        u
    }

    /// Writes the input at `x`.
    fn input(&self, model: &Model<'_>, x: &[f64], u: &mut [f64]) {
        match &self.0 {
            Some(stopping) => stopping.input(model, x, u),
            None => u.copy_from_slice(&self.equilibrium_input(model)),
        }
    }
}

/// The side, -1 or 1, to which a `pattern` moves input `i`.
fn side(i: usize, pattern: u32) -> f64 {
    let bit = (i as u32 + 1).wrapping_mul(pattern).wrapping_mul(2_654_435_761) >> 31;
    if bit == 0 { -1.0 } else { 1.0 }
}

/// How plans end: at an equilibrium under a law, if there is one.
struct Ending<'a> {
    model: Model<'a>,
    /// The length of a hold of the search in s.
    hold: f64,
    stopping: Option<Arc<StoppingController>>,
    /// The law that leads to an equilibrium within the sets.
    aim: Option<Arc<StoppingController>>,
}

impl Ending<'_> {
    /// The law around the equilibrium at the end of `found`, for samples that are `period` s apart.
    fn at_end(&self, found: &Trajectory, period: f64) -> Option<Arc<StoppingController>> {
        self.stopping.as_ref()?;
        let (x, u) = (found.states.last()?, found.inputs.last()?);
        StoppingController::beside(&self.model, x, u, self.hold)?.shorter(&self.model, period).map(Arc::new)
    }
}

/// The plant, its bounds and the requirements at a sample, from which plans are made.
#[derive(Clone, Copy)]
pub(crate) struct Planner<'a> {
    plant: &'a dyn Predict,
    dims: [usize; 2],
    bounds: &'a Bounds,
    requirements: &'a [Requirement<'a>],
    tolerances: &'a CheckTolerances,
    settings: &'a SearchSettings,
    /// The time in s until the next sample, and the usual one between samples.
    period: f64,
    usual: f64,
    /// The size of an input that has no bounds.
    size: f64,
    /// Whether samples come at the same intervals as before.
    regular: bool,
    /// Whether a trial may not take much longer than the current plan.
    hurried: bool,
    /// The quadratic programs of a search that continues at the next sample.
    programs: u32,
    integral: Option<Integral>,
    policies: &'a [Policy],
    /// How long in s a plan without an equilibrium at its end has to be, if it is allowed.
    horizon: Option<f64>,
    /// An earlier plan that the new one continues.
    before: Option<&'a BackupPlan>,
    /// A plan for other deadlines from which alone a search begins, and the factor from its deadlines to these.
    beside: Option<(&'a Plan, f64)>,
    /// What is not known of the plant, if anything.
    uncertain: Option<Uncertain<'a>>,
}

impl<'a> Planner<'a> {
    /// A planner for `plant`, which has as many states and inputs as `dims` says. Its inputs are within `bounds` and held
    /// for `period` s; `size` > 0 is the size of an input without bounds, in its unit.
    pub(crate) fn new(
        plant: &'a dyn Predict,
        dims: [usize; 2],
        bounds: &'a Bounds,
        requirements: &'a [Requirement<'a>],
        period: f64,
        size: f64,
    ) -> Self {
        Self {
            plant,
            dims,
            bounds,
            requirements,
            tolerances: &TOLERANCES,
            settings: &SETTINGS,
            period,
            usual: period,
            size,
            regular: true,
            hurried: false,
            programs: u32::MAX,
            integral: None,
            policies: &[],
            horizon: None,
            before: None,
            beside: None,
            uncertain: None,
        }
    }

    /// The same planner at a sample that did not come at the usual interval, or is held for another time.
    #[must_use]
    pub(crate) fn irregular(self, irregular: bool) -> Self {
        Self { regular: !irregular, ..self }
    }

    /// The same planner between samples. A rollout behind another input is given up if it takes many more pieces than the
    /// current plan, and a search continues at the next sample after `programs` quadratic programs.
    #[must_use]
    pub(crate) fn hurried(self, programs: u32) -> Self {
        Self { hurried: true, programs, ..self }
    }

    /// The same planner if samples are usually `usual` s apart. A plan made when they follow sooner has holds of about that
    /// length, so that its cost does not grow with their number.
    #[must_use]
    pub(crate) fn usually(self, usual: f64) -> Self {
        Self { usual, ..self }
    }

    /// The same planner for a plant that receives the mean of an integral over each period.
    #[must_use]
    pub(crate) fn integrated(self, integral: Integral) -> Self {
        Self { integral: Some(integral), ..self }
    }

    /// The same planner with these policies, from which a search begins.
    #[must_use]
    pub(crate) fn led(self, policies: &'a [Policy]) -> Self {
        Self { policies, ..self }
    }

    /// The same planner for plans that need not end at an equilibrium if they reach `horizon` seconds, finite, > 0, past the
    /// last deadline and the sample.
    #[must_use]
    pub(crate) fn until(self, horizon: Option<f64>) -> Self {
        Self { horizon, ..self }
    }

    /// The same planner for plans that reach at least as far as `before`, from which a search begins.
    #[must_use]
    pub(crate) fn beyond(self, before: &'a BackupPlan) -> Self {
        Self { before: Some(before), ..self }
    }

    /// The same planner for deadlines that are `factor` times as long as those of `plan`, from which alone a search begins.
    #[must_use]
    pub(crate) fn beside(self, plan: &'a Plan, factor: f64) -> Self {
        Self { beside: Some((plan, factor)), ..self }
    }

    /// The time in s between the samples at which the inputs of a new plan change: a multiple of the period.
    fn pace(&self) -> f64 {
        let samples = self.usual / self.period;
        // The mean of an integral is taken over each period.
        if self.integral.is_some() || samples <= self.settings.frequent {
            return self.period;
        }
        (samples + 0.5) as u64 as f64 * self.period
    }

    fn model(&self, step: f64) -> Model<'a> {
        let Self { plant, dims, bounds, integral, settings, .. } = *self;
        Model { plant, dims, bounds, integral, settings, step }
    }

    /// Searches for a plan from `x` at `t`.
    ///
    /// # Errors
    ///
    /// Why the nearest trial fails.
    pub(crate) fn search(&self, t: f64, x: &[f64]) -> Result<Plan, Failure> {
        if let Some(uncertain) = self.uncertain {
            return self.search_robust(uncertain, t, x);
        }
        let paced = Self { period: self.pace(), ..*self };
        let to = |horizon| paced.search_to(horizon, t, x);
        match (self.horizon, self.before.map(|before| before.until.is_finite())) {
            (None, _) | (_, Some(false)) => to(None),
            (Some(_), None) => to(None).or_else(|_| to(self.horizon)),
            // A plan that continued without an equilibrium most likely does so again.
            (Some(_), Some(true)) => to(self.horizon).or_else(|failure| to(None).map_err(|_| failure)),
        }
    }

    /// Searches for a plan that ends at an equilibrium, or at a horizon.
    fn search_to(&self, horizon: Option<f64>, t: f64, x: &[f64]) -> Result<Plan, Failure> {
        // The failure of the nearest trial says more than that of another trial, or of a grid without trials.
        let (mut failure, mut nearest) = (None, f64::INFINITY);
        let is_dated = self.last(t) > t || horizon.is_some();
        let SearchSettings { grids, slow_grid, undated, undated_longer, searched, .. } = *self.settings;
        let longer = undated_longer.into_iter().filter(|_| !is_dated).map(|undated| (grids[0], undated));
        let slow = Some((slow_grid, undated)).filter(|_| is_dated && horizon.is_none());
        let most = if self.beside.is_some() { self.settings.beside_grids } else { usize::MAX };
        // Being early is no help with several visits, nor are a few long holds.
        let visits = self.requirements.iter().filter(|r| r.from > t && r.until.is_finite()).count();
        let helps = |((part, [before, _]), _): &((f64, [usize; 2]), usize)| {
            visits < 2 || *part == 1.0 && *before > slow_grid.1[0]
        };
        let grids = grids.map(|grid| (grid, undated)).into_iter().chain(slow).chain(longer);
        let grids = grids.filter(helps).take(most);
        for ((part, holds), undated) in grids {
            let sooner = |r: &Requirement<'a>| {
                let margin = match r.is_limit {
                    true => self.settings.room * r.model.value(t, x).abs(),
                    false => r.margin.max((r.margin + r.reserve) / searched),
                };
                Requirement { from: t + part * (r.from - t), margin, ..*r }
            };
            let requirements: Vec<Requirement<'a>> = self.requirements.iter().map(sooner).collect();
            let Some((mut hold, mut times)) = self.grid(t, &requirements, (holds, undated), horizon) else {
                failure.get_or_insert(Failure::TooLong);
                continue;
            };
            let resolved = self.settings.resolved.map(|error| self.resolved(x, hold, error));
            let [Some(coarse), Some(fine)] = resolved else {
                failure.get_or_insert(Failure::Singular);
                continue;
            };
            let (sketch, model) = (self.model(coarse), self.model(fine));
            let mut guide = StoppingController::around(&model, x, hold);
            // If a deviation grows too much within a hold, shorter holds are used.
            let finer = guide
                .as_ref()
                .map_or(1, |guide| (hold / guide.longest(self.settings.led) * (1.0 - 1e-9)) as usize + 1);
            if finer > 1
                && let finer = finer.min(self.settings.finest)
                && let holds = (holds.map(|n| n * finer), undated.div_ceil(finer))
                && let Some(grid) = self.grid(t, &requirements, holds, horizon)
            {
                (hold, times) = grid;
                guide = StoppingController::around(&model, x, hold).or(guide);
            }
            let mut guide = Guide(guide);
            let aim = self.aim(&sketch, &requirements, &guide, (times[times.len() - 1], hold), x);
            guide.0 = guide.0.or_else(|| aim.clone());
            let law = |at: &Option<StoppingController>| {
                let shorter = at.as_ref().filter(|_| horizon.is_none())?.shorter(&model, self.period);
                shorter.map(Arc::new)
            };
            let ending = Ending { model, hold, stopping: law(&guide.0), aim: law(&aim) };
            if horizon.is_none() && ending.stopping.is_none() {
                failure.get_or_insert(Failure::NoRest);
                continue;
            }
            let search = Search {
                model: sketch,
                requirements,
                strictness: searched,
                times: &times,
                x,
                size: self.size,
                at_equilibrium: horizon.is_none(),
                quick: false,
                sizes: vec![0.0; self.requirements.len()],
            };
            let begin = |inputs: Vec<Vec<f64>>| search.descent(inputs);
            if let Some(before) = self.before.filter(|_| horizon.is_some()) {
                let held = |hold: &[f64]| before.mean(hold[0], hold[1])[..self.dims[1]].to_vec();
                let mut inputs: Vec<Vec<f64>> = times.windows(2).map(held).collect();
                inputs.push(guide.equilibrium_input(&sketch));
                if let Ok(plan) =
                    self.descend(&search, &mut vec![begin(inputs)], &self.settings.rounds, &ending)
                {
                    return Ok(plan);
                }
            }
            if let Some((plan, factor)) = self.beside {
                let guesses = self.stretched(&sketch, plan, factor, &guide, &times).map(begin);
                match self.descend(&search, &mut guesses.into(), &self.settings.beside_rounds, &ending) {
                    Ok(plan) => return Ok(plan),
                    Err(_) => continue,
                }
            }
            let lead = || {
                let aimed = aim.iter().flat_map(|aim| self.aimed(&sketch, aim, x, &times));
                self.descend(&search, &mut aimed.map(begin).collect(), &self.settings.aimed_rounds, &ending)
            };
            // A plant with isolated equilibria is led to one of them at once, unless there is a policy.
            let leads_first = self.policies.is_empty()
                && guide.0.as_ref().is_some_and(|equilibrium| !equilibrium.is_one_of_many(&sketch));
            if leads_first && let Ok(plan) = lead() {
                return Ok(plan);
            }
            let policies = self.policies.iter().map(|policy| self.follow(&sketch, policy, &guide, x, &times));
            let mut guesses = policies.chain(self.guesses(&sketch, &guide, x, &times)).map(begin);
            let mut descents = Vec::new();
            if search.is_of_many() {
                descents.extend(guesses.next());
                if let Ok(plan) = self.descend(&search, &mut descents, &self.settings.alone, &ending) {
                    return Ok(plan);
                }
                let begun = self.guesses(&sketch, &guide, x, &times).next().unwrap_or_default();
                let mut passing: Vec<Descent> = self.passing(&search, begun).map(begin).collect();
                if let Ok(plan) = self.descend(&search, &mut passing, &self.settings.passed, &ending) {
                    return Ok(plan);
                }
                descents.extend(passing);
            }
            descents.extend(guesses);
            descents.iter_mut().take(self.policies.len()).for_each(|descent| descent.is_wanted = true);
            let found = self.descend(&search, &mut descents, &self.settings.rounds, &ending);
            let found = found.or_else(|failure| match leads_first {
                true => Err(failure),
                false => lead().map_err(|_| failure),
            });
            match found {
                Ok(plan) => return Ok(plan),
                Err(Some((missing, found))) if missing < nearest || failure.is_none() => {
                    (failure, nearest) = (Some(found), missing);
                }
                Err(_) => {}
            }
        }
        Err(failure.unwrap_or(Failure::NoRest))
    }

    /// The plan to which one of `descents` leads; or the shortfall of the nearest one, as [`Trajectory::violation`], and its
    /// failure.
    fn descend(
        &self,
        given: &Search<'_>,
        descents: &mut Vec<Descent>,
        rounds: &[(usize, u32)],
        ending: &Ending<'_>,
    ) -> Result<Plan, Option<(f64, Failure)>> {
        let SearchSettings { worth, tightened, tightening, stuck: most_stuck, less, polishing, .. } =
            *self.settings;
        let (mut checked, mut search): (Option<(f64, Failure)>, _) = (None, given.clone());
        // A few steps show which guesses lead somewhere.
        for (round, &(most, iterations)) in rounds.iter().chain([&polishing]).enumerate() {
            let is_near = |d: &Descent| d.best.violation <= worth;
            if round == rounds.len() && !descents.iter().any(is_near) {
                break;
            }
            // A guess supplied by the user is never dropped.
            let merit = |d: &Descent| (!d.is_wanted, d.best.merit);
            descents.sort_by(|a, b| {
                let (a, b) = (merit(a), merit(b));
                a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
            });
            descents.truncate(most);
            let mut nearest = f64::INFINITY;
            for descent in descents.iter_mut() {
                search.improve(descent, iterations);
                let violation = descent.best.violation;
                if violation > worth && violation >= nearest {
                    continue;
                }
                // A requirement broken between the nodes gets more margin at the nodes.
                let (mut least, mut stuck) = (f64::INFINITY, 0);
                for _ in 0..tightened {
                    let gains = search.gains(descent);
                    let found = match self.finish(search.times, &descent.best, gains, ending) {
                        Ok(plan) => return Ok(plan),
                        Err(found) => found,
                    };
                    nearest = nearest.min(violation);
                    if checked.is_none_or(|(least, _)| violation < least) {
                        checked = Some((violation, found));
                    }
                    match found {
                        Failure::Broken { barrier, slack, .. }
                            if descent.best.violation <= worth && stuck < most_stuck =>
                        {
                            // Of many vehicles, all that are too near are told at once.
                            let mut short = match search.is_of_many() {
                                true => search.tighten_between(given, &descent.best),
                                false => 0.0,
                            };
                            if short == 0.0 {
                                short = -slack;
                                search.tighten(barrier, slack, &descent.best);
                            }
                            stuck = if short > less * least { stuck + 1 } else { 0 };
                            least = least.min(short);
                            search.again(descent);
                            search.improve(descent, tightening);
                        }
                        _ => break,
                    }
                }
            }
        }
        let missed = descents.iter().map(|descent| &descent.best).filter(|best| best.violation > worth);
        let missed = missed.filter_map(|best| Some((best.violation, self.missed(search.times, best)?)));
        // A trial that is far off was also checked, but only up to its first violation. Its largest violation says more.
        Err(missed.chain(checked).min_by(|a, b| a.0.total_cmp(&b.0)))
    }

    /// The largest violation of `found` at its nodes, relative to its size.
    fn missed(&self, times: &[f64], found: &Trajectory) -> Option<Failure> {
        let mut most = 0.0;
        let mut failure = None;
        for requirement in self.requirements {
            let h: Vec<f64> =
                times.iter().zip(&found.states).map(|(t, x)| requirement.model.value(*t, x)).collect();
            let size = h.iter().fold(f64::MIN_POSITIVE, |size: f64, h| size.max(h.abs()));
            for (k, h) in h.iter().enumerate().skip(1) {
                let next = times
                    .get(k + 1)
                    .map_or(f64::INFINITY, |next| next - self.settings.on_node * (next - times[k]));
                let slack = h - requirement.margin;
                let until = requirement.until + self.settings.on_node * (times[k] - times[k - 1]);
                if requirement.from < next && times[k] <= until && -slack / size > most {
                    let (barrier, time) = (requirement.barrier, requirement.from.max(times[k]));
                    most = -slack / size;
                    failure = Some(Failure::Broken { barrier, time, slack });
                }
            }
        }
        failure
    }

    /// The length of a hold in s, and the times at which inputs may change: samples only. `before` holds lead to the last
    /// deadline, `after` holds past it; or both together to the end of a plan with a horizon. Without a deadline a hold is
    /// `undated` periods. The last sample before each deadline, and before the end of each requirement, is a node. `None` if there
    /// are too many samples.
    fn grid(
        &self,
        t: f64,
        requirements: &[Requirement<'_>],
        ([before, after], undated): ([usize; 2], usize),
        horizon: Option<f64>,
    ) -> Option<(f64, Vec<f64>)> {
        // A deadline that is a whole number of periods stays one despite round-off.
        let sample = |at: f64| ((at - t) / self.period + self.settings.on_node).max(0.0) as usize;
        let finite = |at: &f64| at.is_finite();
        let mut deadlines: Vec<usize> =
            requirements.iter().map(|r| r.from).filter(finite).map(sample).collect();
        let last = deadlines.iter().copied().max().unwrap_or(0);
        let mut ends: Vec<usize> = requirements.iter().map(|r| r.until).filter(finite).map(sample).collect();
        // Past the actual last deadline, not the one used in the search.
        let past = horizon.map(|horizon| {
            let until = (self.last(t) + self.settings.ample * horizon)
                .max(self.before.map_or(t, |before| before.until));
            ((until - t) / self.period + 0.5) as usize + 1 - last
        });
        if last.saturating_add(past.unwrap_or(0)) > self.settings.most_samples {
            return None;
        }
        let hold = match past {
            Some(past) => (last + past).div_ceil(before + after),
            None if last > 0 => last.div_ceil(before),
            None => undated,
        };
        let after = past.map_or(after, |past| past.div_ceil(hold));
        deadlines.extend(ends.iter().copied().filter(|end| *end < last));
        deadlines.sort_unstable();
        deadlines.dedup();
        let (mut samples, mut from) = (vec![0], 0);
        for deadline in deadlines {
            let (length, holds) = (deadline - from, (deadline - from).div_ceil(hold));
            samples.extend((1..=holds).map(|k| from + (length as u64 * k as u64 / holds as u64) as usize));
            from = deadline;
        }
        samples.extend((1..=after).map(|k| from + hold * k));
        let end = from + hold * after;
        ends.retain(|sample| *sample > last && *sample < end && !samples.contains(sample));
        samples.extend(ends);
        samples.sort_unstable();
        samples.dedup();
        Some((hold as f64 * self.period, samples.into_iter().map(|k| t + k as f64 * self.period).collect()))
    }

    /// The plan along `found`, checked.
    fn finish(
        &self,
        times: &[f64],
        found: &Trajectory,
        gains: Option<Vec<Gain>>,
        ending: &Ending<'_>,
    ) -> Result<Plan, Failure> {
        let (mut inputs, states) = (found.inputs.clone(), found.states.clone());
        inputs.pop();
        let gains = gains.ok_or(Failure::Singular)?;
        let reference = Reference { times: times.to_vec(), inputs, states, gains };
        let mut plan = Plan {
            reference: Some(Arc::new(reference)),
            stopping: ending.stopping.clone(),
            backup_plan: BackupPlan::default(),
            reserve: Vec::new(),
        };
        let grid = Grid { period: self.period, even: true };
        let walk = |plan: &Plan| self.walk(plan, 1.0, grid, (times[0], &found.states[0]), None, true);
        let failure = match walk(&plan) {
            Ok(backup_plan) => return Ok(Plan { backup_plan, ..plan }),
            Err(failure) => failure,
        };
        // If not every position is an equilibrium, the law leads back to the one around which it was made.
        if !matches!(failure, Failure::Broken { time, .. } if time < times[times.len() - 1]) {
            for law in [ending.at_end(found, self.period), ending.aim.clone()].into_iter().flatten() {
                plan.stopping = Some(law);
                if let Ok(backup_plan) = walk(&plan) {
                    return Ok(Plan { backup_plan, ..plan });
                }
            }
        }
        Err(failure)
    }

    /// Whether `plan`, found from `x` at `t` for other requirements, keeps these as strictly as a new plan has to.
    pub(crate) fn keeps(&self, plan: &Plan, t: f64, x: &[f64]) -> bool {
        let walked = self.walk(plan, 1.0, Grid { period: self.period, even: true }, (t, x), None, true);
        walked.and_then(|nominal| self.kept(plan, nominal, t, x)).is_ok()
    }

    /// A backup plan that begins with `u` for one period from `x` at `t`. Then the reference of `plan` is followed, or the
    /// plant is stopped.
    ///
    /// # Errors
    ///
    /// Why the first of these fails.
    pub(crate) fn behind(&self, plan: &Plan, t: f64, x: &[f64], u: &[f64]) -> Result<BackupPlan, Failure> {
        let nominal = self.on_a_grid(|grid| {
            let at = t + self.period;
            let has_reference =
                plan.reference.as_ref().is_some_and(|r| r.hold_at(at, grid.slack()).is_some());
            let strictness = if self.regular { 1.0 } else { self.tolerances.wary };
            let walk = |follows| self.walk(plan, strictness, grid, (t, x), Some(u), follows);
            match has_reference {
                // A plan without an equilibrium ends with its reference.
                true if plan.is_finite() => walk(true),
                true => walk(true).or_else(|failure| walk(false).map_err(|_| failure)),
                false => walk(false),
            }
        })?;
        self.kept(plan, nominal, t, x)
    }

    /// The end of `walk`, which has followed the reference of `plan` as far as it goes: at an equilibrium, or at the plan's
    /// horizon.
    fn conclude(&self, walk: Walk<'a>, plan: &Plan) -> Result<BackupPlan, Failure> {
        match (&plan.stopping, &plan.reference) {
            (Some(stopping), _) => walk.stop(stopping),
            (None, Some(reference)) => walk.end(reference),
            (None, None) => Err(Failure::NoRest),
        }
    }

    /// The remainder of the backup plan of `plan`, from `x` at `t`: its inputs as they are; or, if the plant deviates from
    /// the model or does not forget round-off, the feedback that they came from.
    ///
    /// # Errors
    ///
    /// Why it fails.
    pub(crate) fn tail(&self, plan: &Plan, t: f64, x: &[f64]) -> Result<BackupPlan, Failure> {
        if let Some(followed) = self.followed(plan, t, x) {
            return followed;
        }
        let nu = self.dims[1];
        // Replays `held` of its holds, then applies the law behind it.
        let replay = |grid: Grid, held: usize, follows: bool| {
            let mut walk = self.begin(plan, self.tolerances.kept, grid, (t, x))?;
            let mut at = t;
            let hold = |walk: &mut Walk<'a>, mut u: [f64; MAX_INPUTS], end: f64| {
                self.model(self.pace()).clamp(&mut u[..nu]);
                walk.hold_until(&u[..nu], end)
            };
            if !grid.even {
                at += grid.period;
                hold(&mut walk, plan.backup_plan.mean(t, at), at)?;
            }
            let left = plan.backup_plan.inputs.iter().filter(|(end, _)| *end > t + grid.slack());
            for (end, u) in left.take(held) {
                if *end > at + grid.slack() {
                    // Holds after the end are not replayed, since there is one more at every sample.
                    if plan.stopping.as_ref().is_some_and(|stopping| walk.may_end(stopping)) {
                        break;
                    }
                    hold(&mut walk, *u, *end)?;
                    at = *end;
                }
            }
            if let Some(reference) = plan.reference.as_ref().filter(|_| follows) {
                walk.follow(reference)?;
            }
            self.conclude(walk, plan)
        };
        self.on_a_grid(|grid| {
            let kept = match plan.stays() {
                true => replay(grid, usize::MAX, false),
                // The law takes over at the end of the present hold.
                false => replay(grid, 1, true).or_else(|failure| replay(grid, 1, false).map_err(|_| failure)),
            };
            kept.or_else(|failure| {
                let follow = |follows| self.walk(plan, self.tolerances.kept, grid, (t, x), None, follows);
                follow(true).or_else(|_| follow(false)).map_err(|_| failure)
            })
        })
    }

    /// Whether every requirement is met from `x` at `t` until the next sample, under `u`.
    ///
    /// # Errors
    ///
    /// Why it fails.
    pub(crate) fn holds(
        &self,
        t: f64,
        x: &[f64],
        inputs: &[(f64, [f64; MAX_INPUTS])],
    ) -> Result<(), Failure> {
        let grid = Grid { period: self.period, even: false };
        let mut walk =
            Walk::new(self.model(self.pace()), self.tolerances, self.requirements, 1.0, grid, (t, x))?;
        if let Some(uncertain) = self.uncertain {
            let measured = Uncertain { measured: None, ..uncertain };
            walk = walk.within(self.measured(measured)?.0)?;
        }
        let mut end = t;
        for (dt, u) in inputs {
            end += dt;
            let u = &u[..self.dims[1]];
            match self.uncertain {
                Some(_) => walk.hold_in_tube(u, None, end)?,
                None => walk.hold_until(u, end)?,
            }
        }
        Ok(())
    }

    /// Runs the plant from `x` until the next sample, under `u`, to round-off.
    pub(crate) fn run(&self, x: &mut [f64], u: &[f64]) {
        let grid = Grid { period: self.period, even: true };
        if let Ok(mut walk) = Walk::new(self.model(self.pace()), self.tolerances, &[], 0.0, grid, (0.0, x)) {
            walk.run(x, u, self.period);
        }
    }

    /// The input of the law of `plan` at `t` and `x`, if it nearly keeps every requirement from there.
    ///
    /// # Errors
    ///
    /// Why it fails.
    pub(crate) fn nearly(&self, plan: &Plan, t: f64, x: &[f64]) -> Result<[f64; MAX_INPUTS], Failure> {
        let grid = Grid { period: self.period, even: true };
        let follow = |follows| self.walk(plan, self.tolerances.nearly, grid, (t, x), None, follows);
        let near = follow(true).or_else(|failure| follow(false).map_err(|_| failure))?;
        Ok(near.inputs[0].1)
    }

    /// The result of `find` for samples with the present period. If that fails and the plan was made for another period: the
    /// result for samples with that one from the next sample on.
    fn on_a_grid<R>(&self, find: impl Fn(Grid) -> Result<R, Failure>) -> Result<R, Failure> {
        let grid = Grid { period: self.period, even: true };
        // Over unknown periods there are no means.
        find(grid).or_else(|failure| match self.regular || self.integral.is_some() {
            true => Err(failure),
            false => find(Grid { even: false, ..grid }).map_err(|_| failure),
        })
    }

    fn begin(
        &self,
        plan: &Plan,
        strictness: f64,
        grid: Grid,
        start: (f64, &[f64]),
    ) -> Result<Walk<'a>, Failure> {
        let model = self.model(self.pace());
        let walk = Walk::new(model, self.tolerances, self.requirements, strictness, grid, start)?;
        Ok(walk.after(&plan.backup_plan))
    }

    fn walk(
        &self,
        plan: &Plan,
        strictness: f64,
        grid: Grid,
        (t, x): (f64, &[f64]),
        first: Option<&[f64]>,
        follows: bool,
    ) -> Result<BackupPlan, Failure> {
        let mut walk = self.begin(plan, strictness, grid, (t, x))?;
        if self.hurried && strictness >= 1.0 {
            let [least, times] = self.tolerances.hurried;
            walk.most_pieces = least.max(times.saturating_mul(plan.backup_plan.pieces));
        }
        if let Some(u) = first {
            walk.hold_until(u, t + self.period)?;
        }
        if let Some(reference) = plan.reference.as_ref().filter(|_| follows) {
            if first.is_none() && !grid.even {
                walk.follow_until(reference, t + self.period)?;
            }
            walk.follow(reference)?;
        }
        self.conclude(walk, plan)
    }

    /// A step of the model that resolves a hold from `x` to `allowed` with inputs at both bounds, if there is one. Otherwise
    /// a step that does so at one of them: at the other a tank may run empty.
    fn resolved(&self, x: &[f64], hold: f64, allowed: f64) -> Option<f64> {
        let nu = self.dims[1];
        let SearchSettings { coarse, fine, step_halvings, .. } = *self.settings;
        let mut step = (hold / 8.0).min((coarse * self.period).max(hold / fine));
        let mut one = None;
        for _ in 0..step_halvings {
            let is_resolved = |sign: f64| {
                let mut u: Vec<f64> = (0..nu).map(|i| sign * self.model(step).reach(i, self.size)).collect();
                self.model(step).clamp(&mut u);
                let run = |step: f64| {
                    let mut end = x.to_vec();
                    self.model(step).flow(&mut end, &u, hold);
                    end
                };
                let (coarse, fine) = (run(step), run(step / 2.0));
                let is_near = |(a, b): (&f64, &f64)| (a - b).abs() <= allowed * (1.0 + b.abs());
                // NaN is not near.
                coarse.iter().zip(&fine).all(is_near)
            };
            match [1.0, -1.0].map(is_resolved) {
                [true, true] => return Some(step),
                [true, false] | [false, true] => _ = one.get_or_insert(step),
                [false, false] => {}
            }
            step /= 2.0;
        }
        one
    }

    /// The latest deadline in s, or the time `t` of the search if there is none.
    fn last(&self, t: f64) -> f64 {
        self.requirements.iter().map(|r| r.from).filter(|t| t.is_finite()).fold(t, f64::max)
    }

    /// The mean inputs of `policy` over each hold until the last deadline, then those that stop the plant.
    fn follow(
        &self,
        model: &Model<'_>,
        policy: &Policy,
        guide: &Guide,
        x: &[f64],
        times: &[f64],
    ) -> Vec<Vec<f64>> {
        let last = self.last(times[0]);
        let (mut x, mut u) = (x.to_vec(), vec![0.0; model.inputs()]);
        let mean = |hold: &[f64]| {
            let length = hold[1] - hold[0];
            let parts = (length / self.period).clamp(1.0, self.settings.asked) as u32;
            let part = length / f64::from(parts);
            let mut mean = vec![0.0; u.len()];
            for k in 0..parts {
                let t = hold[0] + f64::from(k) * part;
                match t < last {
                    true => policy(t, &x, &mut u),
                    false => guide.input(model, &x, &mut u),
                }
                model.clamp(&mut u);
                model.flow(&mut x, &u, part);
                mean.iter_mut().zip(&u).for_each(|(mean, u)| *mean += u / f64::from(parts));
            }
            mean
        };
        let mut inputs: Vec<Vec<f64>> = times.windows(2).map(mean).collect();
        inputs.push(guide.equilibrium_input(model));
        inputs
    }

    /// The law that leads from `x` to an equilibrium within every set required at `end`, as deep inside as one is found.
    fn aim(
        &self,
        model: &Model<'_>,
        requirements: &[Requirement<'_>],
        guide: &Guide,
        (end, hold): (f64, f64),
        x: &[f64],
    ) -> Option<StoppingController> {
        let SearchSettings { searched, beyond, deeper: (deeper, times), .. } = *self.settings;
        let within = |x: &[f64], u: &[f64], depth: f64| {
            model.equilibrium_within(x, u.to_vec(), |x, missing| {
                for requirement in requirements.iter().filter(|r| r.until > end) {
                    let (wanted, h) = (depth * requirement.margin, requirement.model.value(end, x));
                    // NaN counts as outside.
                    if h >= wanted {
                        continue;
                    }
                    let mut gradient = vec![0.0; x.len()];
                    slopes(requirement.model, end, x, &mut gradient);
                    let steepness = elementary::sqrt(gradient.iter().map(|g| g * g).sum());
                    gradient.iter_mut().for_each(|g| *g /= steepness);
                    missing.push(((beyond * wanted - h) / steepness, gradient));
                }
            })
        };
        let near = guide.0.as_ref().and_then(|stopping| within(&stopping.state, &stopping.input, searched));
        let mut aim = near.or_else(|| within(x, &guide.equilibrium_input(model), searched))?;
        let depths = core::iter::successors(Some(searched * deeper), |depth| Some(depth * deeper));
        for depth in depths.take(times) {
            let Some(found) = within(&aim.0, &aim.1, depth) else { break };
            aim = found;
        }
        StoppingController::to(model, x, aim, hold)
    }

    /// Guesses that lead to the equilibrium of `aim`: by its law, and by the input that holds the plant there.
    fn aimed(
        &self,
        model: &Model<'_>,
        aim: &StoppingController,
        x: &[f64],
        times: &[f64],
    ) -> [Vec<Vec<f64>>; 2] {
        let (mut x, mut u) = (x.to_vec(), vec![0.0; model.inputs()]);
        let led = |hold: &[f64]| {
            aim.input(model, &x, &mut u);
            model.flow(&mut x, &u, hold[1] - hold[0]);
            u.clone()
        };
        let mut inputs: Vec<Vec<f64>> = times.windows(2).map(led).collect();
        inputs.push(aim.input.clone());
        [inputs, vec![aim.input.clone(); times.len()]]
    }

    /// Guesses that follow the trajectory of `plan` in `factor` times the time: with its inputs; with inputs scaled as rates
    /// are, by 1/`factor`; and with inputs scaled as accelerations are, by its square.
    fn stretched(
        &self,
        model: &Model<'_>,
        plan: &Plan,
        factor: f64,
        guide: &Guide,
        times: &[f64],
    ) -> [Vec<Vec<f64>>; 3] {
        let (equilibrium, begin) = (guide.equilibrium_input(model), times[0]);
        // Without the feedback of its rollout, if it has a reference.
        let padded = |u: &Vec<f64>| core::array::from_fn(|i| u.get(i).copied().unwrap_or(0.0));
        let inputs = match &plan.reference {
            Some(reference) => reference.times[1..]
                .iter()
                .copied()
                .zip(reference.inputs.iter().map(padded))
                .chain([(f64::INFINITY, padded(&equilibrium))])
                .collect(),
            None => plan.backup_plan.inputs.clone(),
        };
        let plan = BackupPlan { inputs, ..BackupPlan::default() };
        let at = |t: f64| begin + (t - begin) / factor;
        [1.0, factor, factor * factor].map(|smaller| {
            let held = |hold: &[f64]| {
                let mean = plan.mean(at(hold[0]), at(hold[1]));
                let mut u: Vec<f64> = equilibrium
                    .iter()
                    .zip(mean)
                    .map(|(equilibrium, mean)| equilibrium + (mean - equilibrium) / smaller)
                    .collect();
                model.clamp(&mut u);
                u
            };
            times.windows(2).map(held).chain([equilibrium.clone()]).collect()
        })
    }

    /// Guesses for several vehicles that are in one another's way: each goes its own way as if it were alone, and then all are
    /// pushed to sides of their own.
    fn passing(&self, search: &Search<'a>, begun: Vec<Vec<f64>>) -> impl Iterator<Item = Vec<Vec<f64>>> {
        let SearchSettings { unhindered, pushes, pushed, .. } = *self.settings;
        let (t, model) = (search.times[0], search.model);
        let goals: Vec<Requirement<'a>> =
            search.requirements.iter().copied().filter(|r| r.from > t).collect();
        let sizes = vec![0.0; goals.len()];
        let free = Search { requirements: goals, sizes, ..search.clone() };
        let mut descent = free.descent(begun);
        free.improve(&mut descent, unhindered);
        let inputs = descent.best.inputs;
        let (holds, size) = (inputs.len() - 1, self.size);
        (1..=pushes).map(move |pattern| {
            let mut inputs = inputs.clone();
            for (k, u) in inputs[..holds].iter_mut().enumerate() {
                // There and back again.
                let phase = 2.0 * core::f64::consts::PI * k as f64 / holds as f64;
                for (i, input) in u.iter_mut().enumerate() {
                    *input += pushed * side(i, pattern) * model.reach(i, size) * elementary::sin(phase);
                }
                model.clamp(u);
            }
            inputs
        })
    }

    /// First guesses: the plant is stopped at once, or after inputs to either side.
    fn guesses(
        &self,
        model: &Model<'_>,
        guide: &Guide,
        x: &[f64],
        times: &[f64],
    ) -> impl Iterator<Item = Vec<Vec<f64>>> {
        let nu = model.inputs();
        let mut sides: Vec<Vec<f64>> = vec![vec![0.0; nu]];
        if nu <= 2 {
            for i in 0..nu {
                let before = sides.clone();
                for side in [-1.0, 1.0] {
                    sides.extend(before.iter().map(|s| {
                        let mut s = s.clone();
                        s[i] = side;
                        s
                    }));
                }
            }
        } else if nu <= self.settings.one_by_one {
            for i in 0..nu {
                for side in [-1.0, 1.0] {
                    let mut s = vec![0.0; nu];
                    s[i] = side;
                    sides.push(s);
                }
            }
        } else {
            // Inputs of several vehicles: all to one side, by turns, or each to a side of its own.
            for side in [-1.0, 1.0] {
                sides.push(vec![side; nu]);
                sides.extend(
                    [0, 1].map(|odd| (0..nu).map(|i| if i % 2 == odd { side } else { 0.0 }).collect()),
                );
            }
            sides.extend([1, 3, 5, 7].map(|pattern| (0..nu).map(|i| side(i, pattern)).collect()));
        }
        let (holds, last) = (times.len() - 1, self.last(times[0]));
        let run = move |side: &[f64], [size, part]: [f64; 2]| {
            let (mut x, mut u) = (x.to_vec(), vec![0.0; nu]);
            let mut inputs = Vec::with_capacity(holds + 1);
            for k in 0..holds {
                if side.iter().any(|s| *s != 0.0) && (k < 2 || times[k] < times[0] + part * (last - times[0]))
                {
                    // A plant that would fall is held upright meanwhile.
                    match guide.stays() {
                        true => u.copy_from_slice(&guide.equilibrium_input(model)),
                        false => guide.input(model, &x, &mut u),
                    }
                    for i in 0..nu {
                        u[i] += side[i] * size * model.reach(i, self.size);
                    }
                    model.clamp(&mut u);
                } else {
                    guide.input(model, &x, &mut u);
                }
                model.flow(&mut x, &u, times[k + 1] - times[k]);
                inputs.push(u.clone());
            }
            inputs.push(guide.equilibrium_input(model));
            inputs
        };
        let others = sides.len() - 1;
        let guesses = self.settings.guesses;
        let sizes = guesses.into_iter().flat_map(move |guess| (1..=others).map(move |side| (side, guess)));
        core::iter::once((0, guesses[0])).chain(sizes).map(move |(side, guess)| run(&sides[side], guess))
    }
}
