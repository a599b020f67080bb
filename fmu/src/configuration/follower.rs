//! `[follower]` of a filter: the plan that a file of the C library follows, made for a set of starts.

use std::collections::BTreeMap;

use punctual_core::filter::TabledPlan;
use serde::Deserialize;

use super::key::{Key, Section, Unit::Of, Value::NumberByName};
use super::names::check_known;
use super::{ConfigurationError, FilterConfiguration, PlantSection, Range};

/// `[follower]`: docs/embedded.md has how it is used.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FollowerSection {
    /// How far each state, as it is measured, may be from `x0` at the first step, by name, in its unit; 0 for the others.
    #[serde(default)]
    pub start: BTreeMap<String, f64>,
    /// By how much each input may differ from the plan's law, by name, in its unit, and 0 for the others. `None`: as much as can
    /// be.
    pub freedom: Option<BTreeMap<String, f64>>,
}

/// `[follower]`.
pub(super) static SECTION: Section = Section {
    name: "follower",
    keys: || {
        static KEYS: [Key; 2] = [
            Key::new(
                "start",
                NumberByName(Of("unit of the state"), Range::NON_NEGATIVE),
                Some("0 each"),
                "how far each state, as it is measured, may be from `x0` at the first step, by name: the plan is for every such start",
            ),
            Key::new(
                "freedom",
                NumberByName(Of("unit of the input"), Range::NON_NEGATIVE),
                Some("the largest part of half the width of its bounds that is found, up to a half"),
                "by how much each input may follow u_ref away from the plan, by name; 0 for those left out",
            ),
        ];
        KEYS.iter().collect()
    },
};

impl FollowerSection {
    /// Refuses names that the plant does not have, and sizes that are none.
    pub(super) fn check(&self, plant: &PlantSection) -> Result<(), ConfigurationError> {
        check_known("follower.start", &self.start, "state", &plant.states())?;
        let none = BTreeMap::new();
        let freedom = self.freedom.as_ref().unwrap_or(&none);
        check_known("follower.freedom", freedom, "input", &plant.inputs())?;
        let sizes = [("start", &self.start), ("freedom", freedom)];
        let mut sizes = sizes.iter().flat_map(|(key, sizes)| sizes.iter().map(move |size| (key, size)));
        match sizes.find(|(_, (_, size))| !(size.is_finite() && **size >= 0.0)) {
            None => Ok(()),
            Some((key, (name, size))) => {
                let message = format!("is {size}, must be finite and >= 0");
                Err(ConfigurationError::new(format!("follower.{key}.{name}"), message))
            }
        }
    }
}

impl FilterConfiguration {
    /// The plan of `[follower]` as a table, from `x0` on; `None` without one.
    ///
    /// # Errors
    ///
    /// What no table can have; why no plan was found.
    pub fn tabled(&self) -> Result<Option<TabledPlan>, ConfigurationError> {
        let Some(section) = &self.run.follower else { return Ok(None) };
        let refuse = |field: &str, message: String| Err(ConfigurationError::new(field, message));
        for (field, is_given) in [
            ("actuation_delay", self.actuation_delay > 0.0),
            ("arm_after", self.arm_after > 0.0),
            ("integrator", self.integrator.is_some()),
            ("uncertainty.jitter", self.jitter() > 0.0),
            ("choice", self.barrier.iter().any(|barrier| barrier.choice.is_some())),
        ] {
            if is_given {
                let message = "stands beside `[follower]`, must be left out: a plan as a table has none";
                return refuse(field, message.into());
            }
        }
        if !self.is_assured() {
            return refuse(
                "follower",
                format!("is for plans, of which there are none: {}", self.unassured()),
            );
        }
        let filter = self.build_loop()?;
        let Some(planning) = filter.planning() else {
            return refuse("follower", "is for plans, of which there are none".into());
        };
        let (plant, _) = self.alone()?;
        let (states, inputs) = (self.plant.states(), self.plant.inputs());
        let by_name = |sizes: &BTreeMap<String, f64>, name: &str| sizes.get(name).copied().unwrap_or(0.0);
        let x0: Vec<f64> = states.iter().map(|state| by_name(&plant.x0, &state.name)).collect();
        let start: Vec<f64> = states.iter().map(|state| by_name(&section.start, &state.name)).collect();
        let freedom: Option<Vec<f64>> = (section.freedom.as_ref())
            .map(|freedom| inputs.iter().map(|input| by_name(freedom, &input.name)).collect());
        match planning.table(self.experiment.start_time, &x0, &start, freedom.as_deref()) {
            Ok(Ok(table)) => Ok(Some(table)),
            Ok(Err(failure)) => {
                let message = format!(
                    "has no plan for all its starts: {}. Try a smaller `start`, a later deadline or less uncertainty",
                    self.failure(failure)
                );
                refuse("follower", message)
            }
            Err(error) => refuse("follower", format!("{error}")),
        }
    }
}
