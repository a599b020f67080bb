//! Fixed-time safety filters where there is no operating system: the C library of `punctual.h`.
//!
//! `punctual build car.toml --embedded car.bin` writes a [`FilterFile`]: the model and its barriers as tapes, the promises, the
//! bounds. One library reads them all. It has the rows of a filter, and the same bits as [`Filter`](punctual_core::filter::Filter)
//! on the same expressions. It has no plans.
//!
//! | module | owns |
//! |---|---|
//! | `file` | the file, and the filter that it holds |
//! | `memory` | how much memory that takes |
//! | `saved` | what a filter remembers, as bytes |
//! | `abi` | the functions of `punctual.h` (feature `c`) |
#![no_std]
#![deny(unsafe_code)]
#![warn(clippy::disallowed_methods)]

extern crate alloc;

#[cfg(feature = "c")]
mod abi;
mod file;
#[cfg(feature = "c")]
mod memory;
#[cfg(feature = "c")]
mod saved;

pub use file::{BarrierFile, FileError, FilterFile, Settings};

/// The CRC-32 of `bytes`. Without a table: it would take more flash than the rest of the file's code.
fn checksum(bytes: &[u8]) -> u32 {
    crc::Crc::<u32, crc::NoTable>::new(&crc::CRC_32_ISO_HDLC).checksum(bytes)
}
