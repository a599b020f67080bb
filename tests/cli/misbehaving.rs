//! The FMU of `tests/fixtures/misbehaving.c`: sound but for one defect, which its GUID names.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};

use punctual::host::PLATFORM;
use punctual_modeldescription::Archive;

use crate::workshop::Workshop;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

/// The model description, with edits; each must touch something.
pub(crate) fn description(defect: &str, edits: &[(&str, &str)]) -> String {
    let mut xml = fs::read_to_string(fixture("misbehaving.xml")).expect("the fixture");
    for (from, to) in [("guid=\"none\"", &*format!("guid=\"{defect}\""))].iter().chain(edits) {
        assert!(xml.contains(from), "{from:?} in {xml}");
        xml = xml.replacen(from, to, 1);
    }
    xml
}

static COMPILED: Mutex<Option<HashMap<Vec<String>, Vec<u8>>>> = Mutex::new(None);

/// The shared library, compiled with these macros by the system's C compiler, once.
pub(crate) fn library(macros: &[&str]) -> Vec<u8> {
    let key: Vec<String> = macros.iter().map(|name| format!("-D{name}")).collect();
    let mut compiled = COMPILED.lock().unwrap_or_else(PoisonError::into_inner);
    let compiled = compiled.get_or_insert_default();
    compiled.entry(key.clone()).or_insert_with(|| compile(&key)).clone()
}

fn compile(macros: &[String]) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let product = folder.path().join("library");
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
    let mut command = Command::new(&compiler);
    command.args(["-shared", "-fPIC", "-fvisibility=hidden", "-Wall", "-Wextra", "-Werror"]).args(macros);
    command.arg(fixture("misbehaving.c")).arg("-o").arg(&product).arg("-lm");
    let done = command.output().unwrap_or_else(|e| {
        panic!("these tests need a C compiler, and {compiler} (or what CC names) cannot be started: {e}")
    });
    assert!(done.status.success(), "{compiler}: {}", String::from_utf8_lossy(&done.stderr));
    fs::read(&product).expect("what the compiler made")
}

/// Writes the FMU with this description and library.
pub(crate) fn write(workshop: &Workshop, name: &str, xml: impl Into<Vec<u8>>, library: &[u8]) {
    let mut archive = Archive::new();
    archive.add("modelDescription.xml", xml).expect("an entry");
    let suffix = std::env::consts::DLL_SUFFIX;
    archive.add(&format!("binaries/{PLATFORM}/misbehaving{suffix}"), library).expect("an entry");
    workshop.write(name, archive.to_bytes().expect("an archive"));
}
