//! Model exchange: time, continuous states, their rates and events, of which there are none.

use super::super::fmi3::{Boolean, FALSE, Instance, Status};
use super::super::guard::{Handle, guarded, slice, slice_mut};

use crate::instance::Failure;

/// Ends an event: nothing has changed, and no event is known to come.
///
/// # Safety
///
/// See the module above; the six pointers are NULL or writable.
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn fmi3UpdateDiscreteStates(
    instance: Instance,
    need_update: *mut Boolean,
    terminate: *mut Boolean,
    nominals_changed: *mut Boolean,
    values_changed: *mut Boolean,
    next_event_time_defined: *mut Boolean,
    next_event_time: *mut f64,
) -> Status {
    let body = |handle: &mut Handle| {
        let flags = [
            ("discreteStatesNeedUpdate", need_update),
            ("terminateSimulation", terminate),
            ("nominalsOfContinuousStatesChanged", nominals_changed),
            ("valuesOfContinuousStatesChanged", values_changed),
            ("nextEventTimeDefined", next_event_time_defined),
        ];
        // SAFETY: the caller's contract for the pointer.
        let time = unsafe { slice_mut("nextEventTime", next_event_time, 1) }?;
        for (name, flag) in flags {
            // SAFETY: the caller's contract for the pointers.
            unsafe { slice_mut(name, flag, 1) }?;
        }
        handle.instance.update_discrete_states()?;
        for (name, flag) in flags {
            // SAFETY: as above.
            unsafe { slice_mut(name, flag, 1) }?[0] = FALSE;
        }
        time[0] = 0.0;
        Ok(Status::OK)
    };
    // SAFETY: the caller's contract for instances.
    unsafe { guarded(instance, "fmi3UpdateDiscreteStates", body) }
}

/// Takes note of a step of the integrator: no event follows, and the run may go on.
///
/// # Safety
///
/// See the module above; the two pointers are NULL or writable.
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn fmi3CompletedIntegratorStep(
    instance: Instance,
    _no_set_fmu_state_prior_to_current_point: Boolean,
    enter_event_mode: *mut Boolean,
    terminate: *mut Boolean,
) -> Status {
    let body = |handle: &mut Handle| {
        // SAFETY: the caller's contract for the pointer.
        let event = unsafe { slice_mut("enterEventMode", enter_event_mode, 1) }?;
        // SAFETY: the caller's contract for the pointer.
        let terminate = unsafe { slice_mut("terminateSimulation", terminate, 1) }?;
        handle.instance.completed_integrator_step()?;
        (event[0], terminate[0]) = (FALSE, FALSE);
        Ok(Status::OK)
    };
    // SAFETY: the caller's contract for instances.
    unsafe { guarded(instance, "fmi3CompletedIntegratorStep", body) }
}

/// Takes over the time.
///
/// # Safety
///
/// See the module above.
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn fmi3SetTime(instance: Instance, time: f64) -> Status {
    // SAFETY: the caller's contract for instances.
    unsafe { guarded(instance, "fmi3SetTime", |handle| handle.instance.set_time(time).map(|()| Status::OK)) }
}

/// Takes over the continuous states.
///
/// # Safety
///
/// See the module above.
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn fmi3SetContinuousStates(
    instance: Instance,
    states: *const f64,
    count: usize,
) -> Status {
    let body = |handle: &mut Handle| {
        // SAFETY: the caller's contract for arrays.
        let states = unsafe { slice("continuousStates", states, count) }?;
        let done = handle.instance.set_continuous_states(states)?;
        Ok(done_or_discarded(handle, "fmi3SetContinuousStates", done))
    };
    // SAFETY: the caller's contract for instances.
    unsafe { guarded(instance, "fmi3SetContinuousStates", body) }
}

/// OK, or discarded with a message.
pub(super) fn done_or_discarded(handle: &Handle, name: &str, done: Result<(), Failure>) -> Status {
    match done {
        Ok(()) => Status::OK,
        Err(why) => {
            handle.logger.discarded(&format!("{name}: {why}"));
            Status::DISCARD
        }
    }
}

/// Defines exports that read a number for each state.
macro_rules! states {
    ($($(#[$doc:meta])* $name:ident => $body:expr;)*) => {$(
        $(#[$doc])*
        ///
        /// # Safety
        ///
        /// See the module above.
        #[unsafe(no_mangle)]
        pub(super) unsafe extern "C" fn $name(instance: Instance, values: *mut f64, count: usize) -> Status {
            let body = |handle: &mut Handle| {
                // SAFETY: the caller's contract for arrays.
                let values = unsafe { slice_mut("values", values, count) }?;
                let read: fn(&mut Handle, &mut [f64]) -> Result<Result<(), Failure>, Failure> = $body;
                let done = read(handle, values)?;
                Ok(done_or_discarded(handle, stringify!($name), done))
            };
            // SAFETY: the caller's contract for instances.
            unsafe { guarded(instance, stringify!($name), body) }
        }
    )*};
}

states! {
    /// Reads the continuous states.
    fmi3GetContinuousStates => |handle, values| handle.instance.continuous_states(values).map(Ok);
    /// Reads the rates of the continuous states.
    fmi3GetContinuousStateDerivatives => |handle, values| handle.instance.continuous_state_derivatives(values);
    /// Reads the sizes that the continuous states are expected to have.
    fmi3GetNominalsOfContinuousStates => |handle, values| handle.instance.nominals(values).map(Ok);
    /// Reads the event indicators, of which there are none.
    fmi3GetEventIndicators => |handle, values| handle.instance.event_indicators(values.len()).map(Ok);
}

/// Defines exports that read one number.
macro_rules! counts {
    ($($(#[$doc:meta])* $name:ident($argument:literal) => $method:ident;)*) => {$(
        $(#[$doc])*
        ///
        /// # Safety
        ///
        /// See the module above; `count` is NULL or writable.
        #[unsafe(no_mangle)]
        pub(super) unsafe extern "C" fn $name(instance: Instance, count: *mut usize) -> Status {
            let body = |handle: &mut Handle| {
                // SAFETY: the caller's contract for the pointer.
                let count = unsafe { slice_mut($argument, count, 1) }?;
                count[0] = handle.instance.$method()?;
                Ok(Status::OK)
            };
            // SAFETY: the caller's contract for instances.
            unsafe { guarded(instance, stringify!($name), body) }
        }
    )*};
}

counts! {
    /// Counts the continuous states.
    fmi3GetNumberOfContinuousStates("nContinuousStates") => number_of_states;
    /// Counts the event indicators, of which there are none.
    fmi3GetNumberOfEventIndicators("nEventIndicators") => number_of_event_indicators;
}
