//! The model description of FMI 3.0 as plain data.

use super::{EnumerationItem, ModelStructure, Variable, VariableKind};
use crate::{DefaultExperiment, LogCategory, NamingConvention, Unit};

/// What the interfaces have in common (FMI 3.0.2, section 2.4.3). All flags are false by default.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Interface {
    /// The name of the shared library without its ending: a C identifier in ASCII.
    pub model_identifier: String,
    /// The FMU needs another program to run.
    pub needs_execution_tool: bool,
    /// Only one instance can exist in one process.
    pub can_be_instantiated_only_once_per_process: bool,
    /// `fmi3GetFMUState`, `fmi3SetFMUState` and `fmi3FreeFMUState` work.
    pub can_get_and_set_state: bool,
    /// The state can be turned to bytes and back; needs `can_get_and_set_state`.
    pub can_serialize_state: bool,
    /// `fmi3GetDirectionalDerivative` works.
    pub provides_directional_derivatives: bool,
    /// `fmi3GetAdjointDerivative` works.
    pub provides_adjoint_derivatives: bool,
    /// `fmi3GetVariableDependencies` and its sister work.
    pub provides_per_element_dependencies: bool,
}

/// Identity and capabilities for model exchange (FMI 3.0.2, section 3.4). All flags are false by default.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ModelExchange {
    /// What the interfaces have in common.
    pub interface: Interface,
    /// `fmi3CompletedIntegratorStep` must be called.
    pub needs_completed_integrator_step: bool,
    /// `fmi3EvaluateDiscreteStates` works.
    pub provides_evaluate_discrete_states: bool,
}

/// Identity and capabilities for co-simulation (FMI 3.0.2, section 4.4). All flags are false by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CoSimulation {
    /// What the interfaces have in common.
    pub interface: Interface,
    /// The step size may differ from call to call.
    pub can_handle_variable_step: bool,
    /// The step size inside, in seconds; finite and greater than 0. `None`: not said.
    pub fixed_internal_step: Option<f64>,
    /// Highest derivative that `fmi3GetOutputDerivatives` gives, dimensionless; 0: none.
    pub max_output_derivative_order: u32,
    /// How often inputs set between communication points should be differentiable, dimensionless; 0: continuous.
    pub recommended_intermediate_input_smoothness: i32,
    /// `fmi3IntermediateUpdateCallback` is called.
    pub provides_intermediate_update: bool,
    /// `fmi3DoStep` may return before the step is done.
    pub might_return_early: bool,
    /// `fmi3DoStep` returns early when the importer asks for it between communication points.
    pub can_return_early_after_intermediate_update: bool,
    /// Events can be handled by the importer.
    pub has_event_mode: bool,
    /// `fmi3EvaluateDiscreteStates` works.
    pub provides_evaluate_discrete_states: bool,
}

/// A type that variables can refer to by name.
#[derive(Clone, Debug, PartialEq)]
pub struct TypeDefinition {
    /// The name; not empty, unique among the types, one line.
    pub name: String,
    /// Meaning for a human; empty: the attribute is absent.
    pub description: String,
    /// Attributes that variables take over where they do not give them themselves.
    pub kind: VariableKind,
    /// The items of an enumeration; at least one, names and values unique. Of other types none.
    pub items: Vec<EnumerationItem>,
}

/// Everything that `modelDescription.xml` of an FMU of FMI 3.0 says.
///
/// The default is empty and not yet valid: name, token, an interface and the independent variable are missing.
/// Texts that are empty give no attribute, except where they are required.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelDescription {
    /// The name of the model for a human; not empty.
    pub model_name: String,
    /// The text that ties description and library together; not empty, one line.
    pub instantiation_token: String,
    /// A description of the model, for a human.
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
    /// The interface for model exchange, if there is one.
    pub model_exchange: Option<ModelExchange>,
    /// The interface for co-simulation, if there is one.
    pub co_simulation: Option<CoSimulation>,
    /// The interface for scheduled execution, if there is one.
    pub scheduled_execution: Option<Interface>,
    /// The units that variables use; names unique.
    pub units: Vec<Unit>,
    /// The types that variables declare to have; names unique.
    pub types: Vec<TypeDefinition>,
    /// The categories of log messages; names unique.
    pub log_categories: Vec<LogCategory>,
    /// Default start, stop and step; `None`: nothing is said.
    pub default_experiment: Option<DefaultExperiment>,
    /// The variables. Their order is that of the file. Exactly one is independent.
    pub variables: Vec<Variable>,
    /// Outputs, derivatives and initial unknowns, with their dependencies. See [`ModelStructure::of`].
    pub structure: ModelStructure,
}

impl ModelDescription {
    /// The variable of a value reference; of several the first.
    pub fn by_reference(&self, value_reference: u32) -> Option<&Variable> {
        self.variables.iter().find(|variable| variable.value_reference == value_reference)
    }

    /// The variable of this name or with an alias of it.
    pub fn by_name(&self, name: &str) -> Option<&Variable> {
        self.variables.iter().find(|v| v.name == name || v.aliases.iter().any(|alias| alias.name == name))
    }

    /// The first declared type of the variable, if it names one that is there and of the same data type.
    pub fn declared(&self, variable: &Variable) -> Option<&TypeDefinition> {
        let name = variable.declared_type.as_deref()?;
        let declared = self.types.iter().find(|declared| declared.name == name)?;
        (declared.kind.data_type() == variable.kind.data_type()).then_some(declared)
    }

    /// The sizes of the dimensions of a variable, as the start values of structural parameters have them.
    /// `None`: a size is not given, or is no start value of a variable.
    pub fn shape(&self, variable: &Variable) -> Option<Vec<u64>> {
        variable.shape(|reference| self.by_reference(reference))
    }

    /// The interfaces that are there, by the names of their elements.
    pub fn interfaces(&self) -> Vec<(&'static str, &Interface)> {
        let exchange = self.model_exchange.as_ref().map(|of| ("ModelExchange", &of.interface));
        let co_simulation = self.co_simulation.as_ref().map(|of| ("CoSimulation", &of.interface));
        let scheduled = self.scheduled_execution.as_ref().map(|of| ("ScheduledExecution", of));
        [exchange, co_simulation, scheduled].into_iter().flatten().collect()
    }
}
