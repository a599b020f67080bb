//! Each hold, predicted with the model from the recorded state, and how the prediction depends on state and inputs.
//!
//! With the recorded states x_k and the means a_s of what arrives over the parts s of a hold, the residual is
//!
//! ρ_k = x_{k+1} − φ(x_k, a),   and for other inputs   ρ_k(b) = ρ_k(a) − Σ_s G_s (b_s − a_s),
//!
//! with G_s = ∂φ/∂a_s. An error e of the measurements and a rate w beside the model make ρ_k = e_{k+1} − A e_k + ∫ w, with
//! A = ∂φ/∂x. So over several holds the errors in between cancel: R ← A R + ρ_k.

use punctual_core::dynamics::DynPlant;

use super::arrival::{Arrival, PARTS, Parts, means, parts};
use super::record::Record;
use crate::error::Error;

/// The change of a state for difference quotients, as a part of its size.
const STATE_CHANGE: f64 = 1e-5;
/// The change of an input, as a part of its size. The model is affine in it.
const INPUT_CHANGE: f64 = 1e-3;

/// The model, and the step with which it is integrated.
pub(super) struct Predictor<'a> {
    plant: &'a dyn DynPlant,
    /// Runge-Kutta steps in each part of a hold.
    steps: usize,
}

impl<'a> Predictor<'a> {
    /// With steps of at most `inner_step` s.
    pub(super) fn new(plant: &'a dyn DynPlant, period: f64, inner_step: f64) -> Self {
        /// More would take minutes and change nothing that a recording shows.
        const MOST: f64 = 64.0;
        let steps = (period / PARTS as f64 / inner_step * (1.0 - 1e-6)).ceil().clamp(1.0, MOST);
        Self { plant, steps: steps as usize }
    }

    /// Advances `x` by `length` s, under the inputs `u`.
    fn part(&self, x: &mut [f64], u: &[f64], length: f64) -> Result<(), Error> {
        let step = length / self.steps as f64;
        for _ in 0..self.steps {
            let done = self.plant.rk4_step(x, u, step);
            done.map_err(|e| Error::configuration(e.field(), e.message()))?;
        }
        Ok(())
    }

    /// Advances `x` over a hold of `length` s, under the inputs `u`.
    pub(super) fn held(&self, x: &mut [f64], u: &[f64], length: f64) -> Result<(), Error> {
        (0..PARTS).try_for_each(|_| self.part(x, u, length / PARTS as f64))
    }

    /// Advances `x` over the parts of a hold of `length` s from part `from` on. `acting` has the means of the inputs, by part and
    /// then by input.
    fn advance(
        &self,
        x: &mut [f64],
        acting: &[f64],
        (length, parts): (f64, &Parts),
        from: usize,
    ) -> Result<(), Error> {
        let each = acting.chunks(self.plant.input_dim()).zip(parts.windows(2)).skip(from);
        each.into_iter().try_for_each(|(u, ends)| self.part(x, u, length * (ends[1] - ends[0])))
    }
}

/// One hold and its prediction.
pub(super) struct Hold {
    /// When it begins, in s, and in which episode.
    pub(super) time: f64,
    pub(super) episode: usize,
    /// In s.
    pub(super) length: f64,
    /// ρ: what is found less what is predicted, by state.
    pub(super) residual: Vec<f64>,
    /// A, row by row.
    pub(super) jacobian: Vec<f64>,
    /// G: by part, then input, then state.
    pub(super) response: Vec<f64>,
}

/// The holds of a record, predicted with inputs that arrive in one way.
pub(super) struct Linear {
    pub(super) states: usize,
    pub(super) inputs: usize,
    pub(super) holds: Vec<Hold>,
    /// The parts of every hold.
    pub(super) parts: Parts,
    /// What arrives, without its gain: by hold, part and input.
    pub(super) arriving: Vec<f64>,
}

/// The changes of states and inputs for difference quotients.
pub(super) struct Changes {
    states: Vec<f64>,
    inputs: Vec<f64>,
}

impl Changes {
    /// Small against what was recorded.
    pub(super) fn of(record: &Record) -> Self {
        let size = |series: &mut dyn Iterator<Item = f64>| {
            let largest = series.fold(0.0, |most: f64, value| most.max(value.abs()));
            if largest > 0.0 { largest } else { 1.0 }
        };
        let state = |i: usize| size(&mut record.episodes.iter().flat_map(|e| e.states[i].iter().copied()));
        let input = |j: usize| size(&mut record.input_range(j).into_iter());
        Self {
            states: (0..record.states.len()).map(|i| STATE_CHANGE * state(i)).collect(),
            inputs: (0..record.inputs.len()).map(|j| INPUT_CHANGE * input(j)).collect(),
        }
    }
}

impl Linear {
    /// Predicts each hold of `record`.
    ///
    /// # Errors
    ///
    /// A state that the model leads to numbers that are not finite, with its time.
    pub(super) fn new(model: &Predictor<'_>, record: &Record, arrival: &Arrival) -> Result<Self, Error> {
        let (states, inputs) = (record.states.len(), record.inputs.len());
        let sizes = Changes::of(record);
        let parts = parts(arrival.delay, record.period);
        let mut all = Self { states, inputs, holds: Vec::new(), parts, arriving: Vec::new() };
        for (e, episode) in record.episodes.iter().enumerate() {
            let means: Vec<Vec<f64>> = (0..inputs)
                .map(|j| means(episode, j, (arrival.delay, arrival.lags[j]), arrival.before, &parts))
                .collect();
            for k in 0..episode.holds() {
                let begin = all.arriving.len();
                for s in 0..PARTS {
                    all.arriving.extend(means.iter().map(|means| means[k * PARTS + s]));
                }
                let mut acting = all.arriving[begin..].to_vec();
                for (value, gain) in acting.iter_mut().zip(arrival.gains.iter().cycle()) {
                    *value *= gain;
                }
                all.holds.push(Hold::new(model, record, (e, k), (&acting, &parts), &sizes)?);
            }
        }
        Ok(all)
    }

    /// What the inputs do over a hold if they arrive as `arriving`: by hold, input and state.
    pub(super) fn effects(&self, arriving: &[f64]) -> Vec<f64> {
        let (n, m) = (self.states, self.inputs);
        let mut effects = vec![0.0; self.holds.len() * m * n];
        for (k, hold) in self.holds.iter().enumerate() {
            let effects = &mut effects[k * m * n..(k + 1) * m * n];
            let arriving = &arriving[k * PARTS * m..(k + 1) * PARTS * m];
            for (s, arriving) in arriving.chunks(m).enumerate() {
                for (j, a) in arriving.iter().enumerate() {
                    let response = &hold.response[(s * m + j) * n..(s * m + j + 1) * n];
                    effects[j * n..(j + 1) * n].iter_mut().zip(response).for_each(|(e, g)| *e += g * a);
                }
            }
        }
        effects
    }
}

impl Hold {
    /// Hold `k` of episode `e`, predicted under the means `acting` of the inputs, by part and then by input.
    pub(super) fn new(
        model: &Predictor<'_>,
        record: &Record,
        (e, k): (usize, usize),
        (acting, parts): (&[f64], &Parts),
        changes: &Changes,
    ) -> Result<Self, Error> {
        let episode = &record.episodes[e];
        let (x, next) = (episode.state(k), episode.state(k + 1));
        let (n, m) = (x.len(), record.inputs.len());
        let length = episode.times[k + 1] - episode.times[k];
        // The states before each part.
        let mut before = vec![x.clone()];
        let mut end = x.clone();
        for (u, ends) in acting.chunks(m).zip(parts.windows(2)) {
            model.part(&mut end, u, length * (ends[1] - ends[0]))?;
            before.push(end.clone());
        }
        if let Some(i) = end.iter().position(|x| !x.is_finite()) {
            let (name, t) = (&record.states[i].name, punctual_fmu::text::number(episode.times[k]));
            let message = format!(
                "leads {name} to {} after the sample at t = {t} s: the model does not hold there; cut those rows off",
                end[i]
            );
            return Err(Error::configuration("plant", message));
        }
        let residual = next.iter().zip(&end).map(|(next, end)| next - end).collect();
        let quotient =
            |ends: &[Vec<f64>; 2], change: f64, r: usize| (ends[0][r] - ends[1][r]) / (2.0 * change);
        let mut jacobian = vec![0.0; n * n];
        for i in 0..n {
            let change = changes.states[i];
            let mut ends = [x.clone(), x.clone()];
            for (moved, sign) in ends.iter_mut().zip([change, -change]) {
                moved[i] += sign;
                model.advance(moved, acting, (length, parts), 0)?;
            }
            (0..n).for_each(|r| jacobian[r * n + i] = quotient(&ends, change, r));
        }
        let mut response = vec![0.0; PARTS * m * n];
        let mut changed = acting.to_vec();
        for at in 0..PARTS * m {
            let (s, change) = (at / m, changes.inputs[at % m]);
            let mut ends = [before[s].clone(), before[s].clone()];
            for (moved, sign) in ends.iter_mut().zip([change, -change]) {
                changed[at] = acting[at] + sign;
                model.advance(moved, &changed, (length, parts), s)?;
            }
            changed[at] = acting[at];
            (0..n).for_each(|r| response[at * n + r] = quotient(&ends, change, r));
        }
        Ok(Self { time: episode.times[k], episode: e, length, residual, jacobian, response })
    }
}
