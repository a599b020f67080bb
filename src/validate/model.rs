//! The model description as plain data with positions. Nothing is refused here: what the schema pass
//! has complained about is simply absent.

use punctual_modeldescription::{BaseType, Causality, Initial, InitialRule, Variability};
use roxmltree::{Document, Node};

use super::finding::Mark;
use super::schema::types::{boolean, double, int, unsigned, words};
use super::schema::{place, place_of};

/// The type of a variable or a declared type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Real,
    Integer,
    Boolean,
    String,
    Enumeration,
}

const KINDS: [(&str, Kind); 5] = [
    ("Real", Kind::Real),
    ("Integer", Kind::Integer),
    ("Boolean", Kind::Boolean),
    ("String", Kind::String),
    ("Enumeration", Kind::Enumeration),
];

impl Kind {
    pub(super) fn name(self) -> &'static str {
        KINDS.iter().find(|(_, kind)| *kind == self).map_or("", |(name, _)| name)
    }

    /// The functions that read it; enumerations are read as integers.
    pub(super) fn base(self) -> BaseType {
        match self {
            Self::Real => BaseType::Real,
            Self::Integer | Self::Enumeration => BaseType::Integer,
            Self::Boolean => BaseType::Boolean,
            Self::String => BaseType::String,
        }
    }
}

#[derive(Debug)]
pub(super) struct Unit<'a> {
    pub(super) name: &'a str,
    pub(super) display: Vec<(&'a str, Mark)>,
    pub(super) mark: Mark,
}

#[derive(Debug)]
pub(super) struct SimpleType<'a> {
    pub(super) name: &'a str,
    pub(super) kind: Option<Kind>,
    pub(super) unit: Option<&'a str>,
    pub(super) display_unit: Option<&'a str>,
    pub(super) min: Option<f64>,
    pub(super) max: Option<f64>,
    pub(super) items: Vec<(&'a str, Option<i32>, Mark)>,
    pub(super) mark: Mark,
}

#[derive(Debug)]
pub(super) struct Variable<'a> {
    pub(super) name: &'a str,
    pub(super) reference: Option<u32>,
    pub(super) kind: Kind,
    pub(super) causality: Causality,
    pub(super) variability: Variability,
    /// As written.
    pub(super) initial: Option<Initial>,
    pub(super) declared_type: Option<&'a str>,
    pub(super) unit: Option<&'a str>,
    pub(super) display_unit: Option<&'a str>,
    pub(super) start: Option<&'a str>,
    pub(super) min: Option<f64>,
    pub(super) max: Option<f64>,
    pub(super) derivative: Option<u32>,
    pub(super) mark: Mark,
    pub(super) start_mark: Mark,
}

impl Variable<'_> {
    /// With the default of the standard filled in.
    pub(super) fn effective_initial(&self) -> Option<Initial> {
        self.initial.or_else(|| InitialRule::of(self.causality, self.variability)?.default)
    }

    /// The start value as a number; enumerations and Booleans too.
    pub(super) fn start_number(&self) -> Option<f64> {
        let start = self.start?;
        match self.kind {
            Kind::Real => double(start),
            Kind::Integer | Kind::Enumeration => int(start).map(f64::from),
            Kind::Boolean => boolean(start).map(|b| f64::from(u8::from(b))),
            Kind::String => None,
        }
    }
}

#[derive(Debug)]
pub(super) struct Unknown<'a> {
    pub(super) index: Option<u32>,
    pub(super) dependencies: Option<Vec<Option<u32>>>,
    pub(super) kinds: Option<Vec<&'a str>>,
    pub(super) mark: Mark,
}

#[derive(Debug)]
pub(super) struct Interface<'a> {
    pub(super) identifier: Option<&'a str>,
    pub(super) get_and_set_state: bool,
    pub(super) serialise_state: bool,
    pub(super) needs_execution_tool: bool,
    pub(super) source_files: usize,
    pub(super) mark: Mark,
}

#[derive(Debug, Default)]
pub(super) struct Experiment {
    pub(super) start: Option<f64>,
    pub(super) stop: Option<f64>,
    pub(super) step: Option<f64>,
    pub(super) tolerance: Option<f64>,
    pub(super) mark: Mark,
}

/// A list of `ModelStructure`.
#[derive(Debug, Default)]
pub(super) struct Unknowns<'a> {
    pub(super) list: Vec<Unknown<'a>>,
    /// Of the list, or of what it is missing in.
    pub(super) mark: Mark,
}

/// What a model description says.
#[derive(Debug)]
pub(super) struct Model<'a> {
    pub(super) guid: Option<&'a str>,
    pub(super) structured: bool,
    pub(super) interfaces: Vec<Interface<'a>>,
    pub(super) units: Vec<Unit<'a>>,
    pub(super) types: Vec<SimpleType<'a>>,
    pub(super) experiment: Option<Experiment>,
    pub(super) variables: Vec<Variable<'a>>,
    pub(super) outputs: Unknowns<'a>,
    pub(super) derivatives: Unknowns<'a>,
    pub(super) initial_unknowns: Unknowns<'a>,
    pub(super) mark: Mark,
}

impl<'a> Model<'a> {
    pub(super) fn read(document: &'a Document<'a>) -> Self {
        let root = document.root_element();
        let inside = |name: &'static str| root.children().filter(move |n| n.has_tag_name(name));
        let list = |outer: &'static str, inner: &'static str| {
            inside(outer).flat_map(move |n| n.children().filter(move |n| n.has_tag_name(inner)))
        };
        let structure = inside("ModelStructure").next();
        Self {
            guid: root.attribute("guid"),
            structured: root.attribute("variableNamingConvention") == Some("structured"),
            interfaces: inside("CoSimulation").map(interface).collect(),
            units: list("UnitDefinitions", "Unit").map(unit).collect(),
            types: list("TypeDefinitions", "SimpleType").map(simple_type).collect(),
            experiment: inside("DefaultExperiment").next().map(experiment),
            variables: list("ModelVariables", "ScalarVariable").map(variable).collect(),
            outputs: unknowns(root, structure, "Outputs"),
            derivatives: unknowns(root, structure, "Derivatives"),
            initial_unknowns: unknowns(root, structure, "InitialUnknowns"),
            mark: place(root),
        }
    }

    /// The first co-simulation interface.
    pub(super) fn interface(&self) -> Option<&Interface<'a>> {
        self.interfaces.first()
    }

    /// The variable of an index of `ModelStructure`, counted from 1.
    pub(super) fn at(&self, index: u32) -> Option<&Variable<'a>> {
        self.variables.get(usize::try_from(index).ok()?.checked_sub(1)?)
    }
}

fn interface<'a>(node: Node<'a, 'a>) -> Interface<'a> {
    let flag = |name| node.attribute(name).and_then(boolean).unwrap_or(false);
    Interface {
        identifier: node.attribute("modelIdentifier"),
        get_and_set_state: flag("canGetAndSetFMUstate"),
        serialise_state: flag("canSerializeFMUstate"),
        needs_execution_tool: flag("needsExecutionTool"),
        source_files: node.descendants().filter(|n| n.has_tag_name("File")).count(),
        mark: place_of(node, "modelIdentifier"),
    }
}

fn unit<'a>(node: Node<'a, 'a>) -> Unit<'a> {
    let display = node.children().filter(|n| n.has_tag_name("DisplayUnit"));
    let display = display.filter_map(|n| Some((n.attribute("name")?, place(n)))).collect();
    Unit { name: node.attribute("name").unwrap_or_default(), display, mark: place(node) }
}

fn kind_of<'a>(node: Node<'a, 'a>) -> Option<(Kind, Node<'a, 'a>)> {
    node.children().find_map(|n| {
        let (_, kind) = KINDS.iter().find(|(name, _)| n.has_tag_name(*name))?;
        Some((*kind, n))
    })
}

fn simple_type<'a>(node: Node<'a, 'a>) -> SimpleType<'a> {
    let of = kind_of(node);
    let attribute = |name: &str| of.and_then(|(_, n)| n.attribute(name));
    let items = of.map(|(_, n)| n.children().filter(|n| n.has_tag_name("Item"))).into_iter().flatten();
    SimpleType {
        name: node.attribute("name").unwrap_or_default(),
        kind: of.map(|(kind, _)| kind),
        unit: attribute("unit"),
        display_unit: attribute("displayUnit"),
        min: attribute("min").and_then(double),
        max: attribute("max").and_then(double),
        items: items
            .map(|n| (n.attribute("name").unwrap_or_default(), n.attribute("value").and_then(int), place(n)))
            .collect(),
        mark: place(node),
    }
}

fn experiment(node: Node<'_, '_>) -> Experiment {
    let number = |name: &str| node.attribute(name).and_then(double);
    Experiment {
        start: number("startTime"),
        stop: number("stopTime"),
        step: number("stepSize"),
        tolerance: number("tolerance"),
        mark: place(node),
    }
}

fn variable<'a>(node: Node<'a, 'a>) -> Variable<'a> {
    let of = kind_of(node);
    let attribute = |name: &str| of.and_then(|(_, n)| n.attribute(name));
    let causality = match node.attribute("causality") {
        Some("parameter") => Causality::Parameter,
        Some("calculatedParameter") => Causality::CalculatedParameter,
        Some("input") => Causality::Input,
        Some("output") => Causality::Output,
        Some("independent") => Causality::Independent,
        _ => Causality::Local,
    };
    let variability = match node.attribute("variability") {
        Some("constant") => Variability::Constant,
        Some("fixed") => Variability::Fixed,
        Some("tunable") => Variability::Tunable,
        Some("discrete") => Variability::Discrete,
        _ => Variability::Continuous,
    };
    let initial = match node.attribute("initial") {
        Some("exact") => Some(Initial::Exact),
        Some("approx") => Some(Initial::Approx),
        Some("calculated") => Some(Initial::Calculated),
        _ => None,
    };
    Variable {
        name: node.attribute("name").unwrap_or_default(),
        reference: node.attribute("valueReference").and_then(unsigned),
        kind: of.map_or(Kind::Real, |(kind, _)| kind),
        causality,
        variability,
        initial,
        declared_type: attribute("declaredType"),
        unit: attribute("unit"),
        display_unit: attribute("displayUnit"),
        start: attribute("start"),
        min: attribute("min").and_then(double),
        max: attribute("max").and_then(double),
        derivative: attribute("derivative").and_then(unsigned),
        mark: place(node),
        start_mark: of.map_or_else(|| place(node), |(_, n)| place_of(n, "start")),
    }
}

fn unknowns<'a>(root: Node<'a, 'a>, structure: Option<Node<'a, 'a>>, name: &'static str) -> Unknowns<'a> {
    let list = structure.and_then(|n| n.children().find(|n| n.has_tag_name(name)));
    let unknown = |n: Node<'a, 'a>| Unknown {
        index: n.attribute("index").and_then(unsigned),
        dependencies: n.attribute("dependencies").map(|text| words(text).map(unsigned).collect()),
        kinds: n.attribute("dependenciesKind").map(|text| words(text).collect()),
        mark: place(n),
    };
    Unknowns {
        list: list
            .map(|n| n.children().filter(|n| n.has_tag_name("Unknown")))
            .into_iter()
            .flatten()
            .map(unknown)
            .collect(),
        mark: place(list.or(structure).unwrap_or(root)),
    }
}
