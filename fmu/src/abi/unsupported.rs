//! Exports that the capability flags of the model description exclude: each answers `fmi2Error` and
//! names the flag.

use super::guard::guarded;
use super::types::{Component, Status, ValueReference};

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
    fmi2GetDirectionalDerivative(
        _unknowns: *const ValueReference, _unknown_count: usize, _knowns: *const ValueReference,
        _known_count: usize, _seed: *const f64, _result: *mut f64
    ) => "providesDirectionalDerivative is false";
    /// Nothing runs asynchronously, so there is nothing to cancel.
    fmi2CancelStep() => "canRunAsynchronuously is false";
}
