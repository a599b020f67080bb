//! `punctual merge`: merges equal FMUs from different systems into one.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use punctual_cosim::error::Error;
use punctual_cosim::package::merge;
use punctual_cosim::validate::Severity;
use serde::Serialize;

use super::validate::seconds;
use crate::output;

/// Arguments of `punctual merge`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The .fmu files, two or more, equal but for their platforms' folders
    #[arg(required = true, num_args = 2.., value_name = "FMU")]
    files: Vec<PathBuf>,
    /// The .fmu file to write; may be one of those read
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
    /// How long the trial of the product may take, in seconds (0.01 to 86400)
    #[arg(long, value_name = "SECONDS", default_value = "60", value_parser = seconds)]
    time_limit: Duration,
    /// Join the files only; nothing of the FMU is run
    #[arg(long)]
    no_trial: bool,
}

/// The report on a merge, as JSON.
#[derive(Serialize)]
struct Reported {
    file: String,
    model_name: String,
    guid: String,
    platforms: Vec<Platform>,
    /// Errors that `validate` finds in the merged FMU, including those of its parts.
    errors: usize,
    left_out: Vec<String>,
    not_examined: Vec<String>,
}

#[derive(Serialize)]
struct Platform {
    platform: String,
    from: String,
}

/// Merges the FMUs and tries the result.
///
/// # Errors
///
/// Those of [`merge::merge`].
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let limit = (!arguments.no_trial).then_some(arguments.time_limit);
    let merged = merge::merge(&arguments.files, &arguments.output, limit)?;
    let reported = reported(arguments, merged);
    for folder in &reported.left_out {
        output::note(&format!("note: left out, since it is empty: {folder}"));
    }
    for skipped in &reported.not_examined {
        output::note(&format!("note: not examined: {skipped}"));
    }
    if reported.errors > 0 {
        let number = reported.errors;
        output::note(&format!("note: `punctual validate {}` finds errors ({number})", reported.file));
    }
    if arguments.json {
        output::json(&reported);
    } else {
        let platforms = reported.platforms.iter().map(|p| format!("{} ({})", p.platform, p.from));
        let platforms = platforms.collect::<Vec<_>>().join(", ");
        output::result(&format!(
            "{}: {} for {platforms}, guid {}",
            reported.file, reported.model_name, reported.guid
        ));
    }
    Ok(ExitCode::SUCCESS)
}

fn reported(arguments: &Arguments, merged: merge::Merged) -> Reported {
    let merge::Merged { model_name, guid, platforms, left_out, report } = merged;
    let platform =
        |(platform, from): (String, PathBuf)| Platform { platform, from: from.display().to_string() };
    Reported {
        file: arguments.output.display().to_string(),
        model_name,
        guid,
        platforms: platforms.into_iter().map(platform).collect(),
        errors: report.count(Severity::Error),
        left_out,
        not_examined: report.skipped,
    }
}
