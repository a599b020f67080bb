//! What model exchange has in FMI 3.0 alone: its way to end an event, and numbers of states and event indicators.

use super::super::fmi3::{Boolean, FALSE, Instance, Status};
use super::super::guard::{Handle, guarded, slice_mut};

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
