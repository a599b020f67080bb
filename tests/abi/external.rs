//! A filter whose derivatives a simulator computes: it gives bitwise the results of the filter that has the
//! model.

use std::sync::Arc;

use punctual_core::barriers::DistanceDisc;
use punctual_core::lie::{self, DerivativeSource, Derivatives};
use punctual_core::plants::PointMass;

use crate::fmu::{EXTERNAL, FILTER, Fmu};
use crate::slave::Slave;

const STEP: f64 = 0.0625;

/// The goal of both configurations.
fn source() -> Box<dyn DerivativeSource> {
    let disc = DistanceDisc::new([45.0, 45.0], 2.0, 2.0).expect("valid disc");
    lie::along(Arc::new(PointMass), disc, 2).expect("in range")
}

/// State and reference, and derivatives and reference, at `x`.
fn inputs(t: f64, x: &[f64; 4]) -> ([f64; 6], [f64; 7]) {
    let (mut d, u_ref) = (Derivatives::ZERO, [-0.5 * x[2], -0.5 * x[3]]);
    source().evaluate(t, x, &mut d);
    let [h, dh, drift, ..] = d.drift;
    ([x[0], x[1], x[2], x[3], u_ref[0], u_ref[1]], [h, dh, drift, d.row[0], d.row[1], u_ref[0], u_ref[1]])
}

/// The common outputs, with their bits.
fn outputs(slave: &Slave) -> Vec<String> {
    let output =
        |line: &String| line.starts_with("u.") || line.starts_with("status") || line.starts_with("goal.");
    let own = |line: &String| {
        ["lf", "lg", "centre", "velocity", "radius", "smoothing"]
            .iter()
            .any(|field| line.starts_with(&format!("goal.{field}")))
    };
    slave.snapshot().into_iter().filter(|line| output(line) && !own(line)).collect()
}

#[test]
fn the_same_bits_as_the_filter_that_has_the_model() {
    let pointwise = FILTER.replace("kind = \"filter\"", "kind = \"filter\"\nsampling = \"pointwise\"");
    let [own, given] = [&pointwise, EXTERNAL].map(Fmu::new);
    let (own, given) = (Slave::ready(&own), Slave::ready(&given));
    let (mut x, mut filtered) = ([0.0, 0.0, 3.0, 1.0], 0);
    for k in 0..240 {
        let t = f64::from(k) * STEP;
        let (state, derivatives) = inputs(t, &x);
        own.set_inputs(&state);
        given.set_inputs(&derivatives);
        assert_eq!(outputs(&given), outputs(&own), "before the step at {t}");
        if k == 100 {
            // Far away and back: the promise is remembered, everything else comes from the inputs.
            let kept = given.state();
            given.set_inputs(&[-1.0, 5.0, 0.0, 1.0, 1.0, 0.0, 0.0]);
            given.step(t, 7.0);
            given.set_flag("rearm", true);
            given.step(t + 7.0, 7.0);
            given.restore(kept);
        }
        own.step(t, STEP);
        given.step(t, STEP);
        assert_eq!(outputs(&given), outputs(&own), "after the step at {t}");
        assert!(given.integer("status") <= 1, "status {} at {t}", given.integer("status"));
        assert!(t < 10.0 || given.real("goal.h") >= 0.0, "outside at {t}");
        filtered += given.integer("status");
        for (i, u) in ["u.u_x", "u.u_y"].map(|name| given.real(name)).into_iter().enumerate() {
            x[i] += x[i + 2] * STEP + u * STEP * STEP / 2.0;
            x[i + 2] += u * STEP;
        }
    }
    assert!(filtered > 100, "{filtered} steps were filtered");
}

#[test]
fn what_is_no_number_is_an_invalid_input() {
    let fmu = Fmu::new(EXTERNAL);
    let slave = Slave::ready(&fmu);
    let good = [-30.0, 3.0, -0.5, 0.8, -0.6, -1.0, 1.0];
    slave.set_inputs(&good);
    let before = slave.real("u.u_x");
    for i in 0..good.len() {
        for bad in [f64::NAN, f64::INFINITY] {
            let mut values = good;
            values[i] = bad;
            slave.set_inputs(&values);
            assert_eq!((slave.integer("status"), slave.real("u.u_x")), (4, 0.0), "input {i}: {bad}");
        }
    }
    slave.set_inputs(&good);
    assert_eq!((slave.integer("status"), slave.real("u.u_x")), (1, before));
    // No input changes h, so the constraint cannot be met, and the filter reports so.
    slave.set_inputs(&[-30.0, 3.0, -0.5, 0.0, 0.0, -1.0, 1.0]);
    assert_eq!(slave.integer("status"), 3, "no_authority");
}
