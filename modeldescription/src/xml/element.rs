//! The elements as `serde` writes them: names, order and defaults of the XML schema, and nothing else.

use crate::number::Number;
use serde::Serialize;

/// Whether a flag or number has the schema's default, false or 0.
fn is_zero<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

#[derive(Serialize)]
#[serde(rename = "fmiModelDescription")]
pub(super) struct Root<'a> {
    #[serde(rename = "@fmiVersion")]
    pub(super) fmi_version: &'static str,
    #[serde(rename = "@modelName")]
    pub(super) model_name: &'a str,
    #[serde(rename = "@guid")]
    pub(super) guid: &'a str,
    #[serde(rename = "@description", skip_serializing_if = "str::is_empty")]
    pub(super) description: &'a str,
    #[serde(rename = "@author", skip_serializing_if = "str::is_empty")]
    pub(super) author: &'a str,
    #[serde(rename = "@version", skip_serializing_if = "str::is_empty")]
    pub(super) version: &'a str,
    #[serde(rename = "@copyright", skip_serializing_if = "str::is_empty")]
    pub(super) copyright: &'a str,
    #[serde(rename = "@license", skip_serializing_if = "str::is_empty")]
    pub(super) license: &'a str,
    #[serde(rename = "@generationTool", skip_serializing_if = "str::is_empty")]
    pub(super) generation_tool: &'a str,
    #[serde(rename = "@generationDateAndTime", skip_serializing_if = "Option::is_none")]
    pub(super) generation_date_and_time: Option<&'a str>,
    #[serde(rename = "@variableNamingConvention")]
    pub(super) variable_naming_convention: &'static str,
    #[serde(rename = "CoSimulation")]
    pub(super) co_simulation: CoSimulation<'a>,
    #[serde(rename = "UnitDefinitions", skip_serializing_if = "Option::is_none")]
    pub(super) units: Option<UnitDefinitions<'a>>,
    #[serde(rename = "TypeDefinitions", skip_serializing_if = "Option::is_none")]
    pub(super) types: Option<TypeDefinitions<'a>>,
    #[serde(rename = "LogCategories", skip_serializing_if = "Option::is_none")]
    pub(super) log_categories: Option<LogCategories<'a>>,
    #[serde(rename = "DefaultExperiment", skip_serializing_if = "Option::is_none")]
    pub(super) default_experiment: Option<DefaultExperiment>,
    #[serde(rename = "ModelVariables")]
    pub(super) variables: ModelVariables<'a>,
    #[serde(rename = "ModelStructure")]
    pub(super) structure: ModelStructure,
}

#[derive(Serialize)]
pub(super) struct CoSimulation<'a> {
    #[serde(rename = "@modelIdentifier")]
    pub(super) model_identifier: &'a str,
    #[serde(rename = "@needsExecutionTool", skip_serializing_if = "is_zero")]
    pub(super) needs_execution_tool: bool,
    #[serde(rename = "@canHandleVariableCommunicationStepSize", skip_serializing_if = "is_zero")]
    pub(super) can_handle_variable_step: bool,
    #[serde(rename = "@canInterpolateInputs", skip_serializing_if = "is_zero")]
    pub(super) can_interpolate_inputs: bool,
    #[serde(rename = "@maxOutputDerivativeOrder", skip_serializing_if = "is_zero")]
    pub(super) max_output_derivative_order: u32,
    // The schema spells it so.
    #[serde(rename = "@canRunAsynchronuously", skip_serializing_if = "is_zero")]
    pub(super) can_run_asynchronously: bool,
    #[serde(rename = "@canBeInstantiatedOnlyOncePerProcess", skip_serializing_if = "is_zero")]
    pub(super) can_be_instantiated_only_once_per_process: bool,
    #[serde(rename = "@canNotUseMemoryManagementFunctions", skip_serializing_if = "is_zero")]
    pub(super) can_not_use_memory_management_functions: bool,
    #[serde(rename = "@canGetAndSetFMUstate", skip_serializing_if = "is_zero")]
    pub(super) can_get_and_set_state: bool,
    #[serde(rename = "@canSerializeFMUstate", skip_serializing_if = "is_zero")]
    pub(super) can_serialize_state: bool,
    #[serde(rename = "@providesDirectionalDerivative", skip_serializing_if = "is_zero")]
    pub(super) provides_directional_derivative: bool,
}

#[derive(Serialize)]
pub(super) struct UnitDefinitions<'a> {
    #[serde(rename = "Unit")]
    pub(super) units: Vec<Unit<'a>>,
}

#[derive(Serialize)]
pub(super) struct Unit<'a> {
    #[serde(rename = "@name")]
    pub(super) name: &'a str,
    #[serde(rename = "BaseUnit")]
    pub(super) base: Base,
}

#[derive(Serialize)]
pub(super) struct Base {
    #[serde(rename = "@kg", skip_serializing_if = "is_zero")]
    pub(super) kg: i32,
    #[serde(rename = "@m", skip_serializing_if = "is_zero")]
    pub(super) m: i32,
    #[serde(rename = "@s", skip_serializing_if = "is_zero")]
    pub(super) s: i32,
    #[serde(rename = "@A", skip_serializing_if = "is_zero")]
    pub(super) a: i32,
    #[serde(rename = "@K", skip_serializing_if = "is_zero")]
    pub(super) k: i32,
    #[serde(rename = "@mol", skip_serializing_if = "is_zero")]
    pub(super) mol: i32,
    #[serde(rename = "@cd", skip_serializing_if = "is_zero")]
    pub(super) cd: i32,
    #[serde(rename = "@rad", skip_serializing_if = "is_zero")]
    pub(super) rad: i32,
    #[serde(rename = "@factor", skip_serializing_if = "Option::is_none")]
    pub(super) factor: Option<Number>,
    #[serde(rename = "@offset", skip_serializing_if = "Option::is_none")]
    pub(super) offset: Option<Number>,
}

#[derive(Serialize)]
pub(super) struct TypeDefinitions<'a> {
    #[serde(rename = "SimpleType")]
    pub(super) types: Vec<SimpleType<'a>>,
}

#[derive(Serialize)]
pub(super) struct SimpleType<'a> {
    #[serde(rename = "@name")]
    pub(super) name: &'a str,
    #[serde(rename = "@description", skip_serializing_if = "str::is_empty")]
    pub(super) description: &'a str,
    #[serde(rename = "Enumeration")]
    pub(super) enumeration: Items<'a>,
}

#[derive(Serialize)]
pub(super) struct Items<'a> {
    #[serde(rename = "Item")]
    pub(super) items: Vec<Item<'a>>,
}

#[derive(Serialize)]
pub(super) struct Item<'a> {
    #[serde(rename = "@name")]
    pub(super) name: &'a str,
    #[serde(rename = "@value")]
    pub(super) value: i32,
    #[serde(rename = "@description", skip_serializing_if = "str::is_empty")]
    pub(super) description: &'a str,
}

#[derive(Serialize)]
pub(super) struct LogCategories<'a> {
    #[serde(rename = "Category")]
    pub(super) categories: Vec<Category<'a>>,
}

#[derive(Serialize)]
pub(super) struct Category<'a> {
    #[serde(rename = "@name")]
    pub(super) name: &'a str,
    #[serde(rename = "@description", skip_serializing_if = "str::is_empty")]
    pub(super) description: &'a str,
}

#[derive(Serialize)]
pub(super) struct DefaultExperiment {
    #[serde(rename = "@startTime")]
    pub(super) start_time: Number,
    #[serde(rename = "@stopTime", skip_serializing_if = "Option::is_none")]
    pub(super) stop_time: Option<Number>,
    #[serde(rename = "@tolerance", skip_serializing_if = "Option::is_none")]
    pub(super) tolerance: Option<Number>,
    #[serde(rename = "@stepSize", skip_serializing_if = "Option::is_none")]
    pub(super) step_size: Option<Number>,
}

#[derive(Serialize)]
pub(super) struct ModelVariables<'a> {
    #[serde(rename = "ScalarVariable")]
    pub(super) variables: Vec<ScalarVariable<'a>>,
}

#[derive(Serialize)]
pub(super) struct ScalarVariable<'a> {
    #[serde(rename = "@name")]
    pub(super) name: &'a str,
    #[serde(rename = "@valueReference")]
    pub(super) value_reference: u32,
    #[serde(rename = "@description", skip_serializing_if = "str::is_empty")]
    pub(super) description: &'a str,
    #[serde(rename = "@causality")]
    pub(super) causality: &'static str,
    #[serde(rename = "@variability")]
    pub(super) variability: &'static str,
    #[serde(rename = "@initial", skip_serializing_if = "Option::is_none")]
    pub(super) initial: Option<&'static str>,
    #[serde(rename = "$value")]
    pub(super) kind: Kind<'a>,
}

/// The variant's name becomes the element's.
#[derive(Serialize)]
pub(super) enum Kind<'a> {
    Real {
        #[serde(rename = "@quantity", skip_serializing_if = "Option::is_none")]
        quantity: Option<&'a str>,
        #[serde(rename = "@unit", skip_serializing_if = "Option::is_none")]
        unit: Option<&'a str>,
        #[serde(rename = "@min", skip_serializing_if = "Option::is_none")]
        min: Option<Number>,
        #[serde(rename = "@max", skip_serializing_if = "Option::is_none")]
        max: Option<Number>,
        #[serde(rename = "@nominal", skip_serializing_if = "Option::is_none")]
        nominal: Option<Number>,
        #[serde(rename = "@start", skip_serializing_if = "Option::is_none")]
        start: Option<Number>,
    },
    Integer {
        #[serde(rename = "@min", skip_serializing_if = "Option::is_none")]
        min: Option<i32>,
        #[serde(rename = "@max", skip_serializing_if = "Option::is_none")]
        max: Option<i32>,
        #[serde(rename = "@start", skip_serializing_if = "Option::is_none")]
        start: Option<i32>,
    },
    Boolean {
        #[serde(rename = "@start", skip_serializing_if = "Option::is_none")]
        start: Option<bool>,
    },
    String {
        #[serde(rename = "@start", skip_serializing_if = "Option::is_none")]
        start: Option<&'a str>,
    },
    Enumeration {
        #[serde(rename = "@declaredType")]
        declared_type: &'a str,
        #[serde(rename = "@start", skip_serializing_if = "Option::is_none")]
        start: Option<i32>,
    },
}

#[derive(Serialize)]
pub(super) struct ModelStructure {
    #[serde(rename = "Outputs", skip_serializing_if = "Option::is_none")]
    pub(super) outputs: Option<Unknowns>,
    #[serde(rename = "InitialUnknowns", skip_serializing_if = "Option::is_none")]
    pub(super) initial_unknowns: Option<Unknowns>,
}

#[derive(Serialize)]
pub(super) struct Unknowns {
    #[serde(rename = "Unknown")]
    pub(super) unknowns: Vec<IndexedUnknown>,
}

#[derive(Serialize)]
pub(super) struct IndexedUnknown {
    #[serde(rename = "@index")]
    pub(super) index: usize,
    /// Separated by blanks. Empty ("on nothing") differs from absent ("on everything").
    #[serde(rename = "@dependencies", skip_serializing_if = "Option::is_none")]
    pub(super) dependencies: Option<String>,
}
