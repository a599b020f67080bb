//! The law of a robust plan: reference, gains and radii, by sample; and how gains are found.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::{DMatrix, DVector};

use super::bends::{Bends, size};
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
    /// How far each state may be from the reference there.
    pub(in crate::plan) radii: Vec<Vec<f64>>,
}

impl Tracking {
    /// The number of the hold that begins at `t`, within `slack` s of it.
    pub(in crate::plan) fn at(&self, t: f64, slack: f64) -> Option<usize> {
        let k = self.times.partition_point(|time| *time < t - slack);
        (k < self.inputs.len() && (self.times[k] - t).abs() <= slack).then_some(k)
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

    /// Writes the input at sample `k` for the measured state `x`.
    pub(in crate::plan) fn input(&self, k: usize, x: &[f64], u: &mut [f64]) {
        u.copy_from_slice(&self.inputs[k]);
        let (z, n) = (&self.states[k], x.len());
        for (u, gain) in u.iter_mut().zip(self.gains[k].chunks_exact(n)) {
            *u += gain.iter().zip(x.iter().zip(z)).map(|(gain, (x, z))| gain * (x - z)).sum::<f64>();
        }
    }

    /// The state that is farther from the reference at sample `k` than is possible, if there is one, and by how much. `x` is
    /// measured with at most `errors`.
    pub(in crate::plan) fn escaped(&self, k: usize, x: &[f64], errors: &[f64]) -> Option<(usize, f64)> {
        let beyond = |i: usize| {
            let round_off = 1e-9 * (1.0 + x[i].abs());
            (x[i] - self.states[k][i]).abs() - self.radii[k][i] - errors[i] - round_off
        };
        // NaN has escaped.
        (0..x.len()).map(|i| (i, beyond(i))).find(|(_, beyond)| !(*beyond <= 0.0))
    }
}

/// The length in s over which the inputs show what they can do, for the prices of [`gains`].
const SIGHT: f64 = 1.0;

/// The gains of a feedback along a reference with these `times`, `states` and `inputs`, whose inputs have half the widths
/// `reach`. `part` says which part of that the feedback may take.
///
/// The price of an input is 1 where it is `part` of its reach. That of a state is 1 where it deviates by what such inputs
/// move it in [`SIGHT`], in the mean along the reference: √W_ii with the Gramian W. So no price has a unit of its own. The
/// Riccati equation then runs backwards along the reference.
pub(in crate::plan) fn gains(
    plant: &dyn Predict,
    (times, states, inputs): (&[f64], &[Vec<f64>], &[Vec<f64>]),
    reach: &[f64],
    part: f64,
) -> Option<Vec<Vec<f64>>> {
    let (n, m) = (states.first()?.len(), reach.len());
    let evaluate = |variables: &[Second], out: &mut [Second]| {
        let (x, u) = variables.split_at(n);
        plant.second_rates(x, u, out)
    };
    let bends = Bends::of(n, n + m, evaluate)?;
    let (mut variables, mut rates, mut slopes) = (Vec::new(), vec![Second::from(0.0); n], Vec::new());
    let mut linear = Vec::with_capacity(inputs.len());
    for k in 0..inputs.len() {
        let next = states.get(k + 1).unwrap_or(&states[k]);
        let middle = states[k].iter().zip(next).map(|(a, b)| Interval::from(0.5 * (a + b)));
        let at: Vec<Interval> = middle.chain(inputs[k].iter().map(|u| Interval::from(*u))).collect();
        bends.slopes(&at, (&mut variables, &mut rates), evaluate, &mut slopes);
        if !slopes.iter().all(|slope| size(*slope).is_finite()) {
            return None;
        }
        let slope = |i: usize, j: usize| slopes[i * (n + m) + j].value();
        let hold = times[k + 1] - times[k];
        let a = DMatrix::from_fn(n, n, |i, j| slope(i, j) * hold);
        let [flow, integral] = super::exponential(a.transpose().as_slice(), n);
        let b = DMatrix::from_fn(n, m, |i, j| slope(i, n + j) * hold);
        linear.push((
            DMatrix::from_row_slice(n, n, &flow),
            DMatrix::from_row_slice(n, n, &integral) * b,
            hold,
        ));
    }
    let reserve = DVector::from_iterator(m, reach.iter().map(|reach| part * reach));
    // What the inputs do from sample k on, at a few samples.
    let (mut prices, mut counted) = (DVector::zeros(n), 0.0);
    for k in (0..linear.len()).step_by((linear.len() / 8).max(1)) {
        let (mut gramian, mut at) = (DMatrix::<f64>::zeros(n, n), 0.0);
        for (a, b, hold) in &linear[k..] {
            if at >= SIGHT {
                break;
            }
            let driven = b * DMatrix::from_diagonal(&reserve);
            // Inputs that change all the time: each for a hold, and what is held longer adds up.
            gramian = a * gramian * a.transpose() + &driven * driven.transpose() * (1.0 / hold);
            at += hold;
        }
        if at >= 0.5 * SIGHT || counted == 0.0 {
            let scale = if at > 0.0 { SIGHT / at.min(SIGHT) } else { 1.0 };
            prices += gramian.diagonal() * scale;
            counted += 1.0;
        }
    }
    prices /= counted.max(1.0);
    let largest = prices.max();
    // A state that no input moves has no price.
    let q = DMatrix::from_diagonal(&prices.map(|p| if p > 1e-9 * largest { 1.0 / p } else { 0.0 }));
    let r = DMatrix::from_diagonal(&reserve.map(|u| 1.0 / (u * u)));
    let mut p = &q * 10.0;
    let mut gains = Vec::with_capacity(linear.len());
    for (a, b, hold) in linear.iter().rev() {
        let (before, gain) = riccati(&p, a, b, &(&q * *hold), &(&r * *hold))?;
        p = before;
        let rows: Vec<f64> = gain.transpose().iter().copied().collect();
        if !all_finite(&rows) {
            return None;
        }
        gains.push(rows);
    }
    gains.reverse();
    Some(gains)
}
