//! One file per subcommand: its arguments, and an `execute` that returns the exit code.

pub mod build;
pub mod campaign;
pub mod check;
mod closed_loop;
pub mod demo;
pub mod inspect;
mod map;
pub mod merge;
pub mod new;
pub mod replay;
pub mod reproduce;
pub mod run;
pub mod validate;
mod witness;
