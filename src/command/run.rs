//! `punctual run`: couples FMUs as a system file says, or simulates a filter's file.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::ValueEnum;
use punctual_core::filter::AssuranceStatus;
use punctual_cosim::coupling::{
    self, Interference, Kept, Model, Order, Outcome, Own, Promise, Simulation, Steps, System,
};
use punctual_cosim::error::Error;
use punctual_cosim::host::journal;
use punctual_cosim::isolation::{self, Child, End, Voice};
use punctual_cosim::package;
use punctual_cosim::recording::{self, Recording};
use punctual_cosim::text;
use punctual_cosim::whole;
use punctual_fmu::configuration::{Configuration, FileKind, FilterConfiguration};
use punctual_pictures::drawing::{self, Drawing};
use punctual_pictures::report::{self, FirstTube};
use punctual_pictures::tube::PlanTube;
use serde::Serialize;

use super::{check, identify};
use crate::codes;
use crate::output::{self, Progress, number};

/// Arguments of `punctual run`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The system file (TOML): experiment, components, connections, pictures; or the file of a filter, which runs with its
    /// own model from its `x0`
    system: PathBuf,
    /// Write the CSV file (named as the system) and the pictures into this folder [default: for a filter's file, a
    /// folder named as the file]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write a page for a browser into that folder too: verdicts, and the run as an animation with charts
    #[arg(long)]
    report: bool,
    /// Let an arrow run along each path of the pictures, as the run does: for a page or a talk
    #[arg(long)]
    animate: bool,
    /// Write the unit of each column as the second line of the CSV file
    #[arg(long)]
    units: bool,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
    /// Run in a separate process: report a crash of an FMU, and keep the rows until then
    #[arg(long)]
    isolate: bool,
    /// List the signals too: unit, least, greatest and final value
    #[arg(long)]
    signals: bool,
    /// Let the plant, the filter's own model, deviate from it at the ends of what the filter declares, as this seed draws: up to
    /// 2^53. It replaces `simulated` and `disturbance` of a filter's file
    #[arg(long, value_name = "SEED", value_parser = clap::value_parser!(u64).range(..=1 << 53))]
    uncertainty: Option<u64>,
    /// What every barrier of every filter has to fulfil, else the exit code is 1
    #[arg(long, value_enum, value_name = "WHAT", default_value_t = Requirement::Unbroken)]
    require: Requirement,
    /// The folder of a run that another process watches
    #[arg(long, hide = true, value_name = "DIR", conflicts_with = "isolate")]
    watched: Option<PathBuf>,
}

/// Requirements on a run, each with what the one before asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum Requirement {
    /// Nothing: the exit code does not tell of promises
    Nothing,
    /// No promise was seen broken, whether it was guaranteed, refused or made by rows alone
    Unbroken,
    /// On time, and inside from then on: nothing is open at the end, and something was promised
    OnTimeAndInside,
    /// Every sample met the constraint too
    Kept,
    /// A plan was behind it at every sample too
    Guaranteed,
}

impl Requirement {
    fn word(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }

    fn is_met(self, promise: &Promise) -> bool {
        match self {
            Self::Nothing => true,
            Self::Unbroken => promise.promise != Kept::Broken,
            Self::OnTimeAndInside => promise.promise.is_done(),
            Self::Kept => promise.kept(),
            Self::Guaranteed => promise.kept() && promise.guaranteed == Some(true),
        }
    }
}

/// The report on a run, as JSON.
#[derive(Serialize)]
struct Report {
    system: String,
    order: Order,
    components: Vec<ComponentReport>,
    steps: u64,
    step: f64,
    final_time: f64,
    wall_time: f64,
    steps_per_second: f64,
    promises: Vec<Promise>,
    interference: Vec<Interference>,
    signals: Vec<SignalReport>,
    files: Vec<String>,
    notes: Vec<String>,
}

#[derive(Serialize)]
struct ComponentReport {
    name: String,
    fmu: String,
    model: String,
}

/// Summary of a recorded signal; numbers that are not finite are `null` in JSON.
#[derive(Serialize)]
struct SignalReport {
    name: String,
    unit: Option<String>,
    min: f64,
    max: f64,
    #[serde(rename = "final")]
    last: f64,
}

/// Runs the system.
///
/// # Errors
///
/// A system file that cannot be used, an FMU that fails, a file that cannot be written.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    if arguments.isolate {
        return isolated(arguments);
    }
    let Some(folder) = &arguments.watched else { return here(arguments, None) };
    isolation::settle(folder)?;
    let rows = rows_file(folder);
    let file = File::create(&rows).map_err(|e| Error::io("write", &rows, e))?;
    let result = here(arguments, Some(file));
    journal::finish();
    result
}

/// The file to which a watched run writes its rows.
fn rows_file(folder: &Path) -> PathBuf {
    folder.join("rows.csv")
}

/// Runs the system in a child process and reports how the child ended.
fn isolated(arguments: &Arguments) -> Result<ExitCode, Error> {
    let child = Child::new()?;
    let mut words: Vec<OsString> = vec!["run".into()];
    if let Some(folder) = &arguments.out {
        words.extend(["--out".into(), folder.into()]);
    }
    words.extend(arguments.report.then(|| "--report".into()));
    words.extend(arguments.animate.then(|| "--animate".into()));
    words.extend(arguments.units.then(|| "--units".into()));
    words.extend(arguments.json.then(|| "--json".into()));
    words.extend(arguments.signals.then(|| "--signals".into()));
    words.extend(arguments.uncertainty.map(|seed| format!("--uncertainty={seed}").into()));
    words.extend(["--require".into(), arguments.require.word().into()]);
    words.extend(["--watched".into(), child.folder().into(), "--".into(), arguments.system.clone().into()]);
    let (how, last) = match child.run(words, Voice::Loud, None)? {
        End::Finished(code) => return Ok(ExitCode::from(u8::try_from(code).unwrap_or(1))),
        End::Broken { how, last } => (how, last),
    };
    if let Some(folder) = &arguments.out {
        let (rows, csv) = (rows_file(child.folder()), csv_file(&arguments.system, folder));
        // The file is empty if the run had not begun.
        if std::fs::metadata(&rows).is_ok_and(|rows| rows.len() > 0) {
            std::fs::copy(&rows, &csv).map_err(|e| Error::io("write", &csv, e))?;
            output::note(&format!("note: what was recorded until then is in {}", csv.display()));
        }
    }
    let what = last.map_or_else(|| "outside of any call, the run".to_owned(), |last| last.to_string());
    Err(Error::broken(what, how.to_string()))
}

/// Writes each row immediately, so that no row is lost if the process ends.
fn stream(rows: &mut Option<File>, write: impl FnOnce(&mut Vec<u8>) -> io::Result<()>) {
    let Some(file) = rows else { return };
    let mut line = Vec::new();
    if write(&mut line).and_then(|()| file.write_all(&line)).is_err() {
        // The run and its own recording continue. Only after a crash would there be fewer rows.
        *rows = None;
    }
}

/// A system ready to run.
struct Opened {
    system: System,
    models: Vec<Model>,
    simulation: Simulation,
    /// The folder for the output.
    out: Option<PathBuf>,
    /// The filter, if the file is a filter's.
    filter: Option<Box<FilterConfiguration>>,
}

/// Lets `simulation` have steps of drawn lengths, or notes why they are all the same.
fn draw_steps(simulation: &mut Simulation, drawn: Steps) {
    match drawn {
        Ok(drawn) => simulation.set_steps(drawn),
        Err(why) => simulation.note(why),
    }
}

/// Opens a system file, or the file of a filter.
fn open(arguments: &Arguments) -> Result<Opened, Error> {
    let (path, out) = (&arguments.system, arguments.out.clone());
    let text = text::read(path)?;
    if FileKind::of(&text) != Some(FileKind::One) {
        let system = System::parse(&text)?;
        let (mut simulation, mut models) =
            Simulation::new(&system, path.parent().unwrap_or(Path::new("")), package::read_configuration)?;
        if let Some(seed) = arguments.uncertainty {
            let drawn = coupling::draw(&system, &mut models, seed, "--uncertainty")?;
            simulation = Simulation::of(&system, &models)?;
            draw_steps(&mut simulation, drawn);
        }
        models.iter().filter_map(Model::stale).for_each(|note| output::note(&note));
        return Ok(Opened { system, models, simulation, out, filter: None });
    }
    let mut configuration = package::read_configuration(path)?;
    if arguments.uncertainty.is_some() {
        coupling::as_the_model(&mut configuration);
    }
    let filter = match &configuration {
        Configuration::Filter(filter) => Some(Box::new(filter.clone())),
        _ => None,
    };
    let (text, configurations) = coupling::alone(configuration)?;
    let system = System::parse(&text)?;
    let own = |configuration| Own::new(configuration).map(|own| Model::Own(Box::new(own), path.to_owned()));
    let mut models = configurations.into_iter().map(own).collect::<Result<Vec<_>, _>>()?;
    let drawn = arguments.uncertainty.map(|seed| coupling::draw(&system, &mut models, seed, "--uncertainty"));
    let mut simulation = Simulation::of(&system, &models)?;
    if let Some(drawn) = drawn.transpose()? {
        draw_steps(&mut simulation, drawn);
    }
    let out = Some(out.unwrap_or_else(|| stem(path).into()));
    Ok(Opened { system, models, simulation, out, filter })
}

/// Runs the system in this process; each row also goes to `rows` immediately.
fn here(arguments: &Arguments, mut rows: Option<File>) -> Result<ExitCode, Error> {
    let path = &arguments.system;
    let Opened { system, models, mut simulation, out, filter } =
        open(arguments).map_err(|e| e.in_file(path))?;
    if arguments.report && out.is_none() {
        let message = "needs a folder for its page; add --out DIR";
        return Err(Error::configuration("--report", message));
    }
    if let Some(folder) = &out {
        // The folder is created before the run, which may be long.
        std::fs::create_dir_all(folder).map_err(|e| Error::io("create", folder, e))?;
    }

    for warning in simulation.warnings() {
        output::warning(warning);
    }
    simulation.stop_by(super::interruption()?);
    let experiment = *system.experiment();
    let mut progress = Progress::new(path.display().to_string());
    let columns = simulation.columns().to_vec();
    stream(&mut rows, |line| recording::write_header(line, &columns, arguments.units));
    let outcome = simulation.run(|time, row| {
        stream(&mut rows, |line| recording::write_row(line, time, row));
        progress.update((time - experiment.start_time) / (experiment.stop_time - experiment.start_time));
    })?;
    drop(progress);

    if let Some(failure) = outcome.failure {
        if let Some(folder) = &out {
            let csv = csv_file(path, folder);
            outcome.recording.save_csv(&csv, arguments.units)?;
            output::note(&format!("note: what was recorded until then is in {}", csv.display()));
        }
        return Err(failure);
    }
    let mut notes = outcome.notes.clone();
    notes.extend(remarks(&outcome.promises));
    if let Some(filter) = filter {
        let is_refused = is_refused(&outcome.recording);
        notes.extend(check::notes_before_run(&filter, is_refused).map_err(|e| e.in_file(path))?);
    }
    let csv = out.as_ref().map(|folder| csv_file(path, folder));
    notes.extend(identify::lost(&system, &models, &outcome, csv.as_deref()));
    let notes = output::grouped(notes);
    let mut files = Vec::new();
    if let Some(folder) = &out {
        let usual = match system.pictures() {
            [] => drawing::usual(&system, &models, &outcome),
            asked => asked.iter().cloned().map(Drawing::from).collect(),
        };
        let how = (arguments.units, arguments.animate);
        files = write_files(&usual, &stem(path), folder, &outcome.recording, how)?;
        if arguments.report {
            let page = folder.join(format!("{}.html", stem(path)));
            let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
            let tubes = first_tubes(&system, &models, &outcome);
            let text = report::document(&name, (&system, &models), &outcome, &tubes, &notes);
            whole::write(&page, text)?;
            files.push(page.display().to_string());
        }
    }
    let report = summary(path, &system, &models, outcome, files, notes);
    for note in report.notes.iter().filter(|note| !simulation.warnings().contains(note)) {
        output::note(&format!("note: {note}"));
    }
    if arguments.json {
        output::json(&report);
    } else {
        output::result(&text(&report, arguments.signals));
    }
    let required = arguments.require;
    let missed = report.promises.iter().filter(|promise| !required.is_met(promise));
    let missed: Vec<_> = missed.map(|promise| promise.barrier.as_str()).collect();
    if missed.is_empty() {
        return Ok(ExitCode::from(codes::DONE));
    }
    // The verdict already shows what is broken.
    if required != Requirement::Unbroken {
        output::note(&format!("note: --require {} is not met by {}", required.word(), missed.join(", ")));
    }
    Ok(ExitCode::from(codes::FOUND))
}

/// The tubes of the first plans of all filters that declare how their plants may differ.
fn first_tubes(system: &System, models: &[Model], outcome: &Outcome) -> Vec<FirstTube> {
    let parts = drawing::parts(system, models);
    let jacobi = system.experiment().order == Order::Jacobi;
    let tube = |part: &drawing::Part<'_>| -> Option<FirstTube> {
        let mut c = part.filter()?;
        if !c.is_assured() || c.covered().is_empty() || c.arm_after > 0.0 {
            return None;
        }
        if jacobi && c.actuation_delay == 0.0 {
            c.actuation_delay = system.experiment().step;
        }
        let recording = &outcome.recording;
        let first = |name: String| {
            let index = recording.index_of(&part.signal(&name))?;
            recording.column(index).next()
        };
        let measured: Vec<f64> =
            c.measured_states().iter().map(|s| first(format!("x.{}", s.name))).collect::<Option<_>>()?;
        let filter = c.assured(c.build().ok()?).ok()?;
        let time = *recording.times().first()?;
        let plan = filter.planning()?.plan_from(time, &measured, 1.0).ok()?;
        let tube = PlanTube::new(&c, plan.tracking()?);
        let promised: Vec<bool> = filter.planning()?.promised(time, &measured).collect();
        let h = c.barrier.iter().enumerate().filter_map(|(i, barrier)| {
            let is_promised = promised.get(i).copied().unwrap_or(false);
            let required = if is_promised { time + barrier.deadline.unwrap_or(0.0) } else { f64::INFINITY };
            Some((barrier.name.clone(), tube.around_h(&filter, i, required).ok()?))
        });
        let inputs = c.plant.inputs().into_iter().enumerate();
        let limits = |name: &str| c.bounds.get(name).copied().unwrap_or_default();
        let states = c.plant.states();
        let is_plane = states.len() >= 2 && states[0].unit == "m" && states[1].unit == "m";
        Some(FirstTube {
            component: part.component.name.clone(),
            path: is_plane.then(|| tube.around_path()),
            h: h.collect(),
            inputs: inputs
                .map(|(i, input)| {
                    let band = tube.around_input(i, limits(&input.name));
                    (input.name, band)
                })
                .collect(),
        })
    };
    parts.iter().filter_map(tube).collect()
}

/// Whether the filter of a single-file run refused its promise at the first sample.
fn is_refused(recording: &Recording) -> bool {
    let place = recording.columns().iter().position(|column| column.name == "filter.assurance");
    let first = place.and_then(|index| recording.column(index).next());
    first == Some(f64::from(AssuranceStatus::Refused as u8))
}

/// The name of a system file without its extension, which is the prefix of all files written.
pub(super) fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(|| "system".into(), |stem| stem.to_string_lossy().into_owned())
}

fn csv_file(path: &Path, folder: &Path) -> PathBuf {
    folder.join(format!("{}.csv", stem(path)))
}

/// Writes the CSV file, with or without `units`, and the `pictures`, which move or not, to the existing `folder`, under
/// names with the prefix `stem`. Returns their paths.
pub(super) fn write_files(
    pictures: &[Drawing],
    stem: &str,
    folder: &Path,
    recording: &Recording,
    (units, moves): (bool, bool),
) -> Result<Vec<String>, Error> {
    let csv = folder.join(format!("{stem}.csv"));
    recording.save_csv(&csv, units)?;
    let mut files = vec![csv];
    for (i, drawing) in pictures.iter().enumerate() {
        let name = drawing.picture.name().map_or_else(|| (i + 1).to_string(), str::to_owned);
        let file = folder.join(format!("{stem}-{name}.svg"));
        drawing::draw(drawing, recording, &file, moves)?;
        files.push(file);
    }
    Ok(files.iter().map(|file| file.display().to_string()).collect())
}

fn summary(
    path: &Path,
    system: &System,
    models: &[Model],
    outcome: Outcome,
    files: Vec<String>,
    notes: Vec<String>,
) -> Report {
    let recording = &outcome.recording;
    let signal = |index: usize| {
        let column = &recording.columns()[index];
        // f64::min and f64::max ignore NaN.
        let min = recording.column(index).fold(f64::NAN, f64::min);
        let max = recording.column(index).fold(f64::NAN, f64::max);
        let last = recording.column(index).last().unwrap_or(f64::NAN);
        SignalReport { name: column.name.clone(), unit: column.unit.clone(), min, max, last }
    };
    Report {
        system: path.display().to_string(),
        order: system.experiment().order,
        components: system
            .components()
            .iter()
            .zip(models)
            .map(|(component, model)| ComponentReport {
                name: component.name.clone(),
                fmu: model.path().display().to_string(),
                model: model.description().model_name.clone(),
            })
            .collect(),
        steps: outcome.statistics.steps,
        step: system.experiment().step,
        final_time: outcome.statistics.final_time,
        wall_time: outcome.statistics.wall_time.as_secs_f64(),
        steps_per_second: outcome.statistics.steps_per_second(),
        promises: outcome.promises,
        interference: outcome.interference,
        signals: (0..recording.columns().len()).map(signal).collect(),
        files,
        notes,
    }
}

fn text(report: &Report, signals: bool) -> String {
    let row = |cells: [&str; 5]| cells.map(str::to_owned).to_vec();
    let mut components = vec![vec!["component".to_owned(), "model".to_owned(), "FMU".to_owned()]];
    components.extend(report.components.iter().map(|c| vec![c.name.clone(), c.model.clone(), c.fmu.clone()]));
    let mut text = format!(
        "{}\n\n{} steps of {} s to t = {} s in {} s ({} steps/s)",
        output::table(&components, &[]),
        report.steps,
        number(report.step),
        number(report.final_time),
        number(report.wall_time),
        number(report.steps_per_second),
    );
    if signals {
        let mut rows = vec![row(["signal", "unit", "min", "max", "final"])];
        rows.extend(report.signals.iter().map(|s| {
            let unit = output::shown_unit(s.unit.as_deref().unwrap_or(""));
            row([&s.name, unit, &number(s.min), &number(s.max), &number(s.last)])
        }));
        text += &format!("\n\n{}", output::table(&rows, &[false, false, true, true, true]));
    } else if report.promises.is_empty() {
        text += &format!("\n\n{} signals recorded: --signals lists them", report.signals.len());
    }
    if !report.files.is_empty() {
        text.push_str("\n\nwritten: ");
        text.push_str(&report.files.join("\n         "));
    }
    // The verdict comes last, where it is most visible.
    if let Some((verdict, sentence)) = coupling::verdict(&report.promises) {
        let sentence = match verdict {
            Kept::Kept | Kept::Broken => output::verdict(&sentence, verdict == Kept::Kept),
            Kept::Open | Kept::NothingPromised | Kept::LetGo => sentence,
        };
        let changed: String = report.interference.iter().map(|of| of.text() + "\n").collect();
        text += &format!("\n\n{}{changed}{sentence}", promises_text(&report.promises));
    }
    text
}

/// What the user should know about promises besides their verdicts.
fn remarks(promises: &[Promise]) -> impl Iterator<Item = String> + '_ {
    promises.iter().filter_map(|p| {
        let text = match p.promise {
            Kept::NothingPromised => {
                "outside at the start and without a deadline: nothing is promised; give it a deadline"
            }
            Kept::Kept if p.refused => {
                "refused at the start, and kept in this run all the same; another u_ref may miss it"
            }
            _ => return None,
        };
        Some(format!("{}: {text}", p.barrier))
    })
}

/// A verdict, coloured for a terminal.
pub(super) fn shown(promise: Kept) -> String {
    match promise {
        Kept::Open | Kept::LetGo => promise.words().to_owned(),
        _ => output::verdict(promise.words(), promise == Kept::Kept),
    }
}

/// By how many seconds a deadline was missed; `never` if the barrier was not reached at all.
pub(super) fn lateness(late_by: Option<f64>, never: &str) -> String {
    match late_by {
        Some(late) if late.is_finite() => number(late),
        Some(_) => never.to_owned(),
        None => "-".to_owned(),
    }
}

/// A row for each promise, followed by an empty line; empty if there is no promise.
pub(super) fn promises_text(promises: &[Promise]) -> String {
    if promises.is_empty() {
        return String::new();
    }
    let head = [
        "barrier",
        "promise",
        "arrival s",
        "late by s",
        "left s",
        "constraint",
        "samples not met",
        "in a row",
        "violation",
    ];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    let time = |t: Option<f64>| t.map_or_else(|| "-".to_owned(), number);
    rows.extend(promises.iter().map(|p| {
        vec![
            p.barrier.clone(),
            shown(p.promise),
            time(p.arrival),
            lateness(p.late_by, "never"),
            time(p.left),
            if p.constraint_met { "met" } else { "not met" }.to_owned(),
            p.unmet.to_string(),
            p.longest.to_string(),
            number(p.violation),
        ]
    }));
    let right = [false, false, true, true, true, false, true, true, true];
    format!("{}\n\n", output::table(&rows, &right))
}
