//! The crate `fmi` (rust-fmi).

use std::path::Path;

use fmi::fmi2::import::Fmi2Import;
use fmi::fmi2::instance::{CoSimulation, Common, InstanceCS};
use fmi::fmi2::schema::{Causality, ScalarVariableElement};
use fmi::fmi2::{Fmi2Error, Fmi2Res};
use fmi::traits::FmiImport;

use crate::{Importer, Kind, Variable};

pub(crate) struct Slave {
    instance: InstanceCS,
    variables: Vec<Variable>,
    /// Holds the extracted files.
    _import: Fmi2Import,
}

fn ok(result: Result<Fmi2Res, Fmi2Error>) {
    assert!(matches!(result, Ok(Fmi2Res::OK)), "{result:?}");
}

impl Importer for Slave {
    fn open(file: &Path) -> Self {
        let import: Fmi2Import = fmi::import::from_path(file).expect("an FMU that fmi reads");
        let variables = import
            .model_description()
            .get_model_variables()
            .map(|v| Variable {
                name: v.name.clone(),
                reference: v.value_reference,
                kind: match v.elem {
                    ScalarVariableElement::Real(_) => Kind::Real,
                    ScalarVariableElement::Integer(_) | ScalarVariableElement::Enumeration => Kind::Integer,
                    ScalarVariableElement::Boolean(_) => Kind::Boolean,
                    ScalarVariableElement::String => panic!("{} is a string", v.name),
                },
                output: v.causality == Causality::Output,
            })
            .collect();
        let mut instance = import.instantiate_cs("instance", false, true).expect("an instance");
        assert_eq!(instance.get_types_platform(), "default");
        ok(instance.setup_experiment(None, 0.0, None));
        ok(instance.enter_initialization_mode());
        ok(instance.exit_initialization_mode());
        Self { instance, variables, _import: import }
    }

    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn set_reals(&mut self, references: &[u32], values: &[f64]) {
        ok(self.instance.set_real(references, values));
    }

    fn reals(&mut self, references: &[u32], values: &mut [f64]) {
        ok(self.instance.get_real(references, values));
    }

    fn integer(&mut self, reference: u32) -> i32 {
        let mut value = [-1];
        ok(self.instance.get_integer(&[reference], &mut value));
        value[0]
    }

    fn boolean(&mut self, reference: u32) -> bool {
        let mut value = [-1];
        ok(self.instance.get_boolean(&[reference], &mut value));
        value[0] != 0
    }

    fn step(&mut self, t: f64, h: f64) {
        ok(self.instance.do_step(t, h, true));
    }

    fn terminate(mut self) {
        ok(self.instance.terminate());
    }
}
