//! The observed deviation of the plant from its model: the difference between the measured state and the one that the model
//! predicts under the inputs given, per second. It is used to bound the effect of the next hold
//! (`docs/guarantees.md#will-it-always`).

use alloc::vec;
use alloc::vec::Vec;

use super::settings::DECISIONS;

#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Deviation {
    /// When the present measuring interval began, in s, at a measured state.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub(super) since: f64,
    /// The state predicted by the model from there until the last sample.
    pub(super) state: Vec<f64>,
    /// The rate of deviation of each state over the last interval, in its unit per s.
    last: Vec<f64>,
    /// The largest rate that was seen twice in a row in the same direction: a plant that was displaced once, or there and
    /// back, does not count as deviating for ever.
    rates: Vec<f64>,
}

impl Deviation {
    /// Starts at the state `x`, measured at `t`.
    pub(super) fn from(t: f64, x: &[f64]) -> Self {
        Self { since: t, state: x.to_vec(), last: vec![0.0; x.len()], rates: vec![0.0; x.len()] }
    }

    /// Compares the state `x` at `t` with `state`, which the model predicts. If x is not measured (`None`), the prediction
    /// is continued.
    pub(super) fn see(&mut self, t: f64, x: Option<&[f64]>, state: Vec<f64>, period: f64) {
        self.state = state;
        let stretch = t - self.since;
        let Some(x) = x.filter(|_| stretch >= DECISIONS.stretch * period) else { return };
        for (((rate, last), state), x) in self.rates.iter_mut().zip(&mut self.last).zip(&self.state).zip(x) {
            // A prediction that is not finite carries no information.
            let now = (x - state) / stretch;
            let now = if now.is_finite() { now } else { 0.0 };
            if now * *last > 0.0 {
                *rate = rate.max(last.abs().min(now.abs()));
            }
            *last = now;
        }
        self.since = t;
        self.state.copy_from_slice(x);
    }

    /// Whether the plant, now at `x`, was not where the model led over the last `hold` s.
    pub(super) fn is_displaced(&self, hold: f64, x: &[f64]) -> bool {
        self.last.iter().zip(x).any(|(last, x)| last.abs() * hold > DECISIONS.covered * (1.0 + x.abs()))
    }

    /// By how much each state may deviate from the model after `hold` s; `None` if every plan has a margin for it at `x`.
    pub(super) fn after(&self, hold: f64, x: &[f64]) -> Option<Vec<f64>> {
        let differs = self.rates.iter().map(|rate| rate * hold);
        let is_covered =
            differs.clone().zip(x).all(|(differs, x)| differs <= DECISIONS.covered * (1.0 + x.abs()));
        (!is_covered).then(|| differs.collect())
    }

    /// Whether it belongs to a plant with `states` states.
    pub(super) fn fits(&self, states: usize) -> bool {
        let Self { since, state, last, rates } = self;
        let are_rates = |rates: &[f64]| rates.len() == states && rates.iter().all(|rate| rate.is_finite());
        let are_sizes = rates.iter().all(|rate| *rate >= 0.0);
        since.is_finite() && state.len() == states && are_rates(last) && are_rates(rates) && are_sizes
    }
}
