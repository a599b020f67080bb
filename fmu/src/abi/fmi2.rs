//! The C interface of FMI 2.0: the types of `fmi2TypesPlatform.h` and `fmi2FunctionTypes.h`, and one table of
//! the functions of co-simulation. All code that exports, calls or resolves them uses these definitions.

use std::ffi::{c_char, c_int, c_uint, c_void};
use std::fmt;

/// `fmi2Component`: an instance, opaque except to its library.
pub type Component = *mut c_void;
/// `fmi2ComponentEnvironment`: a pointer that is passed back to the importer with each message.
pub type Environment = *mut c_void;
/// `fmi2FMUstate`.
pub type State = *mut c_void;
/// `fmi2ValueReference`.
pub type ValueReference = c_uint;
/// `fmi2Boolean`: 0 is false, everything else is true.
pub type Boolean = c_int;
/// `fmi2String`: NULL, or text that ends with a zero byte.
pub type Text = *const c_char;
/// `fmi2StatusKind`.
pub type StatusKind = c_int;

/// `fmi2True`.
pub const TRUE: Boolean = 1;
/// `fmi2False`.
pub const FALSE: Boolean = 0;
/// `fmi2CoSimulation` of `fmi2Type`.
pub const CO_SIMULATION: c_int = 1;
/// `fmi2LastSuccessfulTime` of `fmi2StatusKind`.
pub const LAST_SUCCESSFUL_TIME: StatusKind = 2;
/// `fmi2Terminated` of `fmi2StatusKind`.
pub const TERMINATED: StatusKind = 3;

/// `fmi2Status`. A library may return any number, so this can hold any.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct Status(pub c_int);

impl Status {
    /// `fmi2OK`: done.
    pub const OK: Self = Self(0);
    /// `fmi2Warning`: done, with a remark in the log.
    pub const WARNING: Self = Self(1);
    /// `fmi2Discard`: not done; the instance is unchanged.
    pub const DISCARD: Self = Self(2);
    /// `fmi2Error`: not done; the instance can only be reset or freed.
    pub const ERROR: Self = Self(3);
    /// `fmi2Fatal`: not done; no instance of this FMU can be used any more.
    pub const FATAL: Self = Self(4);
    /// `fmi2Pending`: still being done (asynchronous steps).
    pub const PENDING: Self = Self(5);

    /// Whether the standard defines this number.
    pub fn is_known(self) -> bool {
        (Self::OK.0..=Self::PENDING.0).contains(&self.0)
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match *self {
            Self::OK => "fmi2OK",
            Self::WARNING => "fmi2Warning",
            Self::DISCARD => "fmi2Discard",
            Self::ERROR => "fmi2Error",
            Self::FATAL => "fmi2Fatal",
            Self::PENDING => "fmi2Pending",
            Self(code) => return write!(f, "unknown status {code}"),
        })
    }
}

/// `fmi2CallbackLogger`: environment, instance name, status, category, message, arguments of the message.
pub type Logger = unsafe extern "C" fn(Environment, Text, Status, Text, Text, ...);

/// `fmi2CallbackFunctions`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct CallbackFunctions {
    /// Receives messages.
    pub logger: Option<Logger>,
    /// `calloc`.
    pub allocate_memory: Option<unsafe extern "C" fn(usize, usize) -> *mut c_void>,
    /// `free`.
    pub free_memory: Option<unsafe extern "C" fn(*mut c_void)>,
    /// Called at the end of an asynchronous step.
    pub step_finished: Option<unsafe extern "C" fn(Environment, Status)>,
    /// Passed back to `logger`.
    pub environment: Environment,
}

/// Passes the 34 functions of FMI 2.0 co-simulation to the macro `$with`, one row each: a name in snake case,
/// the name of its type, its own name, and its signature.
///
/// The signatures use the types of [`fmi2`](crate::fmi2), which must be in scope where the rows are expanded.
#[macro_export]
macro_rules! fmi2_functions {
    ($with:ident) => {
        $with! {
            get_types_platform GetTypesPlatform fmi2GetTypesPlatform () -> Text;
            get_version GetVersion fmi2GetVersion () -> Text;
            set_debug_logging SetDebugLogging fmi2SetDebugLogging
                (Component, Boolean, usize, *const Text) -> Status;
            instantiate Instantiate fmi2Instantiate
                (Text, c_int, Text, Text, *const CallbackFunctions, Boolean, Boolean) -> Component;
            free_instance FreeInstance fmi2FreeInstance (Component) -> ();
            setup_experiment SetupExperiment fmi2SetupExperiment
                (Component, Boolean, f64, f64, Boolean, f64) -> Status;
            enter_initialization_mode EnterInitializationMode fmi2EnterInitializationMode
                (Component) -> Status;
            exit_initialization_mode ExitInitializationMode fmi2ExitInitializationMode (Component) -> Status;
            terminate Terminate fmi2Terminate (Component) -> Status;
            reset Reset fmi2Reset (Component) -> Status;
            get_real GetReal fmi2GetReal (Component, *const ValueReference, usize, *mut f64) -> Status;
            get_integer GetInteger fmi2GetInteger
                (Component, *const ValueReference, usize, *mut c_int) -> Status;
            get_boolean GetBoolean fmi2GetBoolean
                (Component, *const ValueReference, usize, *mut Boolean) -> Status;
            get_string GetString fmi2GetString
                (Component, *const ValueReference, usize, *mut Text) -> Status;
            set_real SetReal fmi2SetReal (Component, *const ValueReference, usize, *const f64) -> Status;
            set_integer SetInteger fmi2SetInteger
                (Component, *const ValueReference, usize, *const c_int) -> Status;
            set_boolean SetBoolean fmi2SetBoolean
                (Component, *const ValueReference, usize, *const Boolean) -> Status;
            set_string SetString fmi2SetString
                (Component, *const ValueReference, usize, *const Text) -> Status;
            get_state GetState fmi2GetFMUstate (Component, *mut State) -> Status;
            set_state SetState fmi2SetFMUstate (Component, State) -> Status;
            free_state FreeState fmi2FreeFMUstate (Component, *mut State) -> Status;
            serialized_size SerializedSize fmi2SerializedFMUstateSize
                (Component, State, *mut usize) -> Status;
            serialize Serialize fmi2SerializeFMUstate (Component, State, *mut c_char, usize) -> Status;
            deserialize Deserialize fmi2DeSerializeFMUstate
                (Component, *const c_char, usize, *mut State) -> Status;
            directional_derivative DirectionalDerivative fmi2GetDirectionalDerivative
                (
                    Component,
                    *const ValueReference,
                    usize,
                    *const ValueReference,
                    usize,
                    *const f64,
                    *mut f64
                ) -> Status;
            set_input_derivatives SetInputDerivatives fmi2SetRealInputDerivatives
                (Component, *const ValueReference, usize, *const c_int, *const f64) -> Status;
            get_output_derivatives GetOutputDerivatives fmi2GetRealOutputDerivatives
                (Component, *const ValueReference, usize, *const c_int, *mut f64) -> Status;
            do_step DoStep fmi2DoStep (Component, f64, f64, Boolean) -> Status;
            cancel_step CancelStep fmi2CancelStep (Component) -> Status;
            get_status GetStatus fmi2GetStatus (Component, StatusKind, *mut c_int) -> Status;
            get_real_status GetRealStatus fmi2GetRealStatus (Component, StatusKind, *mut f64) -> Status;
            get_integer_status GetIntegerStatus fmi2GetIntegerStatus
                (Component, StatusKind, *mut c_int) -> Status;
            get_boolean_status GetBooleanStatus fmi2GetBooleanStatus
                (Component, StatusKind, *mut Boolean) -> Status;
            get_string_status GetStringStatus fmi2GetStringStatus
                (Component, StatusKind, *mut Text) -> Status;
        }
    };
}

macro_rules! types {
    ($($field:ident $type:ident $symbol:ident ($($argument:ty),*) -> $result:ty;)*) => {
        $(
            #[doc = concat!("`", stringify!($symbol), "`.")]
            pub type $type = unsafe extern "C" fn($($argument),*) -> $result;
        )*

        /// The names of the functions of co-simulation.
        pub const FUNCTIONS: &[&str] = &[$(stringify!($symbol)),*];
    };
}

fmi2_functions!(types);
