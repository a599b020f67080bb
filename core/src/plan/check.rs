//! The exact check: the plant run ahead under a law, with every requirement looked at, between the nodes too.
//!
//! Under one input, state and h are followed by their Taylor [courses](crate::lie::Course) in pieces. A piece ends where the
//! last terms of a state no longer vanish, and is halved until the course of every state is a solution on all of it: by
//! [enclosures](crate::interval) of the plant's rate there. Where a source has none, in its middle and at its end, and it is
//! assumed that what bends the plant shows there.
//!
//! On a piece h has a lower bound: the least Bernstein coefficient of its course, which none of its values falls below,
//! less its last terms and less four times what the course misses h by at four instants. What bends h between them shows in
//! enclosures: of h on the piece, or of the last coefficient of a course that begins anywhere on it, which by Taylor's theorem
//! is all that the others leave open. Where these do not decide, the piece is halved for this h. Where a source has no
//! enclosures, it is assumed that h bends as those instants show.

use alloc::vec;
use alloc::vec::Vec;

use super::course::{self, at, shifted};
pub(super) use super::failure::Failure;
use super::law::{Brake, Reference};
use super::model::{Model, differences, largest_eigenvalue};
use super::{Integral, Requirement};
use crate::MAX_INPUTS;
use crate::interval::Interval;
use crate::lie::{COURSE, Course, CourseOver, FEW_ORDERS, RateOver};
use crate::scalar::all_finite;

/// Most pieces of a roll-out.
const MOST_PIECES: u32 = 100_000;
/// The last terms of a state's course at the end of a piece, as a part of its size.
const TRUNCATED: f64 = 1e-10;
/// By how much the course of a state may miss being a solution over the piece, as a part of its change there and beside 1.
const RESIDUAL: f64 = 1e-8;
/// Coefficients of the rate of the states that bound this: first few, then all.
const ORDERS: [usize; 2] = [FEW_ORDERS, COURSE - 1];
/// How much longer than a piece that has been halved the next may be. The one after that by the square of it, and so on.
const LONGER: f64 = 1.2;
/// The margin at the edge of a set, in units of that inside: what round-off may miss.
const EDGE: f64 = -1e-6;
/// Halvings of a piece whose bound does not decide, and of those the ones that may only make it sharper.
const HALVINGS: u32 = 14;
const SHARPER: u32 = 3;
/// The bound of a piece that is sharp enough, as a part of the least value seen.
const SHARP: f64 = 0.8;
/// Instants of a piece at which its course is compared with h, and what a difference there counts for between them.
const INSTANTS: u32 = 4;
const MISSED: f64 = 4.0;
/// Rate of the state that counts as rest, as a part of the largest on the way.
const AT_REST: f64 = 1e-6;
/// Change of a state over a hold that is round-off, as a part of its size.
pub(super) const ROUND_OFF: f64 = 16.0 * f64::EPSILON;
/// How many times a deviation may grow on the way of a plan, and of one that was accepted before: what it begins with is what the
/// courses of the states miss, far more than round-off.
const SPREADS: [f64; 2] = [1e4, 1e6];
/// Part of a state's size by which the plant is moved to see how a deviation grows. That size is 1, the way from where the walk began,
/// and this part of the state itself: far from the origin a deviation is more than round-off, and a place no other place.
const ASIDE: f64 = 1e-6;
const FAR: f64 = 1e-6;
/// The last term of a step along which the plant that was moved is followed, as a part of the deviation: (λτ)⁴/4 of a mode that
/// grows with λ. And the shortest step, as a part of a piece.
const BENT: f64 = 0.25;
const SHORTEST: f64 = 1e-3;
/// Each stage of Runge and Kutta: where in the step it is, what it counts, and what it counts in the bend.
const STAGES: [(f64, f64, f64); 4] =
    [(0.0, 1.0 / 6.0, 1.0), (0.5, 1.0 / 3.0, 0.0), (0.5, 1.0 / 3.0, -2.0), (1.0, 1.0 / 6.0, 1.0)];
/// Number of holds for which a drift at rest has to leave every set where it is.
const DRIFT: f64 = 1e3;
/// Difference of a sample from its time that counts as none, as a part of the period. Round-off of times is another.
pub(crate) const ON_TIME: f64 = 1e-6;
/// Holds of the braking law in which what is left at a rest is followed.
const SETTLING: usize = 128;
/// Halvings of the way of the states that is left at a rest, on which h is enclosed.
const WAY_HALVINGS: u32 = 6;
/// Instants of that way at which the plant has to rest, and h is looked at otherwise.
const WAY_INSTANTS: u32 = 32;
/// What h changes by in one of them for that to be round-off, as a part of what it is made of.
const SETTLED: f64 = 64.0 * f64::EPSILON;
/// Part of a state's size by which it is moved to see whether a deviation from a rest grows, and by what part of it that may in
/// all the time that is promised.
const BESIDE: f64 = 1e-5;
const GROWS: f64 = 0.1;
/// Most pieces in which a hold of the braking law at a rest is followed, and the part of one that a kink is passed in.
const CREPT: u32 = 1000;
const KINK: f64 = 1.0 / 16.0;
/// The time in s for which what does not die away has to leave every set where it is.
const LONG: f64 = 1e5;
/// Most holds of the braking law after a reference.
const BRAKING: usize = 200;
/// Later times at which a set that does not move has the same h: in units of the plan's length, and in s.
const LATER: [[f64; 4]; 2] = [[0.1234, 0.618, 1.7, 3.3], [3.7, 61.7, 1013.0, 86413.0]];

/// A list of held inputs that meets every requirement, from a state on.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Witness {
    /// The end of each hold in s, and its input. The last is held for ever where the plant is at rest under it.
    pub inputs: Vec<(f64, [f64; MAX_INPUTS])>,
    /// The time in s until which every requirement is met: infinite where the plan ends at rest, else its end.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub until: f64,
    /// The place on the way where h − margin is least.
    pub tightest: Option<Tightest>,
    /// The largest rate of each state on the way, and on the way of the plan before it: what rest is small against. It never
    /// falls, so what was a rest stays one.
    pub(super) rates: Vec<f64>,
    /// The largest input on the way after the first hold, as a part of its bounds, 0 to 1.
    pub effort: f64,
    /// Whether its holds end at samples in the period of the first.
    pub(crate) is_even: bool,
    /// The pieces of its walk.
    pub(super) pieces: u32,
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
    /// The courses of the states from here on, a state on them and its rate.
    path: Vec<Course>,
    point: Vec<f64>,
    rate: Vec<f64>,
    /// Enclosures of those courses and of the rate on a piece.
    over: Vec<CourseOver>,
    rate_over: Vec<RateOver>,
    /// The courses beside those of the states.
    beside: Vec<Course>,
    pieces: u32,
    /// The most of them.
    pub(super) most_pieces: u32,
    /// The longest piece in s to try, and how much longer the next one may be.
    longest: f64,
    growth: f64,
    aside: Aside,
    witness: Witness,
    started: f64,
    grid: Grid,
}

/// A plant beside that of a roll-out, under the same law.
struct Aside {
    /// The state where the walk began.
    origin: Vec<f64>,
    /// By how much its state and its input differ.
    x: Vec<f64>,
    u: [f64; MAX_INPUTS],
    /// Room for a step: slopes of the difference, their mean, and the first less twice the third and the last.
    slope: Vec<f64>,
    mean: Vec<f64>,
    bend: Vec<f64>,
    /// How many times the difference has grown since some instant, at most.
    grown: f64,
}

impl Aside {
    /// Beside `x`, in a direction that is none of an axis.
    fn new(x: &[f64]) -> Self {
        Self {
            origin: x.to_vec(),
            x: away(x, x).collect(),
            u: [0.0; MAX_INPUTS],
            slope: x.to_vec(),
            mean: x.to_vec(),
            bend: x.to_vec(),
            grown: 1.0,
        }
    }

    /// Notes by how much the difference has grown, at `x`, and makes it as small again. Returns that growth.
    fn note(&mut self, x: &[f64]) -> f64 {
        let ratio = part(&self.x, x, &self.origin) / ASIDE;
        self.grown = (self.grown * ratio).max(1.0);
        match ratio > 0.0 && ratio < f64::INFINITY {
            true => self.x.iter_mut().for_each(|d| *d /= ratio),
            // What is no number shows in the states soon enough.
            false => self.x = away(x, &self.origin).collect(),
        }
        self.grown
    }
}

/// A deviation from `x` in a direction that is none of an axis.
fn away(x: &[f64], origin: &[f64]) -> impl Iterator<Item = f64> {
    let sizes = x.iter().zip(origin).map(|(x, origin)| size_beside(*x, *origin));
    (0_u32..).zip(sizes).map(|(i, size)| (1.0 - 2.0 * f64::from(i % 2)) * ASIDE * size / f64::from(1 + i))
}

/// The largest part of a state's size that a change `d` of it is, at `x`.
fn part(d: &[f64], x: &[f64], origin: &[f64]) -> f64 {
    let parts = d.iter().zip(x.iter().zip(origin)).map(|(d, (x, origin))| d.abs() / size_beside(*x, *origin));
    parts.fold(0.0, f64::max)
}

/// What a deviation is small against.
fn size_beside(x: f64, origin: f64) -> f64 {
    1.0 + (x - origin).abs() + FAR * x.abs()
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
        let mut walk = Self {
            model,
            requirements,
            strictness,
            t,
            x: x.to_vec(),
            path: vec![[0.0; COURSE]; x.len()],
            point: x.to_vec(),
            rate: x.to_vec(),
            over: Vec::with_capacity(x.len()),
            rate_over: vec![[Interval::ALL; COURSE - 1]; x.len()],
            beside: vec![[0.0; COURSE]; x.len()],
            pieces: 0,
            most_pieces: MOST_PIECES,
            longest: f64::INFINITY,
            growth: LONGER,
            aside: Aside::new(x),
            witness: Witness { rates: vec![0.0; x.len()], is_even: grid.even, ..Witness::default() },
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

    /// Takes over the rates of the plan before.
    pub(super) fn after(mut self, before: &Witness) -> Self {
        for (rate, before) in self.witness.rates.iter_mut().zip(&before.rates) {
            *rate = rate.max(*before);
        }
        self
    }

    /// The least value of requirement `i`. With less strictness the reserve may be used up.
    fn least_of(&self, i: usize) -> f64 {
        let is_new = self.strictness >= 1.0 && self.is_firm(i);
        let reserve = if is_new { self.requirements[i].reserve } else { f64::NEG_INFINITY };
        self.margin(i).max(reserve)
    }

    fn margin(&self, i: usize) -> f64 {
        self.strictness * self.requirements[i].margin * if self.is_firm(i) { 1.0 } else { EDGE }
    }

    /// Whether the margin of requirement `i` has to be there.
    fn is_firm(&self, i: usize) -> bool {
        self.t >= self.requirements[i].firm
    }

    /// Notes that h of requirement `i` is at least `h` around `t`.
    fn note(&mut self, i: usize, t: f64, h: f64) -> Result<(), Failure> {
        let (barrier, missing) = (self.requirements[i].barrier, h - self.least_of(i));
        // Not-a-number is broken too.
        if missing.is_nan() || missing < 0.0 {
            return Err(Failure::Broken { barrier, time: t, slack: missing });
        }
        let slack = h - self.margin(i);
        let counts = !self.requirements[i].is_limit;
        if counts && self.witness.tightest.is_none_or(|least| slack < least.slack) {
            self.witness.tightest = Some(Tightest { barrier, time: t, slack });
        }
        Ok(())
    }

    /// Holds the input that `law` has here until `end`, or where samples are even and have come to lie elsewhere until the nearest.
    fn hold_under(&mut self, law: impl Fn(&[f64], &mut [f64]), end: f64) -> Result<(), Failure> {
        let m = self.model.inputs();
        let (mut u, mut beside) = ([0.0; MAX_INPUTS], [0.0; MAX_INPUTS]);
        law(&self.x, &mut u[..m]);
        for (point, (x, d)) in self.point.iter_mut().zip(self.x.iter().zip(&self.aside.x)) {
            *point = x + d;
        }
        law(&self.point, &mut beside[..m]);
        self.aside.u = core::array::from_fn(|i| beside[i] - u[i]);
        self.hold_until_sample(&u[..m], end)?;
        let most = match self.strictness {
            s if s >= 1.0 => SPREADS[0],
            s if s > 0.0 => SPREADS[1],
            _ => f64::INFINITY,
        };
        if self.aside.note(&self.x) <= most { Ok(()) } else { Err(Failure::Unsteady) }
    }

    /// The same of `u`, whatever the state is.
    pub(super) fn hold_until(&mut self, u: &[f64], end: f64) -> Result<(), Failure> {
        self.hold_under(|_, held| held.copy_from_slice(u), end)
    }

    /// Holds `u` until `end` or the nearest sample, and notes it.
    fn hold_until_sample(&mut self, u: &[f64], end: f64) -> Result<(), Failure> {
        let Grid { period, even } = self.grid;
        let samples = ((end - self.started) / period + 0.5) as u64;
        let sample = self.started + samples as f64 * period;
        let end = if !even || (sample - end).abs() <= ON_TIME * period { end } else { sample };
        // Time is too large to tell samples apart.
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
        if !self.witness.inputs.is_empty() {
            self.witness.effort = self.witness.effort.max(self.model.bounds.part(u));
        }
        self.witness.inputs.push((end, input));
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
        let aside_rate = core::mem::take(&mut self.aside.u[input]);
        self.witness.rates[state] = self.witness.rates[state].max(rate.abs());
        let period = self.grid.period;
        while self.t < end {
            // The next sample; one that is here but for round-off has passed.
            let passed = ((self.t - self.started) / period + 1e-6) as u64;
            let sample = self.started + (passed + 1) as f64 * period;
            let sample = if sample < end - 1e-6 * period { sample } else { end };
            let (from, to) = (self.x[state], self.x[state] + rate * (sample - self.t));
            let aside = 0.5 * (aside_rate * (sample - self.t));
            self.x[state] = 0.5 * (from + to);
            self.aside.x[state] += aside;
            self.move_to(&held, sample)?;
            self.aside.x[state] += aside;
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

    /// Moves on by a piece, to `node` at most.
    fn advance(&mut self, u: &[f64], node: f64) -> Result<(), Failure> {
        self.pieces += 1;
        self.witness.pieces = self.pieces;
        if self.pieces > self.most_pieces {
            return Err(Failure::TooLong);
        }
        self.model.plant.path(&self.x, u, &mut self.path);
        if !all_finite(self.path.as_flattened()) {
            return Err(Failure::Singular);
        }
        let whole = node - self.t;
        let mut dt = self.path.iter().fold(whole, |dt, c| course::reach(c, TRUNCATED * size(c), dt));
        // Bends that have cut the piece before short are there still.
        dt = dt.min(self.longest);
        while !self.is_solution(u, dt) {
            dt *= 0.5;
            (self.longest, self.growth) = (dt, LONGER);
            if self.t + dt <= self.t {
                return Err(Failure::Singular);
            }
        }
        if !self.is_smooth_beside(u) {
            return Err(Failure::Singular);
        }
        self.longest *= self.growth;
        self.growth *= self.growth;
        let end = if dt < whole { self.t + dt } else { node };
        // At a time so large that a piece is within its round-off.
        if end <= self.t {
            return Err(Failure::TooLong);
        }
        for (greatest, c) in self.witness.rates.iter_mut().zip(&self.path) {
            *greatest = greatest.max(c[1].abs()).max(course::slope(c, dt).abs());
        }
        let (from, path, over) = (self.t, core::mem::take(&mut self.path), core::mem::take(&mut self.over));
        let mut in_force = (0..self.requirements.len()).filter(|i| self.requirements[*i].is_in_force(from));
        let met = in_force.try_for_each(|i| {
            let least = self.least(i, (&path, &over), (from, dt), HALVINGS);
            self.note(i, from, least)
        });
        // What has failed is not followed further.
        if met.is_ok() {
            self.move_aside(u, &path, dt);
        }
        for (x, c) in self.x.iter_mut().zip(&path) {
            *x = at(c, dt);
        }
        (self.t, self.path, self.over) = (end, path, over);
        met
    }

    /// Moves the plant aside on by `dt` s, as that on `path` under `u` is: the difference of the two in steps of Runge and Kutta.
    fn move_aside(&mut self, u: &[f64], path: &[Course], dt: f64) {
        let Aside { origin, x: aside, u: more, slope, mean, bend, .. } = &mut self.aside;
        let held: [f64; MAX_INPUTS] = core::array::from_fn(|i| u.get(i).map_or(0.0, |u| u + more[i]));
        let (mut from, mut step) = (0.0, dt);
        while from < dt {
            step = step.min(dt - from);
            slope.fill(0.0);
            mean.fill(0.0);
            bend.fill(0.0);
            for (part, weight, bends) in STAGES {
                let after = from + part * step;
                for (i, point) in self.point.iter_mut().enumerate() {
                    *point = at(&path[i], after) + aside[i] + part * step * slope[i];
                }
                self.model.plant.rate(&self.point, &held[..u.len()], &mut self.rate);
                for (i, rate) in self.rate.iter().enumerate() {
                    slope[i] = rate - course::slope(&path[i], after);
                    mean[i] += weight * slope[i];
                    bend[i] += bends * slope[i];
                }
            }
            let part = |d: &[f64]| part(d, &self.x, origin);
            if step * part(bend) > BENT * part(aside) && step > SHORTEST * dt {
                step *= 0.5;
                continue;
            }
            for (d, mean) in aside.iter_mut().zip(&*mean) {
                *d += step * mean;
            }
            from = if step < dt - from { from + step } else { dt };
            step *= 2.0;
        }
    }

    /// Whether the courses of the states are a solution until `dt` s after their begin. Leaves what encloses them.
    fn is_solution(&mut self, u: &[f64], dt: f64) -> bool {
        let plant = self.model.plant;
        self.over.clear();
        self.over.extend(self.path.iter().map(|c| course::over(c, dt)));
        // Not-a-number is not small.
        let is_small = |missed: f64, over: &CourseOver| missed * dt <= allowed(over[0]);
        for orders in ORDERS {
            if !plant.rates_over(&self.over, u, orders, &mut self.rate_over) {
                return [0.5 * dt, dt].into_iter().all(|after| {
                    self.miss(u, after);
                    self.rate.iter().zip(&self.over).all(|(missed, over)| is_small(*missed, over))
                });
            }
            let mut rates = self.rate_over.iter().zip(&self.over);
            if rates.all(|(rate, over)| is_small(course::missed(&rate[..orders], over, dt), over)) {
                return true;
            }
        }
        false
    }

    /// Whether the plant has a course beside its state too, in one of four directions, by as much as that which is moved: where a
    /// tank runs dry its rate has an infinite slope, and no course tells what comes after. A piece that ends near such a place
    /// was cut short before it.
    fn is_smooth_beside(&mut self, u: &[f64]) -> bool {
        if self.longest == f64::INFINITY || self.strictness <= 0.0 {
            return true;
        }
        for (i, (point, x)) in (0_u32..).zip(self.point.iter_mut().zip(&self.x)) {
            let sign = if (self.pieces + i * (self.pieces / 2)).is_multiple_of(2) { 1.0 } else { -1.0 };
            *point = x + sign * self.strictness * ASIDE * size_beside(*x, self.aside.origin[i as usize]);
        }
        self.model.plant.path(&self.point, u, &mut self.beside);
        all_finite(self.beside.as_flattened())
    }

    /// Writes what the course of each state misses its rate by `after` s after its begin to `rate`.
    fn miss(&mut self, u: &[f64], after: f64) {
        for (x, c) in self.point.iter_mut().zip(&self.path) {
            *x = at(c, after);
        }
        self.model.plant.rate(&self.point, u, &mut self.rate);
        for (rate, c) in self.rate.iter_mut().zip(&self.path) {
            *rate = (course::slope(c, after) - *rate).abs();
        }
    }

    /// A number that h of requirement `i` does not fall below along the first `dt` s of `path`, which begins at `from` and is
    /// enclosed by `over`.
    fn least(
        &mut self,
        i: usize,
        (path, over): (&[Course], &[CourseOver]),
        (from, dt): (f64, f64),
        halvings: u32,
    ) -> f64 {
        let (model, margin, needed) = (self.requirements[i].model, self.margin(i), self.least_of(i));
        let tightest = self.witness.tightest.map_or(f64::INFINITY, |tightest| tightest.slack);
        // Far from its edge no more need be known.
        let time = Interval::new(from, from + dt);
        let lowest = model.value_over(time, over).map(|h| h.low);
        if let Some(low) = lowest.filter(|low| *low >= needed && low - margin >= tightest) {
            return low;
        }
        let mut h = [0.0; COURSE];
        model.value_along(from, path, &mut h);
        let (mut least, mut missed) = (h[0], 0.0_f64);
        for k in 1..=INSTANTS {
            let after = dt * f64::from(k) / f64::from(INSTANTS);
            for (x, c) in self.point.iter_mut().zip(path) {
                *x = at(c, after);
            }
            let value = model.value(from + after, &self.point);
            if !value.is_finite() {
                return f64::NEG_INFINITY;
            }
            (least, missed) = (least.min(value), missed.max((value - at(&h, after)).abs()));
        }
        let bound = course::least(&h, dt) - course::last_terms(&h, dt) - MISSED * missed;
        let slack = bound - margin;
        let is_sharp =
            slack >= tightest || slack >= SHARP * (least - margin) || halvings + SHARPER <= HALVINGS;
        if least < needed {
            // By what is missing, and not by what a long piece leaves open.
            return least;
        }
        if bound >= needed && is_sharp || halvings == 0 {
            // Whatever bends h between these instants: by what it takes on the piece, or by Taylor's theorem.
            let enclosed = lowest.filter(|low| *low < needed).map_or(f64::INFINITY, |low| {
                h[COURSE - 1] = model.last_over(time, over).map_or(f64::NEG_INFINITY, |last| last.low);
                low.max(course::least(&h, dt))
            });
            if enclosed >= needed || halvings == 0 {
                return bound.min(least).min(enclosed);
            }
        }
        // A half is as much work as a piece.
        self.pieces += 1;
        if self.pieces > self.most_pieces {
            return f64::NEG_INFINITY;
        }
        let half = 0.5 * dt;
        let enclosed = |path: &[Course]| path.iter().map(|c| course::over(c, half)).collect::<Vec<_>>();
        let left = self.least(i, (path, &enclosed(path)), (from, half), halvings - 1);
        if left < needed {
            return left;
        }
        let path: Vec<Course> = path.iter().map(|c| shifted(c, half)).collect();
        left.min(self.least(i, (&path, &enclosed(&path)), (from + half, half), halvings - 1))
    }

    /// Follows the rest of `reference`.
    pub(super) fn follow(&mut self, reference: &Reference) -> Result<(), Failure> {
        while let Some(k) = reference.hold_at(self.t, self.grid.slack()) {
            let (model, t) = (self.model, self.t);
            self.hold_under(|x, u| reference.input(&model, k, t, x, u), reference.times[k + 1])?;
        }
        Ok(())
    }

    /// Holds the input of `reference` here until `end`.
    pub(super) fn follow_until(&mut self, reference: &Reference, end: f64) -> Result<(), Failure> {
        let Some(k) = reference.hold_at(self.t, self.grid.slack()) else { return Ok(()) };
        let (model, t) = (self.model, self.t);
        self.hold_under(|x, u| reference.input(&model, k, t, x, u), end)
    }

    /// Brakes until the plant is at rest where it can stay for ever.
    pub(super) fn stop(mut self, brake: &Brake) -> Result<Witness, Failure> {
        let mut u = vec![0.0; self.model.inputs()];
        let hold = brake.hold.max(self.grid.period);
        let (mut failure, mut due, mut wait) = (Failure::NoRest, 0, 1);
        for k in 0..BRAKING {
            // Followed far ahead is what stands still, and where it did not stay not again at every hold.
            let rest = match self.is_still(brake, hold, &mut u) && (k >= due || k + 1 == BRAKING) {
                true => {
                    (due, wait) = (k + wait, 2 * wait);
                    self.stays(brake, hold, &u)
                }
                false => Ok(false),
            };
            let model = self.model;
            self.hold_under(|x, u| brake.input(&model, x, u), self.t + hold)?;
            match rest {
                Ok(true) => return Ok(Witness { until: f64::INFINITY, ..self.witness }),
                Ok(false) => {}
                // What still drifts out may do so no longer a hold later.
                Err(drifts_out) => failure = drifts_out,
            }
        }
        Err(failure)
    }

    /// Ends where `reference` does, without a rest, if that was still ahead. Its last input is held until then where samples
    /// lie beside its own.
    pub(super) fn end(mut self, reference: &Reference) -> Result<Witness, Failure> {
        let (Some(&until), slack) = (reference.times.last(), self.grid.slack()) else {
            return Err(Failure::NoRest);
        };
        if self.started >= until - slack || self.t < until - slack {
            return Err(Failure::NoRest);
        }
        if self.t < until
            && let Some((_, u)) = self.witness.inputs.pop()
        {
            self.hold(&u[..self.model.inputs()], until)?;
        }
        Ok(Witness { until, ..self.witness })
    }

    /// Whether the plant is at rest here, where it can stay for ever, so that a plan may end.
    pub(super) fn may_end(&mut self, brake: &Brake) -> bool {
        let (mut u, tightest) = (vec![0.0; self.model.inputs()], self.witness.tightest);
        let hold = brake.hold.max(self.grid.period);
        let ends = self.is_still(brake, hold, &mut u) && matches!(self.stays(brake, hold, &u), Ok(true));
        self.witness.tightest = tightest;
        ends
    }

    /// Whether the plant that stands still under `u`, the input of `brake`, can stay here for ever. Notes what is tightest there.
    fn stays(&mut self, brake: &Brake, hold: f64, u: &[f64]) -> Result<bool, Failure> {
        // Not at the edge of a set, where a margin has to be there later.
        if !(0..self.requirements.len()).all(|i| self.is_firm(i)) {
            return Ok(false);
        }
        let tightest = self.witness.tightest;
        let stays = self.rests(u, hold).map(|rests| rests && self.settles(brake, hold));
        if !matches!(stays, Ok(true)) {
            self.witness.tightest = tightest;
        }
        stays
    }

    /// Whether the plant stands still here under the input of `brake`, which is written to `u`.
    fn is_still(&mut self, brake: &Brake, hold: f64, u: &mut [f64]) -> bool {
        self.point.copy_from_slice(&self.x);
        self.is_still_at_point(brake, hold, u)
    }

    /// The same at the state in `point`.
    fn is_still_at_point(&mut self, brake: &Brake, hold: f64, u: &mut [f64]) -> bool {
        brake.input(&self.model, &self.point, u);
        self.model.plant.rate(&self.point, u, &mut self.rate);
        let small = |i: usize| AT_REST * self.witness.rates[i] + ROUND_OFF * self.point[i].abs() / hold;
        self.rate.iter().enumerate().all(|(i, rate)| rate.abs() <= small(i))
    }

    /// Whether a plant at rest here stays in all sets though it may creep on under the braking law.
    fn settles(&mut self, brake: &Brake, hold: f64) -> bool {
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
        for holds in 1..=SETTLING {
            brake.input(&self.model, &x, &mut u);
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
            // The rest of a plan is asked for half as long, so that time may pass.
            let windows = |i: usize| {
                let time = (self.requirements[i].until - self.t).min(LONG * self.strictness);
                time / (hold * window as f64)
            };
            let stays = seen.iter().all(|(i, seen)| {
                let least = seen.iter().copied().fold(f64::INFINITY, f64::min);
                let motion = Motion::of(last(&|k| seen[k]), SETTLED * (size + least.abs()));
                motion.is_some_and(|motion| least - motion.to_come(windows(*i)) >= self.least_of(*i))
            });
            if !stays {
                continue;
            }
            // What bends h further on the way of the states has not shown yet, nor what a state does that gathers pace.
            let ahead = |j: usize| {
                let motion = Motion::of(last(&|k| states[k][j]), SETTLED * (size + x[j].abs()));
                motion.map(|motion| (x[j], motion))
            };
            let Some(ahead) = (0..x.len()).map(ahead).collect::<Option<Vec<_>>>() else { continue };
            let longest = seen.iter().map(|(i, _)| windows(*i)).fold(0.0, f64::max);
            if seen.iter().all(|(i, _)| self.stays_ahead(*i, &ahead, windows(*i)))
                && self.rests_ahead(brake, hold, &ahead, longest)
            {
                let holds = longest * window as f64;
                return (self.growth(brake, hold, &x) - 1.0) * holds <= GROWS;
            }
        }
        false
    }

    /// How many times a deviation from the rest at `x` grows over a hold of the braking law: the largest eigenvalue.
    fn growth(&mut self, brake: &Brake, hold: f64, x: &[f64]) -> f64 {
        let mut u = vec![0.0; self.model.inputs()];
        let moved = differences(x, BESIDE, x.len(), |x| {
            brake.input(&self.model, x, &mut u);
            self.creep(x, &u, hold);
        });
        largest_eigenvalue(&moved)
    }

    /// Moves `x` on by `duration` s under `u`, of which an integral counts with its mean.
    pub(super) fn run(&mut self, x: &mut [f64], u: &[f64], duration: f64) {
        let Some(Integral { state, input }) = self.model.integral else { return self.creep(x, u, duration) };
        let mut held = u.to_vec();
        let change = core::mem::take(&mut held[input]) * duration;
        let end = x[state] + change;
        x[state] += 0.5 * change;
        self.creep(x, &held, duration);
        x[state] = end;
    }

    /// Moves `x` on by `duration` s under `u`, to round-off: by courses of the states, past a kink that breaks them in a step of
    /// the model.
    fn creep(&mut self, x: &mut [f64], u: &[f64], duration: f64) {
        let (plant, mut left) = (self.model.plant, duration);
        for _ in 0..CREPT {
            plant.path(x, u, &mut self.path);
            // However fast something dies away, its course is as short as that.
            let smooth = self.path.iter().fold(left, |dt, c| course::reach(c, ROUND_OFF * size(c), dt));
            let mut dt = smooth;
            let is_followed = loop {
                self.miss(u, dt);
                let mut missed = self.rate.iter().zip(&self.path);
                if missed.all(|(missed, c)| missed * dt <= SETTLED * size(c)) {
                    break true;
                }
                if dt <= KINK * smooth {
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

    /// Whether requirement `i` is met as the states move on, for so many windows of time: each from where it is by its motion.
    /// Of a set that moves, and of a source without enclosures, at instants.
    fn stays_ahead(&self, i: usize, ahead: &[(f64, Motion)], windows: f64) -> bool {
        let Requirement { model, from, .. } = self.requirements[i];
        let begin = self.t.max(from);
        let is_met = |x: Vec<f64>| {
            let h = model.lowest_from(begin, &x).unwrap_or_else(|| model.value(begin, &x));
            h >= self.least_of(i)
        };
        match model.is_still(&self.x) {
            Some(true) => self.encloses(i, ahead, [0.0, windows], WAY_HALVINGS),
            _ => way(ahead, windows).all(is_met),
        }
    }

    /// The same by enclosures of h, from so many windows on until as many.
    fn encloses(&self, i: usize, ahead: &[(f64, Motion)], [from, to]: [f64; 2], halvings: u32) -> bool {
        let over = ahead.iter().map(|(x, motion)| {
            let mut over = [Interval::ALL; COURSE];
            over[0] = motion.over(*x, [from, to]);
            over
        });
        // A set that does not move where the plant is now may do so farther on: at all times.
        let h = self.requirements[i].model.value_over(Interval::ALL, &over.collect::<Vec<_>>());
        // Not-a-number is not large enough.
        if h.is_some_and(|h| h.low >= self.least_of(i)) {
            return true;
        }
        let middle = 0.5 * (from + to);
        let parts = [[from, middle], [middle, to]];
        halvings > 0 && parts.into_iter().all(|part| self.encloses(i, ahead, part, halvings - 1))
    }

    /// Whether the plant still rests under the input of `brake` as the states move on: a force that grows on their way has not
    /// shown yet.
    fn rests_ahead(&mut self, brake: &Brake, hold: f64, ahead: &[(f64, Motion)], windows: f64) -> bool {
        let mut u = vec![0.0; self.model.inputs()];
        way(ahead, windows).all(|x| {
            self.point.copy_from_slice(&x);
            self.is_still_at_point(brake, hold, &mut u)
        })
    }

    /// Whether a plant at rest here stays in all sets that are or will be asked for: they are still, or it is known how near
    /// they come.
    fn rests(&mut self, u: &[f64], hold: f64) -> Result<bool, Failure> {
        let length = (self.t - self.started).max(self.grid.period);
        self.model.plant.path(&self.x, u, &mut self.path);
        for i in 0..self.requirements.len() {
            let requirement = &self.requirements[i];
            if requirement.until <= self.t {
                continue;
            }
            let h = requirement.model.value(self.t, &self.x);
            let mut spans = LATER[0].iter().map(|part| part * length).chain(LATER[1]);
            let moves = spans.any(|span| {
                let later = requirement.model.value(self.t + span, &self.x);
                (later - h).abs() > 1e-12 * (1.0 + h.abs())
            });
            if moves || requirement.model.is_still(&self.x) == Some(false) {
                let begin = self.t.max(requirement.from);
                for (x, c) in self.point.iter_mut().zip(&self.path) {
                    *x = c[0] + c[1] * DRIFT * hold;
                }
                let lowest = |x: &[f64]| requirement.model.lowest_from(begin, x);
                let (Some(here), Some(there)) = (lowest(&self.x), lowest(&self.point)) else {
                    return Ok(false);
                };
                self.note(i, begin, here.min(there))?;
                continue;
            }
            let mut course = [0.0; COURSE];
            requirement.model.value_along(self.t, &self.path, &mut course);
            let drift = course[1].abs() * (DRIFT * hold).min(requirement.until - self.t);
            self.note(i, self.t.max(requirement.from), h - drift)?;
        }
        Ok(true)
    }
}

/// How a number goes on to move, window of time by window: it creeps, above a series that dies away.
#[derive(Clone, Copy)]
struct Motion {
    /// Change in a window, and by how much that may be wrong.
    creep: f64,
    unsure: f64,
    /// What the series comes to, and the most that it does on the way.
    end: f64,
    series: f64,
}

impl Motion {
    /// That of a number that was `last` at the ends of the last four windows. What the first three changes and the last three
    /// differ by on the creep, that may be wrong by. `None` where the changes do not die away.
    fn of(last: [f64; 5], round_off: f64) -> Option<Self> {
        let change = |k: usize| last[k + 1] - last[k];
        let [before, now] = [0, 1].map(|k| told_apart([change(k), change(k + 1), change(k + 2)], round_off));
        let ([other, ..], [creep, unsure, end, series]) = (before?, now?);
        Some(Self { creep, unsure: unsure + (creep - other).abs(), end, series })
    }

    /// The most by which it moves in so many windows. A creep that leads inside counts too, since it may be a slow series that
    /// will end.
    fn to_come(self, windows: f64) -> f64 {
        self.series + (self.creep.abs() + self.unsure) * windows
    }

    /// Where a number that is at `x` is a `part` of the way on, of so many windows.
    fn at(&self, x: f64, part: f64, windows: f64) -> f64 {
        x + (self.end + self.creep * windows) * part
    }

    /// Where a number that is at `x` is, from so many windows on until as many.
    fn over(&self, x: f64, [from, to]: [f64; 2]) -> Interval {
        let (a, b, wide) = (self.creep * from, self.creep * to, self.series + self.unsure * to);
        Interval::new(x + a.min(b) - wide, x + a.max(b) + wide)
    }
}

/// What three changes in a row tell by Aitken's process if they are a geometric series and a constant creep: the creep, what
/// round-off may hide of it, the sum of the series to come, and the most that it comes to on the way. `None` where what they
/// change by does not die away.
fn told_apart([first, before, now]: [f64; 3], round_off: f64) -> Option<[f64; 4]> {
    let (bent, bends) = (before - first, now - before);
    if bends.abs() <= round_off {
        return Some([if now.abs() <= round_off { 0.0 } else { now }, 0.0, 0.0, 0.0]);
    }
    let dies_away = bends.abs() < bent.abs();
    dies_away.then(|| {
        let ratio = bends / bent;
        let decays = bends * ratio / (ratio - 1.0);
        let unsure = 2.0 * round_off / ((1.0 - ratio) * (1.0 - ratio));
        let next = decays * ratio;
        [now - decays, unsure, next / (1.0 - ratio), next.abs() / (1.0 - ratio.abs())]
    })
}

/// The states at instants of their way, from where they are on for so many windows.
fn way(ahead: &[(f64, Motion)], windows: f64) -> impl Iterator<Item = Vec<f64>> {
    (0..=WAY_INSTANTS).map(move |instant| {
        let part = f64::from(instant) / f64::from(WAY_INSTANTS);
        ahead.iter().map(|(x, motion)| motion.at(*x, part, windows)).collect()
    })
}

/// The error that a state may have on a piece where it is within `over`: far from the origin no more of it than near, but for
/// round-off.
fn allowed(over: Interval) -> f64 {
    RESIDUAL * (1.0 + (over.high - over.low)) + ROUND_OFF * over.low.abs()
}

/// The size of a state, by which the last terms of its course are measured.
fn size(course: &Course) -> f64 {
    1.0 + course[0].abs()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::Motion;

    /// The most by which a number moves in a million windows.
    fn to_come(last: [f64; 5], round_off: f64) -> Option<f64> {
        Motion::of(last, round_off).map(|motion| motion.to_come(1e6))
    }

    proptest! {
        /// Of a geometric series above a creep, both of any sign and size, what is to come is known.
        #[test]
        fn a_decay_and_a_creep_are_told_apart(
            decays in -1.0..1.0_f64,
            creep in -1.0..1.0_f64,
            ratio in -0.95..0.95_f64,
            windows in 10..1000_u32,
        ) {
            let series = |k: u32| decays * (0..k).map(|_| ratio).product::<f64>();
            let h = |k: u32| series(k) + creep * f64::from(k);
            let motion = Motion::of([0, 1, 2, 3, 4].map(h), 1e-14).expect("a decay and a creep");
            let moves = motion.to_come(f64::from(windows));
            let moved = (0..=windows).map(|k| (h(4 + k) - h(4)).abs()).fold(0.0, f64::max);
            prop_assert!(moves >= moved, "{moves} {moved}");
            // No more than each by itself, and what round-off of 1e-14 hides in a creep.
            let apart = series(4).abs() * (1.0 - ratio) / (1.0 - ratio.abs());
            let apart = apart + creep.abs() * f64::from(windows);
            prop_assert!(moves <= apart + 1e-9 * f64::from(windows), "{moves} {apart}");
            // And where it is meanwhile.
            let half = windows / 2;
            for [from, to] in [[0, half], [half, windows]] {
                let over = motion.over(h(4), [f64::from(from), f64::from(to)]);
                for k in from..=to {
                    prop_assert!(over.low <= h(4 + k) && h(4 + k) <= over.high, "{over:?} {}", h(4 + k));
                }
            }
        }
    }

    #[test]
    fn what_gathers_pace_or_is_no_number_has_no_end() {
        assert_eq!(to_come([0.5, 0.0, -1.0, -2.5, -5.0], 0.0), None);
        assert_eq!(to_come([0.0, 0.0, 1.0, 1.0, 0.0], 0.0), None);
        assert_eq!(to_come([f64::NAN, 1.0, 1.5, 1.75, 1.875], 0.0), None);
        assert_eq!(to_come([0.0, 1.0, 2.0, 2.5, f64::NEG_INFINITY], 0.0), None);
        assert_eq!(to_come([1.0; 5], 1e-14), Some(0.0));
    }

    /// A fast decay above a slow one does not hide a creep of the slow one's size.
    #[test]
    fn what_two_decays_hide_is_not_taken_as_known() {
        let power = |base: f64, k: u32| (0..k).map(|_| base).product::<f64>();
        // The last three changes alone say that h rises.
        let h = |k: u32| -2.58e-3 * power(0.984, k) + 3.68e-5 * power(0.483, k) - 9.08e-7 * f64::from(k);
        assert!(to_come([0, 1, 2, 3, 4].map(h), 1e-14).expect("a decay and a creep") > 0.9);
    }
}
