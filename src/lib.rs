//! The commands of the `punctual` command line, over the crates that do the work. `main.rs` only parses arguments.
//!
//! Each module uses only modules above it:
//!
//! ```text
//! codes                the exit codes, in one table
//! output               the one place that prints
//! command              one thin function per subcommand
//! ```
#![forbid(unsafe_code)]
// Elementary functions are those of the core: clippy.toml.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod codes;
pub mod command;
pub mod output;
