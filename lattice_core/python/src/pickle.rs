//! Pickling by `__reduce__`.

use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// Function that recreates an object, and its arguments.
pub type Reduced<'py> = PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)>;
