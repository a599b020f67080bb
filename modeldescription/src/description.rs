//! The model description as plain data.

use crate::{Unit, Variable};

/// How variable names are built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum NamingConvention {
    /// Any text on one line.
    #[default]
    Flat,
    /// Hierarchical names such as `car.wheel[1].speed` or `der(x)` (FMI 2.0.4, section 2.2.9).
    Structured,
}

/// An enumeration type that variables can refer to by name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EnumerationType {
    /// The name; not empty, unique among the types, not the name of a variable, one line.
    pub name: String,
    /// Meaning for a human; empty: the attribute is absent.
    pub description: String,
    /// The items; at least one, names and values unique.
    pub items: Vec<EnumerationItem>,
}

/// One value of an enumeration type.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EnumerationItem {
    /// The name; not empty, one line.
    pub name: String,
    /// The number that stands for it in the C interface, dimensionless.
    pub value: i32,
    /// Meaning for a human; empty: the attribute is absent.
    pub description: String,
}

/// When and how finely to simulate unless the user says otherwise.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DefaultExperiment {
    /// Start time in seconds; finite, default 0.
    pub start_time: f64,
    /// Stop time in seconds; finite and greater than the start time.
    pub stop_time: Option<f64>,
    /// Communication step in seconds; finite and greater than 0.
    pub step_size: Option<f64>,
    /// Relative tolerance, dimensionless; finite and greater than 0.
    pub tolerance: Option<f64>,
}

/// A category of log messages that the importer can switch on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LogCategory {
    /// The name as passed to the logger; not empty, unique, one line.
    pub name: String,
    /// Meaning for a human; empty: the attribute is absent.
    pub description: String,
}

/// Identity and capabilities of the slave (FMI 2.0.4, section 4.3.1). All flags are false by default.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CoSimulation {
    /// The name of the shared library without its ending: a C identifier in ASCII.
    pub model_identifier: String,
    /// The slave needs another program to run.
    pub needs_execution_tool: bool,
    /// The step size may differ from call to call.
    pub can_handle_variable_step: bool,
    /// The slave uses `fmi2SetRealInputDerivatives`.
    pub can_interpolate_inputs: bool,
    /// Highest derivative that `fmi2GetRealOutputDerivatives` gives, dimensionless; 0: none.
    pub max_output_derivative_order: u32,
    /// `fmi2DoStep` may return before the step is done.
    pub can_run_asynchronously: bool,
    /// Only one instance can exist in one process.
    pub can_be_instantiated_only_once_per_process: bool,
    /// The slave does not use the memory functions of the importer.
    pub can_not_use_memory_management_functions: bool,
    /// `fmi2GetFMUstate`, `fmi2SetFMUstate` and `fmi2FreeFMUstate` work.
    pub can_get_and_set_state: bool,
    /// The state can be turned to bytes and back; needs `can_get_and_set_state`.
    pub can_serialize_state: bool,
    /// `fmi2GetDirectionalDerivative` works.
    pub provides_directional_derivative: bool,
}

/// Everything that `modelDescription.xml` of an FMI 2.0 co-simulation slave says.
///
/// The default is empty and not yet valid: name, GUID, model identifier and a variable are missing.
/// Texts that are empty give no attribute, except where they are required.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelDescription {
    /// The name of the model for a human; not empty.
    pub model_name: String,
    /// The text that ties description and library together; not empty, one line. Different for FMUs
    /// with different variables: importers use it as a key.
    pub guid: String,
    /// What the model is.
    pub description: String,
    /// Who made the model.
    pub author: String,
    /// The version of the model; one line.
    pub version: String,
    /// Copyright notice.
    pub copyright: String,
    /// Licence of the model.
    pub license: String,
    /// The program that writes the FMU; one line.
    pub generation_tool: String,
    /// When it was written, in UTC as `YYYY-MM-DDThh:mm:ssZ`. `None`, the default, keeps the file
    /// reproducible.
    pub generation_date_and_time: Option<String>,
    /// How variable names are built.
    pub variable_naming_convention: NamingConvention,
    /// Identity and capabilities.
    pub co_simulation: CoSimulation,
    /// The units that variables use; names unique.
    pub units: Vec<Unit>,
    /// The enumeration types that variables use; names unique.
    pub enumerations: Vec<EnumerationType>,
    /// The categories of log messages; names unique.
    pub log_categories: Vec<LogCategory>,
    /// When and how finely to simulate; `None`: nothing is said.
    pub default_experiment: Option<DefaultExperiment>,
    /// The variables, at least one. Their order is that of the file.
    pub variables: Vec<Variable>,
}
