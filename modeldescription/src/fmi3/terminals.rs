//! `terminalsAndIcons/terminalsAndIcons.xml`: variables grouped into terminals, which a tool can connect with
//! one line (FMI 3.0.2, section 2.4.9). Its graphical information is neither written nor read.

use super::ModelDescription;
#[cfg(feature = "read")]
use crate::notes::{Notes, children, list};
#[cfg(feature = "read")]
use crate::rules::Place;
use crate::rules::{Check, Unread, Violation, fmi3};
use crate::validate::{line, name, text};
use crate::xml::{container, optional, unless_empty};
use crate::{Error, xml};
#[cfg(feature = "read")]
use roxmltree::{Document, Node};
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};
#[cfg(feature = "read")]
use std::collections::VecDeque;

/// The path of the file in the archive.
pub const TERMINALS: &str = "terminalsAndIcons/terminalsAndIcons.xml";

/// The terminals of an FMU.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Terminals {
    /// All terminals, each after its parent.
    pub terminals: Vec<Terminal>,
}

/// A group of variables that can be connected as one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Terminal {
    /// The index in [`Terminals::terminals`] of its parent, if it is nested in one.
    pub inside: Option<usize>,
    /// The name; not empty, one line, unique among terminals with the same parent.
    pub name: String,
    /// How members find their counterparts: `plug`, `bus`, `sequence`, `none`, or a reversed domain name.
    pub matching_rule: String,
    /// The kind of terminal, as another standard names it; if empty, the attribute is omitted.
    pub terminal_kind: String,
    /// Its meaning, as a text for the reader; if empty, the attribute is omitted.
    pub description: String,
    /// Its variables.
    pub members: Vec<TerminalMember>,
    /// Its variables for transported quantities.
    pub streams: Vec<StreamMember>,
}

/// A variable of a terminal.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct TerminalMember {
    /// The name of the variable.
    #[serde(rename = "@variableName")]
    pub variable_name: String,
    /// The name in the terminal, by which `plug` and `bus` match; unique in the terminal. If empty, the
    /// attribute is omitted.
    #[serde(rename = "@memberName", skip_serializing_if = "String::is_empty")]
    pub member_name: String,
    /// How connected variables relate: `signal`, `inflow`, `outflow`, or a reversed domain name.
    #[serde(rename = "@variableKind")]
    pub variable_kind: String,
}

impl TerminalMember {
    /// A signal.
    pub fn signal(variable_name: impl Into<String>, member_name: impl Into<String>) -> Self {
        let (variable_name, member_name) = (variable_name.into(), member_name.into());
        Self { variable_name, member_name, variable_kind: "signal".into() }
    }
}

/// Two variables of a terminal for a quantity that a flow transports in and out.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct StreamMember {
    /// The name in the terminal for the inflow.
    #[serde(rename = "@inStreamMemberName")]
    pub in_member_name: String,
    /// The name in the terminal for the outflow.
    #[serde(rename = "@outStreamMemberName")]
    pub out_member_name: String,
    /// The name of the variable for the inflow.
    #[serde(rename = "@inStreamVariableName")]
    pub in_variable_name: String,
    /// The name of the variable for the outflow.
    #[serde(rename = "@outStreamVariableName")]
    pub out_variable_name: String,
}

/// The root element, or a terminal by its index, with the terminals nested in it.
struct Element<'a> {
    all: &'a [Terminal],
    at: Option<usize>,
}

impl Element<'_> {
    fn inner(&self) -> Vec<Self> {
        let is_inside = |(_, terminal): &(usize, &Terminal)| terminal.inside == self.at;
        let inner = self.all.iter().enumerate().filter(is_inside);
        inner.map(|(t, _)| Self { all: self.all, at: Some(t) }).collect()
    }
}

impl Serialize for Element<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct List<'a> {
            #[serde(rename = "Terminal")]
            terminals: Vec<Element<'a>>,
        }
        let Some(terminal) = self.at.and_then(|t| self.all.get(t)) else {
            let mut element = serializer.serialize_struct("fmiTerminalsAndIcons", 2)?;
            element.serialize_field("@fmiVersion", super::xml::VERSION)?;
            optional(&mut element, "Terminals", container(self.inner(), |terminals| List { terminals }))?;
            return element.end();
        };
        let mut element = serializer.serialize_struct("Terminal", 7)?;
        element.serialize_field("@name", &terminal.name)?;
        element.serialize_field("@matchingRule", &terminal.matching_rule)?;
        unless_empty(&mut element, "@terminalKind", &terminal.terminal_kind)?;
        unless_empty(&mut element, "@description", &terminal.description)?;
        element.serialize_field("TerminalMemberVariable", &terminal.members)?;
        element.serialize_field("TerminalStreamMemberVariable", &terminal.streams)?;
        element.serialize_field("Terminal", &self.inner())?;
        element.end()
    }
}

impl Terminals {
    /// The content of the file for an FMU with this description: UTF-8 without byte order mark.
    ///
    /// # Errors
    ///
    /// - A rule of [`RULES`](crate::RULES) on terminals is broken: duplicate names, members that are not
    ///   connectable variables, or members without the name that the matching rule requires.
    /// - There is no terminal, or one is nested in a terminal that does not come before it.
    /// - A required text is empty, a text has a character that XML 1.0 cannot represent, or a text of one
    ///   line has a line break or tab.
    pub fn to_xml(&self, description: &ModelDescription) -> Result<String, Error> {
        if self.terminals.is_empty() {
            return Err(Error::invalid("terminals", "empty", "at least one terminal"));
        }
        for (t, terminal) in self.terminals.iter().enumerate() {
            if let Some(inside) = terminal.inside.filter(|inside| *inside >= t) {
                let allowed = "the position of a terminal before this one";
                return Err(Error::invalid(format!("terminals[{t}].inside"), inside, allowed));
            }
            terminal.texts(t)?;
        }
        let mut broken = None;
        let mut report = |violation: Violation| {
            broken.get_or_insert(violation);
        };
        fmi3::terminals(self, description, &mut Check { unread: &Unread::new(), report: &mut report });
        if let Some(Violation { rule, place, message }) = broken {
            return Err(Error::rule(rule, description.paths(|paths| paths.of(place)), message));
        }
        xml::text(&Element { all: &self.terminals, at: None })
    }
}

impl Terminal {
    fn texts(&self, t: usize) -> Result<(), Error> {
        let path = |field: &str| format!("terminals[{t}].{field}");
        name(path("name"), &self.name)?;
        name(path("matching_rule"), &self.matching_rule)?;
        line(path("terminal_kind"), &self.terminal_kind)?;
        text(path("description"), &self.description)?;
        for (m, member) in self.members.iter().enumerate() {
            let path = |field: &str| path(&format!("members[{m}].{field}"));
            name(path("variable_name"), &member.variable_name)?;
            line(path("member_name"), &member.member_name)?;
            name(path("variable_kind"), &member.variable_kind)?;
        }
        for (m, member) in self.streams.iter().enumerate() {
            let path = |field: &str| path(&format!("streams[{m}].{field}"));
            name(path("in_member_name"), &member.in_member_name)?;
            name(path("out_member_name"), &member.out_member_name)?;
            name(path("in_variable_name"), &member.in_variable_name)?;
            name(path("out_variable_name"), &member.out_variable_name)?;
        }
        Ok(())
    }
}

/// Terminals that were read, and the positions of their parts in the text.
#[cfg(feature = "read")]
#[derive(Debug, Default)]
pub struct LocatedTerminals {
    /// The content. A missing text is empty.
    pub terminals: Terminals,
    notes: Notes,
}

#[cfg(feature = "read")]
impl LocatedTerminals {
    /// Reads a document, tolerating defects.
    pub fn read(document: &Document<'_>) -> Self {
        let mut read = Self::default();
        let root = document.root_element();
        read.notes.mark(Place::Root, root.range().start);
        // An explicit queue replaces recursion, since the file determines the depth.
        let mut open: VecDeque<_> = list(root, "Terminals", "Terminal").map(|node| (None, node)).collect();
        while let Some((inside, node)) = open.pop_front() {
            let t = read.terminals.terminals.len();
            let terminal = read.terminal(t, inside, node);
            read.terminals.terminals.push(terminal);
            open.extend(children(node, "Terminal").map(|node| (Some(t), node)));
        }
        read
    }

    /// The beginning of a part, in bytes from the beginning of the text.
    pub fn position(&self, place: Place) -> usize {
        self.notes.position(place)
    }

    /// Reports every broken rule of [`RULES`](crate::RULES) on terminals.
    pub fn check(&self, description: &ModelDescription, report: &mut dyn FnMut(Violation)) {
        fmi3::terminals(&self.terminals, description, &mut Check { unread: &self.notes.unread, report });
    }

    fn terminal(&mut self, t: usize, inside: Option<usize>, node: Node<'_, '_>) -> Terminal {
        let at = self.notes.enter(Place::Terminal(t), node);
        let (name, matching_rule) = (at.text("name"), at.text("matchingRule"));
        let (terminal_kind, description) = (at.text("terminalKind"), at.text("description"));
        let mut members = Vec::new();
        for (m, node) in children(node, "TerminalMemberVariable").enumerate() {
            let at = self.notes.enter(Place::Member(t, m), node);
            members.push(TerminalMember {
                variable_name: at.text("variableName"),
                member_name: at.text("memberName"),
                variable_kind: at.text("variableKind"),
            });
        }
        let count = members.len();
        let mut streams = Vec::new();
        for (m, node) in children(node, "TerminalStreamMemberVariable").enumerate() {
            let at = self.notes.enter(Place::Member(t, count + m), node);
            streams.push(StreamMember {
                in_member_name: at.text("inStreamMemberName"),
                out_member_name: at.text("outStreamMemberName"),
                in_variable_name: at.text("inStreamVariableName"),
                out_variable_name: at.text("outStreamVariableName"),
            });
        }
        Terminal { inside, name, matching_rule, terminal_kind, description, members, streams }
    }
}
