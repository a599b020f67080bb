//! The time for which an input is held, and how the constraint accounts for it (`docs/theory.md#period`).
//!
//! The constraint over a period is (S) of [`crate::convergence::sampled`]. [`super::search`] finds the input that meets it.

use super::FilterState;
use crate::error::{Error, positive};

/// How a filter accounts for inputs that are held between samples.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Sampling {
    /// Not at all: the constraint is enforced at the samples, and the margin has to cover the cost of held inputs, Mδ/aⁿ.
    Pointwise,
    /// The default. The constraint is enforced over the period since the last step, taken as the length of the next one, or
    /// over a longer period seen recently. A period is forgotten within a hundred times its length, so a very short step
    /// between long ones changes nothing. After a gap the period at most doubles from step to step. If the length of the
    /// next period is given ([`Filter::expect_hold`](super::Filter::expect_hold)), that is used.
    Measured {
        /// The period in s, finite, > 0, of the first step, before any is measured. Default: a hundredth of the shortest
        /// deadline.
        first: Option<f64>,
    },
    /// The constraint is enforced over this period in s, finite, > 0.
    Period(f64),
}

impl Default for Sampling {
    fn default() -> Self {
        Self::Measured { first: None }
    }
}

impl Sampling {
    pub(super) fn validated(self) -> Result<Self, Error> {
        if let Self::Period(period) | Self::Measured { first: Some(period) } = self {
            positive("sampling_period", period)?;
        }
        Ok(self)
    }

    /// The period in s of the first step under [`Self::Measured`], for the shortest `deadline`.
    pub(super) fn first(self, deadline: f64) -> f64 {
        const PART_OF_DEADLINE: f64 = 0.01;
        match self {
            Self::Measured { first: Some(first) } => first,
            _ => PART_OF_DEADLINE * deadline,
        }
    }

    /// The period in s that a step at `t` looks over; `None` for the pointwise constraint. The `expected` one is used if it
    /// differs from the measured one by more than round-off.
    pub(super) fn period(
        self,
        state: &FilterState,
        t: f64,
        first: f64,
        expected: Option<f64>,
    ) -> Option<f64> {
        /// Relative round-off of one step: times are sums of many.
        const SAME: f64 = 1e-6;
        match self {
            Self::Pointwise => None,
            Self::Period(period) => Some(period),
            Self::Measured { .. } => {
                let measured = measured(state, t, first);
                let other = |e: &f64| (e - measured).abs() > SAME * measured;
                Some(expected.filter(other).unwrap_or(measured))
            }
        }
    }

    /// The longest time in s that a hold of `hold` s may turn out to last; `reported`: its length was given.
    pub(super) fn longest(self, hold: f64, reported: bool) -> f64 {
        /// Longest next step, in units of the measured one. It is seldom exceeded if steps are drawn at random between half
        /// of the longest and the longest.
        const JITTER: f64 = 1.25;
        match self {
            Self::Measured { .. } if !reported => JITTER * hold,
            _ => hold,
        }
    }
}

/// The period in s that the samples up to `t` show: that of the last step, or of longer ones shortly before.
fn measured(state: &FilterState, t: f64, first: f64) -> f64 {
    /// Decrease of a longer period per elapsed time: it is forgotten within a hundred times its length.
    const FORGOTTEN: f64 = 0.01;
    /// Largest growth of the period from step to step.
    const GROWTH: f64 = 2.0;
    /// A first step shorter than this part of the expected one carries no information.
    const TINY: f64 = 1e-3;
    let Some(last) = state.time else { return first };
    let passed = t - last;
    match state.period {
        // A sample at the same time, or an earlier one, carries no new information.
        known if passed <= 0.0 => known.unwrap_or(first),
        Some(known) => passed.min(GROWTH * known).max(known - FORGOTTEN * passed),
        None if passed < TINY * first => first,
        None => passed,
    }
}
