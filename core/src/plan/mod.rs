//! Plans: a verified way to keep every promise, starting from a state, within the bounds of the inputs.
//!
//! A *plan* is a list of held inputs, and a law that holds the plant at an equilibrium after them. It is a *backup plan* for
//! the promise if, run ahead in the model, it meets every requirement at all times. At every sample the filter applies
//! either an input with a new backup plan behind it, or the next input of its current backup plan. It then keeps every
//! requirement for ever. The lemma and its proof are in `docs/theory.md#backup-plan`. Where there is no equilibrium, or a
//! set moves, a plan may end at a [horizon](crate::filter::Plans::horizon): the requirements are kept until then.
//!
//! | module | owns |
//! |---|---|
//! | `model` | the plant run ahead, its linearisation by differences, the equilibrium near a state |
//! | `law` | feedback that stops the plant, and feedback that follows a reference |
//! | `backup_plan` | a verified list of held inputs |
//! | `check` | the exact check: a rollout that meets every requirement, between its nodes too |
//! | `expansion` | polynomials in time, and their lower bounds |
//! | `failure` | messages that say why there is no plan |
//! | `moving` | a barrier that follows a measured point, as a function of time |
//! | `integral` | the mean of an integral over each period, and its limits |
//! | `search` | reference trajectories by sequential convex programming |
//! | `tube` | where an uncertain plant can be along a plan, under a law that holds it there |
//! | `planner` | which trials are made, in which order, and what is kept between samples |
//! | `check::tolerances` | the numbers that decide what the check accepts |
//! | `settings` | the numbers that decide how the search proceeds |
//!
//! The search is heuristic and may fail. The check does not depend on it, and a promise depends on the check alone.

mod backup_plan;
mod check;
mod expansion;
mod failure;
mod integral;
mod law;
mod model;
mod moving;
mod planner;
mod search;
mod settings;
mod tube;

pub use backup_plan::{BackupPlan, Tightest};
pub(crate) use check::{CheckTolerances, TOLERANCES};
pub use failure::{Failure, Names};
pub(crate) use integral::{Integral, Limit};
pub(crate) use model::{climb, highest, slopes};
pub use moving::Motion;
pub(crate) use moving::{Course, Moving};
pub(crate) use planner::{Planner, SearchProgress, Uncertain, narrowed};
pub use tube::Tracking;
pub(crate) use tube::Uncertainty;

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;

use crate::lie::Predict;
use crate::scalar::all_finite;
use law::{Reference, StoppingController};
pub(crate) use settings::SETTINGS;

/// What a plan has to keep: h(t, x(t)) ≥ `margin` for `from` ≤ t < `until`.
#[derive(Clone, Copy)]
pub(crate) struct Requirement<'a> {
    /// The number of its barrier, used in messages.
    pub(crate) barrier: usize,
    /// Whether it is one of the limits of an integral, which are numbered after the barriers and may be reached.
    pub(crate) is_limit: bool,
    /// The barrier along the plant, for prediction.
    pub(crate) model: &'a dyn Predict,
    /// First time in s.
    pub(crate) from: f64,
    /// Last time in s; infinite for ever.
    pub(crate) until: f64,
    /// Least value in the unit of h, ≥ 0. At a limit that is kept it lies below 0 by a part of the limit's last digit.
    pub(crate) margin: f64,
    /// From when in s the margin has to be there: a state that begins at the edge of a set has some time to leave the edge.
    pub(crate) firm: f64,
    /// Least value that a new plan keeps, in the unit of h, ≥ 0. What exceeds the margin is a reserve for a plant that
    /// deviates from the model. The remainder of a plan may use it up.
    pub(crate) reserve: f64,
}

/// A law that may keep what is required, such as a custom controller. It writes the input at a time in s and a state. A
/// search for a plan also begins from the trajectory to which it leads. No guarantee depends on it, since every plan is
/// checked.
pub type Policy = Box<dyn Fn(f64, &[f64], &mut [f64]) + Send>;

impl Requirement<'_> {
    fn is_in_force(&self, t: f64) -> bool {
        self.from <= t && t < self.until
    }
}

/// A backup plan, and the laws from which the next ones are made: plain data, remembered between samples.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Plan {
    reference: Option<Arc<Reference>>,
    stopping: Option<Arc<StoppingController>>,
    /// The inputs that keep every requirement.
    pub backup_plan: BackupPlan,
    /// What its nominal inputs leave of their bounds at either side, in their units, for the feedback that an uncertain plant
    /// needs.
    pub(crate) reserve: Vec<f64>,
}

impl Plan {
    /// Whether it holds no input: there is no plan.
    pub(crate) fn is_empty(&self) -> bool {
        self.backup_plan.inputs.is_empty()
    }

    /// Whether the last input alone holds the plant at the equilibrium of the plan, without feedback.
    pub fn stays(&self) -> bool {
        self.stopping.as_ref().is_some_and(|stopping| stopping.stays())
    }

    /// Whether it ends without an equilibrium, at a time.
    pub(crate) fn is_finite(&self) -> bool {
        self.stopping.is_none()
    }

    /// Its flaw as a plan for a plant with `states` states and `inputs` inputs, if any. A plan from a file may have one.
    /// `is_kept`: a promise rests on it; otherwise it may have [forgotten](BackupPlan::forget) a law, which leaves its end.
    pub(crate) fn flaw(&self, [states, inputs]: [usize; 2], is_kept: bool) -> Option<&'static str> {
        let is_flawed = self.stopping.as_ref().is_some_and(|stopping| !stopping.fits(states, inputs))
            || self.reference.as_ref().is_some_and(|reference| !reference.fits(states, inputs))
            || self.backup_plan.rates.len() != states
            || !all_finite(&self.backup_plan.rates)
            || self.backup_plan.inputs.is_empty()
            || self.backup_plan.tracking.as_ref().is_some_and(|tracking| !tracking.fits(states, inputs))
            || !self.reserve.iter().all(|reserve| reserve.is_finite() && *reserve >= 0.0)
            || match (&self.stopping, &self.reference) {
                (Some(_), _) => {
                    let is_dated = self.backup_plan.until != f64::INFINITY;
                    is_dated && self.backup_plan.tracking.is_none() && is_kept
                }
                (None, Some(_)) => !self.backup_plan.until.is_finite(),
                (None, None) => true,
            }
            || self.backup_plan.inputs.iter().any(|(end, u)| !end.is_finite() || !all_finite(u));
        is_flawed.then_some("is of a plant of other dimensions, or not finite")
    }
}
