//! The library behind the `punctual` command line: a host for co-simulation FMUs of FMI 2.0 and 3.0, the
//! engine that couples them, recordings and pictures. `main.rs` only parses arguments.
//!
//! Each module uses only modules above it:
//!
//! ```text
//! codes                the exit codes, in one table
//! outlines             the edges of safe sets in a plane
//! plot                 pictures of series; knows no FMU
//! page                 a page of HTML with charts
//! pictures             from a system file's plots and a recording to pictures
//! output               the one place that prints
//! report               a run as a page, with an animation; a campaign as a page
//! reproduce            the study: the paper's tables and figures beside ours and the literature's; the demonstration
//! command              one thin function per subcommand
//! ```
#![forbid(unsafe_code)]
// Elementary functions are those of the core: clippy.toml.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod codes;
pub mod command;
pub mod outlines;
pub mod output;
pub mod page;
pub mod pictures;
pub mod plot;
pub mod report;
pub mod reproduce;
