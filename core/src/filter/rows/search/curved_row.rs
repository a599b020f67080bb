//! One active row with its curvature: the usual step.
//!
//! Let r(u) ≥ 0 be a row over the period, and let no other row and no bound be active. The answer then is where
//!
//! ```text
//! u − u_ref = λ ∇r(u),   r(u) = 0,   λ > 0.                                                            (K)
//! ```
//!
//! At an input u with r and ∇r = a there, r is replaced by the quadratic r + aᵀs + ½ sᵀHs in the step s from u, and (K) is
//! solved for that: s = (I − λH)⁻¹(λa + u_ref − u), with λ by Newton's method on the one equation that is left. The Hessian
//! H is learned along the way. It starts at 0, and then changes as little as it must for H s to be the change of ∇r
//! (Powell's symmetric update; J. Nocedal and S. Wright, *Numerical Optimization*, 2nd ed., section 6.2). So the steps
//! shorten faster and faster. The last is taken once the next, shorter in the same ratio, would be a tenth of what counts as
//! met.
//!
//! The search begins at the answer of the pointwise row, and H with the change of ∇r from u_ref to there. If the previous
//! sample has left its H ([`Curvature`]), the search begins at u_ref with that, and arrives in a step or two. The difference
//! between H s and the change of ∇r shows how stale that H is. An old H never determines an answer, it only shortens the way
//! to it.
//!
//! The answer is accepted under the terms of [`correction`](super::correction): the rows are almost affine from u_ref to
//! there, every other row holds, and no other answer is in sight. λH, which has no unit, is how far the normal turns on the
//! way from u_ref. The differences of r and ∇r at u_ref from the linear model at the answer show it too. A row that turns
//! further is also accepted if it is curved inwards: no eigenvalue of λH is large and positive, so that the quadratic has
//! one answer, and r and ∇r at u_ref differ little from the values of the *quadratic*. The row of a vehicle that heads for
//! its goal over a long period is curved like that. If the answer continues that of the previous sample, other answers are
//! looked for only every [`GOES_ON`]th time.

use super::correction::{CONVERGING, CORRECTIONS, SKIPPED};
use super::{CONTRACTION, FAR, Linearised, MET, PeriodProblem, SAME, norm};
use crate::qp::{Outcome, Row, RowSet, Solution, Solver, Workspace};
use crate::{MAX_INPUTS, elementary};

/// The least square of the sideways part of a step, as a part of the step's, at which it shows how the row curves sideways.
const SIDEWAYS_OF_STEP: f64 = 0.05;
/// Largest ratio of a step to the product of the two before it and the turn of the normal per distance: three to four times
/// what vehicles show, over a third of what counts as met. The same for a step over the observed error of a kept curvature.
const SECANT: f64 = 30.0;
/// The shortest step, as a part of the input, that shows a curvature beyond round-off.
const TELLING: f64 = 1e-7;
/// The next change of λ in Newton's method, as a part of it, that is left out: 3/2 λH times the square of the last one.
const ROOT: f64 = SKIPPED * MET;
/// Largest number of steps of Newton's method for λ.
const MULTIPLIER_STEPS: usize = 12;

/// Number of consecutive samples whose answers continue the previous one without a search for others.
const GOES_ON: u32 = 8;
/// The largest number of inputs with which a row is searched with its curvature.
const INPUTS: usize = if MAX_INPUTS < 3 { MAX_INPUTS } else { 3 };

type Matrix<const M: usize> = [[f64; M]; M];

/// The curvature of the only active row of a sample: the memory from which the search of the next sample begins.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Curvature {
    /// The number of the barrier that the row belongs to.
    pub barrier: u32,
    /// Second derivatives of the row with respect to the inputs, for each second of the period, in `[h]`/(sⁿ⁺¹ · unit of
    /// u²): of inputs 1 and 1, 2 and 1, 2 and 2, 3 and 1, …; zeros above the number of inputs.
    #[cfg_attr(feature = "serde", serde(with = "crate::real"))]
    pub hessian: [f64; INPUTS * (INPUTS + 1) / 2],
    /// Samples since other answers were looked for; from 8 on, the next sample looks.
    pub looked: u32,
    /// Samples since a step sideways of the line from u_ref has shown how the row curves there; `None` if none ever has.
    pub sideways: Option<u32>,
}

impl Curvature {
    /// The second derivatives over a period of that many `seconds`.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn over<const M: usize>(&self, seconds: f64) -> Matrix<M> {
        let at = |i: usize, j: usize| self.hessian[i * (i + 1) / 2 + j];
        core::array::from_fn(|i| core::array::from_fn(|j| seconds * at(i.max(j), i.min(j))))
    }

    /// As if `hessian` had been `seconds` times as large.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn write<const M: usize>(&mut self, hessian: &Matrix<M>, seconds: f64) {
        for i in 0..M {
            for j in 0..=i {
                self.hessian[i * (i + 1) / 2 + j] = hessian[i][j] / seconds;
            }
        }
    }
}

/// Σ a_i b_i, unrolled.
#[cfg_attr(not(feature = "small"), inline(always))]
fn product<const M: usize>(a: &[f64; M], b: &[f64; M]) -> f64 {
    let mut sum = 0.0;
    for i in 0..M {
        sum += a[i] * b[i];
    }
    sum
}

/// The largest component.
#[cfg_attr(not(feature = "small"), inline(always))]
fn largest<const M: usize>(a: &[f64; M]) -> f64 {
    let mut largest = 0.0;
    for i in 0..M {
        largest = if a[i].abs() > largest { a[i].abs() } else { largest };
    }
    largest
}

/// The row as a quadratic function of the step from an input.
struct Bent<const M: usize> {
    value: f64,
    normal: [f64; M],
    hessian: Matrix<M>,
}

impl<const M: usize> Bent<M> {
    /// H s.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn turn(&self, s: &[f64; M]) -> [f64; M] {
        core::array::from_fn(|i| product(&self.hessian[i], s))
    }

    /// Changes the Hessian as little as possible so that `H s` is the change `y` of the normal.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn learn(&mut self, s: &[f64; M], y: &[f64; M]) {
        let known = self.turn(s);
        let rest: [f64; M] = core::array::from_fn(|i| y[i] - known[i]);
        let per_square = 1.0 / product(s, s);
        let along = product(&rest, s) * per_square;
        for i in 0..M {
            for j in 0..M {
                self.hessian[i][j] += (rest[i] * s[j] + s[i] * rest[j] - along * s[i] * s[j]) * per_square;
            }
        }
    }

    /// Changes the Hessian along a direction sideways of an answer so that the values there and on the opposite side add up
    /// to `values`. Returns whether these are numbers; if not, nothing has been learned.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn learn_sideways(&mut self, way: &[f64], values: f64) -> bool {
        let Some(s) = way.first_chunk::<M>() else { return false };
        let rest = values - product(s, &self.turn(s));
        if !rest.is_finite() {
            return false;
        }
        let square = product(s, s);
        for i in 0..M {
            for j in 0..M {
                self.hessian[i][j] += rest * s[i] * s[j] / (square * square);
            }
        }
        true
    }

    /// Whether no eigenvalue of λH is as large as `most`.
    fn is_curved_inwards(&self, lambda: f64, most: f64) -> bool {
        // `most` I − λH has only positive pivots.
        let mut left: Matrix<M> = core::array::from_fn(|i| {
            core::array::from_fn(|j| if i == j { most } else { 0.0 } - lambda * self.hessian[i][j])
        });
        for k in 0..M {
            // NaN is not positive.
            if !matches!(left[k][k], f64::MIN_POSITIVE..f64::INFINITY) {
                return false;
            }
            for i in k + 1..M {
                let part = left[i][k] / left[k][k];
                for j in k + 1..M {
                    left[i][j] -= part * left[k][j];
                }
            }
        }
        true
    }

    /// The step to the answer of (K), and λ, with u_ref at `back` from here. `None` if an eigenvalue of λH is positive and
    /// not small.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn nearest(&self, back: &[f64; M]) -> Option<([f64; M], f64)> {
        /// The largest square of λH.
        const SMALL: f64 = CONVERGING * CONVERGING;
        // As seen from u_ref, it is value + cᵀw + ½ wᵀHw of the way w, and (K) is w = λ (I − λH)⁻¹ c.
        let curvature = self.turn(back);
        let c: [f64; M] = core::array::from_fn(|i| self.normal[i] + curvature[i]);
        let middle = core::array::from_fn(|i| self.normal[i] + 0.5 * curvature[i]);
        let value = self.value + product(back, &middle);
        let inverse = Resolvent::of(&self.hessian, &c);
        let size: f64 = self.hessian.iter().map(|h| product(h, h)).sum();
        // The first terms in λ are value + λ cᵀc + 3/2 λ² cᵀHc.
        let (square, bent) = (product(&c, &c), product(&c, &self.turn(&c)));
        let mut lambda = -value * square / (square * square - 1.5 * value * bent);
        // NaN is not small.
        let is_small = |turn: f64| matches!(turn, 0.0..=SMALL);
        if !is_small(lambda * lambda * size) {
            // If the row is curved inwards, the remainder is concave in λ. λ grows from the first term on, which is too
            // small.
            lambda = -value / square;
        }
        for _ in 0..MULTIPLIER_STEPS {
            let turn = lambda * lambda * size;
            if !is_small(turn) && !self.is_curved_inwards(lambda, CONVERGING) {
                return None;
            }
            // ∇r there is w/λ, so H w is its difference from c.
            let (there, rate) = inverse.at(lambda);
            let moved: [f64; M] = core::array::from_fn(|i| there[i] + lambda * rate[i]);
            let both = core::array::from_fn(|i| c[i] + there[i]);
            let missing = value + 0.5 * lambda * product(&there, &both);
            let change = -missing / product(&there, &moved);
            let part = change / lambda;
            if 2.25 * turn * (part * part) * (part * part) <= ROOT * ROOT {
                let way = core::array::from_fn(|i| lambda * there[i] + change * moved[i] + back[i]);
                return Some((way, lambda + change));
            }
            lambda += change;
        }
        None
    }
}

/// (I − λH)⁻¹ c as a function of λ: polynomials over the characteristic one, by the recurrence of Faddeev and LeVerrier
/// (F. R. Gantmacher, *The Theory of Matrices*, vol. 1, chapter IV, section 5).
struct Resolvent<const M: usize> {
    /// The coefficients of the numerator, from the constant one on.
    numerator: [[f64; M]; M],
    /// Those of det(I − λH) after the constant one, which is 1.
    determinant: [f64; M],
}

impl<const M: usize> Resolvent<M> {
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn of(hessian: &Matrix<M>, c: &[f64; M]) -> Self {
        let mut of = Self { numerator: [*c; M], determinant: [0.0; M] };
        let mut power = *hessian;
        for k in 0..M {
            let mut trace = 0.0;
            for i in 0..M {
                trace += power[i][i];
            }
            of.determinant[k] = -trace / (k + 1) as f64;
            if k + 1 < M {
                for i in 0..M {
                    power[i][i] += of.determinant[k];
                }
                of.numerator[k + 1] = core::array::from_fn(|i| product(&power[i], c));
                // H is symmetric, and so is every polynomial in it.
                power = core::array::from_fn(|i| core::array::from_fn(|j| product(&hessian[i], &power[j])));
            }
        }
        of
    }

    /// The vector, and its derivative by λ.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn at(&self, lambda: f64) -> ([f64; M], [f64; M]) {
        let (mut over, mut rate) = (self.numerator[M - 1], [0.0; M]);
        for coefficient in self.numerator[..M - 1].iter().rev() {
            for i in 0..M {
                rate[i] = rate[i] * lambda + over[i];
                over[i] = over[i] * lambda + coefficient[i];
            }
        }
        let (mut under, mut change) = (self.determinant[M - 1], 0.0);
        for k in (0..M).rev() {
            change = change * lambda + under;
            under = under * lambda + if k == 0 { 1.0 } else { self.determinant[k - 1] };
        }
        let per = 1.0 / under;
        let value: [f64; M] = core::array::from_fn(|i| over[i] * per);
        (value, core::array::from_fn(|i| (rate[i] - value[i] * change) * per))
    }
}

impl PeriodProblem<'_> {
    /// The answer, written to `u`, if only one hard row is active in it and that row is almost affine between u_ref and
    /// there. `None`, with an arbitrary `u`, if this is not known to be so.
    pub(super) fn curved_row(
        &self,
        u: &mut [f64],
        last: Option<&[f64]>,
        at: &mut Linearised,
        qp: &mut Workspace,
    ) -> Option<Solution> {
        if !self.errors.is_exact() || self.requirements.len() > self.listed {
            return None;
        }
        match u.len() {
            1 => self.bent_row_for::<1>(u, last, at, qp),
            2 => self.bent_row_for::<2>(u, last, at, qp),
            3 if INPUTS >= 3 => self.bent_row_for::<3>(u, last, at, qp),
            _ => None,
        }
    }

    #[cfg_attr(not(feature = "small"), inline(always))]
    fn bent_row_for<const M: usize>(
        &self,
        u: &mut [f64],
        last: Option<&[f64]>,
        at: &mut Linearised,
        qp: &mut Workspace,
    ) -> Option<Solution> {
        let (out, u_ref): (&mut [f64; M], &[f64; M]) = (u.first_chunk_mut()?, self.u_ref.first_chunk()?);
        let (chosen, mut u) = self.furthest(u_ref)?;
        if !self.soft().is_empty() || !self.bounds.contain_all(u_ref) || !self.bounds.contain_all(&u) {
            return None;
        }
        // Does u_ref violate the row over the period too?
        let requirement = &self.requirements[chosen];
        let at_reference = self.weighted(requirement, u_ref, at.evaluations)?;
        let normal: [f64; M] = *at_reference.normal.first_chunk()?;
        let moved: f64 = (0..M).map(|i| (normal[i] * u_ref[i]).abs()).sum();
        if at_reference.value >= -MET * (at_reference.terms + moved) {
            return None;
        }
        // From the answer of the pointwise row, or of the row with its earlier curvature, to that of the row itself.
        let mut row = Bent { value: at_reference.value, normal, hessian: [[0.0; M]; M] };
        let mut step: [f64; M] = core::array::from_fn(|i| u[i] - u_ref[i]);
        let (mut length, mut ratio) = (f64::INFINITY, 0.0_f64);
        let mut kept = self.curvature.filter(|curvature| curvature.barrier as usize == requirement.barrier);
        if let Some(curvature) = kept {
            row.hessian = curvature.over(requirement.ahead);
            let (way, lambda) = row.nearest(&[0.0; M]).unwrap_or(([0.0; M], 0.0));
            let target: [f64; M] = core::array::from_fn(|i| u_ref[i] + way[i]);
            if lambda > 0.0 && self.bounds.contain_all(&target) {
                (u, step, length) = (target, way, largest(&way));
            } else {
                (row.hessian, kept) = ([[0.0; M]; M], None);
            }
        }
        let (mut way, mut turned) = ([0.0; M], [0.0; M]);
        let (mut curved_sideways, mut rounds) = (false, 0);
        let (lambda, turn) = loop {
            let here = self.weighted(requirement, &u, at.evaluations)?;
            let before = core::mem::replace(&mut row.normal, *here.normal.first_chunk()?);
            row.value = here.value;
            let change = core::array::from_fn(|i| row.normal[i] - before[i]);
            let back: [f64; M] = core::array::from_fn(|i| u_ref[i] - u[i]);
            if rounds == 0 {
                (way, turned) = (step, change);
            } else {
                // The part of the step sideways of the line from u_ref, with its own part of the turn.
                let along = product(&step, &way) / product(&way, &way);
                let sideways = core::array::from_fn(|i| step[i] - along * way[i]);
                let tells = largest(&step) >= TELLING * 1.0_f64.max(largest(&u));
                if tells && product(&sideways, &sideways) >= SIDEWAYS_OF_STEP * product(&step, &step) {
                    row.learn(&sideways, &core::array::from_fn(|i| change[i] - along * turned[i]));
                    curved_sideways = true;
                }
            }
            let known = row.turn(&step);
            let off: [f64; M] = core::array::from_fn(|i| change[i] - known[i]);
            let off = elementary::sqrt(product(&off, &off) / product(&step, &step));
            row.learn(&step, &change);
            let lambda;
            (step, lambda) = row.nearest(&back)?;
            let target: [f64; M] = core::array::from_fn(|i| u[i] + step[i]);
            // NaN is not within bounds.
            if !self.bounds.contain_all(&target) || lambda <= 0.0 {
                return None;
            }
            let (shortened, size) = (largest(&step) / length, 1.0_f64.max(largest(&u)).max(largest(&target)));
            let before_length = length;
            let from = core::mem::replace(&mut u, target);
            length = largest(&step);
            let turn = lambda * elementary::sqrt(row.hessian.iter().map(|h| product(h, h)).sum());
            let next = match kept {
                // A step shows the error of the curvature along it. Sideways, if no step has shown it, the curvature is off
                // by that for each sample that has passed.
                Some(curvature) => {
                    let off = lambda * off;
                    let sideways = match curvature.sideways {
                        _ if curved_sideways => off,
                        Some(samples) => turn.min(off * f64::from(samples)),
                        None => turn,
                    };
                    SECANT * (off + sideways) * length
                }
                // Secant methods: a step is about the product of the two before it, once they have shown how the row curves.
                None if curved_sideways => {
                    SECANT * turn * length * before_length / elementary::sqrt(product(&back, &back))
                }
                None => shortened.max(turn) * length / SKIPPED,
            };
            if length == 0.0 || (kept.is_some() || rounds > 0) && next <= MET * size {
                at.rows[chosen] = Row::linear(&row.normal, row.value, &from);
                break (lambda, turn);
            }
            rounds += 1;
            if shortened > CONVERGING || rounds == CORRECTIONS {
                return None;
            }
            // The first two steps show how much the normal turns, if its turn was not known.
            ratio = if rounds == 2 && kept.is_none() { shortened } else { ratio };
        };
        // How far the row curves between u_ref and the answer, and how far its normal turns there, as parts of themselves.
        let square = product(&row.normal, &row.normal);
        let missed = (at_reference.value + lambda * square).abs() / (lambda * square);
        let turned: [f64; M] = core::array::from_fn(|i| row.normal[i] - normal[i]);
        let curvature = missed.max(elementary::sqrt(product(&turned, &turned) / square));
        let mut ratio = ratio.max(curvature).max(turn);
        // NaN fails this comparison.
        if !matches!(ratio, 0.0..=CONVERGING) {
            // A quadratic that is curved inwards has one answer, however far it curves. What counts is the row's difference
            // from it, and that the plant does not turn all the way round, which no quadratic sees.
            let way = core::array::from_fn(|i| u[i] - u_ref[i]);
            let curvature = row.turn(&way);
            let missed = (at_reference.value + lambda * square - 0.5 * product(&way, &curvature)).abs();
            let rest: [f64; M] = core::array::from_fn(|i| turned[i] - curvature[i]);
            ratio = (missed / (lambda * square)).max(elementary::sqrt(product(&rest, &rest) / square));
            let is_far = norm(way.iter().copied()) > FAR * 1.0_f64.max(largest(u_ref));
            if is_far || !matches!(ratio, 0.0..=CONTRACTION) || !row.is_curved_inwards(lambda, CONTRACTION) {
                return None;
            }
        }
        let distance = norm(u.iter().zip(u_ref).map(|(v, r)| v - r));
        let known = 1.0_f64.max(largest(u_ref));
        let limit = last.unwrap_or_default().iter().fold(known, |s, v| s.max(v.abs()));
        if distance > (FAR * limit).min(self.correction_limit) {
            return None;
        }
        // The other rows at the answer.
        if at.rows.len() > 1 {
            self.linearise(&u, RowSet::ALL - RowSet::of(chosen), at)?;
            at.violations[chosen] = 0.0;
            if at.worst(RowSet::EMPTY) > 0.0 {
                return None;
            }
        }
        let young = kept.filter(|curvature| curvature.looked < GOES_ON);
        let goes_on = young.filter(|_| last.is_some_and(|last| self.is_close(last, &u, distance, ratio)));
        let mut sees_sideways = true;
        if goes_on.is_none() {
            let is_sole = match last {
                Some(last) => {
                    self.is_near(last, &u, distance, ratio)
                        || self.leads_to(last.first_chunk()?, &u, (chosen, &row.hessian), at)
                }
                None => ratio <= CONTRACTION,
            };
            let seen_sideways = ratio <= CONTRACTION && curved_sideways;
            let learn = |way: &[f64], slacks: f64| sees_sideways &= row.learn_sideways(way, slacks);
            if !is_sole || !seen_sideways && self.look_sideways(&u, (chosen, ratio <= CONTRACTION), at, learn)
            {
                return None;
            }
        }
        *out = u;
        qp.note_active(chosen, lambda);
        // If the look sideways showed nothing, for example because a bound cut it short, the next sample looks again.
        let looked =
            goes_on.map_or(if sees_sideways { 0 } else { GOES_ON }, |curvature| curvature.looked + 1);
        let passed =
            || kept.and_then(|curvature| curvature.sideways).map(|samples| samples.saturating_add(1));
        let sideways = if curved_sideways { Some(1) } else { passed() };
        let mut curvature =
            Curvature { barrier: requirement.barrier as u32, hessian: [0.0; _], looked, sideways };
        curvature.write(&row.hessian, requirement.ahead);
        *at.curvature = Some(curvature);
        Some(Solution { outcome: Outcome::Optimal, solver: Solver::ClosedForm, iterations: 0 })
    }

    /// The row of the sample that u_ref violates by the largest distance, and the input nearest to u_ref that meets it;
    /// `None` if there is none.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn furthest<const M: usize>(&self, u_ref: &[f64; M]) -> Option<(usize, [f64; M])> {
        let (mut furthest, mut distance) = (None, 0.0);
        for (i, requirement) in self.requirements.iter().enumerate() {
            let row = &self.slots[requirement.barrier].now.row;
            let normal: &[f64; M] = row.normal.first_chunk()?;
            let (missing, square) = (row.floor - product(normal, u_ref), product(normal, normal));
            if missing * missing > distance * square && missing > 0.0 && !requirement.bound.is_zero() {
                let lambda = missing / square;
                distance = missing * lambda;
                furthest = Some((i, core::array::from_fn(|i| u_ref[i] + lambda * normal[i])));
            }
        }
        furthest
    }

    /// Whether the row `chosen`, with the curvature of `hessian` at `last`, leads to the answer `u`.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn leads_to<const M: usize>(
        &self,
        last: &[f64; M],
        u: &[f64; M],
        (chosen, hessian): (usize, &Matrix<M>),
        at: &mut Linearised,
    ) -> bool {
        let Some(here) = self.weighted(&self.requirements[chosen], last, at.evaluations) else {
            return false;
        };
        let Some(normal) = here.normal.first_chunk() else { return false };
        let row = Bent { value: here.value, normal: *normal, hessian: *hessian };
        let back = core::array::from_fn(|i| self.u_ref[i] - last[i]);
        let Some((step, lambda)) = row.nearest(&back) else { return false };
        let away: [f64; M] = core::array::from_fn(|i| u[i] - last[i]);
        let left: [f64; M] = core::array::from_fn(|i| away[i] - step[i]);
        lambda > 0.0 && largest(&left) <= CONVERGING * largest(&away) + SAME * largest(u).max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// r(u) = 1 − (u₁ + 2)² − 3u₂²/2 + u₁u₂: the inside of an ellipse.
    const HESSIAN: Matrix<2> = [[-2.0, 1.0], [1.0, -3.0]];

    fn inside(u: [f64; 2]) -> Bent<2> {
        let normal = [-2.0 * (u[0] + 2.0) + u[1], u[0] - 3.0 * u[1]];
        let value = 1.0 - (u[0] + 2.0).powi(2) - 1.5 * u[1] * u[1] + u[0] * u[1];
        Bent { value, normal, hessian: HESSIAN }
    }

    /// The way solves (K), from wherever it begins.
    #[test]
    fn the_nearest_point_of_a_bent_row() {
        let u_ref = [-0.8, 0.1];
        let mut answers = [[-1.1, -0.4], [-0.9, -0.2]].map(|u: [f64; 2]| {
            let back = [u_ref[0] - u[0], u_ref[1] - u[1]];
            let (step, lambda) = inside(u).nearest(&back).expect("a curvature that is not large");
            let u = [u[0] + step[0], u[1] + step[1]];
            let Bent { value, normal, .. } = inside(u);
            // A dozen operations on numbers of order 1, and λ to the square of the last change.
            assert!(value.abs() < 1e-11 && lambda > 0.0, "{value}");
            for i in 0..2 {
                assert!((u[i] - u_ref[i] - lambda * normal[i]).abs() < 1e-11, "{u:?}");
            }
            u
        });
        let [a, b] = &mut answers;
        assert!((a[0] - b[0]).abs() < 1e-11 && (a[1] - b[1]).abs() < 1e-11, "{a:?}, {b:?}");
    }

    /// From far outside, the row turns several times as much as itself on the way, and there still is one answer. If it is
    /// curved outwards there may be others.
    #[test]
    fn the_nearest_point_of_a_row_that_is_curved_inwards() {
        for u_ref in [[3.0, 2.0], [-9.0, 4.0], [0.5, -30.0]] {
            let (step, lambda) = inside(u_ref).nearest(&[0.0; 2]).expect("curved inwards");
            let Bent { value, normal, hessian } = inside([u_ref[0] + step[0], u_ref[1] + step[1]]);
            assert!(lambda * norm(hessian.iter().flatten().copied()) > 2.0, "{lambda}");
            // As above, on numbers of order 1000 at u_ref.
            assert!(value.abs() < 1e-9, "{u_ref:?}: {value}");
            for i in 0..2 {
                assert!((step[i] - lambda * normal[i]).abs() < 1e-9, "{u_ref:?}: {step:?}");
            }
        }
        // r = u₁ + 3 u₂²/2 − 1, from 0: either side is nearer than straight ahead.
        let outside = Bent { value: -1.0, normal: [1.0, 0.0], hessian: [[0.0, 0.0], [0.0, 3.0]] };
        assert!(outside.nearest(&[0.0; 2]).is_none());
    }

    /// Two steps in different directions show all of a constant Hessian, each change as little as it must be.
    #[test]
    fn the_hessian_is_learned_from_two_steps() {
        let exact = inside([0.0; 2]);
        let mut row = Bent { hessian: [[0.0; 2]; 2], ..inside([0.0; 2]) };
        for step in [[0.3, 0.4], [-0.4, 0.3]] {
            row.learn(&step, &exact.turn(&step));
        }
        for (found, wanted) in row.hessian.as_flattened().iter().zip(HESSIAN.as_flattened()) {
            assert!((found - wanted).abs() < 1e-14, "{:?}", row.hessian);
        }
    }

    /// The values on both sides of an answer show the curvature on the way between them; what is not known shows nothing.
    #[test]
    fn a_look_sideways_shows_the_curvature_on_its_way() {
        let mut row = Bent { hessian: [[0.5, 0.2], [0.2, -0.1]], ..inside([0.0; 2]) };
        let before = row.hessian;
        assert!(!row.learn_sideways(&[0.3, -0.1], f64::NAN) && row.hessian == before);
        for way in [[0.3, -0.1], [-0.2, 0.7]] {
            let values = product(&way, &inside([0.0; 2]).turn(&way));
            assert!(row.learn_sideways(&way, values));
            assert!((product(&way, &row.turn(&way)) - values).abs() < 1e-14, "{:?}", row.hessian);
        }
    }
}
