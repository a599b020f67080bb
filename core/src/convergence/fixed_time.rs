//! One barrier's promise over time: anchor, approach, arrival, stay.

use std::array::from_fn;
use std::fmt;
use std::sync::Arc;

use super::comparison::{Stack, lower_bound, lower_terms};
use super::condition::Condition;
use super::hermite::HermiteProfile;
use super::profile::{self, Derivatives, Hermite, LowPeak, Profile, ProfileError};
use super::repeated_root::{self, NoAdmissibleRate};
use super::sampled;
use super::settings::{FixedTimeSettings, Method, ProfileKind};
use super::state::{FixedTimeState, Phase};
use super::stay::{self, Means};
use crate::MAX_RELATIVE_DEGREE;
use crate::error::{Error, ErrorKind, positive};

/// Round-off of h − μ − r, as a part of its terms.
const MARGIN_TOLERANCE: f64 = 1e-12;

/// What the constraint asks for at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// The least h⁽ⁿ⁾ of the model allowed, `[h]`/sⁿ: what the constraint asks for, and the disturbance on top.
    pub floor: f64,
    /// The lower bound on h that the constraint promises now, `[h]`.
    pub profile: f64,
    /// Time to the deadline in s, 0 from the deadline on.
    pub time_left: f64,
}

/// Why the configured method cannot be used from an anchor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Refusal {
    /// The repeated root has no admissible rate. In its place: (D + a)ⁿ (h − μ) ≥ 0 with the stay rate,
    /// which leads towards the set without a deadline; nothing is guaranteed until the stay constraint
    /// takes over.
    NoAdmissibleRate(NoAdmissibleRate),
    /// The profile of one's own is not one from this anchor. In its place: the Hermite profile, with its
    /// guarantee.
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

impl std::error::Error for Refusal {}

/// The promise "h ≥ μ within T, and from then on" for a barrier of relative degree n.
#[derive(Clone)]
pub struct FixedTime {
    pub(super) n: usize,
    pub(super) settings: FixedTimeSettings,
    /// A profile of one's own in place of [`Hermite`].
    own: Option<Arc<dyn Profile + Send + Sync>>,
    /// A constraint of one's own in place of the settings' method.
    condition: Option<Arc<dyn Condition + Send + Sync>>,
}

/// h − μ and its derivatives.
fn from_margin<const N: usize>(h: &[f64], margin: f64) -> [f64; N] {
    let mut e = [0.0; N];
    e.copy_from_slice(&h[..N]);
    e[0] -= margin;
    e
}

impl fmt::Debug for FixedTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { n, settings, own, condition } = self;
        let (own, condition) = (own.is_some(), condition.is_some());
        let mut text = f.debug_struct("FixedTime");
        text.field("n", n)
            .field("settings", settings)
            .field("own", &own)
            .field("condition", &condition)
            .finish()
    }
}

impl FixedTime {
    /// A promise for relative degree `n`.
    ///
    /// # Errors
    ///
    /// `n` outside 1 ..= [`MAX_RELATIVE_DEGREE`], a setting outside the range its field states, the
    /// repeated root with n = 1, the first-order condition with n > 1.
    pub fn new(n: usize, settings: FixedTimeSettings) -> Result<Self, Error> {
        Ok(Self { n, settings: settings.validated(n)?, own: None, condition: None })
    }

    /// The same promise along a profile of one's own. It is [checked](profile::check) at every anchor,
    /// some 3000 evaluations; one that fails is [refused](Refusal::Profile).
    ///
    /// # Errors
    ///
    /// A method other than [`Method::ReferenceProfile`].
    pub fn with_profile(self, profile: impl Profile + Send + Sync + 'static) -> Result<Self, Error> {
        if self.settings.method != Method::ReferenceProfile {
            let message = "a profile of one's own belongs to the reference profile";
            return Err(Error::new(ErrorKind::Unsupported, "method", message));
        }
        Ok(Self { own: Some(Arc::new(profile)), ..self })
    }

    /// A constraint of one's own in place of the settings' method: of these only deadline, margin and
    /// disturbance count. Nothing is guaranteed, the phases tell what is seen ([`Phase::Stay`]: h ≥ 0,
    /// [`Phase::Left`]: outside again), and it is enforced at the samples only, whatever
    /// [`Sampling`](crate::filter::Sampling) says.
    ///
    /// # Errors
    ///
    /// A method other than the default, a profile of one's own, or a recovery time.
    pub fn with_condition(self, condition: impl Condition + Send + Sync + 'static) -> Result<Self, Error> {
        let settings = &self.settings;
        let message = if settings.method != Method::default() || self.own.is_some() {
            Some(("method", "a constraint of one's own takes the place of method and profile"))
        } else if settings.recovery.is_some() {
            Some(("recovery", "a constraint of one's own knows no recovery"))
        } else {
            None
        };
        if let Some((field, message)) = message {
            return Err(Error::new(ErrorKind::Unsupported, field, message));
        }
        Ok(Self { condition: Some(Arc::new(condition)), ..self })
    }

    /// Whether a constraint of one's own is in force ([`Self::with_condition`]).
    pub fn has_condition(&self) -> bool {
        self.condition.is_some()
    }

    /// The same promise with another deadline in s, for anchors to come.
    ///
    /// # Errors
    ///
    /// A deadline that is not finite or ≤ 0.
    pub fn with_deadline(mut self, deadline: f64) -> Result<Self, Error> {
        self.settings.deadline = Some(positive("deadline", deadline)?);
        Ok(self)
    }

    /// n.
    #[inline]
    pub fn relative_degree(&self) -> usize {
        self.n
    }

    /// T in s from the anchor, infinite where there is none.
    pub fn deadline(&self) -> f64 {
        self.settings.deadline.unwrap_or(f64::INFINITY)
    }

    /// The settings.
    pub fn settings(&self) -> &FixedTimeSettings {
        &self.settings
    }

    /// Moves `state` to the sample at time `t` (s), where `h` holds h⁽⁰⁾ … h⁽ⁿ⁻¹⁾ (finite), and
    /// returns what the constraint asks for there.
    ///
    /// The first call anchors, as [`Self::anchor`] with the configured deadline and no period does. Arrival is
    /// the first sample with h ≥ 0; the stay constraint takes over at the first sample at which h ≥ μ *and*
    /// it is invariant from there ([`stay::is_invariant`]): at the anchor itself for a start well inside.
    pub fn advance(&self, state: &mut FixedTimeState, t: f64, h: &[f64]) -> Demand {
        self.advance_within(state, t, h, &[0.0; MAX_RELATIVE_DEGREE])
    }

    /// As [`Self::advance`], where h⁽ᵏ⁾ is known to `errors[k]` ≥ 0: what starts a theorem starts from the smallest
    /// derivatives there can be, and what ends one is h < 0 for certain. Arrival stays that of `h` as it is given.
    pub fn advance_within(&self, state: &mut FixedTimeState, t: f64, h: &[f64], errors: &Stack) -> Demand {
        self.advance_by(state, t, h, errors, &Means { hold: state.period, ..Means::UNKNOWN })
    }

    /// As [`Self::advance_within`], where `means` says what plant and inputs can do: the rate of the stay constraint is
    /// chosen for that.
    pub fn advance_by(
        &self,
        state: &mut FixedTimeState,
        t: f64,
        h: &[f64],
        errors: &Stack,
        means: &Means,
    ) -> Demand {
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

    /// [`Self::advance_within`] for n = `N`.
    fn advance_degree<const N: usize>(
        &self,
        state: &mut FixedTimeState,
        t: f64,
        h: &[f64],
        errors: &Stack,
        means: &Means,
    ) -> Demand {
        let lowest: [f64; N] = from_fn(|k| h[k] - errors[k]);
        let is_outside = h[0] + errors[0] < 0.0;
        if state.phase == Phase::Waiting {
            self.anchor(state, t, &lowest, self.deadline(), 0.0);
        }
        if let Some(condition) = &self.condition {
            return self.advance_condition(&**condition, state, t, h);
        }
        let was_left = state.phase == Phase::Stay && is_outside;
        if let Some(recovery) = self.settings.recovery.filter(|_| was_left) {
            self.anchor(state, t, &lowest, recovery, state.period);
            state.recoveries = state.recoveries.saturating_add(1);
        }
        let elapsed = (t - state.anchor_time).max(0.0);
        if h[0] >= 0.0 && state.arrival.is_none() {
            state.arrival = Some(t);
        }
        self.change_phase(state, elapsed, &lowest, is_outside, means);
        let (floor, profile) = match state.phase {
            Phase::Stay => self.stay(state, h, &lowest, means),
            Phase::Left => {
                state.guaranteed = false;
                (state.stay_rate, state.stay_margin, state.pull) =
                    (self.base_rate(&lowest, means), state.margin, 0.0);
                (-lower_terms(state.stay_rate, &from_margin::<N>(h, state.margin)), state.margin)
            }
            _ => {
                let e = from_margin::<N>(h, state.margin);
                let (floor, bound) = self.approach(state, elapsed, &e, errors);
                (floor, bound + state.margin)
            }
        };
        // What was promised is broken here; the new promise is for later samples to give.
        state.guaranteed &= !was_left;
        let floor = floor + self.settings.disturbance;
        let time_left = if state.deadline.is_finite() { (state.deadline - elapsed).max(0.0) } else { 0.0 };
        Demand { floor, profile, time_left }
    }

    /// Which phase begins at this sample.
    fn change_phase<const N: usize>(
        &self,
        state: &mut FixedTimeState,
        elapsed: f64,
        lowest: &[f64; N],
        is_outside: bool,
        means: &Means,
    ) {
        let (is_inside, is_over) = (lowest[0] >= 0.0, elapsed >= state.deadline);
        let keeps = |margin: f64| {
            let base = self.base_rate(lowest, means);
            is_inside && stay::is_invariant(base, &from_margin::<N>(lowest, margin))
        };
        state.phase = match state.phase {
            Phase::Stay | Phase::Left if is_outside => Phase::Left,
            Phase::Stay => Phase::Stay,
            Phase::Left if is_inside => Phase::Stay,
            // Until then the approach goes on; from the deadline on it keeps h ≥ 0 too, with r = 0.
            Phase::Approach if keeps(state.margin) => {
                // How h can be influenced far outside says nothing of how it can be here.
                state.gain *= means.weight;
                Phase::Stay
            }
            Phase::Late if is_inside => Phase::Stay,
            Phase::Approach | Phase::Late if is_over && is_outside => Phase::Late,
            other => other,
        };
        state.guaranteed &= !matches!(state.phase, Phase::Late | Phase::Left);
    }

    /// The floor under h⁽ⁿ⁾ and the bound on h while the set is kept.
    fn stay<const N: usize>(
        &self,
        state: &mut FixedTimeState,
        h: &[f64],
        lowest: &[f64; N],
        means: &Means,
    ) -> (f64, f64) {
        let drift = means.drift - self.settings.disturbance;
        let means = Means { drift, ..*means };
        let keep_from = |h: &[f64; N]| stay::keep(h, state.margin, self.base_rate(h, &means), &means);
        let is_exact = lowest[..] == h[..N];
        let mut keep = keep_from(&from_fn(|k| h[k]));
        let is_kept = |rate: f64| stay::affordable_margin(rate, lowest) >= 0.0;
        if !is_exact && !is_kept(keep.rate) {
            keep = keep_from(lowest);
        }
        (state.stay_rate, state.stay_margin, state.pull) = (keep.rate, keep.margin, keep.pull);
        // Errors are bounded to first order; what is left of the margin is for the rest.
        let is_covered = || is_kept(keep.rate) && keep.margin >= stay::ENOUGH * state.margin;
        state.guaranteed = keep.is_invariant && (is_exact || is_covered());
        (keep.pull - lower_terms(keep.rate, &from_margin::<N>(h, keep.margin)), keep.margin)
    }

    /// Whether the rate and the margin with which the set is kept in `state` are constants, that do not depend on the sample.
    pub(crate) fn keeps_evenly(&self, state: &FixedTimeState) -> bool {
        let settings = &self.settings;
        let rate = settings
            .stay_rate
            .or(settings.rate)
            .or(settings.deadline.map(|deadline| FixedTimeSettings::default_rate(deadline, state.period)));
        state.stay_margin == state.margin && rate == Some(state.stay_rate)
    }

    /// The rate in 1/s with which the set is kept where nothing asks for a larger one.
    fn base_rate<const N: usize>(&self, h: &[f64; N], means: &Means) -> f64 {
        /// The part of what bounds allow that is used where there is time.
        const COMFORTABLE: f64 = 0.5;
        if let Some(rate) = self.settings.stay_rate.or(self.settings.rate) {
            return rate;
        }
        let by_time = match self.settings.deadline {
            Some(deadline) => FixedTimeSettings::default_rate(deadline, means.hold),
            None => f64::INFINITY,
        };
        let brakes = COMFORTABLE * (means.drift + means.reach);
        let by_brakes = match N <= 2 && brakes.is_finite() && brakes > 0.0 && h[0] > 0.0 {
            true if N == 1 => brakes / h[0],
            true => (brakes / h[0]).sqrt(),
            false if by_time.is_finite() => by_time,
            false => FixedTimeSettings::DEFAULT_KEEP_RATE,
        };
        let by_hold = stay::LARGEST_RATE_TIMES_HOLD / means.hold;
        let rate = by_time.min(by_brakes);
        if means.hold > 0.0 { rate.min(by_hold) } else { rate }
    }

    /// [`Self::advance`] under a constraint of one's own, after anchoring.
    fn advance_condition(
        &self,
        condition: &dyn Condition,
        state: &mut FixedTimeState,
        t: f64,
        h: &[f64],
    ) -> Demand {
        let (n, deadline, margin) = (self.n, state.deadline, state.margin);
        let elapsed = (t - state.anchor_time).max(0.0);
        state.phase = match state.arrival {
            _ if h[0] >= 0.0 => Phase::Stay,
            Some(_) => Phase::Left,
            None if elapsed >= deadline => Phase::Late,
            None => Phase::Approach,
        };
        if h[0] >= 0.0 && state.arrival.is_none() {
            state.arrival = Some(t);
        }
        let mut e = [0.0; MAX_RELATIVE_DEGREE];
        e[..n].copy_from_slice(&h[..n]);
        e[0] -= margin;
        let anchor = &state.anchor[..n];
        let floor = condition.floor(anchor, deadline, elapsed, &e[..n]) + self.settings.disturbance;
        let bound = condition.lower_bound(anchor, deadline, elapsed).unwrap_or(f64::NEG_INFINITY);
        Demand { floor, profile: bound + margin, time_left: (deadline - elapsed).max(0.0) }
    }

    /// Why the configured method is not the one in force since the anchor in `state`, if it is not:
    /// `None` too before the anchor. Computed anew: not for every step.
    pub fn refusal(&self, state: &FixedTimeState) -> Option<Refusal> {
        if !state.fallback || state.phase == Phase::Waiting {
            return None;
        }
        let (anchor, deadline) = (&state.anchor[..self.n], state.deadline);
        match (&self.settings.method, &self.own) {
            (Method::RepeatedRoot, _) => {
                repeated_root::rate(anchor, deadline).err().map(Refusal::NoAdmissibleRate)
            }
            (Method::ReferenceProfile, Some(own)) => {
                profile::check(&**own, anchor, deadline).err().map(Refusal::Profile)
            }
            _ => None,
        }
    }

    /// Starts the promise anew at time `t` (s), where `h` holds h⁽⁰⁾ … h⁽ⁿ⁻¹⁾ (finite): the barrier is to
    /// be reached within `deadline` seconds from there, with inputs held for `period` ≥ 0 seconds (0: not
    /// held, or not known). The count of recoveries goes on.
    ///
    /// A deadline ≤ 0 is past already: nothing is guaranteed, the phase of the next [`Self::advance`] is
    /// [`Phase::Late`] where h < 0, and the target is h = μ at once, approached with the rate.
    pub fn anchor(&self, state: &mut FixedTimeState, t: f64, h: &[f64], deadline: f64, period: f64) {
        let settings = &self.settings;
        let (n, past) = (self.n, deadline <= 0.0);
        let allowed = if past { self.deadline() } else { deadline };
        let default_rate = FixedTimeSettings::default_rate(allowed, period);
        let stay_rate = settings.stay_rate.or(settings.rate).unwrap_or(match allowed.is_finite() {
            true => default_rate,
            false => FixedTimeSettings::DEFAULT_KEEP_RATE,
        });
        let keeps = self.condition.is_none() && (h[0] >= 0.0 || deadline == f64::INFINITY);
        let mut anchor = [0.0; MAX_RELATIVE_DEGREE];
        anchor[..n].copy_from_slice(&h[..n]);
        let mut margin = settings.margin;
        let (mut rate, mut fallback) = (stay_rate, false);
        let mut guaranteed = !past && self.condition.is_none();
        match settings.method {
            _ if self.condition.is_some() => {}
            Method::ReferenceProfile => {
                rate = settings.rate.unwrap_or(if keeps { stay_rate } else { default_rate });
                if keeps {
                    margin += if period > 0.0 { sampled::ROUND_OFF * h[0].abs() } else { 0.0 };
                } else if !past && period > 0.0 {
                    let attenuation = self.attenuation(rate, deadline);
                    margin += sampled::margin(self.built_in(), &anchor[..n], deadline, attenuation, period);
                }
            }
            Method::FirstOrder(exponent) if !past => rate = exponent.rate(deadline),
            Method::RepeatedRoot | Method::FirstOrder(_) => {}
        }
        anchor[0] -= margin;
        if !past && !keeps {
            if settings.method == Method::RepeatedRoot {
                match repeated_root::rate(&anchor[..n], deadline) {
                    Ok(root) => rate = root,
                    Err(_) => (fallback, guaranteed) = (true, false),
                }
            } else if let Some(own) = &self.own {
                fallback = profile::check(&**own, &anchor[..n], deadline).is_err();
            }
        }
        *state = FixedTimeState {
            phase: if keeps { Phase::Stay } else { Phase::Approach },
            start_time: state.start_time,
            anchor_time: t,
            deadline,
            recoveries: state.recoveries,
            postponed: state.postponed,
            anchor,
            rate,
            stay_rate,
            stay_margin: margin,
            pull: 0.0,
            gain: 0.0,
            margin,
            period,
            fallback,
            arrival: None,
            guaranteed,
            unmet: state.unmet,
        };
    }

    /// Takes into account, on the way, that inputs are held for `period` > 0 seconds: margin and default
    /// rates become what they would have been had it been known at the anchor. With the reference profile
    /// h − μ − r changes by at most C(2n − 1, n) (elapsed/T)ⁿ times the change of the margin; other methods
    /// take none.
    pub fn resample(&self, state: &mut FixedTimeState, period: f64) {
        if self.settings.method != Method::ReferenceProfile || self.condition.is_some() {
            return;
        }
        let FixedTimeState { arrival, guaranteed, phase, gain, .. } = *state;
        let mut h = state.anchor;
        h[0] += state.margin;
        self.anchor(state, state.anchor_time, &h[..self.n], state.deadline, period);
        (state.arrival, state.guaranteed, state.phase, state.gain) = (arrival, guaranteed, phase, gain);
    }

    /// Starts the profile anew from the sample at time `t` (s) that `state` has been moved to, where `h` holds the smallest
    /// h⁽⁰⁾ … h⁽ⁿ⁻¹⁾ there, if the theorem has been lost on the way to it: with the time that is left until the same
    /// deadline. The error is zero again, so the theorem applies again. Returns whether it did.
    ///
    /// Not shortly before the deadline, where a profile from anywhere would ask for any input, nor along a profile of
    /// one's own, whose check takes long.
    pub fn restart(&self, state: &mut FixedTimeState, t: f64, h: &[f64], period: f64) -> bool {
        /// Samples, and part of the configured deadline, that must be left.
        const SAMPLES: f64 = 10.0;
        const PART: f64 = 0.05;
        let left = state.deadline - (t - state.anchor_time);
        let lost = state.phase == Phase::Approach && !state.guaranteed && h[0] < 0.0 && t > state.anchor_time;
        let can = self.settings.method == Method::ReferenceProfile
            && self.own.is_none()
            && self.condition.is_none();
        // Without a period inputs are not held, or not known to be: there is no theorem to win back.
        if !lost || !can || period <= 0.0 || left < (SAMPLES * period).max(PART * self.deadline()) {
            return false;
        }
        let FixedTimeState { arrival, gain, .. } = *state;
        self.anchor(state, t, h, left, period);
        (state.arrival, state.gain) = (arrival, gain);
        true
    }

    /// The profile of the settings.
    pub(super) fn built_in(&self) -> &'static dyn Profile {
        match self.settings.profile {
            ProfileKind::Hermite => &Hermite,
            ProfileKind::LowPeak => &LowPeak,
        }
    }

    /// The profile in force.
    pub(super) fn in_force(&self, state: &FixedTimeState) -> &dyn Profile {
        match &self.own {
            Some(own) if !state.fallback => &**own,
            _ => self.built_in(),
        }
    }

    /// The profile in force and its derivatives, without the margin.
    pub(super) fn profile(&self, state: &FixedTimeState, elapsed: f64) -> Derivatives {
        if state.deadline <= 0.0 {
            return [0.0; MAX_RELATIVE_DEGREE + 1];
        }
        self.in_force(state).evaluate(&state.anchor[..self.n], state.deadline, elapsed)
    }

    /// The floor under h⁽ⁿ⁾ and the bound on h − μ during the approach.
    #[inline]
    fn approach<const N: usize>(
        &self,
        state: &mut FixedTimeState,
        elapsed: f64,
        e: &[f64; N],
        errors: &Stack,
    ) -> (f64, f64) {
        let anchor = &state.anchor[..N];
        match self.settings.method {
            Method::RepeatedRoot => {
                // What the constraint, active from here on, leads to at the deadline: errors grow with a negative rate.
                let ahead = lower_bound(state.rate, e, (state.deadline - elapsed).max(0.0));
                let scale = MARGIN_TOLERANCE * (anchor[0].abs() + state.margin);
                state.guaranteed &= ahead >= -state.margin - scale;
                (-lower_terms(state.rate, e), lower_bound(state.rate, anchor, elapsed))
            }
            Method::FirstOrder(exponent) => {
                let deadline = state.deadline;
                let bound = exponent.lower_bound(anchor[0], deadline, elapsed);
                // The comparison can start at any sample that is not below the bound.
                state.guaranteed = state.phase == Phase::Approach && elapsed < deadline && e[0] >= bound;
                (exponent.floor(anchor[0], deadline, e[0]), bound)
            }
            Method::ReferenceProfile => {
                let r = match (&self.own, self.settings.profile) {
                    // As below, with n known to the compiler.
                    (None, ProfileKind::Hermite) => {
                        HermiteProfile::new(anchor, state.deadline).evaluate(elapsed)
                    }
                    _ => self.profile(state, elapsed),
                };
                let error: [f64; N] = from_fn(|k| e[k] - r[k]);
                let terms = match &self.settings.rates {
                    Some(rates) => rates.lower_terms(&error),
                    None => lower_terms(state.rate, &error),
                };
                // The lemma with what is left of the margin: from this sample on h ≥ r, if the constraint holds.
                let lowest: [f64; N] = from_fn(|k| error[k] - errors[k]);
                let left = state.margin
                    + match &self.settings.rates {
                        Some(rates) => rates.affordable_margin(&lowest),
                        None => stay::affordable_margin(state.rate, &lowest),
                    };
                let scale = MARGIN_TOLERANCE * (e[0].abs() + r[0].abs() + state.margin);
                state.guaranteed = state.phase == Phase::Approach && state.deadline > 0.0 && left >= -scale;
                (r[N] - terms, r[0])
            }
        }
    }
}
