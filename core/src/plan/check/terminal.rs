//! The end of a plan: whether the plant stays for ever where the stopping controller brings it to an equilibrium, or how the
//! plan ends without an equilibrium.

use alloc::vec;
use alloc::vec::Vec;

use super::motion::{Motion, states_along};
use super::{CheckTolerances, Walk, size};
use crate::interval::Interval;
use crate::lie::EXPANSION_ORDERS;
use crate::plan::backup_plan::BackupPlan;
use crate::plan::expansion::{self, at};
use crate::plan::law::{Reference, StoppingController};
use crate::plan::model::{differences, largest_eigenvalue};
use crate::plan::{Failure, Integral, Requirement};

impl Walk<'_> {
    /// Applies the stopping controller until the plant is at an equilibrium where it can stay for ever.
    pub(in crate::plan) fn stop(mut self, stopping: &StoppingController) -> Result<BackupPlan, Failure> {
        let mut u = vec![0.0; self.model.inputs()];
        let hold = stopping.hold.max(self.grid.period);
        let (mut failure, mut due, mut wait) = (Failure::NoRest, 0, 1);
        for k in 0..self.tolerances.stopping_holds {
            // Only a plant that stands still is followed far ahead. If it did not stay, this is not repeated at every hold.
            let equilibrium = match self.is_still(stopping, hold, &mut u)
                && (k >= due || k + 1 == self.tolerances.stopping_holds)
            {
                true => {
                    (due, wait) = (k + wait, 2 * wait);
                    self.stays(stopping, hold, &u)
                }
                false => Ok(false),
            };
            let model = self.model;
            self.hold_under(|x, u| stopping.input(&model, x, u), self.t + hold)?;
            match equilibrium {
                Ok(true) => return Ok(BackupPlan { until: f64::INFINITY, ..self.backup_plan }),
                Ok(false) => {}
                // A plant that still drifts out may no longer do so a hold later.
                Err(drifts_out) => failure = drifts_out,
            }
        }
        Err(failure)
    }

    /// Ends where `reference` does, without an equilibrium, if that end was still ahead. If samples lie beside those of the
    /// reference, its last input is held until then.
    pub(in crate::plan) fn end(mut self, reference: &Reference) -> Result<BackupPlan, Failure> {
        let (Some(&until), slack) = (reference.times.last(), self.grid.slack()) else {
            return Err(Failure::NoRest);
        };
        if self.started >= until - slack || self.t < until - slack {
            return Err(Failure::NoRest);
        }
        if self.t < until
            && let Some((_, u)) = self.backup_plan.inputs.pop()
        {
            self.hold(&u[..self.model.inputs()], until)?;
        }
        Ok(BackupPlan { until, ..self.backup_plan })
    }

    /// Whether the plant is at an equilibrium here at which it can stay for ever, so that a plan may end.
    pub(in crate::plan) fn may_end(&mut self, stopping: &StoppingController) -> bool {
        let (mut u, tightest) = (vec![0.0; self.model.inputs()], self.backup_plan.tightest);
        let hold = stopping.hold.max(self.grid.period);
        let ends =
            self.is_still(stopping, hold, &mut u) && matches!(self.stays(stopping, hold, &u), Ok(true));
        self.backup_plan.tightest = tightest;
        ends
    }

    /// Whether the plant, which stands still under the input `u` of `stopping`, can stay here for ever. Records the tightest
    /// place.
    fn stays(&mut self, stopping: &StoppingController, hold: f64, u: &[f64]) -> Result<bool, Failure> {
        // Not at the edge of a set where a margin has to be there later.
        if !(0..self.requirements.len()).all(|i| self.is_firm(i)) {
            return Ok(false);
        }
        let tightest = self.backup_plan.tightest;
        let stays =
            self.is_equilibrium(u, hold).map(|at_equilibrium| at_equilibrium && self.settles(stopping, hold));
        if !matches!(stays, Ok(true)) {
            self.backup_plan.tightest = tightest;
        }
        stays
    }

    /// Whether the plant stands still here under the input of `stopping`, which is written to `u`.
    fn is_still(&mut self, stopping: &StoppingController, hold: f64, u: &mut [f64]) -> bool {
        self.point.copy_from_slice(&self.x);
        self.is_still_at_point(stopping, hold, u)
    }

    /// The same at the state in `point`.
    fn is_still_at_point(&mut self, stopping: &StoppingController, hold: f64, u: &mut [f64]) -> bool {
        stopping.input(&self.model, &self.point, u);
        self.model.plant.rate(&self.point, u, &mut self.rate);
        let CheckTolerances { at_equilibrium, round_off, .. } = *self.tolerances;
        let small =
            |i: usize| at_equilibrium * self.backup_plan.rates[i] + round_off * self.point[i].abs() / hold;
        self.rate.iter().enumerate().all(|(i, rate)| rate.abs() <= small(i))
    }

    /// Whether a plant at an equilibrium here stays in all sets, though it may creep on under the stopping controller.
    fn settles(&mut self, stopping: &StoppingController, hold: f64) -> bool {
        let (mut x, mut u) = (self.x.clone(), vec![0.0; self.model.inputs()]);
        let (requirements, t) = (self.requirements, self.t);
        let h = |i: usize, x: &[f64]| {
            let Requirement { model, from, .. } = requirements[i];
            let begin = t.max(from);
            let h = model.lowest_from(begin, x).unwrap_or_else(|| model.value(begin, x));
            if h.is_nan() { f64::NEG_INFINITY } else { h }
        };
        let asked = (0..self.requirements.len()).filter(|i| self.requirements[*i].until > self.t);
        let mut seen: Vec<_> = asked.map(|i| (i, vec![h(i, &x)])).collect();
        let mut states = vec![x.clone()];
        for holds in 1..=self.tolerances.settling {
            stopping.input(&self.model, &x, &mut u);
            self.creep(&mut x, &u, hold);
            states.push(x.clone());
            for (i, seen) in &mut seen {
                let h = h(*i, &x);
                if h < self.least_of(*i) {
                    return false;
                }
                seen.push(h);
            }
            let window = holds / 4;
            if holds % 4 > 0 {
                continue;
            }
            let size = x.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
            let last = |seen: &dyn Fn(usize) -> f64| [4, 3, 2, 1, 0].map(|back| seen(holds - back * window));
            // The remainder of a plan has to stay only half as long, so that time may pass.
            let windows = |i: usize| {
                let time = (self.requirements[i].until - self.t).min(self.tolerances.long * self.strictness);
                time / (hold * window as f64)
            };
            let stays = seen.iter().all(|(i, seen)| {
                let least = seen.iter().copied().fold(f64::INFINITY, f64::min);
                let motion = Motion::of(last(&|k| seen[k]), self.tolerances.settled * (size + least.abs()));
                motion.is_some_and(|motion| least - motion.to_come(windows(*i)) >= self.least_of(*i))
            });
            if !stays {
                continue;
            }
            // Two effects have not shown yet: curvature of h farther along the motion of the states, and a state that
            // accelerates.
            let ahead = |j: usize| {
                let motion =
                    Motion::of(last(&|k| states[k][j]), self.tolerances.settled * (size + x[j].abs()));
                motion.map(|motion| (x[j], motion))
            };
            let Some(ahead) = (0..x.len()).map(ahead).collect::<Option<Vec<_>>>() else { continue };
            let longest = seen.iter().map(|(i, _)| windows(*i)).fold(0.0, f64::max);
            if seen.iter().all(|(i, _)| self.stays_ahead(*i, &ahead, windows(*i)))
                && self.is_equilibrium_ahead(stopping, hold, &ahead, longest)
            {
                let holds = longest * window as f64;
                return (self.growth(stopping, hold, &x) - 1.0) * holds <= self.tolerances.grows;
            }
        }
        false
    }

    /// How many times a deviation from the equilibrium at `x` grows over a hold of the stopping controller: the largest
    /// eigenvalue.
    fn growth(&mut self, stopping: &StoppingController, hold: f64, x: &[f64]) -> f64 {
        let mut u = vec![0.0; self.model.inputs()];
        let moved = differences(x, self.tolerances.beside, x.len(), |x| {
            stopping.input(&self.model, x, &mut u);
            self.creep(x, &u, hold);
        });
        largest_eigenvalue(&moved)
    }

    /// Moves `x` on by `duration` s under `u`; an integral counts with its mean.
    pub(in crate::plan) fn run(&mut self, x: &mut [f64], u: &[f64], duration: f64) {
        let Some(Integral { state, input }) = self.model.integral else { return self.creep(x, u, duration) };
        let mut held = u.to_vec();
        let change = core::mem::take(&mut held[input]) * duration;
        let end = x[state] + change;
        x[state] += 0.5 * change;
        self.creep(x, &held, duration);
        x[state] = end;
    }

    /// Moves `x` on by `duration` s under `u`, to round-off: by expansions of the states, or by a step of the model across a
    /// kink that breaks them.
    fn creep(&mut self, x: &mut [f64], u: &[f64], duration: f64) {
        let (plant, mut left) = (self.model.plant, duration);
        for _ in 0..self.tolerances.crept {
            plant.path(x, u, &mut self.path);
            // The faster a motion dies away, the shorter its expansion is.
            let smooth = self
                .path
                .iter()
                .fold(left, |dt, c| expansion::reach(c, self.tolerances.round_off * size(c), dt));
            let mut dt = smooth;
            let is_followed = loop {
                self.miss(u, dt);
                let mut missed = self.rate.iter().zip(&self.path);
                if missed.all(|(missed, c)| missed * dt <= self.tolerances.settled * size(c)) {
                    break true;
                }
                if dt <= self.tolerances.kink * smooth {
                    break false;
                }
                dt *= 0.5;
            };
            match is_followed {
                true => x.iter_mut().zip(&self.path).for_each(|(x, c)| *x = at(c, dt)),
                false => self.model.flow(x, u, dt),
            }
            left -= dt;
            if left <= 0.0 {
                return;
            }
        }
        self.model.flow(x, u, left);
    }

    /// Whether requirement `i` is met as the states move on, each by its motion, for `windows` windows of time. For a set
    /// that moves, or a source without enclosures, it is checked at instants.
    fn stays_ahead(&self, i: usize, ahead: &[(f64, Motion)], windows: f64) -> bool {
        let Requirement { model, from, .. } = self.requirements[i];
        let begin = self.t.max(from);
        let is_met = |x: Vec<f64>| {
            let h = model.lowest_from(begin, &x).unwrap_or_else(|| model.value(begin, &x));
            h >= self.least_of(i)
        };
        match model.is_still(&self.x) {
            Some(true) => self.encloses(i, ahead, [0.0, windows], self.tolerances.path_halvings),
            _ => states_along(ahead, windows, self.tolerances.path_instants).all(is_met),
        }
    }

    /// The same by enclosures of h, from one number of windows on to another.
    fn encloses(&self, i: usize, ahead: &[(f64, Motion)], [from, to]: [f64; 2], halvings: u32) -> bool {
        let over = ahead.iter().map(|(x, motion)| {
            let mut over = [Interval::ALL; EXPANSION_ORDERS];
            over[0] = motion.over(*x, [from, to]);
            over
        });
        // A set that does not move at the present state may move farther on, so all times count.
        let h = self.requirements[i].model.value_over(Interval::ALL, &over.collect::<Vec<_>>());
        // NaN is not large enough.
        if h.is_some_and(|h| h.low >= self.least_of(i)) {
            return true;
        }
        let middle = 0.5 * (from + to);
        let parts = [[from, middle], [middle, to]];
        halvings > 0 && parts.into_iter().all(|part| self.encloses(i, ahead, part, halvings - 1))
    }

    /// Whether the plant is still at an equilibrium under the input of `stopping` as the states move on: a force that grows
    /// along their motion has not shown yet.
    fn is_equilibrium_ahead(
        &mut self,
        stopping: &StoppingController,
        hold: f64,
        ahead: &[(f64, Motion)],
        windows: f64,
    ) -> bool {
        let mut u = vec![0.0; self.model.inputs()];
        states_along(ahead, windows, self.tolerances.path_instants).all(|x| {
            self.point.copy_from_slice(&x);
            self.is_still_at_point(stopping, hold, &mut u)
        })
    }

    /// Whether a plant at an equilibrium here stays in all sets that are required now or later: either they do not move, or
    /// it is known how near they come.
    fn is_equilibrium(&mut self, u: &[f64], hold: f64) -> Result<bool, Failure> {
        let CheckTolerances { later, unmoved, drift: holds, .. } = *self.tolerances;
        let length = (self.t - self.started).max(self.grid.period);
        self.model.plant.path(&self.x, u, &mut self.path);
        for i in 0..self.requirements.len() {
            let requirement = &self.requirements[i];
            if requirement.until <= self.t {
                continue;
            }
            let h = requirement.model.value(self.t, &self.x);
            let mut spans = later[0].iter().map(|part| part * length).chain(later[1]);
            let moves = spans.any(|span| {
                let later = requirement.model.value(self.t + span, &self.x);
                (later - h).abs() > unmoved * (1.0 + h.abs())
            });
            if moves || requirement.model.is_still(&self.x) == Some(false) {
                let begin = self.t.max(requirement.from);
                for (x, c) in self.point.iter_mut().zip(&self.path) {
                    *x = c[0] + c[1] * holds * hold;
                }
                let lowest = |x: &[f64]| requirement.model.lowest_from(begin, x);
                let (Some(here), Some(there)) = (lowest(&self.x), lowest(&self.point)) else {
                    return Ok(false);
                };
                self.note(i, begin, here.min(there))?;
                continue;
            }
            let mut expansion = [0.0; EXPANSION_ORDERS];
            requirement.model.value_along(self.t, &self.path, &mut expansion);
            let drift = expansion[1].abs() * (holds * hold).min(requirement.until - self.t);
            self.note(i, self.t.max(requirement.from), h - drift)?;
        }
        Ok(true)
    }
}
