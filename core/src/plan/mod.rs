//! Plans: a verified way to keep every promise, from a state on, within the bounds of the inputs.
//!
//! A *plan* is a list of held inputs and a law that holds the plant at rest after them. It is a *witness* of the promise:
//! run ahead in the model, it meets every requirement at all times. A filter that applies at every sample either an
//! input with a new witness behind it, or the next input of the witness it has, keeps every requirement for ever. The
//! lemma and its proof are in `docs/theory.md#witness`. Where there is no rest, or a set moves, a plan may end at a
//! [horizon](crate::filter::Pace::horizon): the requirements are kept until then.
//!
//! | module | owns |
//! |---|---|
//! | `model` | the plant run ahead, its linearisation by differences, the rest near a state |
//! | `law` | feedback that stops the plant, and feedback that follows a reference |
//! | `witness`, `failure` | a verified list of inputs; why there is none |
//! | `check` | the exact check: a roll-out that meets every requirement, between its nodes too |
//! | `course` | polynomials in time, and what they do not fall below |
//! | `failure` | why there is no plan, in words |
//! | `integral` | the mean of an integral over each period, and its limits |
//! | `search` | reference trajectories by sequential convex programming |
//! | `planner` | which trials are made, in which order, and what is kept between samples |
//!
//! The search is heuristic and may fail. The check does not depend on it: a promise rests on the check alone.

mod check;
mod course;
mod failure;
mod integral;
mod law;
mod model;
mod planner;
mod search;
mod witness;

pub(crate) use check::ON_TIME;
pub use failure::{Failure, Names};
pub(crate) use integral::{Integral, Limit};
pub(crate) use model::slopes;
pub(crate) use planner::{Planner, Sought};
pub use witness::{Tightest, Witness};

use alloc::boxed::Box;
use alloc::sync::Arc;

use crate::lie::Predict;
use crate::scalar::all_finite;
use law::{Brake, Reference};

/// What a plan has to keep: h(t, x(t)) ≥ `margin` for `from` ≤ t < `until`.
#[derive(Clone, Copy)]
pub(crate) struct Requirement<'a> {
    /// The number of its barrier, to name it by.
    pub(crate) barrier: usize,
    /// Whether it is one of the limits of an integral, which come after the barriers and may be reached.
    pub(crate) is_limit: bool,
    /// The barrier along the plant, run ahead.
    pub(crate) model: &'a dyn Predict,
    /// First time in s.
    pub(crate) from: f64,
    /// Last time in s; infinite for ever.
    pub(crate) until: f64,
    /// Least value in the unit of h, ≥ 0; of a limit that is kept a part of its last digit below 0.
    pub(crate) margin: f64,
    /// From when in s it has to be there: what begins at the edge has some time to leave it.
    pub(crate) firm: f64,
    /// Least value that a new plan keeps, in the unit of h, ≥ 0: what is more than the margin is a reserve for a plant that is
    /// not quite the model. The rest of a plan may use it up.
    pub(crate) reserve: f64,
}

/// A law that may keep what is asked for, such as a controller of one's own: it writes the input at a time in s and a state.
/// A search for a plan begins with where it leads too. Nothing rests on it, since every plan is checked.
pub type Policy = Box<dyn Fn(f64, &[f64], &mut [f64]) + Send>;

impl Requirement<'_> {
    fn is_in_force(&self, t: f64) -> bool {
        self.from <= t && t < self.until
    }
}

/// A witness, and the laws from which the next ones are made: plain data, remembered between samples.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Plan {
    reference: Option<Arc<Reference>>,
    brake: Option<Arc<Brake>>,
    /// The inputs that keep every requirement.
    pub witness: Witness,
}

impl Plan {
    /// Whether it holds no input: there is no plan.
    pub(crate) fn is_empty(&self) -> bool {
        self.witness.inputs.is_empty()
    }

    /// Whether the last input alone holds the plant at the rest of the plan, without feedback.
    pub fn stays(&self) -> bool {
        self.brake.as_ref().is_some_and(|brake| brake.stays())
    }

    /// Whether it ends without a rest, at a time.
    pub(crate) fn is_finite(&self) -> bool {
        self.brake.is_none()
    }

    /// What is wrong with it as a plan of a plant with so many states and inputs; one from a file may be.
    pub(crate) fn flaw(&self, [states, inputs]: [usize; 2]) -> Option<&'static str> {
        let is_flawed = self.brake.as_ref().is_some_and(|brake| !brake.fits(states, inputs))
            || self.reference.as_ref().is_some_and(|reference| !reference.fits(states, inputs))
            || self.witness.rates.len() != states
            || !all_finite(&self.witness.rates)
            || self.witness.inputs.is_empty()
            || match (&self.brake, &self.reference) {
                (Some(_), _) => self.witness.until != f64::INFINITY,
                (None, Some(_)) => !self.witness.until.is_finite(),
                (None, None) => true,
            }
            || self.witness.inputs.iter().any(|(end, u)| !end.is_finite() || !all_finite(u));
        is_flawed.then_some("is of a plant of other dimensions, or not finite")
    }
}
