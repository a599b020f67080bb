//! The elements and attributes of the FMI 3.0 schemas (`fmi3ModelDescription.xsd`, `fmi3TerminalsAndIcons.xsd`,
//! `fmi3BuildDescription.xsd` and the files they include), row by row.

use punctual_modeldescription::Causality;
use punctual_modeldescription::fmi3::IntervalVariability;

use super::super::types::{INT, UNSIGNED, Value};
use super::Times::{Many, Maybe, Mix, One, Some};
use super::fmi2::{DEPENDENCY, INITIAL, NAMING, VARIABILITY};
use super::{Attribute, Child, Element, anything, child, groups, may, must};
use Value::{Boolean, Bytes, DateTime, Double, Line, List, OneOf, Text, Version, Whole};

const CAUSALITY: Value = OneOf(Causality::WORDS);
const LONG: Value = Whole(i64::MIN as i128, i64::MAX as i128);
const UNSIGNED_LONG: Value = Whole(0, u64::MAX as i128);
const BYTE: Value = Whole(i8::MIN as i128, i8::MAX as i128);
const UNSIGNED_BYTE: Value = Whole(0, u8::MAX as i128);
const SHORT: Value = Whole(i16::MIN as i128, i16::MAX as i128);
const UNSIGNED_SHORT: Value = Whole(0, u16::MAX as i128);
/// A non-negative number of any size.
const NATURAL: Value = Whole(0, i128::MAX);

// Groups of attributes, as in fmi3AttributeGroups.xsd and fmi3Variable.xsd.

const NAMED: &[Attribute] = &[must("name", Line), may("description", Text)];
const REAL: &[Attribute] = &[
    may("quantity", Line),
    may("unit", Line),
    may("displayUnit", Line),
    may("relativeQuantity", Boolean),
    may("unbounded", Boolean),
    may("min", Double),
    may("max", Double),
    may("nominal", Double),
];
const QUANTITY: &[Attribute] = &[may("quantity", Line)];
const BINARY: &[Attribute] = &[may("mimeType", Line), may("maxSize", NATURAL)];
const CLOCK: &[Attribute] = &[
    may("canBeDeactivated", Boolean),
    may("priority", UNSIGNED),
    must("intervalVariability", OneOf(IntervalVariability::WORDS)),
    may("intervalDecimal", Double),
    may("shiftDecimal", Double),
    may("supportsFraction", Boolean),
    may("resolution", UNSIGNED_LONG),
    may("intervalCounter", UNSIGNED_LONG),
    may("shiftCounter", UNSIGNED_LONG),
];
const VARIABLE: &[Attribute] = &[
    must("name", Line),
    must("valueReference", UNSIGNED),
    may("description", Text),
    may("causality", CAUSALITY),
    may("variability", VARIABILITY),
    may("canHandleMultipleSetPerTimeInstant", Boolean),
    may("clocks", List(&UNSIGNED)),
];
const ARRAYABLE: &[Attribute] =
    &[may("intermediateUpdate", Boolean), may("previous", UNSIGNED), may("initial", INITIAL)];
const TYPED: &[Attribute] = &[may("declaredType", Line)];
const STATE: &[Attribute] =
    &[may("start", List(&Double)), may("derivative", UNSIGNED), may("reinit", Boolean)];
const INTERFACE: &[Attribute] = &[
    must("modelIdentifier", Line),
    may("needsExecutionTool", Boolean),
    may("canBeInstantiatedOnlyOncePerProcess", Boolean),
    may("canGetAndSetFMUState", Boolean),
    may("canSerializeFMUState", Boolean),
    may("providesDirectionalDerivatives", Boolean),
    may("providesAdjointDerivatives", Boolean),
    may("providesPerElementDependencies", Boolean),
];

/// `min` and `max` of an integer type.
macro_rules! bounds {
    ($value:expr) => {
        &[may("min", $value), may("max", $value)]
    };
}

// Children.

const ANNOTATIONS: Child = child(0, "Annotations", "Annotations", Maybe);
const ONLY_ANNOTATIONS: &[Child] = &[ANNOTATIONS];
const OF_FLOAT: &[Child] =
    &[ANNOTATIONS, child(1, "Dimension", "Dimension", Many), child(3, "Alias", "FloatAlias", Many)];
const OF_VARIABLE: &[Child] =
    &[ANNOTATIONS, child(1, "Dimension", "Dimension", Many), child(3, "Alias", "Alias", Many)];
const OF_TEXT: &[Child] = &[
    ANNOTATIONS,
    child(1, "Dimension", "Dimension", Many),
    child(2, "Start", "TextStart", Many),
    child(3, "Alias", "Alias", Many),
];
const OF_BYTES: &[Child] = &[
    ANNOTATIONS,
    child(1, "Dimension", "Dimension", Many),
    child(2, "Start", "BytesStart", Many),
    child(3, "Alias", "Alias", Many),
];

/// An interface, which may have capability flags that the schema does not know.
const fn interface(kind: &'static str, of: &'static [&'static [Attribute]]) -> Element {
    Element { open: true, ..groups(kind, of, ONLY_ANNOTATIONS) }
}

/// The row of an integer type as a variable.
macro_rules! integer {
    ($kind:literal, $value:expr) => {
        groups(
            $kind,
            &[VARIABLE, ARRAYABLE, TYPED, QUANTITY, bounds!($value), &[may("start", List(&$value))]],
            OF_VARIABLE,
        )
    };
}

/// The row of an integer type as a declared type.
macro_rules! integer_type {
    ($kind:literal, $value:expr) => {
        groups($kind, &[NAMED, QUANTITY, bounds!($value)], ONLY_ANNOTATIONS)
    };
}

/// The rows of the schemas.
pub(super) const ELEMENTS: &[Element] = &[
    groups(
        "fmiModelDescription",
        &[&[
            must("fmiVersion", Version("3.0")),
            must("modelName", Text),
            must("instantiationToken", Line),
            may("description", Text),
            may("author", Text),
            may("version", Line),
            may("copyright", Text),
            may("license", Text),
            may("generationTool", Line),
            may("generationDateAndTime", DateTime),
            may("variableNamingConvention", NAMING),
        ]],
        &[
            child(0, "ModelExchange", "ModelExchange", Maybe),
            child(1, "CoSimulation", "CoSimulation", Maybe),
            child(2, "ScheduledExecution", "ScheduledExecution", Maybe),
            child(3, "UnitDefinitions", "UnitDefinitions", Maybe),
            child(4, "TypeDefinitions", "TypeDefinitions", Maybe),
            child(5, "LogCategories", "LogCategories", Maybe),
            child(6, "DefaultExperiment", "DefaultExperiment", Maybe),
            child(7, "ModelVariables", "ModelVariables", One),
            child(8, "ModelStructure", "ModelStructure", One),
            child(9, "Annotations", "Annotations", Maybe),
        ],
    ),
    interface(
        "ModelExchange",
        &[
            INTERFACE,
            &[may("needsCompletedIntegratorStep", Boolean), may("providesEvaluateDiscreteStates", Boolean)],
        ],
    ),
    interface(
        "CoSimulation",
        &[
            INTERFACE,
            &[
                may("canHandleVariableCommunicationStepSize", Boolean),
                may("fixedInternalStepSize", Double),
                may("maxOutputDerivativeOrder", UNSIGNED),
                may("recommendedIntermediateInputSmoothness", INT),
                may("providesIntermediateUpdate", Boolean),
                may("mightReturnEarlyFromDoStep", Boolean),
                may("canReturnEarlyAfterIntermediateUpdate", Boolean),
                may("hasEventMode", Boolean),
                may("providesEvaluateDiscreteStates", Boolean),
            ],
        ],
    ),
    interface("ScheduledExecution", &[INTERFACE]),
    groups("Annotations", &[], &[child(0, "Annotation", "Annotation", Some)]),
    anything("Annotation", &[&[must("type", Line)]]),
    groups("UnitDefinitions", &[], &[child(0, "Unit", "Unit", Some)]),
    groups(
        "Unit",
        &[&[must("name", Line)]],
        &[
            child(0, "BaseUnit", "BaseUnit", Maybe),
            child(1, "DisplayUnit", "DisplayUnit", Many),
            child(2, "Annotations", "Annotations", Maybe),
        ],
    ),
    groups(
        "BaseUnit",
        &[&[
            may("kg", INT),
            may("m", INT),
            may("s", INT),
            may("A", INT),
            may("K", INT),
            may("mol", INT),
            may("cd", INT),
            may("rad", INT),
            may("factor", Double),
            may("offset", Double),
        ]],
        &[],
    ),
    groups(
        "DisplayUnit",
        &[&[must("name", Line), may("factor", Double), may("offset", Double), may("inverse", Boolean)]],
        ONLY_ANNOTATIONS,
    ),
    groups(
        "TypeDefinitions",
        &[],
        &[
            child(0, "Float32Type", "FloatType", Mix),
            child(0, "Float64Type", "FloatType", Mix),
            child(0, "Int8Type", "Int8Type", Mix),
            child(0, "UInt8Type", "UInt8Type", Mix),
            child(0, "Int16Type", "Int16Type", Mix),
            child(0, "UInt16Type", "UInt16Type", Mix),
            child(0, "Int32Type", "Int32Type", Mix),
            child(0, "UInt32Type", "UInt32Type", Mix),
            child(0, "Int64Type", "Int64Type", Mix),
            child(0, "UInt64Type", "UInt64Type", Mix),
            child(0, "BooleanType", "PlainType", Mix),
            child(0, "StringType", "PlainType", Mix),
            child(0, "BinaryType", "BinaryType", Mix),
            child(0, "EnumerationType", "EnumerationType", Mix),
            child(0, "ClockType", "ClockType", Mix),
        ],
    ),
    groups("FloatType", &[NAMED, REAL], ONLY_ANNOTATIONS),
    integer_type!("Int8Type", BYTE),
    integer_type!("UInt8Type", UNSIGNED_BYTE),
    integer_type!("Int16Type", SHORT),
    integer_type!("UInt16Type", UNSIGNED_SHORT),
    integer_type!("Int32Type", INT),
    integer_type!("UInt32Type", UNSIGNED),
    integer_type!("Int64Type", LONG),
    integer_type!("UInt64Type", UNSIGNED_LONG),
    groups("PlainType", &[NAMED], ONLY_ANNOTATIONS),
    groups("BinaryType", &[NAMED, BINARY], ONLY_ANNOTATIONS),
    groups(
        "EnumerationType",
        &[NAMED, QUANTITY, bounds!(LONG)],
        &[ANNOTATIONS, child(1, "Item", "Item", Some)],
    ),
    groups("Item", &[NAMED, &[must("value", LONG)]], ONLY_ANNOTATIONS),
    groups("ClockType", &[NAMED, CLOCK], ONLY_ANNOTATIONS),
    groups("LogCategories", &[], &[child(0, "Category", "Category", Some)]),
    groups("Category", &[NAMED], ONLY_ANNOTATIONS),
    groups(
        "DefaultExperiment",
        &[&[
            may("startTime", Double),
            may("stopTime", Double),
            may("tolerance", Double),
            may("stepSize", Double),
        ]],
        ONLY_ANNOTATIONS,
    ),
    groups(
        "ModelVariables",
        &[],
        &[
            child(0, "Float32", "Float", Mix),
            child(0, "Float64", "Float", Mix),
            child(0, "Int8", "Int8", Mix),
            child(0, "UInt8", "UInt8", Mix),
            child(0, "Int16", "Int16", Mix),
            child(0, "UInt16", "UInt16", Mix),
            child(0, "Int32", "Int32", Mix),
            child(0, "UInt32", "UInt32", Mix),
            child(0, "Int64", "Int64", Mix),
            child(0, "UInt64", "UInt64", Mix),
            child(0, "Boolean", "Boolean", Mix),
            child(0, "String", "String", Mix),
            child(0, "Binary", "Binary", Mix),
            child(0, "Enumeration", "Enumeration", Mix),
            child(0, "Clock", "Clock", Mix),
        ],
    ),
    groups("Float", &[VARIABLE, ARRAYABLE, TYPED, REAL, STATE], OF_FLOAT),
    integer!("Int8", BYTE),
    integer!("UInt8", UNSIGNED_BYTE),
    integer!("Int16", SHORT),
    integer!("UInt16", UNSIGNED_SHORT),
    integer!("Int32", INT),
    integer!("UInt32", UNSIGNED),
    integer!("Int64", LONG),
    integer!("UInt64", UNSIGNED_LONG),
    groups("Boolean", &[VARIABLE, ARRAYABLE, TYPED, &[may("start", List(&Boolean))]], OF_VARIABLE),
    groups("String", &[VARIABLE, ARRAYABLE, TYPED], OF_TEXT),
    groups("Binary", &[VARIABLE, ARRAYABLE, TYPED, BINARY], OF_BYTES),
    groups(
        "Enumeration",
        &[
            VARIABLE,
            ARRAYABLE,
            &[must("declaredType", Line)],
            QUANTITY,
            bounds!(LONG),
            &[may("start", List(&LONG))],
        ],
        OF_VARIABLE,
    ),
    groups("Clock", &[VARIABLE, TYPED, CLOCK], &[ANNOTATIONS, child(3, "Alias", "Alias", Many)]),
    groups("Dimension", &[&[may("start", UNSIGNED_LONG), may("valueReference", UNSIGNED)]], &[]),
    groups("TextStart", &[&[may("value", Text)]], &[]),
    groups("BytesStart", &[&[may("value", Bytes)]], &[]),
    groups("Alias", &[NAMED], &[]),
    groups("FloatAlias", &[NAMED, &[may("displayUnit", Line)]], &[]),
    groups(
        "ModelStructure",
        &[],
        &[
            child(0, "Output", "Unknown", Many),
            child(1, "ContinuousStateDerivative", "Unknown", Many),
            child(2, "ClockedState", "Unknown", Many),
            child(3, "InitialUnknown", "Unknown", Many),
            child(4, "EventIndicator", "Unknown", Many),
        ],
    ),
    groups(
        "Unknown",
        &[&[
            must("valueReference", UNSIGNED),
            may("dependencies", List(&UNSIGNED)),
            may("dependenciesKind", DEPENDENCY),
        ]],
        ONLY_ANNOTATIONS,
    ),
    // terminalsAndIcons.xml
    groups(
        "fmiTerminalsAndIcons",
        &[&[must("fmiVersion", Version("3.0"))]],
        &[
            child(0, "GraphicalRepresentation", "GraphicalRepresentation", Maybe),
            child(1, "Terminals", "Terminals", Maybe),
            child(2, "Annotations", "Annotations", Maybe),
        ],
    ),
    groups(
        "GraphicalRepresentation",
        &[],
        &[
            child(0, "CoordinateSystem", "CoordinateSystem", Maybe),
            child(1, "Icon", "Icon", Maybe),
            child(2, "Annotations", "Annotations", Maybe),
        ],
    ),
    groups("CoordinateSystem", &[EXTENT, &[must("suggestedScalingFactorTo_mm", Double)]], &[]),
    groups("Icon", &[EXTENT], &[]),
    groups("Terminals", &[], &[child(0, "Terminal", "Terminal", Some)]),
    groups(
        "Terminal",
        &[NAMED, &[must("matchingRule", Line), may("terminalKind", Line)]],
        &[
            child(0, "TerminalMemberVariable", "TerminalMemberVariable", Many),
            child(1, "TerminalStreamMemberVariable", "TerminalStreamMemberVariable", Many),
            child(2, "Terminal", "Terminal", Many),
            child(3, "TerminalGraphicalRepresentation", "TerminalGraphicalRepresentation", Maybe),
            child(4, "Annotations", "Annotations", Maybe),
        ],
    ),
    groups(
        "TerminalMemberVariable",
        &[&[must("variableName", Line), may("memberName", Line), must("variableKind", Line)]],
        ONLY_ANNOTATIONS,
    ),
    groups(
        "TerminalStreamMemberVariable",
        &[&[
            must("inStreamMemberName", Line),
            must("outStreamMemberName", Line),
            must("inStreamVariableName", Line),
            must("outStreamVariableName", Line),
        ]],
        ONLY_ANNOTATIONS,
    ),
    groups(
        "TerminalGraphicalRepresentation",
        &[
            EXTENT,
            &[
                may("defaultConnectionColor", List(&UNSIGNED_BYTE)),
                may("defaultConnectionStrokeSize", Double),
                must("iconBaseName", Text),
            ],
        ],
        ONLY_ANNOTATIONS,
    ),
    // sources/buildDescription.xml
    groups(
        "fmiBuildDescription",
        &[&[must("fmiVersion", Version("3.0"))]],
        &[
            child(0, "BuildConfiguration", "BuildConfiguration", Some),
            child(1, "Annotations", "Annotations", Maybe),
        ],
    ),
    groups(
        "BuildConfiguration",
        &[&[must("modelIdentifier", Line), may("platform", Line), may("description", Text)]],
        &[
            child(0, "SourceFileSet", "SourceFileSet", Many),
            child(1, "Library", "Library", Many),
            child(2, "Annotations", "Annotations", Maybe),
        ],
    ),
    groups(
        "SourceFileSet",
        &[&[may("name", Line), may("language", Line), may("compiler", Line), may("compilerOptions", Text)]],
        &[
            child(0, "SourceFile", "File", Some),
            child(1, "PreprocessorDefinition", "PreprocessorDefinition", Many),
            child(2, "IncludeDirectory", "File", Many),
            child(3, "Annotations", "Annotations", Maybe),
        ],
    ),
    groups("File", &[&[must("name", Line)]], ONLY_ANNOTATIONS),
    groups(
        "PreprocessorDefinition",
        &[NAMED, &[may("optional", Boolean), may("value", Line)]],
        &[child(0, "Option", "Option", Many), child(1, "Annotations", "Annotations", Maybe)],
    ),
    groups("Option", &[&[may("value", Line), may("description", Text)]], &[]),
    groups("Library", &[NAMED, &[may("version", Line), may("external", Boolean)]], ONLY_ANNOTATIONS),
];

const EXTENT: &[Attribute] =
    &[must("x1", Double), must("y1", Double), must("x2", Double), must("y2", Double)];
