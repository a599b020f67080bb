//! `punctual completions` and `punctual man`: the commands described for a shell and for `man`.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use clap_complete::Shell;
use punctual_cosim::error::Error;
use punctual_cosim::whole;

use crate::{codes, output};

/// Arguments of `punctual completions`.
#[derive(Debug, clap::Args)]
pub struct CompletionArguments {
    /// The shell
    shell: Shell,
}

/// Arguments of `punctual man`.
#[derive(Debug, clap::Args)]
pub struct ManArguments {
    /// The folder to write `punctual.1` and a page for every command into
    folder: PathBuf,
}

/// Prints the script that completes the arguments of `program`.
///
/// # Errors
///
/// None in practice, since the script is text.
pub fn execute_completions(
    arguments: &CompletionArguments,
    mut program: clap::Command,
) -> Result<ExitCode, Error> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut program, "punctual", &mut script);
    output::result(String::from_utf8_lossy(&script).trim_end());
    Ok(ExitCode::SUCCESS)
}

/// Writes the man pages of `program` and of its commands.
///
/// # Errors
///
/// A folder or file that cannot be written.
pub fn execute_man(arguments: &ManArguments, mut program: clap::Command) -> Result<ExitCode, Error> {
    let folder = &arguments.folder;
    std::fs::create_dir_all(folder).map_err(|e| Error::io("create", folder, e))?;
    program.build();
    let shown =
        program.get_subcommands().filter(|command| !command.is_hide_set() && command.get_name() != "help");
    let pages = shown.cloned().map(|command| {
        let name = format!("punctual-{}", command.get_name());
        let codes = codes::in_man(Some(command.get_name()));
        (name.clone(), command.display_name(name), codes)
    });
    for (name, command, codes) in pages.chain([("punctual".to_owned(), program.clone(), codes::in_man(None))])
    {
        let man = clap_mangen::Man::new(command);
        whole::write_with(&folder.join(format!("{name}.1")), |out| {
            man.render(out)?;
            out.write_all(codes.as_bytes())
        })?;
    }
    output::result(&format!("written: {}", folder.join("punctual.1").display()));
    Ok(ExitCode::SUCCESS)
}
