//! `kind = "plant"`: a plant that moves under held inputs.

use std::collections::BTreeMap;

use punctual_core::dynamics::DynPlant;
use punctual_models::Functions;
use serde::{Deserialize, Serialize};

use super::key::{
    Key, Section,
    Unit::{Is, Of},
    Value::{Name, Number, NumberByName, Table, Tables, Text, Word},
};
use super::model::RawModel;
use super::names::{check_identifier, check_known, taken};
use super::unit::measured;
use super::{
    ConfigurationError, Deviation, DeviationKind, EXPERIMENT, ExperimentSection, ModelName, Parameter,
    PlantSection, PluginLoader, Range, VariableSection, check_unit, model,
};

const INNER_STEP: Range = Range::POSITIVE;
const SEED: Range = Range::NON_NEGATIVE;
const PERIOD: Range = Range::POSITIVE;
const SIZE: Range = Range::NON_NEGATIVE;

/// A plant.
pub(super) static SECTION: Section = Section {
    name: "plant",
    keys: || {
        static KEYS: [Key; 8] = [
            Key::new("kind", Word(&["plant"]), None, ""),
            Key::new("name", Name, Some("the model's"), "the FMU's name"),
            Key::new("plant", Table(&model::PLANT), None, "[the model](#models)"),
            Key::new(
                "x0",
                NumberByName(Of("unit of the state"), Range::FINITE),
                Some("0, or nearest to it in the state's range"),
                "initial value of a state, by name",
            ),
            Key::new("output", Tables(&OUTPUT), Some("none"), "further outputs of the FMU beside its states"),
            Key::new("integration", Table(&INTEGRATION), Some(""), "how it is integrated"),
            Key::new("disturbance", Table(&DISTURBANCE), Some("none"), "what the model does not say"),
            Key::new("experiment", Table(&EXPERIMENT), Some(""), "[the run it is meant for](#runs)"),
        ];
        KEYS.iter().collect()
    },
};

/// An entry of `output`.
pub(super) static OUTPUT: Section = Section {
    name: "output",
    keys: || {
        static KEYS: [Key; 4] = [
            Key::new("name", Name, None, "unique; the output is `y.<name>`"),
            Key::new(
                "expression",
                Text,
                None,
                "an [expression](#expressions) of states, parameters and `t`, such as `v * cos(theta)`",
            ),
            Key::new("unit", Text, Some("`1`"), "that of the expression"),
            Key::new("description", Text, Some("none"), "for a human"),
        ];
        KEYS.iter().collect()
    },
};

/// `[integration]`.
pub(super) static INTEGRATION: Section = Section {
    name: "integration",
    keys: || {
        static KEYS: [Key; 1] = [Key::new(
            "inner_step",
            Number(Is("s"), INNER_STEP),
            Some("0.001"),
            "largest step; a communication step is divided into equal ones",
        )];
        KEYS.iter().collect()
    },
};

/// `[disturbance]`.
pub(super) static DISTURBANCE: Section = Section {
    name: "disturbance",
    keys: || {
        static KEYS: [Key; 4] = [
            Key::new(
                "inputs",
                NumberByName(Of("unit of the input"), SIZE),
                Some("nothing"),
                "largest size of what is added to an input, by name",
            ),
            Key::new(
                "measurements",
                NumberByName(Of("unit of the state"), SIZE),
                Some("nothing"),
                "largest size of what is added to an output `x.<state>`, by the state's name",
            ),
            Key::new("seed", Number(Is("1"), SEED), Some("0"), "another number, another sequence"),
            Key::new("period", Number(Is("s"), PERIOD), Some("0.01"), "how long a value lasts"),
        ];
        KEYS.iter().collect()
    },
};

/// An output of a plant beside its states: an entry of `output`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct OutputSection {
    /// Its name, a C identifier, unique among the outputs; in the FMU `y.<name>`.
    pub name: String,
    /// Its value: an expression of states, parameters and the time `t`. Of the states as they are, without the disturbance of
    /// their measurement.
    pub expression: String,
    /// Its unit.
    #[serde(default = "model::one")]
    pub unit: String,
    /// Meaning, for a human.
    #[serde(default)]
    pub description: String,
}

/// `[integration]`: the motion of the plant between communication points.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct IntegrationSection {
    /// Largest Runge-Kutta step in s. A communication step h is divided into the least number of equal steps that are not
    /// longer.
    pub inner_step: f64,
}

impl Default for IntegrationSection {
    fn default() -> Self {
        Self { inner_step: 0.001 }
    }
}

/// Part of an inner step by which a communication step may be longer than a multiple of it: round-off
/// in the importer's time, not a reason for another inner step.
const STEP_ROUND_OFF: f64 = 1e-6;

impl IntegrationSection {
    /// Number of Runge-Kutta steps for a communication step of `h` s; a whole number, 0 for h = 0.
    pub fn substeps(&self, h: f64) -> f64 {
        (h / self.inner_step * (1.0 - STEP_ROUND_OFF)).ceil()
    }
}

/// `[disturbance]`: noise on the inputs and the measurements of a plant that its model does not know, uniformly
/// distributed within bounds. Each value is a function of seed, signal and time alone, so a run can be repeated.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct DisturbanceSection {
    /// Seed of the sequence.
    #[serde(default)]
    pub seed: f64,
    /// Time in s for which a value lasts, counted from time 0.
    #[serde(default = "hold")]
    pub period: f64,
    /// Largest size of the disturbance of an input, by name, in its unit.
    #[serde(default)]
    pub inputs: BTreeMap<String, f64>,
    /// Largest size of the disturbance of an output `x.<state>`, by the name of the state, in its unit. The state
    /// itself stays as it is.
    #[serde(default)]
    pub measurements: BTreeMap<String, f64>,
}

fn hold() -> f64 {
    0.01
}

/// Reaches a number of the section.
type Access = Box<dyn Fn(&mut DisturbanceSection) -> Option<&mut f64> + Send>;

impl DisturbanceSection {
    fn check(&self, plant: &PlantSection) -> Result<(), ConfigurationError> {
        for (field, given, known, what) in [
            ("inputs", &self.inputs, plant.inputs(), "input"),
            ("measurements", &self.measurements, plant.states(), "state"),
        ] {
            check_known(&format!("disturbance.{field}"), given, what, &known)?;
        }
        Ok(())
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum PlantKind {
    Plant,
}

/// A plant as written in a file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawPlant {
    kind: PlantKind,
    #[serde(default)]
    name: String,
    plant: RawModel,
    #[serde(default)]
    output: Vec<OutputSection>,
    #[serde(default)]
    integration: IntegrationSection,
    disturbance: Option<DisturbanceSection>,
    #[serde(default)]
    x0: BTreeMap<String, f64>,
    #[serde(default)]
    experiment: ExperimentSection,
}

/// A plant FMU: `ẋ = f(x) + g(x) u` with held input u.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlantConfiguration {
    pub(super) kind: PlantKind,
    /// The FMU's name, a C identifier.
    pub name: String,
    /// The plant's model.
    pub plant: PlantSection,
    /// What the FMU tells beside the states.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub output: Vec<OutputSection>,
    /// Integration between communication points.
    pub integration: IntegrationSection,
    /// Disturbances that the model does not know.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub disturbance: Option<DisturbanceSection>,
    /// Initial value of each state, in its unit.
    pub x0: BTreeMap<String, f64>,
    /// The run that it is meant for.
    pub experiment: ExperimentSection,
    /// How the plant deviates from its model in a test of a promise. No file says so.
    #[serde(skip)]
    pub deviation: Option<Box<Deviation>>,
}

impl PlantConfiguration {
    /// Completes and checks `raw`.
    pub(super) fn parse(raw: RawPlant, loader: &dyn PluginLoader) -> Result<Self, ConfigurationError> {
        let RawPlant {
            kind: PlantKind::Plant,
            mut name,
            plant,
            output,
            integration,
            disturbance,
            x0,
            experiment,
        } = raw;
        if name.is_empty() {
            name = plant.model.map_or("plant", ModelName::name).to_owned();
        }
        check_identifier("name", &name)?;
        let plant = PlantSection::parse(plant, loader)?;
        let (kind, deviation) = (PlantKind::Plant, None);
        Self { kind, name, plant, output, integration, disturbance, x0, experiment, deviation }.completed()
    }

    /// Completes and checks what has a valid name and plant.
    pub(super) fn completed(mut self) -> Result<Self, ConfigurationError> {
        let Self { plant, disturbance, x0, experiment, .. } = &mut self;
        let states = plant.states();
        check_known("x0", x0, "state", &states)?;
        if let Some(disturbance) = disturbance {
            disturbance.check(plant)?;
        }
        for state in states {
            let start = state.range().nearest(0.0);
            x0.entry(state.name).or_insert(start);
        }
        experiment.check()?;
        for parameter in self.parameters() {
            parameter.check(&mut self)?;
        }
        // The plant itself refuses what the ranges of single numbers cannot.
        self.build()?;
        self.check_outputs()?;
        Ok(self)
    }

    /// The numbers that are parameters of the FMU; `x0.*` come first, in the order of the states.
    pub fn parameters(&self) -> Vec<Parameter<Self>> {
        let mut rows: Vec<Parameter<Self>> = Vec::new();
        for state in self.plant.states() {
            let name = format!("x0.{}", state.name);
            let description = format!("initial value: {}", state.description);
            let (unit, range) = (state.unit.clone(), state.range());
            rows.push(Parameter::new((name.clone(), name), unit, range, description, move |c: &mut Self| {
                c.x0.get_mut(&state.name)
            }));
        }
        rows.extend(self.plant.parameters(|c: &mut Self| &mut c.plant));
        rows.push(Parameter::new(
            ("inner_step".to_owned(), "integration.inner_step".to_owned()),
            "s",
            INNER_STEP,
            "largest Runge-Kutta step; the communication step is divided into equal ones",
            |c: &mut Self| Some(&mut c.integration.inner_step),
        ));
        rows.extend(self.disturbance.as_ref().map(|d| self.disturbance_parameters(d)).into_iter().flatten());
        if self.deviation.is_some() {
            let row = |name: &str, range, meaning: &str, access: fn(&mut Deviation) -> &mut f64| {
                let names = (name.to_owned(), name.to_owned());
                Parameter::new(names, "1", range, meaning, move |c: &mut Self| {
                    c.deviation.as_deref_mut().map(access)
                })
            };
            let kinds = "how the plant deviates within what the filter declares: 1 constant, 2 changing, 3 at its ends";
            let last = DeviationKind::ALL.len() as f64;
            rows.push(row(Deviation::SEED, SEED, "seed of how the plant deviates", |d| &mut d.seed));
            rows.push(row(Deviation::KIND, Range { min: Some(1.0), max: Some(last) }, kinds, |d| {
                &mut d.kind
            }));
        }
        rows
    }

    fn disturbance_parameters(&self, given: &DisturbanceSection) -> Vec<Parameter<Self>> {
        let row = |field: &str, place: &str, unit: String, range, meaning: String, access: Access| {
            let names = (format!("disturbance.{field}"), format!("disturbance.{place}"));
            Parameter::new(names, unit, range, meaning, move |c: &mut Self| {
                c.disturbance.as_mut().and_then(&access)
            })
        };
        let mut rows = vec![
            row(
                "seed",
                "seed",
                "1".to_owned(),
                SEED,
                "another number, another sequence, from then on".to_owned(),
                Box::new(|d| Some(&mut d.seed)),
            )
            .tunable(),
            row(
                "period",
                "period",
                "s".to_owned(),
                PERIOD,
                "time for which a value lasts".to_owned(),
                Box::new(|d| Some(&mut d.period)),
            ),
        ];
        for input in self.plant.inputs().into_iter().filter(|i| given.inputs.contains_key(&i.name)) {
            let (field, place) = (format!("u.{}", input.name), format!("inputs.{}", input.name));
            let meaning = format!("largest size of what is added to {}", input.description);
            let access: Access = Box::new(move |d| d.inputs.get_mut(&input.name));
            rows.push(row(&field, &place, input.unit, SIZE, meaning, access));
        }
        for state in self.plant.states().into_iter().filter(|s| given.measurements.contains_key(&s.name)) {
            let (field, place) = (format!("x.{}", state.name), format!("measurements.{}", state.name));
            let meaning = format!("largest error of the measurement of {}", state.description);
            let access: Access = Box::new(move |d| d.measurements.get_mut(&state.name));
            rows.push(row(&field, &place, state.unit, SIZE, meaning, access));
        }
        rows
    }

    fn check_outputs(&self) -> Result<(), ConfigurationError> {
        for (i, output) in self.output.iter().enumerate() {
            let field = |key: &str| format!("output[{i}].{key}");
            check_identifier(&field("name"), &output.name)?;
            if self.output[..i].iter().any(|other| other.name == output.name) {
                return Err(taken(field("name"), &output.name));
            }
            check_unit(&field("unit"), &output.unit)?;
        }
        self.outputs()?;
        for (i, OutputSection { expression, unit, .. }) in self.output.iter().enumerate() {
            let refuse = |key: &str, message: String| {
                Err(ConfigurationError::new(format!("output[{i}].{key}"), message))
            };
            match (self.plant.unit_of(expression), measured(unit)) {
                (Err(message), _) => return refuse("expression", message),
                (Ok(Some(found)), Some(given)) if !found.is(&given) => {
                    return refuse("unit", format!("is {unit:?}, but {expression:?} is in {found}"));
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// The least h of each barrier over the last step, for a plant that deviates.
    pub fn least_signals(&self) -> Vec<VariableSection> {
        let barriers = self.deviation.iter().flat_map(|of| &of.filter.barrier);
        let signal = |barrier: &super::BarrierSection| VariableSection {
            name: barrier.name.clone(),
            unit: barrier.unit(&self.plant),
            description: format!("h of {} at the state as it is, over the last step", barrier.name),
            min: None,
            max: None,
        };
        barriers.map(signal).collect()
    }

    /// The outputs as signals, in order.
    pub fn output_signals(&self) -> Vec<VariableSection> {
        let signal = |output: &OutputSection| VariableSection {
            name: output.name.clone(),
            unit: output.unit.clone(),
            description: output.description.clone(),
            min: None,
            max: None,
        };
        self.output.iter().map(signal).collect()
    }

    /// The values of the outputs, in order; none where there are no outputs.
    ///
    /// # Errors
    ///
    /// An expression that cannot be used, by its path.
    pub fn outputs(&self) -> Result<Option<Functions<f64>>, ConfigurationError> {
        if self.output.is_empty() {
            return Ok(None);
        }
        let place = |i: usize| format!("output[{i}].expression");
        let places: Vec<String> = (0..self.output.len()).map(place).collect();
        let texts = self.output.iter().map(|output| output.expression.as_str());
        let expressions: Vec<_> = places.iter().map(String::as_str).zip(texts).collect();
        self.plant.values(&expressions).map(Some)
    }

    /// The plant.
    ///
    /// # Errors
    ///
    /// A constant outside its range.
    pub fn build(&self) -> Result<Box<dyn DynPlant>, ConfigurationError> {
        self.plant.build()
    }
}
