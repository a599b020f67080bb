//! `punctual inspect`: the variables and capabilities of an FMU of FMI 2.0 or 3.0.

mod fmi2;
mod fmi3;

use std::borrow::Cow;
use std::path::PathBuf;
use std::process::ExitCode;

use punctual_cosim::error::{Error, FmuProblem};
use punctual_cosim::host::{Archive, DefaultExperiment, Fmu, Written};
use punctual_modeldescription::fmi3::Located;
use roxmltree::Document;
use serde::Serialize;

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

/// The report on an FMU, as JSON. Fields that only one version of FMI has are absent for the other.
#[derive(Default, Serialize)]
struct Report<'a> {
    file: String,
    model_name: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    fmi_version: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    guid: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    instantiation_token: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    model_identifier: Option<&'a str>,
    description: Option<&'a str>,
    author: Option<&'a str>,
    version: Option<&'a str>,
    generation_tool: Option<&'a str>,
    generation_time: Option<&'a str>,
    platforms: &'a [String],
    #[serde(skip_serializing_if = "Option::is_none")]
    capabilities: Option<fmi2::Capabilities>,
    #[serde(skip_serializing_if = "Option::is_none")]
    model_exchange: Option<fmi2::Exchange<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    interfaces: Option<Vec<fmi3::Interface<'a>>>,
    default_experiment: Option<Experiment>,
    variables: Vec<VariableReport<'a>>,
    /// For each output, the inputs it depends on directly; `null` if the FMU does not declare them.
    dependencies: Vec<DependencyReport<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    states: Option<Vec<&'a str>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    terminals: Option<Vec<fmi3::Terminal<'a>>>,
    problems: &'a [String],
}

#[derive(Clone, Copy, Serialize)]
struct Experiment {
    start_time: Option<f64>,
    stop_time: Option<f64>,
    step_size: Option<f64>,
    tolerance: Option<f64>,
}

#[derive(Default, Serialize)]
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
    items: Vec<(&'a str, i64)>,
    /// The sizes of an array, as numbers or by the variables that hold them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    dimensions: Vec<fmi3::Size<'a>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    aliases: Vec<&'a str>,
}

#[derive(Serialize)]
struct DependencyReport<'a> {
    output: &'a str,
    on: Option<Vec<&'a str>>,
}

/// Facts for the header of the text, with their names.
type Facts = Vec<(&'static str, String)>;

/// Shows the FMU.
///
/// # Errors
///
/// The file is not a readable FMU of FMI 2.0 co-simulation or of FMI 3.0.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let archive = Archive::open(&arguments.file)?;
    let refused = |problem: FmuProblem| Error::fmu(&arguments.file, problem);
    let text = archive.model_description().map_err(refused)?;
    let document = Document::parse(&text).map_err(|e| refused(FmuProblem::Description(e.to_string())))?;
    let root = document.root_element();
    if root.attribute("fmiVersion").is_some_and(|version| version.starts_with("3.")) {
        if !root.has_tag_name("fmiModelDescription") {
            let problem =
                format!("the root element is {}; must be fmiModelDescription", root.tag_name().name());
            return Err(refused(FmuProblem::Description(problem)));
        }
        let located = Located::read(&document);
        let terminals = fmi3::terminals(&archive);
        let problems = fmi3::problems(&located);
        let version = root.attribute("fmiVersion").unwrap_or_default();
        let report = Report { problems: &problems, ..fmi3::report(&archive, version, &located, &terminals) };
        show(arguments, &report, fmi3::facts(&located.description, version, &report));
    } else {
        let fmu = Fmu::of(archive)?;
        let Written::Fmi2(description) = &fmu.description().written else {
            return Err(refused(FmuProblem::Description("is of no version that can be shown".to_owned())));
        };
        let report = Report { problems: &fmu.description().problems, ..fmi2::report(&fmu, description) };
        show(arguments, &report, fmi2::facts(description));
    }
    Ok(ExitCode::SUCCESS)
}

fn show(arguments: &Arguments, report: &Report<'_>, facts: Facts) {
    if arguments.json {
        output::json(report);
    } else {
        output::result(&text(report, facts));
    }
    for problem in report.problems {
        output::note(&format!("note: modelDescription.xml: {problem}"));
    }
}

/// A text, if it is not empty.
fn given(text: &str) -> Option<&str> {
    (!text.is_empty()).then_some(text)
}

fn experiment(of: Option<DefaultExperiment>) -> Option<Experiment> {
    of.map(|of| {
        let DefaultExperiment { start_time, stop_time, step_size, tolerance } = of;
        Experiment { start_time, stop_time, step_size, tolerance }
    })
}

/// The facts that both versions share. Those of one version, `own`, come after the description.
fn text(report: &Report<'_>, own: Facts) -> String {
    let text = |text: Option<&str>| text.unwrap_or_default().to_owned();
    let mut facts = vec![("model", report.model_name.to_owned()), ("description", text(report.description))];
    let (capabilities, names): (Facts, Facts) =
        own.into_iter().partition(|(name, _)| name.starts_with("can"));
    facts.extend(names);
    facts.extend([
        ("version", text(report.version)),
        ("author", text(report.author)),
        (
            "tool",
            join(
                " of ",
                [report.generation_tool, report.generation_time].map(|part| part.map(str::to_owned)),
            ),
        ),
        (
            "platforms",
            if report.platforms.is_empty() { "none".to_owned() } else { report.platforms.join(", ") },
        ),
    ]);
    facts.extend(capabilities);
    if let Some(e) = report.default_experiment {
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
    let terminals =
        report.terminals.iter().flatten().map(|terminal| format!("\n{terminal}")).collect::<String>();
    let terminals = if terminals.is_empty() { terminals } else { format!("\n{terminals}") };
    format!("{}\n\n{}\n\n{}{terminals}", facts.join("\n"), variables(report), dependencies(report))
}

fn join<const N: usize>(separator: &str, parts: [Option<String>; N]) -> String {
    parts.into_iter().flatten().collect::<Vec<_>>().join(separator)
}

/// The words for the flags that are set.
fn flags(named: &[(bool, &str)]) -> String {
    named.iter().filter(|(yes, _)| *yes).map(|(_, text)| *text).collect::<Vec<_>>().join(", ")
}

fn variables(report: &Report<'_>) -> String {
    let header = ["name", "vr", "type", "causality", "unit", "start", "min", "max", "description"];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    for v in &report.variables {
        let mut description = Cow::Borrowed(v.description.unwrap_or_default());
        if !v.items.is_empty() {
            let items: Vec<_> = v.items.iter().map(|(name, value)| format!("{value} {name}")).collect();
            description = format!("{description} [{}]", items.join(", ")).into();
        }
        if !v.aliases.is_empty() {
            description = format!("{description} (also {})", v.aliases.join(", ")).into();
        }
        let sizes: Vec<_> = v.dimensions.iter().map(ToString::to_string).collect();
        let sizes = if sizes.is_empty() { String::new() } else { format!("[{}]", sizes.join(", ")) };
        rows.push(vec![
            v.name.to_owned(),
            v.value_reference.to_string(),
            format!("{}{sizes}", v.r#type),
            v.causality.to_owned(),
            v.unit.unwrap_or_default().to_owned(),
            v.start.unwrap_or_default().to_owned(),
            v.min.map(output::number).unwrap_or_default(),
            v.max.map(output::number).unwrap_or_default(),
            description.trim().to_owned(),
        ]);
    }
    output::table(&rows, &[false, true, false, false, false, true, true, true, false])
}

/// The dependencies: for each set of inputs a line with the outputs that depend on exactly these.
fn dependencies(report: &Report<'_>) -> String {
    let mut lines: Vec<(String, Vec<&str>)> = Vec::new();
    for DependencyReport { output, on } in &report.dependencies {
        let on = match on {
            None => "depend on every input (the FMU does not say)".to_owned(),
            Some(names) if names.is_empty() => "depend on no input directly".to_owned(),
            Some(names) => format!("depend directly on {}", names.join(", ")),
        };
        match lines.iter_mut().find(|(other, _)| *other == on) {
            Some((_, outputs)) => outputs.push(output),
            None => lines.push((on, vec![output])),
        }
    }
    if lines.is_empty() {
        return "no outputs".to_owned();
    }
    lines.iter().map(|(on, outputs)| format!("{}\n  {on}", outputs.join(", "))).collect::<Vec<_>>().join("\n")
}
