//! `kind = "plant"`: a plant that moves under held inputs.

use std::collections::BTreeMap;

use punctual_core::dynamics::DynPlant;
use serde::{Deserialize, Serialize};

use super::{ConfigurationError, ExperimentSection, Parameter, PlantSection, Range, check_identifier};

/// `[integration]`: how the plant moves between communication points.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct IntegrationSection {
    /// Largest Runge-Kutta step in s, finite, > 0. Default 0.001. A communication step h is divided
    /// into the least number of equal steps that are not longer.
    pub inner_step: f64,
}

impl Default for IntegrationSection {
    fn default() -> Self {
        Self { inner_step: 0.001 }
    }
}

/// Part of an inner step by which a communication step may be longer than a multiple of it: round-off
/// in the importer's time, not a reason for another inner step.
const STEP_ROUND_OFF: f64 = 1e-6;

impl IntegrationSection {
    /// Number of Runge-Kutta steps for a communication step of `h` s; a whole number, 0 for h = 0.
    pub fn substeps(&self, h: f64) -> f64 {
        (h / self.inner_step * (1.0 - STEP_ROUND_OFF)).ceil()
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum PlantKind {
    Plant,
}

/// A plant FMU: `ẋ = f(x) + g(x) u` with held input u.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PlantConfiguration {
    pub(super) kind: PlantKind,
    /// The FMU's name, a C identifier. Default: the model's name.
    #[serde(default)]
    pub name: String,
    /// Which plant.
    pub plant: PlantSection,
    /// How it is integrated.
    #[serde(default)]
    pub integration: IntegrationSection,
    /// Initial state by name, in the units of the states; finite. Default 0, or nearest to it in the state's range.
    #[serde(default)]
    pub x0: BTreeMap<String, f64>,
    /// The run it is meant for.
    #[serde(default)]
    pub experiment: ExperimentSection,
}

impl PlantConfiguration {
    pub(super) fn completed(mut self) -> Result<Self, ConfigurationError> {
        if self.name.is_empty() {
            self.name = self.plant.reference().map_or("plant", |r| r.model.name()).to_owned();
        }
        check_identifier("name", &self.name)?;
        self.plant.complete()?;
        let states = self.plant.states();
        if let Some(unknown) = self.x0.keys().find(|k| states.iter().all(|s| s.name != **k)) {
            let names: Vec<_> = states.iter().map(|s| s.name.as_str()).collect();
            let message = format!("unknown state, must be one of {}", names.join(", "));
            return Err(ConfigurationError::new(format!("x0.{unknown}"), message));
        }
        for state in states {
            let start = state.range().nearest(0.0);
            self.x0.entry(state.name).or_insert(start);
        }
        self.experiment.check()?;
        for parameter in self.parameters() {
            parameter.check(&mut self)?;
        }
        // Whatever the ranges of single numbers cannot say.
        self.build()?;
        Ok(self)
    }

    /// The numbers that are parameters of the FMU; `x0.*` come first, in the order of the states.
    pub fn parameters(&self) -> Vec<Parameter<Self>> {
        let mut rows: Vec<Parameter<Self>> = Vec::new();
        for state in self.plant.states() {
            let name = format!("x0.{}", state.name);
            let description = format!("initial value: {}", state.description);
            let (unit, range) = (state.unit.clone(), state.range());
            rows.push(Parameter::new((name.clone(), name), unit, range, description, move |c: &mut Self| {
                c.x0.entry(state.name.clone()).or_insert(0.0)
            }));
        }
        rows.extend(self.plant.parameters(|c: &mut Self| &mut c.plant));
        rows.push(Parameter::new(
            ("inner_step".to_owned(), "integration.inner_step".to_owned()),
            "s",
            Range::POSITIVE,
            "largest Runge-Kutta step; the communication step is divided into equal ones",
            |c: &mut Self| &mut c.integration.inner_step,
        ));
        rows
    }

    /// The plant.
    ///
    /// # Errors
    ///
    /// A constant outside its range.
    pub fn build(&self) -> Result<Box<dyn DynPlant>, ConfigurationError> {
        self.plant.build()
    }
}
