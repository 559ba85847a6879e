//! Pickling by `__reduce__`.

use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// The function that makes an object again, and its arguments.
pub type Reduced<'py> = PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)>;
