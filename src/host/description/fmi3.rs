//! A model description of FMI 3.0 as an importer holds it, and its arrays as scalars.

use std::collections::BTreeMap;
use std::sync::Arc;

use roxmltree::Document;

use super::Description;
use crate::error::FmuProblem;

/// The description of a co-simulation FMU of FMI 3.0.
#[derive(Clone, Debug)]
pub struct Fmi3Description {}

impl Fmi3Description {
    pub(super) fn read(_document: &Document<'_>) -> Result<Self, FmuProblem> {
        Err(FmuProblem::NoCoSimulation)
    }
}

impl Description {
    pub(super) fn of_fmi3(
        _written: Arc<Fmi3Description>,
        _structural: &BTreeMap<u32, f64>,
    ) -> Result<Self, FmuProblem> {
        Err(FmuProblem::NoCoSimulation)
    }
}
