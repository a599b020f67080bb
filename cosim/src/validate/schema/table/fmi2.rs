//! The elements and attributes of the FMI 2.0 schema (`fmi2ModelDescription.xsd` and the files it
//! includes), row by row.

use punctual_modeldescription::{Causality, Initial, NamingConvention, Variability};

use super::super::types::{INT, UNSIGNED, Value};
use super::Times::{Choice, Many, Maybe, One, Some};
use super::{Element, anything, child, groups, may, must};
use Value::{Boolean, DateTime, Double, Line, OneOf, Text, Version, Words};

const CAUSALITY: Value = OneOf(Causality::WORDS_OF_FMI2);
pub(super) const VARIABILITY: Value = OneOf(Variability::WORDS);
pub(super) const INITIAL: Value = OneOf(Initial::WORDS);
pub(super) const NAMING: Value = OneOf(NamingConvention::WORDS);
pub(super) const DEPENDENCY: Value = Words(&["dependent", "constant", "fixed", "tunable", "discrete"]);

/// The rows of the schema.
pub(super) const ELEMENTS: &[Element] = &[
    groups(
        "fmiModelDescription",
        &[&[
            must("fmiVersion", Version("2.0")),
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
            may("numberOfEventIndicators", UNSIGNED),
        ]],
        &[
            // Any order and number is allowed here. A rule beyond the schema allows one CoSimulation.
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
    groups(
        "ModelExchange",
        &[&[
            must("modelIdentifier", Line),
            may("needsExecutionTool", Boolean),
            may("completedIntegratorStepNotNeeded", Boolean),
            may("canBeInstantiatedOnlyOncePerProcess", Boolean),
            may("canNotUseMemoryManagementFunctions", Boolean),
            may("canGetAndSetFMUstate", Boolean),
            may("canSerializeFMUstate", Boolean),
            may("providesDirectionalDerivative", Boolean),
        ]],
        &[child(0, "SourceFiles", "SourceFiles", Maybe)],
    ),
    groups(
        "CoSimulation",
        &[&[
            must("modelIdentifier", Line),
            may("needsExecutionTool", Boolean),
            may("canHandleVariableCommunicationStepSize", Boolean),
            may("canInterpolateInputs", Boolean),
            may("maxOutputDerivativeOrder", UNSIGNED),
            // The spelling of the schema.
            may("canRunAsynchronuously", Boolean),
            may("canBeInstantiatedOnlyOncePerProcess", Boolean),
            may("canNotUseMemoryManagementFunctions", Boolean),
            may("canGetAndSetFMUstate", Boolean),
            may("canSerializeFMUstate", Boolean),
            may("providesDirectionalDerivative", Boolean),
        ]],
        &[child(0, "SourceFiles", "SourceFiles", Maybe)],
    ),
    groups("SourceFiles", &[], &[child(0, "File", "File", Some)]),
    groups("File", &[&[must("name", Line)]], &[]),
    groups("UnitDefinitions", &[], &[child(0, "Unit", "Unit", Some)]),
    groups(
        "Unit",
        &[&[must("name", Line)]],
        &[child(0, "BaseUnit", "BaseUnit", Maybe), child(1, "DisplayUnit", "DisplayUnit", Many)],
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
    groups("DisplayUnit", &[&[must("name", Line), may("factor", Double), may("offset", Double)]], &[]),
    groups("TypeDefinitions", &[], &[child(0, "SimpleType", "SimpleType", Some)]),
    groups(
        "SimpleType",
        &[&[must("name", Line), may("description", Text)]],
        &[
            child(0, "Real", "RealType", Choice),
            child(0, "Integer", "IntegerType", Choice),
            child(0, "Boolean", "Nothing", Choice),
            child(0, "String", "Nothing", Choice),
            child(0, "Enumeration", "EnumerationType", Choice),
        ],
    ),
    groups(
        "RealType",
        &[&[
            may("quantity", Line),
            may("unit", Line),
            may("displayUnit", Line),
            may("relativeQuantity", Boolean),
            may("min", Double),
            may("max", Double),
            may("nominal", Double),
            may("unbounded", Boolean),
        ]],
        &[],
    ),
    groups("IntegerType", &[&[may("quantity", Line), may("min", INT), may("max", INT)]], &[]),
    // The schema gives these no type, so they may contain anything, although nothing is intended.
    anything("Nothing", &[]),
    groups("EnumerationType", &[&[may("quantity", Line)]], &[child(0, "Item", "Item", Some)]),
    groups("Item", &[&[must("name", Line), must("value", INT), may("description", Text)]], &[]),
    groups("LogCategories", &[], &[child(0, "Category", "Category", Some)]),
    groups("Category", &[&[must("name", Line), may("description", Text)]], &[]),
    groups(
        "DefaultExperiment",
        &[&[
            may("startTime", Double),
            may("stopTime", Double),
            may("tolerance", Double),
            may("stepSize", Double),
        ]],
        &[],
    ),
    groups("Annotations", &[], &[child(0, "Tool", "Tool", Some)]),
    anything("Tool", &[&[must("name", Line)]]),
    groups("ModelVariables", &[], &[child(0, "ScalarVariable", "ScalarVariable", Some)]),
    groups(
        "ScalarVariable",
        &[&[
            must("name", Line),
            must("valueReference", UNSIGNED),
            may("description", Text),
            may("causality", CAUSALITY),
            may("variability", VARIABILITY),
            may("initial", INITIAL),
            may("canHandleMultipleSetPerTimeInstant", Boolean),
        ]],
        &[
            child(0, "Real", "Real", Choice),
            child(0, "Integer", "Integer", Choice),
            child(0, "Boolean", "Boolean", Choice),
            child(0, "String", "String", Choice),
            child(0, "Enumeration", "Enumeration", Choice),
            child(1, "Annotations", "Annotations", Maybe),
        ],
    ),
    groups(
        "Real",
        &[&[
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
            may("derivative", UNSIGNED),
            may("reinit", Boolean),
        ]],
        &[],
    ),
    groups(
        "Integer",
        &[&[
            may("declaredType", Line),
            may("quantity", Line),
            may("min", INT),
            may("max", INT),
            may("start", INT),
        ]],
        &[],
    ),
    groups("Boolean", &[&[may("declaredType", Line), may("start", Boolean)]], &[]),
    groups("String", &[&[may("declaredType", Line), may("start", Text)]], &[]),
    groups(
        "Enumeration",
        &[&[
            must("declaredType", Line),
            may("quantity", Line),
            may("min", INT),
            may("max", INT),
            may("start", INT),
        ]],
        &[],
    ),
    groups(
        "ModelStructure",
        &[],
        &[
            child(0, "Outputs", "Unknowns", Maybe),
            child(1, "Derivatives", "Unknowns", Maybe),
            child(2, "InitialUnknowns", "Unknowns", Maybe),
        ],
    ),
    groups("Unknowns", &[], &[child(0, "Unknown", "Unknown", Some)]),
    groups(
        "Unknown",
        &[&[
            must("index", UNSIGNED),
            may("dependencies", Value::List(&UNSIGNED)),
            may("dependenciesKind", DEPENDENCY),
        ]],
        &[],
    ),
];
