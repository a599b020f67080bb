//! Writes files completely or not at all: after a full disk or a crash, the previous file is still there.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::error::Error;

/// Writes `bytes` to the file at `path`.
///
/// # Errors
///
/// A file that cannot be written; the previous one is unchanged.
pub fn write(path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), Error> {
    write_with(path, |out| out.write_all(bytes.as_ref()))
}

/// Writes the output of `content` to the file at `path`.
///
/// # Errors
///
/// As for [`write()`].
pub fn write_with(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), Error> {
    let failed = |e| Error::io("write", path, e);
    // A pipe or a device is written to directly, not replaced.
    let is_file = fs::metadata(path).map_or(true, |meta| meta.is_file());
    let place = if is_file { draft(path) } else { path.to_owned() };
    let written = File::create(&place).and_then(|file| {
        let mut out = BufWriter::with_capacity(1 << 16, file);
        content(&mut out)?;
        out.flush()
    });
    let done = written.and_then(|()| if is_file { fs::rename(&place, path) } else { Ok(()) });
    done.map_err(|e| {
        if is_file {
            // If this fails too, the first error is the one to report.
            let _ = fs::remove_file(&place);
        }
        failed(e)
    })
}

/// The temporary name of the file at `path` until it is complete.
fn draft(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".part");
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_there_stays_where_writing_fails() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        write(&path, "old").unwrap();
        let full = |out: &mut BufWriter<File>| {
            out.write_all(b"half of the n")?;
            Err(io::Error::from(io::ErrorKind::StorageFull))
        };
        let error = write_with(&path, full).unwrap_err().to_string();
        assert!(error.starts_with(&format!("cannot write {}: ", path.display())), "{error}");
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        write(&path, "new").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "a draft is left");
        let nowhere = folder.path().join("no/a.csv");
        assert!(write(&nowhere, "x").is_err());
    }

    #[cfg(unix)]
    #[test]
    fn a_device_is_written_to() {
        write(Path::new("/dev/null"), "x").unwrap();
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
    }
}
