//! The trait that every constraint implements: a floor under h⁽ⁿ⁾ that is known from h, …, h⁽ⁿ⁻¹⁾.
//!
//! One file per method implements [`Condition`]: `reference_profile` and [`repeated_root`](super::repeated_root) on the way
//! to the set, [`stay`](super::stay) inside it. A custom condition replaces the first two
//! ([`FixedTime::with_condition`](super::FixedTime::with_condition)); the rest of a filter stays as it is.
//!
//! A new method is a file here that implements the trait, a variant of [`Method`](super::Method) and one of `Approach`,
//! which makes the one from the other.

use super::comparison::Stack;
use super::fixed_time::Refusal;
use super::operator::Operator;
use super::profile::Derivatives;
use super::sampled::{self, PeriodBound};
use crate::MAX_RELATIVE_DEGREE;

/// No error of any derivative.
pub(super) const EXACT: Stack = [0.0; MAX_RELATIVE_DEGREE];

/// A sample, as a condition sees it. With e = h − μ:
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Sample<'a> {
    /// e⁽ʲ⁾ at the anchor, `[h]`/sʲ, j < n.
    pub anchor: &'a [f64],
    /// T in s, counted from the anchor: infinite if there is none, ≤ 0 if it had passed at the anchor.
    pub deadline: f64,
    /// τ ≥ 0, the time in s since the anchor.
    pub elapsed: f64,
    /// e⁽ʲ⁾ now, `[h]`/sʲ, j < n.
    pub e: &'a [f64],
    /// A bound ≥ 0 on the error of e⁽ʲ⁾, j < n at least. Default: 0.
    pub errors: &'a [f64],
    /// μ in `[h]`. Default: 0.
    pub margin: f64,
    /// a in 1/s, as [`Condition::anchor`] chose it. Default: 0.
    pub rate: f64,
    /// The part of the floor that leads back to a larger margin, `[h]`/sⁿ. Of the stay constraint only. Default: 0.
    pub pull: f64,
    /// Whether [`Condition::anchor`] fell back on another choice. Default: false.
    pub fallback: bool,
    /// Whether the theorem behind the condition applied at the previous sample. Default: true.
    pub on_course: bool,
}

impl<'a> Sample<'a> {
    /// A sample `elapsed` s after the anchor; everything else has its default.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub fn new(anchor: &'a [f64], deadline: f64, elapsed: f64, e: &'a [f64]) -> Self {
        Self {
            anchor,
            deadline,
            elapsed,
            e,
            errors: &EXACT,
            margin: 0.0,
            rate: 0.0,
            pull: 0.0,
            fallback: false,
            on_course: true,
        }
    }

    /// Whether the deadline lies after the anchor.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn has_time(&self) -> bool {
        self.deadline > 0.0
    }

    /// The relative degree, n.
    pub(super) fn degree(&self) -> usize {
        self.anchor.len()
    }

    /// The time in s until the deadline, at least `period`.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn time_left(&self, period: f64) -> f64 {
        (self.deadline - self.elapsed).max(period)
    }
}

/// The floor that a condition sets at a sample, and what it promises.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// The least h⁽ⁿ⁾ allowed, `[h]`/sⁿ. If it is not finite, [`Status::Singular`](crate::filter::Status::Singular) is
    /// reported.
    pub floor: f64,
    /// The lower bound on e that the condition promises now, `[h]`; −∞ if it promises none.
    pub lower: f64,
    /// Whether the theorem behind the condition applies from this sample on.
    pub applies: bool,
}

impl Bound {
    /// A floor that promises nothing.
    pub fn floor(floor: f64) -> Self {
        Self { floor, lower: f64::NEG_INFINITY, applies: false }
    }
}

/// The data from which a condition is anchored.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Anchoring<'a> {
    /// h⁽ʲ⁾, `[h]`/sʲ, j < n.
    pub h: &'a [f64],
    /// T in s from now; ≤ 0 if it has passed.
    pub deadline: f64,
    /// The time in s for which inputs are held; 0 if they are not, or if it is not known.
    pub period: f64,
    /// The requested margin, `[h]`: that of the settings, or the one that a plan behind the constraint needs.
    pub margin: f64,
    /// The default rate for this deadline and period, 1/s.
    pub default_rate: f64,
    /// The rate of the stay constraint, 1/s.
    pub stay_rate: f64,
    /// Whether the set is to be kept from now on, rather than to be reached.
    pub keeps: bool,
}

impl Anchoring<'_> {
    /// Whether the deadline has passed already.
    pub fn is_past(&self) -> bool {
        self.deadline <= 0.0
    }

    /// h − `margin` and its derivatives.
    pub(super) fn error(&self, margin: f64) -> Stack {
        let mut e = [0.0; MAX_RELATIVE_DEGREE];
        e[..self.h.len()].copy_from_slice(self.h);
        e[0] -= margin;
        e
    }
}

/// The choice of a condition at an anchor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchored {
    /// μ in `[h]`: the requested margin plus the expected cost of held inputs.
    pub margin: f64,
    /// a in 1/s.
    pub rate: f64,
    /// Whether the method could not be used from here, so that another replaced it.
    pub fallback: bool,
    /// Whether its theorem applies.
    pub applies: bool,
}

/// Further uses that a promise may make of a condition.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Abilities {
    /// The stay constraint takes over inside the set. Without this, the condition is enforced for ever, and the phases only
    /// report what is seen.
    pub hands_over: bool,
    /// Its margin covers the cost of held inputs, and changes if samples turn out to be farther apart.
    pub covers_holds: bool,
    /// Its bound allows for [errors](Sample::errors) of the derivatives.
    pub allows_errors: bool,
    /// It may restart at any time during the approach, and its theorem then applies again.
    pub restarts: bool,
}

/// The derivative of an anchor as h moves at the anchoring sample.
#[derive(Clone, Copy, Debug, Default)]
#[non_exhaustive]
pub struct AnchorChange {
    /// Derivatives of e⁽ʲ⁾ at the anchor.
    pub anchor: Stack,
    /// Derivative of the margin.
    pub margin: f64,
    /// Derivative of the rate.
    pub rate: f64,
}

/// (D + a)ⁿ or Π (D + a_i), as a condition applies it to h − μ − r.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rates {
    /// n times this rate in 1/s, of either sign.
    Repeated(f64),
    /// n positive rates.
    Each(Operator),
}

/// A constraint h⁽ⁿ⁾ ≥ φ for a barrier of relative degree n.
///
/// It has no state: all that it depends on is in its arguments, and the same arguments give the same bits. Only
/// [`bound`](Self::bound) is required. The defaults are those of a condition without a theorem, enforced only at the
/// samples.
pub trait Condition {
    /// The floor φ at a sample, and what it promises.
    fn bound(&self, at: &Sample) -> Bound;

    /// Further uses that a promise may make of it.
    fn abilities(&self) -> Abilities {
        Abilities::default()
    }

    /// Margin and rate from an anchor on.
    fn anchor(&self, at: &Anchoring) -> Anchored {
        Anchored { margin: at.margin, rate: at.stay_rate, fallback: false, applies: false }
    }

    /// Why it [fell back](Anchored::fallback) at the anchor of `at`.
    fn refusal(&self, _at: &Sample) -> Option<Refusal> {
        None
    }

    /// The operator, if φ is linear: Π (D + a_i)(h − μ − r) ≥ pull. Such a condition has a form for held inputs
    /// ([`sampled`]).
    fn rates(&self, _at: &Sample) -> Option<Rates> {
        None
    }

    /// r of [`rates`](Self::rates) and its derivatives, `elapsed` s after the anchor.
    fn profile(&self, _at: &Sample, _elapsed: f64) -> Derivatives {
        [0.0; MAX_RELATIVE_DEGREE + 1]
    }

    /// (S) of [`sampled`] from the sample `at` over `period` > 0 seconds; `None` if φ is not linear. `h` holds h⁽⁰⁾ …
    /// h⁽ⁿ⁻¹⁾, and h⁽ⁿ⁾ is disturbed by up to `disturbance`. It follows from [`rates`](Self::rates) and
    /// [`profile`](Self::profile), so there is nothing to define. It is here to be compiled with them.
    fn over_period(&self, at: &Sample, h: &[f64], period: f64, disturbance: f64) -> Option<PeriodBound> {
        sampled::over_period(self, at, h, period, disturbance)
    }

    /// The derivative of the choice of [`anchor`](Self::anchor) as h (`h[0]`) moves along `h[1]`; `None` if it is not known.
    /// `period` is that of the anchor.
    fn anchor_change(&self, _at: &Sample, _h: [&[f64]; 2], _period: f64) -> Option<AnchorChange> {
        None
    }

    /// The derivatives of the floor and of the lower bound on e as e moves along `de`, and the anchor by `change` if this is
    /// its sample. `None` if they are not known.
    fn bound_change(&self, _at: &Sample, _change: Option<&AnchorChange>, _de: &[f64]) -> Option<[f64; 2]> {
        None
    }

    /// The derivative of [`profile`](Self::profile) as the anchor changes by `change`; `None` if it is not known.
    fn profile_change(&self, _at: &Sample, _change: &AnchorChange, _elapsed: f64) -> Option<Derivatives> {
        None
    }
}
