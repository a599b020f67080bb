//! An `.fmu` file unpacked into a directory of its own, which goes when the value goes.
//! Knows the layout of the archive, not the content of its files.

use std::path::{Path, PathBuf};

use percent_encoding::{AsciiSet, CONTROLS, utf8_percent_encode};
use tempfile::TempDir;

use crate::error::{Error, FmuProblem};

/// Bytes that a path in a `file:` URI must not carry as they are (RFC 3986, `pchar` and `/` may stay).
const URI_PATH: &AsciiSet = &CONTROLS
    .add(b' ')
    .add(b'"')
    .add(b'#')
    .add(b'%')
    .add(b'<')
    .add(b'>')
    .add(b'?')
    .add(b'[')
    .add(b'\\')
    .add(b']')
    .add(b'^')
    .add(b'`')
    .add(b'{')
    .add(b'|')
    .add(b'}');

/// The folder of this platform's binaries inside an FMI 2.0 archive.
pub const PLATFORM: &str = if cfg!(target_os = "windows") {
    if cfg!(target_pointer_width = "64") { "win64" } else { "win32" }
} else if cfg!(target_os = "macos") {
    "darwin64"
} else if cfg!(all(target_os = "linux", target_arch = "x86_64")) {
    "linux64"
} else if cfg!(all(target_os = "linux", target_arch = "x86")) {
    "linux32"
} else if cfg!(all(target_os = "linux", target_arch = "aarch64")) {
    "aarch64-linux"
} else {
    "unknown"
};

/// An unpacked archive.
#[derive(Debug)]
pub(super) struct Archive {
    source: PathBuf,
    directory: TempDir,
    platforms: Vec<String>,
}

impl Archive {
    /// Unpacks the archive at `path`.
    ///
    /// # Errors
    ///
    /// The file cannot be read, is not a zip archive, or holds an entry that points out of the
    /// archive (an absolute name, a drive, a backslash, a `..`).
    pub(super) fn open(path: &Path) -> Result<Self, Error> {
        let problem = |problem| Error::fmu(path, problem);
        // Opened here first: "no such file" is told from "not an archive".
        drop(std::fs::File::open(path).map_err(|e| Error::io("read", path, e))?);
        let Some(text) = path.to_str() else {
            return Err(problem(FmuProblem::Archive("its path is not valid UTF-8".into())));
        };
        let entries =
            fmi_rs::zip::get_zip_contents(text).map_err(|e| problem(FmuProblem::Archive(chain(&e))))?;
        if let Some(entry) = entries.iter().find(|entry| leaves_archive(entry)) {
            return Err(problem(FmuProblem::UnsafeEntry(entry.clone())));
        }
        let directory = tempfile::Builder::new()
            .prefix("punctual-")
            .tempdir()
            .map_err(|e| Error::io("create a folder in", &std::env::temp_dir(), e))?;
        // Links are written as plain files and names are checked once more while unpacking.
        fmi_rs::zip::extract_zip_archive(path, directory.path())
            .map_err(|e| problem(FmuProblem::Archive(chain(&e))))?;
        let mut platforms: Vec<String> = entries
            .iter()
            .filter_map(|entry| entry.strip_prefix("binaries/")?.split_once('/'))
            .filter(|(platform, rest)| !platform.is_empty() && !rest.is_empty())
            .map(|(platform, _)| platform.to_owned())
            .collect();
        platforms.sort();
        platforms.dedup();
        Ok(Self { source: path.to_owned(), directory, platforms })
    }

    /// The file this was unpacked from.
    pub(super) fn source(&self) -> &Path {
        &self.source
    }

    /// The folders under `binaries/` that hold files, sorted.
    pub(super) fn platforms(&self) -> &[String] {
        &self.platforms
    }

    /// Where the model description should be.
    pub(super) fn model_description(&self) -> PathBuf {
        self.directory.path().join("modelDescription.xml")
    }

    /// Where this platform's shared library should be.
    pub(super) fn library(&self, model_identifier: &str) -> PathBuf {
        let file = format!("{model_identifier}{}", fmi_rs::SHARED_LIBRARY_EXTENSION);
        self.directory.path().join("binaries").join(PLATFORM).join(file)
    }

    /// The `fmuResourceLocation` for `fmi2Instantiate`: `file:///…/resources`, percent-encoded.
    /// The folder need not exist.
    pub(super) fn resource_location(&self) -> String {
        let path = self.directory.path().join("resources");
        let path = std::path::absolute(&path).unwrap_or(path);
        file_uri(&path.to_string_lossy())
    }
}

/// `file://` URI of an absolute path.
fn file_uri(path: &str) -> String {
    let path = if cfg!(windows) { path.replace('\\', "/") } else { path.to_owned() };
    let slash = if path.starts_with('/') { "" } else { "/" };
    format!("file://{slash}{}", utf8_percent_encode(&path, URI_PATH))
}

/// Whether an archive entry of this name would be written outside the target folder somewhere.
fn leaves_archive(entry: &str) -> bool {
    entry.starts_with('/')
        || entry.contains(['\\', '\0'])
        || entry.split('/').any(|part| part == "..")
        || entry.as_bytes().get(1) == Some(&b':')
}

/// An error and its causes on one line.
pub(super) fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        let inner_text = inner.to_string();
        if !text.ends_with(&inner_text) {
            text = format!("{text}: {inner_text}");
        }
        cause = inner.source();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_that_leave_the_archive_are_recognised() {
        for bad in ["/etc/x", "../x", "a/../../x", "a\\..\\x", "C:/x", "a/.."] {
            assert!(leaves_archive(bad), "{bad}");
        }
        for good in ["modelDescription.xml", "binaries/linux64/a.so", "resources/..x/y..", "a..b"] {
            assert!(!leaves_archive(good), "{good}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn resource_locations_are_percent_encoded() {
        assert_eq!(file_uri("/a b/ü#%/resources"), "file:///a%20b/%C3%BC%23%25/resources");
    }

    #[test]
    fn what_is_no_archive_is_said_so() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "not a zip").unwrap();
        let message = Archive::open(file.path()).unwrap_err().to_string();
        assert!(message.contains("not a readable FMU archive"), "{message}");
        let message = Archive::open(Path::new("no/such.fmu")).unwrap_err().to_string();
        assert!(message.contains("cannot read no/such.fmu"), "{message}");
    }
}
