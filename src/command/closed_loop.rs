//! The closed loops of `check`, with the filter's own model and the wanted u_ref. They show whether each
//! promise is kept, the earliest deadline, and the smallest bounds.

use std::cell::RefCell;

use punctual_core::dynamics::DynPlant;
use punctual_core::filter::{Filter, ProfileKind};
use punctual_cosim::coupling::Kept;
use punctual_cosim::error::Error;
use punctual_fmu::configuration::{
    Automatic, FilterConfiguration, Functions, MethodName, ModelName, PlantSection, ProfileName, UNBOUNDED,
    VariableSection,
};
use punctual_reference::effort::{self, CANDIDATES, Candidate, Loop};
use punctual_reference::nominal::damping;
use punctual_reference::simulation::Schedule;
use serde::Serialize;

use crate::output::{self, number, number_above, number_below};

/// The most samples until a deadline; fewer if the filter's own step is longer.
const SAMPLES: f64 = 200.0;
/// Relative tolerance of the earliest deadline.
const TOLERANCE: f64 = 0.02;
/// The longest deadline tried, as a multiple of the configured one.
const HORIZON: f64 = 30.0;
/// Gain of the damping in 1/s.
const DAMPING: f64 = 1.0;
/// Length of a closed loop, as a multiple of its longest deadline.
const WATCHED: f64 = 2.0;
/// The longest integration step of the plant in a closed loop, in s.
const INNER_STEP: f64 = 0.002;
/// The fewest instants in a period at which h is evaluated.
const INSTANTS: f64 = 4.0;
/// The most samples of a closed loop; they are further apart in a longer loop.
const MOST_SAMPLES: f64 = 1e6;

/// The u_ref of the closed loops.
pub(super) enum Wanted {
    /// Zero: the value in an FMU whose input is not connected.
    None,
    /// Damping: −v per second, for the vehicles by name.
    Damping,
    /// Constant.
    Constant(Vec<f64>),
    /// That of the file.
    File(RefCell<Functions<f64>>),
}

impl Wanted {
    /// Parses `--u-ref`: `none`, `damping`, or values such as `a=0.5,omega=0`. By default the u_ref of the
    /// file, if it is for the filter's own model.
    pub(super) fn parse(text: Option<&str>, c: &FilterConfiguration) -> Result<Self, Error> {
        let Some(text) = text else {
            let own = c.integrator.is_none() && (c.run.simulated.is_none() || simulated(c).is_some());
            let functions = match c.alone() {
                Ok((_, Some(controller))) if own => controller.functions()?,
                _ => None,
            };
            return Ok(functions.map_or(Self::None, |functions| Self::File(RefCell::new(functions))));
        };
        let refuse = |message: String| Err(Error::configuration("--u-ref", message));
        let inputs: Vec<String> = c.plant.inputs().into_iter().map(|input| input.name).collect();
        match text.trim() {
            "none" => return Ok(Self::None),
            "damping" if has_damping(c) => return Ok(Self::Damping),
            "damping" => {
                let example = inputs.first().map_or("u", String::as_str);
                return refuse(format!(
                    "is \"damping\", which is for the vehicles by name; give none, or values as \"{example}=0\""
                ));
            }
            _ => {}
        }
        let mut values = vec![0.0; inputs.len()];
        for part in text.split(',').map(str::trim).filter(|part| !part.is_empty()) {
            let Some((name, value)) = part.split_once('=') else {
                return refuse(format!("is {part:?}, must be none, damping, or like \"a=0.5\""));
            };
            let Some(index) = inputs.iter().position(|input| input == name.trim()) else {
                return refuse(format!(
                    "{:?} is not an input, must be one of {}",
                    name.trim(),
                    inputs.join(", ")
                ));
            };
            match value.trim().parse() {
                Ok(value) if f64::is_finite(value) => values[index] = value,
                _ => return refuse(format!("is {part:?}, must be a finite number")),
            }
        }
        Ok(Self::Constant(values))
    }

    /// In the form that `--u-ref` accepts.
    fn words(&self, c: &FilterConfiguration) -> String {
        match self {
            Self::None => "u_ref = 0 (--u-ref none)".to_owned(),
            Self::Damping => "damping as u_ref (--u-ref damping)".to_owned(),
            Self::File(_) => "the u_ref of the file".to_owned(),
            Self::Constant(values) => {
                let inputs = c.plant.inputs();
                let named = inputs.iter().zip(values).map(|(s, v)| format!("{} = {}", s.name, number(*v)));
                format!("u_ref: {}", named.collect::<Vec<_>>().join(", "))
            }
        }
    }

    /// Writes u_ref at time `t` in s for the state `x`.
    fn write(&self, c: &FilterConfiguration, t: f64, x: &[f64], u_ref: &mut [f64]) {
        match self {
            Self::None => u_ref.fill(0.0),
            Self::Constant(values) => u_ref.copy_from_slice(values),
            Self::File(functions) => {
                let functions = &mut *functions.borrow_mut();
                u_ref.iter_mut().zip(functions.at(t, |i| x[i])).for_each(|(u, value)| *u = value);
            }
            Self::Damping if c.plant.model() == Some(ModelName::PointMass) => {
                u_ref.copy_from_slice(&[damping(x[2], DAMPING), damping(x[3], DAMPING)]);
            }
            Self::Damping => {
                u_ref.fill(0.0);
                u_ref[0] = damping(x[3], DAMPING);
            }
        }
    }
}

/// The plant that the file simulates in place of the filter's model, if its states and inputs are those of
/// the model.
pub(super) fn simulated(c: &FilterConfiguration) -> Option<&PlantSection> {
    let names = |signals: Vec<VariableSection>| signals.into_iter().map(|s| s.name).collect::<Vec<_>>();
    let is_alike = |plant: &PlantSection| {
        names(plant.states()) == names(c.plant.states()) && names(plant.inputs()) == names(c.plant.inputs())
    };
    c.run.simulated.as_ref().filter(|plant| c.integrator.is_none() && is_alike(plant))
}

/// The plant of the closed loops.
fn plant(c: &FilterConfiguration) -> Result<Box<dyn DynPlant>, Error> {
    Ok(simulated(c).unwrap_or(&c.plant).build()?)
}

/// Whether damping is available for the plant, as for every named vehicle, whose fourth state is a velocity.
pub(super) fn has_damping(c: &FilterConfiguration) -> bool {
    c.plant.model().is_some() && c.plant.states().len() > 3
}

/// Result of a closed loop.
#[derive(Serialize)]
pub(super) struct LoopReport {
    /// u_ref as text.
    pub(super) u_ref: String,
    /// Whether every promise was kept.
    pub(super) kept: bool,
    /// Whether the loop uses only the rows although the filter follows plans.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub(super) by_rows: bool,
    /// End of the run in s.
    end: f64,
    /// Time between samples in s.
    step: f64,
    pub(super) barriers: Vec<LoopBarrier>,
    pub(super) inputs: Vec<LoopInput>,
    /// States that left the range for which the model is intended.
    pub(super) beyond: Vec<LoopState>,
}

/// Findings on a barrier.
#[derive(Serialize)]
pub(super) struct LoopBarrier {
    pub(super) name: String,
    pub(super) promise: Kept,
    arrival: Option<f64>,
    /// Time in s from which it was inside.
    #[serde(skip)]
    since: Option<f64>,
    late: Option<f64>,
    late_by: Option<f64>,
    left: Option<f64>,
    least_h: Option<f64>,
    pub(super) unmet: usize,
    first_unmet: Option<f64>,
}

/// Findings on an input.
#[derive(Serialize)]
pub(super) struct LoopInput {
    pub(super) name: String,
    unit: String,
    /// Largest magnitude.
    pub(super) peak: f64,
    /// Its bounds; `null` if it has none.
    pub(super) bounds: Option<[f64; 2]>,
}

/// A state that left its range.
#[derive(Serialize)]
pub(super) struct LoopState {
    name: String,
    unit: String,
    seen: [f64; 2],
    range: [Option<f64>; 2],
}

impl LoopState {
    pub(super) fn words(&self) -> String {
        let end = |end: Option<f64>, none: &str| end.map_or_else(|| none.to_owned(), number);
        format!(
            "{} goes from {} to {} {}, beyond its range of {} to {}: the model is not meant there",
            self.name,
            number(self.seen[0]),
            number(self.seen[1]),
            self.unit,
            end(self.range[0], "-inf"),
            end(self.range[1], "inf"),
        )
    }
}

impl LoopInput {
    pub(super) fn words(&self) -> String {
        let Self { name, peak, unit, .. } = self;
        let size = format!("{name} {}", output::quantity(*peak, unit));
        match self.bounds {
            Some([min, max]) => format!("{size} (bounds {} to {})", number(min), number(max)),
            None => format!("{size} (no bounds)"),
        }
    }
}

impl LoopReport {
    /// The time in s after `start` from which barrier `index` was inside, if every promise was kept: a
    /// deadline that this run meets.
    pub(super) fn arrival(&self, index: usize, start: f64) -> Option<f64> {
        let barrier = self.barriers.get(index).filter(|b| self.kept && b.promise == Kept::Kept)?;
        Some(barrier.since? - start).filter(|after| *after > 0.0)
    }

    /// A line that says whether the promises were kept.
    pub(super) fn head(&self) -> String {
        let words = if self.kept { "every promise is kept" } else { "NOT every promise is kept" };
        let verdict = output::verdict(words, self.kept);
        let (step, end) = (number(self.step), number(self.end));
        let who = if self.by_rows { " of the rows alone" } else { "" };
        format!("closed loop{who} with {}, steps of {step} s to t = {end} s: {verdict}", self.u_ref)
    }

    pub(super) fn text(&self) -> String {
        let head =
            ["barrier", "promise", "arrival s", "late by s", "left s", "least h", "steps not met", "from s"];
        let mut rows = vec![head.map(str::to_owned).to_vec()];
        let shown = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), number);
        rows.extend(self.barriers.iter().map(|b| {
            let promise = super::run::shown(b.promise);
            let [arrival, left, least] = [b.arrival, b.left, b.least_h].map(shown);
            // After a promise is lost, the run may end before the arrival.
            let late = super::run::lateness(b.late_by, "not seen");
            let unmet = b.unmet.to_string();
            vec![b.name.clone(), promise, arrival, late, left, least, unmet, shown(b.first_unmet)]
        }));
        let right = [false, false, true, true, true, true, true, true];
        let inputs: Vec<_> = self.inputs.iter().map(LoopInput::words).collect();
        format!("\n{}\n{}\nlargest inputs: {}", self.head(), output::table(&rows, &right), inputs.join(", "))
    }
}

/// The experiment's length in s, or well beyond every deadline if that is longer.
fn watched(c: &FilterConfiguration) -> f64 {
    let ends = c.barrier.iter().flat_map(|b| [b.deadline, b.begin, b.end]);
    let longest = ends.flatten().fold(0.0, f64::max);
    (WATCHED * longest).max(c.experiment.stop_time - c.experiment.start_time)
}

/// The filter of the closed loop. An integrator is part of the plant here, so its filter is that of the rows.
pub(super) fn filter(c: &FilterConfiguration) -> Result<Filter, Error> {
    let follows = c.is_assured() && c.integrator.is_none();
    Ok(if follows { c.build_loop()? } else { c.build()? })
}

/// The closed loop of the configuration from `x0`, well beyond every deadline.
pub(super) fn watch(c: &FilterConfiguration, x0: &[f64], wanted: &Wanted) -> Result<LoopReport, Error> {
    let (mut filter, plant) = (filter(c)?, plant(c)?);
    let (length, deadlines) = (watched(c), deadlines(c));
    // The closed loop, finely enough.
    let step = c.experiment.step_size.max(length / MOST_SAMPLES);
    let substeps = (step / INNER_STEP).max(INSTANTS).ceil() as usize;
    let steps = (length / step - 1e-9).ceil() as usize;
    let setting = Loop {
        plant: &*plant,
        start: (c.experiment.start_time, x0),
        schedule: Schedule { step, steps, substeps },
        deadlines: &deadlines,
        delay: c.actuation_delay,
        // A lost promise is not simulated for long, since steps that cannot be met take the longest.
        until: deadlines.iter().copied().filter(|d| d.is_finite()).fold(0.0, f64::max),
    };
    let run = effort::run(&mut filter, &setting, |t, x, u_ref| wanted.write(c, t, x, u_ref))?;
    // Findings by barrier, input and state.
    let barriers = c.barrier.iter().zip(&run.barriers).map(|(section, seen)| LoopBarrier {
        name: section.name.clone(),
        promise: seen.judgement.verdict().into(),
        arrival: seen.judgement.arrival,
        since: seen.judgement.since,
        late: seen.judgement.late,
        late_by: seen.judgement.late_by(),
        left: seen.judgement.left,
        least_h: seen.judgement.least,
        unmet: seen.unmet,
        first_unmet: seen.first_unmet,
    });
    let inputs = c.plant.inputs().into_iter().zip(run.peak).map(|(input, peak)| LoopInput {
        bounds: c.bounds.get(&input.name).copied().filter(|b| b.iter().all(|b| b.abs() < UNBOUNDED)),
        name: input.name,
        unit: input.unit,
        peak,
    });
    let beyond = c.plant.states().into_iter().zip(&run.states).filter_map(|(state, seen)| {
        // NaN is outside every range.
        let within = state.min.is_none_or(|min| seen[0] >= min) && state.max.is_none_or(|max| seen[1] <= max);
        let (seen, range) = (*seen, [state.min, state.max]);
        let finite = seen.iter().all(|x| x.is_finite());
        (!within || !finite).then_some(LoopState { name: state.name, unit: state.unit, seen, range })
    });
    Ok(LoopReport {
        u_ref: wanted.words(c),
        kept: run.kept,
        by_rows: c.is_assured() && c.integrator.is_some(),
        end: run.end,
        step,
        barriers: barriers.collect(),
        inputs: inputs.collect(),
        beyond: beyond.collect(),
    })
}

/// Whether the bounds allow a deadline.
#[derive(Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Verdict {
    /// The filter meets it in simulation.
    CanBeMet,
    /// No input within the bounds leads inside by the deadline.
    CannotBeMet,
    NotKnown,
}

/// Deadlines that the input bounds allow from the start.
#[derive(Serialize)]
pub(super) struct ReachReport {
    pub(super) deadline: Verdict,
    /// Lower bound in s on the time that any input within the bounds needs.
    earliest_at_least: Option<f64>,
    /// The earliest deadline in s that this filter meets in simulation, or a plan on the model.
    earliest_at_most: Option<f64>,
    /// Whether the finding comes from a plan.
    by_plan: bool,
    /// Whether the closed loop meets the earliest deadline.
    #[serde(skip)]
    by_loop: bool,
}

impl ReachReport {
    pub(super) fn rows(&self) -> Vec<(&'static str, String)> {
        let verdict = match self.deadline {
            Verdict::CanBeMet if self.by_plan => "can be met (a plan does it)",
            Verdict::CanBeMet => "can be met (this filter does it with that u_ref, simulated)",
            Verdict::CannotBeMet => "cannot be met (no input within the bounds is inside then)",
            Verdict::NotKnown => "not known whether it can be met",
        };
        let least = match self.earliest_at_least {
            Some(time) => format!("at least {} s (no input within the bounds is faster)", number_below(time)),
            None => "no lower bound is known".to_owned(),
        };
        let is_planned = self.by_plan && !self.by_loop;
        let who = if is_planned { "a plan does it" } else { "this filter does it, simulated" };
        let most = match self.earliest_at_most {
            Some(time) => format!("at most {} s ({who})", number_above(time)),
            None => "no upper bound was found".to_owned(),
        };
        vec![("bounds", verdict.to_owned()), ("earliest", least), ("", most)]
    }
}

/// Inputs that one candidate requires.
#[derive(Serialize)]
pub(super) struct RatingReport {
    profile: &'static str,
    rate_times_deadline: f64,
    /// Largest input among the accelerations, without bounds on them, in m/s2.
    peak: Option<f64>,
    /// The smallest bound on the accelerations with which the deadlines are kept, in m/s2.
    smallest_bound: Option<f64>,
    /// The lines for the configuration.
    settings: String,
}

/// A closed loop of `filter` from `x0`, until twice the longest deadline.
fn run(
    c: &FilterConfiguration,
    filter: &mut Filter,
    (x0, wanted): (&[f64], &Wanted),
    deadlines: &[f64],
) -> Result<effort::Run, Error> {
    let plant = plant(c)?;
    let finite = deadlines.iter().copied().filter(|deadline| deadline.is_finite());
    let longest = finite.clone().fold(0.0, f64::max);
    let shortest = finite.fold(f64::INFINITY, f64::min);
    let step = c.experiment.step_size.max(longest / SAMPLES).min(shortest);
    let substeps = ((10.0 * step / shortest).ceil() as usize).max(2);
    let setting = Loop {
        plant: &*plant,
        start: (c.experiment.start_time, x0),
        schedule: Schedule { step, steps: (2.0 * longest / step).ceil() as usize, substeps },
        deadlines,
        delay: c.actuation_delay.min(step),
        until: 0.0,
    };
    effort::run(filter, &setting, |t, x, u_ref| wanted.write(c, t, x, u_ref)).map_err(Error::from)
}

fn deadlines(c: &FilterConfiguration) -> Vec<f64> {
    c.barrier.iter().map(|b| b.deadline.unwrap_or(f64::INFINITY)).collect()
}

/// Limits that the bounds set on barrier `index` with this deadline, from `x0`; `rows` is the filter of `c`. `plans`, if they are
/// followed, says whether there is one for this deadline, and the earliest deadline that has one. `arrival`
/// is the arrival in the closed loop that keeps every promise.
pub(super) fn reach(
    (c, rows): (&FilterConfiguration, &Filter),
    (index, deadline): (usize, f64),
    (x0, wanted): (&[f64], &Wanted),
    plans: Option<(bool, Option<f64>)>,
    arrival: Option<f64>,
) -> Result<ReachReport, Error> {
    let sooner = |most: Option<f64>| match (most, arrival) {
        (Some(most), Some(arrival)) if arrival < most => (Some(arrival), true),
        (None, Some(_)) => (arrival, true),
        _ => (most, false),
    };
    let t = c.experiment.start_time;
    let horizon = HORIZON * deadline;
    let earliest = rows.earliest_arrival(index, t, x0, horizon).map_err(Error::from)?;
    let lost = rows.is_ruled_out(index, t, x0, deadline).map_err(Error::from)?;
    if let Some((found, earliest_at_most)) = plans {
        let deadline = match () {
            () if found => Verdict::CanBeMet,
            () if lost => Verdict::CannotBeMet,
            () => Verdict::NotKnown,
        };
        let (earliest_at_most, by_loop) = sooner(earliest_at_most);
        return Ok(ReachReport {
            deadline,
            earliest_at_least: earliest,
            earliest_at_most,
            by_plan: true,
            by_loop,
        });
    }
    let keeps = |deadline: f64| {
        let mut tried = c.clone();
        tried.barrier[index].deadline = Some(deadline);
        tried.barrier[index].when_infeasible = punctual_fmu::configuration::InfeasibleName::Report;
        let mut filter = tried.build()?;
        Ok::<_, Error>(run(c, &mut filter, (x0, wanted), &deadlines(&tried))?.kept)
    };
    // The search goes upwards from a deadline that is not ruled out, since the longest deadlines give the
    // longest runs. A deadline lies after the beginning of its barrier, and not after its end.
    let section = &c.barrier[index];
    let begin = section.begin.filter(|_| section.after.is_none()).unwrap_or(0.0);
    let end = section.end.filter(|end| *end > 0.0 && section.after.is_none()).unwrap_or(f64::INFINITY);
    let horizon = horizon.min(end);
    let mut low = earliest.unwrap_or(0.0).max(begin + 1e-3 * (deadline - begin)).min(horizon);
    let mut most = None;
    while low < horizon {
        let high = (2.0 * low).min(horizon);
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
    let (most, by_loop) = sooner(most);
    Ok(ReachReport {
        deadline: verdict,
        earliest_at_least: earliest,
        earliest_at_most: most,
        by_plan: false,
        by_loop,
    })
}

fn named(profile: ProfileKind) -> ProfileName {
    match profile {
        ProfileKind::Hermite => ProfileName::Hermite,
        ProfileKind::LowPeak => ProfileName::LowPeak,
    }
}

/// A bound in m/s², rounded as in the lines to paste. The rounded bound is tried, since below the peak a
/// slightly larger bound can be worse.
fn written(bound: f64) -> f64 {
    (bound * 1e3).ceil() / 1e3
}

/// Rates the candidates of [`effort`] from `x0`, by the bounds on the inputs that are accelerations. The
/// other inputs keep their bounds.
pub(super) fn ratings(
    c: &FilterConfiguration,
    x0: &[f64],
    wanted: &Wanted,
) -> Result<Vec<RatingReport>, Error> {
    // The configuration of a candidate under a bound.
    let driven: Vec<usize> =
        c.plant.inputs().iter().enumerate().filter(|(_, s)| s.unit == "m/s2").map(|(i, _)| i).collect();
    let configured = |candidate: &Candidate, bound: f64| {
        let mut tried = c.clone();
        for section in &mut tried.barrier {
            let Some(deadline) = section.deadline else { continue };
            section.rates.clear();
            section.rate = Automatic(candidate.rate_times_deadline / deadline);
            section.method = MethodName::ReferenceProfile;
            section.profile = named(candidate.profile);
        }
        for &i in &driven {
            let limit = written(bound).min(UNBOUNDED);
            tried.bounds.insert(c.plant.inputs()[i].name.clone(), [-limit, limit]);
        }
        tried
    };
    // Run each candidate.
    let try_out = |candidate: &Candidate, bound: f64| {
        let tried = configured(candidate, bound);
        let mut filter = tried.build()?;
        let run = run(&tried, &mut filter, (x0, wanted), &deadlines(&tried))?;
        Ok::<_, Error>((run.kept, driven.iter().map(|&i| run.peak[i]).fold(0.0, f64::max)))
    };
    let ratings = effort::compare(&CANDIDATES, try_out)?;
    // Write the lines to paste.
    let lines = |candidate: &Candidate, bound: Option<f64>| {
        let mut lines: Vec<String> = Vec::new();
        for section in &c.barrier {
            // A barrier without a deadline has nothing to paste.
            let Some(deadline) = section.deadline else { continue };
            let rate = candidate.rate_times_deadline / deadline;
            let profile = named(candidate.profile).name();
            let method = match section.method {
                MethodName::ReferenceProfile => "",
                MethodName::RepeatedRoot => "method = \"reference_profile\"\n",
            };
            lines.push(format!(
                "# in [[barrier]] {}\n{method}profile = \"{profile}\"\nrate = {rate:?}",
                section.name
            ));
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
            profile: named(r.candidate.profile).name(),
            rate_times_deadline: r.candidate.rate_times_deadline,
            peak: r.peak,
            smallest_bound: r.bound.map(written),
            settings: lines(&r.candidate, r.bound),
        })
        .collect())
}

/// The ratings as a table, and the best one as lines to paste.
pub(super) fn ratings_text(ratings: &[RatingReport], wanted: &str) -> String {
    let head = ["profile", "rate times deadline", "peak m/s2", "smallest bound m/s2"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    let shown = |value: Option<f64>| value.map_or_else(|| "deadline lost".to_owned(), number);
    rows.extend(ratings.iter().map(|r| {
        vec![r.profile.to_owned(), number(r.rate_times_deadline), shown(r.peak), shown(r.smallest_bound)]
    }));
    let table = output::table(&rows, &[false, true, true, true]);
    let head = format!(
        "effort, simulated with {wanted}; below the peak steps are infeasible and nothing is guaranteed"
    );
    match ratings.first().filter(|best| best.smallest_bound.is_some()) {
        Some(best) => format!("\n{head}\n{table}\n\n{}", best.settings),
        None => format!("\n{head}\n{table}"),
    }
}
