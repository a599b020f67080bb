//! Exports that the capability flags of the model description exclude: each answers `fmi2Error` and
//! names the flag.

use super::fmi2::{Component, Status};

use super::guard::{Handle, guarded};

/// Returns OK where nothing is asked for, else an error with the reason.
pub(super) fn none(why: &str, count: usize) -> Result<Status, String> {
    if count == 0 { Ok(Status::OK) } else { Err(format!("{why}: {count} values were asked for, must be 0")) }
}

/// Refuses to cancel a step: nothing runs asynchronously, so there is nothing to cancel.
///
/// # Safety
///
/// The component is NULL or came from `fmi2Instantiate` and was not freed.
#[unsafe(no_mangle)]
pub(super) unsafe extern "C" fn fmi2CancelStep(component: Component) -> Status {
    let body = |_: &mut Handle| Err("not supported: canRunAsynchronuously is false".into());
    // SAFETY: the caller's contract.
    unsafe { guarded(component, "fmi2CancelStep", body) }
}
