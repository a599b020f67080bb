//! Computes the row of a run from the values at the communication points and from its promises.

use std::collections::HashSet;

use punctual_core::filter::{AssuranceStatus, Phase, Status};
use punctual_fmu::configuration::Configuration;

use super::file::{Campaign, Choice, Success};
use super::table::{Cell, Column, Kind, Row};
use crate::coupling::{Promise, Simulation};
use crate::error::Error;

/// A filter of the system.
struct FilterPlan {
    component: String,
    /// Names and units of its inputs to the plant.
    inputs: Vec<(String, String)>,
    /// Whether it follows backup plans.
    assured: bool,
    barriers: Vec<BarrierPlan>,
    /// How its promise is judged, if its plant is drawn within what it declares.
    declared: Option<DeclaredPlan>,
}

/// How the promise of a filter is judged whose plant is drawn.
struct DeclaredPlan {
    /// The name of the plant.
    plant: String,
    /// Whether its outputs are read a step late.
    late: bool,
    /// The number of steps by which the instant of the phase in its report comes after the sample, or fewer.
    delayed: usize,
}

/// A barrier of a filter.
struct BarrierPlan {
    /// `component.barrier`.
    name: String,
    unit: String,
}

/// What a campaign measures in each run.
pub struct Measures {
    filters: Vec<FilterPlan>,
    success: Success,
    columns: Vec<Column>,
}

/// What was observed of a filter in one run.
struct Seen {
    /// Number of steps by status.
    counts: [u64; Status::ALL.len()],
    /// Number of steps by status of its guarantee.
    assurance_statuses: [u64; AssuranceStatus::ALL.len()],
    /// Largest magnitude of each input.
    peaks: Vec<f64>,
    /// What was promised of each barrier, if the plant is drawn within what is declared.
    promised: Vec<Promised>,
    /// The number of communication points seen.
    points: u64,
}

/// What a filter promised of a barrier, and what became of it at every instant.
#[derive(Clone, Debug)]
struct Promised {
    /// Whether a plan guaranteed it, as read at the last communication points; the latest first.
    guaranteed: Vec<bool>,
    /// Whether h ≥ 0 was required from then on, as read there.
    required: Vec<bool>,
    /// Whether it was ever guaranteed.
    given: bool,
    /// Whether it was guaranteed at all samples since, until it was released.
    stays: bool,
    /// The least h of the plant as it is while it was guaranteed and required.
    least: Option<f64>,
    /// The largest size of h.
    size: f64,
}

/// Part of the largest size of h by which h may lie below 0: what the integration of the plant may be off by.
const TOLERANCE: f64 = 1e-7;

/// What became of the promise of a filter whose plant was drawn within what it declares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fate {
    /// No plan was found at the start, so nothing was promised.
    Refused,
    /// Guaranteed at every sample, and h ≥ 0 at every instant at which that was required.
    Kept,
    /// The guarantee was withdrawn, and h ≥ 0 as long as there was one.
    Withdrawn,
    /// h < 0 while a plan guaranteed h ≥ 0.
    Broken,
}

impl Fate {
    pub(super) const ALL: [Self; 4] = [Self::Refused, Self::Kept, Self::Withdrawn, Self::Broken];

    /// Its word in a row.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Refused => "refused",
            Self::Kept => "kept",
            Self::Withdrawn => "withdrawn",
            Self::Broken => "broken",
        }
    }
}

impl Promised {
    /// Before the first communication point of a filter that is read, and whose inputs act, up to `late` steps late.
    fn nothing(late: usize) -> Self {
        let none = vec![false; late + 1];
        Self { guaranteed: none.clone(), required: none, given: false, stays: true, least: None, size: 0.0 }
    }

    /// Takes the values of a communication point: whether a plan guarantees it, its phase, and the least h over the step before.
    fn see(&mut self, [guaranteed, phase, least]: [f64; 3], of: &DeclaredPlan, is_first: bool) {
        let is = |of: Phase| phase == f64::from(of as i32);
        let is_guaranteed = guaranteed != 0.0;
        self.given |= is_guaranteed;
        self.stays &= is_guaranteed || !self.given || is(Phase::Released);
        self.size = self.size.max(least.abs());
        self.guaranteed.rotate_right(1);
        self.required.rotate_right(1);
        (self.guaranteed[0], self.required[0]) = (is_guaranteed, is(Phase::Stay) || is(Phase::Left));
        // The sample at the start of the step before is read here, or was at the point before. The phase is of a later instant
        // with a delay, and then that of the sample before it is of one before the step.
        let at = usize::from(!of.late);
        if !is_first && self.guaranteed[at] && self.required[at + of.delayed] {
            self.least = Some(self.least.map_or(least, |before| before.min(least)));
        }
    }

    fn is_broken(&self) -> bool {
        self.least.is_some_and(|least| least.is_nan() || least < -TOLERANCE * self.size)
    }
}

/// What became of all promises of a filter.
fn fate(promised: &[Promised]) -> Fate {
    match () {
        () if promised.iter().any(Promised::is_broken) => Fate::Broken,
        () if !promised.iter().any(|of| of.given) => Fate::Refused,
        () if promised.iter().all(|of| of.stays) => Fate::Kept,
        () => Fate::Withdrawn,
    }
}

impl Measures {
    /// Measures for the runs of `campaign`.
    ///
    /// # Errors
    ///
    /// Names in a filter that would make two columns of the same name.
    pub fn new(campaign: &Campaign) -> Result<Self, Error> {
        let mut filters = Vec::new();
        for (c, part) in campaign.models().iter().enumerate() {
            let Some(Configuration::Filter(filter)) = part.configuration() else { continue };
            let description = part.description();
            let component = &campaign.system().components()[c];
            let unit = |variable: &str| {
                let found = description.index_of(variable).map(|i| &description.variables[i]);
                found.and_then(|v| v.unit.clone()).unwrap_or_default()
            };
            filters.push(FilterPlan {
                component: component.name.clone(),
                assured: filter.is_assured(),
                declared: campaign.declared().iter().find(|declared| declared.filter == c).map(|declared| {
                    DeclaredPlan {
                        plant: campaign.system().components()[declared.plant].name.clone(),
                        late: declared.late,
                        delayed: declared.delayed,
                    }
                }),
                inputs: filter
                    .plant
                    .inputs()
                    .iter()
                    .map(|input| (input.name.clone(), unit(&format!("u.{}", input.name))))
                    .collect(),
                barriers: filter
                    .barrier
                    .iter()
                    .map(|section| BarrierPlan {
                        name: format!("{}.{}", component.name, section.name),
                        unit: unit(&format!("{}.h", section.name)),
                    })
                    .collect(),
            });
        }
        let columns = columns(campaign, &filters);
        let mut names = HashSet::new();
        if let Some(twice) = columns.iter().find(|column| !names.insert(column.name.as_str())) {
            let message =
                format!("two columns of a row are called {}; rename the barrier or the input", twice.name);
            return Err(Error::configuration("component", message));
        }
        Ok(Self { filters, success: campaign.success(), columns })
    }

    /// The columns of a row.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The names of the barriers, `component.barrier`.
    pub fn barriers(&self) -> impl Iterator<Item = &str> {
        self.filters.iter().flat_map(|filter| &filter.barriers).map(|barrier| barrier.name.as_str())
    }

    /// The measured signals, in the order that `Measures::see` expects.
    pub fn signals(&self) -> Vec<String> {
        let mut signals = Vec::new();
        for filter in &self.filters {
            signals.push(format!("{}.status", filter.component));
            signals.extend(filter.assured.then(|| format!("{}.assurance", filter.component)));
            signals.extend(filter.inputs.iter().map(|(name, _)| format!("{}.u.{name}", filter.component)));
            if let Some(DeclaredPlan { plant, .. }) = &filter.declared {
                for BarrierPlan { name, .. } in &filter.barriers {
                    let of_plant = name.strip_prefix(&filter.component).unwrap_or(name);
                    signals.extend(["guaranteed", "phase"].map(|field| format!("{name}.{field}")));
                    signals.push(format!("{plant}.least_h{of_plant}"));
                }
            }
        }
        signals
    }

    /// Makes run `number` and measures it. `simulation` records [`Measures::signals`] at every step.
    pub fn run(&self, campaign: &Campaign, simulation: &mut Simulation, number: u64) -> Row {
        self.run_from(campaign, simulation, number, &campaign.choice(number))
    }

    /// Like [`Measures::run`], but starts from `choice` instead of the run's own draw.
    pub(super) fn run_from(
        &self,
        campaign: &Campaign,
        simulation: &mut Simulation,
        number: u64,
        choice: &Choice,
    ) -> Row {
        campaign.start(simulation, choice);
        let mut seen = self.nothing();
        let outcome = simulation.run_unrecorded(|_, values| self.see(&mut seen, values));
        let (failure, promises) = match outcome {
            Ok(outcome) => (outcome.failure, outcome.promises),
            Err(error) => (Some(error), Vec::new()),
        };
        self.row(number, choice, &seen, &promises, failure.as_ref())
    }

    /// The row of a run that could not be made.
    pub(super) fn unmade(&self, number: u64, choice: &Choice, why: &Error) -> Row {
        self.row(number, choice, &self.nothing(), &[], Some(why))
    }

    fn nothing(&self) -> Vec<Seen> {
        let nothing = |filter: &FilterPlan| Seen {
            counts: [0; Status::ALL.len()],
            assurance_statuses: [0; AssuranceStatus::ALL.len()],
            peaks: vec![0.0; filter.inputs.len()],
            promised: filter.declared.as_ref().map_or_else(Vec::new, |declared| {
                vec![Promised::nothing(declared.delayed + 1); filter.barriers.len()]
            }),
            points: 0,
        };
        self.filters.iter().map(nothing).collect()
    }

    /// Takes the values of a communication point.
    fn see(&self, seen: &mut [Seen], mut values: &[f64]) {
        for (filter, seen) in self.filters.iter().zip(seen) {
            count(&mut seen.counts, &mut values);
            if filter.assured {
                count(&mut seen.assurance_statuses, &mut values);
            }
            for (peak, u) in seen.peaks.iter_mut().zip(values) {
                *peak = peak.max(u.abs());
            }
            values = values.get(seen.peaks.len()..).unwrap_or_default();
            if let Some(declared) = &filter.declared {
                for promised in &mut seen.promised {
                    let Some((of_barrier, rest)) = values.split_first_chunk() else { break };
                    promised.see(*of_barrier, declared, seen.points == 0);
                    values = rest;
                }
            }
            seen.points += 1;
        }
    }

    fn row(
        &self,
        number: u64,
        choice: &Choice,
        seen: &[Seen],
        promises: &[Promise],
        failure: Option<&Error>,
    ) -> Row {
        let mut row = Vec::with_capacity(self.columns.len());
        let mut success = failure.is_none();
        row.extend([Cell::Count(number), Cell::Count(choice.seed)]);
        row.extend(choice.values.iter().map(|value| Cell::Number(Some(*value))));
        let verdict = row.len();
        for (filter, Seen { counts, assurance_statuses, peaks, promised, .. }) in
            self.filters.iter().zip(seen)
        {
            row.extend(counts.iter().map(|count| Cell::Count(*count)));
            row.extend(assurance_statuses.iter().filter(|_| filter.assured).map(|count| Cell::Count(*count)));
            row.extend(peaks.iter().map(|peak| Cell::Number(Some(*peak))));
            if filter.declared.is_some() {
                let fate = fate(promised);
                success &= fate == Fate::Kept;
                row.push(Cell::Text(Some(fate.word().to_owned())));
            }
            for (i, plan) in filter.barriers.iter().enumerate() {
                let promise = promises.iter().find(|promise| promise.barrier == plan.name);
                let kept = promise.is_some_and(Promise::kept);
                success &= match self.success {
                    // The filter sees the plant with the errors of its measurement. The promise is of the plant as it is.
                    _ if filter.declared.is_some() => true,
                    Success::Kept => kept,
                    Success::OnTimeAndInside => promise.is_some_and(|p| p.promise.is_done()),
                };
                row.extend([
                    Cell::Number(promise.and_then(|p| p.arrival)),
                    Cell::Flag(promise.is_some_and(|p| p.on_time)),
                    Cell::Number(promise.and_then(|p| p.least_h)),
                    Cell::Flag(promise.is_some_and(|p| p.inside)),
                    Cell::Number(promise.and_then(|p| p.late)),
                    Cell::Number(promise.and_then(|p| p.left)),
                    Cell::Count(promise.map_or(0, |p| p.unmet)),
                    Cell::Count(promise.map_or(0, |p| p.longest)),
                    Cell::Number(promise.map(|p| p.violation)),
                    Cell::Flag(failure.is_none() && kept),
                ]);
                row.extend(promised.get(i).map(|of| Cell::Number(of.least)));
            }
        }
        let failure = Cell::Text(failure.map(ToString::to_string));
        row.splice(verdict..verdict, [Cell::Flag(success), failure]);
        row
    }
}

/// Counts a step under the first of `values`, and removes that value.
fn count(counts: &mut [u64], values: &mut &[f64]) {
    if let Some(number) = values.split_off_first()
        && let Some(count) = counts.get_mut(*number as usize)
    {
        *count += 1;
    }
}

/// The column of the [`Fate`] of a filter's promise.
pub(super) const FATE: &str = "promise";

/// The column of the least h of a barrier while it was guaranteed.
pub(super) const GUARANTEED: &str = "least_guaranteed_h";

/// Columns of a barrier, in the order of a row; `[h]` stands for its unit.
const OF_BARRIER: [(&str, Kind, &str, &str); 10] = [
    ("arrival", Kind::Number, "s", "when h >= 0 held first"),
    ("on_time", Kind::Flag, "", "whether that was by its deadline; without one, at the start"),
    ("least_h", Kind::Number, "[h]", "least h from the deadline on; from the start where it began inside"),
    (
        "inside",
        Kind::Flag,
        "",
        "whether the deadline was reached and h >= 0 held from then on; from the start where it began inside",
    ),
    ("late", Kind::Number, "s", "when it was known that its deadline is missed"),
    ("left", Kind::Number, "s", "when it was left after it had been inside and was to be kept"),
    ("unmet", Kind::Count, "", "samples that did not meet its constraint"),
    ("longest", Kind::Count, "", "most of them in a row"),
    ("violation", Kind::Number, "", "largest violation of its constraint, in the unit of its slack"),
    ("kept", Kind::Flag, "", "whether it was on time and inside, and every sample met its constraint"),
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
    add("success".into(), Kind::Flag, "", "whether the run met what the campaign asks for");
    add("failure".into(), Kind::Text, "", "the call that ended the run before its stop time");
    for filter in filters {
        for status in Status::ALL {
            let name = status.name();
            let meaning = format!("communication points with status {name}");
            add(format!("{}.status.{name}", filter.component), Kind::Count, "", &meaning);
        }
        for assurance_status in AssuranceStatus::ALL.into_iter().filter(|_| filter.assured) {
            let name = assurance_status.name();
            let meaning = format!("communication points at which the guarantee was {name}");
            add(format!("{}.assurance.{name}", filter.component), Kind::Count, "", &meaning);
        }
        for (input, unit) in &filter.inputs {
            let meaning = format!("largest size of u.{input} at a communication point");
            add(format!("{}.peak.{input}", filter.component), Kind::Number, unit, &meaning);
        }
        if filter.declared.is_some() {
            let meaning = "what became of the promise, with a plant within what is declared: refused, kept, withdrawn or broken";
            add(format!("{}.{FATE}", filter.component), Kind::Text, "", meaning);
        }
        for barrier in &filter.barriers {
            for (field, kind, unit, meaning) in OF_BARRIER {
                let unit = if unit == "[h]" { &barrier.unit } else { unit };
                add(format!("{}.{field}", barrier.name), kind, unit, meaning);
            }
            if filter.declared.is_some() {
                let meaning = "least h of the plant as it is, at any instant, while a plan guaranteed h >= 0";
                add(format!("{}.{GUARANTEED}", barrier.name), Kind::Number, &barrier.unit, meaning);
            }
        }
    }
    columns
}
