//! The delay, lags and gains that explain most of a recording.
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
/// A parameter is kept if the logarithm of the likelihood falls by more than this without it: four standard deviations.
const SIGNIFICANT: f64 = 8.0;
/// And if it explains at least this part of what everything explains.
const WORTHWHILE: f64 = 0.002;
/// Below these a parameter is that of the model: parts of a hold for delays and lags, and of 1 for gains.
const NEGLIGIBLE: [f64; 2] = [0.01, 1e-3];
/// Delays and lags are found to this part of a hold.
const FINEST: f64 = 2e-5;
/// Standard deviations by which a fitted number may be off.
pub(super) const DEVIATIONS: f64 = 3.0;
/// Part of a hold by which a delay may be off a whole number of holds.
const NEARLY: f64 = 0.01;
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
    base: Vec<f64>,
    /// What an input does by itself: by input, delay and lag.
    columns: BTreeMap<(usize, u64, u64, bool), Vec<f64>>,
}

/// How well an arrival explains the recording.
#[derive(Clone, Debug)]
pub(super) struct Explained {
    pub(super) arrival: Arrival,
    /// Σ ln of the mean square residuals.
    cost: f64,
    /// Sum of the squared residuals without their mean, by state.
    squares: Vec<f64>,
}

/// What may be sought, with the largest values in s.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sought {
    pub(super) delay: f64,
    pub(super) lag: f64,
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
    fn stride(window: usize) -> usize {
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
    fn column(&mut self, j: usize, delay: f64, lag: f64, before: Before) -> &[f64] {
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
    fn floors(&self) -> Vec<f64> {
        let reach = self.window as f64 * self.record.period;
        self.scales.iter().map(|scale| (RESOLUTION * scale * reach) * (RESOLUTION * scale * reach)).collect()
    }

    /// How many windows there are that do not overlap.
    fn independent(&self) -> f64 {
        let windows = self.base.len() / self.linear.states;
        windows as f64 * Self::stride(self.window) as f64 / self.window as f64
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

/// What may differ from the model's in a search.
#[derive(Clone, Debug)]
pub(super) struct Active {
    pub(super) delay: bool,
    pub(super) lags: Vec<bool>,
    pub(super) gains: Vec<bool>,
}

/// The standard deviations of what was fitted, as far as the residuals are noise.
#[derive(Clone, Debug)]
pub(super) struct Spread {
    /// Of the delay, in s.
    pub(super) delay: f64,
    /// Of the lags, in s.
    pub(super) lags: Vec<f64>,
    /// Of the gains.
    pub(super) gains: Vec<f64>,
}

impl Fitting<'_> {
    /// The delay and lags of least cost near `from`, and the gains that belong to them: a pattern search that halves its step.
    fn searched(&mut self, from: &Arrival, active: &Active, sought: Sought, step: f64) -> Explained {
        let mut best = self.fitted(from, &active.gains);
        let lags: Vec<usize> = (0..from.lags.len()).filter(|j| active.lags[*j]).collect();
        let finest = FINEST * self.record.period;
        let mut step = step;
        while step > finest {
            let cost = best.cost;
            // Along each, and along delay for lag, since both are late.
            let mut moves: Vec<(f64, Option<usize>, f64)> = Vec::new();
            for sign in [step, -step] {
                moves.extend(active.delay.then_some((sign, None, 0.0)));
                moves.extend(lags.iter().map(|j| (0.0, Some(*j), sign)));
                if active.delay {
                    moves.extend(lags.iter().map(|j| (sign, Some(*j), -sign)));
                }
            }
            for (later, lag, slower) in moves {
                let mut tried = best.arrival.clone();
                tried.delay = (tried.delay + later).clamp(0.0, sought.delay);
                if let Some(j) = lag {
                    tried.lags[j] = (tried.lags[j] + slower).clamp(0.0, sought.lag);
                }
                if tried == best.arrival {
                    continue;
                }
                let found = self.fitted(&tried, &active.gains);
                if found.cost < best.cost - 1e-12 {
                    best = found;
                }
            }
            if best.cost >= cost - 1e-9 {
                step /= 2.0;
            }
        }
        best
    }

    /// The best of a grid of delays, of lags common to all inputs, and of lags of each input, refined.
    fn anywhere(&mut self, sought: Sought) -> Explained {
        let m = self.linear.inputs;
        let (period, all) = (self.record.period, vec![true; m]);
        let mut starts = vec![Arrival::nominal(m)];
        let mut late = vec![0.25 * period, 0.5 * period];
        while late.last().is_some_and(|last| 1.5 * last < sought.delay.max(sought.lag)) {
            late.push(1.5 * late.last().copied().unwrap_or(period));
        }
        for by in late.into_iter().chain([sought.delay, sought.lag]) {
            if by <= sought.delay {
                starts.push(Arrival { delay: by, ..Arrival::nominal(m) });
            }
            if by <= sought.lag && by > 0.0 {
                starts.push(Arrival { lags: vec![by; m], ..Arrival::nominal(m) });
                let of_one = |j: usize| (0..m).map(|i| if i == j { by } else { 0.0 }).collect();
                starts.extend(
                    (0..m).filter(|_| m > 1).map(|j| Arrival { lags: of_one(j), ..Arrival::nominal(m) }),
                );
            }
        }
        let both = |start: &Arrival| {
            [Before::Nothing, Before::First].map(|before| Arrival { before, ..start.clone() })
        };
        let mut found: Vec<Explained> =
            starts.iter().flat_map(both).map(|start| self.fitted(&start, &all)).collect();
        found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        // Beginnings of different kinds lead to different valleys.
        const STARTS: usize = 3;
        let active = Active { delay: sought.delay > 0.0, lags: vec![sought.lag > 0.0; m], gains: all };
        let refined =
            found.into_iter().take(STARTS).map(|f| self.searched(&f.arrival, &active, sought, period));
        let refined: Vec<_> = refined.collect();
        let best = refined.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
        best.unwrap_or_else(|| self.fitted(&Arrival::nominal(m), &active.gains))
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

    /// Σ over the states of the squares of `explained` in units of the mean squares of `best`.
    fn size(&self, explained: &Explained, best: &Explained) -> f64 {
        let windows = (self.base.len() / self.linear.states) as f64;
        let floors = self.floors();
        let terms = explained.squares.iter().zip(&best.squares).zip(floors);
        terms.map(|((square, best), floor)| square / (best / windows + floor)).sum()
    }

    /// The same explanation with everything removed that is not seen in the recording or explains next to nothing.
    fn reduced(&mut self, mut best: Explained, sought: Sought) -> (Explained, Active) {
        let m = self.linear.inputs;
        let period = self.record.period;
        let mut active = Active {
            delay: best.arrival.delay > NEGLIGIBLE[0] * period,
            lags: best.arrival.lags.iter().map(|lag| *lag > NEGLIGIBLE[0] * period).collect(),
            gains: best.arrival.gains.iter().map(|gain| (gain - 1.0).abs() > NEGLIGIBLE[1]).collect(),
        };
        let without = |active: &Active, from: &Arrival, i: usize| {
            let (mut active, mut arrival) = (active.clone(), from.clone());
            match i {
                0 => (active.delay, arrival.delay) = (false, 0.0),
                i if i <= m => (active.lags[i - 1], arrival.lags[i - 1]) = (false, 0.0),
                i => (active.gains[i - 1 - m], arrival.gains[i - 1 - m]) = (false, 1.0),
            }
            (active, arrival)
        };
        // What is negligible goes at once.
        for i in 0..=2 * m {
            let is_active = match i {
                0 => active.delay,
                i if i <= m => active.lags[i - 1],
                i => active.gains[i - 1 - m],
            };
            if !is_active {
                (_, best.arrival) = without(&active, &best.arrival, i);
            }
        }
        let all = self.fitted(&best.arrival, &active.gains);
        let nominal =
            self.fitted(&Arrival { before: best.arrival.before, ..Arrival::nominal(m) }, &vec![false; m]);
        let most = self.size(&nominal, &all) - self.size(&all, &all);
        best = all.clone();
        loop {
            let mut least: Option<(f64, Explained, Active)> = None;
            for i in 0..=2 * m {
                let is_active = match i {
                    0 => active.delay,
                    i if i <= m => active.lags[i - 1],
                    i => active.gains[i - 1 - m],
                };
                if !is_active {
                    continue;
                }
                let (fewer, arrival) = without(&active, &best.arrival, i);
                let found = self.searched(&arrival, &fewer, sought, 0.25 * period);
                if least.as_ref().is_none_or(|(cost, ..)| found.cost < *cost) {
                    least = Some((found.cost, found, fewer));
                }
            }
            let Some((cost, found, fewer)) = least else { break };
            let is_seen = (cost - best.cost) * 0.5 * self.independent() > SIGNIFICANT;
            let is_worth = self.size(&found, &all) - self.size(&best, &all) > WORTHWHILE * most;
            if is_seen && is_worth {
                break;
            }
            (best, active) = (found, fewer);
        }
        (best, active)
    }

    /// The standard deviations of the lags and gains that are `active`, and 0 for the others.
    fn spread(&mut self, explained: &Explained, active: &Active) -> Spread {
        let (n, m) = (self.linear.states, self.linear.inputs);
        let arrival = &explained.arrival;
        let by = 0.02 * self.record.period;
        // The derivatives of the residuals, by what they are of: the delay, then lags, then gains.
        let mut columns = Vec::new();
        let mut late = vec![0.0; self.base.len()];
        for j in 0..m {
            let gain = arrival.gains[j];
            let own = self.column(j, arrival.delay, arrival.lags[j], arrival.before).to_vec();
            let slope =
                |later: &[f64]| own.iter().zip(later).map(|(a, b)| gain * (b - a) / by).collect::<Vec<_>>();
            let later = slope(self.column(j, arrival.delay + by, arrival.lags[j], arrival.before));
            late.iter_mut().zip(&later).for_each(|(sum, part)| *sum += part);
            if active.lags[j] {
                columns.push((
                    1 + j,
                    slope(self.column(j, arrival.delay, arrival.lags[j] + by, arrival.before)),
                ));
            }
            if active.gains[j] {
                columns.push((1 + m + j, own));
            }
        }
        if active.delay {
            columns.push((0, late));
        }
        let windows = self.base.len() / n;
        let weights: Vec<f64> = explained
            .squares
            .iter()
            .zip(self.floors())
            .map(|(s, floor)| 1.0 / (s / windows as f64 + floor))
            .collect();
        let normal = DMatrix::from_fn(columns.len(), columns.len(), |r, c| {
            let products = columns[r].1.iter().zip(&columns[c].1).enumerate();
            products.map(|(at, (a, b))| weights[at % n] * a * b).sum::<f64>()
        });
        let overlap = self.window as f64 / Self::stride(self.window) as f64;
        let mut spread = Spread { delay: 0.0, lags: vec![0.0; m], gains: vec![0.0; m] };
        if let Some(factors) = normal.cholesky() {
            let covariance = factors.inverse();
            for (at, (of, _)) in columns.iter().enumerate() {
                let size = punctual_core::elementary::sqrt((covariance[(at, at)] * overlap).max(0.0));
                match *of {
                    0 => spread.delay = size,
                    of if of <= m => spread.lags[of - 1] = size,
                    of => spread.gains[of - 1 - m] = size,
                }
            }
        }
        spread
    }
}

/// The delay, lags and gains that explain most of `record`, as far as it shows them, and their standard deviations.
///
/// # Errors
///
/// A model that does not hold where the recording is.
pub(super) fn fit(
    model: &Predictor<'_>,
    record: &Record,
    sought: Sought,
) -> Result<(Arrival, Spread), Error> {
    /// How often the predictions are made anew where the search has led.
    const ROUNDS: usize = 3;
    let m = record.inputs.len();
    let mut fitting = Fitting::new(model, record, &Arrival::nominal(m), None)?;
    let window = fitting.window;
    let all = Active { delay: sought.delay > 0.0, lags: vec![sought.lag > 0.0; m], gains: vec![true; m] };
    let mut best = fitting.anywhere(sought);
    for _ in 1..ROUNDS {
        fitting = Fitting::new(model, record, &best.arrival, Some(window))?;
        best = fitting.searched(&best.arrival, &all, sought, 0.1 * record.period);
    }
    let (mut reduced, mut active) = fitting.reduced(best, sought);
    // Most delays are of whole steps: those that may be are.
    let whole = (reduced.arrival.delay / record.period).round() * record.period;
    let off = (reduced.arrival.delay - whole).abs();
    let may_be = off <= (DEVIATIONS * fitting.spread(&reduced, &active).delay).max(NEARLY * record.period);
    if active.delay && may_be && whole <= sought.delay * (1.0 + 1e-9) {
        (active.delay, reduced.arrival.delay) = (false, whole);
    }
    let mut last = reduced;
    for step in [0.05, 0.01, 0.002] {
        fitting = Fitting::new(model, record, &last.arrival, Some(window))?;
        last = fitting.searched(&last.arrival, &active, sought, step * record.period);
    }
    let spread = fitting.spread(&last, &active);
    Ok((last.arrival, spread))
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
