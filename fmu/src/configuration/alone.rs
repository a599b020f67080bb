//! A run of a filter's file alone: the plant, the start and the nominal controller that are in it.

use std::collections::BTreeMap;

use super::controller::ControllerKind;
use super::plant::PlantKind;
use super::{
    ConfigurationError, Controller, ControllerConfiguration, Deviation, DisturbanceSection,
    FilterConfiguration, FollowerSection, IntegrationSection, ModelName, PlantConfiguration, PlantSection,
};

/// What a run of a filter's file alone has besides the filter.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunSection {
    /// Initial value of each state of the plant, in its unit. A state without one starts at 0, or nearest to it in its range.
    pub x0: BTreeMap<String, f64>,
    /// An expression of states, parameters and time for each input, by name.
    pub u_ref: Option<BTreeMap<String, String>>,
    /// The plant, where it is not the filter's model.
    pub simulated: Option<PlantSection>,
    /// Integration between communication points.
    pub integration: IntegrationSection,
    /// Disturbances that the model does not know.
    pub disturbance: Option<DisturbanceSection>,
    /// The plan that a file of the C library follows.
    pub follower: Option<FollowerSection>,
}

impl FilterConfiguration {
    /// The plant of a run of this file alone, and its nominal controller, if it has one.
    ///
    /// # Errors
    ///
    /// A start, controller or disturbance that does not fit the plant; a plant that cannot be simulated, such as one of which
    /// only the inputs are known.
    pub fn alone(&self) -> Result<(PlantConfiguration, Option<ControllerConfiguration>), ConfigurationError> {
        let RunSection { x0, u_ref, simulated, integration, disturbance, follower: _ } = (*self.run).clone();
        let is_model = simulated.is_none() && self.integrator.is_none();
        let plant = simulated.map_or_else(|| self.outside(), Ok)?;
        let controller = u_ref.map(|u_ref| {
            let controller = ControllerConfiguration {
                kind: ControllerKind::Controller,
                name: "controller".to_owned(),
                controller: Controller::Expressions { u_ref },
                direct_feedthrough: true,
                plant: plant.clone(),
                experiment: self.experiment,
            };
            controller.functions::<f64>().map(|_| controller)
        });
        let (kind, name, experiment) = (PlantKind::Plant, "plant".to_owned(), self.experiment);
        let is_late = is_model && self.actuation_delay > 0.0;
        let deviation = is_late.then(|| Box::new(Deviation::late(self, experiment.step_size)));
        let output = Vec::new();
        let plant = PlantConfiguration {
            kind,
            name,
            plant,
            output,
            integration,
            disturbance,
            x0,
            experiment,
            deviation,
        };
        Ok((plant.completed()?, controller.transpose()?))
    }

    /// The plant outside: the model of the filter, with the state that it integrates as an input.
    fn outside(&self) -> Result<PlantSection, ConfigurationError> {
        let needs = |reason: &str| {
            Err(ConfigurationError::new(
                "simulated",
                format!("missing: {reason}, so give the plant to simulate"),
            ))
        };
        let Some(integrator) = &self.integrator else {
            return match self.plant.is_external() {
                true => needs("of the filter's plant only the inputs are known"),
                false => Ok(self.plant.clone()),
            };
        };
        let (state, input) = integrator.place(&self.plant)?;
        match self.plant.clone() {
            PlantSection::Expressions(mut own) => {
                own.inputs[input] = own.states.remove(state);
                own.derivatives.remove(&integrator.state);
                let plant = PlantSection::Expressions(own);
                plant.expressions().map(|_| plant)
            }
            PlantSection::Reference(mut reference) => {
                reference.model = match reference.model {
                    ModelName::BicycleSmallSlipRate => ModelName::BicycleSmallSlip,
                    ModelName::BicycleKinematic => ModelName::BicycleKinematicAngle,
                    _ => return needs("no model by name has the integrated state as its input"),
                };
                Ok(PlantSection::Reference(reference))
            }
            PlantSection::Plugin(_) | PlantSection::External { .. } => {
                needs("nothing is known of the plant outside the integrator")
            }
        }
    }
}

/// `error` about a part of the table `section` that replaces `plant`.
pub(super) fn within(section: &str, error: &ConfigurationError) -> ConfigurationError {
    let field = error.field().strip_prefix("plant").unwrap_or(error.field());
    ConfigurationError::new(format!("{section}{field}"), error.message())
}
