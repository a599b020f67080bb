//! `[uncertainty]` of a filter: how the plant may differ from the model. Only plans account for it.

use std::collections::BTreeMap;

use punctual_core::filter::Plans;
use serde::{Deserialize, Serialize};

use super::key::{
    Key, Section,
    Unit::{Is, Of},
    Value::{NumberByName, Pair, TableByName},
};
use super::names::check_known;
use super::{ConfigurationError, FilterConfiguration, Parameter, PlantSection, Range, over_seconds};
use crate::text::{number, quantity};

/// The size of what may be added to a rate.
const RATE: Range = Range::NON_NEGATIVE;
/// The part of an input that arrives.
const GAIN: Range = Range::POSITIVE;
/// All of it.
const ALL: [f64; 2] = [1.0, 1.0];

/// `[uncertainty]`: the promises hold for every plant within it.
/// docs/configuration.md has ranges and defaults.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct UncertaintySection {
    /// What may be added to the rate of a state at any time, by name, in its unit per s.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub rates: BTreeMap<String, f64>,
    /// What arrives of an input, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub inputs: BTreeMap<String, UncertainInput>,
}

/// An entry of `inputs` in `[uncertainty]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct UncertainInput {
    /// The least and the largest part of the input that arrives.
    #[serde(default = "all")]
    pub gain: [f64; 2],
}

fn all() -> [f64; 2] {
    ALL
}

/// `[uncertainty]`.
pub(super) static SECTION: Section = Section {
    name: "uncertainty",
    keys: || {
        static KEYS: [Key; 2] = [
            Key::new(
                "rates",
                NumberByName(Of("unit of the state per s"), RATE),
                Some("nothing"),
                "what may be added to the rate of a state at any time, by name: wind, a slope, what the model leaves out",
            ),
            Key::new(
                "inputs",
                TableByName(&INPUT),
                Some("all of each arrives"),
                "what arrives of an input, by name: the next table",
            ),
        ];
        KEYS.iter().collect()
    },
};

/// An entry of `inputs`.
pub(super) static INPUT: Section = Section {
    name: "uncertain_input",
    keys: || {
        static KEYS: [Key; 1] = [Key::new(
            "gain",
            Pair(Is("1"), GAIN),
            Some("`[1, 1]`: all of it"),
            "`[least, largest]` part of the input that arrives, constant or not; least ≤ largest",
        )];
        KEYS.iter().collect()
    },
};

impl UncertaintySection {
    /// Refuses names that the plant does not have.
    pub(super) fn check(&self, plant: &PlantSection) -> Result<(), ConfigurationError> {
        check_known("uncertainty.rates", &self.rates, "state", &plant.states())?;
        check_known("uncertainty.inputs", &self.inputs, "input", &plant.inputs())
    }

    /// Refuses a least part that exceeds the largest one.
    pub(super) fn check_gains(&self) -> Result<(), ConfigurationError> {
        let Some((name, input)) = self.inputs.iter().find(|(_, input)| input.gain[0] > input.gain[1]) else {
            return Ok(());
        };
        let [least, largest] = input.gain.map(number);
        let message = format!(
            "is [{least}, {largest}], must be [least, largest] with least <= largest (in an FMU: uncertainty.gain_min.{name}, \
             uncertainty.gain_max.{name})"
        );
        Err(ConfigurationError::new(format!("uncertainty.inputs.{name}.gain"), message))
    }

    /// `plans` for every plant within it.
    pub(super) fn declared(&self, plant: &PlantSection, mut plans: Plans) -> Plans {
        let rate = |name: &str| self.rates.get(name).copied().unwrap_or(0.0);
        let gain = |name: &str| self.inputs.get(name).map_or(ALL, |input| input.gain);
        let rates: Vec<f64> = plant.states().iter().map(|state| rate(&state.name)).collect();
        let gains: Vec<[f64; 2]> = plant.inputs().iter().map(|input| gain(&input.name)).collect();
        if rates.iter().any(|rate| *rate != 0.0) {
            plans = plans.uncertain_rates(&rates);
        }
        if gains.iter().any(|gain| *gain != ALL) {
            plans = plans.uncertain_gains(&gains);
        }
        plans
    }

    /// Its numbers that are parameters of the FMU: those that the file states.
    pub(super) fn parameters(&self, plant: &PlantSection) -> Vec<Parameter<FilterConfiguration>> {
        type Declared = FilterConfiguration;
        let mut rows = Vec::new();
        for state in plant.states().into_iter().filter(|state| self.rates.contains_key(&state.name)) {
            let name = state.name;
            let names = (format!("uncertainty.rate.{name}"), format!("uncertainty.rates.{name}"));
            let description =
                format!("largest size of what is added to the rate of the {}", state.description);
            let unit = over_seconds(&state.unit, 1);
            rows.push(Parameter::new(names, unit, RATE, description, move |c: &mut Declared| {
                c.uncertainty.as_mut()?.rates.get_mut(&name)
            }));
        }
        for input in plant.inputs().into_iter().filter(|input| self.inputs.contains_key(&input.name)) {
            for (side, word, of) in [(0, "gain_min", "least"), (1, "gain_max", "largest")] {
                let name = input.name.clone();
                let path = format!("uncertainty.inputs.{name}.gain[{}]", side + 1);
                let description = format!("{of} part that arrives of the {}", input.description);
                let names = (format!("uncertainty.{word}.{name}"), path);
                rows.push(Parameter::new(names, "1", GAIN, description, move |c: &mut Declared| {
                    c.uncertainty.as_mut()?.inputs.get_mut(&name).map(|input| &mut input.gain[side])
                }));
            }
        }
        rows
    }
}

/// What a file says.
impl FilterConfiguration {
    /// Whether the file declares that the plant may differ from the model, or its measurements from the state. Plans then
    /// have an end.
    pub(super) fn declares_uncertainty(&self) -> bool {
        !self.measurement_errors.is_empty()
            || self.uncertainty.as_ref().is_some_and(|of| !of.rates.is_empty() || !of.inputs.is_empty())
    }

    /// The tables that declare this, in words.
    pub(super) fn declarations(&self) -> String {
        let errors = (!self.measurement_errors.is_empty()).then_some("[measurement_errors]");
        let uncertainty = self.uncertainty.as_ref().map(|_| "[uncertainty]");
        errors.into_iter().chain(uncertainty).collect::<Vec<_>>().join(" and ")
    }

    /// For which plants plans keep the promises: rates, measurement errors and gains, in words. Empty if for the model alone.
    pub fn covered(&self) -> Vec<String> {
        let none = UncertaintySection::default();
        let declared = self.uncertainty.as_deref().unwrap_or(&none);
        let sizes = |sizes: &BTreeMap<String, f64>, degree: usize| {
            let given = self.plant.states().into_iter().filter_map(|state| {
                let size = sizes.get(&state.name).filter(|size| **size > 0.0)?;
                Some(format!("{} {}", state.name, quantity(*size, &over_seconds(&state.unit, degree))))
            });
            given.collect::<Vec<_>>().join(", ")
        };
        let gains = self.plant.inputs().into_iter().filter_map(|input| {
            let [least, largest] = declared.inputs.get(&input.name)?.gain;
            let part = format!("gain of {} {} to {}", input.name, number(least), number(largest));
            ([least, largest] != ALL).then_some(part)
        });
        let rates = [
            ("rates", sizes(&declared.rates, 1)),
            ("measurement errors", sizes(&self.measurement_errors, 0)),
        ];
        let rates = rates.into_iter().filter(|(_, sizes)| !sizes.is_empty());
        rates.map(|(what, sizes)| format!("{what} {sizes}")).chain(gains).collect()
    }
}
