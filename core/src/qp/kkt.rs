//! The residuals of an input in the Karush-Kuhn-Tucker conditions.

use super::{Active, Constraint, Enforcement, Problem, Row};
use crate::MAX_INPUTS;
use crate::elementary;

/// The four conditions of optimality, each as a part of the terms it is the sum of: dimensionless, 0 for the
/// exact minimiser, a small multiple of 1e-16 for a good answer. Where rows were given up or yielded, they
/// show in `violation`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residuals {
    /// The largest component of W (u − u_ref) − Σ λ a.
    pub stationarity: f64,
    /// The largest violation of a row.
    pub violation: f64,
    /// The most negative multiplier, as a part of the largest, with the norms of the normals.
    pub negativity: f64,
    /// The largest distance of an active row or bound from its floor.
    pub complementarity: f64,
}

impl Residuals {
    pub(super) fn of(p: &Problem, u: &[f64], active: &[Active]) -> Self {
        let m = u.len();
        let weight = |i: usize| p.weights.map_or(1.0, |w| w[i]);
        // W (u − u_ref) − Σ λ a and the terms of it.
        let mut rest = [0.0; MAX_INPUTS];
        let mut size = [0.0; MAX_INPUTS];
        for i in 0..m {
            rest[i] = weight(i) * (u[i] - p.u_ref[i]);
            size[i] = weight(i) * (u[i].abs() + p.u_ref[i].abs());
        }
        let (mut least, mut largest) = (0.0_f64, 0.0_f64);
        for &Active { constraint, multiplier } in active {
            let mut pull = |i: usize, a: f64| {
                rest[i] -= multiplier * a;
                size[i] += (multiplier * a).abs();
                least = least.min(multiplier * a.abs());
                largest = largest.max((multiplier * a).abs());
            };
            match constraint {
                Constraint::Row(k) => (0..m).for_each(|i| pull(i, p.rows[k].normal[i])),
                Constraint::Lower(i) => pull(i, 1.0),
                Constraint::Upper(i) => pull(i, -1.0),
            }
        }
        // The violation of each row, and the distance of each active one from its floor. u is known to the round-off of
        // the terms above, as a length of √W u.
        let length = (0..m).fold(0.0, |s: f64, i| s.max(size[i] / elementary::sqrt(weight(i))));
        let part = |row: &Row, slack: f64| {
            let terms = |s: f64, i: usize| s + (row.normal[i] / elementary::sqrt(weight(i))).abs() * length;
            if slack == 0.0 { 0.0 } else { slack / (0..m).fold(row.floor.abs(), terms) }
        };
        let violation = p.rows.iter().map(|row| part(row, -row.slack(u).min(0.0)));
        let apart = active.iter().map(|a| match a.constraint {
            Constraint::Row(k) => {
                // A soft row at its largest multiplier may be violated.
                let soft = matches!(p.enforcement.get(k), Some(Enforcement::Soft { .. }));
                let slack = p.rows[k].slack(u);
                part(&p.rows[k], if soft { slack.max(0.0) } else { slack.abs() })
            }
            Constraint::Lower(i) => (u[i] - p.bounds.min[i]).abs() * elementary::sqrt(weight(i)) / length,
            Constraint::Upper(i) => (u[i] - p.bounds.max[i]).abs() * elementary::sqrt(weight(i)) / length,
        });
        let largest_of = |v: &[f64; MAX_INPUTS]| v.iter().fold(0.0, |s: f64, v| s.max(v.abs()));
        let relative = |value: f64, to: f64| if value == 0.0 { 0.0 } else { value / to };
        Self {
            stationarity: relative(largest_of(&rest), largest_of(&size)),
            violation: violation.fold(0.0, f64::max),
            negativity: relative(-least, largest),
            complementarity: apart.fold(0.0, f64::max),
        }
    }
}
