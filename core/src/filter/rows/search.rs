//! The rows over the sampling period, and the search for an input that meets them.
//!
//! The row of the pointwise constraint is affine in u. Its integral over the period ([`crate::convergence::sampled`]) is
//! not, because the state at the end of the period depends on u through the plant. Newton's method on the rows solves it:
//! linearise at the present guess, solve the QP, and go towards its answer. Each step goes as far as the violation
//! decreases, halving its length; rows that the QP gives up do not count. Only rows that are active or violated are
//! linearised again. The others keep their last linearisation, at first the pointwise row. All are evaluated where the
//! search ends.
//!
//! Usually one row is active and almost affine, and its point nearest to u_ref is found at once (`curved_row`). With several
//! rows, a few corrections from u_ref find the answer (`correction`). If they do not, there are two guesses to start from:
//! the answer of the pointwise rows, and the input of the previous step. The better result is used, judged by the number of
//! rows given up, then by violation, then by distance from u_ref. The second guess matters if the row nearly vanishes, as
//! for a vehicle across the line of sight: it continues the turn that was begun, through the instants at which the
//! linearisation cannot see it. It is left out if the first guess met every row by full steps that each became ten times
//! shorter, and is no further from u_ref than the last input. The rows are then almost affine there, and the answer is the
//! only one nearby. Answers that differ by round-off count as equal, so a repeated sample gives the same bits.
//!
//! An answer is settled if its steps contracted like that, or if both guesses lead to it. Two kinds of answers are not
//! settled. One is far from u_ref, where the plant turns and other answers exist. The other has room sideways: the row that
//! u_ref violates leaves more room there than the way costs. A vehicle that brakes straight ahead, though it could turn to
//! either side, stands still between two such answers. So a master that repeats a step, or divides it in two, gets the same
//! input. From any answer that is not settled, above all from one that does not meet the rows, the module `wide` searches
//! on. Its answer is used only if it meets all hard rows and is nearer, so a correct answer keeps its bits. Rows that cannot
//! be met together are given up as the QP says, by priority.
//!
//! A violation counts as round-off if it is small against the terms that h and its derivatives are made of. It is not
//! compared with the sum of these terms: on the boundary of 10 − p ≥ 0 that is round-off itself.

mod correction;
mod curved_row;
mod wide;

pub use curved_row::Curvature;

use super::errors::{MeasurementErrors, Uncertainty};
use super::shared::SharedPlants;
use super::slot::BarrierSlot;
use crate::convergence::sampled::{PeriodBound, Weighted};
use crate::elementary;
use crate::lie::Ahead;
use crate::qp::{
    Bounds, Constraint, Enforcement, Outcome, Problem, Row, RowSet, Solution, Solver, Workspace,
};
use crate::scalar::all_finite;
use crate::{MAX_INPUTS, MAX_RELATIVE_DEGREE, MAX_ROWS};

/// Violations up to this part of a row's terms count as met: Newton's method leaves as much.
const MET: f64 = 1e-9;
/// Violations up to this part of the terms that the derivatives of h are made of count as met: some thousand
/// roundings of 1e-16.
const ROUND_OFF: f64 = 1e-12;
/// Answers that differ by no more than this, as a part of their size, count as one.
const SAME: f64 = 1e-6;
/// Distance from u_ref beyond which an answer is not settled, in units of the size of u_ref and the last input, or of 1.
const FAR: f64 = 8.0;
/// Distance sideways of an answer at which a nearer one is looked for, as a part of its distance from u_ref.
const SIDEWAYS: f64 = 0.5;
/// Linearisations per guess, and halvings of the way to the answer of one linearisation.
const PATIENT: [u32; 2] = [12, 8];
/// The same of a brief search: what more of them would find is seldom better than a plan.
const BRIEF: [u32; 2] = [4, 2];
/// The part of the predicted decrease that must come true.
const SUFFICIENT: f64 = 0.3;
/// Largest ratio of each step of a search to the one before, for its answer to be the only one nearby.
const CONTRACTION: f64 = 0.1;

/// The requirement on one barrier at one instant ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Requirement {
    /// The number of the barrier.
    pub(crate) barrier: usize,
    /// The bound on its derivatives at that instant.
    pub(crate) bound: PeriodBound,
    /// The time in s until that instant, finite, > 0.
    pub(crate) ahead: f64,
    /// The divisor that makes h⁽ʲ⁾ at the end comparable with a row on h⁽ⁿ⁾, where j is the highest order that the bound
    /// weighs: h⁽ⁿ⁾ held for the duration δ changes h⁽ʲ⁾ by δⁿ⁻ʲ/(n − j)! times itself. For j = n − 1 it is δ.
    pub(crate) divisor: f64,
}

impl Requirement {
    /// The requirement `ahead` s from now, of a barrier of relative degree `n`.
    pub(crate) fn new(barrier: usize, bound: PeriodBound, ahead: f64, n: usize) -> Self {
        let order = bound.weights[..n].iter().rposition(|w| *w != 0.0).unwrap_or(0);
        let divisor = (1..=n - order).fold(1.0, |product, i| product * (ahead / i as f64));
        Self { barrier, bound, ahead, divisor }
    }

    /// Whether it bounds h alone at an instant. Otherwise it is (S), whose floor contains the present h.
    pub(crate) fn is_instant(&self) -> bool {
        self.bound.decay == 0.0
    }

    /// The derivative of its row as the derivatives at that instant move by `change` and the bound stays.
    pub(crate) fn change(&self, change: &Ahead, n: usize, inputs: usize) -> Weighted {
        let homogeneous = PeriodBound { floor: 0.0, ..self.bound };
        homogeneous.weighted(&change.value[..n], &change.gradient, inputs, self.divisor)
    }
}

/// The rows over the period as functions of u, for the search.
pub(crate) struct PeriodProblem<'a> {
    pub(crate) slots: &'a [BarrierSlot],
    /// Requirements, at most [`MAX_ROWS`]; each has a row.
    pub(crate) requirements: &'a [Requirement],
    /// Number of those at the end of the period; the others are instants within it.
    pub(crate) listed: usize,
    pub(crate) t: f64,
    pub(crate) bounds: &'a Bounds,
    pub(crate) u_ref: &'a [f64],
    /// Enforcement of each requirement.
    pub(crate) enforcement: &'a [Enforcement],
    pub(crate) correction_limit: f64,
    pub(crate) errors: &'a MeasurementErrors,
    /// Whether to search widely for an input if the pointwise rows cannot be met either.
    pub(crate) widens: bool,
    /// Whether the search is brief: a plan backs the step, so that the rows need not be met, or it was asked for.
    pub(crate) is_brief: bool,
    /// The curvature of the only active row of the previous sample.
    pub(crate) curvature: Option<&'a Curvature>,
}

/// Scratch memory of the search; its contents change no bit of the next one.
pub(crate) struct Scratch {
    violations: [f64; MAX_ROWS],
    pub(crate) evaluations: Evaluations,
    predicted: Predicted,
    /// The curvature of the only active row of the last answer, if the search knows it.
    pub(crate) curvature: Option<Curvature>,
}

impl Scratch {
    pub(crate) fn new(plants: SharedPlants) -> Self {
        let evaluations = Evaluations { ahead: Ahead::ZERO, plants };
        Self { violations: [0.0; MAX_ROWS], evaluations, predicted: Predicted::NOTHING, curvature: None }
    }

    /// Forgets the last answer.
    pub(crate) fn clear(&mut self) {
        (self.predicted.rows, self.curvature) = (RowSet::EMPTY, None);
    }

    /// h⁽⁰⁾ … h⁽ⁿ⁻¹⁾ at the instant of requirement `i` under `u`; the rest is meaningless. `None` if this is not the
    /// search's last prediction.
    pub(crate) fn predicted(&self, i: usize, u: &[f64]) -> Option<&[f64; MAX_RELATIVE_DEGREE]> {
        let Predicted { rows, input, values } = &self.predicted;
        (rows.contains(i) && *u == input[..u.len()]).then(|| &values[i])
    }
}

/// Memory for the evaluations of the sources.
pub(crate) struct Evaluations {
    /// The last prediction.
    ahead: Ahead,
    pub(crate) plants: SharedPlants,
}

/// The predictions at one input.
struct Predicted {
    /// The requirements that were predicted.
    rows: RowSet,
    input: [f64; MAX_INPUTS],
    /// h⁽⁰⁾ … h⁽ⁿ⁻¹⁾ at the instant of each.
    values: [[f64; MAX_RELATIVE_DEGREE]; MAX_ROWS],
}

impl Predicted {
    const NOTHING: Self = Self {
        rows: RowSet::EMPTY,
        input: [0.0; MAX_INPUTS],
        values: [[0.0; MAX_RELATIVE_DEGREE]; MAX_ROWS],
    };
}

/// Linear models of the sampled rows, and the violation of each at the present u in units of its terms.
struct Linearised<'a> {
    rows: &'a mut [Row],
    violations: &'a mut [f64; MAX_ROWS],
    evaluations: &'a mut Evaluations,
    predicted: &'a mut Predicted,
    curvature: &'a mut Option<Curvature>,
}

impl Linearised<'_> {
    /// The largest violation among the rows that are not in `relaxed`, 0 if all are met.
    fn worst(&self, relaxed: RowSet) -> f64 {
        let kept = |i: &usize| !relaxed.contains(*i);
        (0..self.rows.len()).filter(kept).fold(0.0, |w: f64, i| w.max(self.violations[i]))
    }

    /// The row with the largest violation, if any is violated.
    fn most_violated(&self) -> Option<usize> {
        let worst =
            (0..self.rows.len()).max_by(|i, j| self.violations[*i].total_cmp(&self.violations[*j]))?;
        (self.violations[worst] > 0.0).then_some(worst)
    }

    fn violated(&self) -> RowSet {
        RowSet::with(self.rows.len(), |i| self.violations[i] > 0.0)
    }
}

/// The length of the vector of these components.
#[cfg_attr(not(feature = "small"), inline(always))]
fn norm(components: impl Iterator<Item = f64> + Clone) -> f64 {
    /// Squares in this range neither overflow nor lose digits.
    const SQUARES: core::ops::Range<f64> = 1e-250..1e250;
    let square = components.clone().fold(0.0, |sum, v| sum + v * v);
    if SQUARES.contains(&square) {
        return elementary::sqrt(square);
    }
    components.fold(0.0, |s: f64, v| elementary::hypot(s, v))
}

/// The rows that are active in the last answer of `qp`.
fn active(qp: &Workspace) -> RowSet {
    let mut rows = RowSet::EMPTY;
    for active in qp.active() {
        if let Constraint::Row(i) = active.constraint {
            rows.insert(i);
        }
    }
    rows
}

impl PeriodProblem<'_> {
    /// The row from which the search starts: the pointwise one, or the one at an instant to the order n.
    fn first_row(&self, i: usize) -> Row {
        let requirement = &self.requirements[i];
        let slot = &self.slots[requirement.barrier];
        match i < self.listed {
            true => slot.now.row,
            false => slot.outlook().row_at(requirement, &slot.now.row.normal),
        }
    }

    /// Finds u from the pointwise rows and `last`, the input of the previous step. On return `rows` are the sampled ones,
    /// linearised at `u`. `None` if a source cannot predict or its prediction is not finite; `rows` and `u` are then as a
    /// pointwise step would leave them.
    pub(crate) fn solve(
        &self,
        rows: &mut [Row],
        last: Option<&[f64]>,
        scratch: &mut Scratch,
        qp: &mut Workspace,
        u: &mut [f64],
    ) -> Option<Solution> {
        // With two inputs, as most vehicles have, known to the compiler the short loops unroll.
        match u {
            [a, b] if MAX_INPUTS > 4 => {
                let mut two = [*a, *b];
                let solution = self.solve_for::<2>(rows, last, scratch, qp, &mut two);
                (*a, *b) = (two[0], two[1]);
                solution
            }
            _ => self.solve_for::<MAX_INPUTS>(rows, last, scratch, qp, u),
        }
    }

    /// [`Self::solve`] for at most `N` inputs.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn solve_for<const N: usize>(
        &self,
        rows: &mut [Row],
        last: Option<&[f64]>,
        scratch: &mut Scratch,
        qp: &mut Workspace,
        u: &mut [f64],
    ) -> Option<Solution> {
        let m = u.len();
        let Scratch { violations, evaluations, predicted, curvature } = scratch;
        let mut at = Linearised { rows, violations, evaluations, predicted, curvature };
        if let Some(solution) = self.curved_row(u, last, &mut at, qp) {
            return Some(solution);
        }
        for (i, row) in at.rows.iter_mut().enumerate() {
            *row = self.first_row(i);
        }
        let mut pointwise = [0.0; N];
        let pointwise = &mut pointwise[..m];
        let first = qp.solve(&self.problem(at.rows), pointwise);
        // Nothing to do if u_ref meets the sampled rows.
        let doubtful = active(qp);
        let Some(unseen) = self.unmet_by_reference(u, doubtful, &mut at)? else {
            return Some(Solution { outcome: Outcome::Optimal, solver: Solver::Unchanged, iterations: 0 });
        };
        let watched = doubtful | at.violated();
        let against = at.most_violated();
        // Almost affine rows: a few corrections from u_ref.
        if let Some(solution) = self.correct::<N>(u, last, [watched, unseen], against, &mut at, qp) {
            return Some(Solution { iterations: first.iterations + solution.iterations, ..solution });
        }
        for (i, row) in at.rows.iter_mut().enumerate() {
            *row = self.first_row(i);
        }
        // Newton's method from both guesses.
        let Found { mut best, mut at_best, mut settled } =
            self.descend(u, [Some(&*pointwise), last], watched, &mut at, qp)?;
        // Is the answer settled? An input far from u_ref turns the plant by an angle: there the rows have other answers,
        // which contracting steps do not see.
        let known = self.u_ref.iter().chain(last.into_iter().flatten());
        let size = known.fold(1.0, |s: f64, v| s.max(v.abs()));
        settled &= best.distance <= FAR * size;
        settled = settled && !against.is_some_and(|i| self.is_nearer_sideways(u, (i, false), &mut at));
        // Search widely if the answer is in doubt.
        let widens =
            !self.is_brief && (self.widens || best.is_met(self.soft()) || first.outcome == Outcome::Optimal);
        if !settled
            && widens
            && let Some(found) = self.widen(u, &[Some(pointwise), last], &best, &mut at, qp)
        {
            (best, at_best) = (found, false);
        }
        if !(at_best && settled) {
            self.judge(u, &mut at)?;
            // The last answer of the QP has to be that of the rows at u: it says which are active.
            qp.solve(&self.problem(at.rows), pointwise);
        }
        let outcome = match best.outcome {
            Outcome::Optimal if best.violation <= 0.0 => Outcome::Optimal,
            // The linearised rows can be met, the rows themselves could not.
            Outcome::Optimal if first.outcome == Outcome::Infeasible => Outcome::Infeasible,
            Outcome::Optimal => Outcome::IllConditioned,
            // Rows that were relaxed in between have been met after all.
            Outcome::Infeasible | Outcome::IllConditioned if at.worst(self.soft()) <= 0.0 => Outcome::Optimal,
            other => other,
        };
        Some(Solution { outcome, solver: best.solver, iterations: first.iterations + best.iterations })
    }

    /// Whether u_ref within its bounds, written to `u`, fails the sampled rows; if so, the rows that are not linearised
    /// there. The `doubtful` ones are checked first, and alone if one of them is violated.
    fn unmet_by_reference(
        &self,
        u: &mut [f64],
        doubtful: RowSet,
        at: &mut Linearised,
    ) -> Option<Option<RowSet>> {
        for (i, ui) in u.iter_mut().enumerate() {
            *ui = self.bounds.clamp(i, self.u_ref[i]);
        }
        let others = RowSet::ALL - doubtful;
        if !doubtful.is_empty() {
            self.linearise(u, doubtful, at)?;
            if !(at.violated() & doubtful).is_empty() {
                return Some(Some(others));
            }
        }
        self.linearise(u, others, at)?;
        Some((at.worst(RowSet::EMPTY) > 0.0).then_some(RowSet::EMPTY))
    }

    /// The better of the answers that Newton's method finds from the `guesses`, written to `u`. The later guess is left out
    /// if the one before met every row by steps that contracted.
    fn descend(
        &self,
        u: &mut [f64],
        guesses: [Option<&[f64]>; 2],
        watched: RowSet,
        at: &mut Linearised,
        qp: &mut Workspace,
    ) -> Option<Found> {
        let (m, soft, last) = (u.len(), self.soft(), guesses[1]);
        let mut guess = [0.0; MAX_INPUTS];
        let mut best: Option<Candidate> = None;
        let (mut at_best, mut settled) = (false, false);
        for start in guesses.into_iter().flatten() {
            // The last input may come from a state that was made under other bounds.
            for i in 0..m {
                guess[i] = self.bounds.clamp(i, start[i]);
            }
            at_best = false;
            let Some(found) = self.newton(&mut guess[..m], watched, at, qp) else { continue };
            let same = best.as_ref().is_some_and(|b| b.is_met(soft) && found.is_met(soft))
                && (0..m).all(|i| (u[i] - guess[i]).abs() <= SAME * u[i].abs().max(1.0));
            settled |= same && found.ended;
            if !best.as_ref().is_none_or(|b| found.better_than(b)) {
                continue;
            }
            u.copy_from_slice(&guess[..m]);
            let near = last.is_none_or(|last| found.distance <= (1.0 + MET) * self.distance(last));
            let is_only = found.sure && near;
            settled |= found.sure;
            (best, at_best) = (Some(found), true);
            if is_only {
                break;
            }
        }
        Some(Found { best: best?, at_best, settled })
    }

    fn problem<'b>(&'b self, rows: &'b [Row]) -> Problem<'b> {
        let plain = Problem::new(rows, self.bounds, self.u_ref, self.correction_limit);
        Problem { enforcement: self.enforcement, ..plain }
    }

    fn patience(&self) -> [u32; 2] {
        if self.is_brief { BRIEF } else { PATIENT }
    }

    fn soft(&self) -> RowSet {
        RowSet::with(self.enforcement.len(), |i| matches!(self.enforcement[i], Enforcement::Soft { .. }))
    }

    #[cfg_attr(not(feature = "small"), inline(always))]
    fn distance(&self, u: &[f64]) -> f64 {
        norm(u.iter().zip(&self.u_ref[..u.len()]).map(|(v, r)| v - r))
    }

    /// Linearises the sampled rows of `again` at `u`, and evaluates the models of the others there. `None` if there is no
    /// finite prediction.
    fn linearise(&self, u: &[f64], again: RowSet, at: &mut Linearised) -> Option<()> {
        // As in `solve`.
        match u {
            [a, b] => self.linearise_for(&[*a, *b], again, at),
            _ => self.linearise_for(u, again, at),
        }
    }

    #[cfg_attr(not(feature = "small"), inline(always))]
    fn linearise_for(&self, u: &[f64], again: RowSet, at: &mut Linearised) -> Option<()> {
        let Linearised { rows, violations, evaluations, predicted, .. } = at;
        if predicted.input[..u.len()] != *u {
            predicted.rows = RowSet::EMPTY;
            predicted.input[..u.len()].copy_from_slice(u);
        }
        let rows = rows.iter_mut().zip(violations.iter_mut());
        for (i, (requirement, (row, violation))) in self.requirements.iter().zip(rows).enumerate() {
            *violation = 0.0;
            if requirement.bound.is_zero() {
                *row = Row::ZERO;
            } else if again.contains(i) {
                *violation = self.linearised(requirement, u, evaluations, row)?;
                predicted.rows.insert(i);
                let n = self.slots[requirement.barrier].degree();
                predicted.values[i][..n].copy_from_slice(&evaluations.ahead.value[..n]);
            } else {
                let (slack, terms) = (row.slack(u), row.size(u));
                if slack < -MET * terms {
                    *violation = -slack / terms;
                }
            }
        }
        Some(())
    }

    /// A requirement under the input `u`, as a row on h⁽ⁿ⁾. `None` if there is no prediction.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn weighted(&self, requirement: &Requirement, u: &[f64], room: &mut Evaluations) -> Option<Weighted> {
        let slot = &self.slots[requirement.barrier];
        let Evaluations { ahead, plants } = room;
        plants.ahead_of_row(slot, self.t, u, requirement.ahead, ahead)?;
        let (n, bound) = (slot.degree(), &requirement.bound);
        Some(bound.weighted(&ahead.value[..n], &ahead.gradient, u.len(), requirement.divisor))
    }

    /// [`Self::weighted`] without the gradient.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn reached(&self, requirement: &Requirement, u: &[f64], room: &mut Evaluations) -> Option<Weighted> {
        let slot = &self.slots[requirement.barrier];
        let source = slot.source.predict()?;
        let ahead = &mut room.ahead;
        source.values_of_row(self.t, &slot.now.from, u, requirement.ahead, &mut ahead.value);
        let (n, bound) = (slot.degree(), &requirement.bound);
        Some(bound.weighted(&ahead.value[..n], &ahead.gradient, 0, requirement.divisor))
    }

    /// Writes the row of a requirement linearised at `u`. Returns its violation there in units of its terms.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn linearised(
        &self,
        requirement: &Requirement,
        u: &[f64],
        room: &mut Evaluations,
        row: &mut Row,
    ) -> Option<f64> {
        let Weighted { mut value, mut terms, mut normal } = self.weighted(requirement, u, room)?;
        if !self.errors.is_exact() {
            let slot = &self.slots[requirement.barrier];
            let held = (self.t, &slot.now.from[..], u, requirement.ahead);
            let bound = (&requirement.bound, requirement.divisor);
            let Uncertainty { size, gradient } =
                self.errors.of_row(&*slot.source, held, bound, &slot.now.slopes)?;
            value -= size;
            terms += size;
            for (a, d) in normal.iter_mut().zip(&gradient) {
                *a -= d;
            }
        }
        let (mut at_u, mut moved) = (0.0, 0.0);
        for (a, v) in normal.iter().zip(u) {
            at_u += a * v;
            moved += (a * v).abs();
        }
        *row = Row { normal, floor: at_u - value };
        // Near a floor of 0 the value is a small difference of what the input moves.
        let terms = terms + moved;
        let violation = if value < -MET * terms { -value / terms } else { 0.0 };
        // If the prediction is not finite, neither is this: a weight of 0 times it is NaN.
        let finite = row.floor.is_finite() & all_finite(&row.normal[..u.len()]);
        finite.then_some(violation)
    }

    /// The slack at `u` of the row of a requirement. `None` if there is no prediction.
    fn slack(&self, requirement: &Requirement, u: &[f64], room: &mut Evaluations) -> Option<f64> {
        if !self.errors.is_exact() {
            let mut row = Row::ZERO;
            return self.linearised(requirement, u, room, &mut row).map(|_| row.slack(u));
        }
        self.reached(requirement, u, room).map(|reached| reached.value)
    }

    /// Linearises all rows at `u`, with violations that are round-off counted as met.
    fn judge(&self, u: &[f64], at: &mut Linearised) -> Option<()> {
        self.linearise(u, RowSet::ALL, at)?;
        for i in 0..at.rows.len() {
            if at.violations[i] > 0.0 && at.violations[i].is_finite() {
                let (requirement, row) = (&self.requirements[i], &at.rows[i]);
                if -row.slack(u) <= ROUND_OFF * self.size(requirement, u) {
                    at.violations[i] = 0.0;
                }
            }
        }
        Some(())
    }

    /// The size of the terms that add up to the row of a requirement.
    ///
    /// A sum that cancels shows nothing of its terms: 10 − p on the boundary. So every state and the time are changed by a
    /// small part of themselves, after which the terms no longer cancel. Each part is different, of either sign, so that
    /// sums of states do not cancel again.
    fn size(&self, requirement: &Requirement, u: &[f64]) -> f64 {
        const STATES: usize = 64;
        const PART: f64 = 1e-6;
        let slot = &self.slots[requirement.barrier];
        let x = &slot.now.from;
        let states = x.len();
        let Some(source) = slot.source.predict().filter(|_| states <= STATES) else { return 0.0 };
        let mut moved = [0.0; STATES];
        for (i, (moved, x)) in moved.iter_mut().zip(x).enumerate() {
            let part = if i % 2 == 0 { PART } else { -PART };
            *moved = x * (1.0 + part * (1.0 + i as f64 / states as f64));
        }
        let mut values = [[0.0; MAX_RELATIVE_DEGREE + 1]; 2];
        let [here, there] = &mut values;
        let (later, duration) = (self.t * (1.0 + 0.7 * PART), requirement.ahead);
        source.values_of_row(self.t, x, u, duration, here);
        source.values_of_row(later, &moved[..states], u, duration, there);
        let (n, weights) = (slot.degree(), &requirement.bound.weights);
        let change = |k: usize| (weights[k] * (there[k] - here[k])).abs() / PART;
        let size = (0..n).map(change).sum::<f64>() / requirement.divisor;
        if size.is_finite() { size } else { 0.0 }
    }

    /// Whether row `i`, seen from half the way sideways, allows an answer that is nearer to u_ref than `u`. If the rows are
    /// almost affine, or differ little from a quadratic that is curved inwards, the others have to allow it too; otherwise
    /// the plant may turn so far that they do elsewhere.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn is_nearer_sideways(&self, u: &[f64], (i, is_regular): (usize, bool), at: &mut Linearised) -> bool {
        self.look_sideways(u, (i, is_regular), at, |_, _| {})
    }

    /// [`Self::is_nearer_sideways`]. For each direction sideways, calls `seen` with how far it went without a nearer answer,
    /// and with the sum of the row's slacks there and on the opposite side.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn look_sideways(
        &self,
        u: &[f64],
        (i, is_regular): (usize, bool),
        at: &mut Linearised,
        mut seen: impl FnMut(&[f64], f64),
    ) -> bool {
        let (m, far, u_ref) = (u.len(), self.distance(u), &self.u_ref[..u.len()]);
        let normal = norm(at.rows[i].normal[..m].iter().copied());
        // The axis that is most along u − u_ref adds no direction sideways to those of the others.
        let way = |i: usize| (u[i] - u_ref[i]).abs();
        let main = (0..m).fold(0, |main, i| if way(i) > way(main) { i } else { main });
        let mut direction = [0.0; MAX_INPUTS];
        let mut sideways = [0.0; MAX_INPUTS];
        for axis in (0..m).filter(|axis| *axis != main) {
            // The axis without its part along u − u_ref.
            let along = (u[axis] - u_ref[axis]) / far;
            for (j, d) in direction[..m].iter_mut().enumerate() {
                *d = -along * (u[j] - u_ref[j]) / far;
            }
            direction[axis] += 1.0;
            let length = SIDEWAYS * far / norm(direction[..m].iter().copied());
            let mut slacks = 0.0;
            for way in [length, -length] {
                for j in 0..m {
                    sideways[j] = self.bounds.clamp(j, u[j] + way * direction[j]);
                }
                let sideways = &sideways[..m];
                let nearer = (self.distance(sideways) - far) * normal;
                // NaN if it is not known, as on a way that a bound cuts short.
                let slack = self.slack(&self.requirements[i], sideways, at.evaluations);
                if slack.is_some_and(|s| s > nearer)
                    && (!is_regular || self.others_leave_room(sideways, i, far, at))
                {
                    return true;
                }
                let is_cut = (0..m).any(|j| sideways[j] != u[j] + way * direction[j]);
                slacks += slack.filter(|_| !is_cut).unwrap_or(f64::NAN);
            }
            for d in &mut direction[..m] {
                *d *= length;
            }
            seen(&direction[..m], slacks);
        }
        false
    }

    /// Whether every hard row but `i` holds from `sideways` to the point that is only `far` from u_ref, as if no other row
    /// were active.
    fn others_leave_room(&self, sideways: &[f64], i: usize, far: f64, at: &mut Linearised) -> bool {
        let (way, soft) = (self.distance(sideways) - far, self.soft());
        let has_row = |j: &usize| *j != i && !soft.contains(*j) && !self.requirements[*j].bound.is_zero();
        (0..self.requirements.len()).filter(has_row).all(|j| {
            let normal = norm(at.rows[j].normal[..sideways.len()].iter().copied());
            self.slack(&self.requirements[j], sideways, at.evaluations).is_some_and(|s| s > way * normal)
        })
    }

    /// Newton's method from `u`, on the rows that the linearised QP does not give up. Rows of `watched`, and all that become
    /// active or violated, are linearised along the way, all of them at the end.
    fn newton(
        &self,
        u: &mut [f64],
        mut watched: RowSet,
        at: &mut Linearised,
        qp: &mut Workspace,
    ) -> Option<Candidate> {
        let m = u.len();
        self.linearise(u, watched, at)?;
        let soft = self.soft();
        let mut found = Candidate {
            relaxed: RowSet::EMPTY,
            violation: at.worst(soft),
            distance: 0.0,
            outcome: Outcome::Optimal,
            solver: Solver::Unchanged,
            iterations: 0,
            ended: false,
            sure: true,
        };
        let mut target = [0.0; MAX_INPUTS];
        let (target, mut last_way) = (&mut target[..m], f64::INFINITY);
        let mut ended = false;
        let [iterations, _] = self.patience();
        for _ in 0..iterations {
            // The answer of the QP linearised here.
            let solution = qp.solve(&self.problem(at.rows), target);
            found.relaxed = soft | qp.relaxed() | qp.ill_conditioned();
            (found.outcome, found.solver) = (solution.outcome, solution.solver);
            found.iterations += solution.iterations;
            found.violation = at.worst(found.relaxed);
            let size = u.iter().chain(&*target).fold(1.0, |s: f64, v| s.max(v.abs()));
            let way = u.iter().zip(&*target).fold(0.0, |d: f64, (a, b)| d.max((a - b).abs()));
            // It ends when that answer no longer moves the input, and every row has been linearised.
            if found.violation <= 0.0 && way <= MET * size {
                if watched != RowSet::ALL {
                    self.linearise(u, RowSet::ALL, at)?;
                    watched = RowSet::ALL;
                    found.violation = at.worst(found.relaxed);
                }
                ended = found.violation <= 0.0;
                if ended {
                    break;
                }
                continue;
            }
            // Go towards it, as far as the violation decreases.
            found.sure &= way <= CONTRACTION * last_way;
            last_way = way;
            watched |= active(qp) | at.violated();
            if !self.line_search(u, target, watched, at, &mut found) {
                break;
            }
        }
        // Not ended: judge where it stopped.
        if !ended {
            self.judge(u, at)?;
            found.violation = at.worst(found.relaxed);
        }
        found.ended = ended;
        found.sure &= ended && found.relaxed == soft;
        found.distance = self.distance(u);
        Some(found)
    }

    /// Moves `u` towards `target` by a part of the way that lets the violation decrease sufficiently. If there is none,
    /// leaves it unchanged and returns false.
    fn line_search(
        &self,
        u: &mut [f64],
        target: &[f64],
        watched: RowSet,
        at: &mut Linearised,
        found: &mut Candidate,
    ) -> bool {
        let m = u.len();
        let from: [f64; MAX_INPUTS] = core::array::from_fn(|i| if i < m { u[i] } else { 0.0 });
        let (violation, mut part) = (found.violation, 1.0);
        let [_, halvings] = self.patience();
        for _ in 0..=halvings {
            for i in 0..m {
                // Round-off may leave the bounds, between two points within them.
                u[i] = self.bounds.clamp(i, from[i] + part * (target[i] - from[i]));
            }
            if self.linearise(u, watched, at).is_some() {
                let there = at.worst(found.relaxed);
                if there <= 0.0 || there <= (1.0 - SUFFICIENT * part) * violation {
                    found.violation = there;
                    return true;
                }
            }
            part /= 2.0;
            found.sure = false;
        }
        u.copy_from_slice(&from[..m]);
        false
    }
}

/// The result of Newton's method from all guesses.
struct Found {
    best: Candidate,
    /// Whether the rows are linearised at `best`.
    at_best: bool,
    /// Whether it is certainly right: reached by steps that contracted, or the same from both guesses.
    settled: bool,
}

/// An input at which the search arrived.
struct Candidate {
    /// The rows that `violation` does not count.
    relaxed: RowSet,
    violation: f64,
    distance: f64,
    outcome: Outcome,
    solver: Solver,
    iterations: u32,
    /// Whether the QP linearised at it no longer moves it.
    ended: bool,
    /// Whether it met every row by steps that contracted: there is no other answer nearby.
    sure: bool,
}

impl Candidate {
    /// Whether it meets all rows but the `soft` ones.
    fn is_met(&self, soft: RowSet) -> bool {
        self.relaxed == soft && self.violation <= 0.0
    }

    fn better_than(&self, other: &Self) -> bool {
        let key = |g: &Self| (g.relaxed.len(), g.violation);
        key(self) < key(other) || key(self) == key(other) && self.distance < (1.0 - MET) * other.distance
    }
}
