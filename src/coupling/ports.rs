//! The values of a run: one vector of doubles, in which every output and every connected input has a slot. They
//! come from and go to instances without allocation.

use super::participant::Participant;
use crate::error::Error;
use crate::host::ScalarType;

/// Variables of one component that are read or written together, real ones first, then integers
/// and enumerations, then Booleans; their slots follow one another in this order.
#[derive(Clone, Debug, Default)]
pub(super) struct Group {
    first: usize,
    real: Vec<u32>,
    integer: Vec<u32>,
    boolean: Vec<u32>,
    scratch: Vec<i32>,
}

/// A position in a component's variable list.
pub(super) type Position = usize;

impl Group {
    /// Lays out `variables` (position, value reference, type) from slot `first` on. Returns the group and the
    /// positions in slot order. Strings are left out.
    pub(super) fn new(first: usize, variables: &[(Position, u32, ScalarType)]) -> (Self, Vec<Position>) {
        let of = |wanted: &[ScalarType]| {
            variables.iter().copied().filter(|v| wanted.contains(&v.2)).collect::<Vec<_>>()
        };
        let parts = [
            of(&[ScalarType::Real]),
            of(&[ScalarType::Integer, ScalarType::Enumeration]),
            of(&[ScalarType::Boolean]),
        ];
        let positions = parts.iter().flatten().map(|v| v.0).collect();
        let [real, integer, boolean] = parts.map(|part| part.into_iter().map(|v| v.1).collect::<Vec<_>>());
        let scratch = vec![0; integer.len().max(boolean.len())];
        (Self { first, real, integer, boolean, scratch }, positions)
    }

    /// The slots of the real variables.
    pub(super) fn real_slots(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.real.len()
    }

    /// Reads all variables of the group from the instance into their slots.
    pub(super) fn read<P: Participant>(&mut self, instance: &mut P, values: &mut [f64]) -> Result<(), Error> {
        instance.get_real(&self.real, &mut values[self.first..self.first + self.real.len()])?;
        let mut slot = self.first + self.real.len();
        if !self.integer.is_empty() {
            let numbers = &mut self.scratch[..self.integer.len()];
            instance.get_integer(&self.integer, numbers)?;
            for number in numbers {
                values[slot] = f64::from(*number);
                slot += 1;
            }
        }
        if !self.boolean.is_empty() {
            let numbers = &mut self.scratch[..self.boolean.len()];
            instance.get_boolean(&self.boolean, numbers)?;
            for number in numbers {
                values[slot] = f64::from(u8::from(*number != 0));
                slot += 1;
            }
        }
        Ok(())
    }

    /// Writes all variables of the group from their slots to the instance.
    pub(super) fn write<P: Participant>(&mut self, instance: &mut P, values: &[f64]) -> Result<(), Error> {
        instance.set_real(&self.real, &values[self.first..self.first + self.real.len()])?;
        let mut slot = self.first + self.real.len();
        // Slots of integers and Booleans only ever hold values read from integers and Booleans.
        for (references, boolean) in [(&self.integer, false), (&self.boolean, true)] {
            if references.is_empty() {
                continue;
            }
            let numbers = &mut self.scratch[..references.len()];
            for number in &mut *numbers {
                *number = values[slot] as i32;
                slot += 1;
            }
            if boolean {
                instance.set_boolean(references, numbers)?;
            } else {
                instance.set_integer(references, numbers)?;
            }
        }
        Ok(())
    }
}

/// The source of an input slot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Source {
    /// The slot of the input.
    pub(super) input: usize,
    /// The slot of the output.
    pub(super) output: usize,
    /// Factor (units of the input per unit of the output) and offset (unit of the input).
    pub(super) factor: f64,
    /// See `factor`.
    pub(super) offset: f64,
}

impl Source {
    /// Takes the value over. A plain connection copies the bits, the sign of zero included.
    pub(super) fn transfer(&self, values: &mut [f64]) {
        let value = values[self.output];
        values[self.input] = match (self.factor == 1.0, self.offset == 0.0) {
            (true, true) => value,
            (_, true) => self.factor * value,
            _ => self.factor * value + self.offset,
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_are_laid_out_by_type() {
        let variables = [
            (0, 10, ScalarType::Boolean),
            (1, 11, ScalarType::Real),
            (2, 12, ScalarType::String),
            (3, 13, ScalarType::Enumeration),
            (4, 14, ScalarType::Real),
        ];
        let (group, positions) = Group::new(5, &variables);
        assert_eq!(positions, [1, 4, 3, 0]);
        assert_eq!(group.real_slots(), 5..7);
        assert_eq!((group.real, group.integer, group.boolean), (vec![11, 14], vec![13], vec![10]));
    }

    #[test]
    fn a_plain_connection_keeps_the_sign_of_zero() {
        let mut values = [-0.0, 1.0, 3.0];
        Source { input: 1, output: 0, factor: 1.0, offset: 0.0 }.transfer(&mut values);
        assert_eq!(values[1].to_bits(), (-0.0_f64).to_bits());
        Source { input: 1, output: 2, factor: -2.0, offset: 0.5 }.transfer(&mut values);
        assert_eq!(values[1], -5.5);
    }
}
