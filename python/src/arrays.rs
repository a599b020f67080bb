//! Arguments that are arrays of float64, or sequences of numbers where one sample is meant.

use numpy::{Element, PyArrayDyn, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

/// Copies the vector `argument`, called `name`, to `into`: an array of float64 or a sequence of numbers, whose
/// components are `meaning`.
pub(crate) fn vector(
    argument: &Bound<'_, PyAny>,
    name: &str,
    meaning: &[String],
    into: &mut [f64],
) -> PyResult<()> {
    if argument.cast::<PyUntypedArray>().is_ok() {
        return array(argument, name, &[into.len()], meaning, into);
    }
    let Ok(values) = argument.extract::<Vec<f64>>() else {
        let message = format!(
            "{name}: is {}, must be an array of float64 or a sequence of {} numbers ({})",
            type_name(argument),
            into.len(),
            meaning.join(", ")
        );
        return Err(PyTypeError::new_err(message));
    };
    if values.len() != into.len() {
        return Err(wrong_shape(name, &[values.len()], &[into.len()], meaning));
    }
    into.copy_from_slice(&values);
    Ok(())
}

/// Copies the matrix `argument`, called `name`, to `into`, row after row: an array of float64 with `rows` rows, whose
/// columns are `meaning`.
pub(crate) fn matrix(
    argument: &Bound<'_, PyAny>,
    name: &str,
    rows: usize,
    meaning: &[String],
    into: &mut [f64],
) -> PyResult<()> {
    if argument.cast::<PyUntypedArray>().is_ok() {
        return array(argument, name, &[rows, meaning.len()], meaning, into);
    }
    let message = format!(
        "{name}: is {}, must be an array of float64 of shape {}",
        type_name(argument),
        shape_text(&[rows, meaning.len()])
    );
    Err(PyTypeError::new_err(message))
}

/// Copies the vector `argument`, called `name`, to `into`: an array of bool.
pub(crate) fn mask(argument: &Bound<'_, PyAny>, name: &str, into: &mut [bool]) -> PyResult<()> {
    if argument.cast::<PyUntypedArray>().is_ok() {
        return array(argument, name, &[into.len()], &["bool".to_owned()], into);
    }
    let message = format!(
        "{name}: is {}, must be an array of bool of shape {}",
        type_name(argument),
        shape_text(&[into.len()])
    );
    Err(PyTypeError::new_err(message))
}

fn array<T: Element + Copy>(
    argument: &Bound<'_, PyAny>,
    name: &str,
    shape: &[usize],
    meaning: &[String],
    into: &mut [T],
) -> PyResult<()> {
    let Ok(array) = argument.cast::<PyArrayDyn<T>>() else {
        let found = argument.cast::<PyUntypedArray>().map(|array| array.dtype().to_string());
        let wanted = T::get_dtype(argument.py());
        let message =
            format!("{name}: is an array of {}, must be one of {wanted}", found.unwrap_or_default());
        return Err(PyTypeError::new_err(message));
    };
    if array.shape() != shape {
        return Err(wrong_shape(name, array.shape(), shape, meaning));
    }
    let array = array.try_readonly()?;
    match array.as_slice() {
        // A contiguous slice in Fortran's order has another order of elements.
        Ok(values) if array.is_c_contiguous() => into.copy_from_slice(values),
        _ => into.iter_mut().zip(array.as_array().iter()).for_each(|(to, from)| *to = *from),
    }
    Ok(())
}

fn wrong_shape(name: &str, found: &[usize], shape: &[usize], meaning: &[String]) -> PyErr {
    let message = format!(
        "{name}: has shape {}, must have {} ({})",
        shape_text(found),
        shape_text(shape),
        meaning.join(", ")
    );
    PyValueError::new_err(message)
}

/// The shape in the way that Python writes a tuple.
fn shape_text(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        _ => format!("({})", shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

fn type_name(argument: &Bound<'_, PyAny>) -> String {
    argument.get_type().name().map_or_else(|_| "of no known type".to_owned(), |name| name.to_string())
}
