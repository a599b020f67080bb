//! Zonotopes: a centre, and generators each of which counts with a number from −1 to 1.

use alloc::vec;
use alloc::vec::Vec;

/// c + Σ_k β_k g_k with |β_k| ≤ 1.
#[derive(Clone, Debug)]
pub(super) struct Zonotope {
    /// The number of components.
    rows: usize,
    pub(super) centre: Vec<f64>,
    /// The generators, one after the other.
    columns: Vec<f64>,
}

impl Zonotope {
    /// The point 0 with `rows` components.
    pub(super) fn point(rows: usize) -> Self {
        Self { rows, centre: vec![0.0; rows], columns: Vec::new() }
    }

    pub(super) fn columns(&self) -> core::slice::ChunksExact<'_, f64> {
        self.columns.chunks_exact(self.rows)
    }

    /// Calls `change` with the centre and with every generator.
    pub(super) fn map(&mut self, mut change: impl FnMut(&mut [f64])) {
        change(&mut self.centre);
        self.columns.chunks_exact_mut(self.rows).for_each(change);
    }

    /// Adds a generator, 0 in components that `components` does not give.
    pub(super) fn push(&mut self, components: impl IntoIterator<Item = f64>) {
        let end = self.columns.len() + self.rows;
        self.columns.extend(components);
        self.columns.resize(end, 0.0);
    }

    /// Adds a generator along component `i`, if `size` > 0.
    pub(super) fn push_along(&mut self, i: usize, size: f64) {
        if size > 0.0 {
            self.columns.resize(self.columns.len() + self.rows, 0.0);
            let from = self.columns.len() - self.rows;
            self.columns[from + i] = size;
        }
    }

    /// Writes the largest size of every component.
    pub(super) fn reach(&self, out: &mut [f64]) {
        for (out, c) in out.iter_mut().zip(&self.centre) {
            *out = c.abs();
        }
        for column in self.columns() {
            for (out, g) in out.iter_mut().zip(column) {
                *out += g.abs();
            }
        }
    }

    /// How far `direction`ᵀx may be from its value at the centre.
    pub(super) fn half_width(&self, direction: &[f64]) -> f64 {
        self.columns().map(|column| dot(direction, column).abs()).sum()
    }

    /// Replaces the generators that are nearly along an axis, or small, by a box around them, so that at most `most` are left.
    /// Components are measured in units of `sizes`. Encloses what was there.
    ///
    /// Source: A. Girard, "Reachability of uncertain linear systems using zonotopes", HSCC (2005).
    pub(super) fn reduce(
        &mut self,
        most: usize,
        states: usize,
        sizes: &[f64],
        scores: &mut Vec<(f64, usize)>,
    ) {
        let count = self.columns.len() / self.rows;
        if count <= most {
            return;
        }
        scores.clear();
        scores.extend(self.columns().enumerate().map(|(k, column)| {
            let parts = column.iter().zip(sizes).map(|(g, size)| g.abs() / size);
            let (sum, largest) = parts.fold((0.0_f64, 0.0_f64), |(s, m), p| (s + p, m.max(p)));
            (sum - largest, k)
        }));
        let boxed = count - (most - states);
        scores.select_nth_unstable_by(boxed - 1, |a, b| a.0.total_cmp(&b.0));
        let mut sides = vec![0.0; states];
        for (_, k) in &scores[..boxed] {
            let column = &mut self.columns[k * self.rows..][..self.rows];
            for (side, g) in sides.iter_mut().zip(&mut *column) {
                *side += g.abs();
            }
            // Marks it as gone.
            column.fill(f64::NAN);
        }
        let (rows, mut kept) = (self.rows, 0);
        for k in 0..count {
            if !self.columns[k * rows].is_nan() {
                self.columns.copy_within(k * rows..(k + 1) * rows, kept * rows);
                kept += 1;
            }
        }
        self.columns.truncate(kept * rows);
        for (i, side) in sides.into_iter().enumerate() {
            // The sum of up to a few hundred numbers is rounded.
            self.push_along(i, side * (1.0 + 1e-13));
        }
    }
}

/// aᵀb, over the shorter.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
