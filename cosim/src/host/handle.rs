//! What instances of both versions share: how a call begins and ends, how its failure is reported, and when
//! an instance must be left alone.

use std::ffi::{CString, c_char, c_void};
use std::ptr::NonNull;
use std::rc::Rc;

use super::logging::{self, Copied, Logging};
use super::number::{DataType, Loss};
use super::{Description, Fmu, LogMessage, Status, journal};
use crate::error::{CallFailure, Error};

/// A live instance. It may be freed unless it returned a status after which the standard forbids it: fatal;
/// pending, since its step may still be running; a number that is no status. In these cases the instance and
/// its library are left alone until the process ends.
pub(super) struct Handle {
    component: NonNull<c_void>,
    name: String,
    /// The last time passed to the FMU, in seconds; only for error texts.
    pub(super) time: Option<f64>,
    warnings: u64,
    abandoned: bool,
    /// For the names of variables in error texts.
    description: Rc<Description>,
    // These two must outlive the instance: `drop` frees it before the fields are dropped.
    logging: Logging,
    fmu: Rc<Fmu>,
}

/// A text for C.
pub(super) fn c_text(field: &str, value: &str) -> Result<CString, Error> {
    CString::new(value).map_err(|_| Error::configuration(field, "must not hold a zero byte"))
}

impl Handle {
    /// Makes an instance with `make`; `call` is the name of the function.
    pub(super) fn instantiate(
        call: &'static str,
        (fmu, description): (Rc<Fmu>, Rc<Description>),
        name: &str,
        make: impl Fn(&Logging, bool) -> *mut c_void,
    ) -> Result<Self, Error> {
        let logging = Logging::new();
        journal::entering(call, name, fmu.path(), None);
        logging.call();
        let mut component = make(&logging, false);
        if component.is_null() && logging.messages().is_empty() {
            // Some FMUs give the reason only if logging is on.
            component = make(&logging, true);
        }
        let Some(component) = NonNull::new(component) else {
            return Err(Error::call(CallFailure {
                call,
                instance: name.to_owned(),
                path: fmu.path().to_owned(),
                time: None,
                status: None,
                fault: None,
                log: logging.messages(),
            }));
        };
        let name = name.to_owned();
        Ok(Self { component, name, time: None, warnings: 0, abandoned: false, description, logging, fmu })
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// Number of calls that returned a warning (they count as successful).
    pub(super) fn warnings(&self) -> u64 {
        self.warnings
    }

    /// Its last log messages, oldest first; at most eight.
    pub(super) fn log(&self) -> Vec<LogMessage> {
        self.logging.messages()
    }

    /// What was wrong with the first call of its log callback that violated the standard.
    pub(super) fn log_fault(&self) -> Option<String> {
        self.logging.fault()
    }

    /// The texts that a call returned; `None` for each that is NULL.
    pub(super) fn texts(
        &self,
        call: &'static str,
        texts: &[*const c_char],
    ) -> Result<Vec<Option<String>>, Error> {
        let text = |address: &*const c_char| match logging::value(*address) {
            Copied::Null => Ok(None),
            copied => copied.text().map(Some).map_err(|what| self.broken(call, format!("gave {what}"))),
        };
        texts.iter().map(text).collect()
    }

    /// The instance as its library knows it.
    pub(super) fn component(&self) -> *mut c_void {
        self.component.as_ptr()
    }

    /// Whether the instance may be freed. After a fatal status of one instance, no other instance of this FMU
    /// may be called either.
    pub(super) fn may_be_freed(&self) -> bool {
        !self.abandoned && !self.fmu.abandoned.get()
    }

    #[inline]
    pub(super) fn entering(&self, call: &'static str) {
        self.logging.call();
        journal::entering(call, &self.name, self.fmu.path(), self.time);
    }

    /// Checks the status at the end of a call.
    #[inline]
    pub(super) fn check(&mut self, call: &'static str, status: impl Into<Status>) -> Result<(), Error> {
        let status = status.into();
        if status.is_ok() { Ok(()) } else { self.not_ok(call, status) }
    }

    /// Checks the status at the end of a step to the time `end` (s).
    #[inline]
    pub(super) fn check_step(
        &mut self,
        call: &'static str,
        status: impl Into<Status>,
        end: f64,
    ) -> Result<(), Error> {
        self.check(call, status)?;
        self.time = Some(end);
        Ok(())
    }

    #[cold]
    fn not_ok(&mut self, call: &'static str, status: Status) -> Result<(), Error> {
        if status.is_last() {
            self.abandoned = true;
            self.fmu.abandoned.set(true);
            self.logging.leak();
        }
        if status.is_warning() {
            self.warnings += 1;
            return Ok(());
        }
        Err(self.failure(call, Some(status), None))
    }

    /// The error of a call that succeeded but violated the standard.
    #[cold]
    pub(super) fn broken(&self, call: &'static str, how: impl Into<String>) -> Error {
        self.failure(call, None, Some(how.into()))
    }

    fn failure(&self, call: &'static str, status: Option<Status>, fault: Option<String>) -> Error {
        Error::call(CallFailure {
            call,
            instance: self.name.clone(),
            path: self.fmu.path().to_owned(),
            time: self.time,
            status,
            fault,
            log: self.logging.messages(),
        })
    }

    /// The error for a number that its type, or a run, cannot represent.
    #[cold]
    pub(super) fn lost(&self, call: &'static str, of: DataType, references: &[u32], loss: &Loss) -> Error {
        let mut element = loss.at;
        let mut variable = None;
        for reference in references {
            let first = self.description.variables.iter().find(|v| v.is(of, *reference));
            let count = first.map_or(1, |first| first.count);
            if element < count {
                let mut all = self.description.variables.iter();
                variable = all.find(|v| v.is(of, *reference) && v.element == element);
                break;
            }
            element -= count;
        }
        let name = variable.map_or("a variable", |variable| &variable.name);
        let (least, greatest) = loss.range;
        self.broken(
            call,
            format!(
                "cannot carry {name} = {}: must be a number of its type, from {least} to {greatest}",
                loss.value
            ),
        )
    }

    /// The error for a call with different numbers of values and value references.
    #[cold]
    pub(super) fn lengths_differ(&self, references: usize, values: usize) -> Error {
        let message = format!("{references} value references and {values} values; the numbers must be equal");
        Error::configuration(&self.name, message)
    }

    /// The error for a type that cannot be read or written this way.
    #[cold]
    pub(super) fn has_no(&self, of: DataType, action: &str) -> Error {
        Error::configuration(&self.name, format!("a variable of type {of:?} cannot be {action} here"))
    }
}

/// Texts for C, and their addresses.
pub(super) struct CTexts {
    _texts: Vec<CString>,
    addresses: Vec<*const c_char>,
}

impl CTexts {
    pub(super) fn new(field: &str, texts: &[String]) -> Result<Self, Error> {
        let texts = texts.iter().map(|text| c_text(field, text)).collect::<Result<Vec<_>, _>>()?;
        // The texts are on the heap, so moving the list does not move them.
        let addresses = texts.iter().map(|text| text.as_ptr()).collect();
        Ok(Self { _texts: texts, addresses })
    }

    /// The address of the first address; valid while `self` lives.
    pub(super) fn first(&self) -> *const *const c_char {
        self.addresses.as_ptr()
    }
}

/// Reads numbers through a buffer of their own type.
macro_rules! get_through {
    ($self:ident.$function:ident $name:literal $of:ident ($buffer:ident) $references:ident $values:ident $($count:expr)?) => {{
        let first = number::room(&mut $self.$buffer, $values.len()).cast();
        $self.handle.entering($name);
        let (call, component) = ($self.functions.$function, $self.handle.component());
        let (references, count) = ($references.as_ptr(), $references.len());
        // SAFETY: the instance lives; both addresses are valid for the given numbers of elements.
        let status = unsafe { call(component, references, count, first $(, $count)?) };
        $self.handle.check($name, status)?;
        number::give(&$self.$buffer, $values)
            .map_err(|loss| $self.handle.lost($name, $of, $references, &loss))
    }};
}
pub(super) use get_through;

/// Writes numbers through a buffer of their own type.
macro_rules! set_through {
    ($self:ident.$function:ident $name:literal $of:ident ($buffer:ident) $references:ident $values:ident $($count:expr)?) => {{
        let first = number::take(&mut $self.$buffer, $values)
            .map_err(|loss| $self.handle.lost($name, $of, $references, &loss))?
            .cast();
        $self.handle.entering($name);
        let (call, component) = ($self.functions.$function, $self.handle.component());
        let (references, count) = ($references.as_ptr(), $references.len());
        // SAFETY: the instance lives; both addresses are readable for the given numbers of elements.
        let status = unsafe { call(component, references, count, first $(, $count)?) };
        $self.handle.check($name, status)
    }};
}
pub(super) use set_through;

/// Calls whose only argument is the instance.
macro_rules! plain_calls {
    ($($method:ident $name:literal;)*) => {$(
        fn $method(&mut self) -> Result<(), Error> {
            self.handle.entering($name);
            // SAFETY: the instance lives.
            let status = unsafe { (self.functions.$method)(self.handle.component()) };
            self.handle.check($name, status)
        }
    )*};
}
pub(super) use plain_calls;
