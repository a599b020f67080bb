//! Access to values by the value references of FMI 3.0: scalars, and arrays as consecutive scalars.

use punctual_modeldescription::{Causality, ScalarType, Variability};

use super::{Call, Failure, Instance, Mode};
use crate::product::Access;

/// The type of a variable as named in FMI 3.0; its functions are `fmi3Get<type>` and `fmi3Set<type>`.
pub(crate) fn type_name(scalar: ScalarType) -> &'static str {
    match scalar {
        ScalarType::Real => "Float64",
        ScalarType::Integer => "Int32",
        ScalarType::Enumeration => "Int64",
        ScalarType::Boolean => "Boolean",
        ScalarType::String => "String",
    }
}

/// The scalars of variables, by their index. The references must be valid.
pub(super) fn scalars<'a>(
    accesses: &'a [Access],
    references: &'a [u32],
) -> impl Iterator<Item = usize> + Clone + 'a {
    references.iter().flat_map(|&reference| {
        let first = reference as usize;
        first..first + accesses[first].length as usize
    })
}

impl Instance {
    /// Reads Float64 variables, in their units: the elements of each array in order.
    ///
    /// # Errors
    ///
    /// A value reference that is not that of such a variable; a number of values other than the variables
    /// have.
    pub fn get_float64(&mut self, references: &[u32], out: &mut [f64]) -> Result<(), Failure> {
        self.check_runs(Call::Get, ScalarType::Real, references, out.len())?;
        self.refresh();
        let mut rest = out;
        for &reference in references {
            let first = reference as usize;
            let (to, others) = rest.split_at_mut(self.accesses[first].length as usize);
            match self.values.reals.get(first..first + to.len()) {
                Some(values) => to.copy_from_slice(values),
                // The time, which FMI 2.0 does not have as a variable.
                None => to.fill(self.time),
            }
            rest = others;
        }
        Ok(())
    }

    /// Reads Int32 variables.
    ///
    /// # Errors
    ///
    /// Those of [`Self::get_float64`].
    pub fn get_int32(&mut self, references: &[u32], out: &mut [i32]) -> Result<(), Failure> {
        self.check_runs(Call::Get, ScalarType::Integer, references, out.len())?;
        self.refresh();
        let Self { accesses, values, .. } = self;
        scalars(accesses, references).zip(out).for_each(|(i, o)| *o = values.integers[i]);
        Ok(())
    }

    /// Reads enumerations, which are Int64.
    ///
    /// # Errors
    ///
    /// Those of [`Self::get_float64`].
    pub fn get_int64(&mut self, references: &[u32], out: &mut [i64]) -> Result<(), Failure> {
        self.check_runs(Call::Get, ScalarType::Enumeration, references, out.len())?;
        self.refresh();
        let Self { accesses, values, .. } = self;
        scalars(accesses, references).zip(out).for_each(|(i, o)| *o = i64::from(values.integers[i]));
        Ok(())
    }

    /// Reads booleans, as 0 and 1.
    ///
    /// # Errors
    ///
    /// Those of [`Self::get_float64`].
    pub fn get_bytes_of_booleans(&mut self, references: &[u32], out: &mut [u8]) -> Result<(), Failure> {
        self.check_runs(Call::Get, ScalarType::Boolean, references, out.len())?;
        self.refresh();
        let Self { accesses, values, .. } = self;
        scalars(accesses, references).zip(out).for_each(|(i, o)| *o = u8::from(values.booleans[i]));
        Ok(())
    }

    /// Writes Float64 variables, as [`Self::set_real`] does.
    ///
    /// # Errors
    ///
    /// Those of [`Self::set_real`]; a number of values other than the variables have.
    pub fn set_float64(&mut self, references: &[u32], values: &[f64]) -> Result<(), Failure> {
        self.check_runs(Call::Set, ScalarType::Real, references, values.len())?;
        if references.iter().any(|&reference| reference as usize >= self.product.layout.parameters) {
            for (i, &value) in scalars(&self.accesses, references).zip(values) {
                self.check_range(i, value)?;
            }
        }
        let mut rest = values;
        for &reference in references {
            let first = reference as usize;
            let (from, others) = rest.split_at(self.accesses[first].length as usize);
            self.values.reals[first..first + from.len()].copy_from_slice(from);
            rest = others;
        }
        self.taken_over(references);
        Ok(())
    }

    /// Writes booleans; every number but 0 is true.
    ///
    /// # Errors
    ///
    /// The wrong mode; a reference that is not that of a boolean input; a number of values other than the
    /// variables have.
    pub fn set_bytes_of_booleans(&mut self, references: &[u32], values: &[u8]) -> Result<(), Failure> {
        self.check_runs(Call::Set, ScalarType::Boolean, references, values.len())?;
        let Self { accesses, values: own, .. } = self;
        scalars(accesses, references).zip(values).for_each(|(i, value)| own.booleans[i] = *value != 0);
        self.fresh &= references.is_empty();
        Ok(())
    }

    /// Writes Int32 variables: there is no such input or parameter.
    ///
    /// # Errors
    ///
    /// Any reference or value at all.
    pub fn set_int32(&mut self, references: &[u32], values: &[i32]) -> Result<(), Failure> {
        self.check_runs(Call::Set, ScalarType::Integer, references, values.len())
    }

    /// Writes enumerations: there is no such input or parameter.
    ///
    /// # Errors
    ///
    /// Any reference or value at all.
    pub fn set_int64(&mut self, references: &[u32], values: &[i64]) -> Result<(), Failure> {
        self.check_runs(Call::Set, ScalarType::Enumeration, references, values.len())
    }

    /// The dependencies of the variable `dependent`: an element of it, a variable, and an element of that.
    /// Elements count from 1; 0 denotes a scalar. Before the end of initialization, these are the
    /// dependencies of its first value.
    ///
    /// # Errors
    ///
    /// A reference that is not that of an output.
    pub fn dependencies(
        &self,
        dependent: u32,
    ) -> Result<impl Iterator<Item = (usize, u32, usize)> + '_, Failure> {
        let item = self.item(dependent)?;
        let initial = self.mode.is_in(Mode::INSTANTIATED.or(Mode::INITIALIZATION));
        let variables = self.product.variables.get(item.scalars.clone());
        let outputs = variables.filter(|v| v.iter().all(|v| v.causality == Causality::Output));
        let Some(outputs) = outputs else {
            return Err(format!("{} is not an output, so its dependencies are not reported", item.name));
        };
        Ok(outputs.iter().enumerate().flat_map(move |(k, output)| {
            let reported =
                output.initial_dependencies.as_ref().filter(|_| initial).or(output.dependencies.as_ref());
            let reported = reported.map_or(&[][..], Vec::as_slice);
            reported.iter().map(move |&on| {
                let on_item = self.product.item_of(on as usize);
                let element = on_item.element(on as usize);
                (item.element(item.scalars.start + k), on_item.reference(), element)
            })
        }))
    }

    /// Reads or writes a type that no variable has, so that every reference is an error.
    ///
    /// # Errors
    ///
    /// Any reference or value at all.
    pub(crate) fn check_absent(
        &self,
        call: Call,
        name: &str,
        references: &[u32],
        count: usize,
    ) -> Result<(), Failure> {
        self.check(call)?;
        match references.first() {
            Some(&reference) => Err(self.misfit_of(name, reference)),
            None => check_count(count, 0),
        }
    }

    /// Checks that each of `references` is a variable of the type `scalar` that `call` may access now, and
    /// that they have `count` values in total.
    fn check_runs(
        &self,
        call: Call,
        scalar: ScalarType,
        references: &[u32],
        count: usize,
    ) -> Result<(), Failure> {
        self.check(call)?;
        let (set, running) = (call == Call::Set, self.is_running());
        let mut total = 0;
        for &reference in references {
            let fits = |access: &&Access| {
                let settable = match access.causality {
                    Causality::Input => true,
                    Causality::Parameter => !running || access.variability == Variability::Tunable,
                    _ => false,
                };
                access.length > 0 && access.scalar == scalar && (!set || settable)
            };
            match self.accesses.get(reference as usize).filter(fits) {
                Some(access) => total += access.length as usize,
                None => return Err(self.misfit_of(type_name(scalar), reference)),
            }
        }
        check_count(count, total)
    }

    /// The variable of FMI 3.0 with this value reference.
    pub(super) fn item(&self, reference: u32) -> Result<&crate::product::Item, Failure> {
        let items = &self.product.items;
        items.binary_search_by_key(&reference, crate::product::Item::reference).map(|i| &items[i]).map_err(
            |i| match i.checked_sub(1).map(|before| &items[before]) {
                Some(array) if array.scalars.contains(&(reference as usize)) => format!(
                    "value reference {reference} is inside the array {}, whose value reference is {}",
                    array.name,
                    array.reference()
                ),
                _ => {
                    let last = items.last().map_or(0, crate::product::Item::reference);
                    format!("value reference {reference} is unknown, must be 0 to {last}")
                }
            },
        )
    }

    /// The reason why `reference` is not a variable of the type called `wanted`, or cannot be set now.
    #[cold]
    fn misfit_of(&self, wanted: &str, reference: u32) -> Failure {
        let item = match self.item(reference) {
            Ok(item) => item,
            Err(failure) => return failure,
        };
        let (name, access) = (&item.name, &self.accesses[item.scalars.start]);
        let found = type_name(access.scalar);
        if found != wanted {
            return format!("value reference {reference} is {name} of type {found}, not {wanted}");
        }
        match access.causality {
            Causality::Parameter => {
                format!("{name} is a fixed parameter and cannot change after initialization")
            }
            causality => format!("{name} is of causality {} and cannot be set", causality.as_str()),
        }
    }
}

/// Checks that the number of values given is that of the variables.
fn check_count(found: usize, wanted: usize) -> Result<(), Failure> {
    if found == wanted {
        return Ok(());
    }
    Err(format!("nValues is {found}, must be {wanted}: the number of values of the variables"))
}
