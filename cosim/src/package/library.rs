//! Finds the prebuilt shared library that every FMU contains.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use punctual_fmu::configuration::FmiVersion;
use punctual_fmu::product::MARK;

use crate::error::Error;
use crate::host::{PLATFORM, Version};
use crate::validate::layout::ending;
use crate::validate::symbols;

/// The environment variable that names the library's file.
pub const VARIABLE: &str = "PUNCTUAL_FMU_LIBRARY";

/// A shared library that goes into an FMU.
#[derive(Clone, Debug)]
pub struct Library {
    /// Its folder below `binaries/`, such as `linux64`.
    pub platform: &'static str,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

impl Library {
    /// Its paths in the archive of an FMU of the version `fmi`, one for each processor that it supports.
    pub fn entries(&self, identifier: &str, fmi: FmiVersion) -> Vec<String> {
        // Every platform that a library can be for has a file extension.
        let ending = ending(Version::Fmi2, self.platform).unwrap_or(DLL_SUFFIX);
        let folders = match fmi {
            FmiVersion::Two => vec![self.platform],
            FmiVersion::Three => symbols::tuples(self.platform, &self.bytes),
        };
        folders.into_iter().map(|folder| format!("binaries/{folder}/{identifier}{ending}")).collect()
    }
}

/// Reads the shared libraries for an FMU. Each of those `given` is for the platform that its file says. If
/// none is given, takes the one that [`VARIABLE`] names, else the one beside this executable (an installed
/// `punctual`), in its `deps/` folder (`cargo run`), or in `../lib/`. If several of these places have one,
/// the newest is taken, which only matters in a build folder.
///
/// # Errors
///
/// A file that cannot be read, or is not the library for FMUs of this version; two for one platform; no
/// library anywhere.
pub fn read(given: &[PathBuf]) -> Result<Vec<Library>, Error> {
    let named = || std::env::var_os(VARIABLE).filter(|name| !name.is_empty()).map(PathBuf::from);
    let own = match (given, named()) {
        ([], Some(path)) => Some(path),
        ([], None) => Some(find()?),
        _ => None,
    };
    let mut libraries: Vec<Library> = Vec::new();
    for path in own.iter().chain(given) {
        let bytes = std::fs::read(path).map_err(|e| Error::io("read", path, e))?;
        let refused = |message: String| Error::configuration("library", message).in_file(path);
        let platform = symbols::platform(&bytes).map_err(refused)?;
        // A library for this platform is checked by running it; only others need the mark.
        if platform != PLATFORM && !bytes.windows(MARK.len()).any(|part| part == MARK.as_bytes()) {
            let message = format!("is not the library of \"{}\", which this program is", MARK.trim_end());
            return Err(refused(message));
        }
        if libraries.iter().any(|other| other.platform == platform) {
            return Err(refused(format!("is for {platform}, as one before it; give one for each platform")));
        }
        libraries.push(Library { platform, bytes });
    }
    libraries.sort_by_key(|library| library.platform);
    Ok(libraries)
}

fn find() -> Result<PathBuf, Error> {
    let name = format!("{DLL_PREFIX}punctual_fmu{DLL_SUFFIX}");
    let executable = std::env::current_exe().map_err(|e| Error::io("find", Path::new("punctual"), e))?;
    let folder = executable.parent().unwrap_or(Path::new(""));
    let candidates = ["", "deps", "../lib"].map(|place| folder.join(place).join(&name));
    let newest = candidates
        .iter()
        .filter_map(|path| Some((std::fs::metadata(path).and_then(|m| m.modified()).ok()?, path)))
        .max_by_key(|(time, _): &(SystemTime, _)| *time);
    newest.map(|(_, path)| path.clone()).ok_or_else(|| {
        let places: Vec<_> = candidates.iter().map(|path| path.display().to_string()).collect();
        let message = format!(
            "the shared library {name} is at none of {}; build it with `cargo build --release` or name it with \
             --library or {VARIABLE}",
            places.join(", ")
        );
        Error::configuration("library", message)
    })
}
