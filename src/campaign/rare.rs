//! The probability that a run of a campaign fails, however rare that is, with the worst run found.
//!
//! What is estimated: the probability that what `[vary]` draws leads to a run that fails. Nothing is drawn during a run,
//! so the run is a function of what is drawn at its start, and subset simulation over that is what splitting is elsewhere
//! ([`super::splitting`]). Its margin is the least h of all barriers from their deadlines on.

use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::Serialize;

use super::distribution::{Distribution, below};
use super::file::{Campaign, Choice, Success};
use super::measures::Measures;
use super::runner::{self, Crew, Options};
use super::splitting::{Estimate, Point, Problem, Stalled};
use super::table::{Cell, Row};
use crate::error::Error;

/// Estimate of the probability of failure.
#[derive(Clone, Debug, Serialize)]
pub struct Rare {
    /// The probability that a run fails.
    pub probability: f64,
    /// Interval for it, with a confidence of 95 %.
    pub interval: [f64; 2],
    /// Independent repeats that it is the mean of.
    pub repeats: usize,
    /// The levels of h on the way.
    pub levels: Vec<f64>,
    /// Runs made.
    pub runs: u64,
    /// Runs that plain sampling takes for the same standard deviation.
    pub plain_runs: f64,
    /// The worst failure found.
    pub worst: Failing,
}

/// A failing run.
#[derive(Clone, Debug, Serialize)]
pub struct Failing {
    /// Least h of all barriers from their deadlines on; `None` where the run ended before.
    pub least_h: Option<f64>,
    /// The value of each varied variable.
    pub values: Vec<Value>,
}

/// The value of a varied variable.
#[derive(Clone, Debug, Serialize)]
pub struct Value {
    /// `component.variable`.
    pub name: String,
    /// Its unit; empty where it has none.
    pub unit: String,
    /// Its value.
    pub value: f64,
}

/// Estimates the probability that a run of `campaign` fails, and writes the worst one found to `output`, as a campaign of
/// that run alone. `None` where `stop` was set. `tell` gets the number of repeats done, 0 after the pilot.
///
/// # Errors
///
/// A campaign that this does not fit; no way to failure; a file that is in the way or cannot be written.
pub fn rare(
    campaign: &Campaign,
    output: &Path,
    threads: Option<NonZeroUsize>,
    repeats: usize,
    stop: &AtomicBool,
    tell: &(dyn Fn(usize) + Sync),
) -> Result<Option<Rare>, Error> {
    check(campaign, output)?;
    let measures = Measures::new(campaign);
    let margins = Margins::new(&measures)?;
    let crew = Crew::new(campaign, &measures, threads)?;
    // After a stop all are alike, which ends the pilot and costs a repeat nothing.
    let margin = |z: &[f64]| match stop.load(Ordering::Relaxed) {
        true => f64::INFINITY,
        false => margins.of(&crew.make(0, &choice(campaign, z))),
    };
    let problem = Problem { dimensions: campaign.varied().len(), seed: campaign.seed(), margin: &margin };
    let found = crew.pool.install(|| {
        let plan = problem.pilot()?;
        tell(0);
        let estimate = problem.estimate(&plan, repeats, tell);
        Ok((plan, estimate))
    });
    if stop.load(Ordering::Relaxed) {
        return Ok(None);
    }
    let (plan, estimate) = found.map_err(stalled)?;
    let Estimate { probability, interval, deviation, worst: Some(worst), made } = estimate else {
        let message = format!(
            "none of {repeats} repeats came to a failure that the pilot had found; give more, such as --rare={}",
            10 * repeats
        );
        return Err(Error::configuration("--rare", message));
    };
    let worst = write(campaign, output, &worst)?;
    Ok(Some(Rare {
        probability,
        interval,
        repeats,
        runs: plan.made + made,
        plain_runs: (1.0 - probability) / (probability * deviation * deviation),
        levels: plan.levels,
        worst,
    }))
}

/// Refuses what the method does not fit.
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
    if let Some(varied) = campaign.varied().iter().find(|v| matches!(v.distribution, Distribution::Seed)) {
        let message =
            "is \"seed\"; --rare comes to failures by small steps, and seeds have none between them";
        return wrong(&format!("vary.{:?}.distribution", varied.name), message);
    }
    if output.exists() {
        let message = format!("{} is there already; remove it, or give another output", output.display());
        return wrong("--output", &message);
    }
    Ok(())
}

fn stalled(Stalled { margin, part, made }: Stalled) -> Error {
    let way = match margin {
        f64::INFINITY => "no run has an h from a deadline on".to_owned(),
        _ => format!("the least h that {made} runs came to is {margin}"),
    };
    let message = format!(
        "found no way to a failure: {way}, at which about {part:.1e} of all runs are. That proves nothing about the rest"
    );
    Error::configuration("--rare", message)
}

/// What is drawn at a standard normal point.
fn choice(campaign: &Campaign, z: &[f64]) -> Choice {
    let value = |(z, varied): (&f64, &super::file::Varied)| {
        let u = below(*z).clamp(f64::EPSILON / 2.0, 1.0 - f64::EPSILON / 2.0);
        varied.distribution.value(u, 0)
    };
    Choice { seed: 0, values: z.iter().zip(campaign.varied()).map(value).collect() }
}

/// Places of the cells that tell the margin.
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

    /// Least h of the barriers, if all have one.
    fn least(&self, row: &Row) -> Option<f64> {
        let least = self.least.iter().map(|place| match &row[*place] {
            Cell::Number(number) => *number,
            _ => None,
        });
        least.reduce(|a, b| Some(a?.min(b?))).flatten()
    }

    /// Negative where the run fails, and nowhere else.
    fn of(&self, row: &Row) -> f64 {
        let least = self.least(row);
        match row[self.success] {
            Cell::Flag(true) => least.map_or(f64::INFINITY, |h| h.max(0.0)),
            _ => least.filter(|h| *h < 0.0).unwrap_or(f64::NEG_INFINITY),
        }
    }
}

/// Makes the run at `worst` as a campaign of its own.
fn write(campaign: &Campaign, output: &Path, worst: &Point) -> Result<Failing, Error> {
    let drawn = choice(campaign, &worst.z);
    let alone = campaign.alone(&drawn)?;
    let options = Options { output: output.to_owned(), runs: None, threads: NonZeroUsize::new(1) };
    runner::run(&alone, &options, &AtomicBool::new(false), &|_| {})?;
    let value = |(varied, value): (&super::file::Varied, &f64)| Value {
        name: varied.name.clone(),
        unit: varied.unit.clone().unwrap_or_default(),
        value: *value,
    };
    Ok(Failing {
        least_h: Some(worst.margin).filter(|h| h.is_finite()),
        values: campaign.varied().iter().zip(&drawn.values).map(value).collect(),
    })
}
