//! A few corrections from u_ref, for rows that are almost affine between u_ref and the answer: the usual step.
//!
//! With G(u) the answer of the QP whose rows are linearised at u, the answer is where G(u) = u. The corrections u_{k+1} =
//! G(u_k) begin at u_ref, where the rows have been linearised to see whether they hold. Let ρ be the largest ratio of a step
//! G(u_k) − u_k to the one before. It is the part by which the rows' normals turn on the way from u_ref. From the second
//! correction on, the secant through the last two is used (Anderson's method of depth one), so that a ρ of a tenth costs a
//! correction or two. The last G(u_k) is the answer once ρ times its step is a tenth of what counts as met: the next
//! correction would not be longer.
//!
//! Only rows that are active or violated are linearised along the way, the others at the end. The answer is accepted if
//! every row holds, no other answer is in sight sideways, and one of three conditions holds: the last input leads to it too,
//! or is no nearer to u_ref, or is too near for the rows to curve on the way there. Otherwise the search starts over from
//! its two guesses.

use super::{CONTRACTION, FAR, Linearised, MET, PeriodProblem, SAME, active};
use crate::MAX_INPUTS;
use crate::qp::{Outcome, RowSet, Solution, Workspace};

/// Largest number of corrections of an answer whose rows are almost affine.
pub(super) const CORRECTIONS: usize = 12;
/// Length of a correction that is left out, as a part of what counts as met.
pub(super) const SKIPPED: f64 = 0.1;
/// Largest ratio of each correction to the one before.
pub(super) const CONVERGING: f64 = 0.5;

/// Answer and step of a correction, and the length of the step.
type Correction<const N: usize> = ([f64; N], [f64; N], f64);

/// The part of the way back, from a correction's answer to that of the one before, at which the remaining `way` would be
/// least.
#[cfg_attr(not(feature = "small"), inline(always))]
fn secant(way: &[f64], before: &[f64]) -> f64 {
    let (mut product, mut square) = (0.0, 0.0);
    for (way, before) in way.iter().zip(before) {
        let change = way - before;
        product += way * change;
        square += change * change;
    }
    if square > 0.0 { product / square } else { 0.0 }
}

impl PeriodProblem<'_> {
    /// The answer, written to `u`, if all hard rows can be met and are almost affine between u_ref and there. It is the
    /// limit of the QP's answers from u_ref on, each for the rows linearised at the one before. At u_ref the rows are
    /// linearised, except `unseen` ones. `watched` are linearised all along, the others at the end. `None` if the answers do
    /// not converge fast, or others may exist.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn correct<const N: usize>(
        &self,
        u: &mut [f64],
        last: Option<&[f64]>,
        [mut watched, unseen]: [RowSet; 2],
        against: Option<usize>,
        at: &mut Linearised,
        qp: &mut Workspace,
    ) -> Option<Solution> {
        let m = u.len();
        if !self.soft().is_empty() {
            return None;
        }
        let mut target = [0.0; N];
        let mut before: Option<Correction<N>> = None;
        let (mut ratio, mut iterations) = (0.0_f64, 0);
        if !(watched & unseen).is_empty() {
            self.linearise(u, watched & unseen, at)?;
        }
        for _ in 0..CORRECTIONS {
            let solution = qp.solve(&self.problem(at.rows), &mut target[..m]);
            iterations += solution.iterations;
            if solution.outcome != Outcome::Optimal {
                return None;
            }
            let mut way = [0.0; N];
            let (mut size, mut length) = (1.0, 0.0);
            for i in 0..m {
                way[i] = target[i] - u[i];
                size = f64::max(size, u[i].abs().max(target[i].abs()));
                length = f64::max(length, way[i].abs());
            }
            let added = active(qp) - watched;
            let grown = !added.is_empty();
            if let Some((.., shorter)) = before {
                if length > CONVERGING * shorter && !grown {
                    return None;
                }
                ratio = ratio.max(length / shorter);
            }
            // The next correction would be shorter in the same ratio at least.
            let ends = before.is_some() && ratio * length <= SKIPPED * MET * size && !grown;
            u.copy_from_slice(&target[..m]);
            if let Some((answer, way_before, _)) = before.filter(|_| !ends) {
                let part = secant(&way[..m], &way_before);
                for i in 0..m {
                    u[i] = self.bounds.clamp(i, target[i] - part * (target[i] - answer[i]));
                }
            }
            before = (!grown).then_some((target, way, length));
            watched |= added;
            if !ends {
                self.linearise(u, watched, at)?;
                let violated = at.violated() - watched;
                if !violated.is_empty() {
                    self.linearise(u, violated, at)?;
                    (watched, before) = (watched | violated, None);
                }
                continue;
            }
            // The others at the end.
            self.linearise(u, RowSet::ALL - watched, at)?;
            if at.worst(RowSet::EMPTY) > 0.0 {
                let violated = at.violated();
                if (violated - watched).is_empty() {
                    return None;
                }
                (watched, before) = (watched | violated, None);
                continue;
            }
            let distance = self.distance(u);
            let known = self.u_ref.iter().chain(last.into_iter().flatten());
            let limit = known.fold(1.0, |s: f64, v| s.max(v.abs()));
            let is_sole = match last {
                Some(last) => self.is_sole(u, last, ratio, watched, at, qp),
                None => ratio <= CONTRACTION,
            };
            let settled = distance <= FAR * limit
                && is_sole
                && !against.is_some_and(|i| self.is_nearer_sideways(u, (i, ratio <= CONTRACTION), at));
            return settled.then_some(Solution { iterations, ..solution });
        }
        None
    }

    /// Whether the rows, whose normals turn by the part `ratio` of themselves on the `distance` of `u` from u_ref, are
    /// almost affine there and on the way to `last`, or `last` is no nearer to u_ref.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn is_near(&self, last: &[f64], u: &[f64], distance: f64, ratio: f64) -> bool {
        let near = || distance <= (1.0 + MET) * self.distance(last);
        ratio <= CONTRACTION && (self.is_close(last, u, distance, ratio) || near())
    }

    /// Whether the rows are almost affine on the way from `last` to `u`, as for [`Self::is_near`].
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn is_close(&self, last: &[f64], u: &[f64], distance: f64, ratio: f64) -> bool {
        let away = u.iter().zip(last).fold(0.0, |d: f64, (a, b)| d.max((a - b).abs()));
        ratio * away <= CONTRACTION * distance
    }

    /// Whether there is no other answer near `u`, which corrections approached in `ratio`, or nearer to u_ref towards
    /// `last`.
    fn is_sole(
        &self,
        u: &[f64],
        last: &[f64],
        ratio: f64,
        watched: RowSet,
        at: &mut Linearised,
        qp: &mut Workspace,
    ) -> bool {
        if self.is_near(last, u, self.distance(u), ratio) {
            return true;
        }
        let away = u.iter().zip(last).fold(0.0, |d: f64, (a, b)| d.max((a - b).abs()));
        // A correction from there has to lead here.
        let mut target = [0.0; MAX_INPUTS];
        let target = &mut target[..u.len()];
        if self.linearise(last, watched, at).is_none() {
            return false;
        }
        let solution = qp.solve(&self.problem(at.rows), target);
        let size = u.iter().fold(1.0, |s: f64, v| s.max(v.abs()));
        let left = u.iter().zip(&*target).fold(0.0, |d: f64, (a, b)| d.max((a - b).abs()));
        let leads_here = solution.outcome == Outcome::Optimal && left <= CONVERGING * away + SAME * size;
        // The rows, and the last answer of the QP, have to be those at `u`.
        let seen = leads_here && self.linearise(u, watched, at).is_some();
        seen && qp.solve(&self.problem(at.rows), target).outcome == Outcome::Optimal
    }
}
