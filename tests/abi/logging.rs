//! Categories, the messages logged, and functions that the capability flags exclude.

use std::ffi::CString;
use std::ptr::null;

use punctual_fmu::product::LOG_CATEGORIES;

use crate::api::{API, DISCARD, ERROR, Text};
use crate::fmu::{FILTER, Fmu, PLANT};
use crate::slave::Slave;

fn debug(slave: &Slave, on: bool, categories: &[&str]) -> i32 {
    let texts: Vec<_> = categories.iter().map(|c| CString::new(*c).unwrap()).collect();
    let pointers: Vec<Text> = texts.iter().map(|t| t.as_ptr()).collect();
    (API.set_debug_logging)(slave.component, i32::from(on), pointers.len(), pointers.as_ptr())
}

#[test]
fn no_category_means_all() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::new(&fmu);
    assert_eq!(slave.log.messages(), [""; 0], "logging is off, and nothing failed");
    slave.ok((API.set_debug_logging)(slave.component, 1, 0, null()));
    slave.ok((API.reset)(slave.component));
    assert_eq!(slave.log.messages(), ["reset"]);
    assert_eq!(slave.log.entries()[0].category, "logEvents");
    assert_eq!(slave.log.entries()[0].status, 0);
    slave.ok((API.set_debug_logging)(slave.component, 0, 0, null()));
    slave.ok((API.reset)(slave.component));
    assert_eq!(slave.log.messages().len(), 1);
}

#[test]
fn categories_by_name() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::new(&fmu);
    for (on, categories, logged) in [
        (true, vec!["logStatusError"], 0),
        (true, vec!["logStatusError", "logEvents"], 1),
        (false, vec!["logStatusError"], 2),
        (false, vec!["logEvents"], 2),
    ] {
        slave.ok(debug(&slave, on, &categories));
        slave.ok((API.reset)(slave.component));
        assert_eq!(slave.log.messages().len(), logged, "after {on} {categories:?}");
    }
}

#[test]
fn an_unknown_category_is_an_error_and_switches_nothing() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::new(&fmu);
    let message = slave.refused(debug(&slave, true, &["logEvents", "log100%s"]));
    let wanted = "fmi2SetDebugLogging: the log category \"log100?s\" is unknown, must be one of \
                  logStatusError, logEvents, logStatusWarning";
    assert_eq!(message, wanted);
    let pointers: [Text; 1] = [null()];
    let message = slave.refused((API.set_debug_logging)(slave.component, 1, 1, pointers.as_ptr()));
    assert_eq!(message, "fmi2SetDebugLogging: a category is NULL");
    let before = slave.log.messages().len();
    slave.ok((API.reset)(slave.component));
    assert_eq!(slave.log.messages().len(), before, "events are still off");
}

/// Categories are those of the model description, and an ordinary run logs nothing unless requested.
#[test]
fn an_ordinary_run_is_silent_unless_asked() {
    for configuration in [FILTER, PLANT] {
        let fmu = Fmu::new(configuration);
        let slave = Slave::ready(&fmu);
        slave.step(0.0, 0.1);
        slave.ok((API.terminate)(slave.component));
        assert_eq!(slave.log.messages(), [""; 0]);

        let slave = Slave::new(&fmu);
        slave.ok((API.set_debug_logging)(slave.component, 1, 0, null()));
        slave.initialize();
        assert_eq!(slave.try_step(-1.0, 0.1), ERROR);
        for entry in slave.log.entries() {
            assert!(LOG_CATEGORIES.iter().any(|(name, _)| *name == entry.category), "{entry:?}");
            assert_eq!(entry.instance, "slave");
        }
        assert_eq!(slave.log.entries().len(), 2, "{:?}", slave.log.entries());
    }
}

/// Whatever disables plans gives a warning at instantiation, which still succeeds.
#[test]
fn what_switches_plans_off_is_logged_once() {
    let declared = FILTER.replace("assurance = \"off\"", "actuation_delay = 0.3");
    let fmu = Fmu::new(&declared.replace("deadline", "disturbance = 0.5\ndeadline"));
    let slave = Slave::new(&fmu);
    let entries = slave.log.entries();
    let [entry] = &entries[..] else { panic!("{entries:?}") };
    assert_eq!((entry.status, entry.category.as_str()), (1, "logStatusWarning"), "{entry:?}");
    for part in
        ["the guarantee of goal", "actuation_delay is 0.3", "goal.disturbance is 0.5", "assurance = \"on\""]
    {
        assert!(entry.message.contains(part) && !entry.message.contains('%'), "{part}: {entry:?}");
    }
    slave.initialize();
    slave.step(0.0, 0.001);
    assert_eq!(slave.log.entries().len(), 1, "{:?}", slave.log.entries());
}

/// Every excluded function, with sensible arguments, names the flag that excludes it.
#[test]
fn excluded_functions_name_their_flag() {
    for configuration in [FILTER, PLANT] {
        let fmu = Fmu::new(configuration);
        let slave = Slave::ready(&fmu);
        let (c, before) = (slave.component, slave.snapshot());
        let mut result = [1.5];
        let (references, order) = ([0], [1]);
        let refs = references.as_ptr();
        for (status, name, flag) in [
            (
                (API.set_input_derivatives)(c, refs, 1, order.as_ptr(), [1.0].as_ptr()),
                "fmi2SetRealInputDerivatives",
                "canInterpolateInputs is false",
            ),
            (
                (API.get_output_derivatives)(c, refs, 1, order.as_ptr(), result.as_mut_ptr()),
                "fmi2GetRealOutputDerivatives",
                "maxOutputDerivativeOrder is 0",
            ),
            // The spelling of the standard.
            ((API.cancel_step)(c), "fmi2CancelStep", "canRunAsynchronuously is false"),
        ] {
            assert_eq!(status, ERROR, "{name}");
            let messages = slave.log.messages();
            let named = messages.iter().any(|m| m.starts_with(&format!("{name}: ")) && m.contains(flag));
            assert!(named, "{name} should name {flag}: {messages:?}");
        }
        assert_eq!(result, [1.5], "nothing was written");
        assert_eq!(slave.snapshot(), before);
    }
}

/// Nothing is asynchronous, so only the time and the end of the run have a status.
#[test]
fn get_status_family() {
    let fmu = Fmu::new(PLANT);
    let slave = Slave::ready(&fmu);
    let c = slave.component;
    slave.step(0.0, 0.5);
    assert_eq!(slave.time(), 0.5);
    let (mut real, mut int, mut text) = (1.5, 7, null());
    for kind in [-1, 0, 1, 2, 3, 4, 99] {
        assert_eq!((API.get_status)(c, kind, &raw mut int), DISCARD);
        assert_eq!((API.get_integer_status)(c, kind, &raw mut int), DISCARD);
        assert_eq!((API.get_string_status)(c, kind, &raw mut text), DISCARD);
        if kind != 2 {
            assert_eq!((API.get_real_status)(c, kind, &raw mut real), DISCARD);
        }
        if kind != 3 {
            assert_eq!((API.get_boolean_status)(c, kind, &raw mut int), DISCARD);
        }
    }
    assert_eq!((real, int, text), (1.5, 7, null()), "nothing was written");
    slave.ok((API.get_boolean_status)(c, 3, &raw mut int));
    assert_eq!(int, 0);
    slave.ok((API.terminate)(c));
    slave.ok((API.get_boolean_status)(c, 3, &raw mut int));
    assert_eq!(int, 1);
    assert_eq!(slave.log.messages(), [""; 0], "to ask is no failure");
}
