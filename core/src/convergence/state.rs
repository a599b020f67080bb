//! The memory of a promise between samples.

use super::comparison::Stack;
use super::condition::{EXACT, Sample};
use super::phase::Phase;

/// The memory of a promise between samples: plain data, and all that a snapshot needs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FixedTimeState {
    /// The phase of the promise.
    pub phase: Phase,
    /// Time in s of the sample from which its window counts ([`Begin`](crate::filter::Begin)).
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub start_time: Option<f64>,
    /// Time of the anchor, t₀ in s.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub anchor_time: f64,
    /// T in s, counted from the anchor; infinite if there is none.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub deadline: f64,
    /// How many times leaving the set has anchored again
    /// ([`FixedTimeSettings::recovery`](super::FixedTimeSettings::recovery)).
    pub recoveries: u32,
    /// Number of deadlines given up for a later one, because the input bounds do not allow them
    /// ([`Infeasible::Earliest`](super::Infeasible::Earliest)).
    pub postponed: u32,
    /// (h − μ)⁽ʲ⁾ at the anchor for j < n.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub anchor: Stack,
    /// The rate of the approach in 1/s, chosen at the anchor; not used if the settings give n rates.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub rate: f64,
    /// The rate of the stay constraint in 1/s, chosen at the last sample ([`stay::keep`](super::stay::keep)).
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub stay_rate: f64,
    /// The margin of the stay constraint in the unit of h, chosen there too.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub stay_margin: f64,
    /// The part of the floor that leads back from `stay_margin` to `margin`, `[h]`/sⁿ, chosen there too.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub pull: f64,
    /// The largest ‖L_gL_f^{n−1}h‖ at a sample since the anchor, or since the arrival if an approach has ended.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub gain: f64,
    /// μ in the unit of h, chosen at the anchor: the margin of the settings, or `least_margin` if that is more, plus the
    /// expected cost of held inputs.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub margin: f64,
    /// Least μ in the unit of h, ≥ 0, whatever the settings say: it leaves room for a plan behind the constraint.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub least_margin: f64,
    /// The sampling period in s for which the anchor accounted, 0 for none.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub period: f64,
    /// Whether the method could not be used from this anchor, so that another replaced it
    /// ([`FixedTime::refusal`](super::FixedTime::refusal) says why).
    pub fallback: bool,
    /// Time in s of the first sample with h ≥ 0 since the anchor.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub arrival: Option<f64>,
    /// Time in s of the first of the samples in a row with h ≥ 0, for a promise that ends
    /// [after a stay](crate::filter::End::AfterStay).
    #[cfg_attr(feature = "serde", serde(with = "crate::real", default))]
    pub since: Option<f64>,
    /// Whether the theorem behind the present phase applies from the last sample on: its conditions held there. Code that
    /// enforces the row clears it if the row is not met, or if the held input breaks the promise in between.
    pub on_course: bool,
    /// The current run of steps that did not meet the constraint.
    pub unmet: Option<Unmet>,
}

/// A run of consecutive steps that did not meet a constraint.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Unmet {
    /// Their number, ≥ 1.
    pub steps: u32,
    /// Time in s of the first, or of the last progress since: a rise of h by a hundredth of its size.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub since: f64,
    /// h then, in its own unit.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub h: f64,
}

impl Unmet {
    /// Rise of h that counts as progress, as a part of its size.
    const PROGRESS: f64 = 0.01;

    /// Counts another step, at time `t` with the value `h`.
    pub(crate) fn after(before: Option<Self>, t: f64, h: f64) -> Self {
        match before {
            None => Self { steps: 1, since: t, h },
            Some(unmet) => {
                let steps = unmet.steps.saturating_add(1);
                let progress = h - unmet.h > Self::PROGRESS * unmet.h.abs();
                if progress { Self { steps, since: t, h } } else { Self { steps, ..unmet } }
            }
        }
    }
}

impl FixedTimeState {
    /// τ ≥ 0, the time in s from the anchor to `t`.
    pub(super) fn elapsed(&self, t: f64) -> f64 {
        (t - self.anchor_time).max(0.0)
    }

    /// The sample as the method of the approach sees it, with `e` = h − `margin` and its derivatives.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn on_approach<'a>(&'a self, elapsed: f64, e: &'a [f64], errors: &'a [f64]) -> Sample<'a> {
        Sample {
            margin: self.margin,
            rate: self.rate,
            fallback: self.fallback,
            on_course: self.on_course,
            errors,
            ..Sample::new(&self.anchor[..e.len()], self.deadline, elapsed, e)
        }
    }

    /// The sample as the stay constraint sees it, with `e` = h − `stay_margin` and its derivatives.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn on_stay<'a>(&'a self, elapsed: f64, e: &'a [f64]) -> Sample<'a> {
        Sample {
            margin: self.stay_margin,
            rate: self.stay_rate,
            pull: self.pull,
            on_course: self.on_course,
            ..Sample::new(&self.anchor[..e.len()], self.deadline, elapsed, e)
        }
    }

    /// The anchor as the method of the approach sees it.
    pub(super) fn at_anchor(&self, n: usize) -> Sample<'_> {
        self.on_approach(0.0, &self.anchor[..n], &EXACT)
    }

    /// Whether h ≥ 0 held at the anchor: a set to be kept rather than to be reached.
    pub fn was_inside(&self) -> bool {
        self.phase != Phase::Waiting && self.anchor[0] + self.margin >= 0.0
    }
}
