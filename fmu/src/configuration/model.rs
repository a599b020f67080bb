//! `[plant]` of a filter or plant: a reference plant by name, or the user's own by expressions.

use std::collections::BTreeMap;

use punctual_core::dynamics::DynPlant;
use punctual_models::Model;
use punctual_reference::plants::Signal;
use serde::{Deserialize, Serialize};

use super::external::check_inputs as check_external_inputs;
use super::key::{
    Key, Section,
    Unit::Of,
    Value::{Name, Number, Tables, Text, TextByName, TextOrByName, Word},
};
use super::names::{Named, check_identifier, is_reserved, taken};
use super::plugin::{Loaded, PluginDigest, PluginLoader};
use super::reference::{self, MODELS};
use super::{ConfigurationError, ModelName, Parameter, Range, ReferenceSection, check_unit};

/// A state or input of a model: an entry of `plant.states` or `plant.inputs`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct VariableSection {
    /// Its name, a C identifier, unique in the model.
    pub name: String,
    /// Its unit, such as `m/s2` or `kg.m2/s`. Default `1`.
    #[serde(default = "one")]
    pub unit: String,
    /// Meaning, for a human. Default: none.
    #[serde(default)]
    pub description: String,
    /// Smallest value for which the model is meant. For an input it is the smallest value allowed, where
    /// `[bounds]` says nothing. Default: none.
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
    /// Its value, until an importer sets another one; finite, within the range.
    pub start: f64,
    /// Its unit, such as `kg`. Default `1`.
    #[serde(default = "one")]
    pub unit: String,
    /// Meaning, for a human. Default: none.
    #[serde(default)]
    pub description: String,
    /// Smallest value. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// Largest value. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
}

fn one() -> String {
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

/// `[plant]`: a reference plant (`model`, with its constants), a model of expressions (`states`, `inputs`,
/// `parameters`, `derivatives`), a plug-in (`plugin`), or `inputs` alone, for a filter that is given the
/// derivatives of its barriers.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PlantSection {
    /// The reference plant. Default: none, the model is given by expressions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<ModelName>,
    /// The name of a plug-in, a shared library beside this file (`lib<name>.so`, `<name>.dll`, `lib<name>.dylib`);
    /// states, inputs and parameters are its own, and given here only to change ranges and values. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plugin: Option<String>,
    /// Digest of the plug-in's bytes, one for every platform or each by its name. Default: any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plugin_digest: Option<PluginDigest>,
    #[serde(skip)]
    pub(super) loaded: Option<Loaded>,
    /// As [`ReferenceSection::l_r`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub l_r: Option<f64>,
    /// As [`ReferenceSection::l_f`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub l_f: Option<f64>,
    /// The states, in order: at most 32.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub states: Vec<VariableSection>,
    /// The inputs, in order: at most 12.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub inputs: Vec<VariableSection>,
    /// The constants. Default: none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<ParameterSection>,
    /// The expression for the derivative of each state, affine in the inputs.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub derivatives: BTreeMap<String, String>,
}

/// `[plant]` of a filter or plant.
pub(super) static PLANT: Section = Section {
    name: "model",
    keys: || {
        static KEYS: [Key; 9] = [
            Key::new("model", Word(&MODELS), Some(""), "a vehicle by name, see the next table"),
            reference::L_R,
            reference::L_F,
            Key::new(
                "states",
                Tables(&VARIABLE),
                Some(""),
                "your own model: variables, in order, at most 32",
            ),
            Key::new(
                "inputs",
                Tables(&VARIABLE),
                Some(""),
                "your own model: variables, in order, at most 12",
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
                "what its bytes must come to: a text, or one for each platform",
            ),
        ];
        KEYS.iter().collect()
    },
};

const NAME: Key = Key::new("name", Name, None, "unique");
const UNIT: Key = Key::new("unit", Text, Some("`1`"), "such as `m/s2` or `kg.m2/s`");
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
                "of a state: where the model is meant, and the relative degree looked for; of an input: its bound where \
                 `[bounds]` says nothing",
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

impl PlantSection {
    /// The reference plant, if it is one.
    pub fn reference(&self) -> Option<ReferenceSection> {
        let model = self.model?;
        Some(ReferenceSection { model, l_r: self.l_r, l_f: self.l_f })
    }

    /// The name in messages: that of the reference plant, or the kind of model that stands in its place.
    pub fn name(&self) -> &'static str {
        let unnamed = match self.plugin {
            Some(_) => "a plug-in",
            None if self.is_external() => "external",
            None => "expressions",
        };
        self.model.map_or(unnamed, ModelName::name)
    }

    /// A description, for a human.
    pub fn title(&self) -> &'static str {
        let unnamed = match self.plugin {
            Some(_) => "plant given by a plug-in",
            None if self.is_external() => "plant whose simulator computes the derivatives",
            None => "plant given by expressions",
        };
        self.model.map_or(unnamed, ModelName::title)
    }

    /// Whether its inputs are all that is known of it.
    pub fn is_external(&self) -> bool {
        let unknown = self.states.is_empty() && self.parameters.is_empty() && self.derivatives.is_empty();
        self.model.is_none() && self.plugin.is_none() && unknown && !self.inputs.is_empty()
    }

    /// The states, in order.
    pub fn states(&self) -> Vec<VariableSection> {
        match self.model {
            Some(model) => model.states().iter().map(VariableSection::from).collect(),
            None => self.states.clone(),
        }
    }

    /// The inputs, in order.
    pub fn inputs(&self) -> Vec<VariableSection> {
        match self.model {
            Some(model) => model.inputs().iter().map(VariableSection::from).collect(),
            None => self.inputs.clone(),
        }
    }

    /// The name of state `i`, or nothing.
    pub(crate) fn state_name(&self, i: usize) -> &str {
        match self.model {
            Some(model) => model.states().get(i).map_or("", |s| s.name),
            None => self.states.get(i).map_or("", |s| &s.name),
        }
    }

    /// The name of input `i`, or nothing.
    pub(crate) fn input_name(&self, i: usize) -> &str {
        match self.model {
            Some(model) => model.inputs().get(i).map_or("", |s| s.name),
            None => self.inputs.get(i).map_or("", |s| &s.name),
        }
    }

    pub(super) fn complete(&mut self, loader: &dyn PluginLoader) -> Result<(), ConfigurationError> {
        let refuse =
            |field: &str, message: String| Err(ConfigurationError::new(format!("plant.{field}"), message));
        // The kind of plant decides which keys belong to it.
        let given = [
            ("plugin", self.plugin.is_some()),
            ("states", !self.states.is_empty()),
            ("inputs", !self.inputs.is_empty()),
            ("parameters", !self.parameters.is_empty()),
            ("derivatives", !self.derivatives.is_empty()),
        ];
        if self.plugin_digest.is_some() && self.plugin.is_none() {
            return refuse("plugin_digest", "given without `plugin`".into());
        }
        // A reference plant needs nothing more.
        if let Some(mut reference) = self.reference() {
            if let Some((field, _)) = given.iter().find(|(_, given)| *given) {
                let message = format!("given beside `model`; {} has its own", reference.model.name());
                return refuse(field, message);
            }
            reference.complete()?;
            (self.l_r, self.l_f) = (reference.l_r, reference.l_f);
            return Ok(());
        }
        // The other kinds have no constants; a plug-in brings everything else.
        for (field, value) in [("l_r", self.l_r), ("l_f", self.l_f)] {
            if value.is_some() {
                return refuse(field, "is a constant of the bicycle; other models have `parameters`".into());
            }
        }
        if let Some(name) = self.plugin.clone() {
            return self.complete_plugin(&name, loader);
        }
        if given.iter().all(|(_, given)| !given) {
            return refuse(
                "model",
                "missing; either name a model or give `states`, `inputs` and `derivatives`".into(),
            );
        }
        // Expressions, or inputs alone: check the names and ranges.
        for (group, variables) in [("states", &self.states), ("inputs", &self.inputs)] {
            for (i, variable) in variables.iter().enumerate() {
                let path = format!("plant.{group}[{i}]");
                check_variable(&path, &variable.name, &variable.unit, variable.range())?;
            }
        }
        if self.is_external() {
            return check_external_inputs(self);
        }
        // Every state has one expression, and every expression can be used.
        self.check_parameters()?;
        if let Some(unknown) = self.derivatives.keys().find(|k| self.states.iter().all(|s| s.name != **k)) {
            let names: Vec<_> = self.states.iter().map(|s| s.name.as_str()).collect();
            let message = format!("unknown state, must be one of {}", names.join(", "));
            return refuse(&format!("derivatives.{unknown}"), message);
        }
        if let Some(state) = self.states.iter().find(|s| !self.derivatives.contains_key(&s.name)) {
            return refuse(&format!("derivatives.{}", state.name), "missing, every state needs one".into());
        }
        self.expressions()?;
        Ok(())
    }

    pub(super) fn check_parameters(&self) -> Result<(), ConfigurationError> {
        for (i, p) in self.parameters.iter().enumerate() {
            let path = format!("plant.parameters[{i}]");
            check_variable(&path, &p.name, &p.unit, Range { min: p.min, max: p.max })?;
            if is_reserved(&p.name, Named::Parameter) {
                return Err(taken(format!("{path}.name"), &p.name));
            }
        }
        Ok(())
    }

    /// The range in which each state is meant to be, or an infinite one.
    pub(super) fn ranges(&self) -> Vec<[f64; 2]> {
        let end = |value: Option<f64>, none: f64| value.unwrap_or(none);
        let range = |s: VariableSection| [end(s.min, f64::NEG_INFINITY), end(s.max, f64::INFINITY)];
        self.states().into_iter().map(range).collect()
    }

    /// The plant as a model of expressions.
    ///
    /// # Errors
    ///
    /// An expression that cannot be used, by its path.
    pub fn expressions(&self) -> Result<Model, ConfigurationError> {
        let (states, inputs) = (self.states(), self.inputs());
        let names =
            |variables: &[VariableSection]| variables.iter().map(|v| v.name.clone()).collect::<Vec<_>>();
        let (states, inputs) = (names(&states), names(&inputs));
        let lengths = [("l_r", self.l_r), ("l_f", self.l_f)];
        let lengths = lengths.into_iter().filter_map(|(name, value)| Some((name, value?)));
        let own = self.parameters.iter().map(|p| (p.name.as_str(), p.start));
        let derivatives = self.derivatives();
        let parameters: Vec<_> = lengths.chain(own).collect();
        Model::new(&texts(&states), &texts(&inputs), &parameters, &derivatives)
            .map_err(|e| ConfigurationError::new(format!("plant.{}", e.field()), e.message()))
    }

    /// The expressions for the derivatives of its states, in order.
    pub(super) fn derivatives(&self) -> Vec<&str> {
        let own = |s: &VariableSection| self.derivatives.get(&s.name).map_or("", String::as_str);
        match self.reference() {
            Some(reference) => reference.derivatives().to_vec(),
            None => self.states.iter().map(own).collect(),
        }
    }

    /// The parameters of the model, reached through `section` in a configuration of type `C`.
    pub(super) fn parameters<C: 'static>(&self, section: fn(&mut C) -> &mut Self) -> Vec<Parameter<C>> {
        if let Some(reference) = self.reference() {
            return reference.parameters(move |c| &mut section(c).l_r, move |c| &mut section(c).l_f);
        }
        let row = |(i, p): (usize, &ParameterSection)| {
            let names = (p.name.clone(), format!("plant.parameters[{i}].start"));
            let range = Range { min: p.min, max: p.max };
            Parameter::new(names, p.unit.clone(), range, p.description.clone(), move |c| {
                section(c).parameters.get_mut(i).map(|p| &mut p.start)
            })
        };
        self.parameters.iter().enumerate().map(row).collect()
    }

    /// The plant, to simulate.
    ///
    /// # Errors
    ///
    /// A constant outside its range, an expression that cannot be used.
    pub fn build(&self) -> Result<Box<dyn DynPlant>, ConfigurationError> {
        match self.reference() {
            Some(reference) => reference.build(),
            None if self.plugin.is_some() => Ok(self.code()?.plant()),
            None => Ok(self.expressions()?.plant()),
        }
    }
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
