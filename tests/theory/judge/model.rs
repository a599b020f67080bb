//! The plants and sets of the judge: in the form that the filter gets, and again in plain numbers.

use std::sync::Arc;

use punctual_core::barrier::Barrier;
use punctual_core::barriers::{DistanceDisc, Outside, QuadraticDisc};
use punctual_core::dynamics::ControlAffine;
use punctual_core::lie::{self, DerivativeSource};
use punctual_core::plants::{Bicycle, KinematicBicycle, PointMass, SmallSlipBicycle, Unicycle};
use punctual_core::scalar::Scalar;
use punctual_models::Model;

use crate::chains::Chain;

/// The most states of a plant.
const STATES: usize = 8;

pub(crate) type State = [f64; STATES];
pub(crate) type Input = [f64; 2];

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Plant {
    /// This many integrators.
    Chain(usize),
    PointMass,
    Unicycle,
    Bicycle {
        l_r: f64,
    },
    /// The bicycle for small slip angles, with the slip angle as a state and its rate as the input.
    SmallSlip {
        l_r: f64,
    },
    /// The bicycle without approximation, with both axles equally far away and the steering angle as a state.
    Kinematic {
        length: f64,
    },
    /// p' = v, v' = u − a v − b v √(v² + 1); given by expressions, like all that follow.
    Cart {
        drag: [f64; 2],
    },
    /// θ' = ω, ω' = pull sin θ − drag ω + u.
    Pendulum {
        pull: f64,
        drag: f64,
    },
    /// z' = lead − v, v' = u − drag v.
    Cruise {
        lead: f64,
        drag: f64,
    },
    /// One or two integrators.
    Written(usize),
}

/// A set, h ≥ 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Shape {
    /// sign (x₁ − at).
    Line { sign: f64, at: f64 },
    /// A disc centred at `start + velocity t`; quadratic if it has no smoothing.
    Disc { start: [f64; 2], velocity: [f64; 2], radius: f64, smoothing: Option<f64>, outside: bool },
    /// limit² − x₁².
    Within { limit: f64 },
    /// limit − x₂.
    Slow { limit: f64 },
    /// limit − sign x₅.
    Angle { sign: f64, limit: f64 },
    /// x₁ − time x₂.
    Headway { time: f64 },
    /// x₁ − size sin(rate t).
    Wave { size: f64, rate: f64 },
}

impl Plant {
    pub(crate) fn states(&self) -> usize {
        match self {
            Self::Chain(n) | Self::Written(n) => *n,
            Self::PointMass | Self::Unicycle | Self::Bicycle { .. } => 4,
            Self::SmallSlip { .. } | Self::Kinematic { .. } => 5,
            Self::Cart { .. } | Self::Pendulum { .. } | Self::Cruise { .. } => 2,
        }
    }

    pub(crate) fn inputs(&self) -> usize {
        match self {
            Self::PointMass | Self::Unicycle | Self::Bicycle { .. } => 2,
            Self::SmallSlip { .. } | Self::Kinematic { .. } => 2,
            _ => 1,
        }
    }

    /// ẋ.
    pub(crate) fn derivative(&self, x: &State, u: &Input) -> State {
        let mut dx = [0.0; STATES];
        match *self {
            Self::Chain(n) | Self::Written(n) => {
                dx[..n - 1].copy_from_slice(&x[1..n]);
                dx[n - 1] = u[0];
            }
            Self::PointMass => dx[..4].copy_from_slice(&[x[2], x[3], u[0], u[1]]),
            Self::Unicycle | Self::Bicycle { .. } => {
                let turning = if let Self::Bicycle { l_r } = self { x[3] * u[1] / l_r } else { u[1] };
                dx[..4].copy_from_slice(&[x[3] * x[2].cos(), x[3] * x[2].sin(), turning, u[0]]);
            }
            Self::SmallSlip { l_r } => {
                let ([sin, cos], v, slip) = ([x[2].sin(), x[2].cos()], x[3], x[4]);
                let ahead = [v * (cos - slip * sin), v * (sin + slip * cos)];
                dx[..5].copy_from_slice(&[ahead[0], ahead[1], v * slip / l_r, u[0], u[1]]);
            }
            Self::Kinematic { length } => {
                let (v, slip) = (x[3], (0.5 * x[4].tan()).atan());
                let ahead = [v * (x[2] + slip).cos(), v * (x[2] + slip).sin()];
                dx[..5].copy_from_slice(&[ahead[0], ahead[1], v * slip.sin() / length, u[0], u[1]]);
            }
            Self::Cart { drag: [a, b] } => {
                dx[..2].copy_from_slice(&[x[1], u[0] - a * x[1] - b * x[1] * (x[1] * x[1] + 1.0).sqrt()]);
            }
            Self::Pendulum { pull, drag } => {
                dx[..2].copy_from_slice(&[x[1], pull * x[0].sin() - drag * x[1] + u[0]]);
            }
            Self::Cruise { lead, drag } => {
                dx[..2].copy_from_slice(&[lead - x[1], u[0] - drag * x[1]]);
            }
        }
        dx
    }

    /// Rate in rad/s at which the state turns under the input, which a grid must resolve.
    pub(crate) fn turning(&self, x: &State, u: &Input, dt: f64) -> f64 {
        match self {
            Self::Unicycle => u[1].abs(),
            Self::Bicycle { l_r } => (x[3].abs() + u[0].abs() * dt) * u[1].abs() / l_r,
            // An angle is below π/2, with a tangent of that order.
            Self::SmallSlip { l_r: length } | Self::Kinematic { length } => {
                (x[3].abs() + u[0].abs() * dt) * (x[4].abs() + u[1].abs() * dt) / length
            }
            _ => 0.0,
        }
    }

    /// The derivatives of each set's h along the plant, as the filter takes them.
    pub(crate) fn sources(&self, shapes: &[&Shape]) -> Vec<Box<dyn DerivativeSource>> {
        match *self {
            Self::PointMass => each(PointMass, shapes, disc),
            Self::Unicycle => each(Unicycle, shapes, disc),
            Self::Bicycle { l_r } => each(Bicycle::new(l_r).expect("valid bicycle"), shapes, disc),
            Self::SmallSlip { l_r } => {
                each(SmallSlipBicycle::new(l_r).expect("valid bicycle").with_rate(), shapes, steered)
            }
            Self::Kinematic { length } => {
                each(KinematicBicycle::new(length, length).expect("valid bicycle"), shapes, steered)
            }
            Self::Chain(1) => each(Chain::<1>, shapes, line),
            Self::Chain(2) => each(Chain::<2>, shapes, line),
            Self::Chain(3) => each(Chain::<3>, shapes, line),
            Self::Chain(4) => each(Chain::<4>, shapes, line),
            Self::Chain(5) => each(Chain::<5>, shapes, line),
            Self::Chain(6) => each(Chain::<6>, shapes, line),
            Self::Chain(7) => each(Chain::<7>, shapes, line),
            Self::Chain(_) => each(Chain::<8>, shapes, line),
            _ => each((), shapes, |plant, shape| self.written(plant, shape)),
        }
    }

    /// The same from expressions, along `plant`.
    fn written(&self, plant: Arc<()>, shape: &Shape) -> Box<dyn DerivativeSource> {
        let (states, derivatives, mut parameters): (_, Vec<&str>, Vec<(&str, f64)>) = match *self {
            Self::Cart { drag: [a, b] } => {
                (["y", "z"], vec!["z", "u - a*z - b*z*sqrt(z^2 + 1)"], vec![("a", a), ("b", b)])
            }
            Self::Pendulum { pull, drag } => {
                (["y", "z"], vec!["z", "g*sin(y) - c*z + u"], vec![("g", pull), ("c", drag)])
            }
            Self::Cruise { lead, drag } => {
                (["y", "z"], vec!["lead - z", "u - c*z"], vec![("lead", lead), ("c", drag)])
            }
            Self::Written(1) => (["y", ""], vec!["u"], vec![]),
            _ => (["y", "z"], vec!["z", "u"], vec![]),
        };
        let (text, n, more) = match *shape {
            Shape::Line { sign, at } => ("s*(y - d)", self.states(), [("s", sign), ("d", at)]),
            Shape::Within { limit } => ("d^2 - y^2", 2, [("d", limit), ("s", 0.0)]),
            Shape::Slow { limit } => ("d - z", 1, [("d", limit), ("s", 0.0)]),
            Shape::Headway { time } => ("y - d*z", 1, [("d", time), ("s", 0.0)]),
            Shape::Wave { size, rate } => ("y - s*sin(d*t)", self.states(), [("s", size), ("d", rate)]),
            Shape::Disc { .. } | Shape::Angle { .. } => panic!("no set of an expression: {shape:?}"),
        };
        parameters.extend(more);
        let model = Model::new(&states[..derivatives.len()], &["u"], &parameters, &derivatives);
        let model = model.map(|model| model.as_form_of(plant));
        let barrier = model.and_then(|model| model.barrier(text)).expect("valid expressions");
        barrier.source(n).expect("a relative degree")
    }
}

impl Shape {
    /// h.
    pub(crate) fn value(&self, t: f64, x: &State) -> f64 {
        match *self {
            Self::Line { sign, at } => sign * (x[0] - at),
            Self::Disc { start, velocity, radius, smoothing, outside } => {
                let away = [0, 1].map(|i| x[i] - start[i] - velocity[i] * t);
                let inside = match smoothing {
                    Some(s) => radius.hypot(s) - away[0].hypot(away[1]).hypot(s),
                    None => radius * radius - away[0] * away[0] - away[1] * away[1],
                };
                if outside { -inside } else { inside }
            }
            Self::Within { limit } => limit * limit - x[0] * x[0],
            Self::Slow { limit } => limit - x[1],
            Self::Angle { sign, limit } => limit - sign * x[4],
            Self::Headway { time } => x[0] - time * x[1],
            Self::Wave { size, rate } => x[0] - size * (rate * t).sin(),
        }
    }

    /// Rate in rad/s at which the set itself turns.
    pub(crate) fn turning(&self) -> f64 {
        if let Self::Wave { rate, .. } = self { rate.abs() } else { 0.0 }
    }
}

/// sign (x₁ − at), for the filter.
#[derive(Clone, Copy)]
struct Line {
    sign: f64,
    at: f64,
}

impl<const N: usize> Barrier<N> for Line {
    fn value<S: Scalar>(&self, _t: S, x: &[S; N]) -> S {
        (x[0] - self.at) * self.sign
    }
}

/// The sources of all sets along one plant.
fn each<P>(
    plant: P,
    shapes: &[&Shape],
    source: impl Fn(Arc<P>, &Shape) -> Box<dyn DerivativeSource>,
) -> Vec<Box<dyn DerivativeSource>> {
    let plant = Arc::new(plant);
    shapes.iter().map(|shape| source(Arc::clone(&plant), shape)).collect()
}

fn line<const N: usize>(plant: Arc<Chain<N>>, shape: &Shape) -> Box<dyn DerivativeSource> {
    let &Shape::Line { sign, at } = shape else { panic!("no set of a chain: {shape:?}") };
    lie::along(plant, Line { sign, at }, N).expect("a relative degree")
}

/// limit − sign x₅, for the filter.
#[derive(Clone, Copy)]
struct Angle {
    sign: f64,
    limit: f64,
}

impl Barrier<5> for Angle {
    fn value<S: Scalar>(&self, _t: S, x: &[S; 5]) -> S {
        x[4] * -self.sign + self.limit
    }
}

fn steered<P>(plant: Arc<P>, shape: &Shape) -> Box<dyn DerivativeSource>
where
    P: ControlAffine<5, 2> + Send + Sync + 'static,
{
    let &Shape::Angle { sign, limit } = shape else { return disc(plant, shape) };
    lie::along(plant, Angle { sign, limit }, 1).expect("a relative degree")
}

fn disc<P, const N: usize>(plant: Arc<P>, shape: &Shape) -> Box<dyn DerivativeSource>
where
    P: ControlAffine<N, 2> + Send + Sync + 'static,
{
    let &Shape::Disc { start, velocity, radius, smoothing, outside } = shape else {
        panic!("no set of a vehicle: {shape:?}")
    };
    let source = if let Some(smoothing) = smoothing {
        let disc = DistanceDisc::new(start, radius, smoothing).and_then(|d| d.moving(velocity));
        let disc = disc.expect("valid disc");
        if outside { lie::along(plant, Outside(disc), 2) } else { lie::along(plant, disc, 2) }
    } else {
        let disc = QuadraticDisc::new(start, radius).and_then(|d| d.moving(velocity)).expect("valid disc");
        if outside { lie::along(plant, Outside(disc), 2) } else { lie::along(plant, disc, 2) }
    };
    source.expect("a relative degree")
}
