//! `punctual build`: turns a configuration into an FMU, and a system file into an SSP package.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use punctual_core::filter::TabledPlan;
use punctual_core::follower::PlanTable;
use punctual_cosim::coupling::Order;
use punctual_cosim::error::Error;
use punctual_cosim::{package, whole};
use punctual_fmu::configuration::{Configuration, FilterConfiguration, FmiVersion};

use punctual_fmu::text::{number, quantity};
use punctual_modeldescription::SspVersion;

use crate::output;

/// Arguments of `punctual build`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The configuration file (TOML): `kind = "filter"`, `"plant"` or `"controller"`; or a system file
    configuration: PathBuf,
    /// The .fmu file to write; for a system file the .ssp file, with the FMUs it names, and those of the configurations it names
    #[arg(short, long, value_name = "FILE", required_unless_present = "embedded")]
    output: Option<PathBuf>,
    /// Writes a filter as a file for the C library instead, and beside it a header with the names of its states, inputs and barriers,
    /// and its bytes: car.bin and car.h
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with_all = ["output", "libraries", "fmi", "ssp", "scalars"]
    )]
    embedded: Option<PathBuf>,
    /// A shared library to put inside, for the platform that the file is for; repeat it for several [default: the one
    /// beside this program]
    #[arg(long = "library", value_name = "FILE")]
    libraries: Vec<PathBuf>,
    /// The version of FMI; `both` writes that of 3.0 to a file beside, NAME-fmi3.fmu [default: `experiment.fmi` of the
    /// configuration, or 2]
    #[arg(long, value_name = "VERSION")]
    fmi: Option<Versions>,
    /// The version of SSP of an .ssp file: 1, for scalars, or 2, which has arrays [default: 1]
    #[arg(long, value_name = "VERSION")]
    ssp: Option<Ssp>,
    /// With FMI 3.0, scalars instead of arrays, for tools that cannot take arrays
    #[arg(long)]
    scalars: bool,
    /// The master that a filter is for. One that is a step late gives the filter an `actuation_delay` of a step, which its promises
    /// account for [default: the file's `actuation_delay`; for a system file its `order`]
    #[arg(long, value_name = "ORDER")]
    master: Option<Master>,
}

/// The order of calls of a master.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Master {
    /// A filter's input acts in the step of its sample: `actuation_delay` as in the file
    GaussSeidel,
    /// All values are exchanged before a step, so an input acts one step after its sample
    Jacobi,
}

/// The versions of SSP to pack for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Ssp {
    /// SSP 1.0
    #[value(name = "1")]
    One,
    /// SSP 2.0
    #[value(name = "2")]
    Two,
}

/// The versions of FMI to build for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Versions {
    /// FMI 2.0
    #[value(name = "2")]
    Two,
    /// FMI 3.0
    #[value(name = "3")]
    Three,
    /// An FMU of each
    #[value(name = "both")]
    Both,
}

/// Builds the FMU and tries it, or packs the system.
///
/// # Errors
///
/// A configuration that cannot be used, a file that cannot be read or written, an FMU that does not work.
pub fn execute(arguments: &Arguments) -> Result<ExitCode, Error> {
    let file = &arguments.configuration;
    // Clap asks for one of the two.
    let output = match (&arguments.embedded, &arguments.output) {
        (Some(to), _) => return embed(arguments, to),
        (None, Some(output)) => output,
        (None, None) => {
            return Err(Error::configuration("--output", "is not given, must be a file to write"));
        }
    };
    if output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("ssp")) {
        return pack(arguments, file, output);
    }
    if arguments.ssp.is_some() {
        let message = "is for an .ssp file, which is made from a system file";
        return Err(Error::configuration("--ssp", message));
    }
    let configuration = configuration(arguments)?;
    for note in configuration.in_degrees() {
        output::note(&format!("note: {note}"));
    }
    let experiment = *configuration.experiment();
    let versions = match arguments.fmi {
        None => vec![experiment.fmi],
        Some(Versions::Two) => vec![FmiVersion::Two],
        Some(Versions::Three) => vec![FmiVersion::Three],
        Some(Versions::Both) => vec![FmiVersion::Two, FmiVersion::Three],
    };
    if arguments.scalars && !versions.contains(&FmiVersion::Three) {
        let message = "is for FMI 3.0, such as `--fmi 3`; FMI 2.0 has no arrays";
        return Err(Error::configuration("--scalars", message));
    }
    let several = versions.len() > 1;
    for fmi in versions {
        let configuration = configuration.clone().for_fmi(fmi, experiment.arrays && !arguments.scalars);
        let beside = several && fmi == FmiVersion::Three;
        let output = if beside { next_to(output) } else { output.clone() };
        build(configuration, &arguments.libraries, &output)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The configuration, for the master that is asked for.
fn configuration(arguments: &Arguments) -> Result<Configuration, Error> {
    let file = &arguments.configuration;
    Ok(match super::read(file)? {
        Configuration::Filter(filter) if arguments.master == Some(Master::Jacobi) => {
            Configuration::Filter(filter.for_jacobi().map_err(|e| Error::from(e).in_file(file))?)
        }
        configuration @ (Configuration::Plant(_) | Configuration::Controller(_))
            if arguments.master.is_some() =>
        {
            let message = format!("is for a filter, and {} is a {}", file.display(), configuration.kind());
            return Err(Error::configuration("--master", message));
        }
        configuration => configuration,
    })
}

/// Writes the file for the C library, and its header.
fn embed(arguments: &Arguments, to: &Path) -> Result<ExitCode, Error> {
    let file = &arguments.configuration;
    let configuration = configuration(arguments)?;
    let Configuration::Filter(filter) = &configuration else {
        let message = format!("is for a filter, and {} is a {}", file.display(), configuration.kind());
        return Err(Error::configuration("--embedded", message));
    };
    let (embedded, plan) = filter.embedded().map_err(|e| Error::from(e).in_file(file))?;
    let bytes = embedded.to_bytes().map_err(|e| Error::configuration("--embedded", e.to_string()))?;
    let header = to.with_extension("h");
    if header == to {
        let message =
            format!("is {}, must have another ending than .h, which the header beside it has", to.display());
        return Err(Error::configuration("--embedded", message));
    }
    let name = to.file_stem().unwrap_or_default().to_string_lossy();
    whole::write(to, &bytes)?;
    whole::write(&header, filter.embedded_header(&name, &bytes))?;
    output::result(&format!(
        "{}: {} states, {} inputs, {} barriers in {} bytes; their names are in {}",
        to.display(),
        filter.plant.states().len(),
        filter.plant.inputs().len(),
        filter.barrier.len(),
        bytes.len(),
        header.display(),
    ));
    if let Some(plan) = plan {
        output::result(&planned(filter, &plan)?);
    }
    Ok(ExitCode::SUCCESS)
}

/// What a plan as a table keeps, in words.
fn planned(filter: &FilterConfiguration, plan: &TabledPlan) -> Result<String, Error> {
    let table =
        PlanTable::read(&plan.bytes).map_err(|e| Error::configuration("--embedded", e.to_string()))?;
    let kept = filter.barrier.iter().zip(&plan.promised);
    let named = |kept: &[&str]| if kept.is_empty() { "none".to_owned() } else { kept.join(", ") };
    let [kept, left]: [Vec<&str>; 2] = [true, false]
        .map(|is_kept| kept.clone().filter(|(_, k)| **k == is_kept).map(|(b, _)| b.name.as_str()).collect());
    let free = (filter.plant.inputs().iter().zip(&plan.freedom))
        .map(|(input, freedom)| format!("{} {}", input.name, quantity(*freedom, &input.unit)))
        .collect::<Vec<_>>();
    let left = if left.is_empty() { String::new() } else { format!(" (not {})", left.join(", ")) };
    Ok(format!(
        "plan: {} holds in {} bytes keep {}{left} for {} s from every start; inputs may follow u_ref within {}",
        table.holds(),
        plan.bytes.len(),
        named(&kept),
        number(table.until()),
        free.join(", "),
    ))
}

/// The file for FMI 3.0 next to the one for 2.0.
fn next_to(file: &Path) -> PathBuf {
    let mut name = file.file_stem().unwrap_or_default().to_owned();
    name.push("-fmi3.");
    name.push(file.extension().unwrap_or("fmu".as_ref()));
    file.with_file_name(name)
}

fn build(configuration: Configuration, libraries: &[PathBuf], file: &Path) -> Result<(), Error> {
    let fmu = package::build(configuration, libraries, file)?;
    let description = fmu.description();
    let platform = description.version().platform();
    if !fmu.platforms().iter().any(|found| found == platform) {
        output::note(&format!("not tried: no library is for this platform, {platform}"));
    }
    output::result(&format!(
        "{}: {} with {} variables, guid {}",
        file.display(),
        if description.text.is_empty() { &description.model_name } else { &description.text },
        description.variables.len(),
        description.token,
    ));
    Ok(())
}

/// Arguments of `punctual try-plugin`.
#[derive(Debug, clap::Args)]
pub struct TryPluginArguments {
    /// The configuration file
    configuration: PathBuf,
    /// Where to leave the journal
    folder: PathBuf,
}

/// Reads a configuration; this part may crash.
///
/// # Errors
///
/// A defect of the configuration or its plug-in.
pub fn execute_try_plugin(arguments: &TryPluginArguments) -> Result<ExitCode, Error> {
    package::plugin::perform(&arguments.configuration, &arguments.folder)?;
    Ok(ExitCode::SUCCESS)
}

fn pack(arguments: &Arguments, file: &Path, output: &Path) -> Result<ExitCode, Error> {
    if !arguments.libraries.is_empty() {
        let message = "is for one FMU; an .ssp file takes the FMUs that the system names as they are";
        return Err(Error::configuration("--library", message));
    }
    let given = [(arguments.scalars, "--scalars"), (arguments.fmi.is_some(), "--fmi")];
    if let Some((_, option)) = given.into_iter().find(|(given, _)| *given) {
        let message = "is for one FMU; an .ssp file takes the FMUs that the system names as they are";
        return Err(Error::configuration(option, message));
    }
    if let Ok(configuration) = package::read_configuration(file) {
        let message = format!("is {:?}; an .ssp file is made from a system file", configuration.kind());
        return Err(Error::configuration("kind", message).in_file(file));
    }
    let version = match arguments.ssp {
        None | Some(Ssp::One) => SspVersion::One,
        Some(Ssp::Two) => SspVersion::Two,
    };
    let order = arguments.master.map(|master| match master {
        Master::GaussSeidel => Order::GaussSeidel,
        Master::Jacobi => Order::Jacobi,
    });
    let packed = package::system::pack(file, output, version, order)?;
    packed.warnings.iter().for_each(|warning| output::warning(warning));
    for note in &packed.notes {
        output::note(&format!("note: {note}"));
    }
    output::result(&format!(
        "{}: {} components from {} FMUs, {} connections, {} start values",
        output.display(),
        packed.components,
        packed.fmus,
        packed.connections,
        packed.start_values,
    ));
    Ok(ExitCode::SUCCESS)
}
