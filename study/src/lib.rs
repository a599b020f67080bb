//! The paper's tables and figures compared with ours, and with the baselines of the literature.
//!
//! Tables and figures run in process: the filter of `punctual-core`, a plant with the named integrator,
//! inputs held between samples. Every number except the times is a pure function of the options. [`demo`]
//! runs its cases through FMI.
//!
//! Each module uses only modules above it:
//!
//! ```text
//! starts               random starts, those of a file and those drawn
//! cases                vehicles, settings and nominal controllers
//! table                rows of cells: text, CSV, JSON, Markdown, HTML
//! baseline             the methods that are compared
//! trial                one closed loop and its measurements
//! search               the best parameters of a method
//! always               what survives bounds and any u_ref
//! bicycles             the kinematic bicycle's models and remedies
//! figures              all figures
//! tables               all tables
//! page                 tables and figures as a page
//! guide                pictures and numbers of docs/guide.md
//! demo                 the demonstration, through FMI
//! ```
#![forbid(unsafe_code)]
// Elementary functions come from the core: see clippy.toml.
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod always;
pub mod baseline;
pub mod bicycles;
pub mod cases;
pub mod demo;
pub mod figures;
pub mod guide;
pub mod page;
pub mod search;
pub mod starts;
pub mod table;
pub mod tables;
pub mod trial;

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use punctual_cosim::error::Error;
use punctual_cosim::whole;
use punctual_pictures::plot::{self, Chart};
use serde::Serialize;

pub use cases::{Setup, Vehicle};
pub use table::{Cell, Table};

/// The extent of the study.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Options {
    /// Random starts of every table, 1 to 100.
    pub runs: usize,
    /// Number of seeds; seeds 1 to this number are used.
    pub seeds: u64,
    /// Starts of the parameter search on its first pass and on its second, and the number of candidates that
    /// reach the second.
    pub search: (usize, usize, usize),
    /// The smallest step in s.
    pub finest: f64,
    /// Whether times are measured.
    pub timed: bool,
}

impl Options {
    /// The extent of the paper's tables.
    pub const FULL: Self = Self { runs: 100, seeds: 10, search: (6, 8, 4), finest: 1e-4, timed: true };
    /// A few runs, for a first look and for tests: the same tables with fewer starts.
    pub const QUICK: Self = Self { runs: 4, seeds: 2, search: (1, 1, 1), finest: 1e-3, timed: true };
}

/// Counts the closed loops that are done.
pub struct Watch<'a> {
    done: AtomicUsize,
    total: usize,
    tell: &'a (dyn Fn(f64) + Sync),
}

impl<'a> Watch<'a> {
    /// Reports to `tell` the fraction of `total` loops that is done.
    pub fn new(total: usize, tell: &'a (dyn Fn(f64) + Sync)) -> Self {
        Self { done: AtomicUsize::new(0), total: total.max(1), tell }
    }

    /// Counts `loops` more as done.
    pub fn done(&self, loops: usize) {
        let done = self.done.fetch_add(loops, Ordering::Relaxed) + loops;
        (self.tell)(done as f64 / self.total as f64);
    }
}

/// A picture with its name in files and its caption.
#[derive(Clone, Debug, Serialize)]
pub struct Figure {
    /// Its name in files.
    pub key: String,
    /// Description of the picture, with runs and steps.
    pub caption: String,
    /// The picture.
    pub chart: Chart,
}

/// All results of the command.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The options of the study.
    pub options: Options,
    /// The tables, the paper's three first.
    pub tables: Vec<Table>,
    /// The pictures.
    #[serde(skip)]
    pub figures: Vec<Figure>,
    /// Whether our method kept every deadline.
    pub kept: bool,
}

/// Runs everything; `tell` gets the fraction done, from any thread.
///
/// # Errors
///
/// None in practice, since all parameters are constants.
pub fn run(options: Options, tell: &(dyn Fn(f64) + Sync)) -> Result<Report, Error> {
    let watch = Watch::new(tables::loops(&options), tell);
    let (tables, kept) = tables::all(&options, &watch)?;
    let (figures, fitted) = figures::all(&options)?;
    let mut all = tables;
    all.push(fitted);
    Ok(Report { options, tables: all, figures, kept })
}

/// Writes tables as CSV, pictures as SVG and the page `report.html` to `folder`.
///
/// # Errors
///
/// A file that cannot be written.
pub fn save(report: &Report, folder: &Path) -> Result<(), Error> {
    std::fs::create_dir_all(folder).map_err(|e| Error::io("create", folder, e))?;
    for table in &report.tables {
        whole::write(&folder.join(format!("{}.csv", table.key)), table.csv())?;
    }
    for figure in &report.figures {
        whole::write(&folder.join(format!("{}.svg", figure.key)), &plot::chart(&figure.chart, &figure.key)?)?;
    }
    whole::write(&folder.join("report.html"), &page::document(report)?)
}
