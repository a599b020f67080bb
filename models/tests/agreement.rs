//! Compares models given by expressions with the same models in Rust, on the jets of the core.

use std::sync::Arc;

use proptest::prelude::*;
use punctual_core::barrier::Barrier;
use punctual_core::barriers::DistanceDisc;
use punctual_core::dynamics::{ControlAffine, DynPlant, Erased};
use punctual_core::internal;
use punctual_core::lie::{self, Ahead, DerivativeSource, Derivatives, Direction, RelativeDegree};
use punctual_core::plants::{Bicycle, KinematicBicycle, PointMass, SmallSlipBicycle, Unicycle};
use punctual_core::scalar::Scalar;
use punctual_models::Model;

/// A random expression: as text for one side, as a tree for the other.
#[derive(Clone, Debug)]
enum Tree {
    State(usize),
    Time,
    Number(f64),
    Unary(&'static str, Arc<Tree>),
    Binary(&'static str, Arc<Tree>, Arc<Tree>),
    Power(Arc<Tree>, f64),
}

impl Tree {
    fn text(&self) -> String {
        match self {
            Self::State(i) => ["x", "y"][*i].to_owned(),
            Self::Time => "t".to_owned(),
            Self::Number(value) => format!("({value:?})"),
            Self::Unary("-", a) => format!("(-{})", a.text()),
            Self::Unary(function, a) => format!("{function}({})", a.text()),
            Self::Binary(function, a, b) if function.len() > 1 => {
                format!("{function}({}, {})", a.text(), b.text())
            }
            Self::Binary(sign, a, b) => format!("({} {sign} {})", a.text(), b.text()),
            Self::Power(a, exponent) => format!("({})^({exponent:?})", a.text()),
        }
    }

    fn value<S: Scalar>(&self, t: S, x: &[S; 2]) -> S {
        match self {
            Self::State(i) => x[*i],
            Self::Time => t,
            Self::Number(value) => S::from(*value),
            Self::Unary(function, a) => {
                let a = a.value(t, x);
                match *function {
                    "-" => -a,
                    "sqrt" => a.sqrt(),
                    "exp" => a.exp(),
                    "ln" => a.ln(),
                    "sin" => a.sin(),
                    "cos" => a.cos(),
                    "tan" => a.tan(),
                    "atan" => a.atan(),
                    "tanh" => a.tanh(),
                    "abs" => a.abs(),
                    _ => panic!("{function}"),
                }
            }
            Self::Binary(function, a, b) => {
                let (a, b) = (a.value(t, x), b.value(t, x));
                match *function {
                    "+" => a + b,
                    "-" => a - b,
                    "*" => a * b,
                    "/" => a / b,
                    "atan2" => a.atan2(b),
                    "min" => a.min(b),
                    "max" => a.max(b),
                    _ => panic!("{function}"),
                }
            }
            Self::Power(a, exponent) if exponent.fract() == 0.0 => a.value(t, x).powi(*exponent as i32),
            Self::Power(a, exponent) => a.value(t, x).powf(*exponent),
        }
    }
}

fn tree(time: bool) -> impl Strategy<Value = Tree> {
    let leaf = prop_oneof![
        (0_usize..2).prop_map(Tree::State),
        (-4_i32..=8).prop_map(|n| Tree::Number(f64::from(n) / 2.0)),
        Just(if time { Tree::Time } else { Tree::State(0) }),
    ];
    leaf.prop_recursive(5, 24, 2, |inner| {
        let inner = inner.prop_map(Arc::new);
        let unary =
            prop::sample::select(vec!["-", "sqrt", "exp", "ln", "sin", "cos", "tan", "atan", "tanh", "abs"]);
        let binary = prop::sample::select(vec!["+", "-", "*", "/", "atan2", "min", "max"]);
        prop_oneof![
            (unary, inner.clone()).prop_map(|(f, a)| Tree::Unary(f, a)),
            (binary, inner.clone(), inner.clone()).prop_map(|(f, a, b)| Tree::Binary(f, a, b)),
            (inner, prop::sample::select(vec![-2.0, 0.5, 1.7, 2.0, 3.0]))
                .prop_map(|(a, p)| Tree::Power(a, p)),
        ]
    })
}

/// ẋ = a + u, ẏ = b + c u + w.
struct Random([Tree; 3]);

impl ControlAffine<2, 2> for Random {
    fn drift<S: Scalar>(&self, x: &[S; 2]) -> [S; 2] {
        [self.0[0].value(S::zero(), x), self.0[1].value(S::zero(), x)]
    }

    fn input_map<S: Scalar>(&self, x: &[S; 2]) -> [[S; 2]; 2] {
        [[S::one(), S::zero()], [self.0[2].value(S::zero(), x), S::one()]]
    }
}

impl Barrier<2> for Tree {
    fn value<S: Scalar>(&self, t: S, x: &[S; 2]) -> S {
        Self::value(self, t, x)
    }
}

/// Everything that two sources give at one sample, as pairs of numbers.
fn both(found: &dyn DerivativeSource, wanted: &dyn DerivativeSource, x: &[f64], u: &[f64]) -> Vec<[f64; 2]> {
    const T: f64 = 0.3;
    const AHEAD: f64 = 0.01;
    let each = |source: &dyn DerivativeSource| {
        let (mut here, mut ahead) = (Derivatives::ZERO, Ahead::ZERO);
        source.evaluate(T, x, &mut here);
        let model = source.predict().expect("a model");
        model.ahead(T, x, u, AHEAD, &mut ahead);
        let mut moved = x.to_vec();
        model.flow(&mut moved, u, AHEAD);
        let (dx, du): (Vec<f64>, Vec<f64>) = (
            (1..=x.len()).map(|i| 0.1 * i as f64).collect(),
            (1..=u.len()).map(|i| -0.2 * i as f64).collect(),
        );
        let (mut here_directional, mut ahead_directional) = (Ahead::ZERO, Ahead::ZERO);
        let direction = Direction { x: &dx, u: &du };
        let instant = source.directional().expect("a model");
        instant.evaluate_directional(T, x, u, direction, &mut here_directional);
        let model = source.predict_directional().expect("a model");
        model.ahead_directional(T, x, u, direction, AHEAD, &mut ahead_directional);
        let (mut from, mut turned) = (x.to_vec(), dx);
        model.flow_directional(&mut from, &mut turned, u, AHEAD);
        let mut all = moved;
        all.extend(turned.iter().chain(&from));
        for along in [here_directional, ahead_directional] {
            all.extend(along.value.iter().chain(along.gradient.as_flattened()));
        }
        all.extend(here.drift.iter().chain(&here.row).chain([&here.lower_sensitivity]));
        all.extend(ahead.value.iter().chain(ahead.gradient.as_flattened()));
        all
    };
    each(found).into_iter().zip(each(wanted)).map(|(a, b)| [a, b]).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn random_models_have_the_derivatives_of_the_jets(
        plant in [tree(false), tree(false), tree(false)],
        barrier in tree(true),
        x in prop::array::uniform2(0.2_f64..3.0),
        n in 1_usize..=2,
    ) {
        let derivatives = [
            format!("{} + u", plant[0].text()),
            format!("{} + {}*u + w", plant[1].text(), plant[2].text()),
        ];
        let model = Model::new(&["x", "y"], &["u", "w"], &[], &[&derivatives[0], &derivatives[1]]);
        let found = model.and_then(|m| m.barrier(&barrier.text())).and_then(|b| b.source(n));
        let found = found.unwrap_or_else(|e| panic!("{e}"));
        let wanted = lie::along(Arc::new(Random(plant)), barrier, n).expect("in range");
        let pairs = both(&*found, &*wanted, &x, &[0.3, -0.4]);
        // Round-off grows with the terms added up; beyond this size the sample says little.
        let size = pairs.iter().map(|p| p[1].abs()).fold(1.0, f64::max);
        prop_assume!(pairs.iter().all(|p| p[1].is_finite()) && size < 1e6);
        for (i, [found, wanted]) in pairs.into_iter().enumerate() {
            prop_assert!((found - wanted).abs() <= 1e-9 * size, "{i}: {found} {wanted}");
        }
    }
}

/// The bits of everything that rows ask of a source at one sample.
fn bits(source: &dyn DerivativeSource, x: &[f64], u: &[f64]) -> Vec<u64> {
    const T: f64 = 0.3;
    const AHEAD: f64 = 0.01;
    let (mut here, mut ahead, mut of_row) = (Derivatives::ZERO, Ahead::ZERO, Ahead::ZERO);
    source.evaluate(T, x, &mut here);
    let model = source.predict().expect("a model");
    let (mut moved, mut rate) = (x.to_vec(), x.to_vec());
    model.ahead(T, x, u, AHEAD, &mut ahead);
    model.ahead_of_row(T, x, u, AHEAD, &mut of_row);
    model.flow(&mut moved, u, AHEAD);
    model.rate(x, u, &mut rate);
    let lowest = model.lowest_held(T, x, u, AHEAD, f64::INFINITY).unwrap_or(f64::NAN);
    let all =
        [ahead, of_row].into_iter().flat_map(|a| [a.value.to_vec(), a.gradient.as_flattened().to_vec()]);
    let all = all.flatten().chain(moved).chain(rate).chain(here.drift).chain(here.row);
    all.chain([here.lower_sensitivity, model.value(T, x), lowest]).map(f64::to_bits).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 400, ..ProptestConfig::default() })]

    /// Two barriers, which share their memory, in turn.
    #[test]
    fn recorded_tapes_have_the_bits_of_their_model(
        plant in [tree(false), tree(false), tree(false)],
        barriers in [tree(true), tree(true)],
        x in prop::array::uniform2(0.2_f64..3.0),
        degrees in prop::array::uniform2(1_usize..=3),
    ) {
        let derivatives = [
            format!("{} + u", plant[0].text()),
            format!("{} + {}*u + w", plant[1].text(), plant[2].text()),
        ];
        let model = Model::new(&["x", "y"], &["u", "w"], &[], &[&derivatives[0], &derivatives[1]]).expect("a model");
        let barriers = barriers.map(|barrier| model.barrier(&barrier.text()).expect("a barrier"));
        let recorded = barriers.each_ref().map(punctual_models::Barrier::recorded);
        prop_assert_eq!(&recorded[0].0, &recorded[1].0);
        let plant = recorded[0].0.clone();
        let recording = punctual_models::recorded::Recording::new(plant, 500, 3).expect("a whole tape");
        let found = recorded.into_iter().zip(degrees).map(|((_, tape), n)| recording.source(tape, n).expect("a whole tape"));
        let found: Vec<_> = found.collect();
        for _ in 0..2 {
            for ((barrier, found), n) in barriers.iter().zip(&found).zip(degrees) {
                let wanted = barrier.source(n).expect("in range");
                prop_assert_eq!(bits(&**found, &x, &[0.3, -0.4]), bits(&*wanted, &x, &[0.3, -0.4]));
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 2000, ..ProptestConfig::default() })]

    /// On a grid, whose states are not quite the best.
    #[test]
    fn random_barriers_reach_a_ten_thousandth_of_their_scale_at_every_time(barrier in tree(true)) {
        const RANGE: [f64; 2] = [-2.0, 2.0];
        let model = Model::new(&["x", "y"], &["u"], &[], &["u", "0"]).expect("a model");
        let scale = model.scale(&barrier.text(), &[RANGE; 2]).expect("an expression");
        prop_assert!(scale.is_finite() && scale >= 0.0, "{scale}");
        for t in [0.0, 0.3, 20.0] {
            let grid = (0..=40).flat_map(|i| (0..=40).map(move |j| [i, j].map(|k| 0.1 * f64::from(k) - 2.0)));
            let values = grid.map(|x| barrier.value(t, &x)).filter(|h| !h.is_nan());
            // An expression that is nowhere a number is refused elsewhere.
            let Some(largest) = values.reduce(f64::max) else { continue };
            prop_assert!(scale == 0.0 || largest >= 1e-4 * scale, "{largest} {scale}: {}", barrier.text());
        }
    }
}

const DISC: &str = "sqrt(R^2 + R^2) - sqrt((x_p - c_x)^2 + (y_p - c_y)^2 + R^2)";

fn disc() -> DistanceDisc {
    DistanceDisc::new([45.0, 44.0], 2.0, 2.0).expect("valid disc")
}

/// Compares, at 50 states, the model of these expressions with `plant`.
fn agrees<P, const NX: usize>(plant: P, names: ([&str; NX], [&str; 2]), derivatives: [&str; NX])
where
    P: ControlAffine<NX, 2> + Copy + Send + Sync + 'static,
    DistanceDisc: Barrier<NX>,
{
    let parameters = [("R", 2.0), ("c_x", 45.0), ("c_y", 44.0), ("l_r", 3.0), ("l_f", 2.0)];
    let model = Model::new(&names.0, &names.1, &parameters, &derivatives).expect("a model");
    let barrier = model.barrier(DISC).expect("a barrier");
    assert_eq!(
        barrier.relative_degree(&[[f64::NEG_INFINITY, f64::INFINITY]; NX]),
        lie::detected(&plant, &disc())
    );
    let found = barrier.source(2).expect("in range");
    let wanted = lie::along(Arc::new(plant), disc(), 2).expect("in range");
    let simulated: Box<dyn DynPlant> = Box::new(Erased(plant));
    for (_, x) in internal::samples(&[[-3.0, 3.0]; NX]).into_iter().cycle().take(50) {
        let pairs = both(&*found, &*wanted, &x, &[0.7, -0.2]);
        let size = pairs.iter().map(|p| p[1].abs()).fold(1.0, f64::max);
        for (i, [found, wanted]) in pairs.into_iter().enumerate() {
            // Round-off of a few dozen operations.
            assert!((found - wanted).abs() <= 1e-14 * size, "{i}: {found} {wanted}");
        }
        let mut both = [x.clone(), x];
        model.plant().rk4_step(&mut both[0], &[0.7, -0.2], 0.1).expect("the lengths");
        simulated.rk4_step(&mut both[1], &[0.7, -0.2], 0.1).expect("the lengths");
        for (found, wanted) in both[0].iter().zip(&both[1]) {
            assert!((found - wanted).abs() <= 1e-15 * (1.0 + wanted.abs()) * 4.0, "{found} {wanted}");
        }
    }
}

#[test]
fn the_reference_plants_as_expressions() {
    let four = (["x_p", "y_p", "theta", "v"], ["a", "omega"]);
    let five = (["x_p", "y_p", "theta", "v", "s"], ["a", "rate"]);
    agrees(PointMass, (["x_p", "y_p", "v_x", "v_y"], ["u_x", "u_y"]), ["v_x", "v_y", "u_x", "u_y"]);
    agrees(Unicycle, four, ["v*cos(theta)", "v*sin(theta)", "omega", "a"]);
    let bicycle = Bicycle::new(3.0).expect("valid");
    agrees(bicycle, four, ["v*cos(theta)", "v*sin(theta)", "v*omega/l_r", "a"]);
    let small_slip = SmallSlipBicycle::new(3.0).expect("valid").with_rate();
    let derivatives =
        ["v*cos(theta) - v*s*sin(theta)", "v*sin(theta) + v*s*cos(theta)", "v*s/l_r", "a", "rate"];
    agrees(small_slip, five, derivatives);
    let kinematic = KinematicBicycle::new(2.0, 3.0).expect("valid");
    let beta = "atan(tan(s)*(l_r/(l_f + l_r)))";
    let derivatives = [
        &format!("v*cos(theta + {beta})"),
        &format!("v*sin(theta + {beta})"),
        &format!("v*sin({beta})/l_r"),
        "a",
        "rate",
    ];
    agrees(kinematic, five, derivatives.map(|d| d as &str));
}

#[test]
fn chains_of_integrators_have_their_order_as_relative_degree() {
    let states = ["x1", "x2", "x3", "x4", "x5", "x6", "x7", "x8"];
    for n in 1..=8 {
        let derivatives: Vec<_> = states[1..n].iter().copied().chain(["u"]).collect();
        let model = Model::new(&states[..n], &["u"], &[], &derivatives).expect("a chain");
        let barrier = model.barrier("10 + sin(t) - x1").expect("a barrier");
        let ranges = vec![[-1.0, 1.0]; n];
        assert_eq!(barrier.relative_degree(&ranges), RelativeDegree::Uniform(n));
        let source = barrier.source(n).expect("in range");
        let mut out = Derivatives::ZERO;
        source.evaluate(0.0, &vec![0.5; n], &mut out);
        // The derivatives of sin t at 0, and those of the chain.
        let sine = [0.0, 1.0, 0.0, -1.0, 0.0, 1.0, 0.0, -1.0, 0.0];
        for k in 0..=n {
            let wanted = sine[k] - if k < n { 0.5 } else { 0.0 } + if k == 0 { 10.0 } else { 0.0 };
            assert!((out.drift[k] - wanted).abs() < 1e-13, "n = {n}, k = {k}: {}", out.drift[k]);
        }
        assert!((out.row[0] + 1.0).abs() < 1e-15 && out.lower_sensitivity == 0.0, "n = {n}: {out:?}");
    }
}

#[test]
fn thirty_two_inputs() {
    let names: Vec<_> = (0..32).map(|i| (format!("x{i}"), format!("u{i}"))).collect();
    let states: Vec<_> = names.iter().map(|n| n.0.as_str()).collect();
    let inputs: Vec<_> = names.iter().map(|n| n.1.as_str()).collect();
    for m in 1..=32 {
        let model = Model::new(&states[..m], &inputs[..m], &[], &inputs[..m]).expect("a model");
        let sum = states[..m]
            .iter()
            .enumerate()
            .map(|(i, x)| format!("{}*{x}", i + 1))
            .collect::<Vec<_>>()
            .join("+");
        let barrier = model.barrier(&sum).expect("a barrier");
        assert_eq!(barrier.relative_degree(&vec![[-1.0, 1.0]; m]), RelativeDegree::Uniform(1));
        let mut out = Derivatives::ZERO;
        barrier.source(1).expect("in range").evaluate(0.0, &vec![0.0; m], &mut out);
        let wanted: Vec<_> = (0..32).map(|i| if i < m { (i + 1) as f64 } else { 0.0 }).collect();
        assert_eq!(out.row.to_vec(), wanted);
    }
}

/// Barriers along one model share what is computed for the plant; the results are bitwise those of each
/// barrier on its own.
#[test]
fn barriers_along_one_model_share_the_plant() {
    let model = |l_r| {
        let derivatives = ["v*cos(theta)", "v*sin(theta)", "v*beta/l_r", "a"];
        let parameters = [("R", 2.0), ("c_x", 45.0), ("c_y", 44.0), ("l_r", l_r)];
        Model::new(&["x_p", "y_p", "theta", "v"], &["a", "beta"], &parameters, &derivatives).expect("a model")
    };
    let source = |model: &Model, text| {
        let barrier = model.barrier(text).expect("a barrier");
        barrier.source(2).expect("in range")
    };
    let (bicycle, another) = (model(3.0), model(3.0));
    let (one, other, longer) =
        (source(&bicycle, DISC), source(&bicycle, "sin(t) - x_p + exp(y_p/9)"), source(&another, DISC));
    let [one, shared, longer] = [&one, &other, &longer].map(|s| s.shared().expect("a source that shares"));
    assert!(one.plant() == shared.plant() && one.plant() != longer.plant());
    let [mut motion, mut ahead] = one.rooms();
    for (t, x) in internal::samples(&[[-3.0, 3.0]; 4]).into_iter().take(50) {
        let (mut found, mut wanted) = (Derivatives::ZERO, Derivatives::ZERO);
        one.motion(&x, &mut *motion);
        shared.evaluate_along(t, &*motion, &mut found);
        other.evaluate(t, &x, &mut wanted);
        assert_eq!(found, wanted);
        // One Runge–Kutta step suffices for the first duration, but not for the second.
        for duration in [1e-3, 1.5] {
            let (mut found, mut wanted) = (Ahead::ZERO, Ahead::ZERO);
            let u = [0.7, -0.4 * t.cos()];
            one.motion_ahead(&x, &u, duration, &mut *ahead);
            shared.ahead_of_row_along(t + duration, &*ahead, &mut found);
            other.predict().expect("a model").ahead_of_row(t, &x, &u, duration, &mut wanted);
            assert_eq!(found, wanted);
        }
    }
}

/// Whether a barrier depends on time is determined for all times together.
#[test]
fn what_depends_on_time_is_known() {
    let model = Model::new(&["x", "v"], &["u"], &[("c", 3.0)], &["v", "u"]).expect("a model");
    let is_still = |text: &str, x: [f64; 2]| {
        let source = model.barrier(text).expect("a barrier").source(2).expect("in range");
        source.predict().expect("a model").is_still(&x)
    };
    let texts = [
        (true, "5 - x^2/c"),
        (true, "sqrt(x^2 + v^2 + 1) - atan2(x, v)/max(c, exp(x))"),
        (false, "5 - x^2/9 - 10*exp(-((t - 40)*2)^2)"),
        (false, "5 - x - 1e-9*tanh(t - 1e6)"),
        (false, "5 - x - max(0, t - 1e5)"),
        (false, "sin(1e-3*t) - x"),
        (false, "x - sqrt(t)"),
    ];
    for (still, text) in texts {
        for x in [[0.3, -2.0], [1e3, 0.0], [-7.5, 1e-9]] {
            assert_eq!(is_still(text, x), Some(still), "{text} at {x:?}");
        }
    }
}
