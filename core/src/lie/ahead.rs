//! The state and the barrier's derivatives a moment ahead, under an input that is held.
//!
//! The classical Runge-Kutta method runs on dual numbers whose gradients are those along u. It gives the state x(t + σ)
//! after σ seconds, and its derivative by u. The series of h started there gives h⁽ᵏ⁾(t + σ) and its total derivative,
//!
//! ```math
//! \frac{\partial h^{(k)}(t+\sigma)}{\partial u}
//! = \frac{\partial h^{(k)}}{\partial x} \frac{\partial x(t+\sigma)}{\partial u} + \frac{\partial h^{(k)}}{\partial u},
//! \qquad k = 0 \dots n. \tag{4}
//! ```
//!
//! The error is the integrator's, O(σ⁵) over [`SUBSTEPS`] substeps. (4) is the exact derivative of what is computed, so
//! Newton's method on it converges quadratically.

use nalgebra::SVector;

use super::{COURSE, Course, Direction};
use crate::barrier::Barrier;
use crate::dynamics::{ControlAffine, rk4};
use crate::jet::{Dual, Tangent, Taylor};
use crate::scalar::{Scalar, all_finite};
use crate::{MAX_INPUTS, MAX_RELATIVE_DEGREE};

/// Runge-Kutta steps per prediction.
pub const SUBSTEPS: usize = 2;

/// Derivatives of one barrier a moment ahead along a held input, as plain numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ahead {
    /// `value[k]` = h⁽ᵏ⁾ at the end of the moment for k = 0 ..= n, in `[h]`/s^k; zeros above n.
    pub value: [f64; MAX_RELATIVE_DEGREE + 1],
    /// `gradient[k]` = its derivative with respect to the input held until then, in
    /// `[h]`/(s^k · unit of u); zeros above n and above the number of inputs.
    pub gradient: [[f64; MAX_INPUTS]; MAX_RELATIVE_DEGREE + 1],
}

impl Ahead {
    /// All zero.
    pub const ZERO: Self = Self {
        value: [0.0; MAX_RELATIVE_DEGREE + 1],
        gradient: [[0.0; MAX_INPUTS]; MAX_RELATIVE_DEGREE + 1],
    };

    /// Overwrites all with the derivatives of order 0, 1, …
    fn write<const NU: usize>(&mut self, derivatives: impl Iterator<Item = Dual<NU>>) {
        *self = Self::ZERO;
        for (k, derivative) in derivatives.enumerate() {
            self.value[k] = derivative.value;
            self.gradient[k][..NU].copy_from_slice(&derivative.gradient);
        }
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        all_finite(&self.value) & all_finite(self.gradient.as_flattened())
    }
}

/// The state `duration` seconds after `x` under the held input `u`, by `steps` ≥ 1 steps of the
/// classical Runge-Kutta method; as [`rk4_step`](crate::dynamics::rk4_step), for any scalar.
pub fn flow<P, S, const NX: usize, const NU: usize>(
    plant: &P,
    x: &SVector<S, NX>,
    u: &SVector<S, NU>,
    duration: f64,
    steps: usize,
) -> SVector<S, NX>
where
    P: ControlAffine<NX, NU>,
    S: Scalar,
{
    let dt = duration / steps as f64;
    let mut x = *x;
    for _ in 0..steps {
        x = rk4(|x| plant.derivative(x, u), &x, dt);
    }
    x
}

/// The series of h `duration` ≥ 0 seconds after `t` and `x` along the held input `u`, `K` = n + 1
/// coefficients.
fn series<P, B, S, const NX: usize, const NU: usize, const K: usize>(
    (plant, barrier): (&P, &B),
    (t, duration): (f64, f64),
    x: &SVector<S, NX>,
    u: &SVector<S, NU>,
) -> Taylor<S, K>
where
    P: ControlAffine<NX, NU>,
    B: Barrier<NX>,
    S: Scalar,
{
    let x = flow(plant, x, u, duration, SUBSTEPS);
    let held = SVector::<Taylor<S, K>, NU>::from_fn(|i, _| Taylor::constant(u[i]));
    let mut series = SVector::<Taylor<S, K>, NX>::from_fn(|i, _| Taylor::constant(x[i]));
    for k in 0..K - 1 {
        let dx = plant.derivative(&series, &held);
        for i in 0..NX {
            series[i].coefficients[k + 1] = dx[i].coefficients[k] * (1.0 / (k + 1) as f64);
        }
    }
    barrier.value(Taylor::time(t + duration), &series)
}

/// Writes the courses of the states from `x` on under the held input `u`: `J x_J = [f(x)]_{J−1} + [g(x)]_{J−1} u`. Once
/// for a plant, whatever the barriers: it is much code.
#[inline(never)]
pub(super) fn path<P, const NX: usize, const NU: usize>(
    plant: &P,
    x: &SVector<f64, NX>,
    u: &[f64],
    out: &mut [Course],
) where
    P: ControlAffine<NX, NU>,
{
    let mut path = SVector::<Taylor<f64, COURSE>, NX>::from_fn(|i, _| Taylor::constant(x[i]));
    macro_rules! extend_to {
        ($($j:literal),*) => {{
            const { assert!([$($j),*].len() == COURSE - 1, "an order each") };
            $({
                let known = SVector::<Taylor<f64, $j>, NX>::from_fn(|i, _| path[i].truncated());
                let (f, g) = (plant.drift(&known), plant.input_map(&known));
                for i in 0..NX {
                    let mut rate = f[i].coefficients[$j - 1];
                    for m in 0..NU {
                        rate += g[(i, m)].coefficients[$j - 1] * u[m];
                    }
                    path[i].coefficients[$j] = rate * (1.0 / f64::from($j));
                }
            })*
        }};
    }
    extend_to!(1, 2, 3, 4, 5, 6, 7, 8, 9);
    for (out, state) in out.iter_mut().zip(&path) {
        *out = state.coefficients;
    }
}

/// The course of `barrier` along `path`, from `t` on. Once for a barrier, whatever the plants and degrees.
#[inline(never)]
pub(super) fn value_along<B, const NX: usize>(barrier: &B, t: f64, path: &[Course]) -> Course
where
    B: Barrier<NX>,
{
    let states = SVector::<Taylor<f64, COURSE>, NX>::from_fn(|i, _| Taylor { coefficients: path[i] });
    barrier.value(Taylor::time(t), &states).coefficients
}

/// Evaluates (4) for `plant` and `barrier` from `x` at `t` under `u`, `duration` ≥ 0 seconds ahead;
/// `K` = n + 1.
pub(super) fn evaluate<P, B, const NX: usize, const NU: usize, const K: usize>(
    plant: &P,
    barrier: &B,
    time: (f64, f64),
    x: &SVector<f64, NX>,
    u: &[f64],
    out: &mut Ahead,
) where
    P: ControlAffine<NX, NU>,
    B: Barrier<NX>,
{
    let u = SVector::<Dual<NU>, NU>::from_fn(|i, _| Dual::variable(u[i], i));
    let x = SVector::<Dual<NU>, NX>::from_fn(|i, _| Dual::from(x[i]));
    let h: Taylor<_, K> = series((plant, barrier), time, &x, &u);
    out.write((0..K).map(|k| h.derivative(k)));
}

/// Writes the derivative of what [`evaluate`] writes, along `direction`.
pub(super) fn differentiate<P, B, const NX: usize, const NU: usize, const K: usize>(
    (plant, barrier): (&P, &B),
    time: (f64, f64),
    x: &[f64],
    u: &[f64],
    direction: Direction,
    out: &mut Ahead,
) where
    P: ControlAffine<NX, NU>,
    B: Barrier<NX>,
{
    let Direction { x: dx, u: du } = direction;
    type Second<const NU: usize> = Tangent<Dual<NU>>;
    let u = SVector::<Second<NU>, NU>::from_fn(|i, _| Tangent {
        value: Dual::variable(u[i], i),
        directional: Dual::from(du[i]),
    });
    let x = SVector::<Second<NU>, NX>::from_fn(|i, _| Tangent {
        value: Dual::from(x[i]),
        directional: Dual::from(dx[i]),
    });
    let h: Taylor<_, K> = series((plant, barrier), time, &x, &u);
    out.write((0..K).map(|k| h.derivative(k).directional));
}

/// Moves `x` by `duration` ≥ 0 seconds under the held input `u`, and the direction `dx` with it.
pub(super) fn flow_directional<P, const NX: usize, const NU: usize>(
    plant: &P,
    x: &mut [f64],
    dx: &mut [f64],
    u: &[f64],
    duration: f64,
) where
    P: ControlAffine<NX, NU>,
{
    let from = SVector::<Tangent<f64>, NX>::from_fn(|i, _| Tangent { value: x[i], directional: dx[i] });
    let held = SVector::<Tangent<f64>, NU>::from_fn(|i, _| Tangent::from(u[i]));
    let to = flow(plant, &from, &held, duration, SUBSTEPS);
    for i in 0..NX {
        (x[i], dx[i]) = (to[i].value, to[i].directional);
    }
}
