//! Columns of a table, as query engines return them, converted to integers.

use std::collections::BTreeMap;

use arrow_array::cast::AsArray;
use arrow_array::types::{
    ArrowPrimitiveType, Decimal32Type, Decimal64Type, Decimal128Type, Float32Type, Float64Type,
    Int8Type, Int16Type, Int32Type, Int64Type, TimestampMicrosecondType, TimestampMillisecondType,
    TimestampNanosecondType, TimestampSecondType, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrayRef, Int64Array, RecordBatch};
use arrow_schema::{DataType, TimeUnit};
use lattice_core::voxels::LabelCount;
use pyo3::PyResult;

use crate::errors::{mistyped, refuse};

/// Integers of any width of a column without nulls; `None` if there is no such column.
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

/// The same for a column with nulls.
pub fn nullable_integers(batch: &RecordBatch, name: &str) -> PyResult<Option<Int64Array>> {
    let column = batch.column_by_name(name);
    column.map(|column| as_integers(column, name)).transpose()
}

fn as_integers(column: &ArrayRef, name: &str) -> PyResult<Int64Array> {
    let of_time = name.ends_with("_ns");
    match column.data_type() {
        DataType::Int8 => each::<Int8Type>(column, name, |v| Some(v.into())),
        DataType::Int16 => each::<Int16Type>(column, name, |v| Some(v.into())),
        DataType::Int32 => each::<Int32Type>(column, name, |v| Some(v.into())),
        DataType::Int64 => each::<Int64Type>(column, name, Some),
        DataType::UInt8 => each::<UInt8Type>(column, name, |v| Some(v.into())),
        DataType::UInt16 => each::<UInt16Type>(column, name, |v| Some(v.into())),
        DataType::UInt32 => each::<UInt32Type>(column, name, |v| Some(v.into())),
        DataType::UInt64 => each::<UInt64Type>(column, name, |v| v.try_into().ok()),
        // Sums of engines that use more than 64 bits.
        DataType::Decimal32(_, 0) => each::<Decimal32Type>(column, name, |v| Some(v.into())),
        DataType::Decimal64(_, 0) => each::<Decimal64Type>(column, name, Some),
        DataType::Decimal128(_, 0) => each::<Decimal128Type>(column, name, |v| v.try_into().ok()),
        // Types that engines widen to.
        DataType::Float32 => each::<Float32Type>(column, name, |v| whole(v.into())),
        DataType::Float64 => each::<Float64Type>(column, name, whole),
        DataType::Timestamp(unit, _) if of_time => match unit {
            TimeUnit::Second => times::<TimestampSecondType>(column, name, 1_000_000_000),
            TimeUnit::Millisecond => times::<TimestampMillisecondType>(column, name, 1_000_000),
            TimeUnit::Microsecond => times::<TimestampMicrosecondType>(column, name, 1000),
            TimeUnit::Nanosecond => times::<TimestampNanosecondType>(column, name, 1),
        },
        DataType::Null => Ok(Int64Array::new_null(column.len())),
        DataType::Dictionary(..) => {
            let packed = column.as_any_dictionary();
            let values = as_integers(packed.values(), name)?;
            if values.is_empty() {
                return Ok(Int64Array::new_null(column.len()));
            }
            let keys = packed.normalized_keys();
            let value = |(row, key): (usize, &usize)| {
                let known = column.is_valid(row) && *key < values.len() && values.is_valid(*key);
                known.then(|| values.value(*key))
            };
            Ok(keys.iter().enumerate().map(value).collect())
        }
        other => Err(mistyped(format!(
            "column {name:?} is of {other}, not integers"
        ))),
    }
}

/// Doubles that are integers up to 2^53, above which adjacent integers are not distinguished.
fn whole(value: f64) -> Option<i64> {
    let most = (1_u64 << 53) as f64;
    (value.fract() == 0.0 && value.abs() <= most).then_some(value as i64)
}

fn times<T: ArrowPrimitiveType<Native = i64>>(
    column: &ArrayRef,
    name: &str,
    ns: i64,
) -> PyResult<Int64Array> {
    each::<T>(column, name, |time| time.checked_mul(ns))
}

fn each<T: ArrowPrimitiveType>(
    column: &ArrayRef,
    name: &str,
    integer: impl Fn(T::Native) -> Option<i64>,
) -> PyResult<Int64Array> {
    let value = |value: T::Native| {
        let no = || {
            refuse(format!(
                "column {name:?} has {value:?}, not a 64-bit integer"
            ))
        };
        integer(value).ok_or_else(no)
    };
    let values = column.as_primitive::<T>().iter();
    values.map(|v| v.map(value).transpose()).collect()
}

/// Labels of each row, from lists `labels` of `{label, n}`, summed and ascending; empty for a null list. `None` if
/// there is no such column.
pub fn labels(batch: &RecordBatch) -> PyResult<Option<Vec<Vec<LabelCount>>>> {
    let Some(column) = batch.column_by_name("labels") else {
        return Ok(None);
    };
    let (values, ends): (&ArrayRef, Vec<usize>) = match column.data_type() {
        DataType::List(_) => {
            let lists = column.as_list::<i32>();
            let ends = lists.value_offsets().iter();
            (lists.values(), ends.map(|end| *end as usize).collect())
        }
        DataType::LargeList(_) => {
            let lists = column.as_list::<i64>();
            let ends = lists.value_offsets().iter();
            (lists.values(), ends.map(|end| *end as usize).collect())
        }
        DataType::Null => return Ok(Some(vec![Vec::new(); column.len()])),
        other => {
            return Err(mistyped(format!(
                "column \"labels\" is of {other}, not lists of {{label, n}}"
            )));
        }
    };
    let wrong = || mistyped("column \"labels\" has no lists of {label, n}");
    let pairs = values.as_struct_opt().ok_or_else(wrong)?;
    let of = |name: &str| -> PyResult<Int64Array> {
        as_integers(pairs.column_by_name(name).ok_or_else(wrong)?, name)
    };
    let (label, n) = (of("label")?, of("n")?);
    let rows = ends.iter().zip(ends.iter().skip(1)).enumerate();
    let rows = rows.map(|(row, (start, end))| {
        let mut sums = BTreeMap::<u16, u32>::new();
        let places = if column.is_valid(row) {
            *start..*end
        } else {
            0..0
        };
        for place in places {
            if pairs.is_null(place) || label.is_null(place) || n.is_null(place) {
                return Err(refuse(format!("row {row} has a label that is null")));
            }
            let (label, n) = (label.value(place), n.value(place));
            let known = u16::try_from(label).ok().zip(u32::try_from(n).ok());
            let no = || refuse(format!("row {row} has label {label} of {n} points"));
            let (label, n) = known.ok_or_else(no)?;
            let sum = sums.entry(label).or_default();
            *sum = sum.saturating_add(n);
        }
        let known = sums.into_iter().filter(|(_, count)| *count > 0);
        let known = known.map(|(label, count)| LabelCount { label, count });
        Ok(known.collect())
    });
    rows.collect::<PyResult<_>>().map(Some)
}
