//! One loop: a filter, and all that it remembers between samples.

use punctual_core::filter::{Filter, FilterState, Report};
use punctual_fmu::configuration::FilterConfiguration;
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
    filter: Filter,
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
    pub(crate) fn filter(&self) -> &Filter {
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
        if self.filter.counts_holds() {
            self.filter.expect_hold(Some(self.hold(t)))?;
        }
        self.filter.step(t, x, u_ref, u)
    }

    /// For how long in s the input at `t` is going to be held where nobody says so: as long as the one before was, but no
    /// shorter than the longest that is configured.
    fn hold(&self, t: f64) -> f64 {
        self.filter.usual_hold(t).map_or(self.period, |usual| usual.max(self.longest))
    }

    /// Restarts every deadline; the integrated input stays.
    pub(crate) fn rearm(&mut self) {
        self.filter.rearm();
    }

    /// What is remembered.
    pub(crate) fn memory(&self) -> &FilterState {
        self.filter.state()
    }

    /// Goes back to a memory: every bit that follows is the same.
    ///
    /// # Errors
    ///
    /// The memory of another configuration.
    pub(crate) fn restore(&mut self, memory: &FilterState) -> Result<(), punctual_core::Error> {
        self.filter.restore(memory)
    }
}
