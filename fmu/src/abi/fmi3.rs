//! The C interface of FMI 3.0: the types of `fmi3PlatformTypes.h` and `fmi3FunctionTypes.h`, and one table of
//! the functions. All code that exports, calls or resolves them uses these definitions.

use std::ffi::{c_char, c_int, c_void};
use std::fmt;

/// `fmi3Instance`, opaque except to its library.
pub type Instance = *mut c_void;
/// `fmi3InstanceEnvironment`: a pointer that is passed back to the importer with each callback.
pub type Environment = *mut c_void;
/// `fmi3FMUState`.
pub type State = *mut c_void;
/// `fmi3ValueReference`.
pub type ValueReference = u32;
/// `fmi3Boolean`, a C `bool`: 0 is false. A library may write any byte, so it is not a Rust `bool`.
pub type Boolean = u8;
/// `fmi3Clock`, a C `bool`: 0 is inactive.
pub type Clock = u8;
/// `fmi3String`: NULL, or text that ends with a zero byte.
pub type Text = *const c_char;
/// `fmi3Binary`: NULL, or as many bytes as its size gives.
pub type Binary = *const u8;
/// `fmi3DependencyKind`.
pub type DependencyKind = c_int;
/// `fmi3IntervalQualifier`.
pub type IntervalQualifier = c_int;

/// `fmi3True`.
pub const TRUE: Boolean = 1;
/// `fmi3False`.
pub const FALSE: Boolean = 0;
/// `fmi3Dependent` of `fmi3DependencyKind`.
pub const DEPENDENT: DependencyKind = 5;

/// `fmi3Status`. A library may return any number, so this can hold any.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct Status(pub c_int);

impl Status {
    /// `fmi3OK`: done.
    pub const OK: Self = Self(0);
    /// `fmi3Warning`: done, with a remark in the log.
    pub const WARNING: Self = Self(1);
    /// `fmi3Discard`: not done; the instance is unchanged.
    pub const DISCARD: Self = Self(2);
    /// `fmi3Error`: not done; the instance can only be reset or freed.
    pub const ERROR: Self = Self(3);
    /// `fmi3Fatal`: not done; no instance of this FMU can be used any more.
    pub const FATAL: Self = Self(4);

    /// Whether the standard defines this number.
    pub fn is_known(self) -> bool {
        (Self::OK.0..=Self::FATAL.0).contains(&self.0)
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match *self {
            Self::OK => "fmi3OK",
            Self::WARNING => "fmi3Warning",
            Self::DISCARD => "fmi3Discard",
            Self::ERROR => "fmi3Error",
            Self::FATAL => "fmi3Fatal",
            Self(code) => return write!(f, "unknown status {code}"),
        })
    }
}

/// `fmi3LogMessageCallback`: environment, status, category, message. NULL means no messages.
pub type LogMessage = Option<unsafe extern "C" fn(Environment, Status, Text, Text)>;
/// `fmi3ClockUpdateCallback`.
pub type ClockUpdate = Option<unsafe extern "C" fn(Environment)>;
/// `fmi3IntermediateUpdateCallback`: environment, time, whether values may be set and read, whether a step is
/// finished, whether it can return early; then, as outputs, whether and when the importer wants an early
/// return.
pub type IntermediateUpdate = Option<
    unsafe extern "C" fn(Environment, f64, Boolean, Boolean, Boolean, Boolean, *mut Boolean, *mut f64),
>;
/// `fmi3LockPreemptionCallback` and `fmi3UnlockPreemptionCallback`.
pub type Preemption = Option<unsafe extern "C" fn()>;

/// Passes the 75 functions of FMI 3.0 to the macro `$with`, one row each: a name in snake case, the name of
/// its type, its own name, and its signature.
///
/// The signatures use the types of [`fmi3`](crate::fmi3), which must be in scope where the rows are expanded.
#[macro_export]
macro_rules! fmi3_functions {
    ($with:ident) => {
        $with! {
            get_version GetVersion fmi3GetVersion () -> Text;
            set_debug_logging SetDebugLogging fmi3SetDebugLogging
                (Instance, Boolean, usize, *const Text) -> Status;
            instantiate_model_exchange InstantiateModelExchange fmi3InstantiateModelExchange
                (Text, Text, Text, Boolean, Boolean, Environment, LogMessage) -> Instance;
            instantiate_co_simulation InstantiateCoSimulation fmi3InstantiateCoSimulation
                (
                    Text, Text, Text, Boolean, Boolean, Boolean, Boolean, *const ValueReference, usize,
                    Environment, LogMessage, IntermediateUpdate
                ) -> Instance;
            instantiate_scheduled_execution InstantiateScheduledExecution fmi3InstantiateScheduledExecution
                (
                    Text, Text, Text, Boolean, Boolean, Environment, LogMessage, ClockUpdate, Preemption,
                    Preemption
                ) -> Instance;
            free_instance FreeInstance fmi3FreeInstance (Instance) -> ();
            enter_initialization_mode EnterInitializationMode fmi3EnterInitializationMode
                (Instance, Boolean, f64, f64, Boolean, f64) -> Status;
            exit_initialization_mode ExitInitializationMode fmi3ExitInitializationMode (Instance) -> Status;
            enter_event_mode EnterEventMode fmi3EnterEventMode (Instance) -> Status;
            terminate Terminate fmi3Terminate (Instance) -> Status;
            reset Reset fmi3Reset (Instance) -> Status;
            get_float32 GetFloat32 fmi3GetFloat32
                (Instance, *const ValueReference, usize, *mut f32, usize) -> Status;
            get_float64 GetFloat64 fmi3GetFloat64
                (Instance, *const ValueReference, usize, *mut f64, usize) -> Status;
            get_int8 GetInt8 fmi3GetInt8 (Instance, *const ValueReference, usize, *mut i8, usize) -> Status;
            get_uint8 GetUInt8 fmi3GetUInt8
                (Instance, *const ValueReference, usize, *mut u8, usize) -> Status;
            get_int16 GetInt16 fmi3GetInt16
                (Instance, *const ValueReference, usize, *mut i16, usize) -> Status;
            get_uint16 GetUInt16 fmi3GetUInt16
                (Instance, *const ValueReference, usize, *mut u16, usize) -> Status;
            get_int32 GetInt32 fmi3GetInt32
                (Instance, *const ValueReference, usize, *mut i32, usize) -> Status;
            get_uint32 GetUInt32 fmi3GetUInt32
                (Instance, *const ValueReference, usize, *mut u32, usize) -> Status;
            get_int64 GetInt64 fmi3GetInt64
                (Instance, *const ValueReference, usize, *mut i64, usize) -> Status;
            get_uint64 GetUInt64 fmi3GetUInt64
                (Instance, *const ValueReference, usize, *mut u64, usize) -> Status;
            get_boolean GetBoolean fmi3GetBoolean
                (Instance, *const ValueReference, usize, *mut Boolean, usize) -> Status;
            get_string GetString fmi3GetString
                (Instance, *const ValueReference, usize, *mut Text, usize) -> Status;
            get_binary GetBinary fmi3GetBinary
                (Instance, *const ValueReference, usize, *mut usize, *mut Binary, usize) -> Status;
            get_clock GetClock fmi3GetClock (Instance, *const ValueReference, usize, *mut Clock) -> Status;
            set_float32 SetFloat32 fmi3SetFloat32
                (Instance, *const ValueReference, usize, *const f32, usize) -> Status;
            set_float64 SetFloat64 fmi3SetFloat64
                (Instance, *const ValueReference, usize, *const f64, usize) -> Status;
            set_int8 SetInt8 fmi3SetInt8 (Instance, *const ValueReference, usize, *const i8, usize) -> Status;
            set_uint8 SetUInt8 fmi3SetUInt8
                (Instance, *const ValueReference, usize, *const u8, usize) -> Status;
            set_int16 SetInt16 fmi3SetInt16
                (Instance, *const ValueReference, usize, *const i16, usize) -> Status;
            set_uint16 SetUInt16 fmi3SetUInt16
                (Instance, *const ValueReference, usize, *const u16, usize) -> Status;
            set_int32 SetInt32 fmi3SetInt32
                (Instance, *const ValueReference, usize, *const i32, usize) -> Status;
            set_uint32 SetUInt32 fmi3SetUInt32
                (Instance, *const ValueReference, usize, *const u32, usize) -> Status;
            set_int64 SetInt64 fmi3SetInt64
                (Instance, *const ValueReference, usize, *const i64, usize) -> Status;
            set_uint64 SetUInt64 fmi3SetUInt64
                (Instance, *const ValueReference, usize, *const u64, usize) -> Status;
            set_boolean SetBoolean fmi3SetBoolean
                (Instance, *const ValueReference, usize, *const Boolean, usize) -> Status;
            set_string SetString fmi3SetString
                (Instance, *const ValueReference, usize, *const Text, usize) -> Status;
            set_binary SetBinary fmi3SetBinary
                (Instance, *const ValueReference, usize, *const usize, *const Binary, usize) -> Status;
            set_clock SetClock fmi3SetClock (Instance, *const ValueReference, usize, *const Clock) -> Status;
            get_number_of_variable_dependencies GetNumberOfVariableDependencies fmi3GetNumberOfVariableDependencies
                (
                    Instance, ValueReference, *mut usize
                ) -> Status;
            get_variable_dependencies GetVariableDependencies fmi3GetVariableDependencies
                (
                    Instance, ValueReference, *mut usize, *mut ValueReference, *mut usize, *mut
                    DependencyKind, usize
                ) -> Status;
            get_state GetState fmi3GetFMUState (Instance, *mut State) -> Status;
            set_state SetState fmi3SetFMUState (Instance, State) -> Status;
            free_state FreeState fmi3FreeFMUState (Instance, *mut State) -> Status;
            serialized_state_size SerializedStateSize fmi3SerializedFMUStateSize
                (Instance, State, *mut usize) -> Status;
            serialize_state SerializeState fmi3SerializeFMUState (Instance, State, *mut u8, usize) -> Status;
            deserialize_state DeserializeState fmi3DeserializeFMUState
                (Instance, *const u8, usize, *mut State) -> Status;
            get_directional_derivative GetDirectionalDerivative fmi3GetDirectionalDerivative
                (
                    Instance, *const ValueReference, usize, *const ValueReference, usize, *const f64, usize,
                    *mut f64, usize
                ) -> Status;
            get_adjoint_derivative GetAdjointDerivative fmi3GetAdjointDerivative
                (
                    Instance, *const ValueReference, usize, *const ValueReference, usize, *const f64, usize,
                    *mut f64, usize
                ) -> Status;
            enter_configuration_mode EnterConfigurationMode fmi3EnterConfigurationMode (Instance) -> Status;
            exit_configuration_mode ExitConfigurationMode fmi3ExitConfigurationMode (Instance) -> Status;
            get_interval_decimal GetIntervalDecimal fmi3GetIntervalDecimal
                (Instance, *const ValueReference, usize, *mut f64, *mut IntervalQualifier) -> Status;
            get_interval_fraction GetIntervalFraction fmi3GetIntervalFraction
                (
                    Instance, *const ValueReference, usize, *mut u64, *mut u64, *mut IntervalQualifier
                ) -> Status;
            get_shift_decimal GetShiftDecimal fmi3GetShiftDecimal
                (Instance, *const ValueReference, usize, *mut f64) -> Status;
            get_shift_fraction GetShiftFraction fmi3GetShiftFraction
                (Instance, *const ValueReference, usize, *mut u64, *mut u64) -> Status;
            set_interval_decimal SetIntervalDecimal fmi3SetIntervalDecimal
                (Instance, *const ValueReference, usize, *const f64) -> Status;
            set_interval_fraction SetIntervalFraction fmi3SetIntervalFraction
                (Instance, *const ValueReference, usize, *const u64, *const u64) -> Status;
            set_shift_decimal SetShiftDecimal fmi3SetShiftDecimal
                (Instance, *const ValueReference, usize, *const f64) -> Status;
            set_shift_fraction SetShiftFraction fmi3SetShiftFraction
                (Instance, *const ValueReference, usize, *const u64, *const u64) -> Status;
            evaluate_discrete_states EvaluateDiscreteStates fmi3EvaluateDiscreteStates (Instance) -> Status;
            update_discrete_states UpdateDiscreteStates fmi3UpdateDiscreteStates
                (
                    Instance, *mut Boolean, *mut Boolean, *mut Boolean, *mut Boolean, *mut Boolean, *mut f64
                ) -> Status;
            enter_continuous_time_mode EnterContinuousTimeMode fmi3EnterContinuousTimeMode
                (Instance) -> Status;
            completed_integrator_step CompletedIntegratorStep fmi3CompletedIntegratorStep
                (Instance, Boolean, *mut Boolean, *mut Boolean) -> Status;
            set_time SetTime fmi3SetTime (Instance, f64) -> Status;
            set_continuous_states SetContinuousStates fmi3SetContinuousStates
                (Instance, *const f64, usize) -> Status;
            get_continuous_state_derivatives GetContinuousStateDerivatives fmi3GetContinuousStateDerivatives
                (Instance, *mut f64, usize) -> Status;
            get_event_indicators GetEventIndicators fmi3GetEventIndicators
                (Instance, *mut f64, usize) -> Status;
            get_continuous_states GetContinuousStates fmi3GetContinuousStates
                (Instance, *mut f64, usize) -> Status;
            get_nominals_of_continuous_states GetNominalsOfContinuousStates fmi3GetNominalsOfContinuousStates
                (Instance, *mut f64, usize) -> Status;
            get_number_of_event_indicators GetNumberOfEventIndicators fmi3GetNumberOfEventIndicators
                (Instance, *mut usize) -> Status;
            get_number_of_continuous_states GetNumberOfContinuousStates fmi3GetNumberOfContinuousStates
                (Instance, *mut usize) -> Status;
            enter_step_mode EnterStepMode fmi3EnterStepMode (Instance) -> Status;
            get_output_derivatives GetOutputDerivatives fmi3GetOutputDerivatives
                (Instance, *const ValueReference, usize, *const i32, *mut f64, usize) -> Status;
            do_step DoStep fmi3DoStep
                (Instance, f64, f64, Boolean, *mut Boolean, *mut Boolean, *mut Boolean, *mut f64) -> Status;
            activate_model_partition ActivateModelPartition fmi3ActivateModelPartition
                (Instance, ValueReference, f64) -> Status;
        }
    };
}

macro_rules! types {
    ($($field:ident $type:ident $symbol:ident ($($argument:ty),*) -> $result:ty;)*) => {
        $(
            #[doc = concat!("`", stringify!($symbol), "`.")]
            pub type $type = unsafe extern "C" fn($($argument),*) -> $result;
        )*

        /// The names of the functions.
        pub const FUNCTIONS: &[&str] = &[$(stringify!($symbol)),*];
    };
}

fmi3_functions!(types);
