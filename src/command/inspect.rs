//! `punctual inspect`: what an FMU offers.

use std::path::PathBuf;
use std::process::ExitCode;

use serde::Serialize;

use crate::error::Error;
use crate::host::{Capabilities, DefaultExperiment, Description, Fmu, Kind, Output, Variable};
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

/// Everything `inspect` tells, as JSON.
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
    default_experiment: Option<DefaultExperiment>,
    variables: Vec<VariableReport<'a>>,
    /// For each output the inputs it depends on directly; `null` where the FMU does not say.
    dependencies: Vec<DependencyReport<'a>>,
    problems: &'a [String],
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
    if arguments.json {
        output::json(&report(&fmu));
    } else {
        output::result(&text(&fmu));
    }
    for problem in &fmu.description().problems {
        output::note(&format!("note: modelDescription.xml: {problem}"));
    }
    Ok(ExitCode::SUCCESS)
}

fn report(fmu: &Fmu) -> Report<'_> {
    let d = fmu.description();
    Report {
        file: fmu.path().display().to_string(),
        model_name: &d.model_name,
        guid: &d.guid,
        model_identifier: &d.model_identifier,
        description: d.description.as_deref(),
        author: d.author.as_deref(),
        version: d.version.as_deref(),
        generation_tool: d.generation_tool.as_deref(),
        generation_time: d.generation_time.as_deref(),
        platforms: fmu.platforms(),
        capabilities: d.capabilities,
        default_experiment: d.default_experiment,
        variables: d.variables.iter().map(variable_report).collect(),
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

fn variable_report(v: &Variable) -> VariableReport<'_> {
    VariableReport {
        name: &v.name,
        value_reference: v.value_reference,
        r#type: v.kind.name(),
        causality: v.causality.as_str(),
        variability: v.variability.as_str(),
        unit: v.unit.as_deref(),
        start: v.start.as_deref(),
        min: v.min,
        max: v.max,
        description: v.description.as_deref(),
        items: v.items.iter().map(|item| (item.name.as_str(), item.value)).collect(),
    }
}

fn dependency_names<'a>(d: &'a Description, output: &Output) -> Vec<&'a str> {
    d.direct_inputs(output).into_iter().map(|i| d.variables[i].name.as_str()).collect()
}

fn text(fmu: &Fmu) -> String {
    let d = fmu.description();
    let mut facts = vec![
        ("model", d.model_name.clone()),
        ("description", d.description.clone().unwrap_or_default()),
        ("guid", d.guid.clone()),
        ("identifier", d.model_identifier.clone()),
        ("version", d.version.clone().unwrap_or_default()),
        ("author", d.author.clone().unwrap_or_default()),
        ("tool", join(" of ", [d.generation_tool.clone(), d.generation_time.clone()])),
        (
            "platforms",
            if fmu.platforms().is_empty() { "none".to_owned() } else { fmu.platforms().join(", ") },
        ),
        ("can", capabilities(d.capabilities)),
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

fn capabilities(c: Capabilities) -> String {
    let named = [
        (c.can_handle_variable_communication_step_size, "take steps of any length"),
        (c.can_interpolate_inputs, "interpolate inputs"),
        (c.can_get_and_set_fmu_state, "save and restore its state"),
        (c.can_serialize_fmu_state, "serialise its state"),
        (c.provides_directional_derivative, "give directional derivatives"),
        (c.can_be_instantiated_only_once_per_process, "only be instantiated once per process"),
        (c.needs_execution_tool, "only run with its tool"),
    ];
    named.into_iter().filter(|(yes, _)| *yes).map(|(_, text)| text).collect::<Vec<_>>().join(", ")
}

fn variables(d: &Description) -> String {
    let header = ["name", "vr", "type", "causality", "unit", "start", "min", "max", "description"];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    for v in &d.variables {
        let mut description = v.description.clone().unwrap_or_default();
        if v.kind == Kind::Enumeration && !v.items.is_empty() {
            let items: Vec<_> = v.items.iter().map(|i| format!("{} {}", i.value, i.name)).collect();
            description = format!("{description} [{}]", items.join(", "));
        }
        rows.push(vec![
            v.name.clone(),
            v.value_reference.to_string(),
            v.kind.name().to_owned(),
            v.causality.as_str().to_owned(),
            v.unit.clone().unwrap_or_default(),
            v.start.clone().unwrap_or_default(),
            v.min.map(output::number).unwrap_or_default(),
            v.max.map(output::number).unwrap_or_default(),
            description.trim().to_owned(),
        ]);
    }
    output::table(&rows, &[false, true, false, false, false, true, true, true, false])
}

/// One line for each set of inputs, with the outputs that depend on exactly these.
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
