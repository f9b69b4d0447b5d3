//! Arguments and results of Python functions: names of logs, and coordinates of many points as numpy arrays.
//!
//! Arrays are passed as bytes, with numpy's own `tobytes` and `frombuffer`. This takes one copy and no extra crate, and
//! types can't be confused. The buffer protocol isn't in Python's stable interface before 3.11.

use std::path::PathBuf;

use pyo3::types::{PyAnyMethods as _, PyByteArray, PyBytes, PyBytesMethods as _, PyDict, PyDictMethods as _};
use pyo3::{Borrowed, Bound, FromPyObject, PyAny, PyErr, PyResult, Python};

use crate::errors::Failure;

/// A log: one file, the parts of a recording, or a folder with these.
#[derive(FromPyObject)]
pub(crate) enum Named {
    One(PathBuf),
    Several(Vec<PathBuf>),
}

impl Named {
    pub(crate) fn paths(self) -> Vec<PathBuf> {
        match self {
            Self::One(path) => vec![path],
            Self::Several(paths) => paths,
        }
    }
}

/// Coordinates of points, m: an array of float64, or a value that numpy converts to such an array.
pub(crate) struct Coordinates(Vec<f64>);

impl<'py> FromPyObject<'_, 'py> for Coordinates {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let options = PyDict::new(given.py());
        options.set_item("dtype", "<f8")?;
        let array = given.py().import("numpy")?.call_method("asarray", (given,), Some(&options))?;
        if array.getattr("ndim")?.extract::<usize>()? != 1 {
            let shape = array.getattr("shape")?;
            return Err(
                Failure::Argument(format!("an array of shape {shape}; expected one dimension")).into()
            );
        }
        let bytes = array.call_method0("tobytes")?;
        let (values, _) = bytes.cast::<PyBytes>()?.as_bytes().as_chunks::<8>();
        Ok(Self(values.iter().map(|value| f64::from_le_bytes(*value)).collect()))
    }
}

/// Converts numbers to a numpy array of float64.
pub(crate) fn array<'py>(py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyAny>> {
    let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    py.import("numpy")?.call_method1("frombuffer", (PyByteArray::new(py, &bytes), "<f8"))
}

/// The points given by two lists of coordinates.
///
/// Errors: lists of different lengths; a coordinate that isn't finite, with its index.
pub(crate) fn points(
    names: [&str; 2],
    Coordinates(first): &Coordinates,
    Coordinates(second): &Coordinates,
) -> Result<Vec<[f64; 2]>, Failure> {
    let [one, other] = names;
    if first.len() != second.len() {
        let lengths = format!(
            "{one} has {} values and {other} has {}; they must have equal lengths",
            first.len(),
            second.len()
        );
        return Err(Failure::Argument(lengths));
    }
    let found: Vec<[f64; 2]> = first.iter().zip(second).map(|(a, b)| [*a, *b]).collect();
    let unfit = found.iter().position(|point| !point.iter().all(|value| value.is_finite()));
    match unfit.and_then(|index| Some((index, found.get(index)?))) {
        Some((index, [a, b])) => Err(Failure::Argument(format!(
            "point {index} has {one} {a} and {other} {b}; both must be finite numbers"
        ))),
        None => Ok(found),
    }
}

/// Returns `value` if it is finite and above zero.
///
/// Errors: any other value. `what` is the name in the error text.
pub(crate) fn positive(what: &str, value: f64) -> Result<f64, Failure> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(Failure::Argument(format!("{what} is {value}; it must be a finite number above zero")))
    }
}
