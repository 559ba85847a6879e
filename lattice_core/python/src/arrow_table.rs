//! Writing maps as Arrow tables, by the C data interface.

use std::sync::Arc;

use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{
    Array, ArrayRef, Int64Array, ListArray, RecordBatch, RecordBatchIterator, StructArray,
};
use arrow_buffer::OffsetBuffer;
use arrow_schema::{DataType, Field, Fields, Schema};
use lattice_core::lattice::MortonKey;
use lattice_core::voxels::file::{MapColumns, MapContents, WriteOptions};
use lattice_core::voxels::{LabelCount, Stamps};
use pyo3::prelude::*;
use pyo3::types::PyCapsule;

use crate::errors::refuse;

/// Schema metadata key of the map file without its rows, in hexadecimal digits.
pub const HEAD: &str = "lattice_map";
/// Schema metadata key of the sum of the counts.
pub const COUNTED: &str = "lattice_map_counted";

/// Rows of a map as an Arrow table.
#[pyclass(frozen, module = "lattice_core")]
pub struct Table {
    batch: RecordBatch,
}

#[pymethods]
impl Table {
    /// Exports the table as a stream of the Arrow C interface.
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
    /// Rows of a map in key order.
    pub fn of(map: MapContents) -> PyResult<Table> {
        let map = MapColumns::from(map);
        let head = head_of(&map)?;
        let voxels = map.voxels.iter().flatten();
        let counted: u64 = voxels.map(|voxel| u64::from(voxel.count)).sum();
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
        let metadata = [(HEAD, head), (COUNTED, counted.to_string())];
        let metadata = metadata.map(|(key, value)| (key.to_owned(), value)).into();
        let schema = Schema::new(fields).with_metadata(metadata);
        let arrays = columns.into_iter().map(|(_, array)| array).collect();
        let batch = RecordBatch::try_new(Arc::new(schema), arrays).map_err(refuse)?;
        Ok(Table { batch })
    }
}

/// Map file of the map without rows.
fn head_of(map: &MapColumns) -> PyResult<String> {
    let columns = MapColumns {
        lattice: map.lattice.clone(),
        datum_index: map.datum_index,
        keys: Vec::new(),
        voxels: map.voxels.is_some().then(Vec::new),
        stamps: map.stamps.is_some().then(Vec::new),
        labels: map.labels.is_some().then(Vec::new),
        // Tables have no colours.
        colors: None,
        statistics: map.statistics,
    };
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
