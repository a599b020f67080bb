//! Old versions of glibc's functions, so that the shared library loads on distributions from 2014 on (glibc
//! 2.17), wherever it was built. `build.rs` redirects the calls of the library, its dependencies and the
//! standard library to the names defined here.
//!
//! Functions with a newer version are linked to the old one. `stat64` and `fstat64` were macros around
//! another function until 2.33. The four functions in `absent!` came after 2.17. They remain weak and
//! undefined, and the standard library checks at run time whether they exist and works without them.
//! `_dl_find_object` is how the compiler's unwinder, which is linked into the library, finds an object's
//! table. Here it is implemented the way the table was found before 2.35.

use std::arch::global_asm;
use std::ffi::{c_char, c_int, c_void};
use std::ptr::null;

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
    "__pthread_key_create" "GLIBC_2.2.5"
    "pthread_once" "GLIBC_2.2.5"
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

/// `struct dl_phdr_info`, up to the fields that are read.
#[repr(C)]
struct Loaded {
    address: usize,
    name: *const c_char,
    headers: *const Header,
    count: u16,
}

/// `Elf64_Phdr`.
#[repr(C)]
struct Header {
    kind: u32,
    flags: u32,
    offset: usize,
    address: usize,
    physical: usize,
    file_size: usize,
    size: usize,
    align: usize,
}

/// `struct dl_find_object`.
#[repr(C)]
struct Found {
    flags: u64,
    begin: *const c_void,
    end: *const c_void,
    link_map: *const c_void,
    eh_frame: *const c_void,
    reserved: [u64; 7],
}

/// An address, and the object that contains it.
struct Wanted {
    address: usize,
    found: Option<Found>,
}

unsafe extern "C" {
    fn dl_iterate_phdr(
        callback: unsafe extern "C" fn(*const Loaded, usize, *mut c_void) -> c_int,
        data: *mut c_void,
    ) -> c_int;
}

/// If the object contains the address, notes it in `data`, a [`Wanted`], and ends the iteration.
unsafe extern "C" fn look(loaded: *const Loaded, _size: usize, data: *mut c_void) -> c_int {
    const LOAD: u32 = 1;
    const EH_FRAME: u32 = 0x6474_e550;
    // SAFETY: `dl_iterate_phdr` passes an object.
    let loaded = unsafe { &*loaded };
    // SAFETY: `dl_iterate_phdr` passes on the data it was given.
    let wanted = unsafe { &mut *data.cast::<Wanted>() };
    // SAFETY: the object has that many headers.
    let headers = unsafe { std::slice::from_raw_parts(loaded.headers, usize::from(loaded.count)) };
    let place = |header: &Header| loaded.address.wrapping_add(header.address);
    let Some(part) = headers
        .iter()
        .find(|header| header.kind == LOAD && wanted.address.wrapping_sub(place(header)) < header.size)
    else {
        return 0;
    };
    let Some(table) = headers.iter().find(|header| header.kind == EH_FRAME) else { return 1 };
    let pointer = |address: usize| address as *const c_void;
    wanted.found = Some(Found {
        flags: 0,
        begin: pointer(place(part)),
        end: pointer(place(part).wrapping_add(part.size)),
        link_map: null(),
        eh_frame: pointer(place(table)),
        reserved: [0; 7],
    });
    1
}

/// `_dl_find_object`: writes the object that contains `address`, up to the fields that an unwinder reads.
/// Returns 0 if there is one.
///
/// # Safety
///
/// `result` is writable.
unsafe extern "C" fn find_object(address: *const c_void, result: *mut Found) -> c_int {
    let mut wanted = Wanted { address: address as usize, found: None };
    // SAFETY: `look` expects this data.
    unsafe { dl_iterate_phdr(look, (&raw mut wanted).cast()) };
    let Some(found) = wanted.found else { return -1 };
    // SAFETY: the caller's contract.
    unsafe { result.write(found) };
    0
}

global_asm!(
    ".hidden __wrap__dl_find_object",
    ".globl __wrap__dl_find_object",
    ".type __wrap__dl_find_object,@function",
    "__wrap__dl_find_object:",
    "jmp {found}@PLT",
    ".size __wrap__dl_find_object, . - __wrap__dl_find_object",
    found = sym find_object,
);
