//! Many runs of one system from drawn starts, parameters and disturbances, on all cores.
//!
//! A run depends only on the campaign's texts and its number. Its row does not depend on which run came
//! before it, on the thread, or on where a campaign was interrupted. The blocks are those of the FMUs, run in
//! process and coupled by the same master, so a row is bit for bit what `punctual run` would find. An FMU of
//! another program is loaded for each thread and instantiated for each run; the same holds for it if its
//! steps depend on nothing else.

mod arrow;
mod distribution;
mod file;
mod join;
mod measures;
mod part;
mod rare;
mod runner;
mod sampling;
mod sobol;
mod splitting;
mod summary;
mod table;

pub use distribution::{Distribution, VarySection};
pub use file::{Campaign, Choice, Declared, Source, Success, Uncertainty, Varied};
pub use join::join;
pub use measures::Measures;
pub use part::Part;
pub use rare::{Ended, Failing, Rare, Value, rare};
pub use runner::{Options, Progress, kept, recorded, run, runs, version};
pub use sampling::{Sampler, Sampling};
pub use summary::{Case, Fates, Lack, Rate, Spread, Summary, summary};
pub use table::{Cell, Column, GROUP, Kind, Reader, Row};
