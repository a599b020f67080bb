//! The report on an FMU of FMI 2.0.

use punctual_cosim::host::{Fmi2Description as Description, Fmu, Output};
use punctual_modeldescription::{ModelExchange, Unknown, Variable};
use serde::Serialize;

use super::{DependencyReport, Facts, Report, VariableReport, experiment, flags, given};

#[derive(Serialize)]
pub(super) struct Capabilities {
    can_handle_variable_communication_step_size: bool,
    can_interpolate_inputs: bool,
    can_get_and_set_fmu_state: bool,
    can_serialize_fmu_state: bool,
    provides_directional_derivative: bool,
    can_be_instantiated_only_once_per_process: bool,
    needs_execution_tool: bool,
}

/// The capabilities of model exchange.
#[derive(Serialize)]
pub(super) struct Exchange<'a> {
    model_identifier: &'a str,
    completed_integrator_step_not_needed: bool,
    can_get_and_set_fmu_state: bool,
    can_serialize_fmu_state: bool,
    provides_directional_derivative: bool,
    can_be_instantiated_only_once_per_process: bool,
    needs_execution_tool: bool,
}

impl<'a> Exchange<'a> {
    fn of(can: &'a ModelExchange) -> Self {
        Self {
            model_identifier: &can.model_identifier,
            completed_integrator_step_not_needed: can.completed_integrator_step_not_needed,
            can_get_and_set_fmu_state: can.can_get_and_set_state,
            can_serialize_fmu_state: can.can_serialize_state,
            provides_directional_derivative: can.provides_directional_derivative,
            can_be_instantiated_only_once_per_process: can.can_be_instantiated_only_once_per_process,
            needs_execution_tool: can.needs_execution_tool,
        }
    }
}

/// The names of the states for model exchange, in the order of its functions.
fn states(d: &Description) -> Vec<&str> {
    let state = |unknown: &Unknown| Some(d.at(d.at(unknown.index)?.state()?)?.name.as_str());
    d.derivatives.iter().filter_map(state).collect()
}

pub(super) fn report<'a>(fmu: &'a Fmu, d: &'a Description) -> Report<'a> {
    let can = &d.co_simulation;
    Report {
        file: fmu.path().display().to_string(),
        model_name: &d.model_name,
        guid: Some(&d.guid),
        model_identifier: Some(&d.co_simulation.model_identifier),
        description: given(&d.description),
        author: given(&d.author),
        version: given(&d.version),
        generation_tool: given(&d.generation_tool),
        generation_time: d.generation_date_and_time.as_deref(),
        platforms: fmu.platforms(),
        capabilities: Some(Capabilities {
            can_handle_variable_communication_step_size: can.can_handle_variable_step,
            can_interpolate_inputs: can.can_interpolate_inputs,
            can_get_and_set_fmu_state: can.can_get_and_set_state,
            can_serialize_fmu_state: can.can_serialize_state,
            provides_directional_derivative: can.provides_directional_derivative,
            can_be_instantiated_only_once_per_process: can.can_be_instantiated_only_once_per_process,
            needs_execution_tool: can.needs_execution_tool,
        }),
        model_exchange: d.model_exchange.as_ref().map(Exchange::of),
        states: d.model_exchange.as_ref().map(|_| states(d)),
        default_experiment: experiment(d.default_experiment),
        variables: d.variables.iter().zip(&d.starts).map(|(v, start)| variable_report(d, v, start)).collect(),
        dependencies: d
            .outputs
            .iter()
            .map(|output| DependencyReport {
                output: &d.variables[output.variable].name,
                on: output.dependencies.is_some().then(|| dependency_names(d, output)),
            })
            .collect(),
        ..Report::default()
    }
}

fn variable_report<'a>(d: &'a Description, v: &'a Variable, start: &'a Option<String>) -> VariableReport<'a> {
    let (min, max) = v.kind.range();
    VariableReport {
        name: &v.name,
        value_reference: v.value_reference,
        r#type: v.kind.scalar_type().as_str(),
        causality: v.causality.as_str(),
        variability: v.variability.as_str(),
        unit: v.kind.unit(),
        start: start.as_deref(),
        min,
        max,
        description: given(&v.description),
        items: d.items(v).iter().map(|item| (item.name.as_str(), item.value.into())).collect(),
        ..VariableReport::default()
    }
}

fn dependency_names<'a>(d: &'a Description, output: &Output) -> Vec<&'a str> {
    d.direct_inputs(output).into_iter().map(|i| d.variables[i].name.as_str()).collect()
}

pub(super) fn facts(d: &Description) -> Facts {
    let can = &d.co_simulation;
    let capabilities = flags(&[
        (can.can_handle_variable_step, "take steps of any length"),
        (can.can_interpolate_inputs, "interpolate inputs"),
        (can.can_get_and_set_state, "save and restore its state"),
        (can.can_serialize_state, "serialise its state"),
        (can.provides_directional_derivative, "give directional derivatives"),
        (can.can_be_instantiated_only_once_per_process, "only be instantiated once per process"),
        (can.needs_execution_tool, "only run with its tool"),
    ]);
    let mut facts = vec![("guid", d.guid.clone()), ("identifier", can.model_identifier.clone())];
    let Some(exchange) = &d.model_exchange else {
        facts.push(("can", capabilities));
        return facts;
    };
    let exchanged = flags(&[
        (exchange.can_get_and_set_state, "save and restore its state"),
        (exchange.can_serialize_state, "serialise its state"),
        (exchange.provides_directional_derivative, "give directional derivatives"),
        (exchange.can_be_instantiated_only_once_per_process, "only be instantiated once per process"),
        (exchange.needs_execution_tool, "only run with its tool"),
    ]);
    facts.push(("interfaces", "model exchange, co-simulation".to_owned()));
    facts.push(("states", states(d).join(", ")));
    // Each interface has its own line.
    for (can, interface) in [(exchanged, "model exchange"), (capabilities, "co-simulation")] {
        facts.extend((!can.is_empty()).then(|| ("can", format!("{can} (in {interface})"))));
    }
    facts
}
