//! Lie derivatives of a barrier along a plant, of any order, by Taylor jets.
//!
//! Let x(t₀ + τ) solve `ẋ = f(x) + g(x) u` with a *constant* u. Its Taylor coefficients follow one after the other from
//! `(k+1) x_{k+1} = [f(x) + g(x) u]_k`; then `h(t, x)` evaluated on that series has the coefficients `h⁽ᵏ⁾(t₀)/k!`. Series
//! are taken at u = 0 with their derivatives along u (`Response`), so that at relative degree n
//!
//! ```math
//! \begin{align}
//! h^{(k)} &= L_f^k h, & k &= 0 \dots n, \text{ the value part} \tag{1} \\
//! \frac{\partial h^{(n)}}{\partial u} &= L_g L_f^{n-1} h, & k &= n, \text{ the gradient part} \tag{2} \\
//! \frac{\partial h^{(k)}}{\partial u} &= 0, & k &< n \tag{3}
//! \end{align}
//! ```
//!
//! (for a time-varying h, L_f stands for ∂/∂t + L_f). All are exact up to round-off. The filter checks (3) at every
//! evaluation, since an input that enters earlier invalidates every constraint built for n.

pub(crate) mod ahead;
pub(crate) mod degree;
pub(crate) mod enclosure;
mod external;
mod place;
mod source;

use ahead::SUBSTEPS;
pub use ahead::{Ahead, flow};

use alloc::boxed::Box;
use alloc::sync::Arc;
use core::any::Any;
use core::array::from_fn;
use core::marker::PhantomData;

use crate::barrier::Barrier;
use crate::dynamics::{ControlAffine, WithPoint, first};
use crate::error::{Error, ErrorKind};
use crate::interval::Interval;
use crate::jet::{Dual, Response, Tangent, Taylor};
use crate::scalar::{Scalar, all_finite};
use crate::{MAX_INPUTS, MAX_RELATIVE_DEGREE};

pub use crate::error::RelativeDegree;
pub use degree::{detected, relative_degree};
pub use external::external;
use place::Place;
pub(crate) use source::FEW_ORDERS;
pub use source::{
    DerivativeSource, Direction, Directional, EXPANSION_ORDERS, Expansion, ExpansionOver, Follows, PlantId,
    Predict, PredictDirectional, RateOver, Second, SharedPlant,
};

/// The Taylor series of h(t, x(t)) at `t` and `x` with u = 0, `K` coefficients, each with its
/// derivatives along the `NU` inputs. This is (1)–(3) before multiplication by k!.
#[inline]
pub(crate) fn barrier_series<P, B, const NX: usize, const NU: usize, const K: usize>(
    plant: &P,
    barrier: &B,
    t: f64,
    x: &[f64; NX],
) -> Response<NU, K>
where
    P: ControlAffine<NX, NU>,
    B: Barrier<NX>,
{
    barrier.value(Response::time(t), &motion(plant, x))
}

/// The Taylor series of the states from `x` with u = 0, `K` coefficients, each with its derivatives along the inputs.
#[inline]
fn motion<P, const NX: usize, const NU: usize, const K: usize>(
    plant: &P,
    x: &[f64; NX],
) -> [Response<NU, K>; NX]
where
    P: ControlAffine<NX, NU>,
{
    const { assert!(K <= MAX_RELATIVE_DEGREE + 1, "orders 1 to 8 are spelled out below") };
    let mut series = from_fn::<Response<NU, K>, NX, _>(|i| Response::from(x[i]));
    macro_rules! extend_to {
        ($($j:literal),*) => {
            $(if const { $j < K } {
                extend::<P, NX, NU, K, $j>(plant, &mut series);
            })*
        };
    }
    extend_to!(1, 2, 3, 4, 5, 6, 7, 8);
    series
}

/// Coefficient `J` of the state from the lower ones: `J x_J = [f(x)]_{J−1} + [g(x)]_{J−1} u` at u = 0, where products of u
/// with derivatives of g along u vanish. Every series is cut off after its last known coefficient.
#[inline]
fn extend<P, const NX: usize, const NU: usize, const K: usize, const J: usize>(
    plant: &P,
    series: &mut [Response<NU, K>; NX],
) where
    P: ControlAffine<NX, NU>,
{
    let known = from_fn::<Response<NU, J>, NX, _>(|i| series[i].truncated());
    let f = plant.drift(&known);
    let g = plant.input_map(&from_fn::<Taylor<f64, J>, NX, _>(|i| known[i].series));
    let part = 1.0 / J as f64;
    for i in 0..NX {
        let (value, along) = f[i].coefficient(J - 1);
        let gradient = from_fn(|m| (along[m] + g[i][m].coefficients[J - 1]) * part);
        series[i].set_coefficient(J, (value * part, gradient));
    }
}

/// Derivatives of one barrier at one instant, as plain numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Derivatives {
    /// `drift[k]` = L_f^k h for k = 0 ..= n, in `[h]`/s^k; zeros above n.
    pub drift: [f64; MAX_RELATIVE_DEGREE + 1],
    /// L_g L_f^(n−1) h, in `[h]`/(s^n · unit of u); zeros above the number of inputs.
    pub row: [f64; MAX_INPUTS],
    /// Σ |∂h⁽ᵏ⁾/∂u_i| over k < n and all inputs: 0 if the declared relative degree is right.
    pub lower_sensitivity: f64,
}

impl Derivatives {
    /// All zero.
    pub const ZERO: Self =
        Self { drift: [0.0; MAX_RELATIVE_DEGREE + 1], row: [0.0; MAX_INPUTS], lower_sensitivity: 0.0 };

    /// Whether every number is finite.
    #[inline]
    pub fn is_finite(&self) -> bool {
        all_finite(&self.drift) & all_finite(&self.row) & self.lower_sensitivity.is_finite()
    }
}

/// A barrier along a plant, with `K` = n + 1 Taylor coefficients, and `N` = n for a row over the period.
struct Along<P, B, const NX: usize, const NU: usize, const K: usize, const N: usize> {
    plant: Arc<P>,
    barrier: B,
    place: Place,
    /// If it follows a point: where the point begins, and the plant without it.
    beside: Option<Beside>,
    dims: PhantomData<([(); NX], [(); NU])>,
}

/// The plant without the point that a barrier follows.
struct Beside {
    first: usize,
    plant: PlantId,
    alone: Box<dyn Predict + Send>,
}

/// No barrier: h = 0.
struct Nothing;

impl<const NX: usize> Barrier<NX> for Nothing {
    const ONE_SIDED_CURVATURE: bool = true;

    fn value<S: Scalar>(&self, _t: S, _x: &[S; NX]) -> S {
        S::zero()
    }
}

impl<P, B, const NX: usize, const NU: usize, const K: usize, const N: usize> Along<P, B, NX, NU, K, N>
where
    P: ControlAffine<NX, NU>,
    B: Barrier<NX>,
{
    /// What is known of the point that it follows: it is asked only of a source that does.
    fn of_point(&self) -> &Beside {
        self.beside.as_ref().expect("a source that follows a point")
    }

    /// Writes the derivatives given by the coefficients of `h`.
    #[cfg_attr(not(feature = "small"), inline(always))]
    fn write(h: &Response<NU, K>, out: &mut Derivatives) {
        *out = Derivatives::ZERO;
        let mut factorial = 1.0;
        for k in 0..K {
            factorial *= k.max(1) as f64;
            let (value, gradient) = h.coefficient(k);
            out.drift[k] = value * factorial;
            if k == K - 1 {
                out.row[..NU].copy_from_slice(&gradient.map(|d| d * factorial));
            } else {
                // A sum and not a maximum: `f64::max` would drop a NaN.
                out.lower_sensitivity += gradient.iter().map(|d| d.abs()).sum::<f64>() * factorial;
            }
        }
    }
}

impl<P, B, const NX: usize, const NU: usize, const K: usize, const N: usize> DerivativeSource
    for Along<P, B, NX, NU, K, N>
where
    P: ControlAffine<NX, NU> + Send + Sync + 'static,
    B: Barrier<NX> + Send,
{
    fn relative_degree(&self) -> usize {
        K - 1
    }

    fn state_dim(&self) -> usize {
        self.place.components(NX)
    }

    fn input_dim(&self) -> usize {
        NU
    }

    fn evaluate(&self, t: f64, x: &[f64], out: &mut Derivatives) {
        Self::write(&barrier_series(&*self.plant, &self.barrier, t, &self.place.take(x)), out);
    }

    fn predict(&self) -> Option<&dyn Predict> {
        Some(self)
    }

    fn directional(&self) -> Option<&dyn Directional> {
        Some(self)
    }

    fn predict_directional(&self) -> Option<&dyn PredictDirectional> {
        Some(self)
    }

    fn shared(&self) -> Option<&dyn SharedPlant> {
        Some(self)
    }

    fn follows(&self) -> Option<&dyn Follows> {
        self.beside.is_some().then_some(self)
    }

    fn highest(&self, t: f64, x: &[f64], bounds: [&[f64]; 2], time: [f64; 2]) -> Option<f64> {
        let region = self.plant.region(&self.place.take(x), bounds, time)?;
        self.barrier.highest(time.map(|after| t + after), &region)
    }
}

impl<P, B, const NX: usize, const NU: usize, const K: usize, const N: usize> Predict
    for Along<P, B, NX, NU, K, N>
where
    P: ControlAffine<NX, NU>,
    B: Barrier<NX>,
{
    fn flow(&self, x: &mut [f64], u: &[f64], duration: f64) {
        let (from, held) = (self.place.take::<_, NX>(x), first(u));
        self.place.put(&flow(&*self.plant, &from, &held, duration, SUBSTEPS), x);
    }

    fn ahead(&self, t: f64, x: &[f64], u: &[f64], duration: f64, out: &mut Ahead) {
        *out = Ahead::ZERO;
        let motion = ahead::motion::<P, NX, NU, K>(&*self.plant, &self.place.take(x), u, duration);
        ahead::evaluate(&self.barrier, t + duration, &motion, out);
    }

    fn ahead_of_row(&self, t: f64, x: &[f64], u: &[f64], duration: f64, out: &mut Ahead) {
        let motion = ahead::motion::<P, NX, NU, N>(&*self.plant, &self.place.take(x), u, duration);
        ahead::evaluate(&self.barrier, t + duration, &motion, out);
    }

    fn values_ahead(
        &self,
        t: f64,
        x: &[f64],
        u: &[f64],
        duration: f64,
        out: &mut [f64; MAX_RELATIVE_DEGREE + 1],
    ) {
        ahead::values::<P, B, NX, NU, K>(
            (&*self.plant, &self.barrier),
            (t, duration),
            &self.place.take(x),
            u,
            out,
        );
    }

    fn values_of_row(
        &self,
        t: f64,
        x: &[f64],
        u: &[f64],
        duration: f64,
        out: &mut [f64; MAX_RELATIVE_DEGREE + 1],
    ) {
        ahead::values::<P, B, NX, NU, N>(
            (&*self.plant, &self.barrier),
            (t, duration),
            &self.place.take(x),
            u,
            out,
        );
    }

    fn rate(&self, x: &[f64], u: &[f64], out: &mut [f64]) {
        let rate = self.plant.derivative(&self.place.take(x), &first(u));
        out.fill(0.0);
        self.place.put(&rate, out);
    }

    fn path(&self, x: &[f64], u: &[f64], out: &mut [Expansion]) {
        for (out, x) in out.iter_mut().zip(x) {
            *out = [0.0; EXPANSION_ORDERS];
            out[0] = *x;
        }
        self.place.put(&ahead::path::<P, NX, NU>(&*self.plant, &self.place.take(x), u), out);
    }

    fn value(&self, t: f64, x: &[f64]) -> f64 {
        self.barrier.value(t, &self.place.take(x))
    }

    fn value_along(&self, t: f64, path: &[Expansion], out: &mut Expansion) {
        *out = self.place.read::<_, _, NX>(path, |path| ahead::value_along::<B, NX>(&self.barrier, t, path));
    }

    fn rates_over(&self, path: &[ExpansionOver], u: &[f64], orders: usize, out: &mut [RateOver]) -> bool {
        /// The rates of a component that does not move.
        const STILL: RateOver = [Interval { low: 0.0, high: 0.0 }; EXPANSION_ORDERS - 1];
        let plant = &*self.plant;
        let write = |path: &[ExpansionOver], out: &mut [RateOver]| match orders <= FEW_ORDERS {
            true => ahead::rates_over::<P, NX, NU, FEW_ORDERS>(plant, path, u, out),
            false => ahead::rates_over::<P, NX, NU, { EXPANSION_ORDERS - 1 }>(plant, path, u, out),
        };
        if self.place == Place::START {
            write(path, &mut out[..NX]);
            out[NX..].fill(STILL);
        } else {
            let mut own = [STILL; NX];
            write(&self.place.take::<_, NX>(path), &mut own);
            out.fill(STILL);
            self.place.put(&own, out);
        }
        true
    }

    fn value_over(&self, time: Interval, path: &[ExpansionOver]) -> Option<Interval> {
        Some(self.place.read::<_, _, NX>(path, |path| ahead::value_over::<B, NX>(&self.barrier, time, path)))
    }

    fn last_over(&self, time: Interval, path: &[ExpansionOver]) -> Option<Interval> {
        Some(self.place.read::<_, _, NX>(path, |path| ahead::last_over::<B, NX>(&self.barrier, time, path)))
    }

    fn second_rates(&self, x: &[Second], u: &[Second], out: &mut [Second]) -> bool {
        let rate = self.plant.derivative(&self.place.take::<_, NX>(x), &from_fn(|m| u[m]));
        out.fill(Second::from(0.0));
        self.place.put(&rate, out);
        true
    }

    fn second_value(&self, time: Interval, x: &[Second]) -> Option<Second> {
        Some(self.barrier.value(second_time(time), &self.place.take::<_, NX>(x)))
    }

    fn lowest_held(&self, t: f64, x: &[f64], u: &[f64], duration: f64, wanted: f64) -> Option<f64> {
        // With n > 1 the derivatives at the ends of a hold show as much of such an h, at a lower cost.
        if B::ONE_SIDED_CURVATURE && P::SLOW_CURVATURE && K > 2 {
            return None;
        }
        let model = (&*self.plant, &self.barrier);
        Some(ahead::lowest_held::<P, B, NX, NU>(
            model,
            (t, duration),
            &self.place.take::<_, NX>(x),
            u,
            wanted,
        ))
    }

    fn is_still(&self, x: &[f64]) -> Option<bool> {
        let x = self.place.take::<_, NX>(x).map(Interval::from);
        // If time is not used, the bits are the same.
        Some(self.barrier.value(Interval::ALL, &x) == self.barrier.value(Interval::from(0.0), &x))
    }

    fn lowest_from(&self, t: f64, x: &[f64]) -> Option<f64> {
        self.barrier.range_from(t, &self.place.take(x)).map(|[least, _]| least)
    }
}

impl<P, B, const NX: usize, const NU: usize, const K: usize, const N: usize> SharedPlant
    for Along<P, B, NX, NU, K, N>
where
    P: ControlAffine<NX, NU> + 'static,
    B: Barrier<NX>,
{
    fn plant(&self) -> PlantId {
        // Beside points in two places it is two plants.
        PlantId::of(&self.plant, [self.place.components(NX), NU])
    }

    fn rooms(&self) -> [Box<dyn Any + Send>; 2] {
        let motion = from_fn::<Response<NU, K>, NX, _>(|_| Response::from(0.0));
        let ahead = from_fn::<Taylor<Dual<NU>, N>, NX, _>(|_| Taylor::from(0.0));
        [Box::new(motion), Box::new(ahead)]
    }

    fn motion(&self, x: &[f64], room: &mut dyn Any) {
        *room.downcast_mut().expect(ROOM) = motion::<P, NX, NU, K>(&*self.plant, &self.place.take(x));
    }

    fn evaluate_along(&self, t: f64, motion: &dyn Any, out: &mut Derivatives) {
        let motion: &[Response<NU, K>; NX] = motion.downcast_ref().expect(ROOM);
        Self::write(&self.barrier.value(Response::time(t), motion), out);
    }

    fn motion_ahead(&self, x: &[f64], u: &[f64], duration: f64, room: &mut dyn Any) {
        *room.downcast_mut().expect(ROOM) =
            ahead::motion::<P, NX, NU, N>(&*self.plant, &self.place.take(x), u, duration);
    }

    fn ahead_of_row_along(&self, t: f64, motion: &dyn Any, out: &mut Ahead) {
        let motion: &[Taylor<Dual<NU>, N>; NX] = motion.downcast_ref().expect(ROOM);
        ahead::evaluate(&self.barrier, t, motion, out);
    }
}

impl<P, B, const NX: usize, const NU: usize, const K: usize, const N: usize> Follows
    for Along<P, B, NX, NU, K, N>
where
    P: ControlAffine<NX, NU>,
    B: Barrier<NX>,
{
    fn first(&self) -> usize {
        self.of_point().first
    }

    fn plant(&self) -> PlantId {
        self.of_point().plant
    }

    fn alone(&self) -> &dyn Predict {
        &*self.of_point().alone
    }

    fn steepness(&self) -> Option<f64> {
        self.barrier.steepness()
    }

    fn value(&self, t: f64, x: &[f64], point: &[f64; 4]) -> f64 {
        self.barrier.value(t, &Place::beside(x, point))
    }

    fn value_along(&self, t: f64, path: &[Expansion], point: &[Expansion; 4], out: &mut Expansion) {
        *out = ahead::value_along::<B, NX>(&self.barrier, t, &Place::beside::<_, NX>(path, point));
    }

    fn value_over(&self, time: Interval, path: &[ExpansionOver], point: &[ExpansionOver; 4]) -> Interval {
        ahead::value_over::<B, NX>(&self.barrier, time, &Place::beside::<_, NX>(path, point))
    }

    fn last_over(&self, time: Interval, path: &[ExpansionOver], point: &[ExpansionOver; 4]) -> Interval {
        ahead::last_over::<B, NX>(&self.barrier, time, &Place::beside::<_, NX>(path, point))
    }

    fn second_value(&self, time: Interval, x: &[Second], point: &[Second; 4]) -> Second {
        self.barrier.value(second_time(time), &Place::beside(x, point))
    }
}

/// The time as a number with derivatives along states: it has none.
fn second_time(time: Interval) -> Second {
    Second { value: Tangent { value: time, ..Tangent::from(0.0) }, ..Second::from(0.0) }
}

/// The expectation that is violated if a room belongs to another plant.
const ROOM: &str = "a room that a source along the same plant has made";

impl<P, B, const NX: usize, const NU: usize, const K: usize, const N: usize> Directional
    for Along<P, B, NX, NU, K, N>
where
    P: ControlAffine<NX, NU>,
    B: Barrier<NX>,
{
    fn evaluate_directional(&self, t: f64, x: &[f64], u: &[f64], direction: Direction, out: &mut Ahead) {
        self.ahead_directional(t, x, u, direction, 0.0, out);
    }
}

impl<P, B, const NX: usize, const NU: usize, const K: usize, const N: usize> PredictDirectional
    for Along<P, B, NX, NU, K, N>
where
    P: ControlAffine<NX, NU>,
    B: Barrier<NX>,
{
    fn flow_directional(&self, x: &mut [f64], dx: &mut [f64], u: &[f64], duration: f64) {
        let [mut own, mut own_dx] = [&*x, &*dx].map(|all| self.place.take::<_, NX>(all));
        ahead::flow_directional::<P, NX, NU>(&*self.plant, &mut own, &mut own_dx, u, duration);
        self.place.put(&own, x);
        self.place.put(&own_dx, dx);
    }

    fn ahead_directional(
        &self,
        t: f64,
        x: &[f64],
        u: &[f64],
        direction: Direction,
        duration: f64,
        out: &mut Ahead,
    ) {
        let model = (&*self.plant, &self.barrier);
        let [x, dx] = [x, direction.x].map(|all| self.place.take::<_, NX>(all));
        let direction = Direction { x: &dx, ..direction };
        ahead::differentiate::<P, B, NX, NU, K>(model, (t, duration), &x, u, direction, out);
    }
}

/// The derivatives of `barrier` along `plant` at relative degree `n`, which cannot exceed the plant's
/// [`LARGEST_DEGREE`](ControlAffine::LARGEST_DEGREE). The number of states is always such a limit, since the gradients of h,
/// …, h⁽ⁿ⁻¹⁾ are linearly independent (A. Isidori, *Nonlinear Control Systems*, lemma 4.1.1).
///
/// Several barriers of a filter share work, and a plan, if each gets a clone of one `Arc` of the plant.
///
/// # Errors
///
/// `n` outside 1 ..= min(`LARGEST_DEGREE`, [`MAX_RELATIVE_DEGREE`]); `NU` above [`MAX_INPUTS`] or zero. Whether `n` *is* the
/// relative degree is for [`detected`] to decide. It is also checked at every evaluation
/// ([`Derivatives::lower_sensitivity`]).
pub fn along<P, B, const NX: usize, const NU: usize>(
    plant: Arc<P>,
    barrier: B,
    n: usize,
) -> Result<Box<dyn DerivativeSource>, Error>
where
    P: ControlAffine<NX, NU> + Send + Sync + 'static,
    B: Barrier<NX> + Send + 'static,
{
    placed(plant, barrier, n, (Place::START, None))
}

/// The same for a barrier that follows a measured point: along the plant [beside a point](WithPoint), whose position and
/// velocity are the four components of the filter's x from `first` on. The other states are its first components. So several
/// barriers of a filter can each follow a point of their own.
///
/// # Errors
///
/// As for [`along`]; `first` below `NX`, where the states of the plant are.
pub fn following<P, B, const NX: usize, const EXTENDED: usize, const NU: usize>(
    plant: Arc<P>,
    barrier: B,
    n: usize,
    first: usize,
) -> Result<Box<dyn DerivativeSource>, Error>
where
    P: ControlAffine<NX, NU> + Send + Sync + 'static,
    B: Barrier<EXTENDED> + Send + 'static,
{
    if first < NX {
        let message = format!("is {first}, must be >= {NX}, the number of states of the plant");
        return Err(Error::new(ErrorKind::Range, "first", message));
    }
    let alone = Along::<P, Nothing, NX, NU, 2, 1> {
        plant: Arc::clone(&plant),
        barrier: Nothing,
        place: Place::START,
        beside: None,
        dims: PhantomData,
    };
    let beside = Beside { first, plant: PlantId::of(&plant, [NX, NU]), alone: Box::new(alone) };
    let plant = Arc::new(WithPoint::<_, NX>(plant));
    placed::<_, _, EXTENDED, NU>(plant, barrier, n, (Place::new(NX, first), Some(beside)))
}

fn placed<P, B, const NX: usize, const NU: usize>(
    plant: Arc<P>,
    barrier: B,
    n: usize,
    (place, beside): (Place, Option<Beside>),
) -> Result<Box<dyn DerivativeSource>, Error>
where
    P: ControlAffine<NX, NU> + Send + Sync + 'static,
    B: Barrier<NX> + Send + 'static,
{
    checked_inputs(NU)?;
    macro_rules! by_degree {
        ($($n:literal => $k:literal),*) => {
            match n {
                // A constant condition: impossible degrees are not compiled.
                $($n if const { $n <= P::LARGEST_DEGREE && $n <= MAX_RELATIVE_DEGREE } => {
                    Ok(Box::new(Along::<P, B, NX, NU, $k, $n> { plant, barrier, place, beside, dims: PhantomData }) as _)
                })*
                _ => Err(no_degree(n, P::LARGEST_DEGREE.min(MAX_RELATIVE_DEGREE))),
            }
        };
    }
    by_degree!(1 => 2, 2 => 3, 3 => 4, 4 => 5, 5 => 6, 6 => 7, 7 => 8, 8 => 9)
}

/// `inputs`, if it is a possible number of inputs.
fn checked_inputs(inputs: usize) -> Result<usize, Error> {
    if (1..=MAX_INPUTS).contains(&inputs) {
        return Ok(inputs);
    }
    let message = format!("has {inputs} components, must have 1 to {MAX_INPUTS}");
    Err(Error::new(ErrorKind::Dimension, "u", message))
}

/// `n`, if it is a possible relative degree.
fn checked_degree(n: usize) -> Result<usize, Error> {
    if (1..=MAX_RELATIVE_DEGREE).contains(&n) { Ok(n) } else { Err(no_degree(n, MAX_RELATIVE_DEGREE)) }
}

fn no_degree(n: usize, most: usize) -> Error {
    let message = format!("is {n}, must be 1 to {most}");
    Error::new(ErrorKind::RelativeDegree, "relative_degree", message)
}
