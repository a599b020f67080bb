//! A filter's file as a system: the filter, the plant that its model is, and the nominal controller that stands in it.

use std::path::Path;

use punctual_fmu::configuration::{Configuration, FilterConfiguration};

use super::model::{Model, Own};
use super::system::System;
use crate::error::Error;

/// The system of the filter in the file at `path`, and what its components are made of.
///
/// # Errors
///
/// A plant that cannot be simulated, a start or controller that does not fit it.
pub fn alone(path: &Path, filter: FilterConfiguration) -> Result<(System, Vec<Model>), Error> {
    let (plant, controller) = filter.alone()?;
    let experiment = filter.experiment;
    let mut names = vec!["filter", "plant"];
    let mut configurations = vec![Configuration::Filter(filter), Configuration::Plant(plant)];
    if let Some(controller) = controller {
        names.push("controller");
        configurations.push(Configuration::Controller(controller));
    }
    let mut text = format!(
        "[experiment]\nstart_time = {:?}\nstop_time = {:?}\nstep = {:?}\n",
        experiment.start_time, experiment.stop_time, experiment.step_size
    );
    for (i, name) in names.iter().enumerate() {
        text += &format!("[[component]]\nname = \"{name}\"\nfmu = \"{name}\"\n");
        for other in &names[..i] {
            text += &format!("[[connect_by_name]]\ncomponents = [\"{other}\", \"{name}\"]\n");
        }
    }
    let models = configurations
        .into_iter()
        .map(|configuration| Own::new(configuration).map(|own| Model::Own(Box::new(own), path.to_owned())));
    Ok((System::parse(&text)?, models.collect::<Result<_, _>>()?))
}
