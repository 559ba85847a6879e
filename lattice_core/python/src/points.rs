//! Points of NumPy: float32 or float64 rows of x, y, z.

use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::refuse;

/// Points as NumPy holds them; the rows are borrowed, not copied.
pub enum Points<'py> {
    /// Single precision.
    F32(PyReadonlyArray2<'py, f32>),
    /// Double precision.
    F64(PyReadonlyArray2<'py, f64>),
}

/// The rows of [`Points`], which threads without the GIL may read.
pub enum Rows<'a> {
    /// Single precision.
    F32(&'a [[f32; 3]]),
    /// Double precision.
    F64(&'a [[f64; 3]]),
}

impl<'py> Points<'py> {
    /// An array of shape (n, 3), in rows one after another; other layouts are copied by NumPy first.
    pub fn of(array: &Bound<'py, PyAny>) -> PyResult<Points<'py>> {
        let numpy = array.py().import("numpy")?;
        let array = numpy.call_method1("ascontiguousarray", (array,))?;
        let shape = match array.cast::<numpy::PyUntypedArray>() {
            Ok(array) => array.shape().to_vec(),
            Err(_) => Vec::new(),
        };
        if shape.len() != 2 || shape.get(1) != Some(&3) {
            return Err(refuse(format!("points have shape {shape:?}, not (n, 3)")));
        }
        if let Ok(single) = array.extract() {
            return Ok(Points::F32(single));
        }
        if let Ok(double) = array.extract() {
            return Ok(Points::F64(double));
        }
        let double = array.call_method1("astype", ("float64",))?;
        double.extract().map(Points::F64).map_err(|_| {
            let kind = array.getattr("dtype").map(|kind| kind.to_string());
            refuse(format!(
                "points are of {}, not float32 or float64",
                kind.unwrap_or_default()
            ))
        })
    }

    /// The rows.
    pub fn rows(&self) -> PyResult<Rows<'_>> {
        let not = |_| refuse("points are not in rows one after another");
        Ok(match self {
            Points::F32(array) => Rows::F32(array.as_slice().map_err(not)?.as_chunks().0),
            Points::F64(array) => Rows::F64(array.as_slice().map_err(not)?.as_chunks().0),
        })
    }
}

impl Rows<'_> {
    /// Number of points.
    pub fn len(&self) -> usize {
        match self {
            Rows::F32(rows) => rows.len(),
            Rows::F64(rows) => rows.len(),
        }
    }

    /// Point `i` in double precision; NaN beyond the last.
    pub fn get(&self, i: usize) -> [f64; 3] {
        let row = match self {
            Rows::F32(rows) => rows.get(i).map(|row| row.map(f64::from)),
            Rows::F64(rows) => rows.get(i).copied(),
        };
        row.unwrap_or([f64::NAN; 3])
    }
}

/// Integers of a column, one for each of `count` points.
pub fn integers(array: &Bound<'_, PyAny>, name: &str, count: usize) -> PyResult<Vec<i64>> {
    let numpy = array.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (array,))?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if kind != "i" && kind != "u" {
        return Err(refuse(format!(
            "{name} are of {}, not integers",
            array.getattr("dtype")?
        )));
    }
    let array = array.call_method1("astype", ("int64",))?;
    let array: PyReadonlyArray1<i64> = array
        .extract()
        .map_err(|_| refuse(format!("{name} are not one row of integers")))?;
    let values = array.as_slice().map_err(refuse)?.to_vec();
    if values.len() != count {
        let len = values.len();
        return Err(refuse(format!("there are {count} points and {len} {name}")));
    }
    Ok(values)
}

/// Labels below 2^16, one for each of `count` points.
pub fn labels(array: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<u16>> {
    let label = |(row, value): (usize, i64)| {
        u16::try_from(value)
            .map_err(|_| refuse(format!("row {row}: label {value} is not below 65536")))
    };
    let values = integers(array, "labels", count)?;
    values.into_iter().enumerate().map(label).collect()
}

/// A new array of `len` rows of `N` values, which `fill` writes without the GIL, and its answer.
pub fn new_array<'py, T, R, const N: usize>(
    py: Python<'py>,
    len: usize,
    fill: impl FnOnce(&mut [[T; N]]) -> R + Send,
) -> PyResult<(Bound<'py, PyAny>, R)>
where
    T: numpy::Element + Send,
    R: Send,
{
    let array = PyArray2::<T>::zeros(py, [len, N], false);
    let answer = {
        let mut rows = array.try_readwrite().map_err(refuse)?;
        let rows = rows.as_slice_mut().map_err(refuse)?.as_chunks_mut().0;
        py.detach(|| fill(rows))
    };
    Ok((array.into_any(), answer))
}

/// Rows of `N` values as an array of shape (n, N).
pub fn array_of<'py, T: numpy::Element + Copy + Sync, const N: usize>(
    py: Python<'py>,
    rows: &[[T; N]],
) -> PyResult<Bound<'py, PyAny>> {
    let copy = |to: &mut [[T; N]]| to.copy_from_slice(rows);
    Ok(new_array(py, rows.len(), copy)?.0)
}
