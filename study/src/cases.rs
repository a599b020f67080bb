//! The cases of the study and the demonstration: vehicles, barriers, nominal controllers, and the settings of a
//! loop.

use std::sync::Arc;

use std::array::from_fn;

use punctual_core::barriers::{DistanceDisc, QuadraticDisc};
use punctual_core::dynamics::{ControlAffine, rk4_step};
use punctual_core::elementary;
use punctual_core::lie::{self, DerivativeSource};
use punctual_core::plants::{Bicycle, PointMass, Signal, Signals, Unicycle};
use punctual_cosim::error::Error;

/// Deadline in s of the runs from rest and of the pictures over time, as in the paper.
pub const DEADLINE: f64 = 10.0;
/// Default sampling period in s.
pub const STEP: f64 = 1e-3;
/// Centre of the safe disc in m.
pub const CENTRE: [f64; 2] = [45.0, 45.0];
/// Radius of the safe disc in m.
pub const RADIUS: f64 = 2.0;
/// ε of the distance-shaped disc in m.
pub(super) const SMOOTHING: f64 = 2.0;
/// l_r of the bicycle in m.
pub(super) const REAR: f64 = 10.0;

/// A plant of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vehicle {
    /// (x_p, y_p, v_x, v_y), inputs (u_x, u_y).
    PointMass,
    /// (x_p, y_p, θ, v), inputs (a, ω).
    Unicycle,
    /// (x_p, y_p, θ, v), inputs (a, β): the simplified model.
    Bicycle,
}

impl Vehicle {
    /// All three.
    pub const ALL: [Self; 3] = [Self::PointMass, Self::Unicycle, Self::Bicycle];

    /// Its name in tables.
    pub fn title(self) -> &'static str {
        match self {
            Self::PointMass => "point mass",
            Self::Unicycle => "unicycle",
            Self::Bicycle => "bicycle",
        }
    }

    /// Its name in configurations and file names.
    pub fn key(self) -> &'static str {
        match self {
            Self::PointMass => "point_mass",
            Self::Unicycle => "unicycle",
            Self::Bicycle => "bicycle",
        }
    }

    /// Its four states and its two inputs, as in configurations.
    pub fn signals(self) -> [&'static [Signal]; 2] {
        match self {
            Self::PointMass => [PointMass::STATES, PointMass::INPUTS],
            Self::Unicycle => [Unicycle::STATES, Unicycle::INPUTS],
            Self::Bicycle => [Bicycle::STATES, Bicycle::INPUTS],
        }
    }

    /// Its two inputs, as in configurations.
    pub fn inputs(self) -> &'static [Signal] {
        self.signals()[1]
    }

    /// The index of the state that is the speed changed by each input. The damping input is its negative.
    pub fn damped(self) -> [Option<usize>; 2] {
        match self {
            Self::PointMass => [Some(2), Some(3)],
            Self::Unicycle | Self::Bicycle => [Some(3), None],
        }
    }

    pub(super) fn reference(self, nominal: Nominal, x: &[f64; 4]) -> [f64; 2] {
        let to = [CENTRE[0] - x[0], CENTRE[1] - x[1]];
        match (nominal, self) {
            (Nominal::Coast, _) => [0.0; 2],
            (Nominal::Damping, _) => self.damped().map(|speed| speed.map_or(0.0, |k| -x[k])),
            (Nominal::Away(size), Self::PointMass) => {
                let distance = elementary::hypot(to[0], to[1]).max(f64::MIN_POSITIVE);
                to.map(|d| -size * d / distance)
            }
            (Nominal::Away(size), _) => {
                let (sin, cos) = elementary::sin_cos(x[2]);
                let ahead = to[0] * cos + to[1] * sin;
                [if ahead < 0.0 { size } else { -size }, 0.0]
            }
        }
    }

    /// The derivatives of the barrier of this `shape`.
    ///
    /// # Errors
    ///
    /// None in practice, since all numbers are constants.
    pub fn source(self, shape: Shape) -> Result<Box<dyn DerivativeSource>, Error> {
        fn shaped<P>(plant: P, shape: Shape) -> Result<Box<dyn DerivativeSource>, punctual_core::Error>
        where
            P: ControlAffine<4, 2> + Send + Sync + 'static,
        {
            match shape {
                Shape::Quadratic => lie::along(Arc::new(plant), QuadraticDisc::new(CENTRE, RADIUS)?, 2),
                Shape::Distance => {
                    lie::along(Arc::new(plant), DistanceDisc::new(CENTRE, RADIUS, SMOOTHING)?, 2)
                }
            }
        }
        let source = match self {
            Self::PointMass => shaped(PointMass, shape),
            Self::Unicycle => shaped(Unicycle, shape),
            Self::Bicycle => Bicycle::new(REAR).and_then(|plant| shaped(plant, shape)),
        };
        source.map_err(Error::from)
    }

    pub(super) fn advance(self, integrator: Integrator, x: &[f64; 4], u: &[f64; 2], dt: f64) -> [f64; 4] {
        match self {
            Self::PointMass => integrator.step(&PointMass, x, u, dt),
            Self::Unicycle => integrator.step(&Unicycle, x, u, dt),
            Self::Bicycle => match Bicycle::new(REAR) {
                Ok(plant) => integrator.step(&plant, x, u, dt),
                Err(_) => *x,
            },
        }
    }
}

/// A signal's unit for display.
pub fn unit(signal: &Signal) -> String {
    signal.unit.replace('2', "²")
}

/// A signal's symbol and unit for display.
pub fn label(signal: &Signal) -> String {
    let symbol = match signal.name {
        "omega" => "ω",
        "beta" => "β",
        name => name,
    };
    format!("{symbol} ({})", unit(signal))
}

/// The forms of the barrier, which describe the same set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// R² − d², in m²: the paper's.
    Quadratic,
    /// √(R² + ε²) − √(d² + ε²), in m: ours.
    Distance,
}

impl Shape {
    /// The unit of h.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Quadratic => "m²",
            Self::Distance => "m",
        }
    }
}

/// The choices of u_ref.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Nominal {
    /// 0: the paper's.
    Coast,
    /// −v on the accelerations: ours.
    Damping,
    /// This acceleration (m/s²) away from the disc. Only the constraint leads to the disc, and is active
    /// throughout.
    Away(f64),
}

/// Integrators of the plant with a held input. The paper does not say which one it uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Integrator {
    /// x + f dt.
    Euler,
    /// Euler for the last two states, then the positions with the new values.
    SemiImplicit,
    /// Runge-Kutta of order 4.
    Rk4,
}

impl Integrator {
    /// All three.
    pub const ALL: [Self; 3] = [Self::Euler, Self::SemiImplicit, Self::Rk4];

    /// Its name in tables.
    pub fn title(self) -> &'static str {
        match self {
            Self::Euler => "Euler",
            Self::SemiImplicit => "semi-implicit",
            Self::Rk4 => "RK4",
        }
    }

    fn step<P: ControlAffine<4, 2>>(self, plant: &P, x: &[f64; 4], u: &[f64; 2], dt: f64) -> [f64; 4] {
        let way = |x: &[f64; 4]| {
            let (f, g) = (plant.drift(x), plant.input_map(x));
            from_fn::<f64, 4, _>(|i| (f[i] + (g[i][0] * u[0] + g[i][1] * u[1])) * dt)
        };
        match self {
            Self::Euler => {
                let now = way(x);
                from_fn(|i| x[i] + now[i])
            }
            Self::SemiImplicit => {
                let now = way(x);
                let mut next = [x[0], x[1], x[2] + now[2], x[3] + now[3]];
                let then = way(&next);
                next[0] += then[0];
                next[1] += then[1];
                next
            }
            Self::Rk4 => rk4_step(plant, x, u, dt),
        }
    }
}

/// The settings of a loop, besides vehicle and constraint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setup {
    /// The barrier.
    pub shape: Shape,
    /// u_ref.
    pub nominal: Nominal,
    /// Margin μ in the unit of h.
    pub margin: f64,
    /// Deadline T in s.
    pub deadline: f64,
    /// Sampling period in s.
    pub step: f64,
    /// End of the run in s.
    pub end: f64,
    /// Bounds on |u_1| and |u_2|, if any.
    pub bounds: Option<[f64; 2]>,
    /// The integrator of the plant.
    pub integrator: Integrator,
}

impl Setup {
    /// The paper's settings: R² − d², u_ref = 0, no margin, until 2T.
    pub fn paper(deadline: f64, step: f64) -> Self {
        Self {
            shape: Shape::Quadratic,
            nominal: Nominal::Coast,
            margin: 0.0,
            deadline,
            step,
            end: 2.0 * deadline,
            bounds: None,
            integrator: Integrator::Rk4,
        }
    }

    /// The settings that we recommend: the distance-shaped disc, damping, a margin of 0.02 m, until 2T.
    pub fn advised(deadline: f64, step: f64) -> Self {
        Self {
            shape: Shape::Distance,
            nominal: Nominal::Damping,
            margin: 0.02,
            ..Self::paper(deadline, step)
        }
    }

    /// Whether it has the barrier and the nominal controller that we recommend.
    pub fn is_advised(&self) -> bool {
        self.shape == Shape::Distance && self.nominal == Nominal::Damping
    }

    /// Its name in tables.
    pub fn title(&self) -> &'static str {
        if self.is_advised() { "distance, damping" } else { "quadratic, u_ref = 0" }
    }
}
