//! `ModelStructure`: outputs and initial unknowns with their dependencies (FMI 2.0.4, section 2.2.8).
//!
//! Callers have value references, and give dependencies as such. The file needs the 1-based positions of the
//! variables, in ascending order. A value reference is unique only within its base type. So the translation
//! searches the variables that may be dependencies ("knowns"), and refuses an ambiguous value reference.

use crate::variable::variable_path;
use crate::{Causality, Error, Initial, ModelDescription, Variability, Variable};
use serde::Serialize;
use std::collections::{BTreeSet, HashMap};

/// The content of `ModelStructure`.
///
/// In a description to be written, dependencies are given with the variables, and the lists follow from them
/// ([`ModelDescription::structure`]). A description that was read has the lists of its file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ModelStructure {
    /// All outputs.
    pub outputs: Vec<Unknown>,
    /// The derivatives of continuous states.
    pub derivatives: Vec<Unknown>,
    /// The unknowns of initialization: outputs that are not exact, calculated parameters, and states and
    /// derivatives computed during initialization. In ascending order of index.
    pub initial_unknowns: Vec<Unknown>,
}

/// A computed variable and its dependencies, as indices of variables, from 1.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Unknown {
    /// The index of the variable.
    #[serde(rename = "@index")]
    pub index: u32,
    /// The indices of its dependencies. `None` (the attribute is absent) means all, empty means none.
    #[serde(rename = "@dependencies", skip_serializing_if = "Option::is_none")]
    pub dependencies: Option<Vec<u32>>,
    /// The kind of each dependency, in the terms of the standard, if declared.
    #[serde(rename = "@dependenciesKind", skip_serializing_if = "Option::is_none")]
    pub dependency_kinds: Option<Vec<String>>,
}

/// The index, from 1, of the variable at a position, from 0.
pub(crate) fn index(position: usize) -> u32 {
    u32::try_from(position + 1).unwrap_or(u32::MAX)
}

impl ModelDescription {
    /// The lists of `ModelStructure` that follow from the variables and their dependencies.
    ///
    /// # Errors
    ///
    /// - A variable that is neither an output nor, with model exchange, the derivative of a state has dependencies, or one
    ///   that is not an initial unknown has initial dependencies.
    /// - A dependency is not the value reference of exactly one known.
    pub fn structure(&self) -> Result<ModelStructure, Error> {
        let derivatives = self.derivatives();
        let is_state = |i: usize| derivatives.iter().any(|of| self.variables[*of].state() == Some(index(i)));
        let knowns = Knowns::new(&self.variables, |i, v| is_known(v) || is_state(i));
        let initial_knowns =
            Knowns::new(&self.variables, |_, v| is_known(v) || v.effective_initial() == Some(Initial::Exact));
        let initial_unknowns = initial_unknowns(self, derivatives.iter().map(|of| index(*of)));
        let mut structure = ModelStructure::default();
        let unknown = |index, dependencies| Unknown { index, dependencies, dependency_kinds: None };
        for (position, variable) in self.variables.iter().enumerate() {
            let index = index(position);
            let path = |field| variable_path(variable, field);
            let is_derivative = derivatives.contains(&position);
            if variable.causality == Causality::Output || is_derivative {
                let path = path("dependencies");
                let allowed = "value references of inputs, parameters, the independent variable or, with model \
                               exchange, states";
                let dependencies = knowns.translate(&path, variable.dependencies.as_deref(), allowed)?;
                if is_derivative {
                    structure.derivatives.push(unknown(index, dependencies.clone()));
                }
                if variable.causality == Causality::Output {
                    structure.outputs.push(unknown(index, dependencies));
                }
            } else if variable.dependencies.is_some() {
                let allowed = "nothing, as this is neither an output nor, with model exchange, the derivative of a state";
                return Err(Error::invalid(path("dependencies"), "given", allowed));
            }
            if initial_unknowns.contains(&index) {
                let path = path("initial_dependencies");
                let allowed = "value references of inputs, parameters, the independent variable or variables \
                               with initial exact";
                let dependencies =
                    initial_knowns.translate(&path, variable.initial_dependencies.as_deref(), allowed)?;
                structure.initial_unknowns.push(unknown(index, dependencies));
            } else if variable.initial_dependencies.is_some() {
                let allowed = "nothing, as this is neither an output with initial approx or calculated, nor a calculated \
                               parameter, nor with model exchange a derivative or state computed then";
                return Err(Error::invalid(path("initial_dependencies"), "given", allowed));
            }
        }
        Ok(structure)
    }

    /// The positions of the derivatives of continuous states, which only model exchange makes visible:
    /// variables with `derivative`, unless they or their states are inputs.
    pub(crate) fn derivatives(&self) -> Vec<usize> {
        let is_flow = |v: &Variable| v.causality == Causality::Input;
        let is_derivative = |v: &Variable| {
            let state = v.state().and_then(|state| self.at(state));
            let moves = |state: &Variable| !is_flow(state) && state.variability == Variability::Continuous;
            !is_flow(v) && state.is_some_and(moves)
        };
        let all = self.variables.iter().enumerate();
        let all = all.filter(|(_, v)| self.model_exchange.is_some() && is_derivative(v));
        all.map(|(i, _)| i).collect()
    }
}

/// The indices of the unknowns of initialization: outputs computed during initialization, calculated
/// parameters, and those of the derivatives with indices `derivatives`, and of their states, that are
/// computed then.
pub(crate) fn initial_unknowns(
    description: &ModelDescription,
    derivatives: impl Iterator<Item = u32>,
) -> BTreeSet<u32> {
    let variables = description.variables.iter().enumerate();
    let mut wanted: BTreeSet<u32> =
        variables.filter(|(_, v)| v.is_initial_unknown()).map(|(i, _)| index(i)).collect();
    for derivative in derivatives {
        let state = description.at(derivative).and_then(Variable::state);
        let pair = [Some(derivative), state].into_iter().flatten();
        wanted.extend(pair.filter(|index| description.at(*index).is_some_and(Variable::is_computed)));
    }
    wanted
}

fn is_known(variable: &Variable) -> bool {
    matches!(variable.causality, Causality::Input | Causality::Parameter | Causality::Independent)
}

/// Maps a value reference to the positions of the knowns that have it.
struct Knowns<'a> {
    variables: &'a [Variable],
    positions: HashMap<u32, Vec<usize>>,
}

impl<'a> Knowns<'a> {
    fn new(variables: &'a [Variable], is_known: impl Fn(usize, &Variable) -> bool) -> Self {
        let mut positions = HashMap::<u32, Vec<usize>>::new();
        for (position, variable) in variables.iter().enumerate().filter(|(i, v)| is_known(*i, v)) {
            positions.entry(variable.value_reference).or_default().push(position);
        }
        Self { variables, positions }
    }

    fn translate(
        &self,
        path: &str,
        value_references: Option<&[u32]>,
        allowed: &str,
    ) -> Result<Option<Vec<u32>>, Error> {
        let Some(value_references) = value_references else { return Ok(None) };
        let mut indices = BTreeSet::new();
        for value_reference in value_references {
            match self.positions.get(value_reference).map(Vec::as_slice) {
                Some([position]) => {
                    indices.insert(index(*position));
                }
                Some(positions) => {
                    let names: Vec<_> =
                        positions.iter().map(|p| format!("{:?}", self.variables[*p].name)).collect();
                    let value = format!("{value_reference}, which is that of {}", names.join(" and "));
                    return Err(Error::invalid(path, value, "value references of exactly one variable"));
                }
                None => return Err(Error::invalid(path, value_reference, allowed)),
            }
        }
        Ok(Some(indices.into_iter().collect()))
    }
}
