//! What a component is made from: an FMU, or a configuration of this program, which runs in process. Both
//! give the same numbers, bit for bit.

use std::path::{Path, PathBuf};
use std::rc::Rc;

use punctual_fmu::configuration::{Configuration, RESOURCE};
use punctual_fmu::product::Product;

use super::starts;
use super::{Component, InProcess};
use crate::error::Error;
use crate::host::{Description, Fmu, Participant};
use crate::text;

/// A configuration with the data of the FMU that it would make.
pub struct Own {
    /// The configuration.
    pub configuration: Configuration,
    /// The GUID of its FMU.
    pub guid: String,
    /// The model description of its FMU.
    pub description: Description,
}

impl Own {
    /// Derives everything from `configuration`.
    ///
    /// # Errors
    ///
    /// A configuration that cannot be built.
    pub fn new(configuration: Configuration) -> Result<Self, Error> {
        let product = Product::new(configuration)?;
        let xml = product.model_description().to_xml();
        let xml = xml.map_err(|e| Error::configuration("", e.to_string()))?;
        let name = Path::new(product.configuration.name());
        let description = Description::parse(&xml).map_err(|problem| Error::fmu(name, problem))?;
        Ok(Self { configuration: product.configuration, guid: product.guid, description })
    }

    /// An instance in this process.
    ///
    /// # Errors
    ///
    /// None in practice, since the GUID is the configuration's own.
    pub fn instance(&self, name: &str) -> Result<InProcess, Error> {
        InProcess::new(name, self.configuration.clone(), &self.guid)
    }
}

/// Reads a configuration and its plug-in from a file.
pub type Reader = fn(&Path) -> Result<Configuration, Error>;

/// An FMU, or a configuration that runs in process.
pub enum Model {
    /// An FMU, and its description with the array sizes of this component.
    Fmu(Rc<Fmu>, Rc<Description>),
    /// A configuration and its file.
    Own(Box<Own>, PathBuf),
}

impl Model {
    /// Opens the FMU at `path`, or reads the configuration if the name ends in `.toml`. `shared` are the
    /// models already opened.
    ///
    /// # Errors
    ///
    /// A file that is missing or cannot be used.
    pub(crate) fn open(path: &Path, shared: &[Self], read: Reader) -> Result<Self, Error> {
        if text::is_toml(path) {
            let own = Own::new(read(path)?)?;
            return Ok(Self::Own(Box::new(own), path.to_owned()));
        }
        let once = |fmu: &Fmu| fmu.description().only_once;
        let opened = shared.iter().find_map(|model| match model {
            Self::Fmu(fmu, _) if fmu.path() == path && !once(fmu) => Some(Rc::clone(fmu)),
            _ => None,
        });
        Ok(match opened {
            Some(fmu) => fmu.into(),
            None => Rc::new(Fmu::open(path)?).into(),
        })
    }

    /// The same model, with the array sizes that the start values of `component` set.
    ///
    /// # Errors
    ///
    /// Arrays that become too large.
    pub fn sized(self, component: &Component) -> Result<Self, Error> {
        let Self::Fmu(fmu, description) = self else { return Ok(self) };
        let structural = starts::structural(component, &description);
        let sized = description.sized(&structural).map_err(|problem| Error::fmu(fmu.path(), problem))?;
        Ok(Self::Fmu(fmu, Rc::new(sized)))
    }

    /// Its configuration, if it is one.
    pub fn configuration(&self) -> Option<&Configuration> {
        match self {
            Self::Fmu(..) => None,
            Self::Own(own, _) => Some(&own.configuration),
        }
    }

    /// The file it comes from.
    pub fn path(&self) -> &Path {
        match self {
            Self::Fmu(fmu, _) => fmu.path(),
            Self::Own(_, path) => path,
        }
    }

    /// Its model description.
    pub fn description(&self) -> &Description {
        match self {
            Self::Fmu(_, description) => description,
            Self::Own(own, _) => &own.description,
        }
    }

    /// A warning if an FMU of this program does not match the configuration file beside it.
    pub fn stale(&self) -> Option<String> {
        let Self::Fmu(fmu, _) = self else { return None };
        let inside = fmu.resource(RESOURCE)?;
        // A file that cannot be used is not what the FMU was built from, or describes something else.
        let beside = fmu.path().with_extension("toml");
        let text = std::fs::read_to_string(&beside).ok()?;
        let outside = Configuration::parse(&text).and_then(|c| c.canonical()).ok()?;
        let (fmu, beside) = (fmu.path().display(), beside.display());
        (inside != outside).then(|| {
            format!(
                "note: {fmu} was not built from the current {beside}; rebuild it, or name the .toml file in the system"
            )
        })
    }

    /// An instance called `name`.
    pub(crate) fn instance(&self, name: &str) -> Result<Box<dyn Participant>, Error> {
        Ok(match self {
            Self::Fmu(fmu, description) => fmu.instantiate(description, name)?,
            Self::Own(own, _) => Box::new(own.instance(name)?),
        })
    }
}

impl From<Rc<Fmu>> for Model {
    fn from(fmu: Rc<Fmu>) -> Self {
        let description = Rc::clone(fmu.description());
        Self::Fmu(fmu, description)
    }
}
