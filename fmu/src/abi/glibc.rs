//! Old versions of glibc's functions, so that the shared library loads on distributions from 2014 on
//! (glibc 2.17), wherever it was built. `build.rs` redirects the calls of the library, its dependencies
//! and the standard library to the names defined here.
//!
//! Functions that got a new version are named with the old one. `stat64` and `fstat64` were macros around another
//! function until 2.33. The last four came later than 2.17: they are left undefined, weak, and the standard
//! library asks at run time whether they are there and does without.

use std::arch::global_asm;

/// Links `__wrap_<name>` to `<name>` of `version`.
macro_rules! version {
    ($($name:literal $version:literal)*) => {$(global_asm!(
        concat!(".symver punctual_", $name, ",", $name, "@", $version),
        concat!(".hidden __wrap_", $name),
        concat!(".globl __wrap_", $name),
        concat!(".type __wrap_", $name, ",@function"),
        concat!("__wrap_", $name, ":"),
        concat!("jmp [rip + punctual_", $name, "@GOTPCREL]"),
        concat!(".size __wrap_", $name, ", . - __wrap_", $name),
    );)*};
}

/// Links `__wrap_<name>(a, b)` to `<old>(1, a, b)`, where 1 is the layout of the structure on x86-64.
macro_rules! status {
    ($($name:literal $old:literal)*) => {$(global_asm!(
        concat!(".symver punctual_", $name, ",", $old, "@GLIBC_2.2.5"),
        concat!(".hidden __wrap_", $name),
        concat!(".globl __wrap_", $name),
        concat!(".type __wrap_", $name, ",@function"),
        concat!("__wrap_", $name, ":"),
        "mov rdx, rsi",
        "mov rsi, rdi",
        "mov edi, 1",
        concat!("jmp [rip + punctual_", $name, "@GOTPCREL]"),
        concat!(".size __wrap_", $name, ", . - __wrap_", $name),
    );)*};
}

/// Declares `__wrap_<name>` weak and leaves it undefined.
macro_rules! absent {
    ($($name:literal)*) => {$(global_asm!(
        concat!(".weak __wrap_", $name),
        concat!(".hidden __wrap_", $name),
    );)*};
}

version! {
    "hypot" "GLIBC_2.2.5"
    "exp" "GLIBC_2.2.5"
    "log" "GLIBC_2.2.5"
    "pow" "GLIBC_2.2.5"
    "pthread_key_create" "GLIBC_2.2.5"
    "pthread_key_delete" "GLIBC_2.2.5"
    "pthread_setspecific" "GLIBC_2.2.5"
    "dlopen" "GLIBC_2.2.5"
    "dlsym" "GLIBC_2.2.5"
    "dlclose" "GLIBC_2.2.5"
    "dlerror" "GLIBC_2.2.5"
}
status! {
    "stat64" "__xstat64"
    "fstat64" "__fxstat64"
}
absent! {
    "gettid"
    "statx"
    "getrandom"
    "__cxa_thread_atexit_impl"
}
