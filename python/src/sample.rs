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

/// A filter with its integrator, if it has one: what the FMU of the same configuration computes.
pub(crate) struct Loop {
    filter: SafetyFilter,
    integrator: Option<Integrator>,
    /// For how long an integrated input is going to be held, in s.
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

    /// The sample at `t`, remembered.
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

    /// Starts every deadline anew; what is integrated stays.
    pub(crate) fn rearm(&mut self) {
        self.filter.rearm();
    }

    fn integrated(&self) -> f64 {
        self.integrator.as_ref().map_or(0.0, Integrator::value)
    }

    /// What is remembered.
    pub(crate) fn memory(&self) -> Memory {
        Memory { filter: self.filter.state().clone(), integrated: self.integrated() }
    }

    /// Writes what is remembered to `memory`, without an allocation.
    pub(crate) fn save(&self, memory: &mut Memory) {
        memory.filter.clone_from(self.filter.state());
        memory.integrated = self.integrated();
    }

    /// Goes back to what was remembered: every bit that follows is the same.
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
