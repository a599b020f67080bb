//! The campaign file: parses TOML text into a checked [`Campaign`], which needs no other file.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use punctual_fmu::configuration::{
    Configuration, ConfigurationError, Deviation, DeviationKind, FileKind, Range, read_toml, write_toml,
};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::distribution::{Distribution, VarySection};
use super::part::Part;
use super::sampling::{MAX_RUNS, Sampler, Sampling};
use crate::coupling::{
    self, DrawnSteps, Grid, Role, Sequence, Simulation, StartValue, System, check_fed, links, port,
};
use crate::error::Error;
use crate::host::{Causality, DataType, Variability};
use crate::package;
use crate::text;

/// The content of a campaign file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    system: SystemSource,
    campaign: CampaignSection,
    /// The varied variables, by `component.variable`.
    #[serde(default)]
    vary: BTreeMap<String, VarySection>,
}

/// `system`: the name of a system file, relative to the folder of the campaign file, or the system itself as
/// a table.
#[derive(Clone, Debug)]
enum SystemSource {
    File(PathBuf),
    Inline(Box<System>),
}

impl<'de> Deserialize<'de> for SystemSource {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Expected;
        impl<'de> Visitor<'de> for Expected {
            type Value = SystemSource;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of a system file or a table like one")
            }
            fn visit_str<E>(self, name: &str) -> Result<SystemSource, E> {
                Ok(SystemSource::File(name.into()))
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<SystemSource, A::Error> {
                System::deserialize(MapAccessDeserializer::new(map))
                    .map(|s| SystemSource::Inline(Box::new(s)))
            }
        }
        deserializer.deserialize_any(Expected)
    }
}

/// `[campaign]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CampaignSection {
    /// The number of runs, 1 to 2⁵³.
    runs: u64,
    /// Seed of the campaign; another seed makes another campaign. Default 0.
    #[serde(default)]
    seed: u64,
    /// How the drawn values are spread over their distributions; default random.
    #[serde(default)]
    sampling: Sampling,
    /// Condition for a successful run; default kept.
    #[serde(default)]
    success: Success,
    /// Whether plants deviate from the model; default not.
    #[serde(default)]
    uncertainty: Uncertainty,
    /// Stop time in s, in place of the system's.
    stop_time: Option<f64>,
    /// Communication step in s, in place of the system's.
    step: Option<f64>,
}

/// Whether the plants of a campaign deviate from the filter's model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Uncertainty {
    /// They do not: each is as the system says.
    #[default]
    None,
    /// Each is drawn within what the filter declares: `[uncertainty]`, `[measurement_errors]` and `actuation_delay`.
    Declared,
}

/// Conditions for a successful run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Success {
    /// Every promise is kept, as for `punctual run --require kept`.
    #[default]
    Kept,
    /// Every barrier is reached by its deadline and not left afterwards, whether or not its samples met the
    /// constraint.
    OnTimeAndInside,
}

/// The texts that define a campaign. Its rows depend only on them and on this program.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub struct Source {
    /// The campaign file.
    pub file: String,
    /// The system file, if the campaign file names one.
    pub system: Option<String>,
    /// The configuration of each component in order, with every value stated. For an FMU of another program,
    /// the text that identifies its file.
    pub configurations: Vec<String>,
}

impl Source {
    /// A name-based UUID of all texts and the version of this program. Campaigns with the same UUID have the
    /// same rows.
    pub fn fingerprint(&self) -> String {
        let parts = [Some(&self.file), self.system.as_ref()];
        let parts = parts.into_iter().flatten().chain(&self.configurations);
        let mut text = format!("punctual {}", env!("CARGO_PKG_VERSION"));
        parts.for_each(|part| text += &format!("\n{} {part}", part.len()));
        Uuid::new_v5(&Uuid::NAMESPACE_OID, text.as_bytes()).to_string()
    }
}

/// A campaign in one JSON file, with everything that another machine needs to run it.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Packed {
    /// The version of the program that packed it.
    version: String,
    /// [`Source::fingerprint`].
    fingerprint: String,
    runs: u64,
    source: Source,
}

/// A variable that differs from run to run.
#[derive(Clone, Debug)]
pub struct Varied {
    /// `component.variable`.
    pub name: String,
    /// Its unit.
    pub unit: Option<String>,
    /// Its meaning.
    pub description: String,
    /// Position of the component.
    pub component: usize,
    /// Its value reference.
    pub reference: u32,
    /// Whether it may change in a run.
    pub tunable: bool,
    /// Its distribution.
    pub distribution: Distribution,
}

/// The numbers drawn for one run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choice {
    /// The run's own seed, below 2⁵³.
    pub seed: u64,
    /// The values of the varied variables, in order.
    pub values: Vec<f64>,
    /// If not empty, the seeds of the pieces of the run, in place of `seed`. Pieces have equal numbers of
    /// steps and contain whole periods of the noise.
    pub pieces: Vec<u64>,
}

/// A campaign ready to run.
pub struct Campaign {
    source: Source,
    system: System,
    models: Vec<Part>,
    varied: Vec<Varied>,
    sampling: Sampling,
    sampler: Sampler,
    seed: u64,
    runs: u64,
    success: Success,
    /// How the steps of a run are drawn, if they are.
    steps: Option<DrawnSteps>,
    /// The filters whose plants deviate.
    declared: Vec<Declared>,
    notes: Vec<String>,
}

impl Campaign {
    /// Reads and checks the campaign file at `path` and the files that it names: its system file and the
    /// components' FMUs, or the configurations (`.toml`) to build them from. A file from [`Campaign::packed`]
    /// replaces all of them.
    ///
    /// # Errors
    ///
    /// A file that cannot be read, or a key or value that cannot be used.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let source_text = text::read(path)?;
        // TOML text never begins with a brace.
        if source_text.starts_with('{') {
            return Self::unpacked(&source_text, path);
        }
        let file: File = read_toml(&source_text).map_err(|e| {
            let why = FileKind::Campaign.instead(&source_text).or_else(|| unquoted(&source_text));
            Error::from(why.unwrap_or(e)).in_file(path)
        })?;
        let system_path = match &file.system {
            SystemSource::File(name) => path.with_file_name(name),
            SystemSource::Inline(_) => path.to_owned(),
        };
        let (system, system_text) = match file.system {
            SystemSource::File(_) => {
                if !system_path.exists() {
                    let message = format!("there is no file {}", system_path.display());
                    return Err(Error::configuration("system", message).in_file(path));
                }
                let text = text::read(&system_path)?;
                if FileKind::of(&text) == Some(FileKind::One) {
                    let own = |e: Error| e.in_file(&system_path);
                    let mut configuration = package::read_configuration(&system_path)?;
                    if file.campaign.uncertainty == Uncertainty::Declared {
                        coupling::as_the_model(&mut configuration);
                    }
                    let (system, configurations) = coupling::alone(configuration).map_err(own)?;
                    let configurations =
                        configurations.iter().map(Configuration::canonical).collect::<Result<_, _>>()?;
                    let system = Some(system);
                    return Self::of(
                        Source { file: source_text, system, configurations },
                        path,
                        &system_path,
                    );
                }
                let system = System::parse(&text).map_err(|e| e.in_file(&system_path))?;
                (system, Some(text))
            }
            SystemSource::Inline(system) => (*system, None),
        };
        let text = |(i, component): (usize, &coupling::Component)| {
            let name = system_path.with_file_name(&component.fmu);
            let prefix = if system_text.is_none() { "system." } else { "" };
            Part::text(&name, &format!("{prefix}component[{i}].fmu")).map_err(|e| e.in_file(&system_path))
        };
        let configurations = system.components().iter().enumerate().map(text).collect::<Result<_, _>>()?;
        Self::of(Source { file: source_text, system: system_text, configurations }, path, &system_path)
    }

    /// Reads a campaign that [`Campaign::packed`] packed.
    fn unpacked(text: &str, path: &Path) -> Result<Self, Error> {
        let wrong = |message: String| Error::configuration("", format!("{}: {message}", path.display()));
        let Packed { version, fingerprint, runs, source } = serde_json::from_str(text)
            .map_err(|e| wrong(format!("is not a complete campaign written by `--pack`: {e}")))?;
        let ours = env!("CARGO_PKG_VERSION");
        if version != ours {
            return Err(wrong(format!(
                "was packed by version {version} of this program, this is version {ours}"
            )));
        }
        let changed = || wrong("was changed after `--pack` wrote it; pack the campaign again".to_owned());
        if fingerprint != source.fingerprint() {
            return Err(changed());
        }
        let campaign = Self::of(source, path, path)?;
        if campaign.runs == runs { Ok(campaign) } else { Err(changed()) }
    }

    /// The campaign as one text, with everything that it needs.
    ///
    /// # Errors
    ///
    /// A component without a text form: an FMU of another program.
    pub fn packed(&self) -> Result<String, Error> {
        let mut parts = self.models.iter().zip(self.system.components());
        if let Some((_, component)) = parts.find(|(part, _)| part.configuration().is_none()) {
            let message = format!(
                "{} of component {:?} is an FMU of another program, which is not packed; run shards where its file is",
                component.fmu, component.name
            );
            return Err(Error::configuration("--pack", message));
        }
        let packed = Packed {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            fingerprint: self.source.fingerprint(),
            runs: self.runs,
            source: self.source.clone(),
        };
        // Serialising only texts and numbers cannot fail.
        Ok(serde_json::to_string_pretty(&packed).unwrap_or_default() + "\n")
    }

    /// Checks a campaign given as texts; errors name `path` or `system_path`.
    ///
    /// # Errors
    ///
    /// As for [`Campaign::read`].
    pub fn of(source: Source, path: &Path, system_path: &Path) -> Result<Self, Error> {
        let in_file = |e: ConfigurationError| Error::from(e).in_file(path);
        // The system, with the times of the campaign.
        let file: File = read_toml(&source.file).map_err(in_file)?;
        let system = match (file.system, &source.system) {
            (SystemSource::Inline(system), _) => *system,
            (SystemSource::File(_), Some(text)) => System::parse(text).map_err(|e| e.in_file(system_path))?,
            (SystemSource::File(name), None) => {
                let message = format!("is {}, whose text is missing", name.display());
                return Err(in_file(ConfigurationError::new("system", message)));
            }
        };
        // A system inside the campaign file has not been checked yet.
        let prefix = if source.system.is_none() { "system." } else { "" };
        let system = system
            .timed(None, None)
            .map_err(|e| in_file(ConfigurationError::new(format!("{prefix}{}", e.field()), e.message())))?;
        let section = file.campaign;
        let system = system.timed(section.stop_time, section.step).map_err(|e| {
            in_file(ConfigurationError::new(e.field().replace("experiment.", "campaign."), e.message()))
        })?;
        // The components, from their configurations.
        let components = source.configurations.iter().zip(system.components());
        let mut models = components
            .map(|(text, component)| Part::of(text, component, system_path))
            .collect::<Result<Vec<_>, Error>>()?;
        let (declared, steps) = match section.uncertainty {
            Uncertainty::None => (Vec::new(), Ok(None)),
            Uncertainty::Declared => {
                deviating(&system, &mut models, &file.vary).map_err(|e| e.in_file(path))?
            }
        };
        let refer: Vec<_> = models.iter().map(Part::description).collect();
        let connected = links(&system, &refer).map_err(|e| e.in_file(system_path))?;
        // The varied variables.
        let (mut varied, mut given) = (Vec::new(), Vec::new());
        for (name, section) in &file.vary {
            let field = format!("vary.{name:?}");
            let port = port(&system, &refer, &field, name).map_err(|e| e.in_file(path))?;
            let variable = &refer[port.component].variables[port.variable];
            let settable = matches!(variable.causality, Causality::Parameter | Causality::Input);
            if !settable || variable.of != DataType::Float64 {
                let (causality, kind) = (variable.causality.as_str(), variable.type_name);
                let message = format!(
                    "is of type {kind} and causality {causality}; only Real parameters and inputs can be varied"
                );
                return Err(in_file(ConfigurationError::new(field, message)));
            }
            if variable.count > 1 {
                let message = "is an element of an array; only scalars can be varied";
                return Err(in_file(ConfigurationError::new(field, message)));
            }
            if let Some(link) = connected.iter().find(|link| link.to == port) {
                let from = &system.components()[link.from.component].name;
                let output = &refer[link.from.component].variables[link.from.variable].name;
                let message = format!("is an input whose values come from {from}.{output}");
                return Err(in_file(ConfigurationError::new(field, message)));
            }
            let (min, max) = variable.range;
            let range = Range { min, max };
            given.push(port);
            varied.push(Varied {
                name: name.clone(),
                unit: variable.unit.clone(),
                description: variable.description.clone(),
                component: port.component,
                reference: variable.value_reference,
                tunable: variable.causality == Causality::Input
                    || variable.variability == Variability::Tunable,
                distribution: section.checked(&field, range).map_err(in_file)?,
            });
            let varied = &varied[varied.len() - 1];
            if let Distribution::Sequence { period, .. } = varied.distribution {
                let wrong =
                    |key, message| Err(in_file(ConfigurationError::new(format!("{field}.{key}"), message)));
                if !varied.tunable {
                    let message = "is \"sequence\", which is for what may change in a run: inputs and tunable parameters";
                    return wrong("distribution", message.to_owned());
                }
                let step = system.experiment().step;
                if whole(period / step).is_none_or(|steps| steps < 1.0) {
                    let message = format!("is {period}, must be a whole number of steps of {step} s");
                    return wrong("period", message);
                }
            }
        }
        check_fed(&system, &refer, &connected, &given).map_err(|e| e.in_file(system_path))?;
        // How each plant deviates is drawn after what the file varies, so that this stays the same.
        for Declared { plant: component, .. } in &declared {
            for (name, distribution) in [
                (Deviation::SEED, Distribution::Seed),
                (
                    Deviation::KIND,
                    Distribution::Choice(DeviationKind::ALL.map(|kind| f64::from(kind as u8)).into()),
                ),
            ] {
                let description = refer[*component];
                let Some(variable) = description.index_of(name).map(|i| &description.variables[i]) else {
                    continue;
                };
                varied.push(Varied {
                    name: format!("{}.{name}", system.components()[*component].name),
                    unit: variable.unit.clone(),
                    description: variable.description.clone(),
                    component: *component,
                    reference: variable.value_reference,
                    tunable: false,
                    distribution,
                });
            }
        }
        let CampaignSection { runs, seed, sampling, success, .. } = section;
        let sampler = Sampler::new(sampling, seed, runs, varied.len()).map_err(in_file)?;
        let late = coupling::delays(&system, &refer, &connected);
        let mut notes = coupling::unit_notes(&system, &refer, &connected);
        notes.extend(late.warnings.into_iter().chain(late.notes));
        let (steps, kept) = steps.map_or_else(|why| (None, Some(why)), |steps| (steps, None));
        notes.extend(kept);
        notes.extend(declared.iter().map(|declared| {
            let [filter, plant] = [declared.filter, declared.plant].map(|c| &system.components()[c].name);
            format!("{plant} is the model of {filter} and deviates from it in each run, as drawn within what {filter} declares")
        }));
        Ok(Self {
            source,
            system,
            models,
            varied,
            sampling,
            sampler,
            seed,
            runs,
            success,
            declared,
            steps,
            notes,
        })
    }

    /// The texts it is made of.
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// The coupled system, with the times that the campaign sets.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// The components, in the order of the system.
    pub fn models(&self) -> &[Part] {
        &self.models
    }

    /// The varied variables, by name.
    pub fn varied(&self) -> &[Varied] {
        &self.varied
    }

    /// How the runs are spread over the varied values.
    pub fn sampling(&self) -> Sampling {
        self.sampling
    }

    /// The seed of the campaign.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The number of runs.
    pub fn runs(&self) -> u64 {
        self.runs
    }

    /// Notes for the user that hold for every run.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The filters whose plants are drawn within what they declare.
    pub fn declared(&self) -> &[Declared] {
        &self.declared
    }

    /// The condition for a successful run.
    pub fn success(&self) -> Success {
        self.success
    }

    /// The least number of steps that holds whole noise periods of every plant whose seed is varied. A new
    /// seed after that many steps starts with a new period. `None` if no seed is varied.
    ///
    /// # Errors
    ///
    /// A seed that is varied but is not that of a plant's `[disturbance]`; a period that is varied; a start
    /// time or step that does not fit the periods.
    pub(super) fn piece(&self) -> Result<Option<u64>, Error> {
        if !self.declared.is_empty() {
            let message = "is \"declared\", must be \"none\" for --rare, which draws from [vary] and the noise of plants alone";
            return Err(Error::configuration("campaign.uncertainty", message));
        }
        let experiment = self.system.experiment();
        let mut periods = Vec::new();
        for varied in self.varied.iter().filter(|varied| matches!(varied.distribution, Distribution::Seed)) {
            let component = &self.system.components()[varied.component];
            let wrong = |message: String| {
                Err(Error::configuration(format!("vary.{:?}.distribution", varied.name), message))
            };
            let given = match self.models[varied.component].configuration() {
                Some(Configuration::Plant(plant)) => plant.disturbance.as_ref().map(|given| given.period),
                _ => None,
            };
            let Some(given) = given.filter(|_| varied.tunable) else {
                return wrong(
                    "is \"seed\"; --rare takes the seed of a plant's [disturbance] alone".to_owned(),
                );
            };
            let name = format!("{}.disturbance.period", component.name);
            if self.varied.iter().any(|varied| varied.name == name) {
                return wrong(format!("is \"seed\" where {name} is varied too; --rare takes one of them"));
            }
            let period = match component.start.get("disturbance.period") {
                Some(StartValue::Real(period)) => *period,
                Some(StartValue::Integer(period)) => *period as f64,
                _ => given,
            };
            if whole(experiment.start_time / period).is_none() {
                let start = experiment.start_time;
                return wrong(format!(
                    "is \"seed\"; --rare needs a start time, now {start} s, of whole periods of {period} s"
                ));
            }
            periods.push((period, varied));
        }
        let Some((longest, varied)) = periods.iter().max_by(|a, b| a.0.total_cmp(&b.0)) else {
            return Ok(None);
        };
        let fits = |steps: &u64| {
            periods
                .iter()
                .all(|(period, _)| whole(*steps as f64 * experiment.step / period).is_some_and(|n| n > 0.0))
        };
        let steps = (1..=self.grid().steps()).find(fits).ok_or_else(|| {
            let message = format!(
                "is \"seed\"; --rare needs steps, now of {} s, a whole number of which is one of its periods of {longest} s",
                experiment.step
            );
            Error::configuration(format!("vary.{:?}.distribution", varied.name), message)
        })?;
        // More pieces would only cost memory.
        Ok(Some(steps * self.grid().steps().div_ceil(steps * MOST_PIECES)))
    }

    /// The communication points.
    pub(super) fn grid(&self) -> Grid {
        let experiment = self.system.experiment();
        Grid::new(experiment.start_time, experiment.stop_time, experiment.step)
    }

    /// The campaign that consists of one run, drawn as `choice`.
    ///
    /// # Errors
    ///
    /// None if the choice is one of this campaign.
    pub(super) fn alone(&self, choice: &Choice) -> Result<Self, Error> {
        let mut file: serde_json::Value = read_toml(&self.source.file)?;
        file["campaign"]["runs"] = 1.into();
        for (varied, value) in self.varied.iter().zip(&choice.values) {
            let alone = match (&varied.distribution, self.piece()?) {
                (Distribution::Sequence { .. }, _) => continue,
                (Distribution::Seed, Some(steps)) => serde_json::json!({
                    "distribution": "sequence",
                    "values": choice.pieces,
                    "period": steps as f64 * self.system.experiment().step,
                }),
                _ => serde_json::json!({ "distribution": "choice", "values": [value] }),
            };
            file["vary"][&varied.name] = alone;
        }
        let source = Source { file: write_toml(&file)?, ..self.source.clone() };
        Self::of(source, Path::new("the worst run"), Path::new("the worst run"))
    }

    /// Draws the numbers of run `number`. They depend only on the campaign's texts and on the number.
    pub fn choice(&self, number: u64) -> Choice {
        let mut values = Vec::new();
        let seed = self.sampler.draw(number, &mut values);
        for (value, varied) in values.iter_mut().zip(&self.varied) {
            *value = varied.distribution.value(*value, seed);
        }
        Choice { seed, values, pieces: Vec::new() }
    }

    /// Couples the components as `system` says, which differs from the campaign's only in the signals that it
    /// records. FMUs of other programs are loaded for this simulation alone.
    ///
    /// # Errors
    ///
    /// A signal to record or draw that does not exist; an FMU that has changed since, or cannot be loaded.
    pub fn simulation(&self, system: &System) -> Result<Simulation, Error> {
        let descriptions: Vec<_> = self.models.iter().map(Part::description).collect();
        let instance = |c: usize| self.models[c].instance(&system.components()[c].name);
        Simulation::assembled(system, &descriptions, instance)
    }

    /// Gives `simulation` the start values of a run, and the values that change during it.
    pub fn start(&self, simulation: &mut Simulation, choice: &Choice) {
        for (varied, value) in self.varied.iter().zip(&choice.values) {
            simulation.set_start(varied.component, varied.reference, *value);
        }
        // Steps are drawn as the first plant is.
        let drawn = |name: &str| {
            let plant = &self.system.components()[self.declared.first()?.plant].name;
            let at = self.varied.iter().position(|varied| varied.name == format!("{plant}.{name}"))?;
            choice.values.get(at).copied()
        };
        let of_run = drawn(Deviation::SEED).zip(drawn(Deviation::KIND));
        simulation.set_steps(self.steps.zip(of_run).map(|(steps, (seed, kind))| DrawnSteps {
            seed,
            kind,
            ..steps
        }));
        let pieces: Vec<f64> = choice.pieces.iter().map(|seed| *seed as f64).collect();
        let sequence = |varied: &Varied| {
            let (values, steps) = match &varied.distribution {
                Distribution::Sequence { values, period } => {
                    (values, whole(period / self.system.experiment().step)? as u64)
                }
                Distribution::Seed if !pieces.is_empty() => (&pieces, self.piece().ok()??),
                _ => return None,
            };
            let Varied { component, reference, .. } = *varied;
            Some(Sequence { component, reference, steps, values: values.clone() })
        };
        simulation.set_sequences(self.varied.iter().filter_map(sequence).collect());
    }
}

/// A filter whose plant is drawn within what the filter declares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Declared {
    /// Position of the filter among the components.
    pub filter: usize,
    /// Position of its plant.
    pub plant: usize,
    /// Whether its outputs are read a step late.
    pub late: bool,
    /// How many steps after its sample an input begins to act, a part of one counted as one.
    pub delayed: usize,
}

/// Lets the plants of all filters that declare something deviate within that.
///
/// # Errors
///
/// No filter declares anything; a filter without plans; a plant that is not the filter's model alone; a declared number that
/// differs from run to run, or is given by the system.
fn deviating(
    system: &System,
    models: &mut [Part],
    vary: &BTreeMap<String, VarySection>,
) -> Result<(Vec<Declared>, coupling::Steps), Error> {
    let (found, steps) = {
        let configurations: Vec<_> = models.iter().map(Part::configuration).collect();
        let descriptions: Vec<_> = models.iter().map(Part::description).collect();
        let found = coupling::deviations(system, &descriptions, &configurations)
            .map_err(|message| Error::configuration("campaign.uncertainty", message))?;
        let steps = coupling::steps(system, &descriptions, &configurations, &found);
        (found, steps)
    };
    let mut declared = Vec::new();
    for coupling::Drawn { filter, plant, configuration, late, delayed, .. } in found {
        for (component, role) in [(filter, Role::Filter), (plant, Role::Plant)] {
            let name = &system.components()[component].name;
            let is_fixed = |key: &&String| {
                let variable = key.strip_prefix(name.as_str()).and_then(|rest| rest.strip_prefix('.'));
                variable.is_some_and(|variable| !coupling::may_differ(role, variable))
            };
            if let Some(key) = vary.keys().find(is_fixed) {
                let message = "cannot be varied where `campaign.uncertainty` is \"declared\": the plant is drawn within what the file of \
                               the filter states";
                return Err(Error::configuration(format!("vary.{key:?}"), message));
            }
        }
        models[plant] = Part::Own(Box::new(coupling::Own::new(Configuration::Plant(configuration))?));
        declared.push(Declared { filter, plant, late, delayed });
    }
    Ok((declared, steps))
}

/// The error for a name under `vary` that has dots but no quotes, which TOML reads as nested tables.
fn unquoted(text: &str) -> Option<ConfigurationError> {
    let file: serde_json::Value = read_toml(text).ok()?;
    for (first, mut found) in file.get("vary")?.as_object()? {
        let mut name = first.clone();
        while let Some(table) = found.as_object().filter(|table| !table.contains_key("distribution")) {
            let (key, inner) = table.iter().next()?;
            name += &format!(".{key}");
            found = inner;
        }
        if name != *first && found.is_object() {
            let message = format!("a name with dots is written in quotes, [vary.{name:?}]");
            return Some(ConfigurationError::new(format!("vary.{name}"), message));
        }
    }
    None
}

/// The whole number that equals `ratio` up to round-off, if there is one.
fn whole(ratio: f64) -> Option<f64> {
    let whole = ratio.round();
    ((ratio - whole).abs() <= 1e-6).then_some(whole)
}

/// The most pieces of a run that have seeds of their own.
const MOST_PIECES: u64 = 1000;

// Counts travel as 64-bit integers, seeds as doubles.
const _: () = assert!(MAX_RUNS <= 1 << 53);
