//! One closed loop: a vehicle, a constraint and a start.

use std::time::Instant;

use punctual_core::elementary;
use punctual_core::filter::{Filter, Report};
use punctual_cosim::error::Error;
use punctual_reference::simulation::{Schedule, closed_loop_by};

use super::baseline::Baseline;
use super::cases::{CENTRE, RADIUS, Setup, Vehicle};

/// One sample of a loop.
pub struct Sample<'a> {
    /// Time in s.
    pub t: f64,
    /// The state.
    pub x: [f64; 4],
    /// The wanted input.
    pub u_ref: [f64; 2],
    /// The input.
    pub u: [f64; 2],
    /// The filter's report.
    pub report: &'a Report,
}

/// Result of a loop.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// First sample with h ≥ 0, in s.
    pub arrival: Option<f64>,
    /// Least h from the deadline on, in the unit of h.
    pub least_h: f64,
    /// Least R − d from the deadline on, in m.
    pub least_depth: f64,
    /// Largest |u_1| and |u_2| up to the arrival, or the end.
    pub peak: [f64; 2],
    /// Largest ‖u‖ up to the arrival, or the end.
    pub longest: f64,
    /// ∫‖u‖² dt up to the arrival, or the end.
    pub effort: f64,
    /// The same, to the end of the run.
    pub whole_effort: f64,
    /// Largest |u_1| and |u_2| of the whole run.
    pub whole_peak: [f64; 2],
    /// Largest ‖u‖ of the whole run.
    pub whole_longest: f64,
    /// Largest shortfall of h below its promised bound, up to the deadline, in the unit of h. For our method
    /// the bound is r + μ without the part of μ that compensation adds.
    pub shortfall: f64,
    /// The part of the margin that compensation adds, in the unit of h.
    pub added: f64,
    /// Samples whose constraint was not met.
    pub unmet: usize,
}

/// Measurements at a sample, for any kind of loop.
pub struct Measured {
    /// Time in s.
    pub t: f64,
    /// Position in m.
    pub position: [f64; 2],
    /// The input.
    pub u: [f64; 2],
    /// h in its unit.
    pub h: f64,
    /// First sample with h ≥ 0 so far, in s.
    pub arrival: Option<f64>,
    /// Whether the constraint was met.
    pub satisfied: bool,
}

impl Default for Outcome {
    /// The outcome before any sample.
    fn default() -> Self {
        Self {
            arrival: None,
            least_h: f64::INFINITY,
            least_depth: f64::INFINITY,
            peak: [0.0; 2],
            longest: 0.0,
            effort: 0.0,
            whole_effort: 0.0,
            whole_peak: [0.0; 2],
            whole_longest: 0.0,
            shortfall: 0.0,
            added: 0.0,
            unmet: 0,
        }
    }
}

impl Outcome {
    /// Adds the next sample of a loop that runs with `setup`.
    pub fn take(&mut self, setup: &Setup, sample: &Measured) {
        let Measured { t, position, u, h, .. } = *sample;
        let before = self.arrival.is_none();
        self.arrival = sample.arrival;
        for i in 0..2 {
            self.whole_peak[i] = self.whole_peak[i].max(u[i].abs());
        }
        self.whole_longest = self.whole_longest.max(elementary::hypot(u[0], u[1]));
        self.whole_effort += (u[0] * u[0] + u[1] * u[1]) * setup.step;
        // The arrival's own sample already counts as inside.
        if before && self.arrival.is_none() {
            (self.peak, self.longest, self.effort) = (self.whole_peak, self.whole_longest, self.whole_effort);
        }
        self.unmet += usize::from(!sample.satisfied);
        // Compares half a step early, so that round-off in t cannot skip the sample at the deadline.
        if t > setup.deadline - setup.step / 2.0 {
            // Not `f64::min`, which drops a NaN.
            let depth = RADIUS - elementary::hypot(position[0] - CENTRE[0], position[1] - CENTRE[1]);
            self.least_h = if h < self.least_h || h.is_nan() { h } else { self.least_h };
            self.least_depth =
                if depth < self.least_depth || depth.is_nan() { depth } else { self.least_depth };
        }
    }

    /// Whether it had arrived by `t`.
    pub fn by(&self, t: f64) -> bool {
        self.arrival.is_some_and(|arrival| arrival <= t + 1e-9)
    }

    /// Whether it was on time, and inside from the deadline on.
    pub fn kept(&self, deadline: f64) -> bool {
        self.by(deadline) && self.least_h >= 0.0
    }
}

/// Runs `vehicle` with `baseline` from `x0`; `observe` sees every sample.
///
/// # Errors
///
/// A parameter out of range.
pub fn observed(
    vehicle: Vehicle,
    baseline: Baseline,
    setup: &Setup,
    x0: [f64; 4],
    mut observe: impl FnMut(&Sample),
) -> Result<Outcome, Error> {
    let mut filter = baseline.filter(vehicle.source(setup.shape)?, setup).map_err(Error::from)?;
    let schedule =
        Schedule { step: setup.step, steps: (setup.end / setup.step).round() as usize, substeps: 1 };
    let mut out = Outcome::default();
    let u_ref = |x: &[f64; 4]| vehicle.reference(setup.nominal, x);
    closed_loop_by(
        &mut filter,
        |x, u, dt| vehicle.advance(setup.integrator, x, u, dt),
        x0,
        schedule,
        |_, x| u_ref(x),
        |t, x, u, report| {
            let b = &report.barriers[0];
            let sample = Measured {
                t,
                position: [x[0], x[1]],
                u: *u,
                h: b.h,
                arrival: b.arrival_time,
                satisfied: report.status.is_satisfied(),
            };
            out.take(setup, &sample);
            out.added = b.margin - setup.margin;
            if t < setup.deadline + setup.step / 2.0 && b.profile.is_finite() {
                out.shortfall = out.shortfall.max(b.profile - out.added - b.h);
            }
            observe(&Sample { t, x: *x, u_ref: u_ref(x), u: *u, report });
        },
    )
    .map_err(Error::from)?;
    Ok(out)
}

/// Like [`observed`], without an observer.
///
/// # Errors
///
/// As for [`observed`].
pub fn run(vehicle: Vehicle, baseline: Baseline, setup: &Setup, x0: [f64; 4]) -> Result<Outcome, Error> {
    observed(vehicle, baseline, setup, x0, |_| {})
}

/// Mean time in s of a filter's step, along the states of the loop from `x0`; the least of several passes.
///
/// # Errors
///
/// As for [`observed`].
pub fn seconds_per_step(
    vehicle: Vehicle,
    baseline: Baseline,
    setup: &Setup,
    x0: [f64; 4],
) -> Result<f64, Error> {
    const PASSES: usize = 7;
    let setup = Setup { end: setup.deadline, ..*setup };
    let mut samples = Vec::new();
    observed(vehicle, baseline, &setup, x0, |s| samples.push((s.t, s.x, s.u_ref)))?;
    let mut best = f64::INFINITY;
    for _ in 0..PASSES {
        let mut filter: Filter =
            baseline.filter(vehicle.source(setup.shape)?, &setup).map_err(Error::from)?;
        let mut u = [0.0; 2];
        let begin = Instant::now();
        for (t, x, u_ref) in &samples {
            filter.step(*t, x, u_ref, &mut u).map_err(Error::from)?;
        }
        std::hint::black_box(u);
        best = best.min(begin.elapsed().as_secs_f64() / samples.len() as f64);
    }
    Ok(best)
}
