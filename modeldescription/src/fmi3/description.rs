//! The model description of FMI 3.0 as plain data.

use super::{EnumerationItem, ModelStructure, Variable, VariableKind};
use crate::{DefaultExperiment, LogCategory, NamingConvention, Unit};

/// What all interfaces share (FMI 3.0.2, section 2.4.3). All flags are false by default.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Interface {
    /// The name of the shared library without its extension: a C identifier in ASCII.
    pub model_identifier: String,
    /// Whether the FMU needs another program to run.
    pub needs_execution_tool: bool,
    /// Whether only one instance can exist in one process.
    pub can_be_instantiated_only_once_per_process: bool,
    /// Whether `fmi3GetFMUState`, `fmi3SetFMUState` and `fmi3FreeFMUState` work.
    pub can_get_and_set_state: bool,
    /// Whether states can be serialised; requires `can_get_and_set_state`.
    pub can_serialize_state: bool,
    /// Whether `fmi3GetDirectionalDerivative` works.
    pub provides_directional_derivatives: bool,
    /// Whether `fmi3GetAdjointDerivative` works.
    pub provides_adjoint_derivatives: bool,
    /// Whether `fmi3GetVariableDependencies` and `fmi3GetNumberOfVariableDependencies` work.
    pub provides_per_element_dependencies: bool,
}

/// Identity and capabilities for model exchange (FMI 3.0.2, section 3.4). All flags are false by default.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ModelExchange {
    /// What all interfaces share.
    pub interface: Interface,
    /// Whether `fmi3CompletedIntegratorStep` must be called.
    pub needs_completed_integrator_step: bool,
    /// Whether `fmi3EvaluateDiscreteStates` works.
    pub provides_evaluate_discrete_states: bool,
}

/// Identity and capabilities for co-simulation (FMI 3.0.2, section 4.4). All flags are false by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CoSimulation {
    /// What all interfaces share.
    pub interface: Interface,
    /// Whether the step size may differ from call to call.
    pub can_handle_variable_step: bool,
    /// The internal step size in seconds; finite and greater than 0. `None` if undeclared.
    pub fixed_internal_step: Option<f64>,
    /// Highest derivative that `fmi3GetOutputDerivatives` provides, dimensionless; 0 if it provides none.
    pub max_output_derivative_order: u32,
    /// How often inputs set between communication points should be differentiable, dimensionless; 0 means
    /// continuous.
    pub recommended_intermediate_input_smoothness: i32,
    /// Whether `fmi3IntermediateUpdateCallback` is called.
    pub provides_intermediate_update: bool,
    /// Whether `fmi3DoStep` may return before the step is done.
    pub might_return_early: bool,
    /// Whether `fmi3DoStep` returns early if the importer requests it between communication points.
    pub can_return_early_after_intermediate_update: bool,
    /// Whether the importer can handle events.
    pub has_event_mode: bool,
    /// Whether `fmi3EvaluateDiscreteStates` works.
    pub provides_evaluate_discrete_states: bool,
}

/// A type that variables can refer to by name.
#[derive(Clone, Debug, PartialEq)]
pub struct TypeDefinition {
    /// The name; not empty, unique among the types, one line.
    pub name: String,
    /// Its meaning, as a text for the reader; if empty, the attribute is omitted.
    pub description: String,
    /// Default attributes of variables that do not give their own.
    pub kind: VariableKind,
    /// The items of an enumeration, at least one, with unique names and values; empty for other types.
    pub items: Vec<EnumerationItem>,
}

/// The content of `modelDescription.xml` of an FMU of FMI 3.0.
///
/// The default is empty and not yet valid: name, token, an interface and the independent variable are
/// missing. Empty texts give no attribute, except where one is required.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelDescription {
    /// The name of the model for the reader; not empty.
    pub model_name: String,
    /// The text that links description and library; not empty, one line.
    pub instantiation_token: String,
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
    /// The interface for model exchange, if any.
    pub model_exchange: Option<ModelExchange>,
    /// The interface for co-simulation, if any.
    pub co_simulation: Option<CoSimulation>,
    /// The interface for scheduled execution, if any.
    pub scheduled_execution: Option<Interface>,
    /// The units that variables use, with unique names.
    pub units: Vec<Unit>,
    /// The types that variables can declare, with unique names.
    pub types: Vec<TypeDefinition>,
    /// The categories of log messages, with unique names.
    pub log_categories: Vec<LogCategory>,
    /// Default start, stop and step, if given.
    pub default_experiment: Option<DefaultExperiment>,
    /// The variables in the order of the file. Exactly one is independent.
    pub variables: Vec<Variable>,
    /// Outputs, derivatives and initial unknowns, with their dependencies. See [`ModelStructure::of`].
    pub structure: ModelStructure,
}

impl ModelDescription {
    /// The variable with a value reference, the first one if there are several.
    pub fn by_reference(&self, value_reference: u32) -> Option<&Variable> {
        self.variables.iter().find(|variable| variable.value_reference == value_reference)
    }

    /// The variable with this name or alias.
    pub fn by_name(&self, name: &str) -> Option<&Variable> {
        self.variables.iter().find(|v| v.name == name || v.aliases.iter().any(|alias| alias.name == name))
    }

    /// The first declared type with the name and data type that the variable declares, if any.
    pub fn declared(&self, variable: &Variable) -> Option<&TypeDefinition> {
        let name = variable.declared_type.as_deref()?;
        let declared = self.types.iter().find(|declared| declared.name == name)?;
        (declared.kind.data_type() == variable.kind.data_type()).then_some(declared)
    }

    /// The sizes of the dimensions of a variable, according to the start values of structural parameters.
    /// `None` if a size is missing, or is not the start value of a variable.
    pub fn shape(&self, variable: &Variable) -> Option<Vec<u64>> {
        variable.shape(|reference| self.by_reference(reference))
    }

    /// The interfaces present, by the names of their elements.
    pub fn interfaces(&self) -> Vec<(&'static str, &Interface)> {
        let exchange = self.model_exchange.as_ref().map(|of| ("ModelExchange", &of.interface));
        let co_simulation = self.co_simulation.as_ref().map(|of| ("CoSimulation", &of.interface));
        let scheduled = self.scheduled_execution.as_ref().map(|of| ("ScheduledExecution", of));
        [exchange, co_simulation, scheduled].into_iter().flatten().collect()
    }
}
