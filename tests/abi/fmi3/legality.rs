//! Every function in every mode, against the table of the library.

use std::ffi::c_int;
use std::ptr::{null, null_mut};

use punctual_fmu::fmi3;
use punctual_fmu::instance::{Call, Mode};

use super::slave::Slave;
use crate::api::three::API;
use crate::api::{ERROR, OK};
use crate::fmu::{FILTER, Fmu, PLANT};

/// A function, its call in the table (`None`: legal in every mode), and its answer if it is legal: OK, or an
/// error because the description excludes it.
type Function = (&'static str, Option<Call>, fn(&Slave) -> c_int, c_int);

/// Reads and writes of zero values, which succeed in every mode that allows the call.
macro_rules! nothing {
    ($($symbol:literal $field:ident $call:ident;)*) => {
        [$(($symbol, Some(Call::$call), (|s| (API.$field)(s.instance, null(), 0, null_mut(), 0)) as fn(&Slave) -> c_int, OK)),*]
    };
    (const $($symbol:literal $field:ident $call:ident;)*) => {
        [$(($symbol, Some(Call::$call), (|s| (API.$field)(s.instance, null(), 0, null(), 0)) as fn(&Slave) -> c_int, OK)),*]
    };
}

const READ: [Function; 12] = nothing! {
    "fmi3GetFloat32" get_float32 Get;
    "fmi3GetInt8" get_int8 Get;
    "fmi3GetUInt8" get_uint8 Get;
    "fmi3GetInt16" get_int16 Get;
    "fmi3GetUInt16" get_uint16 Get;
    "fmi3GetInt32" get_int32 Get;
    "fmi3GetUInt32" get_uint32 Get;
    "fmi3GetInt64" get_int64 Get;
    "fmi3GetUInt64" get_uint64 Get;
    "fmi3GetBoolean" get_boolean Get;
    "fmi3GetString" get_string Get;
    "fmi3GetFloat64" get_float64 Get;
};

const WRITTEN: [Function; 12] = nothing! {
    const
    "fmi3SetFloat32" set_float32 Set;
    "fmi3SetInt8" set_int8 Set;
    "fmi3SetUInt8" set_uint8 Set;
    "fmi3SetInt16" set_int16 Set;
    "fmi3SetUInt16" set_uint16 Set;
    "fmi3SetInt32" set_int32 Set;
    "fmi3SetUInt32" set_uint32 Set;
    "fmi3SetInt64" set_int64 Set;
    "fmi3SetUInt64" set_uint64 Set;
    "fmi3SetBoolean" set_boolean Set;
    "fmi3SetString" set_string Set;
    "fmi3SetFloat64" set_float64 Set;
};

/// The other functions, with arguments that are valid for both FMUs in every mode that allows them.
const OTHERS: [Function; 46] = [
    ("fmi3SetDebugLogging", None, |s| (API.set_debug_logging)(s.instance, 1, 0, null()), OK),
    (
        "fmi3EnterInitializationMode",
        Some(Call::EnterInitializationMode),
        |s| (API.enter_initialization_mode)(s.instance, 1, 1e-4, 0.0, 1, 9.0),
        OK,
    ),
    (
        "fmi3ExitInitializationMode",
        Some(Call::ExitInitializationMode),
        |s| (API.exit_initialization_mode)(s.instance),
        OK,
    ),
    ("fmi3Terminate", Some(Call::Terminate), |s| (API.terminate)(s.instance), OK),
    ("fmi3Reset", None, |s| (API.reset)(s.instance), OK),
    (
        "fmi3GetBinary",
        Some(Call::Get),
        |s| (API.get_binary)(s.instance, null(), 0, null_mut(), null_mut(), 0),
        OK,
    ),
    ("fmi3SetBinary", Some(Call::Set), |s| (API.set_binary)(s.instance, null(), 0, null(), null(), 0), OK),
    ("fmi3GetClock", None, |s| (API.get_clock)(s.instance, null(), 0, null_mut()), OK),
    ("fmi3SetClock", None, |s| (API.set_clock)(s.instance, null(), 0, null()), OK),
    (
        "fmi3GetIntervalDecimal",
        None,
        |s| (API.get_interval_decimal)(s.instance, null(), 0, null_mut(), null_mut()),
        OK,
    ),
    (
        "fmi3GetIntervalFraction",
        None,
        |s| (API.get_interval_fraction)(s.instance, null(), 0, null_mut(), null_mut(), null_mut()),
        OK,
    ),
    ("fmi3GetShiftDecimal", None, |s| (API.get_shift_decimal)(s.instance, null(), 0, null_mut()), OK),
    (
        "fmi3GetShiftFraction",
        None,
        |s| (API.get_shift_fraction)(s.instance, null(), 0, null_mut(), null_mut()),
        OK,
    ),
    ("fmi3SetIntervalDecimal", None, |s| (API.set_interval_decimal)(s.instance, null(), 0, null()), OK),
    (
        "fmi3SetIntervalFraction",
        None,
        |s| (API.set_interval_fraction)(s.instance, null(), 0, null(), null()),
        OK,
    ),
    ("fmi3SetShiftDecimal", None, |s| (API.set_shift_decimal)(s.instance, null(), 0, null()), OK),
    ("fmi3SetShiftFraction", None, |s| (API.set_shift_fraction)(s.instance, null(), 0, null(), null()), OK),
    (
        "fmi3GetOutputDerivatives",
        None,
        |s| (API.get_output_derivatives)(s.instance, null(), 0, null(), null_mut(), 0),
        OK,
    ),
    ("fmi3GetFMUState", None, |s| (API.get_state)(s.instance, &mut null_mut()), OK),
    ("fmi3SetFMUState", None, |s| (API.set_state)(s.instance, s.state()), OK),
    ("fmi3FreeFMUState", None, |s| (API.free_state)(s.instance, &mut s.state()), OK),
    ("fmi3SerializedFMUStateSize", None, |s| (API.serialized_state_size)(s.instance, s.state(), &mut 0), OK),
    (
        "fmi3SerializeFMUState",
        None,
        |s| (API.serialize_state)(s.instance, s.state(), [0; 4096].as_mut_ptr(), 4096),
        OK,
    ),
    (
        "fmi3DeserializeFMUState",
        None,
        |s| {
            let bytes = s.now();
            (API.deserialize_state)(s.instance, bytes.as_ptr(), bytes.len(), &mut null_mut())
        },
        OK,
    ),
    (
        "fmi3GetDirectionalDerivative",
        Some(Call::GetDirectionalDerivative),
        |s| (API.get_directional_derivative)(s.instance, null(), 0, null(), 0, null(), 0, null_mut(), 0),
        OK,
    ),
    (
        "fmi3GetAdjointDerivative",
        Some(Call::GetDirectionalDerivative),
        |s| (API.get_adjoint_derivative)(s.instance, null(), 0, null(), 0, null(), 0, null_mut(), 0),
        OK,
    ),
    (
        "fmi3GetNumberOfVariableDependencies",
        None,
        |s| {
            let output = s.fmu.product.layout.outputs as u32;
            (API.get_number_of_variable_dependencies)(s.instance, output, &mut 0)
        },
        OK,
    ),
    (
        "fmi3GetVariableDependencies",
        None,
        |s| {
            let (output, mut count) = (s.fmu.product.layout.outputs as u32, 0);
            (API.get_number_of_variable_dependencies)(s.instance, output, &mut count);
            let (mut a, mut b, mut c, mut d) =
                (vec![0; count], vec![0; count], vec![0; count], vec![0; count]);
            (API.get_variable_dependencies)(
                s.instance,
                output,
                a.as_mut_ptr(),
                b.as_mut_ptr(),
                c.as_mut_ptr(),
                d.as_mut_ptr(),
                count,
            )
        },
        OK,
    ),
    ("fmi3DoStep", Some(Call::DoStep), |s| s.try_step(0.0, 0.01), OK),
    ("fmi3EnterConfigurationMode", None, |s| (API.enter_configuration_mode)(s.instance), ERROR),
    ("fmi3ExitConfigurationMode", None, |s| (API.exit_configuration_mode)(s.instance), ERROR),
    ("fmi3EvaluateDiscreteStates", None, |s| (API.evaluate_discrete_states)(s.instance), ERROR),
    ("fmi3ActivateModelPartition", None, |s| (API.activate_model_partition)(s.instance, 0, 0.0), ERROR),
    ("fmi3EnterStepMode", None, |s| (API.enter_step_mode)(s.instance), ERROR),
    ("fmi3EnterEventMode", None, |s| (API.enter_event_mode)(s.instance), ERROR),
    (
        "fmi3UpdateDiscreteStates",
        None,
        |s| (API.update_discrete_states)(s.instance, &mut 0, &mut 0, &mut 0, &mut 0, &mut 0, &mut 0.0),
        ERROR,
    ),
    ("fmi3EnterContinuousTimeMode", None, |s| (API.enter_continuous_time_mode)(s.instance), ERROR),
    (
        "fmi3CompletedIntegratorStep",
        None,
        |s| (API.completed_integrator_step)(s.instance, 0, &mut 0, &mut 0),
        ERROR,
    ),
    ("fmi3SetTime", None, |s| (API.set_time)(s.instance, 0.0), ERROR),
    ("fmi3SetContinuousStates", None, |s| (API.set_continuous_states)(s.instance, null(), 0), ERROR),
    (
        "fmi3GetContinuousStateDerivatives",
        None,
        |s| (API.get_continuous_state_derivatives)(s.instance, null_mut(), 0),
        ERROR,
    ),
    ("fmi3GetEventIndicators", None, |s| (API.get_event_indicators)(s.instance, null_mut(), 0), ERROR),
    ("fmi3GetContinuousStates", None, |s| (API.get_continuous_states)(s.instance, null_mut(), 0), ERROR),
    (
        "fmi3GetNominalsOfContinuousStates",
        None,
        |s| (API.get_nominals_of_continuous_states)(s.instance, null_mut(), 0),
        ERROR,
    ),
    (
        "fmi3GetNumberOfEventIndicators",
        None,
        |s| (API.get_number_of_event_indicators)(s.instance, &mut 0),
        ERROR,
    ),
    (
        "fmi3GetNumberOfContinuousStates",
        None,
        |s| (API.get_number_of_continuous_states)(s.instance, &mut 0),
        ERROR,
    ),
];

/// The functions that need no co-simulation instance, or that free it.
const WITHOUT: [&str; 5] = [
    "fmi3GetVersion",
    "fmi3InstantiateModelExchange",
    "fmi3InstantiateCoSimulation",
    "fmi3InstantiateScheduledExecution",
    "fmi3FreeInstance",
];

/// Brings a new instance into `mode`.
fn into_mode(fmu: &Fmu, mode: Mode) -> Slave<'_> {
    let slave = Slave::new(fmu);
    let c = slave.instance;
    if mode != Mode::INSTANTIATED {
        slave.ok((API.enter_initialization_mode)(c, 0, 0.0, 0.0, 0, 0.0));
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
    let c = slave.instance;
    if mode == Mode::TERMINATED {
        slave.ok((API.reset)(c));
    }
    if mode == Mode::INSTANTIATED || mode == Mode::TERMINATED {
        slave.ok((API.enter_initialization_mode)(c, 0, 0.0, 0.0, 0, 0.0));
    }
    if mode != Mode::STEP {
        slave.ok((API.exit_initialization_mode)(c));
    }
    slave.set_inputs(&[0.5, 0.25]);
    slave.step(0.0, 0.1);
    slave.snapshot()
}

#[test]
fn every_function_in_every_mode() {
    let functions: Vec<_> = READ.iter().chain(&WRITTEN).chain(&OTHERS).collect();
    for symbol in fmi3::FUNCTIONS {
        let there = functions.iter().any(|(name, ..)| name == symbol);
        assert_ne!(there, WITHOUT.contains(symbol), "{symbol}");
    }
    for (configuration, arrays) in [(FILTER, false), (PLANT, true)] {
        let fmu = Fmu::of_fmi3(configuration, arrays);
        let fresh = finish(&Slave::new(&fmu), Mode::INSTANTIATED);
        for mode in [Mode::INSTANTIATED, Mode::INITIALIZATION, Mode::STEP, Mode::TERMINATED] {
            for (name, call, function, answer) in &functions {
                let modes = call.map_or(Mode::ANY, Call::modes);
                let slave = into_mode(&fmu, mode);
                let found = function(&slave);
                let place = format!("{name} in {}: {:?}", mode.name(), slave.log.entries());
                if mode.is_in(modes) {
                    assert_eq!(found, *answer, "{place}");
                    if *answer == ERROR {
                        let message = slave.log.failure();
                        assert!(message.starts_with(&format!("{name}: not supported: ")), "{message}");
                        assert_eq!(finish(&slave, mode), fresh, "after the refused {name}");
                    }
                    continue;
                }
                assert_eq!(found, ERROR, "{place}");
                let message = slave.log.failure();
                let wanted = format!("{name}: not allowed in the mode {:?}, only in ", mode.name());
                assert!(message.starts_with(&wanted), "{message}");
                assert_eq!(finish(&slave, mode), fresh, "after the refused {name} in {}", mode.name());
            }
        }
    }
}

#[test]
fn null_is_an_error_everywhere() {
    let fmu = Fmu::of_fmi3(PLANT, true);
    let mut slave = Slave::ready(&fmu);
    let instance = std::mem::replace(&mut slave.instance, null_mut());
    // Creating a state requires an instance.
    let needs_one = |name: &&str| name.contains("FMUState") && !name.contains("Get");
    for (name, _, function, _) in READ.iter().chain(&WRITTEN).chain(&OTHERS) {
        if !needs_one(name) {
            assert_eq!(function(&slave), ERROR, "{name}");
        }
    }
    assert_eq!((API.set_state)(null_mut(), null_mut()), ERROR);
    assert_eq!((API.free_state)(null_mut(), &mut null_mut()), ERROR);
    assert_eq!((API.serialized_state_size)(null_mut(), null_mut(), &mut 0), ERROR);
    assert_eq!((API.serialize_state)(null_mut(), null_mut(), null_mut(), 0), ERROR);
    assert_eq!((API.deserialize_state)(null_mut(), null(), 0, &mut null_mut()), ERROR);
    slave.instance = instance;
}
