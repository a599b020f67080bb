//! `punctual validate`: finds the defects of an FMU.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use punctual_cosim::error::Error;
use punctual_cosim::validate::{self, Finding, Severity, trial};
use serde::Serialize;

use crate::output;

/// Arguments of `punctual validate`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The .fmu file
    #[arg(required_unless_present = "rules")]
    file: Option<PathBuf>,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
    /// How long the trial may take, in seconds (0.01 to 86400)
    #[arg(long, value_name = "SECONDS", default_value = "60", value_parser = seconds)]
    time_limit: Duration,
    /// Look at the files only; nothing of the FMU is run
    #[arg(long)]
    no_trial: bool,
    /// List the rules
    #[arg(long, conflicts_with_all = ["file", "no_trial"])]
    rules: bool,
}

/// Arguments of the hidden part that runs the FMU.
#[derive(Debug, clap::Args)]
pub struct TrialArguments {
    /// The .fmu file
    file: PathBuf,
    /// The folder that the watching process made
    folder: PathBuf,
    /// The time that it may take, in seconds
    #[arg(long, value_parser = seconds)]
    time_limit: Duration,
}

pub(super) fn seconds(text: &str) -> Result<Duration, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.01..=86_400.0).contains(&value) => Ok(Duration::from_secs_f64(value)),
        _ => Err("must be seconds, 0.01 to 86400".to_owned()),
    }
}

/// The report on an FMU, as JSON.
#[derive(Serialize)]
struct Report {
    file: String,
    errors: usize,
    warnings: usize,
    findings: Vec<Finding>,
    not_examined: Vec<String>,
}

/// A rule, as JSON.
#[derive(Serialize)]
struct Rule {
    rule: &'static str,
    severity: Severity,
    asks: &'static str,
}

/// Examines the FMU. The exit code is 0 if there are no errors (warnings are allowed), else 1.
///
/// # Errors
///
/// The file cannot be read, or the trial's process cannot be started.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let Some(file) = &arguments.file else {
        rules(arguments.json);
        return Ok(ExitCode::SUCCESS);
    };
    let limit = (!arguments.no_trial).then_some(arguments.time_limit);
    let found = validate::validate(file, limit)?;
    let report = Report {
        file: file.display().to_string(),
        errors: found.count(Severity::Error),
        warnings: found.count(Severity::Warning),
        findings: found.findings,
        not_examined: found.skipped,
    };
    let code = if report.errors > 0 { ExitCode::from(1) } else { ExitCode::SUCCESS };
    if arguments.json {
        output::json(&report);
        return Ok(code);
    }
    for skipped in &report.not_examined {
        output::note(&format!("note: not examined: {skipped}"));
    }
    output::result(&text(&report));
    Ok(code)
}

fn text(report: &Report) -> String {
    let mut parts: Vec<String> = report.findings.iter().map(ToString::to_string).collect();
    let number = |n: usize, word: &str| match n {
        0 => format!("no {word}s"),
        1 => format!("1 {word}"),
        n => format!("{n} {word}s"),
    };
    let (errors, warnings) = (number(report.errors, "error"), number(report.warnings, "warning"));
    parts.push(format!("{}: {errors}, {warnings}", report.file));
    parts.join("\n")
}

fn rules(json: bool) {
    if json {
        let list: Vec<_> =
            validate::rules().map(|&(rule, severity, asks)| Rule { rule, severity, asks }).collect();
        output::json(&list);
        return;
    }
    let mut rows = vec![["rule", "severity", "asks that"].map(str::to_owned).to_vec()];
    rows.extend(
        validate::rules()
            .map(|(rule, severity, asks)| vec![(*rule).to_owned(), severity.to_string(), (*asks).to_owned()]),
    );
    output::result(&output::table(&rows, &[]));
}

/// Tries the FMU in this process, which may crash.
///
/// # Errors
///
/// The folder cannot be written to.
pub fn execute_trial(arguments: &TrialArguments) -> Result<ExitCode, Error> {
    trial::perform(&arguments.file, &arguments.folder, arguments.time_limit)?;
    Ok(ExitCode::SUCCESS)
}
