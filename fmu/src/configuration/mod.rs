//! Configurations: what a filter or plant FMU is made from. The only module that knows TOML.

mod read;

pub use read::{ConfigurationError, read_toml};
