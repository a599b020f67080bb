//! Models of expressions: every defect with its message, and the same inputs as the models by name.

use super::*;
use crate::configuration::Configuration;

const CAR: &str = include_str!("../../../../examples/models/jerk-car-filter.toml");
const CAR_PLANT: &str = include_str!("../../../../examples/models/jerk-car-plant.toml");

fn refusal(valid: &str, from: &str, to: &str) -> String {
    assert_eq!(valid.matches(from).count(), 1, "{from:?} in {valid}");
    Configuration::parse(valid).expect("the file without the defect");
    match Configuration::parse(&valid.replace(from, to)) {
        Ok(configuration) => panic!("{to:?} was taken: {configuration:?}"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn defects() {
    for (from, to, wanted) in [
        (
            "acc = \"jerk\"",
            "acc = \"jerk^2\"",
            "plant.derivatives.acc: is \"jerk^2\", in which \"jerk^2\" is not affine in the input jerk; inputs may only be added and multiplied by what is free of inputs",
        ),
        (
            "v = \"acc\"",
            "v = \"ac\"",
            "plant.derivatives.v: names ac, which is unknown (did you mean acc?); the names are p, v, acc, jerk, d, v_max",
        ),
        (
            "v = \"acc\"",
            "v = \"acc +\"",
            "plant.derivatives.v: at character 6 of \"acc +\" is its end, must be a number, a name, a sign or \"(\"",
        ),
        ("v = \"acc\"", "w = \"acc\"", "plant.derivatives.w: unknown state, must be one of p, v, acc"),
        ("v = \"acc\"\n", "", "plant.derivatives.v: missing, every state needs one"),
        (
            "\"p - d\"",
            "\"p - jerk\"",
            "barrier[0].expression: names jerk, an input, which it does not depend on",
        ),
        ("\"p - d\"", "\"atan2(p)\"", "barrier[0].expression: gives 1 to atan2, which takes 2 arguments"),
        (
            "\"p - d\"",
            "\"d - 1\"",
            "barrier[0]: its relative degree along expressions does not exist: no input enters a derivative of h up to order 8",
        ),
        (
            "\"p - d\"",
            "\"sqrt(-1 - p^2)\"",
            "barrier[0]: its relative degree along expressions is not known: model or barrier is not finite at any sample state; give the states a range (`min`, `max`)",
        ),
        (
            "unit = \"m\"\ndeadline",
            "unit = \"mile\"\ndeadline",
            "barrier[0].unit: is \"mile\", must be like \"kg.m2/s\", made of kg, cd, min, h, d, deg, rev, rpm, percent, ppm, t, atm, mmHg, psi, hp, kn, mph, nmi, mi, yd, ft, in, lb, lbf and, also with a prefix as in km, of m, s, A, K, mol, rad, Hz, N, Pa, J, W, C, V, Ohm, S, F, H, T, Wb, lm, lx, g, l, L, bar, Wh, Ah, cal, or \"1\"",
        ),
        (
            "unit = \"m/s3\"",
            "unit = \"mile\"",
            "plant.inputs[0].unit: is \"mile\", must be like \"kg.m2/s\", made of kg, cd, min, h, d, deg, rev, rpm, percent, ppm, t, atm, mmHg, psi, hp, kn, mph, nmi, mi, yd, ft, in, lb, lbf and, also with a prefix as in km, of m, s, A, K, mol, rad, Hz, N, Pa, J, W, C, V, Ohm, S, F, H, T, Wb, lm, lx, g, l, L, bar, Wh, Ah, cal, or \"1\"",
        ),
        (
            "start = 60.0, min",
            "start = -1.0, min",
            "plant.parameters[0].start: is -1, must be finite and >= 0",
        ),
        (
            "min = 1.0, unit",
            "min = 9.0, max = 1.0, unit",
            "plant.parameters[1].max: is 1, must be >= min = 9",
        ),
        ("min = 1.0, unit", "min = nan, unit", "plant.parameters[1].min: is NaN, must be finite"),
        (
            "name = \"d\"",
            "name = \"u_ref\"",
            "plant.parameters[0].name: is \"u_ref\", which is already the name of something else",
        ),
        (
            "name = \"d\"",
            "name = \"t\"",
            "plant.parameters[0]: is \"t\", which means something else in expressions",
        ),
        (
            "name = \"d\"",
            "name = \"acc\"",
            "plant.parameters[0]: is \"acc\", which is already the name of something else",
        ),
        (
            "name = \"d\"",
            "name = \"d m\"",
            "plant.parameters[0].name: is \"d m\", must be letters, digits and underscores, not starting with a digit (1 to 64)",
        ),
        (
            "name = \"merge\"",
            "name = \"d\"",
            "barrier[0].name: is \"d\", which is already the name of something else",
        ),
        (
            "unit = \"m\"\ndeadline",
            "unit = \"s\"\ndeadline",
            "barrier[0].unit: is \"s\", but \"p - d\" is in m",
        ),
        (
            "unit = \"m\"\ndeadline",
            "unit = \"km\"\ndeadline",
            "barrier[0].unit: is \"km\", but \"p - d\" is in m",
        ),
        (
            "\"p - d\"",
            "\"p - v\"",
            "barrier[0].expression: is \"p - v\", in which \"p\" is in m and \"v\" in m/s; what is added or compared must be in one unit; a factor between them may be a parameter with its unit",
        ),
        (
            "v = \"acc\"",
            "v = \"p\"",
            "plant.derivatives.v: is \"p\", which is in m; the derivative of v, which is in m/s, must be in m/s2",
        ),
        (
            "v = \"acc\"",
            "v = \"acc * sin(p)\"",
            "plant.derivatives.v: is \"acc * sin(p)\", in which sin takes \"p\", which is in m; it takes an angle in rad or a number without unit",
        ),
        (
            "{ name = \"v\", unit = \"m/s\"",
            "{ name = \"v\", unit = \"km/h\"",
            "plant.derivatives.p: is \"v\", which is in km/h; the derivative of p, which is in m, must be in m/s; numbers are taken as they are, so that this is wrong by the factor 0.277778",
        ),
        (
            "states = [\n",
            "model = \"unicycle\"\nstates = [\n",
            "plant.states: given beside `model`; unicycle has its own",
        ),
        (
            "[plant]\n",
            "[plant]\nmodel = \"unicycle\"\n",
            "plant.states: given beside `model`; unicycle has its own",
        ),
        (
            "[plant]\n",
            "[plant]\nl_r = 1.0\n",
            "plant.l_r: is a constant of the bicycle; other models have `parameters`",
        ),
        (
            "expression = \"p - d\"",
            "shape = \"speed_limit\"\nbound = 1.0",
            "barrier[0].shape: is \"speed_limit\", which is for the plants that have a name; give an `expression`",
        ),
        (
            "expression = \"p - d\"",
            "shape = \"expression\"",
            "barrier[0].expression: missing, expression needs it",
        ),
        (
            "expression = \"p - d\"",
            "expression = \"p - d\"\nradius = 1.0",
            "barrier[0].radius: expression has none",
        ),
        (
            "expression = \"p - d\"",
            "shape = \"disc\"\nexpression = \"p - d\"",
            "barrier[0].centre: missing, disc needs it",
        ),
    ] {
        assert_eq!(refusal(CAR, from, to), wanted, "{to}");
    }
    let none = Configuration::parse("kind = \"plant\"\n[plant]\n").expect_err("no model").to_string();
    assert_eq!(
        none,
        "plant.model: missing; either name a model or give `states`, `inputs` and `derivatives`"
    );
    for table in ["states = []", "inputs = []", "parameters = []", "derivatives = {}"] {
        let text = format!("kind = \"plant\"\n[plant]\nmodel = \"unicycle\"\n{table}\n");
        let key = table.split(' ').next().expect("a key");
        let error = Configuration::parse(&text).expect_err(table).to_string();
        assert_eq!(error, format!("plant.{key}: given beside `model`; unicycle has its own"));
    }
    let empty = "kind = \"plant\"\n[plant]\nstates = []\ninputs = [{ name = \"u\" }]\n";
    let error = Configuration::parse(empty).expect_err("no states").to_string();
    assert_eq!(error, "plant.states: has 0 entries, must have 1 to 64");
    let mixed = CAR
        .replace("v = \"acc\"", "v = \"acc + q\"")
        .replace("inputs = [", "inputs = [{ name = \"q\", unit = \"m/s2\" }, ");
    assert_eq!(
        Configuration::parse(&mixed).expect_err("mixed").to_string(),
        "barrier[0]: its relative degree along expressions is mixed: q enters derivative 2, jerk enters derivative 3 \
         of h; one row cannot use them all. Plans can, but none are followed: q has no bounds. Mend that, or put 1 \
         integrator before q: make it a state whose derivative is the new input"
    );
    let controller = format!(
        "kind = \"controller\"\ncontroller = \"damping\"\n{}",
        &CAR_PLANT[CAR_PLANT.find("[plant]").unwrap()..CAR_PLANT.find("[x0]").unwrap()]
    );
    let error = Configuration::parse(&controller).expect_err("a controller").to_string();
    assert_eq!(error, "controller: is \"damping\", which is for vehicles by name; must be \"expressions\"");
    let outside = CAR_PLANT.replace("name = \"v\", unit", "name = \"v\", max = 5.0, unit");
    let error = Configuration::parse(&outside).expect_err("outside").to_string();
    assert_eq!(error, "x0.v: is 10, must be finite and <= 5");
}

#[test]
fn the_canonical_form_is_the_same_configuration() {
    for text in [CAR, CAR_PLANT] {
        let configuration = Configuration::parse(text).expect("valid");
        let canonical = configuration.canonical().expect("text");
        let again = Configuration::parse(&canonical).unwrap_or_else(|e| panic!("{e} in {canonical}"));
        assert_eq!(again, configuration, "{canonical}");
    }
}

#[test]
fn ranges_of_inputs_are_bounds_and_those_of_states_hold_for_starts() {
    let bounded = CAR.replace("unit = \"m/s3\"", "unit = \"m/s3\", min = -50.0, max = 40.0");
    let Configuration::Filter(c) = Configuration::parse(&bounded).expect("valid") else { panic!("a filter") };
    assert_eq!(c.bounds["jerk"], [-50.0, 40.0]);
    let own = Configuration::parse(&format!("{bounded}\n[bounds]\njerk = [-1.0, 1.0]\n")).expect("valid");
    let Configuration::Filter(c) = own else { panic!("a filter") };
    assert_eq!(c.bounds["jerk"], [-1.0, 1.0]);
    let raised = CAR_PLANT.replace("name = \"p\", unit", "name = \"p\", min = 3.0, unit");
    let Configuration::Plant(c) = Configuration::parse(&raised).expect("valid") else { panic!("a plant") };
    assert_eq!((c.x0["p"], c.x0["v"]), (3.0, 10.0));
}

/// The reference plants, by name and as expressions, along a run from rest: the inputs of both agree.
#[test]
fn the_reference_plants_by_name_and_by_expression_filter_alike() {
    const BARRIERS: [&str; 2] = [
        "centre = [45.0, 44.0]\nradius = 2.0\n",
        "expression = \"sqrt(2^2 + 2^2) - sqrt((x_p - 45)^2 + (y_p - 44)^2 + 2^2)\"\nmargin = 0.02\nunit = \"m\"\n",
    ];
    // Pointwise only round-off is left, from a barrier of some 60 m divided by rows as small as 0.01. Over the
    // period the filter iterates with Newton's method, and stops where its own tolerance is met.
    const STEP: f64 = 0.02;
    const ROUND_OFF: f64 = 1e-9;
    const NEWTON: f64 = 1e-5;
    let samplings = [("pointwise", ROUND_OFF), ("measured", NEWTON)];
    let models = ["point_mass", "unicycle", "bicycle", "bicycle_small_slip_rate", "bicycle_kinematic"];
    for (model, (sampling, tolerance)) in models.iter().flat_map(|m| samplings.map(|s| (m, s))) {
        let by_name = |barrier: &str| {
            format!(
                "kind = \"filter\"\nplant.model = \"{model}\"\nsampling = \"{sampling}\"\nexperiment.step_size = {STEP}\n[[barrier]]\nname = \"goal\"\ndeadline = 5.0\n{barrier}"
            )
        };
        let parsed = |text: &str| match Configuration::parse(text) {
            Ok(Configuration::Filter(c)) => c,
            other => panic!("{text}: {other:?}"),
        };
        let shape = parsed(&by_name(BARRIERS[0]));
        let expression = parsed(&by_name(BARRIERS[1]));
        // The same configuration with all of it as expressions.
        let mut written = expression.clone();
        let (reference, states) = (shape.plant.reference().expect("by name"), shape.plant.states());
        let derivatives = reference.derivatives().iter().map(|&d| d.to_owned());
        let constant = |(name, start): (&str, f64)| ParameterSection {
            name: name.to_owned(),
            start,
            unit: "m".to_owned(),
            description: String::new(),
            min: None,
            max: None,
        };
        written.plant = PlantSection::Expressions(ExpressionSection {
            derivatives: states.iter().map(|s| s.name.clone()).zip(derivatives).collect(),
            states,
            inputs: shape.plant.inputs(),
            parameters: reference.constants().map(constant).collect(),
        });

        let mut filters = [&shape, &expression, &written].map(|c| c.build().expect("a filter"));
        let plants = [shape.plant.build(), written.plant.build()].map(|p| p.expect("a plant"));
        let states = shape.plant.states().len();
        // Vehicles drive already, since at a standstill a turn moves nothing.
        let mut x = vec![0.0; states];
        (x[2], x[3]) = (0.6, 3.0);
        for k in 0..300 {
            let t = f64::from(k) * STEP;
            let mut u = [[0.0; 2]; 3];
            for (filter, u) in filters.iter_mut().zip(&mut u) {
                filter.step(t, &x, &[-0.1, 0.05], u).expect("the lengths");
            }
            for other in &u[1..] {
                for i in 0..2 {
                    let size = 1.0 + u[0][i].abs();
                    assert!(
                        (other[i] - u[0][i]).abs() < tolerance * size,
                        "{model}, {sampling}, t = {t}: {u:?}"
                    );
                }
            }
            let mut moved = [x.clone(), x.clone()];
            for (plant, x) in plants.iter().zip(&mut moved) {
                plant.rk4_step(x, &u[0], STEP).expect("the lengths");
            }
            let size = moved[0].iter().fold(1.0, |size: f64, v| size.max(v.abs()));
            for (a, b) in moved[0].iter().zip(&moved[1]) {
                assert!((a - b).abs() < 1e-14 * size, "{model}, t = {t}: {moved:?}");
            }
            x.clone_from(&moved[0]);
        }
    }
}

/// Three integrators, deadline 4 s: on time from there on, without passing the other bound.
#[test]
fn the_car_with_jerk_meets_its_deadline() {
    let Configuration::Filter(c) = Configuration::parse(CAR).expect("valid") else { panic!("a filter") };
    assert_eq!(c.relative_degrees(), [3, 2]);
    let (mut filter, plant) = (c.build().expect("a filter"), c.plant.build().expect("a plant"));
    let mut x = [0.0, 10.0, 0.0];
    for k in 0..=800 {
        let (t, mut u) = (f64::from(k) * 0.01, [0.0]);
        let report = filter.step(t, &x, &[0.0], &mut u).expect("the lengths");
        assert!(report.status.is_satisfied(), "t = {t}: {report:?}");
        assert!(t < 4.0 || x[0] >= 60.0, "t = {t}: {x:?}");
        assert!(x[1] <= 40.0, "t = {t}: {x:?}");
        plant.rk4_step(&mut x, &u, 0.01).expect("the lengths");
    }
}

/// A bound of a state of a custom model is the expression that it stands for.
#[test]
fn bounds_of_states_are_expressions() {
    let stepped = |barrier: &str| {
        let text = CAR
            .replace("unit = \"m\"\ndeadline", "deadline")
            .replace("expression = \"p - d\" # h >= 0 is wanted", barrier);
        let Configuration::Filter(c) = Configuration::parse(&text).expect("a filter") else {
            panic!("{text}")
        };
        let (mut filter, mut u) = (c.build().expect("a filter"), [0.0]);
        filter.step(0.0, &[-20.5, 10.0, 0.25], &[0.0], &mut u).expect("right dimensions");
        u[0].to_bits()
    };
    for (shape, expression) in [("at_least", "p - (-3.5)"), ("at_most", "-3.5 - p")] {
        let of_shape = stepped(&format!("shape = \"{shape}\"\nstate = \"p\"\nbound = -3.5"));
        assert_eq!(of_shape, stepped(&format!("expression = \"{expression}\"")), "{shape}");
    }
}
