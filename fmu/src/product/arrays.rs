//! The variables of FMI 3.0: single ones of the table, and runs of it as arrays.
//!
//! The value reference of an array is the index of its first scalar, so that a read or write is a run over the
//! same values. After the table comes what FMI 2.0 does not have: the time.

use std::ops::Range;

use punctual_modeldescription::{Causality, ScalarType, Variability, Variable};

use super::Layout;

/// A variable of FMI 3.0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Item {
    /// Its name: that of the scalar, or what the names of the scalars have in common.
    pub name: String,
    /// The scalars, by their index; the time comes after the table.
    pub scalars: Range<usize>,
    /// The lengths of the array, the last one running fastest; none for a scalar.
    pub dimensions: Vec<usize>,
}

impl Item {
    /// The variable that is number `index` by itself.
    fn scalar(name: &str, index: usize) -> Self {
        Self { name: name.to_owned(), scalars: index..index + 1, dimensions: Vec::new() }
    }

    /// The value reference.
    pub fn reference(&self) -> u32 {
        self.scalars.start as u32
    }

    /// The position of the scalar `index` in the array, from 1; 0 in a variable that is no array.
    pub fn element(&self, index: usize) -> usize {
        if self.dimensions.is_empty() { 0 } else { index + 1 - self.scalars.start }
    }
}

/// What an importer of FMI 3.0 may do with a value reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Access {
    /// The type, which tells the functions that read and write it.
    pub(crate) scalar: ScalarType,
    pub(crate) causality: Causality,
    pub(crate) variability: Variability,
    /// The number of values; 0 where no variable begins.
    pub(crate) length: u32,
}

/// The name of the independent variable.
pub const TIME: &str = "time";

/// What the names of scalars of one family have before the last dot, where that becomes an array; and the number of
/// elements that it must have, where some may be missing. A bound is an array where each of the `inputs` has it.
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

/// The array that begins at the scalar `first`, if one does.
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
    // Only where the table has every element, from the first to the last.
    let whole = indices.iter().all(|index| *index == 1) && dimensions.iter().product::<usize>() == length;
    whole.then(|| Item { name: name.to_owned(), scalars: first..first + length, dimensions })
}

/// The variables of FMI 3.0 over the table `variables`, with arrays or without; then the time.
pub(super) fn items(variables: &[Variable], layout: &Layout, arrays: bool) -> Vec<Item> {
    let mut items = Vec::new();
    let mut next = 0;
    while next < variables.len() {
        // The limits of an integrated input are called like the bounds of the others, and come after them.
        let is_new = |item: &Item| items.iter().all(|other: &Item| other.name != item.name);
        let array = arrays.then(|| array_at(variables, next, layout.inputs)).flatten().filter(is_new);
        let item = array.unwrap_or_else(|| Item::scalar(&variables[next].name, next));
        next = item.scalars.end;
        items.push(item);
    }
    items.push(Item::scalar(TIME, next));
    items
}

/// What may be done with each value reference of FMI 3.0.
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
