//! One file per subcommand: its arguments, and an `execute` that returns the exit code.

mod backup_plan;
pub mod build;
pub mod campaign;
pub mod check;
mod closed_loop;
pub mod demo;
pub mod identify;
pub mod inspect;
mod map;
pub mod merge;
pub mod new;
pub mod replay;
pub mod reproduce;
mod robustness;
pub mod run;
pub mod shell;
pub mod validate;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use punctual_cosim::error::Error;
use punctual_cosim::package;
use punctual_fmu::configuration::Configuration;

use crate::codes::INTERRUPTED;
use crate::output;

/// Reads a configuration file, and prints its warnings.
fn read(file: &Path) -> Result<Configuration, Error> {
    let configuration = package::read_configuration(file)?;
    if let Some(warning) = configuration.warning() {
        output::warning(&format!("{}: {warning}", file.display()));
    }
    Ok(configuration)
}

/// A flag that the first Ctrl-C sets; the second one ends the program immediately.
fn interruption() -> Result<Arc<AtomicBool>, Error> {
    let stop = Arc::new(AtomicBool::new(false));
    let handle = Arc::clone(&stop);
    let handler = move || {
        if handle.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(INTERRUPTED));
        }
    };
    ctrlc::set_handler(handler).map_err(|e| Error::broken("Ctrl-C", format!("cannot be caught: {e}")))?;
    Ok(stop)
}
