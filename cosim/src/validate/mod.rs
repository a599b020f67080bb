//! Finds defects of an FMU, ours or another's: FMI 2.0 co-simulation or FMI 3.0. Each module checks one
//! aspect and uses only those above it:
//!
//! | module | asks |
//! |---|---|
//! | `finding` | how a finding is reported |
//! | `schema` | what the XML schemas say: elements, attributes, types of values |
//! | `model` | what the description of either version says |
//! | `layout` | which files the archive must and may hold |
//! | `companions` | terminals and build descriptions of FMI 3.0 |
//! | `symbols` | whether the libraries export what they must, without loading them |
//! | `trial` | whether an instance does what it should, in a child process |
//!
//! The rules of the standard on a description beyond the schema are those of `punctual_modeldescription`,
//! checked on the same model that descriptions are written from.

mod companions;
mod finding;
pub(crate) mod layout;
mod model;
mod schema;
pub(crate) mod symbols;
pub mod trial;

use std::path::Path;
use std::time::Duration;

pub use finding::{Finding, Place, rules};
pub use punctual_modeldescription::Severity;

use crate::error::{Error, FmuProblem};
use crate::host::{Archive, Description, foreign_version};
use finding::{DESCRIPTION, Findings};
use model::Model;

/// Findings on one FMU.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// All findings: first those on the archive, then those on the description from top to bottom.
    pub findings: Vec<Finding>,
    /// Checks that were not made, each with the reason.
    pub skipped: Vec<String>,
}

impl Report {
    /// The number of findings with this severity.
    pub fn count(&self, severity: Severity) -> usize {
        self.findings.iter().filter(|finding| finding.severity == severity).count()
    }
}

/// Examines the FMU at `path`. `limit` is the time limit of the trial; `None` skips it, and no code of the
/// FMU is run.
///
/// # Errors
///
/// The file cannot be read, the FMU is of another version of FMI, or the trial's process cannot be started.
/// Every defect of the FMU is a finding.
pub fn validate(path: &Path, limit: Option<Duration>) -> Result<Report, Error> {
    let mut findings = Findings::default();
    let mut skipped = Vec::new();
    let archive = match Archive::open(path) {
        Ok(archive) => archive,
        Err(error) => {
            let Some(problem) = error.as_fmu_problem() else { return Err(error) };
            findings.archive(rule(problem), "", problem.to_string());
            skipped.push("everything else: the archive was not unpacked".to_owned());
            return Ok(Report { findings: findings.finish(), skipped });
        }
    };
    let text = match archive.model_description() {
        Ok(text) => text,
        Err(problem) => {
            findings.archive(rule(&problem), DESCRIPTION, problem.to_string());
            skipped.push("everything else: there is no description to go by".to_owned());
            return Ok(Report { findings: findings.finish(), skipped });
        }
    };
    let Some(document) = schema::parse(DESCRIPTION, &text, &mut findings) else {
        skipped.push("everything else: the description is not well-formed".to_owned());
        return Ok(Report { findings: findings.finish(), skipped });
    };
    if let Some(foreign) = foreign_version(&document) {
        return Err(Error::fmu(path, FmuProblem::CannotRun(foreign)));
    }
    let model = Model::read(&document);
    schema::check(&document, model.schema(), &mut findings);
    model.check(&mut findings);
    layout::check(&archive, &model, &mut findings);
    if let Model::Fmi3(model) = &model {
        companions::check(&archive, &model.description, &mut findings);
    }
    symbols::check(&archive, &model, &mut findings);
    let reason = trial::reason_to_skip(&archive, model.version(), model.needs_tool(), &findings);
    let reason = reason.or_else(|| match Description::parse(&text) {
        Ok(description) => description.obstacle(),
        Err(FmuProblem::CannotRun(reason)) => Some(reason),
        Err(_) if !model.has_co_simulation() => Some("there is no co-simulation".to_owned()),
        Err(problem @ FmuProblem::ModelIdentifier(_)) => Some(problem.to_string()),
        Err(_) => None,
    });
    match (limit, reason) {
        (None, _) => skipped.push("the trial: it was not wanted".to_owned()),
        (_, Some(reason)) => skipped.push(format!("the trial: {reason}")),
        (Some(limit), None) => trial::run(path, limit, &mut findings)?,
    }
    Ok(Report { findings: findings.finish(), skipped })
}

/// The rule broken by an FMU that cannot be opened at all.
fn rule(problem: &FmuProblem) -> &'static str {
    match problem {
        FmuProblem::UnsafeEntry(_) => "archive.name",
        FmuProblem::Compression { .. } => "archive.compression",
        FmuProblem::Limit { .. } => "archive.limit",
        FmuProblem::Description(_) => "xml.readable",
        _ => "archive.readable",
    }
}
