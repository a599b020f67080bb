//! Every function in every mode, against the table of the library.

use std::ffi::c_int;
use std::ptr::{null, null_mut};

use punctual_fmu::instance::{Call, LEGAL, Mode};

use crate::api::{API, DISCARD, ERROR, OK};
use crate::fmu::{FILTER, Fmu, PLANT};
use crate::slave::Slave;

/// A function, its call in the table (`None`: legal in every mode), and its answer if it is legal: OK, or
/// what its capability flag or meaning says.
type Function = (&'static str, Option<Call>, fn(&Slave) -> c_int, c_int);

/// Each function with arguments that are valid for both FMUs in every mode that allows it; reference 0 is a
/// real input of both.
const FUNCTIONS: [Function; 30] = [
    ("fmi2SetDebugLogging", None, |s| (API.set_debug_logging)(s.component, 1, 0, null()), OK),
    (
        "fmi2SetupExperiment",
        Some(Call::SetupExperiment),
        |s| (API.setup_experiment)(s.component, 1, 1e-4, 0.0, 1, 9.0),
        OK,
    ),
    (
        "fmi2EnterInitializationMode",
        Some(Call::EnterInitializationMode),
        |s| (API.enter_initialization_mode)(s.component),
        OK,
    ),
    (
        "fmi2ExitInitializationMode",
        Some(Call::ExitInitializationMode),
        |s| (API.exit_initialization_mode)(s.component),
        OK,
    ),
    ("fmi2Terminate", Some(Call::Terminate), |s| (API.terminate)(s.component), OK),
    ("fmi2Reset", None, |s| (API.reset)(s.component), OK),
    ("fmi2GetReal", Some(Call::Get), |s| (API.get_real)(s.component, &0, 1, &mut 0.0), OK),
    ("fmi2GetInteger", Some(Call::Get), |s| (API.get_integer)(s.component, null(), 0, null_mut()), OK),
    ("fmi2GetBoolean", Some(Call::Get), |s| (API.get_boolean)(s.component, null(), 0, null_mut()), OK),
    ("fmi2GetString", Some(Call::Get), |s| (API.get_string)(s.component, null(), 0, null_mut()), OK),
    ("fmi2SetReal", Some(Call::Set), |s| (API.set_real)(s.component, &0, 1, &1.0), OK),
    ("fmi2SetInteger", Some(Call::Set), |s| (API.set_integer)(s.component, null(), 0, null()), OK),
    ("fmi2SetBoolean", Some(Call::Set), |s| (API.set_boolean)(s.component, null(), 0, null()), OK),
    ("fmi2SetString", Some(Call::Set), |s| (API.set_string)(s.component, null(), 0, null()), OK),
    ("fmi2DoStep", Some(Call::DoStep), |s| (API.do_step)(s.component, 0.0, 0.01, 0), OK),
    ("fmi2CancelStep", None, |s| (API.cancel_step)(s.component), ERROR),
    ("fmi2GetStatus", None, |s| (API.get_status)(s.component, 0, &mut 0), DISCARD),
    ("fmi2GetRealStatus", None, |s| (API.get_real_status)(s.component, 2, &mut 0.0), OK),
    ("fmi2GetIntegerStatus", None, |s| (API.get_integer_status)(s.component, 0, &mut 0), DISCARD),
    ("fmi2GetBooleanStatus", None, |s| (API.get_boolean_status)(s.component, 3, &mut 0), OK),
    ("fmi2GetStringStatus", None, |s| (API.get_string_status)(s.component, 1, &mut null()), DISCARD),
    (
        "fmi2SetRealInputDerivatives",
        None,
        |s| (API.set_input_derivatives)(s.component, null(), 0, null(), null()),
        OK,
    ),
    (
        "fmi2GetRealOutputDerivatives",
        None,
        |s| (API.get_output_derivatives)(s.component, null(), 0, null(), null_mut()),
        OK,
    ),
    ("fmi2GetFMUstate", None, |s| (API.get_state)(s.component, &mut null_mut()), OK),
    ("fmi2SetFMUstate", None, |s| (API.set_state)(s.component, s.state()), OK),
    ("fmi2FreeFMUstate", None, |s| (API.free_state)(s.component, &mut s.state()), OK),
    ("fmi2SerializedFMUstateSize", None, |s| (API.serialized_size)(s.component, s.state(), &mut 0), OK),
    (
        "fmi2SerializeFMUstate",
        None,
        |s| (API.serialize)(s.component, s.state(), [0; 4096].as_mut_ptr(), 4096),
        OK,
    ),
    (
        "fmi2DeSerializeFMUstate",
        None,
        |s| {
            let bytes = s.bytes(s.state());
            (API.deserialize)(s.component, bytes.as_ptr().cast(), bytes.len(), &mut null_mut())
        },
        OK,
    ),
    (
        "fmi2GetDirectionalDerivative",
        Some(Call::GetDirectionalDerivative),
        |s| {
            let output = s.fmu.product.layout.outputs as u32;
            (API.directional_derivative)(s.component, &output, 1, &0, 1, &1.0, &mut 0.0)
        },
        OK,
    ),
];

/// Brings a new instance into `mode`.
fn into_mode(fmu: &Fmu, mode: Mode) -> Slave<'_> {
    let slave = Slave::new(fmu);
    let c = slave.component;
    if mode != Mode::INSTANTIATED {
        slave.ok((API.enter_initialization_mode)(c));
    }
    if mode == Mode::STEP || mode == Mode::TERMINATED {
        slave.ok((API.exit_initialization_mode)(c));
    }
    if mode == Mode::TERMINATED {
        slave.ok((API.terminate)(c));
    }
    slave
}

/// Continues from `mode` with the calls that only this mode allows, up to a step; returns everything
/// observed.
fn finish(slave: &Slave, mode: Mode) -> Vec<String> {
    let c = slave.component;
    if mode == Mode::TERMINATED {
        let mut terminated = 0;
        slave.ok((API.get_boolean_status)(c, 3, &raw mut terminated));
        assert_eq!(terminated, 1);
        slave.ok((API.reset)(c));
    }
    if mode == Mode::INSTANTIATED || mode == Mode::TERMINATED {
        slave.ok((API.setup_experiment)(c, 0, 0.0, 0.0, 0, 0.0));
        slave.ok((API.enter_initialization_mode)(c));
    }
    if mode != Mode::STEP {
        slave.ok((API.exit_initialization_mode)(c));
    }
    slave.set_inputs(&[0.5, 0.25]);
    slave.step(0.0, 0.1);
    slave.snapshot()
}

#[test]
fn the_table_is_in_the_order_of_the_calls() {
    for (i, (call, ..)) in LEGAL.iter().enumerate() {
        assert_eq!(*call as usize, i, "{call:?}");
    }
}

#[test]
fn every_function_in_every_mode() {
    for configuration in [FILTER, PLANT] {
        let fmu = Fmu::new(configuration);
        let fresh = finish(&Slave::new(&fmu), Mode::INSTANTIATED);
        for mode in Mode::EACH {
            for (name, call, function, answer) in FUNCTIONS {
                let modes = call.map_or(Mode::ANY, Call::modes);
                let slave = into_mode(&fmu, mode);
                let found = function(&slave);
                let place = format!("{name} in {}: {:?}", mode.name(), slave.log.messages());
                if mode.is_in(modes) {
                    assert_eq!(found, answer, "{place}");
                    if answer == ERROR {
                        let message = slave.log.failure();
                        assert!(message.starts_with(&format!("{name}: not supported: ")), "{message}");
                    }
                    continue;
                }
                assert_eq!(found, ERROR, "{place}");
                let message = slave.log.failure();
                let allowed = Mode::EACH.iter().filter(|m| m.is_in(modes));
                let allowed: Vec<_> = allowed.map(|m| format!("{:?}", m.name())).collect();
                let (now, allowed) = (mode.name(), allowed.join(", "));
                assert_eq!(message, format!("{name}: not allowed in the mode {now:?}, only in {allowed}"));
                assert_eq!(finish(&slave, mode), fresh, "after the refused {name} in {now}");
            }
        }
    }
}

#[test]
fn do_step_before_initialization() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::new(&fmu);
    let message = slave.refused(slave.try_step(0.0, 0.001));
    assert_eq!(message, r#"fmi2DoStep: not allowed in the mode "instantiated", only in "step""#);
    slave.initialize();
    slave.step(0.0, 0.001);
}

#[test]
fn setup_experiment_twice_and_later() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::new(&fmu);
    let setup = |start| (API.setup_experiment)(slave.component, 0, 0.0, start, 0, 0.0);
    slave.ok(setup(1.0));
    slave.ok(setup(3.0));
    assert_eq!(slave.time(), 3.0, "the last one wins");
    slave.ok((API.enter_initialization_mode)(slave.component));
    assert!(slave.refused(setup(4.0)).contains(r#"not allowed in the mode "initialization""#));
    slave.ok((API.exit_initialization_mode)(slave.component));
    assert!(slave.refused(setup(4.0)).contains(r#"not allowed in the mode "step""#));
    assert_eq!(slave.time(), 3.0);
    slave.step(3.0, 0.1);
}

#[test]
fn setup_experiment_refuses_times_that_are_none() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::new(&fmu);
    let setup = |start, stop| (API.setup_experiment)(slave.component, 1, f64::NAN, start, 1, stop);
    let message = slave.refused(setup(f64::NAN, 1.0));
    assert_eq!(message, "fmi2SetupExperiment: startTime is NaN, must be finite");
    assert!(slave.refused(setup(f64::NEG_INFINITY, 1.0)).contains("startTime is -inf"));
    let message = slave.refused(setup(2.0, 1.0));
    assert_eq!(message, "fmi2SetupExperiment: stopTime is 1, must be >= startTime = 2");
    assert!(slave.refused(setup(2.0, f64::NAN)).contains("stopTime is NaN"));
    slave.ok(setup(-2.0, f64::INFINITY));
    // An undefined value is not read.
    slave.ok((API.setup_experiment)(slave.component, 0, f64::NAN, -2.5, 0, f64::NAN));
    assert_eq!(slave.time(), -2.5);
}

/// Values can be read after termination but not set; a reset starts again.
#[test]
fn terminated() {
    let fmu = Fmu::new(FILTER);
    let slave = Slave::ready(&fmu);
    slave.step(0.0, 0.1);
    let before = slave.snapshot();
    slave.ok((API.terminate)(slave.component));
    let message = slave.refused(slave.try_set("x.x_p", 1.0));
    let wanted = "fmi2SetReal: not allowed in the mode \"terminated\", only in \"instantiated\", \
                  \"initialization\", \"step\"";
    assert_eq!(message, wanted);
    assert!(slave.refused(slave.try_step(0.1, 0.1)).contains(r#"not allowed in the mode "terminated""#));
    assert_eq!(slave.snapshot(), before);
    slave.ok((API.reset)(slave.component));
    slave.initialize();
    slave.step(0.0, 0.1);
    assert_eq!(slave.snapshot(), before);
}
