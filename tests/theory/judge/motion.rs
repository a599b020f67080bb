//! The judge's own integrator: Dormand–Prince of order 5 with adaptive steps.
//!
//! It shares nothing with the crate: the filter predicts with two Runge–Kutta steps of order 4 per period.

use super::model::{Input, Plant, State};

/// Tolerance of a step, relative to 1 + |x|: a thousandth of the size that counts as broken.
const TOLERANCE: f64 = 1e-12;
/// The most steps of one call. A state that needs more becomes NaN.
const STEPS: usize = 5000;

const STAGES: [&[f64]; 6] = [
    &[1.0 / 5.0],
    &[3.0 / 40.0, 9.0 / 40.0],
    &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
    &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
    &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
    &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
];
/// The weights of order 5 minus those of order 4.
const ERROR: [f64; 7] =
    [71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0];

/// The state `dt` seconds later under the held input.
pub(crate) fn advance(plant: &Plant, x: &State, u: &Input, dt: f64) -> State {
    if let Plant::Chain(n) | Plant::Written(n) = *plant {
        return polynomial(n, x, u[0], dt);
    }
    let (mut x, mut done, mut step) = (*x, 0.0, dt);
    for _ in 0..STEPS {
        let last = done + step >= dt;
        let taken = if last { dt - done } else { step };
        let (next, error) = one(plant, &x, u, taken);
        if !error.is_finite() {
            break;
        }
        if error <= 1.0 {
            x = next;
            if last {
                return x;
            }
            done += taken;
        }
        step = taken * (0.9 * error.max(1e-10).powf(-0.2)).clamp(0.2, 5.0);
    }
    [f64::NAN; 8]
}

/// Makes one step, and returns its error in units of the tolerance.
fn one(plant: &Plant, x: &State, u: &Input, dt: f64) -> (State, f64) {
    let n = plant.states();
    let mut rates = [plant.derivative(x, u); 7];
    let mut next = *x;
    for (stage, weights) in STAGES.iter().enumerate() {
        next = *x;
        for i in 0..n {
            let sum: f64 = weights.iter().zip(&rates).map(|(w, rate)| w * rate[i]).sum();
            next[i] += dt * sum;
        }
        rates[stage + 1] = plant.derivative(&next, u);
    }
    let mut worst = 0.0;
    for i in 0..n {
        let sum: f64 = ERROR.iter().zip(&rates).map(|(w, rate)| w * rate[i]).sum();
        let part = (dt * sum).abs() / (TOLERANCE * (1.0 + x[i].abs()));
        // Not `max`, which would hide a NaN.
        worst = if part > worst || part.is_nan() { part } else { worst };
    }
    (next, worst)
}

/// A chain of `n` integrators moves along a polynomial.
fn polynomial(n: usize, x: &State, input: f64, dt: f64) -> State {
    let mut next = *x;
    for i in 0..n {
        let mut value = input / (n - i) as f64 * dt;
        for j in (i + 1..n).rev() {
            value = (value + x[j]) * dt / (j - i) as f64;
        }
        next[i] = x[i] + value;
    }
    next
}

/// Compared with circles, for which the motion is known, turning by up to a hundred radians.
#[test]
fn the_integrator_turns_right() {
    for turning in [0.1, 3.0, 40.0, 1000.0] {
        let (v, dt) = (5.0, 0.1);
        let x = [1.0, 2.0, 0.5, v, 0.0, 0.0, 0.0, 0.0];
        let found = advance(&Plant::Unicycle, &x, &[0.0, turning], dt);
        let end: f64 = 0.5 + turning * dt;
        let wanted = [
            1.0 + v / turning * (end.sin() - 0.5_f64.sin()),
            2.0 - v / turning * (end.cos() - 0.5_f64.cos()),
        ];
        let error = (found[0] - wanted[0]).hypot(found[1] - wanted[1]);
        assert!(error < 1e-10, "{turning}: {found:?}, wanted {wanted:?}");
    }
    let found = advance(&Plant::Chain(3), &[1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0], &[6.0, 0.0], 2.0);
    assert_eq!(found[..3], [1.0 + 4.0 + 6.0 + 8.0, 2.0 + 6.0 + 12.0, 3.0 + 12.0]);
}
