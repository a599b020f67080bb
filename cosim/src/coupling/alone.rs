//! Turns a filter's file into a system: the filter, the plant given by its model, and the nominal controller
//! in the file.

use punctual_fmu::configuration::Configuration;

use crate::error::Error;

/// The text of the system of a filter, and the configurations of its components, in order.
///
/// # Errors
///
/// A configuration that is no filter, a plant that cannot be simulated, a start or controller that does not
/// fit the plant.
pub fn alone(configuration: Configuration) -> Result<(String, Vec<Configuration>), Error> {
    let Configuration::Filter(filter) = configuration else {
        let message = format!(
            "is {:?}; must be \"filter\", which runs with its own model, or a system file, which couples components",
            configuration.kind()
        );
        return Err(Error::configuration("kind", message));
    };
    let (plant, controller) = filter.alone()?;
    // Nothing in this system moves what a barrier follows, so it stays where it starts.
    let start: Vec<_> =
        filter.barrier_inputs().iter().map(|input| format!("{:?} = {:?}", input.name, input.start)).collect();
    let experiment = filter.experiment;
    let mut configurations = vec![Configuration::Filter(filter), Configuration::Plant(plant)];
    configurations.extend(controller.map(Configuration::Controller));
    let mut text = format!(
        "[experiment]\nstart_time = {:?}\nstop_time = {:?}\nstep = {:?}\n",
        experiment.start_time, experiment.stop_time, experiment.step_size
    );
    let names: Vec<_> = configurations.iter().map(Configuration::kind).collect();
    for (i, name) in names.iter().enumerate() {
        text += &format!("[[component]]\nname = \"{name}\"\nfmu = \"{name}\"\n");
        if i == 0 {
            text += &format!("start = {{ {} }}\n", start.join(", "));
        }
        for other in &names[..i] {
            text += &format!("[[connect_by_name]]\ncomponents = [\"{other}\", \"{name}\"]\n");
        }
    }
    Ok((text, configurations))
}
