//! `Filter`: one loop.

use std::sync::{Arc, Mutex, PoisonError};

use punctual_core::filter::{Assurance, AssuranceStatus, FilterState};
use punctual_fmu::configuration::FilterConfiguration;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::loading::{self, Interface, configuration, refused};
use crate::plan::Plan;
use crate::report::Step;
use crate::sample::{Loop, forwards};
use crate::saved::{self, Reduced, Saved};

/// A safety filter in this process. It computes the samples of the filter FMU of the same configuration, with the
/// same bits at the same times: those of the FMU are sums of its steps, so that `t += dt` has its bits, and `t = k * dt` may not.
///
/// `configuration` is the path of a TOML file or a dict with the same content, of `kind = "filter"`. In a dict a function
/// may replace an expression; it is called once, with symbols, and never in a step. A plug-in is loaded
/// from the folder of the file (of a dict: from the current folder), without the trial in a separate process that
/// `punctual.check` makes.
///
/// Raises `punctual.Error` for a configuration that cannot be used, with the field, the value and what is allowed.
///
/// It can be pickled and copied with all that it remembers; the copy goes on with the same bits. A plug-in is not in
/// a pickle: it must lie where it lay.
#[pyclass(module = "punctual")]
pub(crate) struct Filter {
    configuration: FilterConfiguration,
    interface: Interface,
    names: Arc<[String]>,
    // A lock for the compiler's sake: Python lends the object to one call at a time.
    own: Mutex<Loop>,
    fresh: FilterState,
    x: Vec<f64>,
    u_ref: Vec<f64>,
    u: Vec<f64>,
    /// Time of the last step with a valid state, in s, and that state.
    seen: (f64, Vec<f64>),
}

#[pymethods]
impl Filter {
    #[new]
    fn new(configuration: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = configuration.py();
        let configuration = self::configuration(configuration)?;
        loading::warn(py, &configuration)?;
        Self::of(configuration)
    }

    fn __reduce__<'py>(&mut self, py: Python<'py>) -> PyResult<Reduced<'py, (Saved, f64, Vec<f64>)>> {
        let memory = self.own.get_mut().unwrap_or_else(PoisonError::into_inner).memory();
        let saved = saved::save(&self.configuration, std::slice::from_ref(memory))?;
        let (t, x) = self.seen.clone();
        saved::reduced(py, "unpickled_filter", (saved, t, x))
    }

    /// The least and the largest value of each input that has bounds, by name, in its unit.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        loading::bounds(py, &self.configuration, &self.interface.inputs.names)
    }

    /// Time in s at which a run begins: `experiment.start_time`.
    #[getter]
    fn start_time(&self) -> f64 {
        self.configuration.experiment.start_time
    }

    /// Time in s for which the first input counts as held: `experiment.step_size`.
    #[getter]
    fn step_size(&self) -> f64 {
        self.configuration.experiment.step_size
    }

    /// Components of `x`, in order: name to unit. The measured states, then the inputs of barriers.
    #[getter]
    fn states<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.interface.states.dict(py)
    }

    /// Components of `u` and `u_ref`, in order: name to unit.
    #[getter]
    fn inputs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.interface.inputs.dict(py)
    }

    /// The barriers in order: name to unit of h.
    #[getter]
    fn barriers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.interface.barriers.dict(py)
    }

    /// Computes the safe input at time `t` (s) and remembers the sample. Deadlines count from the first step; the
    /// sampling period is the time between steps, at first `experiment.step_size`.
    ///
    /// - `x`: the state in the order of `states`, an array or a sequence of real numbers. Those of float64 are the fastest.
    /// - `u_ref`: the input wanted, in the order of `inputs`, likewise. Default: zeros.
    ///
    /// Raises `TypeError` or `ValueError` for an array of another type or shape, and for a time before that of the last step; the
    /// same time repeats the sample. Numerical outcomes (infeasible, not a number) are statuses.
    #[pyo3(signature = (t, x, u_ref=None))]
    fn step(
        &mut self,
        py: Python<'_>,
        t: &Bound<'_, PyAny>,
        x: &Bound<'_, PyAny>,
        u_ref: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Step> {
        let t = arrays::time(t)?;
        let Interface { states, inputs, .. } = &self.interface;
        arrays::numbers(x, "x", &[states.len()], &states.names, &mut self.x)?;
        match u_ref {
            Some(u_ref) => {
                arrays::numbers(u_ref, "u_ref", &[inputs.len()], &inputs.names, &mut self.u_ref)?;
            }
            None => self.u_ref.fill(0.0),
        }
        let own = self.own.get_mut().unwrap_or_else(PoisonError::into_inner);
        forwards(own.filter().state().time, t, None)?;
        own.step(t, &self.x, &self.u_ref, &mut self.u).map_err(|e| refused(&e))?;
        if t.is_finite() && self.x.iter().all(|x| x.is_finite()) {
            self.seen.0 = t;
            self.seen.1.copy_from_slice(&self.x);
        }
        Ok(Step::new(py, &self.u, own.filter(), &self.names))
    }

    /// The plan that keeps every promise from the last step on; `None` without one.
    #[getter]
    fn plan(&mut self, py: Python<'_>) -> PyResult<Option<Plan>> {
        let own = self.own.get_mut().unwrap_or_else(PoisonError::into_inner);
        Plan::of(py, own.filter(), (self.seen.0, &self.seen.1), &self.configuration)
    }

    /// Why there is no plan, where the promise was refused or lost, or has come to its end.
    #[getter]
    fn refusal(&mut self) -> Option<String> {
        let own = self.own.get_mut().unwrap_or_else(PoisonError::into_inner);
        let Assurance { status, failure, .. } = *own.filter().assurance()?;
        failure.map(|failure| match status {
            AssuranceStatus::Refused => self.configuration.refusal(failure),
            _ => self.configuration.failure(failure),
        })
    }

    /// Restarts every deadline at the next step with a valid state, which decides again on the promise. Where it finds no
    /// other plan, the current one will do if it keeps that; until then it is followed.
    fn rearm(&mut self) {
        self.own.get_mut().unwrap_or_else(PoisonError::into_inner).rearm();
    }

    /// Forgets every sample: the filter is as it was made. Unlike `rearm`, this sets an integrated input back
    /// too.
    fn reset(&mut self) -> PyResult<()> {
        let own = self.own.get_mut().unwrap_or_else(PoisonError::into_inner);
        own.restore(&self.fresh).map_err(|e| refused(&e))
    }
}

impl Filter {
    /// The filter before its first sample.
    fn of(configuration: FilterConfiguration) -> PyResult<Self> {
        let interface = Interface::of(&configuration);
        let own = Loop::new(&configuration)?;
        let (states, inputs) = (interface.states.len(), interface.inputs.len());
        Ok(Self {
            names: interface.barriers.names.clone().into(),
            fresh: own.memory().clone(),
            own: Mutex::new(own),
            x: vec![0.0; states],
            u_ref: vec![0.0; inputs],
            u: vec![0.0; inputs],
            seen: (0.0, vec![0.0; states]),
            interface,
            configuration,
        })
    }
}

/// The filter that was pickled, and the time and state of its last sample.
#[pyfunction]
pub(crate) fn unpickled_filter(saved: Saved, t: f64, x: Vec<f64>) -> PyResult<Filter> {
    let (configuration, memories) = saved::load(saved)?;
    let mut filter = Filter::of(configuration)?;
    let own = filter.own.get_mut().unwrap_or_else(PoisonError::into_inner);
    for memory in &memories {
        own.restore(memory).map_err(|e| refused(&e))?;
    }
    filter.seen = (t, x);
    Ok(filter)
}
