//! Systems for the tests of derivatives, one for each case of `cas/generate.py`, and a source that does less.

#![allow(dead_code, reason = "each test binary uses its part")]

use std::sync::Arc;

use punctual_core::barrier::Barrier;
use punctual_core::barriers::{DistanceDisc, QuadraticDisc};
use punctual_core::dynamics::ControlAffine;
use punctual_core::lie::{self, DerivativeSource, Derivatives, Directional, Predict, PredictDirectional};
use punctual_core::plants::{Bicycle, PointMass, Unicycle};
use punctual_core::scalar::Scalar;

/// A matrix of zeros with `value` in the last row: one input, in the last equation.
fn last_equation<S: Scalar, const NX: usize>(value: S) -> [[S; 1]; NX] {
    let mut g = [[S::zero()]; NX];
    g[NX - 1][0] = value;
    g
}

/// ẋ₁ = x₂, ẋ₂ = −x₂²/8 − x₁³ + e^{−x₁/4} u.
#[derive(Clone, Copy)]
pub(crate) struct Cart;

impl ControlAffine<2, 1> for Cart {
    fn drift<S: Scalar>(&self, x: &[S; 2]) -> [S; 2] {
        [x[1], -x[1].squared() / 8.0 - x[0].powi(3)]
    }
    fn input_map<S: Scalar>(&self, x: &[S; 2]) -> [[S; 1]; 2] {
        last_equation((-x[0] / 4.0).exp())
    }
}

/// h = (1 + x₁²)^{−7/4} − x₁⁵/16 + (3 + x₁)⁻³.
pub(crate) struct Powers;

impl Barrier<2> for Powers {
    fn value<S: Scalar>(&self, _t: S, x: &[S; 2]) -> S {
        (x[0].squared() + 1.0).powf(-1.75) - x[0].powi(5) / 16.0 + (x[0] + 3.0).powi(-3)
    }
}

/// Four equations, a different function in each, u in the last.
#[derive(Clone, Copy)]
pub(crate) struct Chain4;

impl ControlAffine<4, 1> for Chain4 {
    fn drift<S: Scalar>(&self, x: &[S; 4]) -> [S; 4] {
        [
            x[1].sin(),
            x[2] / (x[0].squared() + 1.0),
            (-x[0]).exp() + x[3],
            (x[0].sin() + 2.0).sqrt() * (x[1].squared() + 1.5).powf(0.625),
        ]
    }
    fn input_map<S: Scalar>(&self, x: &[S; 4]) -> [[S; 1]; 4] {
        last_equation(x[0].cos() + 2.0)
    }
}

/// h = ln(2 + x₁) + atan x₁ − ½ tan(x₁/2).
pub(crate) struct Logarithmic;

impl Barrier<4> for Logarithmic {
    fn value<S: Scalar>(&self, _t: S, x: &[S; 4]) -> S {
        (x[0] + 2.0).ln() + x[0].atan() - (x[0] / 2.0).tan() / 2.0
    }
}

/// Eight equations, nonlinear terms that leave the order of u at eight.
#[derive(Clone, Copy)]
pub(crate) struct Chain8;

impl ControlAffine<8, 1> for Chain8 {
    fn drift<S: Scalar>(&self, x: &[S; 8]) -> [S; 8] {
        [x[1], x[2], x[3] + x[0].sin() / 2.0, x[4], x[5] - x[1] * x[2] / 4.0, x[6], x[7] + x[3].cos(), -x[0]]
    }
    fn input_map<S: Scalar>(&self, x: &[S; 8]) -> [[S; 1]; 8] {
        last_equation(x[0].cos() + 2.0)
    }
}

/// h = e^{−x₁/2} − 1.
pub(crate) struct Exponential;

impl Barrier<8> for Exponential {
    fn value<S: Scalar>(&self, _t: S, x: &[S; 8]) -> S {
        (-x[0] / 2.0).exp() - 1.0
    }
}

/// A disc whose centre moves and whose radius breathes:
/// h = 2 + cos(t)/4 − √((x_p − 8 − 3 sin(t/2))² + (y_p − t²/4 + 1)² + 1).
pub(crate) struct MovingDisc;

impl Barrier<4> for MovingDisc {
    fn value<S: Scalar>(&self, t: S, x: &[S; 4]) -> S {
        let dx = x[0] - 8.0 - (t / 2.0).sin() * 3.0;
        let dy = x[1] - t.squared() / 4.0 + 1.0;
        t.cos() / 4.0 + 2.0 - (dx.squared() + dy.squared() + 1.0).sqrt()
    }
}

/// h = 30 − v²/4.
pub(crate) struct SpeedLimit;

impl Barrier<4> for SpeedLimit {
    fn value<S: Scalar>(&self, _t: S, x: &[S; 4]) -> S {
        -x[3].squared() / 4.0 + 30.0
    }
}

/// h = 1 − x₂: for a state that no input reaches.
pub(crate) struct SecondState;

impl<const NX: usize> Barrier<NX> for SecondState {
    fn value<S: Scalar>(&self, _t: S, x: &[S; NX]) -> S {
        -x[1] + 1.0
    }
}

/// ẋ₁ = u, ẋ₂ = −x₂ + x₂²/2: the second state is autonomous.
#[derive(Clone, Copy)]
pub(crate) struct Uncoupled;

impl ControlAffine<2, 1> for Uncoupled {
    fn drift<S: Scalar>(&self, x: &[S; 2]) -> [S; 2] {
        [S::zero(), -x[1] + x[1].squared() / 2.0]
    }
    fn input_map<S: Scalar>(&self, _x: &[S; 2]) -> [[S; 1]; 2] {
        [[S::one()], [S::zero()]]
    }
}

/// The quadratic disc of the cases `*/quadratic`.
pub(crate) fn quadratic_disc() -> QuadraticDisc {
    QuadraticDisc::new([45.0, 45.0], 2.0).expect("valid disc")
}

/// The distance-shaped disc of the cases `*/distance`.
pub(crate) fn distance_disc() -> DistanceDisc {
    DistanceDisc::new([40.5, -3.25], 2.5, 0.75).expect("valid disc")
}

/// The bicycle of the paper.
pub(crate) fn bicycle() -> Bicycle {
    Bicycle::new(10.0).expect("valid bicycle")
}

/// The derivatives of the case `name` of `values.csv`, at its relative degree.
pub(crate) fn source(name: &str) -> Box<dyn DerivativeSource> {
    match name {
        "point_mass/quadratic" => lie::along(Arc::new(PointMass), quadratic_disc(), 2),
        "point_mass/distance" => lie::along(Arc::new(PointMass), distance_disc(), 2),
        "unicycle/quadratic" => lie::along(Arc::new(Unicycle), quadratic_disc(), 2),
        "unicycle/distance" => lie::along(Arc::new(Unicycle), distance_disc(), 2),
        "unicycle/moving" => lie::along(Arc::new(Unicycle), MovingDisc, 2),
        "bicycle/quadratic" => lie::along(Arc::new(bicycle()), quadratic_disc(), 2),
        "bicycle/distance" => lie::along(Arc::new(bicycle()), distance_disc(), 2),
        "bicycle/speed" => lie::along(Arc::new(bicycle()), SpeedLimit, 1),
        "cart/powers" => lie::along(Arc::new(Cart), Powers, 2),
        "chain4" => lie::along(Arc::new(Chain4), Logarithmic, 4),
        "chain8" => lie::along(Arc::new(Chain8), Exponential, 8),
        _ => panic!("values.csv has the case {name}, which tests/support does not"),
    }
    .expect("a relative degree in range")
}

/// A source that does less than it could: it shares no plant, and where it is blind it knows none.
pub(crate) struct Reduced {
    source: Box<dyn DerivativeSource>,
    blind: bool,
}

impl Reduced {
    pub(crate) fn alone(source: Box<dyn DerivativeSource>) -> Self {
        Self { source, blind: false }
    }

    pub(crate) fn blind(source: Box<dyn DerivativeSource>) -> Self {
        Self { source, blind: true }
    }

    fn sighted(&self) -> Option<&dyn DerivativeSource> {
        (!self.blind).then_some(&*self.source)
    }
}

impl DerivativeSource for Reduced {
    fn relative_degree(&self) -> usize {
        self.source.relative_degree()
    }
    fn state_dim(&self) -> usize {
        self.source.state_dim()
    }
    fn input_dim(&self) -> usize {
        self.source.input_dim()
    }
    fn evaluate(&self, t: f64, x: &[f64], out: &mut Derivatives) {
        self.source.evaluate(t, x, out);
    }
    fn predict(&self) -> Option<&dyn Predict> {
        self.sighted()?.predict()
    }
    fn directional(&self) -> Option<&dyn Directional> {
        self.sighted()?.directional()
    }
    fn predict_directional(&self) -> Option<&dyn PredictDirectional> {
        self.sighted()?.predict_directional()
    }
    fn highest(&self, t: f64, x: &[f64], bounds: [&[f64]; 2], time: [f64; 2]) -> Option<f64> {
        self.sighted()?.highest(t, x, bounds, time)
    }
}
