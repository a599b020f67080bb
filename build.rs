//! Compiles the one C file of the command line: the logger that FMUs call. Stable Rust can call a function with a
//! variable argument list, but not define one.

fn main() {
    println!("cargo::rerun-if-changed=src/host/logger.c");
    cc::Build::new().file("src/host/logger.c").warnings(true).compile("punctual_host_logger");
    // The stack that other systems give: Windows has 1 MiB, and descriptions may be nested 256 deep.
    let target = |key: &str| std::env::var(format!("CARGO_CFG_TARGET_{key}")).unwrap_or_default();
    match (target("OS").as_str(), target("ENV").as_str()) {
        ("windows", "msvc") => println!("cargo::rustc-link-arg-bins=/STACK:8388608"),
        ("windows", _) => println!("cargo::rustc-link-arg-bins=-Wl,--stack,8388608"),
        _ => {}
    }
}
