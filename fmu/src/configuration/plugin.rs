//! `plant.plugin`: a plant and barriers that are compiled code, a shared library beside the configuration.
//!
//! The library describes itself: names, units, ranges, parameters. This is written into the completed
//! configuration, with a digest of the library's bytes. So variables and GUID follow from it as for any plant,
//! and a library that is exchanged afterwards is noticed.

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use punctual_modeldescription::PLATFORM;
use punctual_models::evaluated::{Code, CodeModel, Dimensions};
use serde::{Deserialize, Serialize};

use super::model::{RawModel, check_parameters, check_variable, ranges};
use super::names::{check_identifier, taken};
use super::{ConfigurationError, ParameterSection, PlantSection, Range, VariableSection};

/// The description of a plug-in, and its code, which stays loaded as long as this lives.
#[derive(Clone)]
pub struct Plugin {
    /// Its file, without the folder: for messages.
    pub file: String,
    /// Its path.
    pub path: PathBuf,
    /// Digest of its bytes: other bytes give another text.
    pub digest: String,
    /// The states, in order.
    pub states: Vec<VariableSection>,
    /// The inputs, in order.
    pub inputs: Vec<VariableSection>,
    /// The parameters, in order, with their defaults.
    pub parameters: Vec<ParameterSection>,
    /// Its barriers, in order; they have no range.
    pub barriers: Vec<VariableSection>,
    /// The functions.
    pub code: Arc<dyn Code>,
}

/// The digest that the bytes of a plug-in must have.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(untagged, expecting = "must be a text, or a table with a text for each platform")]
pub enum PluginDigest {
    /// The digest on the platform that the FMU is built for.
    One(String),
    /// The digest on each platform, by its name in FMI 2.0. The configuration is then the same on all of them,
    /// and so is the GUID.
    Each(BTreeMap<String, String>),
}

impl PluginDigest {
    /// Refuses a file whose bytes have another digest on this platform.
    fn check(&self, file: &str, found: &str) -> Result<(), ConfigurationError> {
        let (field, wanted) = match self {
            Self::One(wanted) => ("plant.plugin_digest".to_owned(), Some(wanted)),
            Self::Each(wanted) => (format!("plant.plugin_digest.{PLATFORM}"), wanted.get(PLATFORM)),
        };
        let message = match wanted {
            Some(wanted) if *wanted == found => return Ok(()),
            Some(wanted) => {
                format!("is {wanted:?}, but {file} has {found:?}: it is not the file that this was made with")
            }
            None => format!("is not given, but {file} has {found:?}, and other platforms have theirs"),
        };
        Err(ConfigurationError::new(field, message))
    }
}

/// Finds plug-ins by their names.
pub trait PluginLoader {
    /// The name of the file of the plug-in `name`, a C identifier, and the digest of its bytes. Nothing of it runs.
    ///
    /// # Errors
    ///
    /// The reason why there is none.
    fn digest(&self, name: &str) -> Result<(String, String), String>;

    /// The plug-in `name`, a C identifier.
    ///
    /// # Errors
    ///
    /// The reason why there is none that can be used.
    fn load(&self, name: &str) -> Result<Plugin, String>;
}

/// Refuses every plug-in, for configurations without a folder.
pub(super) struct NoPlugins;

impl PluginLoader for NoPlugins {
    fn digest(&self, name: &str) -> Result<(String, String), String> {
        self.load(name).map(|plugin| (plugin.file, plugin.digest))
    }

    fn load(&self, name: &str) -> Result<Plugin, String> {
        Err(format!("is {name:?}, but this text is in no folder from which a plug-in could be loaded"))
    }
}

/// A plug-in of a completed section.
#[derive(Clone)]
pub(super) struct Loaded(Arc<Plugin>);

impl PartialEq for Loaded {
    fn eq(&self, other: &Self) -> bool {
        self.0.digest == other.0.digest
    }
}

impl fmt::Debug for Loaded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Loaded({:?})", self.0.file)
    }
}

impl Plugin {
    /// Checks that its names, units and ranges are possible.
    fn check(&self) -> Result<(), ConfigurationError> {
        let groups = [("state", &self.states), ("input", &self.inputs), ("barrier", &self.barriers)];
        let variables = groups.iter().flat_map(|(group, variables)| {
            let row = |(i, v): (usize, &VariableSection)| {
                (format!("{group}[{i}]"), v.name.clone(), v.unit.clone(), v.range())
            };
            variables.iter().enumerate().map(row).collect::<Vec<_>>()
        });
        let row = |(i, p): (usize, &ParameterSection)| {
            (format!("parameter[{i}]"), p.name.clone(), p.unit.clone(), Range { min: p.min, max: p.max })
        };
        let all: Vec<_> = variables.chain(self.parameters.iter().enumerate().map(row)).collect();
        for (i, (path, name, unit, range)) in all.iter().enumerate() {
            check_variable(path, name, unit, *range)?;
            if all[..i].iter().any(|other| other.1 == *name) {
                return Err(taken(format!("{path}.name"), name));
            }
        }
        for (i, p) in self.parameters.iter().enumerate() {
            Range { min: p.min, max: p.max }.check(&format!("parameter[{i}].start"), p.start)?;
        }
        Ok(())
    }
}

/// A plant that is a plug-in: its description, with the values that the file gives where it may.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PluginSection {
    /// The name of the plug-in, a shared library beside the file (`lib<name>.so`, `<name>.dll`, `lib<name>.dylib`).
    plugin: String,
    /// Digest of its bytes, one for every platform or each by its name.
    plugin_digest: PluginDigest,
    #[serde(skip)]
    loaded: Loaded,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) states: Vec<VariableSection>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) inputs: Vec<VariableSection>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) parameters: Vec<ParameterSection>,
}

impl PluginSection {
    /// Loads the plug-in `name` and takes over its description, unless `raw` gives other values where it may.
    pub(super) fn parse(
        name: String,
        raw: RawModel,
        loader: &dyn PluginLoader,
    ) -> Result<Self, ConfigurationError> {
        let refuse = |message: String| Err(ConfigurationError::new("plant.plugin", message));
        if raw.derivatives.is_some() {
            let message = "given beside `plugin`, which has its own";
            return Err(ConfigurationError::new("plant.derivatives", message));
        }
        check_identifier("plant.plugin", &name)?;
        let none = |problem| ConfigurationError::new("plant.plugin", problem);
        if let Some(wanted) = &raw.plugin_digest {
            // Before anything of it runs: a file that was cut short may end the process.
            let (file, found) = loader.digest(&name).map_err(none)?;
            wanted.check(&file, &found)?;
        }
        let plugin = loader.load(&name).map_err(none)?;
        if let Err(error) = plugin.check() {
            return refuse(format!("{}: {error}", plugin.file));
        }
        let plugin_digest = raw.plugin_digest.unwrap_or_else(|| PluginDigest::One(plugin.digest.clone()));
        let section = Self {
            plugin: name,
            plugin_digest,
            states: merged("states", raw.states, &plugin.states)?,
            inputs: merged("inputs", raw.inputs, &plugin.inputs)?,
            parameters: merged_parameters(&raw.parameters.unwrap_or_default(), &plugin.parameters)?,
            loaded: Loaded(Arc::new(plugin)),
        };
        check_parameters(&section.parameters)?;
        for (i, p) in section.parameters.iter().enumerate() {
            let field = format!("plant.parameters[{i}].start");
            Range { min: p.min, max: p.max }.check(&field, p.start)?;
        }
        section.code()?;
        Ok(section)
    }

    /// Its model, with its parameters.
    ///
    /// # Errors
    ///
    /// The code does something that it must not.
    pub(super) fn code(&self) -> Result<CodeModel, ConfigurationError> {
        let plugin = self.loaded();
        let dimensions = Dimensions {
            states: plugin.states.len(),
            inputs: plugin.inputs.len(),
            barriers: plugin.barriers.len(),
        };
        let parameters = self.parameters.iter().map(|p| p.start).collect();
        CodeModel::new(Arc::clone(&plugin.code), dimensions, parameters, &ranges(&self.states))
            .map_err(|e| ConfigurationError::new("plant.plugin", format!("{}: {e}", plugin.file)))
    }

    /// The plug-in itself.
    pub(super) fn loaded(&self) -> &Plugin {
        &self.loaded.0
    }
}

impl PlantSection {
    /// The barriers of its plug-in.
    pub(super) fn plugin_barriers(&self) -> &[VariableSection] {
        self.plugin().map_or(&[], |section| &section.loaded().barriers)
    }
}

/// Replaces `own` by `theirs` where it has the value `unsaid`.
fn fill<T: PartialEq>(own: &mut T, unsaid: &T, theirs: T) {
    if own == unsaid {
        *own = theirs;
    }
}

/// What `own`, which has the names of `theirs` in their order, says, and else `theirs`.
fn merged(
    group: &str,
    own: Option<Vec<VariableSection>>,
    theirs: &[VariableSection],
) -> Result<Vec<VariableSection>, ConfigurationError> {
    let Some(mut own) = own else { return Ok(theirs.to_vec()) };
    let names = |list: &[VariableSection]| list.iter().map(|v| v.name.clone()).collect::<Vec<_>>().join(", ");
    if own.len() != theirs.len() || own.iter().zip(theirs).any(|(a, b)| a.name != b.name) {
        let own = if own.is_empty() { "none".to_owned() } else { names(&own) };
        let message = format!("are {own}, but those of the plug-in are {}", names(theirs));
        return Err(ConfigurationError::new(format!("plant.{group}"), message));
    }
    for (i, (own, theirs)) in own.iter_mut().zip(theirs).enumerate() {
        let path = format!("plant.{group}[{i}]");
        fill(&mut own.unit, &"1".to_owned(), theirs.unit.clone());
        same_unit(&path, &own.unit, &theirs.unit)?;
        fill(&mut own.description, &String::new(), theirs.description.clone());
        fill(&mut own.min, &None, theirs.min);
        fill(&mut own.max, &None, theirs.max);
        check_variable(&path, &own.name, &own.unit, own.range())?;
    }
    Ok(own)
}

/// `theirs` with the values that `own` gives.
fn merged_parameters(
    own: &[ParameterSection],
    theirs: &[ParameterSection],
) -> Result<Vec<ParameterSection>, ConfigurationError> {
    let mut merged = theirs.to_vec();
    for (i, given) in own.iter().enumerate() {
        let path = format!("plant.parameters[{i}]");
        let Some(place) = merged.iter_mut().find(|p| p.name == given.name) else {
            let names: Vec<_> = theirs.iter().map(|p| p.name.as_str()).collect();
            let names = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            let message = format!(
                "is {:?}, which is not a parameter of the plug-in; its parameters are {names}",
                given.name
            );
            return Err(ConfigurationError::new(format!("{path}.name"), message));
        };
        if own[..i].iter().any(|other| other.name == given.name) {
            let message = format!("is {:?}, which is given twice", given.name);
            return Err(ConfigurationError::new(format!("{path}.name"), message));
        }
        if given.unit != "1" {
            same_unit(&path, &given.unit, &place.unit)?;
        }
        place.start = given.start;
        place.min = given.min.or(place.min);
        place.max = given.max.or(place.max);
        if !given.description.is_empty() {
            place.description.clone_from(&given.description);
        }
    }
    Ok(merged)
}

fn same_unit(path: &str, own: &str, theirs: &str) -> Result<(), ConfigurationError> {
    if own == theirs {
        return Ok(());
    }
    Err(ConfigurationError::new(
        format!("{path}.unit"),
        format!("is {own:?}, but the plug-in gives {theirs:?}"),
    ))
}
