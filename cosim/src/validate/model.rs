//! The model description of either version, with the queries of the other modules.

use punctual_modeldescription::{self as description, Located, Violation, brief, fmi3, is_c_identifier};
use roxmltree::Document;

use super::finding::{Findings, Mark};
use super::schema::{self, Schema};
use crate::host::Version;

/// A model description.
pub(super) enum Model {
    /// Of FMI 2.0.
    Fmi2(Box<Located>),
    /// Of FMI 3.0.
    Fmi3(Box<fmi3::Located>),
}

impl Model {
    /// Reads a document. If it does not declare FMI 3, it counts as FMI 2.0.
    pub(super) fn read(document: &Document<'_>) -> Self {
        let version = document.root_element().attribute("fmiVersion").unwrap_or_default();
        if version.starts_with('3') {
            Self::Fmi3(Box::new(fmi3::Located::read(document)))
        } else {
            Self::Fmi2(Box::new(Located::read(document)))
        }
    }

    /// The version of FMI.
    pub(super) fn version(&self) -> Version {
        match self {
            Self::Fmi2(_) => Version::Fmi2,
            Self::Fmi3(_) => Version::Fmi3,
        }
    }

    /// The schema of the description.
    pub(super) fn schema(&self) -> &'static Schema {
        match self {
            Self::Fmi2(_) => &schema::FMI2,
            Self::Fmi3(_) => &schema::FMI3,
        }
    }

    /// Reports every broken rule on the description.
    pub(super) fn check(&self, findings: &mut Findings) {
        match self {
            Self::Fmi2(model) => model.check(&mut |violation| {
                let name = |v: usize| model.description.variables.get(v).map(|v| v.name.as_str());
                let is_named = |v| !model.is_unread(description::Place::Variable(v), "name");
                let mark =
                    mark(&violation, model.position(violation.place), |v| name(v).filter(|_| is_named(v)));
                findings.add(violation.rule, mark, violation.message);
            }),
            Self::Fmi3(model) => model.check(&mut |violation| {
                let name = |v: usize| model.description.variables.get(v).map(|v| v.name.as_str());
                let is_named = |v| !model.is_unread(description::Place::Variable(v), "name");
                let mark =
                    mark(&violation, model.position(violation.place), |v| name(v).filter(|_| is_named(v)));
                findings.add(violation.rule, mark, violation.message);
            }),
        }
    }

    /// The names of its libraries, without duplicates.
    pub(super) fn identifiers(&self) -> Vec<&str> {
        match self {
            Self::Fmi2(model) => {
                let exchange =
                    model.description.model_exchange.as_ref().map(|of| of.model_identifier.as_str());
                let mut names: Vec<&str> = model.model_identifier().into_iter().collect();
                // Invalid identifiers are reported elsewhere.
                names.extend(exchange.filter(|name| is_c_identifier(name) && !names.contains(name)));
                names
            }
            Self::Fmi3(model) => {
                let mut names: Vec<&str> = Vec::new();
                for (_, interface) in model.description.interfaces() {
                    let name = interface.model_identifier.as_str();
                    // Invalid identifiers are reported elsewhere.
                    if is_c_identifier(name) && !names.contains(&name) {
                        names.push(name);
                    }
                }
                names
            }
        }
    }

    /// Whether it offers co-simulation.
    pub(super) fn has_co_simulation(&self) -> bool {
        match self {
            Self::Fmi2(model) => model.co_simulation().is_some(),
            Self::Fmi3(model) => model.description.co_simulation.is_some(),
        }
    }

    /// Whether co-simulation needs a tool that drives the FMU.
    pub(super) fn needs_tool(&self) -> bool {
        match self {
            Self::Fmi2(model) => model.description.co_simulation.needs_execution_tool,
            Self::Fmi3(model) => {
                model.description.co_simulation.as_ref().is_some_and(|of| of.interface.needs_execution_tool)
            }
        }
    }

    /// Whether the description names source code. In FMI 3.0 another file does so.
    pub(super) fn names_sources(&self) -> bool {
        match self {
            Self::Fmi2(model) => {
                let exchange = model.description.model_exchange.iter().flat_map(|of| &of.source_files);
                exchange.chain(&model.description.co_simulation.source_files).next().is_some()
            }
            Self::Fmi3(_) => false,
        }
    }
}

/// The place of a violation, with the name of its variable.
pub(super) fn mark<'a>(
    violation: &Violation,
    at: usize,
    name: impl FnOnce(usize) -> Option<&'a str>,
) -> Mark {
    use description::Place::{Alias, Start, Variable};
    let variable = match violation.place {
        Variable(v) | Start(v) | Alias(v, _) => name(v).map(brief),
        _ => None,
    };
    Mark { at, variable }
}
