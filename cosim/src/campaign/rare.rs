//! Estimates the probability that a run of a campaign fails, however rare that is, and finds the worst run.
//!
//! A run is a function of the numbers drawn at its start and of the noise in it. The estimate is the
//! probability that the distributions of `[vary]` lead to a run that fails. The noise comes in independent
//! pieces, each with its own seed. So subset simulation works on the drawn numbers and the seeds
//! ([`super::splitting`]). The margin of a run is the least h of all barriers from their deadlines on.
//!
//! The pilot's plan and the repeats are kept beside the output, in the folder `<output>.rare.parts`, until
//! the estimate is complete. So an interrupted estimate resumes there and gives the same numbers.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::{fs, io};

use serde::{Deserialize, Serialize};

use super::distribution::{Distribution, below};
use super::file::{Campaign, Choice, Success};
use super::measures::Measures;
use super::runner::{self, Crew, Options, Parts};
use super::splitting::{self, Estimate, Plan, Point, Problem, Repeat, Stalled};
use super::summary::Rate;
use super::table::{Cell, Row};
use crate::error::Error;
use crate::whole;

/// Estimate of the probability of failure.
#[derive(Clone, Debug, Serialize)]
pub struct Rare {
    /// The probability that a run fails.
    pub probability: f64,
    /// Its confidence interval, at a confidence of 95 %.
    pub interval: [f64; 2],
    /// Number of independent repeats that `probability` averages.
    pub repeats: usize,
    /// The intermediate levels of h.
    pub levels: Vec<f64>,
    /// Runs made.
    pub runs: u64,
    /// Number of runs that plain sampling would need for the same standard deviation.
    pub plain_runs: f64,
    /// The worst failure found.
    pub worst: Failing,
}

/// A failing run.
#[derive(Clone, Debug, Serialize)]
pub struct Failing {
    /// Least h of all barriers from their deadlines on; `None` if the run ended before.
    pub least_h: Option<f64>,
    /// The value of each varied variable.
    pub values: Vec<Value>,
}

/// The value of a varied variable.
#[derive(Clone, Debug, Serialize)]
pub struct Value {
    /// `component.variable`.
    pub name: String,
    /// Its unit; empty if it has none.
    pub unit: String,
    /// Its value.
    pub value: f64,
    /// If the variable is a seed: the number of values that it takes one after the other, of which this is
    /// the first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub changes: Option<usize>,
}

/// How an estimate ended.
#[derive(Clone, Debug)]
pub enum Ended {
    /// The estimate is complete.
    Done(Box<Rare>),
    /// It was stopped, and this many repeats are kept to resume from.
    Stopped(usize),
}

/// Estimates the probability that a run of `campaign` fails, and writes the worst run found to `output`, as a
/// campaign of that run alone. Ends early once `stop` is set; the results so far are kept beside `output`.
/// `tell` gets the number of repeats completed, 0 after the pilot.
///
/// # Errors
///
/// A campaign that the method does not fit; a pilot that finds no way to failure; a file that is in the way,
/// belongs to another campaign, or cannot be written.
pub fn rare(
    campaign: &Campaign,
    output: &Path,
    threads: Option<NonZeroUsize>,
    repeats: usize,
    stop: &AtomicBool,
    tell: &(dyn Fn(usize) + Sync),
) -> Result<Ended, Error> {
    check(campaign, output)?;
    let measures = Measures::new(campaign)?;
    let margins = Margins::new(&measures)?;
    let crew = Crew::new(campaign, &measures, threads)?;
    // After a stop all margins are equal, which ends the pilot. The repeat under way is discarded.
    let margin = |z: &[f64], pieces: &[u64]| match stop.load(Ordering::Relaxed) {
        true => f64::INFINITY,
        false => margins.of(&crew.make(0, &choice(campaign, z, pieces))),
    };
    // The sample at the stop time needs one more.
    let seeds = campaign.piece()?.map_or(0, |steps| campaign.grid().steps() / steps + 1) as usize;
    let problem =
        Problem { dimensions: campaign.varied().len(), seeds, seed: campaign.seed(), margin: &margin };
    // The plan and the repeats, beginning with those of an earlier call.
    let store = Store::open(campaign, output)?;
    let mut made = match store.read()? {
        Some(made) => made,
        None => {
            let plan = crew.pool.install(|| problem.pilot());
            let stopped = stop.load(Ordering::Relaxed);
            match plan {
                Ok(plan) if !stopped => Made { plan, repeats: Vec::new() },
                plan => {
                    // An interrupted pilot keeps nothing.
                    store.remove()?;
                    let failure = plan.err().filter(|_| !stopped);
                    return failure.map_or(Ok(Ended::Stopped(0)), |failure| Err(stalled(failure)));
                }
            }
        }
    };
    store.write(&made)?;
    tell(made.repeats.len().min(repeats));
    while made.repeats.len() < repeats {
        let repeat = crew.pool.install(|| problem.repeat(&made.plan, made.repeats.len() + 1));
        if stop.load(Ordering::Relaxed) {
            return Ok(Ended::Stopped(made.repeats.len()));
        }
        made.repeats.push(repeat);
        store.write(&made)?;
        tell(made.repeats.len());
    }
    let Made { plan, repeats: found } = &made;
    let Estimate { probability, interval, deviation, worst: Some(worst), made } =
        splitting::estimate(plan, &found[..repeats])
    else {
        let message = format!(
            "none of {repeats} repeats reached a failure that the pilot had found; give more, such as --rare={}",
            10 * repeats
        );
        return Err(Error::configuration("--rare", message));
    };
    let worst = write(campaign, output, &worst)?;
    let runs = plan.made + made;
    // If every run failed, the repeats have no spread. The estimate is then that of plain sampling.
    let (interval, plain_runs) = match probability < 1.0 {
        true => (interval, (1.0 - probability) / (probability * deviation * deviation)),
        false => (Rate::of(made, made).interval, made as f64),
    };
    store.remove()?;
    Ok(Ended::Done(Box::new(Rare {
        probability,
        interval,
        repeats,
        runs,
        plain_runs,
        levels: plan.levels.iter().map(|level| level.margin).collect(),
        worst,
    })))
}

/// The state of an estimate: the pilot's plan and the repeats so far, from the first on.
#[derive(Debug, Deserialize, Serialize)]
struct Made {
    plan: Plan,
    repeats: Vec<Repeat>,
}

/// Keeps that state on the disk until the estimate is complete.
struct Store {
    parts: Parts,
    file: PathBuf,
}

impl Store {
    fn open(campaign: &Campaign, output: &Path) -> Result<Self, Error> {
        let mut beside = output.as_os_str().to_owned();
        beside.push(".rare");
        let parts = Parts::open(Path::new(&beside), campaign, None)?;
        let file = parts.file("made");
        Ok(Self { parts, file })
    }

    /// Reads the state: one line with the fingerprint of the campaign and a checksum of the rest, then the
    /// state itself.
    fn read(&self) -> Result<Option<Made>, Error> {
        let text = match fs::read_to_string(&self.file) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            text => text.map_err(|e| Error::io("read", &self.file, e))?,
        };
        let damaged = || {
            let message = "it was changed since it was written; remove it, and the estimate starts over";
            Error::io("use", &self.file, io::Error::other(message))
        };
        let (head, made) = text.split_once('\n').ok_or_else(damaged)?;
        let (identity, checksum) = head.split_once(' ').ok_or_else(damaged)?;
        if checksum != self::checksum(identity, made) {
            return Err(damaged());
        }
        if identity != self.parts.identity() {
            return Err(runner::other_campaign(&self.file, identity, self.parts.identity()));
        }
        serde_json::from_str(made).map(Some).map_err(|_| damaged())
    }

    /// Writes everything or nothing.
    fn write(&self, made: &Made) -> Result<(), Error> {
        // Serialising only numbers cannot fail.
        let (identity, made) = (self.parts.identity(), serde_json::to_string(made).unwrap_or_default());
        whole::write(&self.file, format!("{identity} {}\n{made}", checksum(identity, &made)))
    }

    fn remove(self) -> Result<(), Error> {
        match fs::remove_file(&self.file) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => Err(Error::io("remove", &self.file, e)),
            _ => self.parts.remove(),
        }
    }
}

fn checksum(identity: &str, made: &str) -> String {
    format!("{:08x}", crc32fast::hash(format!("{identity}\n{made}").as_bytes()))
}

/// Refuses a campaign that the method does not fit.
fn check(campaign: &Campaign, output: &Path) -> Result<(), Error> {
    let wrong = |field: &str, message: &str| Err(Error::configuration(field, message));
    if campaign.success() != Success::OnTimeAndInside {
        return wrong(
            "campaign.success",
            "is \"kept\"; --rare goes by h, so it must be \"on_time_and_inside\"",
        );
    }
    if campaign.varied().is_empty() {
        return wrong("vary", "is empty, so that all runs are alike");
    }
    if output.exists() {
        let message = format!("{} already exists; remove it, or give another output", output.display());
        return wrong("--output", &message);
    }
    Ok(())
}

fn stalled(Stalled { margin, part, made }: Stalled) -> Error {
    let way = match margin {
        f64::INFINITY => "no run has an h from a deadline on".to_owned(),
        _ => format!("the least h that {made} runs reached is {margin}"),
    };
    let message = format!(
        "found no path to a failure: {way}, which about {part:.1e} of all runs reach. That proves nothing about the others"
    );
    Error::configuration("--rare", message)
}

/// The draw at a standard normal point, with the seeds of the pieces.
fn choice(campaign: &Campaign, z: &[f64], pieces: &[u64]) -> Choice {
    let seed = pieces.first().copied().unwrap_or(0);
    let value = |(z, varied): (&f64, &super::file::Varied)| {
        let u = below(*z).clamp(f64::EPSILON / 2.0, 1.0 - f64::EPSILON / 2.0);
        varied.distribution.value(u, seed)
    };
    Choice { seed, values: z.iter().zip(campaign.varied()).map(value).collect(), pieces: pieces.to_vec() }
}

/// The positions of the cells that give the margin.
struct Margins {
    success: usize,
    least: Vec<usize>,
}

impl Margins {
    fn new(measures: &Measures) -> Result<Self, Error> {
        let place = |name: &str| measures.columns().iter().position(|column| column.name == name);
        let least: Vec<_> =
            measures.barriers().filter_map(|name| place(&format!("{name}.least_h"))).collect();
        match place("success") {
            Some(success) if !least.is_empty() => Ok(Self { success, least }),
            _ => Err(Error::configuration("system", "has no barrier, so that no run can fail by one")),
        }
    }

    /// Least h of the barriers, if every barrier has one.
    fn least(&self, row: &Row) -> Option<f64> {
        let least = self.least.iter().map(|place| match &row[*place] {
            Cell::Number(number) => *number,
            _ => None,
        });
        least.reduce(|a, b| Some(a?.min(b?))).flatten()
    }

    /// The margin: negative exactly if the run fails.
    fn of(&self, row: &Row) -> f64 {
        let least = self.least(row);
        match row[self.success] {
            Cell::Flag(true) => least.map_or(f64::INFINITY, |h| h.max(0.0)),
            _ => least.filter(|h| *h < 0.0).unwrap_or(f64::NEG_INFINITY),
        }
    }
}

/// Writes the run at `worst` as a campaign of its own.
fn write(campaign: &Campaign, output: &Path, worst: &Point) -> Result<Failing, Error> {
    let drawn = choice(campaign, &worst.z, &worst.seeds);
    let alone = campaign.alone(&drawn)?;
    let options = Options { output: output.to_owned(), runs: None, threads: NonZeroUsize::new(1) };
    runner::run(&alone, &options, &AtomicBool::new(false), &|_| {})?;
    let value = |(varied, value): (&super::file::Varied, &f64)| Value {
        name: varied.name.clone(),
        unit: varied.unit.clone().unwrap_or_default(),
        value: *value,
        changes: matches!(varied.distribution, Distribution::Seed).then_some(drawn.pieces.len()),
    };
    Ok(Failing {
        least_h: Some(worst.margin).filter(|h| h.is_finite()),
        values: campaign.varied().iter().zip(&drawn.values).map(value).collect(),
    })
}
