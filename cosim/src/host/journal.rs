//! A file that always names the latest call into an FMU. If an FMU ends this process, the process that
//! watches it reads there which call it was. Off unless [`begin`] is called; then each call costs one small
//! write.

use std::fmt;
use std::fs::File;
use std::io;
use std::path::Path;
use std::sync::OnceLock;

use crate::error::brief_time;

/// Size of the record in bytes; longer names are truncated.
const RECORD: usize = 512;
/// The content of the file after the last call into an FMU.
const FINISHED: &str = "finished";

static JOURNAL: OnceLock<File> = OnceLock::new();

/// The last call recorded in a journal.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LastCall {
    /// The function, such as `fmi2DoStep`.
    pub call: String,
    /// The instance; empty before it exists.
    pub instance: String,
    /// The FMU's file.
    pub fmu: String,
    /// The time of the instance in seconds, if it has one.
    pub time: Option<f64>,
}

impl fmt::Display for LastCall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.instance.as_str() {
            "" => write!(f, "{}: {}", self.fmu, self.call)?,
            instance => write!(f, "{} of {instance} ({})", self.call, self.fmu)?,
        }
        match self.time {
            Some(time) => write!(f, " at t = {} s", brief_time(time)),
            None => Ok(()),
        }
    }
}

impl LastCall {
    /// Reads the file at `path`. `None` if the watched process had finished with its FMUs or had not called
    /// any yet.
    ///
    /// # Errors
    ///
    /// Those of reading the file.
    pub fn read(path: &Path) -> io::Result<Option<Self>> {
        let text = String::from_utf8_lossy(&std::fs::read(path)?).into_owned();
        let mut lines = text.lines().map(|line| line.trim_end().to_owned());
        let mut line = || lines.next().unwrap_or_default();
        let last = Self { call: line(), instance: line(), fmu: line(), time: line().parse().ok() };
        Ok((!last.call.is_empty() && last.call != FINISHED).then_some(last))
    }

    /// Whether the watched process recorded that it had finished with its FMUs.
    ///
    /// # Errors
    ///
    /// Those of reading the file.
    pub fn finished(path: &Path) -> io::Result<bool> {
        Ok(std::fs::read(path)?.starts_with(FINISHED.as_bytes()))
    }
}

/// Starts the journal in the file at `path`. A second call in the same process creates its file but leaves the
/// journal where it is.
///
/// # Errors
///
/// The file cannot be made.
pub fn begin(path: &Path) -> io::Result<()> {
    let file = File::create(path)?;
    let _ = JOURNAL.set(file);
    Ok(())
}

/// Records that no more FMUs will be called.
pub fn finish() {
    write(FINISHED, "", "", None);
}

/// Records the next call.
#[inline]
pub fn entering(call: &str, instance: &str, fmu: &Path, time: Option<f64>) {
    if JOURNAL.get().is_some() {
        write(call, instance, &fmu.to_string_lossy(), time);
    }
}

fn write(call: &str, instance: &str, fmu: &str, time: Option<f64>) {
    let Some(file) = JOURNAL.get() else { return };
    let one_line = |text: &str| text.replace(['\n', '\r'], " ");
    let time = time.map(|time| time.to_string()).unwrap_or_default();
    let text = format!("{call}\n{}\n{}\n{time}\n", one_line(instance), one_line(fmu));
    let mut record = [b' '; RECORD];
    let length = text.len().min(RECORD);
    record[..length].copy_from_slice(&text.as_bytes()[..length]);
    // If the write fails, the report is poorer but the run is unaffected.
    let _ = write_at_start(file, &record);
}

#[cfg(unix)]
fn write_at_start(file: &File, record: &[u8]) -> io::Result<()> {
    std::os::unix::fs::FileExt::write_all_at(file, record, 0)
}

#[cfg(windows)]
fn write_at_start(file: &File, record: &[u8]) -> io::Result<()> {
    // One system call, since there may be several threads. A full disk makes the record shorter.
    std::os::windows::fs::FileExt::seek_write(file, record, 0).map(|_| ())
}
