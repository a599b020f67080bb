//! Exports that the capability flags of the model description exclude: each answers `fmi2Error` and
//! names the flag.

use std::ffi::{c_char, c_void};

use super::guard::guarded;
use super::types::{Component, Status, ValueReference};

type State = *mut c_void;

/// OK where nothing is asked for, else an error that says why.
pub(super) fn none(why: &str, count: usize) -> Result<Status, String> {
    if count == 0 { Ok(Status::Ok) } else { Err(format!("{why}: {count} values were asked for, must be 0")) }
}

macro_rules! refused {
    ($($(#[$doc:meta])* $name:ident($($argument:ident: $type:ty),*) => $why:literal;)*) => {$(
        $(#[$doc])*
        ///
        /// # Safety
        ///
        /// The component is NULL or came from `fmi2Instantiate` and was not freed; nothing else is read.
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $name(component: Component, $($argument: $type),*) -> Status {
            // SAFETY: the caller's contract.
            unsafe { guarded(component, stringify!($name), |_| Err(concat!("not supported: ", $why).into())) }
        }
    )*};
}

refused! {
    /// Not supported.
    fmi2GetFMUstate(_state: *mut State) => "canGetAndSetFMUstate is false";
    /// Not supported.
    fmi2SetFMUstate(_state: State) => "canGetAndSetFMUstate is false";
    /// Not supported.
    fmi2SerializedFMUstateSize(_state: State, _size: *mut usize) => "canSerializeFMUstate is false";
    /// Not supported.
    fmi2SerializeFMUstate(_state: State, _bytes: *mut c_char, _size: usize) => "canSerializeFMUstate is false";
    /// Not supported.
    fmi2DeSerializeFMUstate(_bytes: *const c_char, _size: usize, _state: *mut State) => "canSerializeFMUstate is false";
    /// Not supported.
    fmi2GetDirectionalDerivative(
        _unknowns: *const ValueReference, _unknown_count: usize, _knowns: *const ValueReference,
        _known_count: usize, _seed: *const f64, _result: *mut f64
    ) => "providesDirectionalDerivative is false";
    /// Nothing runs asynchronously, so there is nothing to cancel.
    fmi2CancelStep() => "canRunAsynchronuously is false";
}

/// Frees a state: there are none, so only NULL (or a pointer to it) is fine.
///
/// # Safety
///
/// The component is NULL or came from `fmi2Instantiate` and was not freed; `state` is NULL or points
/// to a state pointer.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2FreeFMUstate(component: Component, state: *mut State) -> Status {
    let body = |_: &mut super::Handle| {
        // SAFETY: the caller's contract; a NULL pointer gives None.
        match unsafe { state.as_ref() } {
            Some(content) if !content.is_null() => Err("not supported: canGetAndSetFMUstate is false".into()),
            _ => Ok(Status::Ok),
        }
    };
    // SAFETY: the caller's contract.
    unsafe { guarded(component, "fmi2FreeFMUstate", body) }
}
