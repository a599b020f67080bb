//! `punctual campaign`: many runs of a system from what a campaign file draws.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use serde::Serialize;

use crate::campaign::{self, Campaign, Measures, Options, Rate, Reader, Summary};
use crate::error::{Error, INTERRUPTED};
use crate::output::{self, Counter, number};
use crate::report::campaign::{Pages, pages as campaign_pages};
use crate::whole;

/// Lines of a list that are printed at once.
const AT_ONCE: usize = 1000;

/// Arguments of `punctual campaign`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The campaign file (TOML): a system, how many runs, what varies and how
    campaign: PathBuf,
    /// The Parquet file to write; a campaign that was interrupted goes on from FILE.parts [default: the
    /// campaign file with the ending .parquet]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// The number of runs made at once [default: one for each core]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// How many of the worst runs to list
    #[arg(long, value_name = "N", default_value_t = 10)]
    worst: usize,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
    /// Write a page for a browser and a picture beside the Parquet file: success over what was varied, arrivals against
    /// the deadline, the worst runs
    #[arg(long, conflicts_with = "list")]
    report: bool,
    /// Exit with code 1 unless every run succeeded
    #[arg(long, value_enum, value_name = "WHAT")]
    require: Option<Requirement>,
    /// Run nothing: list what is drawn for the runs FIRST to LAST - 1, as CSV or JSON
    #[arg(long, value_name = "FIRST..LAST", value_parser = range)]
    list: Option<Range>,
}

/// Requirements on a campaign.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Requirement {
    Success,
}

/// A range of runs by number, without the last one.
#[derive(Clone, Copy, Debug)]
struct Range {
    first: u64,
    last: u64,
}

fn range(text: &str) -> Result<Range, String> {
    let wrong = || format!("{text:?} is not of the form FIRST..LAST, such as 0..100");
    let (first, last) = text.split_once("..").ok_or_else(wrong)?;
    let number = |text: &str| text.parse::<u64>().map_err(|_| wrong());
    let range = Range { first: number(first)?, last: number(last)? };
    if range.first < range.last { Ok(range) } else { Err(format!("{text:?} has no run, must rise")) }
}

/// A run as `--list` shows it.
#[derive(Serialize)]
struct Drawn<'a> {
    run: u64,
    seed: u64,
    values: std::collections::BTreeMap<&'a str, f64>,
}

/// The report on a campaign, as JSON.
#[derive(Serialize)]
struct Report {
    campaign: String,
    file: String,
    complete: bool,
    done: u64,
    runs: u64,
    wall_time: f64,
    runs_per_second: f64,
    /// The page and the picture, where they are asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    report: Vec<String>,
    #[serde(flatten)]
    summary: Option<Summary>,
}

/// Makes the missing runs, and sums up.
///
/// # Errors
///
/// A campaign that cannot be used, files of another one in the way, a file that cannot be read or written.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let campaign = Campaign::read(&arguments.campaign)?;
    if let Some(range) = arguments.list {
        return list(arguments, &campaign, range);
    }
    let output = arguments.output.clone();
    let output = output.unwrap_or_else(|| arguments.campaign.with_extension("parquet"));
    if let Some(ending) = output.extension().filter(|e| arguments.report && (*e == "html" || *e == "svg")) {
        let message = format!(
            "ends in .{}, the ending of what --report writes beside it; give another ending, such as .parquet",
            ending.display()
        );
        return Err(Error::configuration("--output", message));
    }
    // A second Ctrl-C ends the program at once, since the kept rows are safe.
    let stop = super::interruption()?;
    // Run.
    let options = Options { output: output.clone(), threads: arguments.threads };
    let counter = Counter::new("runs", 0, campaign.runs());
    let progress = campaign::run(&campaign, &options, &stop, &|done| counter.update(done))?;
    drop(counter);

    // Sum up.
    let complete = progress.done == campaign.runs();
    let (mut summary, mut pages) = (None, Vec::new());
    let reader = match complete {
        true => Some(campaign::recorded(&output)?.0),
        // The page of what there is.
        false if arguments.report => campaign::kept(&campaign, &output)?,
        false => None,
    };
    if let Some(reader) = reader {
        let measures = Measures::new(&campaign);
        let found = campaign::summary(&reader, &measures, arguments.worst)?;
        if arguments.report {
            pages = report_files(&arguments.campaign, &output, &campaign, &measures, &reader, &found)?;
        }
        summary = Some(found).filter(|_| complete);
    }
    let seconds = progress.wall_time.as_secs_f64();
    let report = Report {
        campaign: arguments.campaign.display().to_string(),
        file: output.display().to_string(),
        complete,
        done: progress.done,
        runs: campaign.runs(),
        wall_time: seconds,
        runs_per_second: (progress.done - progress.before) as f64 / seconds.max(1e-9),
        report: pages,
        summary,
    };
    // Tell.
    if progress.before > 0 {
        output::note(&format!("note: {} of {} runs were there already", progress.before, campaign.runs()));
    }
    if arguments.json {
        output::json(&report);
    } else if let Some(summary) = &report.summary {
        output::result(&text(&report, summary));
    }
    if !complete {
        let page = match &report.report[..] {
            [] => String::new(),
            files => format!("; of these there is {}", files.join(", ")),
        };
        output::note(&format!(
            "interrupted with {} of {} runs kept; the same command goes on from there{page}",
            progress.done,
            campaign.runs()
        ));
        return Ok(ExitCode::from(INTERRUPTED));
    }
    let failed = report.summary.is_some_and(|summary| summary.failure.count > 0);
    Ok(if failed && arguments.require == Some(Requirement::Success) {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    })
}

/// Writes the page and the picture beside `output`. Returns their paths.
fn report_files(
    file: &Path,
    output: &Path,
    campaign: &Campaign,
    measures: &Measures,
    reader: &Reader,
    summary: &Summary,
) -> Result<Vec<String>, Error> {
    let name = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy();
    let results = output.display().to_string();
    let Pages { page, picture } = campaign_pages(&name, &results, campaign, measures, reader, summary)?;
    let mut files = Vec::new();
    for (ending, text) in [("html", Some(page)), ("svg", picture)] {
        let Some(text) = text else { continue };
        let path = output.with_extension(ending);
        whole::write(&path, text)?;
        files.push(path.display().to_string());
    }
    Ok(files)
}

fn list(arguments: &Arguments, campaign: &Campaign, range: Range) -> Result<ExitCode, Error> {
    if range.last > campaign.runs() {
        let message =
            format!("ends at {}, must be at most {}, the number of runs", range.last, campaign.runs());
        return Err(Error::configuration("--list", message));
    }
    let names = || campaign.varied().iter().map(|varied| varied.name.as_str());
    let runs = range.first..range.last;
    if arguments.json {
        let drawn = |run: u64| {
            let choice = campaign.choice(run);
            Drawn { run, seed: choice.seed, values: names().zip(choice.values).collect() }
        };
        output::json(&runs.map(drawn).collect::<Vec<_>>());
        return Ok(ExitCode::SUCCESS);
    }
    let mut head = "run,seed".to_owned();
    names().for_each(|name| head += &format!(",{}", crate::recording::quoted(name)));
    output::result(&head);
    let line = |run: u64| {
        let choice = campaign.choice(run);
        let values = choice.values.iter().map(|value| format!(",{value:?}"));
        format!("{run},{}{}", choice.seed, values.collect::<String>())
    };
    for first in runs.clone().step_by(AT_ONCE) {
        let last = runs.end.min(first + AT_ONCE as u64);
        output::result(&(first..last).map(line).collect::<Vec<_>>().join("\n"));
    }
    Ok(ExitCode::SUCCESS)
}

fn text(report: &Report, summary: &Summary) -> String {
    let part = |rate: &Rate| {
        let [low, high] = rate.interval.map(|end| format!("{:.4}", 100.0 * end));
        vec![rate.count.to_string(), format!("{:.4} %", 100.0 * rate.rate), format!("{low} to {high} %")]
    };
    let mut rows = vec![["of all runs", "count", "part", "95 % interval"].map(str::to_owned).to_vec()];
    let mut add = |name: String, rate: &Rate| rows.push([vec![name], part(rate)].concat());
    add("success".into(), &summary.success);
    add("failure".into(), &summary.failure);
    summary.lacks.iter().for_each(|lack| add(format!("not {}", lack.column), &lack.rate));
    let parts = output::table(&rows, &[false, true, true, true]);

    let mut rows = vec![["number", "unit", "runs", "min", "mean", "max"].map(str::to_owned).to_vec()];
    rows.extend(summary.spreads.iter().filter(|spread| spread.count > 0).map(|s| {
        let numbers = [number(s.min), number(s.mean), number(s.max)];
        [vec![s.column.clone(), s.unit.clone(), s.count.to_string()], numbers.to_vec()].concat()
    }));
    let spreads = output::table(&rows, &[false, false, true, true, true, true]);

    let mut rows = vec![["run", "least h after its deadline", ""].map(str::to_owned).to_vec()];
    rows.extend(summary.worst.iter().map(|case| {
        let verdict = if case.success { "success" } else { "failure" };
        let verdict = case.failure.as_deref().map_or(verdict.to_owned(), |why| format!("{verdict}: {why}"));
        vec![case.run.to_string(), case.least_h.map_or("-".to_owned(), number), verdict]
    }));
    let worst = output::table(&rows, &[true, true, false]);
    let made = match report.wall_time {
        0.0 => String::new(),
        time => format!(" in {time:.3} s ({} runs/s)", number(report.runs_per_second)),
    };
    let again = summary.worst.first().map_or_else(String::new, |case| {
        format!("\n\nagain, with pictures: punctual replay {} --run {} --out out", report.file, case.run)
    });
    format!(
        "{} runs{made}\n\n{parts}\n\n{spreads}\n\nthe worst\n{worst}\n\nwritten: {}{again}",
        summary.runs,
        std::iter::once(&report.file).chain(&report.report).cloned().collect::<Vec<_>>().join("\n         ")
    )
}
