//! One instance of a co-simulation FMU of FMI 3.0, behind a safe interface. It runs without event mode, early
//! return and intermediate updates, so the FMU handles its events itself. No call allocates unless it fails,
//! except the first one that reads or writes as many numbers of a type other than double.

use std::rc::Rc;

use punctual_fmu::fmi3::{self, FALSE, TRUE};

use super::handle::{CTexts, Handle, c_text, get_through, plain_calls, set_through};
use super::library::functions;
use super::number::{self, DataType, Truth};
use super::participant::{Participant, Saved, Slave, remark};
use super::{Description, Fmu, LogMessage, Version};
use crate::error::{Error, FmuProblem, brief_time};

functions! {
    needed {
        get_version: "fmi3GetVersion", fmi3::GetVersion;
        instantiate: "fmi3InstantiateCoSimulation", fmi3::InstantiateCoSimulation;
        free_instance: "fmi3FreeInstance", fmi3::FreeInstance;
        enter_initialization_mode: "fmi3EnterInitializationMode", fmi3::EnterInitializationMode;
        exit_initialization_mode: "fmi3ExitInitializationMode", fmi3::ExitInitializationMode;
        terminate: "fmi3Terminate", fmi3::Terminate;
        reset: "fmi3Reset", fmi3::Reset;
        do_step: "fmi3DoStep", fmi3::DoStep;
        get_float32: "fmi3GetFloat32", fmi3::GetFloat32;
        get_float64: "fmi3GetFloat64", fmi3::GetFloat64;
        get_int8: "fmi3GetInt8", fmi3::GetInt8;
        get_uint8: "fmi3GetUInt8", fmi3::GetUInt8;
        get_int16: "fmi3GetInt16", fmi3::GetInt16;
        get_uint16: "fmi3GetUInt16", fmi3::GetUInt16;
        get_int32: "fmi3GetInt32", fmi3::GetInt32;
        get_uint32: "fmi3GetUInt32", fmi3::GetUInt32;
        get_int64: "fmi3GetInt64", fmi3::GetInt64;
        get_uint64: "fmi3GetUInt64", fmi3::GetUInt64;
        get_boolean: "fmi3GetBoolean", fmi3::GetBoolean;
        set_float32: "fmi3SetFloat32", fmi3::SetFloat32;
        set_float64: "fmi3SetFloat64", fmi3::SetFloat64;
        set_int8: "fmi3SetInt8", fmi3::SetInt8;
        set_uint8: "fmi3SetUInt8", fmi3::SetUInt8;
        set_int16: "fmi3SetInt16", fmi3::SetInt16;
        set_uint16: "fmi3SetUInt16", fmi3::SetUInt16;
        set_int32: "fmi3SetInt32", fmi3::SetInt32;
        set_uint32: "fmi3SetUInt32", fmi3::SetUInt32;
        set_int64: "fmi3SetInt64", fmi3::SetInt64;
        set_uint64: "fmi3SetUInt64", fmi3::SetUInt64;
        set_boolean: "fmi3SetBoolean", fmi3::SetBoolean;
    }
    other {
        get_string: "fmi3GetString", fmi3::GetString;
        set_string: "fmi3SetString", fmi3::SetString;
        enter_configuration_mode: "fmi3EnterConfigurationMode", fmi3::EnterConfigurationMode;
        exit_configuration_mode: "fmi3ExitConfigurationMode", fmi3::ExitConfigurationMode;
        get_state: "fmi3GetFMUState", fmi3::GetState;
        set_state: "fmi3SetFMUState", fmi3::SetState;
        free_state: "fmi3FreeFMUState", fmi3::FreeState;
        state_size: "fmi3SerializedFMUStateSize", fmi3::SerializedStateSize;
        serialize: "fmi3SerializeFMUState", fmi3::SerializeState;
        deserialize: "fmi3DeserializeFMUState", fmi3::DeserializeState;
        directional: "fmi3GetDirectionalDerivative", fmi3::GetDirectionalDerivative;
        adjoint: "fmi3GetAdjointDerivative", fmi3::GetAdjointDerivative;
    }
}

/// The greatest size of a serialised state, in bytes.
const MAX_STATE: usize = 1 << 30;

/// The fraction of a step by which the time reached may differ from the requested time without a remark.
const ON_TIME: f64 = 1e-6;

/// An instance, freed on drop if the standard allows it.
pub(super) struct Instance {
    handle: Handle,
    functions: Functions,
    /// Start and stop time and tolerance, for the call that begins the initialisation.
    experiment: (f64, f64, Option<f64>),
    /// Whether the FMU asked to end the run in the last step.
    asks_to_end: bool,
    /// Whether a step may be taken back.
    may_go_back: bool,
    /// The first step that ended at the wrong time: the requested time and the time reached.
    off: Option<(f64, f64)>,
    float32: Vec<f32>,
    int8: Vec<i8>,
    uint8: Vec<u8>,
    int16: Vec<i16>,
    uint16: Vec<u16>,
    int32: Vec<i32>,
    uint32: Vec<u32>,
    int64: Vec<i64>,
    uint64: Vec<u64>,
    truths: Vec<Truth<u8>>,
}

impl Instance {
    /// Makes an instance. `functions` must be those of the loaded library of `of`.
    pub(super) fn new(
        of: (Rc<Fmu>, Rc<Description>),
        functions: Functions,
        name: &str,
    ) -> Result<Self, Error> {
        let instance_name = c_text("instance name", name)?;
        let token = c_text("instantiationToken", &of.1.token)?;
        let resources =
            of.0.archive.resource_path().map(|path| c_text("resource path", &path)).transpose()?;
        let handle = Handle::instantiate("fmi3InstantiateCoSimulation", of, name, |logging, is_logged| {
            let (environment, callback) = logging.plain();
            // No variables. An FMU written in Rust may turn the address into a slice, for which NULL is
            // invalid.
            let required: [u32; 0] = [];
            // SAFETY: the texts and the list outlive the call; the data of the callback outlives the
            // instance.
            unsafe {
                (functions.instantiate)(
                    instance_name.as_ptr(),
                    token.as_ptr(),
                    resources.as_ref().map_or(std::ptr::null(), |path| path.as_ptr()),
                    FALSE,
                    if is_logged { TRUE } else { FALSE },
                    FALSE,
                    FALSE,
                    required.as_ptr(),
                    required.len(),
                    environment,
                    callback,
                    None,
                )
            }
        })?;
        Ok(Self {
            handle,
            functions,
            experiment: (0.0, 0.0, None),
            asks_to_end: false,
            may_go_back: false,
            off: None,
            float32: Vec::new(),
            int8: Vec::new(),
            uint8: Vec::new(),
            int16: Vec::new(),
            uint16: Vec::new(),
            int32: Vec::new(),
            uint32: Vec::new(),
            int64: Vec::new(),
            uint64: Vec::new(),
            truths: Vec::new(),
        })
    }

    /// The state that a call returned.
    fn saved(&self, call: &'static str, state: fmi3::State) -> Result<Saved, Error> {
        let state = std::ptr::NonNull::new(state);
        state.map(Saved).ok_or_else(|| self.handle.broken(call, "gave no state, though it returned fmi3OK"))
    }

    /// Makes a call that concerns structural parameters.
    fn configure(
        &mut self,
        name: &'static str,
        call: Option<fmi3::EnterConfigurationMode>,
    ) -> Result<(), Error> {
        let Some(call) = call else {
            return Err(self.handle.broken(name, "is not exported, so structural parameters cannot be set"));
        };
        self.handle.entering(name);
        // SAFETY: the instance lives.
        let status = unsafe { call(self.handle.component()) };
        self.handle.check(name, status)
    }
}

/// Reads or writes by type, through a buffer of that type.
macro_rules! by_type {
    ($through:ident $self:ident $of:ident $references:ident $values:ident;
        $($variant:pat => $function:ident $name:literal $buffer:ident;)*) => {
        match $of {
            $($variant => {
                $through!($self.$function $name $of ($buffer) $references $values $values.len())
            })*
            _ => Err($self.handle.has_no($of, "read or written")),
        }
    };
}

impl Participant for Instance {
    fn name(&self) -> &str {
        self.handle.name()
    }

    fn reset(&mut self) -> Result<(), Error> {
        self.handle.time = None;
        (self.asks_to_end, self.off) = (false, None);
        self.handle.entering("fmi3Reset");
        // SAFETY: the instance lives.
        let status = unsafe { (self.functions.reset)(self.handle.component()) };
        self.handle.check("fmi3Reset", status)
    }

    fn enter_configuration_mode(&mut self) -> Result<(), Error> {
        self.configure("fmi3EnterConfigurationMode", self.functions.enter_configuration_mode)
    }

    fn exit_configuration_mode(&mut self) -> Result<(), Error> {
        self.configure("fmi3ExitConfigurationMode", self.functions.exit_configuration_mode)
    }

    /// Stores the numbers until the initialisation begins.
    fn setup_experiment(
        &mut self,
        start_time: f64,
        stop_time: f64,
        tolerance: Option<f64>,
    ) -> Result<(), Error> {
        self.handle.time = Some(start_time);
        self.experiment = (start_time, stop_time, tolerance);
        Ok(())
    }

    fn enter_initialization_mode(&mut self) -> Result<(), Error> {
        self.handle.entering("fmi3EnterInitializationMode");
        let (call, component) = (self.functions.enter_initialization_mode, self.handle.component());
        let (start, stop, tolerance) = self.experiment;
        let (defined, tolerance) = tolerance.map_or((FALSE, 0.0), |tolerance| (TRUE, tolerance));
        // SAFETY: the instance lives; the arguments are plain numbers.
        let status = unsafe { call(component, defined, tolerance, start, TRUE, stop) };
        self.handle.check("fmi3EnterInitializationMode", status)
    }

    plain_calls! {
        exit_initialization_mode "fmi3ExitInitializationMode";
        terminate "fmi3Terminate";
    }

    /// `fmi3DoStep`, without the option of going back to before `time`. A need for event mode or early return
    /// is an error, since the FMU was told that neither is available.
    fn do_step(&mut self, time: f64, step: f64) -> Result<(), Error> {
        self.handle.time = Some(time);
        self.handle.entering("fmi3DoStep");
        let (call, component) = (self.functions.do_step, self.handle.component());
        let (mut event, mut end, mut early) = (FALSE, FALSE, FALSE);
        let mut reached = time + step;
        let for_ever = if self.may_go_back { FALSE } else { TRUE };
        let (event_to, end_to) = (&raw mut event, &raw mut end);
        let (early_to, reached_to) = (&raw mut early, &raw mut reached);
        // SAFETY: the instance lives; the last four arguments can be written.
        let status = unsafe { call(component, time, step, for_ever, event_to, end_to, early_to, reached_to) };
        self.handle.check_step("fmi3DoStep", status, time + step)?;
        self.asks_to_end = end != FALSE;
        if early != FALSE {
            let reached = brief_time(reached);
            let how = format!("came back early, at t = {reached} s, although early return was not allowed");
            return Err(self.handle.broken("fmi3DoStep", how));
        }
        if event != FALSE {
            let how =
                "asked for event mode, although it was told to handle events itself (eventModeUsed is false)";
            return Err(self.handle.broken("fmi3DoStep", how));
        }
        let asked = time + step;
        let is_on_time = (reached - asked).abs() <= ON_TIME * step;
        if self.off.is_none() && !is_on_time {
            self.off = Some((asked, reached));
        }
        Ok(())
    }

    fn asks_to_end(&self) -> bool {
        self.asks_to_end
    }

    fn get(&mut self, of: DataType, references: &[u32], values: &mut [f64]) -> Result<(), Error> {
        if references.is_empty() {
            return Ok(());
        }
        if of == DataType::Float64 {
            self.handle.entering("fmi3GetFloat64");
            let (call, component) = (self.functions.get_float64, self.handle.component());
            let (first, count) = (references.as_ptr(), references.len());
            let (data, total) = (values.as_mut_ptr(), values.len());
            // SAFETY: the instance lives; both addresses are valid for the given numbers of elements.
            let status = unsafe { call(component, first, count, data, total) };
            return self.handle.check("fmi3GetFloat64", status);
        }
        by_type! { get_through self of references values;
            DataType::Float32 => get_float32 "fmi3GetFloat32" float32;
            DataType::Int8 => get_int8 "fmi3GetInt8" int8;
            DataType::UInt8 => get_uint8 "fmi3GetUInt8" uint8;
            DataType::Int16 => get_int16 "fmi3GetInt16" int16;
            DataType::UInt16 => get_uint16 "fmi3GetUInt16" uint16;
            DataType::Int32 => get_int32 "fmi3GetInt32" int32;
            DataType::UInt32 => get_uint32 "fmi3GetUInt32" uint32;
            DataType::Int64 | DataType::Enumeration => get_int64 "fmi3GetInt64" int64;
            DataType::UInt64 => get_uint64 "fmi3GetUInt64" uint64;
            DataType::Boolean => get_boolean "fmi3GetBoolean" truths;
        }
    }

    fn set(&mut self, of: DataType, references: &[u32], values: &[f64]) -> Result<(), Error> {
        if references.is_empty() {
            return Ok(());
        }
        if of == DataType::Float64 {
            self.handle.entering("fmi3SetFloat64");
            let (call, component) = (self.functions.set_float64, self.handle.component());
            let (first, count) = (references.as_ptr(), references.len());
            let (data, total) = (values.as_ptr(), values.len());
            // SAFETY: the instance lives; both addresses are readable for the given numbers of elements.
            let status = unsafe { call(component, first, count, data, total) };
            return self.handle.check("fmi3SetFloat64", status);
        }
        by_type! { set_through self of references values;
            DataType::Float32 => set_float32 "fmi3SetFloat32" float32;
            DataType::Int8 => set_int8 "fmi3SetInt8" int8;
            DataType::UInt8 => set_uint8 "fmi3SetUInt8" uint8;
            DataType::Int16 => set_int16 "fmi3SetInt16" int16;
            DataType::UInt16 => set_uint16 "fmi3SetUInt16" uint16;
            DataType::Int32 => set_int32 "fmi3SetInt32" int32;
            DataType::UInt32 => set_uint32 "fmi3SetUInt32" uint32;
            DataType::Int64 | DataType::Enumeration => set_int64 "fmi3SetInt64" int64;
            DataType::UInt64 => set_uint64 "fmi3SetUInt64" uint64;
            DataType::Boolean => set_boolean "fmi3SetBoolean" truths;
        }
    }

    fn set_text(&mut self, reference: u32, texts: &[String]) -> Result<(), Error> {
        let Some(call) = self.functions.set_string else {
            return Err(self.handle.has_no(DataType::String, "written"));
        };
        let count = texts.len();
        let texts = CTexts::new(self.handle.name(), texts)?;
        self.handle.entering("fmi3SetString");
        let component = self.handle.component();
        // SAFETY: the instance lives; one reference and `count` texts are readable, and outlive the call.
        let status = unsafe { call(component, &raw const reference, 1, texts.first(), count) };
        self.handle.check("fmi3SetString", status)
    }

    fn remark(&self) -> Option<String> {
        let off = self.off.map(|(asked, reached)| {
            let (asked, reached) = (brief_time(asked), brief_time(reached));
            format!("its step to t = {asked} s reached t = {reached} s (lastSuccessfulTime), and others after it may too")
        });
        off.or_else(|| remark(self.handle.warnings(), "fmi3Warning", self.handle.log()))
    }
}

impl Slave for Instance {
    fn version(&self) -> Version {
        Version::Fmi3
    }

    fn warnings(&self) -> u64 {
        self.handle.warnings()
    }

    fn log(&self) -> Vec<LogMessage> {
        self.handle.log()
    }

    fn log_fault(&self) -> Option<String> {
        self.handle.log_fault()
    }

    fn get_text(&mut self, reference: u32, count: usize) -> Result<Option<Vec<Option<String>>>, Error> {
        let Some(call) = self.functions.get_string else { return Ok(None) };
        self.handle.entering("fmi3GetString");
        let mut texts = vec![std::ptr::null(); count];
        let (component, first) = (self.handle.component(), texts.as_mut_ptr());
        // SAFETY: the instance lives; one reference can be read and `count` addresses written.
        let status = unsafe { call(component, &raw const reference, 1, first, count) };
        self.handle.check("fmi3GetString", status)?;
        self.handle.texts("fmi3GetString", &texts).map(Some)
    }

    fn may_go_back(&mut self, may: bool) {
        self.may_go_back = may;
    }

    fn save(&mut self) -> Result<Option<Saved>, Error> {
        let Some(call) = self.functions.get_state else { return Ok(None) };
        self.handle.entering("fmi3GetFMUState");
        let mut state = std::ptr::null_mut();
        // SAFETY: the instance lives; the address can be written, and NULL asks for a new state.
        let status = unsafe { call(self.handle.component(), &raw mut state) };
        self.handle.check("fmi3GetFMUState", status)?;
        self.saved("fmi3GetFMUState", state).map(Some)
    }

    fn restore(&mut self, state: &Saved) -> Result<(), Error> {
        let Some(call) = self.functions.set_state else { return Ok(()) };
        self.handle.entering("fmi3SetFMUState");
        // SAFETY: the instance lives, and so does the state until it is released.
        let status = unsafe { call(self.handle.component(), state.0.as_ptr()) };
        self.handle.check("fmi3SetFMUState", status)
    }

    fn release(&mut self, state: Saved) -> Result<(), Error> {
        let Some(call) = self.functions.free_state else { return Ok(()) };
        self.handle.entering("fmi3FreeFMUState");
        let mut state = state.0.as_ptr();
        // SAFETY: the instance lives; the state is not used after this.
        let status = unsafe { call(self.handle.component(), &raw mut state) };
        self.handle.check("fmi3FreeFMUState", status)
    }

    fn to_bytes(&mut self, state: &Saved) -> Result<Option<Vec<u8>>, Error> {
        let Some((size_of, call)) = self.functions.state_size.zip(self.functions.serialize) else {
            return Ok(None);
        };
        self.handle.entering("fmi3SerializedFMUStateSize");
        let mut size = 0;
        // SAFETY: the instance and the state live; the size can be written.
        let status = unsafe { size_of(self.handle.component(), state.0.as_ptr(), &raw mut size) };
        self.handle.check("fmi3SerializedFMUStateSize", status)?;
        if size > MAX_STATE {
            let how = format!("said {size} bytes; allowed are at most {MAX_STATE}");
            return Err(self.handle.broken("fmi3SerializedFMUStateSize", how));
        }
        let mut bytes = vec![0; size];
        self.handle.entering("fmi3SerializeFMUState");
        // SAFETY: the instance and the state live; `size` bytes are writable.
        let status = unsafe { call(self.handle.component(), state.0.as_ptr(), bytes.as_mut_ptr(), size) };
        self.handle.check("fmi3SerializeFMUState", status)?;
        Ok(Some(bytes))
    }

    fn of_bytes(&mut self, bytes: &[u8]) -> Result<Option<Saved>, Error> {
        let Some(call) = self.functions.deserialize else { return Ok(None) };
        self.handle.entering("fmi3DeserializeFMUState");
        let mut state = std::ptr::null_mut();
        let (first, size) = (bytes.as_ptr(), bytes.len());
        // SAFETY: the instance lives; the bytes can be read and the address written.
        let status = unsafe { call(self.handle.component(), first, size, &raw mut state) };
        self.handle.check("fmi3DeserializeFMUState", status)?;
        self.saved("fmi3DeserializeFMUState", state).map(Some)
    }

    fn derivative(
        &mut self,
        adjoint: bool,
        (unknown, known): (u32, u32),
        seed: &[f64],
        derivatives: &mut [f64],
    ) -> Result<bool, Error> {
        let (name, call) = match adjoint {
            true => ("fmi3GetAdjointDerivative", self.functions.adjoint),
            false => ("fmi3GetDirectionalDerivative", self.functions.directional),
        };
        let Some(call) = call else { return Ok(false) };
        self.handle.entering(name);
        let component = self.handle.component();
        let (unknown, known) = (&raw const unknown, &raw const known);
        let (seeds, given, to, wanted) =
            (seed.as_ptr(), seed.len(), derivatives.as_mut_ptr(), derivatives.len());
        // SAFETY: the instance lives; all addresses are valid for the given numbers of elements.
        let status = unsafe { call(component, unknown, 1, known, 1, seeds, given, to, wanted) };
        self.handle.check(name, status)?;
        Ok(true)
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if self.handle.may_be_freed() {
            self.handle.entering("fmi3FreeInstance");
            // SAFETY: the instance lives and is not used after this.
            unsafe { (self.functions.free_instance)(self.handle.component()) }
        }
    }
}
