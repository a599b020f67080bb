//! Checks the files of FMI 3.0 beside the description: terminals, and the build description of source code
//! (FMI 3.0.2, sections 2.4.9 and 2.4.10).

use punctual_modeldescription::fmi3::{LocatedTerminals, ModelDescription, TERMINALS};
use punctual_modeldescription::{brief, is_c_identifier};
use roxmltree::Document;

use super::finding::{Findings, Mark};
use super::model::mark;
use super::schema::{self, Schema};
use crate::error::FmuProblem;
use crate::host::Archive;

/// The path of the build description of source code.
pub(super) const BUILD: &str = "sources/buildDescription.xml";

/// Checks both files, if present.
pub(super) fn check(archive: &Archive, description: &ModelDescription, findings: &mut Findings) {
    read(archive, TERMINALS, &schema::TERMINALS, findings, |document, findings| {
        let terminals = LocatedTerminals::read(document);
        terminals.check(description, &mut |violation| {
            let mark = mark(&violation, terminals.position(violation.place), |_| None);
            findings.add(violation.rule, mark, violation.message);
        });
    });
    read(archive, BUILD, &schema::BUILD, findings, |document, findings| {
        build(document, archive, description, findings);
    });
}

fn read(
    archive: &Archive,
    entry: &str,
    schema: &Schema,
    findings: &mut Findings,
    then: impl FnOnce(&Document<'_>, &mut Findings),
) {
    if !archive.entries().iter().any(|other| other == entry) {
        return;
    }
    let text = match archive.xml(entry) {
        Ok(text) => text,
        Err(FmuProblem::Description(problem)) => {
            findings.archive("xml.readable", entry, problem);
            return;
        }
        Err(problem) => {
            findings.archive(super::rule(&problem), entry, problem.to_string());
            return;
        }
    };
    if let Some(document) = schema::parse(entry, &text, findings) {
        schema::check(&document, schema, findings);
        then(&document, findings);
    }
}

/// Checks that the files named in a build description exist.
fn build(
    document: &Document<'_>,
    archive: &Archive,
    description: &ModelDescription,
    findings: &mut Findings,
) {
    let interfaces = description.interfaces();
    for node in document.descendants().filter(|node| node.has_tag_name("BuildConfiguration")) {
        let Some(attribute) = node.attribute_node("modelIdentifier") else { continue };
        let name = attribute.value();
        let known = interfaces.iter().any(|(_, interface)| interface.model_identifier == name);
        if !known && is_c_identifier(name) {
            let message = format!("modelIdentifier is {:?}, which is that of no interface", brief(name));
            findings.add("archive.companion", Mark { at: attribute.range().start, variable: None }, message);
        } else if !known {
            let message = format!("modelIdentifier is {:?}; must be a C identifier", brief(name));
            findings.add("archive.companion", Mark { at: attribute.range().start, variable: None }, message);
        }
    }
    for node in document.descendants().filter(|node| node.has_tag_name("SourceFile")) {
        let Some(attribute) = node.attribute_node("name") else { continue };
        let entry = format!("sources/{}", attribute.value());
        if !archive.entries().contains(&entry) {
            let message = format!("there is no {:?}, which it names", brief(&entry));
            findings.add("archive.companion", Mark { at: attribute.range().start, variable: None }, message);
        }
    }
}
