//! The one error type of co-simulation and of everything built on it. It says what went wrong, with the names
//! and numbers needed to fix it, and gives the exit code.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use punctual_fmu::configuration::ConfigurationError;
use serde::Serialize;

use crate::exit;
use crate::status::{LogMessage, Status};

/// An error that prevents a command from being carried out.
#[derive(Debug)]
pub struct Error(Box<Kind>);

#[derive(Debug)]
enum Kind {
    Configuration { file: Option<PathBuf>, error: ConfigurationError },
    Io { action: &'static str, path: PathBuf, source: io::Error },
    Fmu { component: Option<String>, path: PathBuf, problem: FmuProblem },
    Call(CallFailure),
    Broken { what: String, how: String },
    Plot { path: PathBuf, message: String },
    Interrupted { time: f64 },
}

/// An error as `--json` prints it.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub struct Details {
    /// What is at fault: `usage`, `configuration`, `file`, `fmu`, `call`, `process`, `picture`, or `interrupted`.
    pub kind: &'static str,
    /// The exit code.
    pub code: u8,
    /// The file it is about.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// The component of the system, or the instance that was called.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub component: Option<String>,
    /// The path in the file, or the option.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// What is wrong with it.
    pub message: String,
}

/// Reasons why an `.fmu` file cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FmuProblem {
    /// Not a zip archive, or a damaged one; with the reason.
    Archive(String),
    /// An entry is compressed in a way that importers need not know.
    Compression {
        /// Its name.
        entry: String,
        /// The method, such as `bzip2`.
        method: String,
    },
    /// An entry whose name would place it outside the folder it is unpacked to.
    UnsafeEntry(String),
    /// It cannot be merged with others into one; with the reason.
    Unfit(String),
    /// A size beyond the limit for files of unknown origin.
    Limit {
        /// The quantity, as the beginning of a sentence.
        what: &'static str,
        /// Its value.
        value: u64,
        /// Its unit; empty for a plain number.
        unit: &'static str,
        /// The greatest value allowed.
        allowed: u64,
    },
    /// The model description is missing, of another version, or malformed; with the reason.
    Description(String),
    /// It offers no interface at all.
    NoCoSimulation,
    /// Its model identifier is no file name, so it names no library.
    ModelIdentifier(String),
    /// No shared library for this platform.
    NoBinary {
        /// The folder looked for, such as `linux64`.
        wanted: &'static str,
        /// The folders present.
        present: Vec<String>,
    },
    /// The folder for this platform lacks the library that its model identifier names.
    NoLibrary {
        /// The library.
        wanted: String,
        /// The files in the folder.
        present: Vec<String>,
    },
    /// The shared library cannot be loaded; with the loader's words.
    Load(String),
    /// It needs something that this program does not offer; with the reason.
    CannotRun(String),
    /// The shared library lacks a function that co-simulation needs.
    MissingSymbol(&'static str),
    /// A function that reports the version contradicts the description.
    Version {
        /// The function asked.
        call: &'static str,
        /// Its answer.
        answer: String,
        /// The version given in the description.
        wanted: &'static str,
    },
}

impl fmt::Display for FmuProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Archive(reason) => write!(f, "not a readable FMU archive: {reason}"),
            Self::Compression { entry, method } => {
                write!(f, "the entry {entry:?} is compressed with {method}; must be stored or deflated")
            }
            Self::UnsafeEntry(entry) => {
                write!(f, "refused, because the archive entry {entry:?} points out of the archive")
            }
            Self::Unfit(reason) => write!(f, "cannot be merged: {reason}"),
            Self::Limit { what, value, unit, allowed } => {
                write!(f, "refused: {what} {value}")?;
                if !unit.is_empty() {
                    write!(f, " {unit}")?;
                }
                write!(f, "; allowed are at most {allowed}")
            }
            Self::Description(reason) => write!(f, "modelDescription.xml: {reason}"),
            Self::NoCoSimulation => f.write_str("has no co-simulation interface, nor any other"),
            Self::ModelIdentifier(name) => {
                write!(f, "modelIdentifier is {name:?}, which names no file, so there is no library")
            }
            Self::NoBinary { wanted, present } if present.is_empty() => {
                write!(f, "holds no binary at all, so none for {wanted}")
            }
            Self::NoBinary { wanted, present } => {
                write!(f, "holds no binary for {wanted}, only for {}", present.join(", "))
            }
            Self::NoLibrary { wanted, present } => write!(
                f,
                "holds no {wanted}, the library that its modelIdentifier names; in that folder is {}",
                present.join(", ")
            ),
            Self::Load(reason) => {
                write!(f, "its library cannot be loaded: {reason}")?;
                // Libraries made by pythonfmu do so: the missing symbols are Python's own.
                let takes_python =
                    ["undefined symbol: Py", "undefined symbol: _Py"].iter().any(|s| reason.contains(s));
                match takes_python {
                    true => f.write_str(
                        "; it takes Python from the program that loads it: start this one with \
                         LD_PRELOAD=FOLDER/libpython3.X.so, where `python3 -c \"import sysconfig as s; \
                         print(s.get_config_var('LIBDIR'), s.get_config_var('LDLIBRARY'))\"` tells both",
                    ),
                    false => Ok(()),
                }
            }
            Self::MissingSymbol(name) => write!(f, "its library does not export {name}"),
            Self::Version { call, answer, wanted } => write!(f, "{call} answered {answer:?}, not {wanted}"),
            Self::CannotRun(reason) => write!(f, "cannot be run here: {reason}"),
        }
    }
}

/// An FMI function that did not succeed.
#[derive(Clone, Debug, PartialEq)]
pub struct CallFailure {
    /// The FMI function, such as `fmi2DoStep`.
    pub call: &'static str,
    /// The instance name.
    pub instance: String,
    /// The FMU's file.
    pub path: PathBuf,
    /// The communication point of the call, in seconds; `None` before the experiment is set up.
    pub time: Option<f64>,
    /// The status that it returned; `None` if it returned a null instance, or if the status is not at fault.
    pub status: Option<Status>,
    /// What was wrong although the call succeeded, as the end of a sentence.
    pub fault: Option<String>,
    /// The last log messages of that instance, oldest first.
    pub log: Vec<LogMessage>,
}

impl fmt::Display for CallFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {} ({})", self.call, self.instance, self.path.display())?;
        if let Some(time) = self.time {
            write!(f, " at t = {} s", brief_time(time))?;
        }
        if let Some(fault) = &self.fault {
            write!(f, " {fault}")?;
            return self.log.iter().try_for_each(|message| write!(f, "\n  {message}"));
        }
        match self.status {
            None => f.write_str(" returned no instance")?,
            Some(status) if status.is_discard() => {
                write!(f, " returned {status}: it refuses this step, and steps are not retried")?;
            }
            Some(status) if status.is_pending() => {
                write!(f, " returned {status}: asynchronous steps are not supported")?;
            }
            Some(status) => write!(f, " returned {status}")?,
        }
        if self.log.is_empty() {
            f.write_str("; it logged nothing")?;
        }
        self.log.iter().try_for_each(|message| write!(f, "\n  {message}"))
    }
}

/// A time in seconds without the rounding error of its last digits.
pub(crate) fn brief_time(time: f64) -> f64 {
    let rounded = (time * 1e9).round() / 1e9;
    if rounded.is_finite() { rounded } else { time }
}

impl Error {
    /// A configuration that cannot be used, without the file it came from.
    pub fn configuration(field: impl Into<String>, message: impl Into<String>) -> Self {
        ConfigurationError::new(field, message).into()
    }

    /// A file that cannot be read or written; `action` is the verb, such as `"read"`.
    pub fn io(action: &'static str, path: &Path, source: io::Error) -> Self {
        Self(Box::new(Kind::Io { action, path: path.to_owned(), source }))
    }

    /// An `.fmu` file that cannot be used.
    pub fn fmu(path: &Path, problem: FmuProblem) -> Self {
        Self(Box::new(Kind::Fmu { component: None, path: path.to_owned(), problem }))
    }

    /// An FMI function that did not succeed.
    pub fn call(failure: CallFailure) -> Self {
        Self(Box::new(Kind::Call(failure)))
    }

    /// An FMU that ended its process, `what` it was doing, and `how` it ended.
    pub fn broken(what: impl Into<String>, how: impl Into<String>) -> Self {
        Self(Box::new(Kind::Broken { what: what.into(), how: how.into() }))
    }

    /// The same error, naming the component whose FMU it is about.
    #[must_use]
    pub fn in_component(mut self, name: &str) -> Self {
        if let Kind::Fmu { component, .. } = &mut *self.0 {
            component.get_or_insert_with(|| name.to_owned());
        }
        self
    }

    /// The problem of the `.fmu` file, if the error is about one.
    pub fn as_fmu_problem(&self) -> Option<&FmuProblem> {
        match &*self.0 {
            Kind::Fmu { problem, .. } => Some(problem),
            _ => None,
        }
    }

    /// A picture that cannot be drawn.
    pub fn plot(path: &Path, message: impl Into<String>) -> Self {
        Self(Box::new(Kind::Plot { path: path.to_owned(), message: message.into() }))
    }

    /// A run that was interrupted, at `time` (s).
    pub fn interrupted(time: f64) -> Self {
        Self(Box::new(Kind::Interrupted { time }))
    }

    /// The same error, naming the configuration file it is about.
    #[must_use]
    pub fn in_file(mut self, path: &Path) -> Self {
        if let Kind::Configuration { file, .. } = &mut *self.0 {
            file.get_or_insert_with(|| path.to_owned());
        }
        self
    }

    /// The configuration error inside, if it is one.
    pub fn as_configuration(&self) -> Option<&ConfigurationError> {
        match &*self.0 {
            Kind::Configuration { error, .. } => Some(error),
            _ => None,
        }
    }

    /// The failed FMI call inside, if it is one.
    pub fn as_call(&self) -> Option<&CallFailure> {
        match &*self.0 {
            Kind::Call(failure) => Some(failure),
            _ => None,
        }
    }

    /// The exit code, one of [`exit`]. It says whether an FMU, a configuration or a file is at fault, or the
    /// user pressed Ctrl-C.
    pub fn exit_code(&self) -> u8 {
        match &*self.0 {
            Kind::Fmu { .. } | Kind::Call(_) | Kind::Broken { .. } => exit::FOUND,
            Kind::Configuration { .. } | Kind::Io { .. } | Kind::Plot { .. } => exit::MISUSE,
            Kind::Interrupted { .. } => exit::INTERRUPTED,
        }
    }
}

impl Error {
    /// The error in parts.
    pub fn details(&self) -> Details {
        let shown = |path: &Path| Some(path.display().to_string());
        let (kind, file, component, field, message) = match &*self.0 {
            Kind::Configuration { file, error } => {
                let field = Some(error.field().to_owned()).filter(|field| !field.is_empty());
                let file = file.as_deref().and_then(shown);
                ("configuration", file, None, field, error.message().to_owned())
            }
            Kind::Io { action, path, source } => {
                ("file", shown(path), None, None, format!("cannot {action} it: {source}"))
            }
            Kind::Fmu { component, path, problem } => {
                ("fmu", shown(path), component.clone(), None, problem.to_string())
            }
            Kind::Call(failure) => {
                ("call", shown(&failure.path), Some(failure.instance.clone()), None, failure.to_string())
            }
            Kind::Plot { path, message } => ("picture", shown(path), None, None, message.clone()),
            Kind::Broken { .. } => ("process", None, None, None, self.to_string()),
            Kind::Interrupted { .. } => ("interrupted", None, None, None, self.to_string()),
        };
        Details { kind, code: self.exit_code(), file, component, field, message }
    }
}

impl From<ConfigurationError> for Error {
    fn from(error: ConfigurationError) -> Self {
        Self(Box::new(Kind::Configuration { file: None, error }))
    }
}

/// Misuse of the core, in the terms of the command line.
impl From<punctual_core::Error> for Error {
    fn from(error: punctual_core::Error) -> Self {
        Self::configuration(error.field(), error.message())
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &*self.0 {
            Kind::Configuration { file: Some(file), error } => write!(f, "{}: {error}", file.display()),
            Kind::Configuration { file: None, error } => error.fmt(f),
            Kind::Io { action, path, source } => write!(f, "cannot {action} {}: {source}", path.display()),
            Kind::Fmu { component: Some(component), path, problem } => {
                write!(f, "{component} ({}): {problem}", path.display())
            }
            Kind::Fmu { component: None, path, problem } => write!(f, "{}: {problem}", path.display()),
            Kind::Broken { what, how } => write!(f, "{what} {how}"),
            Kind::Call(failure) => failure.fmt(f),
            Kind::Interrupted { time } => write!(f, "interrupted at t = {} s", brief_time(*time)),
            Kind::Plot { path, message } => write!(f, "cannot draw {}: {message}", path.display()),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match &*self.0 {
            Kind::Configuration { error, .. } => Some(error),
            Kind::Io { source, .. } => Some(source),
            _ => None,
        }
    }
}
