//! `kind = "controller"`: a nominal controller, which gives the wanted input of a plant without any promise.

use punctual_reference::nominal::Heading;
use serde::{Deserialize, Serialize};

use super::key::{
    Key, Section,
    Unit::Is,
    Value::{Flag, Name, Number, Pair, Pairs, Table, Word},
};
use super::names::check_identifier;
use super::{
    ConfigurationError, EXPERIMENT, ExperimentSection, ModelName, Parameter, Range, ReferenceSection,
    reference,
};

/// The nominal controllers by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ControllerName {
    /// [`damping`](punctual_reference::nominal::damping): of speeds, and of the angle that a rate steers.
    Damping,
    /// [`Heading`] to one goal.
    Heading,
    /// [`Heading`] to one point after the other; the last is held.
    Waypoints,
}

impl ControllerName {
    /// Its name in a configuration.
    pub fn name(self) -> &'static str {
        match self {
            Self::Damping => "damping",
            Self::Heading => "heading",
            Self::Waypoints => "waypoints",
        }
    }
}

/// The numbers of the controllers, each with the controllers and models that have it.
struct Gain {
    key: Key,
    /// Meaning, as the FMU tells it.
    description: &'static str,
    has: fn(ControllerName, ModelName) -> bool,
    default: fn(&Heading) -> f64,
    access: fn(&mut ControllerConfiguration) -> &mut Option<f64>,
}

fn drives(controller: ControllerName, _: ModelName) -> bool {
    controller != ControllerName::Damping
}

fn turns(controller: ControllerName, model: ModelName) -> bool {
    drives(controller, model) && model != ModelName::PointMass
}

fn slips(controller: ControllerName, model: ModelName) -> bool {
    drives(controller, model)
        && matches!(model, ModelName::Bicycle | ModelName::BicycleSmallSlip | ModelName::BicycleKinematicSlip)
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
        has: |controller, _| controller == ControllerName::Damping,
        default: |_| GAIN,
        access: |c| &mut c.gain,
    },
    Gain {
        key: Key::new(
            "acceptance_radius",
            Number(Is("m"), Range::POSITIVE),
            Some("1"),
            "`waypoints`: distance from a point at which the next one becomes the goal",
        ),
        description: "distance from a point at which the next one becomes the goal",
        has: |controller, _| controller == ControllerName::Waypoints,
        default: |_| ACCEPTANCE,
        access: |c| &mut c.acceptance_radius,
    },
    Gain {
        key: Key::new(
            "speed_gain",
            Number(Is("1/s"), Range::POSITIVE),
            Some("0.8"),
            "speed aimed at per distance to the goal",
        ),
        description: "speed aimed at per distance to the goal",
        has: drives,
        default: |h| h.speed_gain,
        access: |c| &mut c.speed_gain,
    },
    Gain {
        key: Key::new(
            "speed_limit",
            Number(Is("m/s"), Range::POSITIVE),
            Some("15"),
            "largest speed aimed at",
        ),
        description: "largest speed aimed at",
        has: drives,
        default: |h| h.speed_limit,
        access: |c| &mut c.speed_limit,
    },
    Gain {
        key: Key::new(
            "acceleration_gain",
            Number(Is("1/s"), Range::POSITIVE),
            Some("1"),
            "acceleration per speed error",
        ),
        description: "acceleration per speed error",
        has: drives,
        default: |h| h.acceleration_gain,
        access: |c| &mut c.acceleration_gain,
    },
    Gain {
        key: Key::new(
            "acceleration_limit",
            Number(Is("m/s2"), Range::POSITIVE),
            Some("10"),
            "largest acceleration",
        ),
        description: "largest acceleration",
        has: drives,
        default: |h| h.acceleration_limit,
        access: |c| &mut c.acceleration_limit,
    },
    Gain {
        key: Key::new(
            "turn_gain",
            Number(Is("1/s"), Range::POSITIVE),
            Some("3"),
            "turning rate per angle to the goal; not for the point mass",
        ),
        description: "turning rate per angle to the goal",
        has: turns,
        default: |h| h.turn_gain,
        access: |c| &mut c.turn_gain,
    },
    Gain {
        key: Key::new(
            "turn_limit",
            Number(Is("rad/s"), Range::POSITIVE),
            Some("3"),
            "largest turning rate; not for the point mass",
        ),
        description: "largest turning rate",
        has: turns,
        default: |h| h.turn_limit,
        access: |c| &mut c.turn_limit,
    },
    Gain {
        key: Key::new(
            "slip_limit",
            Number(Is("rad"), Range::POSITIVE),
            Some("1"),
            "largest slip angle; bicycles steered by it",
        ),
        description: "largest slip angle",
        has: slips,
        default: |h| h.slip_limit,
        access: |c| &mut c.slip_limit,
    },
];

/// A controller.
pub(super) static SECTION: Section = Section {
    name: "controller",
    keys: || {
        static KEYS: [Key; 7] = [
            Key::new("kind", Word(&["controller"]), None, ""),
            Key::new("name", Name, Some("`controller`"), "the FMU's name"),
            Key::new("plant", Table(&reference::SECTION), None, "`model`, `l_r`, `l_f` of a vehicle"),
            Key::new(
                "controller",
                Word(&["damping", "heading", "waypoints"]),
                None,
                "`damping`, `heading` to a goal, `waypoints` one after the other, the last one held (output `waypoint`)",
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

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum ControllerKind {
    Controller,
}

/// A controller FMU: from the state of a plant to `u_ref`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ControllerConfiguration {
    pub(super) kind: ControllerKind,
    /// The FMU's name, a C identifier. Default `controller`.
    #[serde(default)]
    pub name: String,
    /// The kind of controller.
    pub controller: ControllerName,
    /// Whether outputs follow inputs without a step between them. Default true; with false, outputs
    /// are computed in steps only.
    #[serde(default = "yes")]
    pub direct_feedthrough: bool,
    /// `damping`: in 1/s, > 0. Default 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
    /// `heading`: the goal in m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goal: Option<[f64; 2]>,
    /// `heading`: whether the goal is an input of the FMU, such as another FMU's output, that starts with
    /// the value here, and not a parameter. Default false.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub goal_input: bool,
    /// `waypoints`: the points in m, in order, at least one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<[f64; 2]>,
    /// `waypoints`: a point counts as reached within this distance in m, > 0. Default 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub acceptance_radius: Option<f64>,
    /// `heading`, `waypoints`: as [`Heading::speed_gain`], whose type has the defaults of this and the following.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_gain: Option<f64>,
    /// As [`Heading::speed_limit`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_limit: Option<f64>,
    /// As [`Heading::acceleration_gain`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub acceleration_gain: Option<f64>,
    /// As [`Heading::acceleration_limit`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub acceleration_limit: Option<f64>,
    /// As [`Heading::turn_gain`]; not for the point mass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turn_gain: Option<f64>,
    /// As [`Heading::turn_limit`]; not for the point mass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turn_limit: Option<f64>,
    /// As [`Heading::slip_limit`]; bicycles only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slip_limit: Option<f64>,
    /// The plant that it controls.
    pub plant: ReferenceSection,
    /// The run that it is meant for.
    #[serde(default)]
    pub experiment: ExperimentSection,
}

fn yes() -> bool {
    true
}

impl ControllerConfiguration {
    pub(super) fn completed(mut self) -> Result<Self, ConfigurationError> {
        if self.name.is_empty() {
            self.name = "controller".to_owned();
        }
        check_identifier("name", &self.name)?;
        self.plant.complete()?;
        // The controller must suit the plant.
        let (controller, model) = (self.controller, self.plant.model);
        let refuse = |field: &str, message: String| Err(ConfigurationError::new(field, message));
        let name = controller.name();
        if drives(controller, model)
            && matches!(
                model,
                ModelName::BicycleSmallSlipRate
                    | ModelName::BicycleKinematic
                    | ModelName::BicycleKinematicAngle
            )
        {
            let message = format!("is {name:?}, which {} has none of; must be \"damping\"", model.name());
            return refuse("controller", message);
        }
        // The target, a goal or points, must be that of the controller.
        let (heading, waypoints) =
            (controller == ControllerName::Heading, controller == ControllerName::Waypoints);
        for (field, given, has) in
            [("goal", self.goal.is_some(), heading), ("points", !self.points.is_empty(), waypoints)]
        {
            match (given, has) {
                (true, false) => return refuse(field, format!("{name} has none")),
                (false, true) => return refuse(field, format!("missing, {name} needs it")),
                _ => {}
            }
        }
        if self.goal_input && !heading {
            return refuse("goal_input", format!("{name} has none"));
        }
        // Complete the gains.
        let defaults = Heading::towards([0.0; 2]);
        for gain in &GAINS {
            let value = (gain.access)(&mut self);
            if (gain.has)(controller, model) {
                value.get_or_insert((gain.default)(&defaults));
            } else if value.is_some() {
                return refuse(gain.key.name, format!("{name} of {} has none", model.name()));
            }
        }
        // Check every number against its range.
        self.experiment.check()?;
        // The start values of inputs are not parameters.
        if let Some([x, y]) = self.goal {
            Range::FINITE.check("goal[1]", x)?;
            Range::FINITE.check("goal[2]", y)?;
        }
        for parameter in self.parameters() {
            parameter.check(&mut self)?;
        }
        Ok(self)
    }

    /// The numbers that are parameters of the FMU.
    pub fn parameters(&self) -> Vec<Parameter<Self>> {
        let mut rows: Vec<Parameter<Self>> = Vec::new();
        let axes = ["x", "y"];
        for (i, axis) in axes.iter().enumerate().filter(|_| self.goal.is_some() && !self.goal_input) {
            let name = format!("goal[{}]", i + 1);
            let description = format!("the goal along {axis}");
            rows.push(Parameter::new(
                (name.clone(), name),
                "m",
                Range::FINITE,
                description,
                move |c: &mut Self| c.goal.as_mut().map(|goal| &mut goal[i]),
            ));
        }
        for k in 0..self.points.len() {
            for (i, axis) in axes.iter().enumerate() {
                // Files count points from 0, as the error messages of serde do; variables from 1, as FMI.
                let names = (format!("points[{},{}]", k + 1, i + 1), format!("points[{k}][{}]", i + 1));
                let description = format!("point {} along {axis}", k + 1);
                rows.push(Parameter::new(names, "m", Range::FINITE, description, move |c: &mut Self| {
                    c.points.get_mut(k).map(|point| &mut point[i])
                }));
            }
        }
        for gain in GAINS.iter().filter(|g| (g.has)(self.controller, self.plant.model)) {
            let Number(unit, range) = gain.key.value else { continue };
            let names = (gain.key.name.to_owned(), gain.key.name.to_owned());
            let unit = unit.of_barrier("1", 0);
            rows.push(Parameter::new(names, unit, range, gain.description, |c: &mut Self| {
                (gain.access)(c).as_mut()
            }));
        }
        if slips(self.controller, self.plant.model) {
            rows.extend(
                self.plant.parameters(|c: &mut Self| &mut c.plant.l_r, |c: &mut Self| &mut c.plant.l_f),
            );
        }
        rows
    }

    /// Its inputs besides the state, with units, start values and meanings.
    pub fn goal_inputs(&self) -> Vec<(&'static str, &'static str, f64, &'static str)> {
        let [x, y] = self.goal.unwrap_or_default();
        if !self.goal_input {
            return Vec::new();
        }
        vec![("goal[1]", "m", x, "the goal along x"), ("goal[2]", "m", y, "the goal along y")]
    }

    /// The damped states, each with the input that acts against it, by their positions.
    pub fn damped(&self) -> &'static [(usize, usize)] {
        match self.plant.model {
            ModelName::PointMass => &[(2, 0), (3, 1)],
            ModelName::Unicycle
            | ModelName::Bicycle
            | ModelName::BicycleSmallSlip
            | ModelName::BicycleKinematicAngle
            | ModelName::BicycleKinematicSlip => &[(3, 0)],
            ModelName::BicycleSmallSlipRate | ModelName::BicycleKinematic => &[(3, 0), (4, 1)],
        }
    }

    /// The controller of `heading` and `waypoints` towards `goal` (m). A gain that is not given has the default.
    pub fn heading(&self, goal: [f64; 2]) -> Heading {
        let or = |value: Option<f64>, default: f64| value.unwrap_or(default);
        let defaults = Heading::towards(goal);
        Heading {
            goal,
            speed_gain: or(self.speed_gain, defaults.speed_gain),
            speed_limit: or(self.speed_limit, defaults.speed_limit),
            acceleration_gain: or(self.acceleration_gain, defaults.acceleration_gain),
            acceleration_limit: or(self.acceleration_limit, defaults.acceleration_limit),
            turn_gain: or(self.turn_gain, defaults.turn_gain),
            turn_limit: or(self.turn_limit, defaults.turn_limit),
            slip_limit: or(self.slip_limit, defaults.slip_limit),
        }
    }

    /// The gain of `damping` in 1/s.
    pub fn damping_gain(&self) -> f64 {
        self.gain.unwrap_or(GAIN)
    }

    /// The acceptance radius of `waypoints` in m.
    pub fn acceptance(&self) -> f64 {
        self.acceptance_radius.unwrap_or(ACCEPTANCE)
    }
}
