//! Finding the prebuilt shared library that every FMU contains.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::error::Error;

/// The environment variable that names the library's file.
pub const VARIABLE: &str = "PUNCTUAL_FMU_LIBRARY";

/// Reads the shared library: `given` if there is one, else the one that [`VARIABLE`] names, else the one beside
/// this executable (an installed `punctual`), in its `deps/` folder (`cargo run`), or in `../lib/`. Of several
/// the newest is taken, which matters in a build folder only.
///
/// # Errors
///
/// A file that cannot be read, or no library anywhere.
pub fn read(given: Option<&Path>) -> Result<Vec<u8>, Error> {
    let named = || std::env::var_os(VARIABLE).filter(|name| !name.is_empty()).map(PathBuf::from);
    let path = match given.map(Path::to_owned).or_else(named) {
        Some(path) => path,
        None => find()?,
    };
    std::fs::read(&path).map_err(|e| Error::io("read", &path, e))
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
