//! Estimates, by subset simulation, the probability that a margin is negative. The margin is a function of
//! standard normal numbers and of seeds. S.-K. Au and J. L. Beck, Probab. Eng. Mech. 16 (2001), doi
//! 10.1016/S0266-8920(01)00019-4.
//!
//! ```text
//! P(g < 0) = P(g ≤ L₁) · P(g ≤ L₂ | g ≤ L₁) · … · P(g < 0 | g ≤ Lₖ),   L₁ > L₂ > … > Lₖ ≥ 0
//! ```
//!
//! Each factor is about [`PART`], so it takes few points to estimate. A pilot finds the levels L and the
//! width of the moves. Then independent repeats use them unchanged. With fixed levels and fixed moves, the
//! product of the fractions is an unbiased estimate, however badly the moves mix: F. Cérou, P. Del Moral, T.
//! Furon and A. Guyader, Stat. Comput. 22 (2012), doi 10.1007/s11222-011-9231-6. So the mean of the repeats
//! is unbiased too, and their spread gives its error.
//!
//! A move from z proposes √(1 − σ²) z + σ ξ with ξ standard normal, which preserves the standard normal
//! distribution. It is accepted if g ≤ L still holds: I. Papaioannou, W. Betz, K. Zwirglmaier and D. Straub,
//! Probab. Eng. Mech. 41 (2015), doi 10.1016/j.probengmech.2015.06.006. Each seed belongs to one piece of the
//! noise of a run. It is redrawn with probability σ² and kept otherwise, which preserves the distribution of
//! independent seeds.

use std::f64::consts::TAU;

use punctual_core::elementary;
use rayon::iter::{
    IndexedParallelIterator, IntoParallelIterator, IntoParallelRefMutIterator, ParallelIterator,
};
use serde::{Deserialize, Serialize};

use super::distribution::student;
use super::sampling::Sequence;

/// Points of the pilot, and of each repeat, at every level.
const POINTS: usize = 500;
/// The fraction of the points that the pilot lets pass each level.
const PART: f64 = 0.2;
/// Moves of each point at every level.
const MOVES: usize = 6;
/// The fraction of accepted moves that the pilot aims for, and how fast it adapts the width.
const WANTED: f64 = 0.4;
const STEERING: f64 = 1.5;
/// The most levels. Beyond them the probability would be below 1e-15, where doubles cannot resolve
/// probabilities near 1.
const MOST_LEVELS: usize = 21;

/// Gives one random sequence for each key.
fn generator(seed: u64, repeat: usize, level: usize, point: usize) -> Sequence {
    Sequence::new(seed, ((repeat as u64) << 32) + ((level as u64) << 16) + point as u64)
}

/// Fills `z` with standard normal numbers: G. E. P. Box and M. E. Muller (1958).
fn normal(rng: &mut Sequence, z: &mut [f64]) {
    for pair in z.chunks_mut(2) {
        let (radius, angle) = ((-2.0 * elementary::ln(rng.unit())).sqrt(), TAU * rng.unit());
        let (sin, cos) = elementary::sin_cos(angle);
        pair[0] = radius * cos;
        if let Some(second) = pair.get_mut(1) {
            *second = radius * sin;
        }
    }
}

/// Stores numbers as their bits, since JSON has no infinite numbers.
mod exact {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    /// A number as its bits.
    pub(super) fn serialize<S: Serializer>(number: &f64, to: S) -> Result<S::Ok, S::Error> {
        number.to_bits().serialize(to)
    }

    /// The number with these bits.
    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        u64::deserialize(from).map(f64::from_bits)
    }
}

/// A point with its margin.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(super) struct Point {
    /// Standard normal numbers.
    pub(super) z: Vec<f64>,
    /// Seeds below 2⁵³.
    pub(super) seeds: Vec<u64>,
    /// Negative if the point fails.
    #[serde(with = "exact")]
    pub(super) margin: f64,
}

/// What the pilot found for the repeats.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(super) struct Plan {
    /// The margins to reach, decreasing. Below the last one is failure.
    pub(super) levels: Vec<Level>,
    /// Number of points at which the pilot computed the margin.
    pub(super) made: u64,
}

/// A level of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
pub(super) struct Level {
    /// The margin to reach.
    #[serde(with = "exact")]
    pub(super) margin: f64,
    /// The width σ of the moves there.
    width: f64,
}

/// One repeat that follows a plan.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub(super) struct Repeat {
    /// Its estimate.
    probability: f64,
    /// Its failing point with the least margin; the first of equal ones.
    worst: Option<Point>,
}

/// An estimate with its confidence interval.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Estimate {
    pub(super) probability: f64,
    /// At a confidence of 95 %.
    pub(super) interval: [f64; 2],
    /// Standard deviation of the estimate, relative to it.
    pub(super) deviation: f64,
    /// The failing point with the least margin over the repeats; the first of equal ones.
    pub(super) worst: Option<Point>,
    /// Number of points at which the repeats computed the margin.
    pub(super) made: u64,
}

/// Why there is no plan: the least margin that the points reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stalled {
    pub(super) margin: f64,
    /// Roughly the fraction of all points that get this far.
    pub(super) part: f64,
    pub(super) made: u64,
}

/// The margin as a function of numbers and seeds.
pub(super) type Margin<'a> = dyn Fn(&[f64], &[u64]) -> f64 + Sync + 'a;

/// The problem: a margin that depends on this many numbers and seeds, and the seed of all draws.
pub(super) struct Problem<'a> {
    pub(super) dimensions: usize,
    pub(super) seeds: usize,
    pub(super) seed: u64,
    pub(super) margin: &'a Margin<'a>,
}

impl Problem<'_> {
    /// Draws independent points.
    fn first(&self, repeat: usize) -> Vec<Point> {
        let point = |i: usize| {
            let mut z = vec![0.0; self.dimensions];
            let mut rng = generator(self.seed, repeat, 0, i);
            normal(&mut rng, &mut z);
            let seeds: Vec<u64> = (0..self.seeds).map(|_| rng.seed()).collect();
            Point { margin: (self.margin)(&z, &seeds), z, seeds }
        };
        (0..POINTS).into_par_iter().map(point).collect()
    }

    /// Tries to move the point `moves` times by steps of width `width`, and stays at or below `level`.
    /// Returns how often it moved.
    fn moved(&self, point: &mut Point, rng: &mut Sequence, level: f64, width: f64, moves: usize) -> usize {
        let (mut step, mut seeds) = (vec![0.0; self.dimensions], vec![0; self.seeds]);
        let (mut made, keep) = (0, (1.0 - width * width).sqrt());
        for _ in 0..moves {
            normal(rng, &mut step);
            step.iter_mut().zip(&point.z).for_each(|(step, z)| *step = keep * z + width * *step);
            for (new, old) in seeds.iter_mut().zip(&point.seeds) {
                *new = if rng.unit() < width * width { rng.seed() } else { *old };
            }
            let margin = (self.margin)(&step, &seeds);
            if margin <= level {
                (point.margin, made) = (margin, made + 1);
                point.z.copy_from_slice(&step);
                point.seeds.copy_from_slice(&seeds);
            }
        }
        made
    }

    /// Finds levels and widths.
    pub(super) fn pilot(&self) -> Result<Plan, Stalled> {
        let mut plan = Plan { levels: Vec::new(), made: POINTS as u64 };
        let mut points = self.first(0);
        let mut width = 0.6;
        let mut part = 1.0;
        loop {
            let mut margins: Vec<f64> = points.iter().map(|point| point.margin).collect();
            margins.sort_by(f64::total_cmp);
            let level = margins[(PART * POINTS as f64) as usize - 1];
            if level < 0.0 {
                return Ok(plan);
            }
            let through = margins.partition_point(|margin| *margin <= level) as f64 / POINTS as f64;
            if plan.levels.len() == MOST_LEVELS || plan.levels.last().is_some_and(|l| level >= l.margin) {
                return Err(Stalled { margin: margins[0], part, made: plan.made });
            }
            part *= through;
            let l = plan.levels.len() + 1;
            points = resampled(points, level, &mut generator(self.seed, 0, l, POINTS));
            let mut generators: Vec<_> = (0..POINTS).map(|i| generator(self.seed, 0, l, i)).collect();
            // Twice as many moves as in a repeat, so that the width settles.
            for _ in 0..2 * MOVES {
                let moved: usize = points
                    .par_iter_mut()
                    .zip(&mut generators)
                    .map(|(point, rng)| self.moved(point, rng, level, width, 1))
                    .sum();
                plan.made += POINTS as u64;
                let accepted = moved as f64 / POINTS as f64;
                width = (width * elementary::exp(STEERING * (accepted - WANTED))).clamp(1e-3, 1.0);
            }
            plan.levels.push(Level { margin: level, width });
        }
    }

    /// Repeat number `repeat`, counted from 1, with `plan`. It depends only on the problem, the plan and the
    /// number.
    pub(super) fn repeat(&self, plan: &Plan, repeat: usize) -> Repeat {
        let mut points = self.first(repeat);
        let mut probability = 1.0;
        for (l, level) in plan.levels.iter().enumerate() {
            let through = points.iter().filter(|point| point.margin <= level.margin).count();
            probability *= through as f64 / POINTS as f64;
            if through == 0 {
                return Repeat { probability: 0.0, worst: None };
            }
            points = resampled(points, level.margin, &mut generator(self.seed, repeat, l + 1, POINTS));
            points.par_iter_mut().enumerate().for_each(|(i, point)| {
                let rng = &mut generator(self.seed, repeat, l + 1, i);
                self.moved(point, rng, level.margin, level.width, MOVES);
            });
        }
        let failing = points.iter().filter(|point| point.margin < 0.0);
        probability *= failing.clone().count() as f64 / POINTS as f64;
        Repeat { probability, worst: failing.cloned().reduce(worse) }
    }
}

/// The mean of two or more `repeats` with `plan`.
pub(super) fn estimate(plan: &Plan, repeats: &[Repeat]) -> Estimate {
    let n = repeats.len() as f64;
    let probability = repeats.iter().map(|r| r.probability).sum::<f64>() / n;
    let variance =
        repeats.iter().map(|r| elementary::powi(r.probability - probability, 2)).sum::<f64>() / (n - 1.0);
    // If no repeat reaches failure, the deviation is unknown.
    let deviation = if probability > 0.0 { (variance / n).sqrt() / probability } else { f64::INFINITY };
    // The interval is for the logarithm, since estimates of rare events are skewed to the right.
    let factor = elementary::exp(student(n - 1.0) * deviation);
    let made = (repeats.len() * POINTS * (1 + MOVES * plan.levels.len())) as u64;
    let high = if probability > 0.0 { (probability * factor).min(1.0) } else { 1.0 };
    let interval = [probability / factor, high];
    let worst = repeats.iter().filter_map(|r| r.worst.clone()).reduce(worse);
    Estimate { probability, interval, deviation, worst, made }
}

/// The point with the lesser margin; the first of equal ones.
fn worse(a: Point, b: Point) -> Point {
    if b.margin < a.margin { b } else { a }
}

/// Resamples to the same number of points from those at or below `level`. Each is taken equally often, except
/// for a remainder that is drawn without repetition.
fn resampled(mut points: Vec<Point>, level: f64, rng: &mut Sequence) -> Vec<Point> {
    points.retain(|point| point.margin <= level);
    // Fisher–Yates shuffle.
    for i in (1..points.len()).rev() {
        points.swap(i, (rng.unit() * (i + 1) as f64) as usize);
    }
    (0..POINTS).map(|i| points[i % points.len()].clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::distribution::below;

    /// Length of a run of the plant below, in steps.
    const STEPS: usize = 50;

    /// The plant x₀ = 0, xₖ₊₁ = 0.9 xₖ + zₖ: its least distance below `limit`.
    fn least_distance(limit: f64, z: impl IntoIterator<Item = f64>) -> f64 {
        let mut x = 0.0;
        let mut least = f64::INFINITY;
        for z in z {
            x = 0.9 * x + z;
            least = f64::min(least, limit - x);
        }
        least
    }

    fn density(x: f64) -> f64 {
        elementary::exp(-0.5 * x * x) / TAU.sqrt()
    }

    /// The probability that the plant passes `limit`, computed without random numbers. The density of x below
    /// the limit is propagated step by step on a grid (Chapman–Kolmogorov, trapezoid rule); the probability
    /// that leaves is the tail of the normal distribution.
    fn passing(limit: f64) -> f64 {
        let n = 600;
        let (low, width) = (-limit, 2.0 * limit / f64::from(n));
        let grid: Vec<f64> = (0..=n).map(|i| low + width * f64::from(i)).collect();
        let weight = |i: usize| if i == 0 || i == grid.len() - 1 { 0.5 * width } else { width };
        let mut of_x: Vec<f64> = grid.iter().map(|x| density(*x)).collect();
        let mut passed = below(-limit);
        for _ in 1..STEPS {
            let leaving = |(i, x): (usize, &f64)| weight(i) * of_x[i] * below(0.9 * x - limit);
            passed += grid.iter().enumerate().map(leaving).sum::<f64>();
            let at = |y: &f64| {
                grid.iter().enumerate().map(|(i, x)| weight(i) * of_x[i] * density(y - 0.9 * x)).sum()
            };
            of_x = grid.iter().map(at).collect();
        }
        passed
    }

    /// The same for z uniform on [-1, 1]. The distribution function of x below the limit is propagated by its
    /// differences (f(y) = (F((y + 1) / 0.9) - F((y - 1) / 0.9)) / 2, trapezoid rule).
    fn passing_of_uniform(limit: f64) -> f64 {
        let n = 4000;
        // Nothing is below -10, the sum if every z is -1.
        let width = (limit + 10.0) / n as f64;
        let at = |i: usize| width * i as f64 - 10.0;
        let mut below: Vec<f64> = (0..=n).map(|i| f64::midpoint(at(i), 1.0).clamp(0.0, 1.0)).collect();
        let mut passed = 0.0;
        for _ in 1..STEPS {
            let of = |x: f64| {
                let place = ((x + 10.0) / width).clamp(0.0, n as f64);
                let i = (place as usize).min(n - 1);
                below[i] + (place - i as f64) * (below[i + 1] - below[i])
            };
            let density: Vec<f64> =
                (0..=n).map(|i| (of((at(i) + 1.0) / 0.9) - of((at(i) - 1.0) / 0.9)) / 2.0).collect();
            let leaving = |i: usize| {
                let part = |i: usize| f64::midpoint(0.9 * at(i), 1.0 - limit).clamp(0.0, 1.0);
                (below[i + 1] - below[i]) * f64::midpoint(part(i), part(i + 1))
            };
            passed += (0..n).map(leaving).sum::<f64>();
            let mut sum = 0.0;
            below = std::iter::once(0.0)
                .chain(density.windows(2).map(|pair| {
                    sum += width * f64::midpoint(pair[0], pair[1]);
                    sum
                }))
                .collect();
        }
        passed
    }

    /// A limit that the plant passes with a probability near `wanted`, and that probability.
    fn limit(wanted: f64, passing: fn(f64) -> f64) -> (f64, f64) {
        let (mut low, mut high) = (5.0, 20.0);
        for _ in 0..12 {
            let middle = 0.5 * (low + high);
            if passing(middle) > wanted { low = middle } else { high = middle }
        }
        (low, passing(low))
    }

    /// Repeats the whole estimate with other seeds. Returns how many intervals cover `truth`, the mean of the
    /// estimates, and the mean ratio of the points used to those that plain sampling needs for the same
    /// deviation.
    fn judged(
        truth: f64,
        times: u64,
        margin: &Margin<'_>,
        [dimensions, seeds]: [usize; 2],
    ) -> (u64, f64, f64) {
        let (mut covered, mut mean, mut part) = (0, 0.0, 0.0);
        for seed in 0..times {
            let problem = Problem { dimensions, seeds, seed, margin };
            let plan = problem.pilot().unwrap();
            let repeats: Vec<_> = (1..=20).map(|repeat| problem.repeat(&plan, repeat)).collect();
            let found = estimate(&plan, &repeats);
            covered += u64::from(found.interval[0] <= truth && truth <= found.interval[1]);
            mean += found.probability / times as f64;
            let plain = (1.0 - truth) / (truth * found.deviation * found.deviation);
            part += (plan.made + found.made) as f64 / plain / times as f64;
        }
        (covered, mean, part)
    }

    /// The intervals cover the known probability, the mean estimate is right, and plain sampling needs 1e5
    /// times the points. `tests/nightly` uses a hundred seeds.
    fn covers([dimensions, seeds]: [usize; 2], passing: fn(f64) -> f64) {
        let (limit, truth) = limit(1e-9, passing);
        let times = std::env::var("PUNCTUAL_REPEATS").map_or(4, |n| n.parse().expect("a number"));
        let uniform = |seed: &u64| (*seed as f64 + 0.5) / (1_u64 << 52) as f64 - 1.0;
        let noise = |z: &[f64], seeds: &[u64]| {
            least_distance(limit, z.iter().copied().chain(seeds.iter().map(uniform)))
        };
        let (covered, mean, part) = judged(truth, times, &noise, [dimensions, seeds]);
        // An interval misses with probability 1/20. Three of 4 miss once in 2000 times, and so do thirteen of
        // 100.
        assert!(times - covered <= 2 + times / 10, "{covered} of {times}");
        assert!((mean / truth - 1.0).abs() < 0.6 / (times as f64).sqrt(), "{mean}");
        assert!(part < 1e-5, "{part}");
    }

    #[test]
    fn intervals_cover_a_probability_that_is_known() {
        covers([STEPS, 0], passing);
    }

    /// Noise in pieces, each with its own seed.
    #[test]
    fn intervals_cover_that_of_noise_by_seeds() {
        covers([0, STEPS], passing_of_uniform);
    }
}
