//! `shape = "external"`: a barrier whose derivatives are inputs of the filter, computed by its simulator.

use punctual_core::{MAX_INPUTS, MAX_RELATIVE_DEGREE};

use super::names::taken;
use super::{
    BarrierSection, ConfigurationError, FilterConfiguration, PlantSection, SamplingName, Shape,
    VariableSection, over_seconds, unit_per,
};

/// A real input of a filter that belongs to a barrier.
#[derive(Clone, Debug, PartialEq)]
pub struct BarrierInput {
    /// The variable's name.
    pub name: String,
    /// The unit.
    pub unit: String,
    /// The start value.
    pub start: f64,
    /// Meaning, for a human.
    pub description: String,
}

/// The inputs of the external barrier `name` of relative degree `n`, with h in `unit`, in the order of
/// [`punctual_core::lie::external`].
pub(super) fn inputs(name: &str, unit: &str, n: usize, plant: &PlantSection) -> Vec<BarrierInput> {
    let input = |field: String, unit: String, description: String| BarrierInput {
        name: format!("{name}.{field}"),
        unit,
        start: 0.0,
        description,
    };
    let mut rows = vec![input("lf0".to_owned(), unit.to_owned(), "h".to_owned())];
    for k in 1..=n {
        let without = if k == n { " where every input is 0" } else { "" };
        let description = format!("time derivative of h of order {k}{without}");
        rows.push(input(format!("lf{k}"), over_seconds(unit, k), description));
    }
    for u in plant.inputs() {
        let description = format!("what one unit of {} adds to the derivative of order {n}", u.name);
        rows.push(input(format!("lg.{}", u.name), unit_per(&over_seconds(unit, n), &u.unit), description));
    }
    rows
}

/// Refuses a relative degree out of range, by the path of the barrier.
pub(super) fn check_degree(path: &str, degree: usize) -> Result<(), ConfigurationError> {
    if (1..=MAX_RELATIVE_DEGREE).contains(&degree) {
        return Ok(());
    }
    let message = format!("is {degree}, must be 1 to {MAX_RELATIVE_DEGREE}");
    Err(ConfigurationError::new(format!("{path}.relative_degree"), message))
}

/// Refuses inputs of a plant without a model that are too many or share a name.
pub(super) fn check_inputs(inputs: &[VariableSection]) -> Result<(), ConfigurationError> {
    if inputs.len() > MAX_INPUTS {
        let message = format!("has {} entries, must have at most {MAX_INPUTS}", inputs.len());
        return Err(ConfigurationError::new("plant.inputs", message));
    }
    for (i, input) in inputs.iter().enumerate() {
        if inputs[..i].iter().any(|other| other.name == input.name) {
            return Err(taken(format!("plant.inputs[{i}].name"), &input.name));
        }
    }
    Ok(())
}

impl FilterConfiguration {
    /// The first barrier whose derivatives are inputs.
    pub fn external(&self) -> Option<&BarrierSection> {
        self.barrier.iter().find(|b| matches!(b.shape, Shape::External { .. }))
    }

    /// Refuses settings that need a prediction, which nobody can make here.
    pub(super) fn check_sampling(&self) -> Result<(), ConfigurationError> {
        let Some(barrier) = self.external() else { return Ok(()) };
        let why = format!("barrier {} is external, and what it is given cannot be predicted", barrier.name);
        if self.sampling != SamplingName::Pointwise {
            let message = format!("must be \"pointwise\": {why}");
            return Err(ConfigurationError::new("sampling", message));
        }
        if self.actuation_delay != 0.0 {
            let message = format!("is {}, must be 0: {why}", self.actuation_delay);
            return Err(ConfigurationError::new("actuation_delay", message));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
