//! The FMUs of `tests/fixtures/misbehaving.c` and, for FMI 3.0, `sundry.c`: sound except for one defect,
//! which the GUID or the instantiation token selects.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};

use punctual_cosim::host::PLATFORM;
use punctual_modeldescription::{Archive, fmi3};

use crate::workshop::Workshop;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

/// The model description with edits, each of which must match.
pub(crate) fn description(defect: &str, edits: &[(&str, &str)]) -> String {
    edited("misbehaving.xml", &[&[("guid=\"none\"", &*format!("guid=\"{defect}\""))], edits].concat())
}

/// The model description of the FMU of FMI 3.0, with edits.
pub(crate) fn sundry(defect: &str, edits: &[(&str, &str)]) -> String {
    let token = format!("instantiationToken=\"{defect}\"");
    edited("sundry.xml", &[&[("instantiationToken=\"none\"", &*token)], edits].concat())
}

fn edited(name: &str, edits: &[(&str, &str)]) -> String {
    let mut xml = fs::read_to_string(fixture(name)).expect("the fixture");
    for (from, to) in edits {
        assert!(xml.contains(from), "{from:?} in {xml}");
        xml = xml.replacen(from, to, 1);
    }
    xml
}

static COMPILED: Mutex<Option<HashMap<Vec<String>, Vec<u8>>>> = Mutex::new(None);

/// The shared library, compiled once with these macros by the system's C compiler.
pub(crate) fn library(macros: &[&str]) -> Vec<u8> {
    compiled("misbehaving.c", macros)
}

fn compiled(source: &str, macros: &[&str]) -> Vec<u8> {
    let key: Vec<String> =
        [source.to_owned()].into_iter().chain(macros.iter().map(|name| format!("-D{name}"))).collect();
    let mut compiled = COMPILED.lock().unwrap_or_else(PoisonError::into_inner);
    let compiled = compiled.get_or_insert_default();
    compiled.entry(key.clone()).or_insert_with(|| compile(source, &key[1..])).clone()
}

fn compile(source: &str, macros: &[String]) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let product = folder.path().join("library");
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
    let mut command = Command::new(&compiler);
    command.args(["-shared", "-fPIC", "-fvisibility=hidden", "-Wall", "-Wextra", "-Werror"]).args(macros);
    if cfg!(unix) {
        command.arg("-pthread");
    }
    command.arg(fixture(source)).arg("-o").arg(&product).arg("-lm");
    let done = command.output().unwrap_or_else(|e| {
        panic!("these tests need a C compiler, and {compiler} (or what CC names) cannot be started: {e}")
    });
    assert!(done.status.success(), "{compiler}: {}", String::from_utf8_lossy(&done.stderr));
    fs::read(&product).expect("what the compiler made")
}

/// Writes the FMU with this description and library.
pub(crate) fn write(workshop: &Workshop, name: &str, xml: impl Into<Vec<u8>>, library: &[u8]) {
    put(workshop, name, xml, (&format!("{PLATFORM}/misbehaving"), library));
}

/// Writes the FMU with this description, and its library at this path below `binaries/`, given without
/// extension.
pub(crate) fn write_at(workshop: &Workshop, name: &str, xml: impl Into<Vec<u8>>, place: &str) {
    put(workshop, name, xml, (place, &library(&[])));
}

/// Writes the FMU of FMI 3.0 with this description, its library compiled with these macros.
pub(crate) fn write_sundry(workshop: &Workshop, name: &str, xml: impl Into<Vec<u8>>, macros: &[&str]) {
    let library = compiled("sundry.c", macros);
    put(workshop, name, xml, (&format!("{}/sundry", fmi3::PLATFORM), &library));
}

fn put(workshop: &Workshop, name: &str, xml: impl Into<Vec<u8>>, (place, library): (&str, &[u8])) {
    let mut archive = Archive::new();
    archive.add("modelDescription.xml", xml).expect("an entry");
    let suffix = std::env::consts::DLL_SUFFIX;
    archive.add(&format!("binaries/{place}{suffix}"), library).expect("an entry");
    workshop.write(name, archive.to_bytes().expect("an archive"));
}
