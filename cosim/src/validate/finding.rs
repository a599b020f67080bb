//! Findings, each with a severity, a rule, a place and a message.

use std::fmt;

use punctual_modeldescription::{self as description, Severity};
use serde::{Deserialize, Serialize};

/// The place of a finding.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Place {
    /// The entry of the archive; empty for the archive as a whole, `trial` for the behaviour of an instance.
    pub file: String,
    /// The line, from 1, and the column, from 1, in bytes.
    pub position: Option<(u32, u32)>,
    /// The variable, if the finding is about one.
    pub variable: Option<String>,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.file.is_empty() { "archive" } else { &self.file })?;
        if let Some((line, column)) = self.position {
            write!(f, ":{line}:{column}")?;
        }
        if let Some(variable) = &self.variable {
            write!(f, " {variable}")?;
        }
        Ok(())
    }
}

/// A defect of an FMU.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Finding {
    /// Its severity.
    pub severity: Severity,
    /// The name of one of [`rules`].
    pub rule: String,
    /// Its place.
    pub place: Place,
    /// The defect, with the values found and those allowed.
    pub message: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}: {} [{}]\n  {}",
            self.severity,
            self.place,
            self.rule,
            self.message.replace('\n', "\n  ")
        )
    }
}

use Severity::{Error, Warning};

/// A rule: its name, the severity of breaking it, and what it requires.
type Rule = (&'static str, Severity, &'static str);

/// The rules on the archive and the schema, which come before those on the description's meaning.
const BEFORE: &[Rule] = &[
    (
        "archive.readable",
        Error,
        "the file is a zip archive: whole, no entry twice, no link, nothing encrypted",
    ),
    ("archive.name", Error, "no entry is absolute, leaves the archive, or holds a backslash"),
    ("archive.compression", Error, "entries are stored or deflated: several importers read nothing else"),
    ("archive.limit", Error, "the archive is not larger than what is unpacked from a file of unknown origin"),
    (
        "archive.binary",
        Error,
        "there is a library, or source code, for some platform, named as modelIdentifier says",
    ),
    ("archive.companion", Error, "FMI 3.0: what files of the archive need beside them is there"),
    (
        "archive.index",
        Warning,
        "FMI 3.0: documentation/ has its index.html, sources/ its buildDescription.xml",
    ),
    ("archive.platform", Warning, "there is a library for this platform"),
    ("archive.top-folder", Warning, "everything lies where the standard has a place for it"),
    (
        "xml.readable",
        Error,
        "modelDescription.xml is there; it and other XML is UTF-8, well-formed, and needs no document type",
    ),
    ("xml.encoding", Warning, "modelDescription.xml is in UTF-8, not ISO-8859-1, without a byte order mark"),
    ("schema.element", Error, "elements are those of the schema, in its order and number"),
    ("schema.attribute", Error, "attributes are those of the schema; the required ones are there"),
    ("schema.value", Error, "values have the type that the schema gives them"),
    ("schema.text", Error, "there is no text between elements"),
    ("schema.exchange", Error, "attributes for model exchange alone are not there without it"),
];

/// The rules on libraries and the behaviour of instances.
const AFTER: &[Rule] = &[
    ("symbols.readable", Error, "libraries are of the format and processor of their folder"),
    ("symbols.missing", Error, "libraries export every function of FMI 2.0 co-simulation, or of FMI 3.0"),
    ("trial.load", Error, "the library can be loaded, and an importer can read the description"),
    ("trial.version", Error, "fmi2GetVersion answers 2.0 and fmi2GetTypesPlatform default"),
    ("trial.call", Error, "every call of the trial succeeds"),
    ("trial.crash", Error, "the FMU does not crash or end the process"),
    (
        "trial.time",
        Error,
        "the trial comes to its end within the time limit, which one that hangs never does",
    ),
    ("trial.discard", Warning, "the trial's steps are not discarded"),
    ("trial.warning", Warning, "no call returns fmi2Warning, which several importers take for a failure"),
    ("trial.output", Warning, "outputs are finite and within their range"),
    ("trial.start", Warning, "parameters and inputs have the start values that the description says"),
    ("trial.text", Warning, "fmi2GetString gives a text, in UTF-8"),
    (
        "trial.log",
        Warning,
        "the logger gets the component environment that was given, a status of the standard, and texts",
    ),
    ("trial.reset", Warning, "after fmi2Reset the FMU does the same again"),
    (
        "trial.state",
        Warning,
        "a step from a state that was set back gives the same outputs, bit for bit (FMI 3.0)",
    ),
    (
        "trial.derivative",
        Warning,
        "derivatives agree with differences, and adjoint with directional ones (FMI 3.0)",
    ),
    ("trial.instances", Warning, "there can be two instances, unless the description says otherwise"),
];

/// Every rule: its name, the severity of breaking it, and what it requires. The name of a rule never changes
/// its meaning.
pub fn rules() -> impl Iterator<Item = &'static (&'static str, Severity, &'static str)> {
    BEFORE.iter().chain(description::RULES).chain(AFTER)
}

/// The severity of breaking a rule. An unknown rule counts as an error.
pub(super) fn severity(rule: &str) -> Severity {
    rules().find(|known| known.0 == rule).map_or(Error, |known| known.1)
}

/// The most findings kept for one rule: the thousandth variable without a start value adds nothing.
const KEPT_OF_A_RULE: usize = 20;

/// A place in the current file.
#[derive(Clone, Debug, Default)]
pub(super) struct Mark {
    /// Offset from the beginning of the text, in bytes.
    pub(super) at: usize,
    /// The variable, if the finding is about one.
    pub(super) variable: Option<String>,
}

/// The entry with the model description.
pub(super) const DESCRIPTION: &str = "modelDescription.xml";

/// Collects findings.
#[derive(Debug, Default)]
pub(super) struct Findings {
    /// The current entry, which marks refer to.
    file: String,
    /// The offsets of its lines, in bytes.
    lines: Vec<usize>,
    list: Vec<Finding>,
    left_out: Vec<(String, usize)>,
}

impl Findings {
    /// Makes this entry the current one, which marks refer to from now on.
    pub(super) fn read(&mut self, file: &str, text: &str) {
        file.clone_into(&mut self.file);
        let breaks = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        self.lines = std::iter::once(0).chain(breaks.map(|(at, _)| at + 1)).collect();
    }

    /// Adds a finding in the current entry.
    pub(super) fn add(&mut self, rule: &str, mark: Mark, message: impl Into<String>) {
        let line = self.lines.partition_point(|begin| *begin <= mark.at);
        let begin = self.lines.get(line.saturating_sub(1)).copied().unwrap_or(0);
        let number = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        let position = Some((number(line), number(mark.at - begin + 1)));
        let file = self.file.clone();
        self.place(rule, Place { file, position, variable: mark.variable }, message);
    }

    /// Adds a finding at a place.
    pub(super) fn place(&mut self, rule: &str, place: Place, message: impl Into<String>) {
        let severity = severity(rule);
        self.push(Finding { severity, rule: rule.to_owned(), place, message: message.into() });
    }

    /// Adds a finding in an entry of the archive.
    pub(super) fn archive(&mut self, rule: &str, entry: &str, message: impl Into<String>) {
        self.place(rule, Place { file: entry.to_owned(), ..Place::default() }, message);
    }

    /// Adds a finding unchanged.
    pub(super) fn push(&mut self, finding: Finding) {
        if self.list.iter().filter(|other| other.rule == finding.rule).count() < KEPT_OF_A_RULE {
            self.list.push(finding);
            return;
        }
        match self.left_out.iter_mut().find(|(rule, _)| *rule == finding.rule) {
            Some((_, count)) => *count += 1,
            None => self.left_out.push((finding.rule, 1)),
        }
    }

    /// Whether some rule whose name begins with `head` is broken.
    pub(super) fn any(&self, head: &str) -> bool {
        self.any_in(head, |_| true)
    }

    /// Whether such a rule is broken in an entry that `is_meant`. Findings on the archive as a whole do not
    /// count.
    pub(super) fn any_in(&self, head: &str, is_meant: impl Fn(&str) -> bool) -> bool {
        let is_broken =
            |f: &Finding| f.severity == Error && f.rule.starts_with(head) && is_meant(&f.place.file);
        self.list.iter().any(is_broken)
    }

    /// All findings. If some were left out, the last one of their rule says how many.
    pub(super) fn finish(mut self) -> Vec<Finding> {
        for (rule, count) in self.left_out {
            if let Some(last) = self.list.iter_mut().rev().find(|finding| finding.rule == rule) {
                last.message.push_str(&format!(" (and {count} more findings of this rule)"));
            }
        }
        self.list
    }
}
