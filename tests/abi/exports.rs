//! Symbols, version, and NULL components.

use std::collections::BTreeSet;
use std::ffi::CStr;
use std::process::Command;
use std::ptr::{null, null_mut};

use punctual_fmu::fmi2::FUNCTIONS;
use punctual_fmu::fmi3;

use crate::api::{API, ERROR, library_path, three};

#[test]
fn all_34_functions_resolve() {
    let unique: BTreeSet<_> = FUNCTIONS.iter().collect();
    assert_eq!(unique.len(), 34, "{FUNCTIONS:?}");
    // Loading resolves each symbol.
    let _ = &*API;
}

#[test]
fn all_75_functions_of_fmi3_resolve() {
    let unique: BTreeSet<_> = fmi3::FUNCTIONS.iter().collect();
    assert_eq!(unique.len(), 75, "{:?}", fmi3::FUNCTIONS);
    let _ = &*three::API;
    // SAFETY: a static string of the library.
    assert_eq!(unsafe { CStr::from_ptr((three::API.get_version)()) }, c"3.0");
}

/// Output of a tool of binutils on the library.
fn tool_output(tool: &str, arguments: &[&str]) -> String {
    match Command::new(tool).args(arguments).arg(library_path()).output() {
        Ok(output) if output.status.success() => String::from_utf8(output.stdout).unwrap(),
        problem => panic!("this test needs {tool} of binutils: {problem:?}"),
    }
}

#[test]
fn nothing_else_is_exported() {
    let text = tool_output("nm", &["-D", "--defined-only"]);
    let found: BTreeSet<_> = text.lines().filter_map(|line| line.split_whitespace().last()).collect();
    let wanted: BTreeSet<_> = FUNCTIONS.iter().chain(fmi3::FUNCTIONS).copied().collect();
    assert_eq!(found, wanted);
}

/// Distributions of 2014 have glibc 2.17 (RHEL 7) or 2.19 (Debian 8, Ubuntu 14.04).
#[cfg(all(target_os = "linux", target_env = "gnu", target_arch = "x86_64"))]
#[test]
fn a_glibc_of_2014_is_enough() {
    const NEWEST: [u32; 2] = [2, 17];
    let text = tool_output("readelf", &["--wide", "--version-info"]);
    let versions = text.split_whitespace().filter_map(|word| word.strip_prefix("GLIBC_"));
    let parsed = versions.map(|v| v.split('.').map(|part| part.parse().unwrap()).collect::<Vec<u32>>());
    let needed: BTreeSet<_> = parsed.collect();
    assert!(!needed.is_empty(), "{text}");
    let newer: Vec<_> = needed.iter().filter(|v| v.as_slice() > NEWEST.as_slice()).collect();
    assert!(newer.is_empty(), "add what needs {newer:?} to fmu/build.rs and fmu/src/abi/glibc.rs:\n{text}");
}

/// It needs nothing but parts of glibc: the unwinder is linked in, and panics are still caught (`panics` in
/// `fmu/src/abi/guard`).
#[cfg(all(target_os = "linux", target_env = "gnu", target_arch = "x86_64"))]
#[test]
fn glibc_is_all_that_is_needed() {
    const PARTS: [&str; 5] =
        ["libc.so.6", "libm.so.6", "libdl.so.2", "libpthread.so.0", "ld-linux-x86-64.so.2"];
    let text = tool_output("readelf", &["--wide", "--dynamic"]);
    let needed = text.lines().filter(|line| line.contains("(NEEDED)"));
    let others: Vec<_> = needed.filter(|line| !PARTS.iter().any(|part| line.contains(part))).collect();
    assert!(others.is_empty(), "{others:?}");
}

#[test]
fn version_and_platform() {
    // SAFETY: static strings of the library.
    let version = unsafe { CStr::from_ptr((API.get_version)()) };
    // SAFETY: as above.
    let platform = unsafe { CStr::from_ptr((API.get_types_platform)()) };
    assert_eq!((version, platform), (c"2.0", c"default"));
}

/// Every function that takes a component, called with NULL.
#[test]
fn a_null_component_is_an_error_everywhere() {
    let (c, reference, mut size, mut real, mut int) = (null_mut(), 0, 0, 1.5, 7);
    let (refs, size, real, int) = (&raw const reference, &raw mut size, &raw mut real, &raw mut int);
    let mut text = null();
    let text = &raw mut text;
    let mut state = null_mut();
    let state = &raw mut state;
    (API.free_instance)(c);
    let statuses = [
        (API.set_debug_logging)(c, 1, 0, null()),
        (API.setup_experiment)(c, 0, 0.0, 0.0, 0, 0.0),
        (API.enter_initialization_mode)(c),
        (API.exit_initialization_mode)(c),
        (API.terminate)(c),
        (API.reset)(c),
        (API.get_real)(c, refs, 1, real),
        (API.get_integer)(c, refs, 1, int),
        (API.get_boolean)(c, refs, 1, int),
        (API.get_string)(c, refs, 1, text),
        (API.set_real)(c, refs, 1, real),
        (API.set_integer)(c, refs, 1, int),
        (API.set_boolean)(c, refs, 1, int),
        (API.set_string)(c, refs, 1, text),
        (API.get_state)(c, state),
        (API.set_state)(c, null_mut()),
        (API.free_state)(c, state),
        (API.serialized_size)(c, null_mut(), size),
        (API.serialize)(c, null_mut(), null_mut(), 0),
        (API.deserialize)(c, null(), 0, state),
        (API.directional_derivative)(c, refs, 1, refs, 1, real, real),
        (API.set_input_derivatives)(c, refs, 1, int, real),
        (API.get_output_derivatives)(c, refs, 1, int, real),
        (API.do_step)(c, 0.0, 0.1, 0),
        (API.cancel_step)(c),
        (API.get_status)(c, 0, int),
        (API.get_real_status)(c, 2, real),
        (API.get_integer_status)(c, 0, int),
        (API.get_boolean_status)(c, 3, int),
        (API.get_string_status)(c, 1, text),
    ];
    assert_eq!(statuses.len(), 34 - 4, "all but the two constants, fmi2Instantiate and fmi2FreeInstance");
    assert_eq!(statuses, [ERROR; 30]);
    // SAFETY: a local variable that still lives.
    assert_eq!(unsafe { *real }, 1.5, "nothing was written");
    // SAFETY: as above.
    assert_eq!(unsafe { *int }, 7, "nothing was written");
}

/// Importers load with `RTLD_NOW`, so every symbol must resolve at once.
#[cfg(unix)]
#[test]
fn loads_with_every_symbol_resolved_at_once() {
    use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
    // SAFETY: the library has no initialisers of its own.
    let library = unsafe { Library::open(Some(library_path()), RTLD_NOW | RTLD_LOCAL) };
    library.unwrap_or_else(|e| panic!("{e}"));
}
