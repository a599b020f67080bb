//! The search for delay and lags, and what of them a recording shows.
//!
//! A grid finds the valleys, a pattern search their lowest points. Then what is negligible goes, what noise hides, and what explains next to
//! nothing: fewer uncertainties leave a plan more room.

use nalgebra::DMatrix;

use super::arrival::{Arrival, Before};
use super::fit::{Explained, Fitting};
use super::linear::Predictor;
use super::record::Record;
use crate::error::Error;

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

/// What may be sought, with the largest values in s.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sought {
    pub(super) delay: f64,
    pub(super) lag: f64,
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
        let is_active = |active: &Active, i: usize| match i {
            0 => active.delay,
            i if i <= m => active.lags[i - 1],
            i => active.gains[i - 1 - m],
        };
        // What is negligible goes at once.
        for i in 0..=2 * m {
            if !is_active(&active, i) {
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
                if !is_active(&active, i) {
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
