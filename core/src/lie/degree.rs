//! The relative degree: the order of the first derivative of a barrier that the inputs enter.
//!
//! A constraint for relative degree n needs every input that reaches h to enter h⁽ⁿ⁾, and none to enter an earlier
//! derivative. An input that never enters is harmless: the steering of a vehicle does not act on a speed limit. Inputs that
//! enter at *different* orders (mixed relative degree) are not harmless. A row on h⁽ⁿ⁾ with the lower n uses only the input
//! that comes first; with the higher n it is wrong.
//!
//! The orders are read off the gradients of `barrier_series` at sample states. At a sample a gradient may vanish by
//! accident: at the centre of a disc, or at standstill. So if an order is not the lowest found, two neighbours of the sample
//! are also evaluated.

use alloc::vec::Vec;
use core::array::from_fn;

use super::barrier_series;
use crate::barrier::Barrier;
use crate::dynamics::{ControlAffine, first as first_of};
use crate::elementary;
use crate::error::{Error, ErrorKind, RelativeDegree};
use crate::jet::Response;
use crate::{MAX_INPUTS, MAX_RELATIVE_DEGREE};

/// Number of Taylor coefficients taken: every order that is supported.
const K: usize = MAX_RELATIVE_DEGREE + 1;

/// An input counts if the gradient of a Taylor coefficient, scaled by the time scale of h along the drift, exceeds this part
/// of the largest: far above round-off, far below a real effect.
const SIGNIFICANT: f64 = 1e-12;

/// Number of sample states of [`detected`].
const SAMPLES: usize = 16;

/// Largest part of samples that may have another order than the rest and be ignored, as 1 in this number.
const PASSED_OVER: usize = 8;

impl RelativeDegree {
    /// n, if it is uniform and equals `declared`, if that is given.
    ///
    /// # Errors
    ///
    /// [`ErrorKind::RelativeDegree`] otherwise, with details in [`Error::relative_degree`].
    pub fn require(self, declared: Option<usize>) -> Result<usize, Error> {
        let advice = match (&self, declared) {
            (&Self::Uniform(n), None) => return Ok(n),
            (&Self::Uniform(n), Some(d)) if n == d => return Ok(n),
            (Self::Mixed(_), _) => {
                "; one constraint cannot use both, so put an integrator before the input that enters first \
                 (dynamics::IntegratedInput)"
            }
            (Self::NotFinite, _) => "; provide your own samples",
            _ => "",
        };
        let found = self.describe(|i| format!("u[{}]", i + 1));
        let declared = declared.map(|d| format!(", declared is {d}")).unwrap_or_default();
        let error =
            Error::new(ErrorKind::RelativeDegree, "relative_degree", format!("{found}{declared}{advice}"));
        Err(error.with_relative_degree(self))
    }
}

/// The relative degree of `barrier` along `plant`, found at time `t` (s) and the states `samples`. Samples at which the
/// model is not finite are ignored.
///
/// ```
/// use punctual_core::barriers::DistanceDisc;
/// use punctual_core::lie::{RelativeDegree, relative_degree};
/// use punctual_core::plants::{SmallSlipBicycle, Unicycle};
///
/// let disc = DistanceDisc::new([45.0, 45.0], 2.0, 2.0)?;
/// let x = [[1.0, 2.0, 0.3, 4.0]];
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
    samples: &[[f64; NX]],
) -> RelativeDegree
where
    P: ControlAffine<NX, NU>,
    B: Barrier<NX>,
{
    let samples = samples.iter().map(|x| (t, x.to_vec()));
    relative_degree_of(NU, samples, |t, x| coefficients(plant, barrier, t, x))
}

/// The relative degree found on built-in samples of states without a range.
pub fn detected<P, B, const NX: usize, const NU: usize>(plant: &P, barrier: &B) -> RelativeDegree
where
    P: ControlAffine<NX, NU>,
    B: Barrier<NX>,
{
    let samples = samples(&[[f64::NEG_INFINITY, f64::INFINITY]; NX]);
    relative_degree_of(NU, samples, |t, x| coefficients(plant, barrier, t, x))
}

/// Samples for finding a relative degree: times from 0 to 10 s and states within `ranges` (`[min, max]` of each component,
/// or infinite). A component without a range has either sign and a size from 0.01 to 100; with one end, it is that far from
/// it. The same samples on every call.
pub fn samples(ranges: &[[f64; 2]]) -> Vec<(f64, Vec<f64>)> {
    let mut numbers = Numbers(0);
    let mut state = |range: &[f64; 2]| match range.map(f64::is_finite) {
        [true, true] => range[0] + (range[1] - range[0]) * numbers.unit(),
        [true, false] => range[0] + numbers.size(),
        [false, true] => range[1] - numbers.size(),
        [false, false] => {
            let sign = if numbers.unit() < 0.5 { -1.0 } else { 1.0 };
            sign * numbers.size()
        }
    };
    (0..SAMPLES).map(|_| (10.0 * state(&[0.0, 1.0]), ranges.iter().map(&mut state).collect())).collect()
}

/// The first Taylor coefficients of h(t, x(t)) at u = 0, each with its derivatives along the inputs.
pub type Coefficients = [(f64, [f64; MAX_INPUTS]); MAX_RELATIVE_DEGREE + 1];

/// The relative degree of a model with `inputs` ≤ [`MAX_INPUTS`] inputs that does not implement the traits. It is found at
/// the times (s) and states of `samples` from `series(t, x)`. Samples at which that is not finite are ignored.
pub fn relative_degree_of(
    inputs: usize,
    samples: impl IntoIterator<Item = (f64, Vec<f64>)>,
    mut series: impl FnMut(f64, &[f64]) -> Coefficients,
) -> RelativeDegree {
    let mut findings = Findings { inputs, lowest: [None; MAX_INPUTS], first: [0; K], finite: 0 };
    for (t, x) in samples {
        findings.add(t, &x, &mut series);
    }
    findings.verdict()
}

fn coefficients<P, B, const NX: usize, const NU: usize>(
    plant: &P,
    barrier: &B,
    t: f64,
    x: &[f64],
) -> Coefficients
where
    P: ControlAffine<NX, NU>,
    B: Barrier<NX>,
{
    let series: Response<NU, K> = barrier_series(plant, barrier, t, &first_of(x));
    from_fn(|k| {
        let (value, gradient) = series.coefficient(k);
        (value, from_fn(|i| gradient.get(i).copied().unwrap_or_default()))
    })
}

/// The first order at which each input enters.
type Orders = [Option<usize>; MAX_INPUTS];

/// The orders found on the samples.
struct Findings {
    /// Number of inputs; orders are `None` for higher indices.
    inputs: usize,
    /// The lowest order of each input over all samples.
    lowest: Orders,
    /// `first[k]`: number of samples at which the first input to enter does so at order k.
    first: [usize; K],
    /// Samples at which everything was finite.
    finite: usize,
}

impl Findings {
    fn add(&mut self, t: f64, x: &[f64], series: &mut impl FnMut(f64, &[f64]) -> Coefficients) {
        /// Distance of a neighbour, as a part of the component and absolutely. A gradient that vanishes only at the sample
        /// shows at that distance.
        const AWAY: f64 = 1e-3;
        let Some(mut orders) = orders(&series(t, x)) else { return };
        let mut numbers = Numbers(1);
        for _ in 0..2 {
            if first(&orders).is_some() && orders[..self.inputs].iter().all(|&order| order == first(&orders))
            {
                break;
            }
            let mut away = |v: &f64| v + AWAY * (1.0 + v.abs()) * (2.0 * numbers.unit() - 1.0);
            let beside: Vec<f64> = x.iter().map(&mut away).collect();
            if let Some(neighbour) = self::orders(&series(t, &beside)) {
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
            return RelativeDegree::Mixed(self.lowest[..self.inputs].to_vec());
        }
        let reached: usize = self.first.iter().sum();
        if (reached - self.first[n]) * PASSED_OVER > reached {
            return RelativeDegree::Varying((1..K).filter(|&k| self.first[k] > 0).collect());
        }
        RelativeDegree::Uniform(n)
    }
}

fn first(orders: &Orders) -> Option<usize> {
    orders.iter().flatten().copied().min()
}

fn lower(mut a: Orders, b: Orders) -> Orders {
    for (a, b) in a.iter_mut().zip(b) {
        *a = [*a, b].into_iter().flatten().min();
    }
    a
}

/// The orders at one sample; `None` if the model is not finite.
fn orders(c: &Coefficients) -> Option<Orders> {
    if !c.iter().all(|(value, gradient)| value.is_finite() && gradient.iter().all(|d| d.is_finite())) {
        return None;
    }
    // Gradients of different orders have different units. The time scale on which the changes of h along the drift
    // themselves change makes them comparable. (Not h itself: it may have any offset.)
    let changes = || (1..K).filter(|&k| c[k].0 != 0.0);
    let ratio = |j: usize, k: usize| elementary::powf((c[j].0 / c[k].0).abs(), 1.0 / (k - j) as f64);
    let time = changes().next().and_then(|j| changes().skip(1).map(|k| ratio(j, k)).reduce(f64::min));
    let time = time.map_or(1.0, |time| time.clamp(1e-6, 1e6));
    let scaled = |k: usize, i: usize| c[k].1[i].abs() * elementary::powi(time, k as i32);
    let mut found = [None; MAX_INPUTS];
    for (i, found) in found.iter_mut().enumerate() {
        let largest = (0..K).map(|k| scaled(k, i)).fold(0.0, f64::max);
        *found = (0..K).find(|&k| scaled(k, i) > SIGNIFICANT * largest);
    }
    Some(found)
}

/// Pseudo-random numbers in [0, 1) that are always the same (SplitMix64).
struct Numbers(u64);

impl Numbers {
    /// Between 0.01 and 100.
    fn size(&mut self) -> f64 {
        elementary::powf(10.0, 4.0 * self.unit() - 2.0)
    }

    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}
