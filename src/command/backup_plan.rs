//! The backup plan in `check`: whether some plan within the bounds keeps every promise, whatever u_ref is.

use std::path::Path;

use punctual_core::filter::{Appraisal, Bears, Plans};
use punctual_core::plan::{BackupPlan, Failure};
use punctual_cosim::error::Error;
use punctual_fmu::configuration::{FilterConfiguration, UNBOUNDED};
use serde::Serialize;

use super::closed_loop::LoopReport;
use super::{map, robustness};
use crate::output::{self, number, number_above, number_below};

/// The finding on backup plans from the start.
#[derive(Serialize)]
pub(super) struct BackupPlanReport {
    /// Whether a plan was found and checked.
    pub(super) found: bool,
    /// Whether there certainly is no plan.
    #[serde(skip)]
    vain: bool,
    /// What prevents plans altogether, or why the closest plan fails.
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<String>,
    /// If no plan ends at an equilibrium: a `plan_horizon` in s with which there is a plan, and the time in s
    /// until which that plan keeps every promise.
    #[serde(skip_serializing_if = "Option::is_none")]
    in_motion: Option<[f64; 2]>,
    /// Barriers not promised from there: soft, outside without a deadline, or released before it.
    left_out: Vec<String>,
    /// Whether a barrier has a deadline, so that other deadlines were tried.
    #[serde(skip)]
    has_deadline: bool,
    /// The least factor on all deadlines for which a plan was found.
    earliest_factor: Option<f64>,
    /// The earliest deadlines in s, by barrier.
    earliest: Vec<(String, f64)>,
    /// The plan with the configured deadlines, or otherwise with the earliest ones.
    plan: Option<PlanReport>,
    /// What a plan bears if it is declared.
    #[serde(skip)]
    pub(super) bears: Option<Bears>,
    /// With how much less declared it would be kept, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    remedy: Option<String>,
    /// The pictures of the plan.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    files: Vec<String>,
}

/// A plan that was checked.
#[derive(Serialize)]
struct PlanReport {
    /// Time in s from which the plant is at an equilibrium, if the plan ends at one.
    at_equilibrium_from: Option<f64>,
    /// Time in s until which it keeps every promise, if it ends.
    until: Option<f64>,
    /// Whether it is for an uncertain plant.
    #[serde(skip)]
    covers: bool,
    /// Whether it accounts for points that move by themselves.
    #[serde(skip)]
    covers_points: bool,
    /// The largest magnitude of each input, with its unit and bounds.
    inputs: Vec<(String, f64, String, [f64; 2])>,
    /// The barrier with the least h above its margin, the time in s, that difference, and its unit.
    tightest: Option<(String, f64, f64, String)>,
}

/// The finding for the start `x0`, from which the closed loop `run` started. The plan is drawn to the folder
/// `out`, if given. `None` if an input has no bounds, so that nothing is ruled out.
pub(super) fn find(
    c: &FilterConfiguration,
    x0: &[f64],
    run: Option<&LoopReport>,
    out: Option<&Path>,
) -> Result<Option<BackupPlanReport>, Error> {
    let (inputs, x0) = (c.plant.inputs(), &c.measured(x0)[..]);
    let bounds = |name: &str| c.bounds.get(name).copied().filter(|b| b.iter().all(|b| b.abs() < UNBOUNDED));
    if c.commanded().iter().any(|signal| c.limits(&signal.name).is_none()) {
        return Ok(None);
    }
    let refused = |reason: String| BackupPlanReport {
        found: false,
        vain: false,
        reason: Some(reason),
        in_motion: in_motion(c, x0),
        left_out: Vec::new(),
        has_deadline: false,
        earliest_factor: None,
        earliest: Vec::new(),
        plan: None,
        bears: None,
        remedy: None,
        files: Vec::new(),
    };
    let filter = match c.assured(c.build()?) {
        Ok(filter) => filter,
        Err(reason) => return Ok(Some(refused(reason))),
    };
    let Some(planning) = filter.planning() else { return Ok(None) };
    let t = c.experiment.start_time;
    let unit = |i: usize| c.barrier[i].unit(&c.plant);
    let plan = |backup_plan: &BackupPlan| PlanReport {
        at_equilibrium_from: backup_plan
            .until
            .is_infinite()
            .then(|| backup_plan.inputs.last().map_or(t, |(end, _)| *end)),
        until: Some(backup_plan.until).filter(|until| until.is_finite()),
        covers: !c.covered().is_empty(),
        covers_points: !c.covered_points().is_empty(),
        inputs: inputs
            .iter()
            .enumerate()
            .map(|(i, input)| {
                let peak = backup_plan.inputs.iter().fold(0.0_f64, |peak, (_, u)| peak.max(u[i].abs()));
                let given = bounds(&input.name).unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
                (input.name.clone(), peak, input.unit.clone(), given)
            })
            .collect(),
        tightest: backup_plan
            .tightest
            .map(|at| (c.barrier[at.barrier].name.clone(), at.time, at.slack, unit(at.barrier))),
    };
    let has_deadline = c.barrier.iter().any(|barrier| barrier.deadline.is_some());
    let Appraisal { plan: configured, earliest, bears, .. } = planning.appraise(t, x0, Plans::LONGEST);
    let remedy = configured.as_ref().err().and_then(|_| robustness::remedy(c, &filter, t, x0));
    let left_out = c.barrier.iter().zip(planning.promised(t, x0)).filter(|(_, promised)| !promised);
    let left_out = left_out.map(|(barrier, _)| barrier.name.clone()).collect();
    let reason = configured.as_ref().err().map(|failure| c.refusal(*failure));
    // If the closed loop followed plans on the model, its inputs followed by the backup plan are a plan as
    // well.
    let run = run.filter(|run| !run.by_rows && c.run.simulated.is_none());
    let deadlines = |factor: f64| {
        let given = c.barrier.iter().enumerate().filter_map(|(i, b)| {
            let arrival = run.and_then(|run| run.arrival(i, t)).unwrap_or(f64::INFINITY);
            Some((b.name.clone(), b.deadline_times(factor)?.min(arrival)))
        });
        given.collect::<Vec<_>>()
    };
    let shown = configured.as_ref().ok().or(earliest.as_ref().map(|(_, backup_plan)| backup_plan));
    let files = match (out, shown) {
        (Some(folder), Some(backup_plan)) => map::plan(c, (&filter, backup_plan), (t, x0), folder)?,
        _ => Vec::new(),
    };
    Ok(Some(BackupPlanReport {
        found: configured.is_ok(),
        vain: matches!(configured, Err(Failure::Apart { .. })),
        reason,
        in_motion: if configured.is_err() { in_motion(c, x0) } else { None },
        left_out,
        has_deadline,
        earliest_factor: earliest.as_ref().map(|(factor, _)| *factor),
        earliest: earliest.as_ref().map_or(Vec::new(), |(factor, _)| deadlines(*factor)),
        plan: shown.map(plan),
        bears,
        remedy,
        files,
    }))
}

/// One line with the earliest deadlines that have a plan from `x0`, for a refused promise, and one that says with how much less declared
/// it would be kept.
pub(super) fn in_time(c: &FilterConfiguration, x0: &[f64]) -> Result<Vec<String>, Error> {
    let has_deadline = c.barrier.iter().any(|barrier| barrier.deadline.is_some());
    let Ok(filter) = c.assured(c.build()?) else { return Ok(Vec::new()) };
    let (t, x0) = (c.experiment.start_time, &c.measured(x0)[..]);
    let remedy = robustness::remedy(c, &filter, t, x0);
    let Some(planning) = filter.planning().filter(|_| has_deadline) else {
        return Ok(remedy.into_iter().collect());
    };
    let line = match planning.later_deadline(t, x0, Plans::LONGEST) {
        Some((factor, _)) => {
            let earliest = c.barrier.iter().filter_map(|b| Some((&b.name, b.deadline_times(factor)?)));
            let named: Vec<_> = earliest.map(|(name, at)| format!("{name} {} s", number(at))).collect();
            format!("earliest deadline with a plan: {}", named.join(", "))
        }
        None if matches!(planning.plan_from(t, x0, 1.0), Err(Failure::Apart { .. })) => return Ok(Vec::new()),
        None => {
            format!("no plan was found for deadlines up to {} times as long either", Plans::LONGEST)
        }
    };
    Ok([line].into_iter().chain(remedy).collect())
}

/// A `plan_horizon` for a file without one, as long as its latest deadline, and the time until which there is
/// a plan with it.
fn in_motion(c: &FilterConfiguration, x0: &[f64]) -> Option<[f64; 2]> {
    // A plan for an uncertain plant ends in motion anyway.
    if c.plan_horizon.is_some() || c.uncertainty.is_some() || !c.measurement_errors.is_empty() {
        return None;
    }
    let latest = c.barrier.iter().filter_map(|barrier| barrier.deadline).fold(0.0, f64::max);
    let horizon = if latest > 0.0 { latest } else { c.experiment.stop_time - c.experiment.start_time };
    let mut c = c.clone();
    c.plan_horizon = Some(horizon);
    let filter = c.assured(c.build().ok()?).ok()?;
    let until = filter.planning()?.plan_from(c.experiment.start_time, x0, 1.0).ok()?.until;
    until.is_finite().then_some([horizon, until])
}

impl BackupPlanReport {
    /// Whether the plan keeps the promise of `barrier`.
    pub(super) fn keeps(&self, barrier: &str) -> bool {
        self.found && self.covers(barrier)
    }

    /// Whether a plan must keep the promise of `barrier`.
    pub(super) fn covers(&self, barrier: &str) -> bool {
        self.left_out.iter().all(|name| name != barrier)
    }

    /// Time in s until which the plan keeps its promises, if it ends in motion.
    pub(super) fn until(&self) -> Option<f64> {
        self.plan.as_ref()?.until
    }

    /// The earliest deadline of `barrier` in s that has a plan.
    pub(super) fn earliest_deadline(&self, barrier: &str) -> Option<f64> {
        self.earliest.iter().find(|(name, _)| name == barrier).map(|(_, deadline)| *deadline)
    }

    pub(super) fn text(&self) -> String {
        let mut lines = vec![match (self.found, &self.reason) {
            (true, _) => {
                let until = self.until().map(|until| {
                    format!(", until {} s; it is extended if a longer one is found", number_below(until))
                });
                // What is not promised is named below.
                let kept = if self.left_out.is_empty() { "every promise" } else { "what is promised" };
                let keeps = format!("found; within the bounds, it keeps {kept}, whatever u_ref is");
                format!("\nbackup plan: {keeps}{}", until.unwrap_or_default())
            }
            (false, Some(reason)) if self.vain => format!("\nbackup plan: NONE can exist: {reason}"),
            (false, Some(reason)) => format!("\nbackup plan: NONE was found: {reason}"),
            (false, None) => "\nbackup plan: NONE was found".to_owned(),
        }];
        if let Some([horizon, until]) = self.in_motion {
            lines.push(format!(
                "none ends at an equilibrium; with plan_horizon = {} there is one until {} s, to be extended during the run",
                number(horizon),
                number_below(until)
            ));
        }
        lines.extend(self.remedy.clone());
        if !self.left_out.is_empty() {
            lines.push(format!("not promised from there, and not in the plan: {}", self.left_out.join(", ")));
        }
        let earliest: Vec<_> = self
            .earliest
            .iter()
            .map(|(name, deadline)| format!("{name} {} s", number_above(*deadline)))
            .collect();
        if !earliest.is_empty() {
            lines.push(format!("earliest deadline with a plan: {}", earliest.join(", ")));
        } else if self.has_deadline && !self.found && !self.vain && self.plan.is_none() {
            lines.push(format!("none was found for deadlines up to {} times as long either", Plans::LONGEST));
        }
        if let Some(plan) = &self.plan {
            let inputs: Vec<_> = plan
                .inputs
                .iter()
                .map(|(name, peak, unit, [min, max])| {
                    let peak = output::quantity(*peak, unit);
                    format!("{name} {peak} (bounds {} to {})", number(*min), number(*max))
                })
                .collect();
            let of = if self.found { "the plan" } else { "the plan for that" };
            let ending = match (plan.at_equilibrium_from, plan.until) {
                (Some(from), _) => format!("at an equilibrium from {} s", number(from)),
                (None, until) => {
                    let ending = match (plan.covers, plan.covers_points) {
                        (true, _) => "with every plant that it covers",
                        (false, true) => "however the centres move that it covers",
                        (false, false) => "ending in motion",
                    };
                    format!("until {} s, {ending}", number_below(until.unwrap_or(f64::NAN)))
                }
            };
            lines.push(format!("{of}: {ending}; {}", inputs.join(", ")));
            if let Some((barrier, time, slack, unit)) = &plan.tightest {
                let (slack, time) = (output::quantity(*slack, unit), number(*time));
                lines.push(format!("its tightest point: {barrier} at {time} s, {slack} inside"));
            }
        }
        if !self.files.is_empty() {
            lines.push(format!("written: {}", self.files.join("\n         ")));
        }
        lines.join("\n")
    }
}
