//! An instance that checks its log.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_int, c_void};
use std::ptr::null_mut;

use punctual_fmu::fmi2;
use punctual_fmu::instance::Mode;
use punctual_modeldescription::{BaseType, Causality};

use crate::api::{API, Component, ERROR, OK, State, Text, callbacks};
use crate::fmu::Fmu;

/// The status of a message that is a notice. No function returns it.
const WARNING: c_int = fmi2::Status::WARNING.0;

/// Observations of the logger.
#[derive(Default)]
pub(crate) struct Log {
    /// Messages of failed calls since the last check, and the last of them.
    errors: usize,
    last: String,
    /// A message that violates the rules for messages.
    wrong: Option<String>,
}

extern "C" fn log(environment: *mut c_void, name: Text, status: c_int, category: Text, message: Text) {
    // SAFETY: `Instance::new` gave the address of a log that outlives the instance.
    let log = unsafe { environment.cast::<RefCell<Log>>().as_ref() }.expect("the environment");
    let [name, category, message] = [name, category, message].map(|text| {
        // SAFETY: the library passes NULL or NUL-terminated strings.
        (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned())
    });
    let mut log = log.borrow_mut();
    let error = status == ERROR && category.as_deref() == Some("logStatusError");
    let event = status == OK && category.as_deref() == Some("logEvents");
    let warning = status == WARNING && category.as_deref() == Some("logStatusWarning");
    let text = message.as_deref().unwrap_or_default();
    let sound = name.is_some() && (error || event || warning) && !text.is_empty() && !text.contains('%');
    if !sound || text.contains("internal error") || (error && !text.starts_with("fmi2")) {
        log.wrong = Some(format!("{name:?} {status} {category:?} {message:?}"));
    }
    log.errors += usize::from(error);
    log.last = text.to_owned();
}

/// An instance with its log and its expected mode.
pub(crate) struct Instance {
    pub(crate) fmu: &'static Fmu,
    pub(crate) component: Component,
    pub(crate) mode: Mode,
    log: Box<RefCell<Log>>,
}

impl Drop for Instance {
    fn drop(&mut self) {
        (API.free_instance)(self.component);
    }
}

impl Instance {
    pub(crate) fn new(fmu: &'static Fmu) -> Self {
        let log = Box::<RefCell<Log>>::default();
        let callbacks = callbacks(self::log, std::ptr::from_ref(&*log).cast_mut().cast());
        let (guid, location) = (CString::new(fmu.guid()).unwrap(), CString::new(fmu.location()).unwrap());
        let (name, guid, location) = (c"attacked".as_ptr(), guid.as_ptr(), location.as_ptr());
        let component = (API.instantiate)(name, 1, guid, location, &raw const callbacks, 0, 0);
        assert!(!component.is_null(), "{}", log.borrow().last);
        Self { fmu, component, mode: Mode::INSTANTIATED, log }
    }

    /// Judges the answer of a call: a known status, and a message if and only if it failed. Returns whether
    /// the call succeeded.
    #[track_caller]
    pub(crate) fn answered(&self, call: &str, status: c_int) -> bool {
        let mut log = self.log.borrow_mut();
        assert!(log.wrong.is_none(), "{call}: {:?}", log.wrong);
        assert!(status == OK || status == ERROR, "{call} answers {status}");
        let errors = std::mem::take(&mut log.errors);
        assert_eq!(errors, usize::from(status == ERROR), "{call} answers {status}, last: {}", log.last);
        status == OK
    }

    /// [`Self::answered`] for a call that must succeed.
    #[track_caller]
    pub(crate) fn ok(&self, call: &str, status: c_int) {
        let done = self.answered(call, status);
        assert!(done, "{call}: {}", self.log.borrow().last);
    }

    /// The current state as bytes: everything that the instance remembers.
    pub(crate) fn now(&self) -> Vec<u8> {
        let mut state = null_mut();
        self.ok("get_state", (API.get_state)(self.component, &raw mut state));
        let bytes = self.bytes(state);
        self.ok("free_state", (API.free_state)(self.component, &raw mut state));
        bytes
    }

    pub(crate) fn bytes(&self, state: State) -> Vec<u8> {
        let mut size = 0;
        self.ok("serialized_size", (API.serialized_size)(self.component, state, &raw mut size));
        let mut bytes = vec![0xff; size];
        self.ok("serialize", (API.serialize)(self.component, state, bytes.as_mut_ptr().cast(), size));
        bytes
    }

    /// `fmi2LastSuccessfulTime`.
    pub(crate) fn time(&self) -> f64 {
        let mut value = f64::NAN;
        self.ok("get_real_status", (API.get_real_status)(self.component, 2, &raw mut value));
        value
    }

    pub(crate) fn reset(&mut self) {
        self.ok("reset", (API.reset)(self.component));
        self.mode = Mode::INSTANTIATED;
    }

    /// The reals of this causality whose names begin with `prefix`.
    pub(crate) fn reals(&self, causality: Causality, prefix: &str) -> Vec<f64> {
        let references = self.references(causality, prefix);
        let mut values = vec![f64::NAN; references.len()];
        let (references, len) = (references.as_ptr(), references.len());
        self.ok("get_real", (API.get_real)(self.component, references, len, values.as_mut_ptr()));
        values
    }

    /// The value references of these reals.
    pub(crate) fn references(&self, causality: Causality, prefix: &str) -> Vec<u32> {
        let variables = self.fmu.product.variables.iter();
        let real = variables.filter(|v| v.kind.base_type() == BaseType::Real && v.causality == causality);
        real.filter(|v| v.name.starts_with(prefix)).map(|v| v.value_reference).collect()
    }

    pub(crate) fn integer(&self, name: &str) -> c_int {
        let (reference, mut value) = (self.fmu.reference(name), -1);
        self.ok("get_integer", (API.get_integer)(self.component, &raw const reference, 1, &raw mut value));
        value
    }
}
