//! A model description of FMI 2.0 in the form an importer needs: attributes of declared types are filled in,
//! and outputs and their dependencies are positions of variables.
//!
//! The file is parsed once. `fmi-rs` reads the tree as an independent importer: a text that it refuses is no
//! description, and the violations of the standard that it finds are reported as problems. The model itself
//! is read by `punctual_modeldescription`, from the same tree, because `fmi-rs` 0.3.4:
//!
//! - keeps the first of the declared types only;
//! - reads bounds of declared types as 32-bit numbers;
//! - looks for units in an element with a misspelled name, so it finds none;
//! - fills in `initial` and so hides what the file says.

use std::collections::HashMap;
use std::ops::Deref;
use std::sync::{Mutex, PoisonError};

use fmi_rs::model_description::fmi2 as importer;
use punctual_modeldescription::{
    Causality, DefaultExperiment, Located, ModelDescription, ModelStructure, SimpleType, Unknown,
    VariableKind,
};
use roxmltree::{Document, Node};

use super::{Output, names_library, without_co_simulation};
use crate::error::FmuProblem;

/// The description of a co-simulation FMU of FMI 2.0: a [`ModelDescription`] and what is derived from it.
///
/// A variable without a unit or range of its own has those of its declared type. A bound or time that is not
/// a number counts as absent.
#[derive(Clone, Debug)]
pub struct Fmi2Description {
    /// The model description, as read.
    pub model: ModelDescription,
    /// The start values of the variables, as written.
    pub starts: Vec<Option<String>>,
    /// All outputs, in the order of the variables.
    pub outputs: Vec<Output>,
    /// The derivatives of the continuous states, as listed.
    pub derivatives: Vec<Unknown>,
    /// Violations of the standard, found by `fmi-rs`; empty for a valid description.
    pub problems: Vec<String>,
}

impl Deref for Fmi2Description {
    type Target = ModelDescription;

    fn deref(&self) -> &ModelDescription {
        &self.model
    }
}

impl Fmi2Description {
    /// Reads a model description from its tree.
    ///
    /// # Errors
    ///
    /// Text that is no model description of FMI 2.0, or describes no co-simulation interface.
    pub(super) fn read(document: &Document<'_>) -> Result<Self, FmuProblem> {
        let problems = judged(document.root_element())?;
        let Located { description: mut model, structure, interfaces, starts, .. } = Located::read(document);
        if interfaces == 0 {
            let exchange = model.model_exchange.as_ref().map(|_| "ModelExchange");
            return Err(without_co_simulation(exchange.as_slice()));
        }
        if !names_library(&model.co_simulation.model_identifier) {
            return Err(FmuProblem::ModelIdentifier(model.co_simulation.model_identifier));
        }
        let outputs = outputs(&model, &structure)?;
        fill_in(&mut model);
        Ok(Self { model, starts, outputs, derivatives: structure.derivatives, problems })
    }

    /// The inputs an output depends on directly, as positions in the variables.
    pub fn direct_inputs(&self, output: &Output) -> Vec<usize> {
        let is_input = |&i: &usize| self.variables[i].causality == Causality::Input;
        match &output.dependencies {
            None => (0..self.variables.len()).filter(is_input).collect(),
            Some(list) => list.iter().copied().filter(is_input).collect(),
        }
    }
}

/// `fmi-rs` judges names with a parser in C whose state is global: one thread at a time.
static JUDGE: Mutex<()> = Mutex::new(());

/// The violations that `fmi-rs` finds.
fn judged(root: Node<'_, '_>) -> Result<Vec<String>, FmuProblem> {
    let read =
        importer::ModelDescription::from_node(&root).map_err(|e| FmuProblem::Description(e.to_string()))?;
    let _alone = JUDGE.lock().unwrap_or_else(PoisonError::into_inner);
    Ok(read.validate().into_iter().map(|problem| problem.message).collect())
}

/// Fills in the attributes of variables from their declared types. If a type is declared twice, the first
/// declaration counts.
fn fill_in(model: &mut ModelDescription) {
    let number = |value: Option<f64>| value.filter(|value| !value.is_nan());
    if let Some(experiment) = &mut model.default_experiment {
        let DefaultExperiment { start_time, stop_time, step_size, tolerance } = experiment;
        for time in [start_time, stop_time, step_size, tolerance] {
            *time = number(*time);
        }
    }
    let mut types: HashMap<&str, &SimpleType> = HashMap::new();
    for declared in &model.types {
        types.entry(&declared.name).or_insert(declared);
    }
    for variable in &mut model.variables {
        let given = variable.kind.declared_type().and_then(|name| types.get(name)).map(|of| &of.kind);
        match (&mut variable.kind, given) {
            (VariableKind::Real(own), given) => {
                let (min, max) = given.map(VariableKind::range).unwrap_or_default();
                own.min = number(own.min).or(number(min));
                own.max = number(own.max).or(number(max));
                if own.unit.is_none() {
                    own.unit = given.and_then(VariableKind::unit).map(str::to_owned);
                }
                own.relative_quantity |=
                    matches!(given, Some(VariableKind::Real(of)) if of.relative_quantity);
            }
            (
                VariableKind::Integer(own) | VariableKind::Enumeration(own),
                Some(VariableKind::Integer(given)),
            ) => {
                own.min = own.min.or(given.min);
                own.max = own.max.or(given.max);
            }
            _ => {}
        }
    }
}

fn outputs(model: &ModelDescription, structure: &ModelStructure) -> Result<Vec<Output>, FmuProblem> {
    let count = model.variables.len();
    let position = |&index: &u32| {
        let position = usize::try_from(index).ok().and_then(|i| i.checked_sub(1));
        position.filter(|&i| i < count).ok_or_else(|| {
            let named = match index {
                0 => "has an index that is missing or 0".to_owned(),
                _ => format!("names variable {index} of {count}"),
            };
            FmuProblem::Description(format!("ModelStructure {named}"))
        })
    };
    let mut outputs: Vec<Output> = model
        .variables
        .iter()
        .enumerate()
        .filter(|(_, variable)| variable.causality == Causality::Output)
        .map(|(variable, _)| Output { variable, dependencies: None })
        .collect();
    for unknown in &structure.outputs {
        let variable = position(&unknown.index)?;
        let Some(list) = &unknown.dependencies else { continue };
        let list = list.iter().map(position).collect::<Result<Vec<_>, _>>()?;
        if let Some(output) = outputs.iter_mut().find(|output| output.variable == variable) {
            output.dependencies = Some(list.into());
        }
    }
    Ok(outputs)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn xml(interface: &str, outputs: &str) -> String {
        format!(
            r#"<fmiModelDescription fmiVersion="2.0" modelName="m" guid="g">{interface}
            <TypeDefinitions><SimpleType name="T"><Enumeration><Item name="go" value="1"/><Item name="stop" value="2"/></Enumeration></SimpleType>
            <SimpleType name="L"><Real unit="m" min="-4" max="9"/></SimpleType></TypeDefinitions>
            <DefaultExperiment stopTime="2.5" stepSize="1e-3"/>
            <ModelVariables>
            <ScalarVariable name="u" valueReference="7" causality="input" description="pull"><Real start="0" unit="N" min="-1" max="INF"/></ScalarVariable>
            <ScalarVariable name="y" valueReference="8" causality="output"><Real/></ScalarVariable>
            <ScalarVariable name="s" valueReference="9" causality="output" variability="discrete"><Enumeration declaredType="T"/></ScalarVariable>
            <ScalarVariable name="l" valueReference="10"><Real declaredType="L" max="5"/></ScalarVariable>
            </ModelVariables><ModelStructure><Outputs>{outputs}</Outputs></ModelStructure></fmiModelDescription>"#
        )
    }

    /// The parser of `fmi-rs` would crash here without its lock.
    #[test]
    fn descriptions_are_read_on_several_threads() {
        let text = xml(r#"<CoSimulation modelIdentifier="m"/>"#, "");
        let text = text.replace("guid=", r#"variableNamingConvention="structured" guid="#);
        let text = text.replace(r#"name="u""#, r#"name="pump[1].""#);
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    let document = Document::parse(&text).unwrap();
                    for _ in 0..500 {
                        let problems = Fmi2Description::read(&document).unwrap().problems;
                        let named = problems.iter().filter(|problem| problem.contains("'pump[1].'"));
                        assert_eq!(named.count(), 1, "{problems:?}");
                    }
                });
            }
        });
    }

    #[test]
    fn variables_and_dependencies_are_normalised() {
        let text = xml(
            r#"<CoSimulation modelIdentifier="m" canGetAndSetFMUstate="true"/>"#,
            r#"<Unknown index="2"/><Unknown index="3" dependencies=""/>"#,
        );
        let d = Fmi2Description::read(&Document::parse(&text).unwrap()).unwrap();
        assert_eq!(d.variables[0].kind.unit(), Some("N"));
        assert_eq!(d.variables[0].kind.range(), (Some(-1.0), Some(f64::INFINITY)));
        assert_eq!((d.starts[0].as_deref(), d.variables[0].kind.start_number()), (Some("0"), Some(0.0)));
        let stop = &d.items(&d.variables[2])[1];
        assert_eq!((stop.name.as_str(), stop.value), ("stop", 2));
        // The second declared type gives the attributes that the variable leaves out.
        let l = &d.variables[3].kind;
        assert_eq!((l.unit(), l.range()), (Some("m"), (Some(-4.0), Some(5.0))));
        assert_eq!(d.default_experiment.unwrap().step_size, Some(1e-3));
        assert!(d.co_simulation.can_get_and_set_state);
        assert_eq!(d.outputs[0], Output { variable: 1, dependencies: None });
        assert_eq!(d.direct_inputs(&d.outputs[0]), [0]);
        assert_eq!(d.outputs[1].dependencies.as_deref(), Some(&[][..]));
    }

    #[test]
    fn what_cannot_be_run_is_refused() {
        let cs = r#"<CoSimulation modelIdentifier="m"/>"#;
        let error = |text: &str| {
            let document = Document::parse(text).unwrap();
            Fmi2Description::read(&document).unwrap_err().to_string()
        };
        assert!(error(&xml("", "")).contains("no co-simulation interface"));
        assert!(error(&xml(r#"<CoSimulation modelIdentifier="../m"/>"#, "")).contains("names no file"));
        assert!(error(&xml(cs, r#"<Unknown index="5"/>"#)).contains("names variable 5 of 4"));
    }
}
