//! `[integrator]` of a filter: a state of its model that is commanded and not measured.

use std::cell::RefCell;

use punctual_core::filter::{Filter, Integration, Plans};
use punctual_models::mentions;
use serde::{Deserialize, Serialize};

use super::adding::MixedDegree;
use super::filter::{AssuranceName, listed};
use super::key::{
    Key, Section,
    Unit::{Is, Of},
    Value::{Name, Number},
};
use super::{
    ConfigurationError, FilterConfiguration, Parameter, PlantSection, Range, UNBOUNDED, VariableSection,
};

/// `[integrator]`: dynamic extension inside the filter. The plant outside has this state of the filter's model for its
/// input; the filter solves for its rate and integrates that itself ([`Filter`]).
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct IntegratorSection {
    /// The integrated state: one whose derivative is an input alone, such as `beta` of `bicycle_small_slip_rate`.
    /// Bounds of that input bound the rate.
    pub state: String,
    /// Rate in 1/s, > 0, at which it follows `u_ref.<state>` where no constraint is in the way. Default 2.
    #[serde(default = "gain")]
    pub gain: f64,
    /// Its smallest value, in its unit. Default: none (-1e30).
    #[serde(default = "none_below")]
    pub min: f64,
    /// Its largest value. Default: none (1e30).
    #[serde(default = "none_above")]
    pub max: f64,
}

fn gain() -> f64 {
    2.0
}

fn none_below() -> f64 {
    -UNBOUNDED
}

fn none_above() -> f64 {
    UNBOUNDED
}

const GAIN: Range = Range::POSITIVE;
const LIMIT: Range = Range { min: Some(-UNBOUNDED), max: Some(UNBOUNDED) };

/// `[integrator]`.
pub(super) static SECTION: Section = Section {
    name: "integrator",
    keys: || {
        static KEYS: [Key; 4] = [
            Key::new("state", Name, None, "such as `delta` of `bicycle_kinematic`"),
            Key::new(
                "gain",
                Number(Is("1/s"), GAIN),
                Some("2"),
                "how fast it follows `u_ref.<state>` if no constraint interferes",
            ),
            Key::new("min", Number(Of("in its unit"), LIMIT), Some("none"), "its smallest value"),
            Key::new("max", Number(Of("in its unit"), LIMIT), Some("none"), "its largest value"),
        ];
        KEYS.iter().collect()
    },
};

impl IntegratorSection {
    /// Least and largest value of the state, infinite where there is none.
    fn limits(&self) -> [f64; 2] {
        [self.min, self.max].map(|v| if v.abs() >= UNBOUNDED { v.signum() * f64::INFINITY } else { v })
    }

    /// The number of the state, and that of the input that is its rate.
    pub(super) fn place(&self, plant: &PlantSection) -> Result<(usize, usize), ConfigurationError> {
        let (states, inputs, derivatives) = (plant.states(), plant.inputs(), plant.derivatives());
        let rate = |i: usize| {
            let input = inputs.iter().position(|input| input.name == derivatives[i].trim())?;
            let name = &inputs[input].name;
            let alone = derivatives.iter().enumerate().all(|(k, text)| k == i || !mentions(text, name));
            alone.then_some(input)
        };
        let rates: Vec<_> = (0..derivatives.len()).filter_map(|i| Some((i, rate(i)?))).collect();
        if let Some(place) = rates.iter().find(|(i, _)| states[*i].name == self.state) {
            return Ok(*place);
        }
        let names: Vec<_> = rates.iter().map(|(i, _)| states[*i].name.as_str()).collect();
        let known = if names.is_empty() { "none here".to_owned() } else { names.join(", ") };
        let message = format!(
            "is {:?}, must be a state whose derivative is an input that moves nothing else: {known}",
            self.state
        );
        Err(ConfigurationError::new("integrator.state", message))
    }

    pub(super) fn parameters(&self, plant: &PlantSection) -> Vec<Parameter<FilterConfiguration>> {
        let state = plant.states().into_iter().find(|s| s.name == self.state);
        let (unit, description) = state.map_or_else(Default::default, |s| (s.unit, s.description));
        type Access = fn(&mut IntegratorSection) -> &mut f64;
        let row = |name: String, field: &str, unit: String, range, meaning: String, access: Access| {
            let names = (name, format!("integrator.{field}"));
            Parameter::new(names, unit, range, meaning, move |c: &mut FilterConfiguration| {
                c.integrator.as_mut().map(access)
            })
        };
        let (least, largest) = (format!("u_min.{}", self.state), format!("u_max.{}", self.state));
        let limit = |word: &str| format!("{word} {description} (no bound: {UNBOUNDED:e} in size)");
        let follows = format!("how fast the filter's {} follows what is wanted", self.state);
        vec![
            row(least, "min", unit.clone(), LIMIT, limit("smallest"), |i| &mut i.min),
            row(largest, "max", unit, LIMIT, limit("largest"), |i| &mut i.max),
            row("integrator.gain".into(), "gain", "1/s".into(), GAIN, follows, |i| &mut i.gain),
        ]
    }
}

impl FilterConfiguration {
    /// The measured states: those of the plant but the integrated one.
    pub fn measured_states(&self) -> Vec<VariableSection> {
        let integrated = |s: &VariableSection| self.integrator.as_ref().is_some_and(|i| i.state == s.name);
        self.plant.states().into_iter().filter(|s| !integrated(s)).collect()
    }

    /// Of the numbers `x`, one for each state of the plant, those that are [measured](Self::measured_states).
    pub fn measured(&self, x: &[f64]) -> Vec<f64> {
        let states = self.plant.states();
        let is_measured = |name: &str| self.integrator.as_ref().is_none_or(|i| i.state != name);
        x.iter().zip(states).filter(|(_, state)| is_measured(&state.name)).map(|(x, _)| *x).collect()
    }

    /// The bounds of a signal that the filter [hands out](Self::commanded), where it has both.
    pub fn limits(&self, name: &str) -> Option<[f64; 2]> {
        self.limits_given(name).filter(|limits| limits.iter().all(|limit| limit.abs() < UNBOUNDED))
    }

    /// What such a signal lacks of its bounds, in words.
    pub(super) fn lacking(&self, name: &str) -> &'static str {
        match self.limits_given(name).map(|limits| limits.map(|limit| limit.abs() < UNBOUNDED)) {
            Some([true, false]) => "no upper bound",
            Some([false, true]) => "no lower bound",
            _ => "no bounds",
        }
    }

    fn limits_given(&self, name: &str) -> Option<[f64; 2]> {
        let integrator = self.integrator.as_ref().filter(|i| i.state == name);
        integrator.map(IntegratorSection::limits).or(self.bounds.get(name).copied())
    }

    /// The signals that the filter hands out and is asked for: the inputs of the plant, the integrated state in
    /// place of its rate.
    pub fn commanded(&self) -> Vec<VariableSection> {
        let mut inputs = self.plant.inputs();
        if let Some((state, input)) = self.integrator.as_ref().and_then(|i| i.place(&self.plant).ok()) {
            inputs[input] = self.plant.states().swap_remove(state);
        }
        inputs
    }

    /// The filter with its plans or its integrator, if it has them.
    ///
    /// # Errors
    ///
    /// A number out of range, or numbers that contradict each other.
    pub fn build_loop(&self) -> Result<Filter, ConfigurationError> {
        if self.is_assured() {
            match self.assured(self.build()?) {
                Ok(filter) => return Ok(filter),
                Err(reason) if self.assurance == AssuranceName::On => {
                    let message = format!("is \"on\", must be \"off\": {reason}");
                    return Err(ConfigurationError::new("assurance", message));
                }
                // A number that was set since asks for what no plan accounts for.
                Err(_) => {}
            }
        }
        // Rows alone need every input in the same derivative.
        let filter = self.built(MixedDegree::Refused)?;
        match &self.integrator {
            None => Ok(filter),
            Some(section) => self.integrated(filter, section),
        }
    }

    /// `filter` behind its integrator.
    fn integrated(&self, filter: Filter, section: &IntegratorSection) -> Result<Filter, ConfigurationError> {
        let refused = |e: punctual_core::Error| {
            let field = match e.field() {
                "limits" => "integrator.min, integrator.max",
                "gain" => "integrator.gain",
                other => other,
            };
            ConfigurationError::new(field, e.message())
        };
        let (state, input) = section.place(&self.plant)?;
        let of = Integration { state, input, limits: section.limits(), gain: section.gain };
        filter.with_integrator(of).map_err(refused)
    }

    /// How plans are made, but for a policy.
    fn plans(&self) -> Plans {
        Plans::every(self.experiment.step_size)
            .horizon(self.plan_horizon)
            .search_budget(self.search_budget.unwrap_or(Plans::SEARCH_BUDGET))
            .apart(self.apart())
    }

    /// What keeps plans from being put behind `filter`, built from this configuration: each with its key, in words.
    pub(super) fn obstacles_of(&self, filter: &Filter) -> Vec<String> {
        if let Some(barrier) = self.external() {
            return vec![format!("barrier {} has no model to run ahead", barrier.name)];
        }
        let mut found = Vec::new();
        let follows = self.barrier_inputs();
        if let Some(input) = follows.first() {
            found.push(format!(
                "a barrier follows {}, which is moved from outside, so that no plan can predict it",
                input.name
            ));
        }
        for error in filter.obstacles(&self.plans()) {
            let (field, message) = (error.field(), error.message());
            let of = |key: &str| {
                let name = field.strip_suffix(key)?.strip_suffix('.')?;
                self.barrier.iter().find(|barrier| barrier.name == name)
            };
            if field == "measurement_errors" {
                let errors = self.measurement_errors.iter().filter(|(_, error)| **error > 0.0);
                found.extend(
                    errors.map(|(state, error)| format!("{field}.{state} is {error}, must be 0 for a plan")),
                );
            } else if let Some((name, after)) = of("begin").and_then(|b| Some((&b.name, b.after.as_ref()?))) {
                found.push(format!("{name}.after is {after:?}, and no plan predicts when that is reached"));
            } else if let Some(barrier) = of("source") {
                // No key has this name. What follows another thing moves as that does; what moves by itself wants the key of a
                // horizon.
                if follows.is_empty() {
                    found.push(format!("{} {message} (`plan_horizon`)", barrier.name));
                }
            } else {
                found.push(format!("{field} {message}"));
            }
        }
        found
    }

    /// `filter`, built from this configuration, with plans behind it, whether or not `assurance` asks for them.
    ///
    /// # Errors
    ///
    /// What no plan accounts for yet, in words.
    pub fn assured(&self, filter: Filter) -> Result<Filter, String> {
        let obstacles = self.obstacles_of(&filter);
        if !obstacles.is_empty() {
            return Err(listed(&obstacles));
        }
        let mut plans = self.plans();
        if let Some(policy) = &self.policy {
            let functions = self.plant.functions("policy", policy).map_err(|e| e.to_string())?;
            let functions = RefCell::new(functions);
            plans = plans.policy(move |t: f64, x: &[f64], u: &mut [f64]| {
                let values = &mut *functions.borrow_mut();
                u.iter_mut().zip(values.at(t, |i| x[i])).for_each(|(u, value)| *u = value);
            });
        }
        let filter = match &self.integrator {
            None => filter,
            Some(section) => self.integrated(filter, section).map_err(|e| e.to_string())?,
        };
        filter.with_plans(plans).map_err(|e| e.to_string())
    }
}
