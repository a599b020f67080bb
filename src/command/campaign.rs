//! `punctual campaign`: many runs of a system with the values that a campaign file draws.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use punctual_cosim::campaign::{self, Campaign, Measures, Options, Progress, Rare, Rate, Reader, Summary};
use punctual_cosim::error::Error;
use punctual_cosim::whole;
use punctual_fmu::configuration::Configuration;
use punctual_pictures::report::campaign::{Pages, pages as campaign_pages};
use serde::Serialize;

use super::run::stem;
use crate::codes::INTERRUPTED;
use crate::output::{self, Counter, number};

/// Number of lines of a list that are printed together.
const AT_ONCE: usize = 1000;

/// Arguments of `punctual campaign`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The campaign file (TOML): a system, how many runs, what varies and how; or what --pack wrote
    campaign: PathBuf,
    /// The Parquet file to write; a campaign that was interrupted goes on from FILE.parts [default: the
    /// campaign file with the ending .parquet; of a shard .K-of-N.parquet or .FIRST-LAST.parquet, of the worst run of --rare -worst.parquet]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// The number of runs made at once, at most 1024 [default: one for each core]
    #[arg(long, value_name = "N", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=1024))]
    threads: Option<usize>,
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
    /// Run a part alone: the K-th of N equal parts (K from 1), or the runs FIRST to LAST - 1
    #[arg(long, value_name = "K/N|FIRST..LAST", value_parser = shard, conflicts_with_all = ["list", "report", "require", "worst"])]
    shard: Option<Shard>,
    /// Run nothing: join the files of all shards, or those in a folder, to the one Parquet file
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with_all = ["list", "shard", "threads"])]
    join: Vec<PathBuf>,
    /// Estimate the probability of failure, however rare, by subset simulation in independent repeats; write the worst run
    /// found, which `punctual replay` makes again
    #[arg(long, value_name = "REPEATS", num_args = 0..=1, require_equals = true, default_missing_value = "20",
        value_parser = clap::value_parser!(u32).range(5..=10_000),
        conflicts_with_all = ["list", "shard", "join", "pack", "worst", "report", "require"])]
    rare: Option<u32>,
    /// Run nothing: write the campaign with the texts of its system and components into one file, which other
    /// machines run in its place
    #[arg(long, value_name = "FILE", conflicts_with_all = ["list", "shard", "join", "output", "threads", "worst", "json", "report", "require"])]
    pack: Option<PathBuf>,
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

impl Arguments {
    fn threads(&self) -> Option<NonZeroUsize> {
        self.threads.and_then(NonZeroUsize::new)
    }
}

/// A part of a campaign, as `--shard` names it.
#[derive(Clone, Copy, Debug)]
enum Shard {
    /// Part K of N, with K from 1.
    Part(u64, u64),
    Runs(Range),
}

fn shard(text: &str) -> Result<Shard, String> {
    let Some((part, of)) = text.split_once('/') else {
        return range(text).map(Shard::Runs).map_err(|e| format!("{e}; or K/N, such as 1/8"));
    };
    match (part.parse(), of.parse()) {
        (Ok(part), Ok(of)) if 0 < part && part <= of => Ok(Shard::Part(part, of)),
        (Ok(_), Ok(_)) => Err(format!("{text:?} is no part, K must be from 1 to N")),
        _ => Err(format!("{text:?} is not of the form K/N, such as 1/8")),
    }
}

impl Shard {
    /// The runs of this part, out of `all`.
    fn runs(self, all: u64) -> Result<std::ops::Range<u64>, Error> {
        let wrong = |message: String| Error::configuration("--shard", message);
        match self {
            Self::Part(_, of) if of > all => {
                Err(wrong(format!("is one of {of} parts, must be of at most {all}, the number of runs")))
            }
            Self::Part(part, of) => {
                // Both factors are at most 2^53.
                let end = |part: u64| (u128::from(all) * u128::from(part) / u128::from(of)) as u64;
                Ok(end(part - 1)..end(part))
            }
            Self::Runs(range) if range.last > all => {
                Err(wrong(format!("ends at {}, must be at most {all}, the number of runs", range.last)))
            }
            Self::Runs(range) => Ok(range.first..range.last),
        }
    }

    /// The ending of its file's name.
    fn ending(self) -> String {
        match self {
            Self::Part(part, of) => format!("{part}-of-{of}.parquet"),
            Self::Runs(Range { first, last }) => format!("{first}-{last}.parquet"),
        }
    }
}

/// A run as shown by `--list`.
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
    /// For a shard: its first run and the one after its last.
    #[serde(skip_serializing_if = "Option::is_none")]
    shard: Option<[u64; 2]>,
    wall_time: f64,
    runs_per_second: f64,
    /// The page and the picture, if requested.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    report: Vec<String>,
    #[serde(flatten)]
    summary: Option<Summary>,
}

/// The report on a rare failure, as JSON.
#[derive(Serialize)]
struct RareReport {
    campaign: String,
    /// The file of the worst run.
    file: String,
    #[serde(flatten)]
    found: Rare,
}

/// Makes the missing runs, and summarises the results.
///
/// # Errors
///
/// A campaign that cannot be used, files of another one in the way, a file that cannot be read or written.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let campaign = Campaign::read(&arguments.campaign)?;
    for (component, part) in campaign.system().components().iter().zip(campaign.models()) {
        if let Some(warning) = part.configuration().and_then(Configuration::warning) {
            output::warning(&format!("{}: {warning}", component.name));
        }
    }
    for note in campaign.notes() {
        output::note(&format!("note: {note}"));
    }
    let measures = Measures::new(&campaign)?;
    if let Some(range) = arguments.list {
        return list(arguments, &campaign, range);
    }
    if let Some(path) = &arguments.pack {
        // Only a file that --pack wrote may be overwritten.
        if path.exists() && std::fs::read(path).map_or(true, |bytes| !bytes.starts_with(b"{\n  \"version\""))
        {
            let message =
                format!("{} already exists and is not a packed campaign; give another name", path.display());
            return Err(Error::configuration("--pack", message));
        }
        let packed = campaign.packed()?;
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(|e| Error::io("create", folder, e))?;
        }
        whole::write(path, packed)?;
        output::result(&format!("written: {}", path.display()));
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(repeats) = arguments.rare {
        return rare(arguments, &campaign, repeats as usize);
    }
    let runs = arguments.shard.map(|shard| shard.runs(campaign.runs())).transpose()?;
    let ending = arguments.shard.map_or_else(|| "parquet".to_owned(), Shard::ending);
    let output = arguments.output.clone().unwrap_or_else(|| arguments.campaign.with_extension(ending));
    if let Some(ending) = output.extension().filter(|e| arguments.report && (*e == "html" || *e == "svg")) {
        let message = format!(
            "ends in .{}, the ending of what --report writes beside it; give another ending, such as .parquet",
            ending.display()
        );
        return Err(Error::configuration("--output", message));
    }
    // A second Ctrl-C ends the program immediately, since the rows kept are safe.
    let stop = super::interruption()?;
    // Run.
    let all = runs.as_ref().map_or(campaign.runs(), |runs| runs.end - runs.start);
    let progress = if arguments.join.is_empty() {
        let options = Options { output: output.clone(), runs: runs.clone(), threads: arguments.threads() };
        let counter = Counter::new("runs", 0, all);
        campaign::run(&campaign, &options, &stop, &|done| counter.update(done))?
    } else {
        campaign::join(&campaign, &arguments.join, &output)?;
        Progress { done: all, before: 0, again: 0, wall_time: Duration::ZERO }
    };

    // Summarise.
    let complete = progress.done == all;
    let (mut summary, mut pages) = (None, Vec::new());
    let reader = match complete {
        true if runs.is_none() => Some(campaign::recorded(&output)?.0),
        // The page of the runs so far.
        false if arguments.report => campaign::kept(&campaign, &output)?,
        _ => None,
    };
    if let Some(reader) = reader {
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
        runs: all,
        shard: runs.map(|runs| [runs.start, runs.end]),
        wall_time: seconds,
        runs_per_second: if seconds > 0.0 { (progress.done - progress.before) as f64 / seconds } else { 0.0 },
        report: pages,
        summary,
    };
    // Report.
    if progress.before > 0 {
        output::note(&format!("note: {} of {all} runs already existed", progress.before));
    }
    if progress.again > 0 {
        output::note(&format!(
            "note: the kept rows of {} runs were damaged; these were made again",
            progress.again
        ));
    }
    if let Some(summary) = &report.summary {
        let unseen = |name: &&str| {
            let column = format!("{name}.least_h");
            summary.spreads.iter().any(|spread| spread.column == column && spread.count == 0)
        };
        let note = |barrier: &str| format!("{barrier}: no run has an h that counts; {}", counts(&campaign));
        for note in output::grouped(measures.barriers().filter(unseen).map(note)) {
            output::note(&format!("note: {note}"));
        }
    }
    if arguments.json {
        output::json(&report);
    } else if let Some(summary) = &report.summary {
        output::result(&text(&report, summary));
    } else if let Some([first, last]) = report.shard.filter(|_| complete) {
        let (made, of) = (made(&report), campaign.runs());
        output::result(&format!(
            "{all} runs{made}: {first}..{last} of {of}\n\nwritten: {}\n\nonce all are there: punctual campaign {} --join FILE...",
            report.file, report.campaign
        ));
    }
    if !complete {
        let page = match &report.report[..] {
            [] => String::new(),
            files => format!("; of these there is {}", files.join(", ")),
        };
        output::note(&format!(
            "interrupted with {} of {all} runs kept; the same command goes on from there{page}",
            progress.done
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
    names().for_each(|name| head += &format!(",{}", punctual_cosim::recording::quoted(name)));
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

/// Estimates the probability of failure.
fn rare(arguments: &Arguments, campaign: &Campaign, repeats: usize) -> Result<ExitCode, Error> {
    let worst = || arguments.campaign.with_file_name(format!("{}-worst.parquet", stem(&arguments.campaign)));
    let output = arguments.output.clone().unwrap_or_else(worst);
    let stop = super::interruption()?;
    let counter = Counter::new("repeats", 0, repeats as u64);
    let found = campaign::rare(campaign, &output, arguments.threads(), repeats, &stop, &|done| {
        counter.update(done as u64);
    })?;
    drop(counter);
    let found = match found {
        campaign::Ended::Done(found) => *found,
        campaign::Ended::Stopped(kept) => {
            output::note(&format!(
                "interrupted with {kept} of {repeats} repeats kept; the same command goes on from there"
            ));
            return Ok(ExitCode::from(INTERRUPTED));
        }
    };
    if found.worst.least_h.is_none() {
        output::note(&format!("note: the worst run lacks an h that counts; {}", counts(campaign)));
    }
    let report = RareReport {
        campaign: arguments.campaign.display().to_string(),
        file: output.display().to_string(),
        found,
    };
    if arguments.json {
        output::json(&report);
    } else {
        output::result(&rare_text(&report));
    }
    Ok(ExitCode::SUCCESS)
}

/// When h counts, for runs in which it never does.
fn counts(campaign: &Campaign) -> String {
    format!(
        "it does from the deadline on (stop_time = {} s), or from the start where a run begins inside, until a call fails",
        campaign.system().experiment().stop_time
    )
}

fn rare_text(RareReport { file, found, .. }: &RareReport) -> String {
    let Rare { probability, interval: [low, high], repeats, levels, runs, plain_runs, worst } = found;
    let mut rows = vec![["the worst", "value", "unit"].map(str::to_owned).to_vec()];
    rows.extend(worst.values.iter().map(|v| {
        let value = v.changes.map_or(format!("{:?}", v.value), |seeds| format!("{seeds} seeds"));
        vec![v.name.clone(), value, v.unit.clone()]
    }));
    rows.push(vec!["least h".into(), worst.least_h.map_or("-".into(), number), String::new()]);
    format!(
        "probability of failure {probability:.3e}, 95 % interval {low:.2e} to {high:.2e}\n\n\
         {repeats} repeats over {} levels of h, {runs} runs; plain sampling takes {plain_runs:.1e} for the same\n\n{}\n\n\
         written: {file}\n\nagain, with pictures: punctual replay {file} --run 0 --out out",
        levels.len(),
        output::table(&rows, &[false, true, false])
    )
}

/// How long the runs took, if any were made.
fn made(report: &Report) -> String {
    match report.wall_time {
        0.0 => String::new(),
        time => format!(" in {} s ({} runs/s)", number(time), number(report.runs_per_second)),
    }
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
        let unit = output::shown_unit(&s.unit).to_owned();
        [vec![s.column.clone(), unit, s.count.to_string()], numbers.to_vec()].concat()
    }));
    let spreads = output::table(&rows, &[false, false, true, true, true, true]);

    let mut rows = vec![["run", "least h after its deadline", ""].map(str::to_owned).to_vec()];
    rows.extend(summary.worst.iter().map(|case| {
        let verdict = if case.success { "success" } else { "failure" };
        let verdict = case.failure.as_deref().map_or(verdict.to_owned(), |why| format!("{verdict}: {why}"));
        vec![case.run.to_string(), case.least_h.map_or("-".to_owned(), number), verdict]
    }));
    let worst = output::table(&rows, &[true, true, false]);
    let made = made(report);
    let fates: String = summary.declared.iter().map(|of| format!("{}\n\n", of.text())).collect();
    let again = summary.worst.first().map_or_else(String::new, |case| {
        format!("\n\nagain, with pictures: punctual replay {} --run {} --out out", report.file, case.run)
    });
    format!(
        "{} runs{made}\n\n{parts}\n\n{spreads}\n\nthe worst\n{worst}\n\n{fates}written: {}{again}",
        summary.runs,
        std::iter::once(&report.file).chain(&report.report).cloned().collect::<Vec<_>>().join("\n         ")
    )
}
