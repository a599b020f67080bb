//! Turns a filter's file into a system: the filter, the plant given by its model, the nominal controller
//! in the file, and the points that barriers follow.

use punctual_fmu::configuration::{BarrierInput, Configuration};

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
    // What a barrier follows moves on at the velocity with which it starts.
    let points: Vec<_> = filter
        .barrier
        .iter()
        .filter(|barrier| barrier.shape.followed().is_some())
        .map(|barrier| Ok((barrier.name.clone(), point(&barrier.inputs(&filter.plant))?)))
        .collect::<Result<_, Error>>()?;
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
    for (name, point) in points {
        text += &format!(
            "[[component]]\nname = \"{name}_point\"\nfmu = \"{name}_point\"\nstart = {{ \"u.a_x\" = 0.0, \"u.a_y\" = 0.0 }}\n"
        );
        for (state, input) in STATES.iter().zip(INPUTS) {
            text += &format!(
                "[[connection]]\nfrom = \"{name}_point.x.{state}\"\nto = \"filter.{name}.{input}\"\n"
            );
        }
        configurations.push(point);
    }
    Ok((text, configurations))
}

/// The states of a point, and the inputs of the barrier that follows it.
const STATES: [&str; 4] = ["x", "y", "v_x", "v_y"];
const INPUTS: [&str; 4] = ["centre[1]", "centre[2]", "velocity[1]", "velocity[2]"];

/// A point that starts as `inputs` do.
fn point(inputs: &[BarrierInput]) -> Result<Configuration, Error> {
    let start: Vec<_> =
        STATES.iter().zip(inputs).map(|(state, input)| format!("{state} = {:?}", input.start)).collect();
    let text = format!(
        "kind = \"plant\"\nname = \"point\"\nx0 = {{ {} }}\n[plant]\n\
         states = [{{ name = \"x\", unit = \"m\" }}, {{ name = \"y\", unit = \"m\" }}, \
         {{ name = \"v_x\", unit = \"m/s\" }}, {{ name = \"v_y\", unit = \"m/s\" }}]\n\
         inputs = [{{ name = \"a_x\", unit = \"m/s2\" }}, {{ name = \"a_y\", unit = \"m/s2\" }}]\n\
         derivatives = {{ x = \"v_x\", y = \"v_y\", v_x = \"a_x\", v_y = \"a_y\" }}\n",
        start.join(", ")
    );
    Ok(Configuration::parse(&text)?)
}
