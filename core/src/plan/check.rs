//! The exact check: the plant run ahead under a law, with every requirement looked at, between the nodes too.
//!
//! Between two nodes a time σ apart under one input, h lies above its chord by at least −M σ²/8, where M is the largest
//! second derivative there. M is taken from both ends, widened by as much as it differs between them; for n = 1 it is three
//! times the difference quotient of ḣ. Where that is not enough to decide, the piece is halved. So the bound assumes that
//! the second derivative changes no faster between two nodes than the nodes show. That is what the step of the model is
//! chosen for.

use alloc::vec;
use alloc::vec::Vec;

use super::Requirement;
use super::law::{Brake, Reference};
use super::model::Model;
use crate::MAX_INPUTS;
use crate::lie::Derivatives;
use crate::scalar::all_finite;

/// Halvings of a piece whose bound does not decide.
const HALVINGS: u32 = 6;
/// Rate of the state that counts as rest, as a part of the largest on the way and of its size.
const AT_REST: f64 = 1e-6;
/// Most holds of the braking law after a reference.
const BRAKING: usize = 200;
/// Later times, in units of the plan's length, at which a set that does not move has the same h.
const LATER: [f64; 4] = [0.1234, 0.618, 1.7, 3.3];

/// A list of held inputs that meets every requirement, from a state on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Witness {
    /// The end of each hold in s, and its input. The last is held for ever where `until` is infinite.
    pub inputs: Vec<(f64, [f64; MAX_INPUTS])>,
    /// Time in s until which the requirements are known to be met; infinite where the plan ends at rest.
    pub until: f64,
    /// The place on the way where h − margin is least.
    pub tightest: Option<Tightest>,
    /// The largest input on the way after the first hold, as a part of its bounds, 0 to 1.
    pub effort: f64,
}

/// Where h − margin is least.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tightest {
    /// The number of the barrier.
    pub barrier: usize,
    /// Time in s.
    pub time: f64,
    /// h − margin in the unit of h, a bound from below.
    pub slack: f64,
}

/// What keeps a list of inputs from being a witness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Failure {
    /// A requirement is not met.
    Broken {
        /// The number of its barrier.
        barrier: usize,
        /// Time in s.
        time: f64,
        /// h − margin there, < 0.
        slack: f64,
    },
    /// The plant does not come to rest within the horizon, or a set that moves is to be kept after it.
    NoRest,
    /// The model is not finite on the way.
    Singular,
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
    /// The largest rate of each state so far.
    rates: Vec<f64>,
    witness: Witness,
    started: f64,
}

impl<'a> Walk<'a> {
    /// Begins at `t` and `x`, where every requirement in force has to be met with `strictness` times its margin.
    pub(super) fn new(
        model: Model<'a>,
        requirements: &'a [Requirement<'a>],
        strictness: f64,
        t: f64,
        x: &[f64],
    ) -> Result<Self, Failure> {
        let mut walk = Self {
            model,
            requirements,
            strictness,
            t,
            x: x.to_vec(),
            before: x.to_vec(),
            at: vec![Derivatives::ZERO; requirements.len()],
            rates: vec![0.0; x.len()],
            witness: Witness { until: f64::INFINITY, ..Witness::default() },
            started: t,
        };
        for i in 0..requirements.len() {
            walk.evaluate(i)?;
        }
        Ok(walk)
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

    /// Holds `u` for `duration` s.
    pub(super) fn hold(&mut self, u: &[f64], duration: f64) -> Result<(), Failure> {
        let end = self.t + duration;
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
        for (rate, (x, before)) in self.rates.iter_mut().zip(self.x.iter().zip(&self.before)) {
            *rate = rate.max((x - before).abs() / dt);
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
        let least = ends[0].drift[0].min(ends[1].drift[0]);
        let second = match n {
            1 => 3.0 * (derivative(ends[1], 1) - derivative(ends[0], 1)).abs() / dt,
            _ => {
                let [a, b] = ends.map(|d| derivative(d, 2));
                a.max(b) + (a - b).abs()
            }
        };
        let bound = least - second.max(0.0) * dt * dt / 8.0;
        if bound >= self.margin(i) || halvings == 0 || least < self.margin(i) {
            return bound;
        }
        let mut middle = (x.to_vec(), Derivatives::ZERO);
        self.model.plant.flow(&mut middle.0, u, dt / 2.0);
        source.evaluate(from + dt / 2.0, &middle.0, &mut middle.1);
        if !middle.1.is_finite() {
            return f64::NEG_INFINITY;
        }
        let half = |ends, from, x: &[f64]| self.least_between(i, u, ends, (from, dt / 2.0), x, halvings - 1);
        let left = half([ends[0], &middle.1], from, x);
        left.min(half([&middle.1, ends[1]], from + dt / 2.0, &middle.0))
    }

    /// Follows the rest of `reference`.
    pub(super) fn follow(&mut self, reference: &Reference) -> Result<(), Failure> {
        let mut u = vec![0.0; self.model.inputs()];
        while let Some(k) = reference.hold_at(self.t) {
            reference.input(&self.model, k, self.t, &self.x, &mut u);
            self.hold(&u, reference.times[k + 1] - self.t)?;
        }
        Ok(())
    }

    /// Brakes until the plant is at rest where it can stay for ever, or until `horizon` (s) where sets move.
    pub(super) fn stop(mut self, brake: &Brake, horizon: f64) -> Result<Witness, Failure> {
        let mut u = vec![0.0; self.model.inputs()];
        for _ in 0..BRAKING {
            brake.input(&self.model, &self.x, &mut u);
            let rate = self.model.rate(&self.x, &u, brake.hold);
            let still = |(i, rate): (usize, &f64)| {
                rate.abs() * brake.hold
                    <= AT_REST * (self.rates[i] * brake.hold).max(1e-3 * (1.0 + self.x[i].abs()))
            };
            if rate.iter().enumerate().all(still) && self.rests()? {
                self.hold(&u, brake.hold)?;
                return Ok(self.witness);
            }
            if self.t >= horizon && self.requirements.iter().all(|r| r.from <= self.t) {
                self.witness.until = self.t;
                return Ok(self.witness);
            }
            self.hold(&u, brake.hold)?;
        }
        Err(Failure::NoRest)
    }

    /// Whether every set is still, so that a plant at rest here stays in all that are or will be asked for.
    fn rests(&mut self) -> Result<bool, Failure> {
        let length = (self.t - self.started).max(self.model.step);
        for i in 0..self.requirements.len() {
            let requirement = &self.requirements[i];
            if requirement.until <= self.t {
                continue;
            }
            requirement.source.evaluate(self.t, &self.x, &mut self.at[i]);
            let h = self.at[i].drift[0];
            let mut later = Derivatives::ZERO;
            for part in LATER {
                requirement.source.evaluate(self.t + part * length, &self.x, &mut later);
                if (later.drift[0] - h).abs() > 1e-12 * (1.0 + h.abs()) {
                    return Ok(false);
                }
            }
            if requirement.until == f64::INFINITY || requirement.from > self.t {
                self.note(i, self.t.max(requirement.from), h)?;
            }
        }
        Ok(true)
    }
}
