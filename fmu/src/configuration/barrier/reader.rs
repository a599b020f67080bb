//! From the keys of a `[[barrier]]` to its shape: which shape it is, and the numbers of its keys.

use std::fmt;

use serde::Deserialize;
use serde::de::{Deserializer, EnumAccess, VariantAccess, Visitor};

use super::super::model::usual_position;
use super::super::unit::measured;
use super::super::{ConfigurationError, PlantSection, check_unit};
use super::Automatic;
use super::raw::{FromPlace, Place, RawBarrier};
use super::shape::{NAMES, Point, SHAPES, Shape, ShapeRow};

/// A shape by its name.
#[derive(Clone, Copy)]
pub(super) struct Kind(&'static ShapeRow);

impl Kind {
    /// The shape of this name.
    pub(super) fn named(name: &str) -> Option<Self> {
        SHAPES.iter().find(|row| row.name == name).map(Self)
    }

    pub(super) fn name(self) -> &'static str {
        self.0.name
    }
}

impl<'de> Deserialize<'de> for Kind {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Word;
        impl<'de> Visitor<'de> for Word {
            type Value = Kind;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of a shape")
            }
            fn visit_enum<A: EnumAccess<'de>>(self, data: A) -> Result<Kind, A::Error> {
                let (name, nothing) = data.variant::<String>()?;
                nothing.unit_variant()?;
                Kind::named(&name).ok_or_else(|| serde::de::Error::unknown_variant(&name, &NAMES))
            }
        }
        deserializer.deserialize_enum("ShapeName", &NAMES, Word)
    }
}

/// A `[[barrier]]` whose shape is being read.
pub(super) struct Reader<'a> {
    pub(super) raw: &'a RawBarrier,
    row: &'static ShapeRow,
    /// Names the barrier in errors.
    pub(super) path: &'a str,
    plant: &'a PlantSection,
}

impl Reader<'_> {
    fn refuse<T>(&self, key: &str, message: impl Into<String>) -> Result<T, ConfigurationError> {
        Err(ConfigurationError::new(format!("{}.{key}", self.path), message))
    }

    fn missing<T>(&self, key: &str) -> Result<T, ConfigurationError> {
        self.refuse(key, format!("missing, {} needs it", self.row.name))
    }

    pub(super) fn need<T>(&self, key: &str, value: Option<T>) -> Result<T, ConfigurationError> {
        value.map_or_else(|| self.missing(key), Ok)
    }

    /// Refuses keys of other shapes, and missing keys.
    fn check_keys(&self) -> Result<(), ConfigurationError> {
        for (key, given) in self.raw.of_shape() {
            let (required, optional) = (self.row.required.contains(&key), self.row.optional.contains(&key));
            if given && !required && !optional {
                return self.refuse(key, format!("{} has none", self.row.name));
            }
            if !given && required {
                return self.missing(key);
            }
        }
        Ok(())
    }

    /// Refuses a shape that the plant has no states or no positions for.
    fn check_plant(&self) -> Result<(), ConfigurationError> {
        let (shape, plant) = (self.row.name, self.plant);
        let is_own = matches!(plant, PlantSection::Expressions(_));
        let in_space = ["sphere", "spherical_obstacle", "box", "box_obstacle", "apart"].contains(&shape);
        let message = if plant.is_external() && shape != "external" {
            format!("is {shape:?}, which needs states; this plant has none, so it is \"external\"")
        } else if plant.plugin().is_some() && !["plugin", "external"].contains(&shape) {
            format!("is {shape:?}; the barriers of a plug-in are its own (\"plugin\")")
        } else if plant.plugin().is_none() && shape == "plugin" {
            format!("is {shape:?}, but the plant is not one")
        } else if is_own && shape == "speed_limit" {
            format!("is {shape:?}, which is for the plants that have a name; give an `expression`")
        } else if plant.reference().is_some() && in_space {
            format!(
                "is {shape:?}, which is for models of your own: the plants that have a name move in the plane, alone"
            )
        } else {
            return Ok(());
        };
        self.refuse("shape", message)
    }

    /// The numbers of a key along the axes.
    fn place<P: FromPlace>(&self, key: &str, value: Option<Place>) -> Result<P, ConfigurationError> {
        let place = self.need(key, value)?;
        P::from_place(place).map_or_else(
            || {
                let found = if matches!(place, Place::Plane(_)) { 2 } else { 3 };
                self.refuse(key, format!("has {found} entries, must have {} for {}", P::COUNT, self.row.name))
            },
            Ok,
        )
    }

    pub(super) fn centre<P: FromPlace>(&self) -> Result<P, ConfigurationError> {
        self.place("centre", self.raw.centre)
    }

    pub(super) fn half_sides<P: FromPlace>(&self) -> Result<P, ConfigurationError> {
        self.place("half_sides", self.raw.half_sides)
    }

    /// The states that are the position from which another is kept apart.
    pub(super) fn from(&self) -> Result<Vec<String>, ConfigurationError> {
        let from = self.need("from", self.raw.from.clone())?;
        self.check_position("from", &from)?;
        Ok(from)
    }

    /// Refuses what names no 2 or 3 different states.
    fn check_position(&self, key: &str, position: &[String]) -> Result<(), ConfigurationError> {
        if !(2..=3).contains(&position.len()) {
            let count = entries(position.len());
            return self.refuse(key, format!("has {count}, must have 2 or 3: states along x, y and z"));
        }
        let names: Vec<_> = self.plant.states().into_iter().map(|s| s.name).collect();
        for (i, state) in position.iter().enumerate() {
            if !names.contains(state) {
                let names = names.join(", ");
                return self.refuse(key, format!("has {state:?}, which is no state, must be of {names}"));
            }
            if position[..i].contains(state) {
                return self.refuse(key, format!("has {state:?} twice, must be different states"));
            }
        }
        Ok(())
    }

    /// The states that are the position along `axes` axes, of a plant without a name: those that the file gives, or those with
    /// the usual names.
    fn position(&self, axes: usize) -> Result<Vec<String>, ConfigurationError> {
        let position = match &self.raw.position {
            Some(position) => position.clone(),
            None => {
                let states = self.plant.states();
                let names: Vec<&str> = states.iter().map(|state| state.name.as_str()).collect();
                let missing = || {
                    let names = names.join(", ");
                    let message = format!(
                        "missing, {} needs it here: the states that are the position along {}, of {names}",
                        self.row.name,
                        if axes == 2 { "x and y" } else { "x, y and z" }
                    );
                    self.refuse("position", message)
                };
                usual_position(&names, axes).map_or_else(missing, Ok)?
            }
        };
        self.check_position("position", &position)?;
        if position.len() != axes {
            let count = entries(position.len());
            return self.refuse("position", format!("has {count}, must have {axes} for {}", self.row.name));
        }
        Ok(position)
    }

    pub(super) fn point(&self) -> Result<Point, ConfigurationError> {
        let velocity = self.raw.velocity.unwrap_or_default();
        let RawBarrier { centre_input, acceleration, centre_error, velocity_error, .. } = *self.raw;
        // An error of 0 is none.
        let [centre_error, velocity_error] =
            [centre_error, velocity_error].map(|error| error.filter(|error| *error != 0.0));
        let known = [
            ("acceleration", acceleration),
            ("centre_error", centre_error),
            ("velocity_error", velocity_error),
        ];
        if let Some((key, _)) = known.iter().find(|(_, value)| value.is_some() && !centre_input) {
            return self.refuse(key, "is for a centre that is measured: it needs `centre_input = true`");
        }
        if let Some((key, _)) = known.iter().find(|(_, value)| value.is_some() && acceleration.is_none()) {
            return self.refuse(key, "needs `acceleration` beside it: only plans account for it");
        }
        let centre = self.centre()?;
        Ok(Point { centre, velocity, centre_input, acceleration, centre_error, velocity_error })
    }

    pub(super) fn smoothing(&self) -> Automatic {
        Automatic(self.raw.smoothing.unwrap_or_default())
    }

    pub(super) fn angle(&self) -> f64 {
        self.raw.angle.unwrap_or_default()
    }

    /// The name of a state of the plant.
    pub(super) fn state(&self) -> Result<String, ConfigurationError> {
        let state = self.need("state", self.raw.state.clone())?;
        let names: Vec<_> = self.plant.states().into_iter().map(|s| s.name).collect();
        if names.contains(&state) {
            return Ok(state);
        }
        self.refuse("state", format!("is {state:?}, must be one of {}", names.join(", ")))
    }

    /// The unit of h.
    pub(super) fn unit(&self, default: &str) -> Result<String, ConfigurationError> {
        let unit = self.raw.unit.as_deref().unwrap_or(default);
        check_unit(&format!("{}.unit", self.path), unit)?;
        Ok(unit.to_owned())
    }

    /// Refuses an expression of h whose unit certainly is not the one given, or none.
    pub(super) fn check_unit_of(&self, expression: &str) -> Result<(), ConfigurationError> {
        // One that cannot be read is refused with the filter.
        if self.plant.expressions()?.barrier(expression).is_err() {
            return Ok(());
        }
        let found = self.plant.unit_of(expression).or_else(|message| self.refuse("expression", message))?;
        let given = self.raw.unit.as_deref().and_then(measured);
        match (found, given) {
            (Some(found), Some(given)) if !found.is(&given) => self.refuse(
                "unit",
                format!("is {given:?}, but {expression:?} is in {found}", given = given.to_string()),
            ),
            _ => Ok(()),
        }
    }

    /// The name of a barrier of the plug-in, and its unit.
    pub(super) fn output(&self) -> Result<(String, String), ConfigurationError> {
        let output = self.raw.output.as_ref().unwrap_or(&self.raw.name);
        let known = self.plant.plugin_barriers();
        let Some(barrier) = known.iter().find(|b| b.name == *output) else {
            let names: Vec<_> = known.iter().map(|b| b.name.as_str()).collect();
            let names = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            let message = "which is not a barrier of the plug-in; its barriers are";
            return self.refuse("output", format!("is {output:?}, {message} {names}"));
        };
        match &self.raw.unit {
            Some(unit) if *unit != barrier.unit => {
                self.refuse("unit", format!("is {unit:?}, but the plug-in gives {:?}", barrier.unit))
            }
            _ => Ok((output.clone(), barrier.unit.clone())),
        }
    }
}

/// How many entries a list has, in words.
pub(super) fn entries(count: usize) -> String {
    if count == 1 { "1 entry".to_owned() } else { format!("{count} entries") }
}

impl Shape {
    /// Parses the shape in `raw`, of a barrier of `plant`, and the states that are its position where the plant has no name;
    /// `path` names the barrier in errors.
    pub(super) fn parse(
        raw: &RawBarrier,
        path: &str,
        plant: &PlantSection,
    ) -> Result<(Self, Vec<String>), ConfigurationError> {
        let unstated = match raw.expression {
            _ if plant.plugin().is_some() => "plugin",
            _ if plant.is_external() => "external",
            Some(_) => "expression",
            None => "disc",
        };
        let by_name = |name: &str| SHAPES.iter().find(|row| row.name == name).unwrap_or(&SHAPES[0]);
        let row = raw.shape.map_or_else(|| by_name(unstated), |kind| kind.0);
        let reader = Reader { raw, row, path, plant };
        reader.check_plant()?;
        reader.check_keys()?;
        let shape = (row.read)(&reader)?;
        if !matches!(plant, PlantSection::Expressions(_)) {
            return match raw.position {
                Some(_) => {
                    reader.refuse("position", "is for models of your own; this plant has its own position")
                }
                None => Ok((shape, Vec::new())),
            };
        }
        if shape.followed().is_some() {
            return reader.refuse(
                "centre_input",
                "is for the plants that have a name; make the centre two states of the model",
            );
        }
        let position = shape.axes().map_or_else(|| Ok(Vec::new()), |axes| reader.position(axes))?;
        match &shape {
            Shape::Apart { from, .. } if from.iter().any(|state| position.contains(state)) => reader.refuse(
                "from",
                format!("has a state of `position` ({}), must be another one", position.join(", ")),
            ),
            _ => Ok((shape, position)),
        }
    }
}
