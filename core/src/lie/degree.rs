//! Which derivative of a barrier the inputs enter first.
//!
//! A constraint built for relative degree n needs every input that reaches h to enter h⁽ⁿ⁾ and none
//! to enter an earlier derivative. An input that never enters is harmless (the steering of a vehicle
//! does not act on a speed limit). Inputs that enter at *different* orders are not: one row on h⁽ⁿ⁾
//! with the lower n uses only the input that comes first, with the higher n it is wrong.
//!
//! The orders are read off the gradients of [`barrier_series`] at sample states. A sample may lie
//! where a gradient vanishes by accident (the centre of a disc, standing still), so where an order is
//! not the lowest found, two neighbours of the sample are asked as well.

use std::array::from_fn;

use nalgebra::SVector;

use super::barrier_series;
use crate::MAX_RELATIVE_DEGREE;
use crate::barrier::Barrier;
use crate::dynamics::ControlAffine;
use crate::error::{Error, ErrorKind, RelativeDegree};
use crate::jet::Response;

/// Number of Taylor coefficients taken: every order that is supported.
const K: usize = MAX_RELATIVE_DEGREE + 1;

/// An input counts where the gradient of a Taylor coefficient, scaled by the time scale of h along the
/// drift, exceeds this part of the largest: far above round-off, far below a real effect.
const SIGNIFICANT: f64 = 1e-12;

/// Number of sample states of [`detected`].
const SAMPLES: usize = 16;

/// The largest part of samples that may have another order than the rest and be passed over: 1 in 8.
const PASSED_OVER: usize = 8;

impl RelativeDegree {
    /// n, if it is uniform and equals `declared` where that is given.
    ///
    /// # Errors
    ///
    /// [`ErrorKind::RelativeDegree`] otherwise, with the finding behind
    /// [`Error::relative_degree`].
    pub fn require(self, declared: Option<usize>) -> Result<usize, Error> {
        let advice = match (&self, declared) {
            (&Self::Uniform(n), None) => return Ok(n),
            (&Self::Uniform(n), Some(d)) if n == d => return Ok(n),
            (Self::Mixed(_), _) => {
                "; one constraint cannot use both, so put an integrator before the input that enters first \
                 (dynamics::IntegratedInput)"
            }
            (Self::NotFinite, _) => "; give samples of your own",
            _ => "",
        };
        let found = self.describe(|i| format!("u[{}]", i + 1));
        let declared = declared.map(|d| format!(", declared is {d}")).unwrap_or_default();
        let error =
            Error::new(ErrorKind::RelativeDegree, "relative_degree", format!("{found}{declared}{advice}"));
        Err(error.with_relative_degree(self))
    }
}

/// The relative degree of `barrier` along `plant`, found at time `t` (s) and the states `samples`.
/// Samples at which the model is not finite are passed over.
///
/// ```
/// use punctual_core::barriers::DistanceDisc;
/// use punctual_core::lie::{RelativeDegree, relative_degree};
/// use punctual_core::nalgebra::{self, vector};
/// use punctual_core::plants::{SmallSlipBicycle, Unicycle};
///
/// let disc = DistanceDisc::new([45.0, 45.0], 2.0, 2.0)?;
/// let x = [vector![1.0, 2.0, 0.3, 4.0]];
/// assert_eq!(relative_degree(&Unicycle, &disc, 0.0, &x), RelativeDegree::Uniform(2));
/// // Acceleration enters the second derivative of a distance, the slip angle already the first.
/// let bicycle = SmallSlipBicycle::new(10.0)?;
/// let mixed = RelativeDegree::Mixed(vec![Some(2), Some(1)]);
/// assert_eq!(relative_degree(&bicycle, &disc, 0.0, &x), mixed);
/// # Ok::<(), punctual_core::Error>(())
/// ```
pub fn relative_degree<P, B, const NX: usize, const NU: usize>(
    plant: &P,
    barrier: &B,
    t: f64,
    samples: &[SVector<f64, NX>],
) -> RelativeDegree
where
    P: ControlAffine<NX, NU>,
    B: Barrier<NX>,
{
    let mut findings = Findings::<NU>::default();
    for x in samples {
        findings.add(plant, barrier, t, x);
    }
    findings.verdict()
}

/// The relative degree found on built-in samples: states whose components have either sign and sizes
/// from 0.01 to 100, at times from 0 to 10 s. The same ones on every call.
pub fn detected<P, B, const NX: usize, const NU: usize>(plant: &P, barrier: &B) -> RelativeDegree
where
    P: ControlAffine<NX, NU>,
    B: Barrier<NX>,
{
    let mut findings = Findings::<NU>::default();
    let mut numbers = Numbers(0);
    for _ in 0..SAMPLES {
        let t = 10.0 * numbers.unit();
        let x = SVector::<f64, NX>::from_fn(|_, _| {
            let sign = if numbers.unit() < 0.5 { -1.0 } else { 1.0 };
            sign * 10_f64.powf(4.0 * numbers.unit() - 2.0)
        });
        findings.add(plant, barrier, t, &x);
    }
    findings.verdict()
}

/// For each input the first order at which it enters.
type Orders<const NU: usize> = [Option<usize>; NU];

/// What the samples showed.
struct Findings<const NU: usize> {
    /// Per input the lowest order over all samples.
    lowest: Orders<NU>,
    /// `first[k]`: number of samples at which the input that comes first enters at order k.
    first: [usize; K],
    /// Samples at which everything was finite.
    finite: usize,
}

impl<const NU: usize> Default for Findings<NU> {
    fn default() -> Self {
        Self { lowest: [None; NU], first: [0; K], finite: 0 }
    }
}

impl<const NU: usize> Findings<NU> {
    fn add<P, B, const NX: usize>(&mut self, plant: &P, barrier: &B, t: f64, x: &SVector<f64, NX>)
    where
        P: ControlAffine<NX, NU>,
        B: Barrier<NX>,
    {
        /// How far a neighbour is, as a part of the component and absolutely: far enough that a
        /// gradient that vanishes at the sample only is seen there.
        const AWAY: f64 = 1e-3;
        let Some(mut orders) = orders(plant, barrier, t, x) else { return };
        let mut numbers = Numbers(1);
        for _ in 0..2 {
            if first(&orders).is_some() && (0..NU).all(|i| orders[i] == first(&orders)) {
                break;
            }
            let beside = x.map(|v| v + AWAY * (1.0 + v.abs()) * (2.0 * numbers.unit() - 1.0));
            if let Some(neighbour) = self::orders(plant, barrier, t, &beside) {
                orders = lower(orders, neighbour);
            }
        }
        self.finite += 1;
        self.lowest = lower(self.lowest, orders);
        if let Some(n) = first(&orders) {
            self.first[n] += 1;
        }
    }

    fn verdict(&self) -> RelativeDegree {
        if self.finite == 0 {
            return RelativeDegree::NotFinite;
        }
        let Some(n) = first(&self.lowest) else { return RelativeDegree::Unreached };
        if self.lowest.iter().flatten().any(|&order| order != n) {
            return RelativeDegree::Mixed(self.lowest.to_vec());
        }
        let reached: usize = self.first.iter().sum();
        if (reached - self.first[n]) * PASSED_OVER > reached {
            return RelativeDegree::Varying((1..K).filter(|&k| self.first[k] > 0).collect());
        }
        RelativeDegree::Uniform(n)
    }
}

fn first<const NU: usize>(orders: &Orders<NU>) -> Option<usize> {
    orders.iter().flatten().copied().min()
}

fn lower<const NU: usize>(mut a: Orders<NU>, b: Orders<NU>) -> Orders<NU> {
    for (a, b) in a.iter_mut().zip(b) {
        *a = [*a, b].into_iter().flatten().min();
    }
    a
}

/// The orders at one sample, `None` where the model is not finite.
fn orders<P, B, const NX: usize, const NU: usize>(
    plant: &P,
    barrier: &B,
    t: f64,
    x: &SVector<f64, NX>,
) -> Option<Orders<NU>>
where
    P: ControlAffine<NX, NU>,
    B: Barrier<NX>,
{
    let series: Response<NU, K> = barrier_series(plant, barrier, t, x);
    let c: [_; K] = from_fn(|k| series.coefficient(k));
    if !c.iter().all(|(value, gradient)| value.is_finite() && gradient.iter().all(|d| d.is_finite())) {
        return None;
    }
    // Gradients of different orders have different units; the time in which the changes of h along the
    // drift change themselves makes them comparable. (Not h itself: it may have any offset.)
    let changes = || (1..K).filter(|&k| c[k].0 != 0.0);
    let ratio = |j: usize, k: usize| (c[j].0 / c[k].0).abs().powf(1.0 / (k - j) as f64);
    let time = changes().next().and_then(|j| changes().skip(1).map(|k| ratio(j, k)).reduce(f64::min));
    let time = time.map_or(1.0, |time| time.clamp(1e-6, 1e6));
    let scaled = |k: usize, i: usize| c[k].1[i].abs() * time.powi(k as i32);
    let mut found = [None; NU];
    for (i, found) in found.iter_mut().enumerate() {
        let largest = (0..K).map(|k| scaled(k, i)).fold(0.0, f64::max);
        *found = (0..K).find(|&k| scaled(k, i) > SIGNIFICANT * largest);
    }
    Some(found)
}

/// Numbers in [0, 1) that look random and are always the same (SplitMix64).
struct Numbers(u64);

impl Numbers {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}
