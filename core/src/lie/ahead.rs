//! The state and the barrier's derivatives a moment ahead, under a held input.
//!
//! The classical Runge-Kutta method runs on numbers that carry their derivatives along u. It gives the state x(t + σ) after
//! σ seconds, and its derivative with respect to u. The series of h started there gives h⁽ᵏ⁾(t + σ) and its total
//! derivative,
//!
//! ```math
//! \frac{\partial h^{(k)}(t+\sigma)}{\partial u}
//! = \frac{\partial h^{(k)}}{\partial x} \frac{\partial x(t+\sigma)}{\partial u} + \frac{\partial h^{(k)}}{\partial u},
//! \qquad k = 0 \dots n. \tag{4}
//! ```
//!
//! The error is the integrator's, O(σ⁵). One step suffices if the rate of the state is hardly curved over it ([`EVEN`]);
//! otherwise [`SUBSTEPS`] are taken. (4) is the exact derivative of what is computed, so Newton's method on it converges
//! quadratically.

use core::array::from_fn;

use super::{Direction, EXPANSION_ORDERS, Expansion, ExpansionOver, RateOver, enclosure};
use crate::barrier::Barrier;
use crate::dynamics::{ControlAffine, first, rk4};
use crate::interval::Interval;
use crate::jet::{Dual, Tangent, Taylor};
use crate::scalar::{Scalar, all_finite};
use crate::{MAX_INPUTS, MAX_RELATIVE_DEGREE};

/// Runge-Kutta steps per prediction.
pub const SUBSTEPS: usize = 2;

/// Derivatives of one barrier a moment ahead under a held input, as plain numbers.
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
    x: &[S; NX],
    u: &[S; NU],
    duration: f64,
    steps: usize,
) -> [S; NX]
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

/// Largest curvature of the rates over one Runge-Kutta step, as a part of a rate, for which one step suffices.
const EVEN: f64 = 4e-4;

/// Weight of the difference of the two middle stages in the curvature, beside the second difference of all stages.
///
/// If a state turns by φ as other states grow linearly, the middle stages agree, the second difference is φ²/4 and the error
/// of the step is φ⁴/2880 of the distance. If a state decays by the factor e⁻ᶻ, both are z²/4 and the error is z⁴/120. Both
/// are 1e-9 where the curvature is [`EVEN`]; the error of two steps is a sixteenth of that.
const MIDDLE: f64 = 3.0;

/// Largest size with which a rate counts, in units of its own curvature, when curvatures are compared with the largest rate.
/// Rates of different states have different units, and one that is constant shows nothing of the others: the path of a
/// vehicle is not straight because the vehicle spins at a constant rate.
const COUNTS: f64 = 1e6;

/// Whether the rates at the four stages of a Runge-Kutta step, state by state, are curved so little that one step suffices.
#[cfg_attr(not(feature = "small"), inline(always))]
pub fn is_even<S: Scalar>([k1, k2, k3, k4]: [&[S]; 4]) -> bool {
    let (mut most, mut largest) = (0.0_f64, 0.0_f64);
    for (((k1, k2), k3), k4) in k1.iter().zip(k2).zip(k3).zip(k4) {
        let [k1, k2, k3, k4] = [k1, k2, k3, k4].map(|k| k.value());
        let curvature = (k1 - k2 - k3 + k4).abs() + MIDDLE * (k2 - k3).abs();
        most = most.max(curvature);
        largest = largest.max(k1.abs().max(k4.abs()).min(COUNTS * curvature));
    }
    most <= EVEN * largest
}

/// The rates of the states as numbers that carry derivatives along u: f(x) + g(x) u, by the product rule. `x` carries its
/// own.
#[cfg_attr(not(feature = "small"), inline(always))]
fn rate<P, const NX: usize, const NU: usize>(plant: &P, x: &[Dual<NU>; NX], u: &[f64; NU]) -> [Dual<NU>; NX]
where
    P: ControlAffine<NX, NU>,
{
    let (mut rate, g) = (plant.drift(x), plant.input_map(x));
    for m in 0..NU {
        for i in 0..NX {
            // The compiler knows what is constantly zero or one.
            let Dual { value, gradient } = &g[i][m];
            if *value != 0.0 {
                rate[i].value += value * u[m];
                rate[i].gradient[m] += value;
            }
            for (sum, d) in rate[i].gradient.iter_mut().zip(gradient) {
                if *d != 0.0 {
                    *sum += d * u[m];
                }
            }
        }
    }
    rate
}

/// The stages of one Runge-Kutta step of `duration`, from the first on.
#[cfg_attr(not(feature = "small"), inline(always))]
fn stages<S, const NX: usize>(
    rate: &impl Fn(&[S; NX]) -> [S; NX],
    x: &[S; NX],
    k1: &[S; NX],
    duration: f64,
) -> [[S; NX]; 4]
where
    S: Scalar,
{
    let moved = |k: &[S; NX], by: f64| {
        let mut moved = *x;
        for i in 0..NX {
            moved[i] += k[i] * by;
        }
        moved
    };
    let k2 = rate(&moved(k1, duration / 2.0));
    let k3 = rate(&moved(&k2, duration / 2.0));
    let k4 = rate(&moved(&k3, duration));
    [*k1, k2, k3, k4]
}

/// The state after the Runge-Kutta step of those stages.
#[cfg_attr(not(feature = "small"), inline(always))]
fn stepped<S, const NX: usize>(x: &[S; NX], [k1, k2, k3, k4]: &[[S; NX]; 4], duration: f64) -> [S; NX]
where
    S: Scalar,
{
    let mut stepped = *x;
    for i in 0..NX {
        stepped[i] += (k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i]) * (duration / 6.0);
    }
    stepped
}

/// The state `duration` seconds after `x`, at which the rate is `k1`: by one Runge-Kutta step if that suffices, otherwise by
/// [`SUBSTEPS`].
#[cfg_attr(not(feature = "small"), inline(always))]
fn run<S, const NX: usize>(
    rate: impl Fn(&[S; NX]) -> [S; NX],
    x: &[S; NX],
    k1: &[S; NX],
    duration: f64,
) -> [S; NX]
where
    S: Scalar,
{
    let whole = stages(&rate, x, k1, duration);
    if is_even(whole.each_ref().map(|k| k.as_slice())) {
        return stepped(x, &whole, duration);
    }
    run_in_parts(&rate, x, k1, duration)
}

/// The same by [`SUBSTEPS`], separate from the code for short periods.
#[inline(never)]
fn run_in_parts<S, const NX: usize>(
    rate: &impl Fn(&[S; NX]) -> [S; NX],
    x: &[S; NX],
    k1: &[S; NX],
    duration: f64,
) -> [S; NX]
where
    S: Scalar,
{
    let part = duration / SUBSTEPS as f64;
    let (mut x, mut k1) = (*x, *k1);
    for i in 0..SUBSTEPS {
        if i > 0 {
            k1 = rate(&x);
        }
        x = stepped(&x, &stages(rate, &x, &k1, part), part);
    }
    x
}

/// The state `duration` ≥ 0 seconds after `x` under the held input `u`, with its derivatives along u. Compiled once per
/// plant, whatever the barriers.
#[inline(never)]
fn arrival<P, const NX: usize, const NU: usize>(
    plant: &P,
    x: &[f64; NX],
    u: &[f64; NU],
    duration: f64,
) -> [Dual<NU>; NX]
where
    P: ControlAffine<NX, NU>,
{
    let from = from_fn::<Dual<NU>, NX, _>(|i| Dual::from(x[i]));
    if duration == 0.0 {
        return from;
    }
    // The first stage depends on u through g(x) alone.
    let (f, g) = (plant.drift(x), plant.input_map(x));
    let k1 = from_fn::<Dual<NU>, NX, _>(|i| Dual {
        value: (0..NU).fold(f[i], |sum, m| if g[i][m] == 0.0 { sum } else { sum + g[i][m] * u[m] }),
        gradient: from_fn(|m| g[i][m]),
    });
    run(|x| rate(plant, x, u), &from, &k1, duration)
}

/// [`arrival`] without derivatives.
#[inline(never)]
fn arrival_alone<P, const NX: usize, const NU: usize>(
    plant: &P,
    x: &[f64; NX],
    u: &[f64; NU],
    duration: f64,
) -> [f64; NX]
where
    P: ControlAffine<NX, NU>,
{
    if duration == 0.0 {
        return *x;
    }
    let rate = |x: &[f64; NX]| plant.derivative(x, u);
    run(rate, x, &rate(x), duration)
}

/// The series of the states from `x` under the held input `u`, `K` coefficients.
#[cfg_attr(not(feature = "small"), inline(always))]
fn series<P, S, const NX: usize, const NU: usize, const K: usize>(
    plant: &P,
    x: &[S; NX],
    u: &[S; NU],
) -> [Taylor<S, K>; NX]
where
    P: ControlAffine<NX, NU>,
    S: Scalar,
{
    const { assert!(K <= MAX_RELATIVE_DEGREE + 1, "orders 1 to 8 are spelled out below") };
    // In place, since the compiler moves what a closure makes.
    let mut series = [Taylor { coefficients: [S::zero(); K] }; NX];
    for i in 0..NX {
        series[i].coefficients[0] = x[i];
    }
    macro_rules! extend_to {
        ($($j:literal),*) => {
            $(if const { $j < K } {
                // Every series is cut off after its last known coefficient.
                let known = from_fn::<Taylor<S, $j>, NX, _>(|i| Taylor {
                    coefficients: from_fn(|k| series[i].coefficients[k]),
                });
                let (f, g) = (plant.drift(&known), plant.input_map(&known));
                for i in 0..NX {
                    let mut rate = f[i].coefficients[$j - 1];
                    for m in 0..NU {
                        let g = g[i][m].coefficients[$j - 1];
                        if !g.is_zero() {
                            rate += g * u[m];
                        }
                    }
                    series[i].coefficients[$j] = rate * (1.0 / f64::from($j));
                }
            })*
        };
    }
    extend_to!(1, 2, 3, 4, 5, 6, 7, 8);
    series
}

/// The expansions of the states from `x` under the held input `u`: `J x_J = [f(x)]_{J−1} + [g(x)]_{J−1} u`. Compiled
/// once per plant, whatever the barriers, since it is much code.
#[inline(never)]
pub(super) fn path<P, const NX: usize, const NU: usize>(
    plant: &P,
    x: &[f64; NX],
    u: &[f64],
) -> [Expansion; NX]
where
    P: ControlAffine<NX, NU>,
{
    let mut path = from_fn::<Taylor<f64, EXPANSION_ORDERS>, NX, _>(|i| Taylor::constant(x[i]));
    macro_rules! extend_to {
        ($($j:literal),*) => {{
            const { assert!([$($j),*].len() == EXPANSION_ORDERS - 1, "an order each") };
            $({
                let known = from_fn::<Taylor<f64, $j>, NX, _>(|i| path[i].truncated());
                let (f, g) = (plant.drift(&known), plant.input_map(&known));
                for i in 0..NX {
                    let mut rate = f[i].coefficients[$j - 1];
                    for m in 0..NU {
                        rate += g[i][m].coefficients[$j - 1] * u[m];
                    }
                    path[i].coefficients[$j] = rate * (1.0 / f64::from($j));
                }
            })*
        }};
    }
    extend_to!(1, 2, 3, 4, 5, 6, 7, 8, 9);
    path.map(|state| state.coefficients)
}

/// The expansion of `barrier` along `path`, starting at `t`. Compiled once per barrier, whatever the plants and degrees.
#[inline(never)]
pub(super) fn value_along<B, const NX: usize>(barrier: &B, t: f64, path: &[Expansion]) -> Expansion
where
    B: Barrier<NX>,
{
    let states = from_fn::<Taylor<f64, EXPANSION_ORDERS>, NX, _>(|i| Taylor { coefficients: path[i] });
    barrier.value(Taylor::time(t), &states).coefficients
}

/// The first `K` coefficients of the expansions of the states.
#[cfg_attr(not(feature = "small"), inline(always))]
fn first_over<const NX: usize, const K: usize>(path: &[ExpansionOver]) -> [Taylor<Interval, K>; NX] {
    from_fn(|i| Taylor { coefficients: from_fn(|k| path[i][k]) })
}

/// Writes the first `K` coefficients of the rate of `plant` under `u` on enclosures of the expansions of the states.
/// Compiled once per plant.
#[inline(never)]
pub(super) fn rates_over<P, const NX: usize, const NU: usize, const K: usize>(
    plant: &P,
    path: &[ExpansionOver],
    u: &[f64],
    out: &mut [RateOver],
) where
    P: ControlAffine<NX, NU>,
{
    let states = first_over::<NX, K>(path);
    let (f, g) = (plant.drift(&states), plant.input_map(&states));
    for (i, out) in out.iter_mut().enumerate() {
        for (k, out) in out.iter_mut().enumerate().take(K) {
            let driven = u.iter().enumerate().map(|(m, &u)| g[i][m].coefficients[k] * u);
            *out = driven.fold(f[i].coefficients[k], |sum, term| sum + term);
        }
    }
}

/// `barrier` on enclosures of time and of the expansions of the states. Compiled once per barrier.
#[inline(never)]
pub(super) fn value_over<B, const NX: usize>(barrier: &B, time: Interval, path: &[ExpansionOver]) -> Interval
where
    B: Barrier<NX>,
{
    barrier.value(time, &from_fn(|i| path[i][0]))
}

/// The last coefficient of the expansion of `barrier` on enclosures of time and of those of the states. Compiled once per
/// barrier.
#[inline(never)]
pub(super) fn last_over<B, const NX: usize>(barrier: &B, time: Interval, path: &[ExpansionOver]) -> Interval
where
    B: Barrier<NX>,
{
    let states = first_over::<NX, EXPANSION_ORDERS>(path);
    barrier.value(time_over(time), &states).coefficients[EXPANSION_ORDERS - 1]
}

/// Time as an expansion that starts anywhere in `time`.
#[cfg_attr(not(feature = "small"), inline(always))]
fn time_over<const K: usize>(time: Interval) -> Taylor<Interval, K> {
    let mut expansion = Taylor::time(0.0);
    expansion.coefficients[0] = time;
    expansion
}

/// A lower bound on h until `dt` s after `t` and `x` under the held input `u`, sharpened if it would be less than `wanted`.
#[inline(never)]
pub(super) fn lowest_held<P, B, const NX: usize, const NU: usize>(
    (plant, barrier): (&P, &B),
    (t, dt): (f64, f64),
    x: &[f64; NX],
    u: &[f64],
    wanted: f64,
) -> f64
where
    P: ControlAffine<NX, NU>,
    B: Barrier<NX>,
{
    let u = first::<f64, NU>(u);
    let mut states = [[Interval::ALL; 2]; NX];
    let known = enclosure::enclose(x, dt, &plant.derivative(x, &u), &mut states, |states| {
        let over = from_fn::<_, NX, _>(|i| states[i][0]);
        let (f, g) = (plant.drift(&over), plant.input_map(&over));
        for (i, [_, rate]) in states.iter_mut().enumerate() {
            let inputs = (0..NU).filter(|m| g[i][*m] != Interval::from(0.0));
            *rate = inputs.fold(f[i], |sum, m| sum + g[i][m] * u[m]);
        }
    });
    if !known {
        return f64::NEG_INFINITY;
    }
    let time = Interval::new(t, t + dt);
    let low = barrier.value(time, &from_fn(|i| states[i][0])).low;
    if low >= wanted {
        return low;
    }
    let expansion = from_fn::<_, NX, _>(|i| Taylor { coefficients: states[i] });
    let slope = barrier.value(time_over::<2>(time), &expansion).coefficients[1];
    enclosure::sharper(low, barrier.value(t, x), slope, dt)
}

/// The series of the states from [`arrival`] under the held input `u`, `K` coefficients, with their derivatives along u.
#[cfg_attr(not(feature = "small"), inline(always))]
pub(super) fn motion<P, const NX: usize, const NU: usize, const K: usize>(
    plant: &P,
    x: &[f64; NX],
    u: &[f64],
    duration: f64,
) -> [Taylor<Dual<NU>, K>; NX]
where
    P: ControlAffine<NX, NU>,
{
    let held: [f64; NU] = from_fn(|i| u[i]);
    let x = arrival(plant, x, &held, duration);
    series(plant, &x, &from_fn(|i| Dual::variable(held[i], i)))
}

/// Evaluates (4) for `barrier` at time `t` along the [`motion`] from there, for k < `K`. Leaves the rest of `out` as it is.
#[cfg_attr(not(feature = "small"), inline(always))]
pub(super) fn evaluate<B, const NX: usize, const NU: usize, const K: usize>(
    barrier: &B,
    t: f64,
    motion: &[Taylor<Dual<NU>, K>; NX],
    out: &mut Ahead,
) where
    B: Barrier<NX>,
{
    let h = barrier.value(Taylor::time(t), motion);
    for k in 0..K {
        let Dual { value, gradient } = h.derivative(k);
        out.value[k] = value;
        out.gradient[k][..NU].copy_from_slice(&gradient);
    }
}

/// Only the values that [`evaluate`] writes. Leaves the rest of `out` as it is.
#[inline]
pub(super) fn values<P, B, const NX: usize, const NU: usize, const K: usize>(
    (plant, barrier): (&P, &B),
    (t, duration): (f64, f64),
    x: &[f64; NX],
    u: &[f64],
    out: &mut [f64],
) where
    P: ControlAffine<NX, NU>,
    B: Barrier<NX>,
{
    let u = first::<f64, NU>(u);
    let x = arrival_alone(plant, x, &u, duration);
    let h: Taylor<_, K> = barrier.value(Taylor::time(t + duration), &series(plant, &x, &u));
    for (k, out) in out[..K].iter_mut().enumerate() {
        *out = h.derivative(k);
    }
}

/// Writes the derivative of what [`evaluate`] writes, along `direction`.
pub(super) fn differentiate<P, B, const NX: usize, const NU: usize, const K: usize>(
    (plant, barrier): (&P, &B),
    (t, duration): (f64, f64),
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
    let u = from_fn::<Second<NU>, NU, _>(|i| Tangent {
        value: Dual::variable(u[i], i),
        directional: Dual::from(du[i]),
    });
    let x =
        from_fn::<Second<NU>, NX, _>(|i| Tangent { value: Dual::from(x[i]), directional: Dual::from(dx[i]) });
    let x = flow(plant, &x, &u, duration, SUBSTEPS);
    let h: Taylor<_, K> = barrier.value(Taylor::time(t + duration), &series(plant, &x, &u));
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
    let from = from_fn::<Tangent<f64>, NX, _>(|i| Tangent { value: x[i], directional: dx[i] });
    let held = from_fn::<Tangent<f64>, NU, _>(|i| Tangent::from(u[i]));
    let to = flow(plant, &from, &held, duration, SUBSTEPS);
    for i in 0..NX {
        (x[i], dx[i]) = (to[i].value, to[i].directional);
    }
}
