//! `punctual build`: a filter or plant configuration becomes an FMU.

use std::path::PathBuf;
use std::process::ExitCode;

use crate::error::Error;
use crate::{output, package};

/// Arguments of `punctual build`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The configuration file (TOML): `kind = "filter"` or `kind = "plant"`
    configuration: PathBuf,
    /// The .fmu file to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// The shared library to put inside [default: the one beside this program]
    #[arg(long, value_name = "FILE")]
    library: Option<PathBuf>,
}

/// Builds the FMU and tries it.
///
/// # Errors
///
/// A configuration that cannot be used, a file that cannot be read or written, a product that does
/// not work.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let configuration = package::read_configuration(&arguments.configuration)?;
    let fmu = package::build(configuration, arguments.library.as_deref(), &arguments.output)?;
    let description = fmu.description();
    output::result(&format!(
        "{}: {} with {} variables, guid {}",
        arguments.output.display(),
        description.description.as_deref().unwrap_or(&description.model_name),
        description.variables.len(),
        description.guid,
    ));
    Ok(ExitCode::SUCCESS)
}
