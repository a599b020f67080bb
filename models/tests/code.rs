//! Compares models in code with the same models in expressions, bit for bit; also code that breaks its
//! contract.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use punctual_core::interval::Interval;
use punctual_core::lie::{Ahead, DerivativeSource, Derivatives, Direction, EXPANSION_ORDERS, ExpansionOver};
use punctual_models::Model;
use punctual_models::evaluated::{Calculator, Code, CodeModel, Dimensions, LITERAL, Number, OPERATIONS};

const DIMENSIONS: Dimensions = Dimensions { states: 4, inputs: 2, barriers: 1 };
const ANY: [[f64; 2]; 4] = [[f64::NEG_INFINITY, f64::INFINITY]; 4];

/// The result of the operation `name` on `a` and `b`.
fn op(c: &mut dyn Calculator, name: &str, a: Number, b: Number) -> Number {
    c.apply(OPERATIONS.iter().position(|o| *o == name).expect("an operation") as u32, a, b, 0.0)
}

/// The result of the operation `name` on `a` and the literal `b`.
fn with(c: &mut dyn Calculator, name: &str, a: Number, b: f64) -> Number {
    c.apply(OPERATIONS.iter().position(|o| *o == name).expect("an operation") as u32, a, LITERAL, b)
}

type Plant = fn(&mut dyn Calculator, &[Number], &mut [Number], &mut [Number]);
type Barrier = fn(&mut dyn Calculator, Number, &[Number]) -> Number;

struct Functions(Plant, Barrier);

impl Code for Functions {
    fn plant(
        &self,
        c: &mut dyn Calculator,
        _parameters: &[f64],
        x: &[Number],
        f: &mut [Number],
        g: &mut [Number],
    ) {
        self.0(c, x, f, g);
    }

    fn barrier(
        &self,
        _index: usize,
        c: &mut dyn Calculator,
        _parameters: &[f64],
        t: Number,
        x: &[Number],
    ) -> Number {
        self.1(c, t, x)
    }
}

fn unicycle(c: &mut dyn Calculator, x: &[Number], f: &mut [Number], g: &mut [Number]) {
    let (cos, sin) = (op(c, "cos", x[2], 0), op(c, "sin", x[2], 0));
    f[0] = op(c, "multiply", x[3], cos);
    f[1] = op(c, "multiply", x[3], sin);
    let tanh = op(c, "tanh", x[3], 0);
    g[2 + 4] = op(c, "multiply", tanh, tanh);
    g[3] = c.apply(0, 0, 0, 1.0);
}

const DERIVATIVES: [&str; 4] = ["v*cos(th)", "v*sin(th)", "tanh(v)^2*w", "a"];

/// A disc with two branches that compute the same function.
fn disc(c: &mut dyn Calculator, t: Number, x: &[Number]) -> Number {
    let (dx, dy) = (with(c, "subtract", x[0], 40.0), with(c, "subtract", x[1], 40.0));
    let squares = if c.value(x[0]) < 20.0 {
        let (a, b) = (op(c, "multiply", dx, dx), op(c, "multiply", dy, dy));
        op(c, "add", a, b)
    } else {
        let (a, b) = (with(c, "power", dx, 2.0), with(c, "power", dy, 2.0));
        op(c, "add", a, b)
    };
    let inside = with(c, "add", squares, 1.0);
    let root = op(c, "sqrt", inside, 0);
    let (away, drift) = (with(c, "multiply", t, 0.1), op(c, "ln", inside, 0));
    let (h, drift) = (op(c, "subtract", away, root), with(c, "multiply", drift, 0.01));
    op(c, "add", h, drift)
}

const DISC: &str = "(t*0.1 - sqrt((x - 40)^2 + (y - 40)^2 + 1)) + 0.01*ln((x - 40)^2 + (y - 40)^2 + 1)";

fn made(plant: Plant, barrier: Barrier) -> Result<CodeModel, String> {
    CodeModel::new(Arc::new(Functions(plant, barrier)), DIMENSIONS, Vec::new(), &ANY)
        .map_err(|e| e.to_string())
}

/// A barrier with a cosine that the plant also computes, to one order less.
fn shared(c: &mut dyn Calculator, t: Number, x: &[Number]) -> Number {
    let (slow, cos) = (with(c, "multiply", t, 0.1), op(c, "cos", x[2], 0));
    let sum = op(c, "add", x[3], cos);
    op(c, "subtract", sum, slow)
}

const SHARED: &str = "v + cos(th) - t*0.1";

/// The same barrier in code and as an expression, with relative degree `n`.
fn sources(barrier: Barrier, expression: &str, n: usize) -> [Box<dyn DerivativeSource>; 2] {
    let code = made(unicycle, barrier).expect("a model").barrier(0).expect("a barrier");
    let model = Model::new(&["x", "y", "th", "v"], &["a", "w"], &[], &DERIVATIVES).expect("a model");
    let expressions = model.barrier(expression).expect("a barrier");
    let found = code.relative_degree(&ANY);
    assert_eq!(found.uniform(), Some(n), "{found:?}");
    assert_eq!(found, expressions.relative_degree(&ANY));
    [code.source(n).expect("in range"), expressions.source(n).expect("in range")]
}

const STATES: [[f64; 4]; 3] = [[1.0, 2.0, 0.3, 4.0], [30.0, -5.0, -2.0, -0.5], [19.0, 45.0, 7.0, 12.0]];

#[test]
fn code_gives_the_bits_of_expressions() {
    compare(sources(disc, DISC, 2));
    compare(sources(shared, SHARED, 1));
}

/// Reading a single value of an interval gives no enclosure, so such a model has none.
#[test]
fn what_looks_at_plain_values_encloses_nothing() {
    let looking: Plant = |c, x, f, g| {
        unicycle(c, x, f, g);
        f[3] = c.apply(0, 0, 0, if c.value(x[1]) < 0.0 { -0.0 } else { 0.0 });
    };
    let of = |plant, barrier, n| {
        let model = made(plant, barrier).and_then(|m| m.barrier(0).map_err(|e| e.to_string()));
        model.expect("a barrier").source(n).expect("in range")
    };
    let path = |half: f64| -> Vec<ExpansionOver> {
        let over = |x: &f64| {
            let mut expansion = [Interval::from(0.0); EXPANSION_ORDERS];
            expansion[0] = Interval::new(x - half, x + half);
            expansion
        };
        STATES[0].iter().map(over).collect()
    };
    let encloses = |source: &dyn DerivativeSource, half: f64| {
        let (model, mut rates) =
            (source.predict().expect("a model"), [[Interval::ALL; EXPANSION_ORDERS - 1]; 4]);
        let h = model.value_over(Interval::from(0.0), &path(half));
        [model.rates_over(&path(half), &[1.0, 0.5], 1, &mut rates), h.is_some()]
    };
    assert_eq!(encloses(&*of(unicycle, shared, 1), 0.1), [true, true]);
    assert_eq!(encloses(&*of(unicycle, disc, 2), 0.1), [true, false]);
    assert_eq!(encloses(&*of(looking, shared, 1), 0.1), [false, true]);
    assert_eq!(encloses(&*of(looking, disc, 2), 0.0), [true, true]);
}

fn compare([code, expressions]: [Box<dyn DerivativeSource>; 2]) {
    for x in STATES {
        let ([dx, u, du], t) = ([[0.3, -1.0, 0.5, 2.0], [1.5, -0.4, 0.0, 0.0], [0.2, 0.9, 0.0, 0.0]], 1.7);
        let (u, du) = (&u[..2], &du[..2]);
        let mut found = [Derivatives::ZERO; 2];
        let mut ahead = [[Ahead::ZERO; 2]; 2];
        let mut moved = [[x, dx, x]; 2];
        for (i, source) in [&code, &expressions].into_iter().enumerate() {
            source.evaluate(t, &x, &mut found[i]);
            let model = source.predict().expect("a model");
            let directional = source.predict_directional().expect("a model");
            model.ahead(t, &x, u, 0.1, &mut ahead[i][0]);
            directional.ahead_directional(t, &x, u, Direction { x: &dx, u: du }, 0.1, &mut ahead[i][1]);
            let [to, change, alone] = &mut moved[i];
            directional.flow_directional(to, change, u, 0.1);
            model.flow(alone, u, 0.1);
            assert_eq!(to, alone);
        }
        assert_eq!(found[0], found[1]);
        assert!(found[0].is_finite() && found[0].row[1] != 0.0);
        assert_eq!(ahead[0], ahead[1]);
        assert_eq!(moved[0], moved[1]);
    }
}

#[test]
fn a_step_allocates_nothing() {
    let [code, _] = sources(disc, DISC, 2);
    let (mut out, mut ahead, mut x) = (Derivatives::ZERO, Ahead::ZERO, STATES[0]);
    let model = code.predict().expect("a model");
    let found = allocation_counter::measure(|| {
        for at in STATES {
            code.evaluate(0.0, &at, &mut out);
            model.ahead(0.0, &at, &[1.0, 2.0], 0.1, &mut ahead);
            model.flow(&mut x, &[1.0, 2.0], 0.1);
        }
    });
    assert_eq!(found.count_total, 0);
}

#[test]
fn dimensions_out_of_range_are_refused() {
    let refused = |dimensions: Dimensions| dimensions.check().expect_err("it is refused").to_string();
    assert_eq!(refused(Dimensions { states: 0, ..DIMENSIONS }), "states: is 0, must be 1 to 64");
    assert_eq!(refused(Dimensions { inputs: 33, ..DIMENSIONS }), "inputs: is 33, must be 1 to 32");
    let many = refused(Dimensions { barriers: 129, ..DIMENSIONS });
    assert!(many.starts_with("barriers: is 129, must be 0 to "), "{many}");
    let model = made(unicycle, disc).expect("a model");
    assert_eq!(model.barrier(1).err().expect("there is one").to_string(), "barrier: is 1, must be < 1");
}

#[test]
fn code_that_does_what_it_must_not_is_refused() {
    static CALLS: AtomicU32 = AtomicU32::new(0);
    let forged: Plant = |c, x, f, g| {
        unicycle(c, x, f, g);
        f[3] = 4000;
    };
    // The inputs are registers too, but were not given to the code.
    let inputs: Plant = |c, x, f, g| {
        unicycle(c, x, f, g);
        f[3] = op(c, "sin", 4, 0);
    };
    let unknown: Plant = |c, x, f, _| f[0] = c.apply(19, x[0], x[1], 0.0);
    let endless: Barrier = |c, _, x| (0..5000).fold(x[0], |sum, _| op(c, "add", sum, x[1]));
    let changing: Plant = |c, x, f, g| {
        unicycle(c, x, f, g);
        if CALLS.fetch_add(1, Ordering::Relaxed) % 2 == 1 {
            f[0] = op(c, "sin", x[0], 0);
        }
    };
    // A looked-up value carries no derivative.
    let looked_up: Barrier = |c, _, x| {
        let value = c.value(x[0]).sin();
        c.apply(0, 0, 0, value)
    };
    let nowhere: Barrier = |c, _, _| c.apply(0, 0, 0, f64::NAN);
    for (plant, barrier, wanted) in [
        (forged, disc as Barrier, "plant: uses a number that it was not given (4000)"),
        (inputs, disc, "plant: uses a number that it was not given (4)"),
        (unknown, disc, "plant: asks for operation 19, must be 0 to 18"),
        (unicycle, endless, "barrier[0]: asks for more than 4096 operations"),
        (changing, disc, "plant: asks for other operations when it is called again at the same state"),
        (unicycle, nowhere, "barrier[0]: is not finite at any sample: give the states the ranges "),
        (unicycle, looked_up, "barrier[0]: has a derivative along a direction of "),
    ] {
        let found = made(plant, barrier).expect_err("it is refused");
        assert!(found.starts_with(wanted), "{found}");
    }
}

/// A branch that no sample takes requests more operations than there is memory for, so the result is NaN.
#[test]
fn a_branch_that_is_too_long_is_a_status() {
    let branching: Barrier = |c, t, x| {
        let h = disc(c, t, x);
        let far = c.value(x[0]) > 1e6;
        (0..if far { 500 } else { 0 }).fold(h, |sum, _| op(c, "add", sum, x[1]))
    };
    let source = made(unicycle, branching).and_then(|m| m.barrier(0).map_err(|e| e.to_string()));
    let source = source.expect("a barrier").source(2).expect("in range");
    let mut out = Derivatives::ZERO;
    source.evaluate(0.0, &[2e6, 0.0, 0.0, 1.0], &mut out);
    assert!(out.drift[0].is_nan());
    source.evaluate(0.0, &STATES[0], &mut out);
    assert!(out.is_finite());
}
