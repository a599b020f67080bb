//! Resolves the start values of a system file against the description of the component's FMU.

use std::collections::BTreeMap;

use punctual_fmu::configuration::{self, ConfigurationError};

use super::system::{Component, StartValue};
use crate::error::Error;
use crate::host::{Causality, DataType, Description, Family, Variable, whole_range};

/// A resolved start value, written by one call.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Start {
    pub(super) of: DataType,
    pub(super) reference: u32,
    /// Whether it is a structural parameter.
    pub(super) structural: bool,
    pub(super) values: Values,
}

/// The values of a variable, one for each element of an array.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    Numbers(Vec<f64>),
    Texts(Vec<String>),
}

impl Start {
    /// The start value of a real scalar.
    pub(super) fn real(reference: u32, value: f64) -> Self {
        Self { of: DataType::Float64, reference, structural: false, values: Values::Numbers(vec![value]) }
    }

    /// Its number, if it belongs to the Real scalar with this reference.
    pub(super) fn number(&self, reference: u32) -> Option<f64> {
        match &self.values {
            Values::Numbers(values) if self.of == DataType::Float64 && self.reference == reference => {
                values.first().copied()
            }
            _ => None,
        }
    }
}

/// The start values of the component at `position`. `missing` gives the message for an unknown name.
pub(super) fn resolve(
    position: usize,
    component: &Component,
    description: &Description,
    missing: impl Fn(&str) -> String,
) -> Result<Vec<Start>, Error> {
    let mut starts: Vec<Start> = Vec::new();
    // A whole array comes before its elements, which override it.
    for (name, value) in &component.start {
        let wrong = |message: String| {
            Error::from(ConfigurationError::new(format!("component[{position}].start.{name:?}"), message))
        };
        let scalar = description.index_of(name);
        let array = description.array(name).filter(|_| scalar.is_none());
        let elements = match (scalar, array) {
            (Some(variable), _) => variable..variable + 1,
            (None, Some(array)) => array.first..array.first + array.count,
            (None, None) => return Err(wrong(missing(name))),
        };
        let wanted = array.map_or(Vec::new(), |array| array.sizes.clone());
        let given = value.sizes();
        // A matrix may be given row by row or as one list.
        let is_list_of_all = given.as_deref() == Some(&[elements.len()]) && !wanted.is_empty();
        if given.as_ref() != Some(&wanted) && !is_list_of_all {
            let shape = |of: &[usize], plain: &str| match of {
                [] => plain.to_owned(),
                of => format!("a list of {}", sizes(of)),
            };
            let given = given.map_or_else(
                || "a list of lists of different length".to_owned(),
                |of| shape(&of, "one value"),
            );
            return Err(wrong(format!("is {given}; must be {}", shape(&wanted, "one value"))));
        }
        for (index, value) in elements.zip(value.flat()) {
            let variable = &description.variables[index];
            check_causality(variable).map_err(wrong)?;
            place(&mut starts, description, index, value).map_err(wrong)?;
        }
    }
    Ok(starts)
}

/// The values that a component sets for structural parameters, by value reference. Unusable values are left
/// out; [`resolve`] reports them.
pub(super) fn structural(component: &Component, description: &Description) -> BTreeMap<u32, f64> {
    let given = component.start.iter().filter_map(|(name, value)| {
        let variable = &description.variables[description.index_of(name)?];
        let value = number(variable, value).ok()?;
        (variable.causality == Causality::StructuralParameter).then_some((variable.value_reference, value))
    });
    given.collect()
}

/// Notes on angles of more than one turn among the start values.
pub(super) fn in_degrees(components: &[Component], descriptions: &[&Description]) -> Vec<String> {
    let mut notes = Vec::new();
    for (component, description) in components.iter().zip(descriptions) {
        let unit = |name: &str| {
            let array = || description.array(name).map(|array| array.first);
            let index =
                description.index_of(name).or_else(array).filter(|i| *i < description.variables.len())?;
            description.variables[index].unit.as_deref()
        };
        for (name, value) in &component.start {
            let values = value.flat().into_iter().filter_map(StartValue::number);
            let name = (format!("{}.{name}", component.name), unit(name).unwrap_or_default());
            notes.extend(values.filter_map(|value| configuration::in_degrees(&name.0, value, name.1)));
        }
    }
    notes
}

fn check_causality(variable: &Variable) -> Result<(), String> {
    use Causality::{Input, Parameter, StructuralParameter};
    if matches!(variable.causality, Parameter | Input | StructuralParameter) {
        return Ok(());
    }
    let causality = variable.causality.as_str();
    Err(format!("has causality {causality}; only parameters and inputs can be given a start value"))
}

/// Writes a value into the start values of its variable, which are initially those of the description.
fn place(
    starts: &mut Vec<Start>,
    description: &Description,
    index: usize,
    value: &StartValue,
) -> Result<(), String> {
    let variable = &description.variables[index];
    let (of, reference) = (variable.of, variable.value_reference);
    let known = starts.iter().position(|start| start.of == of && start.reference == reference);
    let at = known.unwrap_or_else(|| {
        let first = index - variable.element;
        let all = &description.variables[first..first + variable.count];
        let values = match of {
            DataType::String => {
                Values::Texts(all.iter().map(|v| v.text.clone().unwrap_or_default()).collect())
            }
            _ => Values::Numbers(all.iter().map(|v| v.start.unwrap_or(0.0)).collect()),
        };
        starts.push(Start {
            of,
            reference,
            structural: variable.causality == Causality::StructuralParameter,
            values,
        });
        starts.len() - 1
    });
    match (&mut starts[at].values, value) {
        (Values::Texts(texts), StartValue::Text(text)) => text.clone_into(&mut texts[variable.element]),
        (Values::Numbers(numbers), value) => numbers[variable.element] = number(variable, value)?,
        _ => return Err(format!("is of type {}; the value given is not", variable.type_name)),
    }
    Ok(())
}

/// Converts the value to a number that the variable accepts.
fn number(variable: &Variable, value: &StartValue) -> Result<f64, String> {
    let number = match (variable.family(), value) {
        (Family::Real, StartValue::Real(x)) => *x,
        // Beyond 2⁵³ the nearest double is taken, as for any decimal number.
        (Family::Real, StartValue::Integer(i)) => *i as f64,
        (Family::Integer | Family::Enumeration, StartValue::Integer(i)) => {
            let (least, greatest) = whole_range(variable.of).unwrap_or_default();
            let number = *i as f64;
            if number < least || number > greatest || number as i64 != *i {
                return Err(format!("is {i}; must be from {least} to {greatest}"));
            }
            number
        }
        (Family::Boolean, StartValue::Boolean(b)) => f64::from(u8::from(*b)),
        (Family::Other, _) if variable.of != DataType::String => {
            return Err(format!("is of type {}, which cannot be given a value here", variable.type_name));
        }
        _ => return Err(format!("is of type {}; the value given is not", variable.type_name)),
    };
    let (min, max) = variable.range;
    let (min, max) = (min.unwrap_or(f64::NEG_INFINITY), max.unwrap_or(f64::INFINITY));
    if number < min || number > max {
        let unit = variable.unit.as_ref().map(|unit| format!(" {unit}")).unwrap_or_default();
        return Err(format!("is {number}{unit}; must be {}", range(min, max, &unit)));
    }
    if !variable.items.is_empty() && !variable.items.iter().any(|(_, item)| *item as f64 == number) {
        let items: Vec<_> = variable.items.iter().map(|(name, value)| format!("{value} ({name})")).collect();
        return Err(format!("is {number}; must be one of {}", items.join(", ")));
    }
    Ok(number)
}

/// "≥ a", "≤ b" or "from a to b".
fn range(min: f64, max: f64, unit: &str) -> String {
    let number = |value: f64| {
        let size = value.abs();
        if size == 0.0 || (1e-4..1e7).contains(&size) { value.to_string() } else { format!("{value:e}") }
    };
    let (low, high) = (min.is_finite(), max.is_finite());
    let (min, max) = (number(min), number(max));
    match (low, high) {
        (true, true) => format!("from {min} to {max}{unit}"),
        (true, false) => format!("≥ {min}{unit}"),
        _ => format!("≤ {max}{unit}"),
    }
}

/// The sizes of an array, as in `[2, 3]`.
pub(super) fn sizes(of: &[usize]) -> String {
    format!("{of:?}")
}
