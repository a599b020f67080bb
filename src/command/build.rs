//! `punctual build`: a configuration becomes an FMU, a system file an SSP package.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use crate::error::Error;
use crate::host::PLATFORM;
use crate::{output, package};

/// Arguments of `punctual build`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The configuration file (TOML): `kind = "filter"`, `"plant"` or `"controller"`; or a system file
    configuration: PathBuf,
    /// The .fmu file to write; for a system file the .ssp file, with the FMUs it names, and those of the configurations it names
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// A shared library to put inside, for the platform that the file is for; repeat it for several [default: the one
    /// beside this program]
    #[arg(long = "library", value_name = "FILE")]
    libraries: Vec<PathBuf>,
}

/// Builds the FMU and tries it, or packs the system.
///
/// # Errors
///
/// A configuration that cannot be used, a file that cannot be read or written, a product that does
/// not work.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let file = &arguments.configuration;
    if arguments.output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("ssp")) {
        return pack(arguments, file);
    }
    let configuration = package::read_configuration(file)?;
    let fmu = package::build(configuration, &arguments.libraries, &arguments.output)?;
    if !fmu.platforms().iter().any(|platform| platform == PLATFORM) {
        output::note(&format!("not tried: no library is for this platform, {PLATFORM}"));
    }
    let description = fmu.description();
    output::result(&format!(
        "{}: {} with {} variables, guid {}",
        arguments.output.display(),
        if description.text.is_empty() { &description.model_name } else { &description.text },
        description.variables.len(),
        description.token,
    ));
    Ok(ExitCode::SUCCESS)
}

/// Arguments of `punctual try-plugin`.
#[derive(Debug, clap::Args)]
pub struct TryPluginArguments {
    /// The configuration file
    configuration: PathBuf,
    /// Where to leave the journal
    folder: PathBuf,
}

/// The part of reading a configuration that may crash.
///
/// # Errors
///
/// A defect of the configuration or its plug-in.
pub fn execute_try_plugin(arguments: &TryPluginArguments) -> Result<ExitCode, Error> {
    package::plugin::perform(&arguments.configuration, &arguments.folder)?;
    Ok(ExitCode::SUCCESS)
}

fn pack(arguments: &Arguments, file: &Path) -> Result<ExitCode, Error> {
    if !arguments.libraries.is_empty() {
        let message = "is for one FMU; an .ssp file takes the FMUs that the system names as they are";
        return Err(Error::configuration("--library", message));
    }
    if let Ok(configuration) = package::read_configuration(file) {
        let message = format!("is {:?}; an .ssp file is made from a system file", configuration.kind());
        return Err(Error::configuration("kind", message).in_file(file));
    }
    let packed = package::system::pack(file, &arguments.output)?;
    output::result(&format!(
        "{}: {} components from {} FMUs, {} connections, {} start values",
        arguments.output.display(),
        packed.components,
        packed.fmus,
        packed.connections,
        packed.start_values,
    ));
    Ok(ExitCode::SUCCESS)
}
