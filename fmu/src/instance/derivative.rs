//! Directional and adjoint derivatives of the outputs.

use punctual_modeldescription::{BaseType, Causality, ScalarType, Variable};

use super::arrays::{scalars, type_name};
use super::{Call, Failure, Instance, Mode};

/// The two sides of a Jacobian: the causality of their variables, and their name.
const SIDES: [(Causality, &str); 2] = [(Causality::Output, "unknown"), (Causality::Input, "known")];

impl Instance {
    /// Writes the derivatives of the outputs `unknowns` along `seed`, which has one number for each of the
    /// inputs `knowns`. They are those of the outputs that would be read now had these inputs just been set,
    /// in the unit of the output over that of the input. Changes no value and, once configured, allocates
    /// only for plans.
    ///
    /// # Errors
    ///
    /// The wrong mode; an unknown that is not a real output, or a known that is not a real input; a seed that
    /// is not finite; contradictory parameters; a derivative that is unknown or not finite.
    pub fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        out: &mut [f64],
    ) -> Result<(), Failure> {
        self.check(Call::GetDirectionalDerivative)?;
        for (references, side) in [unknowns, knowns].into_iter().zip(SIDES) {
            for &reference in references {
                let Variable { name, causality, .. } = self.variable(BaseType::Real, reference)?;
                check_side(name, *causality, side)?;
            }
        }
        let known = knowns.iter().map(|&known| known as usize);
        let unknown = unknowns.iter().map(|&unknown| unknown as usize);
        self.check_seed(known.clone(), seed)?;
        seed_direction(&mut self.derivative[0], known, seed);
        self.differentiate()?;
        self.check_finite(unknown.clone())?;
        unknown.zip(out).for_each(|(i, o)| *o = self.derivative[1][i]);
        Ok(())
    }

    /// [`Self::directional_derivative`] for variables of FMI 3.0; seed and result have a number for each
    /// element. The inner error means that the derivative is unknown or not finite here, without any misuse.
    ///
    /// # Errors
    ///
    /// Those of [`Self::directional_derivative`]; a length of seed or result that differs from the
    /// variables'.
    pub fn directional_derivative_of_arrays(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        out: &mut [f64],
    ) -> Result<Result<(), Failure>, Failure> {
        self.check(Call::GetDirectionalDerivative)?;
        self.check_sides([unknowns, knowns], [out.len(), seed.len()], ["nSensitivity", "nSeed"])?;
        self.check_seed(scalars(&self.accesses, knowns), seed)?;
        let Self { accesses, derivative: [direction, ..], .. } = self;
        seed_direction(direction, scalars(accesses, knowns), seed);
        let known = self.differentiate().and_then(|()| self.check_finite(scalars(&self.accesses, unknowns)));
        if known.is_ok() {
            scalars(&self.accesses, unknowns).zip(out).for_each(|(i, o)| *o = self.derivative[1][i]);
        }
        Ok(known)
    }

    /// Writes to `out` the sum of the derivatives of the outputs `unknowns` with respect to each element of
    /// the inputs `knowns`, weighted by `seed`: the transposed Jacobian times the seed. It takes one
    /// [`Self::directional_derivative`] for each element. It changes no value and allocates as little. The
    /// inner error is that of [`Self::directional_derivative_of_arrays`].
    ///
    /// # Errors
    ///
    /// Those of [`Self::directional_derivative_of_arrays`].
    pub fn adjoint_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        out: &mut [f64],
    ) -> Result<Result<(), Failure>, Failure> {
        self.check(Call::GetDirectionalDerivative)?;
        self.check_sides([unknowns, knowns], [seed.len(), out.len()], ["nSeed", "nSensitivity"])?;
        self.check_seed(scalars(&self.accesses, unknowns), seed)?;
        for &reference in knowns {
            let first = reference as usize;
            for k in first..first + self.accesses[first].length as usize {
                if let Err(unknown) = self.gather(unknowns, k, seed) {
                    return Ok(Err(unknown));
                }
            }
        }
        scalars(&self.accesses, knowns).zip(out).for_each(|(k, o)| *o = self.derivative[2][k]);
        Ok(Ok(()))
    }

    /// Computes the derivatives of `unknowns` with respect to the number `k`, and stores their sum, weighted
    /// by `seed`.
    fn gather(&mut self, unknowns: &[u32], k: usize, seed: &[f64]) -> Result<(), Failure> {
        self.derivative[0].fill(0.0);
        self.derivative[0][k] = 1.0;
        self.differentiate()?;
        self.check_finite(scalars(&self.accesses, unknowns))?;
        let slopes = scalars(&self.accesses, unknowns).map(|i| self.derivative[1][i]);
        let sum = slopes.zip(seed).map(|(slope, weight)| slope * weight).sum();
        self.derivative[2][k] = sum;
        Ok(())
    }

    /// Checks the variables of both sides, and that they have as many elements as the arrays called `names`.
    fn check_sides(&self, sides: [&[u32]; 2], lengths: [usize; 2], names: [&str; 2]) -> Result<(), Failure> {
        for (references, side) in sides.into_iter().zip(SIDES) {
            for &reference in references {
                let item = self.item(reference)?;
                let access = self.accesses[item.scalars.start];
                if access.scalar != ScalarType::Real {
                    let found = type_name(access.scalar);
                    return Err(format!(
                        "value reference {reference} is {} of type {found}, not Float64",
                        item.name
                    ));
                }
                check_side(&item.name, access.causality, side)?;
            }
        }
        for ((references, length), name) in sides.into_iter().zip(lengths).zip(names) {
            let wanted = scalars(&self.accesses, references).count();
            if length != wanted {
                return Err(format!("{name} is {length}, must be {wanted}: the number of elements"));
            }
        }
        Ok(())
    }

    /// Checks that each number of a seed of the variables `indices` is finite.
    fn check_seed(&self, mut indices: impl Iterator<Item = usize>, seed: &[f64]) -> Result<(), Failure> {
        let Some(i) = seed.iter().position(|v| !v.is_finite()) else { return Ok(()) };
        let name = indices.nth(i).map_or("", |index| &self.product.variables[index].name);
        Err(format!("the seed of {name} is {}, must be finite", seed[i]))
    }

    /// Differentiates along the direction that was set.
    fn differentiate(&mut self) -> Result<(), Failure> {
        if !self.configured {
            self.configure().map_err(|e| e.to_string())?;
        }
        let [direction, derivative, _] = &mut self.derivative;
        derivative.fill(0.0);
        // After initialization, outputs without direct feedthrough change only in steps.
        if self.mode == Mode::INITIALIZATION || self.block.direct_feedthrough() {
            self.block.differentiate(self.time, &self.values, direction, derivative)?;
        }
        Ok(())
    }

    /// Checks that the derivatives of the variables `indices` are finite: either all numbers returned are
    /// finite, or none is returned.
    fn check_finite(&self, mut indices: impl Iterator<Item = usize>) -> Result<(), Failure> {
        match indices.find(|&i| !self.derivative[1][i].is_finite()) {
            None => Ok(()),
            Some(i) => {
                let (name, value) = (&self.product.variables[i].name, self.derivative[1][i]);
                Err(format!("the derivative of {name} is {value}, must be finite"))
            }
        }
    }
}

/// Writes the direction that consists of the seeds of the variables `indices`.
fn seed_direction(direction: &mut [f64], indices: impl Iterator<Item = usize>, seed: &[f64]) {
    direction.fill(0.0);
    indices.zip(seed).for_each(|(i, seed)| direction[i] += seed);
}

fn check_side(name: &str, found: Causality, (wanted, which): (Causality, &str)) -> Result<(), Failure> {
    if found == wanted {
        return Ok(());
    }
    let (found, wanted) = (found.as_str(), wanted.as_str());
    Err(format!("{name} is of causality {found}: each {which} must be a real {wanted}"))
}
