//! Gives the shared library its name on macOS, and elsewhere links it against the oldest glibc that Rust's standard library
//! supports, whichever the machine has, and with an unwinder of its own. Calls of functions of newer versions go to those that `src/abi/glibc.rs` defines.

use std::process::Command;
use std::{env, fs};

/// Functions with versions newer than 2.17, which the linker redirects to `__wrap_<name>`.
const NEWER: [&str; 20] = [
    "hypot",
    "exp",
    "log",
    "pow",
    "stat64",
    "fstat64",
    "pthread_key_create",
    "pthread_key_delete",
    "pthread_setspecific",
    "__pthread_key_create",
    "pthread_once",
    "_dl_find_object",
    "dlopen",
    "dlsym",
    "dlclose",
    "dlerror",
    "gettid",
    "statx",
    "getrandom",
    "__cxa_thread_atexit_impl",
];

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-check-cfg=cfg(old_glibc)");
    let target = |key: &str| env::var(format!("CARGO_CFG_TARGET_{key}")).unwrap_or_default();
    if target("OS") == "macos" {
        // Not the place where it was made.
        println!("cargo::rustc-cdylib-link-arg=-Wl,-install_name,@rpath/libpunctual_fmu.dylib");
    }
    if (target("OS").as_str(), target("ENV").as_str(), target("ARCH").as_str()) != ("linux", "gnu", "x86_64")
    {
        return;
    }
    // Zig (release/portable) links against the old version itself, and refuses the arguments below.
    if env::var("RUSTC_LINKER").is_ok_and(|linker| linker.contains("zigcc")) {
        return;
    }
    println!("cargo::rustc-cfg=old_glibc");
    for name in NEWER {
        println!("cargo::rustc-cdylib-link-arg=-Wl,--wrap={name}");
    }
    // Before glibc 2.34, threads and the loading of libraries had libraries of their own. Since then empty
    // libraries have their names.
    println!(
        "cargo::rustc-cdylib-link-arg=-Wl,--push-state,--no-as-needed,-l:libpthread.so.0,-l:libdl.so.2,--pop-state"
    );
    link_unwinder();
}

/// Links the compiler's unwinder into the library, so that it needs no `libgcc_s.so.1`: the standard library asks for that by
/// name, and finds a script with this name first. Where the linker has no static one, such as Clang without GCC, it stays.
fn link_unwinder() {
    const STATIC: &str = "libgcc_eh.a";
    let linker = env::var("RUSTC_LINKER").unwrap_or_else(|_| "cc".to_owned());
    let reported = Command::new(linker).arg(format!("-print-file-name={STATIC}")).output();
    // Where there is none, it says the name alone.
    let has_one = reported.is_ok_and(|reported| reported.stdout.starts_with(b"/"));
    let folder = env::var("OUT_DIR").unwrap_or_default();
    if has_one && fs::write(format!("{folder}/libgcc_s.so"), "GROUP ( -lgcc_eh -lgcc )\n").is_ok() {
        println!("cargo::rustc-cdylib-link-arg=-L{folder}");
    }
}
