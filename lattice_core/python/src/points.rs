//! NumPy points: float32 or float64 rows of x, y, z.

use numpy::{PyReadonlyArray2, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;

use crate::errors::{mistyped, refuse};

/// Points held by NumPy; the rows are borrowed, not copied.
pub enum Points<'py> {
    /// Single precision.
    F32(PyReadonlyArray2<'py, f32>),
    /// Double precision.
    F64(PyReadonlyArray2<'py, f64>),
}

/// Rows of [`Points`], readable by threads without the GIL.
#[derive(Clone, Copy)]
pub enum Rows<'a> {
    /// Single precision.
    F32(&'a [[f32; 3]]),
    /// Double precision.
    F64(&'a [[f64; 3]]),
}

impl<'py> Points<'py> {
    /// Accepts an array of shape (n, 3) without masked values; NumPy copies other layouts, byte orders and types.
    pub fn of(array: &Bound<'py, PyAny>) -> PyResult<Points<'py>> {
        if let Some(mask) = mask_of(array)? {
            let row = first_true(&mask.call_method1("any", (-1,))?)?;
            return Err(refuse(format!(
                "row {row} is masked: give xyz.data[~xyz.mask.any(axis=1)]; only insert leaves masked rows out"
            )));
        }
        Points::unmasked(array)
    }

    /// Accepts an array of shape (n, 3), masked or not.
    pub fn unmasked(array: &Bound<'py, PyAny>) -> PyResult<Points<'py>> {
        let numpy = array.py().import("numpy")?;
        let array = numpy.call_method1("asarray", (array,))?;
        let shape = shape_of(&array)?;
        if shape.len() != 2 || shape.get(1) != Some(&3) {
            return Err(refuse(format!("points have shape {shape:?}, not (n, 3)")));
        }
        let dtype = array.getattr("dtype")?;
        let kind: String = dtype.getattr("kind")?.extract()?;
        let bytes: usize = dtype.getattr("itemsize")?.extract()?;
        let precision = match (kind.as_str(), bytes) {
            ("f", 2 | 4) => "float32",
            ("f" | "i" | "u", _) => "float64",
            _ => {
                return Err(mistyped(format!(
                    "points are of {dtype}, not float32 or float64"
                )));
            }
        };
        // Contiguous rows, aligned, in native byte order.
        let array = numpy.call_method1("require", (array, precision, ["C", "A"]))?;
        match precision {
            "float32" => Ok(Points::F32(array.extract()?)),
            _ => Ok(Points::F64(array.extract()?)),
        }
    }

    /// Borrows the rows.
    pub fn rows(&self) -> PyResult<Rows<'_>> {
        Ok(match self {
            Points::F32(array) => Rows::F32(array.as_slice().map_err(refuse)?.as_chunks().0),
            Points::F64(array) => Rows::F64(array.as_slice().map_err(refuse)?.as_chunks().0),
        })
    }
}

impl<'a> Rows<'a> {
    /// Number of points.
    pub fn len(&self) -> usize {
        match self {
            Rows::F32(rows) => rows.len(),
            Rows::F64(rows) => rows.len(),
        }
    }

    /// Point `i` in double precision; NaN if out of range.
    pub fn get(&self, i: usize) -> [f64; 3] {
        let row = match self {
            Rows::F32(rows) => rows.get(i).map(|row| row.map(f64::from)),
            Rows::F64(rows) => rows.get(i).copied(),
        };
        row.unwrap_or([f64::NAN; 3])
    }

    /// Up to `len` rows from `start` on.
    pub fn part(&self, start: usize, len: usize) -> Rows<'a> {
        match self {
            Rows::F32(rows) => Rows::F32(part(rows, start, len)),
            Rows::F64(rows) => Rows::F64(part(rows, start, len)),
        }
    }
}

/// Number of points sampled for their precision.
const SAMPLES: usize = 16;
/// Rounding error above which a warning is issued, in cell sizes: 0.1 moves one point in three to another cell.
const COARSE: f64 = 0.1;

/// Warns of single-precision points so far from the origin that rounding moves many to other cells.
pub fn warn_of_rounding(py: Python<'_>, rows: Rows, side_m: f64) -> PyResult<()> {
    let Rows::F32(rows) = rows else {
        return Ok(());
    };
    let samples = rows.iter().step_by(rows.len().div_ceil(SAMPLES).max(1));
    let sizes = samples.flatten().map(|coordinate| coordinate.abs());
    let largest = f64::from(sizes.filter(|size| size.is_finite()).fold(0.0, f32::max));
    let rounding_m = largest * f64::from(f32::EPSILON) / 2.0;
    if rounding_m > COARSE * side_m && rounding_m < largest {
        let text = format!(
            "float32 rounds coordinates of {largest:.0} m by up to {rounding_m:.3} m, where cells have a side of \
             {side_m:.3} m: give float64"
        );
        let text = std::ffi::CString::new(text)?;
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)?;
    }
    Ok(())
}

/// Up to `len` values from `start` on.
pub fn part<T>(values: &[T], start: usize, len: usize) -> &[T] {
    let rest = values.get(start..).unwrap_or_default();
    rest.get(..len).unwrap_or(rest)
}

/// Lengths of an array along its axes.
pub fn shape_of(array: &Bound<'_, PyAny>) -> PyResult<Vec<usize>> {
    Ok(array.cast::<PyUntypedArray>()?.shape().to_vec())
}

/// Mask of a masked array, if something is masked.
pub fn mask_of<'py>(array: &Bound<'py, PyAny>) -> PyResult<Option<Bound<'py, PyAny>>> {
    let masked = array.py().import("numpy")?.getattr("ma")?;
    if !masked
        .call_method1("isMaskedArray", (array,))?
        .is_truthy()?
    {
        return Ok(None);
    }
    let mask = masked.call_method1("getmaskarray", (array,))?;
    let any = mask.call_method0("any")?.is_truthy()?;
    Ok(any.then_some(mask))
}

/// Index of the first true value.
pub fn first_true(flags: &Bound<'_, PyAny>) -> PyResult<usize> {
    flags.call_method0("argmax")?.extract()
}
