//! The 75 functions of FMI 3.0. Those for FMU states are in [`states`](super::states), those of features that
//! our FMUs lack in [`absent`].
//!
//! `fmi3Warning` and `fmi3Fatal` are never returned. `fmi3Discard` means that a derivative does not exist at
//! this point; the run may continue.

mod absent;

use std::ptr;

use super::fmi3::{
    self, Boolean, ClockUpdate, DEPENDENT, DependencyKind, Environment, FALSE, Instance, IntermediateUpdate,
    LogMessage, Preemption, Status, Text, ValueReference,
};
use super::guard::{Handle, guarded, slice, slice_mut, text};
use super::logger::Logger;
use super::states::{
    fmi3DeserializeFMUState, fmi3FreeFMUState, fmi3GetFMUState, fmi3SerializeFMUState,
    fmi3SerializedFMUStateSize, fmi3SetFMUState,
};
use super::{free, instantiated, switch};
use absent::*;

use crate::configuration::FmiVersion;

/// Defines exports with the types of the standard.
macro_rules! exported {
    ($($field:ident $type:ident $symbol:ident ($($argument:ty),*) -> $result:ty;)*) => {
        $(const _: fmi3::$type = $symbol;)*
    };
}

fmi3_functions!(exported);

/// Returns `"3.0"`.
#[unsafe(no_mangle)]
extern "C" fn fmi3GetVersion() -> Text {
    c"3.0".as_ptr()
}

/// Makes a new instance, or returns NULL with a log message.
///
/// # Safety
///
/// See the module above; `required` has `required_count` elements.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3InstantiateCoSimulation(
    _instance_name: Text,
    token: Text,
    resource_path: Text,
    _visible: Boolean,
    logging_on: Boolean,
    event_mode_used: Boolean,
    _early_return_allowed: Boolean,
    _required: *const ValueReference,
    required_count: usize,
    environment: Environment,
    log_message: LogMessage,
    _intermediate_update: IntermediateUpdate,
) -> Instance {
    // SAFETY: the caller's contract for strings.
    let token = unsafe { text(token) };
    // SAFETY: the caller's contract for strings.
    let path = unsafe { text(resource_path) };
    let logger = Logger::of_fmi3(log_message, environment, logging_on != FALSE);
    instantiated("fmi3InstantiateCoSimulation", FmiVersion::Three, logger, || {
        if event_mode_used != FALSE {
            return Err("eventModeUsed is true, must be false: hasEventMode is false".to_owned());
        }
        if required_count > 0 {
            return Err(format!(
                "nRequiredIntermediateVariables is {required_count}, must be 0: no variable has intermediateUpdate, \
                 since there are no intermediate updates"
            ));
        }
        let token = token.ok_or("instantiationToken is NULL")?;
        Ok((token, path.ok_or("resourcePath is NULL, must be the folder with the FMU's configuration")?))
    })
}

/// Instantiates nothing: returns NULL with a log message.
///
/// # Safety
///
/// See the module above.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3InstantiateModelExchange(
    _instance_name: Text,
    _token: Text,
    _resource_path: Text,
    _visible: Boolean,
    logging_on: Boolean,
    environment: Environment,
    log_message: LogMessage,
) -> Instance {
    let logger = Logger::of_fmi3(log_message, environment, logging_on != FALSE);
    logger.error("fmi3InstantiateModelExchange: the FMU has no model exchange");
    ptr::null_mut()
}

/// Instantiates nothing: returns NULL with a log message.
///
/// # Safety
///
/// See the module above.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3InstantiateScheduledExecution(
    _instance_name: Text,
    _token: Text,
    _resource_path: Text,
    _visible: Boolean,
    logging_on: Boolean,
    environment: Environment,
    log_message: LogMessage,
    _clock_update: ClockUpdate,
    _lock_preemption: Preemption,
    _unlock_preemption: Preemption,
) -> Instance {
    let logger = Logger::of_fmi3(log_message, environment, logging_on != FALSE);
    logger.error("fmi3InstantiateScheduledExecution: the FMU has no scheduled execution");
    ptr::null_mut()
}

/// Frees an instance in any mode; NULL is allowed.
///
/// # Safety
///
/// See the module above; the instance is not used afterwards.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3FreeInstance(instance: Instance) {
    // SAFETY: the caller's contract.
    unsafe { free(instance) }
}

/// Enables or disables log categories; none named means all.
///
/// # Safety
///
/// See the module above.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetDebugLogging(
    instance: Instance,
    logging_on: Boolean,
    count: usize,
    categories: *const Text,
) -> Status {
    // SAFETY: the caller's contract for arrays and strings.
    let body = |handle: &mut Handle| unsafe { switch(handle, logging_on != FALSE, count, categories) };
    // SAFETY: the caller's contract for instances.
    unsafe { guarded(instance, "fmi3SetDebugLogging", body) }
}

/// Sets the start and stop time and enters initialization mode; the tolerance is not used.
///
/// # Safety
///
/// See the module above.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3EnterInitializationMode(
    instance: Instance,
    _tolerance_defined: Boolean,
    _tolerance: f64,
    start_time: f64,
    stop_time_defined: Boolean,
    stop_time: f64,
) -> Status {
    let body = |handle: &mut Handle| {
        let stop_time = (stop_time_defined != FALSE).then_some(stop_time);
        handle.instance.begin(start_time, stop_time).map(|()| Status::OK)
    };
    // SAFETY: the caller's contract for instances.
    unsafe { guarded(instance, "fmi3EnterInitializationMode", body) }
}

plain! {
    Status;
    /// Applies the parameters and enters step mode.
    fmi3ExitInitializationMode => |handle| {
        handle.instance.exit_initialization_mode()?;
        handle.logger.event("initialized");
        Ok(())
    };
    /// Ends the run.
    fmi3Terminate => |handle| handle.instance.terminate();
    /// Returns to the instantiated state.
    fmi3Reset => |handle| {
        handle.instance.reset();
        handle.logger.event("reset");
        Ok(())
    };
}

/// Defines exports that read or write the values of variables of one type.
macro_rules! values {
    ($($(#[$doc:meta])* $name:ident($pointer:ty, $slice:ident) => $body:expr;)*) => {$(
        $(#[$doc])*
        ///
        /// # Safety
        ///
        /// See the module above.
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $name(
            instance: Instance,
            references: *const ValueReference,
            count: usize,
            values: $pointer,
            value_count: usize,
        ) -> Status {
            let body = |handle: &mut Handle| {
                // SAFETY: the caller's contract for arrays.
                let references = unsafe { slice("valueReferences", references, count) }?;
                // SAFETY: the caller's contract for arrays.
                let values = unsafe { $slice("values", values, value_count) }?;
                $body(&mut handle.instance, references, values).map(|()| Status::OK)
            };
            // SAFETY: the caller's contract for instances.
            unsafe { guarded(instance, stringify!($name), body) }
        }
    )*};
}

/// Our instance, since `Instance` is that of the standard.
type Own = crate::instance::Instance;

values! {
    /// Reads numbers.
    fmi3GetFloat64(*mut f64, slice_mut) => Own::get_float64;
    /// Reads counts.
    fmi3GetInt32(*mut i32, slice_mut) => Own::get_int32;
    /// Reads enumerations.
    fmi3GetInt64(*mut i64, slice_mut) => Own::get_int64;
    /// Reads booleans.
    fmi3GetBoolean(*mut Boolean, slice_mut) => Own::get_bytes_of_booleans;
    /// Writes numbers.
    fmi3SetFloat64(*const f64, slice) => Own::set_float64;
    /// Writes booleans.
    fmi3SetBoolean(*const Boolean, slice) => Own::set_bytes_of_booleans;
    /// Writes counts; no count is writable.
    fmi3SetInt32(*const i32, slice) => Own::set_int32;
    /// Writes enumerations; none is writable.
    fmi3SetInt64(*const i64, slice) => Own::set_int64;
}

/// Defines the two derivatives. A seed or a sensitivity has one number for each element of its variables.
macro_rules! derivatives {
    ($($(#[$doc:meta])* $name:ident => $method:ident;)*) => {$(
        $(#[$doc])*
        ///
        /// # Safety
        ///
        /// See the module above.
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $name(
            instance: Instance,
            unknowns: *const ValueReference,
            unknown_count: usize,
            knowns: *const ValueReference,
            known_count: usize,
            seed: *const f64,
            seed_count: usize,
            sensitivity: *mut f64,
            sensitivity_count: usize,
        ) -> Status {
            let body = |handle: &mut Handle| {
                // SAFETY: the caller's contract for arrays.
                let unknowns = unsafe { slice("unknowns", unknowns, unknown_count) }?;
                // SAFETY: the caller's contract for arrays.
                let knowns = unsafe { slice("knowns", knowns, known_count) }?;
                // SAFETY: the caller's contract for arrays.
                let seed = unsafe { slice("seed", seed, seed_count) }?;
                // SAFETY: the caller's contract for arrays.
                let result = unsafe { slice_mut("sensitivity", sensitivity, sensitivity_count) }?;
                Ok(match handle.instance.$method(unknowns, knowns, seed, result)? {
                    Ok(()) => Status::OK,
                    Err(why) => {
                        handle.logger.discarded(&format!("{}: {why}", stringify!($name)));
                        Status::DISCARD
                    }
                })
            };
            // SAFETY: the caller's contract for instances.
            unsafe { guarded(instance, stringify!($name), body) }
        }
    )*};
}

derivatives! {
    /// Computes the derivatives of outputs along a direction of inputs.
    fmi3GetDirectionalDerivative => directional_derivative_of_arrays;
    /// Computes the derivatives of a weighted sum of outputs with respect to each element of inputs.
    fmi3GetAdjointDerivative => adjoint_derivative;
}

/// Counts the dependencies of an output, element by element.
///
/// # Safety
///
/// See the module above; `count` is NULL or writable.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetNumberOfVariableDependencies(
    instance: Instance,
    dependent: ValueReference,
    count: *mut usize,
) -> Status {
    let body = |handle: &mut Handle| {
        // SAFETY: the caller's contract for `count`.
        let count = unsafe { slice_mut("nDependencies", count, 1) }?;
        count[0] = handle.instance.dependencies(dependent)?.count();
        Ok(Status::OK)
    };
    // SAFETY: the caller's contract for instances.
    unsafe { guarded(instance, "fmi3GetNumberOfVariableDependencies", body) }
}

/// Returns the dependencies of an output: which of its elements depends on which element of which variable.
/// Indices count from 1; 0 denotes a scalar.
///
/// # Safety
///
/// See the module above; the four arrays have `count` elements.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetVariableDependencies(
    instance: Instance,
    dependent: ValueReference,
    elements: *mut usize,
    independents: *mut ValueReference,
    elements_of_independents: *mut usize,
    kinds: *mut DependencyKind,
    count: usize,
) -> Status {
    let body = |handle: &mut Handle| {
        // SAFETY: the caller's contract for arrays.
        let elements = unsafe { slice_mut("elementIndicesOfDependent", elements, count) }?;
        // SAFETY: the caller's contract for arrays.
        let independents = unsafe { slice_mut("independents", independents, count) }?;
        // SAFETY: the caller's contract for arrays.
        let others = unsafe { slice_mut("elementIndicesOfIndependents", elements_of_independents, count) }?;
        // SAFETY: the caller's contract for arrays.
        let kinds = unsafe { slice_mut("dependencyKinds", kinds, count) }?;
        let wanted = handle.instance.dependencies(dependent)?.count();
        if count != wanted {
            return Err(format!("nDependencies is {count}, must be {wanted}"));
        }
        for (k, (element, independent, other)) in handle.instance.dependencies(dependent)?.enumerate() {
            (elements[k], independents[k], others[k], kinds[k]) = (element, independent, other, DEPENDENT);
        }
        Ok(Status::OK)
    };
    // SAFETY: the caller's contract for instances.
    unsafe { guarded(instance, "fmi3GetVariableDependencies", body) }
}

/// Makes a communication step; there are no events and no early returns. `noSetFMUStatePriorToCurrentPoint`
/// is ignored, since importers pass true while rolling back.
///
/// # Safety
///
/// See the module above; the last four pointers are NULL or writable.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3DoStep(
    instance: Instance,
    current_communication_point: f64,
    communication_step_size: f64,
    _no_set_fmu_state_prior_to_current_point: Boolean,
    event_handling_needed: *mut Boolean,
    terminate_simulation: *mut Boolean,
    early_return: *mut Boolean,
    last_successful_time: *mut f64,
) -> Status {
    let body = |handle: &mut Handle| {
        // SAFETY: the caller's contract for the pointer.
        let event = unsafe { slice_mut("eventHandlingNeeded", event_handling_needed, 1) }?;
        // SAFETY: the caller's contract for the pointer.
        let terminate = unsafe { slice_mut("terminateSimulation", terminate_simulation, 1) }?;
        // SAFETY: the caller's contract for the pointer.
        let early = unsafe { slice_mut("earlyReturn", early_return, 1) }?;
        // SAFETY: the caller's contract for the pointer.
        let last = unsafe { slice_mut("lastSuccessfulTime", last_successful_time, 1) }?;
        handle.step(current_communication_point, communication_step_size)?;
        (event[0], terminate[0], early[0], last[0]) = (FALSE, FALSE, FALSE, handle.instance.time());
        Ok(Status::OK)
    };
    // SAFETY: the caller's contract for instances.
    unsafe { guarded(instance, "fmi3DoStep", body) }
}
