//! The demonstration: three plants, two methods, coupled through FMI.

mod cases;
mod pictures;
mod summary;

pub use cases::{DEADLINE, MODELS, Method, Model, STOP};
pub use summary::Summary;

use std::path::{Path, PathBuf};

use punctual_fmu::configuration::Configuration;

use crate::coupling::{Simulation, System};
use crate::error::Error;
use crate::package;
use crate::recording::Recording;

/// One coupled run.
pub struct Run {
    /// The plant.
    pub model: Model,
    /// How the deadline was to be met.
    pub method: Method,
    /// What was recorded.
    pub recording: Recording,
    /// The numbers of the table.
    pub summary: Summary,
}

/// Runs all cases; writes configurations, FMUs, system files, CSV and pictures into `folder`.
/// `progress` hears of the fraction done (0 to 1).
///
/// # Errors
///
/// A file that cannot be written, a library that cannot be found, an FMU that fails.
pub fn run(folder: &Path, library: Option<&Path>, mut progress: impl FnMut(f64)) -> Result<Vec<Run>, Error> {
    std::fs::create_dir_all(folder).map_err(|e| Error::io("create", folder, e))?;
    let mut runs = Vec::new();
    let cases = (MODELS.len() * Method::ALL.len()) as f64;
    for model in MODELS {
        build(folder, &cases::plant_stem(model), &cases::plant(model), library)?;
        for method in Method::ALL {
            build(folder, &cases::filter_stem(model, method), &cases::filter(model, method), library)?;
            let stem = cases::run_stem(model, method);
            let text = cases::system(model, method);
            write(&folder.join(format!("{stem}.toml")), &text)?;
            let mut simulation = Simulation::new(&System::parse(&text)?, folder)?;
            let done = runs.len() as f64;
            let outcome = simulation.run(|time, _| progress((done + time / STOP) / cases))?;
            if let Some(failure) = outcome.failure {
                return Err(failure);
            }
            outcome.recording.save_csv(&folder.join(format!("{stem}.csv")))?;
            let summary = Summary::new(model, &outcome.recording, outcome.statistics.steps_per_second())?;
            runs.push(Run { model, method, recording: outcome.recording, summary });
        }
    }
    pictures::draw(&runs, folder)?;
    Ok(runs)
}

/// Writes a configuration and the FMU made from it.
fn build(folder: &Path, stem: &str, text: &str, library: Option<&Path>) -> Result<(), Error> {
    let path: PathBuf = folder.join(format!("{stem}.toml"));
    write(&path, text)?;
    let configuration = Configuration::parse(text).map_err(|e| Error::from(e).in_file(&path))?;
    package::build(configuration, library, &folder.join(format!("{stem}.fmu")))?;
    Ok(())
}

fn write(path: &Path, text: &str) -> Result<(), Error> {
    std::fs::write(path, text).map_err(|e| Error::io("write", path, e))
}
