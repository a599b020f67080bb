//! Co-simulation: a host for FMUs of FMI 2.0 and 3.0, the master that couples them, campaigns of many runs,
//! and a packager and checker of FMUs. This crate draws and prints nothing.
//!
//! Each module uses only modules above it:
//!
//! ```text
//! exit                 the exit codes of processes that use it
//! status               the status of an FMI call, and log messages
//! error                the errors of everything here, with names and numbers
//! text                 text files, and other files given in their place
//! host                 one FMU: archive, description, library, instance
//! whole                files that are written whole or not at all
//! isolation            FMUs in a child process, which may crash
//! recording            the rows of a run; CSV
//! validate             the defects of an FMU: archive, schema, rules, symbols, a trial
//! coupling             several FMUs: system file, order, fixed-step master
//! package              from a configuration to an .fmu file, from a system to an .ssp file, FMUs merged
//! identification       how a plant differs from its model, found in recordings
//! campaign             many runs from drawn starts and parameters, in process; Parquet
//! ```
#![deny(unsafe_code)]
// Elementary functions come from the core: see clippy.toml.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod campaign;
pub mod coupling;
pub mod error;
pub mod exit;
#[expect(unsafe_code, reason = "FMUs are shared libraries called through C")]
pub mod host;
pub mod identification;
pub mod isolation;
pub mod package;
pub mod recording;
pub mod status;
pub mod text;
pub mod validate;
pub mod whole;
