//! Maps as Arrow tables, by the C data interface.

use std::collections::BTreeMap;
use std::sync::Arc;

use arrow::array::{
    Array, ArrayRef, AsArray, Int64Array, ListArray, RecordBatch, RecordBatchIterator,
    RecordBatchReader, StructArray,
};
use arrow::buffer::OffsetBuffer;
use arrow::datatypes::{DataType, Field, Fields, Int64Type, Schema};
use arrow::ffi_stream::{ArrowArrayStreamReader, FFI_ArrowArrayStream};
use lattice_core::lattice::MortonKey;
use lattice_core::voxels::file::{MapColumns, MapContents, WriteOptions};
use lattice_core::voxels::{LabelCount, Stamps, Voxel};
use pyo3::prelude::*;
use pyo3::types::PyCapsule;

use crate::refuse;

/// Key of the schema's metadata: the map file of the map without its rows, in hexadecimal digits.
const HEAD: &str = "lattice_map";

/// Rows of a map as Arrow.
#[pyclass(frozen, module = "lattice_core")]
pub struct Table {
    batch: RecordBatch,
}

#[pymethods]
impl Table {
    /// The table as a stream of the Arrow C interface.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        let _ = requested_schema;
        let batches = RecordBatchIterator::new([Ok(self.batch.clone())], self.batch.schema());
        let stream = FFI_ArrowArrayStream::new(Box::new(batches));
        PyCapsule::new_with_value(py, stream, c"arrow_array_stream")
    }

    fn __len__(&self) -> usize {
        self.batch.num_rows()
    }

    /// Names of the columns.
    #[getter]
    fn column_names(&self) -> Vec<String> {
        let schema = self.batch.schema();
        schema
            .fields()
            .iter()
            .map(|field| field.name().clone())
            .collect()
    }
}

impl Table {
    /// The rows of a map, in the order of its keys.
    pub fn of(map: &MapContents) -> PyResult<Table> {
        let head = head_of(map)?;
        let map = MapColumns::from(map.clone());
        let datum = map.datum_index;
        let mut columns: Vec<(&str, ArrayRef)> = Vec::new();
        for (axis, name) in ["ix", "iy", "iz"].into_iter().enumerate() {
            let index = |key: &MortonKey| datum[axis].saturating_add(key.unpack()[axis].into());
            columns.push((
                name,
                Arc::new(map.keys.iter().map(index).collect::<Int64Array>()),
            ));
        }
        if let Some(voxels) = &map.voxels {
            let counts: Int64Array = voxels.iter().map(|voxel| i64::from(voxel.count)).collect();
            columns.push(("count", Arc::new(counts)));
            for (axis, name) in ["sum_x", "sum_y", "sum_z"].into_iter().enumerate() {
                let sums: Int64Array = voxels.iter().map(|voxel| voxel.sum[axis]).collect();
                columns.push((name, Arc::new(sums)));
            }
        }
        if let Some(stamps) = &map.stamps {
            let known = |s: &Stamps| *s != Stamps::NONE;
            let first: Int64Array = stamps
                .iter()
                .map(|s| known(s).then_some(s.first_ns))
                .collect();
            let last: Int64Array = stamps
                .iter()
                .map(|s| known(s).then_some(s.last_ns))
                .collect();
            columns.extend([
                ("first_ns", Arc::new(first) as ArrayRef),
                ("last_ns", Arc::new(last)),
            ]);
        }
        if let Some(labels) = &map.labels {
            columns.push(("labels", Arc::new(list_of(labels)?)));
        }
        let fields = columns.iter().map(|(name, array)| {
            Field::new(*name, array.data_type().clone(), name.ends_with("_ns"))
        });
        let fields: Vec<Field> = fields.collect();
        let metadata = [(HEAD.to_owned(), head)].into();
        let schema = Schema::new(fields).with_metadata(metadata);
        let arrays = columns.into_iter().map(|(_, array)| array).collect();
        let batch = RecordBatch::try_new(Arc::new(schema), arrays).map_err(refuse)?;
        Ok(Table { batch })
    }
}

/// The map file of the map without rows.
fn head_of(map: &MapContents) -> PyResult<String> {
    let mut columns = MapColumns::from(map.clone());
    columns.keys.clear();
    columns.voxels.iter_mut().for_each(Vec::clear);
    columns.stamps.iter_mut().for_each(Vec::clear);
    columns.labels.iter_mut().for_each(Vec::clear);
    let mut bytes = Vec::new();
    let head = MapContents::try_from(columns).map_err(refuse)?;
    head.write(&mut bytes, &WriteOptions::default())
        .map_err(refuse)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

fn list_of(labels: &[Vec<LabelCount>]) -> PyResult<ListArray> {
    let all = || labels.iter().flatten();
    let label: Int64Array = all().map(|known| i64::from(known.label)).collect();
    let n: Int64Array = all().map(|known| i64::from(known.count)).collect();
    let names = ["label", "n"].map(|name| Field::new(name, DataType::Int64, false));
    let fields = Fields::from(names.to_vec());
    let rows = StructArray::try_new(fields.clone(), vec![Arc::new(label), Arc::new(n)], None);
    let item = Arc::new(Field::new("item", DataType::Struct(fields), false));
    let offsets = OffsetBuffer::from_lengths(labels.iter().map(Vec::len));
    ListArray::try_new(item, offsets, Arc::new(rows.map_err(refuse)?), None).map_err(refuse)
}

/// The map of any object with `__arrow_c_stream__`.
pub fn map_of(table: &Bound<'_, PyAny>) -> PyResult<MapContents> {
    let capsule = table
        .call_method0("__arrow_c_stream__")
        .map_err(|_| refuse("from_arrow takes a table with __arrow_c_stream__"))?;
    let capsule = capsule
        .cast::<PyCapsule>()
        .map_err(|_| refuse("__arrow_c_stream__ gave no capsule"))?;
    let pointer = capsule.pointer_checked(Some(c"arrow_array_stream"))?;
    // SAFETY: a capsule of this name holds a stream of the Arrow C interface, of which the reader takes the
    // ownership and leaves a released one behind, as the interface demands of a consumer.
    let reader = unsafe { ArrowArrayStreamReader::from_raw(pointer.cast().as_ptr()) };
    let reader = reader.map_err(refuse)?;
    let schema = reader.schema();
    let head = schema.metadata().get(HEAD).ok_or_else(|| {
        refuse(format!(
            "the schema lacks the metadata {HEAD:?}, in which to_arrow keeps the lattice"
        ))
    })?;
    let head = read_head(head)?;
    let mut rows = BTreeMap::new();
    for batch in reader {
        take_rows(&batch.map_err(refuse)?, &head, &mut rows)?;
    }
    let mut map = head;
    for (key, row) in rows {
        map.keys.push(key);
        map.voxels
            .iter_mut()
            .for_each(|column| column.push(row.voxel));
        map.stamps
            .iter_mut()
            .for_each(|column| column.push(row.stamps));
        map.labels
            .iter_mut()
            .for_each(|column| column.push(row.labels.clone()));
    }
    MapContents::try_from(map).map_err(refuse)
}

fn read_head(digits: &str) -> PyResult<MapColumns> {
    let wrong = || refuse(format!("the metadata {HEAD:?} is damaged"));
    let pairs = digits.as_bytes().chunks(2);
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
    let bytes = pairs
        .map(byte)
        .collect::<Option<Vec<u8>>>()
        .ok_or_else(wrong)?;
    let head = MapContents::read(&bytes[..], 0);
    Ok(head
        .map_err(|error| refuse(format!("the metadata {HEAD:?}: {error}")))?
        .into())
}

/// A row besides its key.
struct Row {
    voxel: Voxel,
    stamps: Stamps,
    labels: Vec<LabelCount>,
}

fn take_rows(
    batch: &RecordBatch,
    head: &MapColumns,
    rows: &mut BTreeMap<MortonKey, Row>,
) -> PyResult<()> {
    let column = |name: &str| -> PyResult<&Int64Array> {
        let column = batch.column_by_name(name);
        let column = column.and_then(|column| column.as_primitive_opt::<Int64Type>());
        column.ok_or_else(|| refuse(format!("there is no column {name:?} of int64")))
    };
    let cells = [column("ix")?, column("iy")?, column("iz")?];
    let sums = match &head.voxels {
        Some(_) => Some([
            column("count")?,
            column("sum_x")?,
            column("sum_y")?,
            column("sum_z")?,
        ]),
        None => None,
    };
    let stamps = match &head.stamps {
        Some(_) => Some([column("first_ns")?, column("last_ns")?]),
        None => None,
    };
    let labels = batch
        .column_by_name("labels")
        .and_then(|column| column.as_list_opt::<i32>());
    if head.labels.is_some() && labels.is_none() {
        return Err(refuse("there is no column \"labels\" of lists"));
    }
    for row in 0..batch.num_rows() {
        let cell = cells.map(|column| column.value(row));
        let key = key_of(cell, head.datum_index)?;
        let voxel = match sums.map(|columns| columns.map(|column| column.value(row))) {
            Some([count, x, y, z]) => Voxel {
                count: u32::try_from(count)
                    .map_err(|_| refuse(format!("cell {cell:?} has count {count}")))?,
                sum: [x, y, z],
            },
            None => Voxel::default(),
        };
        let stamps = match stamps {
            Some([first, last]) if first.is_valid(row) && last.is_valid(row) => Stamps {
                first_ns: first.value(row),
                last_ns: last.value(row),
            },
            _ => Stamps::NONE,
        };
        let labels = match labels {
            Some(lists) if lists.is_valid(row) => labels_of(&lists.value(row))?,
            _ => Vec::new(),
        };
        if rows
            .insert(
                key,
                Row {
                    voxel,
                    stamps,
                    labels,
                },
            )
            .is_some()
        {
            return Err(refuse(format!(
                "cell {cell:?} has two rows: sum them first"
            )));
        }
    }
    Ok(())
}

fn key_of(cell: [i64; 3], datum: [i64; 3]) -> PyResult<MortonKey> {
    let w = [0, 1, 2].map(|i: usize| i32::try_from(cell[i].checked_sub(datum[i])?).ok());
    let key = match w {
        [Some(x), Some(y), Some(z)] => MortonKey::pack([x, y, z]),
        _ => None,
    };
    key.ok_or_else(|| {
        refuse(format!(
            "cell {cell:?} is more than 2^20 cells from datum {datum:?}"
        ))
    })
}

fn labels_of(list: &ArrayRef) -> PyResult<Vec<LabelCount>> {
    let wrong = || refuse("labels are not lists of {label, n} of int64");
    let rows = list.as_struct_opt().ok_or_else(wrong)?;
    let column = |name: &str| {
        let column = rows.column_by_name(name)?;
        column.as_primitive_opt::<Int64Type>()
    };
    let (label, n) = column("label").zip(column("n")).ok_or_else(wrong)?;
    let pairs = label.values().iter().zip(n.values());
    let count = |(label, n): (&i64, &i64)| {
        let known = u16::try_from(*label).ok().zip(u32::try_from(*n).ok());
        let known = known.map(|(label, count)| LabelCount { label, count });
        known.ok_or_else(|| refuse(format!("label {label} of {n} points")))
    };
    pairs.map(count).collect()
}
