//! The gains that explain most of a recording behind a delay and lags.
//!
//! For each delay and each lag the gains follow by least squares, with a constant rate per state beside them. What is minimised is
//! Σ_i ln(mean square residual of state i): the likelihood under noise of unknown size in every state, whose units do not matter.
//! Residuals are those over windows of several holds where noise would hide the inputs otherwise.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use super::arrival::{Arrival, Before, PARTS, means};
use super::linear::{Linear, Predictor};
use super::record::Record;
use crate::error::Error;

/// Residuals below this part of a state's own rates are round-off of numbers and integration.
pub(super) const RESOLUTION: f64 = 1e-7;
/// The spread that a gain is given beforehand: where an input hardly moves, its gain stays near 1.
const PRIOR: f64 = 0.5;
/// How often the gains are fitted anew with the weights that follow from them.
const ROUNDS: usize = 4;

/// A recording to be explained, as seen over windows of `window` holds.
pub(super) struct Fitting<'a> {
    pub(super) record: &'a Record,
    pub(super) linear: Linear,
    /// The size of the rates of each state, in its unit per s.
    pub(super) scales: Vec<f64>,
    pub(super) window: usize,
    /// The residuals without any input: by window and state.
    pub(super) base: Vec<f64>,
    /// What an input does by itself: by input, delay and lag.
    columns: BTreeMap<(usize, u64, u64, bool), Vec<f64>>,
}

/// How well an arrival explains the recording.
#[derive(Clone, Debug)]
pub(super) struct Explained {
    pub(super) arrival: Arrival,
    /// Σ ln of the mean square residuals.
    pub(super) cost: f64,
    /// Sum of the squared residuals without their mean, by state.
    pub(super) squares: Vec<f64>,
}

impl<'a> Fitting<'a> {
    /// Prepares the recording; the inputs are taken to arrive nearly as `arrival` says.
    pub(super) fn new(
        model: &Predictor<'_>,
        record: &'a Record,
        arrival: &Arrival,
        window: Option<usize>,
    ) -> Result<Self, Error> {
        let linear = Linear::new(model, record, arrival)?;
        let scales = scales(record);
        let mut fitting =
            Self { record, linear, scales, window: 1, base: Vec::new(), columns: BTreeMap::new() };
        fitting.window = window.unwrap_or_else(|| fitting.best_window());
        let (n, m) = (fitting.linear.states, fitting.linear.inputs);
        let effects = fitting.linear.effects(&fitting.linear.arriving);
        let mut base: Vec<f64> = fitting.linear.holds.iter().flat_map(|hold| hold.residual.clone()).collect();
        for (k, base) in base.chunks_mut(n).enumerate() {
            for (j, gain) in arrival.gains.iter().enumerate() {
                let effect = &effects[(k * m + j) * n..(k * m + j + 1) * n];
                base.iter_mut().zip(effect).for_each(|(r, b)| *r += gain * b);
            }
        }
        fitting.base = fitting.windowed(&base, fitting.window);
        Ok(fitting)
    }

    /// Holds between the beginnings of two windows.
    pub(super) fn stride(window: usize) -> usize {
        (window / 4).max(1)
    }

    /// The numbers `series`, by hold and state, as they appear over windows of `window` holds.
    pub(super) fn windowed(&self, series: &[f64], window: usize) -> Vec<f64> {
        let n = self.linear.states;
        if window == 1 {
            return series.to_vec();
        }
        let holds = &self.linear.holds;
        let mut seen = Vec::new();
        let mut sum = vec![0.0; n];
        for begin in (0..(holds.len() + 1).saturating_sub(window)).step_by(Self::stride(window)) {
            if holds[begin].episode != holds[begin + window - 1].episode {
                continue;
            }
            sum.fill(0.0);
            for k in begin..begin + window {
                let own = &series[k * n..(k + 1) * n];
                let through = |i: usize| {
                    let row = &holds[k].jacobian[i * n..(i + 1) * n];
                    own[i] + row.iter().zip(&sum).map(|(a, r)| a * r).sum::<f64>()
                };
                sum = (0..n).map(through).collect();
            }
            seen.extend_from_slice(&sum);
        }
        seen
    }

    /// What input `j` does by itself behind a delay and a lag, by hold and state.
    pub(super) fn effect(&self, j: usize, delay: f64, lag: f64, before: Before) -> Vec<f64> {
        let (n, m) = (self.linear.states, self.linear.inputs);
        let series =
            self.record.episodes.iter().flat_map(|e| means(e, j, (delay, lag), before, &self.linear.parts));
        let mut effect = vec![0.0; self.linear.holds.len() * n];
        for (at, mean) in series.enumerate() {
            let (k, s) = (at / PARTS, at % PARTS);
            let response = &self.linear.holds[k].response[(s * m + j) * n..(s * m + j + 1) * n];
            effect[k * n..(k + 1) * n].iter_mut().zip(response).for_each(|(e, g)| *e += g * mean);
        }
        effect
    }

    /// The same over windows, remembered.
    pub(super) fn column(&mut self, j: usize, delay: f64, lag: f64, before: Before) -> &[f64] {
        /// More would take memory.
        const MOST: usize = 64;
        let key = (j, delay.to_bits(), lag.to_bits(), before == Before::First);
        if !self.columns.contains_key(&key) {
            if self.columns.len() >= MOST {
                self.columns.clear();
            }
            let column = self.windowed(&self.effect(j, delay, lag, before), self.window);
            self.columns.insert(key, column);
        }
        &self.columns[&key]
    }

    /// The least mean square that counts, by state.
    pub(super) fn floors(&self) -> Vec<f64> {
        let reach = self.window as f64 * self.record.period;
        self.scales.iter().map(|scale| (RESOLUTION * scale * reach) * (RESOLUTION * scale * reach)).collect()
    }

    /// How many windows there are that do not overlap.
    pub(super) fn independent(&self) -> f64 {
        let windows = self.base.len() / self.linear.states;
        windows as f64 * Self::stride(self.window) as f64 / self.window as f64
    }

    /// The window over which gains and delay are found most accurately: long ones where measurements are noisy, one hold where they
    /// are not.
    fn best_window(&self) -> usize {
        const WINDOWS: [usize; 6] = [1, 2, 4, 8, 16, 32];
        /// A longer window has to be better by this factor.
        const BETTER: f64 = 0.7;
        let (n, m, holds) = (self.linear.states, self.linear.inputs, self.linear.holds.len());
        let residuals: Vec<f64> = self.linear.holds.iter().flat_map(|hold| hold.residual.clone()).collect();
        let at_once: Vec<_> = (0..m).map(|j| self.effect(j, 0.0, 0.0, Before::First)).collect();
        let by = 0.25 * self.record.period;
        let mut late = vec![0.0; residuals.len()];
        for (j, effect) in at_once.iter().enumerate() {
            let delayed = self.effect(j, by, 0.0, Before::First);
            late.iter_mut()
                .zip(delayed.iter().zip(effect))
                .for_each(|(l, (d, e))| *l += (d - e) / by * self.record.period);
        }
        let mut best = (1, f64::INFINITY);
        for window in WINDOWS {
            let reach = window as f64 * self.record.period;
            if window > 1 && (reach > 1.0 || holds < 20 * window) {
                break;
            }
            let left = self.windowed(&residuals, window);
            let windows = left.len() / n;
            let squares =
                |series: &[f64], i: usize| series.iter().skip(i).step_by(n).map(|v| v * v).sum::<f64>();
            // Information on each of them by itself, under the residual as noise.
            let informed = |series: &[f64]| {
                let seen = self.windowed(series, window);
                let of_state = |i: usize| {
                    let floor = RESOLUTION * self.scales[i] * reach;
                    squares(&seen, i) / (squares(&left, i) / windows as f64 + floor * floor)
                };
                (0..n).map(of_state).sum::<f64>() * Self::stride(window) as f64 / window as f64
            };
            let inverse = at_once.iter().chain([&late]).map(|series| 1.0 / informed(series).max(1e-9));
            let spread = punctual_core::elementary::sqrt(inverse.sum::<f64>());
            if spread < BETTER * best.1 {
                best = (window, spread);
            }
        }
        best.0
    }

    /// Fits the gains that are `free` to the delay and lags of `arrival`; the others stay.
    pub(super) fn fitted(&mut self, arrival: &Arrival, free: &[bool]) -> Explained {
        let (n, m) = (self.linear.states, self.linear.inputs);
        let (floors, windows) = (self.floors(), self.base.len() / n);
        let mut columns = Vec::with_capacity(m);
        for j in 0..m {
            columns.push(self.column(j, arrival.delay, arrival.lags[j], arrival.before).to_vec());
        }
        // Without their means over the windows, since a constant rate is no matter of an input.
        let centred = |series: &mut [f64]| {
            for i in 0..n {
                let mean = series.iter().skip(i).step_by(n).sum::<f64>() / windows as f64;
                series.iter_mut().skip(i).step_by(n).for_each(|value| *value -= mean);
            }
        };
        let mut rest = self.base.clone();
        centred(&mut rest);
        columns.iter_mut().for_each(|column| centred(column));
        let squares = |gains: &[f64]| {
            let mut squares = vec![0.0; n];
            for (at, base) in rest.iter().enumerate() {
                let left =
                    base - columns.iter().zip(gains).map(|(column, gain)| gain * column[at]).sum::<f64>();
                squares[at % n] += left * left;
            }
            squares
        };
        let mut gains = arrival.gains.clone();
        let open: Vec<usize> = (0..m).filter(|j| free[*j]).collect();
        let mut found = squares(&gains);
        // The weights are those of the residuals, which follow from the gains.
        for _ in 0..if open.is_empty() { 0 } else { ROUNDS } {
            let weights: Vec<f64> =
                found.iter().zip(&floors).map(|(s, floor)| 1.0 / (s / windows as f64 + floor)).collect();
            let mut normal = DMatrix::<f64>::zeros(open.len(), open.len());
            let mut right = DVector::<f64>::zeros(open.len());
            for at in 0..rest.len() {
                let weight = weights[at % n];
                let fixed = (0..m).filter(|j| !free[*j]).map(|j| gains[j] * columns[j][at]).sum::<f64>();
                for (r, j) in open.iter().enumerate() {
                    right[r] += weight * columns[*j][at] * (rest[at] - fixed);
                    for (c, other) in open.iter().enumerate().take(r + 1) {
                        normal[(r, c)] += weight * columns[*j][at] * columns[*other][at];
                    }
                }
            }
            for r in 0..open.len() {
                normal[(r, r)] += 1.0 / (PRIOR * PRIOR);
                right[r] += 1.0 / (PRIOR * PRIOR);
                for c in 0..r {
                    normal[(c, r)] = normal[(r, c)];
                }
            }
            let Some(solved) = normal.cholesky().map(|factors| factors.solve(&right)) else { break };
            open.iter().zip(solved.iter()).for_each(|(j, gain)| gains[*j] = *gain);
            found = squares(&gains);
        }
        let cost = found
            .iter()
            .zip(&floors)
            .map(|(s, floor)| punctual_core::elementary::ln(s / windows as f64 + floor));
        Explained { cost: cost.sum(), arrival: Arrival { gains, ..arrival.clone() }, squares: found }
    }
}

/// The size of the rates of each state: the root of the mean square over a fifth of a second, at least of six holds.
fn scales(record: &Record) -> Vec<f64> {
    let reach = ((0.2 / record.period).round() as usize).max(6);
    let scale = |i: usize| {
        let (mut sum, mut count, mut largest) = (0.0, 0.0, 0.0_f64);
        for episode in &record.episodes {
            let series = &episode.states[i];
            largest = series.iter().fold(largest, |most, value| most.max(value.abs()));
            let reach = reach.min(episode.holds());
            for k in reach..series.len() {
                let rate = (series[k] - series[k - reach]) / (reach as f64 * record.period);
                sum += rate * rate;
                count += 1.0;
            }
        }
        let scale = punctual_core::elementary::sqrt(sum / f64::max(count, 1.0));
        // A state that stays where it is.
        scale.max(1e-6 * largest).max(1e-9)
    };
    (0..record.states.len()).map(scale).collect()
}
