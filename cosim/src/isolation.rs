//! Runs work with FMUs in a child process. If an FMU crashes, calls `exit()` or hangs, only the child ends,
//! and this process reports the call it was in. The child runs this program again. A journal is all that it
//! leaves behind (see [`crate::host::journal`]).

use std::ffi::OsString;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::error::Error;
use crate::host::crash_at_once;
use crate::host::journal::{self, LastCall};

/// The name of the journal in the child's folder.
const JOURNAL: &str = "journal";
/// Interval at which the running child is polled.
const LOOK: Duration = Duration::from_millis(5);

fn journal_file(folder: &Path) -> PathBuf {
    folder.join(JOURNAL)
}

/// Prepares the child: starts the journal in the folder that the watching process made, and unpacks FMUs
/// below that folder. So nothing is left behind if this process has no time to clean up.
///
/// # Errors
///
/// The folder cannot be written to.
pub fn settle(folder: &Path) -> Result<(), Error> {
    crash_at_once();
    let file = journal_file(folder);
    journal::begin(&file).map_err(|e| Error::io("write", &file, e))?;
    // An error means that a folder was set before; files then go there.
    let _ = tempfile::env::override_temp_dir(folder);
    Ok(())
}

/// What happens to the output of the child.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Voice {
    /// It goes to the output of this process.
    Loud,
    /// It is dropped.
    Silent,
}

/// How a child ended.
#[derive(Clone, Debug, PartialEq)]
pub enum End {
    /// By itself, after it had finished with its FMUs; with its exit code.
    Finished(i32),
    /// While it was still working with an FMU.
    Broken {
        /// How it broke off.
        how: Break,
        /// The last call made; `None` before the first.
        last: Option<LastCall>,
    },
}

/// Ways in which a child can break off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Break {
    /// Terminated by this signal.
    Signal(i32),
    /// Terminated by this exception, on Windows.
    Exception(u32),
    /// Exited with this code, because the FMU ended the process.
    Exit(i32),
    /// Killed because it took too long.
    Late {
        /// The time limit.
        limit: Duration,
        /// How long its last call had lasted.
        call: Duration,
    },
}

impl fmt::Display for Break {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Signal(number) => write!(f, "crashed with signal {number}{}", meaning(*number)),
            Self::Exception(number) => write!(f, "crashed with exception {number:#X}{}", cause(*number)),
            Self::Exit(code) => write!(f, "ended the whole process with exit code {code}"),
            Self::Late { limit, .. } => write!(f, "did not come back within {} s", limit.as_secs_f64()),
        }
    }
}

/// The meaning of a signal that terminates a process, if its number is the same on all systems.
fn meaning(signal: i32) -> &'static str {
    match signal {
        4 => " (illegal instruction)",
        6 => " (aborted)",
        8 => " (arithmetic exception)",
        9 => " (killed)",
        11 => " (invalid memory access)",
        15 => " (terminated)",
        _ => "",
    }
}

/// The meaning of an unhandled exception of Windows.
fn cause(exception: u32) -> &'static str {
    match exception {
        0xC000_0005 => " (invalid memory access)",
        0xC000_001D => " (illegal instruction)",
        0xC000_0094 => " (division by zero)",
        0xC000_00FD => " (stack overflow)",
        0xC000_0374 => " (corrupted heap)",
        0xC000_0409 => " (aborted)",
        0xC000_0135 => " (a library is missing)",
        _ => "",
    }
}

/// How a process with the exit code `code` broke off on Windows, which has no signals. An unhandled exception
/// becomes the exit code; those of the system begin with 0xC.
#[cfg(any(not(unix), test))]
fn coded(code: i32) -> Break {
    let number = code.cast_unsigned();
    if number >> 28 == 0xC { Break::Exception(number) } else { Break::Exit(code) }
}

/// The folder of a child process.
#[derive(Debug)]
pub struct Child {
    folder: TempDir,
}

impl Child {
    /// Makes the folder.
    ///
    /// # Errors
    ///
    /// It cannot be made.
    pub fn new() -> Result<Self, Error> {
        let folder = tempfile::Builder::new().prefix("punctual-child-").tempdir();
        let folder = folder.map_err(|e| Error::io("create a folder in", &std::env::temp_dir(), e))?;
        Ok(Self { folder })
    }

    /// The folder in which the child may leave files.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Runs this program with `arguments` and waits until it ends, at most for `limit`.
    ///
    /// # Errors
    ///
    /// The program cannot be started or waited for.
    pub fn run(
        &self,
        arguments: impl IntoIterator<Item = OsString>,
        voice: Voice,
        limit: Option<Duration>,
    ) -> Result<End, Error> {
        let program = std::env::current_exe().map_err(|e| Error::io("find", Path::new("punctual"), e))?;
        let failed = |e: io::Error| Error::io("run", &program, e);
        let mut command = Command::new(&program);
        command.args(arguments).stdin(Stdio::null());
        if voice == Voice::Silent {
            command.stdout(Stdio::null()).stderr(Stdio::null());
        }
        let begin = Instant::now();
        // The last record of the journal, and when it first appeared.
        let (mut record, mut entered) = (Vec::new(), begin);
        let mut child = command.spawn().map_err(failed)?;
        let status = loop {
            if let Some(status) = child.try_wait().map_err(failed)? {
                break status;
            }
            if limit.is_some() {
                let now = std::fs::read(journal_file(self.folder.path())).unwrap_or_default();
                if now != record {
                    (record, entered) = (now, Instant::now());
                }
            }
            if let Some(limit) = limit.filter(|limit| begin.elapsed() >= *limit) {
                let call = entered.elapsed();
                // The child may have ended by itself just now; it is waited for in any case.
                let _ = child.kill();
                child.wait().map_err(failed)?;
                return Ok(End::Broken { how: Break::Late { limit, call }, last: self.last_call() });
            }
            std::thread::sleep(LOOK);
        };
        let finished = LastCall::finished(&journal_file(self.folder.path())).unwrap_or(false);
        Ok(match broken(status) {
            Break::Exit(code) if finished => End::Finished(code),
            how => End::Broken { how, last: self.last_call() },
        })
    }

    fn last_call(&self) -> Option<LastCall> {
        LastCall::read(&journal_file(self.folder.path())).ok().flatten()
    }
}

#[cfg(unix)]
fn broken(status: ExitStatus) -> Break {
    use std::os::unix::process::ExitStatusExt;
    match status.signal() {
        Some(signal) => Break::Signal(signal),
        None => Break::Exit(status.code().unwrap_or(-1)),
    }
}

#[cfg(not(unix))]
fn broken(status: ExitStatus) -> Break {
    coded(status.code().unwrap_or(-1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exit_code_of_windows_names_the_exception() {
        let crash = coded(-1_073_741_819);
        assert_eq!(crash.to_string(), "crashed with exception 0xC0000005 (invalid memory access)");
        assert_eq!(coded(3), Break::Exit(3));
        assert_eq!(coded(-1), Break::Exit(-1));
    }
}
