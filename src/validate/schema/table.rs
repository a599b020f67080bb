//! The elements and attributes of the FMI 2.0 schema (`fmi2ModelDescription.xsd` and the files it
//! includes), row by row.

use punctual_modeldescription::{Causality, Initial, NamingConvention, Variability};

use super::types::Value;
use Times::{Choice, Many, Maybe, One, Some};
use Value::{Boolean, DateTime, Double, Int, Line, OneOf, Text, Unsigned, Version, Words};

/// Number of times that an element stands in its parent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Times {
    /// Exactly once.
    One,
    /// At most once.
    Maybe,
    /// Once or more.
    Some,
    /// Any number of times.
    Many,
    /// Exactly one of all those marked so.
    Choice,
}

impl Times {
    pub(super) fn most(self) -> usize {
        match self {
            One | Maybe => 1,
            // A second element of a choice is told for the whole choice.
            Some | Many | Choice => usize::MAX,
        }
    }
}

/// Whether an attribute must be there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Use {
    Required,
    Optional,
}

/// Further content of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Content {
    /// Only the children of the table.
    Elements,
    /// Any content that a tool put there.
    Anything,
}

/// An attribute.
#[derive(Debug)]
pub(super) struct Attribute {
    pub(super) name: &'static str,
    pub(super) value: Value,
    pub(super) required: Use,
}

/// A child of an element. Children of a lower group stand before those of a higher one.
#[derive(Debug)]
pub(super) struct Child {
    pub(super) name: &'static str,
    /// Its row in [`ELEMENTS`].
    pub(super) kind: &'static str,
    pub(super) times: Times,
    pub(super) group: u8,
}

/// An element, by the name of its type.
#[derive(Debug)]
pub(super) struct Element {
    pub(super) kind: &'static str,
    pub(super) attributes: &'static [Attribute],
    pub(super) children: &'static [Child],
    pub(super) content: Content,
}

const fn must(name: &'static str, value: Value) -> Attribute {
    Attribute { name, value, required: Use::Required }
}

const fn may(name: &'static str, value: Value) -> Attribute {
    Attribute { name, value, required: Use::Optional }
}

const fn child(group: u8, name: &'static str, kind: &'static str, times: Times) -> Child {
    Child { name, kind, times, group }
}

const fn row(kind: &'static str, attributes: &'static [Attribute], children: &'static [Child]) -> Element {
    Element { kind, attributes, children, content: Content::Elements }
}

const CAUSALITY: Value = OneOf(Causality::WORDS_OF_FMI2);
const VARIABILITY: Value = OneOf(Variability::WORDS);
const INITIAL: Value = OneOf(Initial::WORDS);
const NAMING: Value = OneOf(NamingConvention::WORDS);
const DEPENDENCY: Value = Words(&["dependent", "constant", "fixed", "tunable", "discrete"]);

/// The schema.
pub(super) const ELEMENTS: &[Element] = &[
    row(
        "fmiModelDescription",
        &[
            must("fmiVersion", Version),
            must("modelName", Text),
            must("guid", Line),
            may("description", Text),
            may("author", Text),
            may("version", Line),
            may("copyright", Text),
            may("license", Text),
            may("generationTool", Line),
            may("generationDateAndTime", DateTime),
            may("variableNamingConvention", NAMING),
            may("numberOfEventIndicators", Unsigned),
        ],
        &[
            // Both orders are allowed. A rule beyond the schema asks for one of each.
            child(0, "ModelExchange", "ModelExchange", Many),
            child(0, "CoSimulation", "CoSimulation", Many),
            child(1, "UnitDefinitions", "UnitDefinitions", Maybe),
            child(2, "TypeDefinitions", "TypeDefinitions", Maybe),
            child(3, "LogCategories", "LogCategories", Maybe),
            child(4, "DefaultExperiment", "DefaultExperiment", Maybe),
            child(5, "VendorAnnotations", "Annotations", Maybe),
            child(6, "ModelVariables", "ModelVariables", One),
            child(7, "ModelStructure", "ModelStructure", One),
        ],
    ),
    row(
        "ModelExchange",
        &[
            must("modelIdentifier", Line),
            may("needsExecutionTool", Boolean),
            may("completedIntegratorStepNotNeeded", Boolean),
            may("canBeInstantiatedOnlyOncePerProcess", Boolean),
            may("canNotUseMemoryManagementFunctions", Boolean),
            may("canGetAndSetFMUstate", Boolean),
            may("canSerializeFMUstate", Boolean),
            may("providesDirectionalDerivative", Boolean),
        ],
        &[child(0, "SourceFiles", "SourceFiles", Maybe)],
    ),
    row(
        "CoSimulation",
        &[
            must("modelIdentifier", Line),
            may("needsExecutionTool", Boolean),
            may("canHandleVariableCommunicationStepSize", Boolean),
            may("canInterpolateInputs", Boolean),
            may("maxOutputDerivativeOrder", Unsigned),
            // The schema spells it so.
            may("canRunAsynchronuously", Boolean),
            may("canBeInstantiatedOnlyOncePerProcess", Boolean),
            may("canNotUseMemoryManagementFunctions", Boolean),
            may("canGetAndSetFMUstate", Boolean),
            may("canSerializeFMUstate", Boolean),
            may("providesDirectionalDerivative", Boolean),
        ],
        &[child(0, "SourceFiles", "SourceFiles", Maybe)],
    ),
    row("SourceFiles", &[], &[child(0, "File", "File", Some)]),
    row("File", &[must("name", Line)], &[]),
    row("UnitDefinitions", &[], &[child(0, "Unit", "Unit", Some)]),
    row(
        "Unit",
        &[must("name", Line)],
        &[child(0, "BaseUnit", "BaseUnit", Maybe), child(1, "DisplayUnit", "DisplayUnit", Many)],
    ),
    row(
        "BaseUnit",
        &[
            may("kg", Int),
            may("m", Int),
            may("s", Int),
            may("A", Int),
            may("K", Int),
            may("mol", Int),
            may("cd", Int),
            may("rad", Int),
            may("factor", Double),
            may("offset", Double),
        ],
        &[],
    ),
    row("DisplayUnit", &[must("name", Line), may("factor", Double), may("offset", Double)], &[]),
    row("TypeDefinitions", &[], &[child(0, "SimpleType", "SimpleType", Some)]),
    row(
        "SimpleType",
        &[must("name", Line), may("description", Text)],
        &[
            child(0, "Real", "RealType", Choice),
            child(0, "Integer", "IntegerType", Choice),
            child(0, "Boolean", "Nothing", Choice),
            child(0, "String", "Nothing", Choice),
            child(0, "Enumeration", "EnumerationType", Choice),
        ],
    ),
    row(
        "RealType",
        &[
            may("quantity", Line),
            may("unit", Line),
            may("displayUnit", Line),
            may("relativeQuantity", Boolean),
            may("min", Double),
            may("max", Double),
            may("nominal", Double),
            may("unbounded", Boolean),
        ],
        &[],
    ),
    row("IntegerType", &[may("quantity", Line), may("min", Int), may("max", Int)], &[]),
    // The schema gives these no type, so it takes anything; nothing is meant.
    Element { kind: "Nothing", attributes: &[], children: &[], content: Content::Anything },
    row("EnumerationType", &[may("quantity", Line)], &[child(0, "Item", "Item", Some)]),
    row("Item", &[must("name", Line), must("value", Int), may("description", Text)], &[]),
    row("LogCategories", &[], &[child(0, "Category", "Category", Some)]),
    row("Category", &[must("name", Line), may("description", Text)], &[]),
    row(
        "DefaultExperiment",
        &[
            may("startTime", Double),
            may("stopTime", Double),
            may("tolerance", Double),
            may("stepSize", Double),
        ],
        &[],
    ),
    row("Annotations", &[], &[child(0, "Tool", "Tool", Some)]),
    Element { kind: "Tool", attributes: &[must("name", Line)], children: &[], content: Content::Anything },
    row("ModelVariables", &[], &[child(0, "ScalarVariable", "ScalarVariable", Some)]),
    row(
        "ScalarVariable",
        &[
            must("name", Line),
            must("valueReference", Unsigned),
            may("description", Text),
            may("causality", CAUSALITY),
            may("variability", VARIABILITY),
            may("initial", INITIAL),
            may("canHandleMultipleSetPerTimeInstant", Boolean),
        ],
        &[
            child(0, "Real", "Real", Choice),
            child(0, "Integer", "Integer", Choice),
            child(0, "Boolean", "Boolean", Choice),
            child(0, "String", "String", Choice),
            child(0, "Enumeration", "Enumeration", Choice),
            child(1, "Annotations", "Annotations", Maybe),
        ],
    ),
    row(
        "Real",
        &[
            may("declaredType", Line),
            may("quantity", Line),
            may("unit", Line),
            may("displayUnit", Line),
            may("relativeQuantity", Boolean),
            may("min", Double),
            may("max", Double),
            may("nominal", Double),
            may("unbounded", Boolean),
            may("start", Double),
            may("derivative", Unsigned),
            may("reinit", Boolean),
        ],
        &[],
    ),
    row(
        "Integer",
        &[
            may("declaredType", Line),
            may("quantity", Line),
            may("min", Int),
            may("max", Int),
            may("start", Int),
        ],
        &[],
    ),
    row("Boolean", &[may("declaredType", Line), may("start", Boolean)], &[]),
    row("String", &[may("declaredType", Line), may("start", Text)], &[]),
    row(
        "Enumeration",
        &[
            must("declaredType", Line),
            may("quantity", Line),
            may("min", Int),
            may("max", Int),
            may("start", Int),
        ],
        &[],
    ),
    row(
        "ModelStructure",
        &[],
        &[
            child(0, "Outputs", "Unknowns", Maybe),
            child(1, "Derivatives", "Unknowns", Maybe),
            child(2, "InitialUnknowns", "Unknowns", Maybe),
        ],
    ),
    row("Unknowns", &[], &[child(0, "Unknown", "Unknown", Some)]),
    row(
        "Unknown",
        &[
            must("index", Unsigned),
            may("dependencies", Value::UnsignedList),
            may("dependenciesKind", DEPENDENCY),
        ],
        &[],
    ),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_child_has_a_row_and_every_row_a_parent() {
        for element in ELEMENTS {
            for child in element.children {
                assert!(ELEMENTS.iter().any(|row| row.kind == child.kind), "{}", child.kind);
            }
            assert!(element.children.is_sorted_by_key(|child| child.group), "{}", element.kind);
            let used = ELEMENTS.iter().flat_map(|row| row.children).any(|child| child.kind == element.kind);
            assert!(used || element.kind == "fmiModelDescription", "{}", element.kind);
        }
    }
}
