//! A plant within what a filter declares: how it deviates from the model is drawn, by a seed.
//!
//! It is for tests of a promise. No file has it and no FMU: a campaign or a run puts it into the plant that it simulates.

use std::collections::BTreeMap;

use super::{FilterConfiguration, PlantConfiguration, UncertaintySection};

/// How the deviations of a plant change with time; the number is that of the parameter [`Deviation::KIND`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviationKind {
    /// Anything within what is declared, constant in a run.
    Constant = 1,
    /// Anything within what is declared, for a time of its own that each deviation has.
    Changing = 2,
    /// Each at one of its ends: always, in turn, or by chance, for a time of its own.
    Corners = 3,
}

impl DeviationKind {
    /// All of them, by number.
    pub const ALL: [Self; 3] = [Self::Constant, Self::Changing, Self::Corners];
}

/// How a plant may deviate from its model, as the filter declares it, and which deviations are drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Deviation {
    /// The largest size of what is added to the rate of each state, in its unit per s.
    pub rates: Vec<f64>,
    /// The least and the largest part of each input that arrives.
    pub gains: Vec<[f64; 2]>,
    /// The least and the largest time constant in s with which each input is followed.
    pub lags: Vec<[f64; 2]>,
    /// The largest error of each measured state, in its unit.
    pub errors: Vec<f64>,
    /// The time in s until an input acts, beside what the coupling takes.
    pub delay: f64,
    /// The time in s between samples.
    pub step: f64,
    /// The filter that declares it. Its barriers are evaluated at the state as it is.
    pub filter: Box<FilterConfiguration>,
    /// The seed of what is drawn, a whole number.
    pub seed: f64,
    /// The number of a [`DeviationKind`].
    pub kind: f64,
}

impl Deviation {
    /// The parameter of the plant with the seed.
    pub const SEED: &str = "uncertainty.seed";
    /// The parameter of the plant with the number of the kind.
    pub const KIND: &str = "uncertainty.kind";

    /// The delay that `filter` declares alone, with samples `step` s apart.
    pub fn late(filter: &FilterConfiguration, step: f64) -> Self {
        let mut exact = filter.clone();
        (exact.uncertainty, exact.measurement_errors) = (None, BTreeMap::new());
        Self::of(&exact, step, 0.0)
    }

    /// What `filter` declares, with samples `step` s apart, in a coupling that hands an input on `late` s after its sample.
    pub fn of(filter: &FilterConfiguration, step: f64, late: f64) -> Self {
        let none = UncertaintySection::default();
        let declared = filter.uncertainty.as_deref().unwrap_or(&none);
        let (states, inputs) = (filter.plant.states(), filter.plant.inputs());
        let input = |name: &str| declared.inputs.get(name);
        let remaining = filter.actuation_delay - late;
        Self {
            rates: states.iter().map(|s| declared.rates.get(&s.name).copied().unwrap_or(0.0)).collect(),
            gains: inputs.iter().map(|i| input(&i.name).map_or([1.0, 1.0], |of| of.gain)).collect(),
            lags: inputs.iter().map(|i| input(&i.name).map_or([0.0, 0.0], |of| of.lag)).collect(),
            errors: filter.errors(),
            // Round-off is no delay.
            delay: if remaining > 1e-9 * late { remaining } else { 0.0 },
            step,
            filter: Box::new(filter.clone()),
            seed: 0.0,
            kind: f64::from(DeviationKind::Corners as u8),
        }
    }
}

impl PlantConfiguration {
    /// The same plant, deviating as drawn.
    #[must_use]
    pub fn deviating(self, deviation: Deviation) -> Self {
        Self { deviation: Some(Box::new(deviation)), ..self }
    }
}
