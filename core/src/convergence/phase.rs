//! The phases of a promise, and the samples at which they change (docs/theory.md, sections 6 and 8). Knows no method.

use super::state::FixedTimeState;

/// The phase of a barrier's promise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
#[repr(u8)]
pub enum Phase {
    /// Not anchored yet: no valid sample has been seen.
    #[default]
    Waiting = 0,
    /// On the way, before the deadline.
    Approach = 1,
    /// The deadline has passed with the state outside the safe set; the approach continues.
    Late = 2,
    /// The set is to be kept under the stay constraint: the state was inside from the start, or has reached it. Before the
    /// deadline, a plan that decides may leave it once more.
    Stay = 3,
    /// Outside again after having been inside, with no recovery time set, or outside from the start without a deadline. The
    /// stay constraint pulls back, without a deadline.
    Left = 4,
    /// Released: nothing is required any more ([`End`](crate::filter::End)).
    Released = 5,
}

impl Phase {
    /// Every phase, in the order of its number.
    pub const ALL: [Self; 6] =
        [Self::Waiting, Self::Approach, Self::Late, Self::Stay, Self::Left, Self::Released];

    /// Its name, as in the FMU's enumeration.
    pub fn name(self) -> &'static str {
        self.words().0
    }

    /// The meaning of the phase, in brief.
    pub fn meaning(self) -> &'static str {
        self.words().1
    }

    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Waiting => ("waiting", "not begun: no step with valid inputs yet, or not armed"),
            Self::Approach => ("approach", "approaching, before the deadline"),
            Self::Late => ("late", "the deadline passed outside the set; the approach continues"),
            Self::Stay => ("stay", "inside, and kept there"),
            Self::Left => ("left", "outside again; pulled back without a deadline"),
            Self::Released => ("released", "released: nothing is required any more"),
        }
    }

    /// Whether the set is to be kept now, so that the stay constraint is in force.
    pub(super) fn keeps(self) -> bool {
        matches!(self, Self::Stay | Self::Left)
    }
}

/// The side of the set that a sample shows, if h is known up to an error.
#[derive(Clone, Copy)]
pub(super) struct Seen {
    /// h ≥ 0 for certain.
    pub(super) is_inside: bool,
    /// h < 0 for certain.
    pub(super) is_outside: bool,
    /// The deadline has come.
    pub(super) is_over: bool,
}

impl FixedTimeState {
    /// Changes to the phase that begins at this sample. `can_keep`: whether the stay constraint can take over.
    pub(super) fn change_phase(&mut self, seen: Seen, can_keep: impl FnOnce() -> bool) {
        let Seen { is_inside, is_outside, is_over } = seen;
        self.phase = match self.phase {
            Phase::Stay | Phase::Left if is_outside => Phase::Left,
            Phase::Left if is_inside => Phase::Stay,
            // Until then the approach continues. From the deadline on it keeps h ≥ 0 too, with r = 0.
            Phase::Approach if can_keep() => Phase::Stay,
            Phase::Late if is_inside => Phase::Stay,
            Phase::Approach | Phase::Late if is_over && is_outside => Phase::Late,
            other => other,
        };
        self.on_course &= !matches!(self.phase, Phase::Late | Phase::Left);
    }

    /// Changes to the phase that h itself shows, under a condition that is enforced for ever.
    pub(super) fn observe(&mut self, seen: Seen) {
        self.phase = match self.arrival {
            _ if seen.is_inside => Phase::Stay,
            Some(_) => Phase::Left,
            None if seen.is_over => Phase::Late,
            None => Phase::Approach,
        };
    }
}
