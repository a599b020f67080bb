//! The exit codes. Each command documents what they mean for it.

/// The command was carried out, and nothing is wrong.
pub const DONE: u8 = 0;
/// The command was carried out and found something wrong with its subject; or an FMU is at fault.
pub const FOUND: u8 = 1;
/// Usage, a configuration or a file is at fault. Clap uses the same code for its own errors.
pub const MISUSE: u8 = 2;
/// Ended by Ctrl-C, as shells encode it.
pub const INTERRUPTED: u8 = 130;
