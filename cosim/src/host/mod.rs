//! A host for co-simulation FMUs of FMI 2.0 and 3.0: it unpacks, describes, loads, instantiates and calls
//! them. The only module of this crate with unsafe code. Its interface is safe as long as the FMU itself
//! follows the standard. It knows nothing of coupling.

mod archive;
mod bounds;
mod description;
mod fmi2;
mod fmi3;
mod handle;
pub mod journal;
mod library;
mod logging;
mod number;
mod participant;

use std::cell::{Cell, OnceCell};
use std::path::Path;
use std::rc::Rc;

pub use archive::{
    Archive, MAX_DESCRIPTION_BYTES, MAX_ENTRIES, MAX_FILE_BYTES, MAX_NAME_BYTES, MAX_RATIO,
    MAX_UNPACKED_BYTES, SMALL_BYTES, declared_encoding, is_latin,
};
#[cfg(test)]
pub(crate) use description::example;
pub(crate) use description::foreign_version;
pub use description::{
    Array, Description, Fmi2Description, Fmi3Description, Output, Variable, Version, Written,
};
pub use number::{DataType, Family, whole_range};
pub use participant::{Fresh, Participant, Saved, Slave};
pub use punctual_modeldescription::{Causality, DefaultExperiment, PLATFORM, Variability};

pub(crate) use library::crash_at_once;
use library::{Functions, Library};

use crate::error::{Error, FmuProblem};
pub use crate::status::{LogMessage, Status};

/// An FMU, with its archive unpacked and its description read. The library is loaded when first needed.
#[derive(Debug)]
pub struct Fmu {
    description: Rc<Description>,
    // Dropped before the archive, since the library must be unloaded before its file is removed.
    library: OnceCell<Library>,
    /// Set once an instance was abandoned in a state in which it may still be running.
    abandoned: Cell<bool>,
    archive: Archive,
}

impl Fmu {
    /// Unpacks and reads the FMU at `path`; none of its code is run.
    ///
    /// # Errors
    ///
    /// The file cannot be read, is not a sound archive, or its description is missing, malformed,
    /// not of FMI 2.0 or 3.0, or without a co-simulation interface that can be run.
    pub fn open(path: &Path) -> Result<Self, Error> {
        Self::of(Archive::open(path)?)
    }

    /// Reads the FMU in an unpacked archive.
    ///
    /// # Errors
    ///
    /// Its description is missing, malformed, not of FMI 2.0 or 3.0, or without a co-simulation interface that can be
    /// run.
    pub fn of(archive: Archive) -> Result<Self, Error> {
        let description = archive
            .model_description()
            .and_then(|text| Description::parse(&text))
            .map_err(|problem| Error::fmu(archive.source(), problem))?;
        let description = Rc::new(description);
        Ok(Self { description, library: OnceCell::new(), abandoned: Cell::new(false), archive })
    }

    /// The file it was read from.
    pub fn path(&self) -> &Path {
        self.archive.source()
    }

    /// Its model description.
    pub fn description(&self) -> &Rc<Description> {
        &self.description
    }

    /// The platforms that it has binaries for, such as `linux64`; sorted.
    pub fn platforms(&self) -> &[String] {
        self.archive.platforms()
    }

    /// Its shared library, loaded at the first call.
    fn library(&self) -> Result<&Library, Error> {
        if let Some(library) = self.library.get() {
            return Ok(library);
        }
        let version = self.description.version();
        let path = self.archive.library(version, &self.description.model_identifier);
        if !path.is_file() {
            let (wanted, platforms) = (version.platform(), self.archive.platforms());
            let problem = if platforms.iter().any(|platform| platform == wanted) {
                let folder = format!("binaries/{wanted}/");
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                let inside = |entry: &String| entry.strip_prefix(&folder).map(str::to_owned);
                let files = self.archive.entries().iter().filter_map(inside).filter(|e| !e.is_empty());
                FmuProblem::NoLibrary { wanted: format!("{folder}{name}"), present: files.take(8).collect() }
            } else {
                FmuProblem::NoBinary { wanted, present: platforms.to_vec() }
            };
            return Err(Error::fmu(self.path(), problem));
        }
        journal::entering("loading its library", "", self.path(), None);
        let library = Library::load(&path, version).map_err(|problem| Error::fmu(self.path(), problem))?;
        Ok(self.library.get_or_init(|| library))
    }

    /// The library's answers on its version, by function: `fmi2GetVersion` and `fmi2GetTypesPlatform`, or
    /// `fmi3GetVersion`. Loads the library.
    ///
    /// # Errors
    ///
    /// The library cannot be loaded, lacks a function, or is of another version.
    pub fn answers(&self) -> Result<&[(&'static str, String)], Error> {
        Ok(&self.library()?.answers)
    }

    /// Makes an instance called `name`; the first one loads the library. `description` is that of the FMU,
    /// with the array sizes that will be set.
    ///
    /// # Errors
    ///
    /// The FMU needs something that this program does not offer, the library cannot be loaded or lacks a
    /// function, `name` contains a zero byte, or the FMU refuses (its log says why).
    pub fn instantiate(
        self: &Rc<Self>,
        description: &Rc<Description>,
        name: &str,
    ) -> Result<Box<dyn Slave>, Error> {
        if let Some(reason) = description.obstacle() {
            return Err(Error::fmu(self.path(), FmuProblem::CannotRun(reason)));
        }
        let of = (Rc::clone(self), Rc::clone(description));
        Ok(match self.library()?.functions {
            Functions::Fmi2(functions) => Box::new(fmi2::Instance::new(of, functions, name)?),
            Functions::Fmi3(functions) => Box::new(fmi3::Instance::new(of, functions, name)?),
        })
    }

    /// The text of a file in its `resources/`; `None` if there is no such text.
    pub fn resource(&self, name: &str) -> Option<String> {
        let entry = format!("resources/{name}");
        let is_there = self.archive.entries().contains(&entry);
        is_there.then(|| std::fs::read_to_string(self.archive.path(&entry)).ok())?
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
