//! A model description as the coupling sees it, in either version: scalars with names, types and value
//! references; arrays of them; outputs and their dependencies. The original descriptions are kept as well.

mod fmi2;
mod fmi3;

use std::collections::BTreeMap;
use std::sync::Arc;

use punctual_fmu::product::CODE;
use punctual_fmu::units::Said;
use punctual_modeldescription::{Causality, DefaultExperiment, ScalarType, Variability, VariableKind};
use roxmltree::Document;

use super::number::{DataType, Family};
use crate::error::FmuProblem;
pub use fmi2::Fmi2Description;
pub use fmi3::Fmi3Description;

/// A version of FMI that can be run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// FMI 2.0.
    Fmi2,
    /// FMI 3.0.
    Fmi3,
}

impl Version {
    /// The name of the version.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Fmi2 => "FMI 2.0",
            Self::Fmi3 => "FMI 3.0",
        }
    }

    /// The prefix of its functions' names.
    pub fn prefix(self) -> &'static str {
        match self {
            Self::Fmi2 => "fmi2",
            Self::Fmi3 => "fmi3",
        }
    }

    /// The folder below `binaries/` for the platform of this program.
    pub fn platform(self) -> &'static str {
        match self {
            Self::Fmi2 => punctual_modeldescription::PLATFORM,
            Self::Fmi3 => punctual_modeldescription::fmi3::PLATFORM,
        }
    }
}

/// A scalar: a variable of FMI 2.0, a scalar variable of FMI 3.0, or one element of an array variable.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Its name; for an element with the indices from 1, as in `u[2]` and `m[1,3]`.
    pub name: String,
    /// The handle in the C interface; elements of an array share it.
    pub value_reference: u32,
    /// Its row-major position in its array, from 0; 0 for a scalar.
    pub element: usize,
    /// The number of elements of its array; 1 for a scalar.
    pub count: usize,
    /// Its data type, which determines the functions that read and write it.
    pub of: DataType,
    /// The name of its type in its version, such as `Real` or `Float64`.
    pub type_name: &'static str,
    /// Its role.
    pub causality: Causality,
    /// The instants at which it may change.
    pub variability: Variability,
    /// Its unit.
    pub unit: Option<String>,
    /// The least and the greatest value allowed.
    pub range: (Option<f64>, Option<f64>),
    /// Its start value; 0 or 1 for a Boolean, `None` if it is not a number.
    pub start: Option<f64>,
    /// The start value of a String.
    pub text: Option<String>,
    /// The name of its declared type.
    pub declared_type: Option<String>,
    /// The names and numbers of an enumeration's items.
    pub items: Vec<(String, i64)>,
    /// Its meaning, as a text for the reader.
    pub description: String,
}

impl Variable {
    /// Whether it is accessed with this type and value reference.
    pub fn is(&self, of: DataType, reference: u32) -> bool {
        self.value_reference == reference && self.of == of
    }

    /// Whether it is a number.
    pub fn is_number(&self) -> bool {
        self.family() != Family::Other
    }

    /// The family of types that it can be connected with.
    pub fn family(&self) -> Family {
        Family::of(self.of)
    }
}

/// An array of FMI 3.0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Array {
    /// Its name.
    pub name: String,
    /// Its sizes, the outermost first.
    pub sizes: Vec<usize>,
    /// The position of its first element in [`Description::variables`]; the others follow.
    pub first: usize,
    /// The number of its elements.
    pub count: usize,
}

/// An output, and its dependencies at the same communication point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    /// Position in the variables.
    pub variable: usize,
    /// Positions of the variables it depends on; `None` if undeclared, which means every input.
    pub dependencies: Option<Arc<[usize]>>,
}

/// The description as written in its file.
#[derive(Clone, Debug)]
pub enum Written {
    /// Of FMI 2.0.
    Fmi2(Arc<Fmi2Description>),
    /// Of FMI 3.0.
    Fmi3(Arc<Fmi3Description>),
}

/// The description of a co-simulation FMU.
///
/// A variable without a unit or range of its own has those of its declared type. A bound or time that is not
/// a number counts as absent.
#[derive(Clone, Debug)]
pub struct Description {
    /// The description as written in its file.
    pub written: Written,
    /// The name of the model.
    pub model_name: String,
    /// The meaning of the model, as a text for the reader; may be empty.
    pub text: String,
    /// The token for instantiation: `guid`, or `instantiationToken` in FMI 3.0.
    pub token: String,
    /// The name of the shared library without its extension.
    pub model_identifier: String,
    /// Whether only one instance can exist in one process.
    pub only_once: bool,
    /// Whether steps can differ in length.
    pub any_step: bool,
    /// Whether states can be saved and restored, and whether they can be serialised.
    pub states: [bool; 2],
    /// Whether it provides directional derivatives, and adjoint ones.
    pub derivatives: [bool; 2],
    /// Whether it needs another program to run.
    pub needs_tool: bool,
    /// The suggested experiment.
    pub default_experiment: Option<DefaultExperiment>,
    /// All scalars.
    pub variables: Vec<Variable>,
    /// All arrays, in the order of their elements.
    pub arrays: Vec<Array>,
    /// Aliases of scalars and arrays, each with the position of what it names in the variables.
    aliases: BTreeMap<String, usize>,
    /// All outputs, in the order of the variables.
    pub outputs: Vec<Output>,
    /// Violations of the standard; empty for a valid description.
    pub problems: Vec<String>,
}

/// A message on a description of FMI 1.0 or of an unknown version.
pub(crate) fn foreign_version(document: &Document<'_>) -> Option<String> {
    let version = document.root_element().attribute("fmiVersion").unwrap_or_default();
    // A value that is no version at all, such as "3", is a mistake in the file.
    let (head, tail) = version.split_once('.')?;
    let is_version = head.parse::<u32>().is_ok() && tail.starts_with(|c: char| c.is_ascii_digit());
    (is_version && !["2", "3"].contains(&head)).then(|| {
        format!(
            "it is of FMI {version}, and this program is for FMI 2.0 and 3.0; export it again as one of these"
        )
    })
}

/// Whether a model identifier can be the name of a library. The standard requires a C identifier; FMUs in the
/// field have other names too.
fn names_library(identifier: &str) -> bool {
    !identifier.trim().is_empty() && !identifier.contains(['/', '\\', ':', '\0'])
}

/// The reason why an FMU with only other interfaces is not run.
fn without_co_simulation(interfaces: &[&str]) -> FmuProblem {
    match interfaces {
        [] => FmuProblem::NoCoSimulation,
        others => FmuProblem::CannotRun(format!(
            "it offers {} only, and this program runs co-simulation; export it for that",
            others.join(" and ")
        )),
    }
}

impl Description {
    /// Reads a model description from its text.
    ///
    /// # Errors
    ///
    /// Text that is no model description of FMI 2.0 or 3.0, or one without a co-simulation interface that
    /// this program can run.
    pub fn parse(text: &str) -> Result<Self, FmuProblem> {
        let document = Document::parse(text).map_err(|e| FmuProblem::Description(e.to_string()))?;
        let version = document.root_element().attribute("fmiVersion").unwrap_or_default();
        if version.starts_with("3.") {
            return Self::of_fmi3(Arc::new(Fmi3Description::read(&document)?), &BTreeMap::new());
        }
        if let Some(foreign) = foreign_version(&document) {
            return Err(FmuProblem::CannotRun(foreign));
        }
        Fmi2Description::read(&document).map(|written| Self::of_fmi2(Arc::new(written)))
    }

    /// The version of FMI.
    pub fn version(&self) -> Version {
        match self.written {
            Written::Fmi2(_) => Version::Fmi2,
            Written::Fmi3(_) => Version::Fmi3,
        }
    }

    /// The reason why the FMU cannot be run here, if there is one.
    pub fn obstacle(&self) -> Option<String> {
        match &self.written {
            Written::Fmi2(_) => None,
            Written::Fmi3(written) => written.obstacle(),
        }
    }

    /// The same FMU with these values of structural parameters, by value reference.
    ///
    /// # Errors
    ///
    /// Arrays that become too large.
    pub fn sized(&self, structural: &BTreeMap<u32, f64>) -> Result<Self, FmuProblem> {
        match &self.written {
            Written::Fmi3(written) if !structural.is_empty() => {
                Self::of_fmi3(Arc::clone(written), structural)
            }
            _ => Ok(self.clone()),
        }
    }

    /// The position of the scalar of this name.
    pub fn index_of(&self, name: &str) -> Option<usize> {
        // A scalar whose name looks like that of an array element takes precedence over the element.
        let named = || self.variables.iter().enumerate().filter(|(_, v)| v.name == name).map(|(v, _)| v);
        named().find(|v| !self.is_element(*v)).or_else(|| named().next()).or_else(|| self.aliased(name))
    }

    /// The position of the scalar with this alias.
    fn aliased(&self, name: &str) -> Option<usize> {
        if let Some(first) = self.aliases.get(name) {
            return self.array_from(*first).is_none().then_some(*first);
        }
        let (base, place) = name.split_at(name.rfind('[')?);
        let array = self.array_from(*self.aliases.get(base)?)?;
        let elements = array.first..array.first + array.count;
        let own = format!("{}{place}", array.name);
        elements.into_iter().find(|&element| self.variables[element].name == own)
    }

    /// The array of this name.
    pub fn array(&self, name: &str) -> Option<&Array> {
        let own = self.arrays.iter().find(|array| array.name == name);
        own.or_else(|| self.array_from(*self.aliases.get(name)?))
    }

    /// The array whose first element is at this position.
    fn array_from(&self, first: usize) -> Option<&Array> {
        self.arrays.iter().find(|array| array.first == first)
    }

    /// Whether the scalar at `index` is an element of an array.
    pub fn is_element(&self, index: usize) -> bool {
        self.arrays.iter().any(|array| (array.first..array.first + array.count).contains(&index))
    }

    /// Whether the variable at `index` repeats an enumeration of the same FMU for importers that drop
    /// enumerations: the Integer `status_code` beside `status`.
    pub fn is_twin(&self, index: usize) -> bool {
        let variable = &self.variables[index];
        let is_whole = variable.family() == Family::Integer;
        let of = variable.name.strip_suffix(CODE).filter(|_| is_whole);
        of.is_some_and(|of| self.variables.iter().any(|v| v.name == of && v.of == DataType::Enumeration))
    }

    /// What the description says about the unit of the variable at `index`.
    pub fn unit(&self, index: usize) -> Said<'_> {
        let variable = &self.variables[index];
        let (units, is_difference) = match &self.written {
            Written::Fmi2(written) => {
                let own = written.model.variables.get(index).map(|v| &v.kind);
                (&written.model.units, matches!(own, Some(VariableKind::Real(own)) if own.relative_quantity))
            }
            Written::Fmi3(written) => {
                let own = written.model.by_reference(variable.value_reference);
                let kinds = own.map(|own| [Some(&own.kind), written.model.declared(own).map(|of| &of.kind)]);
                let mut floats = kinds.into_iter().flatten().flatten().filter_map(|kind| kind.as_float());
                (&written.model.units, floats.any(|float| float.relative_quantity))
            }
        };
        let name = variable.unit.as_deref();
        let base = units.iter().find(|unit| Some(unit.name.as_str()) == name).and_then(|unit| unit.base);
        Said { name, base, is_difference }
    }

    /// The inputs an output depends on directly, as positions in the variables.
    pub fn direct_inputs(&self, output: &Output) -> Vec<usize> {
        let is_input = |&i: &usize| self.variables[i].causality == Causality::Input;
        match &output.dependencies {
            None => (0..self.variables.len()).filter(is_input).collect(),
            Some(list) => list.iter().copied().filter(is_input).collect(),
        }
    }

    fn of_fmi2(written: Arc<Fmi2Description>) -> Self {
        let (interface, model) = (&written.co_simulation, &written.model);
        let variable = |v: &punctual_modeldescription::Variable| Variable {
            name: v.name.clone(),
            value_reference: v.value_reference,
            element: 0,
            count: 1,
            of: match v.kind.scalar_type() {
                ScalarType::Real => DataType::Float64,
                ScalarType::Integer => DataType::Int32,
                ScalarType::Boolean => DataType::Boolean,
                ScalarType::String => DataType::String,
                ScalarType::Enumeration => DataType::Enumeration,
            },
            type_name: v.kind.scalar_type().as_str(),
            causality: v.causality,
            variability: v.variability,
            unit: v.kind.unit().map(str::to_owned),
            range: v.kind.range(),
            start: v.kind.start_number(),
            text: match &v.kind {
                VariableKind::String(text) => text.start.clone(),
                _ => None,
            },
            declared_type: v.kind.declared_type().map(str::to_owned),
            items: model.items(v).iter().map(|item| (item.name.clone(), i64::from(item.value))).collect(),
            description: v.description.clone(),
        };
        Self {
            model_name: model.model_name.clone(),
            text: model.description.clone(),
            token: model.guid.clone(),
            model_identifier: interface.model_identifier.clone(),
            only_once: interface.can_be_instantiated_only_once_per_process,
            any_step: interface.can_handle_variable_step,
            states: [interface.can_get_and_set_state, interface.can_serialize_state],
            derivatives: [interface.provides_directional_derivative, false],
            needs_tool: interface.needs_execution_tool,
            default_experiment: model.default_experiment,
            variables: model.variables.iter().map(variable).collect(),
            arrays: Vec::new(),
            aliases: BTreeMap::new(),
            outputs: written.outputs.clone(),
            problems: written.problems.clone(),
            written: Written::Fmi2(written),
        }
    }
}

/// Descriptions for tests of other modules.
#[cfg(test)]
pub(crate) mod example {
    use super::*;

    /// A variable with this name, type and causality, and defaults for everything else.
    pub(crate) fn variable(name: &str, of: DataType, causality: Causality) -> Variable {
        let type_name = match of {
            DataType::Float64 => ScalarType::Real.as_str(),
            of => of.as_str(),
        };
        Variable {
            name: name.to_owned(),
            value_reference: 0,
            element: 0,
            count: 1,
            of,
            type_name,
            causality,
            variability: Variability::Discrete,
            unit: None,
            range: (None, None),
            start: None,
            text: None,
            declared_type: None,
            items: Vec::new(),
            description: String::new(),
        }
    }

    /// A description with these variables. `dependencies` of outputs are given by name.
    pub(crate) fn description(
        variables: Vec<Variable>,
        dependencies: &[(&str, Option<&[&str]>)],
    ) -> Description {
        let index = |name: &str| variables.iter().position(|v| v.name == name).unwrap();
        let outputs = dependencies
            .iter()
            .map(|(name, list)| Output {
                variable: index(name),
                dependencies: list.map(|list| list.iter().map(|name| index(name)).collect()),
            })
            .collect();
        let arrays = variables.iter().enumerate().filter(|(_, v)| v.name.ends_with("[1]"));
        let array = |(first, v): (usize, &Variable)| Array {
            name: v.name.trim_end_matches("[1]").to_owned(),
            sizes: vec![v.count],
            first,
            count: v.count,
        };
        let written = Fmi3Description {
            model: Default::default(),
            co_simulation: Default::default(),
            problems: Vec::new(),
        };
        Description {
            arrays: arrays.map(array).collect(),
            outputs,
            variables,
            ..Description::of_fmi3(Arc::new(written), &BTreeMap::new()).unwrap()
        }
    }

    /// The elements of a vector.
    pub(crate) fn vector(name: &str, count: usize, causality: Causality) -> Vec<Variable> {
        let element = |element: usize| Variable {
            element,
            count,
            ..variable(&format!("{name}[{}]", element + 1), DataType::Float64, causality)
        };
        (0..count).map(element).collect()
    }
}
