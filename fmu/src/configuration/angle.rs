//! Angles that were given in degrees, as it seems: in rad they are more than a turn.

use std::f64::consts::TAU;

use super::barrier::Shape;
use super::{Configuration, PlantSection};

/// What to say of a value in this unit that was given for `name`, if it is an angle of more than a turn.
pub fn in_degrees(name: &str, value: f64, unit: &str) -> Option<String> {
    let is_beyond = unit == "rad" && value.abs() > TAU;
    is_beyond.then(|| format!("{name} is {value} rad, more than a turn; is that meant in degrees?"))
}

impl Configuration {
    /// What to say of starts, angles of sets and bounds of angles that are more than a turn.
    pub fn in_degrees(&self) -> Vec<String> {
        let of = |plant: &PlantSection, state: &str| {
            plant.states().into_iter().find(|own| own.name == state).map_or_else(String::new, |own| own.unit)
        };
        let (x0, plant, barriers) = match self {
            Self::Filter(filter) => {
                let plant = filter.run.simulated.as_ref().unwrap_or(&filter.plant);
                (&filter.run.x0, plant, &filter.barrier[..])
            }
            Self::Plant(own) => (&own.x0, &own.plant, &[][..]),
            Self::Controller(_) => return Vec::new(),
        };
        let starts = x0
            .iter()
            .filter_map(|(state, value)| in_degrees(&format!("x0.{state}"), *value, &of(plant, state)));
        let sets = barriers.iter().filter_map(|barrier| {
            let (key, value, unit) = match &barrier.shape {
                Shape::Ellipse { angle, .. }
                | Shape::EllipticObstacle { angle, .. }
                | Shape::Rectangle { angle, .. }
                | Shape::RectangularObstacle { angle, .. } => ("angle", *angle, "rad".to_owned()),
                Shape::AtMost { state, bound } | Shape::AtLeast { state, bound } => {
                    ("bound", *bound, of(plant, state))
                }
                _ => return None,
            };
            in_degrees(&format!("{key} of {}", barrier.name), value, &unit)
        });
        starts.chain(sets).collect()
    }
}
