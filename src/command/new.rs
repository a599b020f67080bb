//! `punctual new`: a commented file to begin with.

use std::fs::OpenOptions;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use punctual_cosim::error::Error;
use punctual_cosim::text;

use super::run::stem;
use crate::output;

/// Arguments of `punctual new`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The file to write, such as car.toml; it must not be there yet
    file: PathBuf,
    /// What is simulated
    #[arg(long, value_enum, value_name = "MODEL", default_value_t = Start::Unicycle)]
    model: Start,
}

/// What a new file begins with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Start {
    /// A vehicle by name, past an obstacle
    Unicycle,
    /// A model of your own, as expressions
    Expressions,
    /// A plant FMU of another tool: a system file, and the filter's file beside it
    Fmu,
}

/// Writes the file and, for an FMU, the filter's file next to it.
///
/// # Errors
///
/// A name without the extension .toml, a file that already exists or cannot be written.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let file = &arguments.file;
    if !text::is_toml(file) {
        let message = format!("is {:?}, must end in .toml", file.display().to_string());
        return Err(Error::configuration("FILE", message));
    }
    let beside = file.with_file_name(format!("{}-filter.toml", stem(file)));
    let files = match arguments.model {
        Start::Unicycle => vec![(file, include_str!("new/unicycle.toml"))],
        Start::Expressions => vec![(file, include_str!("new/expressions.toml"))],
        Start::Fmu => {
            vec![(file, include_str!("new/fmu.toml")), (&beside, include_str!("new/expressions.toml"))]
        }
    };
    for (path, _) in &files {
        if path.exists() {
            return Err(there(path));
        }
    }
    for (path, template) in &files {
        write(path, template)?;
    }
    let written: Vec<_> = files.iter().map(|(path, _)| path.display().to_string()).collect();
    output::result(&format!("written: {}", written.join("\n         ")));
    let name = file.display();
    output::note(&match arguments.model {
        Start::Fmu => {
            format!("next: write the names of your FMU's variables into {name}, then `punctual run {name}`")
        }
        _ => format!("next: `punctual check {name}`, then `punctual run {name}`"),
    });
    Ok(ExitCode::SUCCESS)
}

fn there(path: &Path) -> Error {
    let message = format!("{} already exists; name another file, or remove that one", path.display());
    Error::configuration("FILE", message)
}

/// Writes `template` to a new file at `path`.
fn write(path: &Path, template: &str) -> Result<(), Error> {
    let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let text = template.replace("{FILE}", &name).replace("{STEM}", &stem(path));
    let mut file =
        OpenOptions::new().write(true).create_new(true).open(path).map_err(|e| match e.kind() {
            ErrorKind::AlreadyExists => there(path),
            _ => Error::io("write", path, e),
        })?;
    file.write_all(text.as_bytes()).map_err(|e| Error::io("write", path, e))
}
