//! Checks the value references that are read and written.

use punctual_modeldescription::{BaseType, Causality, Variability, Variable};

use super::{Call, Failure, Instance};

impl Instance {
    pub(super) fn check_references(
        &self,
        call: Call,
        base: BaseType,
        references: &[u32],
    ) -> Result<(), Failure> {
        self.check(call)?;
        self.check_each(base, references, |_, _| true)
    }

    pub(super) fn check_settable(&self, base: BaseType, references: &[u32]) -> Result<(), Failure> {
        self.check(Call::Set)?;
        let fixed = self.is_running();
        let settable = |c, v| {
            c == Causality::Input || (c == Causality::Parameter && (!fixed || v == Variability::Tunable))
        };
        self.check_each(base, references, settable)
    }

    /// Checks that each of `references` is a variable of the type `base` with an `allowed` causality and variability.
    fn check_each(
        &self,
        base: BaseType,
        references: &[u32],
        allowed: impl Fn(Causality, Variability) -> bool,
    ) -> Result<(), Failure> {
        // Reads the compact table, since this is done at every step; only the message needs the variables
        // themselves.
        let fits = |reference: u32| {
            let kind = self.kinds.get(reference as usize);
            kind.is_some_and(|&(found, c, v)| found == base && allowed(c, v))
        };
        match references.iter().find(|&&reference| !fits(reference)) {
            None => Ok(()),
            Some(&reference) => Err(self.misfit(base, reference)),
        }
    }

    /// The reason why `reference` is not a variable of the type `base`, or cannot be set now.
    #[cold]
    fn misfit(&self, base: BaseType, reference: u32) -> Failure {
        match self.variable(base, reference) {
            Err(failure) => failure,
            Ok(Variable { name, causality: Causality::Parameter, .. }) => {
                format!("{name} is a fixed parameter and cannot change after initialization")
            }
            Ok(Variable { name, .. }) => format!("{name} is an output and cannot be set"),
        }
    }

    /// The real, integer, … variable with this value reference.
    pub(super) fn variable(&self, base: BaseType, reference: u32) -> Result<&Variable, Failure> {
        let variables = &self.product.variables;
        let variable = variables.get(reference as usize).ok_or_else(|| {
            format!("value reference {reference} is unknown, must be 0 to {}", variables.len() - 1)
        })?;
        let found = variable.kind.base_type();
        if found != base {
            return Err(format!(
                "value reference {reference} is {} of type {found:?}, not {base:?}",
                variable.name
            ));
        }
        Ok(variable)
    }
}
