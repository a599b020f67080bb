//! A plant beside that of a roll-out, under the same law: whether a deviation that nobody could measure grows until the plan is lost.

use alloc::vec::Vec;

use super::Walk;
use crate::MAX_INPUTS;
use crate::lie::Expansion;
use crate::plan::expansion::{self, at};
use crate::scalar::all_finite;

/// How many times a deviation may grow on the way of a plan, and of one that was accepted before: what it begins with is what the
/// expansions of the states miss, far more than round-off.
pub(super) const SPREADS: [f64; 2] = [1e4, 1e6];
/// Part of a state's size by which the plant is moved to see how a deviation grows. That size is 1, the way from where the walk began,
/// and this part of the state itself: far from the origin a deviation is more than round-off, and a place no other place.
const PERTURBATION: f64 = 1e-6;
const FAR: f64 = 1e-6;
/// The last term of a step along which the plant that was moved is followed, as a part of the deviation: (λτ)⁴/4 of a mode that
/// grows with λ. And the shortest step, as a part of a piece.
const BENT: f64 = 0.25;
const SHORTEST: f64 = 1e-3;
/// Each stage of Runge and Kutta: where in the step it is, what it counts, and its weight in the curvature.
const STAGES: [(f64, f64, f64); 4] =
    [(0.0, 1.0 / 6.0, 1.0), (0.5, 1.0 / 3.0, 0.0), (0.5, 1.0 / 3.0, -2.0), (1.0, 1.0 / 6.0, 1.0)];

/// A plant beside that of a roll-out, under the same law.
pub(super) struct Perturbed {
    /// The state where the walk began.
    origin: Vec<f64>,
    /// By how much its state and its input differ.
    pub(super) x: Vec<f64>,
    pub(super) u: [f64; MAX_INPUTS],
    /// Room for a step: slopes of the difference, their mean, and the first less twice the third and the last.
    slope: Vec<f64>,
    mean: Vec<f64>,
    curvature: Vec<f64>,
    /// How many times the difference has grown since some instant, at most.
    grown: f64,
}

impl Perturbed {
    /// Beside `x`, in a direction that is none of an axis.
    pub(super) fn new(x: &[f64]) -> Self {
        Self {
            origin: x.to_vec(),
            x: away(x, x).collect(),
            u: [0.0; MAX_INPUTS],
            slope: x.to_vec(),
            mean: x.to_vec(),
            curvature: x.to_vec(),
            grown: 1.0,
        }
    }

    /// Notes by how much the difference has grown, at `x`, and makes it as small again. Returns that growth.
    pub(super) fn note(&mut self, x: &[f64]) -> f64 {
        let ratio = part(&self.x, x, &self.origin) / PERTURBATION;
        self.grown = (self.grown * ratio).max(1.0);
        match ratio > 0.0 && ratio < f64::INFINITY {
            true => self.x.iter_mut().for_each(|d| *d /= ratio),
            // What is no number shows in the states soon enough.
            false => self.x = away(x, &self.origin).collect(),
        }
        self.grown
    }
}

/// A deviation from `x` in a direction that is none of an axis.
fn away(x: &[f64], origin: &[f64]) -> impl Iterator<Item = f64> {
    let sizes = x.iter().zip(origin).map(|(x, origin)| size_beside(*x, *origin));
    (0_u32..)
        .zip(sizes)
        .map(|(i, size)| (1.0 - 2.0 * f64::from(i % 2)) * PERTURBATION * size / f64::from(1 + i))
}

/// The largest part of a state's size that a change `d` of it is, at `x`.
fn part(d: &[f64], x: &[f64], origin: &[f64]) -> f64 {
    let parts = d.iter().zip(x.iter().zip(origin)).map(|(d, (x, origin))| d.abs() / size_beside(*x, *origin));
    parts.fold(0.0, f64::max)
}

/// What a deviation is small against.
fn size_beside(x: f64, origin: f64) -> f64 {
    1.0 + (x - origin).abs() + FAR * x.abs()
}

impl Walk<'_> {
    /// Moves the perturbed plant on by `dt` s, as that on `path` under `u` is: the difference of the two in steps of Runge
    /// and Kutta.
    pub(super) fn move_perturbed(&mut self, u: &[f64], path: &[Expansion], dt: f64) {
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
            let part = |d: &[f64]| part(d, &self.x, origin);
            if step * part(curvature) > BENT * part(perturbed) && step > SHORTEST * dt {
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

    /// Whether the plant has an expansion beside its state too, in one of four directions, by as much as that which is
    /// moved: where a tank runs dry its rate has an infinite slope, and no expansion tells what comes after. A piece that
    /// ends near such a place was cut short before it.
    pub(super) fn is_smooth_beside(&mut self, u: &[f64]) -> bool {
        if self.longest == f64::INFINITY || self.strictness <= 0.0 {
            return true;
        }
        for (i, (point, x)) in (0_u32..).zip(self.point.iter_mut().zip(&self.x)) {
            let sign = if (self.pieces + i * (self.pieces / 2)).is_multiple_of(2) { 1.0 } else { -1.0 };
            *point = x + sign
                * self.strictness
                * PERTURBATION
                * size_beside(*x, self.perturbed.origin[i as usize]);
        }
        self.model.plant.path(&self.point, u, &mut self.beside);
        all_finite(self.beside.as_flattened())
    }
}
