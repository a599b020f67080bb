//! The library's functions, as the C header declares them.

use std::ffi::{c_char, c_int, c_void};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use punctual_fmu::fmi2::{self, Boolean, CallbackFunctions, Logger, StatusKind, ValueReference};
pub(crate) use punctual_fmu::fmi2::{CallbackFunctions as Callbacks, Component, State, Text};

/// Statuses are compared and printed as numbers here.
type Status = c_int;

pub(crate) const OK: Status = fmi2::Status::OK.0;
pub(crate) const DISCARD: Status = fmi2::Status::DISCARD.0;
pub(crate) const ERROR: Status = fmi2::Status::ERROR.0;

/// A logger that only takes the five fixed arguments.
type FixedLogger = extern "C" fn(*mut c_void, Text, c_int, Text, Text);

/// Callbacks with a logger and its environment.
///
/// The logger is C-variadic; this one takes the five fixed arguments only. On x86-64 (System V and
/// Windows) a variadic call passes them where a plain function looks for them; the language does not
/// promise it, and Rust cannot define a variadic function yet.
pub(crate) fn callbacks(logger: FixedLogger, environment: *mut c_void) -> Callbacks {
    // SAFETY: as above.
    let logger = unsafe { std::mem::transmute::<FixedLogger, Logger>(logger) };
    Callbacks {
        logger: Some(logger),
        allocate_memory: None,
        free_memory: None,
        step_finished: None,
        environment,
    }
}

macro_rules! api {
    ($($field:ident $type:ident $symbol:ident ($($argument:ty),*) -> $result:ty;)*) => {
        /// The functions. They are declared safe so that the tests stay readable. Each call satisfies the
        /// contract of the standard, or violates it only where the library promises to survive.
        pub(crate) struct Api {
            $(pub(crate) $field: extern "C" fn($($argument),*) -> $result,)*
            _library: libloading::Library,
        }

        impl Api {
            /// Loads `path` and resolves every function.
            pub(crate) fn load(path: &Path) -> Self {
                // SAFETY: the library has no initialisers of its own.
                let library = unsafe { libloading::Library::new(path) }
                    .unwrap_or_else(|e| panic!("{}: {e}", path.display()));
                Self {
                    $($field: {
                        // SAFETY: the type is the one of the C header; the library is kept beside it.
                        let symbol = unsafe { library.get(stringify!($symbol)) };
                        *symbol.unwrap_or_else(|e| panic!("{} is missing: {e}", stringify!($symbol)))
                    },)*
                    _library: library,
                }
            }
        }
    };
}

punctual_fmu::fmi2_functions!(api);

/// The functions of FMI 3.0.
pub(crate) mod three {
    use std::ffi::c_int;
    use std::path::Path;
    use std::sync::LazyLock;

    pub(crate) use punctual_fmu::fmi3::{
        Binary, Boolean, Clock, ClockUpdate, DependencyKind, Environment, Instance, IntermediateUpdate,
        IntervalQualifier, LogMessage, Preemption, State, Text, ValueReference,
    };

    /// Statuses are compared and printed as numbers here.
    type Status = c_int;

    punctual_fmu::fmi3_functions!(api);

    /// The library, loaded once for all tests that do not unload it.
    pub(crate) static API: LazyLock<Api> = LazyLock::new(|| Api::load(&super::library_path()));
}

/// The path where cargo puts the library of the tested build: beside the test's executable.
pub(crate) fn library_path() -> PathBuf {
    let name = format!("{}punctual_fmu{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    std::env::current_exe().expect("the path of this test").with_file_name(name)
}

/// The library, loaded once for all tests that do not unload it.
pub(crate) static API: LazyLock<Api> = LazyLock::new(|| Api::load(&library_path()));
