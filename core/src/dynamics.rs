//! Control-affine dynamics `ẋ = f(x) + g(x) u`, written once and generic over the scalar.

use alloc::sync::Arc;
use core::array::from_fn;

use crate::elementary;
use crate::error::{Error, length};
use crate::scalar::Scalar;

/// A plant `ẋ = f(x) + g(x) u` with `NX` states and `NU` inputs.
///
/// ```
/// use punctual_core::dynamics::ControlAffine;
/// use punctual_core::scalar::Scalar;
///
/// /// A cart with quadratic drag: x = (position in m, velocity in m/s), u = acceleration in m/s².
/// struct Cart {
///     drag: f64, // 1/m
/// }
///
/// impl ControlAffine<2, 1> for Cart {
///     fn drift<S: Scalar>(&self, x: &[S; 2]) -> [S; 2] {
///         [x[1], -x[1].squared() * self.drag]
///     }
///     fn input_map<S: Scalar>(&self, _x: &[S; 2]) -> [[S; 1]; 2] {
///         [[S::zero()], [S::one()]]
///     }
/// }
/// ```
///
/// # Requirements
///
/// f and g are smooth where the filter is used; derivatives up to the relative degree are taken by
/// running these functions on Taylor series.
pub trait ControlAffine<const NX: usize, const NU: usize> {
    /// An upper limit of the relative degree of any output along this plant. Default: the number of states,
    /// which is one for every plant. Larger degrees are not compiled.
    const LARGEST_DEGREE: usize = NX;

    /// Whether f and g vary slowly over a sampling period, wherever the state is, as those of vehicles do: then they hide
    /// nothing narrow between two samples, and with n > 1 and a set that [bends one way](crate::barrier::Barrier::ONE_SIDED_CURVATURE) a
    /// step does not look for it. With the default, `false`, it does, for a gust say.
    const SLOW_CURVATURE: bool = false;

    /// f(x): the rate of change of the state at u = 0, per second.
    fn drift<S: Scalar>(&self, x: &[S; NX]) -> [S; NX];

    /// g(x): how each input changes the rate of the state.
    fn input_map<S: Scalar>(&self, x: &[S; NX]) -> [[S; NU]; NX];

    /// f(x) + g(x) u.
    #[inline]
    fn derivative<S: Scalar>(&self, x: &[S; NX], u: &[S; NU]) -> [S; NX] {
        let mut dx = self.drift(x);
        let g = self.input_map(x);
        for j in 0..NU {
            for i in 0..NX {
                // Known to the compiler where it is a constant.
                if !g[i][j].is_zero() {
                    dx[i] += g[i][j] * u[j];
                }
            }
        }
        dx
    }

    /// A region that contains every position, the first two states, between `time[0]` and `time[1]` s (0 ≤ first ≤
    /// second) after the state `x`, under any input with `bounds[0]` ≤ u ≤ `bounds[1]` (`NU` components). `None`,
    /// the default, where none is known.
    fn region(&self, _x: &[f64; NX], _bounds: [&[f64]; 2], _time: [f64; 2]) -> Option<Region> {
        None
    }
}

/// A part of the plane: every point within `radius` of a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// The box: smallest and largest coordinate along x, and along y, in m.
    pub sides: [[f64; 2]; 2],
    /// Distance in m, ≥ 0.
    pub radius: f64,
}

impl Region {
    /// The points within `radius` (m) of `centre` (m).
    pub fn disc(centre: [f64; 2], radius: f64) -> Self {
        Self { sides: centre.map(|c| [c, c]), radius }
    }

    /// Smallest and largest value of nᵀp over the region.
    pub fn along(&self, n: [f64; 2]) -> [f64; 2] {
        let mut ends =
            [-self.radius * elementary::hypot(n[0], n[1]), self.radius * elementary::hypot(n[0], n[1])];
        for (side, n) in self.sides.iter().zip(n) {
            let (a, b) = (n * side[0], n * side[1]);
            ends = [ends[0] + a.min(b), ends[1] + a.max(b)];
        }
        ends
    }

    /// The distance in m from `point` (m), 0 inside.
    pub fn distance(&self, point: [f64; 2]) -> f64 {
        let [x, y] = [0, 1].map(|i| (self.sides[i][0] - point[i]).max(point[i] - self.sides[i][1]).max(0.0));
        (elementary::sqrt(x * x + y * y) - self.radius).max(0.0)
    }
}

/// An interval that contains every output of a chain of integrators between `time[0]` and `time[1]` s after it
/// had the derivatives `from` (of order 0 to n − 1), while its n-th one lies within `input`. Where the two times
/// are one, it holds exactly the values that can be had.
///
/// ```
/// // n = 2 from rest: ±u τ²/2.
/// assert_eq!(punctual_core::dynamics::chain(&[0.0, 0.0], [-2.0, 3.0], [4.0, 4.0]), [-16.0, 24.0]);
/// ```
pub fn chain(from: &[f64], input: [f64; 2], time: [f64; 2]) -> [f64; 2] {
    let (n, length) = (from.len(), time[1] - time[0]);
    let terms = if length > 0.0 { n } else { 0 };
    let mut ends = [0.0; 2];
    for (side, end) in ends.iter_mut().enumerate() {
        let order = |k: usize| if k < n { from[k] } else { input[side] };
        // The derivatives at time[0], then the rest of the interval by Taylor's formula, term by term.
        let mut power = 1.0;
        for k in 0..terms + 1 {
            let shifted = (k..=n).rev().fold(0.0, |sum, j| order(j) + sum * time[0] / (j - k + 1) as f64);
            let term = shifted * power;
            *end += if k == 0 {
                term
            } else if side == 0 {
                term.min(0.0)
            } else {
                term.max(0.0)
            };
            power *= length / (k + 1) as f64;
        }
    }
    ends
}

/// A plant with an integrator before one of its inputs (dynamic extension): the input becomes the last
/// state, its rate the new input in its place.
///
/// An input then enters every derivative one order later, so that a barrier of mixed relative degree
/// can get a uniform one. `NX` is the number of states of the plant inside; the extended one has
/// `NX` + 1, which is checked at compile time.
///
/// ```
/// use punctual_core::barriers::DistanceDisc;
/// use punctual_core::dynamics::IntegratedInput;
/// use punctual_core::lie::{RelativeDegree, detected};
/// use punctual_core::plants::SmallSlipBicycle;
///
/// let disc = DistanceDisc::new([45.0, 45.0], 2.0, 2.0)?;
/// let bicycle = SmallSlipBicycle::new(10.0)?;
/// assert_eq!(detected(&bicycle, &disc).uniform(), None);
/// // State (x_p, y_p, θ, v, β), input (a, rate of β).
/// let extended = IntegratedInput::<_, 4>::new(bicycle, 1);
/// assert_eq!(detected::<_, _, 5, 2>(&extended, &disc), RelativeDegree::Uniform(2));
/// # Ok::<(), punctual_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct IntegratedInput<P, const NX: usize> {
    plant: P,
    input: usize,
}

impl<P, const NX: usize> IntegratedInput<P, NX> {
    /// `plant` with an integrator before input number `input`, counted from 0. A number that the plant
    /// does not have leaves its inputs as they are, and the last state constant.
    pub fn new(plant: P, input: usize) -> Self {
        Self { plant, input }
    }
}

impl<P, const NX: usize, const EXTENDED: usize, const NU: usize> ControlAffine<EXTENDED, NU>
    for IntegratedInput<P, NX>
where
    P: ControlAffine<NX, NU>,
{
    #[inline]
    fn drift<S: Scalar>(&self, x: &[S; EXTENDED]) -> [S; EXTENDED] {
        const { assert!(EXTENDED == NX + 1, "one state more than the plant inside") };
        let inner = from_fn::<S, NX, _>(|i| x[i]);
        let (f, g) = (self.plant.drift(&inner), self.plant.input_map(&inner));
        let held = |i: usize| if self.input < NU { g[i][self.input] * x[NX] } else { S::zero() };
        from_fn(|i| if i < NX { f[i] + held(i) } else { S::zero() })
    }

    #[inline]
    fn input_map<S: Scalar>(&self, x: &[S; EXTENDED]) -> [[S; NU]; EXTENDED] {
        let g = self.plant.input_map(&from_fn::<S, NX, _>(|i| x[i]));
        from_fn(|i| {
            from_fn(|j| match (i < NX, j == self.input) {
                (true, false) => g[i][j],
                (false, true) => S::one(),
                _ => S::zero(),
            })
        })
    }

    fn region(&self, x: &[f64; EXTENDED], bounds: [&[f64]; 2], time: [f64; 2]) -> Option<Region> {
        let inner = from_fn::<f64, NX, _>(|i| x[i]);
        let mut own = [[0.0; NU]; 2];
        for (own, bounds) in own.iter_mut().zip(bounds) {
            own.copy_from_slice(bounds);
        }
        if self.input < NU {
            let rates = [own[0][self.input], own[1][self.input]];
            if !rates.iter().all(|rate| rate.is_finite()) {
                return None;
            }
            let [least, most] = chain(&[x[NX]], rates, [0.0, time[1]]);
            (own[0][self.input], own[1][self.input]) = (least, most);
        }
        self.plant.region(&inner, [&own[0], &own[1]], time)
    }
}

/// A plant beside a point that moves on its own at constant velocity, such as an obstacle that another
/// system measures: the last four states are the point's position (m) and velocity (m/s).
///
/// With the position and velocity of each sample a barrier on these states knows where the point is then,
/// and expects it to go on like that until the next one. `NX` is the number of states of the plant
/// inside; the extended one has `NX` + 4, which is checked at compile time.
/// `docs/theory.md#measured-set` says what a point that accelerates costs.
///
/// ```
/// use punctual_core::barriers::{DistanceDisc, Outside};
/// use punctual_core::dynamics::WithPoint;
/// use punctual_core::filter::{BarrierSettings, Filter};
/// use punctual_core::plants::Unicycle;
///
/// // State (x_p, y_p, θ, v, p_x, p_y, v_x, v_y).
/// let clear = Outside(DistanceDisc::new([0.0, 0.0], 2.0, 2.0)?.following(4));
/// let filter = Filter::builder::<_, 8, 2>(WithPoint::<_, 4>(Unicycle))
///     .barrier("clear", clear, BarrierSettings::within(5.0))?
///     .build()?;
/// # Ok::<(), punctual_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct WithPoint<P, const NX: usize>(pub P);

impl<P, const NX: usize, const EXTENDED: usize, const NU: usize> ControlAffine<EXTENDED, NU>
    for WithPoint<P, NX>
where
    P: ControlAffine<NX, NU>,
{
    /// The point moves by itself, so no input reaches it: to the plant it is what time is.
    const LARGEST_DEGREE: usize = P::LARGEST_DEGREE;
    const SLOW_CURVATURE: bool = P::SLOW_CURVATURE;

    fn drift<S: Scalar>(&self, x: &[S; EXTENDED]) -> [S; EXTENDED] {
        const { assert!(EXTENDED == NX + 4, "four states more than the plant inside") };
        let f = self.0.drift(&from_fn::<S, NX, _>(|i| x[i]));
        from_fn(|i| match i {
            i if i < NX => f[i],
            i if i < NX + 2 => x[i + 2],
            _ => S::zero(),
        })
    }

    fn input_map<S: Scalar>(&self, x: &[S; EXTENDED]) -> [[S; NU]; EXTENDED] {
        let g = self.0.input_map(&from_fn::<S, NX, _>(|i| x[i]));
        from_fn(|i| from_fn(|j| if i < NX { g[i][j] } else { S::zero() }))
    }

    fn region(&self, x: &[f64; EXTENDED], bounds: [&[f64]; 2], time: [f64; 2]) -> Option<Region> {
        self.0.region(&from_fn(|i| x[i]), bounds, time)
    }
}

/// One plant of several owners.
impl<P, const NX: usize, const NU: usize> ControlAffine<NX, NU> for Arc<P>
where
    P: ControlAffine<NX, NU>,
{
    const LARGEST_DEGREE: usize = P::LARGEST_DEGREE;
    const SLOW_CURVATURE: bool = P::SLOW_CURVATURE;

    #[inline]
    fn drift<S: Scalar>(&self, x: &[S; NX]) -> [S; NX] {
        (**self).drift(x)
    }

    #[inline]
    fn input_map<S: Scalar>(&self, x: &[S; NX]) -> [[S; NU]; NX] {
        (**self).input_map(x)
    }

    #[inline]
    fn derivative<S: Scalar>(&self, x: &[S; NX], u: &[S; NU]) -> [S; NX] {
        (**self).derivative(x, u)
    }

    fn region(&self, x: &[f64; NX], bounds: [&[f64]; 2], time: [f64; 2]) -> Option<Region> {
        (**self).region(x, bounds, time)
    }
}

/// A plant chosen at run time: [`ControlAffine`] behind slices, in plain numbers.
pub trait DynPlant: Send {
    /// Number of states.
    fn state_dim(&self) -> usize;

    /// Number of inputs.
    fn input_dim(&self) -> usize;

    /// Advances `x` by `dt` seconds under the held input `u`, in one step of the classical
    /// Runge-Kutta method.
    ///
    /// # Errors
    ///
    /// A slice of the wrong length.
    fn rk4_step(&self, x: &mut [f64], u: &[f64], dt: f64) -> Result<(), Error>;
}

/// The first `N` of the numbers `x`.
#[cfg_attr(not(feature = "small"), inline(always))]
pub(crate) fn first<T: Scalar, const N: usize>(x: &[T]) -> [T; N] {
    *x.first_chunk().expect("a number for each component")
}

/// Checks the lengths of a state and an input.
///
/// # Errors
///
/// A slice of another length than the one beside it.
pub fn check_lengths((x, states): (&[f64], usize), (u, inputs): (&[f64], usize)) -> Result<(), Error> {
    length("x", x.len(), states)?;
    length("u", u.len(), inputs)
}

/// A [`ControlAffine`] plant as a [`DynPlant`].
#[derive(Clone, Debug)]
pub struct Erased<P, const NX: usize, const NU: usize>(pub P);

impl<P, const NX: usize, const NU: usize> DynPlant for Erased<P, NX, NU>
where
    P: ControlAffine<NX, NU> + Send,
{
    fn state_dim(&self) -> usize {
        NX
    }

    fn input_dim(&self) -> usize {
        NU
    }

    fn rk4_step(&self, x: &mut [f64], u: &[f64], dt: f64) -> Result<(), Error> {
        check_lengths((x, NX), (u, NU))?;
        let next = rk4_step(&self.0, &first(x), &first(u), dt);
        x.copy_from_slice(&next);
        Ok(())
    }
}

/// The state `dt` seconds after `x` under the held input `u`, by one step of the classical
/// fourth-order Runge-Kutta method.
pub fn rk4_step<P, const NX: usize, const NU: usize>(
    plant: &P,
    x: &[f64; NX],
    u: &[f64; NU],
    dt: f64,
) -> [f64; NX]
where
    P: ControlAffine<NX, NU>,
{
    rk4(|x| plant.derivative(x, u), x, dt)
}

/// As [`rk4_step`], for any `derivative` of the state and any scalar.
#[inline]
pub fn rk4<S: Scalar, const NX: usize>(
    derivative: impl Fn(&[S; NX]) -> [S; NX],
    x: &[S; NX],
    dt: f64,
) -> [S; NX] {
    let moved = |k: &[S; NX], by: f64| from_fn::<S, NX, _>(|i| x[i] + k[i] * by);
    let k1 = derivative(x);
    let k2 = derivative(&moved(&k1, dt / 2.0));
    let k3 = derivative(&moved(&k2, dt / 2.0));
    let k4 = derivative(&moved(&k3, dt));
    from_fn(|i| x[i] + (k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i]) * (dt / 6.0))
}
