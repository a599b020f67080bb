//! Rules of the standard beyond the schema (FMI 2.0.4, sections 2.2 and 4.3; FMI 3.0.2, section 2.4): one
//! list for both versions, for descriptions to be written and for those that were read.
//!
//! A description to be written must satisfy all rules; in FMI 2.0 its structure follows from its variables. A
//! description that was read ([`Located`](crate::Located)) may break any rule, and some of its attributes may
//! not even be values of their type. The model has nothing in their place, and rules that need them report
//! nothing.
//!
//! Rules that both versions share are here, in `variables` and in `structure`. `fmi2` and `fmi3` have their
//! own rules, and provide the properties of variables that the shared rules need.

pub(crate) mod fmi2;
pub(crate) mod fmi3;
mod structure;
mod variables;

use crate::{DefaultExperiment, LogCategory, Unit, is_c_identifier};
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::fmt;

/// How serious it is to break a rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The FMU violates the standard or does not work.
    Error,
    /// Allowed, but some importers will have trouble.
    Warning,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Error => "error",
            Self::Warning => "warning",
        })
    }
}

use Severity::{Error, Warning};

/// Every rule on descriptions: its name, its severity, and what it requires. The name of a rule never changes
/// its meaning.
pub const RULES: &[(&str, Severity, &str)] = &[
    ("interface.co-simulation", Error, "the FMU offers co-simulation, once, or model exchange"),
    ("interface.identifier", Error, "modelIdentifier is a C identifier"),
    ("interface.guid", Error, "guid is not empty"),
    ("interface.kind", Error, "FMI 3.0: the FMU offers an interface"),
    ("interface.token", Error, "FMI 3.0: instantiationToken is not empty"),
    ("interface.event-mode", Error, "FMI 3.0: an FMU with clocks has event mode in co-simulation"),
    ("interface.flags", Warning, "the capability flags do not contradict each other"),
    ("experiment.times", Error, "stopTime lies after startTime; stepSize and tolerance are positive"),
    ("experiment.step", Warning, "stepSize is at most stopTime - startTime"),
    ("log.unique", Error, "no log category is defined twice"),
    ("unit.unique", Error, "no unit or display unit is defined twice"),
    ("unit.factor", Error, "factors of units and display units are finite and not 0"),
    ("unit.defined", Error, "units and display units used are defined"),
    ("type.unique", Error, "no type is defined twice or named like a variable"),
    ("type.defined", Error, "declaredType names a type of the same kind"),
    ("type.items", Error, "the items of an enumeration have different names and values"),
    ("variable.unique", Error, "variable names are unique, those of aliases too"),
    ("variable.reference", Error, "FMI 3.0: value references are unique"),
    ("variable.name", Error, "variable names follow the naming convention"),
    ("variable.alias", Warning, "variables with the same value reference agree in start value and unit"),
    ("variable.alias-set", Error, "at most one variable of an alias set can be set from outside"),
    ("variable.combination", Error, "causality, variability and initial go together"),
    ("variable.continuous", Error, "only floating-point variables are continuous"),
    ("variable.start", Error, "start values are there where they must be, and only there"),
    (
        "variable.dimension",
        Error,
        "FMI 3.0: sizes of arrays are given, by themselves or by a variable that may",
    ),
    ("variable.length", Error, "FMI 3.0: arrays have one start value, or as many as elements"),
    ("variable.clock", Error, "FMI 3.0: clocks, clocked variables and their previous values go together"),
    ("variable.range", Error, "min <= start <= max"),
    ("variable.enumeration", Error, "start values of enumerations are values of their items"),
    (
        "variable.independent",
        Error,
        "there is at most one independent variable (FMI 3.0: one), a floating-point number",
    ),
    ("variable.derivative", Error, "derivative names a floating-point variable (FMI 3.0: of the same size)"),
    ("structure.outputs", Error, "ModelStructure/Outputs lists every output exactly once"),
    ("structure.derivatives", Error, "ModelStructure/Derivatives lists derivatives"),
    (
        "structure.states",
        Warning,
        "model exchange: Derivatives (FMI 3.0: ContinuousStateDerivative) lists every derivative",
    ),
    ("structure.clocked-states", Error, "FMI 3.0: ClockedState lists variables with a previous value"),
    ("structure.event-indicators", Error, "FMI 3.0: EventIndicator lists continuous numbers"),
    ("structure.initial-unknowns", Error, "ModelStructure/InitialUnknowns is complete, without others"),
    ("structure.order", Error, "ModelStructure/InitialUnknowns is sorted by index"),
    ("structure.index", Error, "indices (FMI 3.0: value references) are those of variables"),
    ("structure.dependencies", Error, "dependencies name variables; dependenciesKind has as many words"),
    (
        "structure.kinds",
        Warning,
        "FMI 3.0: only floating-point numbers depend by a factor (dependenciesKind)",
    ),
    ("structure.unsaid", Warning, "outputs say what they depend on (without it, on every input)"),
    (
        "terminal.unique",
        Error,
        "FMI 3.0: names of terminals are unique on each level, memberName in each terminal",
    ),
    ("terminal.member", Error, "FMI 3.0: members of terminals name variables that can be connected"),
    ("terminal.name", Error, "FMI 3.0: members have a memberName where the matching rule goes by it"),
];

/// A list of [`ModelStructure`](crate::ModelStructure), by its name in FMI 2.0 or its element in FMI 3.0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum UnknownList {
    /// `Outputs` or `Output`.
    Outputs,
    /// `Derivatives` or `ContinuousStateDerivative`.
    Derivatives,
    /// `ClockedState`; in FMI 3.0 only.
    ClockedStates,
    /// `InitialUnknowns` or `InitialUnknown`.
    InitialUnknowns,
    /// `EventIndicator`; in FMI 3.0 only.
    EventIndicators,
}

impl UnknownList {
    /// All of them, in the order of FMI 3.0.
    pub const ALL: [Self; 5] =
        [Self::Outputs, Self::Derivatives, Self::ClockedStates, Self::InitialUnknowns, Self::EventIndicators];

    /// The name of the list; in FMI 2.0 that of its element.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Outputs => "Outputs",
            Self::Derivatives => "Derivatives",
            Self::ClockedStates => "ClockedStates",
            Self::InitialUnknowns => "InitialUnknowns",
            Self::EventIndicators => "EventIndicators",
        }
    }

    /// The element of each of its variables in FMI 3.0.
    pub const fn element(self) -> &'static str {
        match self {
            Self::Outputs => "Output",
            Self::Derivatives => "ContinuousStateDerivative",
            Self::ClockedStates => "ClockedState",
            Self::InitialUnknowns => "InitialUnknown",
            Self::EventIndicators => "EventIndicator",
        }
    }
}

/// A place in a description; numbers are indices in its lists, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Place {
    /// The root.
    Root,
    /// An interface. In FMI 2.0 one for co-simulation, of which the model contains the first. In FMI 3.0 the
    /// one for model exchange, co-simulation or scheduled execution, in this order.
    Interface(usize),
    /// The interface for model exchange of FMI 2.0.
    ModelExchange,
    /// The default experiment.
    Experiment,
    /// A log category.
    Category(usize),
    /// A unit.
    Unit(usize),
    /// A unit, and one of its display units.
    DisplayUnit(usize, usize),
    /// A declared type.
    Type(usize),
    /// A declared type, and one of its items.
    Item(usize, usize),
    /// A variable.
    Variable(usize),
    /// The start value of a variable.
    Start(usize),
    /// A variable, and one of its aliases.
    Alias(usize, usize),
    /// A terminal; nested terminals come after all outer ones.
    Terminal(usize),
    /// A terminal, and one of its members; stream members come after the others.
    Member(usize, usize),
    /// A list of the structure.
    Unknowns(UnknownList),
    /// An element of a list of the structure.
    Unknown(UnknownList, usize),
}

/// A broken rule.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// The name of one of [`RULES`].
    pub rule: &'static str,
    /// The place in the description.
    pub place: Place,
    /// The defect, with the values found and those allowed.
    pub message: String,
}

/// Attributes that are required but missing, or are not values of their type.
pub(crate) type Unread = HashSet<(Place, &'static str)>;

/// The attributes that could not be read, and the callback that rules report to.
pub(crate) struct Check<'a> {
    pub(crate) unread: &'a Unread,
    pub(crate) report: &'a mut dyn FnMut(Violation),
}

impl Check<'_> {
    fn add(&mut self, rule: &'static str, place: Place, message: impl Into<String>) {
        (self.report)(Violation { rule, place, message: message.into() });
    }

    fn is_unread(&self, place: Place, attribute: &'static str) -> bool {
        self.unread.contains(&(place, attribute))
    }

    /// Checks the text that links description and library.
    fn token(&mut self, rule: &'static str, attribute: &'static str, token: &str) {
        if token.trim().is_empty() && !self.is_unread(Place::Root, attribute) {
            let message = format!("{attribute} is empty; must be a text that no other FMU has");
            self.add(rule, Place::Root, message);
        }
    }

    /// Checks a model identifier.
    fn identifier(&mut self, place: Place, name: &str) {
        if !is_c_identifier(name) && !self.is_unread(place, "modelIdentifier") {
            let message = format!(
                "modelIdentifier is {name:?}; must be a C identifier (letters, digits, underscores, no digit first), \
                 since it names the library"
            );
            self.add("interface.identifier", place, message);
        }
    }

    /// Checks two flags with their names; the first requires the second.
    fn flags(&mut self, place: Place, flag: (&str, bool), needs: (&str, bool)) {
        if flag.1 && !needs.1 {
            let message = format!("{} is true, so {} must be true; it is false", flag.0, needs.0);
            self.add("interface.flags", place, message);
        }
    }

    fn experiment(&mut self, experiment: Option<DefaultExperiment>) {
        let Some(experiment) = experiment else { return };
        let mut complain = |message: String| self.add("experiment.times", Place::Experiment, message);
        let named = [("startTime", experiment.start_time), ("stopTime", experiment.stop_time)];
        for (name, value) in named {
            if let Some(value) = value.filter(|value| !value.is_finite()) {
                complain(format!("{name} is {value}; must be finite"));
            }
        }
        let start = experiment.start_time.unwrap_or(0.0);
        if let Some(stop) = experiment.stop_time.filter(|stop| *stop <= start) {
            complain(format!("stopTime is {stop}; must be greater than startTime = {start}"));
        }
        for (name, value) in [("stepSize", experiment.step_size), ("tolerance", experiment.tolerance)] {
            if let Some(value) = value.filter(|value| !value.is_finite() || *value <= 0.0) {
                complain(format!("{name} is {value}; must be finite and > 0"));
            }
        }
        if let (Some(stop), Some(step)) = (experiment.stop_time, experiment.step_size)
            && step > (stop - start) * (1.0 + ROUND_OFF)
            && stop > start
        {
            let message = format!(
                "stepSize is {step}; should be at most stopTime - startTime = {}, or no step fits into the experiment",
                stop - start
            );
            self.add("experiment.step", Place::Experiment, message);
        }
    }

    fn categories(&mut self, categories: &[LogCategory]) {
        let mut seen = HashSet::new();
        for (c, category) in categories.iter().enumerate() {
            if !seen.insert(category.name.as_str()) {
                let message = format!("the log category {:?} is defined twice", brief(&category.name));
                self.add("log.unique", Place::Category(c), message);
            }
        }
    }

    fn units(&mut self, units: &[Unit]) {
        let mut seen = HashSet::new();
        for (u, unit) in units.iter().enumerate() {
            if !seen.insert(unit.name.as_str()) {
                let message = format!("the unit {:?} is defined twice", unit.name);
                self.add("unit.unique", Place::Unit(u), message);
            }
            if let Some(base) = unit.base {
                self.factor(Place::Unit(u), &unit.name, base.factor);
            }
            let mut displayed = HashSet::new();
            for (d, display) in unit.display_units.iter().enumerate() {
                self.factor(Place::DisplayUnit(u, d), &display.name, display.factor);
                if display.inverse && display.offset != 0.0 {
                    let (name, offset) = (brief(&display.name), display.offset);
                    let message = format!(
                        "the display unit {name:?} is inverse and has the offset {offset}; must have none"
                    );
                    self.add("unit.factor", Place::DisplayUnit(u, d), message);
                }
                if !displayed.insert(display.name.as_str()) {
                    let message =
                        format!("the unit {:?} has the display unit {:?} twice", unit.name, display.name);
                    self.add("unit.unique", Place::DisplayUnit(u, d), message);
                }
            }
        }
    }

    fn factor(&mut self, place: Place, unit: &str, factor: f64) {
        if factor == 0.0 || !factor.is_finite() {
            let message =
                format!("the unit {:?} has the factor {factor}; must be finite and not 0", brief(unit));
            self.add("unit.factor", place, message);
        }
    }
}

/// Relative round-off of a time that is the difference of two times.
const ROUND_OFF: f64 = 1e-9;

/// The beginning of a long text, for messages.
pub fn brief(text: &str) -> String {
    const LENGTH: usize = 80;
    if text.chars().count() <= LENGTH {
        return text.to_owned();
    }
    text.chars().take(LENGTH).chain("...".chars()).collect()
}
