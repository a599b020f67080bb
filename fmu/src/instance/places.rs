//! Fast access for a master in this process that passes the same inputs and outputs at every step. They are
//! looked up once, then read and written without checking their types.

use punctual_modeldescription::{BaseType, Causality};

use super::{Call, Failure, Instance};
use crate::block::Values;

/// The storage place of an input or output: the index in the array of its type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Of a real.
    Real(usize),
    /// Of an integer or enumeration.
    Integer(usize),
    /// Of a boolean.
    Boolean(usize),
}

impl Instance {
    /// The storage place of the input or output `reference`; `None` if its type or causality differs.
    pub fn place(&self, causality: Causality, base: BaseType, reference: u32) -> Option<Place> {
        let index = reference as usize;
        let &(found, c, _) = self.kinds.get(index)?;
        let is_it = (found, c) == (base, causality) && matches!(c, Causality::Input | Causality::Output);
        match base {
            _ if !is_it => None,
            BaseType::Real => Some(Place::Real(index)),
            BaseType::Integer => Some(Place::Integer(index)),
            BaseType::Boolean => Some(Place::Boolean(index)),
            BaseType::String => None,
        }
    }

    /// Reads the numbers at `places`, which [`Self::place`] returned. A boolean is 0 or 1.
    ///
    /// # Errors
    ///
    /// The wrong mode.
    #[inline]
    pub fn read(&mut self, places: &[Place], out: &mut [f64]) -> Result<(), Failure> {
        self.check(Call::Get)?;
        self.refresh();
        let Values { reals, integers, booleans } = &self.values;
        for (o, place) in out.iter_mut().zip(places) {
            *o = match *place {
                Place::Real(i) => reals[i],
                Place::Integer(i) => f64::from(integers[i]),
                Place::Boolean(i) => f64::from(booleans[i]),
            };
        }
        Ok(())
    }

    /// Writes numbers to `places`, which [`Self::place`] returned for inputs. A boolean is false if the
    /// number truncates to 0.
    ///
    /// # Errors
    ///
    /// The wrong mode.
    #[inline]
    pub fn write(&mut self, places: &[Place], numbers: &[f64]) -> Result<(), Failure> {
        self.check(Call::Set)?;
        let Values { reals, integers, booleans } = &mut self.values;
        let (reals, integers, booleans) = (&mut reals[..], &mut integers[..], &mut booleans[..]);
        for (number, place) in numbers.iter().zip(places) {
            match *place {
                Place::Real(i) => reals[i] = *number,
                Place::Integer(i) => integers[i] = *number as i32,
                Place::Boolean(i) => booleans[i] = *number as i32 != 0,
            }
        }
        self.fresh &= places.is_empty();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::configuration::Configuration;
    use crate::product::Product;

    #[test]
    fn places_are_those_of_inputs_and_outputs() {
        let text = "kind = \"plant\"\n[plant]\nmodel = \"unicycle\"\n";
        let product = Product::new(Configuration::parse(text).expect("a plant")).expect("a product");
        let (layout, guid) = (product.layout, product.guid.clone());
        let mut instance = Instance::new(product.configuration, &guid).expect("an instance");
        let place = |instance: &Instance, causality, base, index: usize| {
            instance.place(causality, base, u32::try_from(index).expect("a small number"))
        };
        let input = place(&instance, Causality::Input, BaseType::Real, 0);
        let output = place(&instance, Causality::Output, BaseType::Real, layout.outputs);
        assert_eq!((input, output), (Some(Place::Real(0)), Some(Place::Real(layout.outputs))));
        assert_eq!(place(&instance, Causality::Output, BaseType::Real, 0), None);
        assert_eq!(place(&instance, Causality::Input, BaseType::Boolean, 0), None);
        assert_eq!(place(&instance, Causality::Parameter, BaseType::Real, layout.parameters), None);
        assert_eq!(place(&instance, Causality::Output, BaseType::Real, 1000), None);

        let input = [input.expect("an input")];
        instance.write(&input, &[2.5]).expect("a mode to write in");
        let mut read = [0.0];
        instance.get_real(&[0], &mut read).expect("a real");
        assert_eq!(read, [2.5]);
        instance.enter_initialization_mode().expect("initialization");
        instance.exit_initialization_mode().expect("steps");
        instance.terminate().expect("an end");
        assert_eq!(instance.write(&input, &[1.0]), instance.set_real(&[0], &[1.0]));
        assert!(instance.write(&input, &[1.0]).is_err());
        instance.read(&input, &mut read).expect("a mode to read in");
        assert_eq!(read, [2.5]);
    }
}
