//! A model description of FMI 3.0 in the form an importer needs: arrays become scalars, attributes of
//! declared types are filled in, and outputs and their dependencies are positions of scalars.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use punctual_modeldescription::fmi3::{self, CoSimulation, ModelDescription, VariableKind};
use punctual_modeldescription::{Causality, Place};
use roxmltree::Document;

use super::{Array, Description, Output, Variable, Written, names_library, without_co_simulation};
use crate::error::FmuProblem;

/// The greatest number of elements of all arrays of an FMU.
const MAX_ELEMENTS: u64 = 1_000_000;

/// The description of a co-simulation FMU of FMI 3.0, as read.
#[derive(Clone, Debug)]
pub struct Fmi3Description {
    /// The model description.
    pub model: ModelDescription,
    /// Its co-simulation interface.
    pub co_simulation: CoSimulation,
    /// Violations of the standard; empty for a valid description.
    pub problems: Vec<String>,
}

impl Fmi3Description {
    /// Reads a model description from its tree.
    ///
    /// # Errors
    ///
    /// A description without a co-simulation interface, or without a name for its library.
    pub(super) fn read(document: &Document<'_>) -> Result<Self, FmuProblem> {
        let read = fmi3::Located::read(document);
        for (v, variable) in read.description.variables.iter().enumerate() {
            for attribute in ["name", "valueReference"] {
                if read.is_unread(Place::Variable(v), attribute) {
                    let text = format!("{attribute} of variable {:?} is missing or no value", variable.name);
                    return Err(FmuProblem::Description(text));
                }
            }
        }
        Self::of(read.description)
    }

    fn of(model: ModelDescription) -> Result<Self, FmuProblem> {
        let Some(co_simulation) = model.co_simulation.clone() else {
            let others: Vec<_> = model.interfaces().into_iter().map(|(name, _)| name).collect();
            return Err(without_co_simulation(&others));
        };
        if !names_library(&co_simulation.interface.model_identifier) {
            return Err(FmuProblem::ModelIdentifier(co_simulation.interface.model_identifier));
        }
        Ok(Self { model, co_simulation, problems: Vec::new() })
    }

    /// The reason why the FMU cannot be run, if there is one.
    pub(in crate::host) fn obstacle(&self) -> Option<String> {
        let is_clock = |v: &&fmi3::Variable| matches!(v.kind, VariableKind::Clock(_));
        let clock = self.model.variables.iter().find(is_clock)?;
        Some(format!(
            "it has clocks ({}), which need an importer with event mode; this program steps without",
            clock.name
        ))
    }

    /// The sizes of an array, with these values for structural parameters if given.
    fn sizes(
        &self,
        variable: &fmi3::Variable,
        structural: &BTreeMap<u32, f64>,
    ) -> Result<Vec<u64>, FmuProblem> {
        let size = |dimension: &fmi3::Dimension| {
            let Some(reference) = dimension.value_reference else { return dimension.start };
            if let Some(given) = structural.get(&reference) {
                return Some(*given as u64);
            }
            let start = self.model.by_reference(reference)?.kind.as_integer()?.start.first().copied()?;
            u64::try_from(start).ok()
        };
        let sizes: Option<Vec<u64>> = variable.dimensions.iter().map(size).collect();
        sizes.ok_or_else(|| {
            let name = &variable.name;
            FmuProblem::Description(format!(
                "the size of {name} is neither a number nor that of another variable"
            ))
        })
    }
}

impl Description {
    /// The description with its arrays as scalars.
    ///
    /// # Errors
    ///
    /// Arrays without sizes or too large, or a structure that names missing variables.
    pub(super) fn of_fmi3(
        written: Arc<Fmi3Description>,
        structural: &BTreeMap<u32, f64>,
    ) -> Result<Self, FmuProblem> {
        let (model, interface) = (&written.model, &written.co_simulation.interface);
        let mut flat = Flat::default();
        for variable in &model.variables {
            flat.add(&written, variable, structural)?;
        }
        let outputs = flat.outputs(model)?;
        Ok(Self {
            model_name: model.model_name.clone(),
            text: model.description.clone(),
            token: model.instantiation_token.clone(),
            model_identifier: interface.model_identifier.clone(),
            only_once: interface.can_be_instantiated_only_once_per_process,
            any_step: written.co_simulation.can_handle_variable_step,
            states: [interface.can_get_and_set_state, interface.can_serialize_state],
            derivatives: [interface.provides_directional_derivatives, interface.provides_adjoint_derivatives],
            needs_tool: interface.needs_execution_tool,
            default_experiment: model.default_experiment,
            variables: flat.variables,
            arrays: flat.arrays,
            aliases: flat.aliases,
            outputs,
            problems: written.problems.clone(),
            written: Written::Fmi3(written),
        })
    }
}

/// Collects scalars.
#[derive(Default)]
struct Flat {
    variables: Vec<Variable>,
    arrays: Vec<Array>,
    aliases: BTreeMap<String, usize>,
    /// For each value reference, the first position of its scalars and their number.
    places: HashMap<u32, (usize, usize)>,
    elements: u64,
}

impl Flat {
    fn add(
        &mut self,
        written: &Fmi3Description,
        variable: &fmi3::Variable,
        structural: &BTreeMap<u32, f64>,
    ) -> Result<(), FmuProblem> {
        let sizes = written.sizes(variable, structural)?;
        let count = sizes.iter().try_fold(1_u64, |count, size| count.checked_mul(*size)).unwrap_or(u64::MAX);
        self.elements = self.elements.saturating_add(count);
        if self.elements > MAX_ELEMENTS {
            let what = "the elements of all variables are";
            return Err(FmuProblem::Limit { what, value: self.elements, unit: "", allowed: MAX_ELEMENTS });
        }
        // Their product is within the limit, so no size is truncated.
        let sizes: Vec<usize> = sizes.iter().map(|size| *size as usize).collect();
        let (first, count) = (self.variables.len(), count as usize);
        if !sizes.is_empty() {
            self.arrays.push(Array { name: variable.name.clone(), sizes: sizes.clone(), first, count });
        }
        self.places.entry(variable.value_reference).or_insert((first, count));
        self.aliases.extend(variable.aliases.iter().map(|alias| (alias.name.clone(), first)));
        let declared = written.model.declared(variable);
        let number = |own: Option<f64>, of: Option<f64>| own.or(of).filter(|bound| !bound.is_nan());
        let (own, of) = (variable.kind.range(), declared.map(|of| of.kind.range()).unwrap_or_default());
        let unit = variable.kind.unit().or_else(|| declared.and_then(|of| of.kind.unit()));
        let items = declared.map(|of| of.items.as_slice()).unwrap_or_default();
        let starts = variable.kind.start_numbers();
        let texts = match &variable.kind {
            VariableKind::String(texts) => texts.start.as_slice(),
            _ => &[],
        };
        for element in 0..count {
            self.variables.push(Variable {
                name: element_name(&variable.name, &sizes, element),
                value_reference: variable.value_reference,
                element,
                count,
                of: variable.kind.data_type(),
                type_name: variable.kind.data_type().as_str(),
                causality: variable.causality,
                variability: variable.variability,
                unit: unit.map(str::to_owned),
                range: (number(own.0, of.0), number(own.1, of.1)),
                start: of_element(&starts, element).copied(),
                text: of_element(texts, element).cloned(),
                declared_type: variable.declared_type.clone(),
                items: items.iter().map(|item| (item.name.clone(), item.value)).collect(),
                description: variable.description.clone(),
            });
        }
        Ok(())
    }

    fn outputs(&self, model: &ModelDescription) -> Result<Vec<Output>, FmuProblem> {
        let place = |reference: &u32| {
            self.places.get(reference).copied().ok_or_else(|| {
                let text = format!("ModelStructure names value reference {reference}, which no variable has");
                FmuProblem::Description(text)
            })
        };
        let mut outputs: Vec<Output> = self
            .variables
            .iter()
            .enumerate()
            .filter(|(_, variable)| variable.causality == Causality::Output)
            .map(|(variable, _)| Output { variable, dependencies: None })
            .collect();
        for unknown in &model.structure.outputs {
            let (first, count) = place(&unknown.value_reference)?;
            let Some(list) = &unknown.dependencies else { continue };
            let mut on: Vec<usize> = Vec::new();
            for reference in list {
                let (first, count) = place(reference)?;
                on.extend(first..first + count);
            }
            let on: Arc<[usize]> = on.into();
            for output in outputs.iter_mut().filter(|o| (first..first + count).contains(&o.variable)) {
                output.dependencies = Some(Arc::clone(&on));
            }
        }
        Ok(outputs)
    }
}

/// The start value of an element; a single value applies to all elements.
fn of_element<T>(starts: &[T], element: usize) -> Option<&T> {
    match starts {
        [one] => Some(one),
        all => all.get(element),
    }
}

/// The name of an element, with its indices from 1 in each dimension: `m[1,3]`. A scalar keeps its own name.
fn element_name(name: &str, sizes: &[usize], element: usize) -> String {
    if sizes.is_empty() {
        return name.to_owned();
    }
    let mut rest = element;
    let mut places: Vec<String> = Vec::new();
    for size in sizes.iter().rev() {
        places.push((rest % size + 1).to_string());
        rest /= size;
    }
    places.reverse();
    format!("{name}[{}]", places.join(","))
}
