//! The library's functions, as the C header declares them.

use std::ffi::{c_char, c_int, c_void};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

pub(crate) type Component = *mut c_void;
pub(crate) type State = *mut c_void;
pub(crate) type Text = *const c_char;
type Status = c_int;
type Bool = c_int;
type Refs = *const u32;

pub(crate) const OK: Status = 0;
pub(crate) const DISCARD: Status = 2;
pub(crate) const ERROR: Status = 3;

/// The logger is C-variadic; this one takes the five fixed arguments only. On x86-64 (System V and
/// Windows) a variadic call passes them where a plain function looks for them; the language does not
/// promise it, and Rust cannot define a variadic function yet.
pub(crate) type LoggerFunction = extern "C" fn(*mut c_void, Text, c_int, Text, Text);

/// `fmi2CallbackFunctions`.
#[repr(C)]
pub(crate) struct Callbacks {
    pub(crate) logger: Option<LoggerFunction>,
    pub(crate) allocate_memory: *const c_void,
    pub(crate) free_memory: *const c_void,
    pub(crate) step_finished: *const c_void,
    pub(crate) environment: *mut c_void,
}

macro_rules! api {
    ($($field:ident $symbol:literal ($($argument:ty),*) $(-> $result:ty)?;)*) => {
        /// The functions. They are declared safe so that tests read as tests: each keeps the contract
        /// of the standard, or breaks it only where the library promises to survive.
        pub(crate) struct Api {
            $(pub(crate) $field: extern "C" fn($($argument),*) $(-> $result)?,)*
            _library: libloading::Library,
        }

        /// The 34 functions of FMI 2.0 co-simulation.
        pub(crate) const SYMBOLS: &[&str] = &[$($symbol),*];

        impl Api {
            /// Loads `path` and resolves every function.
            pub(crate) fn load(path: &Path) -> Self {
                // SAFETY: the library has no initialisers of its own.
                let library = unsafe { libloading::Library::new(path) }
                    .unwrap_or_else(|e| panic!("{}: {e}", path.display()));
                Self {
                    $($field: {
                        // SAFETY: the type is the one of the C header; the library is kept beside it.
                        let symbol = unsafe { library.get($symbol) };
                        *symbol.unwrap_or_else(|e| panic!("{} is missing: {e}", $symbol))
                    },)*
                    _library: library,
                }
            }
        }
    };
}

api! {
    get_types_platform "fmi2GetTypesPlatform" () -> Text;
    get_version "fmi2GetVersion" () -> Text;
    set_debug_logging "fmi2SetDebugLogging" (Component, Bool, usize, *const Text) -> Status;
    instantiate "fmi2Instantiate" (Text, c_int, Text, Text, *const Callbacks, Bool, Bool) -> Component;
    free_instance "fmi2FreeInstance" (Component);
    setup_experiment "fmi2SetupExperiment" (Component, Bool, f64, f64, Bool, f64) -> Status;
    enter_initialization_mode "fmi2EnterInitializationMode" (Component) -> Status;
    exit_initialization_mode "fmi2ExitInitializationMode" (Component) -> Status;
    terminate "fmi2Terminate" (Component) -> Status;
    reset "fmi2Reset" (Component) -> Status;
    get_real "fmi2GetReal" (Component, Refs, usize, *mut f64) -> Status;
    get_integer "fmi2GetInteger" (Component, Refs, usize, *mut c_int) -> Status;
    get_boolean "fmi2GetBoolean" (Component, Refs, usize, *mut Bool) -> Status;
    get_string "fmi2GetString" (Component, Refs, usize, *mut Text) -> Status;
    set_real "fmi2SetReal" (Component, Refs, usize, *const f64) -> Status;
    set_integer "fmi2SetInteger" (Component, Refs, usize, *const c_int) -> Status;
    set_boolean "fmi2SetBoolean" (Component, Refs, usize, *const Bool) -> Status;
    set_string "fmi2SetString" (Component, Refs, usize, *const Text) -> Status;
    get_state "fmi2GetFMUstate" (Component, *mut State) -> Status;
    set_state "fmi2SetFMUstate" (Component, State) -> Status;
    free_state "fmi2FreeFMUstate" (Component, *mut State) -> Status;
    serialized_size "fmi2SerializedFMUstateSize" (Component, State, *mut usize) -> Status;
    serialize "fmi2SerializeFMUstate" (Component, State, *mut c_char, usize) -> Status;
    deserialize "fmi2DeSerializeFMUstate" (Component, *const c_char, usize, *mut State) -> Status;
    directional_derivative "fmi2GetDirectionalDerivative"
        (Component, Refs, usize, Refs, usize, *const f64, *mut f64) -> Status;
    set_input_derivatives "fmi2SetRealInputDerivatives"
        (Component, Refs, usize, *const c_int, *const f64) -> Status;
    get_output_derivatives "fmi2GetRealOutputDerivatives"
        (Component, Refs, usize, *const c_int, *mut f64) -> Status;
    do_step "fmi2DoStep" (Component, f64, f64, Bool) -> Status;
    cancel_step "fmi2CancelStep" (Component) -> Status;
    get_status "fmi2GetStatus" (Component, c_int, *mut c_int) -> Status;
    get_real_status "fmi2GetRealStatus" (Component, c_int, *mut f64) -> Status;
    get_integer_status "fmi2GetIntegerStatus" (Component, c_int, *mut c_int) -> Status;
    get_boolean_status "fmi2GetBooleanStatus" (Component, c_int, *mut Bool) -> Status;
    get_string_status "fmi2GetStringStatus" (Component, c_int, *mut Text) -> Status;
}

/// Where cargo puts the library of the tested build: beside the test's executable.
pub(crate) fn library_path() -> PathBuf {
    let name = format!("{}punctual_fmu{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    std::env::current_exe().expect("the path of this test").with_file_name(name)
}

/// The library, loaded once for all tests that do not unload it.
pub(crate) static API: LazyLock<Api> = LazyLock::new(|| Api::load(&library_path()));
