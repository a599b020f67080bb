//! The verdict on a promise, from a recorded run.

use punctual_core::filter::{Phase, Status};
use punctual_core::judge::{Interpolation, Judge, PromiseState, Verdict};
use punctual_fmu::configuration::over_seconds;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Judges a barrier by its h at the instants of a run: rows of (time, h, phase, deadline_unreachable, status).
/// `units` are those of h and of its slack, which tell the relative degree 1 from others.
#[pyfunction]
pub(crate) fn judge<'py>(
    py: Python<'py>,
    rows: Vec<(f64, f64, i32, bool, i32)>,
    deadline: Option<f64>,
    units: (String, String),
) -> PyResult<Bound<'py, PyDict>> {
    if let Some(deadline) = deadline.filter(|deadline| deadline.is_nan() || *deadline <= 0.0) {
        return Err(PyValueError::new_err(format!("deadline: is {deadline}, must be > 0")));
    }
    let (of_h, of_slack) = units;
    let straight = over_seconds(&of_h, 1) == of_slack;
    let mut judge =
        Judge::new(deadline, if straight { Interpolation::Straight } else { Interpolation::Smooth });
    let mut started = false;
    for (t, h, phase, lost, status) in rows {
        started |= !Status::from_number(status).is_some_and(Status::is_abstention);
        let is = |wanted: Phase| phase == wanted as i32;
        let promise_state = match () {
            () if is(Phase::Released) => PromiseState::Released,
            () if is(Phase::Waiting) => PromiseState::Waiting,
            () => PromiseState::InForce,
        };
        if started {
            judge.see(t, h, promise_state, lost || is(Phase::Late));
        }
    }
    let seen = judge.judgement();
    let word = match seen.verdict() {
        Verdict::Kept => "kept",
        Verdict::Broken => "broken",
        Verdict::Open => "open",
        Verdict::Nothing => "nothing_promised",
        Verdict::LetGo => "let_go",
    };
    let said = PyDict::new(py);
    said.set_item("promise", word)?;
    said.set_item("deadline", seen.deadline)?;
    said.set_item("began_inside", seen.began_inside)?;
    said.set_item("on_time", seen.on_time())?;
    said.set_item("inside", seen.inside())?;
    said.set_item("arrival", seen.arrival)?;
    said.set_item("late", seen.late)?;
    said.set_item("late_by", seen.late_by())?;
    said.set_item("left", seen.left)?;
    said.set_item("least_h", seen.least)?;
    Ok(said)
}
