//! The units of two variables that are connected.

use punctual_fmu::units::{BaseUnit, Fit, Said, fit};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// A unit as a model description has it: its name, its exponents of kg, m, s, A, K, mol, cd and rad with factor and offset
/// where it is defined, and whether offsets do not count.
type Unit = (Option<String>, Option<([i32; 8], f64, f64)>, bool);

fn said(unit: &Unit) -> Said<'_> {
    let base = unit.1.map(|(exponents, factor, offset)| {
        let [kg, m, s, a, k, mol, cd, rad] = exponents;
        BaseUnit { kg, m, s, a, k, mol, cd, rad, factor, offset }
    });
    Said { name: unit.0.as_deref(), base, is_difference: unit.2 }
}

/// The factor and offset that make a value in the unit `given` one in `taken`, or `None` where they cannot be compared. Raises
/// `ValueError` with the reason where they do not fit.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "what comes from Python is owned")]
pub(crate) fn fit_units(given: Unit, taken: Unit) -> PyResult<Option<(f64, f64)>> {
    match fit(&said(&given), &said(&taken)).map_err(PyValueError::new_err)? {
        Fit::Same => Ok(Some((1.0, 0.0))),
        Fit::Scaled { factor, offset } => Ok(Some((factor, offset))),
        Fit::Unknown => Ok(None),
    }
}
