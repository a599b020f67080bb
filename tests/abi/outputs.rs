//! Lazy outputs of a filter: the inputs and the time that they belong to, and which samples are remembered.
//!
//! The oracle is the filter of `punctual-core` with the same configuration.

use punctual_core::filter::{Filter, Phase, Status};
use punctual_fmu::configuration::Shape;

use crate::api::API;
use crate::fmu::{FILTER, Fmu};
use crate::slave::Slave;

/// Inputs (state, then reference) along a plausible path.
fn inputs(k: usize) -> [f64; 6] {
    let s = k as f64;
    [0.3 * s, 0.2 * s, 1.5 + 0.1 * s, 1.25 - 0.01 * s, 0.5, -0.25]
}

const ZERO: [f64; 6] = [0.0; 6];
const NAN: [f64; 6] = [f64::NAN; 6];

fn oracle(fmu: &Fmu) -> Filter {
    fmu.filter().build().unwrap()
}

/// Makes a sample of the oracle, which `commit` remembers; returns u.
fn sample(filter: &mut Filter, t: f64, inputs: &[f64; 6], commit: bool) -> [f64; 2] {
    let (x, u_ref) = inputs.split_at(4);
    let mut u = [f64::NAN; 2];
    let done = if commit { filter.step(t, x, u_ref, &mut u) } else { filter.peek(t, x, u_ref, &mut u) };
    done.unwrap();
    u
}

#[test]
fn outputs_follow_inputs_without_a_step() {
    let fmu = Fmu::new(FILTER);
    let (slave, mut filter) = (Slave::ready(&fmu), oracle(&fmu));
    let (mut t, h) = (0.0, 0.1);
    for k in 0..30 {
        slave.set_inputs(&inputs(k));
        let looked = sample(&mut filter, t, &inputs(k), false);
        slave.shows(&filter, &looked, &format!("read at {t} before the step"));
        slave.step(t, h);
        let u = sample(&mut filter, t, &inputs(k), true);
        t += h;
        slave.shows(&filter, &u, &format!("read at {t} after the step: still the sample at its start"));
    }
}

/// A Jacobi master sets inputs, steps and reads; a Gauss–Seidel master reads before the step. Both see the
/// same sample of the same inputs, only at different moments.
#[test]
fn the_order_of_reading_and_stepping_changes_nothing() {
    let fmu = Fmu::new(FILTER);
    let [early, late, both] = [(); 3].map(|()| Slave::ready(&fmu));
    for k in 0..20 {
        let t = k as f64 * 0.1;
        for slave in [&early, &late, &both] {
            slave.set_inputs(&inputs(k));
        }
        let read_early = early.snapshot();
        both.snapshot();
        both.set_inputs(&ZERO);
        both.snapshot();
        both.set_inputs(&inputs(k));
        for slave in [&early, &late, &both] {
            slave.step(t, 0.1);
        }
        let after = late.snapshot();
        assert_eq!(early.snapshot(), after, "reading before the step at {t}");
        assert_eq!(both.snapshot(), after, "reading twice and trying other inputs at {t}");
        assert_eq!(read_early, after, "the step at {t} remembers what was shown before it");
    }
}

/// A master that is a step late hands on what it reads at the start for the first step. With a delay that is what the filter assumes
/// to act there: the admissible input nearest 0. Once the inputs of the first step are set, it is the sample of these.
#[test]
fn before_the_first_inputs_a_late_filter_shows_what_acts() {
    let text =
        FILTER.replace("kind", "actuation_delay = 0.001\nkind").replacen("[-50.0, 50.0]", "[1.5, 50.0]", 1);
    let fmu = Fmu::new(&text);
    let u = |slave: &Slave| [slave.real("u.u_x"), slave.real("u.u_y")];
    let slave = Slave::new(&fmu);
    slave.ok((API.setup_experiment)(slave.component, 0, 0.0, 0.0, 0, 0.0));
    slave.ok((API.enter_initialization_mode)(slave.component));
    slave.set_inputs(&inputs(4));
    assert_eq!(u(&slave), [1.5, 0.0], "initialization mode");
    slave.ok((API.exit_initialization_mode)(slave.component));
    assert_eq!(u(&slave), [1.5, 0.0], "before the inputs of the first step");
    let mut filter = oracle(&fmu);
    slave.set_inputs(&inputs(4));
    let wanted = sample(&mut filter, 0.0, &inputs(4), true);
    assert_eq!(u(&slave), wanted, "read before the first step");
    assert_ne!(wanted, [1.5, 0.0]);
    slave.step(0.0, 0.001);
    assert_eq!(u(&slave), wanted, "and after it");
    // The delay may be set by the importer too.
    let prompt = Fmu::new(FILTER);
    let told = Slave::new(&prompt);
    told.set("actuation_delay", 0.001);
    told.ok((API.setup_experiment)(told.component, 0, 0.0, 0.0, 0, 0.0));
    told.ok((API.enter_initialization_mode)(told.component));
    told.set_inputs(&inputs(4));
    told.ok((API.exit_initialization_mode)(told.component));
    assert_eq!(u(&told), [0.0, 0.0]);
}

#[test]
fn reading_twice_gives_the_same() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::ready(&fmu);
    slave.set_inputs(&inputs(3));
    assert_eq!(slave.snapshot(), slave.snapshot());
}

/// Masters differ in what they pass before the first step; only the first step anchors.
#[test]
fn the_anchor_is_the_first_step_whatever_came_before() {
    let fmu = Fmu::new(FILTER);
    for garbage in [ZERO, NAN, [f64::INFINITY; 6], [1e308; 6], inputs(9)] {
        let (slave, mut filter) = (Slave::new(&fmu), oracle(&fmu));
        slave.set_inputs(&garbage);
        slave.snapshot();
        slave.ok((API.setup_experiment)(slave.component, 0, 0.0, 0.5, 0, 0.0));
        slave.ok((API.enter_initialization_mode)(slave.component));
        slave.set_inputs(&garbage);
        slave.snapshot();
        slave.ok((API.exit_initialization_mode)(slave.component));
        slave.snapshot();
        slave.set_inputs(&garbage);
        slave.snapshot();
        slave.set_inputs(&inputs(1));
        slave.step(0.5, 0.1);
        let u = sample(&mut filter, 0.5, &inputs(1), true);
        slave.shows(&filter, &u, &format!("after {garbage:?}"));
        assert_eq!(slave.real("goal.time_left"), 10.0);
    }
}

/// Steps with invalid inputs do not anchor, and the output stays finite and within its bounds.
#[test]
fn inputs_that_are_not_numbers() {
    let fmu = Fmu::new(FILTER);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for place in 0..6 {
            let slave = Slave::ready(&fmu);
            let mut broken = inputs(1);
            broken[place] = bad;
            slave.set_inputs(&broken);
            for moment in ["before", "after"] {
                assert_eq!(slave.integer("status"), Status::InvalidInput as i32, "{bad} at {place} {moment}");
                assert_eq!(slave.integer("goal.phase"), Phase::Waiting as i32);
                for (name, bound) in [("u.u_x", 50.0), ("u.u_y", 40.0)] {
                    let u = slave.real(name);
                    assert!(u.is_finite() && u.abs() <= bound, "{name} is {u} for {bad} at {place}");
                }
                if moment == "before" {
                    slave.step(0.0, 0.1);
                }
            }
            slave.set_inputs(&inputs(1));
            slave.step(0.1, 0.1);
            let mut filter = oracle(&fmu);
            let u = sample(&mut filter, 0.1, &inputs(1), true);
            slave.shows(&filter, &u, &format!("anchored after {bad} at {place}"));
        }
    }
}

/// Invalid inputs in between leave the promise unchanged.
#[test]
fn a_gap_of_invalid_inputs_forgets_nothing() {
    let fmu = Fmu::new(FILTER);
    let (slave, mut filter) = (Slave::ready(&fmu), oracle(&fmu));
    let mut t = 0.0;
    for k in 0..10 {
        let given = if (3..6).contains(&k) { NAN } else { inputs(k) };
        slave.set_inputs(&given);
        slave.step(t, 0.1);
        let u = sample(&mut filter, t, &given, true);
        slave.shows(&filter, &u, &format!("at {t}"));
        t += 0.1;
    }
    let left = slave.real("goal.time_left");
    assert!((left - 9.1).abs() < 1e-12, "{left} s are left of the deadline that the first step set");
}

#[test]
fn without_feedthrough_only_steps_compute() {
    let fmu = Fmu::new(&format!("direct_feedthrough = false\n{FILTER}"));
    let (slave, mut filter) = (Slave::ready(&fmu), oracle(&fmu));
    let mut t = 0.0;
    for k in 0..10 {
        let outputs = |slave: &Slave| slave.snapshot().split_off(fmu.product.layout.outputs);
        let before = outputs(&slave);
        slave.set_inputs(&inputs(k));
        assert_eq!(outputs(&slave), before, "at {t}, inputs set but not stepped");
        slave.step(t, 0.1);
        let u = sample(&mut filter, t, &inputs(k), true);
        slave.shows(&filter, &u, &format!("after the step from {t}"));
        t += 0.1;
    }
}

#[test]
fn a_rising_edge_of_rearm_starts_the_deadline_anew() {
    let fmu = Fmu::new(FILTER);
    let (slave, mut filter) = (Slave::ready(&fmu), oracle(&fmu));
    let mut before = false;
    for (k, rearm) in [false, false, true, true, true, false, false, true, false].into_iter().enumerate() {
        let t = k as f64;
        slave.set_inputs(&inputs(k));
        slave.set_flag("rearm", rearm);
        let shown = slave.snapshot();
        // Looking ahead over a re-arming must not re-arm: look, undo it, look again.
        slave.set_flag("rearm", !rearm);
        slave.snapshot();
        slave.set_flag("rearm", rearm);
        assert_eq!(slave.snapshot(), shown, "at {t}");
        slave.step(t, 1.0);
        assert_eq!(slave.snapshot(), shown, "the step at {t} remembers what was shown");
        if rearm && !before {
            filter.rearm();
            assert_eq!(slave.real("goal.time_left"), 10.0, "at {t}");
        }
        before = rearm;
        let u = sample(&mut filter, t, &inputs(k), true);
        slave.shows(&filter, &u, &format!("at {t}"));
    }
}

/// Parameters take effect whenever they are set before the end of the initialization.
#[test]
fn parameters_in_every_mode_before_the_steps() {
    let fmu = Fmu::new(FILTER);
    for when in 0..3 {
        let slave = Slave::new(&fmu);
        let set = |now: usize| {
            if now == when {
                slave.set("goal.deadline", 4.0);
                slave.set("goal.centre[2]", 30.0);
                slave.set("u_max.u_x", 3.0);
            }
        };
        set(0);
        slave.ok((API.setup_experiment)(slave.component, 0, 0.0, 0.0, 0, 0.0));
        set(1);
        slave.ok((API.enter_initialization_mode)(slave.component));
        slave.set_inputs(&inputs(2));
        slave.snapshot();
        set(2);
        let mut configuration = fmu.filter().clone();
        configuration.barrier[0].deadline = Some(4.0);
        let Shape::Disc { at, .. } = &mut configuration.barrier[0].shape else { panic!("not a disc") };
        at.centre = [45.0, 30.0];
        configuration.bounds.get_mut("u_x").unwrap()[1] = 3.0;
        let mut filter = configuration.build().unwrap();
        let u = sample(&mut filter, 0.0, &inputs(2), false);
        slave.shows(&filter, &u, &format!("in initialization mode, set at {when}"));
        slave.ok((API.exit_initialization_mode)(slave.component));
        slave.shows(&filter, &u, "after it");
        slave.step(0.0, 0.1);
        let u = sample(&mut filter, 0.0, &inputs(2), true);
        slave.shows(&filter, &u, "after a step");
    }
}
