//! `Plan`: what keeps the promise of a filter that follows plans.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use punctual_core::filter::Filter;
use punctual_core::plan::BackupPlan;
use punctual_fmu::configuration::FilterConfiguration;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays;
use crate::loading::{self, Signals, refused};

/// Points of the way, at least.
const POINTS: f64 = 200.0;

/// A verified way to keep every promise from the last step on, whatever u_ref is. The last input is held for ever, or the
/// plan ends with it.
#[pyclass(frozen, module = "punctual")]
pub(crate) struct Plan {
    configuration: FilterConfiguration,
    states: Signals,
    inputs: Signals,
    /// The barriers that it keeps: the place in the filter, the instant of the deadline if that is still to come.
    kept: Vec<(usize, Option<f64>)>,
    barriers: Signals,
    /// Times on the way in s, shape (n,); the plant is at an equilibrium from the last on, or the plan ends there.
    #[pyo3(get)]
    times: Py<PyArray1<f64>>,
    /// The states then, shape (n, states).
    #[pyo3(get)]
    x: Py<PyArray2<f64>>,
    /// The inputs held from then until the next time, shape (n, inputs).
    #[pyo3(get)]
    u: Py<PyArray2<f64>>,
    /// h of the barriers that it keeps, shape (n, barriers).
    #[pyo3(get)]
    h: Py<PyArray2<f64>>,
    /// Time in s until which it keeps every promise: `inf` where it ends at an equilibrium.
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
    /// The plan of `filter`, made of `configuration`, from its last sample, `x` at `t`, if it has one.
    pub(crate) fn of(
        py: Python<'_>,
        filter: &Filter,
        (t, x): (f64, &[f64]),
        configuration: &FilterConfiguration,
    ) -> PyResult<Option<Self>> {
        let (Some(backup_plan), Some(planning)) = (filter.plan(), filter.planning()) else { return Ok(None) };
        let BackupPlan { inputs: holds, tightest, effort, until, .. } = backup_plan;
        // An integrated input is a state of the way, and its rate the input.
        let states = Signals::of(configuration.plant.states());
        let inputs = Signals::of(configuration.plant.inputs());
        let end = holds.last().map_or(t, |(end, _)| *end);
        let way = planning.trajectory(backup_plan, t, x, ((end - t) / POINTS).max(f64::MIN_POSITIVE));
        let reports = filter.report().barriers.iter().enumerate().filter(|(_, report)| report.guaranteed);
        let to_come = |left: f64| Some(filter.report().time + left).filter(|at| left > 0.0 && at.is_finite());
        let kept: Vec<_> = reports.map(|(i, report)| (i, to_come(report.time_left))).collect();
        let unit = |&(i, _): &(usize, _)| {
            let barrier = &configuration.barrier[i];
            (barrier.name.clone(), barrier.unit(&configuration.plant))
        };
        let barriers = Signals::new(kept.iter().map(unit));
        let (mut h, mut values) = (Vec::new(), vec![0.0; filter.barrier_names().count()]);
        for (t, x, _) in &way {
            filter.barrier_values(*t, x, &mut values).map_err(|e| refused(&e))?;
            h.extend(kept.iter().map(|(i, _)| values[*i]));
        }
        let times: Vec<f64> = way.iter().map(|(t, ..)| *t).collect();
        let places: Vec<f64> = way.iter().flat_map(|(_, x, _)| x.iter().copied()).collect();
        let held: Vec<f64> = way.iter().flat_map(|(.., u)| u[..inputs.len()].iter().copied()).collect();
        let count = times.len();
        let name = |barrier: usize| filter.barrier_names().nth(barrier).unwrap_or_default().to_owned();
        Ok(Some(Self {
            times: times.into_pyarray(py).unbind(),
            x: places.into_pyarray(py).reshape([count, states.len()])?.unbind(),
            u: held.into_pyarray(py).reshape([count, inputs.len()])?.unbind(),
            h: h.into_pyarray(py).reshape([count, kept.len()])?.unbind(),
            until: *until,
            effort: *effort,
            tightest: tightest.map(|at| (name(at.barrier), at.time, at.slack)),
            configuration: configuration.clone(),
            states,
            inputs,
            kept,
            barriers,
        }))
    }
}

#[pymethods]
impl Plan {
    /// The states, the columns of `x`, in order: name to unit. An integrated input is one of them.
    #[getter]
    fn states<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.states.dict(py)
    }

    /// The inputs, the columns of `u`, in order: name to unit.
    #[getter]
    fn inputs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.inputs.dict(py)
    }

    /// The barriers that it keeps, the columns of `h`, in order: name to unit of h.
    #[getter]
    fn barriers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.barriers.dict(py)
    }

    /// The deadlines that are still to come, by barrier: the instant in s.
    #[getter]
    fn deadlines<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for (name, (_, deadline)) in self.barriers.names.iter().zip(&self.kept) {
            if let Some(at) = deadline {
                dict.set_item(name, at)?;
            }
        }
        Ok(dict)
    }

    /// The least and the largest value of each input.
    #[getter]
    fn bounds<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        loading::bounds(py, &self.configuration, &self.inputs.names)
    }

    /// h of the barriers that it keeps at time `t` (s) and other states, real numbers of shape (m, states): shape (m, barriers).
    ///
    /// Raises `TypeError` or `ValueError` for an array of another type or shape.
    fn values<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        x: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let states = self.states.len();
        let places = arrays::rows(x, "x", &self.states.names)?;
        let count = places.len() / states;
        let filter = self.configuration.build().map_err(|e| refused(&e))?;
        let (mut h, mut values) = (Vec::new(), vec![0.0; self.configuration.barrier.len()]);
        for row in places.chunks(states) {
            filter.barrier_values(t, row, &mut values).map_err(|e| refused(&e))?;
            h.extend(self.kept.iter().map(|(i, _)| values[*i]));
        }
        h.into_pyarray(py).reshape([count, self.kept.len()])
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let times = self.times.bind(py).readonly();
        let end = times.as_slice()?.last().copied().unwrap_or(f64::NAN);
        let ending = if self.until.is_finite() { "until" } else { "at an equilibrium from" };
        Ok(format!("Plan({ending} t={end}, effort={})", self.effort))
    }
}
