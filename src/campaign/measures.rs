//! What is kept of a run: its row, from the values at the communication points and from its promises.

use punctual_core::filter::{Phase, Status};
use punctual_fmu::configuration::Configuration;
use punctual_fmu::product::describe;

use super::file::{Campaign, Choice, Success};
use super::in_process::InProcess;
use super::table::{Cell, Column, Kind, Row};
use crate::coupling::{Simulation, StartValue};
use crate::error::Error;

/// Times in s that differ by no more are the same communication point: round-off of a deadline.
const SAME_TIME: f64 = 1e-9;

/// A filter of the system.
struct FilterPlan {
    component: String,
    /// Names and units of its inputs to the plant.
    inputs: Vec<(String, String)>,
    barriers: Vec<BarrierPlan>,
}

/// A barrier of a filter.
struct BarrierPlan {
    /// `component.barrier`.
    name: String,
    unit: String,
    deadline: Deadline,
}

/// Where the deadline of a run comes from.
enum Deadline {
    Fixed(f64),
    Varied(usize),
}

/// What a campaign keeps of its runs.
pub struct Measures {
    filters: Vec<FilterPlan>,
    start_time: f64,
    success: Success,
    columns: Vec<Column>,
}

/// What is seen of one run.
struct Seen {
    /// By filter and status.
    counts: Vec<[u64; Status::ALL.len()]>,
    /// By filter and input.
    peaks: Vec<f64>,
    barriers: Vec<SeenBarrier>,
}

#[derive(Clone, Copy, Default)]
struct SeenBarrier {
    /// In s.
    deadline: f64,
    /// Whether the deadline was reached in time.
    reached: bool,
    /// Least h from then on.
    least: Option<f64>,
    /// Whether it was outside from then on.
    outside: bool,
}

impl Measures {
    /// For the runs of `campaign`.
    pub fn new(campaign: &Campaign) -> Self {
        let mut filters = Vec::new();
        for (c, configuration) in campaign.configurations().iter().enumerate() {
            let Configuration::Filter(filter) = configuration else { continue };
            let component = &campaign.system().components()[c];
            let description = &campaign.descriptions()[c];
            let unit = |variable: &str| {
                let found = description.index_of(variable).map(|i| &description.variables[i]);
                found.and_then(|v| v.unit.clone()).unwrap_or_default()
            };
            let barrier = |name: &str| {
                let (name, parameter) = (format!("{}.{name}", component.name), format!("{name}.deadline"));
                let full = format!("{}.{parameter}", component.name);
                let deadline = match campaign.varied().iter().position(|v| v.name == full) {
                    Some(varied) => Deadline::Varied(varied),
                    None => {
                        let given = component.start.get(&parameter).and_then(|value| match *value {
                            StartValue::Real(value) => Some(value),
                            StartValue::Integer(value) => Some(value as f64),
                            StartValue::Boolean(_) => None,
                        });
                        let own = description.index_of(&parameter).map(|i| &description.variables[i]);
                        let own = own.and_then(|v| v.start.as_deref()?.parse().ok());
                        Deadline::Fixed(given.or(own).unwrap_or(f64::INFINITY))
                    }
                };
                (name, deadline)
            };
            filters.push(FilterPlan {
                component: component.name.clone(),
                inputs: filter
                    .plant
                    .inputs()
                    .iter()
                    .map(|input| (input.name.clone(), unit(&format!("u.{}", input.name))))
                    .collect(),
                barriers: filter
                    .barrier
                    .iter()
                    .map(|section| {
                        let (name, deadline) = barrier(&section.name);
                        BarrierPlan { name, unit: unit(&format!("{}.h", section.name)), deadline }
                    })
                    .collect(),
            });
        }
        let columns = columns(campaign, &filters);
        let start_time = campaign.system().experiment().start_time;
        Self { filters, start_time, success: campaign.success(), columns }
    }

    /// The columns of a row.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The names of the barriers, `component.barrier`.
    pub fn barriers(&self) -> impl Iterator<Item = &str> {
        self.filters.iter().flat_map(|filter| &filter.barriers).map(|barrier| barrier.name.as_str())
    }

    /// The signals that are looked at, in the order of `Measures::see`.
    pub fn signals(&self) -> Vec<String> {
        let mut signals = Vec::new();
        for filter in &self.filters {
            signals.push(format!("{}.status", filter.component));
            signals.extend(filter.inputs.iter().map(|(name, _)| format!("{}.u.{name}", filter.component)));
            for barrier in &filter.barriers {
                signals.extend(["h", "phase"].map(|field| format!("{}.{field}", barrier.name)));
            }
        }
        signals
    }

    /// Makes run `number` and measures it. `simulation` records [`Measures::signals`] at every step.
    pub fn run(&self, campaign: &Campaign, simulation: &mut Simulation<InProcess>, number: u64) -> Row {
        let choice = campaign.choice(number);
        campaign.start(simulation, &choice);
        let mut seen = self.nothing(&choice);
        let outcome = simulation.run_unrecorded(|time, values| self.see(&mut seen, time, values));
        let (failure, promises) = match outcome {
            Ok(outcome) => (outcome.failure, outcome.promises),
            Err(error) => (Some(error), Vec::new()),
        };
        self.row(number, &choice, &seen, &promises, failure.as_ref())
    }

    fn nothing(&self, choice: &Choice) -> Seen {
        let barrier = |barrier: &BarrierPlan| SeenBarrier {
            deadline: match barrier.deadline {
                Deadline::Fixed(deadline) => deadline,
                Deadline::Varied(varied) => choice.values[varied],
            },
            ..SeenBarrier::default()
        };
        Seen {
            counts: vec![[0; Status::ALL.len()]; self.filters.len()],
            peaks: vec![0.0; self.filters.iter().map(|filter| filter.inputs.len()).sum()],
            barriers: self.filters.iter().flat_map(|f| &f.barriers).map(barrier).collect(),
        }
    }

    /// Takes the values of the communication point at `time` (s).
    fn see(&self, seen: &mut Seen, time: f64, values: &[f64]) {
        let mut values = values.iter().copied();
        let mut next = || values.next().unwrap_or(f64::NAN);
        let (mut peaks, mut barriers) = (seen.peaks.iter_mut(), seen.barriers.iter_mut());
        for (filter, counts) in self.filters.iter().zip(&mut seen.counts) {
            if let Some(count) = counts.get_mut(next() as usize) {
                *count += 1;
            }
            for peak in peaks.by_ref().take(filter.inputs.len()) {
                *peak = peak.max(next().abs());
            }
            for barrier in barriers.by_ref().take(filter.barriers.len()) {
                let (h, phase) = (next(), next());
                if time - self.start_time < barrier.deadline - SAME_TIME {
                    continue;
                }
                barrier.reached = true;
                if phase != f64::from(Phase::Released as i32) {
                    barrier.least = Some(barrier.least.map_or(h, |least| least.min(h)));
                    // Also where it is not a number.
                    barrier.outside |= h.is_nan() || h < 0.0;
                }
            }
        }
    }

    fn row(
        &self,
        number: u64,
        choice: &Choice,
        seen: &Seen,
        promises: &[crate::coupling::Promise],
        failure: Option<&Error>,
    ) -> Row {
        let mut row = Vec::with_capacity(self.columns.len());
        let mut success = failure.is_none();
        row.extend([Cell::Count(number), Cell::Count(choice.seed)]);
        row.extend(choice.values.iter().map(|value| Cell::Number(Some(*value))));
        let verdict = row.len();
        let (mut peaks, mut barriers) = (seen.peaks.iter(), seen.barriers.iter());
        for (filter, counts) in self.filters.iter().zip(&seen.counts) {
            row.extend(counts.iter().map(|count| Cell::Count(*count)));
            row.extend(peaks.by_ref().take(filter.inputs.len()).map(|peak| Cell::Number(Some(*peak))));
            for (plan, barrier) in filter.barriers.iter().zip(barriers.by_ref()) {
                let promise = promises.iter().find(|promise| promise.barrier == plan.name);
                let arrival = promise.and_then(|p| p.arrival);
                let deadline = self.start_time + barrier.deadline;
                let on_time = arrival.is_some_and(|time| time <= deadline + SAME_TIME);
                let inside = barrier.reached && !barrier.outside;
                let kept = failure.is_none() && promise.is_some_and(crate::coupling::Promise::kept);
                success &= match self.success {
                    Success::Kept => kept && barrier.reached,
                    Success::OnTimeAndInside => on_time && inside,
                };
                row.extend([
                    Cell::Number(arrival),
                    Cell::Flag(on_time),
                    Cell::Number(barrier.least),
                    Cell::Flag(inside),
                    Cell::Number(promise.and_then(|p| p.late)),
                    Cell::Number(promise.and_then(|p| p.left)),
                    Cell::Count(promise.map_or(0, |p| p.unmet)),
                    Cell::Count(promise.map_or(0, |p| p.longest)),
                    Cell::Number(promise.map(|p| p.violation)),
                    Cell::Flag(kept),
                ]);
            }
        }
        let failure = Cell::Text(failure.map(ToString::to_string));
        row.splice(verdict..verdict, [Cell::Flag(success), failure]);
        row
    }
}

/// What is kept of a barrier, in the order of a row; `[h]` stands for its unit.
const OF_BARRIER: [(&str, Kind, &str, &str); 10] = [
    ("arrival", Kind::Number, "s", "first communication point at which it had arrived"),
    ("on_time", Kind::Flag, "", "whether it had arrived by its deadline"),
    ("least_h", Kind::Number, "[h]", "least h at the communication points from the deadline on"),
    ("inside", Kind::Flag, "", "whether the deadline was reached and h >= 0 at all these points"),
    ("late", Kind::Number, "s", "first point at which its deadline had passed outside, or was certain to"),
    ("left", Kind::Number, "s", "first point at which it had been left again"),
    ("unmet", Kind::Count, "", "samples that did not meet its constraint"),
    ("longest", Kind::Count, "", "longest row of them"),
    ("violation", Kind::Number, "", "largest violation of its constraint, in the unit of its slack"),
    ("kept", Kind::Flag, "", "whether every sample met its constraint, not late, not left"),
];

fn columns(campaign: &Campaign, filters: &[FilterPlan]) -> Vec<Column> {
    let mut columns = Vec::new();
    let mut add = |name: String, kind, unit: &str, description: &str| {
        columns.push(Column { name, kind, unit: unit.to_owned(), description: description.to_owned() });
    };
    add("run".into(), Kind::Count, "", "number of the run, from 0");
    add("seed".into(), Kind::Count, "", "the run's own seed");
    for varied in campaign.varied() {
        add(varied.name.clone(), Kind::Number, varied.unit.as_deref().unwrap_or(""), &varied.description);
    }
    add("success".into(), Kind::Flag, "", "whether the run came to what the campaign asks for");
    add("failure".into(), Kind::Text, "", "the call that ended the run before its stop time");
    for filter in filters {
        for status in Status::ALL {
            let (name, _) = describe(status);
            let meaning = format!("communication points with status {name}");
            add(format!("{}.status.{name}", filter.component), Kind::Count, "", &meaning);
        }
        for (input, unit) in &filter.inputs {
            let meaning = format!("largest size of u.{input} at a communication point");
            add(format!("{}.peak.{input}", filter.component), Kind::Number, unit, &meaning);
        }
        for barrier in &filter.barriers {
            for (field, kind, unit, meaning) in OF_BARRIER {
                let unit = if unit == "[h]" { &barrier.unit } else { unit };
                add(format!("{}.{field}", barrier.name), kind, unit, meaning);
            }
        }
    }
    columns
}
