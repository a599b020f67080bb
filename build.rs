//! Compiles the one C file of the command line: the logger that FMUs call. Stable Rust can call a function with a
//! variable argument list, but not define one.

fn main() {
    println!("cargo::rerun-if-changed=src/host/logger.c");
    cc::Build::new().file("src/host/logger.c").warnings(true).compile("punctual_host_logger");
    // The stack that other systems give: Windows has 1 MiB, and descriptions may be nested 256 deep.
    if std::env::var("CARGO_CFG_TARGET_ENV").is_ok_and(|environment| environment == "msvc") {
        println!("cargo::rustc-link-arg-bins=/STACK:8388608");
    }
}
