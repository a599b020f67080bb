//! `punctual inspect`: the variables and capabilities of an FMU.

use std::path::PathBuf;
use std::process::ExitCode;

use punctual_modeldescription::{CoSimulation, Variable};
use serde::Serialize;

use crate::error::{Error, FmuProblem};
use crate::host::{DefaultExperiment, Fmi2Description as Description, Fmu, Output, Written};
use crate::output;

/// Arguments of `punctual inspect`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The .fmu file
    file: PathBuf,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
}

/// The report on an FMU, as JSON.
#[derive(Serialize)]
struct Report<'a> {
    file: String,
    model_name: &'a str,
    guid: &'a str,
    model_identifier: &'a str,
    description: Option<&'a str>,
    author: Option<&'a str>,
    version: Option<&'a str>,
    generation_tool: Option<&'a str>,
    generation_time: Option<&'a str>,
    platforms: &'a [String],
    capabilities: Capabilities,
    default_experiment: Option<Experiment>,
    variables: Vec<VariableReport<'a>>,
    /// For each output the inputs it depends on directly; `null` where the FMU does not say.
    dependencies: Vec<DependencyReport<'a>>,
    problems: &'a [String],
}

#[derive(Serialize)]
struct Capabilities {
    can_handle_variable_communication_step_size: bool,
    can_interpolate_inputs: bool,
    can_get_and_set_fmu_state: bool,
    can_serialize_fmu_state: bool,
    provides_directional_derivative: bool,
    can_be_instantiated_only_once_per_process: bool,
    needs_execution_tool: bool,
}

#[derive(Serialize)]
struct Experiment {
    start_time: Option<f64>,
    stop_time: Option<f64>,
    step_size: Option<f64>,
    tolerance: Option<f64>,
}

#[derive(Serialize)]
struct VariableReport<'a> {
    name: &'a str,
    value_reference: u32,
    r#type: &'static str,
    causality: &'static str,
    variability: &'static str,
    unit: Option<&'a str>,
    start: Option<&'a str>,
    min: Option<f64>,
    max: Option<f64>,
    description: Option<&'a str>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    items: Vec<(&'a str, i32)>,
}

#[derive(Serialize)]
struct DependencyReport<'a> {
    output: &'a str,
    on: Option<Vec<&'a str>>,
}

/// Shows the FMU.
///
/// # Errors
///
/// The file is not a readable FMI 2.0 co-simulation FMU.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let fmu = Fmu::open(&arguments.file)?;
    let Written::Fmi2(description) = &fmu.description().written else {
        let problem = FmuProblem::Description("is of FMI 3.0; this command shows FMI 2.0".to_owned());
        return Err(Error::fmu(fmu.path(), problem));
    };
    if arguments.json {
        output::json(&report(&fmu, description));
    } else {
        output::result(&text(&fmu, description));
    }
    for problem in &fmu.description().problems {
        output::note(&format!("note: modelDescription.xml: {problem}"));
    }
    Ok(ExitCode::SUCCESS)
}

fn report<'a>(fmu: &'a Fmu, d: &'a Description) -> Report<'a> {
    let can = &d.co_simulation;
    Report {
        file: fmu.path().display().to_string(),
        model_name: &d.model_name,
        guid: &d.guid,
        model_identifier: &d.co_simulation.model_identifier,
        description: given(&d.description),
        author: given(&d.author),
        version: given(&d.version),
        generation_tool: given(&d.generation_tool),
        generation_time: d.generation_date_and_time.as_deref(),
        platforms: fmu.platforms(),
        capabilities: Capabilities {
            can_handle_variable_communication_step_size: can.can_handle_variable_step,
            can_interpolate_inputs: can.can_interpolate_inputs,
            can_get_and_set_fmu_state: can.can_get_and_set_state,
            can_serialize_fmu_state: can.can_serialize_state,
            provides_directional_derivative: can.provides_directional_derivative,
            can_be_instantiated_only_once_per_process: can.can_be_instantiated_only_once_per_process,
            needs_execution_tool: can.needs_execution_tool,
        },
        default_experiment: d.default_experiment.map(|e| {
            let DefaultExperiment { start_time, stop_time, step_size, tolerance } = e;
            Experiment { start_time, stop_time, step_size, tolerance }
        }),
        variables: d.variables.iter().zip(&d.starts).map(|(v, start)| variable_report(d, v, start)).collect(),
        dependencies: d
            .outputs
            .iter()
            .map(|output| DependencyReport {
                output: &d.variables[output.variable].name,
                on: output.dependencies.is_some().then(|| dependency_names(d, output)),
            })
            .collect(),
        problems: &d.problems,
    }
}

/// A text, if there is one.
fn given(text: &str) -> Option<&str> {
    (!text.is_empty()).then_some(text)
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
        items: d.items(v).iter().map(|item| (item.name.as_str(), item.value)).collect(),
    }
}

fn dependency_names<'a>(d: &'a Description, output: &Output) -> Vec<&'a str> {
    d.direct_inputs(output).into_iter().map(|i| d.variables[i].name.as_str()).collect()
}

fn text(fmu: &Fmu, d: &Description) -> String {
    let mut facts = vec![
        ("model", d.model_name.clone()),
        ("description", d.description.clone()),
        ("guid", d.guid.clone()),
        ("identifier", d.co_simulation.model_identifier.clone()),
        ("version", d.version.clone()),
        ("author", d.author.clone()),
        (
            "tool",
            join(" of ", [given(&d.generation_tool).map(str::to_owned), d.generation_date_and_time.clone()]),
        ),
        (
            "platforms",
            if fmu.platforms().is_empty() { "none".to_owned() } else { fmu.platforms().join(", ") },
        ),
        ("can", capabilities(&d.co_simulation)),
    ];
    if let Some(e) = d.default_experiment {
        let part = |name: &str, value: Option<f64>, unit: &str| value.map(|v| format!("{name} {v}{unit}"));
        let parts = [
            part("start", e.start_time, " s"),
            part("stop", e.stop_time, " s"),
            part("step", e.step_size, " s"),
            part("tolerance", e.tolerance, ""),
        ];
        facts.push(("experiment", join(", ", parts)));
    }
    let facts: Vec<String> =
        facts.into_iter().filter(|(_, v)| !v.is_empty()).map(|(k, v)| format!("{k:<12}{v}")).collect();
    format!("{}\n\n{}\n\n{}", facts.join("\n"), variables(d), dependencies(d))
}

fn join<const N: usize>(separator: &str, parts: [Option<String>; N]) -> String {
    parts.into_iter().flatten().collect::<Vec<_>>().join(separator)
}

fn capabilities(c: &CoSimulation) -> String {
    let named = [
        (c.can_handle_variable_step, "take steps of any length"),
        (c.can_interpolate_inputs, "interpolate inputs"),
        (c.can_get_and_set_state, "save and restore its state"),
        (c.can_serialize_state, "serialise its state"),
        (c.provides_directional_derivative, "give directional derivatives"),
        (c.can_be_instantiated_only_once_per_process, "only be instantiated once per process"),
        (c.needs_execution_tool, "only run with its tool"),
    ];
    named.into_iter().filter(|(yes, _)| *yes).map(|(_, text)| text).collect::<Vec<_>>().join(", ")
}

fn variables(d: &Description) -> String {
    let header = ["name", "vr", "type", "causality", "unit", "start", "min", "max", "description"];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    for (v, start) in d.variables.iter().zip(&d.starts) {
        let mut description = v.description.clone();
        let items = d.items(v);
        if !items.is_empty() {
            let items: Vec<_> = items.iter().map(|i| format!("{} {}", i.value, i.name)).collect();
            description = format!("{description} [{}]", items.join(", "));
        }
        let (min, max) = v.kind.range();
        rows.push(vec![
            v.name.clone(),
            v.value_reference.to_string(),
            v.kind.scalar_type().as_str().to_owned(),
            v.causality.as_str().to_owned(),
            v.kind.unit().unwrap_or_default().to_owned(),
            start.clone().unwrap_or_default(),
            min.map(output::number).unwrap_or_default(),
            max.map(output::number).unwrap_or_default(),
            description.trim().to_owned(),
        ]);
    }
    output::table(&rows, &[false, true, false, false, false, true, true, true, false])
}

/// The dependencies, a line for each set of inputs with the outputs that depend on exactly these.
fn dependencies(d: &Description) -> String {
    let mut lines: Vec<(String, Vec<&str>)> = Vec::new();
    for output in &d.outputs {
        let names = dependency_names(d, output);
        let on = match &output.dependencies {
            None => "depend on every input (the FMU does not say)".to_owned(),
            Some(_) if names.is_empty() => "depend on no input directly".to_owned(),
            Some(_) => format!("depend directly on {}", names.join(", ")),
        };
        let name = d.variables[output.variable].name.as_str();
        match lines.iter_mut().find(|(other, _)| *other == on) {
            Some((_, outputs)) => outputs.push(name),
            None => lines.push((on, vec![name])),
        }
    }
    if lines.is_empty() {
        return "no outputs".to_owned();
    }
    lines.iter().map(|(on, outputs)| format!("{}\n  {on}", outputs.join(", "))).collect::<Vec<_>>().join("\n")
}
