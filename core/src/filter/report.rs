//! The report of a step.

use alloc::vec::Vec;

use crate::convergence::{DerivativeBound, FixedTimeState, Phase};
use crate::elementary::{self, dot};
use crate::qp::{Active, Constraint, Row, Solver};

/// Part of the deadline that passes without progress before a barrier counts as [`BarrierReport::deadlocked`].
const DEADLOCK_TIME: f64 = 0.1;

/// How a step ended, and so the meaning of the returned input. The numbers are stable: they leave the library as the FMU's
/// `status`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
#[repr(u8)]
pub enum Status {
    /// u_ref satisfies every constraint, and the input is u_ref, bit for bit. If an input is integrated, this holds for its
    /// rate; the input itself then differs from its u_ref as far as the integral does.
    #[default]
    Unchanged = 0,
    /// The input is the point nearest to u_ref that satisfies every constraint.
    Filtered = 1,
    /// The constraints cannot be met within the input bounds: the input within the bounds that violates them least.
    Infeasible = 2,
    /// A constraint's row is so small that no reasonable input meets it (the barrier cannot be influenced at this instant):
    /// the input within the bounds that violates it least, or u_ref if there are no bounds. If the constraint is enforced on
    /// a predicted state ([`Sampling`](super::Sampling)), this status also means that no input was found that meets it; the
    /// returned one is the best of the search, finite and within the bounds.
    NoAuthority = 3,
    /// Time, state or reference input is not a number or infinite: the admissible input nearest 0. Nothing is remembered
    /// except that guarantees already given are lost.
    InvalidInput = 4,
    /// The model's derivatives are not finite at this state: the admissible input nearest 0.
    Singular = 5,
    /// An input enters a derivative of the barrier below its declared relative degree, so that the
    /// constraint would be wrong: the admissible input nearest 0.
    WrongRelativeDegree = 6,
    /// The solver for several rows did not converge: u_ref within its bounds.
    SolverFailed = 7,
    /// The constraints are not met, or they lead to a state without a plan; a plan that keeps every promise decides. Only
    /// from a filter that follows plans ([`Filter::with_plans`](super::Filter::with_plans)).
    Backup = 8,
    /// The filter is [not armed](super::FilterBuilder::arm_after) yet: nothing is asked or promised, and the input is u_ref
    /// within its bounds.
    NotArmed = 9,
}

impl Status {
    /// Every status, in the order of its number.
    pub const ALL: [Self; 10] = [
        Self::Unchanged,
        Self::Filtered,
        Self::Infeasible,
        Self::NoAuthority,
        Self::InvalidInput,
        Self::Singular,
        Self::WrongRelativeDegree,
        Self::SolverFailed,
        Self::Backup,
        Self::NotArmed,
    ];

    /// Its name, as in the FMU's enumeration.
    pub fn name(self) -> &'static str {
        self.words().0
    }

    /// The meaning of the returned input, in brief.
    pub fn meaning(self) -> &'static str {
        self.words().1
    }

    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Unchanged => ("unchanged", "u_ref satisfies every constraint and is passed through"),
            Self::Filtered => ("filtered", "u is the safe input nearest to u_ref"),
            Self::Infeasible => ("infeasible", "not possible within the input bounds: least violation"),
            Self::NoAuthority => ("no_authority", "the barrier cannot be influenced at this state"),
            Self::InvalidInput => ("invalid_input", "an input is not a number or infinite: u nearest 0"),
            Self::Singular => ("singular", "the model is not finite at this state: u nearest 0"),
            Self::WrongRelativeDegree => {
                ("wrong_relative_degree", "the constraint would be wrong: u nearest 0")
            }
            Self::SolverFailed => ("solver_failed", "no convergence: u_ref within its bounds"),
            Self::Backup => ("backup", "a plan decides, and keeps every promise"),
            Self::NotArmed => ("not_armed", "not armed yet: nothing is promised, u_ref within its bounds"),
        }
    }

    /// The status with this number, if there is one.
    pub fn from_number(number: i32) -> Option<Self> {
        Self::ALL.into_iter().find(|status| *status as i32 == number)
    }

    /// Whether no constraint was enforced: no valid input, no finite model, no correct row, no convergence, or not armed.
    pub fn is_abstention(self) -> bool {
        matches!(
            self,
            Self::InvalidInput
                | Self::Singular
                | Self::WrongRelativeDegree
                | Self::SolverFailed
                | Self::NotArmed
        )
    }

    /// Whether the returned input satisfies every constraint, or a plan that keeps every promise backs it.
    pub fn is_satisfied(self) -> bool {
        matches!(self, Self::Unchanged | Self::Filtered | Self::Backup)
    }
}

/// One barrier's part of a [`Report`]. With an [actuation delay](super::FilterBuilder::actuation_delay), all values but h
/// refer to the instant at which the input of the sample acts.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct BarrierReport {
    /// h now, in its own unit; NaN if the state is.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub h: f64,
    /// The phase of the barrier's promise.
    pub phase: Phase,
    /// The value that the constraint aims to keep h above at this time, in the unit of h: the profile plus the margin. Held
    /// inputs use up the margin, so the promised value is this less [`Self::margin`].
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub profile: f64,
    /// Time to the deadline in s, 0 from the deadline on.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub time_left: f64,
    /// Whether h ≥ 0 has been reached since the anchor.
    pub arrived: bool,
    /// Time in s of the first sample with h ≥ 0 since the anchor.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub arrival_time: Option<f64>,
    /// Whether there is a backup plan: one that was checked in the model and keeps this barrier's promise within the bounds,
    /// whatever u_ref is. Only from a filter that follows plans ([`Filter::with_plans`](super::Filter::with_plans)).
    pub guaranteed: bool,
    /// Whether the theorem behind the present phase applies: its conditions held at a sample of this phase, and every step
    /// since then was satisfied. It does not say that an input will exist at later samples.
    pub on_course: bool,
    /// μ in force since the anchor, `[h]`: the margin of the settings, or the larger one that plans behind the rows need,
    /// plus the expected cost of held inputs.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub margin: f64,
    /// Whether the configured method could not be used from the anchor, so that another replaced it
    /// ([`Filter::refusal`](super::Filter::refusal) says why).
    pub fallback: bool,
    /// How many times leaving the set has re-armed the deadline (the settings' `recovery`).
    pub recoveries: u32,
    /// Whether no input within the bounds has h ≥ 0 at the deadline ([`reach`](crate::reach)): true from the first sample of
    /// the approach at which this is certain, for plants and barriers that can tell.
    pub deadline_unreachable: bool,
    /// How many deadlines were given up for a later one because the bounds do not allow them (the settings' `infeasible`).
    /// Time left, profile and guarantee then refer to the later one.
    pub postponed: u32,
    /// The row aᵀu ≥ b given to the QP; a and b in `[h]`/sⁿ. If the step looked over the sampling period
    /// ([`Report::predicted`]), this is its linearisation at the returned u.
    pub row: Row,
    /// aᵀu − b at the returned u: < 0 by the amount of the violation.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub slack: f64,
    /// Number of consecutive steps that have not met the constraint, including this one.
    pub unmet_steps: u32,
    /// If the constraint is not met: the number of the barrier whose active row points most against this one's, if there is
    /// one.
    pub blocked_by: Option<usize>,
    /// Whether the barrier is blocked and makes no progress: for a tenth of its deadline its constraint has not been met,
    /// and h has not risen by a hundredth of its size. A u_ref that goes around leads out of it (`Heading::around` of the
    /// reference controllers), if this barrier allows it: a hard barrier that is not met stays at its least violation,
    /// whatever u_ref is; a soft one ([`Strictness::Soft`](super::Strictness::Soft)) yields.
    pub deadlocked: bool,
    /// Expected fall of h below its promise within the period because the input is held, `[h]`: the loss that the margin has
    /// to cover ([`sampled`](crate::convergence::sampled), (5)). 0 if the step did not look over the period.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub sampling_loss: f64,
}

impl BarrierReport {
    pub(super) const BLANK: Self = Self {
        h: f64::NAN,
        phase: Phase::Waiting,
        profile: 0.0,
        time_left: 0.0,
        arrived: false,
        arrival_time: None,
        guaranteed: false,
        on_course: false,
        margin: 0.0,
        fallback: false,
        recoveries: 0,
        deadline_unreachable: false,
        postponed: 0,
        row: Row::ZERO,
        slack: 0.0,
        unmet_steps: 0,
        blocked_by: None,
        deadlocked: false,
        sampling_loss: 0.0,
    };

    /// Writes the report before the QP is solved.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn begin(
        &mut self,
        promise: &FixedTimeState,
        h: f64,
        bound: &DerivativeBound,
        row: &Row,
        deadline_unreachable: bool,
    ) {
        *self = Self {
            h,
            phase: promise.phase,
            profile: bound.profile,
            time_left: bound.time_left,
            arrived: promise.arrival.is_some(),
            arrival_time: promise.arrival,
            guaranteed: false,
            on_course: promise.on_course,
            margin: promise.margin,
            fallback: promise.fallback,
            recoveries: promise.recoveries,
            postponed: promise.postponed,
            deadline_unreachable,
            row: *row,
            slack: 0.0,
            unmet_steps: 0,
            blocked_by: None,
            deadlocked: false,
            sampling_loss: 0.0,
        };
    }

    /// Fills in the memory of the promise.
    pub(super) fn remember(&mut self, promise: &FixedTimeState) {
        self.phase = promise.phase;
        self.arrival_time = promise.arrival;
        self.arrived = promise.arrival.is_some();
        self.on_course = promise.on_course;
        self.margin = promise.margin;
        self.fallback = promise.fallback;
        self.recoveries = promise.recoveries;
        self.postponed = promise.postponed;
        self.unmet_steps = promise.unmet.map_or(0, |unmet| unmet.steps);
    }
}

/// The report of a step.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Report {
    /// Time of the sample in s.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub time: f64,
    /// How the step ended.
    pub status: Status,
    /// The method that solved the QP.
    pub solver: Solver,
    /// Rounds of the active-set method, otherwise 0. This field alone depends on more than the filter's state: a step is
    /// faster if the same rows and bounds are active as in the one before.
    pub iterations: u32,
    /// The sampling period in s that the step accounted for, 0 for the pointwise constraint.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub period: f64,
    /// Whether the constraint was enforced over the period, with the state at its end predicted by the model. Also false if
    /// a source cannot predict.
    pub predicted: bool,
    /// One entry per barrier, in the order they were added.
    pub barriers: Vec<BarrierReport>,
    /// Whether the promises are kept, which source chose the input, and why; `None` from a filter without plans.
    #[cfg(feature = "plan")]
    pub assurance: Option<super::Assurance>,
}

impl Report {
    pub(super) fn new(barriers: usize) -> Self {
        Self {
            time: f64::NAN,
            status: Status::Unchanged,
            solver: Solver::Unchanged,
            iterations: 0,
            period: 0.0,
            predicted: false,
            barriers: vec![BarrierReport::BLANK; barriers],
            #[cfg(feature = "plan")]
            assurance: None,
        }
    }

    /// Whether a plan keeps every promise, whatever u_ref is.
    #[cfg(feature = "plan")]
    pub fn is_assured(&self) -> bool {
        self.assurance.is_some_and(|assurance| assurance.is_assured())
    }

    /// The numbers of the barriers whose constraints this step does not meet.
    pub fn unmet(&self) -> impl Iterator<Item = usize> + '_ {
        self.barriers.iter().enumerate().filter(|(_, b)| b.unmet_steps > 0).map(|(i, _)| i)
    }

    /// Finds the `active` row that blocks each unmet barrier, and whether that is a deadlock. `barrier` maps a row to the
    /// number of its barrier.
    pub(super) fn find_deadlocks(
        &mut self,
        t: f64,
        promises: &[FixedTimeState],
        active: &[Active],
        barrier: impl Fn(usize) -> usize,
    ) {
        for i in 0..self.barriers.len() {
            let Some(unmet) = promises[i].unmet else { continue };
            let (normal, mut worst, mut blocked_by) = (self.barriers[i].row.normal, 0.0, None);
            for active in active {
                let Constraint::Row(row) = active.constraint else { continue };
                let j = barrier(row);
                let other = &self.barriers[j].row.normal;
                let cosine =
                    dot(&normal, other) / elementary::sqrt(dot(&normal, &normal) * dot(other, other));
                if j != i && cosine < worst {
                    (worst, blocked_by) = (cosine, Some(j));
                }
            }
            let b = &mut self.barriers[i];
            b.blocked_by = blocked_by;
            b.deadlocked = blocked_by.is_some()
                && matches!(b.phase, Phase::Approach | Phase::Late)
                && t - unmet.since >= DEADLOCK_TIME * promises[i].deadline;
        }
    }

    /// Resets everything except the barriers, which a sample rewrites.
    pub(super) fn reset(&mut self, t: f64) {
        self.time = t;
        self.status = Status::Unchanged;
        self.solver = Solver::Unchanged;
        self.iterations = 0;
        self.period = 0.0;
        self.predicted = false;
    }
}
