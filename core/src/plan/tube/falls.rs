//! By how much h may be lower in a tube than along its reference.
//!
//! For a deviation e, h(z + e) − h(z) = ∇h(z) e + ½ eᵀ H e with the second derivatives H somewhere between. The first term is
//! least at the support of the tube against the gradient. In the second, only the directions count in which h is curved
//! downward: those of an obstacle are not.

use alloc::vec;
use alloc::vec::Vec;

use nalgebra::{DMatrix, SymmetricEigen};

use super::Tube;
use super::bends::{radius, size};
use super::faults;
use super::zonotope::{self, Zonotope};
use crate::interval::Interval;
use crate::lie::{ExpansionOver, Second};
use crate::plan::Requirement;
use crate::scalar::Scalar;

impl Tube<'_> {
    /// By how much h of `requirement`, number `i`, may be lower than along the reference at any enclosed `time` (s) on the last
    /// piece, for which the reference is within `over`; and how much of that a shorter time may lessen. Infinite if it is not
    /// known.
    pub(in crate::plan) fn fall(
        &mut self,
        (i, requirement): (usize, &Requirement<'_>),
        time: Interval,
        over: &[ExpansionOver],
    ) -> [f64; 2] {
        let n = self.dims[0];
        let Self { set, before, reach, bulge, barriers, rooms, .. } = self;
        let Some(bends) = &barriers[i] else { return [f64::INFINITY, 0.0] };
        let evaluate = |x: &[Second], out: &mut [Second]| match requirement.model.second_value(time, x) {
            Some(h) => {
                out[0] = h;
                true
            }
            None => false,
        };
        let mut value = [Second::from(0.0)];
        rooms.at.clear();
        rooms.at.extend(over.iter().take(n).map(|over| over[0]));
        bends.slopes(&rooms.at, (&mut rooms.variables, &mut value), evaluate, &mut rooms.slopes);
        for (at, reach) in rooms.at.iter_mut().zip(&*reach) {
            *at = Interval::new(at.low - reach, at.high + reach);
        }
        bends.curvatures(&rooms.at, (&mut rooms.variables, &mut value), evaluate, &mut rooms.curvatures);
        let middle: Vec<f64> = rooms.slopes.iter().map(|slope| slope.value()).collect();
        // Any deviation is near a line between one at the beginning and one at the end.
        let mut ends = |along: &[f64], of: &dyn Fn(f64, f64) -> f64| {
            let mut end = |set: &Zonotope| {
                of(
                    zonotope::dot(along, &set.centre),
                    faults::part() * set.half_width(along, &mut rooms.parts),
                )
            };
            end(before).max(end(set))
        };
        let aside = |along: &[f64]| along.iter().zip(&*bulge).map(|(d, bulge)| d.abs() * bulge).sum::<f64>();
        let turned: f64 = (0..n).map(|j| radius(rooms.slopes[j]) * reach[j]).sum();
        let furthest = ends(&middle, &|centre, half| half - centre);
        let linear = furthest + aside(&middle) + turned;
        // The curvature in the middle by its principal directions, its width by size.
        let count = bends.bent.len();
        let mut curvature = DMatrix::zeros(count, count);
        let mut wide = 0.0;
        for (pair, along) in bends.pairs.iter().zip(&rooms.curvatures) {
            let [a, b] = pair.map(|of| bends.bent.iter().position(|bent| *bent == of).unwrap_or(0));
            curvature[(a, b)] = along.value();
            curvature[(b, a)] = along.value();
            let both = reach[pair[0]] * reach[pair[1]] * if a == b { 0.5 } else { 1.0 };
            // The decomposition rounds.
            wide += (radius(*along) + 1e-12 * size(*along)) * both;
        }
        if !(linear + wide).is_finite() || !curvature.iter().all(|v| v.is_finite()) {
            return [f64::INFINITY, 0.0];
        }
        let mut bent = 0.0;
        if count > 0 && curvature.iter().any(|v| *v != 0.0) {
            let scale = curvature.amax();
            let Some(principal) = SymmetricEigen::try_new(curvature, 1e-14, 100) else {
                return [f64::INFINITY, 0.0];
            };
            for (value, vector) in principal.eigenvalues.iter().zip(principal.eigenvectors.column_iter()) {
                // Rounded towards less than it is.
                let value = value - 1e-11 * scale;
                if value < 0.0 {
                    let mut direction = vec![0.0; n];
                    for (of, v) in bends.bent.iter().zip(vector.iter()) {
                        direction[*of] = *v;
                    }
                    let across = ends(&direction, &|centre, half| centre.abs() + half) + aside(&direction);
                    bent -= 0.5 * value * across * across;
                }
            }
        }
        [(linear + wide + bent) * (1.0 + 1e-12) + f64::EPSILON, turned + wide]
    }

    /// Enclosures of where the plant is on the last piece, on which the reference is within `over`.
    pub(in crate::plan) fn around_piece(&self, over: &[ExpansionOver]) -> Vec<ExpansionOver> {
        over.iter()
            .enumerate()
            .map(|(i, over)| {
                let mut wide = [Interval::ALL; crate::lie::EXPANSION_ORDERS];
                let reach = self.reach.get(i).filter(|_| i < self.dims[0]).copied().unwrap_or(0.0);
                wide[0] = Interval::new(over[0].low - reach, over[0].high + reach);
                wide
            })
            .collect()
    }

    /// By how much h of `requirement`, number `i`, may be lower at the beginning than at the reference state `z` at `t`.
    pub(in crate::plan) fn fall_at(&mut self, at: (usize, &Requirement<'_>), t: f64, z: &[f64]) -> f64 {
        self.set.reach(&mut self.reach);
        self.before.clone_from(&self.set);
        self.bulge.fill(0.0);
        let over: Vec<ExpansionOver> =
            z.iter().map(|z| [Interval::from(*z); crate::lie::EXPANSION_ORDERS]).collect();
        self.fall(at, Interval::from(t), &over)[0]
    }
}
