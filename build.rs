//! Compiles the one C file of the command line: the logger that FMUs call. A function with a
//! variable argument list can be called from stable Rust, but not defined in it.

fn main() {
    println!("cargo::rerun-if-changed=src/host/logger.c");
    cc::Build::new().file("src/host/logger.c").warnings(true).compile("punctual_host_logger");
}
