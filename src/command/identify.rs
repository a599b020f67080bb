//! `punctual identify`: from recordings of a plant, or from its FMU, to what a filter's file should declare of it.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use punctual_core::filter::AssuranceStatus;
use punctual_cosim::coupling::{Component, Model, Outcome, System};
use punctual_cosim::error::Error;
use punctual_cosim::identification::{self, Finding, Kind, Named, Proposal, Record};
use punctual_cosim::package;
use punctual_cosim::recording::Recording;
use punctual_cosim::{text, whole};
use punctual_fmu::configuration::{Configuration, FilterConfiguration, RESOURCE, VariableSection};
use serde::Serialize;

use crate::codes;
use crate::output::{self, number, quantity};

/// The part of its bounds that an input has to use for more than a small statement on it.
const EXCITED: f64 = 0.3;
/// The shortest recording, in s and in holds, that is not called short.
const LONG: (f64, usize) = (10.0, 500);

/// Arguments of `punctual identify`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The filter's file (TOML), with the model of the plant
    filter: PathBuf,
    /// Recordings (CSV): a column `time` in s, and columns of the model's states and inputs; or the FMU of the plant, or the file of
    /// a plant, which is excited and recorded
    #[arg(required = true)]
    plant: Vec<PathBuf>,
    /// The column of a state or input, or the variable of the FMU, where it has another name: "v=speed"; may be repeated
    #[arg(long, value_name = "SIGNAL=COLUMN")]
    column: Vec<String>,
    /// The factor by which what was found is widened, from 1 on: a recording shows what was, not what may be
    #[arg(long, value_name = "NUMBER", default_value_t = 1.2)]
    factor: f64,
    /// How long an FMU is excited, in s
    #[arg(long, value_name = "SECONDS", default_value_t = 20.0)]
    duration: f64,
    /// The time between two samples of an FMU, in s [default: the step size of the filter's file]
    #[arg(long, value_name = "SECONDS")]
    step: Option<f64>,
    /// Write the recording of an FMU into this file (CSV)
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Write the filter's file with the proposal into this file, which must not be there yet
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
}

/// The report, as JSON.
#[derive(Serialize)]
struct Report<'a> {
    filter: String,
    /// The lines to paste.
    lines: Vec<String>,
    verdict: String,
    #[serde(flatten)]
    proposal: &'a Proposal,
}

/// Proposes what to declare.
///
/// # Errors
///
/// A file that is no filter's, or has no model; a recording or an FMU that cannot be used; numbers out of range; a file that cannot be
/// written.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let file = &arguments.filter;
    let filter = match super::read(file)? {
        Configuration::Filter(filter) => filter,
        other => {
            let message =
                format!("is {:?}, must be \"filter\": its model is compared with the plant", other.kind());
            return Err(Error::configuration("kind", message).in_file(file));
        }
    };
    check(arguments, &filter)?;
    identification::check(&filter).map_err(|e| e.in_file(file))?;
    let named = arguments.column.iter().map(|text| Named::parse(text)).collect::<Result<Vec<_>, _>>()?;
    let record = record(arguments, &filter, &named)?;
    if let Some(path) = &arguments.record {
        record.recording().save_csv(path, true)?;
        output::note(&format!("note: the recording is in {}", path.display()));
    }
    let proposal =
        identification::identify(&filter, &record, arguments.factor).map_err(|e| e.in_file(file))?;
    let lines: Vec<String> = proposal.findings.iter().map(|finding| line(finding, &proposal)).collect();
    if let Some(path) = &arguments.write {
        write(file, path, &filter, &lines)?;
        output::note(&format!("note: {} with these lines is in {}", file.display(), path.display()));
    }
    for note in &proposal.notes {
        output::note(&format!("note: {note}"));
    }
    for warning in warnings(&proposal, &filter) {
        output::warning(&warning);
    }
    let verdict = verdict(&proposal);
    if arguments.json {
        output::json(&Report { filter: file.display().to_string(), lines, verdict, proposal: &proposal });
    } else {
        output::result(&text(&lines, &verdict, file));
    }
    let is_explained = proposal.explained == proposal.holds;
    Ok(ExitCode::from(if is_explained { codes::DONE } else { codes::FOUND }))
}

/// Refuses options that cannot be used, and files that are there already.
fn check(arguments: &Arguments, filter: &FilterConfiguration) -> Result<(), Error> {
    let refuse = |field: &str, value: f64, allowed: &str| {
        Err(Error::configuration(field, format!("is {value}, must be {allowed}")))
    };
    if !(1.0..=100.0).contains(&arguments.factor) {
        return refuse(
            "--factor",
            arguments.factor,
            "1 to 100: 1 declares what the recording shows, and no more",
        );
    }
    if !arguments.duration.is_finite() || arguments.duration <= 0.0 {
        return refuse("--duration", arguments.duration, "finite and > 0 (s)");
    }
    if let Some(step) = arguments.step.filter(|step| !step.is_finite() || *step <= 0.0) {
        return refuse("--step", step, "finite and > 0 (s)");
    }
    let Some(path) = &arguments.write else { return Ok(()) };
    if path.exists() {
        let message = format!("{} already exists; name another file, or remove that one", path.display());
        return Err(Error::configuration("--write", message));
    }
    let declared = [
        ("uncertainty", filter.uncertainty.is_some()),
        ("measurement_errors", !filter.measurement_errors.is_empty()),
        ("actuation_delay", filter.actuation_delay > 0.0),
    ];
    match declared.iter().find(|(_, is_given)| *is_given) {
        None => Ok(()),
        Some((key, _)) => {
            let file = arguments.filter.display();
            let message = format!(
                "{file} has `{key}` already, and nothing is written over it; remove it, or paste the lines yourself"
            );
            Err(Error::configuration("--write", message))
        }
    }
}

/// Whether a file is a recording.
fn is_recording(path: &Path) -> bool {
    let is = |ending: &str| path.extension().is_some_and(|own| own.eq_ignore_ascii_case(ending));
    !is("fmu") && !text::is_toml(path)
}

/// What was recorded of the plant, or is recorded now.
fn record(arguments: &Arguments, filter: &FilterConfiguration, named: &[Named]) -> Result<Record, Error> {
    let plants = &arguments.plant;
    if plants.iter().all(|path| is_recording(path)) {
        if arguments.record.is_some() {
            return Err(Error::configuration("--record", "is for an FMU; this is a recording already"));
        }
        let read = |path: &PathBuf| {
            let recording = Recording::read_csv(path)?;
            // Each by itself first, for a message with its name.
            Record::of(filter, std::slice::from_ref(&recording), named).map_err(|e| e.in_file(path))?;
            Ok(recording)
        };
        let recordings = plants.iter().map(read).collect::<Result<Vec<_>, Error>>()?;
        return Record::of(filter, &recordings, named);
    }
    let [path] = &plants[..] else {
        let message = format!("are {} files; must be one FMU, or recordings alone", plants.len());
        return Err(Error::configuration("PLANT", message));
    };
    let times = (arguments.duration, arguments.step.unwrap_or(filter.experiment.step_size));
    let excited = identification::excite(filter, path, named, times, package::read_configuration)?;
    for (state, count) in &excited.ended {
        let times = if *count == 1 { "once".to_owned() } else { format!("{count} times") };
        output::note(&format!(
            "note: {state} left its range {times}; the plant began anew from its start then"
        ));
    }
    Ok(excited.record)
}

/// The line of a finding, with its comment.
fn line(finding: &Finding, proposal: &Proposal) -> String {
    let mut parts = Vec::new();
    let unit = output::shown_unit(&finding.unit);
    if !unit.is_empty() {
        parts.push(unit.to_owned());
    }
    let found = |[least, most]: [f64; 2]| {
        let ends = [least, most].map(number);
        if ends[0] == ends[1] { number(most) } else { ends.join(" to ") }
    };
    let of = match finding.instant {
        Some([time, length]) if length > 1.5 * proposal.period => {
            format!(" from t = {} s, over {} s", number(time), number(length))
        }
        Some([time, _]) => format!(" at t = {} s", number(time)),
        None => ", by the whole recording".to_owned(),
    };
    parts.push(format!("found {}{of}", found(finding.found)));
    if let Some(without) = finding.without_worst {
        parts.push(match without == [0.0; 2] {
            true => "nothing without the worst hold in a thousand".to_owned(),
            false => format!("{} without the worst hold in a thousand", found(without)),
        });
    }
    format!("{} = {} # {}", finding.key(), finding.shown(finding.declared), parts.join("; "))
}

fn text(lines: &[String], verdict: &str, file: &Path) -> String {
    if lines.is_empty() {
        return format!("# nothing to declare\n\n{verdict}");
    }
    format!("# in {}, below `kind = \"filter\"`\n{}\n\n{verdict}", file.display(), lines.join("\n"))
}

/// What was found, in a paragraph.
fn verdict(proposal: &Proposal) -> String {
    let mut sentences = Vec::new();
    sentences.push(format!(
        "{} holds of {} s, {} in all.",
        proposal.holds,
        number(proposal.period),
        quantity(proposal.duration, "s")
    ));
    if proposal.findings.is_empty() {
        let finest = proposal
            .resolution
            .iter()
            .map(|(state, size, unit)| format!("{state} {}", quantity(*size, unit)));
        sentences.push(format!(
            "The plant is the model, as far as this shows: no rate is off by more than {}.",
            finest.collect::<Vec<_>>().join(", ")
        ));
        return sentences.join(" ");
    }
    if let Some(alone) = proposal.difference.sentence() {
        sentences.push(format!("Alone, {alone}."));
    }
    sentences.push(if proposal.explained == proposal.holds {
        format!("Together the lines explain all {} holds.", proposal.holds)
    } else {
        format!("Together the lines explain {} of {} holds.", proposal.explained, proposal.holds)
    });
    let ranges = proposal.ranges.iter().map(|(state, [least, most], unit)| {
        format!("{state} {} to {}", number(*least), quantity(*most, unit))
    });
    sentences.push(format!(
        "A recording shows what was, less than what may be, and nothing beyond {}:",
        ranges.collect::<Vec<_>>().join(", ")
    ));
    sentences.push(if proposal.factor > 1.0 {
        format!(
            "so what was found is widened by a factor of {} (--factor). That is a guess; recordings of what the plant is to do are better.",
            number(proposal.factor)
        )
    } else {
        "this declares what was found, and no more (--factor).".to_owned()
    });
    sentences.join(" ")
}

/// What makes the proposal doubtful.
fn warnings(proposal: &Proposal, filter: &FilterConfiguration) -> Vec<String> {
    let mut warnings = Vec::new();
    for (input, part) in &proposal.excited {
        if *part == 0.0 {
            warnings.push(format!("{input} never moved: nothing is known of its gain, its lag and a delay"));
        } else if *part < EXCITED {
            warnings.push(format!(
                "{input} used {} % of its bounds: beyond that its gain and lag are a guess; record with larger inputs",
                number((100.0 * part).round())
            ));
        }
    }
    if proposal.holds < LONG.1 || proposal.duration < LONG.0 {
        warnings.push(format!(
            "the recording is short ({} holds, {}): what is rare is not in it",
            proposal.holds,
            quantity(proposal.duration, "s")
        ));
    }
    if !filter.is_assured() {
        let declares = |finding: &Finding| !matches!(finding.kind, Kind::Delay | Kind::Error);
        if proposal.findings.iter().any(declares) {
            warnings.push(format!(
                "only plans account for `uncertainty`, and none are followed: {}",
                filter.unassured()
            ));
        }
    }
    warnings
}

/// What the user should know where a filter of a run lost its guarantee: what the difference between plant and model looks like. The
/// table of the run is in `csv`, if it was written.
pub(super) fn lost(system: &System, models: &[Model], outcome: &Outcome, csv: Option<&Path>) -> Vec<String> {
    // Other rows miss inputs.
    if system.record().every != 1 {
        return Vec::new();
    }
    let components = system.components().iter().zip(models);
    let note = |(component, model): (&Component, &Model)| {
        let name = &component.name;
        let status = outcome.recording.series(&format!("{name}.assurance"))?;
        let code = f64::from(AssuranceStatus::Lost as u8);
        let filter = status.contains(&code).then(|| filter(model)).flatten()?;
        let of = |kind: &'static str| {
            move |s: VariableSection| Named { column: format!("{name}.{kind}.{}", s.name), signal: s.name }
        };
        let named = filter
            .plant
            .states()
            .into_iter()
            .map(of("x"))
            .chain(filter.plant.inputs().into_iter().map(of("u")));
        let named: Vec<_> = named.collect();
        // What cannot be compared is no fault of the run.
        let record = Record::of(&filter, &[first_rows(&outcome.recording)], &named).ok()?;
        let sentence = identification::difference(&filter, &record).ok()?.sentence()?;
        let file = if text::is_toml(model.path()) {
            model.path().display().to_string()
        } else {
            "FILTER.toml".to_owned()
        };
        let what = match csv {
            Some(csv) => format!("`punctual identify {file} {}` says what to declare", csv.display()),
            None => format!("run it with --out, and `punctual identify {file} RUN.csv` says what to declare"),
        };
        Some(format!("{name}: the plant is not the model: {sentence}; {what}"))
    };
    components.filter_map(note).collect()
}

/// As much of a recording as is compared within a second or two.
fn first_rows(recording: &Recording) -> Recording {
    const MOST: usize = 10_000;
    let mut first = Recording::new(recording.columns().to_vec());
    (0..recording.len().min(MOST)).for_each(|k| first.push(recording.times()[k], recording.row(k)));
    first
}

/// The filter that a component is, if it has a model of the plant.
fn filter(model: &Model) -> Option<FilterConfiguration> {
    let own = match model {
        Model::Own(own, _) => own.configuration.clone(),
        Model::Fmu(fmu, _) => Configuration::parse(&fmu.resource(RESOURCE)?).ok()?,
    };
    match own {
        Configuration::Filter(filter) if filter.integrator.is_none() && filter.external().is_none() => {
            Some(filter)
        }
        _ => None,
    }
}

/// Writes the filter's file with the `lines` below its kind.
fn write(file: &Path, path: &Path, filter: &FilterConfiguration, lines: &[String]) -> Result<(), Error> {
    let own = text::read(file)?;
    let is_kind = |line: &str| {
        line.trim_start().strip_prefix("kind").is_some_and(|rest| rest.trim_start().starts_with('='))
    };
    let mut written = String::new();
    let mut done = false;
    for line in own.lines() {
        written += line;
        written.push('\n');
        if !done && is_kind(line) {
            written += &format!("{}\n", lines.join("\n"));
            done = true;
        }
    }
    if !done {
        let message = "found no line `kind = \"filter\"` to write below; paste the lines yourself";
        return Err(Error::configuration("--write", message).in_file(file));
    }
    // What cannot be used is not written. A plug-in is found beside its file only.
    if Configuration::Filter(filter.clone()).plugin().is_none() {
        Configuration::parse(&written).map_err(|e| Error::from(e).in_file(path))?;
    }
    whole::write(path, written)
}
