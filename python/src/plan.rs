//! `Plan`: what keeps the promise of a filter that follows plans.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use punctual_core::plan::Witness;
use punctual_fmu::FilterLoop;
use pyo3::prelude::*;

use crate::loading::Interface;

/// Points of the way, at least.
const POINTS: f64 = 200.0;

/// A verified way to keep every promise from the last step on, whatever u_ref is. The last input is held for ever, or the
/// plan ends with it.
#[pyclass(frozen, module = "punctual")]
pub(crate) struct Plan {
    /// Names of the states, the columns of `x`.
    #[pyo3(get)]
    states: Vec<String>,
    /// Names of the inputs, the columns of `u`.
    #[pyo3(get)]
    inputs: Vec<String>,
    /// Times on the way in s, shape (n,); the plant is at rest from the last on, or the plan ends there.
    #[pyo3(get)]
    times: Py<PyArray1<f64>>,
    /// The states then, shape (n, states).
    #[pyo3(get)]
    x: Py<PyArray2<f64>>,
    /// The inputs held from then until the next time, shape (n, inputs).
    #[pyo3(get)]
    u: Py<PyArray2<f64>>,
    /// Time in s until which it keeps every promise: `inf` where it ends at rest.
    #[pyo3(get)]
    until: f64,
    /// The largest input on the way after the first, as a part of its bounds, 0 to 1.
    #[pyo3(get)]
    effort: f64,
    /// The barrier with the least h above its margin, the time in s, and that h.
    #[pyo3(get)]
    tightest: Option<(String, f64, f64)>,
}

impl Plan {
    /// The plan of `filter` from its last sample, `x` at `t`, if it has one.
    pub(crate) fn of(
        py: Python<'_>,
        filter: &FilterLoop,
        (t, x): (f64, &[f64]),
        interface: &Interface,
    ) -> PyResult<Option<Self>> {
        let (Some(witness), FilterLoop::Assured(assured)) = (filter.plan(), filter) else { return Ok(None) };
        let Witness { inputs: holds, tightest, effort, until, .. } = witness;
        let inputs = interface.inputs.len();
        let end = holds.last().map_or(t, |(end, _)| *end);
        let way = assured.way(witness, t, x, ((end - t) / POINTS).max(f64::MIN_POSITIVE));
        let times: Vec<f64> = way.iter().map(|(t, ..)| *t).collect();
        let states: Vec<f64> = way.iter().flat_map(|(_, x, _)| x.iter().copied()).collect();
        let held: Vec<f64> = way.iter().flat_map(|(.., u)| u[..inputs].iter().copied()).collect();
        let count = times.len();
        let name =
            |barrier: usize| assured.filter().barrier_names().nth(barrier).unwrap_or_default().to_owned();
        Ok(Some(Self {
            states: interface.states.names.clone(),
            inputs: interface.inputs.names.clone(),
            times: times.into_pyarray(py).unbind(),
            x: states.into_pyarray(py).reshape([count, x.len()])?.unbind(),
            u: held.into_pyarray(py).reshape([count, inputs])?.unbind(),
            until: *until,
            effort: *effort,
            tightest: tightest.map(|at| (name(at.barrier), at.time, at.slack)),
        }))
    }
}

#[pymethods]
impl Plan {
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let times = self.times.bind(py).readonly();
        let end = times.as_slice()?.last().copied().unwrap_or(f64::NAN);
        let ending = if self.until.is_finite() { "until" } else { "at rest from" };
        Ok(format!("Plan({ending} t={end}, effort={})", self.effort))
    }
}
