//! What a sample says of a barrier until the next one: what plant and inputs can do about it, and whether the input that is
//! held keeps its promise at every instant.

use super::hold::{Hold, Lowest};
use super::search::Condition;
use super::{FixedTimeState, Phase, SAME_PERIOD, Status};
use crate::convergence::sampled::PeriodBound;
use crate::convergence::stay::Means;
use crate::lie::Derivatives;
use crate::qp::{self, Bounds, Row};
use crate::{MAX_INPUTS, MAX_RELATIVE_DEGREE};

/// What plant and inputs can do about a barrier at a sample; notes how well it can be influenced.
pub(super) fn means(
    derivatives: &Derivatives,
    n: usize,
    bounds: &Bounds,
    promise: &mut FixedTimeState,
    hold: f64,
    inputs: usize,
) -> Means {
    let (mut square, mut reach) = (0.0, 0.0);
    for i in 0..inputs {
        let a = derivatives.row[i];
        square += a * a;
        if a != 0.0 {
            reach += f64::max(a * bounds.min[i], a * bounds.max[i]);
        }
    }
    let size = square.sqrt();
    promise.gain = promise.gain.max(size);
    let weight = if promise.gain > 0.0 { size / promise.gain } else { 1.0 };
    Means { drift: derivatives.drift[n], reach, weight, hold }
}

/// What is foreseen of h until the next sample.
#[derive(Clone, Copy)]
pub(super) struct Outlook {
    pub(super) n: usize,
    /// h⁽⁰⁾ … h⁽ⁿ⁻¹⁾, then L_fⁿh.
    pub(super) drift: [f64; MAX_RELATIVE_DEGREE + 1],
    /// Where the input held breaks the promise, if it does.
    pub(super) lowest: Option<Lowest>,
}

impl Outlook {
    pub(super) const NONE: Self = Self { n: 0, drift: [0.0; MAX_RELATIVE_DEGREE + 1], lowest: None };

    pub(super) fn new(derivatives: &Derivatives, n: usize) -> Self {
        Self { n, drift: derivatives.drift, lowest: None }
    }

    /// h⁽ʲ⁾ `s` seconds later by the Taylor polynomial of order n of h, with h⁽ⁿ⁾ = `highest`.
    fn foreseen(&self, j: usize, highest: f64, s: f64) -> f64 {
        // Horner's scheme.
        (j..self.n).rev().fold(highest, |sum, k| self.drift[k] + sum * s / (k + 1 - j) as f64)
    }

    /// The most by which the terms of that polynomial but the first can move h.
    fn moved(&self, highest: f64, s: f64) -> f64 {
        let (mut power, mut sum) = (1.0, 0.0);
        for k in 1..=self.n {
            power *= s / k as f64;
            sum += power * if k == self.n { highest } else { self.drift[k] }.abs();
        }
        sum
    }

    /// The row that `condition`, on h alone, is to the order n; `normal` is that of h⁽ⁿ⁾.
    pub(super) fn row_at(&self, condition: &Condition, normal: &[f64; MAX_INPUTS]) -> Row {
        let s = condition.duration;
        let power = (1..=self.n).fold(1.0, |power, k| power * s / k as f64);
        let floor = (condition.demand.floor - self.foreseen(0, self.drift[self.n], s)) / power;
        Row { normal: *normal, floor }
    }

    /// Finds out whether the promise holds at every instant of the `hold` (s) that begins, along the model; in a set that
    /// is kept, of one that may last as `long`.
    pub(super) fn look(
        &mut self,
        promise: &FixedTimeState,
        held: &Hold,
        normal: &[f64; MAX_INPUTS],
        [hold, long]: [f64; 2],
        scratch: &mut [f64],
    ) {
        /// Round-off, as a part of the size of h.
        const ROUND_OFF: f64 = 1e-12;
        /// The part of h that must be left for the model not to be asked.
        const CLEAR: f64 = 0.5;
        self.lowest = None;
        let (from, hold) = match promise.phase {
            Phase::Stay => (0.0, long),
            Phase::Approach => ((promise.anchor_time + promise.deadline - held.t).max(0.0), hold),
            _ => return,
        };
        let h = self.drift[0];
        let highest = self.drift[self.n] + qp::dot(normal, held.u);
        // With n = 1 a set that moves faster than the samples shows in no derivative that is known here; a turn by
        // radians shows where the hold ends.
        let is_clear = || {
            let agrees = |end: [f64; MAX_RELATIVE_DEGREE + 1]| {
                let mut power = 1.0;
                (0..=self.n).all(|k| {
                    power *= if k == 0 { 1.0 } else { hold / k as f64 };
                    power * (end[k] - self.foreseen(k, highest, hold)).abs() <= 0.5 * CLEAR * h
                })
            };
            self.n > 1
                && h > 0.0
                && self.moved(highest, hold) <= (1.0 - CLEAR) * h
                && held.derivatives(hold).is_none_or(agrees)
        };
        // The deadline at the very end of the hold is within it.
        let begins = from <= hold * (1.0 + SAME_PERIOD);
        if !begins || is_clear() {
            return;
        }
        let from = from.min(hold);
        let lowest = held
            .lowest(from, hold, scratch)
            .unwrap_or_else(|| self.lowest_of_polynomial(highest, from, hold));
        let size = promise.anchor[0].abs() + promise.margin + h.abs();
        // What is not a number is no promise.
        self.lowest = (lowest.h < -ROUND_OFF * size || lowest.h.is_nan()).then_some(lowest);
    }

    /// The same without a model, to the order n.
    fn lowest_of_polynomial(&self, highest: f64, from: f64, to: f64) -> Lowest {
        const INSTANTS: u32 = 16;
        let at = |i: u32| from + (to - from) * f64::from(i) / f64::from(INSTANTS);
        (0..=INSTANTS)
            .map(|i| Lowest { h: self.foreseen(0, highest, at(i)), at: at(i) })
            .fold(Lowest { h: f64::INFINITY, at: from }, Lowest::or)
    }

    /// What would keep the promise at the instant at which it is broken.
    pub(super) fn condition(&self, channel: usize, promise: &FixedTimeState) -> Option<Condition> {
        let at = self.lowest.map(|lowest| lowest.at).filter(|at| *at > 0.0)?;
        let mut weights = [0.0; MAX_RELATIVE_DEGREE];
        weights[0] = 1.0;
        let floor = match promise.phase {
            Phase::Stay => 0.5 * promise.margin.min(self.drift[0]).max(0.0),
            _ => promise.margin,
        };
        Some(Condition { channel, demand: PeriodBound { weights, floor, ..PeriodBound::ZERO }, duration: at })
    }
}

/// Why derivatives cannot carry a constraint, if they cannot.
#[inline]
pub(super) fn defect(derivatives: &Derivatives) -> Option<Status> {
    /// An input that enters below the declared degree by more than this part of the row is real.
    const OF_ROW: f64 = 1e-9;
    /// So is one by more than this part of the derivatives themselves; round-off of cancelling terms stays below.
    const OF_DERIVATIVES: f64 = 1e-13;
    if !derivatives.is_finite() {
        return Some(Status::Singular);
    }
    if derivatives.lower_sensitivity <= 0.0 {
        return None;
    }
    let size = derivatives.row.iter().fold(0.0, |s: f64, v| s.max(v.abs()));
    let terms = derivatives.drift.iter().fold(0.0, |s: f64, v| s.max(v.abs()));
    let is_real = derivatives.lower_sensitivity > (OF_ROW * size).max(OF_DERIVATIVES * terms);
    is_real.then_some(Status::WrongRelativeDegree)
}
