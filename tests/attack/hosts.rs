//! Runs two C programs, `tests/fixtures/host.c` for FMI 2.0 and `host3.c` for 3.0, with every FMU of the
//! fleet: once under AddressSanitizer and UBSan, once under valgrind. An invalid memory access is an error,
//! and so is memory that remains after `fmi2FreeInstance` and `dlclose`. `PUNCTUAL_ATTACK_LIBRARY` selects
//! another build of the shared library, such as an instrumented one, which valgrind does not support
//! (`tests/nightly`).

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::arrays;
use crate::fleet::FLEET;
use crate::workshop::Workshop;

/// The two hosts: the source, and GUID and resources of each FMU in the form it expects.
fn hosts() -> [(&'static str, Vec<String>); 2] {
    let two = FLEET.iter().flat_map(|fmu| [fmu.guid().to_owned(), fmu.location()]).collect();
    let three = arrays::FLEET.iter().flat_map(|fmu| [fmu.guid().to_owned(), fmu.path()]).collect();
    [("host", two), ("host3", three)]
}

/// Compiles a host; returns the compiler's output and the program.
fn compiled(workshop: &Workshop, host: &str, flags: &[&str]) -> (Output, PathBuf) {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/fixtures/{host}.c"));
    let program = workshop.path(host);
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
    let mut command = Command::new(&compiler);
    command.args(["-g", "-Wall", "-Wextra", "-Werror"]).args(flags).arg(source).arg("-o").arg(&program);
    let output = command.args(["-ldl", "-lm"]).output();
    (
        output.unwrap_or_else(|e| panic!("this test needs a C compiler, {compiler} or what CC names: {e}")),
        program,
    )
}

/// The library.
fn library(workshop: &Workshop) -> String {
    let library = std::env::var("PUNCTUAL_ATTACK_LIBRARY");
    library.unwrap_or_else(|_| workshop.path("library").display().to_string())
}

/// Reports on the terminal, bypassing the capture of test output, that something was not tested; in CI that
/// is a failure.
fn skipped(what: &str, why: &str) {
    let text = format!("\nNOT TESTED: the C host under {what}: {why}\n");
    assert!(std::env::var_os("CI").is_none(), "{text}");
    std::io::stderr().write_all(text.as_bytes()).expect("a terminal");
}

#[track_caller]
fn clean(output: &Output) {
    let [out, err] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
    assert!(output.status.success() && err.is_empty(), "{}\n{out}\n{err:.20000}", output.status);
    let calls = out.strip_suffix(" calls\n").and_then(|n| n.parse::<u32>().ok());
    assert!(calls.is_some_and(|n| n > 1000), "{out}");
    println!("{out}");
}

#[test]
fn a_c_host_under_address_and_undefined_behaviour_sanitizers() {
    let workshop = Workshop::with_library();
    let flags = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"];
    for (name, fmus) in hosts() {
        let (compiler, host) = compiled(&workshop, name, &flags);
        if !compiler.status.success() {
            let (plain, _) = compiled(&workshop, name, &[]);
            assert!(plain.status.success(), "{}", String::from_utf8_lossy(&plain.stderr));
            let why = String::from_utf8_lossy(&compiler.stderr);
            return skipped("AddressSanitizer", why.lines().last().unwrap_or_default());
        }
        let mut command = Command::new(host);
        command.arg(library(&workshop)).args(fmus);
        command.env("ASAN_OPTIONS", "detect_leaks=1").env("UBSAN_OPTIONS", "print_stacktrace=1");
        clean(&command.output().expect("the host"));
    }
}

#[test]
fn a_c_host_under_valgrind() {
    if let Err(why) = Command::new("valgrind").arg("--version").output() {
        return skipped("valgrind", &why.to_string());
    }
    let workshop = Workshop::with_library();
    for (name, fmus) in hosts() {
        let (compiler, host) = compiled(&workshop, name, &[]);
        assert!(compiler.status.success(), "{}", String::from_utf8_lossy(&compiler.stderr));
        let mut command = Command::new("valgrind");
        command.args(["-q", "--leak-check=full", "--show-leak-kinds=all", "--errors-for-leak-kinds=all"]);
        command.args(["--error-exitcode=9", "--keep-debuginfo=yes"]).arg(host).arg(library(&workshop));
        clean(&command.args(fmus).output().expect("valgrind"));
    }
}
