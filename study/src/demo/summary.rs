//! The numbers of one run.

use punctual_cosim::error::Error;
use punctual_cosim::recording::Recording;
use serde::Serialize;

use super::Case;
use crate::trial::{Measured, Outcome};

/// Numbers of one run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// First communication point with h ≥ 0, in s.
    pub arrival: Option<f64>,
    /// Smallest h from the deadline on, in the unit of h.
    pub min_h_after_deadline: f64,
    /// Largest distance from the disc from the deadline on, in m; 0 if it was never outside.
    pub farthest_outside: f64,
    /// Largest magnitude of each input before the arrival (in the whole run if there is none), in its unit.
    pub peak_to_arrival: [f64; 2],
    /// Largest norm of the input vector before the arrival; for the point mass, in m/s².
    pub peak_norm_to_arrival: f64,
    /// Largest magnitude of each input in the whole run, in its unit.
    pub peak: [f64; 2],
    /// Largest norm of the input vector in the whole run; for the point mass, in m/s².
    pub peak_norm: f64,
    /// Samples whose constraint was not met.
    pub unsatisfied: usize,
    /// Communication steps of the coupled system per second of wall time.
    pub steps_per_second: f64,
}

impl Summary {
    pub(super) fn new(case: &Case, recording: &Recording, steps_per_second: f64) -> Result<Self, Error> {
        let series = |name: &str| {
            recording.series(name).ok_or_else(|| Error::configuration(name, "is not in the recording"))
        };
        let input = |i: usize| series(&format!("filter.u.{}", case.vehicle.inputs()[i].name));
        let (h, status) = (series("filter.goal.h")?, series("filter.status")?);
        let (x, y) = (series("plant.x.x_p")?, series("plant.x.y_p")?);
        let u = [input(0)?, input(1)?];
        let mut outcome = Outcome::default();
        for (k, &t) in recording.times().iter().enumerate() {
            let sample = Measured {
                t,
                position: [x[k], y[k]],
                u: [u[0][k], u[1][k]],
                h: h[k],
                arrival: outcome.arrival.or((h[k] >= 0.0).then_some(t)),
                // The statuses unchanged (0) and filtered (1) satisfy every constraint.
                satisfied: status[k] <= 1.0,
            };
            outcome.take(&case.setup, &sample);
        }
        Ok(Self {
            arrival: outcome.arrival,
            min_h_after_deadline: outcome.least_h,
            farthest_outside: (-outcome.least_depth).max(0.0),
            peak_to_arrival: outcome.peak,
            peak_norm_to_arrival: outcome.longest,
            peak: outcome.whole_peak,
            peak_norm: outcome.whole_longest,
            unsatisfied: outcome.unmet,
            steps_per_second,
        })
    }

    /// Whether the state was inside by `deadline` (in s) and from then on.
    pub fn kept(&self, deadline: f64) -> bool {
        self.arrival.is_some_and(|t| t <= deadline) && self.min_h_after_deadline >= 0.0
    }
}
