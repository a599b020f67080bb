//! The condition that follows a reference profile: Π (D + a_i)(h − μ − r) ≥ 0.
//!
//! The error starts at zero, so h ≥ μ + r for ever (`docs/theory.md#profile`). The profiles themselves are in
//! [`profile`].

use alloc::sync::Arc;

use super::comparison::lower_terms;
use super::condition::{Abilities, AnchorChange, Anchored, Anchoring, Bound, Condition, Rates, Sample};
use super::fixed_time::Refusal;
use super::operator::Operator;
use super::profile::{self, Derivatives, Hermite, LowPeak, Profile};
use super::settings::{FixedTimeSettings, ProfileKind};
use super::{sampled, stay};
use crate::MAX_RELATIVE_DEGREE;

/// Round-off of h − μ − r, as a part of its terms.
const MARGIN_TOLERANCE: f64 = 1e-12;

/// The condition of [`Method::ReferenceProfile`](super::Method::ReferenceProfile).
#[derive(Clone)]
pub(super) struct ReferenceProfile {
    kind: ProfileKind,
    /// A custom profile, used instead of `kind`.
    own: Option<Arc<dyn Profile + Send + Sync>>,
    rate: Option<f64>,
    rates: Option<Operator>,
}

impl ReferenceProfile {
    pub(super) fn new(settings: &FixedTimeSettings) -> Self {
        Self { kind: settings.profile, own: None, rate: settings.rate, rates: settings.rates }
    }

    /// The same along a custom profile.
    pub(super) fn along(self, own: Arc<dyn Profile + Send + Sync>) -> Self {
        Self { own: Some(own), ..self }
    }

    /// Whether it follows a custom profile.
    pub(super) fn has_own_profile(&self) -> bool {
        self.own.is_some()
    }

    /// The profile of the settings.
    fn built_in(&self) -> &'static dyn Profile {
        match self.kind {
            ProfileKind::Hermite => &Hermite,
            ProfileKind::LowPeak => &LowPeak,
        }
    }

    /// The profile in force.
    fn in_force(&self, at: &Sample) -> &dyn Profile {
        match &self.own {
            Some(own) if !at.fallback => &**own,
            _ => self.built_in(),
        }
    }

    /// Π (D + a_i) e without its highest derivative.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn lower_terms(&self, rate: f64, e: &[f64]) -> f64 {
        match &self.rates {
            Some(rates) => rates.lower_terms(e),
            None => lower_terms(rate, e),
        }
    }

    /// The attenuation of a [`PeriodBound`](sampled::PeriodBound), for errors against the profile.
    fn attenuation(&self, rate: f64, n: usize, time_left: f64) -> f64 {
        match &self.rates {
            Some(rates) => rates.without_last().weights[0],
            None => sampled::attenuation(rate, n, time_left),
        }
    }
}

impl Condition for ReferenceProfile {
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn bound(&self, at: &Sample) -> Bound {
        let n = at.e.len();
        let r = self.profile(at, at.elapsed);
        let (mut error, mut lowest) = ([0.0; MAX_RELATIVE_DEGREE], [0.0; MAX_RELATIVE_DEGREE]);
        for k in 0..n {
            error[k] = at.e[k] - r[k];
            lowest[k] = error[k] - at.errors[k];
        }
        let (error, lowest) = (&error[..n], &lowest[..n]);
        // The lemma applies with the remaining margin: h ≥ r from this sample on, if the constraint holds.
        let left = at.margin
            + match &self.rates {
                Some(rates) => rates.affordable_margin(lowest),
                None => stay::affordable_margin(at.rate, lowest),
            };
        let scale = MARGIN_TOLERANCE * (at.e[0].abs() + r[0].abs() + at.margin);
        Bound {
            floor: r[n] - self.lower_terms(at.rate, error),
            lower: r[0],
            applies: at.has_time() && left >= -scale,
        }
    }

    fn abilities(&self) -> Abilities {
        // The check of a custom profile takes long.
        Abilities { hands_over: true, covers_holds: true, allows_errors: true, restarts: self.own.is_none() }
    }

    fn anchor(&self, at: &Anchoring) -> Anchored {
        let rate = self.rate.unwrap_or(if at.keeps { at.stay_rate } else { at.default_rate });
        let (mut margin, mut fallback) = (at.margin, false);
        if at.keeps {
            margin += if at.period > 0.0 { sampled::ROUND_OFF * at.h[0].abs() } else { 0.0 };
        } else if !at.is_past() && at.period > 0.0 {
            let attenuation = self.attenuation(rate, at.h.len(), at.deadline);
            margin += sampled::margin(self.built_in(), at.h, at.deadline, attenuation, at.period);
        }
        if let Some(own) = self.own.as_ref().filter(|_| !at.is_past() && !at.keeps) {
            fallback = profile::check(&**own, &at.error(margin)[..at.h.len()], at.deadline).is_err();
        }
        Anchored { margin, rate, fallback, applies: !at.is_past() }
    }

    fn refusal(&self, at: &Sample) -> Option<Refusal> {
        let own = self.own.as_ref()?;
        profile::check(&**own, at.anchor, at.deadline).err().map(Refusal::Profile)
    }

    #[cfg_attr(not(feature = "small"), inline(always))]
    fn rates(&self, at: &Sample) -> Option<Rates> {
        Some(self.rates.map_or(Rates::Repeated(at.rate), Rates::Each))
    }

    #[cfg_attr(not(feature = "small"), inline(always))]
    fn profile(&self, at: &Sample, elapsed: f64) -> Derivatives {
        match (&self.own, self.kind) {
            _ if !at.has_time() => [0.0; MAX_RELATIVE_DEGREE + 1],
            // As below, with n known to the compiler.
            (None, ProfileKind::Hermite) => Hermite.evaluate(at.anchor, at.deadline, elapsed),
            _ => self.in_force(at).evaluate(at.anchor, at.deadline, elapsed),
        }
    }

    fn anchor_change(&self, at: &Sample, [h, dh]: [&[f64]; 2], period: f64) -> Option<AnchorChange> {
        let n = at.degree();
        let mut change = AnchorChange::default();
        let keeps = h[0] >= 0.0 || at.deadline == f64::INFINITY;
        if keeps && period > 0.0 {
            change.margin = sampled::ROUND_OFF * h[0].signum() * dh[0];
        } else if at.has_time() && period > 0.0 {
            let attenuation = self.attenuation(at.rate, n, at.deadline);
            change.margin =
                sampled::margin_change(self.built_in(), [h, dh], at.deadline, attenuation, period)?;
        }
        change.anchor[..n].copy_from_slice(dh);
        change.anchor[0] -= change.margin;
        Some(change)
    }

    fn bound_change(&self, at: &Sample, change: Option<&AnchorChange>, de: &[f64]) -> Option<[f64; 2]> {
        let n = at.degree();
        let dr = match change {
            Some(change) => self.profile_change(at, change, at.elapsed)?,
            None => [0.0; MAX_RELATIVE_DEGREE + 1],
        };
        let mut error = [0.0; MAX_RELATIVE_DEGREE];
        (0..n).for_each(|k| error[k] = de[k] - dr[k]);
        Some([dr[n] - self.lower_terms(at.rate, &error[..n]), dr[0]])
    }

    fn profile_change(&self, at: &Sample, change: &AnchorChange, elapsed: f64) -> Option<Derivatives> {
        if !at.has_time() {
            return Some([0.0; MAX_RELATIVE_DEGREE + 1]);
        }
        self.in_force(at).directional(at.anchor, &change.anchor[..at.degree()], at.deadline, elapsed)
    }
}
