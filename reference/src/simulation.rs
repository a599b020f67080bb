//! Closed loops in process, for studies and tests: a filter and a plant integrated by RK4, with held inputs.

use punctual_core::dynamics::{ControlAffine, rk4_step};
use punctual_core::error::{Error, positive};
use punctual_core::filter::{Filter, Report};

/// Step size and length of a closed-loop run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    /// Sampling period in s, finite, > 0; the input is held over it.
    pub step: f64,
    /// Number of sampling periods.
    pub steps: usize,
    /// Runge-Kutta steps per sampling period, ≥ 1.
    pub substeps: usize,
}

/// Runs `filter` and `plant` in closed loop from `x0` at time 0. At every sample, `nominal(t, x)` gives
/// u_ref, and `observe(t, x, u, report)` sees the result before the plant moves. It is called once more at
/// the end. Sample k is at time k · step.
///
/// # Errors
///
/// A step that is not finite or ≤ 0, and misuse of the filter.
pub fn closed_loop<P, const NX: usize, const NU: usize>(
    filter: &mut Filter,
    plant: &P,
    x0: [f64; NX],
    schedule: Schedule,
    nominal: impl FnMut(f64, &[f64; NX]) -> [f64; NU],
    observe: impl FnMut(f64, &[f64; NX], &[f64; NU], &Report),
) -> Result<(), Error>
where
    P: ControlAffine<NX, NU>,
{
    closed_loop_by(filter, |x, u, dt| rk4_step(plant, x, u, dt), x0, schedule, nominal, observe)
}

/// Like [`closed_loop`], but the plant moves by `advance(x, u, dt)` over `dt` seconds, which allows other
/// integrators.
///
/// # Errors
///
/// As for [`closed_loop`].
pub fn closed_loop_by<const NX: usize, const NU: usize>(
    filter: &mut Filter,
    mut advance: impl FnMut(&[f64; NX], &[f64; NU], f64) -> [f64; NX],
    x0: [f64; NX],
    schedule: Schedule,
    mut nominal: impl FnMut(f64, &[f64; NX]) -> [f64; NU],
    mut observe: impl FnMut(f64, &[f64; NX], &[f64; NU], &Report),
) -> Result<(), Error> {
    let step = positive("step", schedule.step)?;
    let substeps = schedule.substeps.max(1);
    let dt = step / substeps as f64;
    let mut x = x0;
    let mut u = [0.0; NU];
    for k in 0..=schedule.steps {
        let t = k as f64 * step;
        let u_ref = nominal(t, &x);
        let report = filter.step(t, &x, &u_ref, &mut u)?;
        observe(t, &x, &u, report);
        if k < schedule.steps {
            for _ in 0..substeps {
                x = advance(&x, &u, dt);
            }
        }
    }
    Ok(())
}
