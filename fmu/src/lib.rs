//! The safety filter and the reference plants as one FMI 2.0 co-simulation library.
#![deny(unsafe_code)]
pub mod configuration;
