//! How far an input is from satisfying the Karush-Kuhn-Tucker conditions.

use super::{Active, Constraint, Enforcement, Problem, Row};
use crate::MAX_INPUTS;

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
        let mut sum = [0.0; MAX_INPUTS];
        let mut size: f64 = 0.0;
        for (i, v) in u.iter().enumerate() {
            sum[i] = p.weights.map_or(1.0, |w| w[i]) * (v - p.u_ref[i]);
            size = size.max(sum[i].abs());
        }
        let (mut least, mut largest) = (0.0_f64, 0.0_f64);
        let mut complementarity: f64 = 0.0;
        for &Active { constraint, multiplier } in active {
            let part = |value: f64, terms: f64| if value == 0.0 { 0.0 } else { value / terms };
            let (norm, apart) = match constraint {
                Constraint::Row(k) => {
                    let row = &p.rows[k];
                    let mut norm: f64 = 0.0;
                    for (s, a) in sum[..u.len()].iter_mut().zip(&row.normal) {
                        *s -= multiplier * a;
                        size = size.max((multiplier * a).abs());
                        norm = norm.max(a.abs());
                    }
                    // A soft row at its largest multiplier may be violated.
                    let soft = matches!(p.enforcement.get(k), Some(Enforcement::Soft { .. }));
                    let apart = if soft { row.slack(u).max(0.0) } else { row.slack(u).abs() };
                    (norm, part(apart, terms(row, u)))
                }
                Constraint::Lower(i) => {
                    sum[i] -= multiplier;
                    (1.0, part((u[i] - p.bounds.min[i]).abs(), u[i].abs() + p.bounds.min[i].abs()))
                }
                Constraint::Upper(i) => {
                    sum[i] += multiplier;
                    (1.0, part((u[i] - p.bounds.max[i]).abs(), u[i].abs() + p.bounds.max[i].abs()))
                }
            };
            least = least.min(multiplier * norm);
            largest = largest.max(multiplier.abs() * norm);
            complementarity = complementarity.max(apart);
        }
        let violation =
            p.rows.iter().filter(|row| row.slack(u) < 0.0).map(|row| -row.slack(u) / terms(row, u));
        Self {
            stationarity: sum.iter().fold(0.0, |s: f64, v| s.max(v.abs())) / size.max(f64::MIN_POSITIVE),
            violation: violation.fold(0.0, f64::max),
            negativity: -least / largest.max(f64::MIN_POSITIVE),
            complementarity,
        }
    }
}

/// The size of the terms of a slack.
fn terms(row: &Row, u: &[f64]) -> f64 {
    row.normal.iter().zip(u).fold(row.floor.abs(), |s, (a, v)| s + (a * v).abs())
}
