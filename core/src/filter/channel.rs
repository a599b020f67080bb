//! One barrier of a filter: its derivatives, its promise and when that is in force.

use super::{FixedTimeState, Infeasible, Phase, SAME_PERIOD};
use crate::convergence::FixedTime;
use crate::lie::DerivativeSource;
use crate::qp::{Bounds, Enforcement};
use crate::reach;

/// When a barrier begins to be enforced. Its deadline counts from the filter's first sample in any case, so
/// that "be in A by 5 s, then in B by 10 s" has the deadlines 5 s and 10 s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Begin {
    /// At the first sample.
    #[default]
    AtOnce,
    /// This many seconds after it, finite, ≥ 0, less than the deadline.
    At(f64),
    /// When the barrier of this number, counted from 0 and added before, has arrived.
    AfterArrival(usize),
}

/// When a barrier ceases to be enforced ([`Phase::Released`]).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum End {
    /// Never.
    #[default]
    Never,
    /// This many seconds after the filter's first sample, finite, > 0.
    At(f64),
    /// As soon as h ≥ 0 has been reached.
    OnArrival,
}

/// What becomes of a barrier's constraint where not all can be met within the input bounds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Strictness {
    /// Hard, with priority 0 where h ≥ 0 held at the anchor and 1 where not: what is safe is kept before
    /// what is promised is reached.
    #[default]
    KeepFirst,
    /// Hard: met as far as the bounds and the barriers of smaller numbers allow; of equal ones the one added
    /// first goes first.
    Priority(u32),
    /// Soft, with an exact penalty: it yields, also to u_ref, where it would cost more than this distance
    /// ‖u − u_ref‖, in units of u, finite, > 0.
    Soft(f64),
}

/// One barrier of a filter.
pub(super) struct Channel {
    pub(super) name: String,
    pub(super) source: Box<dyn DerivativeSource>,
    pub(super) promise: FixedTime,
    pub(super) begin: Begin,
    pub(super) end: End,
    pub(super) strictness: Strictness,
    /// Whether the state is measured without errors.
    pub(super) exact: bool,
}

/// Round-off of a time that is a sum of steps, as a part of it.
const SAME_TIME: f64 = 1e-12;

impl Channel {
    pub(super) fn new(name: &str, source: Box<dyn DerivativeSource>, promise: FixedTime) -> Self {
        let (begin, end, strictness) = (Begin::default(), End::default(), Strictness::default());
        Self { name: name.to_owned(), source, promise, begin, end, strictness, exact: true }
    }

    /// How strictly its row is enforced.
    pub(super) fn enforcement(&self, promise: &FixedTimeState) -> Enforcement {
        match self.strictness {
            Strictness::KeepFirst => Enforcement::Hard { priority: u32::from(!promise.was_inside()) },
            Strictness::Priority(priority) => Enforcement::Hard { priority },
            Strictness::Soft(penalty) => Enforcement::Soft { penalty },
        }
    }

    /// Whether the barrier at `index` of `barriers` is in force at time `t` with the value `h`; releases it
    /// where it has ceased to be.
    #[inline]
    pub(super) fn in_force(&self, barriers: &mut [FixedTimeState], index: usize, t: f64, h: f64) -> bool {
        let begun = !matches!(barriers[index].phase, Phase::Waiting | Phase::Released);
        begun && self.end == End::Never || self.is_due(barriers, index, t, h)
    }

    fn is_due(&self, barriers: &mut [FixedTimeState], index: usize, t: f64, h: f64) -> bool {
        let start = *barriers[index].start_time.get_or_insert(t);
        let reached = |seconds: f64| t - start >= seconds - SAME_TIME * t.abs().max(seconds);
        let begun = barriers[index].phase != Phase::Waiting
            || match self.begin {
                Begin::AtOnce => true,
                Begin::At(seconds) => reached(seconds),
                Begin::AfterArrival(other) => barriers[other].arrival.is_some(),
            };
        let promise = &mut barriers[index];
        let ended = match self.end {
            End::Never => false,
            End::At(seconds) => reached(seconds),
            End::OnArrival => begun && (h >= 0.0 || promise.arrival.is_some()),
        };
        if ended && promise.phase != Phase::Released {
            promise.phase = Phase::Released;
            promise.unmet = None;
            if h >= 0.0 {
                promise.arrival.get_or_insert(t);
            }
        }
        begun && !ended
    }

    /// Anchors `promise` at time `begin` where it waits for that, `delay` after its sample; and where samples
    /// turn out to be further apart than was thought then, takes the margin for that into account.
    #[inline]
    pub(super) fn anchor(
        &self,
        promise: &mut FixedTimeState,
        (begin, delay): (f64, f64),
        h: &[f64],
        (period, measures): (f64, bool),
    ) {
        if promise.phase != Phase::Waiting && !measures {
            return;
        }
        if promise.phase == Phase::Waiting {
            let waited = begin - delay - promise.start_time.unwrap_or(begin - delay);
            let deadline = self.promise.deadline() - waited - delay;
            self.promise.anchor(promise, begin, h, deadline, period);
        } else if promise.phase == Phase::Approach && period > promise.period * (1.0 + SAME_PERIOD) {
            self.promise.resample(promise, period);
        }
    }

    /// Whether model and measurement say all of h: what a disturbance may do for it is never ruled out.
    pub(super) fn is_undisturbed(&self) -> bool {
        self.exact && self.promise.settings().disturbance == 0.0
    }

    /// Whether the deadline, `time_left` s after time and state `now`, certainly cannot be met: no input within
    /// `bounds` has h ≥ 0 then, or it has passed outside.
    pub(super) fn is_lost(
        &self,
        promise: &FixedTimeState,
        now: (f64, &[f64]),
        bounds: &Bounds,
        time_left: f64,
    ) -> bool {
        match promise.phase {
            Phase::Late => true,
            Phase::Approach if self.is_undisturbed() => {
                let size = promise.anchor[0].abs() + promise.margin;
                reach::ruled_out(&*self.source, now, bounds, time_left, size)
            }
            _ => false,
        }
    }

    /// Gives up a deadline that is lost, where the settings say so: starts the promise anew with a later one
    /// ([`Infeasible::Soonest`]). Returns whether it did.
    pub(super) fn postpone(
        &self,
        promise: &mut FixedTimeState,
        now: (f64, &[f64]),
        bounds: &Bounds,
        h: &[f64],
        period: Option<f64>,
    ) -> bool {
        /// How much longer than what is not ruled out: getting there takes less than stopping there does.
        const FACTOR: f64 = 2.0;
        const GROWTH: f64 = 1.5;
        /// The longest deadline looked for, in units of the configured one.
        const HORIZON: f64 = 1e3;
        if self.promise.settings().infeasible != Infeasible::Soonest {
            return false;
        }
        let configured = self.promise.deadline();
        let soonest = reach::soonest(&*self.source, now, bounds, HORIZON * configured);
        let factor = FACTOR * GROWTH.powi(promise.postponed.min(16) as i32);
        // Near the set the soonest time tends to zero: never shorter than ten samples.
        let deadline = match soonest {
            Some(soonest) if soonest > 0.0 => (factor * soonest).max(10.0 * period.unwrap_or(0.0)),
            _ => configured,
        };
        let postponed = promise.postponed.saturating_add(1);
        let unmet = promise.unmet;
        self.promise.anchor(promise, now.0, h, deadline, period.unwrap_or(0.0));
        (promise.postponed, promise.unmet) = (postponed, unmet);
        true
    }
}
