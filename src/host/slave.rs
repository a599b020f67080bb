//! One instance of an FMU, as a safe value. Every call is checked, and every failure is told with its name, time,
//! status and the instance's last log messages. No call allocates unless it fails.

use std::ffi::CString;
use std::ptr::NonNull;
use std::rc::Rc;

use punctual_fmu::fmi2::{CO_SIMULATION, Component, FALSE, TRUE};

use super::library::Functions;
use super::logging::{Logging, owned};
use super::{Fmu, LogMessage, Status, journal};
use crate::error::{CallFailure, Error};

/// An instance, freed on drop unless it returned a status after which the standard forbids that: fmi2Fatal;
/// fmi2Pending, since its step may still be running; a number that is no status. Then it and its library are left
/// as they are until the process ends.
pub struct Slave {
    component: NonNull<std::ffi::c_void>,
    name: String,
    // The last time that the FMU got, in seconds; for error texts only.
    time: Option<f64>,
    warnings: u64,
    abandoned: bool,
    // These two outlive the instance, because `drop` frees it before fields go.
    logging: Logging,
    fmu: Rc<Fmu>,
}

impl std::fmt::Debug for Slave {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Slave({} of {})", self.name, self.fmu.path().display())
    }
}

impl Slave {
    /// Makes an instance of `fmu`; the first one loads its library.
    ///
    /// # Errors
    ///
    /// The library cannot be loaded or lacks a function, `name` holds a zero byte, or the FMU
    /// refuses (its log says why).
    pub fn instantiate(fmu: Rc<Fmu>, name: &str) -> Result<Self, Error> {
        fmu.library()?;
        let text = |field: &str, value: &str| {
            CString::new(value).map_err(|_| Error::configuration(field, "must not hold a zero byte"))
        };
        let instance_name = text("instance name", name)?;
        let guid = text("guid", &fmu.description().guid)?;
        let resources = text("resource location", &fmu.resource_location())?;
        let logging = Logging::new();
        let functions = &fmu.library()?.functions;
        journal::entering("fmi2Instantiate", name, fmu.path(), None);
        // SAFETY: the texts live through the call; the callbacks live as long as the instance.
        let component = unsafe {
            (functions.instantiate)(
                instance_name.as_ptr(),
                CO_SIMULATION,
                guid.as_ptr(),
                resources.as_ptr(),
                logging.callbacks(),
                FALSE,
                FALSE,
            )
        };
        let Some(component) = NonNull::new(component) else {
            return Err(Error::call(CallFailure {
                call: "fmi2Instantiate",
                instance: name.to_owned(),
                path: fmu.path().to_owned(),
                time: None,
                status: None,
                log: logging.messages(),
            }));
        };
        Ok(Self { component, name: name.to_owned(), time: None, warnings: 0, abandoned: false, logging, fmu })
    }

    /// The FMU it is an instance of.
    pub fn fmu(&self) -> &Rc<Fmu> {
        &self.fmu
    }

    /// The instance name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of calls that returned `fmi2Warning` (they count as done).
    pub fn warnings(&self) -> u64 {
        self.warnings
    }

    /// Its last log messages, oldest first; at most eight.
    pub fn log(&self) -> Vec<LogMessage> {
        self.logging.messages()
    }

    /// `fmi2SetupExperiment` without a tolerance.
    ///
    /// # Errors
    ///
    /// The FMU returns anything but OK or Warning; so for every call below.
    pub fn setup_experiment(&mut self, start_time: f64, stop_time: f64) -> Result<(), Error> {
        self.time = Some(start_time);
        self.entering("fmi2SetupExperiment");
        let (call, component) = (self.functions().setup_experiment, self.component());
        // SAFETY: the instance lives; the arguments are plain numbers.
        let status = unsafe { call(component, FALSE, 0.0, start_time, TRUE, stop_time) };
        self.check("fmi2SetupExperiment", status)
    }

    /// `fmi2EnterInitializationMode`.
    ///
    /// # Errors
    ///
    /// As above.
    pub fn enter_initialization_mode(&mut self) -> Result<(), Error> {
        self.entering("fmi2EnterInitializationMode");
        let (call, component) = (self.functions().enter_initialization_mode, self.component());
        // SAFETY: the instance lives.
        let status = unsafe { call(component) };
        self.check("fmi2EnterInitializationMode", status)
    }

    /// `fmi2ExitInitializationMode`.
    ///
    /// # Errors
    ///
    /// As above.
    pub fn exit_initialization_mode(&mut self) -> Result<(), Error> {
        self.entering("fmi2ExitInitializationMode");
        let (call, component) = (self.functions().exit_initialization_mode, self.component());
        // SAFETY: the instance lives.
        let status = unsafe { call(component) };
        self.check("fmi2ExitInitializationMode", status)
    }

    /// `fmi2Terminate`.
    ///
    /// # Errors
    ///
    /// As above.
    pub fn terminate(&mut self) -> Result<(), Error> {
        self.entering("fmi2Terminate");
        let (call, component) = (self.functions().terminate, self.component());
        // SAFETY: the instance lives.
        let status = unsafe { call(component) };
        self.check("fmi2Terminate", status)
    }

    /// `fmi2Reset`: back to the state after instantiation.
    ///
    /// # Errors
    ///
    /// As above.
    pub fn reset(&mut self) -> Result<(), Error> {
        self.time = None;
        self.entering("fmi2Reset");
        let (call, component) = (self.functions().reset, self.component());
        // SAFETY: the instance lives.
        let status = unsafe { call(component) };
        self.check("fmi2Reset", status)
    }

    /// `fmi2DoStep` from `time` (s) over `step` (s), with no way back to before `time`.
    ///
    /// # Errors
    ///
    /// As above; Discard and Pending are errors too.
    pub fn do_step(&mut self, time: f64, step: f64) -> Result<(), Error> {
        self.time = Some(time);
        self.entering("fmi2DoStep");
        let (call, component) = (self.functions().do_step, self.component());
        // SAFETY: the instance lives; the arguments are plain numbers.
        let status = unsafe { call(component, time, step, TRUE) };
        self.time = Some(if matches!(status, Status::OK | Status::WARNING) { time + step } else { time });
        self.check("fmi2DoStep", status)
    }

    /// `fmi2GetString` of one variable; `None` where the FMU gives NULL or has no such function.
    ///
    /// # Errors
    ///
    /// As above.
    pub fn get_string(&mut self, reference: u32) -> Result<Option<String>, Error> {
        let Some(call) = self.fmu.library()?.get_string else { return Ok(None) };
        self.entering("fmi2GetString");
        let mut text = std::ptr::null();
        // SAFETY: the instance lives; one reference can be read and one address written.
        let status = unsafe { call(self.component(), &raw const reference, 1, &raw mut text) };
        self.check("fmi2GetString", status)?;
        // SAFETY: the standard has the FMU keep a zero-terminated text until its next call; NULL is allowed for.
        Ok((!text.is_null()).then(|| unsafe { owned(text) }))
    }

    fn functions(&self) -> &Functions {
        // A slave is only made from an FMU whose library is loaded, and it stays loaded.
        &self.fmu.library.get().expect("the library of a living instance is loaded").functions
    }

    fn component(&self) -> Component {
        self.component.as_ptr()
    }

    #[inline]
    fn entering(&self, call: &'static str) {
        journal::entering(call, &self.name, self.fmu.path(), self.time);
    }

    #[inline]
    fn check(&mut self, call: &'static str, status: Status) -> Result<(), Error> {
        if status == Status::OK { Ok(()) } else { self.not_ok(call, status) }
    }

    #[cold]
    fn not_ok(&mut self, call: &'static str, status: Status) -> Result<(), Error> {
        if matches!(status, Status::FATAL | Status::PENDING) || !status.is_known() {
            self.abandoned = true;
            self.fmu.abandoned.set(true);
            self.logging.leak();
        }
        if status == Status::WARNING {
            self.warnings += 1;
            return Ok(());
        }
        Err(self.failure(call, status))
    }

    fn failure(&self, call: &'static str, status: Status) -> Error {
        Error::call(CallFailure {
            call,
            instance: self.name.clone(),
            path: self.fmu.path().to_owned(),
            time: self.time,
            status: Some(status),
            log: self.logging.messages(),
        })
    }

    #[cold]
    fn lengths_differ(&self, call: &str, references: usize, values: usize) -> Error {
        Error::configuration(
            &self.name,
            format!(
                "{call} with {references} value references and {values} values; the numbers must be equal"
            ),
        )
    }
}

macro_rules! access {
    ($($(#[$doc:meta])* $method:ident, $name:literal, [$($slice:tt)+], $pointer:ident;)*) => {
        impl Slave {
            $($(#[$doc])*
            ///
            /// # Errors
            ///
            /// Slices of different length, or the FMU returns anything but OK or Warning. Nothing
            /// is called for empty slices.
            pub fn $method(&mut self, references: &[u32], values: &$($slice)+) -> Result<(), Error> {
                if references.len() != values.len() {
                    return Err(self.lengths_differ($name, references.len(), values.len()));
                }
                if references.is_empty() {
                    return Ok(());
                }
                self.entering($name);
                let (call, component) = (self.functions().$method, self.component());
                let (first, count, data) = (references.as_ptr(), references.len(), values.$pointer());
                // SAFETY: the instance lives; `count` elements can be read or written from both addresses.
                let status = unsafe { call(component, first, count, data) };
                self.check($name, status)
            })*
        }
    };
}

access! {
    /// `fmi2GetReal`.
    get_real, "fmi2GetReal", [mut [f64]], as_mut_ptr;
    /// `fmi2GetInteger`; for enumerations too.
    get_integer, "fmi2GetInteger", [mut [i32]], as_mut_ptr;
    /// `fmi2GetBoolean`; 0 is false, anything else true.
    get_boolean, "fmi2GetBoolean", [mut [i32]], as_mut_ptr;
    /// `fmi2SetReal`.
    set_real, "fmi2SetReal", [[f64]], as_ptr;
    /// `fmi2SetInteger`; for enumerations too.
    set_integer, "fmi2SetInteger", [[i32]], as_ptr;
    /// `fmi2SetBoolean`; 0 is false, 1 is true.
    set_boolean, "fmi2SetBoolean", [[i32]], as_ptr;
}

impl Drop for Slave {
    fn drop(&mut self) {
        // After fmi2Fatal of one instance no other of this FMU may be called either.
        if !self.abandoned && !self.fmu.abandoned.get() {
            self.entering("fmi2FreeInstance");
            let (call, component) = (self.functions().free_instance, self.component());
            // SAFETY: the instance lives and is not used after this.
            unsafe { call(component) }
        }
    }
}
