//! Several rows: a dual active-set method of the Goldfarb-Idnani family.
//!
//! In the variables δ = √W (u − u_ref) the QP is `min ½‖δ‖²` under rows aᵀδ ≥ c. The active rows, with normals N = Q
//! R (module `factors`) and multipliers λ ≥ 0, give δ = Nλ. Each round takes the row p that is violated most by its
//! distance, and raises its multiplier by t:
//!
//! ```text
//! a_p = N r + z, Nᵀz = 0:   δ ← δ + t z,   λ ← λ − t r,   λ_p ← λ_p + t
//! ```
//!
//! until p holds (t = −slack/‖z‖²: p joins the active rows) or some λ_j reaches 0 before (j leaves, and
//! the round goes on). At the start, u_ref within its bounds, the bounds that u_ref exceeds are active. Each
//! join raises the dual objective, so no active set comes twice and the method ends; ties go to the row
//! listed first. Round-off can break that argument, so rounds are counted. Beyond the limit the outcome is
//! [`Outcome::Failed`]. After a row has left, δ is recomputed from the active rows.
//!
//! **Soft rows** have λ_j ≤ κ, the penalty per weighted length of their normal: the dual of the exact
//! penalty κ max(0, −slack). A multiplier at κ is constant; its row moves from the active ones into the
//! reference, and comes back when it holds with room to spare.
//!
//! **Infeasibility.** Where z = 0 and no λ_j falls, a_p = Σ r_j a_j with r_j ≤ 0: the active rows with
//! r_j < 0 cap a_pᵀδ at its present value (Farkas). The rows are then taken again one by one, in the order
//! of priority, and the multiplier of each is raised with all rows before it kept. That is the same walk
//! with one more event: a kept row that is reached becomes active. It ends where the row holds, or where
//! the kept rows cap it. Then δ is already the least violation nearest to u_ref, and the rows of the
//! certificate stay active from then on. Soft rows follow at the end, all at once. A row after which u
//! has moved beyond the correction limit is taken back (the soft ones together).
//!
//! # References
//!
//! D. Goldfarb and A. Idnani, A numerically stable dual method for solving strictly convex quadratic
//! programs, Mathematical Programming 27 (1983), doi 10.1007/BF02591962.

mod rows;

use super::RowSet;
use super::factors::{Factors, Projection};
use super::{Active, Constraint, Enforcement, Outcome, Problem, power_of_two};
use crate::elementary::{self, dot};

/// A violation up to this part of the terms of its slack is round-off.
const ROUND_OFF: f64 = 1e-14;
/// A row that holds up to this part of its terms is not given up.
const HOLDS: f64 = 1e-12;
/// A component of r, or of a slack's slope, up to this part of the largest is round-off.
const NO_SLOPE: f64 = 1e-13;

/// One active row or bound.
#[derive(Clone, Copy)]
struct Slot {
    constraint: Constraint,
    /// The power of two that its row is multiplied by.
    scale: f64,
    multiplier: f64,
    /// The largest multiplier, infinite but for soft rows.
    cap: f64,
    /// Whether it stays active whatever its multiplier.
    fixed: bool,
}

impl Slot {
    const EMPTY: Self = Self {
        constraint: Constraint::Row(0),
        scale: 1.0,
        multiplier: 0.0,
        cap: f64::INFINITY,
        fixed: false,
    };
}

/// A row or bound about to become active.
#[derive(Clone, Copy)]
struct Entering<const N: usize> {
    slot: Slot,
    /// Its normal as δ sees it, or its negative for a soft row that holds more than it must.
    normal: [f64; N],
    norm: f64,
    /// Its violation, > 0.
    violation: f64,
    reversed: bool,
}

enum End {
    /// The row holds.
    Met,
    /// It cannot hold; the rows that forbid it are now fixed. `true`: its violation is round-off.
    Capped(bool),
    /// Too many rounds, or numbers that are not finite.
    Stuck,
}

/// The memory of the method, for at most N inputs; nothing in it survives from one solve to the next.
#[derive(Clone, Copy)]
pub(super) struct DualActiveSet<const N: usize> {
    dim: usize,
    len: usize,
    slots: [Slot; N],
    factors: Factors<N>,
    /// 1/√W and √W.
    reach: [f64; N],
    weight: [f64; N],
    u_ref: [f64; N],
    /// u_ref, moved by the soft rows at their largest multiplier.
    origin: [f64; N],
    u: [f64; N],
    /// Sets of rows: at their largest multiplier; active; enabled to become so.
    saturated: RowSet,
    active: RowSet,
    enabled: RowSet,
    /// Sets of bounds that are active: bits 2i for the lower, 2i + 1 for the upper.
    bounds: u64,
    rounds: u32,
    limit: u32,
    /// Whether a row has left since δ was computed from the active rows.
    stale: bool,
    /// Rows given up, because of the others or because of their size.
    pub(super) relaxed: RowSet,
    pub(super) ill_conditioned: RowSet,
}

impl<const N: usize> DualActiveSet<N> {
    pub(super) const EMPTY: Self = Self {
        dim: 0,
        len: 0,
        slots: [Slot::EMPTY; N],
        factors: Factors::EMPTY,
        reach: [1.0; N],
        weight: [1.0; N],
        u_ref: [0.0; N],
        origin: [0.0; N],
        u: [0.0; N],
        saturated: RowSet::EMPTY,
        active: RowSet::EMPTY,
        enabled: RowSet::EMPTY,
        bounds: 0,
        rounds: 0,
        limit: 0,
        stale: false,
        relaxed: RowSet::EMPTY,
        ill_conditioned: RowSet::EMPTY,
    };

    /// Solves into `u`, which is `u_ref` within its bounds; called where some row does not hold there.
    /// Returns the rounds too.
    pub(super) fn solve(&mut self, p: &Problem, u: &mut [f64]) -> (Outcome, u32) {
        self.start(p, u);
        self.enabled = RowSet::first(p.rows.len());
        let outcome = match self.all_at_once(p) {
            End::Met if self.within_limit(p) => {
                if self.ill_conditioned.is_empty() {
                    Outcome::Optimal
                } else {
                    Outcome::IllConditioned
                }
            }
            _ => {
                let rounds = self.rounds;
                self.start(p, u);
                self.rounds = rounds;
                self.one_by_one(p)
            }
        };
        if outcome != Outcome::Failed {
            for (i, ui) in u.iter_mut().enumerate() {
                *ui = p.bounds.clamp(i, self.u[i]);
            }
        } else {
            self.clear(u.len());
        }
        (outcome, self.rounds)
    }

    /// Forgets the active rows, for `dim` inputs.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn clear(&mut self, dim: usize) {
        (self.dim, self.len) = (dim, 0);
        (self.saturated, self.active, self.bounds) = (RowSet::EMPTY, RowSet::EMPTY, 0);
        (self.relaxed, self.ill_conditioned, self.rounds) = (RowSet::EMPTY, RowSet::EMPTY, 0);
        self.stale = false;
        self.factors.clear(dim);
    }

    #[cfg_attr(not(feature = "small"), inline(always))]
    fn start(&mut self, p: &Problem, u: &[f64]) {
        let n = u.len();
        self.clear(n);
        self.limit = 100 + 20 * (p.rows.len() + 2 * n) as u32;
        for i in 0..N {
            self.u_ref[i] = if i < n { p.u_ref[i] } else { 0.0 };
            // Components beyond the inputs do not move.
            self.reach[i] = if i < n { 1.0 } else { 0.0 };
            self.weight[i] = 1.0;
        }
        if let Some(weights) = p.weights {
            for i in 0..n {
                self.weight[i] = elementary::sqrt(weights[i]);
                self.reach[i] = 1.0 / self.weight[i];
            }
        }
        (self.origin, self.u) = (self.u_ref, self.u_ref);
        // The bounds that the reference exceeds.
        for i in 0..n {
            if self.u[i] < p.bounds.min[i] {
                self.join_bound(p, Constraint::Lower(i));
            } else if self.u[i] > p.bounds.max[i] {
                self.join_bound(p, Constraint::Upper(i));
            }
        }
    }

    fn join_bound(&mut self, p: &Problem, bound: Constraint) {
        let mut e = self.bound_entering(p, bound);
        e.slot.multiplier = e.violation;
        let projection = self.factors.project(&e.normal, 1.0);
        self.join(p, e.slot, &projection);
    }

    /// Takes every enabled row and bound, the most violated first. At u_ref any violation counts, later those beyond
    /// round-off.
    fn all_at_once(&mut self, p: &Problem) -> End {
        let mut tolerance = if self.rounds == 0 { 0.0 } else { ROUND_OFF };
        while let Some(entering) = self.most_violated(p, tolerance) {
            let soft = entering.slot.cap.is_finite();
            match self.enter(p, entering, None) {
                End::Met => {}
                // The others forbid no more than round-off: it holds with them.
                End::Capped(true) => self.disable(entering.slot.constraint),
                // Round-off alone can do that to a soft row.
                End::Capped(false) if soft => self.disable(entering.slot.constraint),
                end => return end,
            }
            tolerance = ROUND_OFF;
        }
        if self.u.iter().all(|v| v.is_finite()) { End::Met } else { End::Stuck }
    }

    /// Takes the hard rows one after the other, those before kept; then the soft ones.
    fn one_by_one(&mut self, p: &Problem) -> Outcome {
        self.limit = self.rounds + 1000 + 20 * (p.rows.len() * p.rows.len()) as u32;
        let mut stuck = false;
        let (mut done, mut kept) = (RowSet::EMPTY, RowSet::EMPTY);
        while let Some(k) = next_hard(p, done) {
            done.insert(k);
            let Some(entering) = self.row_entering(p, k, 0.0) else {
                // It holds, or says nothing about u.
                if !self.ill_conditioned.contains(k) {
                    kept.insert(k);
                }
                continue;
            };
            // Take it in, or back where it gets stuck or goes beyond the limit.
            let before = *self;
            let end = self.enter(p, entering, Some(kept));
            if matches!(end, End::Stuck) || !self.within_limit(p) {
                stuck |= matches!(end, End::Stuck) && self.within_limit(p);
                let rounds = self.rounds;
                *self = before;
                (self.rounds, self.ill_conditioned) = (rounds, self.ill_conditioned | RowSet::of(k));
            } else if let End::Capped(false) = end {
                self.relaxed.insert(k);
            } else if let End::Met = end {
                kept.insert(k);
            }
        }
        // The soft rows together.
        let before = *self;
        let soft = RowSet::first(p.rows.len()) - done;
        self.enabled = kept | soft;
        if !soft.is_empty() && (!matches!(self.all_at_once(p), End::Met) || !self.within_limit(p)) {
            let rounds = self.rounds;
            *self = before;
            (self.rounds, self.ill_conditioned) = (rounds, self.ill_conditioned | soft);
        }
        if stuck && self.rounds > self.limit {
            Outcome::Failed
        } else if !self.ill_conditioned.is_empty() {
            Outcome::IllConditioned
        } else if !self.relaxed.is_empty() {
            Outcome::Infeasible
        } else {
            Outcome::Optimal
        }
    }

    /// Raises the multiplier of `e` until it holds. Rows `kept` and bounds are not violated on the
    /// way; with `None` they may be.
    fn enter(&mut self, p: &Problem, mut e: Entering<N>, kept: Option<RowSet>) -> End {
        let parametric = kept.is_some();
        // Its own multiplier so far; it may go as far as its cap.
        let mut moved = 0.0;
        loop {
            self.rounds += 1;
            if self.rounds > self.limit {
                return End::Stuck;
            }
            // The step to where it holds.
            let projection = self.factors.project(&e.normal, e.norm);
            let mut r = projection.inside;
            self.factors.solve(&mut r);
            let free = projection.square > 0.0;
            let full = if free { e.violation.max(0.0) / projection.square } else { f64::INFINITY };
            let (mut step, mut event) = (full, Event::Holds);
            if e.slot.cap - moved < step {
                (step, event) = (e.slot.cap - moved, Event::Saturates);
            }
            // Shorter: to where an active multiplier reaches 0 or its largest.
            let noise = NO_SLOPE * r[..self.len].iter().fold(1.0, |s: f64, v| s.max(v.abs()));
            for (j, slot) in self.slots[..self.len].iter().enumerate() {
                let at = if slot.fixed || r[j].abs() <= noise {
                    continue;
                } else if r[j] > 0.0 {
                    slot.multiplier.max(0.0) / r[j]
                } else {
                    (slot.cap - slot.multiplier).max(0.0) / -r[j]
                };
                if at < step {
                    (step, event) = (at, Event::Leaves(j));
                }
            }
            // Shorter: to where a kept row or bound is reached.
            if let Some(kept) = kept
                && free
                && let Some((at, constraint)) = self.first_reached(p, &projection, kept, step)
            {
                (step, event) = (at, Event::Reaches(constraint));
            }
            if step == f64::INFINITY {
                return self.capped(p, &e, &r, noise, parametric);
            }
            // Take the step.
            for (slot, r) in self.slots[..self.len].iter_mut().zip(&r) {
                slot.multiplier -= step * r;
            }
            moved += step;
            if (parametric || matches!(event, Event::Holds)) && free {
                for i in 0..N {
                    self.u[i] += step * projection.outside[i] * self.reach[i];
                }
            }
            e.violation -= step * projection.square;
            // Change the active rows by its event.
            match event {
                Event::Holds => {
                    if e.reversed {
                        self.saturate(p, e.slot, false);
                        moved = e.slot.cap - moved;
                        e.normal = self.normal(p, &e.slot);
                    }
                    e.slot.multiplier = moved;
                    let projection =
                        if e.reversed { self.factors.project(&e.normal, e.norm) } else { projection };
                    self.join(p, e.slot, &projection);
                    if self.stale || parametric || e.reversed {
                        self.refresh(p);
                    } else {
                        self.snap(p);
                    }
                    return End::Met;
                }
                Event::Saturates => {
                    self.saturate(p, e.slot, !e.reversed);
                    self.refresh(p);
                    return End::Met;
                }
                Event::Leaves(j) => {
                    let slot = self.slots[j];
                    self.leave(j);
                    if r[j] < 0.0 {
                        self.saturate(p, slot, true);
                    }
                }
                Event::Reaches(constraint) => {
                    let (slot, normal, norm) = self.constraint(p, constraint);
                    let projection = self.factors.project(&normal, norm);
                    if projection.square == 0.0 {
                        return End::Stuck;
                    }
                    self.join(p, slot, &projection);
                }
            }
        }
    }

    /// Ends the entering of `e` where the active rows forbid it: r_j ≤ 0 for all that are not fixed.
    fn capped(&mut self, p: &Problem, e: &Entering<N>, r: &[f64; N], noise: f64, parametric: bool) -> End {
        // The terms whose difference its violation is: its own and those of the certificate.
        let mut terms = self.terms(p, &e.slot);
        for (slot, r) in self.slots[..self.len].iter().zip(r) {
            terms += r.abs() * self.terms(p, slot);
        }
        // Between nearly parallel rows the terms may be large: the row must hold up to its own as well.
        let round_off = e.violation <= f64::min(HOLDS * self.terms(p, &e.slot), ROUND_OFF * terms);
        if parametric || round_off {
            for (slot, r) in self.slots[..self.len].iter_mut().zip(r) {
                slot.fixed |= *r < -noise;
            }
            self.refresh(p);
        }
        End::Capped(round_off)
    }

    /// The row or bound that is violated most, by the distance to it.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn most_violated(&mut self, p: &Problem, tolerance: f64) -> Option<Entering<N>> {
        let mut worst: Option<Entering<N>> = None;
        // The distance of the worst, as a fraction.
        let (mut violation, mut norm) = (0.0, 1.0);
        for (k, row) in p.rows.iter().enumerate() {
            let slack = dot(&row.normal[..N], &self.u) - row.floor;
            // A slack that is not a number, or overflows, is looked at closely too.
            if (0.0..f64::INFINITY).contains(&slack) {
                continue;
            }
            if (self.enabled - self.active - self.saturated).contains(k)
                && let Some(e) = self.row_entering(p, k, tolerance)
                && e.violation * norm > violation * e.norm
            {
                (violation, norm) = (e.violation, e.norm);
                worst = Some(e);
            }
        }
        for i in 0..self.dim {
            let v = self.u[i];
            if p.bounds.min[i] <= v && v <= p.bounds.max[i] || self.bounds >> (2 * i) & 3 != 0 {
                continue;
            }
            let bound = if v < p.bounds.min[i] { Constraint::Lower(i) } else { Constraint::Upper(i) };
            let e = self.bound_entering(p, bound);
            if e.violation * norm > violation && e.violation > tolerance * self.terms(p, &e.slot) {
                (violation, norm) = (e.violation, 1.0);
                worst = Some(e);
            }
        }
        for k in (self.saturated & self.enabled).iter() {
            let (slot, normal, length) = self.constraint(p, Constraint::Row(k));
            let room = self.slack(p, &slot);
            if room > tolerance * self.terms(p, &slot) && room * norm > violation * length {
                (violation, norm) = (room, length);
                let normal = normal.map(|a| -a);
                worst = Some(Entering { slot, normal, norm, violation, reversed: true });
            }
        }
        worst
    }

    /// Row `k` where it is violated by more than `tolerance`; one that vanishes is marked as ill-conditioned.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn row_entering(&mut self, p: &Problem, k: usize, tolerance: f64) -> Option<Entering<N>> {
        if p.rows[k].slack(&self.u) >= 0.0 {
            return None;
        }
        if power_of_two(&p.rows[k].normal[..N]).is_none() {
            if p.rows[k].floor > 0.0 {
                self.ill_conditioned.insert(k);
            }
            self.enabled.remove(k);
            return None;
        }
        let (slot, normal, norm) = self.constraint(p, Constraint::Row(k));
        let violation = -self.slack(p, &slot);
        if !violation.is_finite() {
            // The row asks for more than a number can hold.
            self.ill_conditioned.insert(k);
            self.enabled.remove(k);
            return None;
        }
        let violated = violation > tolerance * self.terms(p, &slot);
        violated.then_some(Entering { slot, normal, norm, violation, reversed: false })
    }

    fn bound_entering(&self, p: &Problem, bound: Constraint) -> Entering<N> {
        let (slot, normal, norm) = self.constraint(p, bound);
        Entering { slot, normal, norm, violation: -self.slack(p, &slot), reversed: false }
    }

    /// The first of the kept rows and bounds that δ + t z reaches for 0 ≤ t < `step`.
    fn first_reached(
        &self,
        p: &Problem,
        projection: &Projection<N>,
        kept: RowSet,
        step: f64,
    ) -> Option<(f64, Constraint)> {
        let z = &projection.outside;
        let length = elementary::sqrt(projection.square);
        let (mut step, mut first) = (step, None);
        for k in (kept - self.active).iter() {
            let Some(_) = power_of_two(&p.rows[k].normal[..N]) else { continue };
            let (slot, normal, norm) = self.constraint(p, Constraint::Row(k));
            let slope = -dot(&normal, z);
            if slope > NO_SLOPE * norm * length {
                let at = self.slack(p, &slot).max(0.0) / slope;
                if at < step {
                    (step, first) = (at, Some(Constraint::Row(k)));
                }
            }
        }
        for i in 0..self.dim {
            if self.bounds >> (2 * i) & 3 != 0 || z[i].abs() <= NO_SLOPE * length {
                continue;
            }
            let bound = if z[i] < 0.0 { Constraint::Lower(i) } else { Constraint::Upper(i) };
            let slot = Slot { constraint: bound, ..Slot::EMPTY };
            let at = self.slack(p, &slot).max(0.0) / z[i].abs();
            if at < step {
                (step, first) = (at, Some(bound));
            }
        }
        first.map(|constraint| (step, constraint))
    }

    /// Whether the rows have moved u by no more than the correction limit.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn within_limit(&self, p: &Problem) -> bool {
        let moved = |i: usize| self.u[i] - p.bounds.clamp(i, p.u_ref[i]);
        let square: f64 = (0..self.dim).map(|i| moved(i) * moved(i)).sum();
        // The squares may leave the range of numbers.
        if (1e-280..1e280).contains(&square) && p.correction_limit > 1e-140 {
            return square <= p.correction_limit * p.correction_limit;
        }
        (0..self.dim).fold(0.0, |d: f64, i| elementary::hypot(d, moved(i))) <= p.correction_limit
    }

    /// The active rows and bounds with their multipliers, then the soft rows at their largest.
    pub(super) fn active(&self, p: &Problem) -> impl Iterator<Item = Active> {
        let slots = self.slots[..self.len].iter().map(|slot| {
            let unit = match slot.constraint {
                Constraint::Row(_) => slot.scale,
                Constraint::Lower(i) | Constraint::Upper(i) => self.weight[i],
            };
            Active { constraint: slot.constraint, multiplier: slot.multiplier * unit }
        });
        let saturated = self.saturated.iter().map(|k| {
            let (slot, _, _) = self.constraint(p, Constraint::Row(k));
            Active { constraint: slot.constraint, multiplier: slot.cap * slot.scale }
        });
        slots.chain(saturated)
    }
}

enum Event {
    Holds,
    Saturates,
    Leaves(usize),
    Reaches(Constraint),
}

/// The hard row of highest priority that is not in `done`, the first of equals.
fn next_hard(p: &Problem, done: RowSet) -> Option<usize> {
    let priority = |k: usize| match p.enforcement.get(k) {
        None => Some(0),
        Some(Enforcement::Hard { priority }) => Some(*priority),
        Some(Enforcement::Soft { .. }) => None,
    };
    let open = (0..p.rows.len()).filter(|k| !done.contains(*k));
    open.filter_map(|k| Some((priority(k)?, k))).min().map(|(_, k)| k)
}
