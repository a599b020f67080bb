//! The model description as plain data.

use crate::words::words;
use crate::{Integer, ScalarType, Unit, Variable, VariableKind, xsd};
use serde::Serialize;

/// The convention by which variable names are built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum NamingConvention {
    /// Any text on one line.
    #[default]
    Flat,
    /// Hierarchical names such as `car.wheel[1].speed` or `der(x)` (FMI 2.0.4, section 2.2.9).
    Structured,
}

words!(NamingConvention: Flat "flat", Structured "structured");

/// A type that variables can refer to by name.
#[derive(Clone, Debug, PartialEq)]
pub struct SimpleType {
    /// The name; not empty, unique among the types, not the name of a variable, one line.
    pub name: String,
    /// Its meaning, as a text for the reader; if empty, the attribute is omitted.
    pub description: String,
    /// Default attributes of variables that do not give their own.
    pub kind: VariableKind,
    /// The items of an enumeration, at least one, with unique names and values; empty for other types.
    pub items: Vec<EnumerationItem>,
}

impl SimpleType {
    /// An enumeration.
    pub fn enumeration(
        name: impl Into<String>,
        description: impl Into<String>,
        items: Vec<EnumerationItem>,
    ) -> Self {
        let kind = VariableKind::Enumeration(Integer::default());
        Self { name: name.into(), description: description.into(), kind, items }
    }
}

/// One value of an enumeration type, of 32 bits, or of 64 in FMI 3.0.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename = "Item")]
pub struct EnumerationItem<V = i32> {
    /// The name; not empty, one line.
    #[serde(rename = "@name")]
    pub name: String,
    /// Its number in the C interface, dimensionless.
    #[serde(rename = "@value")]
    pub value: V,
    /// Its meaning, as a text for the reader; if empty, the attribute is omitted.
    #[serde(rename = "@description", skip_serializing_if = "String::is_empty")]
    pub description: String,
}

/// Default start, stop and step of a simulation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DefaultExperiment {
    /// Start time in seconds; finite, default 0.
    #[serde(
        rename = "@startTime",
        skip_serializing_if = "Option::is_none",
        serialize_with = "xsd::optional"
    )]
    pub start_time: Option<f64>,
    /// Stop time in seconds; finite and greater than the start time.
    #[serde(rename = "@stopTime", skip_serializing_if = "Option::is_none", serialize_with = "xsd::optional")]
    pub stop_time: Option<f64>,
    /// Relative tolerance, dimensionless; finite and greater than 0.
    #[serde(
        rename = "@tolerance",
        skip_serializing_if = "Option::is_none",
        serialize_with = "xsd::optional"
    )]
    pub tolerance: Option<f64>,
    /// Communication step in seconds; finite and greater than 0.
    #[serde(rename = "@stepSize", skip_serializing_if = "Option::is_none", serialize_with = "xsd::optional")]
    pub step_size: Option<f64>,
}

/// A category of log messages that the importer can switch on.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LogCategory {
    /// The name as passed to the logger; not empty, unique, one line.
    #[serde(rename = "@name")]
    pub name: String,
    /// Its meaning, as a text for the reader; if empty, the attribute is omitted.
    #[serde(rename = "@description", skip_serializing_if = "String::is_empty")]
    pub description: String,
}

/// Identity and capabilities for model exchange (FMI 2.0.4, section 3.3.1). All flags are false by default.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ModelExchange {
    /// The name of the shared library without its extension: a C identifier in ASCII.
    #[serde(rename = "@modelIdentifier")]
    pub model_identifier: String,
    /// Whether the FMU needs another program to run.
    #[serde(rename = "@needsExecutionTool", skip_serializing_if = "xsd::is_default")]
    pub needs_execution_tool: bool,
    /// Whether `fmi2CompletedIntegratorStep` need not be called.
    #[serde(rename = "@completedIntegratorStepNotNeeded", skip_serializing_if = "xsd::is_default")]
    pub completed_integrator_step_not_needed: bool,
    /// Whether only one instance can exist in one process.
    #[serde(rename = "@canBeInstantiatedOnlyOncePerProcess", skip_serializing_if = "xsd::is_default")]
    pub can_be_instantiated_only_once_per_process: bool,
    /// Whether the FMU does not use the memory functions of the importer.
    #[serde(rename = "@canNotUseMemoryManagementFunctions", skip_serializing_if = "xsd::is_default")]
    pub can_not_use_memory_management_functions: bool,
    /// Whether `fmi2GetFMUstate`, `fmi2SetFMUstate` and `fmi2FreeFMUstate` work.
    #[serde(rename = "@canGetAndSetFMUstate", skip_serializing_if = "xsd::is_default")]
    pub can_get_and_set_state: bool,
    /// Whether states can be serialised; requires `can_get_and_set_state`.
    #[serde(rename = "@canSerializeFMUstate", skip_serializing_if = "xsd::is_default")]
    pub can_serialize_state: bool,
    /// Whether `fmi2GetDirectionalDerivative` works.
    #[serde(rename = "@providesDirectionalDerivative", skip_serializing_if = "xsd::is_default")]
    pub provides_directional_derivative: bool,
    /// Names of its source files, relative to `sources/`; empty if there are none.
    #[serde(
        rename = "SourceFiles",
        skip_serializing_if = "Vec::is_empty",
        serialize_with = "crate::xml::source_files"
    )]
    pub source_files: Vec<String>,
}

/// Identity and capabilities of the slave (FMI 2.0.4, section 4.3.1). All flags are false by default.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CoSimulation {
    /// The name of the shared library without its extension: a C identifier in ASCII.
    #[serde(rename = "@modelIdentifier")]
    pub model_identifier: String,
    /// Whether the slave needs another program to run.
    #[serde(rename = "@needsExecutionTool", skip_serializing_if = "xsd::is_default")]
    pub needs_execution_tool: bool,
    /// Whether the step size may differ from call to call.
    #[serde(rename = "@canHandleVariableCommunicationStepSize", skip_serializing_if = "xsd::is_default")]
    pub can_handle_variable_step: bool,
    /// Whether the slave uses `fmi2SetRealInputDerivatives`.
    #[serde(rename = "@canInterpolateInputs", skip_serializing_if = "xsd::is_default")]
    pub can_interpolate_inputs: bool,
    /// Highest derivative that `fmi2GetRealOutputDerivatives` provides, dimensionless; 0 if it provides none.
    #[serde(rename = "@maxOutputDerivativeOrder", skip_serializing_if = "xsd::is_default")]
    pub max_output_derivative_order: u32,
    /// Whether `fmi2DoStep` may return before the step is done.
    // The spelling of the schema.
    #[serde(rename = "@canRunAsynchronuously", skip_serializing_if = "xsd::is_default")]
    pub can_run_asynchronously: bool,
    /// Whether only one instance can exist in one process.
    #[serde(rename = "@canBeInstantiatedOnlyOncePerProcess", skip_serializing_if = "xsd::is_default")]
    pub can_be_instantiated_only_once_per_process: bool,
    /// Whether the slave does not use the memory functions of the importer.
    #[serde(rename = "@canNotUseMemoryManagementFunctions", skip_serializing_if = "xsd::is_default")]
    pub can_not_use_memory_management_functions: bool,
    /// Whether `fmi2GetFMUstate`, `fmi2SetFMUstate` and `fmi2FreeFMUstate` work.
    #[serde(rename = "@canGetAndSetFMUstate", skip_serializing_if = "xsd::is_default")]
    pub can_get_and_set_state: bool,
    /// Whether states can be serialised; requires `can_get_and_set_state`.
    #[serde(rename = "@canSerializeFMUstate", skip_serializing_if = "xsd::is_default")]
    pub can_serialize_state: bool,
    /// Whether `fmi2GetDirectionalDerivative` works.
    #[serde(rename = "@providesDirectionalDerivative", skip_serializing_if = "xsd::is_default")]
    pub provides_directional_derivative: bool,
    /// Names of its source files, relative to `sources/`; empty if there are none.
    #[serde(
        rename = "SourceFiles",
        skip_serializing_if = "Vec::is_empty",
        serialize_with = "crate::xml::source_files"
    )]
    pub source_files: Vec<String>,
}

/// The content of `modelDescription.xml` of an FMI 2.0 co-simulation slave.
///
/// The default is empty and not yet valid: name, GUID, model identifier and a variable are missing. Empty
/// texts give no attribute, except where one is required.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelDescription {
    /// The name of the model for the reader; not empty.
    pub model_name: String,
    /// The text that links description and library; not empty, one line. It must differ between FMUs with
    /// different variables, since importers use it as a key.
    pub guid: String,
    /// A description of the model for the reader.
    pub description: String,
    /// The author of the model.
    pub author: String,
    /// The version of the model; one line.
    pub version: String,
    /// Copyright notice.
    pub copyright: String,
    /// Licence of the model.
    pub license: String,
    /// The program that writes the FMU; one line.
    pub generation_tool: String,
    /// The instant of writing, in UTC as `YYYY-MM-DDThh:mm:ssZ`. `None`, the default, keeps the file
    /// reproducible.
    pub generation_date_and_time: Option<String>,
    /// The convention by which variable names are built.
    pub variable_naming_convention: NamingConvention,
    /// The interface for model exchange beside the one for co-simulation, if any. It has no event indicators.
    pub model_exchange: Option<ModelExchange>,
    /// Identity and capabilities.
    pub co_simulation: CoSimulation,
    /// The units that variables use, with unique names.
    pub units: Vec<Unit>,
    /// The types that variables can declare, with unique names.
    pub types: Vec<SimpleType>,
    /// The categories of log messages, with unique names.
    pub log_categories: Vec<LogCategory>,
    /// Default start, stop and step, if given.
    pub default_experiment: Option<DefaultExperiment>,
    /// The variables in the order of the file, at least one.
    pub variables: Vec<Variable>,
}

impl ModelDescription {
    /// The variable with this index of [`ModelStructure`](crate::ModelStructure), counted from 1.
    pub fn at(&self, index: u32) -> Option<&Variable> {
        self.variables.get(usize::try_from(index).ok()?.checked_sub(1)?)
    }

    /// The items of an enumeration's declared type; empty for other variables.
    pub fn items(&self, variable: &Variable) -> &[EnumerationItem] {
        let name = variable.kind.declared_type();
        let declared = self.types.iter().find(|declared| Some(declared.name.as_str()) == name);
        match declared {
            Some(declared) if variable.kind.scalar_type() == ScalarType::Enumeration => &declared.items,
            _ => &[],
        }
    }
}
