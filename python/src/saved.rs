//! What `pickle` and `copy` keep of a filter: its configuration and its memory.

use std::ffi::OsString;
use std::path::Path;

use punctual_core::filter::FilterState;
use punctual_fmu::configuration::{Configuration, FilterConfiguration};
use pyo3::prelude::*;

use crate::loading::{parse, refused};

const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The version of the package; the configuration as TOML with every value stated; the folder of its plug-in, empty
/// without one; and a memory for each loop, in the format of the crate postcard.
pub(crate) type Saved = (String, String, OsString, Vec<Vec<u8>>);

/// What `pickle` asks for: a function of this module, and the arguments with which it makes the object again.
pub(crate) type Reduced<'py, T> = (Bound<'py, PyAny>, T);

/// The function called `name`, and its arguments.
pub(crate) fn reduced<'py, T>(py: Python<'py>, name: &str, arguments: T) -> PyResult<Reduced<'py, T>> {
    Ok((py.import("punctual._punctual")?.getattr(name)?, arguments))
}

/// Writes a filter of this configuration.
pub(crate) fn save(configuration: &FilterConfiguration, memories: &[FilterState]) -> PyResult<Saved> {
    let configuration = Configuration::Filter(configuration.clone());
    let folder = configuration.plugin().and_then(|plugin| plugin.path.parent()).unwrap_or(Path::new(""));
    let text = configuration.canonical().map_err(|e| refused(&e))?;
    let bytes = |memory: &FilterState| postcard::to_stdvec(memory).map_err(|e| refused(&e));
    let memories = memories.iter().map(bytes).collect::<PyResult<_>>()?;
    Ok((VERSION.to_owned(), text, folder.into(), memories))
}

/// Reads what [`save`] wrote. A plug-in must still be where it was, with the same bytes.
///
/// # Errors
///
/// The version is another one; the plug-in cannot be used; bytes that are no memory.
pub(crate) fn load(saved: Saved) -> PyResult<(FilterConfiguration, Vec<FilterState>)> {
    let (version, text, folder, memories) = saved;
    if version != VERSION {
        let message = format!(
            "version: the filter was pickled by punctual {version}, must be {VERSION}; create it again from its configuration"
        );
        return Err(refused(&message));
    }
    let configuration = parse(&text, folder.into(), "")?;
    let memory = |bytes: Vec<u8>| {
        postcard::from_bytes(&bytes).map_err(|e| refused(&format!("memory: cannot be read: {e}")))
    };
    let memories = memories.into_iter().map(memory).collect::<PyResult<_>>()?;
    Ok((configuration, memories))
}
