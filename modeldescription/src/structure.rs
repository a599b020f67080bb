//! `ModelStructure`: outputs and initial unknowns with their dependencies (FMI 2.0.4, section 2.2.8).
//!
//! Callers give dependencies as value references, because these are what they have. The file wants
//! the 1-based positions of the variables, ascending. A value reference is unique only within its base
//! type; the translation therefore looks among the variables that may stand there ("knowns") and
//! refuses a value reference that fits more than one.

use crate::validate::variable_path;
use crate::{Causality, Error, Initial, ModelDescription, Variable};
use std::collections::{BTreeSet, HashMap};

/// The content of `ModelStructure`, both lists in ascending order of index.
#[derive(Debug, PartialEq)]
pub(crate) struct Structure {
    /// All outputs.
    pub(crate) outputs: Vec<Unknown>,
    /// Outputs that are not exact, and calculated parameters.
    pub(crate) initial_unknowns: Vec<Unknown>,
}

/// A variable, and what it depends on, as 1-based positions in the list of variables.
#[derive(Debug, PartialEq)]
pub(crate) struct Unknown {
    pub(crate) index: usize,
    /// Ascending, without repetition; `None` means everything.
    pub(crate) dependencies: Option<BTreeSet<usize>>,
}

impl Structure {
    /// Collects the unknowns and translates their dependencies.
    ///
    /// # Errors
    ///
    /// - A variable that is not an output has dependencies, or one that is not an initial unknown has
    ///   initial dependencies.
    /// - A dependency is not the value reference of exactly one known.
    pub(crate) fn of(description: &ModelDescription) -> Result<Self, Error> {
        let knowns = Knowns::new(&description.variables, is_known);
        let initial_knowns = Knowns::new(&description.variables, |v| {
            is_known(v) || v.effective_initial() == Some(Initial::Exact)
        });
        let mut structure = Self { outputs: Vec::new(), initial_unknowns: Vec::new() };
        for (position, variable) in description.variables.iter().enumerate() {
            let index = position + 1;
            let path = |field| variable_path(variable, field);
            if variable.causality == Causality::Output {
                let path = path("dependencies");
                let allowed = "value references of inputs, parameters or the independent variable";
                let dependencies = knowns.translate(&path, variable.dependencies.as_deref(), allowed)?;
                structure.outputs.push(Unknown { index, dependencies });
            } else if variable.dependencies.is_some() {
                return Err(Error::invalid(
                    path("dependencies"),
                    "given",
                    "nothing, as this is not an output",
                ));
            }
            if variable.is_initial_unknown() {
                let path = path("initial_dependencies");
                let allowed = "value references of inputs, parameters, the independent variable or variables \
                               with initial exact";
                let dependencies =
                    initial_knowns.translate(&path, variable.initial_dependencies.as_deref(), allowed)?;
                structure.initial_unknowns.push(Unknown { index, dependencies });
            } else if variable.initial_dependencies.is_some() {
                let allowed = "nothing, as this is neither an output with initial approx or calculated nor a \
                               calculated parameter";
                return Err(Error::invalid(path("initial_dependencies"), "given", allowed));
            }
        }
        Ok(structure)
    }
}

fn is_known(variable: &Variable) -> bool {
    matches!(variable.causality, Causality::Input | Causality::Parameter | Causality::Independent)
}

/// From value reference to the positions of the knowns that have it.
struct Knowns<'a> {
    variables: &'a [Variable],
    positions: HashMap<u32, Vec<usize>>,
}

impl<'a> Knowns<'a> {
    fn new(variables: &'a [Variable], is_known: impl Fn(&Variable) -> bool) -> Self {
        let mut positions = HashMap::<u32, Vec<usize>>::new();
        for (position, variable) in variables.iter().enumerate().filter(|(_, v)| is_known(v)) {
            positions.entry(variable.value_reference).or_default().push(position);
        }
        Self { variables, positions }
    }

    fn translate(
        &self,
        path: &str,
        value_references: Option<&[u32]>,
        allowed: &str,
    ) -> Result<Option<BTreeSet<usize>>, Error> {
        let Some(value_references) = value_references else { return Ok(None) };
        let mut indices = BTreeSet::new();
        for value_reference in value_references {
            match self.positions.get(value_reference).map(Vec::as_slice) {
                Some([position]) => {
                    indices.insert(position + 1);
                }
                Some(positions) => {
                    let names: Vec<_> =
                        positions.iter().map(|p| format!("{:?}", self.variables[*p].name)).collect();
                    let value = format!("{value_reference}, which stands for {}", names.join(" and "));
                    return Err(Error::invalid(path, value, "value references that stand for one variable"));
                }
                None => return Err(Error::invalid(path, value_reference, allowed)),
            }
        }
        Ok(Some(indices))
    }
}
