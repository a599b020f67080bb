//! The threads of this process.

use std::sync::{Mutex, PoisonError};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// The process, and its threads.
static POOL: Mutex<Option<(u32, &'static ThreadPool)>> = Mutex::new(None);

/// The threads of this process: one for each core, or as many as `RAYON_NUM_THREADS` says. A forked process,
/// which has none of its parent's threads, gets its own. They are taken while holding the interpreter, so that no
/// other thread can fork in between.
///
/// # Errors
///
/// Threads that cannot be started.
pub(crate) fn threads(_: Python<'_>) -> PyResult<&'static ThreadPool> {
    let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let own = std::process::id();
    match *pool {
        Some((process, threads)) if process == own => Ok(threads),
        _ => {
            let threads = ThreadPoolBuilder::new()
                .thread_name(|i| format!("punctual-{i}"))
                .build()
                .map_err(|e| PyRuntimeError::new_err(e.to_string()))?;
            // The pool lasts as long as the process; a parent's pool cannot be ended from here.
            let threads: &'static ThreadPool = Box::leak(Box::new(threads));
            *pool = Some((own, threads));
            Ok(threads)
        }
    }
}
