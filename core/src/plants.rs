//! Reference plants, with the state and input order of the paper, section IV.

use nalgebra::{SMatrix, SVector};

use crate::dynamics::ControlAffine;
use crate::error::{Error, positive};
use crate::scalar::Scalar;

/// One component of a state or input: what it is called, its unit and its meaning.
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
const A: Signal = signal("a", "m/s2", "acceleration along the heading");

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
    const STATES: &'static [Signal] =
        &[X_P, Y_P, signal("v_x", "m/s", "velocity along x"), signal("v_y", "m/s", "velocity along y")];
    const INPUTS: &'static [Signal] =
        &[signal("u_x", "m/s2", "acceleration along x"), signal("u_y", "m/s2", "acceleration along y")];
}

impl ControlAffine<4, 2> for PointMass {
    fn drift<S: Scalar>(&self, x: &SVector<S, 4>) -> SVector<S, 4> {
        SVector::from([x[2], x[3], S::zero(), S::zero()])
    }

    fn input_map<S: Scalar>(&self, _x: &SVector<S, 4>) -> SMatrix<S, 4, 2> {
        let mut g = SMatrix::zeros();
        g[(2, 0)] = S::one();
        g[(3, 1)] = S::one();
        g
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
    fn drift<S: Scalar>(&self, x: &SVector<S, 4>) -> SVector<S, 4> {
        let (sin, cos) = x[2].sin_cos();
        SVector::from([x[3] * cos, x[3] * sin, S::zero(), S::zero()])
    }

    fn input_map<S: Scalar>(&self, _x: &SVector<S, 4>) -> SMatrix<S, 4, 2> {
        let mut g = SMatrix::zeros();
        g[(3, 0)] = S::one();
        g[(2, 1)] = S::one();
        g
    }
}

/// The simplified kinematic bicycle of the paper's simulations: x = (x_p, y_p, θ, v), u = (a, β).
///
/// ẋ_p = v cos θ, ẏ_p = v sin θ, θ̇ = v β / l_r, v̇ = a. The slip angle β acts on the heading only.
#[derive(Clone, Copy, Debug)]
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
    const INPUTS: &'static [Signal] = &[A, signal("beta", "rad", "slip angle at the centre of mass")];
}

impl ControlAffine<4, 2> for Bicycle {
    fn drift<S: Scalar>(&self, x: &SVector<S, 4>) -> SVector<S, 4> {
        Unicycle.drift(x)
    }

    fn input_map<S: Scalar>(&self, x: &SVector<S, 4>) -> SMatrix<S, 4, 2> {
        let mut g = SMatrix::zeros();
        g[(3, 0)] = S::one();
        g[(2, 1)] = x[3] / self.l_r;
        g
    }
}
