//! Messages to the importer's logger.

use std::ffi::{CStr, CString};

use super::fmi2::{self, CallbackFunctions, Environment, Status};

use crate::product::LOG_CATEGORIES;

/// The category of failed calls.
const ERRORS: &CStr = c"logStatusError";

/// The category of everything else.
const EVENTS: &CStr = c"logEvents";

/// The category of what the user should know though the call succeeded.
const WARNINGS: &CStr = c"logStatusWarning";

/// The logger of one instance, copied out of the importer's structure.
pub(super) struct Logger {
    function: Option<fmi2::Logger>,
    environment: Environment,
    instance_name: CString,
    /// Whether events are wanted (`loggingOn` and the categories). Errors and warnings are always logged.
    events: bool,
}

// SAFETY: the environment pointer is only handed back to the importer's own function, within calls
// that the importer makes; FMI lets it make them from any one thread at a time.
unsafe impl Send for Logger {}

impl Logger {
    pub(super) fn new(callbacks: Option<&CallbackFunctions>, instance_name: CString, events: bool) -> Self {
        Self {
            function: callbacks.and_then(|c| c.logger),
            environment: callbacks.map_or(std::ptr::null_mut(), |c| c.environment),
            instance_name,
            events,
        }
    }

    /// Logs a failed call.
    pub(super) fn error(&self, message: &str) {
        self.send(Status::ERROR, ERRORS, message);
    }

    /// Logs what the user should know.
    pub(super) fn warning(&self, message: &str) {
        self.send(Status::WARNING, WARNINGS, message);
    }

    /// Logs an event, if events are wanted.
    pub(super) fn event(&self, message: &str) {
        if self.events {
            self.send(Status::OK, EVENTS, message);
        }
    }

    /// Switches categories; none named means all.
    pub(super) fn set_debug_logging(&mut self, on: bool, categories: &[&str]) -> Result<(), String> {
        if let Some(unknown) = categories.iter().find(|c| LOG_CATEGORIES.iter().all(|(name, _)| name != *c)) {
            let names = LOG_CATEGORIES.map(|(name, _)| name).join(", ");
            return Err(format!("the log category {unknown:?} is unknown, must be one of {names}"));
        }
        if categories.is_empty() || categories.iter().any(|c| *c == LOG_CATEGORIES[1].0) {
            self.events = on;
        }
        Ok(())
    }

    fn send(&self, status: Status, category: &CStr, message: &str) {
        let Some(function) = self.function else { return };
        let text = loggable(message);
        let (name, category) = (self.instance_name.as_ptr(), category.as_ptr());
        // SAFETY: the importer guarantees that its logger stays callable with its environment while the
        // instance lives; the strings are NUL-terminated and outlive the call; the text has no
        // conversion, so no further argument is read.
        unsafe { function(self.environment, name, status, category, text.as_ptr()) };
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
