//! Model exchange: time, continuous states and their rates. The functions are the same in both versions of FMI but for
//! their names and types.

use std::ffi::c_void;

use super::guard::{Answer, Handle, guarded, slice, slice_mut};
use super::{fmi2, fmi3};
use crate::instance::Failure;

/// OK, or discarded with a message.
pub(super) fn done_or_discarded<S: Answer>(handle: &Handle, name: &str, done: Result<(), Failure>) -> S {
    match done {
        Ok(()) => S::OK,
        Err(why) => {
            handle.logger.discarded(&format!("{name}: {why}"));
            S::DISCARD
        }
    }
}

/// Reads a number for each state into what `values` points to.
///
/// # Safety
///
/// See the module above.
unsafe fn read<S: Answer>(
    component: *mut c_void,
    name: &str,
    (values, count): (*mut f64, usize),
    body: impl FnOnce(&mut Handle, &mut [f64]) -> Result<Result<(), Failure>, Failure>,
) -> S {
    let body = |handle: &mut Handle| {
        // SAFETY: the caller's contract for arrays.
        let values = unsafe { slice_mut("values", values, count) }?;
        let done = body(handle, values)?;
        Ok(done_or_discarded(handle, name, done))
    };
    // SAFETY: the caller's contract for components.
    unsafe { guarded(component, name, body) }
}

/// Defines the functions of a version: the types of its status and of its flags, then the names.
macro_rules! exchange {
    ($status:ty, $boolean:ty; $time:ident $completed:ident $set:ident $get:ident $rates:ident $nominals:ident
        $indicators:ident) => {
        /// Takes over the time.
        ///
        /// # Safety
        ///
        /// See the module above.
        #[unsafe(no_mangle)]
        pub(super) unsafe extern "C" fn $time(component: *mut c_void, time: f64) -> $status {
            let body = |handle: &mut Handle| handle.instance.set_time(time).map(|()| <$status>::OK);
            // SAFETY: the caller's contract for components.
            unsafe { guarded(component, stringify!($time), body) }
        }

        /// Takes note of a step of the integrator: no event follows, and the run may go on.
        ///
        /// # Safety
        ///
        /// See the module above; the two pointers are NULL or writable.
        #[unsafe(no_mangle)]
        pub(super) unsafe extern "C" fn $completed(
            component: *mut c_void,
            _no_set_fmu_state_prior_to_current_point: $boolean,
            enter_event_mode: *mut $boolean,
            terminate: *mut $boolean,
        ) -> $status {
            let body = |handle: &mut Handle| {
                // SAFETY: the caller's contract for the pointer.
                let event = unsafe { slice_mut("enterEventMode", enter_event_mode, 1) }?;
                // SAFETY: the caller's contract for the pointer.
                let terminate = unsafe { slice_mut("terminateSimulation", terminate, 1) }?;
                handle.instance.completed_integrator_step()?;
                (event[0], terminate[0]) = Default::default();
                Ok(<$status>::OK)
            };
            // SAFETY: the caller's contract for components.
            unsafe { guarded(component, stringify!($completed), body) }
        }

        /// Takes over the continuous states.
        ///
        /// # Safety
        ///
        /// See the module above.
        #[unsafe(no_mangle)]
        pub(super) unsafe extern "C" fn $set(
            component: *mut c_void,
            states: *const f64,
            count: usize,
        ) -> $status {
            let body = |handle: &mut Handle| {
                // SAFETY: the caller's contract for arrays.
                let states = unsafe { slice("continuousStates", states, count) }?;
                let done = handle.instance.set_continuous_states(states)?;
                Ok(done_or_discarded(handle, stringify!($set), done))
            };
            // SAFETY: the caller's contract for components.
            unsafe { guarded(component, stringify!($set), body) }
        }

        exchange! {
            $status;
            /// Reads the continuous states.
            $get => |handle, values| handle.instance.continuous_states(values).map(Ok);
            /// Reads the rates of the continuous states.
            $rates => |handle, values| handle.instance.continuous_state_derivatives(values);
            /// Reads the sizes that the continuous states are expected to have.
            $nominals => |handle, values| handle.instance.nominals(values).map(Ok);
            /// Reads the event indicators, of which there are none.
            $indicators => |handle, values| handle.instance.event_indicators(values.len()).map(Ok);
        }
    };
    ($status:ty; $($(#[$doc:meta])* $name:ident => $body:expr;)*) => {$(
        $(#[$doc])*
        ///
        /// # Safety
        ///
        /// See the module above.
        #[unsafe(no_mangle)]
        pub(super) unsafe extern "C" fn $name(
            component: *mut c_void,
            values: *mut f64,
            count: usize,
        ) -> $status {
            // SAFETY: the caller's contract.
            unsafe { read(component, stringify!($name), (values, count), $body) }
        }
    )*};
}

exchange! {
    fmi2::Status, fmi2::Boolean;
    fmi2SetTime fmi2CompletedIntegratorStep fmi2SetContinuousStates fmi2GetContinuousStates fmi2GetDerivatives
    fmi2GetNominalsOfContinuousStates fmi2GetEventIndicators
}

exchange! {
    fmi3::Status, fmi3::Boolean;
    fmi3SetTime fmi3CompletedIntegratorStep fmi3SetContinuousStates fmi3GetContinuousStates
    fmi3GetContinuousStateDerivatives fmi3GetNominalsOfContinuousStates fmi3GetEventIndicators
}
