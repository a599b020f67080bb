//! The smallest errors, rates and widths of gains that explain what is left: a linear program over all windows of a recording.
//!
//! Of all sizes that meet the conditions of [`super::windows`], those of least price are taken. The price of a rate is its part of the
//! state's own rates, that of a width of a gain is what it adds at the largest input, a little less where both explain the same, and
//! an error of ε costs as a rate that leads as far as 2 ε in a quarter of a second. Errors are allowed where consecutive residuals are
//! anti-correlated, as noise makes them and nothing else does.

use std::collections::BTreeMap;

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus};

use super::linear::Linear;
use super::windows::{Condition, Windows};

/// How far errors may be, in standard deviations.
const FAR: f64 = 4.0;
/// Standard deviations of chance by which consecutive residuals have to be anti-correlated for noise to be seen.
const CHANCE: f64 = 4.0;
/// In s; with more, gusts count as errors, with less, errors as gusts.
const REACH: f64 = 0.25;
/// The price of a gain's width against a rate that explains as much at the largest input.
const GAIN_PRICE: f64 = 0.8;
/// A size is left out if the others explain everything for this much more.
const FEWER: f64 = 1.05;
/// Conditions are met to this part.
const MET: f64 = 1e-6;

/// Bounds on what the model does not say.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sizes {
    /// By state, in its unit.
    pub(super) errors: Vec<f64>,
    /// By state, in its unit per s.
    pub(super) rates: Vec<f64>,
    /// Half the width of the gain, by input.
    pub(super) gains: Vec<f64>,
    /// For each of them in this order the instant in s that determined it, and the length of the window in holds.
    pub(super) instants: Vec<Option<(f64, usize)>>,
}

/// The linear program.
pub(super) struct Program<'a> {
    windows: &'a Windows,
    /// By error, rate and gain.
    prices: Vec<f64>,
    most: Vec<f64>,
    /// Sizes below it are round-off.
    least: Vec<f64>,
}

/// The standard deviation of the errors of each state's measurement as consecutive residuals show it; 0 where they show none.
pub(super) fn noise(linear: &Linear) -> Vec<f64> {
    let n = linear.states;
    let of_state = |i: usize| {
        let all = linear.holds.len() as f64;
        let mean = linear.holds.iter().map(|hold| hold.residual[i]).sum::<f64>() / all;
        // Products of residuals that are 0, 1 and 2 holds apart.
        let mut sums = [(0.0, 0.0); 3];
        for (k, hold) in linear.holds.iter().enumerate() {
            for (apart, (sum, count)) in sums.iter_mut().enumerate() {
                let Some(other) = k.checked_sub(apart).map(|at| &linear.holds[at]) else { continue };
                if other.episode == hold.episode {
                    *sum += (hold.residual[i] - mean) * (other.residual[i] - mean);
                    *count += 1.0;
                }
            }
        }
        let [own, next, second] = sums.map(|(sum, count)| sum / f64::max(count, 1.0));
        // What changes slowly is the same in both.
        let variance = second - next;
        let count = sums[0].1;
        let by_chance = CHANCE * own * punctual_core::elementary::sqrt(2.0 / f64::max(count, 1.0));
        if variance > by_chance { punctual_core::elementary::sqrt(variance) } else { 0.0 }
    };
    (0..n).map(of_state).collect()
}

impl<'a> Program<'a> {
    /// With the noise that `linear` shows. `effects` are what the inputs do by themselves, by hold, input and state; `scales` the sizes
    /// of the states' rates, and `resolution` the part of them below which nothing is said.
    pub(super) fn new(
        windows: &'a Windows,
        linear: &Linear,
        effects: &[f64],
        scales: &[f64],
        resolution: f64,
    ) -> Self {
        let (n, m) = (linear.states, linear.inputs);
        let noise = noise(linear);
        let mut prices: Vec<f64> = scales.iter().map(|scale| 2.0 / (REACH * scale)).collect();
        prices.extend(scales.iter().map(|scale| 1.0 / scale));
        let price = |j: usize| {
            let mut most = 0.0_f64;
            for (k, hold) in linear.holds.iter().enumerate() {
                for i in 0..n {
                    most = most.max((effects[(k * m + j) * n + i] / (hold.length * scales[i])).abs());
                }
            }
            // An input that does nothing explains nothing.
            (GAIN_PRICE * most).max(1e-3)
        };
        prices.extend((0..m).map(price));
        let mut most: Vec<f64> = noise.iter().map(|sigma| FAR * sigma).collect();
        most.extend(vec![f64::INFINITY; n]);
        most.extend(vec![0.5; m]);
        let least = prices.iter().map(|price| resolution / price).collect();
        Self { windows, prices, most, least }
    }

    /// The sizes of least price that explain every window without a hold that is `left_out`.
    pub(super) fn solve(&self, left_out: &[bool]) -> Sizes {
        let mut limits = self.most.clone();
        let mut active = Vec::new();
        let (mut best, mut duals) = self.solved(left_out, &limits, &mut active);
        let price =
            |sizes: &[f64]| sizes.iter().zip(&self.prices).map(|(size, price)| size * price).sum::<f64>();
        // Fewer sizes are a simpler explanation, the cheapest first.
        let allowed = FEWER * price(&best);
        let mut order: Vec<usize> = (0..best.len()).filter(|v| best[*v] > 0.0).collect();
        order.sort_by(|a, b| (best[*a] * self.prices[*a]).total_cmp(&(best[*b] * self.prices[*b])));
        for v in order {
            let limit = std::mem::replace(&mut limits[v], 0.0);
            let (found, with) = self.solved(left_out, &limits, &mut active);
            if price(&found) <= allowed && self.explains(left_out, &found) {
                (best, duals) = (found, with);
            } else {
                limits[v] = limit;
            }
        }
        for (size, least) in best.iter_mut().zip(&self.least) {
            if *size < *least {
                *size = 0.0;
            }
        }
        self.sizes(&best, &active, &duals)
    }

    /// Whether every condition is met, to round-off.
    fn explains(&self, left_out: &[bool], sizes: &[f64]) -> bool {
        let mut met = true;
        self.windows.each(left_out, |condition| met &= self.lacks(condition, sizes) <= 0.0);
        met
    }

    /// By how much a condition is not met, as a part of what one price gives it.
    fn lacks(&self, condition: &Condition, sizes: &[f64]) -> f64 {
        let given: f64 = condition.coefficients.iter().zip(sizes).map(|(c, size)| c * size).sum();
        let unit =
            condition.coefficients.iter().zip(&self.prices).map(|(c, price)| c / price).fold(0.0, f64::max);
        (condition.size * (1.0 - MET) - given) / unit - 1e-9
    }

    /// The program with the conditions that matter, which are found one after the other and kept in `active`. Also its duals.
    fn solved(&self, left_out: &[bool], limits: &[f64], active: &mut Vec<Condition>) -> (Vec<f64>, Vec<f64>) {
        /// Each round adds the conditions that are met least.
        const ROUNDS: usize = 60;
        let mut sizes = vec![0.0; limits.len()];
        let mut duals = Vec::new();
        for _ in 0..ROUNDS {
            // The worst by state and length.
            let mut worst: BTreeMap<(usize, usize), Vec<(f64, Condition)>> = BTreeMap::new();
            self.windows.each(left_out, |condition| {
                let lacks = self.lacks(condition, &sizes);
                if lacks > 0.0 {
                    let alike = worst.entry((condition.state, condition.holds)).or_default();
                    alike.push((lacks, condition.clone()));
                    if alike.len() > 4 * ALIKE {
                        keep_worst(alike);
                    }
                }
            });
            if worst.is_empty() {
                break;
            }
            for mut alike in worst.into_values() {
                keep_worst(&mut alike);
                active.extend(alike.into_iter().map(|(_, condition)| condition));
            }
            let Some((found, with)) = self.least_price(active, limits) else { break };
            (sizes, duals) = (found, with);
        }
        // What round-off leaves is made up for by the state's own rate.
        let n = limits.len();
        let mut more = vec![0.0_f64; n];
        self.windows.each(left_out, |condition| {
            if self.lacks(condition, &sizes) > 0.0 {
                let given: f64 = condition.coefficients.iter().zip(&sizes).map(|(c, size)| c * size).sum();
                let rate = self.rate_of(condition.state);
                more[rate] = more[rate].max((condition.size - given) / condition.coefficients[rate]);
            }
        });
        sizes
            .iter_mut()
            .zip(&more)
            .zip(limits)
            .for_each(|((size, more), limit)| *size = (*size + more).min(*limit));
        (sizes, duals)
    }

    /// The place of the rate of a state among the sizes.
    fn rate_of(&self, state: usize) -> usize {
        let windows = self.windows.states();
        windows + state
    }

    /// Sizes of least price that meet `conditions` within `limits`, and the duals of the conditions.
    fn least_price(&self, conditions: &[Condition], limits: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
        let open: Vec<usize> = (0..limits.len()).filter(|v| limits[*v] > 0.0).collect();
        // In units of their prices, all sizes count alike.
        let (mut rows, mut columns, mut values, mut right) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut add = |entries: &[(usize, f64)], most: f64| {
            for (column, value) in entries.iter().filter(|(_, value)| *value != 0.0) {
                rows.push(right.len());
                columns.push(*column);
                values.push(*value);
            }
            right.push(most);
        };
        for condition in conditions {
            let unit = |v: usize| condition.coefficients[v] / self.prices[v];
            let largest = open.iter().map(|v| unit(*v)).fold(f64::MIN_POSITIVE, f64::max);
            let entries: Vec<_> = open.iter().enumerate().map(|(at, v)| (at, -unit(*v) / largest)).collect();
            add(&entries, -condition.size / largest);
        }
        for (at, v) in open.iter().enumerate() {
            add(&[(at, -1.0)], 0.0);
            if limits[*v].is_finite() {
                add(&[(at, 1.0)], limits[*v] * self.prices[*v]);
            }
        }
        let none = CscMatrix::zeros((open.len(), open.len()));
        let constraints = CscMatrix::new_from_triplets(right.len(), open.len(), rows, columns, values);
        let settings = DefaultSettings {
            verbose: false,
            max_iter: 200,
            tol_gap_abs: 1e-10,
            tol_gap_rel: 1e-10,
            tol_feas: 1e-10,
            ..DefaultSettings::default()
        };
        let cones = [NonnegativeConeT(right.len())];
        let prices = vec![1.0; open.len()];
        let mut solver = DefaultSolver::new(&none, &prices, &constraints, &right, &cones, settings).ok()?;
        solver.solve();
        let solution = &solver.solution;
        let is_solved = matches!(solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved);
        if !is_solved || !solution.x.iter().all(|x| x.is_finite()) {
            return None;
        }
        let mut sizes = vec![0.0; limits.len()];
        for (v, x) in open.iter().zip(&solution.x) {
            sizes[*v] = x.max(0.0) / self.prices[*v];
        }
        Some((sizes, solution.z[..conditions.len()].to_vec()))
    }

    /// The sizes with the instants that determined them: each that of the condition that asks most of it.
    fn sizes(&self, sizes: &[f64], active: &[Condition], duals: &[f64]) -> Sizes {
        let instant = |v: usize| {
            if sizes[v] == 0.0 {
                return None;
            }
            let share = |(condition, dual): (&Condition, &f64)| {
                let tight = self.lacks(condition, sizes).abs() < 1e-3;
                (
                    dual * condition.coefficients[v] * f64::from(u8::from(tight)),
                    condition.time,
                    condition.holds,
                )
            };
            let shares = active.iter().zip(duals).map(share);
            let most = shares.max_by(|a, b| a.0.total_cmp(&b.0))?;
            (most.0 > 0.0).then_some((most.1, most.2))
        };
        let n = self.windows.states();
        Sizes {
            errors: sizes[..n].to_vec(),
            rates: sizes[n..2 * n].to_vec(),
            gains: sizes[2 * n..].to_vec(),
            instants: (0..sizes.len()).map(instant).collect(),
        }
    }
}

/// Conditions of one state and length that are added at a time.
const ALIKE: usize = 12;

/// Drops all but those that are met least.
fn keep_worst(alike: &mut Vec<(f64, Condition)>) {
    alike.sort_by(|a, b| b.0.total_cmp(&a.0));
    alike.truncate(ALIKE);
}

/// The holds that need most beside the others: one in a thousand, at least one.
pub(super) fn worst(linear: &Linear, scales: &[f64]) -> Vec<bool> {
    let size = |hold: &super::linear::Hold| {
        let parts = hold.residual.iter().zip(scales).map(|(r, scale)| (r / (scale * hold.length)).abs());
        parts.fold(0.0, f64::max)
    };
    let mut order: Vec<(usize, f64)> = linear.holds.iter().map(size).enumerate().collect();
    order.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut out = vec![false; linear.holds.len()];
    order.iter().take(linear.holds.len().div_ceil(1000)).for_each(|(k, _)| out[*k] = true);
    out
}
