//! Reference material for [`punctual_core`]: examples to try a filter on, and methods to compare it with.
//!
//! | module | owns |
//! |---|---|
//! | [`nominal`] | controllers that give the wanted input, which a filter changes |
//! | [`baselines`] | the constraints of the literature, as conditions of a promise |
//! | [`simulation`] | a closed loop of a plant and a filter |
//! | [`effort`] | measurements in a closed loop: the input that filters need, compared |
//!
//! Plants are in [`punctual_core::plants`]. No filter depends on this crate.
#![forbid(unsafe_code)]
// Elementary functions come from the core: see clippy.toml.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod baselines;
pub mod effort;
pub mod nominal;
pub mod simulation;
