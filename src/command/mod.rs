//! One file per subcommand: its arguments, and an `execute` that returns the exit code.

pub mod build;
pub mod check;
pub mod demo;
pub mod inspect;
pub mod run;
pub mod validate;
