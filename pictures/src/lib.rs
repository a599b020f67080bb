//! Pictures of results of [`punctual_cosim`] and the study: plots, pages and reports.
//!
//! Each module uses only modules above it:
//!
//! ```text
//! columns              text columns lined up
//! outlines             the edges of safe sets in a plane
//! plot                 pictures of series; knows no FMU
//! page                 a page of HTML with charts
//! drawing              from a system file's plots and a recording to pictures
//! report               a run as a page, with an animation; a campaign as a page
//! tube                 where a plan for an uncertain plant may be
//! ```
#![forbid(unsafe_code)]
// Elementary functions come from the core: see clippy.toml.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod columns;
pub mod drawing;
pub mod outlines;
pub mod page;
pub mod plot;
pub mod report;
pub mod tube;
