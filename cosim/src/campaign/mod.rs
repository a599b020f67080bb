//! Many runs of one system from drawn starts, parameters and disturbances, on all cores.
//!
//! A run is a function of the campaign's texts and its number. Its row does not show which run follows which, on
//! which thread, or where a campaign was interrupted. The blocks are those of the FMUs, in process and coupled by the same
//! master. So a row is what `punctual run` would find, bit for bit. An FMU of another program is loaded for each thread and
//! instantiated for each run; the same is true of it as far as its steps depend on nothing else.

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
pub use file::{Campaign, Choice, Source, Success, Varied};
pub use join::join;
pub use measures::Measures;
pub use part::Part;
pub use rare::{Ended, Failing, Rare, Value, rare};
pub use runner::{Options, Progress, kept, recorded, run, runs, version};
pub use sampling::{Sampler, Sampling};
pub use summary::{Case, Lack, Rate, Spread, Summary, summary};
pub use table::{Cell, Column, GROUP, Kind, Reader, Row};
