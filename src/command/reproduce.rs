//! `punctual reproduce`: the paper's tables and figures next to ours.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Mutex;
use std::time::Instant;

use punctual_cosim::error::Error;
use punctual_study::{self as study, Options, Report, bicycles, guide};

use crate::output::{self, Progress};

/// Arguments of `punctual reproduce`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Write tables (CSV), pictures (SVG) and the page report.html into this folder
    #[arg(long, value_name = "DIR", default_value = "out/reproduce")]
    out: PathBuf,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
    /// Make a few runs of everything, in place of hundreds
    #[arg(long)]
    quick: bool,
    /// Do not measure times, so that the output is the same each time
    #[arg(long)]
    untimed: bool,
    /// Only renew the pictures and numbers of guide.md in this folder, such as docs
    #[arg(long, value_name = "DIR")]
    guide: Option<PathBuf>,
    /// Only print the table of docs/bicycle.md: filters on bicycles that they do not know
    #[arg(long, conflicts_with = "guide")]
    bicycles: bool,
}

/// Runs the study. The exit code is 1 if our method misses a deadline or leaves the disc. Among the bicycles,
/// only the car counts.
///
/// # Errors
///
/// A file that cannot be written.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    if let Some(folder) = &arguments.guide {
        guide::update(folder)?;
        output::note(&format!("guide.md and its pictures in {} are those of this program", folder.display()));
        return Ok(ExitCode::SUCCESS);
    }
    let begin = Instant::now();
    let chosen = if arguments.quick { Options::QUICK } else { Options::FULL };
    let options = Options { timed: !arguments.untimed, ..chosen };
    let progress = Mutex::new(Progress::new("reproduce"));
    let tell = |fraction| {
        // If another thread is drawing the bar, this one can skip it.
        if let Ok(mut progress) = progress.try_lock() {
            progress.show(fraction);
        }
    };
    if arguments.bicycles {
        let (table, kept) = bicycles::table(&options, &tell)?;
        drop(progress);
        if arguments.json {
            output::json(&table);
        } else {
            output::result(&table.text());
        }
        return Ok(if kept { ExitCode::SUCCESS } else { ExitCode::from(1) });
    }
    let report = study::run(options, &tell)?;
    drop(progress);
    study::save(&report, &arguments.out)?;
    if arguments.json {
        output::json(&report);
    } else {
        output::result(&text(&report));
    }
    if options.timed {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        output::note(&format!(
            "{:.1} s on {threads} processors; CSV, SVG and report.html are in {}",
            begin.elapsed().as_secs_f64(),
            arguments.out.display()
        ));
    }
    Ok(if report.kept { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn text(report: &Report) -> String {
    report.tables.iter().map(|table| table.text()).collect::<Vec<_>>().join("\n")
}
