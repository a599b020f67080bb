//! The values of controllers equal those of `core`, bit for bit, whenever and however often they are read.

use punctual_reference::nominal::{Heading, damping};

use super::*;
use crate::block::build;
use crate::configuration::Configuration;
use crate::product::Product;

struct Bench {
    block: Box<dyn Block>,
    product: Product,
    values: Values,
}

impl Bench {
    fn new(model: &str, rest: &str) -> Self {
        let text = format!("kind = \"controller\"\nplant.model = \"{model}\"\n{rest}");
        let product = Configuration::parse(&text).and_then(Product::new).unwrap_or_else(|e| panic!("{e}"));
        let mut values = Values::zeros(product.variables.len());
        for (i, variable) in product.variables.iter().enumerate() {
            if let Some(start) = variable.kind.start_number() {
                values.reals[i] = start;
            }
        }
        let mut block = build(&product).unwrap();
        block.configure(&values).unwrap();
        Self { block, product, values }
    }

    fn set(&mut self, inputs: &[f64]) {
        self.values.reals[..inputs.len()].copy_from_slice(inputs);
    }

    fn u(&self) -> [u64; 2] {
        let at = self.product.layout.outputs;
        [at, at + 1].map(|i| self.values.reals[i].to_bits())
    }

    fn waypoint(&self) -> i32 {
        self.values.integers[self.product.layout.outputs + 2]
    }

    /// The output at `inputs`, read twice without a step and then with one; it must always be the same.
    fn sample(&mut self, inputs: &[f64]) -> [u64; 2] {
        self.set(inputs);
        self.block.output(0.0, &mut self.values);
        let first = self.u();
        self.block.output(7.0, &mut self.values);
        assert_eq!(self.u(), first, "asked again at another time");
        self.block.step(1.0, 0.5, &mut self.values).unwrap();
        assert_eq!(self.u(), first, "in a step");
        first
    }
}

const STATES: [[f64; 4]; 5] = [
    [0.0; 4],
    [1.0, -2.0, 0.5, 3.0],
    [4.1, -3.2, -2.9, -1.5],
    [4.0, -3.0, 0.0, 1.0],
    [1e6, 1e5, 3.0, -200.0],
];

#[test]
fn damping_is_that_of_core() {
    for (model, pairs) in [
        ("point_mass", &[(2, 0), (3, 1)][..]),
        ("unicycle", &[(3, 0)]),
        ("bicycle", &[(3, 0)]),
        ("bicycle_kinematic", &[(3, 0), (4, 1)]),
        ("bicycle_small_slip_rate", &[(3, 0), (4, 1)]),
    ] {
        let mut bench = Bench::new(model, "controller = \"damping\"\ngain = 1.75");
        for x in STATES {
            let x = [x[0], x[1], x[2], x[3], 0.3];
            let mut wanted = [0.0_f64; 2];
            for &(state, input) in pairs {
                wanted[input] = damping(x[state], 1.75);
            }
            let states = bench.product.layout.states;
            assert_eq!(bench.sample(&x[..states]), wanted.map(f64::to_bits), "{model} at {x:?}");
        }
    }
}

#[test]
fn heading_is_that_of_core_towards_a_parameter_and_an_input() {
    let heading = Heading { speed_gain: 0.5, turn_limit: 1.25, ..Heading::towards([4.0, -3.0]) };
    for input in [false, true] {
        for model in ["point_mass", "unicycle", "bicycle", "bicycle_small_slip"] {
            let turning = if model == "point_mass" { "" } else { "turn_limit = 1.25\n" };
            let goal = if input { "goal = [9.0, 9.0]\ngoal_input = true" } else { "goal = [4.0, -3.0]" };
            let mut bench =
                Bench::new(model, &format!("controller = \"heading\"\nspeed_gain = 0.5\n{turning}{goal}"));
            for x in STATES {
                let wanted = match model {
                    "point_mass" => heading.point_mass(&x),
                    "unicycle" => heading.unicycle(&x),
                    _ => heading.bicycle(&x, 10.0),
                };
                let inputs = [x[0], x[1], x[2], x[3], 4.0, -3.0];
                let inputs = &inputs[..bench.product.layout.states];
                assert_eq!(bench.sample(inputs), wanted.map(f64::to_bits), "{model} at {x:?}");
            }
        }
    }
}

#[test]
fn waypoints_go_on_in_steps_and_never_back() {
    let points = [[1.0, 0.0], [2.0, 0.0], [2.0, 5.0]];
    let mut bench = Bench::new(
        "unicycle",
        "controller = \"waypoints\"\nacceptance_radius = 0.5\npoints = [[1.0, 0.0], [2.0, 0.0], [2.0, 5.0]]",
    );
    for (x, present) in [(0.0, 0), (0.49, 0), (0.5, 1), (0.0, 1), (1.6, 2), (1.0, 2), (2.0, 2)] {
        let x = [x, 0.0, 0.1, 0.2];
        let wanted = Heading::towards(points[present]).unicycle(&x);
        assert_eq!(bench.sample(&x), wanted.map(f64::to_bits), "{x:?}");
        assert_eq!(bench.waypoint(), present as i32 + 1);
    }
    // The last point is held once it is reached.
    bench.sample(&[2.0, 5.0, 0.0, 0.0]);
    assert_eq!(bench.waypoint(), 3);
    // Reading does not pass a point; only a step does.
    bench.block.configure(&bench.values.clone()).unwrap();
    bench.set(&[1.0, 0.0, 0.0, 0.0]);
    bench.block.output(0.0, &mut bench.values);
    assert_eq!(bench.waypoint(), 2);
    bench.set(&[0.0; 4]);
    bench.block.output(0.0, &mut bench.values);
    assert_eq!(bench.waypoint(), 1, "it was only looked at");
}

#[test]
fn points_reached_at_once_are_passed_at_once() {
    let mut bench = Bench::new(
        "point_mass",
        "controller = \"waypoints\"\nacceptance_radius = 2.0\npoints = [[0.0, 0.0], [1.0, 0.0], [9.0, 0.0]]",
    );
    bench.sample(&[0.0; 4]);
    assert_eq!(bench.waypoint(), 3);
}

/// Limits alone would turn NaN into a number.
#[test]
fn a_state_that_is_not_finite_gives_no_number() {
    for bad in [f64::NAN, f64::INFINITY] {
        for rest in ["controller = \"damping\"", "controller = \"heading\"\ngoal = [1.0, 1.0]"] {
            let mut bench = Bench::new("unicycle", rest);
            bench.sample(&[1.0, 2.0, 0.0, bad]);
            assert!(bench.u().iter().all(|u| f64::from_bits(*u).is_nan()), "{rest}");
        }
    }
}

#[test]
fn expressions_are_computed_as_written() {
    let mut bench = Bench::new(
        "unicycle",
        "controller = \"expressions\"\nu_ref = { a = \"-0.5 * v + x_p / 8\", omega = \"3 * sin(atan2(-y_p, 4 - x_p) - theta)\" }",
    );
    for x in STATES {
        let wanted = [-0.5 * x[3] + x[0] / 8.0, 3.0 * ((-x[1]).atan2(4.0 - x[0]) - x[2]).sin()];
        let found = bench.sample(&x).map(f64::from_bits);
        for (found, wanted) in found.iter().zip(wanted) {
            // The order of operations is the same, but the functions may differ.
            assert!((found - wanted).abs() <= 1e-14 * (1.0 + wanted.abs()), "{found} {wanted}");
        }
    }
}

#[test]
fn expressions_have_states_parameters_and_time_of_a_model_of_ones_own() {
    let text = "kind = \"controller\"\ncontroller = \"expressions\"\n[plant]\n\
                states = [{ name = \"p\" }, { name = \"v\" }]\ninputs = [{ name = \"F\" }]\n\
                parameters = [{ name = \"k\", start = 2.0 }]\n\
                [plant.derivatives]\np = \"v\"\nv = \"F\"\n[u_ref]\nF = \"-k * p^2 + sin(t)\"\n";
    let product = Configuration::parse(text).and_then(Product::new).unwrap();
    let mut values = Values::zeros(product.variables.len());
    let k = product.layout.parameters;
    assert_eq!(product.variables[k].name, "k");
    (values.reals[0], values.reals[k]) = (3.0, 2.5);
    let mut block = build(&product).unwrap();
    block.configure(&values).unwrap();
    block.output(0.25, &mut values);
    let u = product.layout.outputs;
    assert_eq!(values.reals[u], -2.5 * 9.0 + 0.25_f64.sin());
    // Along p.
    let mut derivative = vec![0.0; values.reals.len()];
    let mut direction = derivative.clone();
    direction[0] = 1.0;
    block.differentiate(0.25, &values, &direction, &mut derivative).unwrap();
    assert_eq!(derivative[u], -2.5 * 2.0 * 3.0);
    // NaN is passed on.
    values.reals[0] = f64::NAN;
    block.output(0.25, &mut values);
    assert!(values.reals[u].is_nan());
}
