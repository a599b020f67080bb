//! `kind = "filter"`: a safety filter for one of the plants.

use std::collections::BTreeMap;

use punctual_core::MAX_ROWS;
use punctual_core::filter::{Begin, End, Filter, FilterBuilder, Sampling, Strictness};
use punctual_core::plan::Names;
use serde::{Deserialize, Serialize};

use super::adding::{Adding, Forms, MixedDegree, not_affine};
use super::alone::within;
use super::assurance::{AssuranceName, Findings};
use super::barrier::RawBarrier;
use super::key::{
    Key, Section,
    Unit::{Is, Of},
    Value::{Count, Flag, Name, Number, NumberByName, PairByName, Table, Tables, Text, TextByName, Word},
};
use super::model::RawModel;
use super::names::{Named, check_identifier, check_known, is_reserved, taken};
use super::parameter::UNBOUNDED;
use super::team::{self, RawAgent};
use super::words::words;
use super::{
    BarrierInput, BarrierSection, ConfigurationError, DisturbanceSection, EXPERIMENT, ExperimentSection,
    FollowerSection, IntegrationSection, IntegratorSection, Parameter, PlantSection, PluginLoader, Range,
    RunSection, UncertaintySection, VariableSection, barrier, follower, integrator, model, plant,
    uncertainty,
};
use crate::text::{number, quantity, shown_unit};

words! {
    /// The treatment of inputs that are held between samples.
    pub enum SamplingName {
        /// [`Sampling::Pointwise`]: the margin has to cover the hold.
        Pointwise = "pointwise",
        /// [`Sampling::Measured`]: predicted over the period since the last step, at first the step size of
        /// `[experiment]`.
        Measured = "measured",
        /// [`Sampling::Period`] with the step size of `[experiment]`.
        StepSize = "step_size",
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum FilterKind {
    Filter,
}

/// The largest budget of a search.
const MOST_PROGRAMS: u64 = 1_000_000;

/// A filter as written in a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawFilter {
    kind: FilterKind,
    #[serde(default)]
    name: String,
    #[serde(default = "yes")]
    direct_feedthrough: bool,
    sampling: Option<SamplingName>,
    #[serde(default = "auto")]
    assurance: AssuranceName,
    plan_horizon: Option<f64>,
    search_budget: Option<u32>,
    #[serde(default)]
    actuation_delay: f64,
    #[serde(default)]
    period_max: f64,
    #[serde(default)]
    arm_after: f64,
    #[serde(default = "correction_limit")]
    correction_limit: f64,
    #[serde(default)]
    brief_search: bool,
    pub(super) plant: RawModel,
    pub(super) integrator: Option<IntegratorSection>,
    pub(super) policy: Option<BTreeMap<String, String>>,
    pub(super) barrier: Vec<RawBarrier>,
    mission: Option<String>,
    #[serde(default)]
    pub(super) agent: Vec<RawAgent>,
    pub(super) keep_apart: Option<f64>,
    #[serde(default)]
    pub(super) bounds: BTreeMap<String, [f64; 2]>,
    #[serde(default)]
    pub(super) measurement_errors: BTreeMap<String, f64>,
    pub(super) uncertainty: Option<UncertaintySection>,
    #[serde(default)]
    experiment: ExperimentSection,
    #[serde(default)]
    pub(super) x0: BTreeMap<String, f64>,
    pub(super) u_ref: Option<BTreeMap<String, String>>,
    pub(super) simulated: Option<RawModel>,
    #[serde(default)]
    integration: IntegrationSection,
    pub(super) disturbance: Option<DisturbanceSection>,
    pub(super) follower: Option<FollowerSection>,
}

/// A filter FMU. docs/configuration.md has units, ranges and defaults.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FilterConfiguration {
    kind: FilterKind,
    /// The FMU's name, a C identifier.
    pub name: String,
    /// Whether outputs follow inputs without a step between them; with false, outputs are computed in steps only,
    /// for the same result in every master.
    pub direct_feedthrough: bool,
    /// The treatment of inputs that are held between samples.
    pub sampling: SamplingName,
    /// Whether the filter promises only what a plan keeps.
    #[serde(skip_serializing_if = "is_auto")]
    pub assurance: AssuranceName,
    /// The time in s for which a plan has to reach past the last deadline and the sample where none ends at an
    /// equilibrium; `None`: every plan has to end at an equilibrium.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plan_horizon: Option<f64>,
    /// The most quadratic programs of a search for a plan at one sample after the first; `None`:
    /// [`Plans::SEARCH_BUDGET`](punctual_core::filter::Plans::SEARCH_BUDGET).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub search_budget: Option<u32>,
    /// What was found out when the file was read.
    #[serde(skip)]
    pub(super) findings: Findings,
    /// Time in s until a computed input acts, such as a communication step with a Jacobi master. The state is predicted over it.
    pub actuation_delay: f64,
    /// The longest time in s between two steps. The promises then hold for steps of any length up to it. 0: as long as the
    /// steps before were.
    #[serde(skip_serializing_if = "is_zero")]
    pub period_max: f64,
    /// The time in s from the first step until the filter is armed: every deadline counts from then. Before, nothing is
    /// asked or promised.
    #[serde(skip_serializing_if = "is_zero")]
    pub arm_after: f64,
    /// Largest ‖u − u_ref‖ of one sample, in units of u; a constraint that needs more is reported as `no_authority`.
    pub correction_limit: f64,
    /// Whether the search for an input that meets the rows over the period is brief.
    #[serde(skip_serializing_if = "is_false")]
    pub brief_search: bool,
    /// The plant that the filter is for.
    pub plant: PlantSection,
    /// The state of the plant that the filter commands and integrates itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub integrator: Option<IntegratorSection>,
    /// An expression of states, parameters and time for each input of the plant, by name: a way to keep what is promised,
    /// with which a search for a plan begins.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub policy: Option<BTreeMap<String, String>>,
    /// The safe sets, at least one.
    pub barrier: Vec<BarrierSection>,
    /// Input bounds by name, `[min, max]` in the unit of the input; none is ±1e30.
    pub bounds: BTreeMap<String, [f64; 2]>,
    /// Bounds on the errors of the measured states, by name, in their units. The promises then hold for the true state: those of
    /// plans exactly, those of the rows to first order in the errors.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub measurement_errors: BTreeMap<String, f64>,
    /// How the plant may differ from the model. The promises then hold for every such plant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<Box<UncertaintySection>>,
    /// The run that it is meant for.
    pub experiment: ExperimentSection,
    /// What a run of this file alone has besides. It is no part of the FMU.
    #[serde(skip)]
    pub run: Box<RunSection>,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_false(value: &bool) -> bool {
    !value
}

fn auto() -> AssuranceName {
    AssuranceName::Auto
}

fn is_auto(assurance: &AssuranceName) -> bool {
    *assurance == AssuranceName::Auto
}

fn yes() -> bool {
    true
}

fn correction_limit() -> f64 {
    FilterBuilder::DEFAULT_CORRECTION_LIMIT
}

/// A filter.
pub(super) static SECTION: Section = Section {
    name: "filter",
    keys: || {
        static KEYS: [Key; 29] = [
            Key::new("kind", Word(&["filter"]), None, ""),
            Key::new("name", Name, Some("`filter`"), "the FMU's name"),
            Key::new("plant", Table(&model::PLANT), None, "[the model](#models) that the filter is for"),
            Key::new("barrier", Tables(&barrier::SECTION), None, "[the safe sets](#barriers), at least one"),
            Key::new(
                "bounds",
                PairByName(Of("unit of the input")),
                Some("none"),
                "`[min, max]` of any input. Never relaxed",
            ),
            Key::new(
                "mission",
                Text,
                Some("none"),
                "[where to be and when](#missions), in signal temporal logic, such as `F[0,5] A & F[5,12] B & G !C`; the names are those of \
                 barriers, which then say only where that is",
            ),
            Key::new(
                "agent",
                Tables(&team::SECTION),
                Some("none"),
                "[a team](#teams) of vehicles of the one model `plant`: each of these has its states and inputs, called by its name \
                 and theirs, such as `red_v`",
            ),
            Key::new(
                "keep_apart",
                Number(Is("m"), Range::POSITIVE),
                Some("none"),
                "of a team: the least distance of every two agents, at all times",
            ),
            Key::new(
                "sampling",
                Word(SamplingName::WORDS),
                Some(
                    "`measured`; `pointwise` where the plant has inputs only. With an external barrier it must be `pointwise`",
                ),
                "inputs are held between samples: `measured` predicts over the period since the last step, `step_size` over \
                 that of `[experiment]`, `pointwise` not at all, so `margin` has to cover it",
            ),
            Key::new(
                "assurance",
                Word(AssuranceName::WORDS),
                Some("`auto`"),
                "`on`: the filter promises only what a plan within the bounds keeps, whatever u_ref is, and follows it where it \
                 must ([guarantees](guarantees.md#will-it-always)). The plan is sought at the first step; if none is found, \
                 nothing is promised. Needs a model to run ahead, sets that stay where they are, a delay of at most 250 steps. `off`: the rows \
                 alone. `auto`: `on` where that is possible and every input has bounds, else `off`. Where every input has bounds, a \
                 warning names the keys that switch it off for all barriers",
            ),
            Key::new(
                "plan_horizon",
                Number(Is("s"), Range::POSITIVE),
                Some(
                    "none: every plan ends at an equilibrium. With `[uncertainty]` or `[measurement_errors]` its promise ends all the same, 3 s past the last deadline and the present",
                ),
                "if no plan ends at an equilibrium, as for an aeroplane or a set that moves for ever: how far a plan has to reach \
                 past the last deadline and the present. The promise holds until its end, `assured_until`. It is extended before it ends, if a \
                 longer plan is found",
            ),
            Key::new(
                "search_budget",
                Count(1, MOST_PROGRAMS),
                Some("3 where plans are followed"),
                "the most quadratic programs that a search for a plan solves at one step after the first; it continues at the next \
                 step, and meanwhile the current plan drives. With more, a plan for u_ref, or one in place of a lost plan, is found in fewer steps, \
                 each of which may take longer: about 0.3 ms per program for a vehicle, and more with more states, inputs and barriers",
            ),
            Key::new(
                "actuation_delay",
                Number(Is("s"), Range::NON_NEGATIVE),
                Some("0"),
                "until a computed input acts: the time that a camera, a computation and a network take, or a step with a [Jacobi \
                 master](fmu.md#jacobi), for which `build --master jacobi` and `run` set it. At most 250 steps; less than every \
                 deadline. The state is predicted over it",
            ),
            Key::new(
                "period_max",
                Number(Is("s"), Range::NON_NEGATIVE),
                Some("0"),
                "the longest time between two steps; the rows then hold for steps of any length up to it, and a late \
                 step seldom ends a plan. 0: as long as the previous ones",
            ),
            Key::new(
                "arm_after",
                Number(Is("s"), Range::NON_NEGATIVE),
                Some("0: at the first step"),
                "the time from the first step until the filter is [armed](fmu.md#arming): every deadline counts from the first \
                 step with valid inputs then. Until then nothing is required or promised, and u is u_ref within its bounds",
            ),
            Key::new(
                "measurement_errors",
                NumberByName(Of("unit of the state"), Range::NON_NEGATIVE),
                Some("none"),
                "largest error of a measured state, by name: the promise then holds for the true state. Plans account for it \
                 ([below](#uncertainty)), and so do the rows, to first order ([theory](theory.md#measurement-errors)). Needs the \
                 reference profile, prediction over the period; beside a delay plans alone account for it",
            ),
            Key::new(
                "uncertainty",
                Table(&uncertainty::SECTION),
                Some("none: the plant is the model"),
                "[how the plant may differ from the model](#uncertainty); only plans account for it",
            ),
            Key::new(
                "integrator",
                Table(&integrator::SECTION),
                Some("none"),
                "[a state that the filter commands and does not measure](#integrators)",
            ),
            Key::new(
                "policy",
                TextByName,
                Some("none"),
                "for each input of the model the [expression](#expressions) of a controller that may keep the promises, in \
                 states, parameters and `t`: a search for a plan starts from it too. No guarantee depends on it",
            ),
            Key::new(
                "direct_feedthrough",
                Flag,
                Some("`true`"),
                "whether outputs follow inputs without a step between them; with `false` they change in steps only, the \
                 same in every master",
            ),
            Key::new(
                "correction_limit",
                Number(Of("unit of u"), Range::POSITIVE),
                Some("1e6"),
                "a sample that needs a larger ‖u − u_ref‖ is `no_authority`",
            ),
            Key::new(
                "brief_search",
                Flag,
                Some("`false`"),
                "whether the search for an input that meets the rows over a step is brief, so that the longest step can be told \
                 ([in your control loop](embedded.md#what-it-takes)); what needs a longer one is `no_authority`",
            ),
            Key::new("experiment", Table(&EXPERIMENT), Some(""), "[the run it is meant for](#runs)"),
            Key::new(
                "x0",
                NumberByName(Of("unit of the state"), Range::FINITE),
                Some("as of a plant"),
                "[a run of this file](#one-file): the start",
            ),
            Key::new(
                "u_ref",
                TextByName,
                Some("0"),
                "a run of this file: for each input the [expression](#expressions) of what is wanted, of states, parameters \
                 and `t`",
            ),
            Key::new(
                "simulated",
                Table(&model::PLANT),
                Some("that of the filter"),
                "a run of this file: the model of the plant, where it is another",
            ),
            Key::new(
                "integration",
                Table(&plant::INTEGRATION),
                Some(""),
                "a run of this file: as of a plant",
            ),
            Key::new(
                "disturbance",
                Table(&plant::DISTURBANCE),
                Some("none"),
                "a run of this file: as of a plant",
            ),
            Key::new(
                "follower",
                Table(&follower::SECTION),
                Some("none"),
                "[the plan of a file for the C library](#follower); nothing else reads it",
            ),
        ];
        KEYS.iter().collect()
    },
};

/// The barriers of a filter for `plant`.
fn barriers(raw: Vec<RawBarrier>, plant: &PlantSection) -> Result<Vec<BarrierSection>, ConfigurationError> {
    let refuse = |message: String| Err(ConfigurationError::new("barrier", message));
    if raw.is_empty() {
        return refuse("is empty, must have at least 1".to_owned());
    }
    // Refuses too many before time is spent on each.
    if raw.len() > MAX_ROWS {
        return refuse(format!("has {} entries, must have at most {MAX_ROWS}", raw.len()));
    }
    let mut barriers: Vec<BarrierSection> = Vec::new();
    for (i, raw) in raw.into_iter().enumerate() {
        let barrier = BarrierSection::parse(raw, &format!("barrier[{i}]"), plant)?;
        let name = &barrier.name;
        // A barrier's variables must not fall among the filter's own.
        let others = plant.own_parameters().iter().map(|p| &p.name).chain(barriers.iter().map(|b| &b.name));
        if is_reserved(name, Named::Barrier) || others.into_iter().any(|other| other == name) {
            return Err(taken(format!("barrier[{i}].name"), name));
        }
        barriers.push(barrier);
    }
    Ok(barriers)
}

impl FilterConfiguration {
    /// Completes and checks `raw`.
    pub(super) fn parse(raw: RawFilter, loader: &dyn PluginLoader) -> Result<Self, ConfigurationError> {
        let raw = raw.joined()?;
        // Name and plant.
        let name = if raw.name.is_empty() { "filter".to_owned() } else { raw.name };
        check_identifier("name", &name)?;
        let plant = PlantSection::parse(raw.plant, loader)?;
        if let Some(model) = plant.model().filter(|model| !model.is_affine()) {
            return Err(not_affine(model));
        }
        if let Some(integrator) = &raw.integrator {
            integrator.place(&plant)?;
        }
        // The filter with its barriers, and the defaults that depend on the plant.
        let mut configuration = Self {
            kind: raw.kind,
            name,
            direct_feedthrough: raw.direct_feedthrough,
            barrier: barriers(
                match &raw.mission {
                    None => raw.barrier,
                    Some(text) => barrier::of_mission(text, raw.barrier, raw.experiment.step_size)?,
                },
                &plant,
            )?,
            sampling: raw.sampling.unwrap_or(match plant.is_external() {
                true => SamplingName::Pointwise,
                false => SamplingName::Measured,
            }),
            assurance: raw.assurance,
            plan_horizon: raw.plan_horizon,
            search_budget: raw.search_budget,
            findings: Findings::default(),
            actuation_delay: raw.actuation_delay,
            period_max: raw.period_max,
            arm_after: raw.arm_after,
            correction_limit: raw.correction_limit,
            brief_search: raw.brief_search,
            plant,
            integrator: raw.integrator,
            policy: raw.policy,
            bounds: raw.bounds,
            measurement_errors: raw.measurement_errors,
            uncertainty: raw.uncertainty.map(Box::new),
            experiment: raw.experiment,
            run: Box::new(RunSection {
                x0: raw.x0,
                u_ref: raw.u_ref,
                simulated: raw
                    .simulated
                    .map(|model| PlantSection::parse(model, loader))
                    .transpose()
                    .map_err(|e| within("simulated", &e))?,
                integration: raw.integration,
                disturbance: raw.disturbance,
                follower: raw.follower,
            }),
        };
        configuration.check_sampling()?;
        configuration.complete_bounds()?;
        let states = configuration.measured_states();
        check_known("measurement_errors", &configuration.measurement_errors, "measured state", &states)?;
        if let Some(uncertainty) = &configuration.uncertainty {
            uncertainty.check(&configuration.plant)?;
        }
        if let Some(follower) = &configuration.run.follower {
            follower.check(&configuration.plant)?;
        }
        // Check every number by itself.
        configuration.experiment.check()?;
        for parameter in configuration.parameters() {
            parameter.check(&mut configuration)?;
        }
        // The filter itself refuses what the ranges of single numbers cannot.
        if let Some(policy) = &configuration.policy {
            configuration.plant.functions::<f64>("policy", policy)?;
        }
        configuration.check_horizon()?;
        configuration.check_budget()?;
        let rows = configuration.examine()?;
        let filter = configuration.completed(rows)?;
        configuration.check_margins(&filter)?;
        if *configuration.run != RunSection::default() {
            configuration.alone()?;
        }
        Ok(configuration)
    }

    /// Refuses a horizon that is no time, or shorter than a step.
    fn check_horizon(&self) -> Result<(), ConfigurationError> {
        let (Some(horizon), step) = (self.plan_horizon, self.experiment.step_size) else { return Ok(()) };
        match horizon.is_finite() && horizon >= step {
            true => Ok(()),
            false => {
                let message = format!("is {horizon} s, must be finite, and at least a step ({step} s)");
                Err(ConfigurationError::new("plan_horizon", message))
            }
        }
    }

    /// Refuses a budget of nothing, or one beyond counting.
    fn check_budget(&self) -> Result<(), ConfigurationError> {
        match self.search_budget {
            Some(programs) if !(1..=MOST_PROGRAMS).contains(&u64::from(programs)) => {
                let message = format!("is {programs}, must be 1 to {MOST_PROGRAMS}");
                Err(ConfigurationError::new("search_budget", message))
            }
            _ => Ok(()),
        }
    }

    /// States the bounds of every input.
    fn complete_bounds(&mut self) -> Result<(), ConfigurationError> {
        let inputs = self.plant.inputs();
        check_known("bounds", &self.bounds, "input", &inputs)?;
        for input in inputs {
            let own = [input.min.unwrap_or(-UNBOUNDED), input.max.unwrap_or(UNBOUNDED)];
            let [min, max] = self.bounds.entry(input.name).or_insert(own);
            // Not `f64::max`, since a value that is not a number has to reach the check below.
            if *min < -UNBOUNDED {
                *min = -UNBOUNDED;
            }
            if *max > UNBOUNDED {
                *max = UNBOUNDED;
            }
        }
        Ok(())
    }

    /// Refuses a margin that h never has. It checks shapes whose largest h is known, at their centre or at rest.
    fn check_margins(&self, filter: &Filter) -> Result<(), ConfigurationError> {
        let states = self.plant.states().len();
        let mut x = vec![0.0; states];
        x.extend(self.barrier_inputs().iter().map(|input| input.start));
        let mut h = vec![0.0; self.barrier.len()];
        for (i, section) in self.barrier.iter().enumerate() {
            let Some(centre) = section.shape.inmost() else { continue };
            for (axis, at) in centre.iter().enumerate() {
                x[self.position_of(section, axis)] = *at;
            }
            let named = |e: punctual_core::Error| ConfigurationError::new(e.field(), e.message());
            filter.barrier_values(0.0, &x, &mut h).map_err(named)?;
            let margin = section.margin;
            if margin >= h[i] {
                let (unit, largest) = (section.unit(&self.plant), h[i]);
                let unit = match shown_unit(&unit) {
                    "" => String::new(),
                    unit => format!(" {unit}"),
                };
                let message = format!(
                    "is {margin}{unit}, must be < {largest:.6}{unit}, the largest that h ever is: h >= margin is aimed at"
                );
                return Err(ConfigurationError::new(format!("barrier[{i}].margin"), message));
            }
        }
        Ok(())
    }

    /// The index of the state that is the position of a barrier along an axis.
    fn position_of(&self, section: &BarrierSection, axis: usize) -> usize {
        let is = |state: &VariableSection| section.position.get(axis).is_some_and(|name| *name == state.name);
        self.plant.states().iter().position(is).unwrap_or(axis)
    }

    /// The numbers that are parameters of the FMU.
    pub fn parameters(&self) -> Vec<Parameter<Self>> {
        let range = Range { min: Some(-UNBOUNDED), max: Some(UNBOUNDED) };
        let mut rows = Vec::new();
        for (side, prefix, word) in [(0, "u_min", "smallest"), (1, "u_max", "largest")] {
            for input in self.plant.inputs() {
                let names = (format!("{prefix}.{}", input.name), format!("bounds.{}", input.name));
                let description = format!("{word} {} (no bound: {UNBOUNDED:e} in size)", input.description);
                rows.push(Parameter::new(names, input.unit, range, description, move |c: &mut Self| {
                    c.bounds.get_mut(&input.name).map(|bounds| &mut bounds[side])
                }));
            }
        }
        let erroneous = |state: &VariableSection| self.measurement_errors.contains_key(&state.name);
        for state in self.measured_states().into_iter().filter(erroneous) {
            let names =
                (format!("measurement_error.{}", state.name), format!("measurement_errors.{}", state.name));
            let description = format!("largest error of the measured {}", state.description);
            rows.push(Parameter::new(
                names,
                state.unit,
                Range::NON_NEGATIVE,
                description,
                move |c: &mut Self| c.measurement_errors.get_mut(&state.name),
            ));
        }
        let uncertainty = self.uncertainty.iter();
        rows.extend(uncertainty.flat_map(|uncertainty| uncertainty.parameters(&self.plant)));
        let integrator = self.integrator.iter();
        rows.extend(integrator.flat_map(|i| i.parameters(&self.plant, |c: &mut Self| c.integrator.as_mut())));
        for (i, barrier) in self.barrier.iter().enumerate() {
            rows.extend(barrier.parameters(i, &self.plant, self.relative_degrees().get(i).copied()));
        }
        rows.extend(self.plant.parameters(|c: &mut Self| &mut c.plant));
        // After all others, which kept their value references.
        let names = ("arm_after".to_owned(), "arm_after".to_owned());
        let description = "time from the first step until the filter is armed; before, nothing is promised";
        rows.push(Parameter::new(names, "s", Range::NON_NEGATIVE, description, |c: &mut Self| {
            Some(&mut c.arm_after)
        }));
        if self.may_be_late() {
            let names = ("actuation_delay".to_owned(), "actuation_delay".to_owned());
            let description =
                "time until u acts: a step with a master that exchanges all values first (Jacobi)";
            rows.push(Parameter::new(names, "s", Range::NON_NEGATIVE, description, |c: &mut Self| {
                Some(&mut c.actuation_delay)
            }));
        }
        rows
    }

    /// Whether the filter can account for an [`actuation_delay`](Self::actuation_delay): not behind an integrator, with a barrier
    /// that it cannot predict, or where rows alone account for errors of measurement.
    pub fn may_be_late(&self) -> bool {
        let errs = !self.measurement_errors.is_empty() && !self.is_assured();
        self.integrator.is_none() && self.external().is_none() && !errs
    }

    /// The same filter for a master that exchanges all values before it steps (Jacobi), so that an input acts one step after its
    /// sample: its `actuation_delay` is the step size, unless the file gives a longer one.
    ///
    /// # Errors
    ///
    /// A delay that is shorter than a step and not 0; a filter that accounts for no delay; with `assurance = "on"`, what no plan
    /// accounts for.
    pub fn for_jacobi(mut self) -> Result<Self, ConfigurationError> {
        let (delay, step) = (self.actuation_delay, self.experiment.step_size);
        let refuse = |message: String| Err(ConfigurationError::new("actuation_delay", message));
        if delay >= step {
            return Ok(self);
        }
        if delay > 0.0 {
            return refuse(format!(
                "is {} s, must be at least the step of {} s for a Jacobi master, which hands an input on one step after its \
                 sample; without the key it is that step",
                number(delay),
                number(step)
            ));
        }
        if !self.may_be_late() {
            return refuse(format!(
                "is 0, must be the step of {} s for a Jacobi master, and this filter accounts for no delay: leave out {}, or use a \
                 master that lets the filter act at once (Gauss-Seidel)",
                number(step),
                match (&self.integrator, self.external()) {
                    (Some(_), _) => "[integrator]",
                    (None, Some(_)) => "the external barriers",
                    (None, None) => "[measurement_errors], for which the rows alone account here",
                }
            ));
        }
        self.actuation_delay = step;
        let rows = self.examine()?;
        self.completed(rows)?;
        Ok(self)
    }

    /// What becomes of barrier `index` where not all can be met.
    pub(super) fn strictness(&self, index: usize) -> Result<Strictness, ConfigurationError> {
        let section = &self.barrier[index];
        match (section.penalty, section.priority) {
            (Some(_), Some(_)) => {
                let message = "belongs to hard barriers, this one has a penalty";
                Err(ConfigurationError::new(format!("barrier[{index}].priority"), message))
            }
            (Some(penalty), None) => Ok(Strictness::Soft(penalty)),
            (None, Some(priority)) => Ok(Strictness::Priority(priority)),
            (None, None) => Ok(Strictness::KeepFirst),
        }
    }

    /// `[min, max]` of each input of the plant, infinite where there is no bound.
    pub(super) fn input_bounds(&self) -> Result<Vec<[f64; 2]>, ConfigurationError> {
        let mut all = Vec::new();
        for input in self.plant.inputs() {
            let [low, high] = self.bounds.get(&input.name).copied().unwrap_or([-UNBOUNDED, UNBOUNDED]);
            if low > high {
                let message = format!(
                    "is [{low}, {high}], must be [min, max] with min <= max (in an FMU: u_min.{name}, u_max.{name})",
                    name = input.name
                );
                return Err(ConfigurationError::new(format!("bounds.{}", input.name), message));
            }
            let min = if low <= -UNBOUNDED { f64::NEG_INFINITY } else { low };
            let max = if high >= UNBOUNDED { f64::INFINITY } else { high };
            all.push([min, max]);
        }
        Ok(all)
    }

    pub(super) fn sampling(&self, step_size: f64) -> Sampling {
        match self.sampling {
            SamplingName::Pointwise => Sampling::Pointwise,
            SamplingName::Measured => Sampling::Measured { first: Some(step_size) },
            SamplingName::StepSize => Sampling::Period(step_size),
        }
    }

    /// The filter, not yet anchored.
    ///
    /// # Errors
    ///
    /// A number outside its range, or a lower input bound above its upper bound.
    pub fn build(&self) -> Result<Filter, ConfigurationError> {
        self.built(if self.is_assured() { MixedDegree::Taken } else { MixedDegree::Refused })
    }

    /// The filter, with what becomes of barriers whose inputs enter at different orders.
    pub(super) fn built(&self, mut mixed_degree: MixedDegree<'_>) -> Result<Filter, ConfigurationError> {
        let inputs = self.plant.inputs();
        let states = self.plant.states().len();
        let is_for_plans = !matches!(mixed_degree, MixedDegree::Refused);
        let mut next_point = states;
        let plant = Forms::default();
        let mut builder = Filter::from_sources(states, inputs.len()).measured(self.barrier_inputs().len());
        // The barriers, each with its window and its strictness.
        for (i, section) in self.barrier.iter().enumerate() {
            let first = next_point;
            next_point += section.inputs(&self.plant).len();
            let mixed_degree = mixed_degree.reborrow();
            builder = section.shape.add(Adding {
                configuration: self,
                plant: &plant,
                builder,
                index: i,
                first,
                mixed_degree,
            })?;
            let (begin, end) = self.window(i)?;
            let strictness = self.strictness(i)?;
            builder = builder
                .window(begin, end)
                .and_then(|b| b.strictness(strictness))
                .map_err(|e| self.refused(i, &e))?;
        }
        // The bounds of the inputs, and the errors of the measurements.
        let (min, max): (Vec<f64>, Vec<f64>) =
            self.input_bounds()?.into_iter().map(|[min, max]| (min, max)).unzip();
        let errors = match is_for_plans && self.leaves_errors_to_plans() {
            true => vec![0.0; states + self.barrier_inputs().len()],
            false => self.errors(),
        };
        if let Some(uncertainty) = &self.uncertainty {
            uncertainty.check_intervals()?;
        }
        // The settings of the whole filter.
        builder
            .bounds(&min, &max)
            .and_then(|b| b.correction_limit(self.correction_limit))
            .map(|b| b.brief_search(self.brief_search))
            .and_then(|b| b.actuation_delay(self.actuation_delay))
            .and_then(|b| if self.period_max == 0.0 { Ok(b) } else { b.period_max(self.period_max) })
            .and_then(|b| b.arm_after(self.arm_after))
            .and_then(|b| b.sampling(self.sampling(self.experiment.step_size)))
            .and_then(|b| b.measurement_errors(&errors))
            .and_then(FilterBuilder::build)
            .map_err(|e| ConfigurationError::new(e.field(), e.message()))
    }

    /// The largest error of each measured quantity.
    pub(super) fn errors(&self) -> Vec<f64> {
        let of = |name: &str| self.measurement_errors.get(name).copied().unwrap_or(0.0);
        let states = self.plant.states().into_iter().map(|state| of(&state.name));
        states.chain(self.barrier_inputs().iter().map(|_| 0.0)).collect()
    }

    /// Whether plans alone account for errors of measurement: rows do not beside a delay.
    pub(super) fn leaves_errors_to_plans(&self) -> bool {
        self.actuation_delay > 0.0 && !self.measurement_errors.is_empty()
    }

    /// The same filter, armed at its first step.
    #[must_use]
    pub fn armed_at_once(mut self) -> Self {
        self.arm_after = 0.0;
        self
    }

    /// Whether an input has a bound.
    pub fn is_bounded(&self) -> bool {
        self.bounds.values().any(|[min, max]| *min > -UNBOUNDED || *max < UNBOUNDED)
    }

    /// The measured states: those of the plant but the integrated one.
    pub fn measured_states(&self) -> Vec<VariableSection> {
        let integrated = |s: &VariableSection| self.integrator.as_ref().is_some_and(|i| i.state == s.name);
        self.plant.states().into_iter().filter(|s| !integrated(s)).collect()
    }

    /// Of the numbers `x`, one for each state of the plant, those that are [measured](Self::measured_states); and those of
    /// barriers behind them.
    pub fn measured(&self, x: &[f64]) -> Vec<f64> {
        let states = self.plant.states();
        let (states_of_x, of_barriers) = x.split_at(states.len().min(x.len()));
        let is_measured = |name: &str| self.integrator.as_ref().is_none_or(|i| i.state != name);
        let own = states_of_x.iter().zip(states).filter(|(_, state)| is_measured(&state.name));
        own.map(|(x, _)| *x).chain(of_barriers.iter().copied()).collect()
    }

    /// The bounds of a signal that the filter [hands out](Self::commanded), where it has both.
    pub fn limits(&self, name: &str) -> Option<[f64; 2]> {
        self.limits_given(name).filter(|limits| limits.iter().all(|limit| limit.abs() < UNBOUNDED))
    }

    /// What such a signal lacks of its bounds, in words.
    pub(super) fn lacking(&self, name: &str) -> &'static str {
        match self.limits_given(name).map(|limits| limits.map(|limit| limit.abs() < UNBOUNDED)) {
            Some([true, false]) => "no upper bound",
            Some([false, true]) => "no lower bound",
            _ => "no bounds",
        }
    }

    fn limits_given(&self, name: &str) -> Option<[f64; 2]> {
        let integrator = self.integrator.as_ref().filter(|i| i.state == name);
        integrator.map(IntegratorSection::limits).or(self.bounds.get(name).copied())
    }

    /// The signals that the filter hands out and is asked for: the inputs of the plant, the integrated state in
    /// place of its rate.
    pub fn commanded(&self) -> Vec<VariableSection> {
        let mut inputs = self.plant.inputs();
        if let Some((state, input)) = self.integrator.as_ref().and_then(|i| i.place(&self.plant).ok()) {
            inputs[input] = self.plant.states().swap_remove(state);
        }
        inputs
    }

    /// The inputs that belong to barriers; they follow the states of the plant in the filter's.
    pub fn barrier_inputs(&self) -> Vec<BarrierInput> {
        self.barrier.iter().flat_map(|b| b.inputs(&self.plant)).collect()
    }

    /// The conditions under which barrier `index` begins and ceases to be enforced.
    pub(super) fn window(&self, index: usize) -> Result<(Begin, End), ConfigurationError> {
        let section = &self.barrier[index];
        let refuse = |field: &str, message: String| {
            Err(ConfigurationError::new(format!("barrier[{index}].{field}"), message))
        };
        let begin = match (&section.after, section.begin) {
            (Some(_), Some(begin)) => {
                return refuse("begin", format!("is {begin}, must be 0 beside `after`"));
            }
            (Some(name), None) => match self.barrier[..index].iter().position(|b| b.name == *name) {
                Some(other) => Begin::AfterArrival(other),
                None => return refuse("after", format!("is {name:?}, must be the name of a barrier above")),
            },
            (None, Some(begin)) if begin > 0.0 => Begin::At(begin),
            (None, _) => Begin::AtOnce,
        };
        let (stay, end) = (section.stay.filter(|stay| *stay > 0.0), section.end.filter(|end| *end > 0.0));
        let ends = [
            ("until_arrival", section.until_arrival),
            ("stay", stay.is_some()),
            ("until", section.until.is_some()),
        ];
        let mut given = ends.iter().filter(|(_, is_given)| *is_given).map(|(key, _)| *key);
        let (first, second) = (given.next(), given.next());
        if let (Some(first), Some(second)) = (first, second) {
            return refuse(second, format!("given beside `{first}`, must be without: each is an end"));
        }
        if let (Some(first), Some(end)) = (first, section.end) {
            return refuse("end", format!("is {end}, must be 0 beside `{first}`"));
        }
        let end = match (stay, &section.until, end) {
            (Some(stay), ..) => End::AfterStay(stay),
            (_, Some(name), _) => match self.barrier.iter().position(|b| b.name == *name) {
                Some(other) if other != index => End::AfterArrival(other),
                _ => return refuse("until", format!("is {name:?}, must be the name of another barrier")),
            },
            _ if section.until_arrival => End::OnArrival,
            (.., Some(end)) => End::At(end),
            (.., None) => End::Never,
        };
        Ok((begin, end))
    }
}

/// Barriers, inputs and states by their names. After the barriers come the limits of the integrator; one of a state from
/// elsewhere may have any number.
impl Names for FilterConfiguration {
    fn barrier(&self, barrier: usize) -> String {
        match (self.barrier.get(barrier), &self.integrator) {
            (Some(section), _) => section.name.clone(),
            (None, Some(integrator)) => format!("the limit of {}", integrator.state),
            (None, None) => "a barrier".to_owned(),
        }
    }

    fn amount(&self, barrier: usize, value: f64) -> String {
        let unit = match (self.barrier.get(barrier), &self.integrator) {
            (Some(section), _) => section.unit(&self.plant),
            (None, Some(integrator)) => {
                let state = self.plant.states().into_iter().find(|s| s.name == integrator.state);
                state.map(|s| s.unit).unwrap_or_default()
            }
            (None, None) => String::new(),
        };
        quantity(value, &unit)
    }

    fn time(&self, time: f64) -> String {
        number(time)
    }

    fn input(&self, input: usize) -> String {
        self.plant.inputs().into_iter().nth(input).map_or_else(|| "an input".to_owned(), |input| input.name)
    }

    fn input_amount(&self, input: usize, value: f64) -> String {
        let unit = self.plant.inputs().into_iter().nth(input).map(|input| input.unit);
        quantity(value, &unit.unwrap_or_default())
    }

    fn state(&self, state: usize) -> String {
        self.plant.states().into_iter().nth(state).map_or_else(|| "a state".to_owned(), |state| state.name)
    }

    fn state_amount(&self, state: usize, value: f64) -> String {
        let unit = self.plant.states().into_iter().nth(state).map(|state| state.unit);
        quantity(value, &unit.unwrap_or_default())
    }

    fn apart(&self, barriers: [usize; 2]) -> String {
        self.apart_in_words(barriers).unwrap_or_default()
    }
}
