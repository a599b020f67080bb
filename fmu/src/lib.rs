//! The safety filter, the reference plants and nominal controllers as one library for FMI 2.0 and 3.0.
//!
//! Every FMU that Punctual makes is this library with a different `resources/configuration.toml`: a filter, a
//! plant or a controller. The modules, each using only those above it:
//!
//! | module | owns |
//! |---|---|
//! | [`text`] | numbers formatted for the reader |
//! | [`configuration`] | the TOML file and the table of numeric parameters |
//! | [`units`] | the units of two connected variables of any FMU |
//! | [`product`] | variables, value references, model description and GUID of a configuration |
//! | [`block`] | the computation: a filter, plant or controller on value arrays |
//! | [`instance`] | modes, legality of calls, time, lazy outputs: the FMI state machine in safe Rust |
//! | [`state`] | a snapshot of an instance as bytes: layout, version, checksum |
//! | `abi` | the exported functions, 34 of FMI 2.0 and 75 of 3.0: guard, convert, delegate; plug-ins. The only unsafe code |
//!
//! [`fmi2`] and [`fmi3`] have the C types of each version and the table of its functions, for code that calls
//! such a library.
#![deny(unsafe_code)]
// Elementary functions come from the core: see clippy.toml.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

#[cfg(not(panic = "unwind"))]
compile_error!("the FMU guards every exported function against panics, which needs panic = \"unwind\"");

#[expect(unsafe_code, reason = "the C interface")]
mod abi;
pub mod block;
pub mod configuration;
pub mod instance;
pub mod product;
pub mod state;
pub mod text;
pub mod units;

#[cfg(windows)]
pub use abi::loadable;
pub use abi::{PluginFolder, file_name as plugin_file_name, fmi2, fmi3};
