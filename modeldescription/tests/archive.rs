//! The archive: reopened, compared with itself, and fed with paths it must refuse.
#![cfg(feature = "archive")]

use punctual_modeldescription::{Archive, Timestamp};
use std::io::{Cursor, Read, Write};
use zip::{CompressionMethod, ZipArchive};

const FILES: [(&str, &[u8]); 5] = [
    ("modelDescription.xml", b"<fmiModelDescription/>\n"),
    ("binaries/linux64/small.so", &[0x7f; 5000]),
    ("documentation/index.html", b"<html></html>"),
    ("resources/empty", b""),
    ("resources/\u{e4}.toml", b"a = 1\n"),
];

fn archive(order: impl IntoIterator<Item = usize>) -> Archive {
    let mut archive = Archive::new();
    for i in order {
        let (path, bytes) = FILES[i];
        archive.add(path, bytes).expect("a new path");
    }
    archive
}

#[test]
fn reopened_archive_holds_what_was_added() {
    let bytes = archive([3, 1, 4, 0, 2]).to_bytes().expect("fits");
    let mut zip = ZipArchive::new(Cursor::new(bytes)).expect("a zip archive");
    assert_eq!(zip.len(), FILES.len());
    for (i, (path, content)) in FILES.into_iter().enumerate() {
        let mut file = zip.by_index(i).expect("an entry");
        assert_eq!(file.name().expect("UTF-8"), path);
        assert_eq!(file.compression(), CompressionMethod::Deflated);
        let permissions = if path.starts_with("binaries/") { 0o100_755 } else { 0o100_644 };
        assert_eq!(file.unix_mode(), Some(permissions), "{path}");
        assert_eq!(file.last_modified().map(|t| t.to_string()).as_deref(), Some("1980-01-01 00:00:00"));
        let mut got = Vec::new();
        file.read_to_end(&mut got).expect("readable");
        assert_eq!(got, content, "{path}");
    }
}

#[test]
fn entries_are_those_of_the_file_in_its_order() {
    let archive = archive([4, 3, 2, 1, 0]);
    assert_eq!(archive.entries().collect::<Vec<_>>(), FILES);
}

#[test]
fn order_of_adding_does_not_change_the_bytes() {
    let forward = archive(0..5).to_bytes().expect("fits");
    assert_eq!(forward, archive((0..5).rev()).to_bytes().expect("fits"));
    assert_eq!(forward, archive([2, 0, 4, 1, 3]).to_bytes().expect("fits"));
}

#[test]
fn given_instant_is_stored() {
    let stamp = Timestamp::from_source_date_epoch("1700000001").expect("in range");
    let bytes = archive([0]).with_timestamp(stamp).to_bytes().expect("fits");
    let mut zip = ZipArchive::new(Cursor::new(bytes)).expect("a zip archive");
    let time = zip.by_index(0).expect("an entry").last_modified().expect("a time");
    assert_eq!(time.to_string(), "2023-11-14 22:13:20");
}

#[test]
fn unsuitable_paths_are_refused() {
    let components = "relative to the root, components non-empty and neither . nor ..";
    let characters = "no backslash, colon or control character";
    let rows = [
        ("", components),
        ("/etc/passwd", components),
        ("a//b", components),
        ("a/", components),
        ("./a", components),
        ("a/../b", components),
        ("..", components),
        ("a\\b", characters),
        ("C:a", characters),
        ("a\nb", characters),
        ("resources/empty", "not the path of another entry"),
        ("resources/empty/a", "not inside another entry"),
        ("resources", "not the folder of another entry"),
    ];
    for (path, allowed) in rows {
        let mut archive = archive(0..5);
        let error = archive.add(path, "x").expect_err(path);
        assert!(error.is_invalid());
        assert_eq!(error.to_string(), format!("archive path is {path:?}; allowed: {allowed}"));
        assert_eq!(archive.entries().collect::<Vec<_>>(), FILES, "unchanged after {path:?}");
    }
    assert!(Archive::new().add(&"a".repeat(65_536), "").is_err());
}

#[test]
fn similar_paths_are_no_conflict() {
    let mut archive = Archive::new();
    for path in ["a/b", "a-b", "a.b/c", "ab", "a/c"] {
        archive.add(path, "").expect(path);
    }
    assert_eq!(archive.entries().count(), 5);
}

/// A destination without room.
struct Full;

impl Write for Full {
    fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
        Err(std::io::Error::other("no space"))
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn failing_destination_is_an_io_error() {
    let error = archive([0]).write_to(Full).expect_err("full");
    assert!(error.is_io() && !error.is_invalid());
    assert_eq!(error.to_string(), "cannot write the archive");
    let source = std::error::Error::source(&error).expect("a source").to_string();
    assert_eq!(source, "no space");
}

#[test]
fn written_archive_is_the_one_in_memory() {
    let archive = archive(0..5);
    let mut written = Vec::new();
    archive.write_to(&mut written).expect("memory");
    assert_eq!(written, archive.to_bytes().expect("fits"));
}
