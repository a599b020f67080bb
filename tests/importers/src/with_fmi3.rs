//! The crate `fmi` (rust-fmi), with FMI 3.0.
//!
//! Its reader (`fmi-schema` 0.8.0) refuses a description with units: in `src/fmi3/variable/mod.rs` a Float64
//! has no attributes `unit` and `quantity`, and unknown ones are errors. So it is given the text without
//! them; the archive and the library are unchanged. The reader also skips every enumeration, so that only
//! their Int32 twins remain.

use std::fs::File;
use std::path::Path;

use fmi::fmi3::import::Fmi3Import;
use fmi::fmi3::instance::InstanceCS;
use fmi::fmi3::schema::{Causality, Variable as Element};
use fmi::fmi3::{CoSimulation, Common, Fmi3Error, Fmi3Model, Fmi3Res, GetSet};
use fmi::traits::FmiImport;

use crate::{Importer, Kind, Variable};

pub(crate) struct Slave {
    instance: InstanceCS,
    variables: Vec<Variable>,
    /// Holds the extracted files.
    _import: Fmi3Import,
}

fn ok(result: Result<Fmi3Res, Fmi3Error>) {
    assert!(matches!(result, Ok(Fmi3Res::OK)), "{result:?}");
}

/// The text without the values of an attribute.
fn without(text: &str, attribute: &str) -> String {
    let start = format!(" {attribute}=\"");
    let mut parts = text.split(&start);
    let first = parts.next().expect("a part").to_owned();
    parts.fold(first, |kept, part| kept + part.split_once('"').expect("the end of a value").1)
}

/// Opens `file` with a description without units.
fn import(file: &Path) -> Fmi3Import {
    // Not needed with a release that reads units.
    let refusal = fmi::import::from_path::<Fmi3Import>(file).expect_err("units, which fmi 0.8.0 refuses");
    assert!(format!("{refusal:?}").contains("field: \"quantity\""), "{refusal:?}");
    let folder = tempfile::tempdir().expect("a folder");
    let mut archive = zip::ZipArchive::new(File::open(file).expect("a file")).expect("an archive");
    archive.extract(&folder).expect("the files of the archive");
    let text = std::fs::read_to_string(folder.path().join("modelDescription.xml")).expect("a description");
    Fmi3Import::new(folder, &without(&without(&text, "quantity"), "unit")).expect("an FMU that fmi reads")
}

impl Importer for Slave {
    fn open(file: &Path) -> Self {
        let import = import(file);
        let mut variables = Vec::new();
        let elements = &import.model_description().model_variables;
        for (element, v) in elements.variables.iter().zip(elements.iter_abstract()) {
            let (kind, dimensions) = match element {
                Element::Float64(v) => (Kind::Real, &v.dimensions),
                Element::Int32(v) => (Kind::Integer, &v.dimensions),
                Element::Boolean(v) => (Kind::Boolean, &v.dimensions),
                _ => panic!("{} is of another type", v.name()),
            };
            assert!(dimensions.is_empty(), "{} is an array", v.name());
            let output = v.causality() == Causality::Output;
            variables.push(Variable {
                name: v.name().to_owned(),
                reference: v.value_reference(),
                kind,
                output,
            });
        }
        let mut instance =
            import.instantiate_cs("instance", false, true, false, false, &[]).expect("an instance");
        assert_eq!(instance.get_version(), "3.0");
        ok(instance.enter_initialization_mode(None, 0.0, None));
        ok(instance.exit_initialization_mode());
        Self { instance, variables, _import: import }
    }

    fn variables(&self) -> &[Variable] {
        &self.variables
    }

    fn set_reals(&mut self, references: &[u32], values: &[f64]) {
        ok(self.instance.set_float64(references, values));
    }

    fn reals(&mut self, references: &[u32], values: &mut [f64]) {
        ok(self.instance.get_float64(references, values));
    }

    fn integer(&mut self, reference: u32) -> i32 {
        let mut value = [-1];
        ok(self.instance.get_int32(&[reference], &mut value));
        value[0]
    }

    fn boolean(&mut self, reference: u32) -> bool {
        let mut value = [false];
        ok(self.instance.get_boolean(&[reference], &mut value));
        value[0]
    }

    fn step(&mut self, t: f64, h: f64) {
        let (mut event, mut end, mut early, mut reached) = (true, true, true, f64::NAN);
        ok(self.instance.do_step(t, h, true, &mut event, &mut end, &mut early, &mut reached));
        assert_eq!((event, end, early, reached), (false, false, false, t + h));
    }

    fn terminate(mut self) {
        ok(self.instance.terminate());
    }
}
