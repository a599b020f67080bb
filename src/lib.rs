//! The library behind the `punctual` command line: a host for co-simulation FMUs of FMI 2.0 and 3.0, the
//! engine that couples them, recordings and pictures. `main.rs` only parses arguments.
//!
//! Each module uses only modules above it:
//!
//! ```text
//! codes                the exit codes, in one table
//! output               the one place that prints
//! reproduce            the study: the paper's tables and figures beside ours and the literature's; the demonstration
//! command              one thin function per subcommand
//! ```
#![forbid(unsafe_code)]
// Elementary functions are those of the core: clippy.toml.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod codes;
pub mod command;
pub mod output;
pub mod reproduce;
