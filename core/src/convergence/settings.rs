//! The settings of a barrier's promise, with their defaults.

use alloc::borrow::ToOwned;
use alloc::string::String;

use super::operator::Operator;
use crate::MAX_RELATIVE_DEGREE;
use crate::error::{Error, ErrorKind, non_negative, positive};

/// The method by which the deadline is met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Method {
    /// The paper's: (D + a)ⁿ (h − μ) ≥ 0 with the rate of [`repeated_root::rate`](super::repeated_root::rate).
    /// Relative degree 2 and above; for odd ones many anchors have no such rate
    /// ([`FixedTime::refusal`](super::FixedTime::refusal)).
    RepeatedRoot,
    /// (D + a)ⁿ (h − μ − r) ≥ 0 with the [`Hermite`](super::hermite::Hermite) profile r, or a custom one
    /// ([`FixedTime::with_profile`](super::FixedTime::with_profile)).
    #[default]
    ReferenceProfile,
}

/// The profile that [`Method::ReferenceProfile`] follows, unless it is a custom one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum ProfileKind {
    /// [`Hermite`](super::hermite::Hermite): the polynomial of least ∫ (r⁽ⁿ⁾)².
    #[default]
    Hermite,
    /// [`LowPeak`](super::profile::LowPeak): for n = 1 and 2 the profile of least peak |r⁽ⁿ⁾|.
    LowPeak,
}

/// The answer to a deadline that the input bounds certainly do not allow, at the anchor's sample or at any later one
/// ([`reach`](crate::reach)).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Infeasible {
    /// Report it and keep the deadline.
    #[default]
    Report,
    /// Give up the deadline. The promise restarts from that sample, with twice the earliest time at which h ≥ 0 is not ruled
    /// out; the factor grows by half each further time. A deadline that passes with the state outside is given up as well.
    /// If no bound is known, the new one has the configured length. Counted in
    /// [`FixedTimeState::postponed`](super::FixedTimeState::postponed).
    Earliest,
}

/// Settings of one barrier's promise.
///
/// [`Self::within`] and [`Self::keeping`] have the defaults; the method of the name of a field replaces it.
///
/// ```
/// use punctual_core::filter::BarrierSettings;
///
/// let settings = BarrierSettings::within(10.0).margin(0.02).stay_rate(1.5);
/// assert_eq!((settings.deadline, settings.margin, settings.rate), (Some(10.0), 0.02, None));
/// ```
///
/// In a file, keys that are left out have their defaults. The [`FilterBuilder`](crate::filter::FilterBuilder) checks all
/// numbers, whatever their source.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default = "FixedTimeSettings::keeping", deny_unknown_fields))]
#[non_exhaustive]
pub struct FixedTimeSettings {
    /// T in s from the anchor, finite, > 0. A deadline before the next sample is met at that sample for relative degree 1,
    /// if the filter looks over the period ([`Sampling`](crate::filter::Sampling)), and later for higher ones. `None`: the
    /// set is to be kept from a start inside it; from a start outside nothing is promised.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub deadline: Option<f64>,
    /// The method by which the deadline is met. Default: [`Method::ReferenceProfile`].
    pub method: Method,
    /// The profile that [`Method::ReferenceProfile`] follows. Default: [`ProfileKind::Hermite`].
    pub profile: ProfileKind,
    /// The answer to a deadline that certainly cannot be met. Default: [`Infeasible::Report`].
    pub infeasible: Infeasible,
    /// a in 1/s, finite, > 0: how fast an error against the profile decays. Default: [`Self::default_rate`] of the deadline
    /// in force and the sampling period.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub rate: Option<f64>,
    /// n rates for the errors against the profile, Π (D + a_i), in place of `rate`. Default: none.
    pub rates: Option<Operator>,
    /// a of the stay constraint in 1/s, finite, > 0; a larger one is used if necessary ([`stay::keep`](super::stay::keep)).
    /// Default: `rate`, else 20/T. If inputs have bounds and n ≤ 2, it is at most what braking with half of φ_max allows,
    /// (φ_max/2e)^{1/n}; φ_max is the largest h⁽ⁿ⁾ within the bounds. Without a deadline it is that alone, else 2/s.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub stay_rate: Option<f64>,
    /// μ in the unit of h, finite, ≥ 0: arrive and stay this far inside. The expected cost of held inputs
    /// ([`sampled::margin`](super::sampled::margin)) is added if the period is known.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub margin: f64,
    /// Time in s, finite, > 0, within which a barrier that was left after an arrival is to be reached again. Leaving then
    /// anchors again with this deadline, or with the remainder of the first one while that is ahead. `None`, the default:
    /// leaving is reported ([`Phase::Left`](super::Phase::Left)) and the stay constraint pulls back, without a deadline.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub recovery: Option<f64>,
    /// W in `[h]`/sⁿ, finite, ≥ 0: a bound on the part of h⁽ⁿ⁾ that the model lacks, such as L_wL_f^{n−1}h w for a
    /// disturbance w. The constraint requires that much more, so the promise holds for every disturbance within the bound. A
    /// disturbance must enter h⁽ⁿ⁾ only, and no earlier derivative. Default: 0.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub disturbance: f64,
}

impl FixedTimeSettings {
    /// Rate times deadline of [`Self::default_rate`], for periods that are short against the deadline.
    pub const DEFAULT_RATE_TIMES_DEADLINE: f64 = 20.0;

    /// The default of `stay_rate` in 1/s if there is neither a deadline nor a bound on the inputs.
    pub const DEFAULT_KEEP_RATE: f64 = 2.0;

    /// Rate times sampling period that [`Self::default_rate`] stays below.
    pub const DEFAULT_RATE_TIMES_PERIOD: f64 = 0.5;

    /// The defaults for a deadline of `deadline` seconds: reference profile, default rates, no margin.
    pub fn within(deadline: f64) -> Self {
        Self {
            deadline: Some(deadline),
            method: Method::default(),
            profile: ProfileKind::default(),
            infeasible: Infeasible::default(),
            rate: None,
            rates: None,
            stay_rate: None,
            margin: 0.0,
            recovery: None,
            disturbance: 0.0,
        }
    }

    /// The defaults for a set that is to be kept and has no deadline.
    pub fn keeping() -> Self {
        Self { deadline: None, ..Self::within(1.0) }
    }

    /// Replaces [`Self::deadline`](field@Self::deadline).
    #[must_use]
    pub fn deadline(self, deadline: impl Into<Option<f64>>) -> Self {
        Self { deadline: deadline.into(), ..self }
    }

    /// Replaces [`Self::method`](field@Self::method).
    #[must_use]
    pub fn method(self, method: Method) -> Self {
        Self { method, ..self }
    }

    /// Replaces [`Self::profile`](field@Self::profile).
    #[must_use]
    pub fn profile(self, profile: ProfileKind) -> Self {
        Self { profile, ..self }
    }

    /// Replaces [`Self::infeasible`](field@Self::infeasible).
    #[must_use]
    pub fn infeasible(self, infeasible: Infeasible) -> Self {
        Self { infeasible, ..self }
    }

    /// Replaces [`Self::rate`](field@Self::rate).
    #[must_use]
    pub fn rate(self, rate: impl Into<Option<f64>>) -> Self {
        Self { rate: rate.into(), ..self }
    }

    /// Replaces [`Self::rates`](field@Self::rates).
    #[must_use]
    pub fn rates(self, rates: impl Into<Option<Operator>>) -> Self {
        Self { rates: rates.into(), ..self }
    }

    /// Replaces [`Self::stay_rate`](field@Self::stay_rate).
    #[must_use]
    pub fn stay_rate(self, stay_rate: impl Into<Option<f64>>) -> Self {
        Self { stay_rate: stay_rate.into(), ..self }
    }

    /// Replaces [`Self::margin`](field@Self::margin).
    #[must_use]
    pub fn margin(self, margin: f64) -> Self {
        Self { margin, ..self }
    }

    /// Replaces [`Self::recovery`](field@Self::recovery).
    #[must_use]
    pub fn recovery(self, recovery: impl Into<Option<f64>>) -> Self {
        Self { recovery: recovery.into(), ..self }
    }

    /// Replaces [`Self::disturbance`](field@Self::disturbance).
    #[must_use]
    pub fn disturbance(self, disturbance: f64) -> Self {
        Self { disturbance, ..self }
    }

    /// The default of both rates in 1/s: the smaller of 20/T and 1/(2δ), for a deadline T > 0 and a period
    /// δ ≥ 0, both in s.
    ///
    /// An error of order n has decayed after about n/a, 0.4 T for n = 8. That is early enough before the deadline, and slow
    /// enough that inputs remain of the size that the profile itself needs. A rate above 1/(2δ) requires more than two
    /// samples can do.
    pub fn default_rate(deadline: f64, period: f64) -> f64 {
        let by_deadline = Self::DEFAULT_RATE_TIMES_DEADLINE / deadline;
        if period > 0.0 { by_deadline.min(Self::DEFAULT_RATE_TIMES_PERIOD / period) } else { by_deadline }
    }

    pub(super) fn validated(self, n: usize) -> Result<Self, Error> {
        let unsupported = |message: String| Err(Error::new(ErrorKind::Unsupported, "method", message));
        if n == 0 || n > MAX_RELATIVE_DEGREE {
            let message = format!("is {n}, must be 1 to {MAX_RELATIVE_DEGREE}");
            return Err(Error::new(ErrorKind::RelativeDegree, "relative_degree", message));
        }
        super::approach::check(self.method, n)?;
        if let Some(deadline) = self.deadline {
            positive("deadline", deadline)?;
        } else if self.method != Method::ReferenceProfile {
            return unsupported(
                "has no deadline to meet; leave it out for a barrier that is only kept".into(),
            );
        }
        for (field, value) in
            [("rate", self.rate), ("stay_rate", self.stay_rate), ("recovery", self.recovery)]
        {
            if let Some(value) = value {
                positive(field, value)?;
            }
        }
        if let Some(rates) = self.rates {
            let mut refused = None;
            if rates.order() != n {
                refused =
                    Some(format!("has {} components, must have {n}, the relative degree", rates.order()));
            } else if self.rate.is_some() {
                refused = Some("given beside `rate`, which it replaces".to_owned());
            } else if self.method != Method::ReferenceProfile {
                refused = Some("belongs to the reference profile".to_owned());
            }
            if let Some(message) = refused {
                return Err(Error::new(ErrorKind::Dimension, "rates", message));
            }
        }
        non_negative("margin", self.margin)?;
        non_negative("disturbance", self.disturbance)?;
        Ok(self)
    }
}
