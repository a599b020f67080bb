//! `punctual replay`: repeats one run of a campaign from its Parquet file alone.

use std::path::PathBuf;
use std::process::ExitCode;

use punctual_cosim::campaign::{self, Campaign, Choice, GROUP, Measures};
use punctual_cosim::coupling::{Picture, Promise, System, TimePicture, Variant};
use punctual_cosim::error::Error;
use punctual_cosim::recording::Recording;
use punctual_pictures::drawing::Drawing;
use serde::Serialize;

use super::run::{promises_text, stem, write_files};
use crate::output;

/// Arguments of `punctual replay`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The Parquet file that `punctual campaign` wrote
    file: PathBuf,
    /// The number of the run, from 0
    #[arg(long, value_name = "N")]
    run: u64,
    /// Write the CSV file and the pictures into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the unit of each column as the second line of the CSV file
    #[arg(long, requires = "out")]
    units: bool,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
}

/// The report on a replay, as JSON.
#[derive(Serialize)]
struct Report {
    run: u64,
    seed: u64,
    values: Vec<ValueReport>,
    same: bool,
    differences: Vec<Difference>,
    promises: Vec<Promise>,
    failure: Option<String>,
    files: Vec<String>,
}

#[derive(Serialize)]
struct ValueReport {
    name: String,
    unit: String,
    value: f64,
}

/// A cell of the row that differs from the recorded one.
#[derive(Serialize)]
struct Difference {
    column: String,
    recorded: String,
    found: String,
}

/// Repeats the run and compares its row.
///
/// # Errors
///
/// A file that belongs to no campaign, a run that it does not contain, a file that cannot be written.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let (path, run) = (&arguments.file, arguments.run);
    // Read the recorded row.
    let (reader, source) = campaign::recorded(path)?;
    let campaign = Campaign::of(source, path, path)?;
    let runs = campaign::runs(&reader);
    if !runs.contains(&run) {
        let message = format!("is {run}, must be from {} to {}", runs.start, runs.end.saturating_sub(1));
        return Err(Error::configuration("--run", message));
    }
    let measures = Measures::new(&campaign)?;
    // Rows are in order, in groups of equal size.
    let place = run - runs.start;
    let group = usize::try_from(place / GROUP as u64).unwrap_or(usize::MAX);
    let recorded = reader.group(group, measures.columns())?.into_iter().nth((place % GROUP as u64) as usize);
    let recorded = recorded.ok_or_else(|| Error::configuration("--run", "is not in the file"))?;

    // Measure the run again, and compare.
    let mut simulation = campaign.simulation(&campaign.system().clone().recording(measures.signals()))?;
    let found = measures.run(&campaign, &mut simulation, run);
    let cells = recorded.iter().zip(&found).zip(measures.columns());
    let differences: Vec<_> = cells
        .filter(|((recorded, found), _)| !recorded.is(found))
        .map(|((recorded, found), column)| Difference {
            column: column.name.clone(),
            recorded: recorded.to_string(),
            found: found.to_string(),
        })
        .collect();

    // Run once more, and record the signals that the system requests.
    let choice = campaign.choice(run);
    let mut simulation = campaign.simulation(campaign.system())?;
    campaign.start(&mut simulation, &choice);
    let (promises, failure, files) = match simulation.run(|_, _| {}) {
        Ok(outcome) => {
            let files = match &arguments.out {
                Some(folder) => {
                    std::fs::create_dir_all(folder).map_err(|e| Error::io("create", folder, e))?;
                    let pictures = pictures(campaign.system(), &measures, &outcome.recording);
                    let stem = format!("{}-{run}", stem(path));
                    write_files(&pictures, &stem, folder, &outcome.recording, (arguments.units, false))?
                }
                None => Vec::new(),
            };
            (outcome.promises, outcome.failure, files)
        }
        Err(error) => (Vec::new(), Some(error), Vec::new()),
    };
    let report = Report {
        run,
        seed: choice.seed,
        values: values(&campaign, &choice),
        same: differences.is_empty(),
        differences,
        promises,
        failure: failure.map(|e| e.to_string()),
        files,
    };
    // Report, and determine the exit code.
    if arguments.json {
        output::json(&report);
    } else {
        output::result(&text(&report));
    }
    if report.same {
        return Ok(ExitCode::SUCCESS);
    }
    let (theirs, ours) = (campaign::version(&reader), env!("CARGO_PKG_VERSION"));
    output::note(&format!("note: the row was recorded by version {theirs}, this is version {ours}"));
    Ok(ExitCode::FAILURE)
}

fn values(campaign: &Campaign, choice: &Choice) -> Vec<ValueReport> {
    let value = |(varied, value): (&campaign::Varied, &f64)| ValueReport {
        name: varied.name.clone(),
        unit: varied.unit.clone().unwrap_or_default(),
        value: *value,
    };
    campaign.varied().iter().zip(&choice.values).map(value).collect()
}

/// The system's pictures. A system without any gets h with its bound for each barrier whose signals are
/// recorded.
fn pictures(system: &System, measures: &Measures, recording: &Recording) -> Vec<Drawing> {
    if !system.pictures().is_empty() {
        return system.pictures().iter().cloned().map(Drawing::from).collect();
    }
    let picture = |barrier: &str| {
        Drawing::from(Picture::Time(TimePicture {
            name: Some(barrier.to_owned()),
            title: None,
            signals: vec![format!("{barrier}.h")],
            dashed: vec![format!("{barrier}.profile")],
            ylabel: None,
            deadline: None,
            bounds: vec![0.0],
            scale: Variant::Linear,
        }))
    };
    let is_there = |signal: String| recording.index_of(&signal).is_some();
    let drawn = |barrier: &&str| ["h", "profile"].iter().all(|field| is_there(format!("{barrier}.{field}")));
    measures.barriers().filter(drawn).map(picture).collect()
}

fn text(report: &Report) -> String {
    let mut rows = vec![["drawn", "value", "unit"].map(str::to_owned).to_vec()];
    rows.push(vec!["seed".to_owned(), report.seed.to_string(), String::new()]);
    rows.extend(report.values.iter().map(|v| vec![v.name.clone(), format!("{:?}", v.value), v.unit.clone()]));
    let mut text = format!("run {}\n\n{}\n\n", report.run, output::table(&rows, &[false, true, false]));
    text += &promises_text(&report.promises);
    if let Some(failure) = &report.failure {
        text += &format!("{failure}\n\n");
    }
    if report.same {
        text += "the row is as recorded, bit for bit";
    } else {
        let mut rows = vec![["not as recorded", "recorded", "found"].map(str::to_owned).to_vec()];
        rows.extend(
            report.differences.iter().map(|d| vec![d.column.clone(), d.recorded.clone(), d.found.clone()]),
        );
        text += &output::table(&rows, &[false, true, true]);
    }
    if !report.files.is_empty() {
        text += &format!("\n\nwritten: {}", report.files.join("\n         "));
    }
    text
}
