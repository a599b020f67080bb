//! An `.fmu` file unpacked into a directory of its own, which is removed together with the value. The file
//! may come from anyone, so names and sizes are checked before a byte is written, and the bytes written are
//! counted. This module knows the layout of the archive, not the content of its files.

use std::collections::HashSet;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{MAIN_SEPARATOR, Path, PathBuf};

use percent_encoding::{AsciiSet, CONTROLS, utf8_percent_encode};
use tempfile::TempDir;
use zip::{CompressionMethod, ZipArchive};

use super::Version;
use crate::error::{Error, FmuProblem};
use crate::text;

/// The greatest size of an `.fmu` file, in bytes.
pub const MAX_FILE_BYTES: u64 = 2 << 30;
/// The greatest number of entries of an archive.
pub const MAX_ENTRIES: u64 = 20_000;
/// The greatest length of an entry's name, in bytes.
pub const MAX_NAME_BYTES: usize = 1024;
/// The greatest unpacked size of an archive, in bytes.
pub const MAX_UNPACKED_BYTES: u64 = 4 << 30;
/// The greatest ratio of the unpacked size to the file's, dimensionless, for archives that unpack to
/// more than [`SMALL_BYTES`]. Deflate reaches 1032; libraries and tables stay below 50.
pub const MAX_RATIO: u64 = 200;
/// The unpacked size, in bytes, up to which the ratio does not matter.
pub const SMALL_BYTES: u64 = 64 << 20;
/// The greatest size of `modelDescription.xml`, in bytes.
pub const MAX_DESCRIPTION_BYTES: u64 = 64 << 20;

const MODEL_DESCRIPTION: &str = "modelDescription.xml";

/// Bytes that must be percent-encoded in the path of a `file:` URI (RFC 3986 allows `pchar` and `/`).
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

/// An unpacked archive.
#[derive(Debug)]
pub struct Archive {
    source: PathBuf,
    directory: TempDir,
    entries: Vec<String>,
    platforms: Vec<String>,
}

impl Archive {
    /// Unpacks the archive at `path`.
    ///
    /// # Errors
    ///
    /// The file cannot be read, is not a zip archive, or exceeds one of the limits above. An entry points out
    /// of the archive (an absolute name, a drive, a backslash, a `..`), occurs twice, is neither a file nor a
    /// folder, or is neither stored nor deflated. All of this is checked before anything is written.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let problem = |problem| Error::fmu(path, problem);
        // Checked first, to distinguish a missing file and a folder, which Windows does not open, from a file
        // that is no archive.
        let metadata = std::fs::metadata(path).map_err(|e| Error::io("read", path, e))?;
        if !metadata.is_file() {
            return Err(problem(FmuProblem::Archive("it is not a file".into())));
        }
        let size = metadata.len();
        limit("the file has", size, "bytes", MAX_FILE_BYTES).map_err(problem)?;
        if text::is_toml(path) {
            let message =
                "a TOML file is none; `punctual build` makes an FMU from one, `punctual check` checks it";
            return Err(problem(FmuProblem::Archive(message.into())));
        }
        let mut file = File::open(path).map_err(|e| Error::io("read", path, e))?;
        announced_entries(&mut file).map_err(problem)?;
        let mut zip =
            ZipArchive::new(BufReader::new(file)).map_err(|e| problem(FmuProblem::Archive(chain(&e))))?;
        let plan = survey(&mut zip, size).map_err(problem)?;
        let directory = tempfile::Builder::new()
            .prefix("punctual-")
            .tempdir()
            .map_err(|e| Error::io("create a folder in", &std::env::temp_dir(), e))?;
        for entry in &plan {
            unpack(&mut zip, entry, directory.path()).map_err(problem)?;
        }
        let entries: Vec<String> = plan.into_iter().map(|entry| entry.name).collect();
        let mut platforms: Vec<String> = entries
            .iter()
            .filter_map(|entry| entry.strip_prefix("binaries/")?.split_once('/'))
            .filter(|(platform, rest)| !platform.is_empty() && !rest.is_empty())
            .map(|(platform, _)| platform.to_owned())
            .collect();
        platforms.sort();
        platforms.dedup();
        Ok(Self { source: path.to_owned(), directory, entries, platforms })
    }

    /// The `.fmu` file.
    pub fn source(&self) -> &Path {
        &self.source
    }

    /// The names of all entries, in the order of the archive; folders end with a slash.
    pub fn entries(&self) -> &[String] {
        &self.entries
    }

    /// The folders under `binaries/` that hold files, sorted.
    pub fn platforms(&self) -> &[String] {
        &self.platforms
    }

    /// The path of an entry of this name.
    pub fn path(&self, entry: &str) -> PathBuf {
        self.directory.path().join(entry)
    }

    /// The text of `modelDescription.xml`, as [`xml`](Self::xml) reads it.
    ///
    /// # Errors
    ///
    /// Those of [`xml`](Self::xml).
    pub fn model_description(&self) -> Result<String, FmuProblem> {
        let is_inside =
            |entry: &&String| entry.rsplit_once('/').is_some_and(|(_, file)| file == MODEL_DESCRIPTION);
        if !self.entries.iter().any(|entry| entry == MODEL_DESCRIPTION)
            && let Some(entry) = self.entries.iter().find(is_inside)
        {
            let folder = entry.trim_end_matches(MODEL_DESCRIPTION);
            let text = format!(
                "is not at the top of the archive, but in {folder}: an FMU holds what is in that folder, without the \
                 folder; archive it again from inside"
            );
            return Err(FmuProblem::Description(text));
        }
        self.xml(MODEL_DESCRIPTION)
    }

    /// The text of an XML entry, if it is safe to parse. A byte order mark is kept; ISO-8859-1 is decoded if
    /// the text declares it.
    ///
    /// # Errors
    ///
    /// It is missing, too large, not UTF-8, or nested more deeply or wider than `bounds.rs` allows.
    pub fn xml(&self, entry: &str) -> Result<String, FmuProblem> {
        let missing = |e: io::Error| FmuProblem::Description(format!("cannot be read: {e}"));
        let path = self.path(entry);
        let size = std::fs::metadata(&path).map_err(missing)?.len();
        let what = if entry == MODEL_DESCRIPTION { "modelDescription.xml has" } else { "an XML file has" };
        limit(what, size, "bytes", MAX_DESCRIPTION_BYTES)?;
        let bytes = std::fs::read(&path).map_err(missing)?;
        let is_latin = declared_encoding(&bytes).is_some_and(is_latin);
        let text = if is_latin {
            // ISO-8859-1 bytes are the first 256 characters.
            bytes.into_iter().map(char::from).collect()
        } else {
            String::from_utf8(bytes).map_err(|e| {
                FmuProblem::Description(format!("is not UTF-8 from byte {}", e.utf8_error().valid_up_to()))
            })?
        };
        super::bounds::check(&text)?;
        Ok(text)
    }

    /// The expected path of this platform's shared library.
    pub(super) fn library(&self, version: Version, model_identifier: &str) -> PathBuf {
        let file = format!("{model_identifier}{}", std::env::consts::DLL_SUFFIX);
        self.directory.path().join("binaries").join(version.platform()).join(file)
    }

    /// The `fmuResourceLocation` for `fmi2Instantiate`: `file:///…/resources`, percent-encoded.
    /// The folder need not exist.
    pub(super) fn resource_location(&self) -> String {
        file_uri(&self.resources().to_string_lossy())
    }

    /// The `resourcePath` for FMI 3.0: the folder, with a separator at its end; `None` without such a folder.
    pub(super) fn resource_path(&self) -> Option<String> {
        let path = self.resources();
        path.is_dir().then(|| format!("{}{MAIN_SEPARATOR}", path.to_string_lossy()))
    }

    fn resources(&self) -> PathBuf {
        let path = self.directory.path().join("resources");
        std::path::absolute(&path).unwrap_or(path)
    }
}

/// Whether an encoding is ISO-8859-1, which the standard excludes but some tools write.
pub fn is_latin(encoding: &str) -> bool {
    ["iso-8859-1", "iso8859-1", "latin1"].iter().any(|name| encoding.eq_ignore_ascii_case(name))
}

/// The encoding named by the XML declaration at the beginning of `bytes`, if any.
pub fn declared_encoding(bytes: &[u8]) -> Option<&str> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).strip_prefix(b"<?xml")?;
    let end = bytes.windows(2).position(|two| two == b"?>")?;
    let (_, rest) = std::str::from_utf8(&bytes[..end]).ok()?.split_once("encoding")?;
    rest.split(['"', '\'']).nth(1)
}

/// An entry to unpack.
struct Entry {
    index: usize,
    name: String,
    folder: bool,
    size: u64,
}

fn limit(what: &'static str, value: u64, unit: &'static str, allowed: u64) -> Result<(), FmuProblem> {
    if value <= allowed { Ok(()) } else { Err(FmuProblem::Limit { what, value, unit, allowed }) }
}

/// Refuses a file whose end record announces too many entries, before memory is allocated for them. (The
/// plain record counts in 16 bits; a larger count is in a separate record.)
fn announced_entries(file: &mut File) -> Result<(), FmuProblem> {
    let io = |e: io::Error| FmuProblem::Archive(e.to_string());
    let length = file.seek(SeekFrom::End(0)).map_err(io)?;
    // The last record has 22 bytes and a comment of at most 65535; the records for large archives come before
    // it.
    let tail = length.min(22 + 65_535 + 20 + 56);
    file.seek(SeekFrom::Start(length - tail)).map_err(io)?;
    let mut bytes = Vec::new();
    file.take(tail).read_to_end(&mut bytes).map_err(io)?;
    file.seek(SeekFrom::Start(0)).map_err(io)?;
    let number = |at: usize, length: usize| {
        let field = bytes.get(at..at + length).unwrap_or_default();
        field.iter().rev().fold(0_u64, |sum, byte| sum << 8 | u64::from(*byte))
    };
    for at in 0..bytes.len().saturating_sub(3) {
        let count = match &bytes[at..at + 4] {
            b"PK\x05\x06" => number(at + 10, 2),
            b"PK\x06\x06" => number(at + 32, 8),
            _ => continue,
        };
        // 65535 stands for "see the other record".
        if count != 65_535 {
            limit("the archive has", count, "entries", MAX_ENTRIES)?;
        }
    }
    Ok(())
}

/// Checks every entry's name and sizes.
fn survey(zip: &mut ZipArchive<BufReader<File>>, file_size: u64) -> Result<Vec<Entry>, FmuProblem> {
    let damaged = |e: zip::result::ZipError| FmuProblem::Archive(chain(&e));
    limit("the archive has", zip.len() as u64, "entries", MAX_ENTRIES)?;
    if zip.has_duplicate_names() {
        return Err(FmuProblem::Archive("two of its entries have the same name".into()));
    }
    let mut names = HashSet::new();
    let mut total = 0_u64;
    let mut plan = Vec::new();
    for index in 0..zip.len() {
        let file = zip.by_index_raw(index).map_err(damaged)?;
        let raw = file.name_raw();
        limit("the name of an entry has", raw.len() as u64, "bytes", MAX_NAME_BYTES as u64)?;
        let name = String::from_utf8(raw.to_owned()).map_err(|e| {
            let name = String::from_utf8_lossy(raw);
            let at = e.utf8_error().valid_up_to();
            FmuProblem::Archive(format!("the name of entry {index} ({name:?}) is not UTF-8 from byte {at}"))
        })?;
        if leaves_archive(&name) {
            return Err(FmuProblem::UnsafeEntry(name));
        }
        if file.is_symlink() {
            return Err(FmuProblem::Archive(format!("the entry {name:?} is a symbolic link")));
        }
        if file.encrypted() {
            return Err(FmuProblem::Archive(format!("the entry {name:?} is encrypted")));
        }
        let method = file.compression();
        if !matches!(method, CompressionMethod::Stored | CompressionMethod::Deflated) {
            return Err(FmuProblem::Compression { entry: name, method: compression(method) });
        }
        // Two names that differ only in case would overwrite each other on a system that ignores case.
        if !names.insert(name.to_lowercase()) {
            let text = format!("the entry {name:?} is there twice (upper and lower case apart)");
            return Err(FmuProblem::Archive(text));
        }
        let (folder, size) = (name.ends_with('/'), file.size());
        total = total.saturating_add(size);
        limit("unpacked, the archive has", total, "bytes", MAX_UNPACKED_BYTES)?;
        plan.push(Entry { index, name, folder, size });
    }
    if total > SMALL_BYTES && total / file_size.max(1) > MAX_RATIO {
        let value = total / file_size.max(1);
        let what = "unpacked, the archive is larger by a factor of";
        return Err(FmuProblem::Limit { what, value, unit: "", allowed: MAX_RATIO });
    }
    if zip.has_overlapping_entries().map_err(damaged)? {
        return Err(FmuProblem::Archive("two of its entries share their bytes".into()));
    }
    Ok(plan)
}

/// The name of a compression method other than stored and deflated.
fn compression(method: CompressionMethod) -> String {
    const NAMES: [(CompressionMethod, &str); 5] = [
        (CompressionMethod::DEFLATE64, "deflate64"),
        (CompressionMethod::BZIP2, "bzip2"),
        (CompressionMethod::LZMA, "lzma"),
        (CompressionMethod::ZSTD, "zstd"),
        (CompressionMethod::XZ, "xz"),
    ];
    let known = NAMES.iter().find(|(known, _)| *known == method);
    known.map_or_else(|| format!("an unknown method, {method:?}"), |(_, name)| (*name).to_owned())
}

/// Writes one entry below `folder`, but no more bytes than the archive announced for it.
fn unpack(zip: &mut ZipArchive<BufReader<File>>, entry: &Entry, folder: &Path) -> Result<(), FmuProblem> {
    let name = &entry.name;
    let failed = |e: &dyn std::error::Error| FmuProblem::Archive(format!("entry {name:?}: {}", chain(e)));
    let target = folder.join(name);
    if entry.folder {
        return std::fs::create_dir_all(&target).map_err(|e| failed(&e));
    }
    if let Some(parent) = target.parent() {
        std::fs::create_dir_all(parent).map_err(|e| failed(&e))?;
    }
    let source = zip.by_index(entry.index).map_err(|e| failed(&e))?;
    // An existing file is never overwritten.
    let mut file = File::create_new(&target).map_err(|e| failed(&e))?;
    let written =
        io::copy(&mut source.take(entry.size.saturating_add(1)), &mut file).map_err(|e| failed(&e))?;
    if written != entry.size {
        let text = format!("entry {name:?} has {written} bytes or more, but the archive says {}", entry.size);
        return Err(FmuProblem::Archive(text));
    }
    Ok(())
}

/// The `file://` URI of an absolute path.
fn file_uri(path: &str) -> String {
    let path = if cfg!(windows) { path.replace('\\', "/") } else { path.to_owned() };
    let slash = if path.starts_with('/') { "" } else { "/" };
    format!("file://{slash}{}", utf8_percent_encode(&path, URI_PATH))
}

/// Whether an archive entry of this name would be written outside the target folder on some system.
fn leaves_archive(entry: &str) -> bool {
    entry.starts_with('/')
        || entry.contains(['\\', '\0'])
        || entry.is_empty()
        || entry.split('/').any(|part| part == ".." || part == ".")
        || entry.trim_end_matches('/').split('/').any(str::is_empty)
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
