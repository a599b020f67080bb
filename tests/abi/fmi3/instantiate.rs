//! Refusals with their messages, and paths of every kind.

use std::ffi::CString;
use std::ptr::{null, null_mut};

use super::slave::{Log, Said, Slave, log};
use crate::api::three::API;
use crate::api::{API as API2, ERROR, OK};
use crate::fmu::{FILTER, Fmu, PLANT};

/// The message with which an instance is refused.
fn refusal(said: &Said) -> String {
    let log = Log::default();
    assert!(said.instantiate(&log).is_null());
    log.failure()
}

#[test]
fn what_is_not_offered_is_refused_in_plain_words() {
    let fmu = Fmu::of_fmi3(FILTER, true);
    let good = Said::of(&fmu);
    let name = "fmi3InstantiateCoSimulation";
    assert_eq!(
        refusal(&Said { events: true, ..good.clone() }),
        format!("{name}: eventModeUsed is true, must be false: hasEventMode is false")
    );
    let message = refusal(&Said { required: vec![0, 4], ..good.clone() });
    assert!(
        message.starts_with(&format!("{name}: nRequiredIntermediateVariables is 2, must be 0")),
        "{message}"
    );
    assert_eq!(refusal(&Said { token: None, ..good.clone() }), format!("{name}: instantiationToken is NULL"));
    let message = refusal(&Said { path: None, ..good.clone() });
    assert!(message.starts_with(&format!("{name}: resourcePath is NULL")), "{message}");
    let message = refusal(&Said { token: Some(c"{other}".to_owned()), ..good.clone() });
    assert!(message.contains("\"{other}\", must be") && message.contains(fmu.guid()), "{message}");
    let message = refusal(&Said { path: Some(c"/nowhere/resources".to_owned()), ..good.clone() });
    assert!(message.contains("cannot read /nowhere/resources/configuration.toml"), "{message}");
    // An early return is only permitted, so it is no reason for refusal.
    let log = Log::default();
    let instance = Said { early: true, ..good }.instantiate(&log);
    assert!(!instance.is_null(), "{:?}", log.entries());
    (API.free_instance)(instance);
    (API.free_instance)(null_mut());
}

#[test]
fn a_path_may_end_in_a_separator() {
    let fmu = Fmu::of_fmi3(PLANT, true);
    for ending in ["", "/"] {
        let path = Some(CString::new(format!("{}{ending}", fmu.path())).unwrap());
        let log = Log::default();
        let instance = Said { path, ..Said::of(&fmu) }.instantiate(&log);
        assert!(!instance.is_null(), "{ending:?}: {:?}", log.entries());
        (API.free_instance)(instance);
    }
}

#[test]
fn the_other_interfaces_are_refused() {
    let fmu = Fmu::of_fmi3(PLANT, true);
    let Said { token, path, .. } = Said::of(&fmu);
    let (token, path) = (token.unwrap(), path.unwrap());
    let to = Log::default();
    let (name, token, path, environment) = (c"a".as_ptr(), token.as_ptr(), path.as_ptr(), to.environment());
    let exchange = (API.instantiate_model_exchange)(name, token, path, 0, 0, environment, Some(log));
    assert!(exchange.is_null());
    assert_eq!(to.failure(), "fmi3InstantiateModelExchange: the FMU has no model exchange");
    let scheduled = (API.instantiate_scheduled_execution)(
        name,
        token,
        path,
        0,
        0,
        environment,
        Some(log),
        None,
        None,
        None,
    );
    assert!(scheduled.is_null());
    assert_eq!(to.failure(), "fmi3InstantiateScheduledExecution: the FMU has no scheduled execution");
}

/// A function of the other version is refused, and the instance continues.
#[test]
fn functions_of_the_other_version() {
    let (two, three) = (Fmu::new(FILTER), Fmu::of_fmi3(FILTER, true));
    let old = crate::slave::Slave::ready(&two);
    let new = Slave::ready(&three);
    let message = new.refused((API2.do_step)(new.instance, 0.0, 0.1, 1));
    assert_eq!(
        message,
        "fmi2DoStep: the instance is one of FMI 3.0, which has no functions that begin with fmi2"
    );
    let message = old.refused((API.terminate)(old.component));
    assert_eq!(
        message,
        "fmi3Terminate: the instance is one of FMI 2.0, which has no functions that begin with fmi3"
    );
    old.step(0.0, 0.1);
    new.step(0.0, 0.1);
    // A version also does not instantiate an FMU of the other version.
    let message = refusal(&Said::of(&two));
    let wanted = "the FMU is one of FMI 2.0, which has no instance of FMI 3.0";
    assert_eq!(message, format!("fmi3InstantiateCoSimulation: {wanted}"));
    let log = crate::slave::Log::default();
    let callbacks = log.callbacks();
    let (guid, location) = (CString::new(three.guid()).unwrap(), CString::new(three.location()).unwrap());
    let component =
        (API2.instantiate)(null(), 1, guid.as_ptr(), location.as_ptr(), &raw const callbacks, 0, 0);
    assert!(component.is_null());
    let wanted = "the FMU is one of FMI 3.0, which has no instance of FMI 2.0";
    assert_eq!(log.failure(), format!("fmi2Instantiate: {wanted}"));
    assert_ne!(two.guid(), three.guid(), "a token of its own");
}

/// FMI 3.0 only allows messages that were requested, apart from errors.
#[test]
fn a_log_that_nobody_wants_has_errors_only() {
    let fmu = Fmu::of_fmi3(FILTER, true);
    for wanted in [false, true] {
        let to = Log::default();
        let instance = Said { logging: wanted, ..Said::of(&fmu) }.instantiate(&to);
        assert_eq!((API.enter_initialization_mode)(instance, 0, 0.0, 0.0, 0, 0.0), OK);
        assert_eq!((API.exit_initialization_mode)(instance), OK);
        let found: Vec<_> = to.entries().into_iter().map(|(_, _, message)| message).collect();
        assert_eq!(found, if wanted { vec!["instantiated", "initialized"] } else { vec![] });
        assert_eq!((API.exit_initialization_mode)(instance), ERROR);
        assert!(to.failure().starts_with("fmi3ExitInitializationMode: not allowed"));
        let category = c"logEvents".as_ptr();
        assert_eq!((API.set_debug_logging)(instance, u8::from(!wanted), 1, &raw const category), OK);
        assert_eq!((API.reset)(instance), OK);
        let (_, _, last) = to.entries().pop().unwrap();
        assert_eq!(last == "reset", !wanted);
        (API.free_instance)(instance);
    }
}
