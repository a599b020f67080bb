//! The plants: inner steps, initial states, refusals.

use punctual_fmu::configuration::Configuration;

use crate::api::API;
use crate::fmu::{Fmu, PLANT};
use crate::slave::Slave;

const STATES: [&str; 4] = ["x.x_p", "x.y_p", "x.theta", "x.v"];

fn state(slave: &Slave) -> [f64; 4] {
    STATES.map(|name| slave.real(name))
}

fn bits(x: [f64; 4]) -> [u64; 4] {
    x.map(f64::to_bits)
}

/// The plant of `punctual-core` from the state `x` by `steps` inner steps of `h`.
fn oracle(fmu: &Fmu, mut x: [f64; 4], u: [f64; 2], steps: usize, h: f64) -> [f64; 4] {
    let Configuration::Plant(configuration) = &fmu.product.configuration else { panic!("not a plant") };
    let plant = configuration.build().unwrap();
    for _ in 0..steps {
        plant.rk4_step(&mut x, &u, h).unwrap();
    }
    x
}

#[test]
fn steps_are_those_of_core() {
    for model in ["point_mass", "unicycle", "bicycle", "bicycle_small_slip", "bicycle_kinematic_angle"] {
        let fmu = Fmu::new(&PLANT.replace("unicycle", model).replace("x0 = { theta = 0.5, v = 2.0 }", ""));
        let slave = Slave::new(&fmu);
        let parameters = fmu.product.layout.parameters as u32;
        let x0 = [1.0, -2.0, 0.5, 3.0];
        let references: Vec<u32> = (parameters..parameters + 4).collect();
        slave.ok((API.set_real)(slave.component, references.as_ptr(), 4, x0.as_ptr()));
        slave.initialize();
        slave.set_inputs(&[0.75, -0.25]);
        slave.step(0.0, 0.0625);
        let mut x = [0.0; 4];
        slave.ok((API.get_real)(slave.component, [2, 3, 4, 5].as_ptr(), 4, x.as_mut_ptr()));
        let wanted = oracle(&fmu, x0, [0.75, -0.25], 64, 0.0009765625);
        assert_eq!(bits(x), bits(wanted), "{model}: {x:?} {wanted:?}");
    }
}

/// With the input held and the same inner steps, how a time is divided into communication steps has no
/// effect.
#[test]
fn one_step_or_several_of_the_same_inner_steps() {
    let fmu = Fmu::new(PLANT);
    let mut found = Vec::new();
    for cuts in [1, 2, 4, 64] {
        let slave = Slave::ready(&fmu);
        slave.set_inputs(&[1.5, 0.75]);
        let h = 0.0625 / f64::from(cuts);
        for k in 0..cuts {
            slave.step(f64::from(k) * h, h);
        }
        assert_eq!(slave.time(), 0.0625);
        found.push(bits(state(&slave)));
    }
    assert!(found.windows(2).all(|pair| pair[0] == pair[1]), "{found:?}");
}

/// Number of inner steps in a communication step: the smallest for which they are not longer than the inner
/// step, apart from round-off.
#[test]
fn inner_steps_divide_the_communication_step() {
    let fmu = Fmu::new(&PLANT.replace("0.0009765625", "0.01"));
    for (h, steps) in [
        (0.01, 1),
        (0.0100000000000001, 1),
        (0.05, 5),
        (0.0500000000000003, 5),
        (0.0499999999999998, 5),
        (0.055, 6),
        (0.004, 1),
        (1.1e-16, 1),
        (0.0, 0),
    ] {
        let slave = Slave::ready(&fmu);
        let x0 = state(&slave);
        slave.set_inputs(&[1.0, 0.5]);
        slave.step(0.0, h);
        let wanted = oracle(&fmu, x0, [1.0, 0.5], steps, h / (steps as f64));
        assert_eq!(bits(state(&slave)), bits(wanted), "h = {h} in {steps} inner steps");
    }
}

/// Outputs do not depend on inputs without a step.
#[test]
fn outputs_are_the_state() {
    let fmu = Fmu::new(PLANT);
    let slave = Slave::ready(&fmu);
    assert_eq!(state(&slave), [0.0, 0.0, 0.5, 2.0], "x0 of the configuration");
    slave.set_inputs(&[9.0, 9.0]);
    assert_eq!(state(&slave), [0.0, 0.0, 0.5, 2.0]);
    slave.step(0.0, 0.1);
    let after = state(&slave);
    assert!((after[3] - 2.9).abs() < 1e-12, "v = 2 + 9 · 0.1: {after:?}");
    slave.set_inputs(&[f64::NAN, 0.0]);
    assert_eq!(state(&slave), after);
}

#[test]
fn initial_states_are_parameters() {
    let fmu = Fmu::new(PLANT);
    let slave = Slave::new(&fmu);
    slave.set("x0.x_p", 7.0);
    slave.ok((API.enter_initialization_mode)(slave.component));
    assert_eq!(state(&slave), [7.0, 0.0, 0.5, 2.0]);
    slave.set("x0.x_p", 8.0);
    slave.set("x0.v", -1.0);
    assert_eq!(state(&slave), [8.0, 0.0, 0.5, -1.0], "read in initialization mode");
    slave.ok((API.exit_initialization_mode)(slave.component));
    assert_eq!(state(&slave), [8.0, 0.0, 0.5, -1.0]);
}

#[test]
fn inputs_that_are_not_finite() {
    let fmu = Fmu::new(PLANT);
    let slave = Slave::ready(&fmu);
    slave.step(0.0, 0.1);
    let before = state(&slave);
    for (inputs, wanted) in [
        ([f64::NAN, 0.0], "u.a is NaN, must be finite for a step from t = 0.1"),
        ([0.0, f64::INFINITY], "u.omega is inf, must be finite for a step from t = 0.1"),
    ] {
        slave.set_inputs(&inputs);
        assert_eq!(slave.refused(slave.try_step(0.1, 0.1)), format!("fmi2DoStep: {wanted}"));
        assert_eq!((bits(state(&slave)), slave.time()), (bits(before), 0.1));
    }
    slave.set_inputs(&[0.0, 0.0]);
    slave.step(0.1, 0.1);
}

#[test]
fn states_that_become_infinite() {
    let fmu = Fmu::new(PLANT);
    let slave = Slave::ready(&fmu);
    slave.set_inputs(&[1e308, 0.0]);
    let before = state(&slave);
    let message = slave.refused(slave.try_step(0.0, 100.0));
    assert!(message.starts_with("fmi2DoStep: x.") && message.contains("becomes"), "{message}");
    assert_eq!(bits(state(&slave)), bits(before));
    slave.set_inputs(&[0.0, 0.0]);
    slave.step(0.0, 1.0);
}

/// A step with an excessive number of inner steps is refused immediately.
#[test]
fn huge_steps() {
    let fmu = Fmu::new(PLANT);
    let slave = Slave::ready(&fmu);
    for h in [1e6, 1e300] {
        let message = slave.refused(slave.try_step(0.0, h));
        assert!(message.contains("inner steps of 0.0009765625 s, must be at most 100000000"), "{message}");
    }
    let slave = Slave::new(&fmu);
    slave.set("inner_step", 1e-9);
    slave.initialize();
    let message = slave.refused(slave.try_step(0.0, f64::MAX));
    assert!(message.contains("needs inf inner steps"), "{message}");
}
