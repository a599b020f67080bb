//! One barrier's promise over time: anchor, approach, arrival, stay.

use std::array::from_fn;

use super::comparison::{Stack, lower_bound, lower_terms};
use super::first_order::Exponent;
use super::hermite::HermiteProfile;
use super::repeated_root::{self, NoAdmissibleRate};
use super::stay;
use crate::MAX_RELATIVE_DEGREE;
use crate::error::{Error, ErrorKind, non_negative, positive};

/// Round-off of h − μ − r, as a part of its terms.
const MARGIN_TOLERANCE: f64 = 1e-12;

/// How the deadline is met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// The paper's: (D + a)ⁿ (h − μ) ≥ 0 with the rate of [`repeated_root::rate`]. Relative degree 2
    /// and above; for odd ones many anchors have no such rate ([`FixedTime::no_admissible_rate`]).
    RepeatedRoot,
    /// (D + a)ⁿ (h − μ − r) ≥ 0 with the [`HermiteProfile`] r and the configured rate.
    #[default]
    ReferenceProfile,
    /// ė ≥ α |e|^p for e = h − μ < 0, with α such that e = 0 at T ([`Exponent`]). Relative degree 1.
    FirstOrder(Exponent),
}

/// Settings of one barrier's promise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedTimeSettings {
    /// T in s from the anchor, finite, > 0.
    pub deadline: f64,
    /// How the deadline is met. Default: [`Method::ReferenceProfile`].
    pub method: Method,
    /// a in 1/s, finite, > 0: how fast an error against the profile decays.
    pub rate: f64,
    /// a of the stay constraint in 1/s, finite, > 0.
    pub stay_rate: f64,
    /// μ in the unit of h, finite, ≥ 0: arrive and stay this far inside.
    pub margin: f64,
    /// Time in s, finite, > 0, within which a barrier that was left after an arrival is to be reached
    /// again: leaving then anchors anew with this deadline. `None`, the default: leaving is reported
    /// ([`Phase::Left`]) and the stay constraint pulls back, without a deadline.
    pub recovery: Option<f64>,
}

impl FixedTimeSettings {
    /// The product of rate and deadline that [`Self::within`] chooses.
    pub const DEFAULT_RATE_TIMES_DEADLINE: f64 = 20.0;

    /// The defaults for a deadline of `deadline` seconds: reference profile, both rates
    /// 20/T, no margin.
    pub fn within(deadline: f64) -> Self {
        let rate = Self::DEFAULT_RATE_TIMES_DEADLINE / deadline;
        Self { deadline, method: Method::default(), rate, stay_rate: rate, margin: 0.0, recovery: None }
    }

    fn validated(self, n: usize) -> Result<Self, Error> {
        if n == 0 || n > MAX_RELATIVE_DEGREE {
            let message = format!("is {n}, must be 1 to {MAX_RELATIVE_DEGREE}");
            return Err(Error::new(ErrorKind::RelativeDegree, "relative_degree", message));
        }
        if self.method == Method::RepeatedRoot && n == 1 {
            let message = "the repeated root does not exist for relative degree 1; use the reference profile";
            return Err(Error::new(ErrorKind::Unsupported, "method", message));
        }
        if matches!(self.method, Method::FirstOrder(_)) && n != 1 {
            let message = format!(
                "the first-order condition is for relative degree 1, this barrier has {n}; use the reference profile"
            );
            return Err(Error::new(ErrorKind::Unsupported, "method", message));
        }
        positive("deadline", self.deadline)?;
        positive("rate", self.rate)?;
        positive("stay_rate", self.stay_rate)?;
        non_negative("margin", self.margin)?;
        if let Some(recovery) = self.recovery {
            positive("recovery", recovery)?;
        }
        Ok(self)
    }
}

/// Where a barrier stands with its promise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Phase {
    /// Not anchored yet: no valid sample has been seen.
    #[default]
    Waiting = 0,
    /// On the way, before the deadline.
    Approach = 1,
    /// The deadline passed outside the safe set; the approach goes on.
    Late = 2,
    /// Inside, under the stay constraint.
    Stay = 3,
    /// Outside again after having been inside, with no recovery time set; the stay constraint pulls
    /// back, without a deadline.
    Left = 4,
}

/// What is remembered between samples: plain data, all that a snapshot needs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FixedTimeState {
    /// Where the barrier stands.
    pub phase: Phase,
    /// Time of the anchor, t₀ in s.
    pub anchor_time: f64,
    /// T in s, counted from the anchor.
    pub deadline: f64,
    /// How often leaving the set has anchored anew ([`FixedTimeSettings::recovery`]).
    pub recoveries: u32,
    /// (h − μ)⁽ʲ⁾ at the anchor for j < n.
    pub anchor: Stack,
    /// The rate of the approach in 1/s, chosen at the anchor.
    pub rate: f64,
    /// Time in s of the first sample with h ≥ 0 since the anchor.
    pub arrival: Option<f64>,
    /// Whether the theorem behind the present phase applies: its conditions held at a sample of this
    /// phase, and every step since then was satisfied (whoever enforces the row clears this if not).
    /// With a margin, an approach also loses it where a sample shows that held inputs have used up the
    /// margin (h below the profile); without one it is of the continuous-time constraint only.
    pub guaranteed: bool,
}

/// What the constraint asks for at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// The least h⁽ⁿ⁾ allowed, `[h]`/sⁿ.
    pub floor: f64,
    /// The lower bound on h that the constraint promises now, `[h]`.
    pub profile: f64,
    /// Time to the deadline in s, 0 from the deadline on.
    pub time_left: f64,
}

/// The promise "h ≥ μ within T, and from then on" for a barrier of relative degree n.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FixedTime {
    pub(super) n: usize,
    pub(super) settings: FixedTimeSettings,
}

impl FixedTime {
    /// A promise for relative degree `n`.
    ///
    /// # Errors
    ///
    /// `n` outside 1 ..= [`MAX_RELATIVE_DEGREE`], a setting outside the range its field states, the
    /// repeated root with n = 1, the first-order condition with n > 1.
    pub fn new(n: usize, settings: FixedTimeSettings) -> Result<Self, Error> {
        Ok(Self { n, settings: settings.validated(n)? })
    }

    /// The settings.
    pub fn settings(&self) -> &FixedTimeSettings {
        &self.settings
    }

    /// Moves `state` to the sample at time `t` (s), where `h` holds h⁽⁰⁾ … h⁽ⁿ⁻¹⁾ (finite), and
    /// returns what the constraint asks for there.
    ///
    /// The first call anchors, as [`Self::anchor`] with the configured deadline does. Arrival is the first
    /// sample with h ≥ 0; the stay constraint takes over at the first sample at which h ≥ μ *and* it is
    /// invariant from there ([`stay::is_invariant`]).
    pub fn advance(&self, state: &mut FixedTimeState, t: f64, h: &[f64]) -> Demand {
        // With n known to the compiler the short loops of the formulas unroll.
        match self.n {
            1 => self.advance_degree::<1>(state, t, h),
            2 => self.advance_degree::<2>(state, t, h),
            3 => self.advance_degree::<3>(state, t, h),
            4 => self.advance_degree::<4>(state, t, h),
            5 => self.advance_degree::<5>(state, t, h),
            6 => self.advance_degree::<6>(state, t, h),
            7 => self.advance_degree::<7>(state, t, h),
            _ => self.advance_degree::<8>(state, t, h),
        }
    }

    /// [`Self::advance`] for n = `N`.
    fn advance_degree<const N: usize>(&self, state: &mut FixedTimeState, t: f64, h: &[f64]) -> Demand {
        let FixedTimeSettings { stay_rate, margin, .. } = self.settings;
        if state.phase == Phase::Waiting {
            self.anchor(state, t, h, self.settings.deadline);
        }
        let mut e = [0.0; N];
        e.copy_from_slice(&h[..N]);
        e[0] -= margin;

        if let Some(recovery) = self.settings.recovery
            && state.phase == Phase::Stay
            && h[0] < 0.0
        {
            self.anchor(state, t, h, recovery);
            state.recoveries += 1;
        }
        let deadline = state.deadline;
        let elapsed = (t - state.anchor_time).max(0.0);
        if h[0] >= 0.0 && state.arrival.is_none() {
            state.arrival = Some(t);
        }
        match state.phase {
            _ if stay::is_invariant(stay_rate, &e) => {
                state.phase = Phase::Stay;
                state.guaranteed = true;
            }
            Phase::Stay if h[0] >= 0.0 => {}
            Phase::Stay | Phase::Left => {
                state.phase = Phase::Left;
                state.guaranteed = false;
            }
            _ if elapsed >= deadline && h[0] < 0.0 => {
                state.phase = Phase::Late;
                state.guaranteed = false;
            }
            _ => {}
        }

        let (floor, profile) = match state.phase {
            Phase::Stay | Phase::Left => (-lower_terms(stay_rate, &e), 0.0),
            _ => self.approach(state, elapsed, &e),
        };
        Demand { floor, profile: profile + margin, time_left: (deadline - elapsed).max(0.0) }
    }

    /// Why the approach in `state` has no guarantee from its anchor: the repeated root has no admissible
    /// rate there. `None` for other methods, before the anchor, and where the rate exists.
    ///
    /// The fallback is (D + a)ⁿ (h − μ) ≥ 0 with the stay rate a > 0: from the anchor it leads towards
    /// the set without a deadline. Such an approach is not [`FixedTimeState::guaranteed`] until the
    /// stay constraint takes over.
    pub fn no_admissible_rate(&self, state: &FixedTimeState) -> Option<NoAdmissibleRate> {
        if self.settings.method != Method::RepeatedRoot || state.phase == Phase::Waiting {
            return None;
        }
        repeated_root::rate(&state.anchor[..self.n], state.deadline).err()
    }

    /// Starts the promise anew at time `t` (s), where `h` holds h⁽⁰⁾ … h⁽ⁿ⁻¹⁾ (finite): the barrier is to
    /// be reached within `deadline` seconds from there. A deadline ≤ 0 is past already: nothing is
    /// guaranteed, the phase of the next [`Self::advance`] is [`Phase::Late`] where h < 0, and the target
    /// is h = μ at once, approached with the rate. The count of recoveries goes on.
    pub fn anchor(&self, state: &mut FixedTimeState, t: f64, h: &[f64], deadline: f64) {
        let mut anchor = [0.0; MAX_RELATIVE_DEGREE];
        anchor[..self.n].copy_from_slice(&h[..self.n]);
        anchor[0] -= self.settings.margin;
        let rate = match self.settings.method {
            _ if deadline <= 0.0 => None,
            Method::ReferenceProfile => Some(self.settings.rate),
            Method::RepeatedRoot => repeated_root::rate(&anchor[..self.n], deadline).ok(),
            Method::FirstOrder(exponent) => Some(exponent.rate(deadline)),
        };
        let fallback = match self.settings.method {
            Method::ReferenceProfile => self.settings.rate,
            Method::RepeatedRoot | Method::FirstOrder(_) => self.settings.stay_rate,
        };
        *state = FixedTimeState {
            phase: Phase::Approach,
            anchor_time: t,
            deadline,
            recoveries: state.recoveries,
            anchor,
            rate: rate.unwrap_or(fallback),
            arrival: None,
            guaranteed: rate.is_some(),
        };
    }

    /// The floor under h⁽ⁿ⁾ and the bound on h − μ during the approach.
    #[inline]
    fn approach<const N: usize>(&self, state: &mut FixedTimeState, elapsed: f64, e: &[f64; N]) -> (f64, f64) {
        let anchor = &state.anchor[..N];
        match self.settings.method {
            Method::RepeatedRoot => (-lower_terms(state.rate, e), lower_bound(state.rate, anchor, elapsed)),
            Method::FirstOrder(exponent) => {
                let deadline = state.deadline;
                let bound = exponent.lower_bound(anchor[0], deadline, elapsed);
                // The comparison can start at any sample that is not below the bound.
                state.guaranteed |= elapsed < deadline && e[0] >= bound;
                (exponent.floor(anchor[0], deadline, e[0]), bound)
            }
            Method::ReferenceProfile => {
                let r = HermiteProfile::new(anchor, state.deadline).evaluate(elapsed);
                let error: [f64; N] = from_fn(|k| e[k] - r[k]);
                // h below r: what held inputs cost has used up the margin, and the deadline may be missed.
                let scale = MARGIN_TOLERANCE * (e[0].abs() + r[0].abs() + self.settings.margin);
                if self.settings.margin > 0.0 && error[0] < -self.settings.margin - scale {
                    state.guaranteed = false;
                }
                // The lemma can start at any sample before the deadline, also after one that was lost.
                state.guaranteed =
                    state.guaranteed || elapsed < state.deadline && stay::is_invariant(state.rate, &error);
                (r[N] - lower_terms(state.rate, &error), r[0])
            }
        }
    }
}
