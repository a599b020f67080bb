//! One loop: a filter, and all that it remembers between samples.

use punctual_core::filter::Report;
use punctual_fmu::configuration::FilterConfiguration;
use punctual_fmu::{FilterLoop, LoopState};
use pyo3::prelude::*;

use crate::loading::refused;

/// A filter with its integrator, if it has one: the computation of the FMU of the same configuration.
pub(crate) struct Loop {
    filter: FilterLoop,
    /// Time between steps in s, and the longest, as configured.
    period: f64,
    longest: f64,
}

/// The largest difference between two times in s that are the same, as a part of them.
const ROUND_OFF: f64 = 1e-9;

impl Loop {
    /// The loop before its first sample.
    pub(crate) fn new(configuration: &FilterConfiguration) -> PyResult<Self> {
        let filter = configuration.build_loop().map_err(|e| refused(&e))?;
        Ok(Self { filter, period: configuration.experiment.step_size, longest: configuration.period_max })
    }

    /// The filter: to look at.
    pub(crate) fn filter(&self) -> &FilterLoop {
        &self.filter
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
        let hold = self.hold(t);
        self.filter.step(t, hold, x, u_ref, u)
    }

    /// For how long in s the input at `t` is going to be held where nobody says so: as long as the one before was, but no
    /// shorter than the longest that is configured.
    fn hold(&self, t: f64) -> f64 {
        let FilterLoop::Assured(assured) = &self.filter else { return self.period };
        let before = assured.last_hold().unwrap_or(self.period.max(self.longest));
        let passed = assured.filter().state().time.map_or(before, |last| t - last).max(self.longest);
        // Not-a-number is no time.
        let is_other = (passed - before).abs() > ROUND_OFF * t.abs().max(before);
        if passed > 0.0 && passed.is_finite() && is_other { passed } else { before }
    }

    /// Starts every deadline anew; the integrated input stays.
    pub(crate) fn rearm(&mut self) {
        self.filter.rearm();
    }

    /// What is remembered.
    pub(crate) fn memory(&self) -> LoopState {
        self.filter.state()
    }

    /// Writes the memory to `memory`; only a plan allocates.
    pub(crate) fn save(&self, memory: &mut LoopState) {
        self.filter.save(memory);
    }

    /// Goes back to a memory: every bit that follows is the same.
    ///
    /// # Errors
    ///
    /// The memory of another configuration.
    pub(crate) fn restore(&mut self, memory: &LoopState) -> Result<(), punctual_core::Error> {
        self.filter.restore(memory)
    }
}
