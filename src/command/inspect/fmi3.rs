//! The report on an FMU of FMI 3.0 with any interface.

use std::collections::HashMap;
use std::fmt;

use punctual_cosim::host::Archive;
use punctual_modeldescription::fmi3::{
    self, Located, LocatedTerminals, ModelDescription, TERMINALS, Terminals, Variable,
};
use punctual_modeldescription::{Causality, RULES, Severity};
use roxmltree::Document;
use serde::Serialize;

use super::{DependencyReport, Facts, Report, VariableReport, experiment, flags, given};

/// An interface and its capabilities, by the names in the file.
#[derive(Serialize)]
pub(super) struct Interface<'a> {
    kind: &'static str,
    model_identifier: &'a str,
    needs_execution_tool: bool,
    can_be_instantiated_only_once_per_process: bool,
    can_get_and_set_fmu_state: bool,
    can_serialize_fmu_state: bool,
    provides_directional_derivatives: bool,
    provides_adjoint_derivatives: bool,
    provides_per_element_dependencies: bool,
    #[serde(flatten)]
    own: Own,
}

/// Attributes that only one interface has.
#[derive(Serialize)]
#[serde(untagged)]
enum Own {
    ModelExchange {
        needs_completed_integrator_step: bool,
        provides_evaluate_discrete_states: bool,
    },
    CoSimulation {
        can_handle_variable_communication_step_size: bool,
        fixed_internal_step_size: Option<f64>,
        max_output_derivative_order: u32,
        recommended_intermediate_input_smoothness: i32,
        provides_intermediate_update: bool,
        might_return_early_from_do_step: bool,
        can_return_early_after_intermediate_update: bool,
        has_event_mode: bool,
        provides_evaluate_discrete_states: bool,
    },
    ScheduledExecution {},
}

/// A terminal and its members.
#[derive(Serialize)]
pub(super) struct Terminal<'a> {
    name: &'a str,
    /// The name of the parent terminal.
    inside: Option<&'a str>,
    matching_rule: &'a str,
    /// Names in the terminal, each with its variable.
    members: Vec<(&'a str, &'a str)>,
}

impl fmt::Display for Terminal<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "terminal {}", self.name)?;
        if let Some(outer) = self.inside {
            write!(f, " of {outer}")?;
        }
        let members: Vec<_> = self
            .members
            .iter()
            .map(|(name, variable)| match *name {
                "" => (*variable).to_owned(),
                name if name == *variable => name.to_owned(),
                name => format!("{name} = {variable}"),
            })
            .collect();
        write!(f, " ({}): {}", self.matching_rule, members.join(", "))
    }
}

/// The size of a dimension.
#[derive(Serialize)]
#[serde(untagged)]
pub(super) enum Size<'a> {
    Fixed(u64),
    Of(&'a str),
    Unknown(()),
}

impl fmt::Display for Size<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed(size) => write!(f, "{size}"),
            Self::Of(name) => f.write_str(name),
            Self::Unknown(()) => f.write_str("?"),
        }
    }
}

/// The terminals of the archive; none if there is no such file or it cannot be read, which `punctual
/// validate` reports.
pub(super) fn terminals(archive: &Archive) -> Terminals {
    let text = archive.xml(TERMINALS).ok();
    let read = |text: &String| Some(LocatedTerminals::read(&Document::parse(text).ok()?).terminals);
    text.as_ref().and_then(read).unwrap_or_default()
}

/// The errors in the description by the rules beyond the schema.
pub(super) fn problems(located: &Located) -> Vec<String> {
    let mut problems = Vec::new();
    located.check(&mut |violation| {
        let is_error = RULES.iter().any(|row| row.0 == violation.rule && row.1 == Severity::Error);
        if is_error {
            problems.push(violation.message);
        }
    });
    problems
}

pub(super) fn report<'a>(
    archive: &'a Archive,
    version: &'a str,
    located: &'a Located,
    terminals: &'a Terminals,
) -> Report<'a> {
    let d = &located.description;
    let references: HashMap<u32, &Variable> =
        d.variables.iter().rev().map(|v| (v.value_reference, v)).collect();
    let name = |reference: &u32| references.get(reference).map(|v| v.name.as_str());
    let is_input =
        |reference: &&u32| references.get(reference).is_some_and(|v| v.causality == Causality::Input);
    let states = d
        .structure
        .derivatives
        .iter()
        .filter_map(|unknown| references.get(&unknown.value_reference)?.state().as_ref().and_then(name));
    Report {
        file: archive.source().display().to_string(),
        model_name: &d.model_name,
        fmi_version: Some(version),
        instantiation_token: Some(&d.instantiation_token),
        description: given(&d.description),
        author: given(&d.author),
        version: given(&d.version),
        generation_tool: given(&d.generation_tool),
        generation_time: d.generation_date_and_time.as_deref(),
        platforms: archive.platforms(),
        interfaces: Some(interfaces(d)),
        default_experiment: experiment(d.default_experiment),
        variables: d
            .variables
            .iter()
            .zip(&located.starts)
            .map(|(v, start)| variable(d, v, start.as_deref(), &references))
            .collect(),
        dependencies: d
            .structure
            .outputs
            .iter()
            .filter_map(|unknown| {
                let on = unknown.dependencies.as_ref();
                let on = on.map(|list| list.iter().filter(is_input).filter_map(name).collect());
                Some(DependencyReport { output: name(&unknown.value_reference)?, on })
            })
            .collect(),
        states: Some(states.collect()),
        terminals: Some(terminals.terminals.iter().map(|of| terminal(terminals, of)).collect()),
        ..Report::default()
    }
}

fn terminal<'a>(all: &'a Terminals, of: &'a fmi3::Terminal) -> Terminal<'a> {
    let members = of.members.iter().map(|m| (m.member_name.as_str(), m.variable_name.as_str()));
    let streams = of
        .streams
        .iter()
        .flat_map(|m| [(&m.in_member_name, &m.in_variable_name), (&m.out_member_name, &m.out_variable_name)]);
    let streams = streams.map(|(name, variable)| (name.as_str(), variable.as_str()));
    Terminal {
        name: &of.name,
        inside: of.inside.and_then(|t| Some(all.terminals.get(t)?.name.as_str())),
        matching_rule: &of.matching_rule,
        members: members.chain(streams).collect(),
    }
}

fn interfaces(d: &ModelDescription) -> Vec<Interface<'_>> {
    let own = |kind| match (kind, &d.model_exchange, &d.co_simulation) {
        ("ModelExchange", Some(of), _) => Own::ModelExchange {
            needs_completed_integrator_step: of.needs_completed_integrator_step,
            provides_evaluate_discrete_states: of.provides_evaluate_discrete_states,
        },
        ("CoSimulation", _, Some(of)) => Own::CoSimulation {
            can_handle_variable_communication_step_size: of.can_handle_variable_step,
            fixed_internal_step_size: of.fixed_internal_step,
            max_output_derivative_order: of.max_output_derivative_order,
            recommended_intermediate_input_smoothness: of.recommended_intermediate_input_smoothness,
            provides_intermediate_update: of.provides_intermediate_update,
            might_return_early_from_do_step: of.might_return_early,
            can_return_early_after_intermediate_update: of.can_return_early_after_intermediate_update,
            has_event_mode: of.has_event_mode,
            provides_evaluate_discrete_states: of.provides_evaluate_discrete_states,
        },
        _ => Own::ScheduledExecution {},
    };
    let list = d.interfaces().into_iter().map(|(kind, of)| Interface {
        kind,
        model_identifier: &of.model_identifier,
        needs_execution_tool: of.needs_execution_tool,
        can_be_instantiated_only_once_per_process: of.can_be_instantiated_only_once_per_process,
        can_get_and_set_fmu_state: of.can_get_and_set_state,
        can_serialize_fmu_state: of.can_serialize_state,
        provides_directional_derivatives: of.provides_directional_derivatives,
        provides_adjoint_derivatives: of.provides_adjoint_derivatives,
        provides_per_element_dependencies: of.provides_per_element_dependencies,
        own: own(kind),
    });
    list.collect()
}

fn variable<'a>(
    d: &'a ModelDescription,
    v: &'a Variable,
    start: Option<&'a str>,
    references: &HashMap<u32, &'a Variable>,
) -> VariableReport<'a> {
    let declared = d.declared(v);
    let (own, given_range) = (v.kind.range(), declared.map(|of| of.kind.range()).unwrap_or_default());
    let size = |dimension: &fmi3::Dimension| match (dimension.start, dimension.value_reference) {
        (Some(size), None) => Size::Fixed(size),
        (None, Some(reference)) => {
            references.get(&reference).map_or(Size::Unknown(()), |v| Size::Of(&v.name))
        }
        _ => Size::Unknown(()),
    };
    VariableReport {
        name: &v.name,
        value_reference: v.value_reference,
        r#type: v.kind.data_type().as_str(),
        causality: v.causality.as_str(),
        variability: v.variability.as_str(),
        unit: v.kind.unit().or_else(|| declared?.kind.unit()),
        start,
        min: own.0.or(given_range.0),
        max: own.1.or(given_range.1),
        description: given(&v.description),
        items: declared
            .map(|of| &of.items)
            .into_iter()
            .flatten()
            .map(|i| (i.name.as_str(), i.value))
            .collect(),
        dimensions: v.dimensions.iter().map(size).collect(),
        aliases: v.aliases.iter().map(|alias| alias.name.as_str()).collect(),
    }
}

pub(super) fn facts(d: &ModelDescription, version: &str, report: &Report<'_>) -> Facts {
    let mut facts = vec![("fmi", version.to_owned()), ("token", d.instantiation_token.clone())];
    let mut identifiers: Vec<&str> =
        d.interfaces().iter().map(|(_, of)| of.model_identifier.as_str()).collect();
    identifiers.dedup();
    facts.push(("identifier", identifiers.join(", ")));
    let kinds: Vec<_> = d.interfaces().into_iter().map(|(kind, _)| words(kind)).collect();
    facts.push(("interfaces", kinds.join(", ")));
    facts.push(("states", report.states.as_deref().unwrap_or_default().join(", ")));
    // Interfaces that differ have a line each.
    let can = d.interfaces().into_iter().map(|(kind, of)| (words(kind), capabilities(d, kind, of)));
    for (kind, can) in can.filter(|(_, can)| !can.is_empty()) {
        facts.push(("can", format!("{can} (in {kind})")));
    }
    facts
}

/// The name of an interface for the reader.
fn words(kind: &str) -> &'static str {
    match kind {
        "ModelExchange" => "model exchange",
        "CoSimulation" => "co-simulation",
        _ => "scheduled execution",
    }
}

fn capabilities(d: &ModelDescription, kind: &str, of: &fmi3::Interface) -> String {
    let co_simulation = d.co_simulation.as_ref().filter(|_| kind == "CoSimulation");
    let is = |flag: fn(&fmi3::CoSimulation) -> bool| co_simulation.is_some_and(flag);
    flags(&[
        (is(|of| of.can_handle_variable_step), "take steps of any length"),
        (is(|of| of.has_event_mode), "leave events to the importer"),
        (is(|of| of.might_return_early), "return early"),
        (is(|of| of.provides_intermediate_update), "call back between communication points"),
        (of.can_get_and_set_state, "save and restore its state"),
        (of.can_serialize_state, "serialise its state"),
        (of.provides_directional_derivatives, "give directional derivatives"),
        (of.provides_adjoint_derivatives, "give adjoint derivatives"),
        (of.provides_per_element_dependencies, "report dependencies of elements"),
        (of.can_be_instantiated_only_once_per_process, "only be instantiated once per process"),
        (of.needs_execution_tool, "only run with its tool"),
    ])
}
