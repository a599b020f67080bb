//! Every defect of a model with its message.

use punctual_core::lie::{DerivativeSource, Derivatives};
use punctual_models::{MAX_OPERATORS, MAX_STATES, Model};

fn car(v: &str) -> Result<Model, punctual_models::Error> {
    Model::new(&["p", "v"], &["a"], &[("mass", 2.0)], &["v", v])
}

fn barrier(expression: &str) -> Result<Box<dyn DerivativeSource>, punctual_models::Error> {
    car("a").and_then(|m| m.barrier(expression)).and_then(|b| b.source(1))
}

#[test]
fn expressions() {
    for (text, wanted) in [
        ("a*a", "is \"a*a\", in which \"a*a\" is not affine in the input a"),
        ("v + sin(a + p)", "is \"v + sin(a + p)\", in which \"sin(a + p)\" is not affine in the input a"),
        ("a/mas", "names mas, which is unknown (did you mean mass?); the names are p, v, a, mass"),
        ("speed", "names speed, which is unknown; the names are p, v, a, mass"),
        (
            "t*a",
            "names t, the time, which a derivative does not depend on; a state with the derivative 1 does",
        ),
        ("sin", "names sin, a function, without arguments"),
        (
            "sine(v)",
            "calls sine, which is not a function (did you mean sin?); the functions are sqrt, exp, ln, ",
        ),
        ("atan2(v)", "gives 1 to atan2, which takes 2 arguments"),
        ("sin(v, p)", "gives 2 to sin, which takes 1 argument"),
        ("1e999", "holds a number larger than 1.7976931348623157e308"),
        ("v *", "at character 4 of \"v *\" is its end, must be a number, a name, a sign or \"(\""),
    ] {
        let error = car(text).expect_err(text);
        assert_eq!(error.field(), "derivatives.v", "{text}");
        assert!(error.message().starts_with(wanted), "{text}: {error}");
    }
    for (text, wanted) in [
        ("p - a", "expression: names a, an input, which it does not depend on"),
        ("p - q", "expression: names q, which is unknown; the names are p, v, mass"),
    ] {
        assert_eq!(barrier(text).err().expect(text).to_string(), wanted);
    }
}

#[test]
fn names_and_numbers_of_them() {
    let refused = |states: &[&str], inputs: &[&str], parameters: &[(&str, f64)]| {
        let derivatives = vec!["0"; states.len()];
        Model::new(states, inputs, parameters, &derivatives).expect_err("refused").to_string()
    };
    assert_eq!(refused(&[], &["u"], &[]), "states: has 0 entries, must have 1 to 64");
    assert_eq!(refused(&["x"; MAX_STATES + 1], &["u"], &[]), "states: has 65 entries, must have 1 to 64");
    assert_eq!(refused(&["x"], &[], &[]), "inputs: has 0 entries, must have 1 to 32");
    let twice = "inputs[0]: is \"x\", which is already the name of something else";
    assert_eq!(refused(&["x"], &["x"], &[]), twice);
    let taken = "which means something else in expressions";
    assert_eq!(refused(&["t"], &["u"], &[]), format!("states[0]: is \"t\", {taken}"));
    assert_eq!(refused(&["x"], &["u"], &[("min", 1.0)]), format!("parameters[0]: is \"min\", {taken}"));
    assert_eq!(refused(&["x"], &["u"], &[("k", f64::NAN)]), "parameters[0]: is NaN, must be finite");
    let wanted = "states[0]: is \"x.1\", must be letters, digits and underscores, not starting with a digit";
    assert_eq!(refused(&["x.1"], &["u"], &[]), wanted);
    let error = Model::new(&["x", "y"], &["u"], &[], &["u"]).expect_err("one missing").to_string();
    assert_eq!(error, "derivatives: has 1 entries, must have 2");
    let n = car("a").and_then(|m| m.barrier("p")).expect("a barrier").source(9).err().map(|e| e.to_string());
    assert_eq!(n.as_deref(), Some("relative_degree: is 9, must be 1 to 8"));
}

/// Long sums and products give equally deep trees, which must not overflow a thread's stack. Too many
/// different operations are refused before they are computed.
#[test]
fn size() {
    let long = vec!["v"; MAX_OPERATORS + 1].join("*");
    assert!(car(&long).is_ok());
    let states: Vec<_> = (0..MAX_STATES).map(|i| format!("x{i}")).collect();
    let names: Vec<_> = states.iter().map(String::as_str).collect();
    let sums: Vec<_> = (0..MAX_STATES)
        .map(|i| (0..250).map(|k| format!("{}*x{i}", k + 2)).collect::<Vec<_>>().join("+"))
        .collect();
    let derivatives: Vec<_> = sums.iter().map(String::as_str).collect();
    let error = Model::new(&names, &["u"], &[], &derivatives).expect_err("too many").to_string();
    assert_eq!(error, "derivatives.x8: brings the model to more than 4096 operations");
}

#[test]
fn outside_the_domain_nothing_is_finite() {
    let finite = |expression: &str, p: f64| {
        let mut out = Derivatives::ZERO;
        barrier(expression).expect(expression).evaluate(0.0, &[p, 1.0], &mut out);
        out.is_finite()
    };
    for (expression, inside, outside) in [
        ("sqrt(p)", 1.0, -1.0),
        ("sqrt(p)", 1.0, 0.0),
        ("ln(p)", 1.0, -1.0),
        ("1/p", 1.0, 0.0),
        ("atan2(p, p)", 1.0, 0.0),
        ("p^0.3", 1.0, -1.0),
        ("min(p, sqrt(p - 2))", 3.0, 1.0),
        ("exp(p)", 1.0, 1000.0),
    ] {
        assert!(finite(expression, inside), "{expression} at {inside}");
        assert!(!finite(expression, outside), "{expression} at {outside}");
    }
    assert!(finite("p^3 + abs(p)", 0.0), "whole powers and kinks are finite at 0");
}
