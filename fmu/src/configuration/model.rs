//! `[plant]` of a filter or plant: a reference plant by name, or the user's own by expressions.

use std::collections::BTreeMap;

use punctual_core::dynamics::DynPlant;
use punctual_core::plants::Signal;
use punctual_core::scalar::Scalar;
use punctual_models::{Functions, Model, Unit, unit_of};
use serde::{Deserialize, Serialize};

use super::adding::not_affine;
use super::external::check_inputs as check_external_inputs;
use super::key::{
    Key, Section,
    Unit::Of,
    Value::{Name, Number, Tables, Text, TextByName, TextOrByName, Word},
};
use super::names::{Named, check_identifier, check_known, is_reserved, taken};
use super::plugin::{NoPlugins, PluginDigest, PluginLoader, PluginSection};
use super::reference::{self, RawReference};
use super::unit::measured;
use super::{ConfigurationError, ModelName, Parameter, Range, ReferenceSection, check_unit, over_seconds};

/// A state or input of a model: an entry of `plant.states` or `plant.inputs`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct VariableSection {
    /// Its name, a C identifier, unique in the model.
    pub name: String,
    /// Its unit, such as `m/s2` or `kg.m2/s`.
    #[serde(default = "one")]
    pub unit: String,
    /// Meaning, for a human.
    #[serde(default)]
    pub description: String,
    /// Smallest value for which the model is meant. For an input it is the smallest value allowed, where
    /// `[bounds]` says nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// Largest value, likewise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
}

/// A constant of a model: an entry of `plant.parameters`, and a parameter of the FMU.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterSection {
    /// Its name, a C identifier, unique in the model.
    pub name: String,
    /// Its value, until an importer sets another one.
    pub start: f64,
    /// Its unit, such as `kg`.
    #[serde(default = "one")]
    pub unit: String,
    /// Meaning, for a human.
    #[serde(default)]
    pub description: String,
    /// Smallest value, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// Largest value, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
}

pub(super) fn one() -> String {
    "1".to_owned()
}

impl VariableSection {
    /// Its range.
    pub fn range(&self) -> Range {
        Range { min: self.min, max: self.max }
    }
}

impl From<&Signal> for VariableSection {
    fn from(signal: &Signal) -> Self {
        Self {
            name: signal.name.to_owned(),
            unit: signal.unit.to_owned(),
            description: signal.description.to_owned(),
            min: None,
            max: None,
        }
    }
}

/// `[plant]` of a filter or plant as written in a file: the keys of every kind of plant.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawModel {
    pub(super) model: Option<ModelName>,
    pub(super) plugin: Option<String>,
    pub(super) plugin_digest: Option<PluginDigest>,
    l_r: Option<f64>,
    l_f: Option<f64>,
    pub(super) states: Option<Vec<VariableSection>>,
    pub(super) inputs: Option<Vec<VariableSection>>,
    pub(super) parameters: Option<Vec<ParameterSection>>,
    pub(super) derivatives: Option<BTreeMap<String, String>>,
}

/// `[plant]` of a filter or plant.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum PlantSection {
    /// A reference plant.
    Reference(ReferenceSection),
    /// The user's own model.
    Expressions(ExpressionSection),
    /// A plug-in.
    Plugin(PluginSection),
    /// Inputs alone, for a filter that is given the derivatives of its barriers.
    External {
        /// The inputs, in order: at most 32.
        inputs: Vec<VariableSection>,
    },
}

/// A model of expressions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExpressionSection {
    /// The states, in order: at most 64.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub states: Vec<VariableSection>,
    /// The inputs, in order: at most 32.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub inputs: Vec<VariableSection>,
    /// The constants.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<ParameterSection>,
    /// The expression for the derivative of each state, affine in the inputs.
    pub derivatives: BTreeMap<String, String>,
}

/// `[plant]` of a filter or plant.
pub(super) static PLANT: Section = Section {
    name: "model",
    keys: || {
        static KEYS: [Key; 9] = [
            Key::new("model", Word(ModelName::WORDS), Some(""), "a vehicle by name, see the next table"),
            reference::L_R,
            reference::L_F,
            Key::new(
                "states",
                Tables(&VARIABLE),
                Some(""),
                "your own model: variables, in order, at most 64",
            ),
            Key::new(
                "inputs",
                Tables(&VARIABLE),
                Some(""),
                "your own model: variables, in order, at most 32",
            ),
            Key::new(
                "parameters",
                Tables(&PARAMETER),
                Some("none"),
                "your own model: constants, parameters of the FMU",
            ),
            Key::new(
                "derivatives",
                TextByName,
                Some(""),
                "your own model: for each state the [expression](#expressions) of its derivative, affine in the inputs",
            ),
            Key::new("plugin", Name, Some(""), "a shared library beside the file: [plugin.md](plugin.md)"),
            Key::new(
                "plugin_digest",
                TextOrByName,
                Some("any"),
                "the expected digest of its bytes: a text, or one for each platform",
            ),
        ];
        KEYS.iter().collect()
    },
};

const NAME: Key = Key::new("name", Name, None, "unique");
const UNIT: Key = Key::new("unit", Text, Some("`1`"), "such as `m/s2`, `kg.m2/s` or `km/h`");
const DESCRIPTION: Key = Key::new("description", Text, Some("none"), "for a human");

/// An entry of `states` or `inputs`.
pub(super) static VARIABLE: Section = Section {
    name: "variable",
    keys: || {
        static KEYS: [Key; 5] = [
            NAME,
            UNIT,
            DESCRIPTION,
            Key::new(
                "min",
                Number(Of("in its unit"), Range::FINITE),
                Some("none"),
                "of a state: the range for which the model is meant, and in which the relative degree is determined; of \
                 an input: its bound if `[bounds]` gives none",
            ),
            Key::new("max", Number(Of("in its unit"), Range::FINITE), Some("none"), "the same from above"),
        ];
        KEYS.iter().collect()
    },
};

/// An entry of `parameters`.
pub(super) static PARAMETER: Section = Section {
    name: "parameter",
    keys: || {
        static KEYS: [Key; 6] = [
            NAME,
            Key::new(
                "start",
                Number(Of("in its unit"), Range::FINITE),
                None,
                "its value until an importer sets another one",
            ),
            UNIT,
            DESCRIPTION,
            Key::new("min", Number(Of("in its unit"), Range::FINITE), Some("none"), "its smallest value"),
            Key::new("max", Number(Of("in its unit"), Range::FINITE), Some("none"), "its largest value"),
        ];
        KEYS.iter().collect()
    },
};

/// A model of expressions as written in a file, or one with a name as that.
#[derive(Default)]
pub(super) struct OwnModel {
    pub(super) states: Vec<VariableSection>,
    pub(super) inputs: Vec<VariableSection>,
    pub(super) parameters: Vec<ParameterSection>,
    pub(super) derivatives: BTreeMap<String, String>,
    /// The model by name that it is.
    pub(super) model: Option<ModelName>,
}

impl OwnModel {
    /// The states that are its position, by axis: of a model by name the first two, else those with the usual names.
    pub(super) fn position(&self) -> Option<Vec<String>> {
        let names: Vec<&str> = self.states.iter().map(|state| state.name.as_str()).collect();
        match self.model {
            Some(_) => Some(names[..2].iter().map(ToString::to_string).collect()),
            None => [3, 2].into_iter().find_map(|axes| usual_position(&names, axes)),
        }
    }
}

/// The names of the states that usually are the position, by axis.
const USUAL: [[&str; 3]; 3] = [["x", "y", "z"], ["x_p", "y_p", "z_p"], ["p_x", "p_y", "p_z"]];

/// Which of the states `names` are the position along the first `axes` axes, if they have the usual names.
pub(super) fn usual_position(names: &[&str], axes: usize) -> Option<Vec<String>> {
    let all = USUAL.iter().map(|usual| &usual[..axes]).find(|all| all.iter().all(|s| names.contains(s)))?;
    Some(all.iter().map(ToString::to_string).collect())
}

impl From<OwnModel> for RawModel {
    fn from(own: OwnModel) -> Self {
        Self {
            states: Some(own.states),
            inputs: Some(own.inputs),
            parameters: Some(own.parameters),
            derivatives: Some(own.derivatives),
            ..Self::default()
        }
    }
}

impl RawModel {
    /// The model as expressions.
    ///
    /// # Errors
    ///
    /// A plug-in, inputs alone; a model by name with constants of others, or that no filter can have.
    pub(super) fn own(self) -> Result<OwnModel, ConfigurationError> {
        let Some(model) = self.model else {
            let Self { states: Some(states), inputs: Some(inputs), derivatives: Some(derivatives), .. } =
                self
            else {
                let message = "must be a model by name, or one with `states`, `inputs` and `derivatives`: others cannot be joined for \
                               `[[agent]]`";
                return Err(ConfigurationError::new("plant", message));
            };
            let parameters = self.parameters.unwrap_or_default();
            return Ok(OwnModel { states, inputs, parameters, derivatives, model: None });
        };
        let PlantSection::Reference(reference) = PlantSection::parse(self, &NoPlugins)? else {
            return Ok(OwnModel::default());
        };
        if !model.is_affine() {
            return Err(not_affine(model));
        }
        let names = model.states().iter().map(|state| state.name.to_owned());
        let parameter = |(name, start): (&str, f64)| ParameterSection {
            name: name.to_owned(),
            start,
            unit: reference::LENGTH_UNIT.to_owned(),
            description: String::new(),
            min: None,
            max: None,
        };
        Ok(OwnModel {
            states: model.states().iter().map(VariableSection::from).collect(),
            inputs: model.inputs().iter().map(VariableSection::from).collect(),
            parameters: reference.constants().map(parameter).collect(),
            derivatives: names.zip(reference.derivatives().iter().map(ToString::to_string)).collect(),
            model: Some(model),
        })
    }
}

impl PlantSection {
    /// Completes and checks `raw`.
    pub(super) fn parse(raw: RawModel, loader: &dyn PluginLoader) -> Result<Self, ConfigurationError> {
        let refuse =
            |field: &str, message: String| Err(ConfigurationError::new(format!("plant.{field}"), message));
        // The kind of plant decides which keys belong to it.
        let given = [
            ("plugin", raw.plugin.is_some()),
            ("states", raw.states.is_some()),
            ("inputs", raw.inputs.is_some()),
            ("parameters", raw.parameters.is_some()),
            ("derivatives", raw.derivatives.is_some()),
        ];
        if raw.plugin_digest.is_some() && raw.plugin.is_none() {
            return refuse("plugin_digest", "given without `plugin`".into());
        }
        // A reference plant needs nothing more.
        if let Some(model) = raw.model {
            if let Some((field, _)) = given.iter().find(|(_, given)| *given) {
                let message = format!("given beside `model`; {} has its own", model.name());
                return refuse(field, message);
            }
            let reference = RawReference { model, l_r: raw.l_r, l_f: raw.l_f };
            return ReferenceSection::parse(&reference).map(Self::Reference);
        }
        // The other kinds have no constants; a plug-in brings everything else.
        for (field, value) in [("l_r", raw.l_r), ("l_f", raw.l_f)] {
            if value.is_some() {
                return refuse(field, "is a constant of the bicycle; other models have `parameters`".into());
            }
        }
        if let Some(name) = raw.plugin.clone() {
            return PluginSection::parse(name, raw, loader).map(Self::Plugin);
        }
        if given.iter().all(|(_, given)| !given) {
            return refuse(
                "model",
                "missing; either name a model or give `states`, `inputs` and `derivatives`".into(),
            );
        }
        // Expressions, or inputs alone: check the names and ranges.
        let RawModel { states, inputs, parameters, derivatives, .. } = raw;
        let is_external = states.is_none() && parameters.is_none() && derivatives.is_none();
        let (states, inputs) = (states.unwrap_or_default(), inputs.unwrap_or_default());
        let (parameters, derivatives) = (parameters.unwrap_or_default(), derivatives.unwrap_or_default());
        for (group, variables) in [("states", &states), ("inputs", &inputs)] {
            for (i, variable) in variables.iter().enumerate() {
                let path = format!("plant.{group}[{i}]");
                check_variable(&path, &variable.name, &variable.unit, variable.range())?;
            }
        }
        if is_external {
            check_external_inputs(&inputs)?;
            return Ok(Self::External { inputs });
        }
        // Every state has one expression, and every expression can be used.
        check_parameters(&parameters)?;
        check_known("plant.derivatives", &derivatives, "state", &states)?;
        if let Some(state) = states.iter().find(|s| !derivatives.contains_key(&s.name)) {
            return refuse(&format!("derivatives.{}", state.name), "missing, every state needs one".into());
        }
        let plant = Self::Expressions(ExpressionSection { states, inputs, parameters, derivatives });
        plant.expressions()?;
        plant.check_units()?;
        Ok(plant)
    }

    /// Refuses derivatives whose units certainly are not those of their states per second.
    fn check_units(&self) -> Result<(), ConfigurationError> {
        for (state, text) in self.states().iter().zip(self.derivatives()) {
            let name = &state.name;
            let refuse =
                |message: String| ConfigurationError::new(format!("plant.derivatives.{name}"), message);
            let wanted = measured(&state.unit).and_then(|_| measured(&over_seconds(&state.unit, 1)));
            let (Some(found), Some(wanted)) = (self.unit_of(text).map_err(refuse)?, wanted) else { continue };
            if found.is(&wanted) {
                continue;
            }
            let why = if found.is_like(&wanted) {
                let factor = found.per(&wanted);
                format!("; numbers are taken as they are, so that this is wrong by the factor {factor:.6}")
            } else {
                String::new()
            };
            let unit = &state.unit;
            return Err(refuse(format!(
                "is {text:?}, which is in {found}; the derivative of {name}, which is in {unit}, must be in {wanted}{why}"
            )));
        }
        Ok(())
    }

    /// The unit of an expression of states, inputs, constants and time, where it is known.
    ///
    /// # Errors
    ///
    /// Units that certainly do not fit together, in words.
    pub(super) fn unit_of(&self, text: &str) -> Result<Option<Unit>, String> {
        let constants = self.reference().into_iter().flat_map(ReferenceSection::constants);
        let constants = constants.map(|(name, _)| (name.to_owned(), reference::LENGTH_UNIT.to_owned()));
        let variables = self.states().into_iter().chain(self.inputs()).map(|v| (v.name, v.unit));
        let own = self.own_parameters().iter().map(|p| (p.name.clone(), p.unit.clone()));
        let units: BTreeMap<_, _> = variables.chain(constants).chain(own).collect();
        unit_of(text, &|name| units.get(name).and_then(|unit| measured(unit)))
    }

    /// The reference plant, if it is one.
    pub fn reference(&self) -> Option<&ReferenceSection> {
        match self {
            Self::Reference(reference) => Some(reference),
            _ => None,
        }
    }

    /// The model of the reference plant, if it is one.
    pub fn model(&self) -> Option<ModelName> {
        self.reference().map(|reference| reference.model)
    }

    /// The plug-in, if it is one.
    pub(super) fn plugin(&self) -> Option<&PluginSection> {
        match self {
            Self::Plugin(plugin) => Some(plugin),
            _ => None,
        }
    }

    /// The name in messages: that of the reference plant, or the kind of model in its place.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Reference(reference) => reference.model.name(),
            Self::Expressions(_) => "expressions",
            Self::Plugin(_) => "a plug-in",
            Self::External { .. } => "external",
        }
    }

    /// A description, for a human.
    pub fn title(&self) -> &'static str {
        match self {
            Self::Reference(reference) => reference.model.title(),
            Self::Expressions(_) => "plant given by expressions",
            Self::Plugin(_) => "plant given by a plug-in",
            Self::External { .. } => "plant whose simulator computes the derivatives",
        }
    }

    /// Whether its inputs are all that is known of it.
    pub fn is_external(&self) -> bool {
        matches!(self, Self::External { .. })
    }

    /// The states, inputs and parameters that the file or the plug-in gives.
    fn own(&self) -> (&[VariableSection], &[VariableSection], &[ParameterSection]) {
        match self {
            Self::Reference(_) => (&[], &[], &[]),
            Self::Expressions(ExpressionSection { states, inputs, parameters, .. })
            | Self::Plugin(PluginSection { states, inputs, parameters, .. }) => (states, inputs, parameters),
            Self::External { inputs } => (&[], inputs, &[]),
        }
    }

    /// The states, in order.
    pub fn states(&self) -> Vec<VariableSection> {
        match self.model() {
            Some(model) => model.states().iter().map(VariableSection::from).collect(),
            None => self.own().0.to_vec(),
        }
    }

    /// The inputs, in order.
    pub fn inputs(&self) -> Vec<VariableSection> {
        match self.model() {
            Some(model) => model.inputs().iter().map(VariableSection::from).collect(),
            None => self.own().1.to_vec(),
        }
    }

    /// The name of state `i`, or nothing.
    pub(crate) fn state_name(&self, i: usize) -> &str {
        match self.model() {
            Some(model) => model.states().get(i).map_or("", |s| s.name),
            None => self.own().0.get(i).map_or("", |s| &s.name),
        }
    }

    /// The name of input `i`, or nothing.
    pub(crate) fn input_name(&self, i: usize) -> &str {
        match self.model() {
            Some(model) => model.inputs().get(i).map_or("", |s| s.name),
            None => self.own().1.get(i).map_or("", |s| &s.name),
        }
    }

    /// The constants that the file or the plug-in gives.
    pub(super) fn own_parameters(&self) -> &[ParameterSection] {
        self.own().2
    }

    /// The range in which each state is meant to be, or an infinite one.
    pub(super) fn ranges(&self) -> Vec<[f64; 2]> {
        ranges(&self.states())
    }

    /// The plant as a model of expressions.
    ///
    /// # Errors
    ///
    /// An expression that cannot be used, by its path.
    pub fn expressions(&self) -> Result<Model, ConfigurationError> {
        self.with_derivatives(&self.derivatives())
    }

    /// A model of expressions with its names and constants.
    fn with_derivatives(&self, derivatives: &[&str]) -> Result<Model, ConfigurationError> {
        let (states, inputs) = (self.states(), self.inputs());
        let names =
            |variables: &[VariableSection]| variables.iter().map(|v| v.name.clone()).collect::<Vec<_>>();
        let (states, inputs) = (names(&states), names(&inputs));
        let constants = self.reference().into_iter().flat_map(ReferenceSection::constants);
        let mut parameters: Vec<(&str, f64)> = constants.collect();
        parameters.extend(self.own_parameters().iter().map(|p| (p.name.as_str(), p.start)));
        Model::new(&texts(&states), &texts(&inputs), &parameters, derivatives)
            .map_err(|e| ConfigurationError::new(format!("plant.{}", e.field()), e.message()))
    }

    /// The values of an expression for each input, which are in the table `field` by name, in the order of the inputs.
    ///
    /// # Errors
    ///
    /// An input without expression, an expression without input, one that cannot be used: by its path.
    pub(super) fn functions<C: Scalar>(
        &self,
        field: &str,
        given: &BTreeMap<String, String>,
    ) -> Result<Functions<C>, ConfigurationError> {
        let inputs = self.inputs();
        let refuse =
            |input: &str, message: String| Err(ConfigurationError::new(format!("{field}.{input}"), message));
        check_known(field, given, "input", &inputs)?;
        let mut expressions = Vec::with_capacity(inputs.len());
        for VariableSection { name, .. } in &inputs {
            let Some(text) = given.get(name) else {
                return refuse(name, "missing, every input needs one; \"0\" is one".into());
            };
            expressions.push((name.as_str(), text.as_str()));
        }
        self.values(&expressions)
            .map_err(|e| ConfigurationError::new(format!("{field}.{}", e.field()), e.message()))
    }

    /// The values of expressions of states, parameters and time, each with its path.
    ///
    /// # Errors
    ///
    /// One that cannot be used, by its path.
    pub(super) fn values<C: Scalar>(
        &self,
        expressions: &[(&str, &str)],
    ) -> Result<Functions<C>, ConfigurationError> {
        // Whatever the derivatives are, be they affine or not.
        self.with_derivatives(&vec!["0"; self.states().len()])?
            .functions(expressions)
            .map_err(|e| ConfigurationError::new(e.field(), e.message()))
    }

    /// The scale of an expression of states, parameters and time ([`Model::scale`]); 0 of one that cannot be used.
    pub(super) fn scale_of(&self, expression: &str) -> f64 {
        let model = self.with_derivatives(&vec!["0"; self.states().len()]).ok();
        model.and_then(|model| model.scale(expression, &self.ranges()).ok()).unwrap_or(0.0)
    }

    /// The expressions for the derivatives of its states, in order; none where no expressions are known.
    pub(super) fn derivatives(&self) -> Vec<&str> {
        match self {
            Self::Reference(reference) => reference.derivatives().to_vec(),
            Self::Expressions(own) => {
                own.states.iter().map(|s| own.derivatives.get(&s.name).map_or("", String::as_str)).collect()
            }
            Self::Plugin(_) | Self::External { .. } => Vec::new(),
        }
    }

    /// The parameters of the model, reached through `section` in a configuration of type `C`.
    pub(super) fn parameters<C: 'static>(&self, section: fn(&mut C) -> &mut Self) -> Vec<Parameter<C>> {
        if let Self::Reference(reference) = self {
            return reference.parameters(move |c| match section(c) {
                Self::Reference(reference) => Some(reference),
                _ => None,
            });
        }
        let row = |(i, p): (usize, &ParameterSection)| {
            let names = (p.name.clone(), format!("plant.parameters[{i}].start"));
            let range = Range { min: p.min, max: p.max };
            Parameter::new(names, p.unit.clone(), range, p.description.clone(), move |c| match section(c) {
                Self::Expressions(ExpressionSection { parameters, .. })
                | Self::Plugin(PluginSection { parameters, .. }) => {
                    parameters.get_mut(i).map(|p| &mut p.start)
                }
                Self::Reference(_) | Self::External { .. } => None,
            })
        };
        self.own_parameters().iter().enumerate().map(row).collect()
    }

    /// The plant, to simulate.
    ///
    /// # Errors
    ///
    /// A constant outside its range, an expression that cannot be used.
    pub fn build(&self) -> Result<Box<dyn DynPlant>, ConfigurationError> {
        match self {
            Self::Reference(reference) => reference.build(),
            Self::Plugin(plugin) => Ok(plugin.code()?.plant()),
            Self::Expressions(_) | Self::External { .. } => Ok(self.expressions()?.plant()),
        }
    }
}

pub(super) fn check_parameters(parameters: &[ParameterSection]) -> Result<(), ConfigurationError> {
    for (i, p) in parameters.iter().enumerate() {
        let path = format!("plant.parameters[{i}]");
        check_variable(&path, &p.name, &p.unit, Range { min: p.min, max: p.max })?;
        if is_reserved(&p.name, Named::Parameter) {
            return Err(taken(format!("{path}.name"), &p.name));
        }
    }
    Ok(())
}

/// The range in which each of `states` is meant to be, or an infinite one.
pub(super) fn ranges(states: &[VariableSection]) -> Vec<[f64; 2]> {
    let range = |s: &VariableSection| [s.min.unwrap_or(f64::NEG_INFINITY), s.max.unwrap_or(f64::INFINITY)];
    states.iter().map(range).collect()
}

fn texts(names: &[String]) -> Vec<&str> {
    names.iter().map(String::as_str).collect()
}

pub(super) fn check_variable(
    path: &str,
    name: &str,
    unit: &str,
    range: Range,
) -> Result<(), ConfigurationError> {
    check_identifier(&format!("{path}.name"), name)?;
    check_unit(&format!("{path}.unit"), unit)?;
    for (side, value) in [("min", range.min), ("max", range.max)] {
        value.map_or(Ok(()), |value| Range::FINITE.check(&format!("{path}.{side}"), value))?;
    }
    match (range.min, range.max) {
        (Some(min), Some(max)) if min > max => {
            let message = format!("is {max}, must be >= min = {min}");
            Err(ConfigurationError::new(format!("{path}.max"), message))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests;
