//! Turns a configuration into an `.fmu` file: model description, library, resources, documentation and icon.
//! Also turns a system into an `.ssp` file, and merges FMUs of several systems into one. No compiler is
//! needed; the same configuration and library give the same bytes.

mod difference;
mod documentation;
pub mod library;
pub mod merge;
pub mod plugin;
pub mod system;

use std::path::{Path, PathBuf};
use std::rc::Rc;

use punctual_fmu::configuration::{Configuration, FmiVersion, RESOURCE};
use punctual_fmu::product::Product;
use punctual_modeldescription::fmi3::TERMINALS;
use punctual_modeldescription::{Archive, Timestamp};

use crate::error::Error;
use crate::host::{Fmu, PLATFORM};
use crate::whole;
use library::Library;

/// The licences of the contents of an FMU. The texts are those of the repository. FMI 3.0 prescribes the
/// path, which both versions use.
const LICENCE: (&str, &str) = (
    "documentation/licenses/license.txt",
    concat!(
        "The shared libraries in binaries/ are part of Punctual, which is licensed under the MIT licence or the Apache\n\
         License 2.0, at your option; both follow. They are linked with crates of others, under these and like licences,\n\
         whose texts are in LICENSES-THIRD-PARTY.txt of a release of Punctual. What the configuration in resources/ says\n\
         is its author's.\n\n",
        include_str!("../../../LICENSE-MIT"),
        "\n\n",
        include_str!("../../../LICENSE-APACHE"),
    ),
);

/// The picture that importers show.
const ICON: &[u8] = include_bytes!("model.png");

/// Reads a configuration file and completes it. A plug-in is tried in a separate process before it is loaded
/// here.
///
/// # Errors
///
/// A file that cannot be read, or a configuration that cannot be used (naming the file and field).
pub fn read_configuration(path: &Path) -> Result<Configuration, Error> {
    let loader = plugin::Tried::of(path);
    plugin::read(path, &loader)
}

/// The error for an archive that cannot be written.
fn broken(error: &punctual_modeldescription::Error) -> Error {
    Error::configuration("", error.to_string())
}

/// The time of the entries of an archive.
fn timestamp() -> Result<Timestamp, Error> {
    match std::env::var_os("SOURCE_DATE_EPOCH") {
        Some(text) => Timestamp::from_source_date_epoch(&text.to_string_lossy()).map_err(|e| broken(&e)),
        None => Ok(Timestamp::default()),
    }
}

/// The model description of `product` in its version of FMI, as the text of the file and as rows for the
/// documentation.
fn described(product: &Product) -> Result<documentation::Described, Error> {
    let broken = |e: punctual_modeldescription::Error| broken(&e);
    Ok(match product.configuration.experiment().fmi {
        FmiVersion::Two => {
            let description = product.model_description();
            documentation::Described {
                xml: description.to_xml().map_err(broken)?,
                terminals: None,
                rows: description.variables.iter().map(documentation::row).collect(),
            }
        }
        FmiVersion::Three => {
            let description = product.model_description_of_fmi3();
            documentation::Described {
                xml: description.to_xml().map_err(broken)?,
                terminals: Some(product.terminals().to_xml(&description).map_err(broken)?),
                rows: description.variables.iter().map(documentation::row_of_fmi3).collect(),
            }
        }
    })
}

/// Assembles the FMU of `product` with its shared libraries. Entries carry the time in the environment
/// variable `SOURCE_DATE_EPOCH` if it is set, else a fixed one.
///
/// # Errors
///
/// A `SOURCE_DATE_EPOCH` that a zip archive cannot represent; a plug-in that cannot be read.
pub fn archive(product: &Product, libraries: Vec<Library>) -> Result<Archive, Error> {
    let broken = |e: punctual_modeldescription::Error| broken(&e);
    let timestamp = timestamp()?;
    let fmi = product.configuration.experiment().fmi;
    let canonical = product.configuration.canonical()?;
    let described = described(product)?;
    let page = documentation::page(product, &described, &canonical);
    let plugin = product.configuration.plugin();
    let plugin = plugin.map(|plugin| {
        let bytes = std::fs::read(&plugin.path).map_err(|e| Error::io("read", &plugin.path, e))?;
        Ok::<_, Error>((format!("resources/{PLATFORM}/{}", plugin.file), bytes))
    });
    let mut archive = Archive::new().with_timestamp(timestamp);
    archive.add("modelDescription.xml", described.xml).map_err(broken)?;
    let icon = match fmi {
        FmiVersion::Two => "model.png",
        FmiVersion::Three => "terminalsAndIcons/icon.png",
    };
    archive.add(icon, ICON).map_err(broken)?;
    if let Some(terminals) = described.terminals {
        archive.add(TERMINALS, terminals).map_err(broken)?;
    }
    archive.add("documentation/index.html", page).map_err(broken)?;
    let (place, text) = LICENCE;
    archive.add(place, text).map_err(broken)?;
    archive.add(&format!("resources/{RESOURCE}"), canonical).map_err(broken)?;
    for library in libraries {
        for entry in library.entries(product.configuration.name(), fmi) {
            archive.add(&entry, library.bytes.clone()).map_err(broken)?;
        }
    }
    if let Some((place, bytes)) = plugin.transpose()? {
        archive.add(&place, bytes).map_err(broken)?;
    }
    Ok(archive)
}

/// Writes the FMU of `configuration` with the [`libraries`](library::read) to `file`. Then it opens the file
/// as an importer would: it reads the description, loads the library for this platform if there is one, makes
/// an instance and initialises it. An FMU that does not work is removed again.
///
/// # Errors
///
/// A file that cannot be written, a plug-in with libraries for other platforms, or an FMU that does not work.
pub fn build(configuration: Configuration, libraries: &[PathBuf], file: &Path) -> Result<Rc<Fmu>, Error> {
    let product = Product::new(configuration)?;
    let libraries = library::read(libraries)?;
    let other = libraries.iter().find(|library| library.platform != PLATFORM);
    if let Some((other, plugin)) = other.zip(product.configuration.plugin()) {
        let message = format!(
            "one is for {}, where the plug-in {} would be missing; build there too, and join the FMUs by `punctual merge`",
            other.platform, plugin.file
        );
        return Err(Error::configuration("--library", message));
    }
    let can_run = libraries.iter().any(|library| library.platform == PLATFORM);
    whole::write(file, archive(&product, libraries)?.to_bytes().map_err(|e| broken(&e))?)?;
    let opened = if can_run { tried(&product, file) } else { Fmu::open(file).map(Rc::new) };
    opened.inspect_err(|_| {
        // If this fails too, the first error is the one to report.
        let _ = std::fs::remove_file(file);
    })
}

/// Opens the FMU of `product` at `file` and initialises an instance.
fn tried(product: &Product, file: &Path) -> Result<Rc<Fmu>, Error> {
    let fmu = Rc::new(Fmu::open(file)?);
    let mut slave = fmu.instantiate(fmu.description(), product.configuration.name())?;
    let experiment = product.configuration.experiment();
    slave.setup_experiment(experiment.start_time, experiment.stop_time, None)?;
    slave.enter_initialization_mode()?;
    slave.exit_initialization_mode()?;
    Ok(fmu)
}
