//! What a filter remembers between samples.

use alloc::vec::Vec;

#[cfg(feature = "plan")]
use super::backup::PlanState;
use super::{Curvature, SAME_PERIOD, SAME_TIME};
use crate::MAX_INPUTS;
use crate::convergence::FixedTimeState;
use crate::qp::Bounds;

/// The largest number of inputs on their way that a filter remembers: those of an
/// [actuation delay](super::FilterBuilder::actuation_delay) of as many samples.
pub const MAX_SENT: usize = 256;
/// The longest delay in sampling periods, with some room for samples that come sooner.
pub(super) const MOST_LATE: f64 = 250.0;

/// An input that a filter returned, behind an [actuation delay](super::FilterBuilder::actuation_delay).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Sent {
    /// When in s it begins to act.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub at: f64,
    /// The input; zeros above the number of inputs.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub input: [f64; MAX_INPUTS],
}

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
    /// The inputs that act at [`Self::time`] and later, in the order in which they do; empty without a delay.
    #[cfg_attr(feature = "serde", serde(default))]
    pub sent: Vec<Sent>,
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
        // A step with the clone does not allocate either.
        let mut clone = Self { sent: Vec::with_capacity(self.sent.capacity()), ..Self::default() };
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
            sent,
            start,
            curvatures,
            integrated,
            #[cfg(feature = "plan")]
                plan: _,
        } = source;
        self.barriers.clone_from(barriers);
        self.sent.clone_from(sent);
        (self.time, self.period, self.input, self.start) = (*time, *period, *input, *start);
        (self.curvatures, self.integrated) = (*curvatures, *integrated);
    }

    /// Remembers `u`, the input of a sample at `t`, which acts `delay` s later, in place of those that act no sooner. Forgets what
    /// has acted before `t`. Allocates only if more inputs are on their way than ever before.
    pub(super) fn send(&mut self, t: f64, delay: f64, u: &[f64]) {
        let (at, slack) = (t + delay, slack(t, delay));
        self.sent.retain(|sent| sent.at < at - slack);
        let over = self.sent.iter().rposition(|sent| sent.at <= t + slack).unwrap_or(0);
        self.sent.drain(..over);
        if self.is_crowded() {
            // The filter promises nothing until there are fewer.
            self.sent.pop();
        }
        let mut input = [0.0; MAX_INPUTS];
        input[..u.len()].copy_from_slice(u);
        self.sent.push(Sent { at, input });
    }

    /// Whether more inputs are on their way than a filter remembers.
    pub(super) fn is_crowded(&self) -> bool {
        self.sent.len() >= MAX_SENT
    }

    /// The inputs that act in the `span` s from `from` on, one after another, each with the time in s for which it does. Before
    /// the first one acts the admissible input nearest 0 among `bounds`.
    pub(super) fn acting<'a>(
        &'a self,
        bounds: &Bounds,
        from: f64,
        span: f64,
    ) -> impl Iterator<Item = (f64, [f64; MAX_INPUTS])> + Clone + use<'a> {
        let inputs = core::iter::once(self.first(bounds)).chain(self.sent.iter().map(|sent| sent.input));
        let ends = self.sent.iter().map(move |sent| sent.at - from).chain([f64::INFINITY]);
        let (mut begin, slack) = (0.0, slack(from, span));
        inputs.zip(ends).filter_map(move |(input, end)| {
            let end = end.min(span);
            // Times are sums of steps: an input that acts for round-off does not act.
            let acts = end - begin > slack;
            acts.then(|| (end - core::mem::replace(&mut begin, end), input))
        })
    }

    /// The input that acts at `t`, before that of a sample there does.
    #[cfg(feature = "plan")]
    pub(super) fn acting_at(&self, bounds: &Bounds, t: f64) -> [f64; MAX_INPUTS] {
        let acts = |sent: &&Sent| sent.at <= t + slack(t, 0.0);
        self.sent.iter().rfind(acts).map_or_else(|| self.first(bounds), |sent| sent.input)
    }

    /// The input that acts before any on its way does; without a delay the last one.
    fn first(&self, bounds: &Bounds) -> [f64; MAX_INPUTS] {
        match (self.sent.is_empty(), self.time) {
            (true, Some(_)) => self.input,
            // That of a step that was not armed, or otherwise 0.
            (true, None) => core::array::from_fn(|i| bounds.clamp(i, self.input[i])),
            (false, _) => core::array::from_fn(|i| bounds.clamp(i, 0.0)),
        }
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
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn take_rows(&mut self, next: &mut Self) {
        core::mem::swap(&mut self.barriers, &mut next.barriers);
        core::mem::swap(&mut self.sent, &mut next.sent);
        (self.time, self.period, self.input, self.start) = (next.time, next.period, next.input, next.start);
        (self.curvatures, self.integrated) = (next.curvatures, next.integrated);
    }
}

/// Times in s at `t` that differ by less count as the same, where inputs are `delay` s late.
fn slack(t: f64, delay: f64) -> f64 {
    SAME_PERIOD * delay + SAME_TIME * t.abs()
}
