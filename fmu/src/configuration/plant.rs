//! `kind = "plant"`: a reference plant.

use std::collections::BTreeMap;

use punctual_core::dynamics::{DynPlant, Erased};
use punctual_core::plants::{Bicycle, PointMass, Signal, Signals, Unicycle};
use serde::{Deserialize, Serialize};

use super::{ConfigurationError, ExperimentSection, Parameter, Range, check_identifier};

/// The reference plants by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ModelName {
    /// [`PointMass`].
    PointMass,
    /// [`Unicycle`].
    Unicycle,
    /// [`Bicycle`], simplified.
    Bicycle,
}

impl ModelName {
    /// The states, in order.
    pub fn states(self) -> &'static [Signal] {
        match self {
            Self::PointMass => PointMass::STATES,
            Self::Unicycle => Unicycle::STATES,
            Self::Bicycle => Bicycle::STATES,
        }
    }

    /// The inputs, in order.
    pub fn inputs(self) -> &'static [Signal] {
        match self {
            Self::PointMass => PointMass::INPUTS,
            Self::Unicycle => Unicycle::INPUTS,
            Self::Bicycle => Bicycle::INPUTS,
        }
    }

    /// What it is, for a human.
    pub fn title(self) -> &'static str {
        match self {
            Self::PointMass => "point mass in the plane",
            Self::Unicycle => "unicycle",
            Self::Bicycle => "kinematic bicycle (simplified)",
        }
    }
}

/// `[plant]`: which plant, with its constants.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PlantSection {
    /// Which plant.
    pub model: ModelName,
    /// Bicycle only: distance from the rear axle to the centre of mass in m, > 0. Default 10.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub l_r: Option<f64>,
}

impl PlantSection {
    pub(super) fn complete(&mut self) -> Result<(), ConfigurationError> {
        match (self.model, self.l_r) {
            (ModelName::Bicycle, None) => self.l_r = Some(10.0),
            (ModelName::PointMass | ModelName::Unicycle, Some(_)) => {
                let message = "is a constant of the bicycle; this model has none";
                return Err(ConfigurationError::new("plant.l_r", message));
            }
            _ => {}
        }
        Ok(())
    }

    /// The parameters of the model, reached through `section` in a configuration of type `C`.
    pub(super) fn parameters<C: 'static>(
        self,
        section: impl Fn(&mut C) -> &mut Self + Send + 'static,
    ) -> Option<Parameter<C>> {
        self.l_r?;
        let names = ("l_r".to_owned(), "plant.l_r".to_owned());
        Some(Parameter::new(
            names,
            "m",
            Range::POSITIVE,
            "distance from the rear axle to the centre of mass",
            move |c| section(c).l_r.get_or_insert(0.0),
        ))
    }

    /// The bicycle of this section.
    ///
    /// # Errors
    ///
    /// A constant outside its range.
    pub(crate) fn bicycle(&self) -> Result<Bicycle, ConfigurationError> {
        let l_r = self.l_r.unwrap_or(f64::NAN);
        Bicycle::new(l_r).map_err(|e| ConfigurationError::new(format!("plant.{}", e.field()), e.message()))
    }
}

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
    /// Initial state by name, in the units of the states; finite. Default 0.
    #[serde(default)]
    pub x0: BTreeMap<String, f64>,
    /// The run it is meant for.
    #[serde(default)]
    pub experiment: ExperimentSection,
}

impl PlantConfiguration {
    pub(super) fn completed(mut self) -> Result<Self, ConfigurationError> {
        if self.name.is_empty() {
            self.name = match self.plant.model {
                ModelName::PointMass => "point_mass",
                ModelName::Unicycle => "unicycle",
                ModelName::Bicycle => "bicycle",
            }
            .to_owned();
        }
        check_identifier("name", &self.name)?;
        self.plant.complete()?;
        let states = self.plant.model.states();
        if let Some(unknown) = self.x0.keys().find(|k| states.iter().all(|s| s.name != **k)) {
            let names: Vec<_> = states.iter().map(|s| s.name).collect();
            let message = format!("unknown state, must be one of {}", names.join(", "));
            return Err(ConfigurationError::new(format!("x0.{unknown}"), message));
        }
        for state in states {
            self.x0.entry(state.name.to_owned()).or_insert(0.0);
        }
        self.experiment.check()?;
        for parameter in self.parameters() {
            parameter.check(&mut self)?;
        }
        Ok(self)
    }

    /// The numbers that are parameters of the FMU; `x0.*` come first, in the order of the states.
    pub fn parameters(&self) -> Vec<Parameter<Self>> {
        let mut rows: Vec<Parameter<Self>> = Vec::new();
        for state in self.plant.model.states() {
            let name = format!("x0.{}", state.name);
            let description = format!("initial value: {}", state.description);
            rows.push(Parameter::new(
                (name.clone(), name),
                state.unit,
                Range::FINITE,
                description,
                |c: &mut Self| c.x0.entry(state.name.to_owned()).or_insert(0.0),
            ));
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
        Ok(match self.plant.model {
            ModelName::PointMass => Box::new(Erased(PointMass)),
            ModelName::Unicycle => Box::new(Erased(Unicycle)),
            ModelName::Bicycle => Box::new(Erased(self.plant.bicycle()?)),
        })
    }
}
