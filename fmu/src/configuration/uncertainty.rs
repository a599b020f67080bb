//! `[uncertainty]` of a filter: how the plant may differ from the model. Only plans account for it.

use std::collections::BTreeMap;

use punctual_core::filter::Plans;
use serde::{Deserialize, Serialize};

use super::barrier::BarrierSection;
use super::key::{
    Key, Section,
    Unit::{Is, Of},
    Value::{Number, NumberByName, Pair, TableByName},
};
use super::names::check_known;
use super::{ConfigurationError, FilterConfiguration, Parameter, PlantSection, Range, over_seconds};
use crate::text::{number, quantity};

/// The size of what may be added to a rate.
const RATE: Range = Range::NON_NEGATIVE;
/// The part of an input that arrives.
const GAIN: Range = Range::POSITIVE;
/// The time constant with which an input is followed.
const LAG: Range = Range::NON_NEGATIVE;
/// The part of a step by which a sample may be late.
const JITTER: Range = Range::NON_NEGATIVE;
/// All of it.
const ALL: [f64; 2] = [1.0, 1.0];
/// At once.
const AT_ONCE: [f64; 2] = [0.0, 0.0];

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
    /// By how much of a step the next one may come late.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub jitter: f64,
}

/// Whether nothing is declared.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_zero(number: &f64) -> bool {
    *number == 0.0
}

/// An entry of `inputs` in `[uncertainty]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct UncertainInput {
    /// The least and the largest part of the input that arrives.
    #[serde(default = "all")]
    pub gain: [f64; 2],
    /// The least and the largest time constant in s with which what arrives follows what is asked.
    #[serde(default)]
    pub lag: [f64; 2],
}

fn all() -> [f64; 2] {
    ALL
}

/// `[uncertainty]`.
pub(super) static SECTION: Section = Section {
    name: "uncertainty",
    keys: || {
        static KEYS: [Key; 3] = [
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
            Key::new(
                "jitter",
                Number(Is("1"), JITTER),
                Some("0: every step comes as expected"),
                "the part of a step by which the next one may come late; it may also come at any time before. For loops with a \
                 measured clock, and for masters with steps of several lengths",
            ),
        ];
        KEYS.iter().collect()
    },
};

/// An entry of `inputs`.
pub(super) static INPUT: Section = Section {
    name: "uncertain_input",
    keys: || {
        static KEYS: [Key; 2] = [
            Key::new(
                "gain",
                Pair(Is("1"), GAIN),
                Some("`[1, 1]`: all of it"),
                "`[least, largest]` part of the input that arrives, constant or not; least ≤ largest",
            ),
            Key::new(
                "lag",
                Pair(Is("s"), LAG),
                Some("`[0, 0]`: at once"),
                "`[least, largest]` time constant with which what arrives follows what is asked, as a motor does; least ≤ largest",
            ),
        ];
        KEYS.iter().collect()
    },
};

impl UncertaintySection {
    /// Refuses names that the plant does not have.
    pub(super) fn check(&self, plant: &PlantSection) -> Result<(), ConfigurationError> {
        check_known("uncertainty.rates", &self.rates, "state", &plant.states())?;
        check_known("uncertainty.inputs", &self.inputs, "input", &plant.inputs())
    }

    /// Refuses an interval that is from more to less.
    pub(super) fn check_intervals(&self) -> Result<(), ConfigurationError> {
        let intervals = self.inputs.iter().flat_map(|(name, input)| {
            [("gain", input.gain), ("lag", input.lag)].map(|(key, interval)| (name, key, interval))
        });
        match intervals.into_iter().find(|(.., [least, largest])| least > largest) {
            None => Ok(()),
            Some((name, key, interval)) => {
                let [least, largest] = interval.map(number);
                let message = format!(
                    "is [{least}, {largest}], must be [least, largest] with least <= largest (in an FMU: \
                     uncertainty.{key}_min.{name}, uncertainty.{key}_max.{name})"
                );
                Err(ConfigurationError::new(format!("uncertainty.inputs.{name}.{key}"), message))
            }
        }
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
        let lag = |name: &str| self.inputs.get(name).map_or(AT_ONCE, |input| input.lag);
        let lags: Vec<[f64; 2]> = plant.inputs().iter().map(|input| lag(&input.name)).collect();
        if lags.iter().any(|lag| *lag != AT_ONCE) {
            plans = plans.uncertain_lags(&lags);
        }
        plans.jitter(self.jitter)
    }

    /// Its numbers that are parameters of the FMU: those that the file states.
    pub(super) fn parameters(&self, plant: &PlantSection) -> Vec<Parameter<FilterConfiguration>> {
        type Declared = FilterConfiguration;
        let mut rows = Vec::new();
        if self.jitter > 0.0 {
            let names = ("uncertainty.jitter".to_string(), "uncertainty.jitter".to_string());
            let description = "part of a step by which the next one may come late".to_string();
            rows.push(Parameter::new(names, "1", JITTER, description, |c: &mut Declared| {
                Some(&mut c.uncertainty.as_mut()?.jitter)
            }));
        }
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
                let name = input.name.clone();
                let path = format!("uncertainty.inputs.{name}.lag[{}]", side + 1);
                let description =
                    format!("{of} time constant with which the {} is followed", input.description);
                let names = (format!("uncertainty.{}.{name}", word.replace("gain", "lag")), path);
                rows.push(Parameter::new(names, "s", LAG, description, move |c: &mut Declared| {
                    c.uncertainty.as_mut()?.inputs.get_mut(&name).map(|input| &mut input.lag[side])
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
            || self
                .uncertainty
                .as_ref()
                .is_some_and(|of| !of.rates.is_empty() || !of.inputs.is_empty() || of.jitter > 0.0)
    }

    /// The tables that declare this, in words.
    pub(super) fn declarations(&self) -> String {
        let errors = (!self.measurement_errors.is_empty()).then_some("[measurement_errors]");
        let uncertainty = self.uncertainty.as_ref().map(|_| "[uncertainty]");
        errors.into_iter().chain(uncertainty).collect::<Vec<_>>().join(" and ")
    }

    /// The part of a step by which the next one may come late, as it is declared.
    pub fn jitter(&self) -> f64 {
        self.uncertainty.as_deref().map_or(0.0, |declared| declared.jitter)
    }

    /// For which plants plans keep the promises: rates, measurement errors, gains, lags, a delay and late steps, in words. Empty if for the model alone.
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
        let lags = self.plant.inputs().into_iter().filter_map(|input| {
            let [least, largest] = declared.inputs.get(&input.name)?.lag;
            let late = format!("lag of {} {} to {} s", input.name, number(least), number(largest));
            (largest > 0.0).then_some(late)
        });
        let delay = (self.actuation_delay > 0.0).then(|| format!("delay {} s", number(self.actuation_delay)));
        let jitter = (declared.jitter > 0.0)
            .then(|| format!("steps up to {} of a step late", number(declared.jitter)));
        let rates = rates.map(|(what, sizes)| format!("{what} {sizes}"));
        rates.chain(gains).chain(lags).chain(delay).chain(jitter).collect()
    }

    /// However which points move plans keep clear of them, or inside: in words.
    pub fn covered_points(&self) -> Vec<String> {
        let motion = |barrier: &BarrierSection| {
            let motion = barrier.shape.followed()?.motion()?;
            let errors = [(motion.position_error, "m"), (motion.velocity_error, "m/s")];
            let errors = errors.into_iter().filter(|(error, _)| *error > 0.0);
            let errors: Vec<_> = errors.map(|(error, unit)| quantity(error, unit)).collect();
            let errors =
                if errors.is_empty() { String::new() } else { format!(", errors {}", errors.join(", ")) };
            let acceleration = quantity(motion.acceleration, "m/s2");
            Some(format!("acceleration of the centre of {} {acceleration}{errors}", barrier.name))
        };
        self.barrier.iter().filter_map(motion).collect()
    }
}
