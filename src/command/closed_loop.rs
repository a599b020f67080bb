//! What `check` finds by running the filter it checks in a closed loop: the soonest deadline, the smallest
//! bounds. With damping as u_ref on a reference plant, u_ref = 0 on another, on the filter's own model.

use punctual_core::effort::{self, CANDIDATES, Candidate};
use punctual_core::filter::{ProfileKind, SafetyFilter};
use punctual_core::nominal::damping;
use punctual_core::simulation::Schedule;
use punctual_fmu::configuration::{FilterConfiguration, ModelName, ProfileName, UNBOUNDED};
use serde::Serialize;

use crate::error::Error;
use crate::output::{self, number};

/// Most samples until a deadline; fewer where the filter's own step is longer.
const SAMPLES: f64 = 200.0;
/// Part of the soonest deadline to which it is found.
const TOLERANCE: f64 = 0.02;
/// The longest deadline looked for, in units of the configured one.
const HORIZON: f64 = 30.0;
/// Per second.
const DAMPING: f64 = 1.0;

/// Whether the bounds allow the deadline.
#[derive(Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Verdict {
    /// The filter meets it in simulation.
    CanBeMet,
    /// No input within the bounds is inside then.
    CannotBeMet,
    NotKnown,
}

/// What the input bounds allow from the start.
#[derive(Serialize)]
pub(super) struct ReachReport {
    pub(super) deadline: Verdict,
    /// No input within the bounds is faster, in s.
    soonest_at_least: Option<f64>,
    /// The soonest deadline that this filter meets in simulation, in s.
    soonest_at_most: Option<f64>,
}

impl ReachReport {
    pub(super) fn rows(&self) -> Vec<(&'static str, String)> {
        let verdict = match self.deadline {
            Verdict::CanBeMet => "can be met (this filter does it, simulated)",
            Verdict::CannotBeMet => "cannot be met (no input within the bounds is inside then)",
            Verdict::NotKnown => "not known whether it can be met",
        };
        let least = match self.soonest_at_least {
            Some(time) => format!("at least {} s (no input within the bounds is faster)", number(time)),
            None => "no lower bound is known".to_owned(),
        };
        let most = match self.soonest_at_most {
            Some(time) => format!("at most {} s (this filter does it, simulated)", number(time)),
            None => "no upper bound was found".to_owned(),
        };
        vec![("bounds", verdict.to_owned()), ("soonest", least), ("", most)]
    }
}

/// What one candidate needs.
#[derive(Serialize)]
pub(super) struct RatingReport {
    profile: &'static str,
    rate_times_deadline: f64,
    /// Of the inputs that are accelerations, without bounds on them, in m/s2.
    peak: Option<f64>,
    /// The smallest bound on them with which the deadlines are kept, in m/s2.
    smallest_bound: Option<f64>,
    /// The lines for the configuration.
    settings: String,
}

/// A closed loop of `filter` from `x0`, until twice the longest deadline.
fn run(
    c: &FilterConfiguration,
    filter: &mut SafetyFilter,
    x0: &[f64],
    deadlines: &[f64],
) -> Result<effort::Run, Error> {
    let plant = c.plant.build()?;
    let longest = deadlines.iter().copied().fold(0.0, f64::max);
    let shortest = deadlines.iter().copied().fold(f64::INFINITY, f64::min);
    let step = c.experiment.step_size.max(longest / SAMPLES).min(shortest);
    let substeps = (10.0 * step / shortest).ceil() as usize;
    let schedule = Schedule { step, steps: (2.0 * longest / step).ceil() as usize, substeps };
    let states = c.plant.states().len();
    let point_mass = c.plant.model == Some(ModelName::PointMass);
    let vehicle = c.plant.model.is_some() && states > 3;
    effort::run(filter, &*plant, (c.experiment.start_time, x0), schedule, deadlines, |x, u_ref| {
        u_ref.fill(0.0);
        if point_mass {
            u_ref.copy_from_slice(&[damping(x[2], DAMPING), damping(x[3], DAMPING)]);
        } else if vehicle {
            u_ref[0] = damping(x[3], DAMPING);
        }
    })
    .map_err(Error::from)
}

fn deadlines(c: &FilterConfiguration) -> Vec<f64> {
    c.barrier.iter().map(|b| b.deadline.unwrap_or(f64::INFINITY)).collect()
}

/// What the bounds allow barrier `index` from `x0`.
pub(super) fn reach(c: &FilterConfiguration, index: usize, x0: &[f64]) -> Result<ReachReport, Error> {
    let filter = c.build()?;
    let (t, configured) = (c.experiment.start_time, deadlines(c));
    let deadline = configured[index];
    let horizon = HORIZON * deadline;
    let soonest = filter.soonest(index, t, x0, horizon).map_err(Error::from)?;
    let keeps = |deadline: f64| {
        let mut tried = c.clone();
        tried.barrier[index].deadline = Some(deadline);
        tried.barrier[index].when_infeasible = punctual_fmu::configuration::InfeasibleName::Report;
        let mut filter = tried.build()?;
        Ok::<_, Error>(run(c, &mut filter, x0, &deadlines(&tried))?.kept)
    };
    let lost = filter.is_ruled_out(index, t, x0, deadline).map_err(Error::from)?;
    // Growing from what is not ruled out: the longest deadlines are the longest runs.
    let mut low = soonest.unwrap_or(0.0).max(1e-3 * deadline);
    let mut most = None;
    while low < horizon {
        let high = 2.0 * low;
        if let Some(found) = effort::smallest([low, high], TOLERANCE, keeps)? {
            most = Some(found);
            break;
        }
        low = high;
    }
    let verdict = match () {
        () if lost => Verdict::CannotBeMet,
        () if keeps(deadline)? => Verdict::CanBeMet,
        () => Verdict::NotKnown,
    };
    Ok(ReachReport { deadline: verdict, soonest_at_least: soonest, soonest_at_most: most })
}

fn name(profile: ProfileKind) -> &'static str {
    match profile {
        ProfileKind::Hermite => "hermite",
        ProfileKind::LowPeak => "low_peak",
    }
}

/// A bound in m/s² as it is written in the lines to paste, and so tried: below the peak a little more can be worse.
fn written(bound: f64) -> f64 {
    (bound * 1e3).ceil() / 1e3
}

/// What the candidates of [`effort`] need from `x0`: bounds on the inputs that are accelerations; the others
/// keep theirs.
pub(super) fn ratings(c: &FilterConfiguration, x0: &[f64]) -> Result<Vec<RatingReport>, Error> {
    let driven: Vec<usize> =
        c.plant.inputs().iter().enumerate().filter(|(_, s)| s.unit == "m/s2").map(|(i, _)| i).collect();
    let configured = |candidate: &Candidate, bound: f64| {
        let mut tried = c.clone();
        for section in &mut tried.barrier {
            section.rates.clear();
            section.rate = section.deadline.map_or(0.0, |deadline| candidate.rate_times_deadline / deadline);
            section.profile = match candidate.profile {
                ProfileKind::Hermite => ProfileName::Hermite,
                ProfileKind::LowPeak => ProfileName::LowPeak,
            };
        }
        for &i in &driven {
            let limit = written(bound).min(UNBOUNDED);
            tried.bounds.insert(c.plant.inputs()[i].name.clone(), [-limit, limit]);
        }
        tried
    };
    let try_out = |candidate: &Candidate, bound: f64| {
        let tried = configured(candidate, bound);
        let mut filter = tried.build()?;
        let run = run(&tried, &mut filter, x0, &deadlines(&tried))?;
        Ok::<_, Error>((run.kept, driven.iter().map(|&i| run.peak[i]).fold(0.0, f64::max)))
    };
    let ratings = effort::compare(&CANDIDATES, try_out)?;
    let lines = |candidate: &Candidate, bound: Option<f64>| {
        let mut lines: Vec<String> = Vec::new();
        for section in &c.barrier {
            let rate = section.deadline.map_or(0.0, |deadline| candidate.rate_times_deadline / deadline);
            let profile = name(candidate.profile);
            lines
                .push(format!("# in [[barrier]] {}\nprofile = \"{profile}\"\nrate = {rate:?}", section.name));
        }
        if let Some(bound) = bound {
            let bound = written(bound);
            lines.push("[bounds]".to_owned());
            let inputs = c.plant.inputs();
            lines.extend(driven.iter().map(|&i| format!("{} = [{:?}, {bound:?}]", inputs[i].name, -bound)));
        }
        lines.join("\n")
    };
    Ok(ratings
        .iter()
        .map(|r| RatingReport {
            profile: name(r.candidate.profile),
            rate_times_deadline: r.candidate.rate_times_deadline,
            peak: r.peak,
            smallest_bound: r.bound.map(written),
            settings: lines(&r.candidate, r.bound),
        })
        .collect())
}

/// The ratings as a table, and the best as lines to paste.
pub(super) fn ratings_text(ratings: &[RatingReport]) -> String {
    let head = ["profile", "rate times deadline", "peak m/s2", "smallest bound m/s2"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    let shown = |value: Option<f64>| value.map_or_else(|| "deadline lost".to_owned(), number);
    rows.extend(ratings.iter().map(|r| {
        vec![r.profile.to_owned(), number(r.rate_times_deadline), shown(r.peak), shown(r.smallest_bound)]
    }));
    let table = output::table(&rows, &[false, true, true, true]);
    let head = "effort, simulated with damping as u_ref; below the peak steps are infeasible and nothing is guaranteed";
    match ratings.first().filter(|best| best.smallest_bound.is_some()) {
        Some(best) => format!("\n{head}\n{table}\n\n{}", best.settings),
        None => format!("\n{head}\n{table}"),
    }
}
