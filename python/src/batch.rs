//! `FilterBatch`: many loops of one configuration, a row of the arrays each.

use std::sync::{Mutex, PoisonError};

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use punctual_core::filter::FilterState;
use punctual_fmu::configuration::FilterConfiguration;
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::loading::{self, Interface, Signals, configuration, refused};
use crate::sample::{Loop, forwards};
use crate::saved::{self, Reduced, Saved};
use crate::{arrays, pool};

/// Rows go to threads in parts of equal size. There are more parts than threads, since some rows take longer than
/// others.
const PARTS_PER_THREAD: usize = 4;

/// The fewest rows of a part: fewer are done before another thread wakes up.
const LEAST_ROWS: usize = 16;

/// Safe inputs, statuses and h, row after row.
type Rows<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<i32>>, Bound<'py, PyArray2<f64>>);

/// `n` independent loops with filters of one configuration, each with its own memory: row i of every array belongs
/// to loop i, and gives the same bits as a `Filter` of its own would.
///
/// `configuration` is as for `Filter`; `n` >= 1. Rows are computed on all cores (`RAYON_NUM_THREADS`: on so many)
/// without the interpreter's lock. It can be pickled and copied as a `Filter` can.
#[pyclass(module = "punctual")]
pub(crate) struct FilterBatch {
    configuration: FilterConfiguration,
    interface: Interface,
    memories: Vec<FilterState>,
    fresh: FilterState,
    /// Loops, one for each part. The memory of a row is put into its loop before each row.
    // A lock for the compiler's sake: Python lends the object to one call at a time.
    loops: Mutex<Vec<Loop>>,
    t: Vec<f64>,
    x: Vec<f64>,
    u_ref: Vec<f64>,
    /// Whether a plan keeps the promise of each barrier after the last step, row after row.
    guaranteed: Vec<bool>,
}

#[pymethods]
impl FilterBatch {
    #[new]
    fn new(configuration: &Bound<'_, PyAny>, n: &Bound<'_, PyAny>) -> PyResult<Self> {
        let n = arrays::count(n, "n")?;
        let py = configuration.py();
        let configuration = self::configuration(configuration)?;
        loading::warn(py, &configuration)?;
        Self::of(configuration, n)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py, (Saved, Vec<bool>)>> {
        let saved = saved::save(&self.configuration, &self.memories)?;
        saved::reduced(py, "unpickled_batch", (saved, self.guaranteed.clone()))
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

    /// Whether a backup plan keeps the promise of each barrier whatever u_ref is, an array of bool of shape
    /// (n, barriers). False before a row's first step, and from `rearm` or `reset` until its next.
    #[getter]
    fn guaranteed<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let shape = [self.memories.len(), self.interface.barriers.len()];
        PyArray1::from_slice(py, &self.guaranteed).reshape(shape)
    }

    fn __len__(&self) -> usize {
        self.memories.len()
    }

    /// Columns of `x`: name to unit.
    #[getter]
    fn states<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.interface.states.dict(py)
    }

    /// Columns of `u` and `u_ref`: name to unit.
    #[getter]
    fn inputs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.interface.inputs.dict(py)
    }

    /// Columns of `h`: name to unit.
    #[getter]
    fn barriers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.interface.barriers.dict(py)
    }

    /// Computes the safe inputs of all loops at time `t` (s) and remembers the samples.
    ///
    /// - `t`: one time for all, or one for each loop: real numbers of shape (n,).
    /// - `x`: the states, an array of real numbers of shape (n, states). One of float64 is the fastest.
    /// - `u_ref`: the inputs wanted, of shape (n, inputs), likewise. Default: zeros.
    ///
    /// Returns `u` of shape (n, inputs), the numbers of the statuses (`punctual.Status`) of shape (n,) and `h` of shape
    /// (n, barriers). Raises `TypeError` or `ValueError` for an array of another type or shape, and for a row's time before that of
    /// its last step, before any row is computed.
    #[pyo3(signature = (t, x, u_ref=None))]
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        t: &Bound<'py, PyAny>,
        x: &Bound<'py, PyAny>,
        u_ref: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Rows<'py>> {
        let n = self.memories.len();
        let Interface { states, inputs, barriers } = &self.interface;
        arrays::times(t, &mut self.t)?;
        arrays::numbers(x, "x", &[n, states.len()], &states.names, &mut self.x)?;
        match u_ref {
            Some(u_ref) => {
                arrays::numbers(u_ref, "u_ref", &[n, inputs.len()], &inputs.names, &mut self.u_ref)?;
            }
            None => self.u_ref.fill(0.0),
        }
        for (row, (memory, t)) in self.memories.iter().zip(&self.t).enumerate() {
            forwards(memory.time, *t, Some(row))?;
        }
        let threads = pool::threads(py)?;
        let most = PARTS_PER_THREAD * threads.current_num_threads();
        let rows = n.div_ceil(most).max(LEAST_ROWS);
        let loops = self.loops.get_mut().unwrap_or_else(PoisonError::into_inner);
        while loops.len() < n.div_ceil(rows) {
            loops.push(Loop::new(&self.configuration)?);
        }
        let [nx, nu, nb] = [states, inputs, barriers].map(Signals::len);
        let (mut u, mut statuses, mut h) = (vec![0.0; n * nu], vec![0; n], vec![0.0; n * nb]);
        let given = self.t.chunks(rows).zip(self.x.chunks(rows * nx)).zip(self.u_ref.chunks(rows * nu));
        let said = u.chunks_mut(rows * nu).zip(statuses.chunks_mut(rows)).zip(h.chunks_mut(rows * nb));
        let said = said.zip(self.guaranteed.chunks_mut(rows * nb));
        let mut parts: Vec<_> = (loops.iter_mut().zip(self.memories.chunks_mut(rows)))
            .zip(given.zip(said))
            .map(|((own, memories), (((t, x), u_ref), (((u, statuses), h), guaranteed)))| Part {
                own,
                memories,
                t,
                x,
                u_ref,
                u,
                statuses,
                h,
                guaranteed,
            })
            .collect();
        let done = py.detach(|| match &mut parts[..] {
            [one] => one.step(),
            parts => threads.install(|| parts.par_iter_mut().try_for_each(Part::step)),
        });
        done.map_err(|e| refused(&e))?;
        let (u, h) = (u.into_pyarray(py).reshape([n, nu])?, h.into_pyarray(py).reshape([n, nb])?);
        Ok((u, statuses.into_pyarray(py), h))
    }

    /// Restarts every deadline at the next step: of all loops, or of those where `rows`, an array of bool of
    /// shape (n,), is true.
    #[pyo3(signature = (rows=None))]
    fn rearm(&mut self, rows: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let chosen = self.chosen(rows)?;
        let own = &mut self.loops.get_mut().unwrap_or_else(PoisonError::into_inner)[0];
        for (memory, _) in self.memories.iter_mut().zip(&chosen).filter(|(_, chosen)| **chosen) {
            own.restore(memory).map_err(|e| refused(&e))?;
            own.rearm();
            memory.clone_from(own.memory());
        }
        self.revoke(&chosen);
        Ok(())
    }

    /// Forgets every sample: of all loops, or of those where `rows`, an array of bool of shape (n,), is true.
    /// Unlike `rearm`, this sets an integrated input back too.
    #[pyo3(signature = (rows=None))]
    fn reset(&mut self, rows: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let chosen = self.chosen(rows)?;
        for (memory, _) in self.memories.iter_mut().zip(&chosen).filter(|(_, chosen)| **chosen) {
            memory.clone_from(&self.fresh);
        }
        self.revoke(&chosen);
        Ok(())
    }
}

impl FilterBatch {
    /// `n` loops before their first samples.
    fn of(configuration: FilterConfiguration, n: usize) -> PyResult<Self> {
        let interface = Interface::of(&configuration);
        let own = Loop::new(&configuration)?;
        let fresh = own.memory().clone();
        Ok(Self {
            memories: filled(&fresh, [n, 1])?,
            fresh,
            loops: Mutex::new(vec![own]),
            t: filled(&0.0, [n, 1])?,
            x: filled(&0.0, [n, interface.states.len()])?,
            u_ref: filled(&0.0, [n, interface.inputs.len()])?,
            guaranteed: filled(&false, [n, interface.barriers.len()])?,
            configuration,
            interface,
        })
    }

    /// What the chosen rows had promised is over.
    fn revoke(&mut self, chosen: &[bool]) {
        let barriers = self.interface.barriers.len();
        for (i, _) in chosen.iter().enumerate().filter(|(_, chosen)| **chosen) {
            self.guaranteed[i * barriers..][..barriers].fill(false);
        }
    }

    /// The rows that a mask chooses; without a mask, all.
    fn chosen(&self, rows: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<bool>> {
        let n = self.memories.len();
        let mut chosen = vec![true; n];
        if let Some(rows) = rows {
            arrays::mask(rows, "rows", &mut chosen)?;
        }
        Ok(chosen)
    }
}

/// `rows` times `each` copies of `value`.
fn filled<T: Clone>(value: &T, [rows, each]: [usize; 2]) -> PyResult<Vec<T>> {
    let mut all = Vec::new();
    let count = rows.saturating_mul(each);
    all.try_reserve_exact(count)
        .map_err(|_| PyMemoryError::new_err(format!("n: is {rows}, more rows than there is memory for")))?;
    all.resize(count, value.clone());
    Ok(all)
}

/// Rows that one loop computes, one after the other.
struct Part<'a> {
    own: &'a mut Loop,
    memories: &'a mut [FilterState],
    t: &'a [f64],
    x: &'a [f64],
    u_ref: &'a [f64],
    u: &'a mut [f64],
    statuses: &'a mut [i32],
    h: &'a mut [f64],
    guaranteed: &'a mut [bool],
}

impl Part<'_> {
    fn step(&mut self) -> Result<(), punctual_core::Error> {
        let n = self.memories.len();
        let [nx, nu, nb] = [self.x.len(), self.u.len(), self.h.len()].map(|all| all / n);
        for (i, memory) in self.memories.iter_mut().enumerate() {
            let (x, u_ref) = (&self.x[i * nx..][..nx], &self.u_ref[i * nu..][..nu]);
            self.own.restore(memory)?;
            let report = self.own.step(self.t[i], x, u_ref, &mut self.u[i * nu..][..nu])?;
            self.statuses[i] = report.status as i32;
            for (k, barrier) in report.barriers.iter().enumerate() {
                self.h[i * nb + k] = barrier.h;
                self.guaranteed[i * nb + k] = barrier.guaranteed;
            }
            memory.clone_from(self.own.memory());
        }
        Ok(())
    }
}

/// The batch that was pickled, and the guarantees of its last step.
#[pyfunction]
pub(crate) fn unpickled_batch(saved: Saved, guaranteed: Vec<bool>) -> PyResult<FilterBatch> {
    let (configuration, memories) = saved::load(saved)?;
    let mut batch = FilterBatch::of(configuration, memories.len())?;
    let own = &mut batch.loops.get_mut().unwrap_or_else(PoisonError::into_inner)[0];
    for memory in &memories {
        own.restore(memory).map_err(|e| refused(&e))?;
    }
    Ok(FilterBatch { memories, guaranteed, ..batch })
}
