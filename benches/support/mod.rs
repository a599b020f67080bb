//! The cases of the benchmarks, and the same step written by hand.

#![allow(dead_code, reason = "each benchmark uses a part")]

pub(crate) mod sources;

use std::array::from_fn;

use punctual_core::barriers::{DistanceDisc, Outside};
use punctual_core::convergence::{FixedTime, FixedTimeSettings, FixedTimeState};
use punctual_core::dynamics::{ControlAffine, rk4_step};
use punctual_core::filter::{BarrierSettings, Filter, FilterBuilder, FilterState, Sampling};
use punctual_core::plants::PointMass;
use punctual_core::scalar::Scalar;

/// A time and state at which the row is active after anchoring at the origin at time 0.
pub(crate) const T: f64 = 4.0;
pub(crate) const X: [f64; 4] = [15.0, 15.5, 0.8, 6.0];
pub(crate) const DEADLINE: f64 = 10.0;
/// A reference input at [`X`] that every row allows.
pub(crate) const SAFE: [f64; 2] = [30.0, 30.0];

const CENTRE: [f64; 2] = [45.0, 45.0];
const RADIUS: f64 = 2.0;
const SMOOTHING: f64 = 2.0;

pub(crate) fn disc() -> DistanceDisc {
    DistanceDisc::new(CENTRE, RADIUS, SMOOTHING).expect("valid disc")
}

/// One goal, reached within [`DEADLINE`]; the constraint at the samples only.
pub(crate) fn goal<P>(plant: P) -> FilterBuilder
where
    P: ControlAffine<4, 2> + Send + Sync + 'static,
{
    headed(plant).erased()
}

/// [`goal`], to which barriers can be added.
pub(crate) fn headed<P>(plant: P) -> FilterBuilder<P, 4, 2>
where
    P: ControlAffine<4, 2> + Send + Sync + 'static,
{
    Filter::builder(plant)
        .barrier("goal", disc(), BarrierSettings::within(DEADLINE))
        .and_then(|b| b.sampling(Sampling::Pointwise))
        .expect("valid settings")
}

/// The goal of a point mass and `obstacles` discs beside its way.
pub(crate) fn goal_and_obstacles(obstacles: usize) -> FilterBuilder {
    obstructed(PointMass, obstacles)
}

/// The goal of `plant` and `obstacles` discs beside its way.
pub(crate) fn obstructed<P>(plant: P, obstacles: usize) -> FilterBuilder
where
    P: ControlAffine<4, 2> + Copy + Send + Sync + 'static,
{
    let all = (0..obstacles).fold(headed(plant), |builder, i| {
        let (column, line) = ((i % 10) as f64, (i / 10) as f64);
        let disc = DistanceDisc::new([-20.0 + 8.0 * column, 60.0 + 8.0 * line], RADIUS, SMOOTHING);
        let obstacle = Outside(disc.expect("valid disc"));
        builder
            .barrier(&format!("obstacle {i}"), obstacle, BarrierSettings::within(DEADLINE))
            .expect("valid settings")
    });
    all.erased()
}

/// The filter, anchored at rest at the origin at time 0.
pub(crate) fn anchored(builder: FilterBuilder) -> Filter {
    let mut filter = builder.build().expect("valid filter");
    filter.step(0.0, &[0.0; 4], &[0.0; 2], &mut [0.0; 2]).expect("right dimensions");
    filter
}

/// A closed loop that was recorded and is stepped through again and again: samples of which each has the input of the one
/// before behind it.
pub(crate) struct Drive {
    filter: Filter,
    begin: FilterState,
    samples: Vec<(f64, [f64; 4])>,
    next: usize,
}

impl Drive {
    /// Samples of a round.
    pub(crate) const SAMPLES: u32 = 50;

    /// The loop of a filter and `plant` at the `period` (s), without the first samples, in which the period is measured.
    pub(crate) fn recorded<P: ControlAffine<4, 2>>(builder: FilterBuilder, plant: &P, period: f64) -> Self {
        const FIRST: usize = 5;
        let mut filter = builder.build().expect("valid filter");
        let (mut x, mut u) = ([0.0, 0.0, X[2], X[3]], [0.0; 2]);
        let (mut begin, mut samples) = (filter.state().clone(), Vec::new());
        for k in 0..FIRST + Self::SAMPLES as usize {
            if k == FIRST {
                begin = filter.state().clone();
            }
            let t = period * k as f64;
            if k >= FIRST {
                samples.push((t, x));
            }
            filter.step(t, &x, &[0.0; 2], &mut u).expect("right dimensions");
            x = rk4_step(plant, &x, &u, period);
        }
        filter.restore(&begin).expect("its own state");
        Self { filter, begin, samples, next: 0 }
    }

    /// The next sample.
    pub(crate) fn step(&mut self) -> [f64; 2] {
        let (t, x) = self.samples[self.next];
        let mut u = [0.0; 2];
        self.filter.step(t, &x, &[0.0; 2], &mut u).expect("right dimensions");
        self.next += 1;
        if self.next == self.samples.len() {
            self.next = 0;
            self.filter.restore(&self.begin).expect("its own state");
        }
        u
    }
}

/// A promise for relative degree `n` with its state on the way, and derivatives of h there.
pub(crate) fn promise(n: usize) -> (FixedTime, FixedTimeState, [f64; 8]) {
    let promise = FixedTime::new(n, FixedTimeSettings::within(DEADLINE)).expect("valid settings");
    let h = [-30.0, 4.0, 0.3, 0.1, 0.05, 0.1, -0.2, 0.3];
    let mut state = FixedTimeState::default();
    promise.advance(&mut state, 0.0, &h[..n]);
    (promise, state, h)
}

/// A point mass in the plane behind integrators: pairs (position, velocity, …) and the last
/// derivative as input. The relative degree of a barrier on the position is `NX`/2.
#[derive(Clone, Copy)]
pub(crate) struct Integrators<const NX: usize>;

impl<const NX: usize> Integrators<NX> {
    /// A state on the way to the disc.
    pub(crate) fn state() -> [f64; NX] {
        from_fn(|i| if i < 4 { X[i] } else { 0.3 - 0.05 * i as f64 })
    }
}

impl<const NX: usize> ControlAffine<NX, 2> for Integrators<NX> {
    #[inline]
    fn drift<S: Scalar>(&self, x: &[S; NX]) -> [S; NX] {
        from_fn(|i| if i + 2 < NX { x[i + 2] } else { S::zero() })
    }

    #[inline]
    fn input_map<S: Scalar>(&self, _x: &[S; NX]) -> [[S; 2]; NX] {
        from_fn(|i| from_fn(|j| if i + 2 == NX + j { S::one() } else { S::zero() }))
    }
}

/// The computation of [`goal`] with [`PointMass`], by hand: derivatives of one barrier, one profile of order 2,
/// one row.
pub(crate) struct ByHand {
    anchor: [f64; 2],
    rate: f64,
}

impl ByHand {
    /// The filter anchored at rest at the origin at time 0.
    pub(crate) fn anchored() -> Self {
        let (h, dh, _, _) = Self::derivatives(&[0.0; 4]);
        Self { anchor: [h, dh], rate: FixedTimeSettings::default_rate(DEADLINE, 0.0) }
    }

    /// h, ḣ, ḧ at u = 0 and ∂ḧ/∂u.
    #[inline]
    fn derivatives(x: &[f64; 4]) -> (f64, f64, f64, [f64; 2]) {
        let away = [x[0] - CENTRE[0], x[1] - CENTRE[1]];
        let root = (away[0] * away[0] + away[1] * away[1] + SMOOTHING * SMOOTHING).sqrt();
        let per_root = 1.0 / root;
        let normal = [-away[0] * per_root, -away[1] * per_root];
        let dh = normal[0] * x[2] + normal[1] * x[3];
        let ddh = (dh * dh - x[2] * x[2] - x[3] * x[3]) * per_root;
        (RADIUS.hypot(SMOOTHING) - root, dh, ddh, normal)
    }

    /// The safe input.
    pub(crate) fn step(&self, t: f64, x: &[f64; 4], u_ref: &[f64; 2]) -> [f64; 2] {
        let (h, dh, ddh, a) = Self::derivatives(x);
        let ([h0, dh0], rate) = (self.anchor, self.rate);
        let [mut r, mut dr, mut ddr] = [0.0; 3];
        if t < DEADLINE {
            let s = t / DEADLINE;
            let left = 1.0 - s;
            r = left * left * (h0 * (1.0 + 2.0 * s) + dh0 * DEADLINE * s);
            dr = left * (dh0 * (1.0 - 3.0 * s) - h0 * 6.0 * s / DEADLINE);
            ddr = (h0 * (12.0 * s - 6.0) / DEADLINE + dh0 * (6.0 * s - 4.0)) / DEADLINE;
        }
        let floor = ddr - rate * (2.0 * (dh - dr) + rate * (h - r)) - ddh;
        let missing = floor - (a[0] * u_ref[0] + a[1] * u_ref[1]);
        if missing <= 0.0 {
            return *u_ref;
        }
        let multiplier = missing / (a[0] * a[0] + a[1] * a[1]);
        [u_ref[0] + multiplier * a[0], u_ref[1] + multiplier * a[1]]
    }
}
