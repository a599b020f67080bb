//! One loop: a filter, and all that it remembers between samples.

use punctual_core::filter::{FilterState, Integrator, Report, SafetyFilter};
use punctual_fmu::configuration::FilterConfiguration;
use pyo3::prelude::*;

use crate::loading::refused;

/// All that a loop remembers between samples.
#[derive(Clone)]
pub(crate) struct Memory {
    filter: FilterState,
    integrated: f64,
}

/// A filter with its integrator, if it has one: the computation of the FMU of the same configuration.
pub(crate) struct Loop {
    filter: SafetyFilter,
    integrator: Option<Integrator>,
    /// Expected time in s for which an integrated input is held.
    hold: f64,
}

impl Loop {
    /// The loop before its first sample.
    pub(crate) fn new(configuration: &FilterConfiguration) -> PyResult<Self> {
        let made = configuration.build().and_then(|filter| {
            let integrator = configuration.build_integrator(&filter)?;
            Ok(Self { filter, integrator, hold: configuration.experiment.step_size })
        });
        made.map_err(|e| refused(&e))
    }

    /// Computes the sample at `t` and remembers it.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length.
    pub(crate) fn step(
        &mut self,
        t: f64,
        x: &[f64],
        u_ref: &[f64],
        u: &mut [f64],
    ) -> Result<&Report, punctual_core::Error> {
        match &mut self.integrator {
            None => self.filter.step(t, x, u_ref, u),
            Some(integrator) => integrator.step(&mut self.filter, t, self.hold, x, u_ref, u),
        }
    }

    /// Starts every deadline anew; the integrated input stays.
    pub(crate) fn rearm(&mut self) {
        self.filter.rearm();
    }

    fn integrated(&self) -> f64 {
        self.integrator.as_ref().map_or(0.0, Integrator::value)
    }

    /// A copy of the memory.
    pub(crate) fn memory(&self) -> Memory {
        Memory { filter: self.filter.state().clone(), integrated: self.integrated() }
    }

    /// Writes the memory to `memory`, without an allocation.
    pub(crate) fn save(&self, memory: &mut Memory) {
        memory.filter.clone_from(self.filter.state());
        memory.integrated = self.integrated();
    }

    /// Goes back to a memory: every bit that follows is the same.
    ///
    /// # Errors
    ///
    /// The memory of another configuration.
    pub(crate) fn restore(&mut self, memory: &Memory) -> Result<(), punctual_core::Error> {
        self.filter.restore(&memory.filter)?;
        if let Some(integrator) = &mut self.integrator {
            integrator.set_value(memory.integrated);
        }
        Ok(())
    }
}
