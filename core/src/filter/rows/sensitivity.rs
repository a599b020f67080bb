//! The derivative of the returned input with respect to the state and the reference input.
//!
//! The returned u solves `min ½‖u − u_ref‖²` under G_i(x, u) ≥ 0 and the bounds. The row G_i is affine in u for the
//! pointwise constraint, but not if it is enforced over the period. With the active rows A, their multipliers ϑ and a prime
//! for the derivative along the direction (x', u_ref'),
//!
//! ```text
//! u' − Σ_{i∈A} (ϑ_i' ∇_u G_i + ϑ_i (∇²_uu G_i u' + ∇²_ux G_i x')) = u_ref',
//! ∇_u G_iᵀ u' + ∇_x G_iᵀ x' = 0   for i in A,                                             (8)
//! ```
//!
//! by the implicit function theorem (`docs/theory.md#input-sensitivity`). A bound that holds u_j has u_j' = 0. A soft row at
//! its largest multiplier pulls with κ∇G/‖∇G‖ whatever its value. All derivatives of G are exact: jets with one more
//! direction ([`Directional`](crate::lie::Directional)) and the derivative of the promise
//! ([`FixedTime::differentiate`](crate::convergence::FixedTime::differentiate)), anchors included.
//!
//! # References
//!
//! A. V. Fiacco, *Introduction to Sensitivity and Stability Analysis in Nonlinear Programming*, Academic
//! Press 1983, theorem 3.2.2.

use alloc::vec::Vec;
use core::fmt;

use super::search::Requirement;
use super::{FixedTimeState, Phase, Rows, Status};
use crate::convergence::BoundDerivative;
use crate::convergence::sampled::{PeriodBound, Weighted};
use crate::convergence::stay::Means;
use crate::elementary::{self, dot};
use crate::error::{Error, finite, length};
use crate::lie::{Ahead, Derivatives, Direction};
use crate::qp::sensitivity::Equations;
use crate::qp::{self, Constraint, Enforcement, Problem, Solver};
use crate::{MAX_INPUTS, MAX_ROWS};

/// The derivative of a sample along one direction, and reusable memory for computing it.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SampleDerivative {
    /// Derivative of the returned input, unit of u over that of the direction; zeros above the number of inputs.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub u: [f64; MAX_INPUTS],
    /// Derivatives of the reports, in the order of the barriers.
    pub barriers: Vec<BarrierDerivative>,
    /// State, direction and zeros.
    #[cfg_attr(feature = "serde", serde(skip))]
    scratch: [Vec<f64>; 3],
    /// Answers to the perturbed sample, on either side.
    #[cfg_attr(feature = "serde", serde(skip))]
    moved: [Vec<f64>; 2],
    /// A direction of state and reference, and the sum of the derivatives along some of the axes.
    #[cfg_attr(feature = "serde", serde(skip))]
    axis: Vec<f64>,
    #[cfg_attr(feature = "serde", serde(skip))]
    sum: Vec<f64>,
}

impl SampleDerivative {
    /// All numbers.
    fn values_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        let barriers = self.barriers.iter_mut().flat_map(|b| {
            let BarrierDerivative { h, profile, margin, slack, sampling_loss } = b;
            [h, profile, margin, slack, sampling_loss]
        });
        self.u.iter_mut().chain(barriers)
    }
}

/// The derivative of those numbers of a [`BarrierReport`](super::BarrierReport) that vary continuously with the state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BarrierDerivative {
    /// Derivative of [`BarrierReport::h`](super::BarrierReport::h).
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub h: f64,
    /// Derivative of [`BarrierReport::profile`](super::BarrierReport::profile).
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub profile: f64,
    /// Derivative of [`BarrierReport::margin`](super::BarrierReport::margin).
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub margin: f64,
    /// Derivative of [`BarrierReport::slack`](super::BarrierReport::slack).
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub slack: f64,
    /// Derivative of [`BarrierReport::sampling_loss`](super::BarrierReport::sampling_loss).
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub sampling_loss: f64,
}

/// Why a derivative is not known. The number is that of the barrier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoDerivative {
    /// Its [`DerivativeSource`](crate::lie::DerivativeSource) does not give derivatives along a direction.
    Source(usize),
    /// Its promise is anchored at this sample along a custom profile that does not give its
    /// [derivative](crate::convergence::profile::Profile::directional).
    Profile(usize),
    /// Its constraint is a custom one ([`Condition`](crate::convergence::condition::Condition)).
    Condition(usize),
}

impl fmt::Display for NoDerivative {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Source(i) => write!(f, "the source of barrier {i} gives no derivatives along a direction"),
            Self::Profile(i) => write!(f, "the profile of barrier {i} gives no derivative by its anchor"),
            Self::Condition(i) => write!(f, "the condition of barrier {i} gives no derivative"),
        }
    }
}

impl core::error::Error for NoDerivative {}

/// The derivative of one row along the direction.
#[derive(Clone, Copy)]
struct RowDerivative {
    /// Derivative of the slack at a fixed u.
    slack: f64,
    /// Derivative of the normal.
    normal: [f64; MAX_INPUTS],
    /// Derivative of the pointwise slack at a fixed u; then the pointwise normal itself.
    pointwise: f64,
    pointwise_normal: [f64; MAX_INPUTS],
    /// Derivative of the attenuation Λ.
    attenuation: f64,
}

impl RowDerivative {
    const NONE: Self = Self {
        slack: 0.0,
        normal: [0.0; MAX_INPUTS],
        pointwise: 0.0,
        pointwise_normal: [0.0; MAX_INPUTS],
        attenuation: 0.0,
    };
}

/// Largest distance, as a part of its size, of the input from the answer to the rows linearised at it. Usually it is
/// round-off. Where Newton's method reached its limit of iterations, in a few of 100 samples, it is more, and the derivative
/// then has an error of that order.
const SAME_INPUT: f64 = 1e-3;

/// The same if the rows are not met or a plan backs the step: beyond it the search got stuck.
const SAME_INPUT_UNMET: f64 = 1e-6;

/// A multiplier counts as the largest from this part of the largest on.
const SATURATED: f64 = 1.0 - 1e-9;

impl Rows {
    /// As [`Filter::differentiate`](crate::filter::Filter::differentiate), for the answer of the rows.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length; a direction that is not finite.
    pub(crate) fn differentiate(
        &mut self,
        t: f64,
        x: &[f64],
        u_ref: &[f64],
        direction: Direction,
        out: &mut SampleDerivative,
    ) -> Result<Option<NoDerivative>, Error> {
        for (name, part, len) in
            [("dx", direction.x, self.state_dim), ("du_ref", direction.u, self.input_dim)]
        {
            length(name, part.len(), len)?;
            if let Some(i) = part.iter().position(|v| !v.is_finite()) {
                finite(&format!("{name}[{}]", i + 1), part[i])?;
            }
        }
        let mut u = [0.0; MAX_INPUTS];
        let u = &mut u[..self.input_dim];
        self.sample(t, x, u_ref, u)?;
        out.u = [0.0; MAX_INPUTS];
        out.barriers.clear();
        out.barriers.resize(self.slots.len(), BarrierDerivative::default());
        // Allocated whether needed or not, so that no later sample allocates.
        let numbers = MAX_INPUTS + 5 * self.slots.len();
        let lengths = [numbers, numbers, numbers, self.state_dim + self.input_dim, self.state_dim];
        let [less, more] = &mut out.moved;
        for (vec, len) in
            [less, more, &mut out.sum, &mut out.axis, &mut out.scratch[0]].into_iter().zip(lengths)
        {
            vec.clear();
            vec.reserve(len);
        }
        let constant = [Status::InvalidInput, Status::Singular, Status::WrongRelativeDegree];
        if constant.contains(&self.workspace.report.status) {
            return Ok(None);
        }
        if self.workspace.report.status == Status::NotArmed {
            return Ok(self.directional_unarmed(t, x, u_ref, u, direction, out).err());
        }
        match self.directional(t, x, u_ref, u, direction, out) {
            Ok(true) if self.errors.is_exact() => Ok(None),
            Ok(_) => self.by_axes(t, x, u_ref, u, direction, out),
            Err(unknown) => Ok(Some(unknown)),
        }
    }

    /// The derivative as the sum of those along each axis, with difference quotients where the answer is smooth. It remains
    /// linear in the direction.
    fn by_axes(
        &mut self,
        t: f64,
        x: &[f64],
        u_ref: &[f64],
        u: &[f64],
        direction: Direction,
        out: &mut SampleDerivative,
    ) -> Result<Option<NoDerivative>, Error> {
        let (mut sum, mut axis) = (core::mem::take(&mut out.sum), core::mem::take(&mut out.axis));
        sum.clear();
        sum.resize(MAX_INPUTS + 5 * out.barriers.len(), 0.0);
        let mut unknown = None;
        for (k, part) in direction.x.iter().chain(direction.u).enumerate() {
            if *part == 0.0 {
                continue;
            }
            axis.clear();
            axis.resize(x.len() + u.len(), 0.0);
            axis[k] = 1.0;
            let along = Direction { x: &axis[..x.len()], u: &axis[x.len()..] };
            match self.directional(t, x, u_ref, u, along, out) {
                Ok(_) => self.quotient(t, x, u_ref, u, along, out)?,
                Err(reason) => unknown = Some(reason),
            }
            let values = out.values_mut();
            sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += part * *value);
        }
        out.values_mut().zip(&sum).for_each(|(value, sum)| *value = *sum);
        (out.sum, out.axis) = (sum, axis);
        Ok(unknown)
    }

    /// Replaces the derivatives of the input, and of all but h in the reports, by difference quotients, if the answer `u` to
    /// the sample is smooth along an axis. Used for answers that are not the nearest input, and with measurement errors,
    /// whose part in a row already contains derivatives with respect to the state.
    fn quotient(
        &mut self,
        t: f64,
        x: &[f64],
        u_ref: &[f64],
        u: &[f64],
        direction: Direction,
        out: &mut SampleDerivative,
    ) -> Result<(), Error> {
        /// Step of the quotient, as a part of a state or an input, or of 1 of its unit if it is smaller.
        const PART: f64 = 1e-5;
        /// Largest difference between the quotients on both sides, as a part.
        const KINK: f64 = 0.02;
        let along = direction.x.iter().chain(direction.u);
        let by = x.iter().chain(u_ref).zip(along).find(|(_, d)| **d != 0.0);
        let by = PART * by.map_or(1.0, |(v, _)| v.abs().max(1.0));
        let SampleDerivative { u: du, barriers, scratch: [at, ..], moved: [less, more], .. } = out;
        let status = self.workspace.report.status;
        let mut is_smooth = true;
        for (by, values) in [(-by, &mut *less), (by, &mut *more)] {
            let (mut moved, mut answer) = ([0.0; MAX_INPUTS], [0.0; MAX_INPUTS]);
            at.clear();
            at.extend(x.iter().zip(direction.x).map(|(v, d)| v + by * d));
            for (i, v) in moved[..u.len()].iter_mut().enumerate() {
                *v = u_ref[i] + by * direction.u[i];
            }
            let answer = &mut answer[..u.len()];
            self.sample(t, at, &moved[..u.len()], answer)?;
            let report = &self.workspace.report;
            is_smooth &= report.status == status;
            values.clear();
            values.extend_from_slice(answer);
            values
                .extend(report.barriers.iter().flat_map(|b| [b.profile, b.margin, b.slack, b.sampling_loss]));
        }
        self.sample(t, x, u_ref, &mut [0.0; MAX_INPUTS][..u.len()])?;
        for (u, (less, more)) in u.iter().zip(less.iter().zip(&*more)) {
            let [left, right] = [(u - less) / by, (more - u) / by];
            is_smooth &= (right - left).abs() <= KINK * (1.0 + right.abs().max(left.abs()));
        }
        if is_smooth {
            let mut slopes = less.iter().zip(&*more).map(|(less, more)| (more - less) / (2.0 * by));
            let mut next = |value: &mut f64| *value = slopes.next().unwrap_or(*value);
            du[..u.len()].iter_mut().for_each(&mut next);
            for b in barriers {
                let BarrierDerivative { h: _, profile, margin, slack, sampling_loss } = b;
                [profile, margin, slack, sampling_loss].into_iter().for_each(&mut next);
            }
        }
        Ok(())
    }

    /// Turns the derivative `out` of the rows' answer, just computed, into that of the input `u` that replaces it and moves
    /// by `du`. Of the numbers of the report only the slack changes.
    #[cfg(feature = "plan")]
    pub(crate) fn carry(
        &self,
        t: f64,
        (x, dx): (&[f64], &[f64]),
        (u, du): (&[f64], [f64; MAX_INPUTS]),
        out: &mut SampleDerivative,
    ) -> Result<(), NoDerivative> {
        let SampleDerivative { u: moved, barriers, scratch, .. } = out;
        let workspace = &self.workspace;
        let answer = &workspace.next.input[..u.len()];
        for (i, b) in barriers.iter_mut().enumerate() {
            let normal = &workspace.report.barriers[i].row.normal;
            if *normal == [0.0; MAX_INPUTS] {
                continue;
            }
            let (change, _) = self.row_derivative(i, t, x, dx, answer, scratch)?;
            let curvature = self.curvature(i, t, x, answer, scratch)?;
            for (k, u) in u.iter().enumerate() {
                // The row is that at the answer of the rows, and turns as this moves.
                let turn = change.normal[k] + dot(&curvature[k], moved);
                b.slack += turn * (u - answer[k]) + normal[k] * (du[k] - moved[k]);
            }
        }
        *moved = du;
        Ok(())
    }

    /// The derivative while the filter is not armed: u_ref passes, and h is reported.
    fn directional_unarmed(
        &self,
        t: f64,
        x: &[f64],
        u_ref: &[f64],
        u: &[f64],
        direction: Direction,
        out: &mut SampleDerivative,
    ) -> Result<(), NoDerivative> {
        for (i, b) in out.barriers.iter_mut().enumerate() {
            let source = self.slots[i].source.directional().ok_or(NoDerivative::Source(i))?;
            let (mut change, held) = (Ahead::ZERO, &[0.0; MAX_INPUTS][..u.len()]);
            source.evaluate_directional(t, x, u, Direction { x: direction.x, u: held }, &mut change);
            b.h = change.value[0];
        }
        for i in 0..u.len() {
            out.u[i] = if u[i] == u_ref[i] { direction.u[i] } else { 0.0 };
        }
        Ok(())
    }

    /// Returns whether the input is the one nearest to u_ref on the rows linearised there, with no active row at an instant
    /// that a search found.
    fn directional(
        &self,
        t: f64,
        x: &[f64],
        u_ref: &[f64],
        u: &[f64],
        direction: Direction,
        out: &mut SampleDerivative,
    ) -> Result<bool, NoDerivative> {
        let SampleDerivative { u: du, barriers, scratch, .. } = out;
        let du = &mut du[..u.len()];
        scratch[2].clear();
        scratch[2].resize(self.state_dim, 0.0);
        // The derivative of every row at a fixed u.
        let mut row_derivatives = [RowDerivative::NONE; MAX_ROWS];
        for (i, row_derivative) in row_derivatives[..self.slots.len()].iter_mut().enumerate() {
            (*row_derivative, barriers[i]) = self.row_derivative(i, t, x, direction.x, u, scratch)?;
        }
        let workspace = &self.workspace;
        let report = &workspace.report;
        let count = if report.predicted { workspace.requirements.len() } else { self.slots.len() };
        for k in self.slots.len()..count {
            row_derivatives[k] = self.further(&workspace.requirements[k], t, x, direction.x, u, scratch)?;
        }

        // The active rows of the sample, whichever method found it.
        let (rows, enforcement) = (&workspace.rows[..count], &workspace.enforcement[..count]);
        let limit = self.correction_limit;
        let problem = Problem { enforcement, ..Problem::new(rows, &self.bounds, u_ref, limit) };
        let mut qp = qp::Workspace::default();
        let mut again = [0.0; MAX_INPUTS];
        let again = &mut again[..u.len()];
        for (i, v) in again.iter_mut().enumerate() {
            *v = self.bounds.clamp(i, u_ref[i]);
        }
        if !matches!(report.solver, Solver::Unchanged) && report.status != Status::SolverFailed {
            qp.solve(&problem, again);
        }
        let size = u.iter().fold(1.0, |s: f64, v| s.max(v.abs()));
        let is_rough = self.is_brief() || !report.status.is_satisfied();
        let same = if is_rough { SAME_INPUT_UNMET } else { SAME_INPUT };
        let is_nearest = u.iter().zip(&*again).all(|(a, b)| (a - b).abs() <= same * size);
        // The instant at which a row is enforced moves with the sample, and no row shows this.
        let is_instant = |k: usize| k >= self.slots.len() && workspace.requirements[k].is_instant();
        let stands = qp.active().iter().all(|a| !matches!(a.constraint, Constraint::Row(k) if is_instant(k)));
        // The derivative of u: (8) with the active rows; otherwise the direction of u_ref, except at bounds.
        let active = qp.active();
        if active.iter().any(|a| matches!(a.constraint, Constraint::Row(_))) {
            // If the rows are so curved that (8) has no solution, their curvature is ignored.
            for bends in [true, false] {
                let mut equations = Equations::new(direction.u);
                for active in active {
                    let k = match active.constraint {
                        Constraint::Lower(i) | Constraint::Upper(i) => {
                            let mut normal = [0.0; MAX_INPUTS];
                            normal[i] = 1.0;
                            equations.hold(&normal, 0.0);
                            continue;
                        }
                        Constraint::Row(k) => k,
                    };
                    let (row, row_derivative) = (&rows[k].normal, &row_derivatives[k]);
                    let curvature = match bends {
                        true => self.curvature(k, t, x, u, scratch)?,
                        false => [[0.0; MAX_INPUTS]; MAX_INPUTS],
                    };
                    match enforcement[k] {
                        Enforcement::Soft { penalty } if is_saturated(row, active.multiplier, penalty) => {
                            pull_saturated(&mut equations, row, penalty, row_derivative, &curvature);
                        }
                        _ => {
                            let by = active.multiplier;
                            let curvature = curvature.map(|row| row.map(|c| by * c));
                            equations.pull(&row_derivative.normal.map(|a| by * a), &curvature);
                            equations.hold(row, -row_derivative.slack);
                        }
                    }
                }
                if equations.solve(du) {
                    break;
                }
            }
        } else {
            for i in 0..du.len() {
                du[i] = if again[i] == u_ref[i] { direction.u[i] } else { 0.0 };
            }
        }

        // The numbers of the report that depend on u: slack and sampling loss.
        for (i, (b, row_derivative)) in barriers.iter_mut().zip(&row_derivatives).enumerate() {
            b.slack = row_derivative.slack + dot(&rows[i].normal, du);
            let loss = report.barriers[i].sampling_loss;
            if loss > 0.0 {
                let bound = &self.slots[i].now.period_bound;
                let pointwise = row_derivative.pointwise + dot(&row_derivative.pointwise_normal, du);
                b.sampling_loss = -pointwise * report.period / 4.0 / bound.attenuation
                    - loss * row_derivative.attenuation / bound.attenuation;
            }
        }
        Ok(is_nearest && stands)
    }

    /// Writes the state from which barrier `i` is enforced, and its direction, to `scratch`.
    fn begin(
        &self,
        i: usize,
        (t, x): (f64, &[f64]),
        dx: &[f64],
        scratch: &mut [Vec<f64>; 3],
    ) -> Result<(), NoDerivative> {
        let [from, moving, _] = scratch;
        from.clear();
        from.extend_from_slice(x);
        moving.clear();
        moving.extend_from_slice(dx);
        if self.delay > 0.0 {
            let source = self.slots[i].source.predict_directional().ok_or(NoDerivative::Source(i))?;
            for (dt, u) in self.acting(t) {
                source.flow_directional(from, moving, &u[..self.input_dim], dt);
            }
        }
        Ok(())
    }

    /// The derivative of row `i` and of its barrier's report at the fixed input `u`.
    fn row_derivative(
        &self,
        i: usize,
        t: f64,
        x: &[f64],
        dx: &[f64],
        u: &[f64],
        scratch: &mut [Vec<f64>; 3],
    ) -> Result<(RowDerivative, BarrierDerivative), NoDerivative> {
        let (slot, workspace) = (&self.slots[i], &self.workspace);
        let held = &[0.0; MAX_INPUTS][..u.len()];
        let mut change = Ahead::ZERO;
        let source = slot.source.directional().ok_or(NoDerivative::Source(i))?;
        source.evaluate_directional(t, x, u, Direction { x: dx, u: held }, &mut change);
        // h, and whether the promise has a derivative at this sample.
        let mut derivative = BarrierDerivative { h: change.value[0], ..BarrierDerivative::default() };
        let promise = &workspace.next.barriers[i];
        if matches!(promise.phase, Phase::Waiting | Phase::Released) {
            return Ok((RowDerivative::NONE, derivative));
        }
        // h and its derivatives where the input begins to act.
        let begin = t + self.delay;
        self.begin(i, (t, x), dx, scratch)?;
        let [from, moving, _] = &*scratch;
        let direction = Direction { x: moving, u: held };
        if self.delay > 0.0 {
            source.evaluate_directional(begin, from, u, direction, &mut change);
        }
        let n = slot.source.relative_degree();
        let mut now = Derivatives::ZERO;
        slot.source.evaluate(begin, from, &mut now);
        // The floors of the promise, and the pointwise row.
        let period = workspace.report.predicted.then_some(workspace.report.period);
        let bound = self.bound_change(i, (t, x, u), (&now, &change), period)?;
        let BoundDerivative { floor, profile, margin, sampled } = bound;
        (derivative.profile, derivative.margin) = (profile, margin);
        let pointwise = change.value[n] - floor;
        let mut row_derivative = RowDerivative {
            slack: pointwise,
            normal: change.gradient[n],
            pointwise,
            pointwise_normal: now.row,
            attenuation: sampled.attenuation,
        };
        // The row over the period.
        if period.is_some() {
            let row = self.ahead_derivative(&workspace.requirements[i], &sampled, begin, from, moving, u)?;
            (row_derivative.slack, row_derivative.normal) = (row.value, row.normal);
        }
        Ok((row_derivative, derivative))
    }

    /// The derivative of the bounds of barrier `i` at the fixed input `u`, from its derivatives where the input begins to
    /// act and from their `change`.
    fn bound_change(
        &self,
        i: usize,
        (t, x, u): (f64, &[f64], &[f64]),
        (now, change): (&Derivatives, &Ahead),
        period: Option<f64>,
    ) -> Result<BoundDerivative, NoDerivative> {
        let (slot, begin) = (&self.slots[i], t + self.delay);
        let (before, promise) = (&self.state.barriers[i], &self.workspace.next.barriers[i]);
        let anchors = is_anchored(before, promise, begin);
        let n = slot.degree();
        // What the input can do, and how that changes.
        let gain = if anchors { 0.0 } else { before.gain };
        let turn = &change.gradient[n];
        let square = dot(&now.row, &now.row);
        let size = elementary::sqrt(square);
        let (mut reach, mut reach_change) = (0.0, 0.0);
        for k in 0..u.len() {
            let a = now.row[k];
            if a != 0.0 {
                let bound = if a > 0.0 { self.bounds.max[k] } else { self.bounds.min[k] };
                reach += a * bound;
                reach_change += turn[k] * bound;
            }
        }
        let is_less = size < gain;
        let hold = self.moment(t, x, &[]).hold;
        let means =
            Means { drift: now.drift[n], reach, weight: if is_less { size / gain } else { 1.0 }, hold };
        let moves = Means {
            drift: change.value[n] - dot(turn, u),
            reach: if reach.is_finite() { reach_change } else { 0.0 },
            weight: if is_less && size > 0.0 { dot(&now.row, turn) / size / gain } else { 0.0 },
            hold: 0.0,
        };
        let errors = core::array::from_fn(|k| slot.now.slopes.iter().fold(0.0, |sum, s| sum + s[k].abs()));
        let stack = [&now.drift[..n], &change.value[..n]];
        slot.promise.differentiate(promise, anchors, begin, stack, (&errors, [&means, &moves]), period).ok_or(
            match slot.promise.has_condition() {
                true => NoDerivative::Condition(i),
                false => NoDerivative::Profile(i),
            },
        )
    }

    /// The derivative, at the fixed input `u`, of a row that follows those of the barriers: that of the longest step, or of
    /// an instant between two samples, which is held constant.
    fn further(
        &self,
        requirement: &Requirement,
        t: f64,
        x: &[f64],
        dx: &[f64],
        u: &[f64],
        scratch: &mut [Vec<f64>; 3],
    ) -> Result<RowDerivative, NoDerivative> {
        let i = requirement.barrier;
        let (slot, begin, held) = (&self.slots[i], t + self.delay, &[0.0; MAX_INPUTS][..u.len()]);
        self.begin(i, (t, x), dx, scratch)?;
        let [from, moving, _] = &*scratch;
        let (mut now, mut change) = (Derivatives::ZERO, Ahead::ZERO);
        let source = slot.source.directional().ok_or(NoDerivative::Source(i))?;
        source.evaluate_directional(begin, from, u, Direction { x: moving, u: held }, &mut change);
        slot.source.evaluate(begin, from, &mut now);
        let bound = self.bound_change(i, (t, x, u), (&now, &change), Some(requirement.ahead))?;
        let sampled = match requirement.is_instant() {
            true => {
                let promise = &self.workspace.next.barriers[i];
                let dh = change.value[0];
                let floor = slot.outlook().aim_change(promise, requirement.ahead, bound.margin, dh);
                PeriodBound { floor, attenuation: 0.0, ..PeriodBound::ZERO }
            }
            false => bound.sampled,
        };
        let row = self.ahead_derivative(requirement, &sampled, begin, from, moving, u)?;
        Ok(RowDerivative { slack: row.value, normal: row.normal, ..RowDerivative::NONE })
    }

    /// The derivative of the row of a requirement at the fixed input `u`, as its bound moves by `moved`.
    fn ahead_derivative(
        &self,
        requirement: &Requirement,
        moved: &PeriodBound,
        begin: f64,
        from: &[f64],
        moving: &[f64],
        u: &[f64],
    ) -> Result<Weighted, NoDerivative> {
        let (i, ahead) = (requirement.barrier, requirement.ahead);
        let (source, unknown) = (&self.slots[i].source, NoDerivative::Source(i));
        let (mut at, mut change) = (Ahead::ZERO, Ahead::ZERO);
        let direction = Direction { x: moving, u: &[0.0; MAX_INPUTS][..u.len()] };
        source.predict().ok_or(unknown)?.ahead(begin, from, u, ahead, &mut at);
        let directional = source.predict_directional().ok_or(unknown)?;
        directional.ahead_directional(begin, from, u, direction, ahead, &mut change);
        let (n, divisor) = (source.relative_degree(), requirement.divisor);
        let of_state = requirement.change(&change, n, u.len());
        let of_bound = moved.weighted(&at.value[..n], &at.gradient, u.len(), divisor);
        Ok(Weighted {
            value: of_state.value + of_bound.value,
            normal: core::array::from_fn(|i| of_state.normal[i] + of_bound.normal[i]),
            ..of_state
        })
    }

    /// The derivative of row `k`'s normal with respect to u: `[i][j]` is that of its component i with respect to u_j.
    fn curvature(
        &self,
        k: usize,
        t: f64,
        x: &[f64],
        u: &[f64],
        scratch: &mut [Vec<f64>; 3],
    ) -> Result<[[f64; MAX_INPUTS]; MAX_INPUTS], NoDerivative> {
        let mut curvature = [[0.0; MAX_INPUTS]; MAX_INPUTS];
        if !self.workspace.report.predicted {
            return Ok(curvature);
        }
        let requirement = &self.workspace.requirements[k];
        let source = &self.slots[requirement.barrier].source;
        let [from, _, zeros] = scratch;
        from.clear();
        from.extend_from_slice(x);
        if self.delay > 0.0
            && let Some(source) = source.predict()
        {
            for (dt, acting) in self.acting(t) {
                source.flow(from, &acting[..u.len()], dt);
            }
        }
        let unknown = NoDerivative::Source(requirement.barrier);
        let directional = source.predict_directional().ok_or(unknown)?;
        let mut change = Ahead::ZERO;
        for j in 0..u.len() {
            let mut axis = [0.0; MAX_INPUTS];
            axis[j] = 1.0;
            let direction = Direction { x: zeros, u: &axis[..u.len()] };
            let (begin, ahead) = (t + self.delay, requirement.ahead);
            directional.ahead_directional(begin, from, u, direction, ahead, &mut change);
            let moved = requirement.change(&change, source.relative_degree(), u.len());
            for i in 0..u.len() {
                curvature[i][j] = moved.normal[i];
            }
        }
        Ok(curvature)
    }
}

/// Whether the sample at `begin` anchored the promise.
fn is_anchored(before: &FixedTimeState, after: &FixedTimeState, begin: f64) -> bool {
    after.anchor_time == begin && (before.phase == Phase::Waiting || before.anchor_time != begin)
}

/// Whether a soft row has its largest multiplier.
fn is_saturated(normal: &[f64; MAX_INPUTS], multiplier: f64, penalty: f64) -> bool {
    multiplier * elementary::sqrt(dot(normal, normal)) >= SATURATED * penalty
}

/// Adds the pull κa/‖a‖ of a soft row at its largest multiplier, with the change (1 − nnᵀ) a' κ/‖a‖, where n = a/‖a‖.
fn pull_saturated(
    equations: &mut Equations,
    row: &[f64; MAX_INPUTS],
    penalty: f64,
    row_derivative: &RowDerivative,
    curvature: &[[f64; MAX_INPUTS]; MAX_INPUTS],
) {
    let square = dot(row, row);
    let by = penalty / elementary::sqrt(square);
    let turned = |a: &[f64; MAX_INPUTS]| {
        let inside = dot(row, a) / square;
        core::array::from_fn(|i| by * (a[i] - inside * row[i]))
    };
    let mut pull = [[0.0; MAX_INPUTS]; MAX_INPUTS];
    for j in 0..MAX_INPUTS {
        let column: [f64; MAX_INPUTS] = turned(&core::array::from_fn(|i| curvature[i][j]));
        for i in 0..MAX_INPUTS {
            pull[i][j] = column[i];
        }
    }
    let change: [f64; MAX_INPUTS] = turned(&row_derivative.normal);
    equations.pull(&change, &pull);
}
