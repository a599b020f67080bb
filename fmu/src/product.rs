//! The interface of an FMU: variables, value references, model description, GUID.
//!
//! The table built here is the only source of value references. Both the XML file and the accessors of the
//! running instance are derived from it.

mod arrays;
mod description;
mod outputs;

pub(crate) use arrays::Access;
pub use arrays::{Item, TIME};
pub use outputs::{BARRIER_OUTPUTS, BarrierOutput, Reading};

use punctual_core::filter::{AssuranceStatus, Phase, Status};
use punctual_modeldescription::{
    Causality, CoSimulation, DefaultExperiment, EnumerationItem, Integer, LogCategory, ModelDescription,
    NamingConvention, Plain, Real, SimpleType, Unit, Variability, Variable, VariableKind,
};
use uuid::Uuid;

use crate::configuration::{
    BarrierInput, Configuration, ConfigurationError, Controller, ControllerConfiguration,
    FilterConfiguration, FmiVersion, Parameter, PlantConfiguration, PlantSection, Range, VariableSection,
    base_unit, quantity,
};

/// Log categories: name and meaning.
pub const LOG_CATEGORIES: [(&str, &str); 3] = [
    ("logStatusError", "calls that failed, with the reason"),
    ("logEvents", "what happened: instantiation, initialization, reset"),
    (
        "logStatusWarning",
        "guarantees that were refused or lost, with the reason, or regained; times of steps that were rolled back",
    ),
];

/// Everything derived from one configuration.
pub struct Product {
    /// The configuration, with every value filled in.
    pub configuration: Configuration,
    /// The variables; the value reference of each is its index.
    pub variables: Vec<Variable>,
    /// Positions of the groups of variables.
    pub layout: Layout,
    /// The ranges of the parameters, in the order of the table.
    pub ranges: Vec<Range>,
    /// `{…}`: differs between FMUs with different configurations, variables or versions.
    pub guid: String,
    /// The variables of an FMU for FMI 3.0, in the order of their value references; empty for FMI 2.0, whose
    /// variables are those of the table.
    pub items: Vec<Item>,
}

/// Value references of the groups of variables, in the order of the table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Layout {
    /// Number of states: the first inputs of a filter (with the inputs of its barriers) or controller (with
    /// the goal if it is an input), the outputs of a plant.
    pub states: usize,
    /// Number of inputs of the plant.
    pub inputs: usize,
    /// First output.
    pub outputs: usize,
    /// First parameter.
    pub parameters: usize,
    /// One past the last parameter: the first code, if there are [codes](Product::enumerated).
    pub end: usize,
}

impl Product {
    /// Derives everything from a completed configuration.
    ///
    /// # Errors
    ///
    /// With `fmi = 3`, a name that FMI 3.0 reserves.
    pub fn new(configuration: Configuration) -> Result<Self, ConfigurationError> {
        let (Table { variables, ranges }, layout) = match &configuration {
            Configuration::Filter(c) => filter_variables(c),
            Configuration::Plant(c) => plant_variables(c),
            Configuration::Controller(c) => controller_variables(c),
        };
        let guid = guid(&configuration.canonical()?, &variables);
        let experiment = configuration.experiment();
        let items = match experiment.fmi {
            FmiVersion::Two => Vec::new(),
            FmiVersion::Three => arrays::items(&variables, &layout, experiment.arrays),
        };
        if let Some(other) = variables.iter().find(|v| !items.is_empty() && v.name == TIME) {
            let message =
                format!("is {:?}, which is the name of the time with `fmi = 3`; choose another", other.name);
            return Err(ConfigurationError::new("plant.parameters", message));
        }
        Ok(Self { configuration, variables, layout, ranges, guid, items })
    }

    /// The variable of FMI 3.0 that contains the scalar `index` of the table.
    pub(crate) fn item_of(&self, index: usize) -> &Item {
        let after = self.items.partition_point(|item| item.scalars.start <= index);
        &self.items[after.saturating_sub(1)]
    }

    /// The access that importers of FMI 3.0 have to each value reference; empty for FMI 2.0.
    pub(crate) fn accesses(&self) -> Vec<Access> {
        arrays::accesses(&self.variables, &self.items)
    }

    /// The outputs that are enumerations. Each has an Integer twin, from [`Layout::end`] on in the same
    /// order, for importers that drop enumerations. (They come last, so that every other variable kept its
    /// value reference.)
    pub fn enumerated(&self) -> impl Iterator<Item = usize> + '_ {
        enumerated(&self.variables)
    }

    /// The model description.
    pub fn model_description(&self) -> ModelDescription {
        let name = self.configuration.name().to_owned();
        let experiment = self.configuration.experiment();
        let description = match &self.configuration {
            Configuration::Filter(c) => {
                let late = match c.actuation_delay > 0.0 {
                    true => format!(", whose input acts {} s after its sample", c.actuation_delay),
                    false => String::new(),
                };
                format!("Fixed-time safety filter for a {}{late}", c.plant.title())
            }
            Configuration::Plant(c) => match &c.plant {
                PlantSection::Reference(plant) => format!("Reference plant: {}", plant.model.title()),
                PlantSection::Plugin(_) => "Plant given by a plug-in".to_owned(),
                PlantSection::Expressions(_) | PlantSection::External { .. } => {
                    "Plant given by expressions".to_owned()
                }
            },
            Configuration::Controller(c) => {
                format!("Nominal controller ({}) for a {}", c.controller.name(), c.plant.title())
            }
        };
        ModelDescription {
            model_name: name.clone(),
            guid: self.guid.clone(),
            description,
            author: env!("CARGO_PKG_AUTHORS").to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            license: env!("CARGO_PKG_LICENSE").to_owned(),
            generation_tool: concat!("Punctual ", env!("CARGO_PKG_VERSION")).to_owned(),
            variable_naming_convention: NamingConvention::Structured,
            co_simulation: CoSimulation {
                model_identifier: name,
                can_handle_variable_step: true,
                can_not_use_memory_management_functions: true,
                can_get_and_set_state: true,
                can_serialize_state: true,
                provides_directional_derivative: true,
                ..CoSimulation::default()
            },
            units: units(self.variables.iter().filter_map(|v| v.kind.unit())),
            types: match &self.configuration {
                Configuration::Filter(c) => {
                    let mut types = vec![status_type(), phase_type()];
                    types.extend(c.is_assured().then(assurance_type));
                    types
                }
                Configuration::Plant(_) | Configuration::Controller(_) => Vec::new(),
            },
            log_categories: LOG_CATEGORIES
                .map(|(name, description)| LogCategory { name: name.into(), description: description.into() })
                .into(),
            default_experiment: Some(DefaultExperiment {
                start_time: Some(experiment.start_time),
                stop_time: Some(experiment.stop_time),
                step_size: Some(experiment.step_size),
                tolerance: None,
            }),
            variables: self.variables.clone(),
            ..ModelDescription::default()
        }
    }
}

/// A text in the library of every FMU that identifies its version.
pub const MARK: &str = concat!("punctual ", env!("CARGO_PKG_VERSION"), "\n");

/// The GUID: a name-based UUID (version 5) over version, canonical configuration and variable table.
fn guid(canonical: &str, variables: &[Variable]) -> String {
    // Without the black box, the mark could become immediate operands and not be found in any library.
    let mut text = format!("{}{canonical}\n", std::hint::black_box(MARK));
    for v in variables {
        let (causality, variability) = (v.causality.as_str(), v.variability.as_str());
        text +=
            &format!("{} {} {causality} {variability} {:?}\n", v.value_reference, v.name, v.kind.base_type());
    }
    format!("{{{}}}", Uuid::new_v5(&Uuid::NAMESPACE_OID, text.as_bytes()))
}

/// The units used. One that [`base_unit`] cannot read is omitted, and the XML is then refused.
fn units<'a>(names: impl Iterator<Item = &'a str>) -> Vec<Unit> {
    let mut names: Vec<&str> = names.collect();
    names.sort_unstable();
    names.dedup();
    names
        .into_iter()
        .filter_map(|name| {
            Some(Unit { name: name.to_owned(), base: Some(base_unit(name)?), ..Unit::default() })
        })
        .collect()
}

/// The suffix of the Integer twin of an enumeration.
pub const CODE: &str = "_code";

/// The positions of the outputs that are enumerations.
fn enumerated(variables: &[Variable]) -> impl Iterator<Item = usize> + '_ {
    let is_enumerated =
        |v: &Variable| v.causality == Causality::Output && matches!(v.kind, VariableKind::Enumeration(_));
    variables.iter().enumerate().filter(move |(_, v)| is_enumerated(v)).map(|(i, _)| i)
}

/// The enumeration type of `status`.
const STATUS: &str = "Status";

/// The enumeration type of `<barrier>.phase`.
const PHASE: &str = "Phase";

fn enumeration(name: &str, description: &str, items: &[(&str, i32, &str)]) -> SimpleType {
    let item = |&(name, value, description): &(&str, i32, &str)| EnumerationItem {
        name: name.into(),
        value,
        description: description.into(),
    };
    SimpleType::enumeration(name, description, items.iter().map(item).collect())
}

fn status_type() -> SimpleType {
    let items = Status::ALL.map(|status| (status.name(), status as i32, status.meaning()));
    enumeration(STATUS, "What the filter's input means", &items)
}

fn phase_type() -> SimpleType {
    let items = Phase::ALL.map(|phase| (phase.name(), phase as i32, phase.meaning()));
    enumeration(PHASE, "Phase of a barrier's promise", &items)
}

/// The enumeration type of `assurance`.
const ASSURANCE: &str = "Assurance";

fn assurance_type() -> SimpleType {
    let items = AssuranceStatus::ALL.map(|assurance_status| {
        (assurance_status.name(), assurance_status as i32, assurance_status.meaning())
    });
    enumeration(ASSURANCE, "Status of the guarantee of a filter that follows plans", &items)
}

/// Collects variables; their value references are their indices.
#[derive(Default)]
struct Table {
    variables: Vec<Variable>,
    ranges: Vec<Range>,
}

impl Table {
    fn add(
        &mut self,
        name: String,
        description: &str,
        causality: Causality,
        kind: VariableKind,
    ) -> &mut Variable {
        let value_reference = self.variables.len() as u32;
        let variability = match (causality, &kind) {
            (Causality::Parameter, _) => Variability::Fixed,
            (_, VariableKind::Real(_)) => Variability::Continuous,
            _ => Variability::Discrete,
        };
        self.variables.push(Variable {
            name,
            value_reference,
            description: description.to_owned(),
            causality,
            variability,
            initial: None,
            kind,
            dependencies: None,
            initial_dependencies: None,
        });
        let last = self.variables.len() - 1;
        &mut self.variables[last]
    }

    fn signal(
        &mut self,
        prefix: &str,
        signal: &VariableSection,
        what: &str,
        causality: Causality,
    ) -> &mut Variable {
        let start = (causality == Causality::Input).then_some(0.0);
        let description = if signal.description.is_empty() { &signal.name } else { &signal.description };
        self.add(
            format!("{prefix}.{}", signal.name),
            &format!("{what}{description}"),
            causality,
            real(start, &signal.unit),
        )
    }

    fn parameter<C>(&mut self, row: &Parameter<C>, configuration: &mut C) {
        let kind = VariableKind::Real(Real {
            start: Some(row.get(configuration)),
            min: row.range.min,
            max: row.range.max,
            quantity: quantity(&row.unit),
            unit: Some(row.unit.clone().into_owned()),
            ..Real::default()
        });
        let variable = self.add(row.name.clone(), &row.description, Causality::Parameter, kind);
        if row.tunable {
            variable.variability = Variability::Tunable;
        }
        self.ranges.push(row.range);
    }

    /// Adds an Integer twin of each output that is an enumeration.
    fn codes(&mut self) {
        for i in enumerated(&self.variables).collect::<Vec<_>>() {
            let Variable { name, description, dependencies, .. } = &self.variables[i];
            let (name, description) =
                (format!("{name}{CODE}"), format!("{description}: the number of `{name}`"));
            let (kind, dependencies) =
                (VariableKind::Integer(Integer { min: Some(0), ..Integer::default() }), dependencies.clone());
            self.add(name, &description, Causality::Output, kind).dependencies = dependencies;
        }
    }

    /// Adds the parameters of `configuration`, which come after the outputs, then the codes, and completes
    /// `layout` with their positions.
    fn finish<C: Clone>(
        mut self,
        configuration: &C,
        rows: &[Parameter<C>],
        layout: Layout,
    ) -> (Self, Layout) {
        let parameters = self.variables.len();
        let mut configuration = configuration.clone();
        for row in rows {
            self.parameter(row, &mut configuration);
        }
        let end = self.variables.len();
        self.codes();
        (self, Layout { parameters, end, ..layout })
    }
}

fn real(start: Option<f64>, unit: &str) -> VariableKind {
    let (quantity, unit) = (quantity(unit), Some(unit.to_owned()));
    VariableKind::Real(Real { start, quantity, unit, ..Real::default() })
}

fn filter_variables(c: &FilterConfiguration) -> (Table, Layout) {
    let (states, inputs) = (&c.measured_states(), &c.commanded());
    let mut table = Table::default();
    // Inputs: measured states, those of the barriers, the reference, the re-arming.
    for state in states {
        let measured = table.signal("x", state, "measured ", Causality::Input);
        if let VariableKind::Real(Real { start, min, max, .. }) = &mut measured.kind {
            (*start, *min, *max) = (Some(state.range().nearest(0.0)), state.min, state.max);
        }
    }
    for BarrierInput { name, unit, start, description } in c.barrier_inputs() {
        table.add(name, &description, Causality::Input, real(Some(start), &unit));
    }
    let measured = table.variables.len();
    for input in inputs {
        table.signal("u_ref", input, "wanted ", Causality::Input);
    }
    let rearm = VariableKind::Boolean(Plain { start: Some(false), declared_type: None });
    table.add("rearm".into(), "a rising edge restarts every deadline", Causality::Input, rearm);

    let outputs = table.variables.len();
    let output = Causality::Output;
    // Outputs: the safe input and the status, those of each barrier, the assurance, the integrated state.
    for input in inputs {
        table.signal("u", input, "safe ", output);
    }
    let enumerated = |t: &str| VariableKind::enumeration(t);
    table.add("status".into(), "what u means", output, enumerated(STATUS));
    for (barrier, &degree) in c.barrier.iter().zip(c.relative_degrees()) {
        let unit = &barrier.unit(&c.plant);
        for row in &BARRIER_OUTPUTS {
            let kind = match row.reading {
                Reading::Real(own, ..) => real(None, &own.of_barrier(unit, degree)),
                Reading::Count(_) => VariableKind::Integer(Integer { min: Some(0), ..Integer::default() }),
                Reading::Flag(_) => VariableKind::Boolean(Plain::default()),
                Reading::Phase => enumerated(PHASE),
            };
            table.add(format!("{}.{}", barrier.name, row.name), row.description, output, kind);
        }
    }
    if c.is_assured() {
        table.add("assurance".into(), "status of the guarantee", output, enumerated(ASSURANCE));
        let most = c.barrier.len() as i32;
        let number = VariableKind::Integer(Integer { min: Some(0), max: Some(most), ..Integer::default() });
        let reason = "number of the barrier for which u_ref was changed, in their order; 0 for none";
        table.add("reason".into(), reason, output, number);
    }
    if c.ends_plans() {
        let until =
            "time until which the guarantee holds, 1e30 for ever; the current time if nothing is assured";
        table.add("assured_until".into(), until, output, real(None, "s"));
    }
    if let Some(integrator) = &c.integrator {
        let (name, inputs) = (&integrator.state, c.commanded());
        let unit = inputs.iter().find(|i| i.name == *name).map_or("1", |i| &i.unit);
        let ahead = "what the filter has integrated, at the end of the step; u is its mean over the step";
        table.add(format!("integrator.{name}"), ahead, output, real(None, unit));
    }
    // Every output depends on all inputs immediately, or on none until a step.
    let direct: Vec<u32> = if c.direct_feedthrough { (0..outputs as u32).collect() } else { Vec::new() };
    for variable in &mut table.variables[outputs..] {
        variable.dependencies = Some(direct.clone());
    }

    table.finish(
        c,
        &c.parameters(),
        Layout { states: measured, inputs: inputs.len(), outputs, ..Layout::default() },
    )
}

fn plant_variables(c: &PlantConfiguration) -> (Table, Layout) {
    let (states, inputs) = (&c.plant.states(), &c.plant.inputs());
    let mut table = Table::default();
    for input in inputs {
        table.signal("u", input, "", Causality::Input);
    }
    let outputs = table.variables.len();
    let (reported, least) = (c.output_signals(), c.least_signals());
    let parameters = outputs + states.len() + reported.len() + least.len();
    for (i, state) in states.iter().enumerate() {
        let variable = table.signal("x", state, "", Causality::Output);
        variable.dependencies = Some(Vec::new());
        // `x0.*` are the first parameters, in the order of the states.
        variable.initial_dependencies = Some(vec![(parameters + i) as u32]);
    }
    let rows = c.parameters();
    for output in &reported {
        let variable = table.signal("y", output, "", Causality::Output);
        variable.dependencies = Some(Vec::new());
        if c.experiment.fmi == FmiVersion::Three {
            // At the start, it may depend on any state and constant. In FMI 2.0, omitting the dependencies
            // means just that.
            let all = parameters..parameters + rows.len();
            variable.initial_dependencies = Some(all.map(|i| i as u32).collect());
        }
    }
    for barrier in &least {
        table.signal("least_h", barrier, "least ", Causality::Output).dependencies = Some(Vec::new());
    }
    let layout = Layout { states: states.len(), inputs: inputs.len(), outputs, ..Layout::default() };
    table.finish(c, &rows, layout)
}

fn controller_variables(c: &ControllerConfiguration) -> (Table, Layout) {
    let (states, inputs) = (c.plant.states(), c.plant.inputs());
    let mut table = Table::default();
    for state in &states {
        table.signal("x", state, "measured ", Causality::Input);
    }
    for (name, unit, start, description) in c.goal_inputs() {
        table.add(name.to_owned(), description, Causality::Input, real(Some(start), unit));
    }
    let outputs = table.variables.len();
    for (i, input) in inputs.iter().enumerate() {
        // Damping depends on the states that it opposes; driving to a goal depends on all of them.
        let dependencies = match c.controller {
            _ if !c.direct_feedthrough => Vec::new(),
            Controller::Damping { .. } => {
                c.damped().iter().filter(|pair| pair.1 == i).map(|pair| pair.0 as u32).collect()
            }
            _ => (0..outputs as u32).collect(),
        };
        table.signal("u_ref", input, "wanted ", Causality::Output).dependencies = Some(dependencies);
    }
    if let Controller::Waypoints { points, .. } = &c.controller {
        let max = i32::try_from(points.len()).ok();
        let kind = VariableKind::Integer(Integer { min: Some(1), max, ..Integer::default() });
        let waypoint = "which of the points is the goal, from 1";
        let position = if c.direct_feedthrough { vec![0, 1] } else { Vec::new() };
        table.add("waypoint".into(), waypoint, Causality::Output, kind).dependencies = Some(position);
    }
    table.finish(
        c,
        &c.parameters(),
        Layout { states: outputs, inputs: inputs.len(), outputs, ..Layout::default() },
    )
}

#[cfg(test)]
mod tests;
