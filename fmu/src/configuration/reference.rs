//! The reference plants by name, with their constants.

use punctual_core::dynamics::{DynPlant, Erased};
use punctual_core::plants::{
    Bicycle, KinematicBicycle, PointMass, Signal, Signals, SmallSlipBicycle, SmallSlipBicycleWithRate,
    SteeredBicycle, Steering, Unicycle,
};
use serde::ser::{Serialize, SerializeMap, Serializer};

use super::words::words;
use super::{ConfigurationError, Key, Parameter, Range, Unit, Value};

words! {
    /// The reference plants by name.
    pub enum ModelName {
        /// [`PointMass`].
        PointMass = "point_mass",
        /// [`Unicycle`].
        Unicycle = "unicycle",
        /// [`Bicycle`], simplified.
        Bicycle = "bicycle",
        /// [`SmallSlipBicycle`]: as a plant only, since position barriers have a mixed relative degree.
        BicycleSmallSlip = "bicycle_small_slip",
        /// [`SmallSlipBicycleWithRate`]: the same with the rate of the slip angle as its input.
        BicycleSmallSlipRate = "bicycle_small_slip_rate",
        /// [`KinematicBicycle`], steered by the rate of its front wheel.
        BicycleKinematic = "bicycle_kinematic",
        /// The same, steered by the angle of its front wheel: as a plant only, since that does not enter linearly.
        BicycleKinematicAngle = "bicycle_kinematic_angle",
        /// The same, steered by its slip angle as the simplified and the small-slip bicycle are: as a plant only.
        BicycleKinematicSlip = "bicycle_kinematic_slip",
    }
}

/// What is known of a reference plant: the one place that says it.
struct Facts {
    title: &'static str,
    states: &'static [Signal],
    inputs: &'static [Signal],
    /// Whether it has the constants `l_r` and `l_f`.
    constants: [bool; 2],
    /// Whether it is affine in its inputs.
    is_affine: bool,
    /// The derivatives of its states as expressions.
    derivatives: &'static [&'static str],
    /// The states that a damping controller damps, each with the input that acts against it, by their positions.
    damped: &'static [(usize, usize)],
    /// Whether there are controllers that head for a goal and along waypoints.
    heads: bool,
}

impl ModelName {
    fn facts(self) -> Facts {
        match self {
            Self::PointMass => Facts {
                title: "point mass in the plane",
                states: PointMass::STATES,
                inputs: PointMass::INPUTS,
                constants: [false, false],
                is_affine: true,
                derivatives: &["v_x", "v_y", "u_x", "u_y"],
                damped: &[(2, 0), (3, 1)],
                heads: true,
            },
            Self::Unicycle => Facts {
                title: "unicycle",
                states: Unicycle::STATES,
                inputs: Unicycle::INPUTS,
                constants: [false, false],
                is_affine: true,
                derivatives: &["v*cos(theta)", "v*sin(theta)", "omega", "a"],
                damped: &[(3, 0)],
                heads: true,
            },
            Self::Bicycle => Facts {
                title: "kinematic bicycle (simplified)",
                states: Bicycle::STATES,
                inputs: Bicycle::INPUTS,
                constants: [true, false],
                is_affine: true,
                derivatives: &["v*cos(theta)", "v*sin(theta)", "v*beta/l_r", "a"],
                damped: &[(3, 0)],
                heads: true,
            },
            Self::BicycleSmallSlip => Facts {
                title: "bicycle with small slip angle",
                states: SmallSlipBicycle::STATES,
                inputs: SmallSlipBicycle::INPUTS,
                constants: [true, false],
                is_affine: true,
                derivatives: &[
                    "v*cos(theta) - v*sin(theta)*beta",
                    "v*sin(theta) + v*cos(theta)*beta",
                    "v*beta/l_r",
                    "a",
                ],
                damped: &[(3, 0)],
                heads: true,
            },
            Self::BicycleSmallSlipRate => Facts {
                title: "bicycle with small slip angle, steered by its rate",
                states: SmallSlipBicycleWithRate::STATES,
                inputs: SmallSlipBicycleWithRate::INPUTS,
                constants: [true, false],
                is_affine: true,
                derivatives: &[
                    "v*cos(theta) - v*sin(theta)*beta",
                    "v*sin(theta) + v*cos(theta)*beta",
                    "v*beta/l_r",
                    "a",
                    "beta_rate",
                ],
                damped: &[(3, 0), (4, 1)],
                heads: false,
            },
            Self::BicycleKinematic => Facts {
                title: "kinematic bicycle, steered by the rate of its front wheel",
                states: KinematicBicycle::STATES,
                inputs: KinematicBicycle::INPUTS,
                constants: [true, true],
                is_affine: true,
                derivatives: &[
                    "v*cos(theta + atan(tan(delta)*(l_r/(l_f + l_r))))",
                    "v*sin(theta + atan(tan(delta)*(l_r/(l_f + l_r))))",
                    "v*sin(atan(tan(delta)*(l_r/(l_f + l_r))))/l_r",
                    "a",
                    "delta_rate",
                ],
                damped: &[(3, 0), (4, 1)],
                heads: false,
            },
            Self::BicycleKinematicAngle => Facts {
                title: "kinematic bicycle, steered by the angle of its front wheel",
                states: SteeredBicycle::STATES,
                inputs: Steering::Angle.inputs(),
                constants: [true, true],
                is_affine: false,
                derivatives: &[
                    "v*cos(theta + atan(tan(delta)*(l_r/(l_f + l_r))))",
                    "v*sin(theta + atan(tan(delta)*(l_r/(l_f + l_r))))",
                    "v*sin(atan(tan(delta)*(l_r/(l_f + l_r))))/l_r",
                    "a",
                ],
                damped: &[(3, 0)],
                heads: false,
            },
            Self::BicycleKinematicSlip => Facts {
                title: "kinematic bicycle, steered by its slip angle",
                states: SteeredBicycle::STATES,
                inputs: Steering::SlipAngle.inputs(),
                constants: [true, false],
                is_affine: false,
                derivatives: &["v*cos(theta + beta)", "v*sin(theta + beta)", "v*sin(beta)/l_r", "a"],
                damped: &[(3, 0)],
                heads: true,
            },
        }
    }

    /// The states, in order.
    pub fn states(self) -> &'static [Signal] {
        self.facts().states
    }

    /// The inputs, in order.
    pub fn inputs(self) -> &'static [Signal] {
        self.facts().inputs
    }

    /// A description, for a human.
    pub fn title(self) -> &'static str {
        self.facts().title
    }

    /// Whether it is affine in its inputs, as the model of a filter has to be.
    pub fn is_affine(self) -> bool {
        self.facts().is_affine
    }

    /// The states that a damping controller damps, each with the input that acts against it, by their positions.
    pub(super) fn damped(self) -> &'static [(usize, usize)] {
        self.facts().damped
    }

    /// Whether there are controllers that head for a goal and along waypoints.
    pub(super) fn heads(self) -> bool {
        self.facts().heads
    }

    fn has_l_r(self) -> bool {
        self.facts().constants[0]
    }

    fn has_l_f(self) -> bool {
        self.facts().constants[1]
    }
}

pub(super) const L_R: Key =
    Key::new("l_r", LENGTH_VALUE, Some("10"), "bicycles: from the rear axle to the centre of mass");
pub(super) const L_F: Key = Key::new(
    "l_f",
    LENGTH_VALUE,
    Some("10"),
    "`bicycle_kinematic`, `bicycle_kinematic_angle`: from the centre of mass to the front axle",
);
const LENGTH_VALUE: Value = Value::Number(Unit::Is(LENGTH_UNIT), Range::POSITIVE);
/// The unit of the constants.
pub(super) const LENGTH_UNIT: &str = "m";

/// What a reference plant has of `[plant]` in a file.
pub(super) struct RawReference {
    pub(super) model: ModelName,
    pub(super) l_r: Option<f64>,
    pub(super) l_f: Option<f64>,
}

/// A reference plant with its constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceSection {
    /// The plant's model.
    pub model: ModelName,
    /// Lengths in m, whether the model has them or not.
    l_r: f64,
    l_f: f64,
}

impl Serialize for ReferenceSection {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("model", self.model.name())?;
        for (name, value) in self.constants() {
            map.serialize_entry(name, &value)?;
        }
        map.end()
    }
}

/// Default of the lengths of a bicycle in m: the paper's.
const LENGTH: f64 = 10.0;

impl ReferenceSection {
    /// Completes `raw`, unless it has constants of other models. Their ranges are those of the parameters.
    pub(super) fn parse(raw: &RawReference) -> Result<Self, ConfigurationError> {
        for (field, given, has, owner) in [
            ("l_r", raw.l_r.is_some(), raw.model.has_l_r(), "the bicycle"),
            ("l_f", raw.l_f.is_some(), raw.model.has_l_f(), "bicycle_kinematic"),
        ] {
            if given && !has {
                let message = format!("is a constant of {owner}; this model has none");
                return Err(ConfigurationError::new(format!("plant.{field}"), message));
            }
        }
        let [l_r, l_f] = [raw.l_r, raw.l_f].map(|given| given.unwrap_or(LENGTH));
        Ok(Self { model: raw.model, l_r, l_f })
    }

    /// Distance in m from the rear axle to the centre of mass, of a bicycle.
    pub fn l_r(&self) -> Option<f64> {
        self.model.has_l_r().then_some(self.l_r)
    }

    /// Distance in m from the centre of mass to the front axle, of `bicycle_kinematic` and
    /// `bicycle_kinematic_angle`.
    pub fn l_f(&self) -> Option<f64> {
        self.model.has_l_f().then_some(self.l_f)
    }

    /// The constants that the model has, by name.
    pub(super) fn constants(&self) -> impl Iterator<Item = (&'static str, f64)> {
        let all = [("l_r", self.l_r()), ("l_f", self.l_f())];
        all.into_iter().filter_map(|(name, value)| Some((name, value?)))
    }

    /// The parameters of the model, reached through `section` in a configuration of type `C`.
    pub(super) fn parameters<C: 'static>(
        &self,
        section: impl Fn(&mut C) -> Option<&mut Self> + Copy + Send + 'static,
    ) -> Vec<Parameter<C>> {
        let row = |field: &str, what: &str, access: fn(&mut Self) -> &mut f64| {
            let names = (field.to_owned(), format!("plant.{field}"));
            Parameter::new(names, LENGTH_UNIT, Range::POSITIVE, what, move |c: &mut C| section(c).map(access))
        };
        let mut rows = Vec::new();
        if self.model.has_l_r() {
            rows.push(row("l_r", "distance from the rear axle to the centre of mass", |r| &mut r.l_r));
        }
        if self.model.has_l_f() {
            rows.push(row("l_f", "distance from the centre of mass to the front axle", |r| &mut r.l_f));
        }
        rows
    }

    /// The plant as expressions for the derivatives of its states, for barriers that are expressions.
    pub(super) fn derivatives(self) -> &'static [&'static str] {
        self.model.facts().derivatives
    }

    /// The bicycle of this section.
    ///
    /// # Errors
    ///
    /// A constant outside its range.
    pub(crate) fn bicycle(&self) -> Result<Bicycle, ConfigurationError> {
        Bicycle::new(self.l_r).map_err(constant)
    }

    /// The small-slip bicycle of this section; errors as for [`Self::bicycle`].
    pub(crate) fn small_slip(&self) -> Result<SmallSlipBicycle, ConfigurationError> {
        SmallSlipBicycle::new(self.l_r).map_err(constant)
    }

    /// The kinematic bicycle of this section; errors as for [`Self::bicycle`].
    pub(crate) fn kinematic(&self) -> Result<KinematicBicycle, ConfigurationError> {
        KinematicBicycle::new(self.l_f, self.l_r).map_err(constant)
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
