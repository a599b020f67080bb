//! Directional derivatives of the outputs.

use punctual_modeldescription::{BaseType, Causality, Variable};

use super::{Call, Failure, Instance, Mode};

impl Instance {
    /// Writes the derivatives of the outputs `unknowns` along `seed`, one number for each of the inputs `knowns`.
    /// They are those of the outputs that would be read now had these inputs just been set, with the units of the
    /// output over those of the input. Changes no value, and does not allocate once configured but for plans.
    ///
    /// # Errors
    ///
    /// The wrong mode; an unknown that is no real output, a known that is no real input; a seed that is not
    /// finite; parameters that contradict each other; a derivative that is not known or not finite.
    pub fn directional_derivative(
        &mut self,
        unknowns: &[u32],
        knowns: &[u32],
        seed: &[f64],
        out: &mut [f64],
    ) -> Result<(), Failure> {
        self.check(Call::GetDirectionalDerivative)?;
        // Check the references and the seed.
        for (references, causality, which) in
            [(unknowns, Causality::Output, "unknown"), (knowns, Causality::Input, "known")]
        {
            for &reference in references {
                let Variable { name, causality: found, .. } = self.variable(BaseType::Real, reference)?;
                if *found != causality {
                    let (found, wanted) = (found.as_str(), causality.as_str());
                    return Err(format!(
                        "{name} is of causality {found}: each {which} must be a real {wanted}"
                    ));
                }
            }
        }
        if let Some(i) = seed.iter().position(|v| !v.is_finite()) {
            let name = &self.product.variables[knowns[i] as usize].name;
            return Err(format!("the seed of {name} is {}, must be finite", seed[i]));
        }
        // Differentiate along the one direction that the seeds make.
        if !self.configured {
            self.configure().map_err(|e| e.to_string())?;
        }
        let [direction, derivative] = &mut self.derivative;
        direction.fill(0.0);
        derivative.fill(0.0);
        for (&known, seed) in knowns.iter().zip(seed) {
            direction[known as usize] += seed;
        }
        // After initialization outputs without direct feedthrough change in steps only.
        if self.mode == Mode::INITIALIZATION || self.block.direct_feedthrough() {
            self.block.differentiate(self.time, &self.values, direction, derivative)?;
        }
        // Hand out finite numbers, or none.
        for &unknown in unknowns {
            let value = derivative[unknown as usize];
            if !value.is_finite() {
                let name = &self.product.variables[unknown as usize].name;
                return Err(format!("the derivative of {name} is {value}, must be finite"));
            }
        }
        for (&unknown, o) in unknowns.iter().zip(out) {
            *o = derivative[unknown as usize];
        }
        Ok(())
    }
}
