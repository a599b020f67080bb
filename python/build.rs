//! Keeps the exports of the FMUs' shared library, which the crate `punctual-fmu` is too, out of the module's
//! exports.

use std::env;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    // Zig (python/wheel --portable) has no such argument. The exports do no harm there: Python loads modules with
    // RTLD_LOCAL.
    let zig = env::var("RUSTC_LINKER").is_ok_and(|linker| linker.contains("zigcc"));
    if env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("linux") && !zig {
        println!("cargo::rustc-cdylib-link-arg=-Wl,--exclude-libs,ALL");
    }
}
