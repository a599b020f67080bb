//! One instance with its log, used by variable names.

use std::ffi::{CStr, CString, c_int, c_void};
use std::sync::Mutex;

use punctual_core::filter::Filter;
use punctual_modeldescription::BaseType;

use crate::api::{API, Api, Callbacks, Component, ERROR, OK, State, Text, callbacks};
use crate::fmu::Fmu;

/// One call of the logger.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Entry {
    pub(crate) instance: String,
    pub(crate) status: c_int,
    pub(crate) category: String,
    pub(crate) message: String,
}

/// The messages that the logger of one instance received; its address is the component environment.
#[derive(Default)]
pub(crate) struct Log(Mutex<Vec<Entry>>);

impl Log {
    pub(crate) fn entries(&self) -> Vec<Entry> {
        self.0.lock().unwrap().clone()
    }

    /// Every message, in order.
    pub(crate) fn messages(&self) -> Vec<String> {
        self.entries().into_iter().map(|e| e.message).collect()
    }

    /// The last message, which must belong to a failed call.
    pub(crate) fn failure(&self) -> String {
        let last = self.entries().pop().expect("a log message");
        assert_eq!((last.status, last.category.as_str()), (ERROR, "logStatusError"), "{last:?}");
        last.message
    }

    /// Callbacks with this log, and with NULL wherever it is allowed.
    pub(crate) fn callbacks(&self) -> Callbacks {
        callbacks(log, std::ptr::from_ref(self).cast_mut().cast())
    }
}

fn text(pointer: Text) -> String {
    assert!(!pointer.is_null(), "the logger got a NULL string");
    // SAFETY: the library passes NUL-terminated strings.
    unsafe { CStr::from_ptr(pointer) }.to_str().expect("UTF-8").to_owned()
}

extern "C" fn log(environment: *mut c_void, instance: Text, status: c_int, category: Text, message: Text) {
    // SAFETY: `Log::callbacks` gave the address of a log that outlives the instance.
    let log = unsafe { environment.cast::<Log>().as_ref() }.expect("the environment");
    log.0.lock().unwrap().push(Entry {
        instance: text(instance),
        status,
        category: text(category),
        message: text(message),
    });
}

/// An instance; freed when dropped, in any mode.
pub(crate) struct Slave<'a> {
    pub(crate) component: Component,
    pub(crate) log: Box<Log>,
    pub(crate) fmu: &'a Fmu,
    api: &'a Api,
}

// SAFETY: an FMI instance may be used from any thread, by one at a time.
unsafe impl Send for Slave<'_> {}

impl Drop for Slave<'_> {
    fn drop(&mut self) {
        (self.api.free_instance)(self.component);
        if !std::thread::panicking() {
            let messages = self.log.messages();
            assert!(messages.iter().all(|m| !m.contains('%') && !m.is_empty()), "{messages:?}");
        }
    }
}

impl<'a> Slave<'a> {
    /// An instance in mode Instantiated.
    pub(crate) fn new(fmu: &'a Fmu) -> Self {
        Self::from(&API, fmu)
    }

    /// An instance of a separately loaded library.
    pub(crate) fn from(api: &'a Api, fmu: &'a Fmu) -> Self {
        let log = Box::<Log>::default();
        let callbacks = log.callbacks();
        let (guid, location) = (CString::new(fmu.guid()).unwrap(), CString::new(fmu.location()).unwrap());
        let name = c"slave".as_ptr();
        let component =
            (api.instantiate)(name, 1, guid.as_ptr(), location.as_ptr(), &raw const callbacks, 0, 0);
        assert!(!component.is_null(), "{:?}", log.messages());
        Self { component, log, fmu, api }
    }

    /// An instance in step mode, at time 0.
    pub(crate) fn ready(fmu: &'a Fmu) -> Self {
        let slave = Self::new(fmu);
        slave.initialize();
        slave
    }

    /// From Instantiated to step mode, at time 0.
    pub(crate) fn initialize(&self) {
        self.ok((self.api.setup_experiment)(self.component, 0, 0.0, 0.0, 0, 0.0));
        self.ok((self.api.enter_initialization_mode)(self.component));
        self.ok((self.api.exit_initialization_mode)(self.component));
    }

    pub(crate) fn ok(&self, status: c_int) {
        assert_eq!(status, OK, "{:?}", self.log.messages());
    }

    /// Asserts that a call failed and returns its message.
    pub(crate) fn refused(&self, status: c_int) -> String {
        assert_eq!(status, ERROR, "{:?}", self.log.messages());
        self.log.failure()
    }

    pub(crate) fn try_set(&self, name: &str, value: f64) -> c_int {
        let reference = self.fmu.reference(name);
        (self.api.set_real)(self.component, &raw const reference, 1, &raw const value)
    }

    pub(crate) fn set(&self, name: &str, value: f64) {
        self.ok(self.try_set(name, value));
    }

    pub(crate) fn set_flag(&self, name: &str, value: bool) {
        let (reference, value) = (self.fmu.reference(name), c_int::from(value));
        self.ok((self.api.set_boolean)(self.component, &raw const reference, 1, &raw const value));
    }

    /// Sets the first inputs: the state and the reference of a filter, the input of a plant.
    pub(crate) fn set_inputs(&self, values: &[f64]) {
        let references: Vec<u32> = (0..values.len() as u32).collect();
        let (references, len) = (references.as_ptr(), values.len());
        self.ok((self.api.set_real)(self.component, references, len, values.as_ptr()));
    }

    pub(crate) fn real(&self, name: &str) -> f64 {
        let (reference, mut value) = (self.fmu.reference(name), f64::NAN);
        self.ok((self.api.get_real)(self.component, &raw const reference, 1, &raw mut value));
        value
    }

    pub(crate) fn integer(&self, name: &str) -> c_int {
        let (reference, mut value) = (self.fmu.reference(name), -1);
        self.ok((self.api.get_integer)(self.component, &raw const reference, 1, &raw mut value));
        value
    }

    pub(crate) fn flag(&self, name: &str) -> bool {
        let (reference, mut value) = (self.fmu.reference(name), -1);
        self.ok((self.api.get_boolean)(self.component, &raw const reference, 1, &raw mut value));
        assert!(value == 0 || value == 1, "{name} is {value}");
        value == 1
    }

    pub(crate) fn try_step(&self, t: f64, h: f64) -> c_int {
        (self.api.do_step)(self.component, t, h, 1)
    }

    pub(crate) fn step(&self, t: f64, h: f64) {
        self.ok(self.try_step(t, h));
    }

    /// `fmi2LastSuccessfulTime`: the current communication point.
    pub(crate) fn time(&self) -> f64 {
        let mut value = f64::NAN;
        self.ok((self.api.get_real_status)(self.component, 2, &raw mut value));
        value
    }

    /// A new state, which the instance frees if nothing else does.
    pub(crate) fn state(&self) -> State {
        let mut state = std::ptr::null_mut();
        self.ok((self.api.get_state)(self.component, &raw mut state));
        assert!(!state.is_null());
        state
    }

    pub(crate) fn restore(&self, state: State) {
        self.ok((self.api.set_state)(self.component, state));
    }

    /// A state as bytes.
    pub(crate) fn bytes(&self, state: State) -> Vec<u8> {
        let mut size = 0;
        self.ok((self.api.serialized_size)(self.component, state, &raw mut size));
        let mut bytes = vec![0xff; size];
        self.ok((self.api.serialize)(self.component, state, bytes.as_mut_ptr().cast(), size));
        bytes
    }

    /// The current state as bytes: everything that the instance remembers.
    pub(crate) fn now(&self) -> Vec<u8> {
        let mut state = self.state();
        let bytes = self.bytes(state);
        self.ok((self.api.free_state)(self.component, &raw mut state));
        bytes
    }

    /// The answer to bytes that may not be a state, and the state.
    pub(crate) fn try_read(&self, bytes: &[u8]) -> (c_int, State) {
        let mut state = std::ptr::null_mut();
        let status =
            (self.api.deserialize)(self.component, bytes.as_ptr().cast(), bytes.len(), &raw mut state);
        (status, state)
    }

    /// The state in bytes.
    pub(crate) fn read(&self, bytes: &[u8]) -> State {
        let (status, state) = self.try_read(bytes);
        self.ok(status);
        state
    }

    /// Every variable with the bits of its value, as readable text for failed assertions.
    pub(crate) fn snapshot(&self) -> Vec<String> {
        let value = |v: &punctual_modeldescription::Variable| match v.kind.base_type() {
            BaseType::Real => {
                let value = self.real(&v.name);
                format!("{value:?} = {:x}", value.to_bits())
            }
            BaseType::Boolean => self.flag(&v.name).to_string(),
            _ => self.integer(&v.name).to_string(),
        };
        self.fmu.product.variables.iter().map(|v| format!("{}: {}", v.name, value(v))).collect()
    }

    /// The expected [`Self::snapshot`] after a refused step, given the one `before` it. A filter shows the
    /// refusal in `status` (4: `invalid_input`) and `u`; a plant cannot.
    pub(crate) fn after_refusal(before: &[String]) -> Vec<String> {
        let filter = before.iter().any(|line| line.starts_with("status: "));
        let shown = |line: &String| match line.split_once(": ") {
            Some((name, _)) if filter && name.starts_with("u.") => format!("{name}: 0.0 = 0"),
            Some((name @ ("status" | "status_code"), _)) => format!("{name}: 4"),
            _ => line.clone(),
        };
        before.iter().map(shown).collect()
    }

    /// Asserts that every output shows the last sample of `filter` and the input `u`, bit for bit.
    pub(crate) fn shows(&self, filter: &Filter, u: &[f64], when: &str) {
        let report = filter.report();
        for (signal, wanted) in self.fmu.filter().plant.inputs().iter().zip(u) {
            let found = self.real(&format!("u.{}", signal.name));
            assert_eq!(found.to_bits(), wanted.to_bits(), "u.{} {when}: {found} {wanted}", signal.name);
        }
        for name in ["status", "status_code"] {
            assert_eq!(self.integer(name), report.status as c_int, "{name} {when}");
        }
        for (name, b) in filter.barrier_names().zip(&report.barriers) {
            for (field, wanted) in [
                ("h", b.h),
                ("profile", b.profile),
                ("time_left", b.time_left),
                ("slack", b.slack),
                ("margin_used", b.margin),
                ("sampling_loss", b.sampling_loss),
            ] {
                let found = self.real(&format!("{name}.{field}"));
                assert_eq!(found.to_bits(), wanted.to_bits(), "{name}.{field} {when}: {found} {wanted}");
            }
            for (field, wanted) in [("unmet_steps", b.unmet_steps), ("postponed", b.postponed)] {
                let found = self.integer(&format!("{name}.{field}"));
                assert_eq!(i64::from(found), i64::from(wanted), "{name}.{field} {when}");
            }
            for (field, wanted) in [
                ("arrived", b.arrived),
                ("guaranteed", b.guaranteed),
                ("on_course", b.on_course),
                ("deadline_unreachable", b.deadline_unreachable),
                ("deadlocked", b.deadlocked),
            ] {
                assert_eq!(self.flag(&format!("{name}.{field}")), wanted, "{name}.{field} {when}");
            }
            for field in ["phase", "phase_code"] {
                assert_eq!(
                    self.integer(&format!("{name}.{field}")),
                    b.phase as c_int,
                    "{name}.{field} {when}"
                );
            }
        }
    }
}
