//! The library behind the `punctual` command line: a host for co-simulation FMUs of FMI 2.0 and 3.0, the
//! engine that couples them, recordings and pictures. `main.rs` only parses arguments.
//!
//! Each module uses only modules above it:
//!
//! ```text
//! codes                the exit codes, in one table
//! status               the status of an FMI call, and log messages
//! error                the errors of all commands, with names and numbers
//! text                 files of text, and what is said of others in their place
//! host                 one FMU: archive, description, library, instance
//! whole                files that are written whole or not at all
//! isolation            FMUs in a child process, which may crash
//! recording            the rows of a run; CSV
//! validate             the defects of an FMU: archive, schema, rules, symbols, a trial
//! coupling             several FMUs: system file, order, fixed-step master
//! outlines             the edges of safe sets in a plane
//! plot                 pictures of series; knows no FMU
//! page                 a page of HTML with charts
//! pictures             from a system file's plots and a recording to pictures
//! package              from a configuration to an .fmu file, from a system to an .ssp file, FMUs merged
//! campaign             many runs from drawn starts and parameters, in process; Parquet
//! output               the one place that prints
//! report               a run as a page, with an animation; a campaign as a page
//! reproduce            the study: the paper's tables and figures beside ours and the literature's; the demonstration
//! command              one thin function per subcommand
//! ```
#![deny(unsafe_code)]
// Elementary functions are those of the core: clippy.toml.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod campaign;
pub mod codes;
pub mod command;
pub mod coupling;
pub mod error;
#[expect(unsafe_code, reason = "FMUs are shared libraries called through C")]
pub mod host;
pub mod isolation;
pub mod outlines;
pub mod output;
pub mod package;
pub mod page;
pub mod pictures;
pub mod plot;
pub mod recording;
pub mod report;
pub mod reproduce;
pub mod status;
pub mod text;
pub mod validate;
pub mod whole;
