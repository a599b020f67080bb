//! The boundary between C and Rust: NULL checks, panics, slices.

use std::any::Any;
use std::ffi::{CStr, c_char, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, Once, PoisonError};

use super::logger::Logger;
use super::{fmi2, fmi3};
use crate::configuration::FmiVersion;
use crate::instance::{Failure, Instance};

/// An instance behind a component pointer.
pub(super) struct Handle {
    pub(super) instance: Instance,
    pub(super) logger: Logger,
    /// Set once this instance panicked, since its values cannot be trusted any more.
    pub(super) poisoned: bool,
}

impl Handle {
    /// Makes a step, and logs its notice for the user.
    pub(super) fn step(&mut self, t: f64, h: f64) -> Result<(), Failure> {
        self.instance.do_step(t, h)?;
        while let Some(notice) = self.instance.notice() {
            self.logger.warning(&notice);
        }
        Ok(())
    }
}

/// The status that the functions of one version of FMI return.
pub(super) trait Answer: Copy {
    /// The version.
    const FMI: FmiVersion;
    /// Done.
    const OK: Self;
    /// Not done.
    const ERROR: Self;
}

impl Answer for fmi2::Status {
    const FMI: FmiVersion = FmiVersion::Two;
    const OK: Self = Self::OK;
    const ERROR: Self = Self::ERROR;
}

impl Answer for fmi3::Status {
    const FMI: FmiVersion = FmiVersion::Three;
    const OK: Self = Self::OK;
    const ERROR: Self = Self::ERROR;
}

/// Message and place of the last panic, kept by the hook for the log.
static LAST_PANIC: Mutex<String> = Mutex::new(String::new());

/// Prevents panics from printing to the simulator's stderr; the guard logs them. The hook belongs to this
/// library's own copy of the standard library.
pub(super) fn install_panic_hook() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        std::panic::set_hook(Box::new(|info| {
            *LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner) = info.to_string();
        }));
    });
}

/// Runs `body`, and turns a panic into its description.
pub(super) fn catch<R>(body: impl FnOnce() -> R) -> Result<R, String> {
    catch_unwind(AssertUnwindSafe(body)).map_err(|payload: Box<dyn Any + Send>| {
        // Dropping a payload can panic in turn; forgetting it cannot.
        std::mem::forget(payload);
        let text = LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner).replace('\n', " ");
        format!("internal error, please report it: {text}")
    })
}

/// The body of an export: finds the instance, runs `body`, logs a failure under `name`.
///
/// # Safety
///
/// `component` is NULL, or was returned by an instantiating function and not freed since; no other call for
/// it is in progress.
pub(super) unsafe fn guarded<S: Answer>(
    component: *mut c_void,
    name: &str,
    body: impl FnOnce(&mut Handle) -> Result<S, Failure>,
) -> S {
    // SAFETY: the caller's contract; a NULL pointer gives None.
    let Some(handle) = (unsafe { component.cast::<Handle>().as_mut() }) else { return S::ERROR };
    if handle.poisoned {
        handle.logger.error(&format!("{name}: the instance failed before and can only be freed"));
        return S::ERROR;
    }
    let fmi = handle.instance.fmi();
    if fmi != S::FMI {
        let prefix = &name[..4];
        handle.logger.error(&format!(
            "{name}: the instance is one of FMI {}, which has no functions that begin with {prefix}",
            fmi.name()
        ));
        return S::ERROR;
    }
    match catch(|| body(handle)) {
        Ok(Ok(status)) => status,
        Ok(Err(failure)) => {
            handle.logger.error(&format!("{name}: {failure}"));
            S::ERROR
        }
        Err(panic) => {
            handle.poisoned = true;
            handle.logger.error(&format!("{name}: {panic}"));
            S::ERROR
        }
    }
}

/// Returns OK if nothing is requested, else an error with the reason.
pub(super) fn none<S: Answer>(why: &str, count: usize) -> Result<S, Failure> {
    if count == 0 { Ok(S::OK) } else { Err(format!("{why}: {count} values were asked for, must be 0")) }
}

/// `len` elements at `pointer`; nothing is read if `len` is 0.
///
/// # Safety
///
/// `pointer` is NULL or points to `len` readable elements for as long as the result is used.
///
/// # Errors
///
/// NULL with `len` > 0, or a length that no array can have.
pub(super) unsafe fn slice<'a, T>(name: &str, pointer: *const T, len: usize) -> Result<&'a [T], Failure> {
    if len == 0 {
        return Ok(&[]);
    }
    check_array(name, pointer, len)?;
    // SAFETY: not NULL, aligned, of possible size, and the caller's contract.
    Ok(unsafe { std::slice::from_raw_parts(pointer, len) })
}

/// [`slice`] for writing.
///
/// # Safety
///
/// As for [`slice`], writable and not aliased.
///
/// # Errors
///
/// As for [`slice`].
pub(super) unsafe fn slice_mut<'a, T>(
    name: &str,
    pointer: *mut T,
    len: usize,
) -> Result<&'a mut [T], Failure> {
    if len == 0 {
        return Ok(&mut []);
    }
    check_array(name, pointer.cast_const(), len)?;
    // SAFETY: not NULL, aligned, of possible size, and the caller's contract.
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer, len) })
}

#[inline]
fn check_array<T>(name: &str, pointer: *const T, len: usize) -> Result<(), Failure> {
    let fits = !pointer.is_null() && pointer.is_aligned() && len <= isize::MAX as usize / size_of::<T>();
    if fits { Ok(()) } else { Err(no_array(name, pointer, len)) }
}

/// The reason why there cannot be `len` elements at `pointer`.
#[cold]
fn no_array<T>(name: &str, pointer: *const T, len: usize) -> Failure {
    if pointer.is_null() {
        format!("{name} is NULL with {len} elements")
    } else if !pointer.is_aligned() {
        format!("{name} is not aligned to {} bytes", align_of::<T>())
    } else {
        format!("{name} cannot have {len} elements")
    }
}

/// The text at `pointer`, with bytes that are not UTF-8 replaced; `None` for NULL.
///
/// # Safety
///
/// `pointer` is NULL or points to a NUL-terminated string.
pub(super) unsafe fn text(pointer: *const c_char) -> Option<String> {
    if pointer.is_null() {
        return None;
    }
    // SAFETY: not NULL, and the caller's contract.
    Some(unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests;
