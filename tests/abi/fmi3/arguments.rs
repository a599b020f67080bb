//! NULL, counts and value references of arrays; and a failed call changes nothing.

use std::ptr::{null, null_mut};

use super::slave::Slave;
use crate::api::ERROR;
use crate::api::three::API;
use crate::fmu::{FILTER, Fmu, PLANT};

#[test]
fn the_number_of_values_is_that_of_the_elements() {
    let fmu = Fmu::of_fmi3(FILTER, true);
    let slave = Slave::ready(&fmu);
    let references = ["x", "u_ref"].map(|name| fmu.item(name).reference());
    let mut values = [7.5; 8];
    let get = |count: usize, values: &mut [f64; 8]| {
        (API.get_float64)(slave.instance, references.as_ptr(), 2, values.as_mut_ptr(), count)
    };
    for count in [0, 1, 5, 7, 8] {
        let message = slave.refused(get(count, &mut values));
        let wanted = format!("nValues is {count}, must be 6: the number of values of the variables");
        assert_eq!(message, format!("fmi3GetFloat64: {wanted}"));
        assert_eq!(values, [7.5; 8]);
    }
    slave.ok(get(6, &mut values));
    assert_eq!(values, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 7.5, 7.5]);
    let before = slave.now();
    for count in [0, 3, 5] {
        let values = [1.0; 8];
        let message = slave.refused(slave.set("x", &values[..count]));
        assert!(message.starts_with(&format!("fmi3SetFloat64: nValues is {count}, must be 4")), "{message}");
    }
    assert!(slave.now() == before);
}

#[test]
fn value_references_that_are_none() {
    let fmu = Fmu::of_fmi3(FILTER, true);
    let slave = Slave::ready(&fmu);
    let c = slave.instance;
    let (x, status) = (fmu.item("x").reference(), fmu.item("status").reference());
    let last = fmu.item("time").reference();
    let get = |reference: u32| (API.get_float64)(c, &raw const reference, 1, [0.0; 4].as_mut_ptr(), 4);
    let message = slave.refused(get(x + 1));
    assert_eq!(
        message,
        format!(
            "fmi3GetFloat64: value reference {} is inside the array x, whose value reference is {x}",
            x + 1
        )
    );
    let message = slave.refused(get(last + 1));
    let wanted = format!("value reference {} is unknown, must be 0 to {last}", last + 1);
    assert_eq!(message, format!("fmi3GetFloat64: {wanted}"));
    assert!(slave.refused(get(u32::MAX)).contains("is unknown"));
    let message = slave.refused(get(status));
    let wanted = format!("value reference {status} is status of type Int64, not Float64");
    assert_eq!(message, format!("fmi3GetFloat64: {wanted}"));
    let message = slave.refused((API.get_int32)(c, &raw const status, 1, &mut 0, 1));
    assert!(message.contains("is status of type Int64, not Int32"), "{message}");
    let message = slave.refused((API.get_uint8)(c, &raw const x, 1, &mut 0, 1));
    assert!(message.contains("is x of type Float64, not UInt8"), "{message}");
    let message = slave.refused((API.get_string)(c, null(), 0, null_mut(), 1));
    assert!(message.contains("values is NULL") || message.contains("nValues is 1, must be 0"), "{message}");
    // Variables that cannot be set.
    let set = |name: &str, values: &[f64]| slave.refused(slave.set(name, values));
    assert_eq!(set("u", &[0.0; 2]), "fmi3SetFloat64: u is of causality output and cannot be set");
    assert_eq!(set("time", &[0.0]), "fmi3SetFloat64: time is of causality independent and cannot be set");
    assert_eq!(
        set("goal.centre", &[1.0; 2]),
        "fmi3SetFloat64: goal.centre is a fixed parameter and cannot change after initialization"
    );
    let code = fmu.item("status_code").reference();
    let message = slave.refused((API.set_int32)(c, &raw const code, 1, &3, 1));
    assert!(message.contains("status_code is of causality output"), "{message}");
    let message = slave.refused((API.set_int64)(c, &raw const status, 1, &3, 1));
    assert!(message.contains("status is of causality output"), "{message}");
}

/// One element outside its range makes the call refuse all values, including those of other variables.
#[test]
fn a_parameter_keeps_to_its_range_by_elements() {
    let fmu = Fmu::of_fmi3(FILTER, true);
    let slave = Slave::new(&fmu);
    slave.ok(slave.set("goal.centre", &[1.0, 2.0]));
    let before = slave.now();
    for bad in [[3.0, f64::NAN], [f64::INFINITY, 4.0]] {
        let message = slave.refused(slave.set("goal.centre", &bad));
        assert!(message.starts_with("fmi3SetFloat64: goal.centre["), "{message}");
    }
    assert!(slave.now() == before);
    assert_eq!(slave.get("goal.centre"), [1.0, 2.0]);
    slave.initialize();
    assert_eq!(slave.get("goal.centre"), [1.0, 2.0]);
}

#[test]
fn null_arrays() {
    let fmu = Fmu::of_fmi3(PLANT, true);
    let slave = Slave::ready(&fmu);
    let (c, u) = (slave.instance, fmu.item("u").reference());
    slave.ok((API.get_float64)(c, null(), 0, null_mut(), 0));
    assert!(slave.refused((API.get_float64)(c, null(), 1, [0.0; 2].as_mut_ptr(), 2)).contains("NULL"));
    assert!(slave.refused((API.get_float64)(c, &raw const u, 1, null_mut(), 2)).contains("NULL"));
    assert!(slave.refused((API.set_float64)(c, &raw const u, 1, null(), 2)).contains("NULL"));
    assert!(slave.refused((API.set_float64)(c, &raw const u, usize::MAX, &1.0, 1)).contains("cannot have"));
    // A step writes four values, so each pointer must be valid; this is checked before the step.
    let (mut flag, mut last) = (7, 0.5);
    let (f, l) = (&raw mut flag, &raw mut last);
    for (event, end, early, last) in
        [(null_mut(), f, f, l), (f, null_mut(), f, l), (f, f, null_mut(), l), (f, f, f, null_mut())]
    {
        let message = slave.refused((API.do_step)(c, 0.0, 0.1, 0, event, end, early, last));
        assert!(message.contains("is NULL"), "{message}");
    }
    assert_eq!((flag, last), (7, 0.5));
    slave.step(0.0, 0.1);
    assert_eq!(slave.try_step(f64::NAN, 0.1), ERROR);
    assert_eq!(slave.try_step(0.1, -0.1), ERROR);
    assert!(slave.refused((API.get_number_of_variable_dependencies)(c, 2, null_mut())).contains("NULL"));
}
