//! Directional derivatives: compared with central differences of the outputs, and those that are refused.

use std::ffi::c_int;
use std::ptr::{null, null_mut};

use punctual_modeldescription::{BaseType, Causality};

use crate::api::{API, ERROR};
use crate::fmu::{EXTERNAL, FILTER, Fmu, PLANT, STEERED};
use crate::rollback::Random;
use crate::slave::Slave;

/// Step of the differences, in units of inputs of order 1 to 10.
pub(crate) const STEP: f64 = 1e-4;

/// Tolerance of a derivative of size 1: outputs are known to 1e-9 of numbers up to 100, which STEP divides.
pub(crate) const TOLERANCE: f64 = 1e-3;

/// A unicycle with an obstacle that is an input, tight bounds and a second barrier.
pub(crate) const TRAFFIC: &str = r#"
kind = "filter"
plant.model = "unicycle"
bounds = { a = [-4.0, 4.0], omega = [-1.0, 1.0] }
[[barrier]]
name = "goal"
centre = [30.0, 10.0]
radius = 2.0
deadline = 10.0
[[barrier]]
name = "other"
shape = "obstacle"
centre = [12.0, 4.5]
centre_input = true
radius = 1.5
deadline = 2.0
stay_rate = 10.0
"#;

const HEADING: &str = r#"
kind = "controller"
plant.model = "bicycle"
controller = "heading"
goal = [9.0, 4.0]
goal_input = true
"#;

/// The references of all real variables of one causality.
fn reals(fmu: &Fmu, causality: Causality) -> Vec<u32> {
    let variables = fmu.product.variables.iter();
    let wanted = |v: &&punctual_modeldescription::Variable| {
        v.causality == causality && v.kind.base_type() == BaseType::Real
    };
    variables.filter(wanted).map(|v| v.value_reference).collect()
}

fn try_derivative(slave: &Slave, unknowns: &[u32], knowns: &[u32], seed: &[f64]) -> (c_int, Vec<f64>) {
    let mut out = vec![7.5; unknowns.len()];
    let (n, m) = (unknowns.len(), knowns.len());
    let (unknowns, knowns) = (unknowns.as_ptr(), knowns.as_ptr());
    let c = slave.component;
    let status = (API.directional_derivative)(c, unknowns, n, knowns, m, seed.as_ptr(), out.as_mut_ptr());
    (status, out)
}

fn derivative(slave: &Slave, unknowns: &[u32], knowns: &[u32], seed: &[f64]) -> Vec<f64> {
    let (status, out) = try_derivative(slave, unknowns, knowns, seed);
    slave.ok(status);
    out
}

fn set(slave: &Slave, references: &[u32], values: &[f64]) {
    slave.ok((API.set_real)(slave.component, references.as_ptr(), references.len(), values.as_ptr()));
}

fn get(slave: &Slave, references: &[u32]) -> Vec<f64> {
    let mut values = vec![f64::NAN; references.len()];
    let (len, out) = (values.len(), values.as_mut_ptr());
    slave.ok((API.get_real)(slave.component, references.as_ptr(), len, out));
    values
}

/// Compares every real output and input, one seed at a time, with differences of the outputs. Leaves the
/// inputs at `values`.
fn compare(slave: &Slave, values: &[f64], when: &str) {
    let (inputs, outputs) = (reals(slave.fmu, Causality::Input), reals(slave.fmu, Causality::Output));
    for (i, input) in inputs.iter().enumerate() {
        let at = |by: f64| {
            let mut moved = values.to_vec();
            moved[i] += by;
            set(slave, &inputs, &moved);
            get(slave, &outputs)
        };
        let (plus, minus) = (at(STEP), at(-STEP));
        at(0.0);
        let before = slave.now();
        let found = derivative(slave, &outputs, &[*input], &[1.0]);
        assert!(before == slave.now(), "the derivative {when} changed something");
        for (k, (p, m)) in plus.iter().zip(&minus).enumerate() {
            let wanted = (p - m) / (2.0 * STEP);
            let names = [outputs[k], *input].map(|r| &slave.fmu.product.variables[r as usize].name);
            let close = (found[k] - wanted).abs() <= TOLERANCE * (1.0 + wanted.abs());
            assert!(close, "{names:?} {when}: {} for {wanted}", found[k]);
        }
    }
    // Linear in the seeds; repeated inputs add up.
    let [first, second] = [inputs[0], inputs[1]].map(|r| derivative(slave, &outputs, &[r], &[1.0]));
    let both = derivative(slave, &outputs, &[inputs[0], inputs[1], inputs[0]], &[2.0, -3.0, 0.5]);
    for (k, found) in both.iter().enumerate() {
        let wanted = 2.5 * first[k] - 3.0 * second[k];
        // A system of a dozen equations with numbers of this size.
        assert!((found - wanted).abs() <= 1e-9 * (1.0 + wanted.abs()), "{found} for {wanted} {when}");
    }
}

#[test]
fn of_a_filter_in_every_mode_that_has_them() {
    let goal = [30.0, 22.0, 3.0, 4.0, -1.0, -1.5];
    let traffic = [8.0, 2.0, 0.3, 3.0, 12.0, 4.5, -0.5, 0.2, -3.5, 0.5];
    let external = [-30.0, 3.0, -0.5, 0.8, -0.6, -1.0, 1.0];
    let steered = [3.0, -2.0, 0.45, 2.0, -0.5, 0.1];
    for (configuration, values) in
        [(FILTER, &goal[..]), (TRAFFIC, &traffic), (EXTERNAL, &external), (STEERED, &steered)]
    {
        let fmu = Fmu::new(configuration);
        let slave = Slave::new(&fmu);
        let inputs = reals(&fmu, Causality::Input);
        slave.ok((API.enter_initialization_mode)(slave.component));
        compare(&slave, values, "in initialization mode");
        slave.ok((API.exit_initialization_mode)(slave.component));
        compare(&slave, values, "before the first step");
        for k in 0..3 {
            slave.step(0.1 * f64::from(k), 0.1);
        }
        compare(&slave, values, "after three steps");
        assert_eq!(slave.integer("status"), 1, "filtered");
        slave.set_flag("rearm", true);
        compare(&slave, values, "with a re-arming that is due");
        slave.set_flag("rearm", false);
        // u_ref is beyond the bounds.
        let mut far = values.to_vec();
        *far.last_mut().unwrap() = 90.0;
        compare(&slave, &far, "with a bound that holds");
        // An input that is NaN makes u constant.
        far[0] = f64::NAN;
        set(&slave, &inputs, &far);
        let outputs = reals(&fmu, Causality::Output);
        assert!(derivative(&slave, &outputs, &inputs[1..2], &[1.0]).iter().all(|d| *d == 0.0));
        set(&slave, &inputs, values);
        let before = derivative(&slave, &outputs, &inputs[..1], &[1.0]);
        slave.ok((API.terminate)(slave.component));
        assert_eq!(derivative(&slave, &outputs, &inputs[..1], &[1.0]), before, "terminated");
    }
}

/// Plans and an integral, whose outputs both come after those of the barriers.
#[test]
fn of_a_filter_with_plans_behind_an_integrator() {
    let planned = STEERED.replace("bounds = {", "bounds = { a = [-60.0, 60.0],");
    let fmu = Fmu::new(&planned);
    assert!(fmu.filter().is_assured());
    let slave = Slave::ready(&fmu);
    let mut values = [3.0, -2.0, 0.45, 2.0, -0.5, 0.1];
    for k in 0..5 {
        set(&slave, &reals(&fmu, Causality::Input), &values);
        slave.step(0.1 * f64::from(k), 0.1);
        // The motion of the plant, in small steps.
        let (a, beta) = (slave.real("u.a"), slave.real("u.beta"));
        for _ in 0..10_000 {
            let [_, _, theta, v, ..] = values;
            let (sin, cos) = theta.sin_cos();
            let rates = [v * (cos - sin * beta), v * (sin + cos * beta), v * beta / 1.5, a];
            values.iter_mut().zip(rates).for_each(|(x, rate)| *x += 1e-5 * rate);
        }
    }
    compare(&slave, &values, "of a plan that was there");
    assert_eq!(slave.integer("assurance"), 1, "assured");
}

/// In every configuration and state, as requested by a master that only knows the model description: all
/// outputs with respect to all inputs, in initialization mode and before every step.
#[test]
fn are_given_at_every_step() {
    let rock = "[[barrier]]\nname = \"rock\"\nshape = \"obstacle\"\ncentre = [1.5, 0.5]\nradius = 1.0\n";
    let goal = "[[barrier]]\nname = \"goal\"\ncentre = [4.0, 3.0]\nradius = 1.0\ndeadline = 6.0\n";
    let unicycle = "plant.model = \"unicycle\"\nbounds = { a = [-4.0, 4.0], omega = [-1.5, 1.5] }\n";
    let point = "plant.model = \"point_mass\"\nbounds = { u_x = [-4.0, 4.0], u_y = [-4.0, 4.0] }\n";
    let bicycle =
        "plant = { model = \"bicycle\", l_r = 1.5 }\nbounds = { a = [-4.0, 4.0], beta = [-0.5, 0.5] }\n";
    let free = "plant.model = \"unicycle\"\n";
    let off = "assurance = \"off\"\n";
    let errors = "[measurement_errors]\nx_p = 0.05\ny_p = 0.05\nv = 0.02\n";
    let earliest = goal.replace("6.0", "0.7\nwhen_infeasible = \"earliest\"");
    let rated = rock.replace("radius", "stay_rate = 3.0\nmargin = 0.1\nradius");
    let (mut smooth, mut near, mut random) = (0_u32, 0_u32, Random(50));
    // Whether a search keeps something: a plan, or a later deadline.
    for (held, text) in [
        (false, format!("{off}{unicycle}{goal}{rock}")),
        (false, format!("{off}{point}{goal}{rock}")),
        (false, format!("{off}{bicycle}{goal}{rock}")),
        (false, format!("{free}{goal}{rock}")),
        (false, format!("{off}{unicycle}{errors}{goal}{rock}")),
        (true, format!("{off}{point}{earliest}{rated}")),
        (false, format!("{off}{unicycle}sampling = \"pointwise\"\n{goal}{rock}")),
        (true, format!("{unicycle}{goal}{rock}")),
        (true, format!("{point}{goal}{rated}")),
        (true, format!("{bicycle}{goal}{rock}")),
    ] {
        let fmu = Fmu::new(&format!("kind = \"filter\"\n{text}"));
        let (inputs, outputs) = (reals(&fmu, Causality::Input), reals(&fmu, Causality::Output));
        let runs = if held { 3 } else { 12 };
        for _ in 0..runs {
            let slave = Slave::new(&fmu);
            slave.ok((API.enter_initialization_mode)(slave.component));
            let mut values: Vec<f64> = inputs.iter().map(|_| 0.6 * random.number()).collect();
            for k in 0..4 {
                // At first the origin, as in the start values.
                if k > 0 {
                    set(&slave, &inputs, &values);
                }
                if k == 2 {
                    slave.ok((API.exit_initialization_mode)(slave.component));
                }
                let seeds: Vec<f64> = inputs.iter().map(|_| 0.2 * random.number()).collect();
                let found = derivative(&slave, &outputs, &inputs, &seeds);
                assert!(found.iter().all(|d| d.is_finite()), "{found:?} {text}");
                if k > 0 && !held {
                    let at = |by: f64| {
                        let moved: Vec<f64> = values.iter().zip(&seeds).map(|(v, s)| v + by * s).collect();
                        set(&slave, &inputs, &moved);
                        get(&slave, &outputs)
                    };
                    let (plus, here, minus) = (at(0.1 * STEP), at(0.0), at(-0.1 * STEP));
                    set(&slave, &inputs, &values);
                    let is_near = |i: usize| {
                        let wanted = (plus[i] - minus[i]) / (0.2 * STEP);
                        (found[i] - wanted).abs() <= 10.0 * TOLERANCE * (1.0 + wanted.abs())
                    };
                    let bends = |i: usize| {
                        let bend = (plus[i] - 2.0 * here[i] + minus[i]).abs() / (0.1 * STEP);
                        bend > 0.02 * (1.0 + found[i].abs())
                    };
                    if !(0..outputs.len()).any(bends) {
                        smooth += 1;
                        near += u32::from((0..outputs.len()).all(is_near));
                    }
                }
                if k > 1 {
                    slave.step(0.1 * f64::from(k - 2), 0.1);
                }
                values.iter_mut().for_each(|v| *v += 0.02 * random.number());
            }
        }
    }
    assert!(smooth > 180 && 100 * near >= 97 * smooth, "{near} of {smooth} agree with differences");
}

#[test]
fn of_a_controller() {
    for (text, values) in [
        (HEADING, &[1.0, 2.0, 0.3, 3.0, 9.0, 4.0][..]),
        (
            "kind = \"controller\"\nplant.model = \"point_mass\"\ncontroller = \"damping\"\n",
            &[1.0, 2.0, 0.3, 3.0],
        ),
        (
            "kind = \"controller\"\nplant.model = \"unicycle\"\ncontroller = \"waypoints\"\npoints = [[9.0, 4.0]]\n",
            &[1.0, 2.0, 0.6, 3.0],
        ),
    ] {
        let fmu = Fmu::new(text);
        let slave = Slave::ready(&fmu);
        compare(&slave, values, text);
        // An output without a value has no derivative.
        let (inputs, outputs) = (reals(&fmu, Causality::Input), reals(&fmu, Causality::Output));
        if text == HEADING {
            slave.set("x.x_p", f64::NAN);
            let (status, out) = try_derivative(&slave, &outputs, &inputs[1..2], &[1.0]);
            let message = slave.refused(status);
            assert!(message.ends_with("is NaN, must be finite"), "{message}");
            assert_eq!(out, [7.5; 2], "nothing was written");
        }
    }
}

/// Outputs without direct feedthrough do not depend on inputs between steps.
#[test]
fn are_zero_without_feedthrough() {
    let held = FILTER.replace("kind = \"filter\"", "kind = \"filter\"\ndirect_feedthrough = false");
    for configuration in [PLANT, &held] {
        let fmu = Fmu::new(configuration);
        let slave = Slave::ready(&fmu);
        let (inputs, outputs) = (reals(&fmu, Causality::Input), reals(&fmu, Causality::Output));
        slave.step(0.0, 0.1);
        let found = derivative(&slave, &outputs, &inputs, &vec![1.0; inputs.len()]);
        assert_eq!(found, vec![0.0; outputs.len()]);
    }
}

#[test]
fn what_cannot_be_asked() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::ready(&fmu);
    let before = slave.now();
    let [u, x, radius, status, rearm] =
        ["u.u_x", "x.x_p", "goal.radius", "status", "rearm"].map(|name| fmu.reference(name));
    let last = fmu.product.variables.len() - 1;
    for (unknown, known, seed, wanted) in [
        (9999, x, 1.0, format!("value reference 9999 is unknown, must be 0 to {last}")),
        (u, 9999, 1.0, format!("value reference 9999 is unknown, must be 0 to {last}")),
        (status, x, 1.0, format!("value reference {status} is status of type Integer, not Real")),
        (u, rearm, 1.0, format!("value reference {rearm} is rearm of type Boolean, not Real")),
        (x, x, 1.0, "x.x_p is of causality input: each unknown must be a real output".into()),
        (u, u, 1.0, "u.u_x is of causality output: each known must be a real input".into()),
        (u, radius, 1.0, "goal.radius is of causality parameter: each known must be a real input".into()),
        (u, x, f64::NAN, "the seed of x.x_p is NaN, must be finite".into()),
        (u, x, f64::INFINITY, "the seed of x.x_p is inf, must be finite".into()),
    ] {
        let (status, out) = try_derivative(&slave, &[unknown], &[known], &[seed]);
        assert_eq!(slave.refused(status), format!("fmi2GetDirectionalDerivative: {wanted}"));
        assert_eq!(out, [7.5], "nothing was written");
    }
    assert!(before == slave.now());

    // No unknowns are allowed, and then NULL. No knowns mean no change.
    let c = slave.component;
    slave.ok((API.directional_derivative)(c, null(), 0, null(), 0, null(), null_mut()));
    slave.ok((API.directional_derivative)(c, null(), 0, &x, 1, &1.0, null_mut()));
    let mut out = 7.5;
    slave.ok((API.directional_derivative)(c, &u, 1, null(), 0, null(), &raw mut out));
    assert_eq!(out, 0.0);
    for (status, array) in [
        ((API.directional_derivative)(c, null(), 1, &x, 1, &1.0, &mut out), "vUnknown_ref"),
        ((API.directional_derivative)(c, &u, 1, null(), 1, &1.0, &mut out), "vKnown_ref"),
        ((API.directional_derivative)(c, &u, 1, &x, 1, null(), &mut out), "dvKnown"),
        ((API.directional_derivative)(c, &u, 1, &x, 1, &1.0, null_mut()), "dvUnknown"),
    ] {
        assert_eq!(status, ERROR, "{array}");
        let wanted = format!("fmi2GetDirectionalDerivative: {array} is NULL with 1 elements");
        assert!(slave.log.messages().contains(&wanted), "{:?}", slave.log.messages());
    }
}
