//! A verified list of held inputs.

use alloc::vec::Vec;

use crate::MAX_INPUTS;

/// A list of held inputs that meets every requirement, from a state on.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BackupPlan {
    /// The end of each hold in s, and its input. The last is held for ever where the plant is at an equilibrium under it.
    pub inputs: Vec<(f64, [f64; MAX_INPUTS])>,
    /// The time in s until which every requirement is met: infinite where the plan ends at an equilibrium, else its end.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub until: f64,
    /// The place on the way where h − margin is least.
    pub tightest: Option<Tightest>,
    /// The largest rate of each state on the way, and on the way of the plan before it: what an equilibrium's rates are
    /// small against. It never falls, so what was an equilibrium stays one.
    pub(super) rates: Vec<f64>,
    /// The largest input on the way after the first hold, as a part of its bounds, 0 to 1.
    pub effort: f64,
    /// Whether its holds end at samples in the period of the first.
    pub(crate) is_uniform: bool,
    /// The pieces of its walk.
    pub(super) pieces: u32,
}

impl BackupPlan {
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
    /// h − margin in the unit of h, a bound from below.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub slack: f64,
}
