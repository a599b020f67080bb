//! The variables of FMI 3.0: scalars of the table, and consecutive scalars as arrays.
//!
//! The value reference of an array is the index of its first scalar, so that a read or write accesses a range
//! of the same values. The time, which FMI 2.0 does not have as a variable, comes after the table.

use std::ops::Range;

use punctual_modeldescription::{Causality, ScalarType, Variability, Variable};

use super::Layout;

/// A variable of FMI 3.0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Item {
    /// Its name: that of the scalar, or the common part of the scalars' names.
    pub name: String,
    /// The scalars, by their index; the time comes after the table.
    pub scalars: Range<usize>,
    /// The lengths of the array, with the last dimension varying fastest; empty for a scalar.
    pub dimensions: Vec<usize>,
}

impl Item {
    /// The variable that consists of the scalar `index`.
    fn scalar(name: &str, index: usize) -> Self {
        Self { name: name.to_owned(), scalars: index..index + 1, dimensions: Vec::new() }
    }

    /// The value reference.
    pub fn reference(&self) -> u32 {
        self.scalars.start as u32
    }

    /// The position of the scalar `index` in the array, from 1; 0 if the variable is not an array.
    pub fn element(&self, index: usize) -> usize {
        if self.dimensions.is_empty() { 0 } else { index + 1 - self.scalars.start }
    }
}

/// The access that an importer of FMI 3.0 has to a value reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Access {
    /// The type, which determines the functions that read and write it.
    pub(crate) scalar: ScalarType,
    pub(crate) causality: Causality,
    pub(crate) variability: Variability,
    /// The number of values; 0 if no variable begins here.
    pub(crate) length: u32,
}

/// The name of the independent variable.
pub const TIME: &str = "time";

/// The part before the last dot in the names of scalars that form an array, if they do; and the number of
/// elements that it must have, if some may be missing. Bounds form an array if each of the `inputs` has one.
fn family(name: &str, inputs: usize) -> Option<(&str, Option<usize>)> {
    let (family, _) = name.rsplit_once('.')?;
    match family {
        "x" | "x0" | "u" | "u_ref" => Some((family, None)),
        "u_min" | "u_max" => Some((family, Some(inputs))),
        _ => family.ends_with(".lg").then_some((family, None)),
    }
}

/// The name and the indices, from 1, of `name[i]` or `name[i,j]`.
fn element(name: &str) -> Option<(&str, Vec<usize>)> {
    let (array, indices) = name.strip_suffix(']')?.split_once('[')?;
    let indices = indices.split(',').map(|index| index.parse().ok()).collect::<Option<Vec<_>>>()?;
    Some((array, indices))
}

/// The array that begins at the scalar `first`, if any.
fn array_at(variables: &[Variable], first: usize, inputs: usize) -> Option<Item> {
    let start = &variables[first];
    let alike = |v: &Variable| {
        (v.kind.scalar_type(), v.causality, v.variability)
            == (start.kind.scalar_type(), start.causality, start.variability)
    };
    let run = |belongs: &dyn Fn(&str) -> bool| {
        variables[first..].iter().take_while(|v| alike(v) && belongs(&v.name)).count()
    };
    if let Some((name, wanted)) = family(&start.name, inputs) {
        let length = run(&|other| family(other, inputs).is_some_and(|(found, _)| found == name));
        let whole = wanted.is_none_or(|wanted| length == wanted);
        return whole.then(|| Item {
            name: name.to_owned(),
            scalars: first..first + length,
            dimensions: vec![length],
        });
    }
    let (name, indices) = element(&start.name)?;
    let length = run(&|other| element(other).is_some_and(|(found, _)| found == name));
    let (_, dimensions) = element(&variables[first + length - 1].name)?;
    // Only if the table has every element, from the first to the last.
    let whole = indices.iter().all(|index| *index == 1) && dimensions.iter().product::<usize>() == length;
    whole.then(|| Item { name: name.to_owned(), scalars: first..first + length, dimensions })
}

/// The variables of FMI 3.0 made from the table `variables`, with or without arrays; then the time.
pub(super) fn items(variables: &[Variable], layout: &Layout, arrays: bool) -> Vec<Item> {
    let mut items = Vec::new();
    let mut next = 0;
    while next < variables.len() {
        // The limits of an integrated input are named like the bounds of the others, and come after them.
        let is_new = |item: &Item| items.iter().all(|other: &Item| other.name != item.name);
        let array = arrays.then(|| array_at(variables, next, layout.inputs)).flatten().filter(is_new);
        let item = array.unwrap_or_else(|| Item::scalar(&variables[next].name, next));
        next = item.scalars.end;
        items.push(item);
    }
    items.push(Item::scalar(TIME, next));
    items
}

/// The access to each value reference of FMI 3.0.
pub(crate) fn accesses(variables: &[Variable], items: &[Item]) -> Vec<Access> {
    let scalars = items.last().map_or(0, |item| item.scalars.end);
    let mut accesses: Vec<_> = (0..scalars)
        .map(|index| match variables.get(index) {
            Some(v) => Access {
                scalar: v.kind.scalar_type(),
                causality: v.causality,
                variability: v.variability,
                length: 0,
            },
            None => Access {
                scalar: ScalarType::Real,
                causality: Causality::Independent,
                variability: Variability::Continuous,
                length: 0,
            },
        })
        .collect();
    for item in items {
        accesses[item.scalars.start].length = item.scalars.len() as u32;
    }
    accesses
}
