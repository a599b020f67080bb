//! Judges the promises of filters during a run, whether or not they are recorded. A filter is recognised by
//! the names of its outputs: `status`, and `<barrier>.h` with the others of [`FIELDS`].
//!
//! A promise is judged by h itself ([`punctual_core::judge`]), at the deadline and at the communication
//! points. If a filter's outputs are read a step late (Jacobi order, no direct feedthrough), h belongs to the
//! point before.

use punctual_core::filter::{AssuranceStatus, Phase, Status};
use punctual_core::judge::{Interpolation, Judge, Judgement, PromiseState, Verdict};
use punctual_fmu::configuration::over_seconds;
use serde::Serialize;

use super::layout::Layout;
use super::network::{self, Link, Port};
use super::system::{Order, System};
use crate::error::{Error, brief_time};
use crate::host::{Causality, Description, Family};

/// The outputs of a barrier that are read.
const FIELDS: [&str; 5] = ["unmet_steps", "slack", "h", "deadline_unreachable", "phase"];

/// The outputs of a filter that follows backup plans: one for the whole filter, one for each barrier.
const PLANS: &str = "assurance";
const GUARANTEED: &str = "guaranteed";

/// Verdicts on a promise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kept {
    /// On time, and inside from then on. If it began inside: inside from the start on.
    Kept,
    /// Late, or left.
    Broken,
    /// The run ended before a verdict.
    Open,
    /// It began outside and has no deadline.
    NothingPromised,
    /// It was let go before it began: another alternative was taken, or what it waited for was there.
    LetGo,
}

impl Kept {
    /// Whether nothing is left to be done: it was kept, or let go.
    pub fn is_done(self) -> bool {
        matches!(self, Self::Kept | Self::LetGo)
    }

    /// The verdict as text.
    pub fn words(self) -> &'static str {
        match self {
            Self::Kept => "kept",
            Self::Broken => "not kept",
            Self::Open => "open",
            Self::NothingPromised => "nothing promised",
            Self::LetGo => "let go",
        }
    }
}

/// The overall verdict on `promises` as a sentence; `None` if there are none.
pub fn verdict(promises: &[Promise]) -> Option<(Kept, String)> {
    let count = |verdict| promises.iter().filter(|p| p.promise == verdict).count();
    let (broken, kept) = (count(Kept::Broken), count(Kept::Kept));
    Some(match (broken, promises.len() - count(Kept::LetGo)) {
        (_, 0) => return None,
        (0, all) if kept == all => (Kept::Kept, "Every promise is kept.".to_owned()),
        (0, all) => (Kept::Open, format!("{kept} of {all} promises are kept, none is broken.")),
        (_, 1) => (Kept::Broken, "The promise is not kept.".to_owned()),
        (_, all) => (Kept::Broken, format!("{broken} of {all} promises are not kept.")),
    })
}

impl From<Verdict> for Kept {
    fn from(verdict: Verdict) -> Self {
        match verdict {
            Verdict::Kept => Self::Kept,
            Verdict::Broken => Self::Broken,
            Verdict::Open => Self::Open,
            Verdict::Nothing => Self::NothingPromised,
            Verdict::LetGo => Self::LetGo,
        }
    }
}

/// Findings on one barrier. Its promise is about h; its constraint is about single steps.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Promise {
    /// `component.barrier`.
    pub barrier: String,
    /// The verdict by h itself.
    pub promise: Kept,
    /// Whether every sample met the constraint.
    pub constraint_met: bool,
    /// The instant of its deadline in s; `None` without one.
    pub deadline: Option<f64>,
    /// Whether it began inside.
    pub began_inside: bool,
    /// Whether h ≥ 0 held by the deadline; without a deadline, at the start.
    pub on_time: bool,
    /// Whether h ≥ 0 held from the deadline on, or from the start on if it began inside.
    pub inside: bool,
    /// First time in s with h ≥ 0, interpolated between two samples if it lies there.
    pub arrival: Option<f64>,
    /// Time in s at which it became certain that the deadline would be missed.
    pub late: Option<f64>,
    /// By how many seconds it arrived after its deadline; infinite (`null` in JSON) if it was late and never
    /// arrived.
    pub late_by: Option<f64>,
    /// Time in s at which it was left after it had been inside and had to stay there.
    pub left: Option<f64>,
    /// Least h during the time in which it had to be inside.
    pub least_h: Option<f64>,
    /// Whether the filter found no plan at the start and so gave no guarantee.
    pub refused: bool,
    /// Whether a plan guaranteed it at every sample; `None` if the filter follows no plans.
    pub guaranteed: Option<bool>,
    /// Samples that did not meet the constraint, or had no valid input.
    pub unmet: u64,
    /// The longest run of such samples.
    pub longest: u64,
    /// The largest violation of the constraint over these samples, in the unit of its slack; 0 if there are
    /// none.
    pub violation: f64,
}

impl Promise {
    /// Whether the promise is kept and every sample met the constraint.
    pub fn kept(&self) -> bool {
        self.promise.is_done() && self.constraint_met
    }

    /// Takes over a judgement on h.
    fn judged(&mut self, seen: &Judgement) {
        self.promise = seen.verdict().into();
        (self.deadline, self.began_inside) = (seen.deadline, seen.began_inside);
        (self.on_time, self.inside) = (seen.on_time(), seen.inside());
        (self.arrival, self.late, self.left) = (seen.arrival, seen.late, seen.left);
        self.late_by = seen.late_by();
        self.least_h = seen.least;
    }
}

/// The outputs that a promise is judged by, and the facts known before a run.
pub(super) struct Ports {
    /// `component.barrier`.
    name: String,
    pub(super) status: Port,
    pub(super) fields: [Port; FIELDS.len()],
    /// [`PLANS`] and [`GUARANTEED`], if the filter follows plans.
    pub(super) plans: Option<[Port; 2]>,
    rearm: Option<Port>,
    /// The value reference of its deadline, and its start value in the description.
    deadline: Option<(u32, f64)>,
    interpolation: Interpolation,
    /// Whether h belongs to the communication point at which it is read.
    prompt: bool,
    /// The connected measured states; listed for the first barrier only.
    states: Vec<Port>,
}

/// A promise under observation.
#[derive(Debug)]
pub(super) struct Watched {
    pub(super) component: usize,
    /// The value reference of its deadline, and its start value in the description.
    pub(super) deadline: Option<(u32, f64)>,
    name: String,
    interpolation: Interpolation,
    prompt: bool,
    status: usize,
    rearm: Option<usize>,
    fields: [usize; FIELDS.len()],
    plans: Option<[usize; 2]>,
    states: Vec<usize>,
    /// The part of the state that changes during a run.
    run: Run,
}

#[derive(Clone, Debug)]
struct Run {
    judge: Judge,
    deadline: Option<f64>,
    /// The judgement before the last re-arming. A broken promise stays broken.
    before: Option<Judgement>,
    rearm: bool,
    started: bool,
    last: Option<f64>,
    unmet: u64,
    in_a_row: u64,
    longest: u64,
    violation: f64,
    refused: bool,
    guaranteed: Option<bool>,
    zeros: Zeros,
}

/// Detects a plant that outputs zeros before its first step: follows the measured state of a filter while all
/// of it is zero from the start on, and for two points after that.
#[derive(Clone, Debug, Default)]
struct Zeros {
    /// The first point, and the last one with zeros.
    first: Option<f64>,
    last: Option<f64>,
    /// Whether deadlines count from one of these points.
    counted: bool,
    /// The first point with a nonzero state, and that state; then how far it moved up to the next point.
    after: Option<(f64, Vec<f64>)>,
    moved: Option<f64>,
}

impl Zeros {
    /// The zeros did not come from the plant if the state jumps from them this many times as far as it moves
    /// in the next step.
    const JUMP: f64 = 10.0;

    /// Takes the state `x` at `time` (s), until its movement after the zeros is known. `is_valid` says
    /// whether deadlines can count from the sample; if outputs are read late, this is the sample of the point
    /// before.
    fn see(&mut self, time: f64, x: impl Iterator<Item = f64> + Clone, is_valid: bool, prompt: bool) {
        self.first.get_or_insert(time);
        match &self.after {
            None => {
                let is_zero = x.clone().all(|x| x == 0.0);
                self.counted |= is_valid && if prompt { is_zero } else { self.last.is_some() };
                if is_zero {
                    self.last = Some(time);
                } else {
                    self.after = Some((time, x.collect()));
                }
            }
            Some((_, before)) => {
                self.moved = Some(before.iter().zip(x).fold(0.0, |far, (a, b)| f64::max(far, (a - b).abs())));
            }
        }
    }

    /// A note on the filter `name` if its deadlines count from zeros that did not come from its plant.
    fn note(&self, name: &str) -> Option<String> {
        let (first, last, moved) = (self.first?, self.last?, self.moved?);
        let (time, x) = self.after.as_ref()?;
        let far = x.iter().fold(0.0, |far: f64, x| far.max(x.abs()));
        // NaN does not count as a jump.
        let jumps = self.counted && far > Self::JUMP * moved;
        jumps.then(|| {
            format!(
                "{name}: the state was all zero until t = {} s, and jumped then, as where a plant gives zeros before its \
                 first step; the deadlines count from t = {} s: with `arm_after = {}` in the filter, from the jump",
                brief_time(last),
                brief_time(first),
                brief_time(time - first),
            )
        })
    }
}

impl Run {
    fn new(deadline: Option<f64>, interpolation: Interpolation) -> Self {
        Self {
            judge: Judge::new(deadline, interpolation),
            deadline,
            before: None,
            rearm: false,
            started: false,
            last: None,
            unmet: 0,
            in_a_row: 0,
            longest: 0,
            violation: 0.0,
            refused: false,
            guaranteed: None,
            zeros: Zeros::default(),
        }
    }
}

/// The promises of all filters in `system`.
pub(super) fn ports(system: &System, descriptions: &[&Description], links: &[Link]) -> Vec<Ports> {
    let mut found = Vec::new();
    for (component, description) in descriptions.iter().enumerate() {
        let output = |name: &str| {
            let variable = description.index_of(name)?;
            let is_output = description.variables[variable].causality == Causality::Output;
            is_output.then_some(Port { component, variable })
        };
        let Some(status) = output("status") else { continue };
        let is_state = |port: &Port| is_of(&description.variables[port.variable].name, STATE);
        let connected = links.iter().map(|link| link.to).filter(|port| port.component == component);
        let mut states: Vec<_> = connected.filter(is_state).collect();
        for variable in &description.variables {
            let Some(barrier) = variable.name.strip_suffix(".unmet_steps") else { continue };
            let ports = FIELDS.map(|field| output(&format!("{barrier}.{field}")));
            let [Some(unmet), Some(slack), Some(h), Some(late), Some(phase)] = ports else { continue };
            let unit = |port: Port| description.variables[port.variable].unit.as_deref().unwrap_or("1");
            let straight = over_seconds(unit(h), 1) == unit(slack);
            let parameter = description.index_of(&format!("{barrier}.deadline"));
            let parameter = parameter.map(|i| &description.variables[i]);
            let owner = &system.components()[component];
            found.push(Ports {
                name: format!("{}.{barrier}", owner.name),
                status,
                fields: [unmet, slack, h, late, phase],
                plans: output(PLANS).zip(output(&format!("{barrier}.{GUARANTEED}"))).map(|(a, g)| [a, g]),
                rearm: description.index_of("rearm").map(|variable| Port { component, variable }),
                deadline: parameter.and_then(|v| Some((v.value_reference, v.start?))),
                interpolation: if straight { Interpolation::Straight } else { Interpolation::Smooth },
                prompt: system.experiment().order == Order::GaussSeidel
                    && network::has_feedthrough(owner, description, h.variable),
                states: std::mem::take(&mut states),
            });
        }
    }
    found
}

/// Whether the FMU is a filter.
pub(super) fn is_filter(description: &Description) -> bool {
    let promises = description.variables.iter().any(|v| v.name.ends_with(".unmet_steps"));
    promises && description.index_of("status").is_some()
}

/// The measured states of a filter.
const STATE: &str = "x";

/// The wanted inputs of a filter.
const WANTED: &str = "u_ref";

/// Whether a variable belongs to the group `all`, as `x.v` or as an array element `x[2]`.
pub(super) fn is_of(name: &str, all: &str) -> bool {
    name.strip_prefix(all).is_some_and(|rest| rest.starts_with(['.', '[']))
}

/// The Real inputs of `component` that have neither a connection nor a start value in the system file.
fn unfed<'a>(
    system: &System,
    component: usize,
    description: &'a Description,
    links: &[Link],
) -> Vec<(Port, &'a str)> {
    // A start value may be given for a whole array.
    let starts = &system.components()[component].start;
    let given = |variable: usize, name: &str| {
        let arrays = starts.keys().filter_map(|key| description.array(key));
        starts.contains_key(name)
            || arrays.into_iter().any(|array| (array.first..array.first + array.count).contains(&variable))
            || starts.keys().any(|key| description.index_of(key) == Some(variable))
    };
    let all = description.variables.iter().enumerate();
    let all = all.filter(|(_, v)| v.causality == Causality::Input && v.family() == Family::Real);
    let ports = all.map(|(variable, v)| (Port { component, variable }, v.name.as_str()));
    let unfed = |port: &Port| links.iter().all(|link| link.to != *port);
    ports.filter(|(port, name)| unfed(port) && !given(port.variable, name)).collect()
}

/// Refuses Real inputs that nothing feeds, which would silently stay at the FMU's start value. The wanted
/// inputs of a filter may be unfed, and so may inputs in `given`, whose values come from elsewhere.
///
/// # Errors
///
/// Unfed inputs, listed by component.
pub fn check_fed(
    system: &System,
    descriptions: &[&Description],
    links: &[Link],
    given: &[Port],
) -> Result<(), Error> {
    /// The most names in a message.
    const NAMES: usize = 8;
    for (component, description) in descriptions.iter().enumerate() {
        let mut unfed = unfed(system, component, description, links);
        let filter = is_filter(description);
        unfed.retain(|(port, name)| !(given.contains(port) || filter && is_of(name, WANTED)));
        let Some((_, first)) = unfed.first() else { continue };
        let names: Vec<_> = unfed.iter().take(NAMES).map(|(_, name)| *name).collect();
        let more = match unfed.len() - names.len() {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let message = format!(
            "nothing feeds {}{more} of {}: connect what moves (`[[connection]]`, or `[[connect_by_name]]` for equal \
             names), and give what stays the same its value here, as `start = {{ {first:?} = 0.0 }}`",
            names.join(", "),
            system.components()[component].name,
        );
        return Err(Error::configuration(format!("component[{component}]"), message));
    }
    Ok(())
}

/// Notes on filters none of whose wanted inputs is fed. An input with a start value in the system file is
/// meant to be constant.
pub(super) fn unwanted(system: &System, descriptions: &[&Description], links: &[Link]) -> Vec<String> {
    let mut notes = Vec::new();
    for (component, description) in descriptions.iter().enumerate().filter(|(_, d)| is_filter(d)) {
        let wanted = |name: &str| is_of(name, WANTED);
        let inputs = description.variables.iter().filter(|v| v.causality == Causality::Input);
        let count = inputs.filter(|v| wanted(&v.name)).count();
        let unfed = unfed(system, component, description, links);
        let unfed: Vec<_> = unfed.into_iter().map(|(_, name)| name).filter(|name| wanted(name)).collect();
        if !unfed.is_empty() && unfed.len() == count {
            notes.push(format!(
                "{}: nothing feeds {}: the wanted input is 0 at all times, and nothing damps the motion along the set; \
                 connect a controller, such as damping, or give a start value",
                system.components()[component].name,
                unfed.join(", ")
            ));
        }
    }
    notes
}

impl Watched {
    /// `None` if a port has no slot.
    pub(super) fn new(layout: &Layout, ports: &Ports) -> Option<Self> {
        let mut slots = [0; FIELDS.len()];
        for (slot, port) in slots.iter_mut().zip(&ports.fields) {
            *slot = layout.slot(*port)?;
        }
        Some(Self {
            component: ports.status.component,
            deadline: ports.deadline,
            name: ports.name.clone(),
            interpolation: ports.interpolation,
            prompt: ports.prompt,
            status: layout.slot(ports.status)?,
            rearm: ports.rearm.and_then(|port| layout.slot(port)),
            fields: slots,
            plans: match ports.plans {
                Some([plans, guaranteed]) => Some([layout.slot(plans)?, layout.slot(guaranteed)?]),
                None => None,
            },
            states: ports.states.iter().filter_map(|port| layout.slot(*port)).collect(),
            run: Run::new(None, ports.interpolation),
        })
    }

    /// Forgets the last run. `deadline` is that of the next run, in s after its first step. Returns a note if
    /// the deadline comes before the end of the first `step` (s).
    pub(super) fn reset(&mut self, deadline: Option<f64>, step: f64) -> Option<String> {
        self.run = Run::new(deadline, self.interpolation);
        let deadline = deadline.filter(|deadline| *deadline < step)?;
        Some(format!(
            "{}: the deadline of {deadline} s is shorter than the step of {step} s: nothing is measured until it is over",
            self.name
        ))
    }

    /// Evaluates the `values` of the communication point at `time` (s).
    pub(super) fn see(&mut self, time: f64, values: &[f64]) {
        let at = if self.prompt { Some(time) } else { self.run.last };
        let [unmet, slack, h, lost, phase] = self.fields.map(|slot| values[slot]);
        let is = |number: Phase| phase == f64::from(number as i32);
        let status = Status::from_number(values[self.status] as i32);
        let invalid = status.is_some_and(Status::is_abstention);
        if !self.states.is_empty() && self.run.zeros.moved.is_none() {
            let x = self.states.iter().map(|slot| values[*slot]);
            self.run.zeros.see(time, x, !invalid, self.prompt);
        }
        self.run.last = Some(time);
        let Some(time) = at else { return };
        let is_armed = status != Some(Status::NotArmed);
        let run = &mut self.run;
        let rearm = self.rearm.is_some_and(|slot| values[slot] != 0.0);
        if rearm && !run.rearm && run.started {
            let judged = run.judge.judgement();
            run.before = run.before.filter(|before| before.verdict() == Verdict::Broken).or(Some(judged));
            run.judge = Judge::new(run.deadline, self.interpolation);
            run.started = false;
            run.guaranteed = None;
        }
        run.rearm = rearm;
        run.started |= !invalid;
        if run.started {
            if let Some([plans, guaranteed]) = self.plans.map(|slots| slots.map(|slot| values[slot])) {
                run.refused |= plans == f64::from(AssuranceStatus::Refused as u8);
                // A released barrier no longer needs a guarantee.
                let is_covered = guaranteed != 0.0 || is(Phase::Released);
                run.guaranteed = Some(run.guaranteed != Some(false) && is_covered);
            }
            let promise_state = match () {
                () if is(Phase::Released) => PromiseState::Released,
                () if is(Phase::Waiting) => PromiseState::Waiting,
                () => PromiseState::InForce,
            };
            run.judge.see(time, h, promise_state, lost != 0.0 || is(Phase::Late));
        }
        if unmet > 0.0 || invalid && is_armed {
            run.unmet += 1;
            run.in_a_row += 1;
            run.longest = run.longest.max(run.in_a_row);
            run.violation = run.violation.max(-slack);
        } else {
            run.in_a_row = 0;
        }
    }

    /// A note for the user on the state that the filter received, if necessary.
    pub(super) fn note(&self) -> Option<String> {
        let filter = self.name.rsplit_once('.').map_or(self.name.as_str(), |(filter, _)| filter);
        self.run.zeros.note(filter)
    }

    /// The findings so far.
    pub(super) fn promise(&self) -> Promise {
        let run = &self.run;
        let mut promise = Promise {
            barrier: self.name.clone(),
            promise: Kept::Open,
            constraint_met: run.unmet == 0,
            deadline: None,
            began_inside: false,
            on_time: false,
            inside: false,
            arrival: None,
            late: None,
            late_by: None,
            left: None,
            least_h: None,
            refused: run.refused,
            guaranteed: run.guaranteed,
            unmet: run.unmet,
            longest: run.longest,
            violation: run.violation,
        };
        // A promise that was broken before a re-arming stays broken.
        let before = run.before.filter(|before| before.verdict() == Verdict::Broken);
        promise.judged(&before.unwrap_or_else(|| run.judge.judgement()));
        promise
    }
}
