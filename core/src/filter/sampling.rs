//! How long an input is held, and what of that the constraint accounts for.
//!
//! The constraint over a period is (S) of [`crate::convergence::sampled`]; the input that meets it is found in
//! [`super::search`].

use super::FilterState;
use crate::error::{Error, positive};

/// How the filter accounts for inputs that are held between samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sampling {
    /// Not at all: the constraint is enforced at the samples, and the margin has to cover what the held
    /// input costs, Mδ/aⁿ.
    Pointwise,
    /// The constraint is enforced over the period since the step before, taken as the next one's length.
    /// After a gap the period at most doubles from step to step. The default.
    Measured {
        /// The period in s, finite, > 0, of the first step, before any is measured. Default: a hundredth
        /// of the shortest deadline.
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

    /// The period in s that a step at `t` looks over, `None` for the pointwise constraint.
    pub(super) fn period(self, state: &FilterState, t: f64, first: f64) -> Option<f64> {
        match (self, state.time, state.period) {
            (Self::Pointwise, ..) => None,
            (Self::Period(period), ..) => Some(period),
            // A sample at the same time, or an earlier one, says nothing new.
            (_, Some(last), known) if t <= last => Some(known.unwrap_or(first)),
            (_, Some(last), Some(known)) => Some(f64::min(t - last, 2.0 * known)),
            (_, Some(last), None) => Some(t - last),
            (_, None, _) => Some(first),
        }
    }

    /// Whether a step at `t` is the first that measures the period.
    pub(super) fn measures_first(self, state: &FilterState, t: f64) -> bool {
        matches!(self, Self::Measured { .. })
            && state.period.is_none()
            && state.time.is_some_and(|last| t > last)
    }
}
