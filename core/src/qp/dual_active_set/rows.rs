//! The rows and bounds as the method sees them, and the list of the active ones.

use super::super::factors::Projection;
use super::super::{Constraint, Enforcement, Problem, Row, power_of_two};
use super::{DualActiveSet, Slot};
use crate::elementary::{self, dot};

impl<const N: usize> DualActiveSet<N> {
    /// An empty slot for `constraint`, its normal as δ sees it, and the length of that.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn constraint(&self, p: &Problem, constraint: Constraint) -> (Slot, [f64; N], f64) {
        let mut slot = Slot { constraint, ..Slot::EMPTY };
        let mut norm = 1.0;
        if let Constraint::Row(k) = constraint {
            slot.scale = power_of_two(&p.rows[k].normal[..N]).unwrap_or(1.0);
        }
        let normal = self.normal(p, &slot);
        if let Constraint::Row(k) = constraint {
            norm = elementary::sqrt(dot(&normal, &normal));
            if let Some(Enforcement::Soft { penalty }) = p.enforcement.get(k) {
                slot.cap = penalty / norm;
            }
        }
        (slot, normal, norm)
    }

    pub(super) fn normal(&self, p: &Problem, slot: &Slot) -> [f64; N] {
        let mut normal = [0.0; N];
        match slot.constraint {
            Constraint::Row(k) => {
                for i in 0..N {
                    normal[i] = p.rows[k].normal[i] * slot.scale * self.reach[i];
                }
            }
            Constraint::Lower(i) => normal[i] = 1.0,
            Constraint::Upper(i) => normal[i] = -1.0,
        }
        normal
    }

    /// The slack at u, in the scale of [`Self::normal`].
    pub(super) fn slack(&self, p: &Problem, slot: &Slot) -> f64 {
        self.slack_at(p, slot, &self.u)
    }

    pub(super) fn slack_at(&self, p: &Problem, slot: &Slot, u: &[f64; N]) -> f64 {
        match slot.constraint {
            Constraint::Row(k) => {
                let Row { normal, floor } = &p.rows[k];
                let value: f64 = (0..N).map(|i| normal[i] * slot.scale * u[i]).sum();
                value - floor * slot.scale
            }
            Constraint::Lower(i) => (u[i] - p.bounds.min[i]) * self.weight[i],
            Constraint::Upper(i) => (p.bounds.max[i] - u[i]) * self.weight[i],
        }
    }

    /// The size of the terms of the slack, those at u_ref included, from which u is computed.
    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn terms(&self, p: &Problem, slot: &Slot) -> f64 {
        let largest = |i: usize| f64::max(self.u[i].abs(), self.u_ref[i].abs());
        match slot.constraint {
            Constraint::Row(k) => {
                let Row { normal, floor } = &p.rows[k];
                (0..N).map(|i| (normal[i] * slot.scale).abs() * largest(i)).sum::<f64>()
                    + (floor * slot.scale).abs()
            }
            Constraint::Lower(i) => (p.bounds.min[i].abs() + largest(i)) * self.weight[i],
            Constraint::Upper(i) => (p.bounds.max[i].abs() + largest(i)) * self.weight[i],
        }
    }

    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn join(&mut self, p: &Problem, slot: Slot, projection: &Projection<N>) {
        self.slots[self.len] = slot;
        self.len += 1;
        self.factors.append(projection);
        self.mark(slot.constraint, true);
        self.place(p, slot.constraint);
    }

    pub(super) fn leave(&mut self, j: usize) {
        self.mark(self.slots[j].constraint, false);
        self.slots.copy_within(j + 1..self.len, j);
        self.len -= 1;
        self.factors.remove(j);
        self.stale = true;
    }

    #[cfg_attr(not(feature = "small"), inline(always))]
    pub(super) fn mark(&mut self, constraint: Constraint, active: bool) {
        let toggle = |set: u64, bit: usize| if active { set | 1 << bit } else { set & !(1 << bit) };
        match constraint {
            Constraint::Row(k) if active => self.active.insert(k),
            Constraint::Row(k) => self.active.remove(k),
            Constraint::Lower(i) => self.bounds = toggle(self.bounds, 2 * i),
            Constraint::Upper(i) => self.bounds = toggle(self.bounds, 2 * i + 1),
        }
    }

    pub(super) fn disable(&mut self, constraint: Constraint) {
        match constraint {
            Constraint::Row(k) => self.enabled.remove(k),
            // Met by the final clamp.
            bound => self.mark(bound, true),
        }
    }

    /// Puts the row of `slot` at its largest multiplier (`there`), or takes it from there, and moves the origin.
    pub(super) fn saturate(&mut self, p: &Problem, slot: Slot, there: bool) {
        if let Constraint::Row(k) = slot.constraint {
            if there { self.saturated.insert(k) } else { self.saturated.remove(k) }
        }
        self.origin = self.u_ref;
        for k in self.saturated.iter() {
            let (slot, normal, _) = self.constraint(p, Constraint::Row(k));
            for i in 0..N {
                self.origin[i] += slot.cap * normal[i] * self.reach[i];
            }
        }
    }

    /// Computes u and the multipliers from the active rows.
    pub(super) fn refresh(&mut self, p: &Problem) {
        let mut y = [0.0; N];
        for (y, slot) in y.iter_mut().zip(&self.slots[..self.len]) {
            *y = -self.slack_at(p, slot, &self.origin);
        }
        self.factors.solve_transposed(&mut y);
        for i in 0..N {
            self.u[i] = self.origin[i] + self.reach[i] * self.factors.component(i, &y);
        }
        self.factors.solve(&mut y);
        for (slot, y) in self.slots[..self.len].iter_mut().zip(&y) {
            slot.multiplier = *y;
        }
        self.stale = false;
        self.snap(p);
    }

    /// Puts the components at active bounds there exactly.
    pub(super) fn snap(&mut self, p: &Problem) {
        if self.bounds != 0 {
            for j in 0..self.len {
                self.place(p, self.slots[j].constraint);
            }
        }
    }

    pub(super) fn place(&mut self, p: &Problem, constraint: Constraint) {
        match constraint {
            Constraint::Row(_) => {}
            Constraint::Lower(i) => self.u[i] = p.bounds.min[i],
            Constraint::Upper(i) => self.u[i] = p.bounds.max[i],
        }
    }
}
