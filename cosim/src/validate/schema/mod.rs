//! Checks a document against the XML schemas of FMI 2.0 and 3.0: [`table`]s, and one pass over the document.

mod table;
mod types;

use punctual_modeldescription::brief;
use roxmltree::{Document, Node, ParsingOptions};

use super::finding::{Findings, Mark, Place};
use crate::host::{declared_encoding, is_latin};
use punctual_modeldescription::fmi3::DataType;
pub(super) use table::{BUILD, FMI2, FMI3, Schema, TERMINALS};
use table::{Content, Element, Times, Use};

/// The namespace of attributes that every element may have: those of the schema language itself.
const SCHEMA_INSTANCE: &str = "http://www.w3.org/2001/XMLSchema-instance";

/// Parses the text of a file of the archive. A text that is not well-formed is a finding.
pub(super) fn parse<'a>(file: &str, text: &'a str, findings: &mut Findings) -> Option<Document<'a>> {
    findings.read(file, text);
    // No document type is allowed. The number of nodes is unlimited here, since the text was checked before.
    let options = ParsingOptions { allow_dtd: false, ..ParsingOptions::default() };
    match Document::parse_with_options(text, options) {
        Ok(document) => {
            encoding(text, findings);
            Some(document)
        }
        Err(error) => {
            let at = error.pos();
            let place = Place { file: file.to_owned(), position: Some((at.row, at.col)), variable: None };
            let words = error.to_string();
            let words = words.rsplit_once(" at ").map_or(words.as_str(), |(words, _)| words);
            findings.place("xml.readable", place, format!("is not well-formed XML: {words}"));
            None
        }
    }
}

/// Checks the declared encoding and the byte order mark. The standard requires UTF-8. Some importers rely on
/// the bytes, others on the declaration.
fn encoding(text: &str, findings: &mut Findings) {
    if text.starts_with('\u{feff}') {
        let message =
            "begins with a byte order mark; should begin with `<?xml`, as some importers do not skip it";
        findings.add("xml.encoding", Mark::default(), message);
    }
    let Some(name) = declared_encoding(text.as_bytes()) else { return };
    if is_latin(name) {
        let message =
            format!("the declared encoding is {name:?}, which not every importer reads; should be UTF-8");
        findings.add("xml.encoding", Mark::default(), message);
    } else if !name.eq_ignore_ascii_case("utf-8") {
        let message = format!("the declared encoding is {name:?}; must be UTF-8");
        findings.add("xml.readable", Mark::default(), message);
    }
}

/// The beginning of a node.
fn place(node: Node<'_, '_>) -> Mark {
    mark(node, node.range().start)
}

fn mark(node: Node<'_, '_>, at: usize) -> Mark {
    // A variable and its type are nested at most this deep.
    let inside = node.ancestors().take(2).find(is_variable);
    Mark { at, variable: inside.and_then(|n| n.attribute("name")).map(brief) }
}

/// Whether a node is a variable of either version.
fn is_variable(node: &Node<'_, '_>) -> bool {
    let of_fmi3 = |list: Node<'_, '_>| list.has_tag_name("ModelVariables");
    node.has_tag_name("ScalarVariable")
        || node.parent().is_some_and(of_fmi3) && DataType::ALL.iter().any(|of| node.has_tag_name(of.as_str()))
}

/// Checks the whole document.
pub(super) fn check(document: &Document<'_>, schema: &Schema, findings: &mut Findings) {
    let root = document.root_element();
    if root.tag_name().name() != schema.root || root.tag_name().namespace().is_some() {
        let message = format!("the root element is {}; must be {}", root.tag_name().name(), schema.root);
        findings.add("schema.element", place(root), message);
        return;
    }
    let exchanges = !schema.of_exchange || root.children().any(|child| child.has_tag_name("ModelExchange"));
    // An explicit stack replaces recursion, since the file determines the depth.
    let mut open = vec![(root, schema.root)];
    while let Some((node, kind)) = open.pop() {
        let Some(element) = schema.elements.iter().find(|element| element.kind == kind) else { continue };
        attributes(node, element, findings);
        if !exchanges {
            of_exchange(node, findings);
        }
        children(node, element, &mut open, findings);
    }
}

/// Attributes that the standard has only for model exchange, and forbids without it.
const OF_EXCHANGE: [&str; 2] = ["reinit", "canHandleMultipleSetPerTimeInstant"];

fn of_exchange(node: Node<'_, '_>, findings: &mut Findings) {
    let is_of_variable =
        |node: &Node<'_, '_>| node.ancestors().take(2).any(|n| n.has_tag_name("ScalarVariable"));
    for attribute in
        OF_EXCHANGE.iter().filter_map(|name| node.attribute_node(*name)).filter(|_| is_of_variable(&node))
    {
        let message = format!(
            "{} is for model exchange, which this FMU does not offer; must not be there",
            attribute.name()
        );
        findings.add("schema.exchange", mark(node, attribute.range().start), message);
    }
}

fn attributes(node: Node<'_, '_>, element: &Element, findings: &mut Findings) {
    let name = node.tag_name().name();
    for attribute in node.attributes() {
        if attribute.namespace() == Some(SCHEMA_INSTANCE) {
            continue;
        }
        let known = element.attributes().find(|a| a.name == attribute.name());
        let Some(known) = known.filter(|_| attribute.namespace().is_none()) else {
            if element.open {
                continue;
            }
            let names: Vec<_> = element.attributes().map(|a| a.name).collect();
            let allowed = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            let message = format!("{name} has an attribute {}; allowed: {allowed}", attribute.name());
            findings.add("schema.attribute", mark(node, attribute.range().start), message);
            continue;
        };
        if let Err(allowed) = known.value.accepts(attribute.value()) {
            let message =
                format!("{name}: {} is {:?}; must be {allowed}", known.name, brief(attribute.value()));
            findings.add("schema.value", mark(node, attribute.range().start), message);
        }
    }
    for required in element.attributes().filter(|a| a.required == Use::Required) {
        if node.attribute(required.name).is_none() {
            let message = format!("{name} has no attribute {}, which it must have", required.name);
            findings.add("schema.attribute", place(node), message);
        }
    }
}

fn children<'a, 'i>(
    node: Node<'a, 'i>,
    element: &Element,
    open: &mut Vec<(Node<'a, 'i>, &'static str)>,
    findings: &mut Findings,
) {
    if element.content == Content::Anything {
        return;
    }
    let name = node.tag_name().name();
    let rules = element.children;
    let allowed = || {
        let names: Vec<_> = rules.iter().map(|child| child.name).collect();
        if names.is_empty() { "none".to_owned() } else { names.join(", ") }
    };
    let mut counts = vec![0_usize; rules.len()];
    let mut reached = 0;
    // Each child must be allowed here, in order, and not too frequent.
    for child in node.children() {
        if let Some(text) = child.text().filter(|text| child.is_text() && !text.trim().is_empty()) {
            let message = format!("text {:?} between the elements of {name}", brief(text.trim()));
            findings.add("schema.text", place(child), message);
        }
        if !child.is_element() {
            continue;
        }
        let tag = child.tag_name();
        let known = rules.iter().position(|rule| rule.name == tag.name() && tag.namespace().is_none());
        let Some(index) = known else {
            let message = format!("{name} has an element {}; allowed: {}", tag.name(), allowed());
            findings.add("schema.element", place(child), message);
            continue;
        };
        let rule = &rules[index];
        counts[index] += 1;
        if rule.group < reached {
            let message = format!("{} comes too late in {name}; the order is {}", rule.name, allowed());
            findings.add("schema.element", place(child), message);
        }
        reached = reached.max(rule.group);
        if rule.times.most() < counts[index] {
            let message = format!("{} is there again; {name} has it at most once", rule.name);
            findings.add("schema.element", place(child), message);
        }
        open.push((child, rule.kind));
    }
    // Exactly one of a choice, at least one of a mix, and every required child.
    for (times, wanted) in [(Times::Choice, "exactly one"), (Times::Mix, "at least one")] {
        let of = rules.iter().zip(&counts).filter(|(rule, _)| rule.times == times);
        let chosen: usize = of.clone().map(|(_, n)| *n).sum();
        let names: Vec<_> = of.map(|(rule, _)| rule.name).collect();
        let enough = chosen == 1 || times == Times::Mix && chosen > 1;
        if !names.is_empty() && !enough {
            let message = format!("{name} has {chosen} of {}; must have {wanted}", names.join(", "));
            findings.add("schema.element", place(node), message);
        }
    }
    for (rule, count) in rules.iter().zip(counts) {
        if count == 0 && matches!(rule.times, Times::One | Times::Some) {
            let message = format!("{name} has no element {}, which it must have", rule.name);
            findings.add("schema.element", place(node), message);
        }
    }
}
