//! `kind = "plant"`: a reference plant.

use std::collections::BTreeMap;

use punctual_core::dynamics::{DynPlant, Erased};
use punctual_core::plants::{
    Bicycle, KinematicBicycle, PointMass, Signal, Signals, SmallSlipBicycle, SmallSlipBicycleWithRate,
    Unicycle,
};
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
    /// [`SmallSlipBicycle`]: as a plant only, since position barriers have a mixed relative degree.
    BicycleSmallSlip,
    /// [`SmallSlipBicycleWithRate`]: the same with the rate of the slip angle as its input.
    BicycleSmallSlipRate,
    /// [`KinematicBicycle`], steered by the rate of its front wheel.
    BicycleKinematic,
}

impl ModelName {
    /// The states, in order.
    pub fn states(self) -> &'static [Signal] {
        match self {
            Self::PointMass => PointMass::STATES,
            Self::Unicycle => Unicycle::STATES,
            Self::Bicycle => Bicycle::STATES,
            Self::BicycleSmallSlip => SmallSlipBicycle::STATES,
            Self::BicycleSmallSlipRate => SmallSlipBicycleWithRate::STATES,
            Self::BicycleKinematic => KinematicBicycle::STATES,
        }
    }

    /// The inputs, in order.
    pub fn inputs(self) -> &'static [Signal] {
        match self {
            Self::PointMass => PointMass::INPUTS,
            Self::Unicycle => Unicycle::INPUTS,
            Self::Bicycle => Bicycle::INPUTS,
            Self::BicycleSmallSlip => SmallSlipBicycle::INPUTS,
            Self::BicycleSmallSlipRate => SmallSlipBicycleWithRate::INPUTS,
            Self::BicycleKinematic => KinematicBicycle::INPUTS,
        }
    }

    /// What it is, for a human.
    pub fn title(self) -> &'static str {
        match self {
            Self::PointMass => "point mass in the plane",
            Self::Unicycle => "unicycle",
            Self::Bicycle => "kinematic bicycle (simplified)",
            Self::BicycleSmallSlip => "bicycle with small slip angle",
            Self::BicycleSmallSlipRate => "bicycle with small slip angle, steered by its rate",
            Self::BicycleKinematic => "kinematic bicycle, steered by the rate of its front wheel",
        }
    }

    /// Its name in a configuration.
    pub fn name(self) -> &'static str {
        match self {
            Self::PointMass => "point_mass",
            Self::Unicycle => "unicycle",
            Self::Bicycle => "bicycle",
            Self::BicycleSmallSlip => "bicycle_small_slip",
            Self::BicycleSmallSlipRate => "bicycle_small_slip_rate",
            Self::BicycleKinematic => "bicycle_kinematic",
        }
    }

    fn has_l_r(self) -> bool {
        !matches!(self, Self::PointMass | Self::Unicycle)
    }

    fn has_l_f(self) -> bool {
        self == Self::BicycleKinematic
    }
}

/// `[plant]`: which plant, with its constants.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PlantSection {
    /// Which plant.
    pub model: ModelName,
    /// Bicycles only: distance from the rear axle to the centre of mass in m, > 0. Default 10.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub l_r: Option<f64>,
    /// `bicycle_kinematic` only: distance from the centre of mass to the front axle in m, > 0.
    /// Default 10.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub l_f: Option<f64>,
}

/// Default of the lengths of a bicycle in m: the paper's.
const LENGTH: f64 = 10.0;

impl PlantSection {
    pub(super) fn complete(&mut self) -> Result<(), ConfigurationError> {
        for (field, value, has, owner) in [
            ("l_r", &mut self.l_r, self.model.has_l_r(), "the bicycle"),
            ("l_f", &mut self.l_f, self.model.has_l_f(), "bicycle_kinematic"),
        ] {
            if has {
                value.get_or_insert(LENGTH);
            } else if value.is_some() {
                let message = format!("is a constant of {owner}; this model has none");
                return Err(ConfigurationError::new(format!("plant.{field}"), message));
            }
        }
        Ok(())
    }

    /// The parameters of the model, reached through `section` in a configuration of type `C`.
    pub(super) fn parameters<C: 'static>(self, section: fn(&mut C) -> &mut Self) -> Vec<Parameter<C>> {
        let mut rows = Vec::new();
        let mut row = |field: &str, description: &str, access: fn(&mut Self) -> &mut f64| {
            let names = (field.to_owned(), format!("plant.{field}"));
            rows.push(Parameter::new(names, "m", Range::POSITIVE, description, move |c| access(section(c))));
        };
        if self.l_r.is_some() {
            row("l_r", "distance from the rear axle to the centre of mass", |s| s.l_r.get_or_insert(LENGTH));
        }
        if self.l_f.is_some() {
            row("l_f", "distance from the centre of mass to the front axle", |s| s.l_f.get_or_insert(LENGTH));
        }
        rows
    }

    /// The bicycle of this section.
    ///
    /// # Errors
    ///
    /// A constant outside its range.
    pub(crate) fn bicycle(&self) -> Result<Bicycle, ConfigurationError> {
        Bicycle::new(self.l_r.unwrap_or(LENGTH)).map_err(constant)
    }

    /// The small-slip bicycle of this section; errors as for [`Self::bicycle`].
    pub(crate) fn small_slip(&self) -> Result<SmallSlipBicycle, ConfigurationError> {
        SmallSlipBicycle::new(self.l_r.unwrap_or(LENGTH)).map_err(constant)
    }

    /// The kinematic bicycle of this section; errors as for [`Self::bicycle`].
    pub(crate) fn kinematic(&self) -> Result<KinematicBicycle, ConfigurationError> {
        KinematicBicycle::new(self.l_f.unwrap_or(LENGTH), self.l_r.unwrap_or(LENGTH)).map_err(constant)
    }

    /// The plant.
    ///
    /// # Errors
    ///
    /// A constant outside its range.
    pub fn build(&self) -> Result<Box<dyn DynPlant>, ConfigurationError> {
        Ok(match self.model {
            ModelName::PointMass => Box::new(Erased(PointMass)),
            ModelName::Unicycle => Box::new(Erased(Unicycle)),
            ModelName::Bicycle => Box::new(Erased(self.bicycle()?)),
            ModelName::BicycleSmallSlip => Box::new(Erased(self.small_slip()?)),
            ModelName::BicycleSmallSlipRate => Box::new(Erased(self.small_slip()?.with_rate())),
            ModelName::BicycleKinematic => Box::new(Erased(self.kinematic()?)),
        })
    }
}

/// An error about a constant of the plant, with its path.
#[expect(clippy::needless_pass_by_value, reason = "for map_err")]
fn constant(error: punctual_core::Error) -> ConfigurationError {
    ConfigurationError::new(format!("plant.{}", error.field()), error.message())
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
            self.name = self.plant.model.name().to_owned();
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
        self.plant.build()
    }
}
