//! Plug-ins of configurations. A child process, which may crash, tries them before this one loads them.

use std::path::{Path, PathBuf};
use std::time::Duration;

use punctual_fmu::configuration::{Configuration, Plugin, PluginLoader};
use punctual_fmu::{PluginFolder, plugin_file_name};

use crate::error::Error;
use crate::host::journal;
use crate::isolation::{self, Child, End, Voice};
use crate::text;

/// The hidden command that the child runs.
pub const COMMAND: &str = "try-plugin";

/// Time limit for the trial of a plug-in.
const LIMIT: Duration = Duration::from_secs(20);

fn folder(configuration: &Path) -> PathBuf {
    configuration.parent().unwrap_or(Path::new("")).to_owned()
}

/// Loads plug-ins from the folder of a configuration file after trying them in a child process.
pub(super) struct Tried<'a> {
    configuration: &'a Path,
    folder: PluginFolder,
}

impl<'a> Tried<'a> {
    pub(super) fn of(configuration: &'a Path) -> Self {
        Self { configuration, folder: PluginFolder::new(folder(configuration)) }
    }
}

impl PluginLoader for Tried<'_> {
    fn digest(&self, name: &str) -> Result<(String, String), String> {
        self.folder.digest(name)
    }

    fn load(&self, name: &str) -> Result<Plugin, String> {
        let tried = || {
            let child = Child::new()?;
            let words = [COMMAND.into(), "--".into(), self.configuration.into(), child.folder().into()];
            child.run(words, Voice::Silent, Some(LIMIT))
        };
        // If the child refuses a plug-in, it is refused here with the same message.
        if let End::Broken { how, last } = tried().map_err(|e| e.to_string())? {
            let place = last.map_or_else(String::new, |last| format!(" in {}", last.call));
            let file = plugin_file_name(name);
            return Err(format!("{file} {how}{place}, when it was tried in a separate process"));
        }
        self.folder.load(name)
    }
}

/// Reads the configuration at `path` with the plug-ins that `loader` loads.
pub(super) fn read(path: &Path, loader: &dyn PluginLoader) -> Result<Configuration, Error> {
    let text = text::read(path)?;
    Configuration::parse_with(&text, loader).map_err(|e| Error::from(e).in_file(path))
}

/// Runs in the child: reads the configuration at `path` with its plug-in, and unloads the plug-in again.
///
/// # Errors
///
/// The folder cannot be written to; a configuration that cannot be used.
pub fn perform(path: &Path, place: &Path) -> Result<(), Error> {
    isolation::settle(place)?;
    let watch = |file: &Path, what: &str| journal::entering(what, "", file, None);
    let read = read(path, &PluginFolder::new(folder(path)).watched(watch));
    journal::entering("its unloading", "", path, None);
    let done = read.map(drop);
    journal::finish();
    done
}
