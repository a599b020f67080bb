//! One loop: a filter, and all that it remembers between samples.

use punctual_core::filter::Report;
use punctual_fmu::configuration::FilterConfiguration;
use punctual_fmu::{FilterLoop, LoopState};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::loading::refused;

/// Refuses a time `t` before that of the `last` sample; `row` is that of a batch.
///
/// # Errors
///
/// `ValueError`, with both times.
pub(crate) fn forwards(last: Option<f64>, t: f64, row: Option<usize>) -> PyResult<()> {
    match last {
        Some(last) if t < last => {
            let row = row.map(|row| format!(" in row {row}")).unwrap_or_default();
            Err(PyValueError::new_err(format!(
                "t: is {t} s{row}, must be at least {last} s, the time of the step before; to go back in time, call rearm() or \
                 reset() first"
            )))
        }
        _ => Ok(()),
    }
}

/// A filter with its integrator, if it has one: the computation of the FMU of the same configuration.
pub(crate) struct Loop {
    filter: FilterLoop,
    /// Time between steps in s, and the longest, as configured.
    period: f64,
    longest: f64,
}

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
        match &self.filter {
            FilterLoop::Assured(assured) => assured.usual_hold(t).max(self.longest),
            _ => self.period,
        }
    }

    /// Restarts every deadline; the integrated input stays.
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
