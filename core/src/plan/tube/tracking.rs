//! The law of a robust plan: reference, gains and radii, by sample; and how gains are found.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::{DMatrix, DVector};

use super::bends::{Bends, size};
use crate::elementary;
use crate::interval::Interval;
use crate::lie::{Predict, Second};
use crate::plan::law::riccati;
use crate::scalar::{Scalar, all_finite};

/// u = v_k + K_k (x̂ − z_k) at sample k, held until the next: keeps the plant in the tube that was checked.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Tracking {
    /// The time of every sample in s, and the end of the last hold.
    pub(in crate::plan) times: Vec<f64>,
    /// The input of every hold.
    pub(in crate::plan) inputs: Vec<Vec<f64>>,
    /// The reference at every sample.
    pub(in crate::plan) states: Vec<Vec<f64>>,
    /// The gain at every sample, by input and state; empty where the input is held as it is.
    pub(in crate::plan) gains: Vec<Vec<f64>>,
    /// How far each measured state may be from the reference there; anywhere in the hold, if samples may be late.
    pub(in crate::plan) radii: Vec<Vec<f64>>,
}

impl Tracking {
    /// The time of every sample in s, and the end of the last hold.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The input v of every hold.
    pub fn inputs(&self) -> &[Vec<f64>] {
        &self.inputs
    }

    /// The reference z at every sample.
    pub fn states(&self) -> &[Vec<f64>] {
        &self.states
    }

    /// The gain K at every sample, one row of numbers by state for each input, one row after the other. Empty for 0.
    pub fn gains(&self) -> &[Vec<f64>] {
        &self.gains
    }

    /// How far each measured state may be from the reference at every sample, or during its hold if samples may be late.
    pub fn radii(&self) -> &[Vec<f64>] {
        &self.radii
    }

    /// The number of the hold that begins at `t`, within `slack` s of it.
    pub(in crate::plan) fn at(&self, t: f64, slack: f64) -> Option<usize> {
        let k = self.times.partition_point(|time| *time < t - slack);
        (k < self.inputs.len() && (self.times[k] - t).abs() <= slack).then_some(k)
    }

    /// The number of the hold at `t`, within `slack` s.
    pub(in crate::plan) fn during(&self, t: f64, slack: f64) -> Option<usize> {
        let k = self.times.partition_point(|time| *time <= t + slack).checked_sub(1)?;
        (k < self.inputs.len()).then_some(k)
    }

    /// The length in s of its longest hold.
    pub(in crate::plan) fn longest_hold(&self) -> f64 {
        self.times.windows(2).map(|hold| hold[1] - hold[0]).fold(0.0, f64::max)
    }

    /// The gain of the hold that begins at `t`, or of the last one.
    pub(in crate::plan) fn gain_at(&self, t: f64, slack: f64) -> Option<&[f64]> {
        let k = self.times.partition_point(|time| *time < t - slack).min(self.gains.len().checked_sub(1)?);
        // The first hold of a plan behind an input has none.
        [k, k + 1]
            .into_iter()
            .filter_map(|k| self.gains.get(k))
            .map(Vec::as_slice)
            .find(|gain| !gain.is_empty())
    }

    /// Whether it belongs to a plant with `states` states and `inputs` inputs.
    pub(in crate::plan) fn fits(&self, states: usize, inputs: usize) -> bool {
        let is_of = |rows: &[Vec<f64>], count: usize, length: usize| {
            rows.len() == count && rows.iter().all(|row| row.len() == length && all_finite(row))
        };
        let holds = self.inputs.len();
        let are_gains = self.gains.len() == holds
            && self.gains.iter().all(|g| (g.is_empty() || g.len() == states * inputs) && all_finite(g));
        self.times.len() == holds + 1
            && all_finite(&self.times)
            && self.times.is_sorted_by(|a, b| a < b)
            && is_of(&self.inputs, holds, inputs)
            && is_of(&self.states, holds, states)
            && is_of(&self.radii, holds, states)
            && are_gains
    }

    /// Writes the input in hold `k` for the measured state `x`, where the reference is `z`.
    pub(in crate::plan) fn input(&self, (k, z): (usize, &[f64]), x: &[f64], u: &mut [f64]) {
        u.copy_from_slice(&self.inputs[k]);
        let n = x.len();
        for (u, gain) in u.iter_mut().zip(self.gains[k].chunks_exact(n)) {
            *u += gain.iter().zip(x.iter().zip(z)).map(|(gain, (x, z))| gain * (x - z)).sum::<f64>();
        }
    }

    /// The state that is farther from the reference `z` in hold `k` than is possible, if there is one, and by how much.
    pub(in crate::plan) fn escaped(&self, (k, z): (usize, &[f64]), x: &[f64]) -> Option<(usize, f64)> {
        let beyond = |i: usize| {
            let round_off = 1e-9 * (1.0 + x[i].abs());
            (x[i] - z[i]).abs() - self.radii[k][i] - round_off
        };
        // NaN has escaped.
        (0..x.len()).map(|i| (i, beyond(i))).find(|(_, beyond)| *beyond > 0.0 || beyond.is_nan())
    }
}

/// The length in s over which the inputs show what they can do, for the prices of [`gains`].
const SIGHT: f64 = 1.0;
/// The part of the feedback of an input, of half the width of its bounds, that has the price 1.
const PART: f64 = 0.25;
/// Factors on the prices of the states that an input moves at once, and of the others, that are tried in turn. With the first
/// a vehicle is damped; with the second it is held more tightly, with the third more loosely, as a slow motor needs it.
pub(in crate::plan) const PRICES: [[f64; 2]; 3] = [[2.0, 0.4], [1.0, 1.0], [0.5, 0.1]];
/// A state is moved at once if its rate, for as long as one sees, is at least this part of what moves it in that time.
const AT_ONCE: f64 = 0.3;

/// The gains of a feedback along a reference with these `times`, `states` and `inputs`, whose inputs have half the widths
/// `reach`; one set for each of [`PRICES`].
///
/// The price of an input is 1 where it is a part of its reach. That of a state is 1 where it deviates by what such inputs move
/// it at most in the time one sees: √W_ii with the Gramian W. So no price has a unit of its own. The Riccati equation then
/// runs backwards along the reference.
pub(in crate::plan) fn gains(
    plant: &dyn Predict,
    (times, states, inputs): (&[f64], &[Vec<f64>], &[Vec<f64>]),
    reach: &[f64],
) -> Vec<Vec<Vec<f64>>> {
    let (n, m) = (states[0].len(), reach.len());
    let evaluate = |variables: &[Second], out: &mut [Second]| {
        let (x, u) = variables.split_at(n);
        plant.second_rates(x, u, out)
    };
    let Some(bends) = Bends::of(n, n + m, evaluate) else { return Vec::new() };
    let (mut variables, mut rates, mut slopes) = (Vec::new(), vec![Second::from(0.0); n], Vec::new());
    let mut linear = Vec::with_capacity(inputs.len());
    for k in 0..inputs.len() {
        let middle = states[k].iter().zip(&states[k + 1]).map(|(a, b)| Interval::from(0.5 * (a + b)));
        let at: Vec<Interval> = middle.chain(inputs[k].iter().map(|u| Interval::from(*u))).collect();
        bends.slopes(&at, (&mut variables, &mut rates), evaluate, &mut slopes);
        if !slopes.iter().all(|slope| size(*slope).is_finite()) {
            return Vec::new();
        }
        let slope = |i: usize, j: usize| slopes[i * (n + m) + j].value();
        let hold = times[k + 1] - times[k];
        let drift: Vec<f64> = (0..n * n).map(|k| slope(k / n, k % n) * hold).collect();
        let [flow, integral] = super::exponential(&drift, n).map(|rows| DMatrix::from_row_slice(n, n, &rows));
        let driven = integral * DMatrix::from_fn(n, m, |i, j| slope(i, n + j) * hold);
        linear.push((flow, driven, hold));
    }
    let part = DMatrix::from_diagonal(&DVector::from_iterator(m, reach.iter().map(|reach| PART * reach)));
    // What the inputs do from a few samples on, and what they do at once.
    let (mut gramians, mut speeds) = (DVector::zeros(n), DVector::<f64>::zeros(n));
    for k in (0..linear.len()).step_by((linear.len() / 8).max(1)) {
        let (mut gramian, mut at) = (DMatrix::<f64>::zeros(n, n), 0.0);
        for (flow, driven, hold) in &linear[k..] {
            if at >= SIGHT {
                break;
            }
            // Inputs that change all the time, as noise does.
            let driven = driven * &part;
            speeds = speeds.zip_map(&(driven.column_sum().abs() / *hold), f64::max);
            gramian = flow * gramian * flow.transpose() + &driven * driven.transpose() / *hold;
            at += hold;
        }
        gramians = gramian.diagonal().zip_map(&gramians, f64::max);
    }
    let largest = gramians.max();
    let r = part.map_diagonal(|part| 1.0 / (part * part));
    PRICES
        .iter()
        .filter_map(|[at_once, later]| {
            let price = |i: usize| {
                // A state that no input moves has no price.
                if gramians[i] <= 1e-9 * largest {
                    return 0.0;
                }
                let is_at_once = speeds[i] * SIGHT >= AT_ONCE * elementary::sqrt(gramians[i] * SIGHT);
                (if is_at_once { at_once } else { later }) / gramians[i]
            };
            let q = DMatrix::from_diagonal(&DVector::from_fn(n, |i, _| price(i)));
            let (r, mut p) = (DMatrix::from_diagonal(&r), &q * 10.0);
            let mut gains = Vec::with_capacity(linear.len());
            for (flow, driven, hold) in linear.iter().rev() {
                let (before, gain) = riccati(&p, flow, driven, &(&q * *hold), &(&r * *hold))?;
                p = before;
                let rows: Vec<f64> = gain.transpose().iter().copied().collect();
                if !all_finite(&rows) {
                    return None;
                }
                gains.push(rows);
            }
            gains.reverse();
            Some(gains)
        })
        .collect()
}
