//! What the plan of a first sample bears of a plant that is not the model, beside what is declared.

use alloc::vec;
use alloc::vec::Vec;

use super::Planning;
use super::first::First;
use super::settings::DECISIONS;
use crate::plan::{Planner, Uncertainty};

/// How much of each kind of uncertainty the plan of a first sample bears, each alone and beside what is declared: at least
/// that much, since a tube may be wider than what the plant can do. 0 where it bears none that was tried.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
pub struct Bears {
    /// What may be added to the rate of each state, in its unit per s.
    pub rates: Vec<f64>,
    /// How far each state may be from its measured value, in its unit.
    pub errors: Vec<f64>,
    /// The part of each input that may be missing or too much, 0 to 1.
    pub gains: Vec<f64>,
}

/// The first size tried, as a part of the largest rate of a state (over a second for an error); of a gain as it is.
const FIRST: f64 = 0.01;
/// Number of times that it is doubled or halved, and of halvings between the two results that differ then.
const SCALES: [u32; 2] = [10, 3];

impl Planning<'_> {
    /// What the plan that a first sample at `t` and `x` would find bears, for a plant with derivatives on enclosures; `None`
    /// without a plan, and behind an integrator. Remembers nothing.
    pub fn bears(&self, t: f64, x: &[f64]) -> Option<Bears> {
        if self.integrator.is_some() {
            return None;
        }
        let (measured, courses) = (self.state(x), self.courses(t, x));
        let own = Planning { measured: Some((t, &measured)), courses: &courses, ..*self };
        let (t, x) = self.acts(t, &measured);
        let (at, shorter) = ((t, self.plans.period), &DECISIONS.shorter);
        let First { promises, plan, .. } =
            own.first(own.promises(t, &x, |_| 1.0), at, &x, &[], shorter).ok()?;
        let [states, inputs] = [self.states, self.rows.input_dim];
        let declared = self.uncertainty.cloned().unwrap_or_else(|| Uncertainty {
            rates: vec![0.0; states],
            errors: vec![0.0; states],
            gains: vec![[1.0; 2]; inputs],
            lags: vec![[0.0; 2]; inputs],
            jitter: 0.0,
        });
        let keeps = |uncertainty: &Uncertainty| {
            let planning = Planning { uncertainty: Some(uncertainty), ..own };
            let bears = |planner: &Planner<'_>| planner.bears(&plan, t, &x);
            planning.planned(&promises, at, &[], bears).is_ok()
        };
        let largest = |first: f64, most: f64, with: &dyn Fn(f64) -> Uncertainty| {
            let mut size = first;
            let is_kept = |size: f64| size <= most && keeps(&with(size));
            let grows = is_kept(size);
            let mut other = size;
            for _ in 0..SCALES[0] {
                other = if grows { 2.0 * size } else { 0.5 * size };
                if is_kept(other) != grows {
                    break;
                }
                size = other;
            }
            let (mut low, mut high) = if grows { (size, other) } else { (other, size) };
            if !grows && !is_kept(low) {
                return 0.0;
            }
            for _ in 0..SCALES[1] {
                let middle = 0.5 * (low + high);
                if is_kept(middle) { low = middle } else { high = middle }
            }
            low
        };
        let typical = |i: usize| FIRST * plan.backup_plan.largest_rate(i).max(f64::MIN_POSITIVE);
        let each = |count: usize, size: &dyn Fn(usize) -> f64| (0..count).map(size).collect::<Vec<f64>>();
        Some(Bears {
            rates: each(states, &|i| {
                largest(typical(i), f64::INFINITY, &|size| {
                    let mut more = declared.clone();
                    more.rates[i] += size;
                    more
                })
            }),
            errors: each(states, &|i| {
                largest(typical(i), f64::INFINITY, &|size| {
                    let mut more = declared.clone();
                    more.errors[i] += size;
                    more
                })
            }),
            gains: each(inputs, &|i| {
                largest(FIRST, 0.99, &|size| {
                    let mut more = declared.clone();
                    let [least, most] = more.gains[i];
                    more.gains[i] = [least * (1.0 - size), most * (1.0 + size)];
                    more
                })
            }),
        })
    }
}
