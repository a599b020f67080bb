//! The reference plants by name, with their constants.

use punctual_core::dynamics::{DynPlant, Erased};
use punctual_reference::plants::{
    Bicycle, KinematicBicycle, PointMass, Signal, Signals, SmallSlipBicycle, SmallSlipBicycleWithRate,
    SteeredBicycle, Steering, Unicycle,
};
use serde::{Deserialize, Serialize};

use super::{ConfigurationError, Key, Parameter, Range, Section, Unit, Value};

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
    /// The same, steered by the angle of its front wheel: as a plant only, since that does not enter linearly.
    BicycleKinematicAngle,
    /// The same, steered by its slip angle as the simplified and the small-slip bicycle are: as a plant only.
    BicycleKinematicSlip,
}

impl ModelName {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::PointMass,
        Self::Unicycle,
        Self::Bicycle,
        Self::BicycleSmallSlip,
        Self::BicycleSmallSlipRate,
        Self::BicycleKinematic,
        Self::BicycleKinematicAngle,
        Self::BicycleKinematicSlip,
    ];

    /// The states, in order.
    pub fn states(self) -> &'static [Signal] {
        match self {
            Self::PointMass => PointMass::STATES,
            Self::Unicycle => Unicycle::STATES,
            Self::Bicycle => Bicycle::STATES,
            Self::BicycleSmallSlip => SmallSlipBicycle::STATES,
            Self::BicycleSmallSlipRate => SmallSlipBicycleWithRate::STATES,
            Self::BicycleKinematic => KinematicBicycle::STATES,
            Self::BicycleKinematicAngle | Self::BicycleKinematicSlip => SteeredBicycle::STATES,
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
            Self::BicycleKinematicAngle => Steering::Angle.inputs(),
            Self::BicycleKinematicSlip => Steering::SlipAngle.inputs(),
        }
    }

    /// A description, for a human.
    pub fn title(self) -> &'static str {
        match self {
            Self::PointMass => "point mass in the plane",
            Self::Unicycle => "unicycle",
            Self::Bicycle => "kinematic bicycle (simplified)",
            Self::BicycleSmallSlip => "bicycle with small slip angle",
            Self::BicycleSmallSlipRate => "bicycle with small slip angle, steered by its rate",
            Self::BicycleKinematic => "kinematic bicycle, steered by the rate of its front wheel",
            Self::BicycleKinematicAngle => "kinematic bicycle, steered by the angle of its front wheel",
            Self::BicycleKinematicSlip => "kinematic bicycle, steered by its slip angle",
        }
    }

    /// Its name in a configuration.
    pub const fn name(self) -> &'static str {
        match self {
            Self::PointMass => "point_mass",
            Self::Unicycle => "unicycle",
            Self::Bicycle => "bicycle",
            Self::BicycleSmallSlip => "bicycle_small_slip",
            Self::BicycleSmallSlipRate => "bicycle_small_slip_rate",
            Self::BicycleKinematic => "bicycle_kinematic",
            Self::BicycleKinematicAngle => "bicycle_kinematic_angle",
            Self::BicycleKinematicSlip => "bicycle_kinematic_slip",
        }
    }

    fn has_l_r(self) -> bool {
        !matches!(self, Self::PointMass | Self::Unicycle)
    }

    fn has_l_f(self) -> bool {
        matches!(self, Self::BicycleKinematic | Self::BicycleKinematicAngle)
    }

    /// Whether it is affine in its inputs, as the model of a filter has to be.
    pub fn is_affine(self) -> bool {
        !matches!(self, Self::BicycleKinematicAngle | Self::BicycleKinematicSlip)
    }
}

/// The names of the models.
pub(super) static MODELS: [&str; ModelName::ALL.len()] = {
    let mut names = [""; ModelName::ALL.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = ModelName::ALL[i].name();
        i += 1;
    }
    names
};

pub(super) const L_R: Key =
    Key::new("l_r", LENGTH_VALUE, Some("10"), "bicycles: from the rear axle to the centre of mass");
pub(super) const L_F: Key = Key::new(
    "l_f",
    LENGTH_VALUE,
    Some("10"),
    "`bicycle_kinematic`, `bicycle_kinematic_angle`: from the centre of mass to the front axle",
);
const LENGTH_VALUE: Value = Value::Number(Unit::Is("m"), Range::POSITIVE);

/// `[plant]` of a controller.
pub(super) static SECTION: Section = Section {
    name: "vehicle",
    keys: || {
        static KEYS: [Key; 3] =
            [Key::new("model", Value::Word(&MODELS), None, "a [vehicle](#models) by name"), L_R, L_F];
        KEYS.iter().collect()
    },
};

/// A reference plant with its constants: `[plant]` of a controller, or of a filter or plant without expressions.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ReferenceSection {
    /// The plant's model.
    pub model: ModelName,
    /// Bicycles only: distance from the rear axle to the centre of mass in m, > 0. Default 10.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub l_r: Option<f64>,
    /// `bicycle_kinematic` and `bicycle_kinematic_angle` only: distance from the centre of mass to the front axle in m, > 0.
    /// Default 10.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub l_f: Option<f64>,
}

/// Default of the lengths of a bicycle in m: the paper's.
const LENGTH: f64 = 10.0;

impl ReferenceSection {
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

    /// The parameters of the model, reached through `l_r` and `l_f` in a configuration of type `C`.
    pub(super) fn parameters<C: 'static>(
        self,
        l_r: impl Fn(&mut C) -> &mut Option<f64> + Send + 'static,
        l_f: impl Fn(&mut C) -> &mut Option<f64> + Send + 'static,
    ) -> Vec<Parameter<C>> {
        let names = |field: &str| (field.to_owned(), format!("plant.{field}"));
        let mut rows = Vec::new();
        if self.l_r.is_some() {
            let what = "distance from the rear axle to the centre of mass";
            let names = names("l_r");
            rows.push(Parameter::new(names, "m", Range::POSITIVE, what, move |c: &mut C| l_r(c).as_mut()));
        }
        if self.l_f.is_some() {
            let what = "distance from the centre of mass to the front axle";
            let names = names("l_f");
            rows.push(Parameter::new(names, "m", Range::POSITIVE, what, move |c: &mut C| l_f(c).as_mut()));
        }
        rows
    }

    /// The plant as expressions for the derivatives of its states, for barriers that are expressions.
    pub(super) fn derivatives(self) -> &'static [&'static str] {
        match self.model {
            ModelName::PointMass => &["v_x", "v_y", "u_x", "u_y"],
            ModelName::Unicycle => &["v*cos(theta)", "v*sin(theta)", "omega", "a"],
            ModelName::Bicycle => &["v*cos(theta)", "v*sin(theta)", "v*beta/l_r", "a"],
            ModelName::BicycleSmallSlip => {
                &["v*cos(theta) - v*sin(theta)*beta", "v*sin(theta) + v*cos(theta)*beta", "v*beta/l_r", "a"]
            }
            ModelName::BicycleSmallSlipRate => &[
                "v*cos(theta) - v*sin(theta)*beta",
                "v*sin(theta) + v*cos(theta)*beta",
                "v*beta/l_r",
                "a",
                "beta_rate",
            ],
            ModelName::BicycleKinematic => &[
                "v*cos(theta + atan(tan(delta)*(l_r/(l_f + l_r))))",
                "v*sin(theta + atan(tan(delta)*(l_r/(l_f + l_r))))",
                "v*sin(atan(tan(delta)*(l_r/(l_f + l_r))))/l_r",
                "a",
                "delta_rate",
            ],
            ModelName::BicycleKinematicAngle => &[
                "v*cos(theta + atan(tan(delta)*(l_r/(l_f + l_r))))",
                "v*sin(theta + atan(tan(delta)*(l_r/(l_f + l_r))))",
                "v*sin(atan(tan(delta)*(l_r/(l_f + l_r))))/l_r",
                "a",
            ],
            ModelName::BicycleKinematicSlip => {
                &["v*cos(theta + beta)", "v*sin(theta + beta)", "v*sin(beta)/l_r", "a"]
            }
        }
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
            ModelName::BicycleKinematicAngle => Box::new(self.kinematic()?.steered(Steering::Angle)),
            ModelName::BicycleKinematicSlip => Box::new(self.kinematic()?.steered(Steering::SlipAngle)),
        })
    }
}

/// An error about a constant of the plant, with its path.
#[expect(clippy::needless_pass_by_value, reason = "for map_err")]
fn constant(error: punctual_core::Error) -> ConfigurationError {
    ConfigurationError::new(format!("plant.{}", error.field()), error.message())
}
