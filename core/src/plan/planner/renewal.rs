//! Another plan behind an input, between samples: the current one moved in time, or found by a few steps of a search.

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::{Guide, Planner};
use crate::MAX_INPUTS;
use crate::plan::check::Grid;
use crate::plan::law::Reference;
use crate::plan::search::{Descent, Search};
use crate::plan::settings::{SETTINGS, SearchSettings};
use crate::plan::{BackupPlan, Failure};
use crate::plan::{Plan, Requirement};
use crate::scalar::all_finite;

/// Writes an input at a time in s and a state.
type Law<'a> = &'a dyn Fn(f64, &[f64], &mut [f64]);

/// The progress of a search for a plan behind an input that is spread over samples: the guess, and how far it has come.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct SearchProgress {
    /// The number of the guess, and the number of quadratic programs for which it has been pursued.
    guess: u32,
    followed: u32,
    /// The end of each hold in s and its input, and the remaining violation under these inputs.
    inputs: Vec<(f64, [f64; MAX_INPUTS])>,
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    violation: f64,
}

impl SearchProgress {
    /// Whether it cannot be the progress of a search, has a time or input that is not finite, or a violation that is NaN.
    pub(crate) fn is_flawed(&self) -> bool {
        self.guess >= SETTINGS.renewal_guesses
            || self.violation.is_nan()
            || self.inputs.iter().any(|(end, u)| !end.is_finite() || !all_finite(u))
    }

    /// Continues after a sample with `descent` on the grid `times`, or with the next guess. Returns whether there is one.
    fn next(
        &mut self,
        settings: &SearchSettings,
        programs: u32,
        descent: Option<(&Descent, &[f64])>,
    ) -> bool {
        let SearchSettings { followed, left, renewal_guesses: guesses, .. } = *settings;
        let is_first = self.followed == 0;
        self.followed = self.followed.saturating_add(programs);
        if let Some((Descent { best, .. }, times)) = descent
            && self.followed < followed
            && best.violation < if is_first { f64::INFINITY } else { left * self.violation }
        {
            self.violation = best.violation;
            let padded = |u: &Vec<f64>| core::array::from_fn(|i| u.get(i).copied().unwrap_or(0.0));
            self.inputs = times[1..].iter().copied().zip(best.inputs.iter().map(padded)).collect();
            return true;
        }
        let guess = self.guess + 1;
        *self = Self { guess: guess % guesses, ..Self::default() };
        guess < guesses
    }
}

impl Planner<'_> {
    /// `plan`, followed from the place on its trajectory that is nearest to where `u` leads from `x` at `t` in one period: a
    /// state ahead of a plan is not off the plan.
    ///
    /// # Errors
    ///
    /// Why it fails.
    pub(crate) fn moved(&self, plan: &Plan, t: f64, x: &[f64], u: &[f64]) -> Result<Plan, Failure> {
        let moved = self.led_by(plan, t, x, u)?.0.ok_or(Failure::Nothing)?;
        let backup_plan = self.behind(&moved, t, x, u)?;
        Ok(Plan { backup_plan, ..moved })
    }

    /// `plan` moved in time, if that changes it, and the state to which `u` leads.
    fn led_by(&self, plan: &Plan, t: f64, x: &[f64], u: &[f64]) -> Result<(Option<Plan>, Vec<f64>), Failure> {
        let reference = plan.reference.as_ref().filter(|_| !plan.is_finite()).ok_or(Failure::Nothing)?;
        let mut at = x.to_vec();
        self.run(&mut at, u);
        let ahead = (reference.nearest(&at) - t) / self.period - 1.0;
        let ahead = ((ahead.abs() + 0.5) as u64 as f64).copysign(ahead);
        let moved = (ahead != 0.0).then(|| reference.sooner(ahead * self.period));
        let moved = moved.map(|reference| Plan { reference: Some(Arc::new(reference)), ..plan.clone() });
        Ok((moved, at))
    }

    /// A plan that begins with `u` for one period from `x` at `t`, by the next few steps of a search whose progress is in
    /// `progress`. The search begins by following `plan` from there.
    ///
    /// # Errors
    ///
    /// If these steps lead to no plan: whether the search continues.
    pub(crate) fn renewed(
        &self,
        plan: &Plan,
        t: f64,
        x: &[f64],
        u: &[f64],
        progress: &mut SearchProgress,
    ) -> Result<Plan, bool> {
        let found = self.led_by(plan, t, x, u).ok().and_then(|(moved, at)| {
            self.step_on(moved.as_ref().unwrap_or(plan), (t + self.period, &at), u, progress)
        });
        let found = match found {
            Some(Ok(plan)) => {
                self.behind(&plan, t, x, u).map(|backup_plan| Plan { backup_plan, ..plan }).map_err(|_| None)
            }
            Some(Err(descent)) => Err(Some(descent)),
            None => Err(None),
        };
        found.map_err(|descent| {
            progress.next(
                self.settings,
                self.programs,
                descent.as_ref().map(|(descent, times)| (descent, &times[..])),
            )
        })
    }

    /// A plan from `x` at `t`, by the next few steps of the same search, once `plan` is no longer a plan.
    ///
    /// # Errors
    ///
    /// If these steps lead to no plan: whether the search continues.
    pub(crate) fn regained(
        &self,
        plan: &Plan,
        t: f64,
        x: &[f64],
        progress: &mut SearchProgress,
    ) -> Result<Plan, bool> {
        let equilibrium = plan.stopping.as_ref().map(|stopping| stopping.input.clone()).unwrap_or_default();
        match self.step_on(plan, (t, x), &equilibrium, progress) {
            Some(Ok(found)) => match self.kept(plan, found.backup_plan.clone(), t, x) {
                Ok(backup_plan) => Ok(Plan { backup_plan, ..found }),
                Err(_) => Err(progress.next(self.settings, self.programs, None)),
            },
            Some(Err((descent, times))) => {
                Err(progress.next(self.settings, self.programs, Some((&descent, &times))))
            }
            None => Err(progress.next(self.settings, self.programs, None)),
        }
    }

    /// Steps of that search from `x` at `t`. Returns a plan, or the progress and its grid; `None` if there is no search.
    fn step_on(
        &self,
        plan: &Plan,
        (t, x): (f64, &[f64]),
        wanted: &[f64],
        progress: &SearchProgress,
    ) -> Option<Result<Plan, (Descent, Vec<f64>)>> {
        let SearchSettings { room, searched, resolved, wanted: parts, worth, .. } = *self.settings;
        let paced = Self { period: self.pace(), ..*self };
        let margin = |r: &Requirement<'_>| match r.is_limit {
            true => room * r.model.value(t, x).abs(),
            false => r.margin.max((r.margin + r.reserve) / searched),
        };
        let requirements: Vec<Requirement<'_>> =
            paced.requirements.iter().map(|r| Requirement { margin: margin(r), ..*r }).collect();
        let (hold, times) =
            paced.grid(t, &requirements, (self.settings.renewal_holds, self.settings.undated), None)?;
        let sketch = paced.model(paced.resolved(x, hold, resolved[0])?);
        let (reference, stopping) = (plan.reference.as_ref()?, plan.stopping.as_ref()?);
        let (mut at, mut u, last) = (x.to_vec(), vec![0.0; paced.dims[1]], paced.last(t));
        let mut led = |law: Law<'_>| {
            let mut inputs: Vec<Vec<f64>> = Vec::with_capacity(times.len());
            for hold in times.windows(2) {
                law(hold[0], &at, &mut u);
                sketch.flow(&mut at, &u, hold[1] - hold[0]);
                inputs.push(u.clone());
            }
            inputs.push(stopping.input.clone());
            inputs
        };
        let inputs = match progress.guess as usize {
            _ if !progress.inputs.is_empty() => {
                let before = BackupPlan { inputs: progress.inputs.clone(), ..BackupPlan::default() };
                let mean = |hold: &[f64]| before.mean(hold[0], hold[1])[..paced.dims[1]].to_vec();
                times.windows(2).map(mean).chain([stopping.input.clone()]).collect()
            }
            0 => led(&|t, x, u| match reference.hold_at(t, 1e-3 * paced.period) {
                Some(k) => reference.input(&sketch, k, t, x, u),
                None => stopping.input(&sketch, x, u),
            }),
            k if k <= parts.len() => led(&|at, x, u| match at < t + parts[k - 1] * (last - t) {
                true => u.copy_from_slice(wanted),
                false => stopping.input(&sketch, x, u),
            }),
            k => paced
                .guesses(&sketch, &Guide(Some((**stopping).clone())), x, &times)
                .nth(k - 1 - parts.len())?,
        };
        let mut search = Search {
            model: sketch,
            requirements,
            strictness: searched,
            times: &times,
            x,
            size: paced.size,
            at_equilibrium: true,
            quick: true,
            sizes: vec![0.0; self.requirements.len()],
        };
        let mut descent = search.descent(inputs);
        // Half of the programs, a check, and the other half.
        for iterations in [self.programs.div_ceil(2), self.programs / 2] {
            search.improve(&mut descent, iterations);
            if descent.best.violation > worth {
                continue;
            }
            let gains = search.gains(&mut descent)?;
            let (mut inputs, states) = (descent.best.inputs.clone(), descent.best.states.clone());
            inputs.pop();
            let reference = Reference { times: times.clone(), inputs, states, gains };
            let found = Plan { reference: Some(Arc::new(reference)), ..plan.clone() };
            let grid = Grid { period: paced.period, even: true };
            match paced.walk(&found, 1.0, grid, (t, x), None, true) {
                Ok(backup_plan) => return Some(Ok(Plan { backup_plan, ..found })),
                // A requirement broken between the nodes gets more margin at the nodes.
                Err(Failure::Broken { barrier, slack, .. }) => search.tighten(barrier, slack, &descent.best),
                Err(_) => break,
            }
            descent = search.descent(descent.best.inputs.clone());
        }
        Some(Err((descent, times)))
    }
}
