//! Log messages of an FMU: the callbacks handed to it when it is instantiated, and the last messages kept for error
//! texts. Knows nothing of calls and their order.

use std::collections::VecDeque;
use std::ffi::{CStr, c_char, c_void};
use std::fmt;
use std::rc::Rc;
use std::sync::{Mutex, PoisonError};

use punctual_fmu::fmi2::{self, CallbackFunctions, Text};
use punctual_fmu::fmi3;

use super::Status;

/// Messages kept per instance; older ones are dropped.
const KEPT: usize = 8;

/// Characters kept of a category.
const CATEGORY: usize = 100;

/// Bytes kept of a text, as many as `logger.c` has room for.
const TEXT: usize = 2047;

/// One message of an FMU.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogMessage {
    /// The status the FMU gave with it.
    pub status: Status,
    /// The log category, empty where the FMU gave none.
    pub category: String,
    /// The finished text, at most 2047 bytes of it.
    pub text: String,
}

impl fmt::Display for LogMessage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{}", self.status)?;
        if !self.category.is_empty() {
            write!(f, ", {}", self.category)?;
        }
        write!(f, "] {}", self.text)
    }
}

type Receive = unsafe extern "C" fn(*const Environment, Text, fmi2::Status, Text, Text);

/// The target of `componentEnvironment`. `logger.c` reads the first member.
#[repr(C)]
pub(super) struct Environment {
    receive: Receive,
    // An FMU may log from a thread of its own.
    messages: Mutex<VecDeque<LogMessage>>,
}

unsafe extern "C" {
    /// Defined in `logger.c`: a [`fmi2::Logger`].
    fn punctual_host_logger(
        environment: fmi2::Environment,
        instance: Text,
        status: fmi2::Status,
        category: Text,
        message: Text,
        ...
    );
    fn calloc(count: usize, size: usize) -> *mut c_void;
    fn free(pointer: *mut c_void);
}

/// The callbacks of one instance and the messages it sent. Must outlive the instance.
pub(super) struct Logging {
    environment: Rc<Environment>,
    callbacks: Rc<CallbackFunctions>,
}

impl Logging {
    pub(super) fn new() -> Self {
        let environment =
            Rc::new(Environment { receive, messages: Mutex::new(VecDeque::with_capacity(KEPT)) });
        let callbacks = Rc::new(CallbackFunctions {
            logger: Some(punctual_host_logger),
            allocate_memory: Some(calloc),
            free_memory: Some(free),
            step_finished: None,
            environment: Rc::as_ptr(&environment).cast_mut().cast(),
        });
        Self { environment, callbacks }
    }

    /// The address for `fmi2Instantiate`; valid and unmoved while `self` lives.
    pub(super) fn callbacks(&self) -> *const CallbackFunctions {
        Rc::as_ptr(&self.callbacks)
    }

    /// The environment and the callback for `fmi3InstantiateCoSimulation`; valid while `self` lives.
    pub(super) fn plain(&self) -> (fmi3::Environment, fmi3::LogMessage) {
        (Rc::as_ptr(&self.environment).cast_mut().cast(), Some(take))
    }

    /// Keeps the callbacks for ever, for an FMU that may still use them.
    pub(super) fn leak(&self) {
        std::mem::forget((Rc::clone(&self.environment), Rc::clone(&self.callbacks)));
    }

    /// The messages kept, oldest first.
    pub(super) fn messages(&self) -> Vec<LogMessage> {
        let messages = self.environment.messages.lock().unwrap_or_else(PoisonError::into_inner);
        messages.iter().cloned().collect()
    }
}

/// Called by `logger.c` with finished text.
///
/// # Safety
///
/// `environment` is one that [`Logging`] made and still holds; every text is NULL or ends in a zero byte.
unsafe extern "C" fn receive(
    environment: *const Environment,
    _instance: Text,
    status: fmi2::Status,
    category: Text,
    text: Text,
) {
    // SAFETY: by contract the environment lives; it is only ever shared.
    let Some(environment) = (unsafe { environment.as_ref() }) else { return };
    // SAFETY: by contract NULL or zero-terminated.
    unsafe { environment.keep(status.into(), category, text) };
}

/// The `fmi3LogMessageCallback`.
///
/// # Safety
///
/// As for [`receive`].
unsafe extern "C" fn take(
    environment: fmi3::Environment,
    status: fmi3::Status,
    category: fmi3::Text,
    text: fmi3::Text,
) {
    // SAFETY: by contract the environment lives; it is only ever shared.
    let Some(environment) = (unsafe { environment.cast::<Environment>().as_ref() }) else { return };
    // SAFETY: by contract NULL or zero-terminated.
    unsafe { environment.keep(status.into(), category, text) };
}

impl Environment {
    /// Keeps a message, and drops the oldest where there are too many.
    ///
    /// # Safety
    ///
    /// Both texts are NULL or end in a zero byte.
    unsafe fn keep(&self, status: Status, category: Text, text: Text) {
        // SAFETY: by contract NULL or zero-terminated.
        let category = unsafe { owned(category) };
        // SAFETY: as above.
        let text = unsafe { owned(text) };
        let end = (0..=TEXT.min(text.len())).rev().find(|end| text.is_char_boundary(*end)).unwrap_or(0);
        let text = &text[..end];
        let mut messages = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        if messages.len() == KEPT {
            messages.pop_front();
        }
        messages.push_back(LogMessage {
            status,
            category: printable(&category).chars().take(CATEGORY).collect(),
            text: printable(text.trim_end()),
        });
    }
}

/// The text without control characters, which could control a terminal; line breaks and tabs stay.
fn printable(text: &str) -> String {
    let harmless = |c: char| !c.is_control() || c == '\n' || c == '\t';
    text.chars().map(|c| if harmless(c) { c } else { char::REPLACEMENT_CHARACTER }).collect()
}

/// A copy of a C text, invalid UTF-8 replaced; empty for NULL.
///
/// # Safety
///
/// `text` is NULL or ends in a zero byte.
pub(super) unsafe fn owned(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: not NULL, zero-terminated by contract.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_and_tolerates_null_and_strange_statuses() {
        let logging = Logging::new();
        let environment: fmi2::Environment = Rc::as_ptr(&logging.environment).cast_mut().cast();
        let null = std::ptr::null();
        let (instance, category, format) = (c"i".as_ptr(), c"logError".as_ptr(), c"%s is %d".as_ptr());
        // SAFETY: the environment lives; texts are literals; arguments match the format.
        unsafe {
            punctual_host_logger(
                environment,
                instance,
                fmi2::Status::ERROR,
                category,
                format,
                c"n".as_ptr(),
                7,
            );
        };
        // SAFETY: as above.
        unsafe { punctual_host_logger(environment, null, fmi2::Status(-5), null, null) };
        // SAFETY: a NULL environment is allowed.
        unsafe { punctual_host_logger(std::ptr::null_mut(), null, fmi2::Status::OK, null, c"lost".as_ptr()) };
        // SAFETY: as above. A conversion that writes is not carried out: nothing is there to write to.
        unsafe {
            punctual_host_logger(environment, instance, fmi2::Status::OK, null, c"100%n %s\x1b[2J".as_ptr());
        };
        let messages = logging.messages();
        assert_eq!(messages.len(), 3);
        assert_eq!(messages[0].to_string(), "[fmi2Error, logError] n is 7");
        assert_eq!(messages[1].to_string(), "[unknown status -5] ");
        assert_eq!(messages[2].to_string(), "[fmi2OK] 100%n %s\u{fffd}[2J");
    }

    #[test]
    fn keeps_the_last_messages_and_bounds_their_length() {
        let logging = Logging::new();
        let environment: fmi2::Environment = Rc::as_ptr(&logging.environment).cast_mut().cast();
        let long = std::ffi::CString::new("x".repeat(10_000)).unwrap();
        for _ in 0..3 * KEPT {
            // SAFETY: the environment lives; the text has no conversion.
            unsafe {
                punctual_host_logger(
                    environment,
                    std::ptr::null(),
                    fmi2::Status::OK,
                    std::ptr::null(),
                    long.as_ptr(),
                );
            };
        }
        assert_eq!(logging.messages().len(), KEPT);
        assert_eq!(logging.messages()[0].text.len(), TEXT);
    }

    #[test]
    fn messages_of_the_other_version_are_kept_alike() {
        let logging = Logging::new();
        let (environment, callback) = logging.plain();
        let (callback, null) = (callback.expect("a callback"), std::ptr::null());
        // SAFETY: the environment lives; texts are literals.
        unsafe {
            callback(environment, fmi3::Status::ERROR, c"logError".as_ptr(), c"100%n\x1b[2J\n".as_ptr());
        };
        // SAFETY: NULL is allowed.
        unsafe { callback(environment, fmi3::Status(9), null, null) };
        // SAFETY: as above.
        unsafe { callback(std::ptr::null_mut(), fmi3::Status::OK, null, c"lost".as_ptr()) };
        let long = std::ffi::CString::new("ü".repeat(TEXT)).unwrap();
        // SAFETY: the environment lives; the text ends in a zero byte.
        unsafe { callback(environment, fmi3::Status::OK, null, long.as_ptr()) };
        let messages = logging.messages();
        assert_eq!(messages.len(), 3);
        assert_eq!(messages[0].to_string(), "[fmi3Error, logError] 100%n\u{fffd}[2J");
        assert_eq!(messages[1].to_string(), "[unknown status 9] ");
        assert_eq!(messages[2].text.len(), TEXT - 1);
    }
}
