//! Whether what is declared contains a recording: for every hold there are errors, a lag, a gain and a rate within the bounds that lead
//! from the one sample to the next.
//!
//! This knows nothing of how the bounds were found. What arrives of an input is enclosed however its lag varies; what states and
//! inputs within the bounds add is the sum of their sizes.

use super::arrival::{PARTS, enclosures, parts};
use super::linear::{Changes, Hold, Predictor};
use super::record::Record;
use crate::error::Error;

/// Round-off, as a part of what is compared.
const ROUND_OFF: f64 = 1e-9;

/// Bounds on how a plant differs from its model, as a filter's file declares them.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Bounds {
    /// In s.
    pub(super) delay: f64,
    /// Least and largest time constant in s, by input.
    pub(super) lags: Vec<[f64; 2]>,
    /// Least and largest part that acts, by input.
    pub(super) gains: Vec<[f64; 2]>,
    /// In the unit of the state per s, by state.
    pub(super) rates: Vec<f64>,
    /// In the unit of the state, by state.
    pub(super) errors: Vec<f64>,
}

/// What a check found.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Checked {
    /// Holds that the bounds explain.
    pub(super) explained: usize,
    /// By how much the rate of each state is too small for the others.
    pub(super) missing: Vec<f64>,
}

/// Checks every hold of `record`.
///
/// # Errors
///
/// A model that does not hold where the recording is.
pub(super) fn check(model: &Predictor<'_>, record: &Record, bounds: &Bounds) -> Result<Checked, Error> {
    let (n, m) = (record.states.len(), record.inputs.len());
    let mut checked = Checked { explained: 0, missing: vec![0.0; n] };
    let (changes, parts) = (Changes::of(record), parts(bounds.delay, record.period));
    for (e, episode) in record.episodes.iter().enumerate() {
        let arriving: Vec<_> =
            (0..m).map(|j| enclosures(episode, j, bounds.delay, bounds.lags[j], &parts)).collect();
        for k in 0..episode.holds() {
            let (mut acting, mut spread) = (vec![0.0; PARTS * m], vec![0.0; PARTS * m]);
            for at in 0..PARTS * m {
                let [low, high] = arriving[at % m][k * PARTS + at / m];
                let products = bounds.gains[at % m].map(|gain| [gain * low, gain * high]);
                let ends = products.as_flattened().iter().copied();
                let least = ends.clone().fold(f64::INFINITY, f64::min);
                let most = ends.fold(f64::NEG_INFINITY, f64::max);
                (acting[at], spread[at]) = (0.5 * (least + most), 0.5 * (most - least));
            }
            let hold = Hold::new(model, record, (e, k), (&acting, &parts), &changes)?;
            let mut all = true;
            for i in 0..n {
                let row = &hold.jacobian[i * n..(i + 1) * n];
                // The first sample is off, and so is the second.
                let errors = row.iter().zip(&bounds.errors).map(|(a, error)| a.abs() * error).sum::<f64>();
                let inputs: f64 = (0..PARTS * m).map(|at| hold.response[at * n + i].abs() * spread[at]).sum();
                let reach = |j: usize| 0.5 * hold.length * (row[j].abs() + f64::from(u8::from(i == j)));
                let rates: f64 = (0..n).map(|j| reach(j) * bounds.rates[j]).sum();
                let size = hold.residual[i].abs();
                let scale = episode.states[i][k].abs().max(episode.states[i][k + 1].abs());
                let lacking =
                    size - (errors + bounds.errors[i] + inputs + rates) - ROUND_OFF * (size + scale);
                if lacking > 0.0 {
                    all = false;
                    checked.missing[i] = checked.missing[i].max(lacking / reach(i));
                }
            }
            checked.explained += usize::from(all);
        }
    }
    Ok(checked)
}
