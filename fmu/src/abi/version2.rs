//! The 34 functions of FMI 2.0 co-simulation. Those for states are in [`states`](super::states).
//!
//! `fmi2Warning`, `fmi2Fatal` and `fmi2Pending` are never returned. Several importers treat a warning as a
//! failure, and an instance can be freed after any failure. `fmi2Discard` means that a requested status does
//! not exist.

use std::ffi::{CString, c_int};

use super::fmi2::{
    self, Boolean, CO_SIMULATION, CallbackFunctions, Component, LAST_SUCCESSFUL_TIME, Status, StatusKind,
    TERMINATED, Text, ValueReference,
};
use super::guard::{Handle, guarded, none, slice, slice_mut, text};
use super::logger::Logger;
use super::states::{
    fmi2DeSerializeFMUstate, fmi2FreeFMUstate, fmi2GetFMUstate, fmi2SerializeFMUstate,
    fmi2SerializedFMUstateSize, fmi2SetFMUstate,
};
use super::{free, instantiated, switch};

use crate::configuration::FmiVersion;
use crate::instance::{Call, Mode};

/// Defines exports with the types of the standard.
macro_rules! exported {
    ($($field:ident $type:ident $symbol:ident ($($argument:ty),*) -> $result:ty;)*) => {
        $(const _: fmi2::$type = $symbol;)*
    };
}

fmi2_functions!(exported);

/// Returns `"default"`: the types of `fmi2TypesPlatform.h`.
#[unsafe(no_mangle)]
extern "C" fn fmi2GetTypesPlatform() -> Text {
    c"default".as_ptr()
}

/// Returns `"2.0"`.
#[unsafe(no_mangle)]
extern "C" fn fmi2GetVersion() -> Text {
    c"2.0".as_ptr()
}

/// Makes a new instance, or returns NULL with a log message.
///
/// # Safety
///
/// See the module; `callbacks` is NULL or points to a structure that is only read during this call.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Instantiate(
    instance_name: Text,
    fmu_type: c_int,
    guid: Text,
    resource_location: Text,
    callbacks: *const CallbackFunctions,
    _visible: Boolean,
    logging_on: Boolean,
) -> Component {
    // SAFETY: the caller's contract for strings.
    let name = unsafe { text(instance_name) };
    // SAFETY: the caller's contract for the callbacks; a NULL pointer gives None.
    let callbacks = unsafe { callbacks.as_ref() };
    let c_name = CString::new(name.unwrap_or_default()).unwrap_or_default();
    let logger = Logger::of_fmi2(callbacks, c_name, logging_on != 0);
    // SAFETY: the caller's contract for strings.
    let guid = unsafe { text(guid) };
    // SAFETY: the caller's contract for strings.
    let location = unsafe { text(resource_location) };
    instantiated("fmi2Instantiate", FmiVersion::Two, logger, || {
        if fmu_type != CO_SIMULATION {
            return Err(format!(
                "fmuType is {fmu_type}, must be 1 (fmi2CoSimulation): the FMU is one of co-simulation"
            ));
        }
        let guid = guid.ok_or("fmuGUID is NULL")?;
        Ok((guid, location.ok_or("fmuResourceLocation is NULL")?))
    })
}

/// Frees an instance in any mode; NULL is allowed.
///
/// # Safety
///
/// See the module; the component is not used afterwards.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2FreeInstance(component: Component) {
    // SAFETY: the caller's contract.
    unsafe { free(component) }
}

/// Enables or disables log categories; none named means all.
///
/// # Safety
///
/// See the module.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetDebugLogging(
    component: Component,
    logging_on: Boolean,
    count: usize,
    categories: *const Text,
) -> Status {
    // SAFETY: the caller's contract for arrays and strings.
    let body = |handle: &mut Handle| unsafe { switch(handle, logging_on != 0, count, categories) };
    // SAFETY: the caller's contract for components.
    unsafe { guarded(component, "fmi2SetDebugLogging", body) }
}

/// Sets the start time.
///
/// # Safety
///
/// See the module.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetupExperiment(
    component: Component,
    _tolerance_defined: Boolean,
    _tolerance: f64,
    start_time: f64,
    stop_time_defined: Boolean,
    stop_time: f64,
) -> Status {
    let body = |handle: &mut Handle| {
        let stop_time = (stop_time_defined != 0).then_some(stop_time);
        handle.instance.setup_experiment(start_time, stop_time).map(|()| Status::OK)
    };
    // SAFETY: the caller's contract for components.
    unsafe { guarded(component, "fmi2SetupExperiment", body) }
}

plain! {
    Status;
    /// Enters initialization mode.
    fmi2EnterInitializationMode => |handle| handle.instance.enter_initialization_mode();
    /// Applies the parameters and enters step mode.
    fmi2ExitInitializationMode => |handle| {
        handle.instance.exit_initialization_mode()?;
        handle.logger.event("initialized");
        Ok(())
    };
    /// Ends the run.
    fmi2Terminate => |handle| handle.instance.terminate();
    /// Returns to the instantiated state.
    fmi2Reset => |handle| {
        handle.instance.reset();
        handle.logger.event("reset");
        Ok(())
    };
}

/// Defines exports that read or write an array of values of one type.
macro_rules! values {
    ($($(#[$doc:meta])* $name:ident($pointer:ty, $slice:ident) => $method:ident;)*) => {$(
        $(#[$doc])*
        ///
        /// # Safety
        ///
        /// See the module.
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $name(
            component: Component,
            references: *const ValueReference,
            count: usize,
            values: $pointer,
        ) -> Status {
            let body = |handle: &mut Handle| {
                // SAFETY: the caller's contract for arrays.
                let references = unsafe { slice("vr", references, count) }?;
                // SAFETY: the caller's contract for arrays.
                let values = unsafe { $slice("value", values, count) }?;
                handle.instance.$method(references, values).map(|()| Status::OK)
            };
            // SAFETY: the caller's contract for components.
            unsafe { guarded(component, stringify!($name), body) }
        }
    )*};
}

values! {
    /// Reads reals.
    fmi2GetReal(*mut f64, slice_mut) => get_real;
    /// Reads integers and enumerations.
    fmi2GetInteger(*mut c_int, slice_mut) => get_integer;
    /// Reads booleans.
    fmi2GetBoolean(*mut Boolean, slice_mut) => get_boolean;
    /// Writes reals.
    fmi2SetReal(*const f64, slice) => set_real;
    /// Writes integers.
    fmi2SetInteger(*const c_int, slice) => set_integer;
    /// Writes booleans.
    fmi2SetBoolean(*const Boolean, slice) => set_boolean;
}

/// Reads strings. There are none, so only zero of them can be read.
///
/// # Safety
///
/// See the module.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetString(
    component: Component,
    references: *const ValueReference,
    count: usize,
    _values: *mut Text,
) -> Status {
    let body = |handle: &mut Handle| {
        // SAFETY: the caller's contract for arrays.
        let references = unsafe { slice("vr", references, count) }?;
        handle.instance.check_strings(Call::Get, references).map(|()| Status::OK)
    };
    // SAFETY: the caller's contract for components.
    unsafe { guarded(component, "fmi2GetString", body) }
}

/// Writes strings. There are none, so only zero of them can be written.
///
/// # Safety
///
/// See the module.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetString(
    component: Component,
    references: *const ValueReference,
    count: usize,
    _values: *const Text,
) -> Status {
    let body = |handle: &mut Handle| {
        // SAFETY: the caller's contract for arrays.
        let references = unsafe { slice("vr", references, count) }?;
        handle.instance.check_strings(Call::Set, references).map(|()| Status::OK)
    };
    // SAFETY: the caller's contract for components.
    unsafe { guarded(component, "fmi2SetString", body) }
}

/// Computes the derivative of outputs along a direction of inputs.
///
/// # Safety
///
/// See the module; `unknowns` and `result` have `unknown_count` elements, `knowns` and `seed` `known_count`.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetDirectionalDerivative(
    component: Component,
    unknowns: *const ValueReference,
    unknown_count: usize,
    knowns: *const ValueReference,
    known_count: usize,
    seed: *const f64,
    result: *mut f64,
) -> Status {
    let body = |handle: &mut Handle| {
        // SAFETY: the caller's contract for arrays.
        let unknowns = unsafe { slice("vUnknown_ref", unknowns, unknown_count) }?;
        // SAFETY: the caller's contract for arrays.
        let knowns = unsafe { slice("vKnown_ref", knowns, known_count) }?;
        // SAFETY: the caller's contract for arrays.
        let seed = unsafe { slice("dvKnown", seed, known_count) }?;
        // SAFETY: the caller's contract for arrays.
        let result = unsafe { slice_mut("dvUnknown", result, unknown_count) }?;
        handle.instance.directional_derivative(unknowns, knowns, seed, result).map(|()| Status::OK)
    };
    // SAFETY: the caller's contract for components.
    unsafe { guarded(component, "fmi2GetDirectionalDerivative", body) }
}

/// Makes a communication step. The last argument is ignored, since importers pass true while rolling back.
///
/// # Safety
///
/// See the module.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2DoStep(
    component: Component,
    current_communication_point: f64,
    communication_step_size: f64,
    _no_set_fmu_state_prior_to_current_point: Boolean,
) -> Status {
    let body = |handle: &mut Handle| {
        let (t, h) = (current_communication_point, communication_step_size);
        handle.step(t, h).map(|()| Status::OK)
    };
    // SAFETY: the caller's contract for components.
    unsafe { guarded(component, "fmi2DoStep", body) }
}

/// Returns the end of the last successful step (`fmi2LastSuccessfulTime`); other kinds are discarded.
///
/// # Safety
///
/// See the module; `value` is NULL or writable.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetRealStatus(component: Component, kind: StatusKind, value: *mut f64) -> Status {
    let body = |handle: &mut Handle| {
        if kind != LAST_SUCCESSFUL_TIME {
            return Ok(Status::DISCARD);
        }
        // SAFETY: the caller's contract for `value`.
        let value = unsafe { slice_mut("value", value, 1) }?;
        value[0] = handle.instance.time();
        Ok(Status::OK)
    };
    // SAFETY: the caller's contract for components.
    unsafe { guarded(component, "fmi2GetRealStatus", body) }
}

/// Returns whether the run has ended (`fmi2Terminated`); other kinds are discarded.
///
/// # Safety
///
/// See the module; `value` is NULL or writable.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetBooleanStatus(
    component: Component,
    kind: StatusKind,
    value: *mut Boolean,
) -> Status {
    let body = |handle: &mut Handle| {
        if kind != TERMINATED {
            return Ok(Status::DISCARD);
        }
        // SAFETY: the caller's contract for `value`.
        let value = unsafe { slice_mut("value", value, 1) }?;
        value[0] = Boolean::from(handle.instance.mode() == Mode::TERMINATED);
        Ok(Status::OK)
    };
    // SAFETY: the caller's contract for components.
    unsafe { guarded(component, "fmi2GetBooleanStatus", body) }
}

/// Defines exports for statuses that do not exist, since nothing is asynchronous here; they are discarded.
macro_rules! no_status {
    ($($name:ident($pointer:ty);)*) => {$(
        /// A status of asynchronous steps, which do not exist here; it is discarded.
        ///
        /// # Safety
        ///
        /// See the module.
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $name(component: Component, _kind: StatusKind, _value: $pointer) -> Status {
            let body = |_: &mut Handle| Ok(Status::DISCARD);
            // SAFETY: the caller's contract for components.
            unsafe { guarded(component, stringify!($name), body) }
        }
    )*};
}

no_status! {
    fmi2GetStatus(*mut c_int);
    fmi2GetIntegerStatus(*mut c_int);
    fmi2GetStringStatus(*mut Text);
}

/// Reads time derivatives of outputs. `maxOutputDerivativeOrder` is 0, so only zero of them can be read.
///
/// # Safety
///
/// See the module.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetRealOutputDerivatives(
    component: Component,
    _references: *const ValueReference,
    count: usize,
    _orders: *const c_int,
    _values: *mut f64,
) -> Status {
    // SAFETY: the caller's contract for components.
    unsafe {
        guarded(component, "fmi2GetRealOutputDerivatives", |_| none("maxOutputDerivativeOrder is 0", count))
    }
}

/// Sets time derivatives of inputs. `canInterpolateInputs` is false, so only zero of them can be set.
///
/// # Safety
///
/// See the module.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetRealInputDerivatives(
    component: Component,
    _references: *const ValueReference,
    count: usize,
    _orders: *const c_int,
    _values: *const f64,
) -> Status {
    // SAFETY: the caller's contract for components.
    unsafe {
        guarded(component, "fmi2SetRealInputDerivatives", |_| none("canInterpolateInputs is false", count))
    }
}

/// Refuses to cancel a step: nothing is asynchronous, so there is nothing to cancel.
///
/// # Safety
///
/// The component is NULL or came from `fmi2Instantiate` and was not freed.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2CancelStep(component: Component) -> Status {
    let body = |_: &mut Handle| Err("not supported: canRunAsynchronuously is false".into());
    // SAFETY: the caller's contract.
    unsafe { guarded(component, "fmi2CancelStep", body) }
}
