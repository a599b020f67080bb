//! The crate `fmi-rs`, with FMI 3.0.

use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

use fmi_rs::fmi3::FMU3;
use fmi_rs::fmi3::builder::FMU3Builder;
use fmi_rs::fmi3::types::fmi3Status;
use fmi_rs::model_description::fmi3::{Causality, VariableType};

use crate::{Importer, Kind, Variable};

pub(crate) struct Slave {
    instance: Arc<FMU3>,
    variables: Vec<Variable>,
    /// The references of the enumerations, which are 64 bits wide.
    enumerations: HashSet<u32>,
    /// Holds the extracted files.
    _builder: FMU3Builder,
}

fn ok(status: fmi3Status) {
    assert_eq!(status, fmi3Status::Ok);
}

impl Importer for Slave {
    fn open(file: &Path) -> Self {
        let mut builder = FMU3Builder::new(&file).expect("an FMU that fmi-rs reads").loggingOn(true);
        // By default it would request both, whatever the description says.
        (builder.eventModeUsed, builder.earlyReturnAllowed) = (false, false);
        let mut enumerations = HashSet::new();
        let mut variables = Vec::new();
        for v in &builder.model_description.modelVariables {
            let kind = match v.variableType {
                VariableType::Float64 { .. } => Kind::Real,
                VariableType::Int32 { .. } => Kind::Integer,
                VariableType::Enumeration { .. } => {
                    enumerations.insert(v.valueReference);
                    Kind::Integer
                }
                VariableType::Boolean { .. } => Kind::Boolean,
                _ => panic!("{} is of another type", v.name),
            };
            assert!(v.dimensions.is_empty(), "{} is an array", v.name);
            let output = v.causality == Causality::Output;
            variables.push(Variable { name: v.name.clone(), reference: v.valueReference, kind, output });
        }
        let instance = builder.instantiate_cs("instance").expect("an instance");
        ok(instance.enterInitializationMode(None, 0.0, None));
        ok(instance.exitInitializationMode());
        Self { instance, variables, enumerations, _builder: builder }
    }

    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn set_reals(&mut self, references: &[u32], values: &[f64]) {
        ok(self.instance.setFloat64(references, values));
    }

    fn reals(&mut self, references: &[u32], values: &mut [f64]) {
        ok(self.instance.getFloat64(references, values));
    }

    fn integer(&mut self, reference: u32) -> i32 {
        if self.enumerations.contains(&reference) {
            let mut value = [-1];
            ok(self.instance.getInt64(&[reference], &mut value));
            return i32::try_from(value[0]).expect("a small number");
        }
        let mut value = [-1];
        ok(self.instance.getInt32(&[reference], &mut value));
        value[0]
    }

    fn boolean(&mut self, reference: u32) -> bool {
        let mut value = [false];
        ok(self.instance.getBoolean(&[reference], &mut value));
        value[0]
    }

    fn step(&mut self, t: f64, h: f64) {
        let (mut event, mut end, mut early, mut reached) = (true, true, true, f64::NAN);
        ok(self.instance.doStep(t, h, true, &mut event, &mut end, &mut early, &mut reached));
        assert_eq!((event, end, early, reached), (false, false, false, t + h));
    }

    fn terminate(self) {
        ok(self.instance.terminate());
    }
}
