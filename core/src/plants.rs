//! Reference plants, with the state and input order of the paper, section IV.

use crate::dynamics::{ControlAffine, DynPlant, IntegratedInput, Region, chain, check_lengths, first, rk4};
use crate::elementary;
use crate::error::{Error, positive};
use crate::scalar::Scalar;

/// One component of a state or input: its name, unit and meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Signal {
    /// Name as in the paper, ASCII.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Meaning.
    pub description: &'static str,
}

const fn signal(name: &'static str, unit: &'static str, description: &'static str) -> Signal {
    Signal { name, unit, description }
}

const X_P: Signal = signal("x_p", "m", "position along x");
const Y_P: Signal = signal("y_p", "m", "position along y");
const THETA: Signal = signal("theta", "rad", "heading, counter-clockwise from the x axis");
const V: Signal = signal("v", "m/s", "speed along the heading; negative when reversing");
const V_X: Signal = signal("v_x", "m/s", "velocity along x");
const V_Y: Signal = signal("v_y", "m/s", "velocity along y");
const BETA: Signal = signal("beta", "rad", "slip angle at the centre of mass");
const A: Signal = signal("a", "m/s2", "acceleration along the heading");
const DELTA: Signal = signal("delta", "rad", "steering angle of the front wheel");

/// Largest relative degree on every plant below. A function that no input changes at once depends on position and
/// heading alone. Its rate is the speed times something, and the acceleration changes that.
const VEHICLE_DEGREE: usize = 2;

/// The names and units of a plant's states and inputs.
pub trait Signals {
    /// The states, in order.
    const STATES: &'static [Signal];
    /// The inputs, in order.
    const INPUTS: &'static [Signal];
}

/// A point mass in the plane: x = (x_p, y_p, v_x, v_y), u = (u_x, u_y).
///
/// ẋ_p = v_x, ẏ_p = v_y, v̇_x = u_x, v̇_y = u_y.
#[derive(Clone, Copy, Debug, Default)]
pub struct PointMass;

impl Signals for PointMass {
    const STATES: &'static [Signal] = &[X_P, Y_P, V_X, V_Y];
    const INPUTS: &'static [Signal] =
        &[signal("u_x", "m/s2", "acceleration along x"), signal("u_y", "m/s2", "acceleration along y")];
}

impl ControlAffine<4, 2> for PointMass {
    const LARGEST_DEGREE: usize = VEHICLE_DEGREE;
    const SLOW_CURVATURE: bool = true;

    #[inline]
    fn drift<S: Scalar>(&self, x: &[S; 4]) -> [S; 4] {
        [x[2], x[3], S::zero(), S::zero()]
    }

    #[inline]
    fn input_map<S: Scalar>(&self, _x: &[S; 4]) -> [[S; 2]; 4] {
        let mut g = [[S::zero(); 2]; 4];
        g[2][0] = S::one();
        g[3][1] = S::one();
        g
    }

    fn region(&self, x: &[f64; 4], bounds: [&[f64]; 2], time: [f64; 2]) -> Option<Region> {
        bounded_box([&[x[0], x[2]], &[x[1], x[3]]], bounds, time)
    }
}

/// A point in the plane that is moved by its velocity: x = (x_p, y_p), u = (v_x, v_y).
///
/// ẋ_p = v_x, ẏ_p = v_y: a barrier on the position has relative degree 1.
#[derive(Clone, Copy, Debug, Default)]
pub struct MovedPoint;

impl Signals for MovedPoint {
    const STATES: &'static [Signal] = &[X_P, Y_P];
    const INPUTS: &'static [Signal] = &[V_X, V_Y];
}

impl ControlAffine<2, 2> for MovedPoint {
    const LARGEST_DEGREE: usize = 1;
    const SLOW_CURVATURE: bool = true;

    #[inline]
    fn drift<S: Scalar>(&self, _x: &[S; 2]) -> [S; 2] {
        [S::zero(); 2]
    }

    #[inline]
    fn input_map<S: Scalar>(&self, _x: &[S; 2]) -> [[S; 2]; 2] {
        [[S::one(), S::zero()], [S::zero(), S::one()]]
    }

    fn region(&self, x: &[f64; 2], bounds: [&[f64]; 2], time: [f64; 2]) -> Option<Region> {
        bounded_box([&[x[0]], &[x[1]]], bounds, time)
    }
}

/// A unicycle: x = (x_p, y_p, θ, v), u = (a, ω).
///
/// ẋ_p = v cos θ, ẏ_p = v sin θ, θ̇ = ω, v̇ = a.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unicycle;

impl Signals for Unicycle {
    const STATES: &'static [Signal] = &[X_P, Y_P, THETA, V];
    const INPUTS: &'static [Signal] = &[A, signal("omega", "rad/s", "turning rate")];
}

impl ControlAffine<4, 2> for Unicycle {
    const LARGEST_DEGREE: usize = VEHICLE_DEGREE;
    const SLOW_CURVATURE: bool = true;

    #[inline]
    fn drift<S: Scalar>(&self, x: &[S; 4]) -> [S; 4] {
        let (sin, cos) = x[2].sin_cos();
        [x[3] * cos, x[3] * sin, S::zero(), S::zero()]
    }

    #[inline]
    fn input_map<S: Scalar>(&self, _x: &[S; 4]) -> [[S; 2]; 4] {
        let mut g = [[S::zero(); 2]; 4];
        g[3][0] = S::one();
        g[2][1] = S::one();
        g
    }

    fn region(&self, x: &[f64; 4], bounds: [&[f64]; 2], time: [f64; 2]) -> Option<Region> {
        driven([x[0], x[1]], x[3], bounds, time[1], 1.0)
    }
}

/// The simplified bicycle of the paper's simulations: x = (x_p, y_p, θ, v), u = (a, β).
///
/// ẋ_p = v cos θ, ẏ_p = v sin θ, θ̇ = v β / l_r, v̇ = a. The slip angle β acts on the heading only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bicycle {
    l_r: f64,
}

impl Bicycle {
    /// A bicycle whose centre of mass lies `l_r` metres ahead of the rear axle (the paper: 10).
    ///
    /// # Errors
    ///
    /// `l_r` not finite or ≤ 0.
    pub fn new(l_r: f64) -> Result<Self, Error> {
        Ok(Self { l_r: positive("l_r", l_r)? })
    }
}

impl Signals for Bicycle {
    const STATES: &'static [Signal] = &[X_P, Y_P, THETA, V];
    const INPUTS: &'static [Signal] = &[A, BETA];
}

impl ControlAffine<4, 2> for Bicycle {
    const LARGEST_DEGREE: usize = VEHICLE_DEGREE;
    const SLOW_CURVATURE: bool = true;

    #[inline]
    fn drift<S: Scalar>(&self, x: &[S; 4]) -> [S; 4] {
        Unicycle.drift(x)
    }

    #[inline]
    fn input_map<S: Scalar>(&self, x: &[S; 4]) -> [[S; 2]; 4] {
        let mut g = [[S::zero(); 2]; 4];
        g[3][0] = S::one();
        g[2][1] = x[3] / self.l_r;
        g
    }

    fn region(&self, x: &[f64; 4], bounds: [&[f64]; 2], time: [f64; 2]) -> Option<Region> {
        driven([x[0], x[1]], x[3], bounds, time[1], 1.0)
    }
}

/// The bicycle for small slip angles: x = (x_p, y_p, θ, v), u = (a, β).
/// ẋ_p = v cos θ − vβ sin θ, ẏ_p = v sin θ + vβ cos θ, θ̇ = v β / l_r, v̇ = a. β moves the vehicle sideways at
/// once. So it enters the *first* derivative of a barrier on the position, and a only the second. That is a mixed
/// relative degree, which the filter refuses. [`SmallSlipBicycleWithRate`] has a uniform one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmallSlipBicycle {
    l_r: f64,
}

impl SmallSlipBicycle {
    /// A bicycle whose centre of mass lies `l_r` metres ahead of the rear axle.
    ///
    /// # Errors
    ///
    /// `l_r` not finite or ≤ 0.
    pub fn new(l_r: f64) -> Result<Self, Error> {
        Ok(Self { l_r: positive("l_r", l_r)? })
    }

    /// The same vehicle with the slip angle as a state and its rate as the input.
    pub fn with_rate(self) -> SmallSlipBicycleWithRate {
        SmallSlipBicycleWithRate(IntegratedInput::new(self, 1))
    }
}

impl Signals for SmallSlipBicycle {
    const STATES: &'static [Signal] = Bicycle::STATES;
    const INPUTS: &'static [Signal] = Bicycle::INPUTS;
}

impl ControlAffine<4, 2> for SmallSlipBicycle {
    const LARGEST_DEGREE: usize = VEHICLE_DEGREE;
    const SLOW_CURVATURE: bool = true;

    #[inline]
    fn drift<S: Scalar>(&self, x: &[S; 4]) -> [S; 4] {
        Unicycle.drift(x)
    }

    #[inline]
    fn input_map<S: Scalar>(&self, x: &[S; 4]) -> [[S; 2]; 4] {
        let (sin, cos) = x[2].sin_cos();
        let mut g = [[S::zero(); 2]; 4];
        g[3][0] = S::one();
        g[0][1] = -x[3] * sin;
        g[1][1] = x[3] * cos;
        g[2][1] = x[3] / self.l_r;
        g
    }

    fn region(&self, x: &[f64; 4], bounds: [&[f64]; 2], time: [f64; 2]) -> Option<Region> {
        let slip = bounds[0][1].abs().max(bounds[1][1].abs());
        driven([x[0], x[1]], x[3], bounds, time[1], elementary::hypot(slip, 1.0))
    }
}

/// [`SmallSlipBicycle`] with an integrator before β: x = (x_p, y_p, θ, v, β), u = (a, β̇).
///
/// A barrier on the position has relative degree 2 in both inputs.
#[derive(Clone, Copy, Debug)]
pub struct SmallSlipBicycleWithRate(IntegratedInput<SmallSlipBicycle, 4>);

impl Signals for SmallSlipBicycleWithRate {
    const STATES: &'static [Signal] = &[X_P, Y_P, THETA, V, BETA];
    const INPUTS: &'static [Signal] = &[A, signal("beta_rate", "rad/s", "rate of the slip angle")];
}

impl ControlAffine<5, 2> for SmallSlipBicycleWithRate {
    const LARGEST_DEGREE: usize = VEHICLE_DEGREE;
    const SLOW_CURVATURE: bool = true;

    #[inline]
    fn drift<S: Scalar>(&self, x: &[S; 5]) -> [S; 5] {
        self.0.drift(x)
    }

    #[inline]
    fn input_map<S: Scalar>(&self, x: &[S; 5]) -> [[S; 2]; 5] {
        self.0.input_map(x)
    }

    fn region(&self, x: &[f64; 5], bounds: [&[f64]; 2], time: [f64; 2]) -> Option<Region> {
        self.0.region(x, bounds, time)
    }
}

/// The kinematic bicycle, steered by the rate of its front wheel: x = (x_p, y_p, θ, v, δ), u = (a, δ̇).
///
/// ẋ_p = v cos(θ + β), ẏ_p = v sin(θ + β), θ̇ = (v/l_r) sin β with β = atan(l_r/(l_f + l_r) tan δ).
///
/// The model is not affine in δ, and a filter solves for inputs that enter linearly. With δ as a state it is
/// affine, exactly, and a barrier on the position has relative degree 2 in both inputs. |δ| must stay below π/2,
/// where the wheel stands across, and β jumps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KinematicBicycle {
    l_f: f64,
    l_r: f64,
}

impl KinematicBicycle {
    /// A bicycle whose centre of mass lies `l_f` metres behind the front axle and `l_r` metres ahead
    /// of the rear axle.
    ///
    /// # Errors
    ///
    /// A length that is not finite or ≤ 0.
    pub fn new(l_f: f64, l_r: f64) -> Result<Self, Error> {
        Ok(Self { l_f: positive("l_f", l_f)?, l_r: positive("l_r", l_r)? })
    }

    /// Slip angle β in rad that belongs to the steering angle `delta` in rad, |δ| < π/2.
    pub fn slip_angle<S: Scalar>(&self, delta: S) -> S {
        (delta.tan() * (self.l_r / (self.l_f + self.l_r))).atan()
    }

    /// Steering angle δ in rad that belongs to the slip angle `beta` in rad, |β| < π/2.
    pub fn steering_angle(&self, beta: f64) -> f64 {
        elementary::atan(elementary::tan(beta) * ((self.l_f + self.l_r) / self.l_r))
    }

    /// The same vehicle with an angle for its input. It is not affine in that, so it is a plant and no filter's
    /// model.
    pub fn steered(self, steering: Steering) -> SteeredBicycle {
        SteeredBicycle { bicycle: self, steering }
    }

    fn rates<S: Scalar>(&self, theta: S, v: S, beta: S) -> [S; 3] {
        let (sin, cos) = (theta + beta).sin_cos();
        [v * cos, v * sin, v * beta.sin() / self.l_r]
    }
}

impl Signals for KinematicBicycle {
    const STATES: &'static [Signal] = &[X_P, Y_P, THETA, V, DELTA];
    const INPUTS: &'static [Signal] = &[A, signal("delta_rate", "rad/s", "rate of the steering angle")];
}

impl ControlAffine<5, 2> for KinematicBicycle {
    const LARGEST_DEGREE: usize = VEHICLE_DEGREE;
    const SLOW_CURVATURE: bool = true;

    #[inline]
    fn drift<S: Scalar>(&self, x: &[S; 5]) -> [S; 5] {
        let [x_p, y_p, theta] = self.rates(x[2], x[3], self.slip_angle(x[4]));
        [x_p, y_p, theta, S::zero(), S::zero()]
    }

    #[inline]
    fn input_map<S: Scalar>(&self, _x: &[S; 5]) -> [[S; 2]; 5] {
        let mut g = [[S::zero(); 2]; 5];
        g[3][0] = S::one();
        g[4][1] = S::one();
        g
    }

    fn region(&self, x: &[f64; 5], bounds: [&[f64]; 2], time: [f64; 2]) -> Option<Region> {
        driven([x[0], x[1]], x[3], bounds, time[1], 1.0)
    }
}

/// The angle that steers a [`SteeredBicycle`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Steering {
    /// δ of the front wheel.
    Angle,
    /// β at the centre of mass, as the inputs of [`Bicycle`] and [`SmallSlipBicycle`] are: the conversion
    /// δ = atan((l_f + l_r)/l_r tan β) is made inside.
    SlipAngle,
}

impl Steering {
    /// The inputs, in order.
    pub fn inputs(self) -> &'static [Signal] {
        match self {
            Self::Angle => &[A, DELTA],
            Self::SlipAngle => Bicycle::INPUTS,
        }
    }
}

/// The [`KinematicBicycle`] steered by an angle itself: x = (x_p, y_p, θ, v), u = (a, δ) or (a, β).
#[derive(Clone, Copy, Debug)]
pub struct SteeredBicycle {
    bicycle: KinematicBicycle,
    steering: Steering,
}

impl SteeredBicycle {
    /// The states, in order.
    pub const STATES: &'static [Signal] = Bicycle::STATES;
}

impl DynPlant for SteeredBicycle {
    fn state_dim(&self) -> usize {
        Self::STATES.len()
    }

    fn input_dim(&self) -> usize {
        self.steering.inputs().len()
    }

    fn rk4_step(&self, x: &mut [f64], u: &[f64], dt: f64) -> Result<(), Error> {
        check_lengths((x, self.state_dim()), (u, self.input_dim()))?;
        let beta = match self.steering {
            Steering::Angle => self.bicycle.slip_angle(u[1]),
            Steering::SlipAngle => u[1],
        };
        let derivative = |x: &[f64; 4]| {
            let [x_p, y_p, theta] = self.bicycle.rates(x[2], x[3], beta);
            [x_p, y_p, theta, u[0]]
        };
        x.copy_from_slice(&rk4(derivative, &first(x), dt));
        Ok(())
    }
}

/// Box of the positions that a chain of integrators along each axis, at `from`, can reach under its bounds; none without.
fn bounded_box(from: [&[f64]; 2], bounds: [&[f64]; 2], time: [f64; 2]) -> Option<Region> {
    if !bounds.iter().all(|b| b[..2].iter().all(|v| v.is_finite())) {
        return None;
    }
    let side = |i: usize| chain(from[i], [bounds[0][i], bounds[1][i]], time);
    Some(Region { sides: [side(0), side(1)], radius: 0.0 })
}

/// Disc of the positions that a vehicle at `from` with the speed `v` can reach until `time`: no further away than
/// `factor` times the distance that the largest acceleration gives. The acceleration must be the first input; other bounds
/// are not read.
fn driven(from: [f64; 2], v: f64, bounds: [&[f64]; 2], time: f64, factor: f64) -> Option<Region> {
    let acceleration = bounds[0][0].abs().max(bounds[1][0].abs());
    if !acceleration.is_finite() || !factor.is_finite() {
        return None;
    }
    Some(Region::disc(from, factor * (v.abs() * time + acceleration * time * time / 2.0)))
}
