//! The exit codes. The command line says what each means for its commands.

/// The command was carried out, and nothing is wrong.
pub const DONE: u8 = 0;
/// The command was carried out, and something is wrong with what it looked at; or an FMU is at fault.
pub const FOUND: u8 = 1;
/// Usage, a configuration or a file is at fault. Clap has the same for its own errors.
pub const MISUSE: u8 = 2;
/// After Ctrl-C, as shells have it.
pub const INTERRUPTED: u8 = 130;
