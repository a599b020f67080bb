//! The demonstration: three vehicles, the paper's method and ours, each filter and plant an FMU, coupled through FMI.

mod case;
mod pictures;
mod summary;

pub use case::Case;
pub use summary::Summary;

use std::path::Path;

use punctual_fmu::configuration::Configuration;

use super::{Vehicle, write};
use crate::coupling::{Simulation, System};
use crate::error::Error;
use crate::package;
use crate::recording::Recording;

/// One coupled run.
pub struct Run {
    /// The case.
    pub case: Case,
    /// Its recording.
    pub recording: Recording,
    /// The numbers of the table.
    pub summary: Summary,
}

/// Runs all cases, for each vehicle the paper's method and ours. Writes configurations, FMUs, system files, CSV
/// and pictures into `folder`. `progress` hears of the fraction done (0 to 1).
///
/// # Errors
///
/// A file that cannot be written, a library that cannot be found, an FMU that fails.
pub fn run(
    folder: &Path,
    library: Option<&Path>,
    mut progress: impl FnMut(f64),
) -> Result<Vec<[Run; 2]>, Error> {
    std::fs::create_dir_all(folder).map_err(|e| Error::io("create", folder, e))?;
    let mut runs = Vec::new();
    for (k, vehicle) in Vehicle::ALL.into_iter().enumerate() {
        let mut part = |j: usize, fraction: f64| {
            progress(((2 * k + j) as f64 + fraction) / (2 * Vehicle::ALL.len()) as f64);
        };
        let [paper, ours] = Case::of(vehicle);
        build(folder, &paper.plant_stem(), &paper.plant(), library)?;
        let paper = couple(paper, folder, library, |fraction| part(0, fraction))?;
        let ours = couple(ours, folder, library, |fraction| part(1, fraction))?;
        pictures::draw(vehicle, &paper, &ours, folder)?;
        runs.push([paper, ours]);
    }
    Ok(runs)
}

/// Builds the filter of `case` and runs it with the plant, which is in `folder` already.
fn couple(
    case: Case,
    folder: &Path,
    library: Option<&Path>,
    mut progress: impl FnMut(f64),
) -> Result<Run, Error> {
    build(folder, &case.filter_stem(), &case.filter(), library)?;
    let text = case.system();
    write(&folder.join(format!("{}.toml", case.stem())), &text)?;
    let (mut simulation, _) = Simulation::new(&System::parse(&text)?, folder, package::read_configuration)?;
    let outcome = simulation.run(|time, _| progress(time / case.setup.end))?;
    if let Some(failure) = outcome.failure {
        return Err(failure);
    }
    outcome.recording.save_csv(&folder.join(format!("{}.csv", case.stem())), false)?;
    let summary = Summary::new(&case, &outcome.recording, outcome.statistics.steps_per_second())?;
    Ok(Run { case, recording: outcome.recording, summary })
}

/// Writes a configuration and the FMU made from it.
fn build(folder: &Path, stem: &str, text: &str, library: Option<&Path>) -> Result<(), Error> {
    let path = folder.join(format!("{stem}.toml"));
    write(&path, text)?;
    let configuration = Configuration::parse(text).map_err(|e| Error::from(e).in_file(&path))?;
    package::build(configuration, library, &folder.join(format!("{stem}.fmu")))?;
    Ok(())
}
