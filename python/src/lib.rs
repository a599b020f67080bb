//! The extension module `punctual._punctual`: a configuration as a filter that NumPy arrays go through, one
//! sample at a time or one for each row of many independent loops.
//!
//! The Python package around it, `punctual/`, has the command line, the FMUs and the types (`_punctual.pyi`).
//! The modules, each using only those above it:
//!
//! | module | owns |
//! |---|---|
//! | `arrays` | arguments that are arrays: type, shape, and the errors of those that do not fit |
//! | `loading` | a path or dict to a configuration and the names of its signals |
//! | `sample` | one loop: a filter, and its memory |
//! | `saved` | what `pickle` and `copy` keep of a filter |
//! | `promise` | the verdict on a promise in a recorded run |
//! | `report` | the report of a step, as Python objects |
//! | `plan` | the plan of a filter that follows plans |
//! | `units` | the units of two variables that are connected |
//! | `filter` | `Filter`: one loop |
//! | `pool` | the threads, one set for each process |
//! | `batch` | `FilterBatch`: many loops, a row each |
#![forbid(unsafe_code)]

mod arrays;
mod batch;
mod filter;
mod loading;
mod plan;
mod pool;
mod promise;
mod report;
mod sample;
mod saved;
mod units;

use pyo3::prelude::*;

/// The filter on NumPy arrays; the package `punctual` passes it on.
#[pymodule]
fn _punctual(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<filter::Filter>()?;
    module.add_class::<batch::FilterBatch>()?;
    module.add_class::<plan::Plan>()?;
    module.add_class::<report::Step>()?;
    module.add_class::<report::BarrierReport>()?;
    module.add_function(wrap_pyfunction!(promise::judge, module)?)?;
    module.add_function(wrap_pyfunction!(loading::vehicle, module)?)?;
    module.add_function(wrap_pyfunction!(units::fit_units, module)?)?;
    module.add_function(wrap_pyfunction!(filter::unpickled_filter, module)?)?;
    module.add_function(wrap_pyfunction!(batch::unpickled_batch, module)?)?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))
}
