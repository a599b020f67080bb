//! The exact check: the plant run ahead under a law, with every requirement looked at, between the nodes too.
//!
//! Between two nodes a time σ apart under one input, h is looked at in the middle too. Both halves then have a lower bound,
//! which is the least of three: the chord less M (σ/2)²/8, where M is the largest second derivative at the three points,
//! widened by as much as it differs there (for n = 1 three times the difference quotient of ḣ); the point where the tangents
//! of a half cross; and all of it less the error that the cubic through the ends makes in the middle. Where that does not
//! decide, the piece is halved. So it is assumed that a dip of h between two points shows at them: as a value, a slope, a
//! second derivative, or as a middle that is not where it was expected.

use alloc::vec;
use alloc::vec::Vec;

use super::Requirement;
use super::law::{Brake, Reference};
use super::model::Model;
use crate::MAX_INPUTS;
use crate::lie::Derivatives;
use crate::scalar::all_finite;

/// Most steps of the model in a hold.
const MOST_STEPS: f64 = 1e5;
/// Halvings of a piece whose bound does not decide.
const HALVINGS: u32 = 6;
/// Rate of the state that counts as rest, as a part of the largest on the way.
const AT_REST: f64 = 1e-6;
/// Change of a state over a hold that is round-off, as a part of its size.
pub(super) const ROUND_OFF: f64 = 16.0 * f64::EPSILON;
/// Number of holds for which a drift at rest has to leave every set where it is.
const DRIFT: f64 = 1e3;
/// Difference of a sample from its time that counts as none, as a part of the period. Round-off of times is another.
pub(crate) const ON_TIME: f64 = 1e-6;
/// Most holds of the braking law after a reference.
const BRAKING: usize = 200;
/// Later times at which a set that does not move has the same h: in units of the plan's length, and in s.
const LATER: [[f64; 4]; 2] = [[0.1234, 0.618, 1.7, 3.3], [3.7, 61.7, 1013.0, 86413.0]];

/// A list of held inputs that meets every requirement, from a state on.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Witness {
    /// The end of each hold in s, and its input. The plant is at rest under the last, which is held for ever.
    pub inputs: Vec<(f64, [f64; MAX_INPUTS])>,
    /// The place on the way where h − margin is least.
    pub tightest: Option<Tightest>,
    /// The largest rate of each state on the way, and on the way of the plan before it: what rest is small against. It never
    /// falls, so what was a rest stays one.
    pub(super) rates: Vec<f64>,
    /// The largest input on the way after the first hold, as a part of its bounds, 0 to 1.
    pub effort: f64,
}

impl Witness {
    /// The mean input from `t` until `end` > `t`.
    pub(super) fn mean(&self, t: f64, end: f64) -> [f64; MAX_INPUTS] {
        let (mut mean, mut at) = ([0.0; MAX_INPUTS], t);
        let last = self.inputs.last().map(|(_, u)| (f64::INFINITY, *u));
        for (until, u) in self.inputs.iter().copied().chain(last) {
            let until = until.min(end);
            if until > at {
                for (mean, u) in mean.iter_mut().zip(u) {
                    *mean += u * (until - at) / (end - t);
                }
                at = until;
            }
        }
        mean
    }
}

/// Where h − margin is least.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Tightest {
    /// The number of the barrier.
    pub barrier: usize,
    /// Time in s.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub time: f64,
    /// h − margin in the unit of h, a bound from below.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub slack: f64,
}

/// What keeps a list of inputs from being a witness.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Failure {
    /// A requirement is not met.
    Broken {
        /// The number of its barrier.
        barrier: usize,
        /// Time in s.
        #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
        time: f64,
        /// h − margin there, < 0.
        #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
        slack: f64,
    },
    /// The plant does not come to rest, or a set moves.
    NoRest,
    /// Nothing is promised that could be kept.
    Nothing,
    /// The model is not finite on the way.
    Singular,
    /// There are too many samples, or steps of the model, to look at.
    TooLong,
}

/// The samples of a roll-out.
#[derive(Clone, Copy)]
pub(super) struct Grid {
    /// The time in s for which the input of the first one is held.
    pub(super) period: f64,
    /// Whether the others follow in the same period, so that inputs change then; else they come as the plan has them.
    pub(super) even: bool,
}

impl Grid {
    /// By how much an end lies past a sample at least, in s: what it is meant to be is not that sample.
    pub(super) fn slack(&self) -> f64 {
        self.period * if self.even { 0.5 } else { ON_TIME }
    }
}

/// A roll-out in progress.
pub(super) struct Walk<'a> {
    model: Model<'a>,
    requirements: &'a [Requirement<'a>],
    /// What every margin is multiplied by.
    strictness: f64,
    t: f64,
    x: Vec<f64>,
    before: Vec<f64>,
    /// Derivatives of h at (t, x) for the requirements that are or come into force.
    at: Vec<Derivatives>,
    witness: Witness,
    started: f64,
    grid: Grid,
}

impl<'a> Walk<'a> {
    /// Begins at `t` and `x`, where every requirement in force has to be met with `strictness` times its margin. Samples
    /// are those of `grid`.
    pub(super) fn new(
        model: Model<'a>,
        requirements: &'a [Requirement<'a>],
        strictness: f64,
        grid: Grid,
        (t, x): (f64, &[f64]),
    ) -> Result<Self, Failure> {
        if grid.period > MOST_STEPS * model.step {
            return Err(Failure::TooLong);
        }
        let mut walk = Self {
            model,
            requirements,
            strictness,
            t,
            x: x.to_vec(),
            before: x.to_vec(),
            at: vec![Derivatives::ZERO; requirements.len()],
            witness: Witness { rates: vec![0.0; x.len()], ..Witness::default() },
            started: t,
            grid,
        };
        for i in 0..requirements.len() {
            walk.evaluate(i)?;
        }
        Ok(walk)
    }

    /// Takes over the rates of the plan before.
    pub(super) fn after(mut self, before: &Witness) -> Self {
        for (rate, before) in self.witness.rates.iter_mut().zip(&before.rates) {
            *rate = rate.max(*before);
        }
        self
    }

    fn margin(&self, i: usize) -> f64 {
        self.strictness * self.requirements[i].margin
    }

    /// Evaluates requirement `i` here, and checks it where it is in force.
    fn evaluate(&mut self, i: usize) -> Result<(), Failure> {
        let requirement = &self.requirements[i];
        requirement.source.evaluate(self.t, &self.x, &mut self.at[i]);
        let h = self.at[i].drift[0];
        if !self.at[i].is_finite() {
            return Err(Failure::Singular);
        }
        if requirement.is_in_force(self.t) { self.note(i, self.t, h) } else { Ok(()) }
    }

    /// Notes that h of requirement `i` is at least `h` around `t`.
    fn note(&mut self, i: usize, t: f64, h: f64) -> Result<(), Failure> {
        let (barrier, slack) = (self.requirements[i].barrier, h - self.margin(i));
        // Not-a-number is broken too.
        if slack.is_nan() || slack < 0.0 {
            return Err(Failure::Broken { barrier, time: t, slack });
        }
        if self.witness.tightest.is_none_or(|least| slack < least.slack) {
            self.witness.tightest = Some(Tightest { barrier, time: t, slack });
        }
        Ok(())
    }

    /// Holds `u` until `end`, or where samples are even and have come to lie elsewhere until the nearest.
    pub(super) fn hold_until(&mut self, u: &[f64], end: f64) -> Result<(), Failure> {
        let Grid { period, even } = self.grid;
        let samples = ((end - self.started) / period + 0.5) as u64;
        let sample = self.started + samples as f64 * period;
        let end = if !even || (sample - end).abs() <= ON_TIME * period { end } else { sample };
        // Time is too large to tell samples apart.
        if end.is_nan() || end <= self.t {
            return Err(Failure::Singular);
        }
        self.hold(u, end)
    }

    /// Holds `u` until `end`.
    fn hold(&mut self, u: &[f64], end: f64) -> Result<(), Failure> {
        // Requirements begin and end at nodes.
        while self.t < end {
            let ahead = self.t + 1e-9 * (end - self.t);
            let event = |node: f64, time: f64| if ahead < time && time < node { time } else { node };
            let node = self.requirements.iter().fold(end, |node, r| event(event(node, r.from), r.until));
            let (begin, steps) = (self.t, self.model.steps(node - self.t));
            for k in 1..=steps {
                let time = if k == steps { node } else { begin + (node - begin) * k as f64 / steps as f64 };
                self.advance(u, time)?;
            }
        }
        let mut input = [0.0; MAX_INPUTS];
        input[..u.len()].copy_from_slice(u);
        if !self.witness.inputs.is_empty() {
            for (i, u) in u.iter().enumerate() {
                let (min, max) = (self.model.bounds.min[i], self.model.bounds.max[i]);
                let part = (u - (max + min) / 2.0).abs() / ((max - min) / 2.0);
                if part.is_finite() {
                    self.witness.effort = self.witness.effort.max(part);
                }
            }
        }
        self.witness.inputs.push((end, input));
        Ok(())
    }

    /// Moves on to the node `time`.
    fn advance(&mut self, u: &[f64], time: f64) -> Result<(), Failure> {
        let (from, dt) = (self.t, time - self.t);
        self.before.copy_from_slice(&self.x);
        self.model.plant.flow(&mut self.x, u, dt);
        if !all_finite(&self.x) {
            return Err(Failure::Singular);
        }
        // In a piece of some round-offs of time there is no rate.
        if dt > 1e-6 * self.model.step {
            for (rate, (x, before)) in self.witness.rates.iter_mut().zip(self.x.iter().zip(&self.before)) {
                *rate = rate.max((x - before).abs() / dt);
            }
        }
        self.t = time;
        for i in 0..self.requirements.len() {
            let requirement = &self.requirements[i];
            if requirement.from > time || requirement.until <= from {
                continue;
            }
            let first = self.at[i];
            self.evaluate(i)?;
            if requirement.is_in_force(from) {
                let least =
                    self.least_between(i, u, [&first, &self.at[i]], (from, dt), &self.before, HALVINGS);
                self.note(i, from, least)?;
            }
        }
        Ok(())
    }

    /// A number that h of requirement `i` does not fall below in the piece from `x` at `from`, `dt` s long.
    fn least_between(
        &self,
        i: usize,
        u: &[f64],
        ends: [&Derivatives; 2],
        (from, dt): (f64, f64),
        x: &[f64],
        halvings: u32,
    ) -> f64 {
        let source = self.requirements[i].source;
        let n = source.relative_degree();
        let derivative = |d: &Derivatives, k: usize| match k < n {
            true => d.drift[k],
            false => d.drift[k] + d.row.iter().zip(u).map(|(a, u)| a * u).sum::<f64>(),
        };
        let margin = self.margin(i);
        let mut middle = (x.to_vec(), Derivatives::ZERO);
        self.model.plant.flow(&mut middle.0, u, dt / 2.0);
        source.evaluate(from + dt / 2.0, &middle.0, &mut middle.1);
        if !middle.1.is_finite() {
            return f64::NEG_INFINITY;
        }
        let points = [ends[0], &middle.1, ends[1]];
        let h = points.map(|d| d.drift[0]);
        let slope = points.map(|d| derivative(d, 1));
        let half = dt / 2.0;
        let least = h[0].min(h[1]).min(h[2]);
        let second = match n {
            1 => 3.0 * (slope[1] - slope[0]).abs().max((slope[2] - slope[1]).abs()) / half,
            _ => {
                let second = points.map(|d| derivative(d, 2));
                let (low, high) =
                    (second[0].min(second[1]).min(second[2]), second[0].max(second[1]).max(second[2]));
                high + (high - low)
            }
        };
        let chord = least - second.max(0.0) * half * half / 8.0;
        // Where a falling tangent and a rising one cross.
        let crossing = |a: usize, b: usize| match slope[a] < 0.0 && slope[b] > 0.0 {
            true => {
                let time = ((h[b] - h[a] - slope[b] * half) / (slope[a] - slope[b])).clamp(0.0, half);
                h[a] + slope[a] * time
            }
            false => least,
        };
        let expected = 0.5 * (h[0] + h[2]) + (slope[0] - slope[2]) * dt / 8.0;
        let bound = chord.min(crossing(0, 1)).min(crossing(1, 2)) - (h[1] - expected).abs();
        if bound >= margin || halvings == 0 || least < margin {
            return bound;
        }
        let part = |ends, from, x: &[f64]| self.least_between(i, u, ends, (from, half), x, halvings - 1);
        let left = part([ends[0], &middle.1], from, x);
        left.min(part([&middle.1, ends[1]], from + half, &middle.0))
    }

    /// Follows the rest of `reference`.
    pub(super) fn follow(&mut self, reference: &Reference) -> Result<(), Failure> {
        let mut u = vec![0.0; self.model.inputs()];
        while let Some(k) = reference.hold_at(self.t, self.grid.slack()) {
            reference.input(&self.model, k, self.t, &self.x, &mut u);
            self.hold_until(&u, reference.times[k + 1])?;
        }
        Ok(())
    }

    /// Holds the input of `reference` here until `end`.
    pub(super) fn follow_until(&mut self, reference: &Reference, end: f64) -> Result<(), Failure> {
        let mut u = vec![0.0; self.model.inputs()];
        let Some(k) = reference.hold_at(self.t, self.grid.slack()) else { return Ok(()) };
        reference.input(&self.model, k, self.t, &self.x, &mut u);
        self.hold_until(&u, end)
    }

    /// Brakes until the plant is at rest where it can stay for ever.
    pub(super) fn stop(mut self, brake: &Brake) -> Result<Witness, Failure> {
        let mut u = vec![0.0; self.model.inputs()];
        let hold = brake.hold.max(self.grid.period);
        for _ in 0..BRAKING {
            let rests = self.is_still(brake, hold, &mut u) && self.rests(hold)?;
            self.hold_until(&u, self.t + hold)?;
            if rests {
                return Ok(self.witness);
            }
        }
        Err(Failure::NoRest)
    }

    /// Whether the plant is at rest here, where it can stay for ever, so that a plan may end.
    pub(super) fn may_end(&mut self, brake: &Brake) -> bool {
        let (mut u, tightest) = (vec![0.0; self.model.inputs()], self.witness.tightest);
        let hold = brake.hold.max(self.grid.period);
        let ends = self.is_still(brake, hold, &mut u) && matches!(self.rests(hold), Ok(true));
        self.witness.tightest = tightest;
        ends
    }

    /// Whether the plant stands still under the input of `brake`, which is written to `u`.
    fn is_still(&self, brake: &Brake, hold: f64, u: &mut [f64]) -> bool {
        brake.input(&self.model, &self.x, u);
        let rate = self.model.rate(&self.x, u, hold);
        rate.iter().enumerate().all(|(i, rate)| {
            rate.abs() <= AT_REST * self.witness.rates[i] + ROUND_OFF * self.x[i].abs() / hold
        })
    }

    /// Whether every set is still, so that a plant at rest here stays in all that are or will be asked for.
    fn rests(&mut self, hold: f64) -> Result<bool, Failure> {
        let length = (self.t - self.started).max(self.model.step);
        for i in 0..self.requirements.len() {
            let requirement = &self.requirements[i];
            if requirement.until <= self.t {
                continue;
            }
            requirement.source.evaluate(self.t, &self.x, &mut self.at[i]);
            let h = self.at[i].drift[0];
            let mut later = Derivatives::ZERO;
            let spans = LATER[0].iter().map(|part| part * length).chain(LATER[1]);
            for span in spans {
                requirement.source.evaluate(self.t + span, &self.x, &mut later);
                if (later.drift[0] - h).abs() > 1e-12 * (1.0 + h.abs()) {
                    return Ok(false);
                }
            }
            if requirement.until == f64::INFINITY || requirement.from > self.t {
                let drift = match requirement.source.relative_degree() {
                    1 => 0.0,
                    _ => self.at[i].drift[1].abs() * DRIFT * hold,
                };
                self.note(i, self.t.max(requirement.from), h - drift)?;
            }
        }
        Ok(true)
    }
}
