//! The exact check: the plant run ahead under a law, with every requirement checked, between the nodes too.
//!
//! Under one input, state and h are followed in pieces by their Taylor [expansions](crate::lie::Expansion). A piece ends
//! where the last terms of a state no longer vanish. It is then halved until the expansion of every state is a solution on
//! all of it, which [enclosures](crate::interval) of the plant's rate there show. If a source has no enclosures, the rate is
//! compared in the middle and at the end of the piece, on the assumption that the curvature of the plant's motion shows
//! there.
//!
//! On a piece h has a lower bound: the least Bernstein coefficient of its expansion, which is below all of its values, less
//! its last terms, and less four times the error of the expansion at four instants. Enclosures show the curvature of h
//! between these instants: they enclose h on the piece, or the last coefficient of an expansion that begins anywhere on it,
//! which by Taylor's theorem is all that the others leave open. If these do not decide, the piece is halved for this h. If a
//! source has no enclosures, it is assumed that h is curved as those instants show.
//!
//! | module | owns |
//! |---|---|
//! | here | the rollout: holds, pieces, and a lower bound on h for each |
//! | `perturbed` | a plant near that of the rollout: whether a deviation too small to measure grows |
//! | `terminal` | the end: whether the plant stays at an equilibrium for ever, or how a plan ends without one |
//! | `motion` | the extrapolation of motions that have nearly died away |
//! | `tolerances` | the numbers that decide what is accepted |

mod motion;
mod perturbed;
mod terminal;
mod tolerances;

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::backup_plan::{BackupPlan, Tightest};
use super::expansion::{self, at, shifted};
use super::law::Reference;
use super::model::Model;
use super::tube::faults::{Fault, is_planted};
use super::tube::{Piece, Tube};
use super::{Failure, Integral, Requirement};
use crate::MAX_INPUTS;
use crate::interval::Interval;
use crate::lie::{EXPANSION_ORDERS, Expansion, ExpansionOver, FEW_ORDERS, RateOver};
use crate::scalar::all_finite;
use perturbed::Perturbed;
pub(crate) use tolerances::{CheckTolerances, TOLERANCES};

/// Numbers of coefficients of the rates used to bound the residual of a state's expansion: a few first, then all.
const ORDERS: [usize; 2] = [FEW_ORDERS, EXPANSION_ORDERS - 1];

/// The samples of a rollout.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    /// The time in s for which the input of the first one is held.
    pub(super) period: f64,
    /// Whether the others follow with the same period, so that inputs change then; otherwise they come as in the plan.
    pub(super) even: bool,
}

impl Grid {
    /// Least time in s by which an end has to lie past a sample: an end that is meant to be the sample does not count.
    pub(super) fn slack(&self) -> f64 {
        self.period * if self.even { 0.5 } else { TOLERANCES.on_time }
    }
}

/// A rollout in progress.
pub(super) struct Walk<'a> {
    model: Model<'a>,
    tolerances: &'a CheckTolerances,
    requirements: &'a [Requirement<'a>],
    /// Factor on every margin.
    strictness: f64,
    t: f64,
    x: Vec<f64>,
    /// The expansions of the states from here on, a state along them and its rate.
    path: Vec<Expansion>,
    point: Vec<f64>,
    rate: Vec<f64>,
    /// Enclosures of those expansions and of the rate on a piece.
    over: Vec<ExpansionOver>,
    rate_over: Vec<RateOver>,
    /// The expansions from a perturbed state.
    beside: Vec<Expansion>,
    pieces: u32,
    /// The largest number of pieces.
    pub(super) most_pieces: u32,
    /// The longest piece in s to try, and how much longer the next one may be.
    longest: f64,
    growth: f64,
    perturbed: Perturbed<'a>,
    /// Where an uncertain plant can be instead. Every requirement then has to be met there, and `falls` says by how much h
    /// may be lower on the present piece than in the rollout.
    tube: Option<Box<Tube<'a>>>,
    falls: Vec<f64>,
    backup_plan: BackupPlan,
    started: f64,
    grid: Grid,
}

impl<'a> Walk<'a> {
    /// Begins at `t` and `x`, where every requirement in force has to be met with `strictness` times its margin. Samples are
    /// those of `grid`.
    pub(super) fn new(
        model: Model<'a>,
        tolerances: &'a CheckTolerances,
        requirements: &'a [Requirement<'a>],
        strictness: f64,
        grid: Grid,
        (t, x): (f64, &[f64]),
    ) -> Result<Self, Failure> {
        let mut walk = Self {
            model,
            tolerances,
            requirements,
            strictness,
            t,
            x: x.to_vec(),
            path: vec![[0.0; EXPANSION_ORDERS]; x.len()],
            point: x.to_vec(),
            rate: x.to_vec(),
            over: Vec::with_capacity(x.len()),
            rate_over: vec![[Interval::ALL; EXPANSION_ORDERS - 1]; x.len()],
            beside: vec![[0.0; EXPANSION_ORDERS]; x.len()],
            pieces: 0,
            most_pieces: tolerances.most_pieces,
            longest: f64::INFINITY,
            growth: tolerances.longer,
            perturbed: Perturbed::new(tolerances, x),
            tube: None,
            falls: vec![0.0; requirements.len()],
            backup_plan: BackupPlan {
                rates: vec![0.0; x.len()],
                is_uniform: grid.even,
                ..BackupPlan::default()
            },
            started: t,
            grid,
        };
        for (i, requirement) in requirements.iter().enumerate() {
            if requirement.is_in_force(t) {
                walk.note(i, t, requirement.model.value(t, x))?;
            }
        }
        Ok(walk)
    }

    /// Checks the remainder of the rollout for every plant in `tube`.
    ///
    /// # Errors
    ///
    /// A requirement in force that such a plant does not meet here.
    pub(super) fn within(mut self, tube: Tube<'a>) -> Result<Self, Failure> {
        self.tube = Some(Box::new(tube));
        self.meet_in_tube()?;
        Ok(self)
    }

    /// Checks every requirement in force for the plants that are in the tube here.
    fn meet_in_tube(&mut self) -> Result<(), Failure> {
        for i in 0..self.requirements.len() {
            if self.requirements[i].is_in_force(self.t) {
                let (t, x) = (self.t, core::mem::take(&mut self.x));
                let (requirement, tube) = (&self.requirements[i], self.tube.as_deref_mut());
                let fall = tube.map_or(0.0, |tube| tube.fall_at((i, requirement), t, &x));
                let h = requirement.model.value(t, &x);
                self.x = x;
                self.note_in_tube(i, t, h - fall, fall)?;
            }
        }
        Ok(())
    }

    /// The tube around the rollout.
    pub(super) fn tube(&mut self) -> Option<&mut Tube<'a>> {
        self.tube.as_deref_mut()
    }

    /// The state of the rollout.
    pub(super) fn state(&self) -> &[f64] {
        &self.x
    }

    /// Ends here, at a time that was asked for.
    pub(super) fn finish(self) -> (BackupPlan, Option<Box<Tube<'a>>>) {
        (BackupPlan { until: self.t, ..self.backup_plan }, self.tube)
    }

    /// Holds `u` until `end`, at least one sample ahead, with the feedback `gain` of a measurement here.
    ///
    /// # Errors
    ///
    /// What is not met.
    pub(super) fn hold_in_tube(&mut self, u: &[f64], gain: Option<&[f64]>, end: f64) -> Result<(), Failure> {
        if is_planted(Fault::Samples) {
            self.meet_in_tube()?;
        }
        if let Some(tube) = &mut self.tube {
            tube.hold(u, &self.x, gain)?;
        }
        self.hold_until_sample(u, end)
    }

    /// As [`Self::note`], where h may be lower by `fall` than in the rollout. A tube may record what is not met.
    fn note_in_tube(&mut self, i: usize, t: f64, h: f64, fall: f64) -> Result<(), Failure> {
        match (self.note(i, t, h), &mut self.tube) {
            (Err(failure), Some(tube)) => tube.lack_of(i, fall, failure),
            (noted, _) => noted,
        }
    }

    /// As [`Self::least`] in the tube, and how much lower that may be than in the rollout.
    fn least_in_tube(
        &mut self,
        i: usize,
        (path, over): (&[Expansion], &[ExpansionOver]),
        (from, dt): (f64, f64),
        turns: u32,
    ) -> [f64; 2] {
        let Some(tube) = &mut self.tube else {
            return [self.least(i, (path, over), (from, dt), self.tolerances.halvings), 0.0];
        };
        if is_planted(Fault::Samples) {
            return [f64::INFINITY, 0.0];
        }
        let (requirement, time) = (&self.requirements[i], Interval::new(from, from + dt));
        let boxed = requirement.model.value_over(time, &tube.around_piece(over));
        let lowest = boxed.map_or(f64::NEG_INFINITY, |h| h.low);
        let tightest = self.backup_plan.tightest.map_or(f64::INFINITY, |tightest| tightest.slack);
        // Far from the edge, no more needs to be known.
        if lowest >= self.least_of(i) && lowest - self.margin(i) >= tightest {
            return [lowest, 0.0];
        }
        let fall = self.tube.as_mut().map(|tube| tube.fall((i, requirement), time, over));
        let [fall, turned] = fall.unwrap_or_default();
        self.falls[i] = fall;
        let least = (self.least(i, (path, over), (from, dt), self.tolerances.halvings) - fall).max(lowest);
        let decides = least < self.least_of(i) || least - self.margin(i) < tightest;
        self.falls[i] = 0.0;
        if decides && turns > 0 && turned > self.tolerances.turned * fall {
            let half = 0.5 * dt;
            let later: Vec<Expansion> = path.iter().map(|c| shifted(c, half)).collect();
            let halves = [(path, from), (&later, from + half)].map(|(path, from)| {
                let over: Vec<ExpansionOver> = path.iter().map(|c| expansion::over(c, half)).collect();
                self.least_in_tube(i, (path, &over), (from, half), turns - 1)
            });
            return if halves[0][0] < halves[1][0] { halves[0] } else { halves[1] };
        }
        [least, fall]
    }

    /// Takes over the rates of the previous plan.
    pub(super) fn after(mut self, before: &BackupPlan) -> Self {
        for (rate, before) in self.backup_plan.rates.iter_mut().zip(&before.rates) {
            *rate = rate.max(*before);
        }
        self
    }

    /// The least value of requirement `i`. With less strictness the reserve may be used up.
    fn least_of(&self, i: usize) -> f64 {
        let is_new = self.strictness >= 1.0 && self.is_firm(i);
        let reserve = if is_new { self.requirements[i].reserve } else { f64::NEG_INFINITY };
        self.margin(i).max(reserve + self.falls[i])
    }

    fn margin(&self, i: usize) -> f64 {
        let firm = if self.is_firm(i) { 1.0 } else { self.tolerances.edge };
        self.strictness * self.requirements[i].margin * firm + self.falls[i]
    }

    /// Whether the margin of requirement `i` has to be there.
    fn is_firm(&self, i: usize) -> bool {
        self.t >= self.requirements[i].firm
    }

    /// Records that h of requirement `i` is at least `h` around `t`.
    fn note(&mut self, i: usize, t: f64, h: f64) -> Result<(), Failure> {
        let (barrier, missing) = (self.requirements[i].barrier, h - self.least_of(i));
        // NaN counts as broken too.
        if missing.is_nan() || missing < 0.0 {
            return Err(Failure::Broken { barrier, time: t, slack: missing });
        }
        let slack = h - self.margin(i);
        let counts = !self.requirements[i].is_limit;
        if counts && self.backup_plan.tightest.is_none_or(|least| slack < least.slack) {
            self.backup_plan.tightest = Some(Tightest { barrier, time: t, slack });
        }
        Ok(())
    }

    /// Holds the input of `law` here until `end`; if samples are evenly spaced and `end` lies elsewhere, until the nearest
    /// sample.
    fn hold_under(&mut self, law: impl Fn(&[f64], &mut [f64]), end: f64) -> Result<(), Failure> {
        let m = self.model.inputs();
        let (mut u, mut beside) = ([0.0; MAX_INPUTS], [0.0; MAX_INPUTS]);
        law(&self.x, &mut u[..m]);
        for (point, (x, d)) in self.point.iter_mut().zip(self.x.iter().zip(&self.perturbed.x)) {
            *point = x + d;
        }
        law(&self.point, &mut beside[..m]);
        self.perturbed.u = core::array::from_fn(|i| beside[i] - u[i]);
        self.hold_until_sample(&u[..m], end)?;
        let most = match self.strictness {
            s if s >= 1.0 => self.tolerances.spreads[0],
            s if s > 0.0 => self.tolerances.spreads[1],
            _ => f64::INFINITY,
        };
        if self.perturbed.note(&self.x) <= most { Ok(()) } else { Err(Failure::Unsteady) }
    }

    /// The same with `u`, whatever the state is.
    pub(super) fn hold_until(&mut self, u: &[f64], end: f64) -> Result<(), Failure> {
        self.hold_under(|_, held| held.copy_from_slice(u), end)
    }

    /// Holds `u` until `end` or the nearest sample, and records it.
    fn hold_until_sample(&mut self, u: &[f64], end: f64) -> Result<(), Failure> {
        let Grid { period, even } = self.grid;
        let samples = ((end - self.started) / period + 0.5) as u64;
        let sample = self.started + samples as f64 * period;
        let end =
            if !even || (sample - end).abs() <= self.tolerances.on_time * period { end } else { sample };
        // Time is too large to distinguish samples.
        if end.is_nan() || end <= self.t {
            return Err(Failure::TooLong);
        }
        self.hold(u, end)
    }

    /// Holds `u` until `end`.
    fn hold(&mut self, u: &[f64], end: f64) -> Result<(), Failure> {
        match self.model.integral {
            None => self.move_to(u, end)?,
            Some(integral) => self.integrate(u, integral, end)?,
        }
        let mut input = [0.0; MAX_INPUTS];
        input[..u.len()].copy_from_slice(u);
        if !self.backup_plan.inputs.is_empty() {
            self.backup_plan.effort = self.backup_plan.effort.max(self.model.bounds.part(u));
        }
        self.backup_plan.inputs.push((end, input));
        Ok(())
    }

    /// Moves on to `end` under `u`.
    fn move_to(&mut self, u: &[f64], end: f64) -> Result<(), Failure> {
        // Requirements begin, become firm and end at nodes.
        while self.t < end {
            let now = self.t;
            let event = |node: f64, time: f64| if now < time && time < node { time } else { node };
            let events = self.requirements.iter().flat_map(|r| [r.from, r.firm, r.until]);
            let node = events.fold(end, event);
            while self.t < node {
                self.advance(u, node)?;
            }
        }
        Ok(())
    }

    /// Moves on to `end` with the mean of the integral held over each period.
    fn integrate(&mut self, u: &[f64], integral: Integral, end: f64) -> Result<(), Failure> {
        let Integral { state, input } = integral;
        let (rate, mut held) = (u[input], u.to_vec());
        held[input] = 0.0;
        let perturbed_rate = core::mem::take(&mut self.perturbed.u[input]);
        self.backup_plan.rates[state] = self.backup_plan.rates[state].max(rate.abs());
        let period = self.grid.period;
        while self.t < end {
            // The next sample. One that is here up to round-off has passed.
            let passed = ((self.t - self.started) / period + self.tolerances.on_time) as u64;
            let sample = self.started + (passed + 1) as f64 * period;
            let sample = if sample < end - self.tolerances.on_time * period { sample } else { end };
            let (from, to) = (self.x[state], self.x[state] + rate * (sample - self.t));
            let perturbed = 0.5 * (perturbed_rate * (sample - self.t));
            self.x[state] = 0.5 * (from + to);
            self.perturbed.x[state] += perturbed;
            self.move_to(&held, sample)?;
            self.perturbed.x[state] += perturbed;
            self.x[state] = to;
            for (i, requirement) in self.requirements.iter().enumerate() {
                if requirement.is_in_force(sample) {
                    let value = requirement.model.value(sample, &self.x);
                    self.note(i, sample, value)?;
                }
            }
        }
        Ok(())
    }

    /// Moves on by a piece, at most to `node`.
    fn advance(&mut self, u: &[f64], node: f64) -> Result<(), Failure> {
        self.pieces += 1;
        self.backup_plan.pieces = self.pieces;
        if self.pieces > self.most_pieces {
            return Err(Failure::TooLong);
        }
        self.model.plant.path(&self.x, u, &mut self.path);
        if !all_finite(self.path.as_flattened()) {
            return Err(Failure::Singular);
        }
        let whole = node - self.t;
        let mut dt = self
            .path
            .iter()
            .fold(whole, |dt, c| expansion::reach(c, self.tolerances.truncated * size(c), dt));
        // The curvature that shortened the previous piece is still there.
        dt = dt.min(self.longest);
        while !self.is_solution(u, dt) {
            dt *= 0.5;
            (self.longest, self.growth) = (dt, self.tolerances.longer);
            if self.t + dt <= self.t {
                return Err(Failure::Singular);
            }
        }
        if self.tube.is_none() && !self.is_smooth_beside(u) {
            return Err(Failure::Singular);
        }
        self.longest *= self.growth;
        self.growth *= self.growth;
        let end = if dt < whole { self.t + dt } else { node };
        // Time is so large that a piece is within its round-off.
        if end <= self.t {
            return Err(Failure::TooLong);
        }
        for (greatest, c) in self.backup_plan.rates.iter_mut().zip(&self.path) {
            *greatest = greatest.max(c[1].abs()).max(expansion::slope(c, dt).abs());
        }
        let (from, path, over) = (self.t, core::mem::take(&mut self.path), core::mem::take(&mut self.over));
        if let Some(tube) = &mut self.tube {
            let (plant, tolerances) = (self.model.plant, self.tolerances);
            let piece = Piece { path: &path, over: &over, dt, u };
            tube.advance(plant, piece, |i| allowed(tolerances, over[i][0]))?;
        }
        let mut in_force = (0..self.requirements.len()).filter(|i| self.requirements[*i].is_in_force(from));
        let met = in_force.try_for_each(|i| {
            let [least, fall] = self.least_in_tube(i, (&path, &over), (from, dt), self.tolerances.turns);
            self.note_in_tube(i, from, least, fall)
        });
        // After a failure nothing is followed further.
        if met.is_ok() && self.tube.is_none() {
            self.move_perturbed(u, &path, dt);
        }
        for (x, c) in self.x.iter_mut().zip(&path) {
            *x = at(c, dt);
        }
        (self.t, self.path, self.over) = (end, path, over);
        met
    }

    /// Whether the expansions of the states are a solution for `dt` s from their start. Leaves their enclosures.
    fn is_solution(&mut self, u: &[f64], dt: f64) -> bool {
        let (plant, tolerances) = (self.model.plant, self.tolerances);
        self.over.clear();
        self.over.extend(self.path.iter().map(|c| expansion::over(c, dt)));
        // NaN is not small.
        let is_small = |missed: f64, over: &ExpansionOver| missed * dt <= allowed(tolerances, over[0]);
        for orders in ORDERS {
            if !plant.rates_over(&self.over, u, orders, &mut self.rate_over) {
                return [0.5 * dt, dt].into_iter().all(|after| {
                    self.miss(u, after);
                    self.rate.iter().zip(&self.over).all(|(missed, over)| is_small(*missed, over))
                });
            }
            let mut rates = self.rate_over.iter().zip(&self.over);
            if rates.all(|(rate, over)| is_small(expansion::missed(&rate[..orders], over, dt), over)) {
                return true;
            }
        }
        false
    }

    /// Writes the residual of each state's expansion against its rate, `after` s after its start, to `rate`.
    fn miss(&mut self, u: &[f64], after: f64) {
        for (x, c) in self.point.iter_mut().zip(&self.path) {
            *x = at(c, after);
        }
        self.model.plant.rate(&self.point, u, &mut self.rate);
        for (rate, c) in self.rate.iter_mut().zip(&self.path) {
            *rate = (expansion::slope(c, after) - *rate).abs();
        }
    }

    /// A lower bound on h of requirement `i` along the first `dt` s of `path`, which begins at `from` and is enclosed by
    /// `over`.
    fn least(
        &mut self,
        i: usize,
        (path, over): (&[Expansion], &[ExpansionOver]),
        (from, dt): (f64, f64),
        halvings: u32,
    ) -> f64 {
        let (model, margin, needed) = (self.requirements[i].model, self.margin(i), self.least_of(i));
        let CheckTolerances { instants, missed: factor, sharp, sharper, .. } = *self.tolerances;
        let tightest = self.backup_plan.tightest.map_or(f64::INFINITY, |tightest| tightest.slack);
        // Far from the edge, no more needs to be known.
        let time = Interval::new(from, from + dt);
        let lowest = model.value_over(time, over).map(|h| h.low);
        if let Some(low) = lowest.filter(|low| *low >= needed && low - margin >= tightest) {
            return low;
        }
        let mut h = [0.0; EXPANSION_ORDERS];
        model.value_along(from, path, &mut h);
        let (mut least, mut missed) = (h[0], 0.0_f64);
        for k in 1..=instants {
            let after = dt * f64::from(k) / f64::from(instants);
            for (x, c) in self.point.iter_mut().zip(path) {
                *x = at(c, after);
            }
            let value = model.value(from + after, &self.point);
            if !value.is_finite() {
                return f64::NEG_INFINITY;
            }
            (least, missed) = (least.min(value), missed.max((value - at(&h, after)).abs()));
        }
        let bound = expansion::least(&h, dt) - expansion::last_terms(&h, dt) - factor * missed;
        let slack = bound - margin;
        let is_sharp = slack >= tightest
            || slack >= sharp * (least - margin)
            || halvings + sharper <= self.tolerances.halvings;
        if least < needed {
            // Report the actual shortfall, not what a long piece leaves open.
            return least;
        }
        if bound >= needed && is_sharp || halvings == 0 {
            // The curvature of h between these instants, from its enclosure on the piece or by Taylor's theorem.
            let enclosed = lowest.filter(|low| *low < needed).map_or(f64::INFINITY, |low| {
                h[EXPANSION_ORDERS - 1] =
                    model.last_over(time, over).map_or(f64::NEG_INFINITY, |last| last.low);
                low.max(expansion::least(&h, dt))
            });
            if enclosed >= needed || halvings == 0 {
                return bound.min(least).min(enclosed);
            }
        }
        // A half takes as much work as a piece.
        self.pieces += 1;
        if self.pieces > self.most_pieces {
            return f64::NEG_INFINITY;
        }
        let half = 0.5 * dt;
        let enclosed = |path: &[Expansion]| path.iter().map(|c| expansion::over(c, half)).collect::<Vec<_>>();
        let left = self.least(i, (path, &enclosed(path)), (from, half), halvings - 1);
        if left < needed {
            return left;
        }
        let path: Vec<Expansion> = path.iter().map(|c| shifted(c, half)).collect();
        left.min(self.least(i, (&path, &enclosed(&path)), (from + half, half), halvings - 1))
    }

    /// Follows the remainder of `reference`.
    pub(super) fn follow(&mut self, reference: &Reference) -> Result<(), Failure> {
        while let Some(k) = reference.hold_at(self.t, self.grid.slack()) {
            let (model, t) = (self.model, self.t);
            self.hold_under(|x, u| reference.input(&model, k, t, x, u), reference.times[k + 1])?;
        }
        Ok(())
    }

    /// Holds the present input of `reference` until `end`.
    pub(super) fn follow_until(&mut self, reference: &Reference, end: f64) -> Result<(), Failure> {
        let Some(k) = reference.hold_at(self.t, self.grid.slack()) else { return Ok(()) };
        let (model, t) = (self.model, self.t);
        self.hold_under(|x, u| reference.input(&model, k, t, x, u), end)
    }
}

/// The error that a state may have on a piece on which it is within `over`: no more of it far from the origin than near,
/// except for round-off.
fn allowed(tolerances: &CheckTolerances, over: Interval) -> f64 {
    tolerances.residual * (1.0 + (over.high - over.low)) + tolerances.round_off * over.low.abs()
}

/// The size of a state, by which the last terms of its expansion are measured.
fn size(expansion: &Expansion) -> f64 {
    1.0 + expansion[0].abs()
}
