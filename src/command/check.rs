//! `punctual check`: findings on a configuration before it is built.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use punctual_core::elementary;
use punctual_core::filter::{BarrierSettings, Filter, Method, Phase, Refusal};
use punctual_cosim::coupling::Kept;
use punctual_cosim::error::Error;
use punctual_cosim::package;
use punctual_fmu::configuration::{
    Configuration, ControllerConfiguration, FilterConfiguration, PlantConfiguration, SamplingName,
    VariableSection,
};
use serde::Serialize;

use super::backup_plan::{self, BackupPlanReport};
use super::closed_loop::{self, LoopReport, RatingReport, ReachReport, Verdict, Wanted};
use super::map::{self, MapReport, Plane};
use super::robustness::RobustnessReport;
use crate::output::{self, number};

/// Round-off of h at a start on the boundary, in the unit of h.
const ROUND_OFF: f64 = 1e-12;

/// Arguments of `punctual check`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The configuration file (TOML): `kind = "filter"`, `"plant"` or `"controller"`
    configuration: PathBuf,
    /// Also check the filter from the start of this plant configuration
    #[arg(long, value_name = "FILE", conflicts_with = "x0")]
    plant: Option<PathBuf>,
    /// Also check the filter from this start, such as "x_p=1,v=-2" or "goal.lf0=-9"; states not named are as in the file's
    /// `x0`, or 0
    #[arg(long, value_name = "STATE", allow_hyphen_values = true)]
    x0: Option<String>,
    /// The u_ref of the closed loop that is simulated from the start: "none" (0), "damping" (the vehicles by name),
    /// or constants such as "a=0.5,omega=0" [default: the file's `u_ref`, or none]
    #[arg(long, value_name = "WHAT", allow_hyphen_values = true)]
    u_ref: Option<String>,
    /// Also find the profile and rate that need the smallest bound on the accelerations from the start
    #[arg(long)]
    effort: bool,
    /// Draw which starts can be promised, over two states: "x_p=-5..25,y_p=-5..15"; the others are as in the start, or 0
    #[arg(long, value_name = "RANGES", allow_hyphen_values = true)]
    map: Option<String>,
    /// Starts along each side of --map
    #[arg(long, value_name = "NUMBER", default_value_t = 25, requires = "map", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=1000))]
    cells: usize,
    /// The folder for the pictures of the plan and of --map
    #[arg(
        long,
        value_name = "FOLDER",
        default_value_if("map", clap::builder::ArgPredicate::IsPresent, "out")
    )]
    out: Option<PathBuf>,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
}

/// The report on a filter.
#[derive(Serialize)]
struct FilterReport {
    kind: &'static str,
    name: String,
    model: &'static str,
    /// Communication step in s.
    step: f64,
    /// Why the filter follows no plans; `null` if it does.
    no_plans: Option<String>,
    /// For which plants plans keep the promises; empty if for the model alone.
    covers: Vec<String>,
    /// However which points move.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    covers_points: Vec<String>,
    barriers: Vec<BarrierReport>,
    /// The start given, by state.
    start: Option<Vec<(String, f64)>>,
    /// Status of the first sample from there.
    status: Option<&'static str>,
    warnings: Vec<String>,
    /// The closed loop from the start, if the plant is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    closed_loop: Option<LoopReport>,
    /// The same with damping, if the plant supports it and it was not requested, and the run without it does
    /// not keep every promise.
    #[serde(skip_serializing_if = "Option::is_none")]
    with_damping: Option<LoopReport>,
    /// The backup plan that keeps every promise whatever u_ref is, if every input has bounds.
    #[serde(skip_serializing_if = "Option::is_none")]
    backup_plan: Option<BackupPlanReport>,
    /// The starts that can be promised, if requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    map: Option<MapReport>,
    /// Inputs that profiles and rates require, the best first.
    #[serde(skip_serializing_if = "Option::is_none")]
    effort: Option<Vec<RatingReport>>,
    /// What a plan bears of a plant that is not the model, if nothing is declared of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    robustness: Option<RobustnessReport>,
}

#[derive(Serialize)]
struct BarrierReport {
    name: String,
    shape: &'static str,
    /// Unit of h.
    unit: String,
    /// The order of the derivative that the row constrains.
    relative_degree: usize,
    /// If inputs enter at different orders, so that only plans use all of them: the orders found.
    #[serde(skip_serializing_if = "Option::is_none")]
    mixed_degree: Option<String>,
    method: &'static str,
    /// In s; `null` for a barrier without a deadline, which must be kept.
    deadline: Option<f64>,
    /// In 1/s; `null` without a start if the rate is chosen there.
    rate: Option<f64>,
    rate_times_deadline: Option<f64>,
    /// In 1/s; `null` if it is chosen at the start.
    stay_rate: Option<f64>,
    /// Whether the stay rate is chosen anew at every sample; the value is then that of the first sample.
    #[serde(skip)]
    chosen: bool,
    margin: f64,
    /// What the margin is without the cost of held inputs, if that is the default.
    #[serde(skip)]
    default_margin: Option<f64>,
    start: Option<StartReport>,
}

#[derive(Serialize)]
struct StartReport {
    h: f64,
    inside: bool,
    /// Whether nothing contradicts the promise: a plan keeps it or, if the filter follows none, the first
    /// step and the closed loop do.
    promised: bool,
    /// Whether the filter follows plans and has one that keeps this promise, whatever u_ref is.
    guaranteed: bool,
    /// Time in s until which the guarantee holds, if the plan ends in motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    guaranteed_until: Option<f64>,
    /// Whether the theorem applies to the first step.
    on_course: bool,
    /// Verdict of the closed loop, if the plant is known.
    simulated: Option<Kept>,
    /// Limits set by the input bounds, if any.
    reach: Option<ReachReport>,
}

impl StartReport {
    /// The findings on the first step and the closed loop, as text.
    fn words(&self) -> String {
        match (self.on_course, self.simulated) {
            (_, Some(Kept::LetGo)) => "let go: another alternative is taken",
            _ if self.guaranteed => {
                let until =
                    self.guaranteed_until.map(|until| format!(" until {} s", output::number_below(until)));
                return format!("guaranteed{}, whatever u_ref is", until.unwrap_or_default());
            }
            (true, Some(Kept::Kept)) => "on course, and the closed loop keeps it",
            (true, None) => "on course at the first step; without a model nothing is simulated",
            (_, Some(Kept::NothingPromised)) => "nothing is promised without a deadline",
            (true, Some(_)) => "on course at the first step, but the closed loop does not keep it",
            (false, Some(Kept::Kept)) => "not on course, though the closed loop keeps it",
            (false, _) => "not on course",
        }
        .to_owned()
    }
}

/// The report on a plant.
#[derive(Serialize)]
struct PlantReport {
    kind: &'static str,
    name: String,
    model: &'static str,
    states: Vec<SignalReport>,
    inputs: Vec<SignalReport>,
    /// Communication step in s.
    step: f64,
    /// Number of Runge-Kutta steps in it.
    substeps: u64,
    /// Their length in s.
    inner_step: f64,
}

/// The report on a controller.
#[derive(Serialize)]
struct ControllerReport {
    kind: &'static str,
    name: String,
    model: &'static str,
    controller: &'static str,
    parameters: Vec<ParameterReport>,
    /// Communication step in s.
    step: f64,
}

#[derive(Serialize)]
struct ParameterReport {
    name: String,
    value: f64,
    unit: String,
    description: String,
}

#[derive(Serialize)]
struct SignalReport {
    name: String,
    unit: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    start: Option<f64>,
    description: String,
}

/// Checks the configuration. With a start, the exit code is 1 if the filter gives no guarantee.
///
/// # Errors
///
/// A configuration or start that cannot be used.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let file = &arguments.configuration;
    let configuration = super::read(file)?;
    let started = arguments.plant.is_some() || arguments.x0.is_some();
    if started && !matches!(configuration, Configuration::Filter(_)) {
        let message = format!("is a {}; --plant and --x0 give a start to a filter", configuration.kind());
        return Err(Error::configuration("kind", message).in_file(file));
    }
    match configuration {
        Configuration::Filter(configuration) => {
            let start = start(arguments, &configuration)?;
            if arguments.effort && start.is_none() {
                let message = "needs a start: give --plant, --x0, or [x0] in the file";
                return Err(Error::configuration("--effort", message));
            }
            if let Some(barrier) = configuration.external().filter(|_| arguments.effort) {
                let message = format!("simulates, but barrier {} is external: it has no model", barrier.name);
                return Err(Error::configuration("--effort", message));
            }
            // Simulate and judge. Findings on a start refer to the state at which the filter is armed.
            let arm_after = configuration.arm_after;
            let configuration = configuration.armed_at_once();
            let wanted = Wanted::parse(arguments.u_ref.as_deref(), &configuration)?;
            let effort = match &start {
                Some(x0) if arguments.effort => {
                    Some(closed_loop::ratings(&configuration, x0, &wanted).map_err(|e| e.in_file(file))?)
                }
                _ => None,
            };
            let plane = arguments
                .map
                .as_ref()
                .map(|text| Plane::parse(text, arguments.cells, &configuration))
                .transpose()?;
            let out = arguments.out.as_deref();
            let zeros = || vec![0.0; measured(&configuration).len()];
            let from = start.clone().unwrap_or_else(zeros);
            let mut report =
                filter(&configuration, start, &wanted, out, arm_after).map_err(|e| e.in_file(file))?;
            report.effort = effort;
            if let (Some(plane), Some(folder)) = (plane, out) {
                report.map =
                    Some(map::starts(&configuration, &configuration.measured(&from), &plane, folder)?);
            }
            // Report, and determine the exit code.
            if arguments.json {
                output::json(&report);
            } else {
                output::result(&filter_text(&report));
            }
            let mut starts = report.barriers.iter().filter_map(|b| b.start.as_ref());
            let lost = |s: &StartReport| s.reach.as_ref().is_some_and(|r| r.deadline == Verdict::CannotBeMet);
            let kept = report.closed_loop.as_ref().is_none_or(|run| run.kept || run.by_rows);
            let promised = kept && starts.all(|start| start.promised && !lost(start));
            Ok(if promised { ExitCode::SUCCESS } else { ExitCode::FAILURE })
        }
        Configuration::Controller(configuration) => {
            let report = controller(&configuration);
            if arguments.json {
                output::json(&report);
            } else {
                output::result(&controller_text(&report));
            }
            Ok(ExitCode::SUCCESS)
        }
        Configuration::Plant(configuration) => {
            let report = plant(&configuration);
            if arguments.json {
                output::json(&report);
            } else {
                output::result(&plant_text(&report));
            }
            Ok(ExitCode::SUCCESS)
        }
    }
}

/// The start that the arguments give, in the order of [`measured`].
fn start(arguments: &Arguments, configuration: &FilterConfiguration) -> Result<Option<Vec<f64>>, Error> {
    let mut x0 = vec![0.0; configuration.plant.states().len()];
    x0.extend(configuration.barrier_inputs().iter().map(|input| input.start));
    // The start of a plant's configuration.
    if let Some(file) = &arguments.plant {
        if let Some(barrier) = configuration.external() {
            let name = &barrier.name;
            let message = format!(
                "is a start of the states, but barrier {name} is external: give its derivatives, as --x0 \"{name}.lf0=-1\""
            );
            return Err(Error::configuration("--plant", message));
        }
        let plant = match package::read_configuration(file)? {
            Configuration::Plant(plant) => plant,
            other => {
                let message = format!("is {:?}, must be \"plant\"", other.kind());
                return Err(Error::configuration("kind", message).in_file(file));
            }
        };
        let states = configuration.measured_states();
        let missing = states.iter().find(|s| !plant.x0.contains_key(&s.name));
        return match missing {
            Some(state) => {
                let message = format!("has no state {}, which the filter measures", state.name);
                Err(Error::configuration("plant.model", message).in_file(file))
            }
            None => {
                // A state that the filter integrates itself starts at 0.
                let all = configuration.plant.states();
                x0.iter_mut().zip(all).for_each(|(x, s)| *x = plant.x0.get(&s.name).copied().unwrap_or(0.0));
                Ok(Some(x0))
            }
        };
    }
    // The start in the file, and that of `--x0`.
    let own = &configuration.run.x0;
    for (x, state) in x0.iter_mut().zip(configuration.plant.states()) {
        *x = own.get(&state.name).copied().unwrap_or(*x);
    }
    let Some(text) = &arguments.x0 else {
        let is_given = !own.is_empty() && configuration.external().is_none();
        return Ok(is_given.then_some(x0));
    };
    let refuse = |message: String| Error::configuration("--x0", message);
    let names = measured(configuration);
    for part in text.split(',').map(str::trim).filter(|part| !part.is_empty()) {
        let (name, value) =
            part.split_once('=').ok_or_else(|| refuse(format!("is {part:?}, must be like {:?}", "v=1.5")))?;
        let Some(index) = names.iter().position(|n| n == name.trim()) else {
            return Err(refuse(format!(
                "{:?} is not a state, must be one of {}",
                name.trim(),
                names.join(", ")
            )));
        };
        let value = value.trim().parse().ok().filter(|v: &f64| v.is_finite());
        x0[index] = value.ok_or_else(|| refuse(format!("is {part:?}, must be a finite number")))?;
    }
    Ok(Some(x0))
}

/// The inputs that the filter measures: the states, then the inputs of its barriers.
fn measured(c: &FilterConfiguration) -> Vec<String> {
    let states = c.plant.states().into_iter().map(|s| s.name);
    states.chain(c.barrier_inputs().into_iter().map(|input| input.name)).collect()
}

fn filter(
    c: &FilterConfiguration,
    start: Option<Vec<f64>>,
    wanted: &Wanted,
    out: Option<&Path>,
    arm_after: f64,
) -> Result<FilterReport, Error> {
    let mut filter = closed_loop::filter(c)?;
    // The first step from the start, then the closed loops.
    let status = start.as_deref().map(|x0| first_sample(&mut filter, c, x0)).transpose()?;
    // Rates and methods are those of the rows, even if the filter follows plans.
    let rows = first_rows(c, start.as_deref())?;
    // A filter without a model is not simulated.
    let simulated = start.as_deref().filter(|_| c.external().is_none());
    let closed_loop = simulated.map(|x0| closed_loop::watch(c, x0, wanted)).transpose()?;
    let failed = closed_loop.as_ref().is_some_and(|run| !run.kept);
    // Where an uncertain plant is refused, damping keeps no promise either.
    let is_uncertain = c.is_assured() && (c.uncertainty.is_some() || !c.measurement_errors.is_empty());
    let damped = simulated
        .filter(|_| failed && !is_uncertain && matches!(wanted, Wanted::None) && closed_loop::has_damping(c));
    let with_damping = damped.map(|x0| closed_loop::watch(c, x0, &Wanted::Damping)).transpose()?;
    let backup_plan =
        simulated.map(|x0| backup_plan::find(c, x0, closed_loop.as_ref(), out)).transpose()?.flatten();
    let bears = backup_plan.as_ref().filter(|_| c.is_assured()).and_then(|plan| plan.bears.as_ref());
    let robustness = bears.map(|bears| RobustnessReport::new(c, bears));
    let (step, experiment) = (c.experiment.step_size, c.experiment);
    let mut warnings = Configuration::Filter(c.clone()).in_degrees();
    let runs_for = experiment.stop_time - experiment.start_time;
    if arm_after > 0.0 {
        let seconds = number(arm_after);
        warnings.push(format!(
            "the filter is armed {seconds} s after its first step: until then nothing is promised; statements about a start refer to \
             the state at that time"
        ));
    }
    if arm_after >= runs_for {
        warnings.push("the experiment stops before the filter is armed".to_owned());
    }
    if closed_loop.is_some() {
        warnings.extend(differences_from_run(c));
    }
    if !c.is_assured() {
        warnings.extend(disjoint_pairs(c));
    }
    let degrees: Vec<usize> = filter.relative_degrees().collect();
    let (mixed_degree, inputs) = (c.mixed_degree(), c.plant.inputs());
    let mut barriers = Vec::new();
    // Each barrier with its settings, given or chosen.
    for (i, section) in c.barrier.iter().enumerate() {
        let (name, unit) = (&section.name, section.unit(&c.plant));
        let settings = section.settings().map_err(|e| Error::configuration(e.field(), e.message()))?;
        let deadline = settings.deadline.unwrap_or(f64::INFINITY);
        let default_rate = settings.deadline.map(|deadline| BarrierSettings::default_rate(deadline, step));
        let begun = start.is_some();
        let promise = begun.then(|| rows.state().barriers[i]);
        let approaching = begun && rows.report().barriers[i].phase == Phase::Approach;
        let (method, rate) = match settings.method {
            Method::ReferenceProfile if settings.rates.is_some() => ("reference profile, rates given", None),
            Method::ReferenceProfile if deadline.is_infinite() => {
                ("kept inside", settings.rate.or(promise.map(|p| p.stay_rate)))
            }
            Method::ReferenceProfile => ("reference profile", settings.rate.or(default_rate)),
            Method::RepeatedRoot => ("repeated root", approaching.then(|| rows.state().barriers[i].rate)),
            _ => ("another method", None),
        };
        let given = settings.stay_rate.or(settings.rate);
        let kept = promise.filter(|p| p.phase == Phase::Stay || deadline.is_infinite()).map(|p| p.stay_rate);
        let stay_rate = given.or(kept).or(default_rate);
        let margin = if begun { filter.report().barriers[i].margin } else { settings.margin };
        let mut warn = |text: String| warnings.push(format!("{name}: {text}"));
        // Warnings on the settings.
        if c.sampling == SamplingName::Pointwise && margin == 0.0 {
            warn(format!(
                "the margin is 0, so that an input held over {} s can cost the deadline",
                number(step)
            ));
        }
        for (which, rate) in [("rate", rate), ("stay_rate", stay_rate)] {
            let Some(rate) = rate.filter(|rate| rate * step > 1.0) else { continue };
            warn(format!(
                "{which} times step is {}, more than 1: the error changes faster than the input",
                number(rate * step)
            ));
        }
        if deadline < step {
            warn(format!("the deadline is shorter than the step of {} s", number(step)));
        }
        if deadline.is_finite() && arm_after < runs_for && runs_for - arm_after < deadline {
            warn("the experiment stops before the deadline".to_owned());
        }
        let mixed_degree = mixed_degree.iter().find(|(barrier, _)| *barrier == i).map(|(_, found)| found);
        method_warnings(c, &rows, i, mixed_degree.is_some()).into_iter().for_each(&mut warn);
        // Findings from the start.
        let report = begun.then(|| filter.report().barriers[i]);
        let reach = match (simulated, settings.deadline) {
            (Some(x0), Some(deadline)) if c.is_bounded() => {
                let plans = backup_plan.as_ref().filter(|_| c.is_assured());
                let plans = plans.map(|w| (w.keeps(name), w.earliest_deadline(name)));
                let run = closed_loop.as_ref().filter(|run| !run.by_rows && c.run.simulated.is_none());
                let arrival = run.and_then(|run| run.arrival(i, experiment.start_time));
                Some(closed_loop::reach((c, &rows), (i, deadline), (x0, wanted), plans, arrival)?)
            }
            _ => None,
        };
        let simulated = closed_loop.as_ref().map(|run| run.barriers[i].promise);
        let planned = backup_plan.as_ref().filter(|backup_plan| c.is_assured() && backup_plan.covers(name));
        // Another alternative is taken.
        let is_let_go = simulated == Some(Kept::LetGo);
        let guaranteed = !is_let_go && planned.is_some_and(|backup_plan| backup_plan.keeps(name));
        let start = report.map(|b| StartReport {
            h: b.h,
            inside: b.h >= -ROUND_OFF,
            promised: match planned {
                Some(_) => guaranteed || is_let_go,
                None => b.on_course && simulated.is_none_or(Kept::is_done),
            },
            guaranteed,
            guaranteed_until: backup_plan.as_ref().filter(|_| guaranteed).and_then(BackupPlanReport::until),
            on_course: b.on_course,
            simulated,
            reach,
        });
        if start.as_ref().is_some_and(|s| !s.inside && deadline.is_infinite() && !s.guaranteed) {
            warn(
                "outside at the start and without a deadline: nothing is promised; give it a deadline"
                    .to_owned(),
            );
        } else if start.as_ref().is_some_and(|s| !s.promised) {
            warn("not to be relied on from this start".to_owned());
        }
        let refused = start.as_ref().is_some_and(|s| s.inside && !s.promised && deadline.is_finite());
        if refused && section.begin.is_none() && section.after.is_none() && c.barrier.len() > 1 {
            warn(
                "contains the start, so it must be kept from the first step on, and not from its deadline: did you mean `begin`?"
                    .to_owned(),
            );
        }
        barriers.push(BarrierReport {
            name: name.clone(),
            shape: section.shape.name(),
            unit,
            relative_degree: degrees[i],
            mixed_degree: mixed_degree.map(|found| found.describe(|input| inputs[input].name.clone())),
            method,
            deadline: settings.deadline,
            rate,
            rate_times_deadline: rate.zip(settings.deadline).map(|(rate, deadline)| rate * deadline),
            stay_rate,
            chosen: given.is_none() && kept.is_some(),
            margin,
            default_margin: (!section.margin_given.0).then_some(section.margin),
            start,
        });
    }
    warnings.extend(closed_loop.iter().flat_map(loop_warnings));
    Ok(FilterReport {
        kind: "filter",
        name: c.name.clone(),
        model: c.plant.name(),
        step,
        no_plans: (!c.is_assured()).then(|| c.unassured()),
        covers: if c.is_assured() { c.covered() } else { Vec::new() },
        covers_points: if c.is_assured() { c.covered_points() } else { Vec::new() },
        barriers,
        start: start.map(|x0| measured(c).into_iter().zip(x0).collect()),
        status,
        warnings,
        closed_loop,
        with_damping,
        backup_plan,
        map: None,
        effort: None,
        robustness,
    })
}

/// The filter of the rows, after its first sample from the start if there is one.
fn first_rows(c: &FilterConfiguration, start: Option<&[f64]>) -> Result<Filter, Error> {
    let mut rows = c.build()?;
    start.map(|x0| first_sample(&mut rows, c, x0)).transpose()?;
    Ok(rows)
}

/// Warnings on the method of barrier `i` from the first sample of `rows`. `mixed_degree` says that its inputs
/// enter at different orders.
fn method_warnings(c: &FilterConfiguration, rows: &Filter, i: usize, mixed_degree: bool) -> Vec<String> {
    let mut warnings = Vec::new();
    if mixed_degree && !c.is_assured() {
        let reason = c.unassured();
        warnings.push(format!(
            "inputs enter h at different orders, and without plans only the first is used: {reason}"
        ));
    }
    warnings.extend(rows.refusal(i).map(|reason| match reason {
        Refusal::NoAdmissibleRate(_) => format!("{reason}; the stay rate is used instead, without a promise"),
        Refusal::Profile(_) => format!("{reason}; the Hermite profile is used instead"),
        _ => reason.to_string(),
    }));
    let (promise, section) = (rows.state().barriers[i], &c.barrier[i]);
    let is_root = section.settings().is_ok_and(|settings| settings.method == Method::RepeatedRoot);
    let is_used = is_root && rows.report().barriers[i].phase == Phase::Approach && rows.refusal(i).is_none();
    if let Some(deadline) = section.deadline.filter(|_| is_used && promise.rate < 0.0) {
        warnings.push(format!(
            "the repeated root is negative: errors grow by a factor of {} until the deadline",
            number(elementary::exp(-promise.rate * deadline))
        ));
    }
    warnings
}

/// How the closed loops of `check` differ from the run that the file describes.
fn differences_from_run(c: &FilterConfiguration) -> Vec<String> {
    let simulated = c.run.simulated.as_ref().map(|_| match closed_loop::simulated(c) {
        Some(_) => "the closed loop has the plant in `simulated`; plans and deadlines are those of the filter's own model",
        None => {
            "the closed loop has the filter's own model, since `simulated` has other states or inputs, and not the file's u_ref; \
             `punctual run` has both"
        }
    });
    let disturbed =
        c.run.disturbance.as_ref().map(|_| "the closed loop leaves `disturbance` out; `punctual run` has it");
    simulated.into_iter().chain(disturbed).map(str::to_owned).collect()
}

/// Pairs of barriers that both must hold forever although their sets do not intersect.
fn disjoint_pairs(c: &FilterConfiguration) -> Vec<String> {
    let is_kept = |i: &usize| {
        let b = &c.barrier[*i];
        b.penalty.is_none() && b.end.is_none() && !b.until_arrival
    };
    let pairs = c.apart().into_iter().filter(|pair| pair.iter().all(is_kept));
    pairs
        .filter_map(|pair| c.apart_in_words(pair))
        .map(|words| format!("{words}, and neither is ever released"))
        .collect()
}

/// What the user should know of the filter before a run of the file, prefixed with the barrier's name. If the
/// promise was `refused`, this includes the deadlines with which there is a plan.
pub(super) fn notes_before_run(c: &FilterConfiguration, refused: bool) -> Result<Vec<String>, Error> {
    let mut x0 = vec![0.0; c.plant.states().len()];
    let (plant, _) = c.alone()?;
    x0.iter_mut().zip(c.plant.states()).for_each(|(x, s)| *x = plant.x0.get(&s.name).copied().unwrap_or(0.0));
    x0.extend(c.barrier_inputs().iter().map(|input| input.start));
    let c = &c.clone().armed_at_once();
    let (mixed_degree, mut known) =
        (c.mixed_degree(), if c.is_assured() { Vec::new() } else { disjoint_pairs(c) });
    if c.external().is_none() {
        let rows = first_rows(c, Some(&x0))?;
        for (i, section) in c.barrier.iter().enumerate() {
            let is_mixed = mixed_degree.iter().any(|(barrier, _)| *barrier == i);
            known.extend(
                method_warnings(c, &rows, i, is_mixed)
                    .into_iter()
                    .map(|text| format!("{}: {text}", section.name)),
            );
        }
    }
    if c.actuation_delay > 0.0 {
        let delay = number(c.actuation_delay);
        let is_model = c.run.simulated.is_none() && c.integrator.is_none();
        known.push(match is_model {
            true => format!("each input acts {delay} s after its sample, as actuation_delay says"),
            false => format!(
                "the plant that is simulated is not the filter's model, so that its inputs act at once, and not {delay} s late as \
                 actuation_delay says"
            ),
        });
    }
    if refused {
        known.extend(backup_plan::in_time(c, &x0)?);
    }
    Ok(known)
}

/// Warnings on a closed loop, apart from its promises.
fn loop_warnings(run: &LoopReport) -> Vec<String> {
    let unmet = run.barriers.iter().filter(|b| b.unmet > 0).map(|b| {
        let name = &b.name;
        let (steps, do_not) = if b.unmet == 1 { ("step", "does not") } else { ("steps", "do not") };
        format!(
            "{name}: {} {steps} of the closed loop {do_not} meet its constraint: no guarantee there",
            b.unmet
        )
    });
    let loose: Vec<_> = run.inputs.iter().filter(|input| input.bounds.is_none()).map(|i| i.words()).collect();
    let loose = (!loose.is_empty()).then(|| {
        format!(
            "the closed loop takes inputs without bounds: {}; give what the plant can do in [bounds]",
            loose.join(", ")
        )
    });
    unmet.chain(run.beyond.iter().map(|state| state.words())).chain(loose).collect()
}

/// Anchors the filter at `x0` with u_ref = 0, and returns the status in words.
fn first_sample(filter: &mut Filter, c: &FilterConfiguration, x0: &[f64]) -> Result<&'static str, Error> {
    let u_ref = vec![0.0; c.plant.inputs().len()];
    let mut u = u_ref.clone();
    let mut step = |filter: &mut Filter| {
        if filter.counts_holds() {
            filter.expect_hold(Some(c.experiment.step_size))?;
        }
        Ok(filter.step(c.experiment.start_time, x0, &u_ref, &mut u)?.status)
    };
    let status =
        step(filter).map_err(|e: punctual_core::Error| Error::configuration(e.field(), e.message()))?;
    Ok(status.name())
}

fn plant(c: &PlantConfiguration) -> PlantReport {
    let signal = |s: VariableSection, start| SignalReport {
        name: s.name,
        unit: s.unit,
        start,
        description: s.description,
    };
    let step = c.experiment.step_size;
    let substeps = c.integration.substeps(step);
    PlantReport {
        kind: "plant",
        name: c.name.clone(),
        model: c.plant.name(),
        states: c
            .plant
            .states()
            .into_iter()
            .map(|s| (c.x0.get(&s.name).copied(), s))
            .map(|(x0, s)| signal(s, x0))
            .collect(),
        inputs: c.plant.inputs().into_iter().map(|s| signal(s, None)).collect(),
        step,
        substeps: substeps as u64,
        inner_step: step / substeps,
    }
}

fn controller(c: &ControllerConfiguration) -> ControllerReport {
    let parameter = |row: punctual_fmu::configuration::Parameter<ControllerConfiguration>| ParameterReport {
        value: row.get(&mut c.clone()),
        name: row.name,
        unit: row.unit.into_owned(),
        description: row.description,
    };
    ControllerReport {
        kind: "controller",
        name: c.name.clone(),
        model: c.plant.name(),
        controller: c.controller.name(),
        parameters: c.parameters().into_iter().map(parameter).collect(),
        step: c.experiment.step_size,
    }
}

fn filter_text(report: &FilterReport) -> String {
    let mut lines =
        vec![format!("{}: filter for {}, steps of {} s", report.name, report.model, number(report.step))];
    lines.push(match &report.no_plans {
        None => "plans: followed, so that what is promised is kept whatever u_ref is".to_owned(),
        Some(reason) => format!("plans: none, since {reason}"),
    });
    if report.no_plans.is_none() {
        lines.push(match &report.covers[..] {
            [] => "assumes: the plant is the model, measured exactly, without delay; declare [uncertainty] otherwise"
                .to_owned(),
            covers => format!("covers: {}", covers.join("; ")),
        });
        if !report.covers_points.is_empty() {
            lines.push(format!("beside it: {}", report.covers_points.join("; ")));
        }
    }
    if let Some(start) = &report.start {
        let state: Vec<_> =
            start.iter().map(|(name, value)| format!("{name} = {}", number(*value))).collect();
        lines.push(format!("start: {}", state.join(", ")));
    } else {
        lines.push("start: none; give `x0` in the file or --x0 to examine closed loop and plans".to_owned());
    }
    if let Some(status) = &report.status {
        lines.push(format!("first step with u_ref = 0: {status}"));
    }
    // Each barrier as a table.
    for b in &report.barriers {
        lines.push(format!("\n{} ({})", b.name, b.shape));
        let rate = match (b.rate, b.rate_times_deadline) {
            (Some(rate), Some(product)) => {
                format!("{} 1/s, times the deadline {}", number(rate), number(product))
            }
            (Some(rate), None) => format!("{} 1/s", number(rate)),
            _ => "chosen at the start".to_owned(),
        };
        let stay_rate =
            b.stay_rate.map_or_else(|| "chosen at the start".to_owned(), |r| format!("{} 1/s", number(r)));
        let anew = |rate: String, is: bool| {
            if is { format!("{rate} at the start, chosen at every sample") } else { rate }
        };
        let (rate, stay_rate) = (anew(rate, b.chosen && b.deadline.is_none()), anew(stay_rate, b.chosen));
        let deadline =
            b.deadline.map_or_else(|| "none: kept at all times".to_owned(), |d| format!("{} s", number(d)));
        let margin = output::quantity(b.margin, &b.unit);
        let margin = match b.default_margin.map(|default| output::quantity(default, &b.unit)) {
            Some(default) if default == margin => format!("{margin} (default)"),
            Some(default) => format!("{margin} (default {default})"),
            None => margin,
        };
        let mut rows = vec![
            ("relative degree", b.relative_degree.to_string()),
            ("method", b.method.to_owned()),
            ("deadline", deadline),
            ("rate", rate),
            ("stay rate", stay_rate),
            ("margin", margin),
        ];
        if let Some(found) = &b.mixed_degree {
            let found = found.strip_prefix("is ").unwrap_or(found);
            rows.insert(1, ("", format!("{found}; the row moves what enters first, plans every input")));
        }
        if let Some(start) = &b.start {
            let side = if start.inside { "inside" } else { "outside" };
            let h = output::quantity(start.h, &b.unit);
            rows.push(("start", format!("{side}, h = {h}; {}", start.words())));
            rows.extend(start.reach.iter().flat_map(ReachReport::rows));
        }
        lines.extend(rows.into_iter().map(|(name, value)| format!("  {name:<16} {value}")));
    }
    // Findings on the filter as a whole.
    lines.extend(report.closed_loop.iter().map(LoopReport::text));
    if let Some(run) = &report.with_damping {
        lines.push(run.head());
    }
    lines.extend(report.backup_plan.iter().map(BackupPlanReport::text));
    lines.extend(report.robustness.iter().map(RobustnessReport::text));
    if let Some(map) = &report.map {
        let files = map.files.join("\n         ");
        lines.push(format!("\n{} of {} starts can be promised\nwritten: {files}", map.promised, map.of));
    }
    if let Some(ratings) = &report.effort {
        let wanted = report.closed_loop.as_ref().map_or("", |run| &run.u_ref);
        lines.push(closed_loop::ratings_text(ratings, wanted));
    }
    if !report.warnings.is_empty() {
        lines.push(String::new());
        let warnings = output::grouped(report.warnings.iter().cloned());
        lines.extend(warnings.iter().map(|warning| format!("warning: {warning}")));
    }
    lines.join("\n")
}

fn plant_text(report: &PlantReport) -> String {
    let mut rows = vec![["signal", "start", "unit", "meaning"].map(str::to_owned).to_vec()];
    for (prefix, signals) in [("x", &report.states), ("u", &report.inputs)] {
        rows.extend(signals.iter().map(|s| {
            let start = s.start.map(number).unwrap_or_default();
            let unit = output::shown_unit(&s.unit).to_owned();
            vec![format!("{prefix}.{}", s.name), start, unit, s.description.clone()]
        }));
    }
    format!(
        "{}: plant, {}\n\n{}\n\nsteps of {} s; Runge-Kutta steps in each: {}, of {} s",
        report.name,
        report.model,
        output::table(&rows, &[false, true]),
        number(report.step),
        report.substeps,
        number(report.inner_step)
    )
}

fn controller_text(report: &ControllerReport) -> String {
    let mut rows = vec![["parameter", "value", "unit", "meaning"].map(str::to_owned).to_vec()];
    rows.extend(report.parameters.iter().map(|p| {
        let unit = output::shown_unit(&p.unit).to_owned();
        vec![p.name.clone(), number(p.value), unit, p.description.clone()]
    }));
    format!(
        "{}: controller, {} of {}\n\n{}\n\nsteps of {} s; it promises nothing",
        report.name,
        report.controller,
        report.model,
        output::table(&rows, &[false, true]),
        number(report.step)
    )
}
