//! Malicious files, given to every command that opens FMUs. They are refused with a clear message, within
//! bounded time and memory, before anything is unpacked.

use std::io::{Cursor, Write};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use crate::misbehaving::{self, description};
use crate::validating::findings;
use crate::workshop::{Done, Workshop};

/// The longest time that a refusal may take on a loaded machine.
const PATIENCE: Duration = Duration::from_secs(30);
/// Address space available to the commands, in KiB.
const MEMORY: u32 = 2 << 20;

fn archive(entries: &[(&str, &[u8])]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in entries {
        zip.start_file(*name, SimpleFileOptions::default()).expect("an entry");
        zip.write_all(bytes).expect("memory");
    }
    zip.finish().expect("an archive").into_inner()
}

/// The bytes with every `from` replaced by `to`, which has the same length.
fn patched(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let mut bytes = bytes.to_vec();
    let found: Vec<_> = (0..bytes.len() - from.len()).filter(|&at| bytes[at..].starts_with(from)).collect();
    assert!(!found.is_empty(), "{from:?} is not there");
    for at in found {
        bytes[at..at + to.len()].copy_from_slice(to);
    }
    bytes
}

/// Runs the command with limited memory.
fn punctual(workshop: &Workshop, arguments: &[&str]) -> Done {
    let mut command = Command::new("sh");
    command.args(["-c", &format!("ulimit -v {MEMORY}; exec \"$0\" \"$@\""), env!("CARGO_BIN_EXE_punctual")]);
    let command = command.args(arguments).current_dir(workshop.path("")).stdin(Stdio::null());
    let begin = Instant::now();
    let output = command.output().expect("sh starts");
    assert!(begin.elapsed() < PATIENCE, "{arguments:?} took {:?}", begin.elapsed());
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
    Done {
        code: output.status.code().expect("it is not ended by a signal"),
        stdout: text(output.stdout),
        stderr: text(output.stderr),
    }
}

/// Asserts that all commands refuse the file with this rule and a message that contains `message`.
#[track_caller]
fn refused(fmu: &[u8], rule: &str, message: &str) {
    let workshop = Workshop::new();
    workshop.write("x.fmu", fmu);
    workshop.write(
        "s.toml",
        "[experiment]\nstop_time = 1.0\nstep = 0.1\n[[component]]\nname = \"c\"\nfmu = \"x.fmu\"\n",
    );
    let inspected = punctual(&workshop, &["inspect", "x.fmu"]);
    assert!(inspected.code == 1 && inspected.stdout.is_empty(), "{inspected:#?}");
    assert!(
        inspected.stderr.starts_with("error: x.fmu: ") && inspected.stderr.contains(message),
        "{inspected:#?}"
    );
    let ran = punctual(&workshop, &["run", "s.toml"]);
    assert!(
        ran.code == 1 && ran.stderr.starts_with("error: c (x.fmu): ") && ran.stderr.contains(message),
        "{ran:#?}"
    );
    let merged = punctual(&workshop, &["merge", "x.fmu", "x.fmu", "-o", "y.fmu"]);
    assert!(
        merged.code == 1 && merged.stderr.starts_with("error: x.fmu: ") && merged.stderr.contains(message),
        "{merged:#?}"
    );
    assert!(!workshop.files().contains(&"y.fmu".to_owned()), "{merged:#?}");
    let validated = punctual(&workshop, &["validate", "x.fmu"]);
    assert!(validated.code == 1 && validated.stdout.contains(&format!("[{rule}]")), "{validated:#?}");
    assert!(
        validated.stdout.contains(message) && validated.stdout.ends_with("x.fmu: 1 error, no warnings\n"),
        "{validated:#?}"
    );
}

/// The same for an archive with only this model description.
#[track_caller]
fn refused_xml(xml: &[u8], message: &str) {
    refused(&archive(&[("modelDescription.xml", xml)]), "xml.readable", message);
}

#[test]
fn no_archive_at_all() {
    refused(b"", "archive.readable", "not a readable FMU archive: ");
    refused(b"PK\x03\x04", "archive.readable", "not a readable FMU archive: ");
    refused(&[0x55; 100_000], "archive.readable", "not a readable FMU archive: ");
}

#[test]
fn a_truncated_archive() {
    let whole = archive(&[("modelDescription.xml", &[b'x'; 10_000]), ("resources/a", &[b'y'; 100])]);
    for length in [30, whole.len() / 2, whole.len() - 10] {
        refused(&whole[..length], "archive.readable", "not a readable FMU archive: ");
    }
}

#[test]
fn names_that_leave_the_archive() {
    for (plain, name) in [
        ("abcescape", "../escape"),
        ("aescape", "/escape"),
        ("abcescape", "C:/escape"),
        ("r/abcdescape", "r/../../scape"),
        ("r/a/escape", "r/./escape"),
        ("ab/escape", "a\\b\\scape"),
        ("r/aescape", "r//escape"),
    ] {
        let plain: String = plain.chars().chain("zzzz".chars()).take(name.len()).collect();
        let fmu = patched(&archive(&[(&plain, b"x")]), plain.as_bytes(), name.as_bytes());
        refused(&fmu, "archive.name", &format!("the archive entry {name:?} points out of the archive"));
    }
}

#[test]
fn entries_that_are_there_twice() {
    let fmu = archive(&[("resources/one", b"1"), ("resources/two", b"2")]);
    let fmu = patched(&fmu, b"resources/two", b"resources/one");
    refused(&fmu, "archive.readable", "two of its entries have the same name");
    let fmu = archive(&[("resources/one", b"1"), ("Resources/ONE", b"2")]);
    refused(&fmu, "archive.readable", "\"Resources/ONE\" is there twice (upper and lower case apart)");
}

#[test]
fn a_link() {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    zip.add_symlink("resources", "/etc", SimpleFileOptions::default()).expect("an entry");
    let fmu = zip.finish().expect("an archive").into_inner();
    refused(&fmu, "archive.readable", "the entry \"resources\" is a symbolic link");
}

#[test]
fn a_file_that_is_also_a_folder() {
    let fmu = archive(&[("resources", b"1"), ("resources/one", b"2")]);
    refused(&fmu, "archive.readable", "entry \"resources/one\": ");
}

/// 80 MiB of zeros in 80 KiB.
#[test]
fn a_bomb() {
    let fmu = archive(&[("resources/zeros", &vec![0; 80 << 20])]);
    assert!(fmu.len() < 200_000, "{}", fmu.len());
    let message = "refused: unpacked, the archive is larger by a factor of ";
    refused(&fmu, "archive.limit", message);
}

#[test]
fn a_bomb_that_says_it_is_none() {
    let length = 1_000_003_u32.to_le_bytes();
    let fmu = archive(&[("resources/zeros", &vec![0; 1_000_003])]);
    let fmu = patched(&fmu, &length, &7_u32.to_le_bytes());
    refused(&fmu, "archive.readable", "not a readable FMU archive: entry \"resources/zeros\"");
}

#[test]
fn more_than_is_unpacked() {
    let length = 1_000_003_u32.to_le_bytes();
    let zeros = vec![0; 1_000_003];
    let fmu = archive(&[("resources/a", &zeros), ("resources/b", &zeros)]);
    let fmu = patched(&fmu, &length, &0xffff_fff0_u32.to_le_bytes());
    refused(
        &fmu,
        "archive.limit",
        "refused: unpacked, the archive has 8589934560 bytes; allowed are at most 4294967296",
    );
}

#[test]
fn more_entries_than_are_unpacked() {
    let names: Vec<String> = (0..20_001).map(|n| format!("resources/{n}")).collect();
    let entries: Vec<(&str, &[u8])> = names.iter().map(|name| (name.as_str(), &b""[..])).collect();
    refused(
        &archive(&entries),
        "archive.limit",
        "refused: the archive has 20001 entries; allowed are at most 20000",
    );
}

#[test]
fn a_name_without_end() {
    let name = format!("resources/{}", "a".repeat(5000));
    refused(
        &archive(&[(&name, b"")]),
        "archive.limit",
        "the name of an entry has 5010 bytes; allowed are at most 1024",
    );
}

#[test]
fn a_name_that_is_no_text() {
    let fmu = patched(&archive(&[("resources/ab", b"")]), b"resources/ab", b"resources/\xff\xfe");
    refused(
        &fmu,
        "archive.readable",
        "the name of entry 0 (\"resources/\u{fffd}\u{fffd}\") is not UTF-8 from byte 10",
    );
}

#[test]
fn a_description_that_is_missing() {
    refused(&archive(&[("a/other.xml", b"<a/>")]), "xml.readable", "modelDescription.xml: cannot be read: ");
    refused(
        &archive(&[("a/modelDescription.xml", b"<a/>")]),
        "xml.readable",
        "modelDescription.xml: is not at the top of the archive, but in a/: ",
    );
}

#[test]
fn a_description_that_is_no_text() {
    refused_xml(
        b"<fmiModelDescription modelName='\xff'/>",
        "modelDescription.xml: is not UTF-8 from byte 32",
    );
    let wide: Vec<u8> = "<a/>".encode_utf16().flat_map(u16::to_le_bytes).collect();
    let with_mark: Vec<u8> = [0xff, 0xfe].into_iter().chain(wide).collect();
    refused_xml(&with_mark, "modelDescription.xml: is not UTF-8 from byte 0");
}

#[test]
fn a_truncated_description() {
    let xml = description("none", &[]);
    for length in [0, xml.len() / 3, xml.len() / 2, xml.len() - 5] {
        let cut = &xml.as_bytes()[..length];
        let workshop = Workshop::new();
        workshop.write("x.fmu", archive(&[("modelDescription.xml", cut)]));
        let done = punctual(&workshop, &["validate", "x.fmu"]);
        assert!(
            done.code == 1 && done.stdout.contains("[xml.readable]\n  is not well-formed XML: "),
            "{done:#?}"
        );
        punctual(&workshop, &["inspect", "x.fmu"]).fails_like(1, "x.fmu: modelDescription.xml: ", &[]);
    }
}

#[test]
fn elements_without_depth() {
    let depth = 2_000_000;
    let xml = format!("<fmiModelDescription>{}", "<a>".repeat(depth));
    refused_xml(xml.as_bytes(), "line 1: refused, because it has elements nested deeper than 256");
}

#[test]
fn attributes_without_number() {
    let attributes: String = (0..300_000).map(|n| format!(" a{n}=''")).collect();
    let xml = format!("<fmiModelDescription{attributes}/>");
    refused_xml(xml.as_bytes(), "has an element with 300000 attributes; allowed are 256");
}

#[test]
fn entities_that_expand() {
    let mut xml = "<?xml version=\"1.0\"?>\n<!DOCTYPE l [<!ENTITY a0 \"ha\">\n".to_owned();
    for n in 1..30 {
        xml += &format!("<!ENTITY a{n} \"&a{0};&a{0};\">\n", n - 1);
    }
    xml += "]><l>&a29;</l>";
    refused_xml(
        xml.as_bytes(),
        "line 2: refused, because it has a document type, whose entities can expand without bound",
    );
    let outside = "<!DOCTYPE l SYSTEM \"file:///etc/passwd\"><l/>";
    refused_xml(outside.as_bytes(), "line 1: refused, because it has a document type");
}

#[test]
fn a_description_without_end() {
    // Different names compress too little to count as a bomb.
    let mut xml = "<fmiModelDescription>".to_owned();
    let mut state = 1_u64;
    while xml.len() <= 64 << 20 {
        for _ in 0..1000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            xml += &format!("<a>{state:x}</a>");
        }
    }
    let fmu = archive(&[("modelDescription.xml", xml.as_bytes())]);
    refused(&fmu, "archive.limit", "bytes; allowed are at most 67108864");
}

/// Many variables are not a defect: they are read in bounded time, and the findings are limited.
#[test]
fn variables_without_number() {
    let variables: String = (10..100_010)
        .map(|n| format!("<ScalarVariable name=\"v{n}\" valueReference=\"{n}\" causality=\"input\"><Real unit=\"none\"/></ScalarVariable>\n"))
        .collect();
    let workshop = Workshop::new();
    let xml = description("none", &[("</ModelVariables>", &format!("{variables}</ModelVariables>"))]);
    misbehaving::write(&workshop, "x.fmu", xml, &misbehaving::library(&[]));
    let done = punctual(&workshop, &["validate", "x.fmu", "--no-trial"]);
    assert!(
        done.code == 1 && done.stdout.contains("(and 99980 more findings of this rule)"),
        "{}",
        done.stdout.len()
    );
    assert!(done.stdout.len() < 20_000, "{}", done.stdout.len());
}

#[test]
fn another_encoding_than_is_declared() {
    let declared =
        |name: &str| description("none", &[("encoding=\"UTF-8\"", &format!("encoding=\"{name}\""))]);
    assert_eq!(
        findings(declared("UTF-16")),
        ["error xml.readable modelDescription.xml:1: the declared encoding is \"UTF-16\"; must be UTF-8"]
    );
    let latin = "warning xml.encoding modelDescription.xml:1: the declared encoding is \"ISO-8859-1\", which not every importer \
                 reads; should be UTF-8";
    assert_eq!(findings(declared("ISO-8859-1")), [latin]);
    // A byte that is not UTF-8: an umlaut if the declaration says so, else damage.
    let with_byte = |text: String| {
        let mut bytes = text.into_bytes();
        let at = bytes.windows(6).position(|w| w == b"logAll").expect("the category");
        bytes[at + 3] = 0xe4;
        bytes
    };
    assert_eq!(findings(with_byte(declared("ISO-8859-1"))), [latin]);
    let damaged = findings(with_byte(declared("UTF-8")));
    assert!(damaged.len() == 1 && damaged[0].contains("is not UTF-8 from byte"), "{damaged:#?}");
    let marked = format!("\u{feff}{}", description("none", &[]));
    let mark = "warning xml.encoding modelDescription.xml:1: begins with a byte order mark; should begin with `<?xml`, as some \
                importers do not skip it";
    assert_eq!(findings(marked), [mark]);
}
