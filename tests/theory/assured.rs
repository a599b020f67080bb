//! Filters with a backup plan, and the figures that measure them: which fraction of the possible starts they
//! accept, whether everything accepted is kept, and the cost of a step.
//!
//! Each table has a quick size for every run of the tests and a full one for `tests/nightly`.
//! `PUNCTUAL_ASSURED` sets another number of cases for all of them.

#![allow(clippy::print_stdout, reason = "the figures are read from the output")]

mod attacks;
mod costs;
mod integrated;
mod obstacles;
mod optimiser;
mod programme;
mod survival;

/// Number of cases: `full` in `tests/nightly`, `quick` here.
fn cases(quick: u64, full: u64) -> u64 {
    let given = std::env::var("PUNCTUAL_ASSURED").ok().and_then(|n| n.parse().ok());
    given.unwrap_or(if std::env::var_os("PUNCTUAL_TABLES").is_some() { full } else { quick })
}
