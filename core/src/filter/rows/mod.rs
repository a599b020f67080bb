//! The rows of a filter: from a sample to the QP's answer and its report.
//!
//! A step is in `sample`, in the order of the mathematics: evaluate the derivatives of every barrier, move its
//! phase, build its row, solve the QP, report.

mod errors;
mod hold;
mod outlook;
mod sample;
mod search;
mod sensitivity;
mod shared;
mod slot;

use alloc::vec::Vec;

use super::{
    BarrierReport, FilterState, Infeasible, Phase, Report, SAME_PERIOD, SAME_TIME, Sampling, Status,
};
use crate::convergence::FixedTimeState;
use crate::qp::{self, Bounds, Enforcement, Row};
use crate::reach;
pub(super) use errors::MeasurementErrors;
pub(super) use errors::{check as check_errors, check_all as check_all_errors};
pub(super) use sample::{most, rounds};
pub use search::Curvature;
pub(super) use search::Requirement;
pub(super) use search::Scratch;
pub use sensitivity::{BarrierDerivative, NoDerivative, SampleDerivative};
pub(super) use shared::SharedPlants;
pub(super) use slot::BarrierSlot;
pub use slot::{Begin, End, Strictness};

/// Scratch memory of a step; its contents change no bit of the next one.
pub(super) struct Workspace {
    /// Rows of the QP, each with its enforcement.
    pub(super) rows: Vec<Row>,
    pub(super) enforcement: Vec<Enforcement>,
    /// Bounds that the input held over the period has to meet.
    pub(super) requirements: Vec<Requirement>,
    /// The state after the sample.
    pub(super) next: FilterState,
    /// Space for one state.
    pub(super) scratch: Vec<f64>,
    pub(super) report: Report,
    pub(super) search: Scratch,
    pub(super) qp: qp::Workspace,
    /// What plans decided at the very first sample, in case that it is evaluated again.
    #[cfg(feature = "plan")]
    pub(super) decided: Option<super::backup::Decided>,
}

/// One row per barrier, and the QP under them: `min ½‖u − u_ref‖²` within the input bounds. State and input are those of the
/// model, in which an integrated input is a state.
pub(super) struct Rows {
    /// Number of components of x, and how many of them are measured quantities after the states of the plant.
    pub(super) state_dim: usize,
    pub(super) measured: usize,
    pub(super) input_dim: usize,
    pub(super) slots: Vec<BarrierSlot>,
    pub(super) bounds: Bounds,
    /// Whether any input has a bound: without one, nothing is ruled out.
    pub(super) bounded: bool,
    pub(super) correction_limit: f64,
    pub(super) sampling: Sampling,
    pub(super) delay: f64,
    pub(super) errors: MeasurementErrors,
    /// The period in s with which [`Sampling::Measured`] starts.
    pub(super) first_period: f64,
    /// The longest time in s between two samples, 0 if it is not given.
    pub(super) period_max: f64,
    /// The time in s from the first sample until the filter is armed.
    pub(super) arm_after: f64,
    /// The time in s for which the next input will be held, if known.
    pub(super) expected: Option<f64>,
    /// Whether a plan backs the next step, so that the rows need not be met.
    pub(super) is_backed: bool,
    /// Whether the search over the period is always brief.
    pub(super) brief_search: bool,
    /// The memory of the filter, of which the rows use their part.
    pub(super) state: FilterState,
    pub(super) workspace: Workspace,
}

impl Rows {
    /// Whether the search over the period is brief.
    pub(super) fn is_brief(&self) -> bool {
        self.is_backed || self.brief_search
    }

    /// Whether it is certain that the input bounds do not allow h ≥ 0 of barrier number `index` at `after` s after `t` and
    /// `x`.
    pub(super) fn is_ruled_out(&self, index: usize, (t, x): (f64, &[f64]), after: f64) -> bool {
        let slot = self.slots.get(index).filter(|slot| slot.is_undisturbed());
        slot.is_some_and(|slot| reach::ruled_out(&*slot.source, (t, x), &self.bounds, after, 1.0))
    }
}
