//! Fixed-time safety filters where there is no operating system: the C library of `punctual.h`.
//!
//! `punctual build car.toml --embedded car.bin` writes a [`FilterFile`]: the model and its barriers as tapes, the promises, the
//! bounds. One library reads them all. It has the rows of a filter, and the same bits as [`Filter`](punctual_core::filter::Filter)
//! on the same expressions. A plan is a table that was made on a PC, and is followed.
//!
//! | module | owns |
//! |---|---|
//! | `checksum` | whether bytes are those that were written |
//! | `file` | the file |
//! | `memory` | how much memory its filter takes |
//! | `read` | its filter, and how its plan is followed |
//! | `saved` | what a filter remembers, as bytes |
//! | `abi` | the functions of `punctual.h` (feature `c`) |
#![no_std]
#![deny(unsafe_code)]
#![warn(clippy::disallowed_methods)]

extern crate alloc;

#[cfg(feature = "c")]
mod abi;
mod checksum;
mod file;
mod memory;
mod read;
#[cfg(feature = "c")]
mod saved;

pub use file::{BarrierFile, FileError, FilterFile, Promise, Settings};
pub use memory::Size;
pub use read::{Loaded, Step, read};
