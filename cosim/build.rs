//! Compiles the one C file of the host: the logger that FMUs call. Stable Rust can call a function with a variable
//! argument list, but not define one.

fn main() {
    println!("cargo::rerun-if-changed=src/host/logger.c");
    cc::Build::new().file("src/host/logger.c").warnings(true).compile("punctual_host_logger");
}
