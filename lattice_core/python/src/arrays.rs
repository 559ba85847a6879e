//! Arrays returned by calls.

use numpy::{Element, PyArray, PyArrayMethods, PyUntypedArrayMethods, ndarray::Dimension};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::errors::{mistyped, refuse};

/// Creates an uninitialized NumPy array; fails with `MemoryError` if it does not fit into memory.
pub fn empty<'py, T: Element, D: Dimension>(
    py: Python<'py>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArray<T, D>>> {
    let shape = PyTuple::new(py, shape)?;
    let array = py
        .import("numpy")?
        .call_method1("empty", (shape, T::get_dtype(py)))?;
    Ok(array.cast_into::<PyArray<T, D>>()?)
}

/// Creates an array of these values.
pub fn array_of<'py, T: Element + Copy, D: Dimension>(
    py: Python<'py>,
    shape: &[usize],
    values: &[T],
) -> PyResult<Bound<'py, PyAny>> {
    let array = empty::<T, D>(py, shape)?;
    {
        let mut to = array.try_readwrite().map_err(refuse)?;
        to.as_slice_mut().map_err(refuse)?.copy_from_slice(values);
    }
    Ok(array.into_any())
}

/// Creates an array of shape (n, N) from rows of `N` values.
pub fn rows_of<'py, T: Element + Copy, const N: usize>(
    py: Python<'py>,
    rows: &[[T; N]],
) -> PyResult<Bound<'py, PyAny>> {
    array_of::<T, numpy::Ix2>(py, &[rows.len(), N], rows.as_flattened())
}

/// Validates the argument `out`: an int32 array of shape (`len`, 3) in C order.
pub fn expect_out<'a, 'py>(
    out: &'a Bound<'py, PyAny>,
    len: usize,
) -> PyResult<&'a Bound<'py, PyArray<i32, numpy::Ix2>>> {
    let Ok(array) = out.cast::<PyArray<i32, numpy::Ix2>>() else {
        let kind = match out.getattr("dtype") {
            Ok(dtype) => format!("{dtype} with {} axes", out.getattr("ndim")?),
            Err(_) => out.get_type().to_string(),
        };
        return Err(mistyped(format!(
            "out is of {kind}, not an array of int32 of shape (n, 3)"
        )));
    };
    let shape = array.shape();
    if shape != [len, 3] {
        return Err(refuse(format!("out has shape {shape:?}, not ({len}, 3)")));
    }
    if !array.is_c_contiguous() {
        let strides = array.strides();
        return Err(refuse(format!(
            "out is not writable: its strides are {strides:?} bytes, not C order: give np.empty(({len}, 3), np.int32)"
        )));
    }
    Ok(array)
}
