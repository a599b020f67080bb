//! Reads text files, and recognises other files that were given in their place.

use std::io;
use std::path::Path;

use crate::error::Error;

/// How other kinds of files and encodings begin, and what to call them.
const OTHERS: [(&[u8], &str); 4] = [
    (
        b"PK\x03\x04",
        "it is an archive, such as an FMU, and no text; `punctual inspect` and `punctual validate` take FMUs",
    ),
    (b"PAR1", "it is a Parquet file and no text; `punctual replay` takes one that `punctual campaign` wrote"),
    (b"\xff\xfe", "it is in UTF-16, must be in UTF-8; save the file as UTF-8"),
    (b"\xfe\xff", "it is in UTF-16, must be in UTF-8; save the file as UTF-8"),
];

/// Whether the name of the file ends in `.toml`.
pub fn is_toml(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"))
}

/// The text of the file at `path`.
///
/// # Errors
///
/// A file that cannot be read, a folder, or a file that is no UTF-8 text; the message says what it is.
pub fn read(path: &Path) -> Result<String, Error> {
    let refuse = |message: String| Error::io("read", path, io::Error::other(message));
    if path.is_dir() {
        return Err(refuse("it is a folder, must be a file".to_owned()));
    }
    let bytes = std::fs::read(path).map_err(|e| Error::io("read", path, e))?;
    if let Some((_, what)) = OTHERS.iter().find(|(begin, _)| bytes.starts_with(begin)) {
        return Err(refuse((*what).to_owned()));
    }
    String::from_utf8(bytes).map_err(|e| {
        let before = &e.as_bytes()[..e.utf8_error().valid_up_to()];
        let line = before.iter().filter(|byte| **byte == b'\n').count() + 1;
        refuse(format!("line {line} is not valid UTF-8; save the file as UTF-8"))
    })
}
