//! The crate `fmi-rs`.

use std::path::Path;
use std::sync::Arc;

use fmi_rs::fmi2::builder::FMU2Builder;
use fmi_rs::fmi2::types::{fmi2Status, fmi2True};
use fmi_rs::fmi2::{CS, FMU2};
use fmi_rs::model_description::fmi2::{Causality, VariableType};

use crate::{Importer, Kind, Variable};

pub(crate) struct Slave {
    instance: Arc<FMU2<CS>>,
    variables: Vec<Variable>,
    /// Holds the extracted files.
    _builder: FMU2Builder,
}

fn ok(status: fmi2Status) {
    assert_eq!(status, fmi2Status::Ok);
}

impl Importer for Slave {
    fn open(file: &Path) -> Self {
        let builder = FMU2Builder::new(&file).expect("an FMU that fmi-rs reads").loggingOn(true);
        let variables = builder
            .model_description
            .modelVariables
            .iter()
            .map(|v| Variable {
                name: v.name.clone(),
                reference: v.valueReference,
                kind: match v.variableType {
                    VariableType::Real { .. } => Kind::Real,
                    VariableType::Integer { .. } | VariableType::Enumeration { .. } => Kind::Integer,
                    VariableType::Boolean { .. } => Kind::Boolean,
                    VariableType::String { .. } => panic!("{} is a string", v.name),
                },
                output: v.causality == Causality::Output,
            })
            .collect();
        let instance = builder.instantiate_cs("instance").expect("an instance");
        ok(instance.setupExperiment(None, 0.0, None));
        ok(instance.enterInitializationMode());
        ok(instance.exitInitializationMode());
        Self { instance, variables, _builder: builder }
    }

    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn set_reals(&mut self, references: &[u32], values: &[f64]) {
        ok(self.instance.setReal(references, values));
    }

    fn reals(&mut self, references: &[u32], values: &mut [f64]) {
        ok(self.instance.getReal(references, values));
    }

    fn integer(&mut self, reference: u32) -> i32 {
        let mut value = [-1];
        ok(self.instance.getInteger(&[reference], &mut value));
        value[0]
    }

    fn boolean(&mut self, reference: u32) -> bool {
        let mut value = [-1];
        ok(self.instance.getBoolean(&[reference], &mut value));
        value[0] != 0
    }

    fn step(&mut self, t: f64, h: f64) {
        ok(self.instance.doStep(t, h, fmi2True));
    }

    fn terminate(self) {
        ok(self.instance.terminate());
    }
}
