//! Zonotopes: a centre, and generators each of which counts with a number from −1 to 1.

use alloc::vec;
use alloc::vec::Vec;

/// c + Σ_k β_k g_k with |β_k| ≤ 1.
#[derive(Debug)]
pub(super) struct Zonotope {
    pub(super) centre: Vec<f64>,
    /// Of each component, its part of every generator.
    components: Vec<Vec<f64>>,
    /// Memory of [`Self::map`] and [`Self::reduce`].
    mapped: Vec<Vec<f64>>,
    scores: [Vec<f64>; 2],
}

impl Clone for Zonotope {
    fn clone(&self) -> Self {
        let mut clone = Self::point(self.centre.len());
        clone.clone_from(self);
        clone
    }

    fn clone_from(&mut self, other: &Self) {
        self.centre.clone_from(&other.centre);
        self.components.clone_from(&other.components);
    }
}

impl Zonotope {
    /// The point 0 with `rows` components.
    pub(super) fn point(rows: usize) -> Self {
        let empty = vec![Vec::new(); rows];
        Self { centre: vec![0.0; rows], components: empty.clone(), mapped: empty, scores: Default::default() }
    }

    /// The number of generators.
    pub(super) fn len(&self) -> usize {
        self.components.first().map_or(0, Vec::len)
    }

    /// Replaces x by the product of x with the matrix of these coefficients, by row and column.
    pub(super) fn map(&mut self, coefficient: impl Fn(usize, usize) -> f64) {
        let (rows, count) = (self.centre.len(), self.len());
        let centre: Vec<f64> = (0..rows)
            .map(|i| {
                let terms = (0..rows).map(|j| (coefficient(i, j), self.centre[j]));
                terms.filter(|(by, _)| *by != 0.0).map(|(by, c)| by * c).sum()
            })
            .collect();
        self.centre = centre;
        for i in 0..rows {
            let mapped = &mut self.mapped[i];
            mapped.clear();
            mapped.resize(count, 0.0);
            for (j, component) in self.components.iter().enumerate() {
                let by = coefficient(i, j);
                if by != 0.0 {
                    mapped.iter_mut().zip(component).for_each(|(mapped, g)| *mapped += by * g);
                }
            }
        }
        core::mem::swap(&mut self.components, &mut self.mapped);
    }

    /// Adds a generator, 0 in components that `parts` does not give.
    pub(super) fn push(&mut self, parts: impl IntoIterator<Item = f64>) {
        let parts = parts.into_iter().chain(core::iter::repeat(0.0));
        self.components.iter_mut().zip(parts).for_each(|(component, part)| component.push(part));
    }

    /// Adds a generator along component `i`, if `size` > 0.
    pub(super) fn push_along(&mut self, i: usize, size: f64) {
        if size > 0.0 {
            self.push((0..=i).map(|k| if k == i { size } else { 0.0 }));
        }
    }

    /// Writes the largest size of every component.
    pub(super) fn reach(&self, out: &mut [f64]) {
        for ((out, c), component) in out.iter_mut().zip(&self.centre).zip(&self.components) {
            *out = c.abs() + size(component);
        }
    }

    /// How far `direction`ᵀx may be from its value at the centre.
    pub(super) fn half_width(&self, direction: &[f64], parts: &mut Vec<f64>) -> f64 {
        parts.clear();
        parts.resize(self.len(), 0.0);
        for (by, component) in direction.iter().zip(&self.components).filter(|(by, _)| **by != 0.0) {
            parts.iter_mut().zip(component).for_each(|(part, g)| *part += by * g);
        }
        size(parts)
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
        let count = self.len();
        if count <= most {
            return;
        }
        // What is left of the sum of its parts without the largest one.
        let [sums, largest] = &mut self.scores;
        for of in [&mut *sums, &mut *largest] {
            of.clear();
            of.resize(count, 0.0);
        }
        for (component, size) in self.components.iter().zip(sizes) {
            let by = 1.0 / size;
            for ((sum, largest), g) in sums.iter_mut().zip(&mut *largest).zip(component) {
                let part = by * g.abs();
                *sum += part;
                *largest = if part > *largest { part } else { *largest };
            }
        }
        scores.clear();
        scores.extend(sums.iter().zip(&*largest).map(|(sum, largest)| sum - largest).zip(0..));
        let boxed = count - (most - states);
        scores.select_nth_unstable_by(boxed - 1, |a, b| a.0.total_cmp(&b.0));
        // In order, so that what is kept can move up.
        let gone = &mut scores[..boxed];
        gone.sort_unstable_by_key(|(_, k)| *k);
        for (i, component) in self.components.iter_mut().enumerate() {
            let side: f64 = gone.iter().map(|(_, k)| component[*k].abs()).sum();
            let (mut kept, mut next) = (0, gone.iter().map(|(_, k)| *k).peekable());
            for k in 0..count {
                if next.next_if_eq(&k).is_none() {
                    component[kept] = component[k];
                    kept += 1;
                }
            }
            component.truncate(kept);
            // The sum of up to a few hundred numbers is rounded. Others get none of it.
            component.resize(kept + states, 0.0);
            if i < states {
                component[kept + i] = side * (1.0 + 1e-13);
            }
        }
    }
}

/// The sum of sizes, in four parts that a processor adds at once.
fn size(parts: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (fours, rest) = parts.as_chunks::<4>();
    for four in fours {
        sums.iter_mut().zip(four).for_each(|(sum, part)| *sum += part.abs());
    }
    sums.iter().sum::<f64>() + rest.iter().map(|part| part.abs()).sum::<f64>()
}

/// aᵀb, over the shorter.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
