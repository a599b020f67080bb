//! `punctual demo`: three plants, two methods, coupled through FMI.

use std::path::PathBuf;
use std::process::ExitCode;

use punctual_cosim::error::Error;
use punctual_study::cases::{self, DEADLINE};
use punctual_study::demo::{self, Run, Summary};
use serde::Serialize;

use crate::output::{self, Progress, number, quantity};

/// Arguments of `punctual demo`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Write configurations, FMUs, system files, CSV, pictures and pages into this folder
    #[arg(long, value_name = "DIR", default_value = "out/demo")]
    out: PathBuf,
    /// The shared library to put into the FMUs [default: the one beside this program]
    #[arg(long, value_name = "FILE")]
    library: Option<PathBuf>,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
}

/// One run, as JSON.
#[derive(Serialize)]
struct Entry<'a> {
    model: &'a str,
    method: &'a str,
    deadline: f64,
    kept: bool,
    inputs: Vec<&'a str>,
    #[serde(flatten)]
    summary: &'a Summary,
}

/// Runs the demonstration. The exit code is 1 if our method misses a deadline or leaves the disc. The paper's
/// method is shown for comparison, and is expected to do so.
///
/// # Errors
///
/// A file that cannot be written, a library that cannot be found, an FMU that fails.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let mut progress = Progress::new("demo");
    let runs = demo::run(&arguments.out, arguments.library.as_deref(), |fraction| progress.update(fraction))?;
    drop(progress);
    if arguments.json {
        output::json(&runs.iter().flatten().map(entry).collect::<Vec<_>>());
    } else {
        output::result(&text(&runs));
        output::note(&format!(
            "written to {}: TOML configurations, FMUs, system files (punctual run), CSV, SVG pictures; to see: *-plans.html",
            arguments.out.display()
        ));
    }
    let kept = runs.iter().all(|[_, ours, hindered]| ours.kept() && hindered.kept());
    Ok(if kept { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn entry(run: &Run) -> Entry<'_> {
    Entry {
        model: run.case.vehicle.key(),
        method: run.case.method,
        deadline: DEADLINE,
        kept: run.kept(),
        inputs: run.case.vehicle.inputs().iter().map(|signal| signal.name).collect(),
        summary: &run.summary,
    }
}

fn text(runs: &[[Run; 3]]) -> String {
    let header = [
        "model",
        "method",
        "deadline",
        "arrival",
        "min h after",
        "outside after",
        "peak u before arrival",
        "peak u, whole run",
        "steps/s",
    ];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    for run in runs.iter().flatten() {
        let s = &run.summary;
        rows.push(vec![
            run.case.vehicle.title().to_owned(),
            run.case.title.to_owned(),
            // With the resolution of the step, since some are late by only that.
            format!("{DEADLINE:.3} s"),
            s.arrival.map_or("never".to_owned(), |t| format!("{t:.3} s")),
            quantity(s.min_h_after_deadline, run.case.setup.shape.unit()),
            if s.farthest_outside > 0.0 { quantity(s.farthest_outside, "m") } else { "never".to_owned() },
            peaks(run, s.peak_to_arrival, s.peak_norm_to_arrival),
            peaks(run, s.peak, s.peak_norm),
            number(s.steps_per_second),
        ]);
    }
    format!(
        "From rest at the origin into a disc of radius 2 m at (45, 45) m within {DEADLINE} s, 1 ms steps, to {} s.\n\
         Repeated root: the paper's method, h = R² - d², u_ref = 0. Reference profile: ours, distance-shaped h, u_ref = -v.\n\
         Plans: ours with bounds on the inputs, around a rock, from a speed away from the disc; 10 ms steps, to 15 s.\n\
         \"after\": from the deadline to the end of the run.\n\n{}",
        2.0 * DEADLINE,
        output::table(&rows, &[false, false, true, true, true, true, true, true, true])
    )
}

/// The norm of the input vector if its components share a unit, else both components.
fn peaks(run: &Run, values: [f64; 2], norm: f64) -> String {
    match run.case.vehicle.inputs() {
        [first, second] if first.unit == second.unit => quantity(norm, &cases::unit(first)),
        inputs => {
            let each = inputs.iter().zip(values).map(|(input, value)| quantity(value, &cases::unit(input)));
            each.collect::<Vec<_>>().join(", ")
        }
    }
}
