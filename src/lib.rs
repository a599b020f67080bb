//! The commands of the `punctual` command line, on top of the crates that do the work. `main.rs` only parses
//! arguments.
//!
//! Each module uses only modules above it:
//!
//! ```text
//! codes                the exit codes, in one table
//! output               the one place that prints
//! command              one thin function per subcommand
//! ```
#![forbid(unsafe_code)]
// Elementary functions come from the core: see clippy.toml.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod codes;
pub mod command;
pub mod output;
