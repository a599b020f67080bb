//! Couples FMUs. A system file says which FMUs run, how they are connected and for how long; a master
//! runs them in steps and records. It knows FMUs only through [`crate::host`], and steps any [`Participant`].

mod alone;
mod delays;
mod deviations;
mod graph;
mod grid;
mod in_process;
mod interference;
mod layout;
mod master;
mod model;
mod network;
mod ports;
mod promises;
mod starts;
mod system;

pub use crate::host::Participant;
pub use alone::alone;
pub(crate) use delays::of as delays;
pub use deviations::{Drawn, Role, Steps, as_the_model, deviations, draw, may_differ, steps};
pub use grid::Grid;
pub use in_process::InProcess;
pub use interference::Interference;
pub use master::{DrawnSteps, Outcome, Sequence, Simulation, Statistics};
pub use model::{Model, Own, Reader};
pub use network::{Link, Port, Units, links, port, unit_notes};
pub use promises::{Kept, Promise, check_fed, verdict};
pub use system::{
    ByName, Component, Connection, DiscEntry, Experiment, Order, PathEntry, PathPicture, Picture, Record,
    StartValue, System, TimePicture, Variant,
};
