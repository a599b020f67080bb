//! `[[barrier]]` as written in a file: the keys of all shapes.

use core::fmt;

use punctual_core::elementary;
use serde::Deserialize;
use serde::de::{Deserializer, Error, SeqAccess, Visitor};

use super::super::model::OwnModel;
use super::super::{ConfigurationError, mentions};
use super::reader::{Kind, entries};
use super::{InfeasibleName, MethodName, ProfileName};

/// Numbers along the axes of the plane or of space.
#[derive(Clone, Copy)]
pub(super) enum Place {
    Plane([f64; 2]),
    Space([f64; 3]),
}

impl<'de> Deserialize<'de> for Place {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Axes;
        impl<'de> Visitor<'de> for Axes {
            type Value = Place;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list with 2 or 3 entries")
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Place, A::Error> {
                let mut found = Vec::new();
                while let Some(number) = list.next_element::<f64>()? {
                    found.push(number);
                }
                match found[..] {
                    [x, y] => Ok(Place::Plane([x, y])),
                    [x, y, z] => Ok(Place::Space([x, y, z])),
                    _ => Err(A::Error::custom(format!("has {}, must have 2 or 3", entries(found.len())))),
                }
            }
        }
        deserializer.deserialize_tuple_struct("Place", 3, Axes)
    }
}

/// As many of the numbers as a shape needs.
pub(super) trait FromPlace: Sized {
    /// How many, in words.
    const COUNT: &'static str;

    fn from_place(place: Place) -> Option<Self>;
}

impl FromPlace for [f64; 2] {
    const COUNT: &'static str = "2, along x and y";

    fn from_place(place: Place) -> Option<Self> {
        if let Place::Plane(numbers) = place { Some(numbers) } else { None }
    }
}

impl FromPlace for [f64; 3] {
    const COUNT: &'static str = "3, along x, y and z";

    fn from_place(place: Place) -> Option<Self> {
        if let Place::Space(numbers) = place { Some(numbers) } else { None }
    }
}

/// The keys of a `[[barrier]]`; [`KEYS`](super::keys::KEYS) has their meanings.
#[derive(Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in super::super) struct RawBarrier {
    pub(in super::super) name: String,
    pub(in super::super) agent: Option<String>,
    pub(super) shape: Option<Kind>,
    pub(super) centre: Option<Place>,
    pub(super) position: Option<Vec<String>>,
    pub(super) from: Option<Vec<String>>,
    pub(super) distance: Option<f64>,
    pub(super) velocity: Option<[f64; 2]>,
    #[serde(default)]
    pub(super) centre_input: bool,
    pub(super) acceleration: Option<f64>,
    pub(super) centre_error: Option<f64>,
    pub(super) velocity_error: Option<f64>,
    pub(super) radius: Option<f64>,
    pub(super) smoothing: Option<f64>,
    pub(super) half_axes: Option<[f64; 2]>,
    pub(super) half_sides: Option<Place>,
    pub(super) angle: Option<f64>,
    pub(super) normal: Option<[f64; 2]>,
    pub(super) state: Option<String>,
    pub(super) bound: Option<f64>,
    pub(super) expression: Option<String>,
    pub(super) output: Option<String>,
    pub(super) unit: Option<String>,
    pub(super) relative_degree: Option<usize>,
    pub(super) deadline: Option<f64>,
    #[serde(default)]
    pub(super) method: MethodName,
    #[serde(default)]
    pub(super) profile: ProfileName,
    #[serde(default)]
    pub(super) when_infeasible: InfeasibleName,
    #[serde(default)]
    pub(super) rate: f64,
    #[serde(default)]
    pub(super) rates: Vec<f64>,
    #[serde(default)]
    pub(super) stay_rate: f64,
    pub(super) margin: Option<f64>,
    #[serde(default)]
    pub(super) recovery: f64,
    #[serde(default)]
    pub(super) disturbance: f64,
    pub(super) priority: Option<u32>,
    #[serde(default)]
    pub(super) penalty: f64,
    #[serde(default)]
    pub(super) begin: f64,
    pub(in super::super) after: Option<String>,
    #[serde(default)]
    pub(super) end: f64,
    #[serde(default)]
    pub(super) until_arrival: bool,
    #[serde(default)]
    pub(super) stay: f64,
    pub(in super::super) until: Option<String>,
    pub(in super::super) choice: Option<String>,
    pub(super) alternative: Option<String>,
}

impl RawBarrier {
    /// Two positions that are at least `distance` m apart.
    pub(in super::super) fn apart(name: String, [position, from]: [Vec<String>; 2], distance: f64) -> Self {
        let (position, from, distance) = (Some(position), Some(from), Some(distance));
        Self { name, shape: Kind::named("apart"), position, from, distance, ..Self::default() }
    }

    /// Whether it names the state or input `name`.
    pub(in super::super) fn mentions(&self, name: &str) -> bool {
        let lists = [&self.position, &self.from].into_iter().flatten().flatten();
        let is = |other: &String| other == name;
        self.state.as_ref().is_some_and(is)
            || lists.into_iter().any(is)
            || self.expression.as_ref().is_some_and(|text| mentions(text, name))
    }

    /// Makes it, which is written in the names of `model`, one of an agent; `renamed` gives the expressions of that. `path` names
    /// it in errors.
    pub(in super::super) fn of_agent(
        &mut self,
        model: &OwnModel,
        path: &str,
        renamed: impl Fn(&str) -> String,
    ) -> Result<(), ConfigurationError> {
        let shape = self.shape.map(Kind::name).or(self.expression.is_none().then_some("disc"));
        let names: Vec<&str> = model.states.iter().map(|state| state.name.as_str()).collect();
        if shape == Some("speed_limit") && model.model.is_some() {
            let bound = self.bound.take();
            let Some(bound) = bound.filter(|bound| bound.is_finite() && *bound > 0.0) else {
                let found = bound.map_or_else(|| "missing".to_owned(), |bound| format!("is {bound}"));
                return Err(ConfigurationError::new(
                    format!("{path}.bound"),
                    format!("{found}, must be > 0"),
                ));
            };
            // As the core has it.
            let smoothing = 0.5 * bound;
            let speed = if names.contains(&"v") { "v^2" } else { "v_x^2 + v_y^2" };
            let level = elementary::hypot(bound, smoothing);
            let text = format!("{level:?} - sqrt({speed} + {:?})", smoothing * smoothing);
            (self.shape, self.expression) = (Kind::named("expression"), Some(text));
            self.unit = Some("m/s".to_owned());
        }
        let axes = match shape {
            Some("sphere" | "spherical_obstacle" | "box" | "box_obstacle") => Some(3),
            None | Some("expression" | "at_most" | "at_least" | "speed_limit") => None,
            Some(_) => Some(2),
        };
        if self.position.is_none()
            && let Some(axes) = axes
        {
            self.position = model.position().filter(|all| all.len() >= axes).map(|all| all[..axes].to_vec());
        }
        let lists = [&mut self.position, &mut self.from].into_iter().flatten().flatten();
        for name in lists.chain(&mut self.state).chain(&mut self.expression) {
            *name = renamed(name);
        }
        Ok(())
    }

    /// The keys that say when, and whether they are given.
    pub(super) fn of_time(&self) -> [(&'static str, bool); 9] {
        [
            ("deadline", self.deadline.is_some()),
            ("begin", self.begin != 0.0),
            ("after", self.after.is_some()),
            ("end", self.end != 0.0),
            ("until_arrival", self.until_arrival),
            ("stay", self.stay != 0.0),
            ("until", self.until.is_some()),
            ("choice", self.choice.is_some()),
            ("alternative", self.alternative.is_some()),
        ]
    }

    /// The keys that only some shapes have, and whether they are given; looked at in this order.
    pub(super) fn of_shape(&self) -> [(&'static str, bool); 21] {
        [
            ("centre", self.centre.is_some()),
            ("position", self.position.is_some()),
            ("from", self.from.is_some()),
            ("distance", self.distance.is_some()),
            ("centre_input", self.centre_input),
            ("velocity", self.velocity.is_some()),
            ("acceleration", self.acceleration.is_some()),
            ("centre_error", self.centre_error.is_some()),
            ("velocity_error", self.velocity_error.is_some()),
            ("radius", self.radius.is_some()),
            ("smoothing", self.smoothing.is_some()),
            ("half_axes", self.half_axes.is_some()),
            ("half_sides", self.half_sides.is_some()),
            ("angle", self.angle.is_some()),
            ("normal", self.normal.is_some()),
            ("state", self.state.is_some()),
            ("bound", self.bound.is_some()),
            ("expression", self.expression.is_some()),
            ("output", self.output.is_some()),
            ("unit", self.unit.is_some()),
            ("relative_degree", self.relative_degree.is_some()),
        ]
    }
}
