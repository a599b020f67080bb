//! A model description as the rest of this crate sees it: small, with numbers parsed and references
//! resolved. The XML itself is read by `fmi-rs`, but for the declared types, of which it keeps the first only.

use std::collections::HashMap;

use fmi_rs::model_description::fmi2 as xml;
use punctual_modeldescription::{Causality, Variability};
use roxmltree::{Document, Node};

use crate::error::FmuProblem;

/// The type of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A double.
    Real,
    /// A 32-bit integer.
    Integer,
    /// True or false.
    Boolean,
    /// Text; shown, but not coupled or recorded.
    String,
    /// An integer with named values.
    Enumeration,
}

impl Kind {
    /// The word of the standard, such as `Real`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Real => "Real",
            Self::Integer => "Integer",
            Self::Boolean => "Boolean",
            Self::String => "String",
            Self::Enumeration => "Enumeration",
        }
    }
}

/// A named value of an enumeration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Item {
    /// Its name.
    pub name: String,
    /// Its number.
    pub value: i32,
}

/// A scalar variable.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Its name, unique in the FMU.
    pub name: String,
    /// The number it is called by; not unique across types.
    pub value_reference: u32,
    /// Its type.
    pub kind: Kind,
    /// Its role.
    pub causality: Causality,
    /// When it may change.
    pub variability: Variability,
    /// Its unit, such as `m/s`; also where its declared type gives it.
    pub unit: Option<String>,
    /// Its start value as written.
    pub start: Option<String>,
    /// Its least value (in `unit`), its own or its declared type's; `None` where there is none or it is
    /// not a number.
    pub min: Option<f64>,
    /// Its greatest value, likewise.
    pub max: Option<f64>,
    /// What it means.
    pub description: Option<String>,
    /// The name of the type it is declared to have, if it is.
    pub declared_type: Option<String>,
    /// The named values, for an enumeration whose type is declared.
    pub items: Vec<Item>,
}

/// An output, and what it depends on at the same communication point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    /// Position in [`Description::variables`].
    pub variable: usize,
    /// Positions of the variables it depends on; `None` = not said, so every input.
    pub dependencies: Option<Vec<usize>>,
}

/// What the FMU says it can do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Capabilities {
    /// Steps of any length.
    pub can_handle_variable_communication_step_size: bool,
    /// Inputs may come with derivatives.
    pub can_interpolate_inputs: bool,
    /// `fmi2GetFMUstate` and `fmi2SetFMUstate` work.
    pub can_get_and_set_fmu_state: bool,
    /// A state can be written to bytes and read back.
    pub can_serialize_fmu_state: bool,
    /// `fmi2GetDirectionalDerivative` works.
    pub provides_directional_derivative: bool,
    /// Only one instance can live in a process.
    pub can_be_instantiated_only_once_per_process: bool,
    /// It drives a tool that must be installed.
    pub needs_execution_tool: bool,
}

/// The experiment the FMU suggests; all in seconds but the tolerance, which is relative.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct DefaultExperiment {
    /// Start time, s.
    pub start_time: Option<f64>,
    /// Stop time, s.
    pub stop_time: Option<f64>,
    /// Communication step, s.
    pub step_size: Option<f64>,
    /// Relative tolerance, dimensionless.
    pub tolerance: Option<f64>,
}

/// What a co-simulation FMU says of itself.
#[derive(Clone, Debug)]
pub struct Description {
    /// Model name.
    pub model_name: String,
    /// The identity checked by `fmi2Instantiate`.
    pub guid: String,
    /// The name of its library, a C identifier.
    pub model_identifier: String,
    /// What it is.
    pub description: Option<String>,
    /// Who made it.
    pub author: Option<String>,
    /// Its version.
    pub version: Option<String>,
    /// The tool that wrote it.
    pub generation_tool: Option<String>,
    /// When it was written, as it says.
    pub generation_time: Option<String>,
    /// What it can do.
    pub capabilities: Capabilities,
    /// The experiment it suggests.
    pub default_experiment: Option<DefaultExperiment>,
    /// All variables, in the file's order.
    pub variables: Vec<Variable>,
    /// All outputs, in the order of `variables`.
    pub outputs: Vec<Output>,
    /// Where the description breaks the standard, found by `fmi-rs`; empty for a valid one.
    pub problems: Vec<String>,
}

impl Description {
    /// Reads a model description from its text.
    ///
    /// # Errors
    ///
    /// Text that is no model description of FMI 2.0, or of one without a co-simulation interface.
    pub fn parse(text: &str) -> Result<Self, FmuProblem> {
        let read =
            xml::ModelDescription::from_string(text).map_err(|e| FmuProblem::Description(e.to_string()))?;
        let problems = read.validate().into_iter().map(|problem| problem.message).collect();
        let Some(interface) = &read.coSimulation else { return Err(FmuProblem::NoCoSimulation) };
        if !is_c_identifier(&interface.modelIdentifier) {
            return Err(FmuProblem::ModelIdentifier(interface.modelIdentifier.clone()));
        }
        let document = Document::parse(text).map_err(|e| FmuProblem::Description(e.to_string()))?;
        let types = declared_types(&document);
        let variables: Vec<Variable> = read.modelVariables.iter().map(|v| variable(&types, v)).collect();
        let outputs = outputs(&read, &variables)?;
        Ok(Self {
            model_identifier: interface.modelIdentifier.clone(),
            capabilities: Capabilities {
                can_handle_variable_communication_step_size: interface.canHandleVariableCommunicationStepSize,
                can_interpolate_inputs: interface.canInterpolateInputs,
                can_get_and_set_fmu_state: interface.canGetAndSetFMUstate,
                can_serialize_fmu_state: interface.canSerializeFMUstate,
                provides_directional_derivative: interface.providesDirectionalDerivative,
                can_be_instantiated_only_once_per_process: interface.canBeInstantiatedOnlyOncePerProcess,
                needs_execution_tool: interface.needsExecutionTool,
            },
            default_experiment: read.defaultExperiment.as_ref().map(|e| DefaultExperiment {
                start_time: number(e.startTime.as_deref()),
                stop_time: number(e.stopTime.as_deref()),
                step_size: number(e.stepSize.as_deref()),
                tolerance: number(e.tolerance.as_deref()),
            }),
            variables,
            outputs,
            problems,
            model_name: read.modelName,
            guid: read.guid,
            description: read.description,
            author: read.author,
            version: read.version,
            generation_tool: read.generationTool,
            generation_time: read.generationDateAndTime,
        })
    }

    /// The position of the variable of this name.
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.variables.iter().position(|variable| variable.name == name)
    }

    /// The inputs an output depends on directly, as positions in `variables`.
    pub fn direct_inputs(&self, output: &Output) -> Vec<usize> {
        let is_input = |&i: &usize| self.variables[i].causality == Causality::Input;
        match &output.dependencies {
            None => (0..self.variables.len()).filter(is_input).collect(),
            Some(list) => list.iter().copied().filter(is_input).collect(),
        }
    }
}

/// What a declared type gives to the variables that name it.
#[derive(Default)]
struct DeclaredType {
    unit: Option<String>,
    min: Option<f64>,
    max: Option<f64>,
    items: Vec<Item>,
}

/// The types of `TypeDefinitions` by name. Of one that is declared twice the first counts.
fn declared_types<'a>(document: &'a Document<'_>) -> HashMap<&'a str, DeclaredType> {
    let mut types = HashMap::new();
    let definitions = document.root_element().children().filter(|n| n.has_tag_name("TypeDefinitions"));
    for declared in definitions.flat_map(|n| n.children()).filter(|n| n.has_tag_name("SimpleType")) {
        let (Some(name), Some(of)) = (declared.attribute("name"), declared.children().find(Node::is_element))
        else {
            continue;
        };
        let item = |n: Node<'_, '_>| {
            let value = n.attribute("value")?.trim().parse().ok()?;
            Some(Item { name: n.attribute("name")?.to_owned(), value })
        };
        types.entry(name).or_insert_with(|| DeclaredType {
            unit: of.attribute("unit").map(str::to_owned),
            min: number(of.attribute("min")),
            max: number(of.attribute("max")),
            items: of.children().filter(|n| n.has_tag_name("Item")).filter_map(item).collect(),
        });
    }
    types
}

fn variable(types: &HashMap<&str, DeclaredType>, source: &xml::ScalarVariable) -> Variable {
    use xml::VariableType as T;
    let none = &None;
    let (kind, unit, min, max, declared) = match &source.variableType {
        T::Real { unit, min, max, declaredType, .. } => (Kind::Real, unit, min, max, declaredType.as_ref()),
        T::Integer { min, max, declaredType, .. } => (Kind::Integer, none, min, max, declaredType.as_ref()),
        T::Boolean { declaredType, .. } => (Kind::Boolean, none, none, none, declaredType.as_ref()),
        T::String { declaredType, .. } => (Kind::String, none, none, none, declaredType.as_ref()),
        T::Enumeration { min, max, declaredType, .. } => {
            (Kind::Enumeration, none, min, max, Some(declaredType))
        }
    };
    let nothing = DeclaredType::default();
    let given = declared.and_then(|name| types.get(name.as_str())).unwrap_or(&nothing);
    Variable {
        name: source.name.clone(),
        value_reference: source.valueReference,
        kind,
        causality: match source.causality {
            xml::Causality::Parameter => Causality::Parameter,
            xml::Causality::CalculatedParameter => Causality::CalculatedParameter,
            xml::Causality::Input => Causality::Input,
            xml::Causality::Output => Causality::Output,
            xml::Causality::Local => Causality::Local,
            xml::Causality::Independent => Causality::Independent,
        },
        variability: match source.variability {
            xml::Variability::Constant => Variability::Constant,
            xml::Variability::Fixed => Variability::Fixed,
            xml::Variability::Tunable => Variability::Tunable,
            xml::Variability::Discrete => Variability::Discrete,
            xml::Variability::Continuous => Variability::Continuous,
        },
        unit: unit.clone().or_else(|| given.unit.clone()),
        start: source.variableType.start().clone(),
        min: number(min.as_deref()).or(given.min),
        max: number(max.as_deref()).or(given.max),
        description: source.description.clone(),
        declared_type: declared.cloned(),
        items: given.items.clone(),
    }
}

fn outputs(read: &xml::ModelDescription, variables: &[Variable]) -> Result<Vec<Output>, FmuProblem> {
    let position = |index: u32| {
        usize::try_from(index)
            .ok()
            .and_then(|i| i.checked_sub(1))
            .filter(|&i| i < variables.len())
            .ok_or_else(|| {
                FmuProblem::Description(format!(
                    "ModelStructure names variable {index} of {}",
                    variables.len()
                ))
            })
    };
    let mut outputs: Vec<Output> = variables
        .iter()
        .enumerate()
        .filter(|(_, variable)| variable.causality == Causality::Output)
        .map(|(variable, _)| Output { variable, dependencies: None })
        .collect();
    for unknown in &read.outputs {
        let variable = position(unknown.index)?;
        let Some(list) = &unknown.dependencies else { continue };
        let list = list.iter().map(|&index| position(index)).collect::<Result<_, _>>()?;
        if let Some(output) = outputs.iter_mut().find(|output| output.variable == variable) {
            output.dependencies = Some(list);
        }
    }
    Ok(outputs)
}

/// A number as XML Schema writes it (`INF` and `NaN` included).
fn number(text: Option<&str>) -> Option<f64> {
    text?.trim().parse().ok().filter(|value: &f64| !value.is_nan())
}

fn is_c_identifier(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn xml(interface: &str, outputs: &str) -> String {
        format!(
            r#"<fmiModelDescription fmiVersion="2.0" modelName="m" guid="g">{interface}
            <TypeDefinitions><SimpleType name="T"><Enumeration><Item name="go" value="1"/><Item name="stop" value="2"/></Enumeration></SimpleType>
            <SimpleType name="L"><Real unit="m" min="-4" max="9"/></SimpleType></TypeDefinitions>
            <DefaultExperiment stopTime="2.5" stepSize="1e-3"/>
            <ModelVariables>
            <ScalarVariable name="u" valueReference="7" causality="input" description="pull"><Real start="0" unit="N" min="-1" max="INF"/></ScalarVariable>
            <ScalarVariable name="y" valueReference="8" causality="output"><Real/></ScalarVariable>
            <ScalarVariable name="s" valueReference="9" causality="output" variability="discrete"><Enumeration declaredType="T"/></ScalarVariable>
            <ScalarVariable name="l" valueReference="10"><Real declaredType="L" max="5"/></ScalarVariable>
            </ModelVariables><ModelStructure><Outputs>{outputs}</Outputs></ModelStructure></fmiModelDescription>"#
        )
    }

    #[test]
    fn variables_and_dependencies_are_normalised() {
        let text = xml(
            r#"<CoSimulation modelIdentifier="m" canGetAndSetFMUstate="true"/>"#,
            r#"<Unknown index="2"/><Unknown index="3" dependencies=""/>"#,
        );
        let d = Description::parse(&text).unwrap();
        assert_eq!(d.variables[0].unit.as_deref(), Some("N"));
        assert_eq!((d.variables[0].min, d.variables[0].max), (Some(-1.0), Some(f64::INFINITY)));
        assert_eq!(d.variables[2].items[1], Item { name: "stop".into(), value: 2 });
        // From the second declared type, what the variable does not say itself.
        let l = &d.variables[3];
        assert_eq!((l.unit.as_deref(), l.min, l.max), (Some("m"), Some(-4.0), Some(5.0)));
        assert_eq!(d.default_experiment.unwrap().step_size, Some(1e-3));
        assert!(d.capabilities.can_get_and_set_fmu_state);
        assert_eq!(d.outputs[0], Output { variable: 1, dependencies: None });
        assert_eq!(d.direct_inputs(&d.outputs[0]), [0]);
        assert_eq!(d.outputs[1].dependencies, Some(vec![]));
    }

    #[test]
    fn what_cannot_be_run_is_refused() {
        let cs = r#"<CoSimulation modelIdentifier="m"/>"#;
        let error = |text: &str| Description::parse(text).unwrap_err().to_string();
        assert!(error(&xml("", "")).contains("no co-simulation interface"));
        assert!(error(&xml(r#"<CoSimulation modelIdentifier="../m"/>"#, "")).contains("not a C identifier"));
        assert!(error(&xml(cs, r#"<Unknown index="5"/>"#)).contains("names variable 5 of 4"));
        assert!(error(&xml(cs, "").replace("\"2.0\"", "\"3.0\"")).contains("Expected FMI version 2.0"));
        assert!(error("nonsense").starts_with("modelDescription.xml: "));
    }
}
