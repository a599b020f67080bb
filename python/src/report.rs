//! The report of a step, as Python objects.

use std::sync::Arc;

use numpy::PyArray1;
use punctual_core::filter::{self, AssuranceStatus, Filter, Phase, Reason, Status};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyType};

/// `punctual.Status`, `punctual.Phase` and `punctual.Assurance`, after their first use.
static STATUS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
static PHASE: PyOnceLock<Py<PyType>> = PyOnceLock::new();
static ASSURANCE: PyOnceLock<Py<PyType>> = PyOnceLock::new();

/// The member with this number of the enumeration called `name`.
fn member<'py>(
    py: Python<'py>,
    class: &PyOnceLock<Py<PyType>>,
    name: &str,
    number: i32,
) -> PyResult<Bound<'py, PyAny>> {
    class.import(py, "punctual._enumerations", name)?.call1((number,))
}

/// One barrier's part of a step, by the names of the outputs of the filter FMU.
#[pyclass(frozen, module = "punctual")]
pub(crate) struct BarrierReport {
    /// h now, in its own unit; not a number where the state is not.
    #[pyo3(get)]
    h: f64,
    /// The lower bound on h promised now, in the unit of h.
    #[pyo3(get)]
    profile: f64,
    /// Time to the deadline in s, 0 from the deadline on.
    #[pyo3(get)]
    time_left: f64,
    /// By how much the returned u meets the constraint; < 0 where it violates it.
    #[pyo3(get)]
    slack: f64,
    /// Whether h >= 0 has been reached since the deadline began to count.
    #[pyo3(get)]
    arrived: bool,
    /// Whether a backup plan keeps the promise, whatever u_ref is; only if the filter follows plans.
    #[pyo3(get)]
    guaranteed: bool,
    /// Whether the theorem behind the present phase applies so far.
    #[pyo3(get)]
    on_course: bool,
    phase: Phase,
    /// The margin in force, in the unit of h.
    #[pyo3(get)]
    margin_used: f64,
    /// Largest fall of h below its promise within the period because u is held, in the unit of h.
    #[pyo3(get)]
    sampling_loss: f64,
    /// Steps in a row that have not met the constraint, this one included.
    #[pyo3(get)]
    unmet_steps: u32,
    /// Number of times that the deadline was postponed to a later one.
    #[pyo3(get)]
    postponed: u32,
    /// Whether no input within the bounds has h >= 0 at the deadline.
    #[pyo3(get)]
    deadline_unreachable: bool,
    /// Whether other barriers block the way and h gets nowhere.
    #[pyo3(get)]
    deadlocked: bool,
}

#[pymethods]
impl BarrierReport {
    /// The phase of the barrier's promise.
    #[getter]
    fn phase<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        member(py, &PHASE, "Phase", self.phase as i32)
    }

    fn __repr__(&self) -> String {
        format!("BarrierReport(h={}, profile={}, time_left={})", self.h, self.profile, self.time_left)
    }
}

impl From<&filter::BarrierReport> for BarrierReport {
    fn from(b: &filter::BarrierReport) -> Self {
        Self {
            h: b.h,
            profile: b.profile,
            time_left: b.time_left,
            slack: b.slack,
            arrived: b.arrived,
            guaranteed: b.guaranteed,
            on_course: b.on_course,
            phase: b.phase,
            margin_used: b.margin,
            sampling_loss: b.sampling_loss,
            unmet_steps: b.unmet_steps,
            postponed: b.postponed,
            deadline_unreachable: b.deadline_unreachable,
            deadlocked: b.deadlocked,
        }
    }
}

/// Result of a step.
#[pyclass(frozen, module = "punctual")]
pub(crate) struct Step {
    /// The safe input, in the order of `Filter.inputs`: finite and within its bounds, whatever happens.
    #[pyo3(get)]
    u: Py<PyArray1<f64>>,
    status: Status,
    assurance_status: Option<AssuranceStatus>,
    /// Time in s until which every promise is kept, `inf` for ever; `None` where nothing is assured.
    #[pyo3(get)]
    assured_until: Option<f64>,
    reason: Option<Reason>,
    barriers: Vec<filter::BarrierReport>,
    names: Arc<[String]>,
}

impl Step {
    pub(crate) fn new(py: Python<'_>, u: &[f64], filter: &Filter, names: &Arc<[String]>) -> Self {
        let (report, assurance) = (filter.report(), filter.assurance());
        Self {
            u: PyArray1::from_slice(py, u).unbind(),
            status: report.status,
            assurance_status: assurance.map(|assurance| assurance.status),
            assured_until: assurance.and_then(|assurance| assurance.until),
            reason: assurance.and_then(|assurance| assurance.reason),
            barriers: report.barriers.clone(),
            names: Arc::clone(names),
        }
    }
}

#[pymethods]
impl Step {
    /// Outcome of the step, and so the meaning of `u`.
    #[getter]
    fn status<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        member(py, &STATUS, "Status", self.status as i32)
    }

    /// Status of the guarantee; `None` where no plans are followed.
    #[getter]
    fn assurance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.assurance_status
            .map(|assurance_status| member(py, &ASSURANCE, "Assurance", assurance_status as i32))
            .transpose()
    }

    /// Why u_ref was changed: the name of a barrier, and when in s it would be broken, or come nearest to its edge, had u_ref been
    /// held; `None` where it was not changed, or no plans are followed.
    #[getter]
    fn reason(&self) -> Option<(&str, f64)> {
        self.reason.and_then(|Reason { barrier, time }| Some((self.names.get(barrier)?.as_str(), time)))
    }

    /// Whether `u` satisfies every constraint, or has a plan behind it that keeps every promise.
    #[getter]
    fn satisfied(&self) -> bool {
        self.status.is_satisfied()
    }

    /// The report on each barrier, by its name.
    #[getter]
    fn barriers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for (name, barrier) in self.names.iter().zip(&self.barriers) {
            dict.set_item(name, BarrierReport::from(barrier))?;
        }
        Ok(dict)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let status = self.status(py)?.getattr("name")?;
        Ok(format!("Step(u={}, status={status})", self.u.bind(py).repr()?))
    }
}
