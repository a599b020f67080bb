//! Sends messages to the importer's logger.

use std::ffi::{CStr, CString, c_void};

use super::{fmi2, fmi3};

use crate::product::LOG_CATEGORIES;

/// The category of failed calls.
const ERRORS: &CStr = c"logStatusError";

/// The category of everything else.
const EVENTS: &CStr = c"logEvents";

/// The category of notices to the user although the call succeeded.
const WARNINGS: &CStr = c"logStatusWarning";

/// The importer's function that receives messages, as its version of FMI declares it.
enum Function {
    Fmi2 { logger: fmi2::Logger, instance_name: CString },
    Fmi3(unsafe extern "C" fn(fmi3::Environment, fmi3::Status, fmi3::Text, fmi3::Text)),
}

/// The logger of one instance, copied from what the importer passed.
pub(super) struct Logger {
    function: Option<Function>,
    environment: *mut c_void,
    /// Whether events are enabled (`loggingOn` and the categories). Errors are always logged.
    events: bool,
    /// Whether warnings are enabled. FMI 3.0 forbids warnings that were not requested, FMI 2.0 does not.
    warnings: bool,
}

// SAFETY: the environment pointer is only passed back to the importer's own function, within calls that the
// importer makes; FMI allows these from any one thread at a time.
unsafe impl Send for Logger {}

/// The kind of a message, which determines its status and category.
#[derive(Clone, Copy)]
enum MessageKind {
    Error,
    Warning,
    Event,
    /// A call was not done, but the run may continue.
    Discarded,
}

impl Logger {
    /// The logger passed to `fmi2Instantiate`.
    pub(super) fn of_fmi2(
        callbacks: Option<&fmi2::CallbackFunctions>,
        instance_name: CString,
        events: bool,
    ) -> Self {
        let logger = callbacks.and_then(|c| c.logger);
        Self {
            function: logger.map(|logger| Function::Fmi2 { logger, instance_name }),
            environment: callbacks.map_or(std::ptr::null_mut(), |c| c.environment),
            events,
            warnings: true,
        }
    }

    /// The logger passed to an instantiating function of FMI 3.0.
    pub(super) fn of_fmi3(function: fmi3::LogMessage, environment: fmi3::Environment, on: bool) -> Self {
        Self { function: function.map(Function::Fmi3), environment, events: on, warnings: on }
    }

    /// Logs a failed call.
    pub(super) fn error(&self, message: &str) {
        self.send(MessageKind::Error, message);
    }

    /// Logs a notice to the user.
    pub(super) fn warning(&self, message: &str) {
        if self.warnings {
            self.send(MessageKind::Warning, message);
        }
    }

    /// Logs why a call was not done although the run may continue.
    pub(super) fn discarded(&self, message: &str) {
        if self.warnings {
            self.send(MessageKind::Discarded, message);
        }
    }

    /// Logs an event, if events are enabled.
    pub(super) fn event(&self, message: &str) {
        if self.events {
            self.send(MessageKind::Event, message);
        }
    }

    /// Enables or disables categories; none named means all.
    pub(super) fn set_debug_logging(&mut self, on: bool, categories: &[&str]) -> Result<(), String> {
        if let Some(unknown) = categories.iter().find(|c| LOG_CATEGORIES.iter().all(|(name, _)| name != *c)) {
            let names = LOG_CATEGORIES.map(|(name, _)| name).join(", ");
            return Err(format!("the log category {unknown:?} is unknown, must be one of {names}"));
        }
        let named = |category: usize| {
            categories.is_empty() || categories.iter().any(|c| *c == LOG_CATEGORIES[category].0)
        };
        if named(1) {
            self.events = on;
        }
        if named(2) && matches!(self.function, Some(Function::Fmi3(_))) {
            self.warnings = on;
        }
        Ok(())
    }

    fn send(&self, kind: MessageKind, message: &str) {
        let category = match kind {
            MessageKind::Error => ERRORS,
            MessageKind::Warning | MessageKind::Discarded => WARNINGS,
            MessageKind::Event => EVENTS,
        }
        .as_ptr();
        // Statuses have the same numbers in both versions.
        let status = match kind {
            MessageKind::Error => fmi3::Status::ERROR,
            MessageKind::Warning => fmi3::Status::WARNING,
            MessageKind::Discarded => fmi3::Status::DISCARD,
            MessageKind::Event => fmi3::Status::OK,
        };
        match &self.function {
            None => {}
            Some(Function::Fmi2 { logger, instance_name }) => {
                let (text, status) = (loggable(message), fmi2::Status(status.0));
                // SAFETY: the importer guarantees that its logger stays callable with its environment while the
                // instance lives; the strings are NUL-terminated and outlive the call; the text has no
                // conversion, so no further argument is read.
                unsafe { logger(self.environment, instance_name.as_ptr(), status, category, text.as_ptr()) };
            }
            Some(Function::Fmi3(function)) => {
                // A single # would begin a value reference.
                let text = loggable(&message.replace('#', "##"));
                // SAFETY: as above; the function has these four arguments.
                unsafe { function(self.environment, status, category, text.as_ptr()) };
            }
        }
    }
}

/// `message` as a C string that reads the same through `printf` and printed raw: without `%` and NUL.
fn loggable(message: &str) -> CString {
    let clean: String = message
        .chars()
        .map(|c| match c {
            '%' | '\0' => '?',
            c => c,
        })
        .collect();
    CString::new(clean).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_has_no_conversion_and_no_end_inside() {
        assert_eq!(loggable("at 50% of %s\0rest").to_str(), Ok("at 50? of ?s?rest"));
    }
}
