//! How a plant differs from its model, found in recordings: what a filter's file should declare.
//!
//! [`identify`] proposes bounds from a [`Record`]; [`difference`] says what a difference looks like; [`excite`] makes a recording of an
//! FMU. Each module uses only those above it:
//!
//! ```text
//! record         states and inputs at samples, from the columns of recordings
//! arrival        inputs behind a delay and a lag
//! linear         each hold predicted, with derivatives
//! fit            gains behind a delay and lags, by least squares
//! search         the delay and lags that explain most
//! windows        what is left over one hold and over many
//! sizes          the smallest errors, rates and widths of gains that explain the rest: a linear program
//! membership     whether bounds contain every hold
//! explanation    single causes, ranked
//! proposal       all of it, as lines of a file
//! excitation     recordings of an FMU
//! ```
//!
//! A recording shows what was, hence lower limits of what is possible. A factor widens what was found.

mod arrival;
mod excitation;
mod explanation;
mod fit;
mod linear;
mod membership;
mod proposal;
mod record;
mod search;
mod sizes;
mod windows;

pub use excitation::{Excited, excite};
pub use explanation::{Cause, Difference, Explanation, difference};
pub use proposal::{Finding, Kind, Proposal, check, identify};
pub use record::{EPISODE, Episode, Named, Record};

use search::Sought;

#[cfg(test)]
mod tests;

/// The longest delay and lag that are looked for: they have to be shorter than a recording.
fn longest(record: &Record, step: f64) -> Sought {
    /// In s.
    const LAG: f64 = 2.0;
    const DELAY: f64 = 0.25;
    /// As a part of the longest episode.
    const PART: f64 = 0.2;
    let last = |e: &Episode| e.times.last().zip(e.times.first()).map_or(0.0, |(end, begin)| end - begin);
    let most = PART * record.episodes.iter().map(last).fold(0.0, f64::max);
    Sought { delay: DELAY.max(3.0 * step).min(most), lag: LAG.min(most) }
}
