//! The `punctual` command line: parses arguments and returns the exit code. The commands are in
//! [`punctual::command`]; all printing goes through [`punctual::output`].
#![forbid(unsafe_code)]
// Elementary functions come from the core: see clippy.toml.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use punctual::codes;
use punctual::command::{
    build, campaign, check, demo, identify, inspect, merge, new, replay, reproduce, run, shell, validate,
};
use punctual::output;
use punctual_cosim::error::Details;
use serde::Serialize;

/// A safety filter that keeps deadlines, as FMI 2.0 and 3.0 FMUs: build, check, couple, plot and validate.
///
/// Results go to stdout, talk and progress to stderr.
#[derive(Debug, Parser)]
#[command(version, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Write a commented file to begin with
    New(new::Arguments),
    /// Turn a filter, plant or controller configuration into an FMU, or a system into an SSP package
    Build(build::Arguments),
    /// Check a configuration before it is built: relative degree, rates, guarantee from a start, warnings
    Check(check::Arguments),
    /// Find out from a recording or an FMU how the plant differs from the model, and what to declare
    Identify(identify::Arguments),
    /// Bring three vehicles into a disc by a deadline, with the paper's method and with ours; then with bounds, past a rock
    Demo(demo::Arguments),
    /// Compare the paper's tables and figures with ours and with other methods; write CSV, SVG and a page
    Reproduce(reproduce::Arguments),
    /// Simulate a filter's file, or couple FMUs as a system file says; write CSV and pictures
    Run(run::Arguments),
    /// Run a system from many drawn starts, parameters and disturbances; write a Parquet file
    Campaign(campaign::Arguments),
    /// Repeat one run of a campaign, with CSV and pictures, and check that it is the same
    Replay(replay::Arguments),
    /// Show the variables of an FMU, with units, ranges and dependencies
    Inspect(inspect::Arguments),
    /// Join equal FMUs that were built on different systems into one for all of them
    Merge(merge::Arguments),
    /// Find what is wrong with an FMU, ours or another's, before a master stumbles over it
    Validate(validate::Arguments),
    /// Print the script that completes these commands in a shell
    Completions(shell::CompletionArguments),
    /// Write man pages
    Man(shell::ManArguments),
    /// The part of `validate` that may crash, in a separate process
    #[command(hide = true)]
    Trial(validate::TrialArguments),
    /// A plug-in, loaded in a separate process
    #[command(hide = true)]
    TryPlugin(build::TryPluginArguments),
}

/// What a failed command prints to stdout with `--json`.
#[derive(Serialize)]
struct Failure {
    error: Details,
}

fn main() -> ExitCode {
    let wants_json = std::env::args_os().any(|argument| argument == "--json");
    let tell = |error: Details| {
        if wants_json {
            output::json(&Failure { error });
        }
    };
    let program = codes::in_help(Arguments::command());
    let parsed = program.try_get_matches().and_then(|matches| Arguments::from_arg_matches(&matches));
    let arguments = parsed.unwrap_or_else(|error| {
        // Help and version are not errors.
        if error.use_stderr() {
            let words = error.render().to_string();
            let message = words.trim_start_matches("error: ").trim_end().to_owned();
            tell(Details {
                kind: "usage",
                code: codes::MISUSE,
                file: None,
                component: None,
                field: None,
                message,
            });
        }
        error.exit()
    });
    let result = match arguments.command {
        Command::Build(arguments) => build::execute(&arguments),
        Command::Campaign(arguments) => campaign::execute(&arguments),
        Command::Check(arguments) => check::execute(&arguments),
        Command::Identify(arguments) => identify::execute(&arguments),
        Command::Demo(arguments) => demo::execute(&arguments),
        Command::Reproduce(arguments) => reproduce::execute(&arguments),
        Command::New(arguments) => new::execute(&arguments),
        Command::Merge(arguments) => merge::execute(&arguments),
        Command::Replay(arguments) => replay::execute(&arguments),
        Command::Run(arguments) => run::execute(&arguments),
        Command::Inspect(arguments) => inspect::execute(&arguments),
        Command::Validate(arguments) => validate::execute(&arguments),
        Command::Completions(arguments) => shell::execute_completions(&arguments, Arguments::command()),
        Command::Man(arguments) => shell::execute_man(&arguments, Arguments::command()),
        Command::Trial(arguments) => validate::execute_trial(&arguments),
        Command::TryPlugin(arguments) => build::execute_try_plugin(&arguments),
    };
    match result {
        Ok(code) => code,
        Err(error) => {
            tell(error.details());
            output::error(&error);
            ExitCode::from(error.exit_code())
        }
    }
}
