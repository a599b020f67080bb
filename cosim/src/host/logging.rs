//! Log messages of an FMU: the callbacks passed to it at instantiation, and the last messages, kept for error
//! texts. It does not depend on the order of calls.
//!
//! Nothing that an FMU passes is trusted. The component environment is compared with those given out and
//! never dereferenced. Texts are copied by `logger.c`, which survives unreadable addresses.

use std::cell::Cell;
use std::collections::VecDeque;
use std::ffi::{c_char, c_int, c_void};
use std::sync::{Mutex, MutexGuard, PoisonError};

use punctual_fmu::fmi2::{self, CallbackFunctions, Text};
use punctual_fmu::fmi3;

use super::{LogMessage, Status};

/// Messages kept per instance; older ones are dropped.
const KEPT: usize = 8;

/// The most characters kept of a category.
const CATEGORY: usize = 100;

/// The most bytes kept of a text; `logger.c` has room for as many.
const TEXT: usize = 2047;

/// The most bytes read of a text that is a variable's value.
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

/// The callbacks of an instance, and its messages. The memory is never freed, since an FMU may call after its
/// instance is gone; the next instance reuses it.
struct Channel {
    /// Never changed. The environment is the address of this channel.
    callbacks: CallbackFunctions,
    // An FMU may log from a thread of its own.
    inbox: Mutex<Inbox>,
}

// SAFETY: the callbacks are only read, and the address in them is never dereferenced.
unsafe impl Sync for Channel {}

#[derive(Default)]
struct Inbox {
    is_taken: bool,
    messages: VecDeque<LogMessage>,
    /// What was wrong with the first message that violated the standard.
    fault: Option<String>,
}

/// All channels ever made.
static CHANNELS: Mutex<Vec<&'static Channel>> = Mutex::new(Vec::new());

thread_local! {
    /// The channel of the instance that this thread called last.
    static CALLED: Cell<Option<&'static Channel>> = const { Cell::new(None) };
}

fn locked<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Channel {
    /// Takes a channel that is not in use.
    fn take() -> &'static Self {
        let mut channels = locked(&CHANNELS);
        for channel in channels.iter().copied() {
            let mut inbox = locked(&channel.inbox);
            if !inbox.is_taken {
                *inbox = Inbox { is_taken: true, ..Inbox::default() };
                return channel;
            }
        }
        let channel = Box::leak(Box::new(Self {
            callbacks: CallbackFunctions {
                logger: Some(punctual_host_logger),
                allocate_memory: Some(calloc),
                free_memory: Some(free),
                step_finished: None,
                environment: std::ptr::null_mut(),
            },
            inbox: Mutex::new(Inbox { is_taken: true, ..Inbox::default() }),
        }));
        channel.callbacks.environment = std::ptr::from_mut(channel).cast();
        channels.push(channel);
        channel
    }

    /// The channel of a message: the one whose environment the FMU passed, else that of the instance called
    /// last, else the only one in use. Also returns what is wrong with the environment.
    fn of(environment: *const c_void) -> Option<(&'static Self, Option<String>)> {
        let called = CALLED.get().filter(|channel| locked(&channel.inbox).is_taken);
        let channels = locked(&CHANNELS);
        let mut taken = channels.iter().copied().filter(|channel| locked(&channel.inbox).is_taken);
        let named = taken.clone().find(|channel| std::ptr::eq(channel.callbacks.environment, environment));
        match (named, called) {
            (Some(named), Some(called)) if !std::ptr::eq(named, called) => {
                Some((named, Some("the component environment was that of another instance".to_owned())))
            }
            (Some(named), _) => Some((named, None)),
            (None, called) => {
                let only = taken.next().filter(|_| taken.next().is_none());
                let what = if environment.is_null() { "NULL" } else { "not the one given" };
                called
                    .or(only)
                    .map(|channel| (channel, Some(format!("the component environment was {what}"))))
            }
        }
    }
}

/// The callbacks of one instance and the messages it sent. Must outlive the instance.
pub(super) struct Logging {
    channel: &'static Channel,
    /// Whether the channel stays in use after the drop.
    leaks: Cell<bool>,
}

impl Logging {
    pub(super) fn new() -> Self {
        Self { channel: Channel::take(), leaks: Cell::new(false) }
    }

    /// The address for `fmi2Instantiate`, valid forever.
    pub(super) fn callbacks(&self) -> *const CallbackFunctions {
        &raw const self.channel.callbacks
    }

    /// The environment and the callback for `fmi3InstantiateCoSimulation`.
    pub(super) fn plain(&self) -> (fmi3::Environment, fmi3::LogMessage) {
        (self.channel.callbacks.environment, Some(take))
    }

    /// Records that this instance is called next. A message without a valid environment will be attributed to
    /// it.
    #[inline]
    pub(super) fn call(&self) {
        CALLED.set(Some(self.channel));
    }

    /// Keeps the callbacks reserved for an FMU that may still use them.
    pub(super) fn leak(&self) {
        self.leaks.set(true);
    }

    /// The messages kept, oldest first.
    pub(super) fn messages(&self) -> Vec<LogMessage> {
        locked(&self.channel.inbox).messages.iter().cloned().collect()
    }

    /// What was wrong with the first message that violated the standard.
    pub(super) fn fault(&self) -> Option<String> {
        locked(&self.channel.inbox).fault.clone()
    }
}

impl Drop for Logging {
    fn drop(&mut self) {
        if !self.leaks.get() {
            locked(&self.channel.inbox).is_taken = false;
        }
    }
}

/// Called by `logger.c` with a formatted text.
///
/// # Safety
///
/// `text` is NULL or ends in a zero byte. The other arguments may be anything.
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

/// Keeps a message, and drops the oldest one if there are too many. A message without an owner is dropped.
fn keep(environment: *const c_void, status: Status, category: Text, text: Text) {
    let Some((channel, mut fault)) = Channel::of(environment) else { return };
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
    let mut inbox = locked(&channel.inbox);
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

/// The text without control characters, which could manipulate a terminal; line breaks and tabs are kept.
fn printable(text: &str) -> String {
    let harmless = |c: char| !c.is_control() || c == '\n' || c == '\t';
    text.chars().map(|c| if harmless(c) { c } else { char::REPLACEMENT_CHARACTER }).collect()
}

/// A text at an address that an FMU passed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Copied {
    /// The text, with invalid UTF-8 replaced.
    Text(String),
    /// NULL.
    Null,
    /// The address cannot be read.
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

/// Copies a C text that is the value of a variable, truncated to a mebibyte.
pub(super) fn value(text: *const c_char) -> Copied {
    copied(text, LONG_TEXT)
}

/// Copies a C text, truncated to `most` bytes. `text` may be any address.
fn copied(text: *const c_char, most: usize) -> Copied {
    if text.is_null() {
        return Copied::Null;
    }
    let mut bytes: Vec<u8> = Vec::new();
    loop {
        let mut part = [0_u8; TEXT + 1];
        let from = text.wrapping_add(bytes.len());
        // SAFETY: `part` is writable; the other address may be anything.
        let length = unsafe { punctual_host_text(from, part.as_mut_ptr().cast(), part.len()) };
        let Ok(length) = usize::try_from(length) else { break };
        bytes.extend_from_slice(&part[..length]);
        if length < part.len() - 1 || bytes.len() >= most {
            return Copied::Text(whole(&bytes, most));
        }
    }
    if bytes.is_empty() { Copied::Lost } else { Copied::Text(whole(&bytes, most)) }
}

/// At most `most` bytes as text, with invalid UTF-8 replaced. A character cut off at the end is left out.
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

    /// One of two instances, neither of which was called: a message that names neither has no owner.
    fn one_of_two() -> (Logging, Logging) {
        CALLED.set(None);
        (Logging::new(), Logging::new())
    }

    #[test]
    fn formats_and_tolerates_null_and_strange_statuses() {
        let (logging, _other) = one_of_two();
        let environment = logging.channel.callbacks.environment;
        let null = std::ptr::null();
        let (instance, category, format) = (c"i".as_ptr(), c"logError".as_ptr(), c"%s is %d".as_ptr());
        // SAFETY: the environment is live; texts are literals; arguments match the format.
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
        // SAFETY: as above. A conversion that writes is not carried out, since there is nothing to write to.
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
        let environment = logging.channel.callbacks.environment;
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

    /// Every argument takes any address, near or far, readable or not. Losing a message is acceptable, a
    /// crash is not.
    #[test]
    fn any_address_is_survived() {
        let logging = Logging::new();
        let (given, own) = (logging.channel.callbacks.environment.addr(), c"a text".as_ptr().addr());
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
            // SAFETY: the arguments may be anything.
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
            // SAFETY: the environment may be anything; the text is a literal.
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
        say(other.channel.callbacks.environment);
        assert_eq!((counts(), other.fault()), ((0, 1), None));
        say(std::ptr::without_provenance_mut(1));
        assert_eq!(counts(), (0, 2));
        assert!(other.fault().is_some_and(|fault| fault.ends_with("was not the one given")));
        say(one.channel.callbacks.environment);
        assert_eq!(counts(), (1, 2));
        assert!(one.fault().is_some_and(|fault| fault.ends_with("was that of another instance")));
        // Calls on the channel of an instance that is gone have no effect until another instance has it.
        let gone = one.channel.callbacks.environment;
        drop(one);
        say(gone);
        assert_eq!(other.messages().len(), 3);
    }
}
