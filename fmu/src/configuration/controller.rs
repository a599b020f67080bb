//! `kind = "controller"`: a nominal controller, which gives the wanted input of a plant without any promise.

use std::collections::BTreeMap;

use punctual_core::scalar::Scalar;
use punctual_models::Functions;
use punctual_reference::nominal::Heading;
use serde::Deserialize;
use serde::ser::{Serialize, SerializeMap, Serializer};

use super::key::{
    Key, Section,
    Unit::Is,
    Value::{Flag, Name, Number, Pair, Pairs, Table, TextByName, Word},
};
use super::model::{self, RawModel};
use super::names::check_identifier;
use super::plugin::NoPlugins;
use super::words::words;
use super::{ConfigurationError, EXPERIMENT, ExperimentSection, ModelName, Parameter, PlantSection, Range};

words! {
    /// The nominal controllers by name.
    pub enum ControllerName {
        /// [`damping`](punctual_reference::nominal::damping): of speeds, and of the angle that a rate steers.
        Damping = "damping",
        /// [`Heading`] to one goal.
        Heading = "heading",
        /// [`Heading`] to one point after the other; the last is held.
        Waypoints = "waypoints",
        /// An expression for each input.
        Expressions = "expressions",
    }
}

/// A number of a controller.
struct Gain {
    key: Key,
    /// Meaning, as the FMU tells it.
    description: &'static str,
    /// Value in a file.
    given: fn(&RawController) -> Option<f64>,
    /// The number, in a controller that has it.
    access: fn(&mut ControllerConfiguration) -> Option<&mut f64>,
}

/// Default of the gain of the damping in 1/s.
const GAIN: f64 = 1.0;

/// Default of the acceptance radius in m.
const ACCEPTANCE: f64 = 1.0;

static GAINS: [Gain; 9] = [
    Gain {
        key: Key::new(
            "gain",
            Number(Is("1/s"), Range::POSITIVE),
            Some("1"),
            "`damping`: deceleration per speed, and rate per steering or slip angle where a rate steers",
        ),
        description: "deceleration per speed, and rate per steering or slip angle where a rate steers",
        given: |raw| raw.gain,
        access: |c| match &mut c.controller {
            Controller::Damping { gain } => Some(gain),
            _ => None,
        },
    },
    Gain {
        key: Key::new(
            "acceptance_radius",
            Number(Is("m"), Range::POSITIVE),
            Some("1"),
            "`waypoints`: distance from a point at which the next one becomes the goal",
        ),
        description: "distance from a point at which the next one becomes the goal",
        given: |raw| raw.acceptance_radius,
        access: |c| match &mut c.controller {
            Controller::Waypoints { acceptance_radius, .. } => Some(acceptance_radius),
            _ => None,
        },
    },
    Gain {
        key: Key::new(
            "speed_gain",
            Number(Is("1/s"), Range::POSITIVE),
            Some("0.8"),
            "speed aimed at per distance to the goal",
        ),
        description: "speed aimed at per distance to the goal",
        given: |raw| raw.speed_gain,
        access: |c| c.drive().map(|h| &mut h.speed_gain),
    },
    Gain {
        key: Key::new(
            "speed_limit",
            Number(Is("m/s"), Range::POSITIVE),
            Some("15"),
            "largest speed aimed at",
        ),
        description: "largest speed aimed at",
        given: |raw| raw.speed_limit,
        access: |c| c.drive().map(|h| &mut h.speed_limit),
    },
    Gain {
        key: Key::new(
            "acceleration_gain",
            Number(Is("1/s"), Range::POSITIVE),
            Some("1"),
            "acceleration per speed error",
        ),
        description: "acceleration per speed error",
        given: |raw| raw.acceleration_gain,
        access: |c| c.drive().map(|h| &mut h.acceleration_gain),
    },
    Gain {
        key: Key::new(
            "acceleration_limit",
            Number(Is("m/s2"), Range::POSITIVE),
            Some("10"),
            "largest acceleration",
        ),
        description: "largest acceleration",
        given: |raw| raw.acceleration_limit,
        access: |c| c.drive().map(|h| &mut h.acceleration_limit),
    },
    Gain {
        key: Key::new(
            "turn_gain",
            Number(Is("1/s"), Range::POSITIVE),
            Some("3"),
            "turning rate per angle to the goal; not for the point mass",
        ),
        description: "turning rate per angle to the goal",
        given: |raw| raw.turn_gain,
        access: |c| c.turning().map(|h| &mut h.turn_gain),
    },
    Gain {
        key: Key::new(
            "turn_limit",
            Number(Is("rad/s"), Range::POSITIVE),
            Some("3"),
            "largest turning rate; not for the point mass",
        ),
        description: "largest turning rate",
        given: |raw| raw.turn_limit,
        access: |c| c.turning().map(|h| &mut h.turn_limit),
    },
    Gain {
        key: Key::new(
            "slip_limit",
            Number(Is("rad"), Range::POSITIVE),
            Some("1"),
            "largest slip angle; bicycles steered by it",
        ),
        description: "largest slip angle",
        given: |raw| raw.slip_limit,
        access: |c| c.slipping().map(|h| &mut h.slip_limit),
    },
];

/// A controller.
pub(super) static SECTION: Section = Section {
    name: "controller",
    keys: || {
        static KEYS: [Key; 8] = [
            Key::new("kind", Word(&["controller"]), None, ""),
            Key::new("name", Name, Some("`controller`"), "the FMU's name"),
            Key::new(
                "plant",
                Table(&model::PLANT),
                None,
                "[the model](#models); a vehicle by name for all but `expressions`",
            ),
            Key::new(
                "controller",
                Word(ControllerName::WORDS),
                None,
                "`damping`, `heading` to a goal, `waypoints` one after the other, the last one held (output `waypoint`), or your \
                 own `expressions`",
            ),
            Key::new(
                "u_ref",
                TextByName,
                Some(""),
                "`expressions`: for each input the [expression](#expressions) of what is wanted, of states, parameters and `t`",
            ),
            Key::new("goal", Pair(Is("m"), Range::FINITE), Some(""), "`heading`: the goal"),
            Key::new(
                "goal_input",
                Flag,
                Some("`false`"),
                "`heading`: the goal is an input of the FMU that starts with `goal`",
            ),
            Key::new(
                "points",
                Pairs(Is("m"), Range::FINITE),
                Some(""),
                "`waypoints`: the points, at least one",
            ),
        ];
        static LAST: [Key; 2] = [
            Key::new("direct_feedthrough", Flag, Some("`true`"), "as of a filter"),
            Key::new("experiment", Table(&EXPERIMENT), Some(""), "[the run it is meant for](#runs)"),
        ];
        KEYS.iter().chain(GAINS.iter().map(|gain| &gain.key)).chain(&LAST).collect()
    },
};

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum ControllerKind {
    Controller,
}

/// A controller as written in a file: the keys of every kind.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawController {
    kind: ControllerKind,
    #[serde(default)]
    name: String,
    controller: ControllerName,
    #[serde(default = "yes")]
    direct_feedthrough: bool,
    gain: Option<f64>,
    goal: Option<[f64; 2]>,
    #[serde(default)]
    goal_input: bool,
    #[serde(default)]
    points: Vec<[f64; 2]>,
    acceptance_radius: Option<f64>,
    speed_gain: Option<f64>,
    speed_limit: Option<f64>,
    acceleration_gain: Option<f64>,
    acceleration_limit: Option<f64>,
    turn_gain: Option<f64>,
    turn_limit: Option<f64>,
    slip_limit: Option<f64>,
    u_ref: Option<BTreeMap<String, String>>,
    plant: RawModel,
    #[serde(default)]
    experiment: ExperimentSection,
}

fn yes() -> bool {
    true
}

/// A kind of controller, with its target and its numbers.
#[derive(Clone, Debug, PartialEq)]
pub enum Controller {
    /// [`damping`](punctual_reference::nominal::damping).
    Damping {
        /// In 1/s.
        gain: f64,
    },
    /// [`Heading`] to one goal.
    Heading {
        /// The goal, and how it is driven to.
        drive: Heading,
        /// Whether the goal is an input of the FMU, such as another FMU's output, that starts with the value in
        /// `drive`, and not a parameter.
        goal_input: bool,
    },
    /// [`Heading`] to one point after the other.
    Waypoints {
        /// The points in m, in order, at least one.
        points: Vec<[f64; 2]>,
        /// Distance in m within which a point counts as reached.
        acceptance_radius: f64,
        /// The way to a point, which takes the place of the goal.
        drive: Heading,
    },
    /// An expression of states, parameters and time for each input, by name.
    Expressions {
        /// The expressions.
        u_ref: BTreeMap<String, String>,
    },
}

impl Controller {
    /// Its name in a configuration.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Damping { .. } => ControllerName::Damping.name(),
            Self::Heading { .. } => ControllerName::Heading.name(),
            Self::Waypoints { .. } => ControllerName::Waypoints.name(),
            Self::Expressions { .. } => ControllerName::Expressions.name(),
        }
    }
}

/// A controller FMU: from the state of a plant to `u_ref`.
#[derive(Clone, Debug, PartialEq)]
pub struct ControllerConfiguration {
    pub(super) kind: ControllerKind,
    /// The FMU's name, a C identifier.
    pub name: String,
    /// The controller.
    pub controller: Controller,
    /// Whether outputs follow inputs without a step between them; with false, outputs are computed in steps only.
    pub direct_feedthrough: bool,
    /// The plant that it controls.
    pub plant: PlantSection,
    /// The run that it is meant for.
    pub experiment: ExperimentSection,
}

impl Serialize for ControllerConfiguration {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("kind", &self.kind)?;
        map.serialize_entry("name", &self.name)?;
        map.serialize_entry("controller", self.controller.name())?;
        map.serialize_entry("direct_feedthrough", &self.direct_feedthrough)?;
        match &self.controller {
            Controller::Damping { .. } => {}
            Controller::Heading { drive, goal_input } => {
                map.serialize_entry("goal", &drive.goal)?;
                if *goal_input {
                    map.serialize_entry("goal_input", goal_input)?;
                }
            }
            Controller::Waypoints { points, .. } => map.serialize_entry("points", points)?,
            Controller::Expressions { u_ref } => map.serialize_entry("u_ref", u_ref)?,
        }
        let mut reached = self.clone();
        for gain in &GAINS {
            if let Some(value) = (gain.access)(&mut reached) {
                map.serialize_entry(gain.key.name, value)?;
            }
        }
        map.serialize_entry("plant", &self.plant)?;
        map.serialize_entry("experiment", &self.experiment)?;
        map.end()
    }
}

impl ControllerConfiguration {
    /// Completes and checks `raw`.
    pub(super) fn parse(mut raw: RawController) -> Result<Self, ConfigurationError> {
        let name = if raw.name.is_empty() { "controller".to_owned() } else { raw.name.clone() };
        check_identifier("name", &name)?;
        if raw.plant.plugin.is_some() {
            let message = "is for filters and plants; give `model`, or `states`, `inputs` and `derivatives`";
            return Err(ConfigurationError::new("plant.plugin", message));
        }
        let plant = PlantSection::parse(std::mem::take(&mut raw.plant), &NoPlugins)?;
        let word = raw.controller.name();
        let refuse = |field: &str, message: String| Err(ConfigurationError::new(field, message));
        // The controller must suit the plant.
        match plant.model() {
            None if raw.controller != ControllerName::Expressions => {
                return refuse(
                    "controller",
                    format!("is {word:?}, which is for vehicles by name; must be \"expressions\""),
                );
            }
            Some(model)
                if !model.heads()
                    && matches!(raw.controller, ControllerName::Heading | ControllerName::Waypoints) =>
            {
                let message = format!(
                    "is {word:?}, which {} has none of; must be \"damping\" or \"expressions\"",
                    model.name()
                );
                return refuse("controller", message);
            }
            _ => {}
        }
        // The target, a goal or points, must be that of the controller.
        let none = |field: &str, given: bool| match given {
            true => Err(ConfigurationError::new(field, format!("{word} has none"))),
            false => Ok(()),
        };
        let missing = |field: &str| ConfigurationError::new(field, format!("missing, {word} needs it"));
        let points = Some(raw.points.clone()).filter(|points| !points.is_empty());
        if raw.controller != ControllerName::Expressions {
            none("u_ref", raw.u_ref.is_some())?;
        }
        let controller = match raw.controller {
            ControllerName::Expressions => {
                none("goal", raw.goal.is_some())?;
                none("points", points.is_some())?;
                none("goal_input", raw.goal_input)?;
                Controller::Expressions { u_ref: raw.u_ref.clone().ok_or_else(|| missing("u_ref"))? }
            }
            ControllerName::Damping => {
                none("goal", raw.goal.is_some())?;
                none("points", points.is_some())?;
                none("goal_input", raw.goal_input)?;
                Controller::Damping { gain: GAIN }
            }
            ControllerName::Heading => {
                let drive = Heading::towards(raw.goal.ok_or_else(|| missing("goal"))?);
                none("points", points.is_some())?;
                Controller::Heading { drive, goal_input: raw.goal_input }
            }
            ControllerName::Waypoints => {
                none("goal", raw.goal.is_some())?;
                let points = points.ok_or_else(|| missing("points"))?;
                none("goal_input", raw.goal_input)?;
                let drive = Heading::towards([0.0; 2]);
                Controller::Waypoints { points, acceptance_radius: ACCEPTANCE, drive }
            }
        };
        // The numbers have their defaults, until others are given.
        let mut configuration = Self {
            kind: raw.kind,
            name,
            controller,
            direct_feedthrough: raw.direct_feedthrough,
            plant,
            experiment: raw.experiment,
        };
        for gain in &GAINS {
            match ((gain.given)(&raw), (gain.access)(&mut configuration)) {
                (Some(value), Some(number)) => *number = value,
                (Some(_), None) => {
                    let plant = configuration.plant.name();
                    return refuse(gain.key.name, format!("{word} of {plant} has none"));
                }
                (None, _) => {}
            }
        }
        // Check every number against its range.
        configuration.experiment.check()?;
        // The start values of inputs are not parameters.
        if let Some([x, y]) = raw.goal {
            Range::FINITE.check("goal[1]", x)?;
            Range::FINITE.check("goal[2]", y)?;
        }
        for parameter in configuration.parameters() {
            parameter.check(&mut configuration)?;
        }
        configuration.functions::<f64>()?;
        Ok(configuration)
    }

    /// The expressions of `u_ref`, in the order of the inputs; none of a controller without.
    ///
    /// # Errors
    ///
    /// An input without expression, an expression without input, one that cannot be used.
    pub fn functions<C: Scalar>(&self) -> Result<Option<Functions<C>>, ConfigurationError> {
        let Controller::Expressions { u_ref } = &self.controller else { return Ok(None) };
        self.plant.functions("u_ref", u_ref).map(Some)
    }

    /// The drive of a controller that has one.
    fn drive(&mut self) -> Option<&mut Heading> {
        match &mut self.controller {
            Controller::Damping { .. } | Controller::Expressions { .. } => None,
            Controller::Heading { drive, .. } | Controller::Waypoints { drive, .. } => Some(drive),
        }
    }

    /// The drive of a vehicle that turns.
    fn turning(&mut self) -> Option<&mut Heading> {
        if self.plant.model() == Some(ModelName::PointMass) { None } else { self.drive() }
    }

    /// The drive of a vehicle that is steered by its slip angle.
    fn slipping(&mut self) -> Option<&mut Heading> {
        match self.plant.model() {
            Some(ModelName::Bicycle | ModelName::BicycleSmallSlip | ModelName::BicycleKinematicSlip) => {
                self.drive()
            }
            _ => None,
        }
    }

    /// The numbers that are parameters of the FMU.
    pub fn parameters(&self) -> Vec<Parameter<Self>> {
        let mut rows: Vec<Parameter<Self>> = Vec::new();
        let axes = ["x", "y"];
        if let Controller::Heading { goal_input: false, .. } = self.controller {
            for (i, axis) in axes.iter().enumerate() {
                let name = format!("goal[{}]", i + 1);
                let description = format!("the goal along {axis}");
                rows.push(Parameter::new(
                    (name.clone(), name),
                    "m",
                    Range::FINITE,
                    description,
                    move |c: &mut Self| c.drive().map(|drive| &mut drive.goal[i]),
                ));
            }
        }
        for k in 0..self.points().len() {
            for (i, axis) in axes.iter().enumerate() {
                // Files count points from 0, as the error messages of serde do; variables from 1, as FMI.
                let names = (format!("points[{},{}]", k + 1, i + 1), format!("points[{k}][{}]", i + 1));
                let description = format!("point {} along {axis}", k + 1);
                rows.push(Parameter::new(names, "m", Range::FINITE, description, move |c: &mut Self| {
                    match &mut c.controller {
                        Controller::Waypoints { points, .. } => points.get_mut(k).map(|point| &mut point[i]),
                        _ => None,
                    }
                }));
            }
        }
        let mut reached = self.clone();
        for gain in GAINS.iter().filter(|gain| (gain.access)(&mut reached).is_some()) {
            let Number(unit, range) = gain.key.value else { continue };
            let names = (gain.key.name.to_owned(), gain.key.name.to_owned());
            let unit = unit.of_barrier("1", 0);
            rows.push(Parameter::new(names, unit, range, gain.description, gain.access));
        }
        if reached.slipping().is_some() || matches!(self.controller, Controller::Expressions { .. }) {
            rows.extend(self.plant.parameters(|c: &mut Self| &mut c.plant));
        }
        rows
    }

    /// The points of `waypoints`, else none.
    pub fn points(&self) -> &[[f64; 2]] {
        match &self.controller {
            Controller::Waypoints { points, .. } => points,
            _ => &[],
        }
    }

    /// Its inputs besides the state, with units, start values and meanings.
    pub fn goal_inputs(&self) -> Vec<(&'static str, &'static str, f64, &'static str)> {
        let Controller::Heading { drive: Heading { goal: [x, y], .. }, goal_input: true } = self.controller
        else {
            return Vec::new();
        };
        vec![("goal[1]", "m", x, "the goal along x"), ("goal[2]", "m", y, "the goal along y")]
    }

    /// The damped states, each with the input that acts against it, by their positions.
    pub fn damped(&self) -> &'static [(usize, usize)] {
        self.plant.model().map_or(&[], ModelName::damped)
    }
}
