//! Arguments that are arrays: those of NumPy, and what it makes one of. Real numbers become float64.

use numpy::{
    Element, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyFloat, PyList};

/// `numpy.asarray`, after its first use.
static ASARRAY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();

/// Copies `argument`, called `name`, to `into`, row after row: real numbers of this shape, of which the last dimension
/// is `meaning`.
pub(crate) fn numbers(
    argument: &Bound<'_, PyAny>,
    name: &str,
    shape: &[usize],
    meaning: &[String],
    into: &mut [f64],
) -> PyResult<()> {
    if let Ok(array) = argument.cast::<PyArrayDyn<f64>>() {
        return copy(array, name, shape, meaning, into);
    }
    // The actions of most policies, and a few numbers, in a fraction of NumPy's time.
    if let Ok(array) = argument.cast::<PyArrayDyn<f32>>() {
        return copy(array, name, shape, meaning, into);
    }
    if let (&[len], Ok(list)) = (shape, argument.cast_exact::<PyList>())
        && list.len() == len
        && list.iter().all(|item| item.is_exact_instance_of::<PyFloat>())
    {
        into.copy_from_slice(&list.extract::<Vec<f64>>()?);
        return Ok(());
    }
    let wanted = || {
        let shape = shape_text(shape);
        format!("real numbers (floats or integers) of shape {shape} ({})", meaning.join(", "))
    };
    let array = as_array(argument, name, &wanted)?;
    // The letters of NumPy for floats, and for integers with and without a sign.
    if !matches!(array.dtype().kind(), b'f' | b'i' | b'u') {
        return Err(wrong_type(argument, name, &array, &wanted()));
    }
    let array = array.call_method1("astype", ("float64",))?;
    copy(array.cast::<PyArrayDyn<f64>>()?, name, shape, meaning, into)
}

/// The real numbers of `argument`, called `name`: any number of rows, whose components are `meaning`.
pub(crate) fn rows(argument: &Bound<'_, PyAny>, name: &str, meaning: &[String]) -> PyResult<Vec<f64>> {
    let wanted = || format!("real numbers of shape (m, {}) ({})", meaning.len(), meaning.join(", "));
    let array = as_array(argument, name, &wanted)?;
    let &[count, _] = array.shape() else {
        let (found, components) = (shape_text(array.shape()), meaning.len());
        let message =
            format!("{name}: has shape {found}, must have (m, {components}) ({})", meaning.join(", "));
        return Err(PyValueError::new_err(message));
    };
    let mut into = vec![0.0; count * meaning.len()];
    numbers(&array, name, &[count, meaning.len()], meaning, &mut into)?;
    Ok(into)
}

/// Copies the vector `argument`, called `name`, to `into`: truth values.
pub(crate) fn mask(argument: &Bound<'_, PyAny>, name: &str, into: &mut [bool]) -> PyResult<()> {
    let shape = [into.len()];
    let wanted = || format!("bool of shape {}", shape_text(&shape));
    let array = as_array(argument, name, &wanted)?;
    match array.cast::<PyArrayDyn<bool>>() {
        Ok(array) => copy(array, name, &shape, &["bool".to_owned()], into),
        Err(_) => Err(wrong_type(argument, name, &array, &wanted())),
    }
}

/// What NumPy makes of `argument`; an array stays as it is.
fn as_array<'py>(
    argument: &Bound<'py, PyAny>,
    name: &str,
    wanted: &dyn Fn() -> String,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = argument.py();
    let array = ASARRAY.import(py, "numpy", "asarray")?.call1((argument,)).map_err(|error| {
        // Rows of unequal length.
        if !error.is_instance_of::<PyValueError>(py) {
            return error;
        }
        let found = type_name(argument);
        PyValueError::new_err(format!("{name}: is {found} of no shape, must be {}", wanted()))
    })?;
    Ok(array.cast_into::<PyUntypedArray>()?)
}

fn copy<T: Element + Copy, U: From<T>>(
    array: &Bound<'_, PyArrayDyn<T>>,
    name: &str,
    shape: &[usize],
    meaning: &[String],
    into: &mut [U],
) -> PyResult<()> {
    if array.shape() != shape {
        let (found, wanted) = (shape_text(array.shape()), shape_text(shape));
        let message = format!("{name}: has shape {found}, must have {wanted} ({})", meaning.join(", "));
        return Err(PyValueError::new_err(message));
    }
    let array = array.try_readonly()?;
    match array.as_slice() {
        // A contiguous slice in Fortran's order has another order of elements.
        Ok(values) if array.is_c_contiguous() => {
            into.iter_mut().zip(values).for_each(|(to, from)| *to = U::from(*from));
        }
        _ => into.iter_mut().zip(array.as_array().iter()).for_each(|(to, from)| *to = U::from(*from)),
    }
    Ok(())
}

fn wrong_type(
    argument: &Bound<'_, PyAny>,
    name: &str,
    array: &Bound<'_, PyUntypedArray>,
    wanted: &str,
) -> PyErr {
    let (found, of) = (type_name(argument), array.dtype());
    PyTypeError::new_err(format!("{name}: is {found} of {of}, must be {wanted}"))
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
