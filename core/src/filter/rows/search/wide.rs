//! The wide search, for samples at which Newton's method finds no settled answer from its two guesses.
//!
//! A row is F(u) ≥ 0 with F smooth. It is hard if F turns with some inputs: a unicycle that stands across the line of sight
//! gains by turning either way and then driving either way. Four parts find the nearest of these answers.
//!
//! **Scan.** Move one component of u over a grid around u_ref. For each of its values find another component for which all
//! rows hold, by Newton's method along that axis. An acceleration enters almost affinely, so one or two steps are exact. The
//! grid is first fine, then coarse, and at most as wide as the bounds: widths grow by a factor until they exceed the
//! distance of an input that is known to meet the rows. Keep the local minima over the grid: of the distance where the rows
//! hold, of the violation elsewhere.
//!
//! **Restoration.** Go from there to the rows by the shortest way: the linearised QP with u in place of u_ref. Go back to a
//! third of the way as long as the violation does not decrease.
//!
//! **Polishing.** Go from an input that meets the rows towards the answer of the linearised QP. Restore each trial
//! (second-order correction), and accept it if it is nearer to u_ref by a part of what the QP promises. So every iterate
//! meets the rows, and the distance only decreases.
//!
//! **Sharpening.** The distance is flat at its minimum, so polishing ends at about the root of the tolerance. If Newton's
//! method does not converge from there, take secant steps along the row.
//!
//! All numbers of steps are fixed: the cost is bounded, and the same input gives the same bits.

use super::{Candidate, Linearised, MET, PeriodProblem};
use crate::MAX_INPUTS;
use crate::qp::{Outcome, Problem, RowSet, Solver, Workspace};

/// Number of parts of the grid of one scan.
const GRID: usize = 16;
/// Half the width of the finest grid, in units of u.
const FINEST: f64 = 1.0;
/// Width of each grid, in units of that of the one before.
const WIDER: f64 = 8.0;
/// Largest number of grids of one component.
const WIDTHS: usize = 6;
/// Number of steps of Newton's method along one axis.
const ALONG: usize = 3;
/// Number of starting points that are kept.
const STARTS: usize = 6;
/// Numbers of steps of a restoration, and of one within a trial of the polishing.
const RESTORING: [usize; 2] = [10, 4];
/// Number of steps of a polishing.
const POLISHING: usize = 12;
/// Number of steps of a sharpening.
const SHARPENING: usize = 16;
/// The part of the way of the first step of a sharpening.
const FIRST_PART: f64 = 0.3;
/// The largest part of any of its steps.
const LARGEST_PART: f64 = 10.0;
/// Number of trials of one step.
const TRIALS: usize = 4;
/// The part of what the linearised QP promises that must come true.
const SUFFICIENT: f64 = 0.1;
/// Starts are considered up to this distance, in units of that of the known answer.
const NEAR: f64 = 1.2;
/// An answer replaces another one if it is nearer by this part.
const NEARER: f64 = 2e-3;

type Input = [f64; MAX_INPUTS];

/// An input, its violation of the rows and its distance from u_ref.
#[derive(Clone, Copy)]
struct Start {
    u: Input,
    violation: f64,
    distance: f64,
}

impl Start {
    const NONE: Self = Self { u: [0.0; MAX_INPUTS], violation: f64::INFINITY, distance: f64::INFINITY };

    fn better_than(&self, other: &Self) -> bool {
        (self.violation, self.distance) < (other.violation, other.distance)
    }
}

/// The best starting points, in order, the best first.
struct Starts {
    kept: [Start; STARTS],
    /// Points further from u_ref are not useful.
    limit: f64,
}

impl Starts {
    fn within(limit: f64) -> Self {
        Self { kept: [Start::NONE; STARTS], limit }
    }

    fn insert(&mut self, start: Start) {
        let found = self.kept.iter().position(|other| start.better_than(other));
        let Some(at) = found.filter(|_| start.distance <= self.limit) else { return };
        self.kept[at..].rotate_right(1);
        self.kept[at] = start;
    }

    /// The distance of the nearest one that meets the rows.
    fn nearest(&self) -> f64 {
        if self.kept[0].violation <= 0.0 { self.kept[0].distance } else { f64::INFINITY }
    }
}

impl PeriodProblem<'_> {
    /// Looks for a better answer than `best`, which is `u`, that meets all rows but those of `relaxed`. If one is found, it
    /// is written to `u`.
    pub(super) fn widen(
        &self,
        u: &mut [f64],
        guesses: &[Option<&[f64]>],
        best: &Candidate,
        at: &mut Linearised,
        qp: &mut Workspace,
    ) -> Option<Candidate> {
        let m = u.len();
        let relaxed = self.soft();
        let mut nearest = Start::NONE;
        if best.is_met(relaxed) {
            nearest.distance = best.distance;
        }
        let known = nearest.distance.is_finite();
        // Start from the inputs available: the answer, u_ref, zero and both guesses.
        let mut starts = Starts::within(f64::INFINITY);
        let zero = [0.0; MAX_INPUTS];
        for guess in [Some(&*u), Some(self.u_ref), Some(&zero[..m])].iter().chain(guesses).flatten() {
            let mut start = Start::NONE;
            for i in 0..m {
                start.u[i] = self.bounds.clamp(i, guess[i]);
            }
            self.measure(&mut start, m, relaxed, at);
            starts.insert(start);
        }
        let iterations = best.iterations;
        let mut found = false;
        if !known {
            found |= self.finish(&mut starts, &mut nearest, relaxed, at, qp);
        }
        // Scan, and once more from the first answer. Inputs near u_ref that almost meet the rows come after all that do.
        for _ in 0..2 {
            let limit = nearest.distance;
            let mut starts = Starts::within(NEAR * limit);
            self.scan_all(limit, relaxed, at, &mut starts);
            found |= self.finish(&mut starts, &mut nearest, relaxed, at, qp);
            if limit.is_finite() || nearest.distance.is_infinite() {
                break;
            }
        }
        if !found && (!known || best.ended) {
            return None;
        }
        if !found {
            // The known answer is the nearest, but Newton's method did not end at it.
            nearest.u[..m].copy_from_slice(u);
            nearest.distance = best.distance;
        }
        // Make it exact: by Newton's method, or if that fails by sharpening.
        let mut exact = nearest.u;
        if let Some(found) = self.newton(&mut exact[..m], RowSet::ALL, at, qp)
            && found.is_met(relaxed)
            && found.ended
            && found.distance <= (1.0 + NEARER) * nearest.distance
        {
            u.copy_from_slice(&exact[..m]);
            return Some(Candidate { iterations: iterations + found.iterations, ..found });
        }
        self.sharpen(&mut nearest, relaxed, at, qp);
        u.copy_from_slice(&nearest.u[..m]);
        Some(Candidate {
            relaxed,
            violation: 0.0,
            distance: nearest.distance,
            outcome: Outcome::Optimal,
            solver: Solver::DualActiveSet,
            iterations,
            ended: false,
            sure: false,
        })
    }

    /// Restores and polishes the starts, and keeps an answer that is nearer than `nearest`. Returns whether there is one.
    fn finish(
        &self,
        starts: &mut Starts,
        nearest: &mut Start,
        relaxed: RowSet,
        at: &mut Linearised,
        qp: &mut Workspace,
    ) -> bool {
        let mut found = false;
        for start in &mut starts.kept {
            // A nearer answer than the known one begins near it.
            let near = |start: &Start| start.distance < NEAR * nearest.distance;
            if !start.distance.is_finite() || !near(start) {
                continue;
            }
            self.restore(start, RESTORING[0], relaxed, at, qp);
            if start.violation <= 0.0 && near(start) {
                let wanted = (1.0 - NEARER) * nearest.distance;
                self.polish(start, wanted, relaxed, at, qp);
                if start.distance < wanted || nearest.distance.is_infinite() {
                    (*nearest, found) = (*start, true);
                }
            }
        }
        found
    }

    /// Linearises all rows at the start, and writes its violation and distance.
    fn measure(&self, start: &mut Start, m: usize, relaxed: RowSet, at: &mut Linearised) {
        start.violation = match self.judge(&start.u[..m], at) {
            Some(()) => at.worst(relaxed),
            None => f64::INFINITY,
        };
        start.distance = self.distance(&start.u[..m]);
        if start.distance > self.correction_limit {
            start.violation = f64::INFINITY;
        }
    }

    /// Scans every component, with wider and wider grids.
    fn scan_all(&self, limit: f64, relaxed: RowSet, at: &mut Linearised, starts: &mut Starts) {
        let m = self.u_ref.len();
        for vary in 0..m {
            let centre = self.bounds.clamp(vary, self.u_ref[vary]);
            let mut width = if limit.is_finite() { limit / WIDER } else { FINEST };
            for _ in 0..WIDTHS {
                let low = (centre - width).max(self.bounds.min[vary]);
                let high = (centre + width).min(self.bounds.max[vary]);
                self.scan((vary, (vary + 1) % m), [low, high], relaxed, at, starts);
                let whole = low <= self.bounds.min[vary] && high >= self.bounds.max[vary];
                if whole || width >= limit.min(starts.nearest()) {
                    break;
                }
                width *= WIDER;
            }
        }
    }

    /// Moves the component `vary` from `low` to `high`, finds the component `solve` for each value, and keeps the local
    /// minima.
    fn scan(
        &self,
        (vary, solve): (usize, usize),
        [low, high]: [f64; 2],
        relaxed: RowSet,
        at: &mut Linearised,
        starts: &mut Starts,
    ) {
        let m = self.u_ref.len();
        let mut before = [Start::NONE; 2];
        for k in 0..=GRID {
            let mut next = Start::NONE;
            for i in 0..m {
                next.u[i] = self.bounds.clamp(i, self.u_ref[i]);
            }
            next.u[vary] = self.bounds.clamp(vary, low + (high - low) * (k as f64 / GRID as f64));
            self.along(&mut next, solve, relaxed, at, vary != solve);
            if before[1].better_than(&before[0]) && !next.better_than(&before[1]) {
                starts.insert(before[1]);
            }
            before = [before[1], next];
        }
        if before[1].better_than(&before[0]) {
            starts.insert(before[1]);
        }
    }

    /// Moves the component `axis` to where the rows hold, as near to its reference as they allow.
    fn along(&self, start: &mut Start, axis: usize, relaxed: RowSet, at: &mut Linearised, solve: bool) {
        let m = self.u_ref.len();
        let mut best = Start::NONE;
        for _ in 0..=ALONG {
            self.measure(start, m, relaxed, at);
            if start.better_than(&best) {
                best = *start;
            }
            let target = self.on_axis(start, axis, relaxed, at);
            let moved = (target - start.u[axis]).abs();
            if !solve || best.violation <= 0.0 || moved.is_nan() || moved <= MET * target.abs() {
                break;
            }
            start.u[axis] = target;
        }
        *start = best;
    }

    /// The value of the component `axis` nearest to its reference for which the linearised rows hold; the middle of their
    /// floors if they contradict each other.
    fn on_axis(&self, start: &Start, axis: usize, relaxed: RowSet, at: &Linearised) -> f64 {
        let m = self.u_ref.len();
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for (i, row) in at.rows.iter().enumerate() {
            let slope = row.normal[axis];
            if relaxed.contains(i) || slope == 0.0 {
                continue;
            }
            let on_row = start.u[axis] - row.slack(&start.u[..m]) / slope;
            if slope > 0.0 {
                low = low.max(on_row);
            } else {
                high = high.min(on_row);
            }
        }
        let wanted = if low <= high { self.u_ref[axis].max(low).min(high) } else { low + (high - low) / 2.0 };
        self.bounds.clamp(axis, wanted)
    }

    /// Moves towards the rows by at most `steps` steps. The rows are linearised at the start, before and after.
    fn restore(
        &self,
        start: &mut Start,
        steps: usize,
        relaxed: RowSet,
        at: &mut Linearised,
        qp: &mut Workspace,
    ) {
        let m = self.u_ref.len();
        self.measure(start, m, relaxed, at);
        for _ in 0..steps {
            if start.violation <= 0.0 || !start.violation.is_finite() {
                return;
            }
            let mut target = [0.0; MAX_INPUTS];
            let nearest = Problem { u_ref: &start.u[..m], ..self.problem(at.rows) };
            qp.solve(&nearest, &mut target[..m]);
            let way = (0..m).fold(0.0, |w: f64, i| w.max((target[i] - start.u[i]).abs()));
            if way <= MET * start.u.iter().fold(1.0, |s: f64, v| s.max(v.abs())) {
                return;
            }
            let (mut part, mut moved) = (1.0, false);
            for _ in 0..TRIALS {
                let mut trial = self.between(start, &target, part);
                self.measure(&mut trial, m, relaxed, at);
                if trial.violation <= (1.0 - SUFFICIENT * part) * start.violation {
                    (*start, moved) = (trial, true);
                    break;
                }
                part /= 3.0;
            }
            if !moved {
                self.measure(start, m, relaxed, at);
                return;
            }
        }
    }

    /// Moves from a start that meets the rows to the nearest answer that can be reached downhill, as long as that can be
    /// nearer than `known`.
    fn polish(
        &self,
        start: &mut Start,
        known: f64,
        relaxed: RowSet,
        at: &mut Linearised,
        qp: &mut Workspace,
    ) {
        let m = self.u_ref.len();
        for step in 0..POLISHING {
            self.measure(start, m, relaxed, at);
            let mut target = [0.0; MAX_INPUTS];
            qp.solve(&self.problem(at.rows), &mut target[..m]);
            let there = self.distance(&target[..m]);
            let promised = start.distance - there;
            let hopeless = step > 0 && there >= known && start.distance >= known;
            if hopeless || promised <= MET * start.distance {
                return;
            }
            let (mut part, mut moved) = (1.0, false);
            for _ in 0..TRIALS {
                let mut trial = self.between(start, &target, part);
                self.restore(&mut trial, RESTORING[1], relaxed, at, qp);
                if trial.violation <= 0.0 && trial.distance <= start.distance - SUFFICIENT * part * promised {
                    (*start, moved) = (trial, true);
                    break;
                }
                part /= 3.0;
            }
            if !moved {
                return;
            }
        }
    }

    /// Moves from a polished answer, known to about the root of the tolerance, to where the QP linearised there no longer
    /// moves it.
    ///
    /// If the rows curve, full steps towards the QP's answer overshoot. With the last step Δu and the change ΔR of the
    /// remaining way, the step −‖Δu‖²/(Δu·ΔR) of Barzilai and Borwein is the secant method along the row.
    fn sharpen(&self, start: &mut Start, relaxed: RowSet, at: &mut Linearised, qp: &mut Workspace) {
        let m = self.u_ref.len();
        let (mut point, mut least) = (*start, f64::INFINITY);
        let mut before: Option<(Input, Input)> = None;
        for _ in 0..SHARPENING {
            self.measure(&mut point, m, relaxed, at);
            if point.violation > 0.0 {
                return;
            }
            let mut target = [0.0; MAX_INPUTS];
            qp.solve(&self.problem(at.rows), &mut target[..m]);
            let left: Input = core::array::from_fn(|i| target[i] - point.u[i]);
            let way = left.iter().fold(0.0, |w: f64, d| w.max(d.abs()));
            if way < least && point.distance <= (1.0 + NEARER) * start.distance {
                (*start, least) = (point, way);
            }
            if way <= MET * point.u.iter().fold(1.0, |s: f64, v| s.max(v.abs())) {
                return;
            }
            let mut part = FIRST_PART;
            if let Some((u, rest)) = before {
                let (mut moved, mut changed) = (0.0, 0.0);
                for i in 0..m {
                    let d = point.u[i] - u[i];
                    moved += d * d;
                    changed += d * (left[i] - rest[i]);
                }
                if changed < 0.0 && moved > 0.0 {
                    part = (-moved / changed).min(LARGEST_PART);
                }
            }
            before = Some((point.u, left));
            point = self.between(&point, &target, part);
            self.restore(&mut point, RESTORING[1], relaxed, at, qp);
        }
    }

    /// The `part` of the way from the start to the target.
    fn between(&self, start: &Start, target: &Input, part: f64) -> Start {
        let mut u = start.u;
        for i in 0..self.u_ref.len() {
            u[i] = self.bounds.clamp(i, u[i] + part * (target[i] - u[i]));
        }
        Start { u, ..Start::NONE }
    }
}
