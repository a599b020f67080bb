//! Log messages of an FMU: the callbacks handed to it when it is instantiated, and the last messages kept for error
//! texts. Knows nothing of calls and their order.
//!
//! What an FMU passes is not trusted. The component environment is looked up among those given out, never followed, and
//! texts are copied by `logger.c`, which survives an address that cannot be read.

use std::cell::Cell;
use std::collections::VecDeque;
use std::ffi::{c_char, c_int, c_void};
use std::sync::{Mutex, MutexGuard, PoisonError};

use punctual_fmu::fmi2::{self, CallbackFunctions, Text};
use punctual_fmu::fmi3;

use super::{LogMessage, Status};

/// Messages kept per instance; older ones are dropped.
const KEPT: usize = 8;

/// Characters kept of a category.
const CATEGORY: usize = 100;

/// Bytes kept of a text, as many as `logger.c` has room for.
const TEXT: usize = 2047;

/// The greatest number of bytes read of a text that is a value.
const LONG_TEXT: usize = 1 << 20;

unsafe extern "C" {
    // Defined in `logger.c`.
    /// A [`fmi2::Logger`].
    fn punctual_host_logger(
        environment: fmi2::Environment,
        instance: Text,
        status: fmi2::Status,
        category: Text,
        message: Text,
        ...
    );
    fn punctual_host_text(from: *const c_char, to: *mut c_char, size: usize) -> isize;
    // Of the C library.
    fn calloc(count: usize, size: usize) -> *mut c_void;
    fn free(pointer: *mut c_void);
}

/// The callbacks of an instance, and its messages. It is never given back to the system, since an FMU may call
/// after its end; the next instance gets it.
struct Desk {
    /// Never changed. Its environment is the address of the desk.
    callbacks: CallbackFunctions,
    // An FMU may log from a thread of its own.
    inbox: Mutex<Inbox>,
}

// SAFETY: the callbacks are read only, and the address in them is followed by nobody.
unsafe impl Sync for Desk {}

#[derive(Default)]
struct Inbox {
    is_taken: bool,
    messages: VecDeque<LogMessage>,
    /// What was wrong with the first message that was not as the standard says.
    fault: Option<String>,
}

/// All desks ever made.
static DESKS: Mutex<Vec<&'static Desk>> = Mutex::new(Vec::new());

thread_local! {
    /// That of the instance that this thread called last.
    static CALLED: Cell<Option<&'static Desk>> = const { Cell::new(None) };
}

fn locked<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Desk {
    /// One that nobody has.
    fn take() -> &'static Self {
        let mut desks = locked(&DESKS);
        for desk in desks.iter().copied() {
            let mut inbox = locked(&desk.inbox);
            if !inbox.is_taken {
                *inbox = Inbox { is_taken: true, ..Inbox::default() };
                return desk;
            }
        }
        let desk = Box::leak(Box::new(Self {
            callbacks: CallbackFunctions {
                logger: Some(punctual_host_logger),
                allocate_memory: Some(calloc),
                free_memory: Some(free),
                step_finished: None,
                environment: std::ptr::null_mut(),
            },
            inbox: Mutex::new(Inbox { is_taken: true, ..Inbox::default() }),
        }));
        desk.callbacks.environment = std::ptr::from_mut(desk).cast();
        desks.push(desk);
        desk
    }

    /// That of a message: the one that the FMU names, else that of the instance called, else the only one there is. With it
    /// what is wrong with the environment.
    fn of(environment: *const c_void) -> Option<(&'static Self, Option<String>)> {
        let called = CALLED.get().filter(|desk| locked(&desk.inbox).is_taken);
        let desks = locked(&DESKS);
        let mut taken = desks.iter().copied().filter(|desk| locked(&desk.inbox).is_taken);
        let named = taken.clone().find(|desk| std::ptr::eq(desk.callbacks.environment, environment));
        match (named, called) {
            (Some(named), Some(called)) if !std::ptr::eq(named, called) => {
                Some((named, Some("the component environment was that of another instance".to_owned())))
            }
            (Some(named), _) => Some((named, None)),
            (None, called) => {
                let only = taken.next().filter(|_| taken.next().is_none());
                let what = if environment.is_null() { "NULL" } else { "not the one given" };
                called.or(only).map(|desk| (desk, Some(format!("the component environment was {what}"))))
            }
        }
    }
}

/// The callbacks of one instance and the messages it sent. Must outlive the instance.
pub(super) struct Logging {
    desk: &'static Desk,
    /// Whether the desk stays taken.
    leaks: Cell<bool>,
}

impl Logging {
    pub(super) fn new() -> Self {
        Self { desk: Desk::take(), leaks: Cell::new(false) }
    }

    /// The address for `fmi2Instantiate`, valid for ever.
    pub(super) fn callbacks(&self) -> *const CallbackFunctions {
        &raw const self.desk.callbacks
    }

    /// The environment and the callback for `fmi3InstantiateCoSimulation`.
    pub(super) fn plain(&self) -> (fmi3::Environment, fmi3::LogMessage) {
        (self.desk.callbacks.environment, Some(take))
    }

    /// Says that the instance is called next. A message that does not tell whose it is will be this one's.
    #[inline]
    pub(super) fn call(&self) {
        CALLED.set(Some(self.desk));
    }

    /// Keeps the callbacks for an FMU that may still use them.
    pub(super) fn leak(&self) {
        self.leaks.set(true);
    }

    /// The messages kept, oldest first.
    pub(super) fn messages(&self) -> Vec<LogMessage> {
        locked(&self.desk.inbox).messages.iter().cloned().collect()
    }

    /// What was wrong with the first message that was not as the standard says.
    pub(super) fn fault(&self) -> Option<String> {
        locked(&self.desk.inbox).fault.clone()
    }
}

impl Drop for Logging {
    fn drop(&mut self) {
        if !self.leaks.get() {
            locked(&self.desk.inbox).is_taken = false;
        }
    }
}

/// Called by `logger.c` with finished text.
///
/// # Safety
///
/// `text` is NULL or ends in a zero byte. All else may be anything.
#[unsafe(no_mangle)]
unsafe extern "C" fn punctual_host_receive(
    environment: *const c_void,
    status: c_int,
    category: Text,
    text: Text,
) {
    keep(environment, fmi2::Status(status).into(), category, text);
}

/// The `fmi3LogMessageCallback`.
///
/// # Safety
///
/// None: the arguments may be anything.
unsafe extern "C" fn take(
    environment: fmi3::Environment,
    status: fmi3::Status,
    category: fmi3::Text,
    text: fmi3::Text,
) {
    keep(environment, status.into(), category, text);
}

/// Keeps a message, and drops the oldest where there are too many. One that is nobody's is dropped.
fn keep(environment: *const c_void, status: Status, category: Text, text: Text) {
    let Some((desk, mut fault)) = Desk::of(environment) else { return };
    let category = copied(category, TEXT);
    let text = copied(text, TEXT);
    for (what, copied) in [("category", &category), ("message", &text)] {
        if let Copied::Lost = copied {
            fault.get_or_insert_with(|| format!("the {what} was at an address that cannot be read"));
        }
    }
    if !status.is_known() {
        fault.get_or_insert_with(|| format!("the status was none of the standard's: {status}"));
    }
    let category = category.text().unwrap_or_default();
    let text = text.text().unwrap_or_default();
    let mut inbox = locked(&desk.inbox);
    if inbox.messages.len() == KEPT {
        inbox.messages.pop_front();
    }
    inbox.messages.push_back(LogMessage {
        status,
        category: printable(&category).chars().take(CATEGORY).collect(),
        text: printable(text.trim_end()),
    });
    inbox.fault = inbox.fault.take().or(fault);
}

/// The text without control characters, which could control a terminal; line breaks and tabs stay.
fn printable(text: &str) -> String {
    let harmless = |c: char| !c.is_control() || c == '\n' || c == '\t';
    text.chars().map(|c| if harmless(c) { c } else { char::REPLACEMENT_CHARACTER }).collect()
}

/// A text at an address that an FMU gave.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Copied {
    /// Its text, invalid UTF-8 replaced.
    Text(String),
    /// NULL.
    Null,
    /// An address that cannot be read.
    Lost,
}

impl Copied {
    /// The text, or what is wrong with the address.
    pub(super) fn text(self) -> Result<String, &'static str> {
        match self {
            Self::Text(text) => Ok(text),
            Self::Null => Err("NULL"),
            Self::Lost => Err("an address that cannot be read"),
        }
    }
}

/// A copy of a C text that is a value of an FMU, cut after a mebibyte.
pub(super) fn value(text: *const c_char) -> Copied {
    copied(text, LONG_TEXT)
}

/// A copy of a C text, cut after `most` bytes. `text` may be any address.
fn copied(text: *const c_char, most: usize) -> Copied {
    if text.is_null() {
        return Copied::Null;
    }
    let mut bytes: Vec<u8> = Vec::new();
    loop {
        let mut part = [0_u8; TEXT + 1];
        let from = text.wrapping_add(bytes.len());
        // SAFETY: `part` can be written; the other address may be anything.
        let length = unsafe { punctual_host_text(from, part.as_mut_ptr().cast(), part.len()) };
        let Ok(length) = usize::try_from(length) else { break };
        bytes.extend_from_slice(&part[..length]);
        if length < part.len() - 1 || bytes.len() >= most {
            return Copied::Text(whole(&bytes, most));
        }
    }
    if bytes.is_empty() { Copied::Lost } else { Copied::Text(whole(&bytes, most)) }
}

/// At most so many bytes as text, invalid UTF-8 replaced. A character that is cut at the end is left out.
fn whole(bytes: &[u8], most: usize) -> String {
    let mut end = bytes.len().min(most);
    let lead = bytes[..end].iter().rposition(|byte| byte & 0xC0 != 0x80);
    if let Some(lead) = lead.filter(|_| end == most) {
        let width = match bytes[lead] {
            0xF0.. => 4,
            0xE0.. => 3,
            0xC0.. => 2,
            _ => 1,
        };
        end = if end - lead < width { lead } else { end };
    }
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One of two instances, neither of which was called: a message that names neither is nobody's.
    fn one_of_two() -> (Logging, Logging) {
        CALLED.set(None);
        (Logging::new(), Logging::new())
    }

    #[test]
    fn formats_and_tolerates_null_and_strange_statuses() {
        let (logging, _other) = one_of_two();
        let environment = logging.desk.callbacks.environment;
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
        // SAFETY: any environment is allowed.
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
        let environment = logging.desk.callbacks.environment;
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
        let (logging, _other) = one_of_two();
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

    /// Every argument is any address, near ones and far ones, readable or not: a message that gets lost is no harm, a crash is.
    #[test]
    fn any_address_is_survived() {
        let logging = Logging::new();
        let (given, own) = (logging.desk.callbacks.environment.addr(), c"a text".as_ptr().addr());
        let mut state = 20_261_128_u64;
        let mut draw = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let far = (state >> 16) as usize;
            [
                far,
                far << 16,
                far % 65_536,
                given,
                given + far % 64,
                own,
                own + far % 7,
                usize::MAX - far % 9_000,
            ][(state >> 60) as usize % 8]
        };
        for _ in 0..100_000 {
            let [environment, name, category, message] = std::array::from_fn(|_| draw() as *mut c_char);
            // SAFETY: of these arguments nothing is asked.
            unsafe {
                punctual_host_logger(
                    environment.cast(),
                    name,
                    fmi2::Status(draw() as c_int),
                    category,
                    message,
                    draw(),
                );
            }
            // SAFETY: as above.
            unsafe {
                punctual_host_logger(
                    environment.cast(),
                    name,
                    fmi2::Status::OK,
                    category,
                    c"%s %.9s% 5s %d %*.*f %zu %hhx %ls %Lq %".as_ptr(),
                    draw(),
                    draw(),
                    draw(),
                    draw(),
                );
            }
            // SAFETY: as above.
            unsafe { take(environment.cast(), fmi3::Status(draw() as c_int), category, message) };
        }
        assert!(logging.fault().is_some());
    }

    /// Texts of every length around the size of a part and of a page.
    #[test]
    fn texts_are_copied_whole_up_to_their_limit() {
        for length in [1, 2046, 2047, 2048, 4095, 4096, 10_000, LONG_TEXT - 1, LONG_TEXT, LONG_TEXT + 1] {
            for first in ["", "e"] {
                let text = std::ffi::CString::new(format!("{first}{}", "é".repeat(length / 2))).unwrap();
                let Copied::Text(copied) = value(text.as_ptr()) else { panic!("{length}") };
                let given = text.to_str().unwrap();
                let end = (0..=given.len().min(LONG_TEXT)).rev().find(|end| given.is_char_boundary(*end));
                assert!(copied == given[..end.unwrap()], "{length}: {}", copied.len());
            }
        }
        assert_eq!(value(std::ptr::null()), Copied::Null);
        assert_eq!(value(8 as *const c_char), Copied::Lost);
        assert_eq!(value(c"".as_ptr()), Copied::Text(String::new()));
    }

    #[test]
    fn a_message_is_that_of_the_instance_named_or_called() {
        let (one, other) = one_of_two();
        let say = |environment: *mut c_void| {
            // SAFETY: of the environment nothing is asked; the text is a literal.
            unsafe {
                punctual_host_logger(
                    environment,
                    std::ptr::null(),
                    fmi2::Status::OK,
                    std::ptr::null(),
                    c"x".as_ptr(),
                );
            }
        };
        let counts = || (one.messages().len(), other.messages().len());
        other.call();
        say(other.desk.callbacks.environment);
        assert_eq!((counts(), other.fault()), ((0, 1), None));
        say(std::ptr::without_provenance_mut(1));
        assert_eq!(counts(), (0, 2));
        assert!(other.fault().is_some_and(|fault| fault.ends_with("was not the one given")));
        say(one.desk.callbacks.environment);
        assert_eq!(counts(), (1, 2));
        assert!(one.fault().is_some_and(|fault| fault.ends_with("was that of another instance")));
        // The desk of an instance that has gone is called in vain, until another has it.
        let gone = one.desk.callbacks.environment;
        drop(one);
        say(gone);
        assert_eq!(other.messages().len(), 3);
    }
}
