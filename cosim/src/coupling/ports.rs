//! The values of a run: one vector of doubles with a slot for every output and every connected input. Values
//! are copied from and to instances without allocation.

use std::ops::Range;

use punctual_fmu::instance::Place;

use crate::error::Error;
use crate::host::{Causality, DataType, Participant, Variable};

/// The variables of one component that are read or written together, grouped by type with Real first. Their
/// slots are consecutive in this order.
#[derive(Clone, Debug, Default)]
pub(super) struct Group {
    first: usize,
    reals: usize,
    parts: Vec<Part>,
    /// If the instance runs in this process, its storage places, one for each slot.
    places: Option<Vec<Place>>,
}

/// The variables of one type.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Part {
    of: DataType,
    /// The value references; an array has one for all elements.
    references: Vec<u32>,
    slots: usize,
}

/// A position in a component's variable list.
pub(super) type Position = usize;

/// The numeric types, in the order of slots.
const NUMBERS: [DataType; 12] = [
    DataType::Float64,
    DataType::Float32,
    DataType::Int8,
    DataType::UInt8,
    DataType::Int16,
    DataType::UInt16,
    DataType::Int32,
    DataType::UInt32,
    DataType::Int64,
    DataType::UInt64,
    DataType::Enumeration,
    DataType::Boolean,
];

impl Group {
    /// Lays out `variables` from slot `first` on. All elements of an array must be given, in order. Returns
    /// the group and the positions in slot order. Variables that are not numbers are left out.
    pub(super) fn new(first: usize, variables: &[(Position, &Variable)]) -> (Self, Vec<Position>) {
        let mut group = Self { first, ..Self::default() };
        let mut positions = Vec::new();
        for of in NUMBERS {
            let mut part = Part { of, references: Vec::new(), slots: 0 };
            for (position, variable) in variables.iter().filter(|(_, v)| v.of == of) {
                if variable.element == 0 {
                    part.references.push(variable.value_reference);
                }
                part.slots += 1;
                positions.push(*position);
            }
            if part.slots > 0 {
                group.reals += if of.is_float() { part.slots } else { 0 };
                group.parts.push(part);
            }
        }
        (group, positions)
    }

    /// The slots of the real variables.
    pub(super) fn real_slots(&self) -> Range<usize> {
        self.first..self.first + self.reals
    }

    /// Asks the instance for the storage places of the variables, which all have this causality.
    pub(super) fn place<P: Participant>(&mut self, instance: &P, causality: Causality) {
        let places = self.parts.iter().flat_map(|part| {
            part.references.iter().map(move |reference| instance.place(causality, part.of, *reference))
        });
        let places: Option<Vec<_>> = places.collect();
        // An array has several slots for one reference.
        let slots: usize = self.parts.iter().map(|part| part.slots).sum();
        self.places = places.filter(|places| places.len() == slots);
    }

    /// Reads all variables of the group from the instance into their slots. Returns the Real values.
    #[inline(always)]
    pub(super) fn read<'a, P: Participant>(
        &self,
        instance: &mut P,
        values: &'a mut [f64],
    ) -> Result<&'a [f64], Error> {
        match &self.places {
            Some(places) if places.is_empty() => Ok(&[]),
            Some(places) => {
                let own = &mut values[self.first..][..places.len()];
                instance.read(places, own)?;
                Ok(&own[..self.reals])
            }
            None => {
                self.each_part(|part, slots| instance.get(part.of, &part.references, &mut values[slots]))?;
                Ok(&values[self.real_slots()])
            }
        }
    }

    /// Writes all variables of the group from their slots to the instance.
    #[inline]
    pub(super) fn write<P: Participant>(&self, instance: &mut P, values: &[f64]) -> Result<(), Error> {
        match &self.places {
            Some(places) if places.is_empty() => Ok(()),
            Some(places) => instance.write(places, &values[self.first..][..places.len()]),
            None => self.each_part(|part, slots| instance.set(part.of, &part.references, &values[slots])),
        }
    }

    #[inline(never)]
    fn each_part(&self, mut call: impl FnMut(&Part, Range<usize>) -> Result<(), Error>) -> Result<(), Error> {
        let mut slot = self.first;
        for part in &self.parts {
            call(part, slot..slot + part.slots)?;
            slot += part.slots;
        }
        Ok(())
    }
}

/// The source of an input slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Source {
    /// The slot of the input.
    input: usize,
    /// The slot of the output.
    output: usize,
    /// Factor (units of the input per unit of the output) and offset (unit of the input); `None` for a plain
    /// copy.
    scale: Option<[f64; 2]>,
}

impl Source {
    /// Connects slot `output` to slot `input` with a factor and an offset.
    pub(super) fn new(input: usize, output: usize, factor: f64, offset: f64) -> Self {
        Self { input, output, scale: (factor != 1.0 || offset != 0.0).then_some([factor, offset]) }
    }

    /// Copies the value. A plain copy preserves all bits, including the sign of zero.
    pub(super) fn transfer(&self, values: &mut [f64]) {
        let value = values[self.output];
        values[self.input] = match self.scale {
            None => value,
            Some([factor, 0.0]) => factor * value,
            Some([factor, offset]) => factor * value + offset,
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::{Causality, example};

    #[test]
    fn slots_are_laid_out_by_type() {
        use DataType::{Boolean, Enumeration, Float64, String};
        let variable = |value_reference, of, element, count| Variable {
            value_reference,
            of,
            element,
            count,
            ..example::variable("v", of, Causality::Output)
        };
        let variables = [
            variable(10, Boolean, 0, 1),
            variable(11, Float64, 0, 1),
            variable(12, String, 0, 1),
            variable(13, Enumeration, 0, 1),
            variable(14, Float64, 0, 2),
            variable(14, Float64, 1, 2),
        ];
        let variables: Vec<_> = variables.iter().enumerate().collect();
        let (group, positions) = Group::new(5, &variables);
        assert_eq!(positions, [1, 4, 5, 3, 0]);
        assert_eq!(group.real_slots(), 5..8);
        let part = |of, references: &[u32], slots| Part { of, references: references.to_vec(), slots };
        let parts = [part(Float64, &[11, 14], 3), part(Enumeration, &[13], 1), part(Boolean, &[10], 1)];
        assert_eq!(group.parts, parts);
    }

    #[test]
    fn a_plain_connection_keeps_the_sign_of_zero() {
        let mut values = [-0.0, 1.0, 3.0];
        Source::new(1, 0, 1.0, 0.0).transfer(&mut values);
        assert_eq!(values[1].to_bits(), (-0.0_f64).to_bits());
        Source::new(1, 2, -2.0, 0.5).transfer(&mut values);
        assert_eq!(values[1], -5.5);
    }
}
