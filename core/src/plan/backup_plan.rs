//! A verified list of held inputs.

use alloc::sync::Arc;
use alloc::vec::Vec;

use super::tube::Tracking;
use crate::MAX_INPUTS;

/// A list of held inputs that meets every requirement, from a state on.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BackupPlan {
    /// The end of each hold in s, and its input. The last is held for ever if the plant is at an equilibrium under it.
    pub inputs: Vec<(f64, [f64; MAX_INPUTS])>,
    /// The time in s until which every requirement is met: infinite if the plan ends at an equilibrium, otherwise its end.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub until: f64,
    /// The place along the plan where h − margin is least.
    pub tightest: Option<Tightest>,
    /// The largest rate of each state along the plan, and along the plan before it. The rates at an equilibrium have to be
    /// small against it. It never falls, so an equilibrium remains one.
    pub(super) rates: Vec<f64>,
    /// The largest input along the plan after the first hold, as a part of its bounds, 0 to 1.
    pub effort: f64,
    /// Whether its holds end at samples with the period of the first.
    pub(crate) is_uniform: bool,
    /// The number of pieces of its rollout.
    pub(super) pieces: u32,
    /// For an uncertain plant: the law that keeps every requirement, along `inputs`.
    pub(super) tracking: Option<Arc<Tracking>>,
}

impl BackupPlan {
    /// Forgets the law: it no longer holds that the plant is near the plan.
    pub(crate) fn forget(&mut self) {
        self.tracking = None;
    }

    /// The largest rate of state `i` along the plan.
    pub(crate) fn largest_rate(&self, i: usize) -> f64 {
        self.rates[i]
    }

    /// The law that keeps every requirement for an uncertain plant, along `inputs`; `None` if nothing uncertain is declared.
    pub fn tracking(&self) -> Option<&Tracking> {
        self.tracking.as_deref()
    }

    /// The mean input from `t` until `end` > `t`.
    pub(super) fn mean(&self, t: f64, end: f64) -> [f64; MAX_INPUTS] {
        let (mut mean, mut at) = ([0.0; MAX_INPUTS], t);
        let last = self.inputs.last().map(|(_, u)| (f64::INFINITY, *u));
        for (until, u) in self.inputs.iter().copied().chain(last) {
            let until = until.min(end);
            if until > at {
                for (mean, u) in mean.iter_mut().zip(u) {
                    *mean += u * (until - at) / (end - t);
                }
                at = until;
            }
        }
        mean
    }
}

/// Where h − margin is least.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Tightest {
    /// The number of the barrier.
    pub barrier: usize,
    /// Time in s.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub time: f64,
    /// A lower bound on h − margin, in the unit of h.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub slack: f64,
}
