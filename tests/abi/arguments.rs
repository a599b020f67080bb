//! NULL arrays, value references and ranges; and a failed call changes nothing.

use std::ptr::{null, null_mut};

use punctual_modeldescription::{BaseType, Causality};

use crate::api::{API, ERROR};
use crate::fmu::{FILTER, Fmu, PLANT};
use crate::slave::Slave;

#[test]
fn null_arrays_of_no_elements_are_fine() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::ready(&fmu);
    let c = slave.component;
    slave.ok((API.get_real)(c, null(), 0, null_mut()));
    slave.ok((API.get_integer)(c, null(), 0, null_mut()));
    slave.ok((API.get_boolean)(c, null(), 0, null_mut()));
    slave.ok((API.get_string)(c, null(), 0, null_mut()));
    slave.ok((API.set_real)(c, null(), 0, null()));
    slave.ok((API.set_integer)(c, null(), 0, null()));
    slave.ok((API.set_boolean)(c, null(), 0, null()));
    slave.ok((API.set_string)(c, null(), 0, null()));
    slave.ok((API.set_debug_logging)(c, 1, 0, null()));
    slave.ok((API.set_input_derivatives)(c, null(), 0, null(), null()));
    slave.ok((API.get_output_derivatives)(c, null(), 0, null(), null_mut()));
}

#[test]
fn null_arrays_of_some_elements_are_errors() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::ready(&fmu);
    let (c, before) = (slave.component, slave.snapshot());
    let (reference, mut real) = (fmu.reference("x.x_p"), 1.5);
    let reference = &raw const reference;
    let real = &raw mut real;
    let mut int = 7;
    let int = &raw mut int;
    for (status, name, array) in [
        ((API.get_real)(c, null(), 1, real), "fmi2GetReal", "vr"),
        ((API.get_real)(c, reference, 1, null_mut()), "fmi2GetReal", "value"),
        ((API.get_integer)(c, null(), 1, int), "fmi2GetInteger", "vr"),
        ((API.get_integer)(c, reference, 1, null_mut()), "fmi2GetInteger", "value"),
        ((API.get_boolean)(c, null(), 1, int), "fmi2GetBoolean", "vr"),
        ((API.get_boolean)(c, reference, 1, null_mut()), "fmi2GetBoolean", "value"),
        ((API.get_string)(c, null(), 1, &mut null()), "fmi2GetString", "vr"),
        ((API.set_real)(c, null(), 1, real), "fmi2SetReal", "vr"),
        ((API.set_real)(c, reference, 1, null()), "fmi2SetReal", "value"),
        ((API.set_integer)(c, null(), 1, int), "fmi2SetInteger", "vr"),
        ((API.set_integer)(c, reference, 1, null()), "fmi2SetInteger", "value"),
        ((API.set_boolean)(c, null(), 1, int), "fmi2SetBoolean", "vr"),
        ((API.set_boolean)(c, reference, 1, null()), "fmi2SetBoolean", "value"),
        ((API.set_string)(c, null(), 1, null()), "fmi2SetString", "vr"),
        ((API.set_debug_logging)(c, 1, 1, null()), "fmi2SetDebugLogging", "categories"),
        ((API.get_real_status)(c, 2, null_mut()), "fmi2GetRealStatus", "value"),
        ((API.get_boolean_status)(c, 3, null_mut()), "fmi2GetBooleanStatus", "value"),
    ] {
        assert_eq!(status, ERROR, "{name} with {array} = NULL");
        let wanted = format!("{name}: {array} is NULL with 1 elements");
        let messages = slave.log.messages();
        assert!(messages.contains(&wanted), "{wanted} is not in {messages:?}");
    }
    // SAFETY: a local variable that still lives.
    assert_eq!(unsafe { *real }, 1.5);
    // SAFETY: as above.
    assert_eq!(unsafe { *int }, 7);
    assert_eq!(slave.snapshot(), before);
    let message = slave.refused((API.get_real)(c, reference, usize::MAX, real));
    assert_eq!(message, format!("fmi2GetReal: vr cannot have {} elements", usize::MAX));
}

/// Each variable through each of the four getters and setters: only those of its type accept it.
#[test]
fn value_references_of_the_wrong_type() {
    for configuration in [FILTER, PLANT] {
        let fmu = Fmu::new(configuration);
        let slave = Slave::new(&fmu);
        let c = slave.component;
        for (reference, variable) in fmu.product.variables.iter().enumerate() {
            let base = variable.kind.base_type();
            let reference = &raw const *Box::leak(Box::new(reference as u32));
            let (mut real, mut int, mut boolean, mut text) = (f64::NAN, -9, -9, null());
            for (kind, get, set) in [
                (
                    BaseType::Real,
                    (API.get_real)(c, reference, 1, &raw mut real),
                    (API.set_real)(c, reference, 1, &raw const real),
                ),
                (
                    BaseType::Integer,
                    (API.get_integer)(c, reference, 1, &raw mut int),
                    (API.set_integer)(c, reference, 1, &raw const int),
                ),
                (
                    BaseType::Boolean,
                    (API.get_boolean)(c, reference, 1, &raw mut boolean),
                    (API.set_boolean)(c, reference, 1, &raw const boolean),
                ),
                (
                    BaseType::String,
                    (API.get_string)(c, reference, 1, &raw mut text),
                    (API.set_string)(c, reference, 1, &raw const text),
                ),
            ] {
                let settable = base == kind && variable.causality != Causality::Output;
                assert_eq!(get == 0, base == kind, "reading {} as {kind:?}", variable.name);
                assert_eq!(set == 0, settable, "writing {} as {kind:?}", variable.name);
            }
        }
    }
    let fmu = Fmu::new(FILTER);
    let slave = Slave::ready(&fmu);
    let (reference, mut value) = (fmu.reference("status"), 1.5);
    let message = slave.refused((API.get_real)(slave.component, &raw const reference, 1, &raw mut value));
    assert_eq!(message, "fmi2GetReal: value reference 9 is status of type Integer, not Real");
    assert_eq!(value, 1.5);
}

#[test]
fn unknown_value_references() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::ready(&fmu);
    let (c, last) = (slave.component, fmu.product.variables.len() - 1);
    for reference in [last as u32 + 1, 9999, u32::MAX] {
        let mut value = 1.5;
        let message = slave.refused((API.get_real)(c, &raw const reference, 1, &raw mut value));
        assert_eq!(
            message,
            format!("fmi2GetReal: value reference {reference} is unknown, must be 0 to {last}")
        );
        assert_eq!(value, 1.5);
        let message = slave.refused((API.set_real)(c, &raw const reference, 1, &raw const value));
        assert_eq!(
            message,
            format!("fmi2SetReal: value reference {reference} is unknown, must be 0 to {last}")
        );
    }
}

#[test]
fn outputs_cannot_be_set() {
    for (configuration, name) in [(FILTER, "u.u_x"), (FILTER, "goal.h"), (PLANT, "x.v")] {
        let fmu = Fmu::new(configuration);
        let slave = Slave::new(&fmu);
        let message = slave.refused(slave.try_set(name, 1.0));
        assert_eq!(message, format!("fmi2SetReal: {name} is an output and cannot be set"));
    }
}

#[test]
fn parameters_are_fixed_after_initialization() {
    for (configuration, name) in [(FILTER, "goal.deadline"), (FILTER, "u_min.u_x"), (PLANT, "x0.v")] {
        let fmu = Fmu::new(configuration);
        let slave = Slave::new(&fmu);
        slave.set(name, 1.0);
        slave.set(name, 2.0);
        slave.initialize();
        let message = slave.refused(slave.try_set(name, 3.0));
        let wanted =
            format!("fmi2SetReal: {name} is a fixed parameter and cannot change after initialization");
        assert_eq!(message, wanted);
        assert_eq!(slave.real(name), 2.0, "the last one wins");
    }
}

/// A call with one bad element changes nothing, wherever the bad element is.
#[test]
fn a_failed_call_changes_nothing() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::new(&fmu);
    let (c, before) = (slave.component, slave.snapshot());
    let [good, other] = ["x.x_p", "goal.deadline"].map(|name| fmu.reference(name));
    for (references, values) in [
        ([good, 9999], [5.0, 5.0]),
        ([9999, good], [5.0, 5.0]),
        ([good, fmu.reference("u.u_x")], [5.0, 5.0]),
        ([good, fmu.reference("rearm")], [5.0, 5.0]),
        ([good, other], [5.0, -1.0]),
        ([other, fmu.reference("goal.radius")], [5.0, f64::NAN]),
        ([other, other], [5.0, 0.0]),
    ] {
        slave.refused((API.set_real)(c, references.as_ptr(), 2, values.as_ptr()));
        assert_eq!(slave.snapshot(), before, "after setting {references:?} to {values:?}");
    }
    let mut out = [1.5, 2.5];
    slave.refused((API.get_real)(c, [good, 9999].as_ptr(), 2, out.as_mut_ptr()));
    assert_eq!(out, [1.5, 2.5]);
    let mut out = [7, 8];
    slave.refused((API.get_boolean)(c, [fmu.reference("rearm"), good].as_ptr(), 2, out.as_mut_ptr()));
    slave.refused((API.get_integer)(c, [fmu.reference("status"), good].as_ptr(), 2, out.as_mut_ptr()));
    assert_eq!(out, [7, 8]);
    slave.refused((API.set_boolean)(c, [fmu.reference("rearm"), good].as_ptr(), 2, [1, 1].as_ptr()));
    assert_eq!(slave.snapshot(), before);
}

#[test]
fn the_same_reference_twice() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::new(&fmu);
    let twice = [fmu.reference("x.x_p"); 2];
    slave.ok((API.set_real)(slave.component, twice.as_ptr(), 2, [3.0, 4.0].as_ptr()));
    let mut out = [0.0; 2];
    slave.ok((API.get_real)(slave.component, twice.as_ptr(), 2, out.as_mut_ptr()));
    assert_eq!(out, [4.0; 2], "the last one wins");
}

#[test]
fn booleans_other_than_1_are_true() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::new(&fmu);
    let reference = fmu.reference("rearm");
    for (value, wanted) in [(0, false), (1, true), (0, false), (-1, true), (0, false), (256, true)] {
        slave.ok((API.set_boolean)(slave.component, &raw const reference, 1, &raw const value));
        assert_eq!(slave.flag("rearm"), wanted, "{value}");
    }
}

#[test]
fn parameters_outside_their_range() {
    for (configuration, name, value, wanted) in [
        (FILTER, "goal.deadline", -1.0, "goal.deadline: is -1, must be finite and >= 1e-9"),
        (FILTER, "goal.deadline", f64::INFINITY, "goal.deadline: is inf, must be finite and >= 1e-9"),
        (FILTER, "goal.radius", 0.0, "goal.radius: is 0, must be finite and >= 1e-9"),
        (FILTER, "goal.margin", -0.5, "goal.margin: is -0.5, must be finite and >= 0"),
        (FILTER, "goal.centre[1]", f64::NAN, "goal.centre[1]: is NaN, must be finite"),
        (PLANT, "x0.theta", f64::NAN, "x0.theta: is NaN, must be finite"),
        (PLANT, "inner_step", 0.0, "inner_step: is 0, must be finite and >= 1e-9"),
    ] {
        let fmu = Fmu::new(configuration);
        let slave = Slave::new(&fmu);
        let before = slave.real(name);
        assert_eq!(slave.refused(slave.try_set(name, value)), format!("fmi2SetReal: {wanted}"));
        assert_eq!(slave.real(name), before);
        slave.initialize();
    }
    let fmu = Fmu::new(FILTER);
    let slave = Slave::new(&fmu);
    let message = slave.refused(slave.try_set("u_max.u_x", 2e30));
    assert_eq!(message, "fmi2SetReal: u_max.u_x: is 2e30, must be finite and >= -1e30 and <= 1e30");
}

/// Contradictory parameters can only be judged together, when initialization ends.
#[test]
fn contradicting_bounds_end_the_initialization_with_an_error() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::new(&fmu);
    let c = slave.component;
    slave.set("u_min.u_x", 60.0);
    slave.ok((API.enter_initialization_mode)(c));
    slave.set_inputs(&[0.0, 0.0]);
    // Reading outputs in between is no error, since getters never fail.
    slave.real("u.u_x");
    let message = slave.refused((API.exit_initialization_mode)(c));
    let wanted = "fmi2ExitInitializationMode: bounds.u_x: is [60, 50], must be [min, max] with min <= max (in an FMU: u_min.u_x, u_max.u_x)";
    assert_eq!(message, wanted);
    // Still in initialization mode, where it can be corrected.
    slave.set("u_max.u_x", 70.0);
    slave.ok((API.exit_initialization_mode)(c));
    slave.step(0.0, 0.1);
    let u = slave.real("u.u_x");
    assert!((60.0..=70.0).contains(&u), "u_x is {u}");
}

/// After a change of seed the noise differs, and a restored state brings the first seed's noise back.
#[test]
fn the_seed_of_a_disturbance_may_change_in_a_run() {
    let disturbed = format!("{PLANT}\n[disturbance]\nseed = 3\nmeasurements = {{ v = 1.0 }}\n");
    let fmu = Fmu::new(&disturbed);
    let told = |seeds: [f64; 2]| {
        let slave = Slave::new(&fmu);
        slave.set("disturbance.seed", seeds[0]);
        slave.initialize();
        slave.step(0.0, 0.1);
        let before = (slave.real("x.v"), slave.state());
        slave.set("disturbance.seed", seeds[1]);
        let now = slave.real("x.v");
        slave.step(0.1, 0.1);
        let next = slave.real("x.v");
        slave.restore(before.1);
        assert_eq!(slave.real("disturbance.seed"), seeds[0]);
        assert_eq!(slave.real("x.v"), before.0);
        (before.0, now, next)
    };
    let (third, fifth, other) = (told([3.0, 3.0]), told([5.0, 5.0]), told([3.0, 5.0]));
    assert_eq!(other, (third.0, fifth.1, fifth.2));
    assert!(third.0 == third.1 && third.1 != fifth.1 && third.2 != fifth.2);
    let slave = Slave::new(&fmu);
    slave.initialize();
    let message = slave.refused(slave.try_set("disturbance.seed", -1.0));
    assert_eq!(message, "fmi2SetReal: disturbance.seed: is -1, must be finite and >= 0");
    slave.refused(slave.try_set("disturbance.period", 1.0));
}
