//! `punctual merge`: the merged FMU, and everything that is refused. The second platform is simulated: the
//! FMU with its library in another folder, as if it had been built there.

use std::collections::BTreeMap;
use std::io::{Cursor, Write};

use punctual_cosim::host::PLATFORM;
use punctual_modeldescription::Archive;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use crate::misbehaving::{self, description};
use crate::workshop::{Workshop, assert_golden, without_guids};

/// The platform of the second FMU, whose libraries have the format of Linux.
const OTHER: &str = "aarch64-linux";

pub(crate) type Entries = BTreeMap<String, Vec<u8>>;

/// The entries of an FMU.
pub(crate) fn entries(workshop: &Workshop, name: &str) -> Entries {
    let mut entries = Entries::new();
    workshop.edit_fmu(name, |entry, bytes| {
        entries.insert(entry.to_owned(), bytes.clone());
        Some(bytes)
    });
    entries
}

/// Writes an FMU with these entries.
pub(crate) fn write(workshop: &Workshop, name: &str, entries: &Entries) {
    let mut archive = Archive::new();
    for (entry, bytes) in entries {
        archive.add(entry, bytes.as_slice()).expect("an entry of its own");
    }
    workshop.write(name, archive.to_bytes().expect("an archive"));
}

/// The entries with the folders of this platform renamed to those of `platform`, and its files edited.
pub(crate) fn elsewhere(entries: &Entries, platform: &str, edit: impl Fn(&mut Vec<u8>)) -> Entries {
    let (here, there) = (format!("/{PLATFORM}/"), format!("/{platform}/"));
    let moved = entries.iter().map(|(entry, bytes)| {
        let mut bytes = bytes.clone();
        if entry.contains(&here) {
            edit(&mut bytes);
        }
        (entry.replace(&here, &there), bytes)
    });
    moved.collect()
}

/// Turns an ELF library into one of [`OTHER`]: the processor is in bytes 18 and 19.
pub(crate) fn for_other_processor(library: &mut [u8]) {
    assert!(library.starts_with(b"\x7fELF"), "this test makes a library of Linux one for another processor");
    library[18..20].copy_from_slice(&[183, 0]);
}

/// A workshop with `here.fmu`, the filter of the example, and `there.fmu`, the same for [`OTHER`].
fn two_systems() -> Workshop {
    let workshop = Workshop::with_fmus();
    let here = entries(&workshop, "filter.fmu");
    write(&workshop, "here.fmu", &here);
    write(&workshop, "there.fmu", &elsewhere(&here, OTHER, |bytes| for_other_processor(bytes)));
    workshop
}

#[test]
fn two_systems_become_one() {
    let workshop = two_systems();
    let done = workshop.punctual(["merge", "here.fmu", "there.fmu", "-o", "both.fmu"]);
    assert_eq!(done.stderr, "");
    let printed =
        format!("both.fmu: unicycle_filter for {OTHER} (there.fmu), {PLATFORM} (here.fmu), guid {{GUID}}\n");
    assert_eq!(without_guids(&done.success()), printed);
    let (here, there) = (entries(&workshop, "here.fmu"), entries(&workshop, "there.fmu"));
    assert_eq!((here.len(), there.len()), (6, 6));
    let mut union = here.clone();
    union.extend(there);
    assert_eq!(union.len(), 7);
    assert!(entries(&workshop, "both.fmu") == union, "not the entries of both");
    // Other commands accept the merged FMU, and no temporary file is left.
    assert_eq!(workshop.punctual(["validate", "both.fmu"]).success(), "both.fmu: no errors, no warnings\n");
    assert_eq!(workshop.files(), ["both.fmu", "filter.fmu", "here.fmu", "plant.fmu", "there.fmu"]);
}

#[test]
fn neither_order_nor_repetition_changes_a_byte() {
    let workshop = two_systems();
    let merge = |files: &[&str], product: &str| {
        workshop.punctual([&["merge", "--no-trial", "-o", product], files].concat()).success();
        workshop.bytes(product)
    };
    let both = merge(&["here.fmu", "there.fmu"], "both.fmu");
    assert!(both == merge(&["there.fmu", "here.fmu"], "reverse.fmu"), "the order shows");
    assert!(
        both == merge(&["both.fmu", "there.fmu", "here.fmu"], "again.fmu"),
        "what is there already shows"
    );
    // The merged FMU may replace one of the files.
    assert!(both == merge(&["here.fmu", "there.fmu"], "here.fmu"), "the name of the product shows");
    assert!(workshop.bytes("filter.fmu") == merge(&["filter.fmu", "filter.fmu"], "same.fmu"));
}

#[test]
fn what_is_told_as_json() {
    let workshop = two_systems();
    let windows = elsewhere(&entries(&workshop, "here.fmu"), "win64", |bytes| bytes.truncate(100));
    let windows = windows.into_iter().map(|(entry, bytes)| (entry.replace(".so", ".dll"), bytes));
    let mut windows: Entries = windows.collect();
    windows.insert("extra/notes.txt".to_owned(), b"for all".to_vec());
    write(&workshop, "windows.fmu", &windows);
    // One FMU has a folder without a file.
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (entry, bytes) in entries(&workshop, "there.fmu") {
        zip.start_file(entry, SimpleFileOptions::default()).expect("an entry");
        zip.write_all(&bytes).expect("memory");
    }
    zip.start_file("extra/notes.txt", SimpleFileOptions::default()).expect("an entry");
    zip.write_all(b"for all").expect("memory");
    zip.add_directory("extra/", SimpleFileOptions::default()).expect("an entry");
    zip.add_directory("resources/tables/", SimpleFileOptions::default()).expect("an entry");
    workshop.write("there.fmu", zip.finish().expect("an archive").into_inner());
    let done = workshop.punctual(["merge", "there.fmu", "windows.fmu", "-o", "both.fmu", "--json"]);
    let notes = format!(
        "note: left out, since it is empty: resources/tables/\n\
         note: not examined: the trial: there is no library for {PLATFORM}\n\
         note: `punctual validate both.fmu` finds errors (1)\n"
    );
    assert_eq!(done.stderr, notes);
    let printed = without_guids(&done.success());
    assert_golden("merge.json", &printed.replace(&format!("library for {PLATFORM}"), "library for PLATFORM"));
}

/// FMUs of another tool that contain the time of writing, in the style of each system.
#[test]
fn fmus_of_others_may_say_when_they_were_written() {
    let workshop = Workshop::new();
    misbehaving::write(&workshop, "a.fmu", description("none", &[]), &misbehaving::library(&[]));
    let a = entries(&workshop, "a.fmu");
    let mut b = elsewhere(&a, "win64", |bytes| *bytes = b"MZ".to_vec());
    let later =
        description("none", &[("2026-01-31T00:00:00Z", "2026-02-01T12:00:00Z")]).replace('\n', "\r\n");
    b.insert("modelDescription.xml".to_owned(), later.into_bytes());
    write(&workshop, "b.fmu", &b);
    for files in [["a.fmu", "b.fmu"], ["b.fmu", "a.fmu"]] {
        let done = workshop.punctual(["merge", files[0], files[1], "-o", "both.fmu"]);
        let printed = format!("both.fmu: misbehaving for {PLATFORM} (a.fmu), win64 (b.fmu), guid none\n");
        assert_eq!(done.success(), printed);
        let both = entries(&workshop, "both.fmu");
        assert!(both["modelDescription.xml"] == a["modelDescription.xml"], "not the earlier one");
        assert_eq!(both.len(), 3);
    }
}

/// Each single difference is refused with its message, and the output file is unchanged.
#[test]
fn what_differs_is_refused() {
    let workshop = Workshop::with_fmus();
    let own_library = format!("binaries/{PLATFORM}/unicycle_filter{}", std::env::consts::DLL_SUFFIX);
    let mut here = entries(&workshop, "filter.fmu");
    // Nothing is run, so a placeholder is enough for a library.
    here.insert(own_library.clone(), b"a library".to_vec());
    write(&workshop, "here.fmu", &here);
    let there = elsewhere(&here, OTHER, |bytes| bytes.push(b'!'));
    let text = |entries: &Entries, name: &str| String::from_utf8(entries[name].clone()).expect("UTF-8");
    let xml = text(&there, "modelDescription.xml");
    let described = |from: &str, to: &str| {
        assert!(xml.contains(from), "{from:?} in {xml}");
        let edited = xml.replacen(from, to, 1).into_bytes();
        let mut entries = there.clone();
        entries.insert("modelDescription.xml".to_owned(), edited);
        entries
    };
    let guid = xml.split("guid=\"{").nth(1).and_then(|rest| rest.get(..36)).expect("a GUID");
    let with = |entry: &str, bytes: Option<&[u8]>| {
        let mut entries = there.clone();
        match bytes {
            Some(bytes) => entries.insert(entry.to_owned(), bytes.to_vec()),
            None => entries.remove(entry),
        };
        entries
    };
    let configuration = text(&there, "resources/configuration.toml").replacen("margin", "Margin", 1);
    let cases = [
        ("another guid", described(guid, "00000000-0000-0000-0000-000000000000")),
        ("another version", described("\" version=\"", "\" version=\"9.")),
        ("another start value", described("start=\"10.0\"", "start=\"10.5\"")),
        (
            "another number of variables",
            described("<ScalarVariable ", "<ScalarVariable name=\"v\"/><ScalarVariable "),
        ),
        ("another version of FMI", described("fmiVersion=\"2.0\"", "fmiVersion=\"3.0\"")),
        ("no description", with("modelDescription.xml", None)),
        ("another configuration", with("resources/configuration.toml", Some(configuration.as_bytes()))),
        ("a file more", with("resources/table.csv", Some(b"1,2"))),
        ("a file less", with("model.png", None)),
        ("another build", with(&own_library, Some(b"another library"))),
        ("a platform with more files", with(&format!("binaries/{PLATFORM}/helper"), Some(b"1"))),
        (
            "no binaries",
            with(&format!("binaries/{OTHER}/unicycle_filter{}", std::env::consts::DLL_SUFFIX), None),
        ),
    ];
    let mut printed = String::new();
    for (what, entries) in cases {
        write(&workshop, "other.fmu", &entries);
        let done = workshop.punctual(["merge", "here.fmu", "other.fmu", "-o", "both.fmu"]);
        assert_eq!((done.code, done.stdout.as_str()), (1, ""), "{what}: {done:?}");
        assert!(!workshop.files().contains(&"both.fmu".to_owned()), "{what}");
        printed += &format!("{what}\n    {}", done.stderr);
    }
    let printed = without_guids(&printed);
    assert_golden(
        "merge-refused.txt",
        &printed.replace(PLATFORM, "PLATFORM").replace(env!("CARGO_PKG_VERSION"), "VERSION"),
    );
}

#[test]
fn a_product_that_does_not_work_takes_no_place() {
    let workshop = Workshop::new();
    misbehaving::write(&workshop, "a.fmu", description("crash-in-enter", &[]), &misbehaving::library(&[]));
    let library = misbehaving::library(&[]);
    let other = elsewhere(&entries(&workshop, "a.fmu"), OTHER, |bytes| for_other_processor(bytes));
    write(&workshop, "b.fmu", &other);
    workshop.write("both.fmu", "as before");
    let merge = ["merge", "a.fmu", "b.fmu", "-o", "both.fmu"];
    workshop.punctual(merge).fails(
        1,
        "both.fmu: cannot be merged: the product does not work here: in fmi2EnterInitializationMode at t = 0 s the \
         FMU crashed with signal 11 (invalid memory access)",
    );
    assert_eq!((workshop.text("both.fmu").as_str(), workshop.files().len()), ("as before", 3));
    // A library that cannot be loaded is reported with the name of the output file.
    misbehaving::write(&workshop, "a.fmu", description("crash-in-enter", &[]), &library[..4096]);
    let done = workshop.punctual(merge);
    assert_eq!(done.code, 0, "symbols are missing, so nothing is run: {done:?}");
    let skipped = format!("note: not examined: the trial: the library is not complete for {PLATFORM}\n");
    assert!(done.stderr.contains(&skipped), "{done:?}");
    // Nothing is run if so requested.
    misbehaving::write(&workshop, "a.fmu", description("crash-in-enter", &[]), &library);
    let done = workshop.punctual(merge.iter().chain(&["--no-trial"]));
    assert_eq!(done.stderr, "note: not examined: the trial: it was not wanted\n");
    done.success();
}

#[test]
fn wrong_usage() {
    let workshop = two_systems();
    workshop.punctual(["merge", "here.fmu", "-o", "both.fmu"]).fails_like(
        2,
        "2 values required",
        &["<FMU> <FMU>"],
    );
    workshop.punctual(["merge", "here.fmu", "no.fmu", "-o", "both.fmu"]).fails_like(
        2,
        "cannot read no.fmu: ",
        &[],
    );
    let done = workshop.punctual(["merge", "here.fmu", "there.fmu", "-o", "no/both.fmu"]);
    done.fails_like(2, "cannot write no/both.fmu: ", &[]);
    std::fs::create_dir(workshop.path("folder")).expect("a folder");
    let done = workshop.punctual(["merge", "here.fmu", "there.fmu", "-o", "folder", "--no-trial"]);
    done.fails_like(2, "cannot write folder: ", &[]);
    workshop.write("here.fmu", "no archive");
    let done = workshop.punctual(["merge", "there.fmu", "here.fmu", "-o", "both.fmu"]);
    done.fails_like(1, "here.fmu: not a readable FMU archive: ", &[]);
}

/// Names that are two files on one system can be one file on another.
#[test]
fn names_that_differ_in_case_do_not_come_together() {
    let workshop = two_systems();
    let mut there = entries(&workshop, "there.fmu");
    there.insert(format!("binaries/{}/x", PLATFORM.to_uppercase()), b"1".to_vec());
    write(&workshop, "there.fmu", &there);
    let mut here = entries(&workshop, "here.fmu");
    here.insert(format!("binaries/{PLATFORM}/X"), b"2".to_vec());
    write(&workshop, "here.fmu", &here);
    workshop.punctual(["merge", "here.fmu", "there.fmu", "-o", "both.fmu"]).fails(
        1,
        &format!(
            "both.fmu: cannot be merged: the product does not work here: not a readable FMU archive: the entry \
             {:?} is there twice (upper and lower case apart)",
            format!("binaries/{PLATFORM}/X")
        ),
    );
}
