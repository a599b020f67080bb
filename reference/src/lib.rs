//! Reference material beside [`punctual_core`]: to try a filter on, and to compare it with.
//!
//! | module | owns |
//! |---|---|
//! | [`nominal`] | controllers that want an input, for a filter to change |
//! | [`baselines`] | the constraints of the literature, as conditions of a promise |
//! | [`simulation`] | a closed loop of a plant and a filter |
//! | [`effort`] | a closed loop that is watched: the input that filters need, compared |
//!
//! Plants are in [`punctual_core::plants`]. Nothing of a filter depends on this crate.
#![forbid(unsafe_code)]
// Elementary functions are those of the core: clippy.toml.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod baselines;
pub mod effort;
pub mod nominal;
pub mod simulation;
