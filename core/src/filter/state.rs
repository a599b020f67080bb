//! What a filter remembers between samples.

use alloc::vec::Vec;

#[cfg(feature = "plan")]
use super::backup::PlanState;
use super::{Curvature, SAME_TIME};
use crate::MAX_INPUTS;
use crate::convergence::FixedTimeState;

/// The memory of a filter between samples: one promise per barrier, the times that [`Sampling`](super::Sampling) needs,
/// where the search for the next input begins, the integrated input and the backup plan.
///
/// With the feature `serde` it can be written to a file, bit for bit (for this, serde_json needs its feature
/// `float_roundtrip`). Human-readable formats write infinities as words, since JSON has none.
/// [`Filter::restore`](super::Filter::restore) checks what it reads.
#[derive(Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FilterState {
    /// Promises, in the order of the barriers.
    pub barriers: Vec<FixedTimeState>,
    /// Time of the last sample with valid inputs, in s.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub time: Option<f64>,
    /// The measured sampling period in s, under [`Sampling::Measured`](super::Sampling::Measured) from the second sample on.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub period: Option<f64>,
    /// The input returned at [`Self::time`], or the last one while not armed; zeros above the number of inputs.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub input: [f64; MAX_INPUTS],
    /// Time of the first sample in s, valid or not, if the filter is [armed later](super::FilterBuilder::arm_after) than
    /// that.
    #[cfg_attr(feature = "serde", serde(default, with = "crate::real"))]
    pub start: Option<f64>,
    /// The curvature of the active row at the sample before [`Self::time`] and at [`Self::time`], where only one was active.
    /// The search over the period begins from the former if the sample at [`Self::time`] is taken again, otherwise from the
    /// latter. Promises do not depend on it.
    #[cfg_attr(feature = "serde", serde(default))]
    pub curvatures: [Option<Curvature>; 2],
    /// The [integrated input](super::Integration) at the end of the last hold, in its unit; 0 if no input is integrated.
    #[cfg_attr(feature = "serde", serde(default, with = "crate::real"))]
    pub integrated: f64,
    /// The backup plan and what it keeps; blank if the filter follows no plans.
    #[cfg(feature = "plan")]
    #[cfg_attr(feature = "serde", serde(default))]
    pub plan: PlanState,
}

impl Clone for FilterState {
    fn clone(&self) -> Self {
        let mut clone = Self::default();
        clone.clone_from(self);
        clone
    }

    /// Reuses the memory, which a derived `Clone` would not. Only a plan allocates.
    fn clone_from(&mut self, source: &Self) {
        self.clone_rows_from(source);
        #[cfg(feature = "plan")]
        self.plan.clone_from(&source.plan);
    }
}

impl FilterState {
    /// Copies `source` except for the plan, without allocating.
    pub(super) fn clone_rows_from(&mut self, source: &Self) {
        // Without `..`: a new field does not compile here until it is decided whether it belongs to a sample of the rows.
        let Self {
            barriers,
            time,
            period,
            input,
            start,
            curvatures,
            integrated,
            #[cfg(feature = "plan")]
                plan: _,
        } = source;
        self.barriers.clone_from(barriers);
        (self.time, self.period, self.input, self.start) = (*time, *period, *input, *start);
        (self.curvatures, self.integrated) = (*curvatures, *integrated);
    }

    /// Whether a filter that is armed `after` seconds from its first sample is armed at `t`. Once armed, it stays armed.
    #[inline]
    pub(super) fn is_armed(&self, t: f64, after: f64) -> bool {
        let reached = |start: f64| t - start >= after - SAME_TIME * t.abs().max(after);
        after == 0.0 || self.time.is_some() || self.start.is_none_or(reached)
    }

    /// The curvature of the active row from which the search at `t` begins.
    #[inline]
    pub(super) fn curvature_before(&self, t: f64) -> &Option<Curvature> {
        let [before, last] = &self.curvatures;
        if self.time.is_some_and(|time| t > time) { last } else { before }
    }

    /// Takes over `next` except for the plan; `next` keeps only its memory.
    #[inline(always)]
    pub(super) fn take_rows(&mut self, next: &mut Self) {
        core::mem::swap(&mut self.barriers, &mut next.barriers);
        (self.time, self.period, self.input, self.start) = (next.time, next.period, next.input, next.start);
        (self.curvatures, self.integrated) = (next.curvatures, next.integrated);
    }
}
