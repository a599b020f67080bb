//! One barrier's promise over time: anchor, approach, arrival, stay.

use alloc::sync::Arc;
use core::array::from_fn;
use core::fmt;

use super::approach::Approach;
use super::comparison::Stack;
use super::condition::{Anchored, Anchoring, Condition, EXACT, Sample};
use super::phase::{Phase, Seen};
use super::profile::{Profile, ProfileError};
use super::repeated_root::NoAdmissibleRate;
use super::sampled::PeriodBound;
use super::settings::FixedTimeSettings;
use super::state::FixedTimeState;
use super::stay::{Means, Stay};
use crate::MAX_RELATIVE_DEGREE;
use crate::error::{Error, ErrorKind, positive};

/// The least h⁽ⁿ⁾ that keeps a promise, at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct DerivativeBound {
    /// The least h⁽ⁿ⁾ of the model allowed, `[h]`/sⁿ: the floor of the constraint plus the disturbance.
    pub floor: f64,
    /// The lower bound on h that the constraint promises now, `[h]`.
    pub profile: f64,
    /// Time to the deadline in s, 0 from the deadline on.
    pub time_left: f64,
}

impl DerivativeBound {
    /// The bound that requires nothing.
    pub const NONE: Self = Self { floor: f64::NEG_INFINITY, profile: 0.0, time_left: 0.0 };
}

/// Why the configured method cannot be used from an anchor.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Refusal {
    /// The repeated root has no admissible rate. It is replaced by (D + a)ⁿ (h − μ) ≥ 0 with the stay rate. That leads
    /// towards the set without a deadline, and guarantees nothing until the stay constraint takes over.
    NoAdmissibleRate(NoAdmissibleRate),
    /// The custom profile fails its check from this anchor. It is replaced by the Hermite profile, with its guarantee.
    Profile(ProfileError),
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoAdmissibleRate(reason) => reason.fmt(f),
            Self::Profile(reason) => reason.fmt(f),
        }
    }
}

impl core::error::Error for Refusal {}

/// The promise "h ≥ μ within T, and from then on" for a barrier of relative degree n.
#[derive(Clone)]
pub struct FixedTime {
    pub(super) n: usize,
    pub(super) settings: FixedTimeSettings,
    pub(super) approach: Approach,
}

impl fmt::Debug for FixedTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = f.debug_struct("FixedTime");
        text.field("n", &self.n).field("settings", &self.settings);
        text.field("own", &self.approach.is_own()).finish_non_exhaustive()
    }
}

impl FixedTime {
    /// A promise for relative degree `n`.
    ///
    /// # Errors
    ///
    /// `n` outside 1 ..= [`MAX_RELATIVE_DEGREE`], a setting outside the range its field states, the
    /// repeated root with n = 1.
    pub fn new(n: usize, settings: FixedTimeSettings) -> Result<Self, Error> {
        let settings = settings.validated(n)?;
        Ok(Self { n, settings, approach: Approach::new(&settings) })
    }

    /// The same promise along a custom profile. It is [checked](super::profile::check) at every anchor, with about 3000
    /// evaluations. A profile that fails is [refused](Refusal::Profile).
    ///
    /// # Errors
    ///
    /// A method other than [`Method::ReferenceProfile`](super::Method::ReferenceProfile).
    pub fn with_profile(self, profile: impl Profile + Send + Sync + 'static) -> Result<Self, Error> {
        let Approach::Profile(reference) = self.approach else {
            let message = "a custom profile requires the reference profile";
            return Err(Error::new(ErrorKind::Unsupported, "method", message));
        };
        Ok(Self { approach: Approach::Profile(reference.along(Arc::new(profile))), ..self })
    }

    /// A custom constraint that replaces the settings' method. Of the settings only deadline, margin and disturbance count.
    /// Unless its [abilities](super::condition::Abilities) say otherwise, nothing is guaranteed and the phases report what
    /// is seen ([`Phase::Stay`]: h ≥ 0, [`Phase::Left`]: outside again). Unless it gives its [rates](Condition::rates), it
    /// is enforced only at the samples, under any [`Sampling`](crate::filter::Sampling).
    ///
    /// # Errors
    ///
    /// A method other than the default, a custom profile, or a recovery time.
    pub fn with_condition(self, condition: impl Condition + Send + Sync + 'static) -> Result<Self, Error> {
        let settings = &self.settings;
        let is_plain = match &self.approach {
            Approach::Profile(reference) => !reference.has_own_profile(),
            Approach::Own(_) => true,
            Approach::Root(_) => false,
        };
        let message = if !is_plain {
            Some(("method", "a custom constraint replaces method and profile"))
        } else if settings.recovery.is_some() {
            Some(("recovery", "a custom constraint has no recovery"))
        } else {
            None
        };
        if let Some((field, message)) = message {
            return Err(Error::new(ErrorKind::Unsupported, field, message));
        }
        Ok(Self { approach: Approach::Own(Arc::new(condition)), ..self })
    }

    /// Whether a custom constraint is in force ([`Self::with_condition`]).
    pub(crate) fn has_condition(&self) -> bool {
        self.approach.is_own()
    }

    /// The same promise with another deadline in s, for future anchors.
    ///
    /// # Errors
    ///
    /// A deadline that is not finite or ≤ 0.
    pub(crate) fn with_deadline(mut self, deadline: f64) -> Result<Self, Error> {
        self.settings.deadline = Some(positive("deadline", deadline)?);
        Ok(self)
    }

    /// n.
    #[inline]
    pub fn relative_degree(&self) -> usize {
        self.n
    }

    /// T in s from the anchor, infinite if there is none.
    pub fn deadline(&self) -> f64 {
        self.settings.deadline.unwrap_or(f64::INFINITY)
    }

    /// The settings.
    pub fn settings(&self) -> &FixedTimeSettings {
        &self.settings
    }

    /// Moves `state` to the sample at time `t` (s), where `h` holds h⁽⁰⁾ … h⁽ⁿ⁻¹⁾ (finite), and
    /// returns the floor of the constraint there.
    ///
    /// The first call anchors, as [`Self::anchor`] with the configured deadline and no period does. Arrival is
    /// the first sample with h ≥ 0. The stay constraint takes over at the first sample at which h ≥ μ *and* it is
    /// invariant from there ([`is_invariant`](super::stay::is_invariant)). A start inside is kept from the anchor on.
    pub fn advance(&self, state: &mut FixedTimeState, t: f64, h: &[f64]) -> DerivativeBound {
        self.advance_within(state, t, h, &[0.0; MAX_RELATIVE_DEGREE])
    }

    /// As [`Self::advance`], if h⁽ᵏ⁾ is known up to `errors[k]` ≥ 0. A theorem starts from the smallest possible
    /// derivatives, and ends when h < 0 for certain. Arrival remains that of the given `h`.
    pub(crate) fn advance_within(
        &self,
        state: &mut FixedTimeState,
        t: f64,
        h: &[f64],
        errors: &Stack,
    ) -> DerivativeBound {
        self.advance_by(state, t, h, errors, &Means { hold: state.period, ..Means::UNKNOWN })
    }

    /// As [`Self::advance_within`], with the stay rate chosen for the influence of plant and inputs (`means`).
    pub(crate) fn advance_by(
        &self,
        state: &mut FixedTimeState,
        t: f64,
        h: &[f64],
        errors: &Stack,
        means: &Means,
    ) -> DerivativeBound {
        // With n known to the compiler the short loops of the formulas unroll.
        match self.n {
            1 => self.advance_degree::<1>(state, t, h, errors, means),
            2 => self.advance_degree::<2>(state, t, h, errors, means),
            3 => self.advance_degree::<3>(state, t, h, errors, means),
            4 => self.advance_degree::<4>(state, t, h, errors, means),
            5 => self.advance_degree::<5>(state, t, h, errors, means),
            6 => self.advance_degree::<6>(state, t, h, errors, means),
            7 => self.advance_degree::<7>(state, t, h, errors, means),
            _ => self.advance_degree::<8>(state, t, h, errors, means),
        }
    }

    /// [`Self::advance_by`] for n = `N`.
    fn advance_degree<const N: usize>(
        &self,
        state: &mut FixedTimeState,
        t: f64,
        h: &[f64],
        errors: &Stack,
        means: &Means,
    ) -> DerivativeBound {
        let h: &[f64; N] = h.first_chunk().expect("n derivatives");
        let lowest: [f64; N] = from_fn(|k| h[k] - errors[k]);
        let is_outside = h[0] + errors[0] < 0.0;
        // Anchor at the first sample, and again if a set that has a recovery time was left.
        if state.phase == Phase::Waiting {
            self.anchor(state, t, &lowest, self.deadline(), 0.0);
        }
        let was_left = state.phase == Phase::Stay && is_outside;
        if let Some(recovery) = self.settings.recovery.filter(|_| was_left) {
            // A set that was to be reached may be left again while its deadline, which is kept, is ahead.
            let left = state.deadline - state.elapsed(t);
            let stands = state.recoveries == 0 && !state.was_inside() && left > 0.0;
            self.anchor(state, t, &lowest, if stands { left } else { recovery }, state.period);
            state.recoveries = state.recoveries.saturating_add(u32::from(!stands));
        }
        // Record the arrival, and change to the phase that begins here.
        let elapsed = state.elapsed(t);
        let is_over = elapsed >= state.deadline;
        if h[0] >= 0.0 && state.arrival.is_none() {
            state.arrival = Some(t);
        }
        let seen = Seen { is_inside: lowest[0] >= 0.0, is_outside, is_over };
        if self.hands_over() {
            let (before, margin) = (state.phase, state.margin);
            state.change_phase(seen, || Stay(&self.settings).can_keep(&lowest, margin, means));
            if (before, state.phase) == (Phase::Approach, Phase::Stay) {
                // From here on the largest gain is that inside the set: far outside it may have been different.
                state.gain *= means.weight;
            }
        } else {
            state.observe(Seen { is_inside: h[0] >= 0.0, ..seen });
        }
        // The floor of the condition in force. Leaving the set breaks its promise, even if a new one begins here.
        let (floor, profile) = self.enforce(state, elapsed, h, &lowest, errors, means);
        state.on_course &= !was_left;
        let floor = floor + self.settings.disturbance;
        let has_deadline = state.deadline.is_finite() || !self.hands_over();
        let time_left = if has_deadline { (state.deadline - elapsed).max(0.0) } else { 0.0 };
        DerivativeBound { floor, profile, time_left }
    }

    /// The floor under h⁽ⁿ⁾ and the bound on h of the condition in force. Records in `state` whether its theorem applies.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn enforce<const N: usize>(
        &self,
        state: &mut FixedTimeState,
        elapsed: f64,
        h: &[f64; N],
        lowest: &[f64; N],
        errors: &Stack,
        means: &Means,
    ) -> (f64, f64) {
        let mut e = *h;
        if self.keeps(state) {
            let stay = Stay(&self.settings);
            match state.phase {
                Phase::Left => stay.pull_back(state, lowest, means),
                _ => stay.choose(state, h, lowest, means),
            }
            e[0] -= state.stay_margin;
            return (stay.bound(&state.on_stay(elapsed, &e)).floor, state.stay_margin);
        }
        e[0] -= state.margin;
        let bound = self.approach.bound(&state.on_approach(elapsed, &e, errors));
        state.on_course = state.phase == Phase::Approach && bound.applies;
        (bound.floor, bound.lower + state.margin)
    }

    /// Whether the condition allows for errors of the derivatives ([`Self::advance_within`]).
    pub(crate) fn allows_errors(&self) -> bool {
        self.approach.abilities().allows_errors
    }

    /// Whether the stay constraint takes over inside.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn hands_over(&self) -> bool {
        self.approach.abilities().hands_over
    }

    /// Whether the stay constraint is in force.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn keeps(&self, state: &FixedTimeState) -> bool {
        state.phase.keeps() && self.hands_over()
    }

    /// Calls `f` with the condition in force and the sample at time `t` (s) that it sees, where `h` holds h⁽⁰⁾ … h⁽ⁿ⁻¹⁾.
    pub(super) fn in_force<R>(
        &self,
        state: &FixedTimeState,
        t: f64,
        h: &[f64],
        f: impl FnOnce(&dyn Condition, &Sample) -> R,
    ) -> R {
        let mut e = [0.0; MAX_RELATIVE_DEGREE];
        let (e, elapsed) = (&mut e[..self.n], state.elapsed(t));
        e.copy_from_slice(&h[..self.n]);
        if self.keeps(state) {
            e[0] -= state.stay_margin;
            f(&Stay(&self.settings), &state.on_stay(elapsed, e))
        } else {
            e[0] -= state.margin;
            f(self.approach.condition(), &state.on_approach(elapsed, e, &EXACT))
        }
    }

    /// (S) of [`sampled`](super::sampled) from the sample at `t` (s), to which [`advance`](Self::advance) has moved `state`
    /// and at which `h` holds h⁽⁰⁾ … h⁽ⁿ⁻¹⁾, over `period` > 0 seconds. `None` under a condition that is not linear in e, as
    /// are most custom ones.
    pub fn over_period(&self, state: &FixedTimeState, t: f64, h: &[f64], period: f64) -> Option<PeriodBound> {
        self.in_force(state, t, h, |condition, at| {
            condition.over_period(at, h, period, self.settings.disturbance)
        })
    }

    /// Whether the rate and the margin with which the set is kept in `state` are constants that do not depend on the sample.
    pub(super) fn keeps_evenly(&self, state: &FixedTimeState) -> bool {
        Stay(&self.settings).is_even(state)
    }

    /// Why another method than the configured one has been in force since the anchor in `state`. `None` if it is the
    /// configured one, and before the anchor. Recomputed at every call: not for every step.
    pub fn refusal(&self, state: &FixedTimeState) -> Option<Refusal> {
        if !state.fallback || state.phase == Phase::Waiting {
            return None;
        }
        self.approach.condition().refusal(&state.at_anchor(self.n))
    }

    /// Restarts the promise at time `t` (s), where `h` holds h⁽⁰⁾ … h⁽ⁿ⁻¹⁾ (finite): the barrier is to be reached within
    /// `deadline` seconds from there, with inputs held for `period` ≥ 0 seconds (0: not held, or not known). The count of
    /// recoveries continues.
    ///
    /// A deadline ≤ 0 has already passed: nothing is guaranteed, the phase of the next [`Self::advance`] is [`Phase::Late`]
    /// if h < 0, and the target is h = μ at once, approached with the rate.
    pub fn anchor(&self, state: &mut FixedTimeState, t: f64, h: &[f64], deadline: f64, period: f64) {
        let settings = &self.settings;
        let allowed = if deadline <= 0.0 { self.deadline() } else { deadline };
        let default_rate = FixedTimeSettings::default_rate(allowed, period);
        let stay_rate = settings.stay_rate.or(settings.rate).unwrap_or(match allowed.is_finite() {
            true => default_rate,
            false => FixedTimeSettings::DEFAULT_KEEP_RATE,
        });
        let keeps = self.hands_over() && (h[0] >= 0.0 || deadline == f64::INFINITY);
        let (h, margin) = (&h[..self.n], settings.margin.max(state.least_margin));
        let at = Anchoring { h, deadline, period, margin, default_rate, stay_rate, keeps };
        let Anchored { margin, rate, fallback, applies } = self.approach.condition().anchor(&at);
        *state = FixedTimeState {
            phase: if keeps { Phase::Stay } else { Phase::Approach },
            start_time: state.start_time,
            anchor_time: t,
            deadline,
            recoveries: state.recoveries,
            postponed: state.postponed,
            anchor: at.error(margin),
            rate,
            stay_rate,
            stay_margin: margin,
            pull: 0.0,
            gain: 0.0,
            margin,
            least_margin: state.least_margin,
            period,
            fallback,
            arrival: None,
            since: state.since,
            on_course: applies,
            unmet: state.unmet,
        };
    }

    /// Accounts, during the approach, for inputs that are held for `period` > 0 seconds. Margin and default rates become
    /// what they would have been if that had been known at the anchor. With the reference profile h − μ − r changes by at
    /// most C(2n − 1, n) (elapsed/T)ⁿ times the change of the margin (`docs/theory.md#period`). Other methods do not account
    /// for it.
    pub(crate) fn resample(&self, state: &mut FixedTimeState, period: f64) {
        if !self.approach.abilities().covers_holds {
            return;
        }
        let FixedTimeState { arrival, on_course, phase, gain, .. } = *state;
        let mut h = state.anchor;
        h[0] += state.margin;
        self.anchor(state, state.anchor_time, &h[..self.n], state.deadline, period);
        (state.arrival, state.on_course, state.phase, state.gain) = (arrival, on_course, phase, gain);
    }

    /// Restarts the condition from the sample at time `t` (s) if its theorem was lost on the way there. `state` has been
    /// moved to that sample, and `h` holds the smallest h⁽⁰⁾ … h⁽ⁿ⁻¹⁾ there. The deadline stays the same. The error is zero
    /// again, so the theorem applies again. Returns whether it restarted.
    ///
    /// It does not restart shortly before the deadline, where a profile from anywhere would require any input, nor along a
    /// custom profile, whose check takes long.
    pub(crate) fn restart(&self, state: &mut FixedTimeState, t: f64, h: &[f64], period: f64) -> bool {
        /// Number of samples that must be left.
        const SAMPLES: f64 = 10.0;
        /// Part of the configured deadline that must be left.
        const PART: f64 = 0.05;
        let left = state.deadline - (t - state.anchor_time);
        let lost = state.phase == Phase::Approach && !state.on_course && h[0] < 0.0 && t > state.anchor_time;
        // Without a period, inputs are not held, or not known to be: there is no theorem to regain.
        if !lost
            || period <= 0.0
            || !self.approach.abilities().restarts
            || left < (SAMPLES * period).max(PART * self.deadline())
        {
            return false;
        }
        let FixedTimeState { arrival, gain, .. } = *state;
        self.anchor(state, t, h, left, period);
        (state.arrival, state.gain) = (arrival, gain);
        true
    }
}
