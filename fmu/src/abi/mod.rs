//! The functions of FMI 2.0 and FMI 3.0. Each only guards, converts and delegates to
//! [`Instance`].
//!
//! # Safety
//!
//! In addition to its own requirements, every function expects of its caller: a component is NULL or came
//! from `fmi2Instantiate` or its counterpart of FMI 3.0 and was not freed; calls for one component do not
//! overlap; an array is NULL or has as many elements as its count says; a string is NULL or NUL-terminated.
//! NULL pointers and counts of zero are answered with a status, never with a crash. A component of one
//! version is refused by functions of the other.

#[macro_use]
pub mod fmi2;
#[macro_use]
pub mod fmi3;
#[cfg(old_glibc)]
mod glibc;
mod guard;
mod logger;
mod plugin;
mod resources;
mod states;

/// Defines exports whose only argument is the component.
macro_rules! plain {
    ($status:ty; $($(#[$doc:meta])* $name:ident => $body:expr;)*) => {$(
        $(#[$doc])*
        ///
        /// # Safety
        ///
        /// See the module.
        #[unsafe(no_mangle)]
        unsafe extern "C" fn $name(component: *mut std::ffi::c_void) -> $status {
            let body: fn(&mut Handle) -> Result<(), String> = $body;
            // SAFETY: the caller's contract for components.
            unsafe {
                guarded(component, stringify!($name), |handle| body(handle).map(|()| <$status>::OK))
            }
        }
    )*};
}

mod version2;
mod version3;

use std::ffi::c_void;
use std::ptr;

#[cfg(windows)]
pub use plugin::loadable;
pub use plugin::{PluginFolder, file_name};

use guard::{Answer, Handle, catch, install_panic_hook, slice, text};
use logger::Logger;

use crate::configuration::FmiVersion;
use crate::instance::{Failure, Instance};

/// A new instance behind a pointer, or NULL with a log message under `name`. `arguments` checks the
/// importer's arguments, and returns the token of the FMU and the location of its resources.
fn instantiated(
    name: &str,
    fmi: FmiVersion,
    logger: Logger,
    arguments: impl FnOnce() -> Result<(String, String), Failure>,
) -> *mut c_void {
    install_panic_hook();
    let built = catch(|| {
        let (token, location) = arguments()?;
        let configuration = resources::configuration(&location)?;
        let found = configuration.experiment().fmi;
        if found != fmi {
            let (found, asked) = (found.name(), fmi.name());
            return Err(format!("the FMU is one of FMI {found}, which has no instance of FMI {asked}"));
        }
        Instance::new(configuration, &token)
    });
    match built.and_then(|result| result) {
        Ok(instance) => {
            logger.event("instantiated");
            if let Some(warning) = instance.warning() {
                logger.warning(&warning);
            }
            Box::into_raw(Box::new(Handle { instance, logger, poisoned: false })).cast()
        }
        Err(failure) => {
            logger.error(&format!("{name}: {failure}"));
            ptr::null_mut()
        }
    }
}

/// Frees an instance in any mode; NULL is allowed.
///
/// # Safety
///
/// See the module; the component is not used afterwards.
unsafe fn free(component: *mut c_void) {
    if !component.is_null() {
        // SAFETY: not NULL, so it came from `Box::into_raw` in `instantiated`, and is freed once.
        let handle = unsafe { Box::from_raw(component.cast::<Handle>()) };
        // A panic while dropping must not reach the importer; the memory that it leaves behind is leaked.
        let _ = catch(|| {
            states::free_all(&handle);
            drop(handle);
        });
    }
}

/// Enables or disables log categories; none named means all.
///
/// # Safety
///
/// See the module.
unsafe fn switch<S: Answer>(
    handle: &mut Handle,
    on: bool,
    count: usize,
    categories: *const fmi2::Text,
) -> Result<S, Failure> {
    // SAFETY: the caller's contract for arrays.
    let pointers = unsafe { slice("categories", categories, count) }?;
    let mut names = Vec::with_capacity(count);
    for &pointer in pointers {
        // SAFETY: the caller's contract for strings.
        names.push(unsafe { text(pointer) }.ok_or("a category is NULL")?);
    }
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    handle.logger.set_debug_logging(on, &names).map(|()| S::OK)
}
