//! The components of a campaign: configurations, which run in process, and FMUs of other programs.
//!
//! A campaign identifies each by a text. For a configuration, this is the configuration with every value
//! stated. For an FMU of another program, it is a digest of the file, which stays where the system file says.

use std::fs;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use punctual_fmu::configuration::{Configuration, ConfigurationError, RESOURCE, read_toml, write_toml};
use punctual_fmu::product::Product;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use crate::coupling::{Component, Model, Own};
use crate::error::Error;
use crate::host::{Description, Fmu, Fresh, Participant};
use crate::package;
use crate::text;

/// The text that stands for an FMU of another program.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Foreign {
    kind: Kind,
    /// A name-based UUID of its bytes.
    digest: String,
}

#[derive(Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Fmu,
}

/// A component of a campaign.
pub enum Part {
    /// A configuration.
    Own(Box<Own>),
    /// An FMU of another program.
    Fmu {
        /// Its file.
        path: PathBuf,
        /// A name-based UUID of its bytes.
        digest: String,
        /// Its model description, with the sizes that arrays have here.
        description: Box<Description>,
    },
}

impl Part {
    /// The text of the component in the file at `path`, which `field` names. An FMU of this program contains
    /// its configuration.
    ///
    /// # Errors
    ///
    /// A file that is missing or cannot be used; an FMU built by another version of this program.
    pub(super) fn text(path: &Path, field: &str) -> Result<String, Error> {
        if text::is_toml(path) {
            return Ok(package::read_configuration(path)?.canonical()?);
        }
        if !path.exists() {
            let message = format!(
                "there is no file {}; it is an FMU, or the .toml file that `punctual build` makes one from",
                path.display()
            );
            return Err(Error::configuration(field, message));
        }
        let fmu = Fmu::open(path)?;
        let Some(text) = fmu.resource(RESOURCE) else {
            return Ok(write_toml(&Foreign { kind: Kind::Fmu, digest: digest(path)? })?);
        };
        let product = Product::new(parsed(&text).map_err(|e| Error::from(e).in_file(path))?)?;
        if product.guid != fmu.description().token {
            let message = format!(
                "{} is the work of another version of Punctual (its GUID is {}, must be {}); rebuild it",
                path.display(),
                fmu.description().token,
                product.guid
            );
            return Err(Error::configuration(field, message));
        }
        Ok(product.configuration.canonical()?)
    }

    /// Reads `component` from its text. `system` is the path of the system file.
    ///
    /// # Errors
    ///
    /// A text that describes no component; an FMU that is missing or has changed.
    pub(super) fn of(text: &str, component: &Component, system: &Path) -> Result<Self, Error> {
        let Ok(Foreign { digest, .. }) = read_toml(text) else {
            return Ok(Self::Own(Box::new(Own::new(parsed(text)?)?)));
        };
        let path = system.with_file_name(&component.fmu);
        let fmu = Rc::new(open(&path, &digest, &component.name)?);
        let model = Model::from(fmu).sized(component)?;
        let description = Box::new(model.description().clone());
        Ok(Self::Fmu { path, digest, description })
    }

    /// Its model description.
    pub fn description(&self) -> &Description {
        match self {
            Self::Own(own) => &own.description,
            Self::Fmu { description, .. } => description,
        }
    }

    /// Its configuration, if it has one.
    pub fn configuration(&self) -> Option<&Configuration> {
        match self {
            Self::Own(own) => Some(&own.configuration),
            Self::Fmu { .. } => None,
        }
    }

    /// An instance called `name` for the calling thread. An FMU of another program is unpacked and loaded for
    /// each instance.
    ///
    /// # Errors
    ///
    /// An FMU that has changed since, or cannot be loaded or instantiated.
    pub(super) fn instance(&self, name: &str) -> Result<Box<dyn Participant>, Error> {
        Ok(match self {
            Self::Own(own) => Box::new(own.instance(name)?),
            Self::Fmu { path, digest, description } => {
                let fmu = Rc::new(open(path, digest, name)?);
                let description = Rc::new(Description::clone(description));
                Box::new(Fresh::new(fmu, description, name).map_err(|e| e.in_component(name))?)
            }
        })
    }
}

/// Opens the FMU of the component called `name` if its digest is the one `wanted`.
fn open(path: &Path, wanted: &str, name: &str) -> Result<Fmu, Error> {
    let wrong = |message: String| Err(Error::configuration(format!("component {name:?}"), message));
    if !path.exists() {
        return wrong(format!(
            "there is no file {}, the FMU that the campaign was made with",
            path.display()
        ));
    }
    if digest(path)? != wanted {
        return wrong(format!("{} is another FMU than the campaign was made with", path.display()));
    }
    Fmu::open(path)
}

fn digest(path: &Path) -> Result<String, Error> {
    let bytes = fs::read(path).map_err(|e| Error::io("read", path, e))?;
    Ok(Uuid::new_v5(&Uuid::NAMESPACE_OID, &bytes).to_string())
}

/// Parses a configuration that needs no plug-in.
fn parsed(text: &str) -> Result<Configuration, ConfigurationError> {
    Configuration::parse(text).map_err(|e| match e.field() {
        "plant.plugin" => ConfigurationError::new(
            e.field(),
            "is a shared library, which campaigns do not load; `punctual run` does",
        ),
        _ => e,
    })
}
