//! Configurations: the sources of filter, plant and controller FMUs. The only module that knows TOML.
//!
//! A configuration is read, completed with its defaults ("canonical": every value stated) and then
//! travels inside the FMU as `resources/configuration.toml`. Numbers in it are also the FMU's
//! parameters: [`Parameter`] is the one table of their names, units, ranges and meaning.

mod adding;
mod alone;
mod angle;
mod apart;
mod assurance;
mod barrier;
mod controller;
mod deviation;
mod embedded;
mod external;
mod file_kind;
mod filter;
mod follower;
mod found;
mod integrator;
mod key;
mod mission;
mod model;
mod names;
mod parameter;
mod plant;
mod plugin;
mod read;
mod reference;
mod team;
mod uncertainty;
mod unit;
mod words;

pub use alone::RunSection;
pub use angle::in_degrees;
pub use barrier::{
    Automatic, BarrierSection, Given, InfeasibleName, MethodName, Point, ProfileName, SHAPES, Shape, ShapeRow,
};
pub use controller::{Controller, ControllerConfiguration, ControllerName};
pub use deviation::{Deviation, DeviationKind};
pub use external::BarrierInput;
pub use file_kind::FileKind;
pub use filter::{FilterConfiguration, SamplingName};
pub use follower::FollowerSection;
pub use integrator::IntegratorSection;
pub use key::{Key, Section, Unit, Value};
pub use mission::{Literal, Mission, Task};
pub use model::{ExpressionSection, ParameterSection, PlantSection, VariableSection};
pub use parameter::{Parameter, Range, UNBOUNDED, updated};
pub use plant::{DisturbanceSection, IntegrationSection, OutputSection, PlantConfiguration};
pub use plugin::{Plugin, PluginDigest, PluginLoader, PluginSection};
pub use punctual_models::{Functions, mentions, nearest};
pub use read::{ConfigurationError, read_toml, write_toml};
pub use reference::{ModelName, ReferenceSection};
pub use uncertainty::{UncertainInput, UncertaintySection};
pub use unit::{base_unit, over_seconds, quantity};

use serde::{Deserialize, Serialize};

use plugin::NoPlugins;
use punctual_models::MAX_STATES;
use unit::{check_unit, unit_per};
pub(crate) use unit::{multiply, symbol_of};

/// The name of the canonical configuration inside an FMU's `resources/`.
pub const RESOURCE: &str = "configuration.toml";

/// The configuration of one FMU.
#[derive(Clone, Debug, PartialEq)]
pub enum Configuration {
    /// A safety filter.
    Filter(FilterConfiguration),
    /// A reference plant.
    Plant(PlantConfiguration),
    /// A nominal controller.
    Controller(ControllerConfiguration),
}

/// The kinds of configurations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Kind {
    Filter,
    Plant,
    Controller,
}

impl Configuration {
    /// Reads a configuration from TOML text, completes it with the defaults and checks it.
    ///
    /// # Errors
    ///
    /// Text that is not TOML; an unknown key; a missing key; a value of the wrong type or outside its
    /// range: each with the field's path, the value and what is allowed.
    ///
    /// A plug-in is refused: there is no place to look for it.
    pub fn parse(text: &str) -> Result<Self, ConfigurationError> {
        Self::parse_with(text, &NoPlugins)
    }

    /// As [`Self::parse`], with plug-ins, which `loader` finds.
    ///
    /// # Errors
    ///
    /// As there; a plug-in that cannot be used.
    pub fn parse_with(text: &str, loader: &dyn PluginLoader) -> Result<Self, ConfigurationError> {
        // Reading in two steps keeps the path of a field in the message, which an enum would lose.
        #[derive(Deserialize)]
        struct Head {
            kind: Option<Kind>,
        }
        let Some(kind) = read_toml::<Head>(text)?.kind else {
            return Err(FileKind::One.instead(text).unwrap_or_else(|| {
                ConfigurationError::new("kind", "missing, must be \"filter\", \"plant\" or \"controller\"")
            }));
        };
        Ok(match kind {
            Kind::Filter => Self::Filter(FilterConfiguration::parse(read_toml(text)?, loader)?),
            Kind::Plant => Self::Plant(PlantConfiguration::parse(read_toml(text)?, loader)?),
            Kind::Controller => Self::Controller(ControllerConfiguration::parse(read_toml(text)?)?),
        })
    }

    /// The configuration as TOML with every value stated. Parsing it gives the same configuration, and
    /// the text is the same on every machine.
    ///
    /// # Errors
    ///
    /// None in practice: the types always have a TOML form.
    pub fn canonical(&self) -> Result<String, ConfigurationError> {
        match self {
            Self::Filter(c) => write_toml(c),
            Self::Plant(c) => write_toml(c),
            Self::Controller(c) => write_toml(c),
        }
    }

    /// The kind, as the file spells it.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Filter(_) => "filter",
            Self::Plant(_) => "plant",
            Self::Controller(_) => "controller",
        }
    }

    /// The FMU's name, a C identifier: model name, model identifier and library name.
    pub fn name(&self) -> &str {
        match self {
            Self::Filter(c) => &c.name,
            Self::Plant(c) => &c.name,
            Self::Controller(c) => &c.name,
        }
    }

    /// What the user has to know of it though it can be used, in words.
    pub fn warning(&self) -> Option<String> {
        match self {
            Self::Filter(c) => c.warning(),
            Self::Plant(_) | Self::Controller(_) => None,
        }
    }

    /// The plug-in of its plant, if the plant is one.
    pub fn plugin(&self) -> Option<&Plugin> {
        let plant = match self {
            Self::Filter(c) => &c.plant,
            Self::Plant(c) => &c.plant,
            Self::Controller(_) => return None,
        };
        plant.plugin().map(PluginSection::loaded)
    }

    /// The run that it is meant for.
    pub fn experiment(&self) -> &ExperimentSection {
        match self {
            Self::Filter(c) => &c.experiment,
            Self::Plant(c) => &c.experiment,
            Self::Controller(c) => &c.experiment,
        }
    }

    /// The same configuration for another version of FMI, with arrays or without.
    #[must_use]
    pub fn for_fmi(mut self, fmi: FmiVersion, arrays: bool) -> Self {
        let experiment = match &mut self {
            Self::Filter(c) => &mut c.experiment,
            Self::Plant(c) => &mut c.experiment,
            Self::Controller(c) => &mut c.experiment,
        };
        experiment.fmi = fmi;
        // FMI 2.0 has none to do without.
        experiment.arrays = arrays || fmi == FmiVersion::Two;
        self
    }
}

/// The files and their tables, each after the tables that contain it.
pub static SECTIONS: [&Section; 16] = [
    &filter::SECTION,
    &team::SECTION,
    &barrier::SECTION,
    &model::PLANT,
    &model::VARIABLE,
    &model::PARAMETER,
    &integrator::SECTION,
    &uncertainty::SECTION,
    &uncertainty::INPUT,
    &follower::SECTION,
    &plant::SECTION,
    &plant::OUTPUT,
    &plant::INTEGRATION,
    &plant::DISTURBANCE,
    &controller::SECTION,
    &EXPERIMENT,
];

/// `[experiment]`.
static EXPERIMENT: Section = Section {
    name: "experiment",
    keys: || {
        static KEYS: [Key; 5] = [
            Key::new("start_time", Value::Number(Unit::Is("s"), Range::FINITE), Some("0"), "when it begins"),
            Key::new("stop_time", Value::Number(Unit::Is("s"), Range::FINITE), Some("10"), "after the start"),
            Key::new("step_size", STEP_SIZE, Some("0.001"), "the communication step"),
            Key::new("fmi", Value::Count(2, 3), Some("2"), "the version of FMI: 2 for 2.0, 3 for 3.0"),
            Key::new(
                "arrays",
                Value::Flag,
                Some("`true`"),
                "with `fmi = 3`: whether signals that belong together are [one array](fmu.md#fmi-30)",
            ),
        ];
        KEYS.iter().collect()
    },
};

const STEP_SIZE: Value = Value::Number(Unit::Is("s"), Range::POSITIVE);

/// `[experiment]`: the run that the FMU is meant for; importers take it as their default. docs/configuration.md has units,
/// ranges and defaults.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct ExperimentSection {
    /// Start in s.
    pub start_time: f64,
    /// Stop in s.
    pub stop_time: f64,
    /// Communication step in s.
    pub step_size: f64,
    /// The version of FMI.
    #[serde(skip_serializing_if = "is_default")]
    pub fmi: FmiVersion,
    /// Whether signals that belong together are one array, which FMI 3.0 alone has.
    #[serde(skip_serializing_if = "is_true")]
    pub arrays: bool,
}

impl Default for ExperimentSection {
    fn default() -> Self {
        Self { start_time: 0.0, stop_time: 10.0, step_size: 0.001, fmi: FmiVersion::Two, arrays: true }
    }
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "for serde")]
fn is_true(value: &bool) -> bool {
    *value
}

/// The version of FMI that an FMU is made for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(try_from = "u64", into = "u64")]
pub enum FmiVersion {
    /// FMI 2.0.
    #[default]
    Two,
    /// FMI 3.0.
    Three,
}

impl FmiVersion {
    /// The name of the version, as `fmi2GetVersion` and `fmi3GetVersion` give it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Two => "2.0",
            Self::Three => "3.0",
        }
    }
}

impl TryFrom<u64> for FmiVersion {
    type Error = String;

    fn try_from(number: u64) -> Result<Self, String> {
        match number {
            2 => Ok(Self::Two),
            3 => Ok(Self::Three),
            _ => Err(format!("is {number}, must be 2 or 3")),
        }
    }
}

impl From<FmiVersion> for u64 {
    fn from(version: FmiVersion) -> Self {
        match version {
            FmiVersion::Two => 2,
            FmiVersion::Three => 3,
        }
    }
}

impl ExperimentSection {
    fn check(&self) -> Result<(), ConfigurationError> {
        Range::FINITE.check("experiment.start_time", self.start_time)?;
        Range::FINITE.check("experiment.stop_time", self.stop_time)?;
        Range::POSITIVE.check("experiment.step_size", self.step_size)?;
        if self.stop_time <= self.start_time {
            let default = if self.stop_time == Self::default().stop_time { " (its default)" } else { "" };
            let message =
                format!("is {}{default}, must be > start_time = {}", self.stop_time, self.start_time);
            return Err(ConfigurationError::new("experiment.stop_time", message));
        }
        if self.fmi == FmiVersion::Two && !self.arrays {
            let message = "is false, must be left out with `fmi = 2`: FMI 2.0 has no arrays";
            return Err(ConfigurationError::new("experiment.arrays", message));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
