//! Columns of points besides their coordinates: labels, stamps and colours.

use lattice_core::registration::UNLABELED;
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::errors::{mistyped, refuse};
use crate::points::{first_true, mask_of, shape_of};

/// Stamps of points, ns.
pub enum StampColumn {
    /// One stamp for all points.
    All(i64),
    /// One stamp per point.
    Each(Vec<i64>),
}

/// Converts labels below 2^16, one per point; -1 is [`UNLABELED`], masked ones are 0.
pub fn labels(array: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<u16>> {
    let array = unmasked(array)?;
    expect_integers(&array, "labels", "")?;
    let label = |(row, value): (usize, i64)| match value {
        -1 => Ok(UNLABELED),
        _ => u16::try_from(value)
            .map_err(|_| refuse(format!("row {row}: label {value} is not from -1 to 65535"))),
    };
    let values = integers(&array, "labels", count)?;
    values.into_iter().enumerate().map(label).collect()
}

/// Converts integers (ns) or datetime64, one for all points or one per point; masked ones are 0.
pub fn stamps(array: &Bound<'_, PyAny>, count: usize) -> PyResult<StampColumn> {
    let mut array = unmasked(array)?;
    let is_one = shape_of(&array)?.is_empty();
    if is_one {
        array = array.call_method1("reshape", (1,))?;
    }
    if kind_of(&array)? == "M" {
        array = nanoseconds(&array)?;
    } else {
        expect_integers(&array, "stamps", " (ns) or datetime64")?;
    }
    let values = integers(&array, "stamps", if is_one { 1 } else { count })?;
    Ok(match values.first() {
        Some(&stamp_ns) if is_one => StampColumn::All(stamp_ns),
        _ => StampColumn::Each(values),
    })
}

/// Converts red, green and blue as bytes, one row per point.
pub fn colors(array: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<Option<[u8; 3]>>> {
    let wrong = |found: String| {
        refuse(format!(
            "colors: {found}, expected uint8 of shape ({count}, 3), 0 to 255, not masked"
        ))
    };
    if mask_of(array)?.is_some() {
        return Err(wrong("they are masked".to_owned()));
    }
    let array = array
        .py()
        .import("numpy")?
        .call_method1("ascontiguousarray", (array,))?;
    let shape = shape_of(&array)?;
    let bytes: PyReadonlyArray2<u8> = (array.extract())
        .map_err(|_| wrong(format!("they are {} of shape {shape:?}", dtype_of(&array))))?;
    if shape != [count, 3] {
        return Err(wrong(format!("they have shape {shape:?}")));
    }
    let values = bytes.as_slice().map_err(refuse)?;
    Ok(values.as_chunks().0.iter().copied().map(Some).collect())
}

fn dtype_of(array: &Bound<'_, PyAny>) -> String {
    let name = array.getattr("dtype").map(|dtype| dtype.to_string());
    name.unwrap_or_default()
}

/// Selects the rows of `keep`.
pub fn kept<T: Copy>(values: &[T], keep: &[bool]) -> Vec<T> {
    let rows = values.iter().zip(keep).filter(|(_, keep)| **keep);
    rows.map(|(value, _)| *value).collect()
}

/// Replaces masked values by 0.
fn unmasked<'py>(array: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let numpy = array.py().import("numpy")?;
    match mask_of(array)? {
        Some(_) => array.call_method1("filled", (0,)),
        None => numpy.call_method1("asarray", (array,)),
    }
}

fn kind_of(array: &Bound<'_, PyAny>) -> PyResult<String> {
    array.getattr("dtype")?.getattr("kind")?.extract()
}

fn expect_integers(array: &Bound<'_, PyAny>, name: &str, or: &str) -> PyResult<()> {
    let kind = kind_of(array)?;
    if kind == "i" || kind == "u" {
        return Ok(());
    }
    let dtype = array.getattr("dtype")?;
    // Python integers of more than 64 bits become objects.
    if kind == "O"
        && let Ok(value) = array.call_method0("max")
        && value.is_instance_of::<pyo3::types::PyInt>()
    {
        return Err(refuse(format!("{name}: {value} is not below 2^63")));
    }
    Err(mistyped(format!("{name} are of {dtype}, not integers{or}")))
}

/// Integers of an array of shape (count,).
fn integers(array: &Bound<'_, PyAny>, name: &str, count: usize) -> PyResult<Vec<i64>> {
    let shape = shape_of(array)?;
    if shape != [count] {
        let shape = match shape.as_slice() {
            [len] => format!("{len} {name}"),
            _ => format!("{name} of shape {shape:?}"),
        };
        return Err(refuse(format!(
            "there are {count} points and {shape}, not one for each"
        )));
    }
    let numpy = array.py().import("numpy")?;
    if kind_of(array)? == "u" && count > 0 {
        let over = array.call_method1("__gt__", (i64::MAX,))?;
        if over.call_method0("any")?.is_truthy()? {
            let row = first_true(&over)?;
            let value = array.get_item(row)?;
            return Err(refuse(format!(
                "row {row} of {name}: {value} is not below 2^63"
            )));
        }
    }
    let array = numpy.call_method1("require", (array, "int64", ["C", "A"]))?;
    let array: PyReadonlyArray1<i64> = array.extract()?;
    Ok(array.as_slice().map_err(refuse)?.to_vec())
}

/// Converts datetime64 to integers, ns since 1970.
fn nanoseconds<'py>(times: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let numpy = times.py().import("numpy")?;
    let refused = |flags: Bound<'py, PyAny>, why: &str| -> PyResult<()> {
        if flags.call_method0("any")?.is_truthy()? {
            let row = first_true(&flags)?;
            let time = times.get_item(row)?;
            return Err(refuse(format!("row {row} of stamps: {time} {why}")));
        }
        Ok(())
    };
    refused(numpy.call_method1("isnat", (times,))?, "is no time")?;
    let ns = times.call_method1("astype", ("datetime64[ns]",))?;
    let whole = times.call_method1("astype", ("datetime64[s]",))?;
    let back = ns.call_method1("astype", ("datetime64[s]",))?;
    refused(
        whole.call_method1("__ne__", (back,))?,
        "is not within 292 years of 1970",
    )?;
    ns.call_method1("view", ("int64",))
}
