//! The change of the input that a filter returns with the state and the input wanted.
//!
//! The returned u solves `min ½‖u − u_ref‖²` under G_i(x, u) ≥ 0 and the bounds. The row G_i is affine in u for
//! the pointwise constraint, not where it is enforced over the period. With the active ones A, their
//! multipliers ϑ and a prime for the derivative along the direction (x', u_ref'),
//!
//! ```text
//! u' − Σ_{i∈A} (ϑ_i' ∇_u G_i + ϑ_i (∇²_uu G_i u' + ∇²_ux G_i x')) = u_ref',
//! ∇_u G_iᵀ u' + ∇_x G_iᵀ x' = 0   for i in A,                                             (8)
//! ```
//!
//! by the implicit function theorem (`docs/theory.md#input-sensitivity`). A bound that holds u_j has u_j' = 0. A soft
//! row at its largest multiplier pulls with κ∇G/‖∇G‖ whatever its value. All derivatives of G are exact: jets with
//! one more direction ([`Directional`](crate::lie::Directional)) and the derivative of the promise
//! ([`FixedTime::differentiate`](crate::convergence::FixedTime::differentiate)), anchors included.
//!
//! # References
//!
//! A. V. Fiacco, *Introduction to Sensitivity and Stability Analysis in Nonlinear Programming*, Academic
//! Press 1983, theorem 3.2.2.

use alloc::vec::Vec;
use core::fmt;

use super::{FixedTimeState, Phase, SafetyFilter, Status};
use crate::convergence::BoundDerivative;
use crate::convergence::sampled::{PeriodBound, Weighted};
use crate::elementary::{self, dot};
use crate::error::{Error, finite, length};
use crate::lie::{Ahead, Derivatives, Direction};
use crate::qp::sensitivity::Equations;
use crate::qp::{self, Constraint, Enforcement, Problem, Solver};
use crate::{MAX_INPUTS, MAX_ROWS};

/// The derivative of a sample along one direction, and the memory to compute it in, to be used again and again.
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

/// The reason why a derivative is not known. The number is that of the barrier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoDerivative {
    /// Its [`DerivativeSource`](crate::lie::DerivativeSource) does not give derivatives along a direction.
    Source(usize),
    /// Its promise is anchored at this sample along a profile of one's own that does not give its
    /// [derivative](crate::convergence::profile::Profile::directional).
    Profile(usize),
    /// Its constraint is one of one's own ([`Condition`](crate::convergence::condition::Condition)).
    Condition(usize),
    /// Its deadline is given up at this sample for a later one, which a search found.
    Postponed(usize),
    /// The set of the barrier is kept with a rate or margin that is chosen at this sample
    /// ([`stay::keep`](crate::convergence::stay::keep)).
    Kept(usize),
    /// The answer keeps a promise at an instant between the samples, or for steps of several lengths.
    Instants,
    /// The search over the period ended more than 1e-3 of its size (1e-6 where the rows are not met) away from
    /// the input that is nearest to u_ref on the rows linearised there.
    NotConverged,
    /// The active rows do not determine the change of the input.
    Dependent,
    /// The state has [measurement errors](super::FilterBuilder::measurement_errors), whose rows contain derivatives by
    /// the state already.
    MeasurementErrors,
    /// A plan chose the input (`AssuredFilter`).
    Plan,
}

impl fmt::Display for NoDerivative {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Source(i) => write!(f, "the source of barrier {i} gives no derivatives along a direction"),
            Self::Profile(i) => write!(f, "the profile of barrier {i} gives no derivative by its anchor"),
            Self::Condition(i) => write!(f, "the condition of barrier {i} gives no derivative"),
            Self::Postponed(i) => write!(f, "the deadline of barrier {i} is given up at this sample"),
            Self::Kept(i) => write!(f, "the rate with which barrier {i} is kept is chosen at this sample"),
            Self::Instants => f.write_str("the answer keeps a promise between the samples"),
            Self::NotConverged => f.write_str("the search for an input over the period did not converge"),
            Self::Dependent => f.write_str("the active rows do not determine the change of the input"),
            Self::MeasurementErrors => f.write_str("not with measurement errors"),
            Self::Plan => f.write_str("a plan chose the input"),
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

/// Largest distance, as a part of its size, of the input from the answer to the rows linearised at it. It is round-off,
/// but where Newton's method ran into its limit of iterations, some of 100 samples. The derivative is then in error by
/// a number of that order.
const SAME_INPUT: f64 = 1e-3;

/// The same where the rows are not met: beyond it the search got stuck.
const SAME_INPUT_UNMET: f64 = 1e-6;

/// A multiplier from this part of its largest on counts as the largest.
const SATURATED: f64 = 1.0 - 1e-9;

impl SafetyFilter {
    /// Computes the derivative of what [`Self::peek`] returns where x and u_ref move along `direction`. Remembers
    /// nothing; the report is that of the sample.
    ///
    /// Exact for the piece in force. The input is a piecewise smooth function. Where rows, bounds, a phase or the
    /// better of two searches change, it has a kink or a jump; the derivative is that of the piece on which the
    /// sample was computed. By status:
    ///
    /// - [`Unchanged`](Status::Unchanged), [`SolverFailed`](Status::SolverFailed): the direction of u_ref, 0
    ///   in components that a bound holds.
    /// - [`Filtered`](Status::Filtered), [`Infeasible`](Status::Infeasible) and
    ///   [`NoAuthority`](Status::NoAuthority): (8) with the active rows, those that hold back a row that cannot be
    ///   met among them; rows given up or left out take no part. A single row that cannot be met: 0 in the
    ///   components at their bounds, the direction of u_ref in the others.
    /// - [`InvalidInput`](Status::InvalidInput), [`Singular`](Status::Singular) and
    ///   [`WrongRelativeDegree`](Status::WrongRelativeDegree), where the input is a constant: all zero.
    /// - [`NotArmed`](Status::NotArmed): the direction of u_ref, 0 in components that a bound holds; h as ever.
    ///
    /// Does not allocate where `out` has been used with this filter before. An answer that is not `None` says why the
    /// derivative is not known; `out` then means nothing.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length; a direction that is not finite.
    ///
    /// ```
    /// # use punctual_core::{barriers::DistanceDisc, filter::*, lie::Direction};
    /// # use punctual_reference::plants::PointMass;
    /// let mut filter = SafetyFilter::builder(4, 2)
    ///     .barrier("goal", PointMass, DistanceDisc::new([45.0, 0.0], 2.0, 2.0)?, BarrierSettings::within(10.0))?
    ///     .build()?;
    /// let mut derivative = SampleDerivative::default();
    /// // Wanted sideways: the row, which is on the x axis, lets it pass. Wanted forwards: it makes up for it.
    /// for (du_ref, wanted) in [([0.0, 1.0], [0.0, 1.0]), ([1.0, 0.0], [0.0, 0.0])] {
    ///     let direction = Direction { x: &[0.0; 4], u: &du_ref };
    ///     let unknown =
    ///         filter.differentiate(0.0, &[0.0; 4], &[0.0; 2], direction, &mut derivative)?;
    ///     assert_eq!(unknown, None);
    ///     // Over the period of a tenth of a second the disc is a little round.
    ///     assert!((0..2).all(|i| (derivative.u[i] - wanted[i]).abs() < 1e-3), "{:?}", derivative.u);
    /// }
    /// # Ok::<(), punctual_core::Error>(())
    /// ```
    pub fn differentiate(
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
        self.peek(t, x, u_ref, u)?;
        out.u = [0.0; MAX_INPUTS];
        out.barriers.clear();
        out.barriers.resize(self.slots.len(), BarrierDerivative::default());
        let constant = [Status::InvalidInput, Status::Singular, Status::WrongRelativeDegree];
        if constant.contains(&self.report().status) {
            return Ok(None);
        }
        if self.report().status == Status::NotArmed {
            return Ok(self.directional_unarmed(t, x, u_ref, u, direction, out).err());
        }
        if !self.errors.is_exact() {
            return Ok(Some(NoDerivative::MeasurementErrors));
        }
        Ok(self.directional(t, x, u_ref, u, direction, out).err())
    }

    /// Makes the derivative `out` of the answer of the rows, just computed, that of the input `u` in its place, which moves
    /// by `du`: of the numbers of the report it is the slack that follows.
    #[cfg(feature = "plan")]
    pub(super) fn carry(
        &self,
        t: f64,
        (x, dx): (&[f64], &[f64]),
        (u, du): (&[f64], [f64; MAX_INPUTS]),
        out: &mut SampleDerivative,
    ) -> Result<(), NoDerivative> {
        let SampleDerivative { u: moved, barriers, scratch } = out;
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

    /// The derivative where the filter is not armed yet: u_ref passes, and h is told.
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

    fn directional(
        &self,
        t: f64,
        x: &[f64],
        u_ref: &[f64],
        u: &[f64],
        direction: Direction,
        out: &mut SampleDerivative,
    ) -> Result<(), NoDerivative> {
        let SampleDerivative { u: du, barriers, scratch } = out;
        let du = &mut du[..u.len()];
        scratch[2].clear();
        scratch[2].resize(self.state_dim, 0.0);
        if self.workspace.requirements.len() > self.slots.len() {
            return Err(NoDerivative::Instants);
        }
        // The derivative of every row at a fixed u.
        let mut row_derivatives = [RowDerivative::NONE; MAX_ROWS];
        for (i, row_derivative) in row_derivatives[..self.slots.len()].iter_mut().enumerate() {
            (*row_derivative, barriers[i]) = self.row_derivative(i, t, x, direction.x, u, scratch)?;
        }

        // The active rows of the sample, whichever method found it.
        let (workspace, count) = (&self.workspace, self.slots.len());
        let (rows, enforcement) = (&workspace.rows[..count], &workspace.enforcement[..count]);
        let report = &workspace.report;
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
        let is_rough = self.is_backed || !report.status.is_satisfied();
        let same = if is_rough { SAME_INPUT_UNMET } else { SAME_INPUT };
        if u.iter().zip(&*again).any(|(a, b)| (a - b).abs() > same * size) {
            return Err(NoDerivative::NotConverged);
        }
        // The derivative of u: (8) with the active rows, else the direction of u_ref but at bounds.
        let active = qp.active();
        if active.iter().any(|a| matches!(a.constraint, Constraint::Row(_))) {
            let mut equations = Equations::new(direction.u);
            for active in active {
                let mut normal = [0.0; MAX_INPUTS];
                let held = match active.constraint {
                    Constraint::Lower(i) | Constraint::Upper(i) => {
                        normal[i] = 1.0;
                        equations.hold(&normal, 0.0)
                    }
                    Constraint::Row(k) => {
                        let row_derivative = &row_derivatives[k];
                        let curvature = self.curvature(k, t, x, u, scratch)?;
                        let row = &rows[k].normal;
                        match enforcement[k] {
                            Enforcement::Soft { penalty }
                                if is_saturated(row, active.multiplier, penalty) =>
                            {
                                pull_saturated(&mut equations, row, penalty, row_derivative, &curvature);
                                true
                            }
                            _ => {
                                let by = active.multiplier;
                                let curvature = curvature.map(|row| row.map(|c| by * c));
                                equations.pull(&row_derivative.normal.map(|a| by * a), &curvature);
                                equations.hold(row, -row_derivative.slack)
                            }
                        }
                    }
                };
                if !held {
                    return Err(NoDerivative::Dependent);
                }
            }
            if !equations.solve(du) {
                return Err(NoDerivative::Dependent);
            }
        } else {
            for i in 0..du.len() {
                du[i] = if again[i] == u_ref[i] { direction.u[i] } else { 0.0 };
            }
        }

        // The numbers of the report that follow u: slack and sampling loss.
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
        Ok(())
    }

    /// Writes the state from which barrier `i` is held, and its direction, to `scratch`.
    fn begin(
        &self,
        i: usize,
        x: &[f64],
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
            source.flow_directional(from, moving, &self.acting()[..self.input_dim], self.delay);
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
        let unknown = NoDerivative::Source(i);
        let source = slot.source.directional().ok_or(unknown)?;
        source.evaluate_directional(t, x, u, Direction { x: dx, u: held }, &mut change);
        // h, and whether the promise has a derivative at this sample.
        let mut derivative = BarrierDerivative { h: change.value[0], ..BarrierDerivative::default() };
        let (before, promise) = (&self.state.barriers[i], &workspace.next.barriers[i]);
        if matches!(promise.phase, Phase::Waiting | Phase::Released) {
            return Ok((RowDerivative::NONE, derivative));
        }
        if promise.phase == Phase::Stay && !slot.promise.keeps_evenly(promise) {
            return Err(NoDerivative::Kept(i));
        }
        if promise.postponed != before.postponed {
            return Err(NoDerivative::Postponed(i));
        }
        // h and its derivatives where the input begins to act.
        let begin = t + self.delay;
        self.begin(i, x, dx, scratch)?;
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
        let anchors = is_anchored(before, promise, begin);
        let stack = [&now.drift[..n], &change.value[..n]];
        let BoundDerivative { floor, profile, margin, sampled } = slot
            .promise
            .differentiate(promise, anchors, begin, stack, period)
            .ok_or(if slot.promise.has_condition() {
                NoDerivative::Condition(i)
            } else {
                NoDerivative::Profile(i)
            })?;
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
        if let Some(period) = period {
            let mut ahead = Ahead::ZERO;
            slot.source.predict().ok_or(unknown)?.ahead(begin, from, u, period, &mut ahead);
            let source = slot.source.predict_directional().ok_or(unknown)?;
            source.ahead_directional(begin, from, u, direction, period, &mut change);
            let bound = &self.slots[i].now.period_bound;
            let moved = weighted(bound, &change, n, u.len(), period);
            let by_weights = sampled.weighted(&ahead.value[..n], &ahead.gradient, u.len(), period);
            row_derivative.slack = moved.value + by_weights.value;
            row_derivative.normal = core::array::from_fn(|i| moved.normal[i] + by_weights.normal[i]);
        }
        Ok((row_derivative, derivative))
    }

    /// The derivative of row `k`'s normal by u: `[i][j]` is that of its component i by u_j.
    fn curvature(
        &self,
        k: usize,
        t: f64,
        x: &[f64],
        u: &[f64],
        scratch: &mut [Vec<f64>; 3],
    ) -> Result<[[f64; MAX_INPUTS]; MAX_INPUTS], NoDerivative> {
        let mut curvature = [[0.0; MAX_INPUTS]; MAX_INPUTS];
        let report = &self.workspace.report;
        if !report.predicted {
            return Ok(curvature);
        }
        let (source, bound) = (&self.slots[k].source, &self.slots[k].now.period_bound);
        let [from, _, zeros] = scratch;
        from.clear();
        from.extend_from_slice(x);
        if self.delay > 0.0
            && let Some(source) = source.predict()
        {
            source.flow(from, &self.acting()[..u.len()], self.delay);
        }
        let directional = source.predict_directional().ok_or(NoDerivative::Source(k))?;
        let mut change = Ahead::ZERO;
        for j in 0..u.len() {
            let mut axis = [0.0; MAX_INPUTS];
            axis[j] = 1.0;
            let direction = Direction { x: zeros, u: &axis[..u.len()] };
            directional.ahead_directional(t + self.delay, from, u, direction, report.period, &mut change);
            let moved = weighted(bound, &change, source.relative_degree(), u.len(), report.period);
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

/// Adds the pull κa/‖a‖ of a soft row at its largest multiplier, with the change (1 − nnᵀ) a' κ/‖a‖ where
/// n = a/‖a‖.
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

/// The derivative of the row of `bound` where the derivatives at the end of the period move by `change`.
fn weighted(bound: &PeriodBound, change: &Ahead, n: usize, inputs: usize, period: f64) -> Weighted {
    let homogeneous = PeriodBound { floor: 0.0, ..*bound };
    homogeneous.weighted(&change.value[..n], &change.gradient, inputs, period)
}
