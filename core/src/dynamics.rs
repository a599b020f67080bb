//! Control-affine dynamics `ẋ = f(x) + g(x) u`, written once and generic over the scalar.

use nalgebra::{SMatrix, SVector};

use crate::error::{Error, length};
use crate::scalar::Scalar;

/// A plant `ẋ = f(x) + g(x) u` with `NX` states and `NU` inputs.
///
/// ```
/// use nalgebra::{SMatrix, SVector, matrix, vector};
/// use punctual_core::dynamics::ControlAffine;
/// use punctual_core::nalgebra;
/// use punctual_core::scalar::Scalar;
///
/// /// A cart with quadratic drag: x = (position in m, velocity in m/s), u = acceleration in m/s².
/// struct Cart {
///     drag: f64, // 1/m
/// }
///
/// impl ControlAffine<2, 1> for Cart {
///     fn drift<S: Scalar>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
///         vector![x[1], -x[1].squared() * self.drag]
///     }
///     fn input_map<S: Scalar>(&self, _x: &SVector<S, 2>) -> SMatrix<S, 2, 1> {
///         matrix![S::zero(); S::one()]
///     }
/// }
/// ```
///
/// # Requirements
///
/// f and g are smooth where the filter is used; derivatives up to the relative degree are taken by
/// running these functions on Taylor series.
pub trait ControlAffine<const NX: usize, const NU: usize> {
    /// f(x): the rate of change of the state at u = 0, per second.
    fn drift<S: Scalar>(&self, x: &SVector<S, NX>) -> SVector<S, NX>;

    /// g(x): how each input changes the rate of the state.
    fn input_map<S: Scalar>(&self, x: &SVector<S, NX>) -> SMatrix<S, NX, NU>;

    /// f(x) + g(x) u.
    #[inline]
    fn derivative<S: Scalar>(&self, x: &SVector<S, NX>, u: &SVector<S, NU>) -> SVector<S, NX> {
        let mut dx = self.drift(x);
        let g = self.input_map(x);
        for j in 0..NU {
            for i in 0..NX {
                dx[i] += g[(i, j)] * u[j];
            }
        }
        dx
    }
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
    fn drift<S: Scalar>(&self, x: &SVector<S, EXTENDED>) -> SVector<S, EXTENDED> {
        const { assert!(EXTENDED == NX + 1, "one state more than the plant inside") };
        let inner = SVector::<S, NX>::from_fn(|i, _| x[i]);
        let (f, g) = (self.plant.drift(&inner), self.plant.input_map(&inner));
        let held = |i: usize| if self.input < NU { g[(i, self.input)] * x[NX] } else { S::zero() };
        SVector::from_fn(|i, _| if i < NX { f[i] + held(i) } else { S::zero() })
    }

    #[inline]
    fn input_map<S: Scalar>(&self, x: &SVector<S, EXTENDED>) -> SMatrix<S, EXTENDED, NU> {
        let g = self.plant.input_map(&SVector::<S, NX>::from_fn(|i, _| x[i]));
        SMatrix::from_fn(|i, j| match (i < NX, j == self.input) {
            (true, false) => g[(i, j)],
            (false, true) => S::one(),
            _ => S::zero(),
        })
    }
}

/// A plant beside a point that moves on its own at constant velocity, such as an obstacle that another
/// system measures: the last four states are the point's position (m) and velocity (m/s).
///
/// With the position and velocity of each sample a barrier on these states knows where the point is then,
/// and expects it to go on like that until the next one. `NX` is the number of states of the plant
/// inside; the extended one has `NX` + 4, which is checked at compile time.
///
/// ```
/// use punctual_core::barriers::{DistanceDisc, Outside};
/// use punctual_core::dynamics::WithPoint;
/// use punctual_core::filter::{BarrierSettings, SafetyFilter};
/// use punctual_core::plants::Unicycle;
///
/// // State (x_p, y_p, θ, v, p_x, p_y, v_x, v_y).
/// let clear = Outside(DistanceDisc::new([0.0, 0.0], 2.0, 2.0)?.following(4));
/// let filter = SafetyFilter::builder(8, 2)
///     .barrier::<_, _, 8, 2>("clear", WithPoint::<_, 4>(Unicycle), clear, BarrierSettings::within(5.0))?
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
    fn drift<S: Scalar>(&self, x: &SVector<S, EXTENDED>) -> SVector<S, EXTENDED> {
        const { assert!(EXTENDED == NX + 4, "four states more than the plant inside") };
        let f = self.0.drift(&SVector::<S, NX>::from_fn(|i, _| x[i]));
        SVector::from_fn(|i, _| match i {
            i if i < NX => f[i],
            i if i < NX + 2 => x[i + 2],
            _ => S::zero(),
        })
    }

    fn input_map<S: Scalar>(&self, x: &SVector<S, EXTENDED>) -> SMatrix<S, EXTENDED, NU> {
        let g = self.0.input_map(&SVector::<S, NX>::from_fn(|i, _| x[i]));
        SMatrix::from_fn(|i, j| if i < NX { g[(i, j)] } else { S::zero() })
    }
}

/// A plant chosen at run time: [`ControlAffine`] behind slices, in plain numbers.
pub trait DynPlant: Send + Sync {
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

/// A [`ControlAffine`] plant as a [`DynPlant`].
#[derive(Clone, Debug)]
pub struct Erased<P, const NX: usize, const NU: usize>(pub P);

impl<P, const NX: usize, const NU: usize> DynPlant for Erased<P, NX, NU>
where
    P: ControlAffine<NX, NU> + Send + Sync,
{
    fn state_dim(&self) -> usize {
        NX
    }

    fn input_dim(&self) -> usize {
        NU
    }

    fn rk4_step(&self, x: &mut [f64], u: &[f64], dt: f64) -> Result<(), Error> {
        length("x", x.len(), NX)?;
        length("u", u.len(), NU)?;
        let next = rk4_step(&self.0, &SVector::from_column_slice(x), &SVector::from_column_slice(u), dt);
        x.copy_from_slice(next.as_slice());
        Ok(())
    }
}

/// The state `dt` seconds after `x` under the held input `u`, by one step of the classical
/// fourth-order Runge-Kutta method.
pub fn rk4_step<P, const NX: usize, const NU: usize>(
    plant: &P,
    x: &SVector<f64, NX>,
    u: &SVector<f64, NU>,
    dt: f64,
) -> SVector<f64, NX>
where
    P: ControlAffine<NX, NU>,
{
    let k1 = plant.derivative(x, u);
    let k2 = plant.derivative(&(x + k1 * (dt / 2.0)), u);
    let k3 = plant.derivative(&(x + k2 * (dt / 2.0)), u);
    let k4 = plant.derivative(&(x + k3 * dt), u);
    x + (k1 + (k2 + k3) * 2.0 + k4) * (dt / 6.0)
}
