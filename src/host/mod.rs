//! A host for FMI 2.0 co-simulation FMUs: unpack, describe, load, instantiate, call. The only module of this
//! crate with unsafe code. All it offers is safe, as far as the FMU itself keeps to the standard. Knows nothing
//! of coupling.

mod archive;
mod bounds;
mod description;
pub mod journal;
mod library;
mod logging;
mod slave;

use std::cell::{Cell, OnceCell};
use std::path::Path;

pub use archive::{
    Archive, MAX_DESCRIPTION_BYTES, MAX_ENTRIES, MAX_FILE_BYTES, MAX_NAME_BYTES, MAX_RATIO,
    MAX_UNPACKED_BYTES, SMALL_BYTES, declared_encoding, is_latin,
};
pub use description::{Description, Output};
pub use logging::LogMessage;
pub use punctual_fmu::fmi2::Status;
pub use punctual_modeldescription::{
    Causality, DefaultExperiment, PLATFORM, ScalarType, Variability, Variable, VariableKind,
};
pub use slave::Slave;

use library::Library;
pub(crate) use library::crash_at_once;

use crate::error::{Error, FmuProblem};

/// An FMU: its archive unpacked, its description read, its library loaded when first needed.
#[derive(Debug)]
pub struct Fmu {
    description: Description,
    // Dropped before the archive: the library is unloaded before its file is removed.
    library: OnceCell<Library>,
    /// Set once an instance was left in a state in which it may still run: see [`Slave`].
    abandoned: Cell<bool>,
    archive: Archive,
}

impl Fmu {
    /// Unpacks and reads the FMU at `path`; nothing of it is run.
    ///
    /// # Errors
    ///
    /// The file cannot be read, is not a sound archive, or its description is missing, malformed,
    /// not of FMI 2.0, or without a co-simulation interface.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let archive = Archive::open(path)?;
        let description = archive
            .model_description()
            .and_then(|text| Description::parse(&text))
            .map_err(|problem| Error::fmu(path, problem))?;
        Ok(Self { description, library: OnceCell::new(), abandoned: Cell::new(false), archive })
    }

    /// The file it was read from.
    pub fn path(&self) -> &Path {
        self.archive.source()
    }

    /// Its model description.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// The platforms it has binaries for, such as `linux64`; sorted.
    pub fn platforms(&self) -> &[String] {
        self.archive.platforms()
    }

    /// Its shared library, loaded at the first call.
    fn library(&self) -> Result<&Library, Error> {
        if let Some(library) = self.library.get() {
            return Ok(library);
        }
        let path = self.archive.library(&self.description.co_simulation.model_identifier);
        if !path.is_file() {
            let present = self.archive.platforms().to_vec();
            return Err(Error::fmu(self.path(), FmuProblem::NoBinary { wanted: PLATFORM, present }));
        }
        journal::entering("loading its library", "", self.path(), None);
        let library = Library::load(&path).map_err(|problem| Error::fmu(self.path(), problem))?;
        Ok(self.library.get_or_init(|| library))
    }

    /// The answers of `fmi2GetVersion` and `fmi2GetTypesPlatform`; loads the library.
    ///
    /// # Errors
    ///
    /// The library cannot be loaded, lacks a function, or is not of FMI 2.
    pub fn answers(&self) -> Result<[(&'static str, &str); 2], Error> {
        let library = self.library()?;
        Ok([("fmi2GetVersion", &library.version), ("fmi2GetTypesPlatform", &library.types_platform)])
    }

    /// The text of a file in its `resources/`; `None` where there is no such text.
    pub fn resource(&self, name: &str) -> Option<String> {
        std::fs::read_to_string(self.archive.path(&format!("resources/{name}"))).ok()
    }

    fn resource_location(&self) -> String {
        self.archive.resource_location()
    }
}

impl Drop for Fmu {
    fn drop(&mut self) {
        match self.library.take() {
            // Its code may still be running, so it stays loaded.
            Some(library) if self.abandoned.get() => std::mem::forget(library),
            Some(library) => {
                journal::entering("unloading its library", "", self.archive.source(), None);
                drop(library);
            }
            None => {}
        }
    }
}
