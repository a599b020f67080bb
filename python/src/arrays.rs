//! Arguments that are arrays: those of NumPy, and what it makes one of. Real numbers become float64.

use numpy::{
    Element, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBool, PyFloat, PyInt, PyList};

/// `numpy.asarray`, after its first use.
static ASARRAY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();

/// `numpy.ma.MaskedArray`, likewise.
static MASKED: PyOnceLock<Py<PyAny>> = PyOnceLock::new();

/// Copies `argument`, called `name`, to `into`, row after row: real numbers of this shape, of which the last dimension
/// is `meaning`.
pub(crate) fn numbers(
    argument: &Bound<'_, PyAny>,
    name: &str,
    shape: &[usize],
    meaning: &[String],
    into: &mut [f64],
) -> PyResult<()> {
    if let Ok(array) = argument.cast_exact::<PyArrayDyn<f64>>() {
        return copy(array, name, shape, meaning, into);
    }
    // The actions of most policies, and a few numbers, in a fraction of NumPy's time.
    if let Ok(array) = argument.cast_exact::<PyArrayDyn<f32>>() {
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
    if !is_real(&array) {
        return Err(wrong_type(argument, name, &array, &wanted()));
    }
    let array = array.call_method1("astype", ("float64",))?;
    copy(array.cast::<PyArrayDyn<f64>>()?, name, shape, meaning, into)
}

/// Whether NumPy has letters of floats, or of integers with and without a sign, for it.
fn is_real(array: &Bound<'_, PyUntypedArray>) -> bool {
    matches!(array.dtype().kind(), b'f' | b'i' | b'u')
}

/// Copies the times `argument`, called t, to `into`: one for all, or one for each.
pub(crate) fn times(argument: &Bound<'_, PyAny>, into: &mut [f64]) -> PyResult<()> {
    match one_time(argument)? {
        Ok(t) => into.fill(t),
        Err(_) => numbers(argument, "t", &[into.len()], &["s".to_owned()], into)?,
    }
    Ok(())
}

/// The time `argument`, called t.
pub(crate) fn time(argument: &Bound<'_, PyAny>) -> PyResult<f64> {
    one_time(argument)?.map_err(|array| {
        PyValueError::new_err(format!("t: has shape {}, must be {TIME}", shape_text(array.shape())))
    })
}

/// What a time is.
const TIME: &str = "a real number (s)";

/// The time `argument`, called t; as an array where it is many.
fn one_time<'py>(argument: &Bound<'py, PyAny>) -> PyResult<Result<f64, Bound<'py, PyUntypedArray>>> {
    // A truth value is no int but by descent.
    if argument.is_instance_of::<PyFloat>() || argument.is_exact_instance_of::<PyInt>() {
        return argument.extract().map(Ok);
    }
    let array = as_array(argument, "t", &|| TIME.to_owned())?;
    if !array.shape().is_empty() {
        return Ok(Err(array));
    }
    if !is_real(&array) {
        return Err(PyTypeError::new_err(format!("t: is {}, must be {TIME}", type_name(argument))));
    }
    array.call_method0("item")?.extract().map(Ok)
}

/// The number `argument`, called `name`: a whole one from 1 on.
pub(crate) fn count(argument: &Bound<'_, PyAny>, name: &str) -> PyResult<usize> {
    let whole = (!argument.is_instance_of::<PyBool>()).then(|| argument.call_method0("__index__"));
    let Some(Ok(whole)) = whole else {
        let message = format!("{name}: is {}, must be a whole number >= 1", argument.repr()?);
        return Err(PyTypeError::new_err(message));
    };
    whole.extract().ok().filter(|count| *count > 0).ok_or_else(|| {
        PyValueError::new_err(format!("{name}: is {whole}, must be >= 1, and at most {}", isize::MAX))
    })
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
    // NumPy gives what a mask hides as if it were there.
    if argument.is_instance(MASKED.import(py, "numpy.ma", "MaskedArray")?)? {
        let message = format!("{name}: is {}, must be {} without a mask", type_name(argument), wanted());
        return Err(PyTypeError::new_err(message));
    }
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
