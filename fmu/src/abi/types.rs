//! The types of `fmi2TypesPlatform.h` and `fmi2FunctionTypes.h` that the exports use.

use std::ffi::{c_char, c_int, c_uint, c_void};

pub(super) type Component = *mut c_void;
pub(super) type Environment = *mut c_void;
/// `fmi2FMUstate`.
pub(super) type StatePointer = *mut c_void;
pub(super) type ValueReference = c_uint;
pub(super) type Boolean = c_int;
pub(super) type StringPointer = *const c_char;
pub(super) type StatusKind = c_int;

/// `fmi2Status`. `fmi2Warning`, `fmi2Fatal` and `fmi2Pending` are never returned: several importers
/// take a warning for a failure, and no failure leaves an instance that could not be freed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub(super) enum Status {
    /// `fmi2OK`.
    Ok = 0,
    /// `fmi2Discard`: a status that is asked for does not exist.
    Discard = 2,
    /// `fmi2Error`.
    Error = 3,
}

/// `fmi2CoSimulation` of `fmi2Type`.
pub(super) const CO_SIMULATION: c_int = 1;

/// `fmi2LastSuccessfulTime` of `fmi2StatusKind`.
pub(super) const LAST_SUCCESSFUL_TIME: StatusKind = 2;

/// `fmi2Terminated` of `fmi2StatusKind`.
pub(super) const TERMINATED: StatusKind = 3;

pub(super) type LoggerFunction =
    unsafe extern "C" fn(Environment, StringPointer, c_int, StringPointer, StringPointer, ...);

/// `fmi2CallbackFunctions`. The memory functions and `stepFinished` are not used; they may be NULL.
#[derive(Clone, Copy)]
#[repr(C)]
pub(super) struct CallbackFunctions {
    pub(super) logger: Option<LoggerFunction>,
    pub(super) allocate_memory: *const c_void,
    pub(super) free_memory: *const c_void,
    pub(super) step_finished: *const c_void,
    pub(super) environment: Environment,
}
