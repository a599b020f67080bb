//! A perturbed copy of the plant of a rollout, under the same law: whether a deviation too small to measure grows until the
//! plan is lost.

use alloc::vec::Vec;

use super::{CheckTolerances, Walk};
use crate::MAX_INPUTS;
use crate::lie::Expansion;
use crate::plan::expansion::{self, at};
use crate::scalar::all_finite;

/// The stages of Runge and Kutta: each with its place in the step, its weight, and its weight in the curvature.
const STAGES: [(f64, f64, f64); 4] =
    [(0.0, 1.0 / 6.0, 1.0), (0.5, 1.0 / 3.0, 0.0), (0.5, 1.0 / 3.0, -2.0), (1.0, 1.0 / 6.0, 1.0)];

/// A perturbed copy of the plant of a rollout, under the same law.
pub(super) struct Perturbed<'a> {
    tolerances: &'a CheckTolerances,
    /// The state where the rollout began.
    origin: Vec<f64>,
    /// The difference of its state and of its input.
    pub(super) x: Vec<f64>,
    pub(super) u: [f64; MAX_INPUTS],
    /// Scratch for a step: slopes of the difference, their mean, and the first less twice the third plus the last.
    slope: Vec<f64>,
    mean: Vec<f64>,
    curvature: Vec<f64>,
    /// The largest growth of the difference since any instant.
    grown: f64,
}

impl<'a> Perturbed<'a> {
    /// Near `x`, in a direction that is not along an axis.
    pub(super) fn new(tolerances: &'a CheckTolerances, x: &[f64]) -> Self {
        Self {
            tolerances,
            origin: x.to_vec(),
            x: away(tolerances, x, x).collect(),
            u: [0.0; MAX_INPUTS],
            slope: x.to_vec(),
            mean: x.to_vec(),
            curvature: x.to_vec(),
            grown: 1.0,
        }
    }

    /// Records by how much the difference has grown, at `x`, and rescales it to its original size. Returns that growth.
    pub(super) fn note(&mut self, x: &[f64]) -> f64 {
        let ratio = part(self.tolerances, &self.x, x, &self.origin) / self.tolerances.perturbation;
        self.grown = (self.grown * ratio).max(1.0);
        match ratio > 0.0 && ratio < f64::INFINITY {
            true => self.x.iter_mut().for_each(|d| *d /= ratio),
            // NaN soon shows in the states.
            false => self.x = away(self.tolerances, x, &self.origin).collect(),
        }
        self.grown
    }
}

/// A deviation from `x` in a direction that is not along an axis.
fn away(tolerances: &CheckTolerances, x: &[f64], origin: &[f64]) -> impl Iterator<Item = f64> {
    let sizes = x.iter().zip(origin).map(|(x, origin)| size_beside(tolerances, *x, *origin));
    (0_u32..)
        .zip(sizes)
        .map(|(i, size)| (1.0 - 2.0 * f64::from(i % 2)) * tolerances.perturbation * size / f64::from(1 + i))
}

/// The largest part that a change `d` is of a state's size, at `x`.
fn part(tolerances: &CheckTolerances, d: &[f64], x: &[f64], origin: &[f64]) -> f64 {
    let parts = d
        .iter()
        .zip(x.iter().zip(origin))
        .map(|(d, (x, origin))| d.abs() / size_beside(tolerances, *x, *origin));
    parts.fold(0.0, f64::max)
}

/// The size of a state, to which a deviation is compared.
fn size_beside(tolerances: &CheckTolerances, x: f64, origin: f64) -> f64 {
    1.0 + (x - origin).abs() + tolerances.far * x.abs()
}

impl Walk<'_> {
    /// Moves the perturbed plant on by `dt` s, together with the one on `path` under `u`: their difference takes steps of
    /// Runge and Kutta.
    pub(super) fn move_perturbed(&mut self, u: &[f64], path: &[Expansion], dt: f64) {
        let tolerances = self.tolerances;
        let Perturbed { origin, x: perturbed, u: more, slope, mean, curvature, .. } = &mut self.perturbed;
        let held: [f64; MAX_INPUTS] = core::array::from_fn(|i| u.get(i).map_or(0.0, |u| u + more[i]));
        let (mut from, mut step) = (0.0, dt);
        while from < dt {
            step = step.min(dt - from);
            slope.fill(0.0);
            mean.fill(0.0);
            curvature.fill(0.0);
            for (part, weight, bends) in STAGES {
                let after = from + part * step;
                for (i, point) in self.point.iter_mut().enumerate() {
                    *point = at(&path[i], after) + perturbed[i] + part * step * slope[i];
                }
                self.model.plant.rate(&self.point, &held[..u.len()], &mut self.rate);
                for (i, rate) in self.rate.iter().enumerate() {
                    slope[i] = rate - expansion::slope(&path[i], after);
                    mean[i] += weight * slope[i];
                    curvature[i] += bends * slope[i];
                }
            }
            let part = |d: &[f64]| part(tolerances, d, &self.x, origin);
            if step * part(curvature) > tolerances.bent * part(perturbed) && step > tolerances.shortest * dt {
                step *= 0.5;
                continue;
            }
            for (d, mean) in perturbed.iter_mut().zip(&*mean) {
                *d += step * mean;
            }
            from = if step < dt - from { from + step } else { dt };
            step *= 2.0;
        }
    }

    /// Whether the plant also has an expansion near its state, in one of four directions, at the distance of the
    /// perturbation. Where a tank runs dry its rate has an infinite slope, and no expansion shows what comes after. A piece
    /// that ends near such a place was cut short before it.
    pub(super) fn is_smooth_beside(&mut self, u: &[f64]) -> bool {
        if self.longest == f64::INFINITY || self.strictness <= 0.0 {
            return true;
        }
        for (i, (point, x)) in (0_u32..).zip(self.point.iter_mut().zip(&self.x)) {
            let sign = if (self.pieces + i * (self.pieces / 2)).is_multiple_of(2) { 1.0 } else { -1.0 };
            *point = x + sign
                * self.strictness
                * self.tolerances.perturbation
                * size_beside(self.tolerances, *x, self.perturbed.origin[i as usize]);
        }
        self.model.plant.path(&self.point, u, &mut self.beside);
        all_finite(self.beside.as_flattened())
    }
}
