//! Columns of a table, as engines return them, as integers.

use std::collections::BTreeMap;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type};
use arrow_array::{Array, ArrayRef, Int64Array, ListArray, RecordBatch};
use arrow_cast::{CastOptions, cast_with_options};
use arrow_schema::{DataType, Field, TimeUnit};
use lattice_core::voxels::LabelCount;
use pyo3::PyResult;

use crate::errors::{mistyped, refuse};

/// Integers of a column of a batch without nulls, whatever their width; `None` if there is no such column.
pub fn integers(batch: &RecordBatch, name: &str) -> PyResult<Option<Int64Array>> {
    let Some(column) = nullable_integers(batch, name)? else {
        return Ok(None);
    };
    if column.null_count() > 0 {
        let row = (0..column.len()).find(|row| column.is_null(*row));
        return Err(refuse(format!(
            "column {name:?} is null in row {}: leave such rows out, or give the value",
            row.unwrap_or_default()
        )));
    }
    Ok(Some(column))
}

/// The same with nulls.
pub fn nullable_integers(batch: &RecordBatch, name: &str) -> PyResult<Option<Int64Array>> {
    let column = batch.column_by_name(name);
    column.map(|column| as_integers(column, name)).transpose()
}

fn as_integers(column: &ArrayRef, name: &str) -> PyResult<Int64Array> {
    let column = match column.data_type() {
        DataType::Dictionary(_, values) => cast(column, values, name)?,
        _ => column.clone(),
    };
    let kind = column.data_type().clone();
    let column = match &kind {
        kind if kind.is_integer() => column,
        // The sums of engines that count beyond 64 bits, and nulls of no type.
        DataType::Null
        | DataType::Decimal32(_, 0)
        | DataType::Decimal64(_, 0)
        | DataType::Decimal128(_, 0)
        | DataType::Decimal256(_, 0) => column,
        DataType::Float32 | DataType::Float64 => {
            let column = cast(&column, &DataType::Float64, name)?;
            expect_whole(&column, name)?;
            column
        }
        DataType::Timestamp(_, zone) if name.ends_with("_ns") => {
            let kind = DataType::Timestamp(TimeUnit::Nanosecond, zone.clone());
            cast(&column, &kind, name)?
        }
        other => {
            return Err(mistyped(format!(
                "column {name:?} is of {other}, not integers"
            )));
        }
    };
    let column = cast(&column, &DataType::Int64, name)?;
    let integers = column.as_primitive_opt::<Int64Type>().cloned();
    integers.ok_or_else(|| mistyped(format!("column {name:?} is of {kind}, not integers")))
}

/// Doubles are whole numbers, up to 2^53, in a column of integers that an engine has widened.
fn expect_whole(column: &ArrayRef, name: &str) -> PyResult<()> {
    let most = (1_u64 << 53) as f64;
    let whole = |value: f64| value.fract() == 0.0 && value.abs() <= most;
    let values = column.as_primitive::<Float64Type>().iter().flatten();
    match values.into_iter().find(|value| !whole(*value)) {
        Some(value) => Err(refuse(format!(
            "column {name:?} has {value}, which is no integer up to 2^53"
        ))),
        None => Ok(()),
    }
}

fn cast(column: &ArrayRef, to: &DataType, name: &str) -> PyResult<ArrayRef> {
    let options = CastOptions {
        safe: false,
        ..CastOptions::default()
    };
    cast_with_options(column, to, &options)
        .map_err(|error| refuse(format!("column {name:?}: {error}")))
}

/// Lists of `{label, n}`; `None` if there is no such column.
pub fn lists(batch: &RecordBatch, name: &str) -> PyResult<Option<ListArray>> {
    let Some(column) = batch.column_by_name(name) else {
        return Ok(None);
    };
    let of = match column.data_type() {
        DataType::List(item)
        | DataType::LargeList(item)
        | DataType::ListView(item)
        | DataType::LargeListView(item)
        | DataType::FixedSizeList(item, _) => item.data_type().clone(),
        other => {
            return Err(mistyped(format!(
                "column {name:?} is of {other}, not lists of {{label, n}}"
            )));
        }
    };
    let item = Field::new("item", of, true);
    let lists = cast(column, &DataType::List(Arc::new(item)), name)?;
    Ok(lists.as_list_opt::<i32>().cloned())
}

/// The labels of each row with the sums of their points, ascending; none where the list is null.
pub fn labels_of(lists: &ListArray) -> PyResult<Vec<Vec<LabelCount>>> {
    let wrong = || mistyped("column \"labels\" has no lists of {label, n}");
    let pairs = lists.values().as_struct_opt().ok_or_else(wrong)?;
    let column = |name: &str| -> PyResult<Int64Array> {
        as_integers(pairs.column_by_name(name).ok_or_else(wrong)?, name)
    };
    let (label, n) = (column("label")?, column("n")?);
    let row = |row: usize| {
        let mut sums = BTreeMap::<u16, u32>::new();
        let range = match lists.is_valid(row) {
            true => {
                let offset = |row: usize| lists.value_offsets().get(row).copied();
                let offset = |row: usize| offset(row).and_then(|o| usize::try_from(o).ok());
                offset(row).unwrap_or_default()..offset(row + 1).unwrap_or_default()
            }
            false => 0..0,
        };
        for place in range {
            if pairs.is_null(place) || label.is_null(place) || n.is_null(place) {
                return Err(refuse(format!("row {row} has a label that is null")));
            }
            let (label, n) = (label.value(place), n.value(place));
            let known = u16::try_from(label).ok().zip(u32::try_from(n).ok());
            let (label, n) = known
                .ok_or_else(|| refuse(format!("row {row} has label {label} of {n} points")))?;
            let sum = sums.entry(label).or_default();
            *sum = sum.saturating_add(n);
        }
        let known = sums.into_iter().filter(|(_, count)| *count > 0);
        let known = known.map(|(label, count)| LabelCount { label, count });
        Ok(known.collect())
    };
    (0..lists.len()).map(row).collect()
}
