//! The numbers of one run.

use serde::Serialize;

use super::cases::{CENTRE, DEADLINE, Model, RADIUS};
use crate::error::Error;
use crate::recording::Recording;

/// What one run comes to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// First communication point with h ≥ 0, in s.
    pub arrival: Option<f64>,
    /// Smallest h from the deadline on, in the unit of h.
    pub min_h_after_deadline: f64,
    /// Largest distance from the disc from the deadline on, in m; 0: never outside.
    pub farthest_outside: f64,
    /// Largest size of each input before the arrival (in the whole run if there is none), in its unit.
    pub peak_to_arrival: [f64; 2],
    /// Largest length of the input vector before the arrival; for the point mass, in m/s².
    pub peak_norm_to_arrival: f64,
    /// Largest size of each input in the whole run, in its unit.
    pub peak: [f64; 2],
    /// Largest length of the input vector in the whole run; for the point mass, in m/s².
    pub peak_norm: f64,
    /// Samples whose constraint could not be met.
    pub unsatisfied: usize,
    /// Communication steps of the coupled system per second of wall time.
    pub steps_per_second: f64,
}

impl Summary {
    pub(super) fn new(model: Model, recording: &Recording, steps_per_second: f64) -> Result<Self, Error> {
        let series = |name: &str| {
            recording.series(name).ok_or_else(|| Error::configuration(name, "is not in the recording"))
        };
        let (h, status) = (series("filter.goal.h")?, series("filter.status")?);
        let (x, y) = (series("plant.x.x_p")?, series("plant.x.y_p")?);
        let u = [
            series(&format!("filter.u.{}", model.inputs[0].0))?,
            series(&format!("filter.u.{}", model.inputs[1].0))?,
        ];
        let times = recording.times();
        let arrived = h.iter().position(|&h| h >= 0.0);
        // The arrival sample itself already belongs to what keeps it inside.
        let approach = arrived.unwrap_or(h.len());
        // Communication points are multiples of the step; half a step decides which side one is on.
        let after = times.iter().position(|&t| t >= DEADLINE - 0.5 * super::cases::STEP).unwrap_or(h.len());
        let outside = |k: usize| ((x[k] - CENTRE[0]).hypot(y[k] - CENTRE[1]) - RADIUS).max(0.0);
        let largest = |values: &[f64]| values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let longest = |end: usize| (0..end).map(|k| u[0][k].hypot(u[1][k])).fold(0.0, f64::max);
        Ok(Self {
            arrival: arrived.map(|k| times[k]),
            min_h_after_deadline: h[after..].iter().copied().fold(f64::INFINITY, f64::min),
            farthest_outside: (after..h.len()).map(outside).fold(0.0, f64::max),
            peak_to_arrival: [largest(&u[0][..approach]), largest(&u[1][..approach])],
            peak_norm_to_arrival: longest(approach),
            peak: [largest(&u[0]), largest(&u[1])],
            peak_norm: longest(h.len()),
            // The statuses unchanged (0) and filtered (1) satisfy every constraint.
            unsatisfied: status.iter().filter(|&&s| s > 1.0).count(),
            steps_per_second,
        })
    }

    /// Whether the state was inside by the deadline and from then on.
    pub fn kept(&self) -> bool {
        self.arrival.is_some_and(|t| t <= DEADLINE) && self.min_h_after_deadline >= 0.0
    }
}
