//! One instance of FMI 3.0 with its log, used by variable names.

use std::ffi::{CStr, CString, c_int, c_void};
use std::ptr::{null, null_mut};
use std::sync::Mutex;

use punctual_fmu::fmi3::{self, Status};
use punctual_fmu::product::Item;

use crate::api::three::{API, Instance, State, Text};
use crate::api::{ERROR, OK};
use crate::fmu::Fmu;

/// Status, category and message of each call of the logger.
#[derive(Default)]
pub(crate) struct Log(Mutex<Vec<(c_int, String, String)>>);

impl Log {
    pub(crate) fn entries(&self) -> Vec<(c_int, String, String)> {
        self.0.lock().unwrap().clone()
    }

    /// The last message, which must belong to a failed call.
    pub(crate) fn failure(&self) -> String {
        let (status, category, message) = self.entries().pop().expect("a log message");
        assert_eq!((status, category.as_str()), (ERROR, "logStatusError"), "{message}");
        message
    }

    pub(crate) fn environment(&self) -> *mut c_void {
        std::ptr::from_ref(self).cast_mut().cast()
    }
}

pub(crate) unsafe extern "C" fn log(environment: *mut c_void, status: Status, category: Text, message: Text) {
    // SAFETY: the environment is a log that outlives the instance.
    let log = unsafe { environment.cast::<Log>().as_ref() }.expect("the environment");
    // SAFETY: the library passes NUL-terminated strings.
    let text = |pointer| unsafe { CStr::from_ptr(pointer) }.to_str().expect("UTF-8").to_owned();
    let (category, message) = (text(category), text(message));
    assert!(!message.contains('%') && !message.is_empty(), "{message:?}");
    log.0.lock().unwrap().push((status.0, category, message));
}

/// An instance; freed when dropped, in any mode.
pub(crate) struct Slave<'a> {
    pub(crate) instance: Instance,
    pub(crate) log: Box<Log>,
    pub(crate) fmu: &'a Fmu,
}

impl Drop for Slave<'_> {
    fn drop(&mut self) {
        (API.free_instance)(self.instance);
    }
}

/// The arguments with which an importer instantiates.
#[derive(Clone)]
pub(crate) struct Said {
    pub(crate) token: Option<CString>,
    pub(crate) path: Option<CString>,
    pub(crate) logging: bool,
    pub(crate) events: bool,
    pub(crate) early: bool,
    pub(crate) required: Vec<u32>,
}

impl Said {
    pub(crate) fn of(fmu: &Fmu) -> Self {
        Self {
            token: Some(CString::new(fmu.guid()).unwrap()),
            path: Some(CString::new(fmu.path()).unwrap()),
            logging: false,
            events: false,
            early: false,
            required: Vec::new(),
        }
    }

    /// A new instance for co-simulation, or NULL.
    pub(crate) fn instantiate(&self, log_to: &Log) -> Instance {
        let pointer = |text: &Option<CString>| text.as_ref().map_or(null(), |text| text.as_ptr());
        (API.instantiate_co_simulation)(
            c"slave".as_ptr(),
            pointer(&self.token),
            pointer(&self.path),
            fmi3::FALSE,
            u8::from(self.logging),
            u8::from(self.events),
            u8::from(self.early),
            self.required.as_ptr(),
            self.required.len(),
            log_to.environment(),
            Some(log),
            None,
        )
    }
}

impl<'a> Slave<'a> {
    /// An instance in mode Instantiated.
    pub(crate) fn new(fmu: &'a Fmu) -> Self {
        let log = Box::<Log>::default();
        let instance = Said::of(fmu).instantiate(&log);
        assert!(!instance.is_null(), "{:?}", log.entries());
        Self { instance, log, fmu }
    }

    /// An instance in step mode, at time 0.
    pub(crate) fn ready(fmu: &'a Fmu) -> Self {
        let slave = Self::new(fmu);
        slave.initialize();
        slave
    }

    /// From Instantiated to step mode, at time 0.
    pub(crate) fn initialize(&self) {
        self.ok((API.enter_initialization_mode)(self.instance, 0, 0.0, 0.0, 0, 0.0));
        self.ok((API.exit_initialization_mode)(self.instance));
    }

    pub(crate) fn ok(&self, status: c_int) {
        assert_eq!(status, OK, "{:?}", self.log.entries());
    }

    /// Asserts that a call failed and returns its message.
    pub(crate) fn refused(&self, status: c_int) -> String {
        assert_eq!(status, ERROR, "{:?}", self.log.entries());
        self.log.failure()
    }

    pub(crate) fn set(&self, name: &str, values: &[f64]) -> c_int {
        let reference = self.fmu.item(name).reference();
        (API.set_float64)(self.instance, &raw const reference, 1, values.as_ptr(), values.len())
    }

    /// The numbers of a variable.
    pub(crate) fn get(&self, name: &str) -> Vec<f64> {
        let item = self.fmu.item(name);
        let mut values = vec![f64::NAN; item.scalars.len()];
        let reference = item.reference();
        self.ok((API.get_float64)(self.instance, &raw const reference, 1, values.as_mut_ptr(), values.len()));
        values
    }

    pub(crate) fn set_flag(&self, name: &str, value: bool) {
        let (reference, value) = (self.fmu.item(name).reference(), u8::from(value));
        self.ok((API.set_boolean)(self.instance, &raw const reference, 1, &raw const value, 1));
    }

    /// Sets the first scalars, which are the inputs, through the variables that contain them.
    pub(crate) fn set_inputs(&self, values: &[f64]) {
        let items = self.fmu.product.items.iter().take_while(|item| item.scalars.end <= values.len());
        let references: Vec<u32> = items.map(Item::reference).collect();
        let (references, count) = (references.as_ptr(), references.len());
        self.ok((API.set_float64)(self.instance, references, count, values.as_ptr(), values.len()));
    }

    pub(crate) fn try_step(&self, t: f64, h: f64) -> c_int {
        let (mut flags, mut last) = ([7_u8; 3], f64::NAN);
        let [event, end, early] = &mut flags;
        let status = (API.do_step)(self.instance, t, h, 1, event, end, early, &raw mut last);
        if status == OK {
            assert_eq!((flags, last.is_finite()), ([0; 3], true), "a step to {last}");
        } else {
            assert!(flags == [7; 3] && last.is_nan(), "a failed step wrote {flags:?} and {last}");
        }
        status
    }

    pub(crate) fn step(&self, t: f64, h: f64) {
        self.ok(self.try_step(t, h));
    }

    /// A new state, which the instance frees if nothing else does.
    pub(crate) fn state(&self) -> State {
        let mut state = null_mut();
        self.ok((API.get_state)(self.instance, &raw mut state));
        assert!(!state.is_null());
        state
    }

    /// A state as bytes.
    pub(crate) fn bytes(&self, state: State) -> Vec<u8> {
        let mut size = 0;
        self.ok((API.serialized_state_size)(self.instance, state, &raw mut size));
        let mut bytes = vec![0xff; size];
        self.ok((API.serialize_state)(self.instance, state, bytes.as_mut_ptr(), size));
        bytes
    }

    /// The current state as bytes: everything that the instance remembers.
    pub(crate) fn now(&self) -> Vec<u8> {
        let mut state = self.state();
        let bytes = self.bytes(state);
        self.ok((API.free_state)(self.instance, &raw mut state));
        bytes
    }

    /// The bits of each scalar of the table, in its order, as text.
    pub(crate) fn snapshot(&self) -> Vec<String> {
        use punctual_modeldescription::ScalarType;
        let mut lines = Vec::new();
        let variables = &self.fmu.product.variables;
        for item in self.fmu.product.items.iter().filter(|item| item.scalars.end <= variables.len()) {
            let (reference, first) = (item.reference(), &variables[item.scalars.start]);
            let (c, r) = (self.instance, &raw const reference);
            match first.kind.scalar_type() {
                ScalarType::Real => {
                    let values = self.get(&item.name);
                    lines.extend(values.iter().map(|value| format!("{value:?} = {:x}", value.to_bits())));
                }
                ScalarType::Boolean => {
                    let mut value = 7;
                    self.ok((API.get_boolean)(c, r, 1, &raw mut value, 1));
                    assert!(value < 2, "{} is {value}", item.name);
                    lines.push((value == 1).to_string());
                }
                ScalarType::Enumeration => {
                    let mut value = -7;
                    self.ok((API.get_int64)(c, r, 1, &raw mut value, 1));
                    lines.push(value.to_string());
                }
                _ => {
                    let mut value = -7;
                    self.ok((API.get_int32)(c, r, 1, &raw mut value, 1));
                    lines.push(value.to_string());
                }
            }
        }
        variables.iter().zip(lines).map(|(v, line)| format!("{}: {line}", v.name)).collect()
    }
}
