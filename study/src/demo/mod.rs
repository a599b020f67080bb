//! The demonstration: three vehicles, the paper's method and ours, with each filter and plant an FMU, coupled
//! through FMI. Then the same vehicles with bounds on their inputs, past a rock, each in one file.

mod case;
mod pictures;
mod summary;

pub use case::Case;
pub use summary::Summary;

use std::path::Path;

use punctual_cosim::coupling::{self, Kept, Model, Own, Promise, Simulation, System};
use punctual_cosim::error::Error;
use punctual_cosim::package;
use punctual_cosim::recording::Recording;
use punctual_cosim::whole;
use punctual_fmu::configuration::Configuration;
use punctual_pictures::report;

use super::Vehicle;
use super::cases::DEADLINE;

/// One coupled run.
pub struct Run {
    /// The case.
    pub case: Case,
    /// Its recording.
    pub recording: Recording,
    /// The verdicts on its promises.
    pub promises: Vec<Promise>,
    /// The numbers of the table.
    pub summary: Summary,
}

impl Run {
    /// Whether it was in the disc in time and from then on, and every promise was kept.
    pub fn kept(&self) -> bool {
        self.summary.kept(DEADLINE) && self.promises.iter().all(|p| p.promise == Kept::Kept)
    }
}

/// Runs all cases: for each vehicle the paper's method, ours, and ours in realistic use. Writes
/// configurations, FMUs, system files, CSV, pictures and pages to `folder`. `progress` gets the fraction done
/// (0 to 1).
///
/// # Errors
///
/// A file that cannot be written, a library that cannot be found, an FMU that fails.
pub fn run(
    folder: &Path,
    library: Option<&Path>,
    mut progress: impl FnMut(f64),
) -> Result<Vec<[Run; 3]>, Error> {
    std::fs::create_dir_all(folder).map_err(|e| Error::io("create", folder, e))?;
    let mut runs = Vec::new();
    for (k, vehicle) in Vehicle::ALL.into_iter().enumerate() {
        let mut part = |j: usize, fraction: f64| {
            progress(((3 * k + j) as f64 + fraction) / (3 * Vehicle::ALL.len()) as f64);
        };
        let [paper, ours] = Case::of(vehicle);
        build(folder, &paper.plant_stem(), &paper.plant(), library)?;
        let paper = couple(paper, folder, library, |fraction| part(0, fraction))?;
        let ours = couple(ours, folder, library, |fraction| part(1, fraction))?;
        pictures::draw(vehicle, &paper, &ours, folder)?;
        let hindered = alone(Case::hindered(vehicle), folder, |fraction| part(2, fraction))?;
        runs.push([paper, ours, hindered]);
    }
    Ok(runs)
}

/// Builds the filter of `case` and runs it with the plant, which is already in `folder`.
fn couple(
    case: Case,
    folder: &Path,
    library: Option<&Path>,
    mut progress: impl FnMut(f64),
) -> Result<Run, Error> {
    build(folder, &case.filter_stem(), &case.filter(), library)?;
    let text = case.system();
    whole::write(&folder.join(format!("{}.toml", case.stem())), &text)?;
    let (mut simulation, _) = Simulation::new(&System::parse(&text)?, folder, package::read_configuration)?;
    let outcome = simulation.run(|time, _| progress(time / case.setup.end))?;
    if let Some(failure) = outcome.failure {
        return Err(failure);
    }
    outcome.recording.save_csv(&folder.join(format!("{}.csv", case.stem())), false)?;
    let summary = Summary::new(&case, &outcome.recording, outcome.statistics.steps_per_second())?;
    Ok(Run { case, recording: outcome.recording, promises: outcome.promises, summary })
}

/// Runs the file of a hindered vehicle, and writes its page.
fn alone(case: Case, folder: &Path, mut progress: impl FnMut(f64)) -> Result<Run, Error> {
    let name = format!("{}.toml", case.stem());
    let (path, text) = (folder.join(&name), case.alone());
    whole::write(&path, &text)?;
    let in_file = |e: Error| e.in_file(&path);
    let (text, configurations) =
        coupling::alone(Configuration::parse(&text).map_err(|e| in_file(e.into()))?)?;
    let system = System::parse(&text)?;
    let own = |configuration| Own::new(configuration).map(|own| Model::Own(Box::new(own), path.clone()));
    let models = configurations.into_iter().map(own).collect::<Result<Vec<_>, _>>()?;
    let mut simulation = Simulation::of(&system, &models)?;
    let mut outcome = simulation.run(|time, _| progress(time / case.setup.end))?;
    if let Some(failure) = outcome.failure.take() {
        return Err(failure);
    }
    outcome.recording.save_csv(&path.with_extension("csv"), false)?;
    let page = report::document(&name, (&system, &models), &outcome, &[], &outcome.notes);
    whole::write(&path.with_extension("html"), &page)?;
    let summary = Summary::new(&case, &outcome.recording, outcome.statistics.steps_per_second())?;
    Ok(Run { case, recording: outcome.recording, promises: outcome.promises, summary })
}

/// Writes a configuration and the FMU made from it.
fn build(folder: &Path, stem: &str, text: &str, library: Option<&Path>) -> Result<(), Error> {
    let path = folder.join(format!("{stem}.toml"));
    whole::write(&path, text)?;
    let configuration = Configuration::parse(text).map_err(|e| Error::from(e).in_file(&path))?;
    package::build(
        configuration,
        library.map(Path::to_owned).as_slice(),
        &folder.join(format!("{stem}.fmu")),
    )?;
    Ok(())
}
