//! Uncertain plants and their judge: cases, adversaries, and an integrator of its own. The tests of promises take it, and the
//! tests of the tube, which plant defects.

#![allow(dead_code, reason = "not every test takes all of it")]

// The crate itself has no prelude of std.
#[allow(unused_imports, reason = "from outside the crate these are there")]
use std::{format, prelude::rust_2024::*};

use punctual_core::barriers::{DistanceDisc, Outside};
use punctual_core::dynamics::ControlAffine;
use punctual_core::filter::*;

/// Shows a row of figures, for tests in the crate, which prints nothing itself.
#[allow(clippy::print_stdout, reason = "the figures are wanted")]
pub(crate) fn show(row: &str) {
    std::println!("{row}");
}

pub(crate) const PERIOD: f64 = 0.02;
pub(crate) const RADIUS: f64 = 2.0;
pub(crate) const DEADLINE: f64 = 8.0;
/// Parts of a period at which a run is judged.
pub(crate) const PARTS: u32 = 4;

pub(crate) struct Draws(pub(crate) u64);

impl Draws {
    pub(crate) fn part(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.part()
    }

    pub(crate) fn sign(&mut self) -> f64 {
        if self.part() < 0.5 { -1.0 } else { 1.0 }
    }
}

/// Who chooses disturbances, errors and gains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Adversary {
    /// Drawn at every sample.
    Random,
    /// A corner, changed now and then.
    Corners,
    /// One corner for ever.
    Constant,
    /// At every sample what leads farthest down h where the plan at hand is tightest, if its law is followed.
    Worst,
}

pub(crate) const ADVERSARIES: [Adversary; 4] =
    [Adversary::Random, Adversary::Corners, Adversary::Constant, Adversary::Worst];

/// What u_ref asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Asks {
    Zero,
    Damping,
    Hostile,
}

pub(crate) const ASKS: [Asks; 3] = [Asks::Hostile, Asks::Zero, Asks::Damping];

/// What is declared, and what an adversary then uses.
#[derive(Clone, Debug)]
pub(crate) struct Declared {
    pub(crate) rates: [f64; 4],
    pub(crate) errors: [f64; 4],
    pub(crate) gains: [[f64; 2]; 2],
    pub(crate) lags: [[f64; 2]; 2],
    pub(crate) delay: f64,
    /// By how much of a period samples come late, or soon.
    pub(crate) jitter: f64,
}

impl Declared {
    /// Everything at once, as for `is_point`: 0.1 m/s² and 0.02 rad/s, ±2 cm, ±2 cm/s, ±0.01 rad, 5 % of each input.
    pub(crate) fn all(is_point: bool) -> Self {
        let (rates, errors) = match is_point {
            true => ([0.0, 0.0, 0.1, 0.1], [0.02; 4]),
            false => ([0.0, 0.0, 0.02, 0.1], [0.02, 0.02, 0.01, 0.02]),
        };
        Self { rates, errors, gains: [[0.95, 1.05]; 2], ..Self::nothing() }
    }

    pub(crate) fn nothing() -> Self {
        Self {
            rates: [0.0; 4],
            errors: [0.0; 4],
            gains: [[1.0; 2]; 2],
            lags: [[0.0; 2]; 2],
            delay: 0.0,
            jitter: 0.0,
        }
    }
}

/// A start, a goal up to 25 m away, and up to two rocks on the way.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    pub(crate) x: [f64; 4],
    pub(crate) goal: [f64; 2],
    pub(crate) rocks: Vec<([f64; 2], f64)>,
    pub(crate) bounds: [f64; 2],
    pub(crate) is_point: bool,
}

impl Case {
    pub(crate) fn draw(draws: &mut Draws, bounds: [f64; 2], is_point: bool) -> Self {
        let (distance, angle) = (draws.within(10.0, 25.0), draws.within(-0.8, 0.8));
        let goal = [distance * angle.cos(), distance * angle.sin()];
        let mut rocks = Vec::new();
        for _ in 0..2 {
            let (part, aside) = (draws.within(0.3, 0.75), draws.within(-3.0, 3.0));
            let radius = draws.within(0.8, 1.8);
            let at = [part * goal[0] - aside * angle.sin(), part * goal[1] + aside * angle.cos()];
            let apart = |c: [f64; 2], least: f64| (at[0] - c[0]).hypot(at[1] - c[1]) > least;
            if apart([0.0, 0.0], radius + 2.5) && apart(goal, radius + 3.0) {
                rocks.push((at, radius));
            }
        }
        let (speed, aside) = (draws.within(0.0, 2.0), draws.within(-0.5, 0.5));
        let x = if is_point { [0.0, 0.0, speed, 2.0 * aside] } else { [0.0, 0.0, aside, speed] };
        Self { x, goal, rocks, bounds, is_point }
    }

    pub(crate) fn filter<P>(&self, plant: P, declared: Option<&Declared>) -> Filter
    where
        P: ControlAffine<4, 2> + Send + Sync + 'static,
    {
        let goal = DistanceDisc::new(self.goal, RADIUS, 1.0).unwrap();
        let mut builder =
            Filter::builder(plant).barrier("goal", goal, BarrierSettings::within(DEADLINE)).unwrap();
        for (i, (at, radius)) in self.rocks.iter().enumerate() {
            let rock = Outside(DistanceDisc::new(*at, *radius, 1.0).unwrap());
            builder = builder.barrier(&format!("rock{i}"), rock, BarrierSettings::keeping()).unwrap();
        }
        let low = self.bounds.map(|b| -b);
        builder = builder.bounds(&low, &self.bounds).unwrap().sampling(Sampling::Period(PERIOD)).unwrap();
        let mut plans = Plans::every(PERIOD);
        if let Some(Declared { rates, errors, gains, lags, delay, jitter }) = declared {
            builder = builder.actuation_delay(*delay).unwrap();
            plans = plans
                .uncertain_rates(rates)
                .uncertain_gains(gains)
                .uncertain_lags(lags)
                .measurement_errors(errors)
                .jitter(*jitter);
        }
        builder.build().unwrap().with_plans(plans).unwrap()
    }

    /// h in m of every barrier.
    pub(crate) fn h(&self, x: &[f64; 4]) -> Vec<f64> {
        let apart = |c: [f64; 2]| (x[0] - c[0]).hypot(x[1] - c[1]);
        let rocks = self.rocks.iter().map(|(c, r)| apart(*c) - r);
        core::iter::once(RADIUS - apart(self.goal)).chain(rocks).collect()
    }

    /// The direction in which h of a barrier falls.
    pub(crate) fn down(&self, barrier: usize, x: &[f64]) -> [f64; 4] {
        let (c, sign) = if barrier == 0 { (self.goal, 1.0) } else { (self.rocks[barrier - 1].0, -1.0) };
        let length = (x[0] - c[0]).hypot(x[1] - c[1]).max(1e-9);
        [sign * (x[0] - c[0]) / length, sign * (x[1] - c[1]) / length, 0.0, 0.0]
    }
}

/// The sides an adversary takes: of the errors, rates and gains, each −1 to 1.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sides {
    pub(crate) errors: [f64; 4],
    pub(crate) rates: [f64; 4],
    pub(crate) gains: [f64; 2],
    pub(crate) lags: [f64; 2],
}

impl Sides {
    pub(crate) fn of(mut draw: impl FnMut() -> f64) -> Self {
        Self {
            errors: core::array::from_fn(|_| draw()),
            rates: core::array::from_fn(|_| draw()),
            gains: core::array::from_fn(|_| draw()),
            lags: core::array::from_fn(|_| draw()),
        }
    }

    /// What leads farthest down h where the plan of `filter` is tightest: the signs of the adjoint of the closed loop, from
    /// there back to the sample at `t`.
    pub(crate) fn worst<P: ControlAffine<4, 2>>(
        filter: &Filter,
        plant: &P,
        case: &Case,
        t: f64,
    ) -> Option<Self> {
        let plan = filter.plan()?;
        let (tracking, tightest) = (plan.tracking()?, plan.tightest?);
        let holds = tracking.inputs().len();
        let index = |time: f64| tracking.times().partition_point(|at| *at < time - 1e-6).min(holds - 1);
        let (now, last) = (index(t), index(tightest.time));
        let mut adjoint = case.down(tightest.barrier, &tracking.states()[last]);
        for k in (now + 1..last).rev() {
            let (z, u, gain) = (&tracking.states()[k], &tracking.inputs()[k], &tracking.gains()[k]);
            let moved = |x: [f64; 4], seen: [f64; 4]| {
                let mut input = [u[0], u[1]];
                for (i, row) in gain.chunks_exact(4).enumerate() {
                    input[i] += (0..4).map(|j| row[j] * (seen[j] - z[j])).sum::<f64>();
                }
                let rate = plant.derivative(&x, &input);
                core::array::from_fn::<f64, 4, _>(|i| x[i] + PERIOD * rate[i])
            };
            let at: [f64; 4] = core::array::from_fn(|i| z[i]);
            let base = moved(at, at);
            adjoint = core::array::from_fn(|j| {
                let mut x = at;
                x[j] += 1e-6;
                let end = moved(x, x);
                (0..4).map(|i| adjoint[i] * (end[i] - base[i]) / 1e-6).sum()
            });
        }
        let sign = |v: f64| if v < 0.0 { -1.0 } else { 1.0 };
        let (z, u, gain) = (&tracking.states()[now], &tracking.inputs()[now], &tracking.gains()[now]);
        let at: [f64; 4] = core::array::from_fn(|i| z[i]);
        let effect: [f64; 2] = core::array::from_fn(|j| {
            let along = |by: f64| {
                plant.derivative(&at, &core::array::from_fn(|i| u[i] + if i == j { by } else { 0.0 }))
            };
            let (more, less) = (along(0.5), along(-0.5));
            (0..4).map(|i| adjoint[i] * (more[i] - less[i])).sum()
        });
        let errors = core::array::from_fn(|j| {
            let gained = gain.chunks_exact(4).zip(effect).map(|(row, effect)| row[j] * effect).sum::<f64>();
            // Behind an input of its own, an error does nothing yet.
            if gained == 0.0 { sign(adjoint[j]) } else { sign(gained) }
        });
        let gains = core::array::from_fn(|i| sign(effect[i] * u[i]));
        // As late as can be.
        Some(Self { errors, rates: adjoint.map(sign), gains, lags: [1.0; 2] })
    }
}

/// What happened in a run.
#[derive(Debug, Default)]
pub(crate) struct Outcome {
    pub(crate) accepted: bool,
    /// The least h in m while it was promised.
    pub(crate) least: f64,
    /// Samples without the promise after it was given.
    pub(crate) withdrawn: usize,
    /// Samples at which u_ref passed.
    pub(crate) passed: usize,
    /// Why it was refused or withdrawn.
    pub(crate) failure: String,
}

pub(crate) struct Run {
    pub(crate) adversary: Adversary,
    pub(crate) asks: Asks,
    pub(crate) seed: u64,
    /// How long in s.
    pub(crate) time: f64,
    /// How much worse the plant is than declared.
    pub(crate) worse: f64,
}

pub(crate) fn run<P>(plant: &P, case: &Case, declared: &Declared, how: &Run) -> Outcome
where
    P: ControlAffine<4, 2> + Clone + Send + Sync + 'static,
{
    let Declared { rates, errors, gains, lags, delay, jitter } = declared;
    let (mut draws, mut filter) = (Draws(how.seed), case.filter(plant.clone(), Some(declared)));
    let (mut x, mut late) = (case.x, [0.0; 2]);
    // When each input begins to act.
    let mut sent = vec![(f64::NEG_INFINITY, [0.0; 2])];
    let mut sides = Sides::of(|| draws.sign());
    let mut outcome = Outcome { least: f64::INFINITY, ..Outcome::default() };
    let mut next = 0.0;
    for step in 0..(how.time / PERIOD) as u32 {
        let t = if *jitter > 0.0 { next } else { f64::from(step) * PERIOD };
        if t > how.time {
            break;
        }
        // Late by all that is declared, or any time.
        let part = if draws.part() < 0.5 { 1.0 } else { draws.within(-1.0, 1.0) };
        let period = if *jitter > 0.0 { PERIOD * (1.0 + how.worse * jitter * part) } else { PERIOD };
        next = t + period;
        sides = match how.adversary {
            Adversary::Random => Sides::of(|| draws.within(-1.0, 1.0)),
            Adversary::Corners if draws.part() < 0.05 => Sides::of(|| draws.sign()),
            Adversary::Worst => Sides::worst(&filter, plant, case, t).unwrap_or(sides),
            _ => sides,
        };
        let measured: [f64; 4] = core::array::from_fn(|i| x[i] + how.worse * errors[i] * sides.errors[i]);
        let u_ref = match (how.asks, case.is_point) {
            (Asks::Zero, _) => [0.0; 2],
            (Asks::Damping, true) => [-measured[2], -measured[3]],
            (Asks::Damping, false) => [-measured[3], 0.0],
            (Asks::Hostile, _) => {
                let turns = if draws.part() < 0.9 { 1.0 } else { -1.0 };
                [case.bounds[0] * draws.sign(), case.bounds[1] * turns]
            }
        };
        let mut u = [0.0; 2];
        let report = filter.step(t, &measured, &u_ref, &mut u).unwrap();
        let assurance = report.assurance.unwrap();
        if step == 0 {
            outcome.accepted = assurance.is_assured();
        }
        if !assurance.is_assured() {
            if outcome.failure.is_empty() {
                let why = assurance.failure.map(|failure| failure.to_string()).unwrap_or_default();
                outcome.failure = format!("at {t:.2} s {:?}: {why}", assurance.status);
            }
            if !outcome.accepted {
                return outcome;
            }
            outcome.withdrawn += 1;
        }
        outcome.passed += usize::from(matches!(assurance.driver, Driver::Reference | Driver::Eased));
        let guaranteed: Vec<bool> = report.barriers.iter().map(|b| b.guaranteed).collect();
        sent.push((t + delay, u));
        let rate = |x: &[f64; 4], u: &[f64; 2]| {
            let arrives: [f64; 2] = core::array::from_fn(|i| {
                let [low, high] = gains[i];
                u[i] * (0.5 * (low + high) + 0.5 * how.worse * (high - low) * sides.gains[i])
            });
            let rate = plant.derivative(x, &arrives);
            core::array::from_fn::<f64, 4, _>(|i| rate[i] + how.worse * rates[i] * sides.rates[i])
        };
        // Parts of the period, and where another input begins to act.
        let mut ends: Vec<f64> =
            (1..=PARTS).map(|part| t + period * f64::from(part) / f64::from(PARTS)).collect();
        ends.extend(sent.iter().map(|(at, _)| *at).filter(|at| *at > t + 1e-9 && *at < next - 1e-9));
        ends.sort_by(f64::total_cmp);
        let mut begin = t;
        for now in ends {
            let h = now - begin;
            let acts = |(at, _): &&(f64, [f64; 2])| *at <= begin + 0.5 * h;
            let asked = sent.iter().rfind(acts).unwrap().1;
            if h <= 0.0 {
                continue;
            }
            begin = now;
            let follow = |late: &mut [f64; 2]| {
                for i in 0..2 {
                    let [low, high] = lags[i];
                    let lag = 0.5 * (low + high) + 0.5 * how.worse * (high - low) * sides.lags[i];
                    late[i] = asked[i] + (late[i] - asked[i]) * (-0.5 * h / lag.max(1e-9)).exp();
                }
            };
            // The input in the middle of the part.
            follow(&mut late);
            let u = &late;
            // Kutta's rule of third order.
            let moved = |by: [(f64, &[f64; 4]); 2]| {
                core::array::from_fn::<f64, 4, _>(|i| {
                    x[i] + h * by.iter().map(|(b, k)| b * k[i]).sum::<f64>()
                })
            };
            let k1 = rate(&x, u);
            let k2 = rate(&moved([(0.5, &k1), (0.0, &k1)]), u);
            let k3 = rate(&moved([(-1.0, &k1), (2.0, &k2)]), u);
            x = core::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 4.0 * k2[i] + k3[i]));
            follow(&mut late);
            for (j, (h, guaranteed)) in case.h(&x).into_iter().zip(&guaranteed).enumerate() {
                if *guaranteed && (j > 0 || now >= DEADLINE) {
                    outcome.least = outcome.least.min(h);
                }
            }
        }
    }
    outcome
}
