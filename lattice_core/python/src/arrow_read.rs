//! Reading maps from Arrow tables, by the C data interface.

use arrow_array::ffi_stream::ArrowArrayStreamReader;
use arrow_array::{Array, Int64Array, RecordBatch, RecordBatchReader};
use arrow_schema::Schema;
use lattice_core::lattice::{Lattice, MortonKey};
use lattice_core::voxels::file::{MapColumns, MapContents};
use lattice_core::voxels::{DistortionSums, LabelCount, Stamps, Voxel};
use nalgebra::Vector3;
use pyo3::prelude::*;
use pyo3::types::PyCapsule;

use crate::arrow_columns::{integers, labels, nullable_integers};
use crate::arrow_table::{COUNTED, HEAD};
use crate::errors::{mistyped, refuse};
use crate::threads::background;

/// Lattice and datum from the caller.
pub struct Cells {
    /// Lattice, if the table has none.
    pub lattice: Option<Lattice>,
    /// Datum (m), if it differs from that of the table.
    pub datum_m: Option<Vector3<f64>>,
}

/// Reads the map of any object with `__arrow_c_stream__`.
pub fn map_of(py: Python<'_>, table: &Bound<'_, PyAny>, cells: Cells) -> PyResult<MapContents> {
    let reader = reader_of(table)?;
    let schema = reader.schema();
    let mut batches = Vec::new();
    // With the GIL, which the producer may need.
    for batch in reader {
        batches.push(batch.map_err(refuse)?);
        py.check_signals()?;
    }
    background(py, move |_| {
        let (mut map, counted) = head_of(&schema, &cells, &batches)?;
        let mut rows = Rows::default();
        for batch in &batches {
            rows.take(batch, &map)?;
        }
        if !cells.knows_datum(&schema) {
            map.datum_index = rows.datum_index();
        }
        rows.fill(&mut map)?;
        let voxels = map.voxels.iter().flatten();
        let points: u64 = voxels.map(|voxel| u64::from(voxel.count)).sum();
        if points != counted {
            map.statistics = map.statistics.of_part(points);
        }
        MapContents::try_from(map).map_err(refuse)
    })?
}

fn reader_of(table: &Bound<'_, PyAny>) -> PyResult<ArrowArrayStreamReader> {
    if !table.hasattr("__arrow_c_stream__")? {
        return Err(mistyped(format!(
            "from_arrow takes a table with __arrow_c_stream__, not {}",
            table.get_type()
        )));
    }
    let capsule = table.call_method0("__arrow_c_stream__")?;
    let capsule = capsule
        .cast::<PyCapsule>()
        .map_err(|_| mistyped("__arrow_c_stream__ gave no capsule"))?;
    let pointer = capsule.pointer_checked(Some(c"arrow_array_stream"))?;
    // SAFETY: a capsule of this name holds an Arrow C stream. The reader takes ownership and leaves a released one
    // behind, as the interface requires of a consumer.
    let reader = unsafe { ArrowArrayStreamReader::from_raw(pointer.cast().as_ptr()) };
    reader.map_err(refuse)
}

impl Cells {
    fn knows_datum(&self, schema: &Schema) -> bool {
        self.datum_m.is_some() || schema.metadata().contains_key(HEAD)
    }
}

/// Creates the map without rows from the metadata and the caller's arguments, with the number of points of its
/// statistics.
fn head_of(schema: &Schema, cells: &Cells, batches: &[RecordBatch]) -> PyResult<(MapColumns, u64)> {
    // A column of nulls is not kept by the map.
    let has = |name: &str| {
        let mut columns = batches.iter().filter_map(|b| b.column_by_name(name));
        schema.column_with_name(name).is_some()
            && columns.any(|column| column.null_count() < column.len())
    };
    let given = |lattice: &Lattice| MapColumns {
        lattice: lattice.clone(),
        datum_index: [0; 3],
        keys: Vec::new(),
        voxels: has("count").then(Vec::new),
        stamps: has("first_ns").then(Vec::new),
        labels: has("labels").then(Vec::new),
        colors: None,
        statistics: DistortionSums::default(),
    };
    let (mut head, counted) = match (schema.metadata().get(HEAD), &cells.lattice) {
        (None, None) => {
            return Err(refuse(format!(
                "the table has no metadata {HEAD:?}, which engines drop: give lattice=, such as that of the map before"
            )));
        }
        (None, Some(lattice)) => (given(lattice), 0),
        (Some(digits), wanted) => {
            let head = read_head(digits)?;
            let counted = schema.metadata().get(COUNTED);
            let counted = counted.and_then(|counted| counted.parse().ok());
            let counted = counted.unwrap_or(head.statistics.points);
            match wanted {
                Some(lattice) if *lattice != head.lattice => {
                    let of = &head.lattice;
                    return Err(refuse(format!("the table is of {of:?}, not {lattice:?}")));
                }
                Some(lattice) => {
                    let (datum_index, statistics) = (head.datum_index, head.statistics);
                    let head = MapColumns {
                        datum_index,
                        statistics,
                        ..given(lattice)
                    };
                    (head, counted)
                }
                None => (head, counted),
            }
        }
    };
    if let Some(datum_m) = &cells.datum_m {
        let index = head.lattice.quantize_wide(datum_m);
        head.datum_index =
            index.ok_or_else(|| refuse(format!("datum {datum_m:?} m is out of range")))?;
    }
    Ok((head, counted))
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

/// Rows of all batches, in order.
#[derive(Default)]
struct Rows {
    cells: Vec<[i64; 3]>,
    voxels: Vec<Voxel>,
    stamps: Vec<Stamps>,
    labels: Vec<Vec<LabelCount>>,
}

impl Rows {
    fn take(&mut self, batch: &RecordBatch, head: &MapColumns) -> PyResult<()> {
        let lacks = |name: &str| {
            let columns = batch.schema();
            let columns = columns.fields().iter();
            let columns: Vec<_> = columns.map(|field| field.name().as_str()).collect();
            refuse(format!("there is no column {name:?} beside {columns:?}"))
        };
        let column = |name: &str| -> PyResult<Int64Array> {
            integers(batch, name)?.ok_or_else(|| lacks(name))
        };
        let rows = 0..batch.num_rows();
        let [x, y, z] = [column("ix")?, column("iy")?, column("iz")?];
        let cells = rows.clone().map(|i| [x.value(i), y.value(i), z.value(i)]);
        self.cells.extend(cells);
        if head.voxels.is_some() {
            let count = column("count")?;
            let [x, y, z] = [column("sum_x")?, column("sum_y")?, column("sum_z")?];
            for i in rows.clone() {
                let count = count.value(i);
                self.voxels.push(Voxel {
                    count: u32::try_from(count).map_err(|_| {
                        refuse(format!("row {i} has count {count}, not one below 2^32"))
                    })?,
                    sum: [x.value(i), y.value(i), z.value(i)],
                });
            }
        }
        if head.stamps.is_some() {
            let column = |name: &str| -> PyResult<Int64Array> {
                nullable_integers(batch, name)?.ok_or_else(|| lacks(name))
            };
            let (first, last) = (column("first_ns")?, column("last_ns")?);
            for i in rows.clone() {
                self.stamps
                    .push(match (first.is_valid(i), last.is_valid(i)) {
                        (true, true) => Stamps {
                            first_ns: first.value(i),
                            last_ns: last.value(i),
                        },
                        (false, false) => Stamps::NONE,
                        _ => {
                            return Err(refuse(format!(
                                "row {i} has only one of first_ns and last_ns"
                            )));
                        }
                    });
            }
        }
        if head.labels.is_some() {
            self.labels
                .extend(labels(batch)?.ok_or_else(|| lacks("labels"))?);
        }
        Ok(())
    }

    /// Datum of cells without one: 0 if it is near enough, else their centre.
    fn datum_index(&self) -> [i64; 3] {
        [0, 1, 2].map(|axis: usize| {
            let along = || self.cells.iter().map(|cell| cell[axis]);
            let (least, most) = (along().min().unwrap_or(0), along().max().unwrap_or(0));
            let near = i64::from(1 << 20);
            match -near <= least && most < near {
                true => 0,
                false => least.midpoint(most),
            }
        })
    }

    /// Converts the rows to columns of a map, by their keys.
    fn fill(mut self, map: &mut MapColumns) -> PyResult<()> {
        let datum = map.datum_index;
        let cells = self.cells.iter().enumerate();
        let keys = cells.map(|(row, cell)| Ok((key_of(*cell, datum)?, row)));
        let mut order = keys.collect::<PyResult<Vec<_>>>()?;
        order.sort_unstable();
        let mut pairs = order.iter().zip(order.iter().skip(1));
        if let Some(((_, row), _)) = pairs.find(|((key, _), (next, _))| key == next) {
            let cell = self.cells.get(*row).copied().unwrap_or_default();
            return Err(refuse(format!(
                "cell {cell:?} has two rows: sum them first, GROUP BY ix, iy, iz"
            )));
        }
        map.keys = order.iter().map(|(key, _)| *key).collect();
        let rows = || order.iter().map(|(_, row)| *row);
        if let Some(voxels) = &mut map.voxels {
            voxels.extend(rows().filter_map(|row| self.voxels.get(row)));
        }
        if let Some(stamps) = &mut map.stamps {
            stamps.extend(rows().filter_map(|row| self.stamps.get(row)));
        }
        if let Some(labels) = &mut map.labels {
            labels.extend(rows().filter_map(|row| self.labels.get_mut(row).map(std::mem::take)));
        }
        Ok(())
    }
}

fn key_of(cell: [i64; 3], datum: [i64; 3]) -> PyResult<MortonKey> {
    let w = [0, 1, 2].map(|i: usize| i32::try_from(cell[i].checked_sub(datum[i])?).ok());
    let key = match w {
        [Some(x), Some(y), Some(z)] => MortonKey::pack([x, y, z]),
        _ => None,
    };
    key.ok_or_else(|| {
        refuse(format!(
            "cell {cell:?} is more than 2^20 cells from datum {datum:?}: give datum= near the cells"
        ))
    })
}
