//! Rows of the tables: conversion from and to the columns of a map, and Arrow.

use std::sync::Arc;

use datafusion::arrow::array::{Array, ArrayRef, AsArray, Int64Array, RecordBatch};
use datafusion::arrow::datatypes::Int64Type;
use lattice_core::lattice::MortonKey;
use lattice_core::voxels::file::MapColumns;
use lattice_core::voxels::{LabelCount, Stamps, Voxel};

use crate::tile::{Tile, order_in_tile, tile_of};
use crate::{Result, schema};

/// Row of `voxels`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct VoxelRow {
    /// Absolute lattice index.
    pub cell: [i64; 3],
    /// Count and offset sums, where kept.
    pub sums: Option<[i64; 4]>,
    /// Stamp of the first and of the last point, where known.
    pub stamps_ns: Option<[i64; 2]>,
}

/// Row of `labels`.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct LabelRow {
    /// Absolute lattice index.
    pub cell: [i64; 3],
    /// Label.
    pub label: i64,
    /// Points with it.
    pub n: i64,
}

/// Rows of one tile, sorted.
#[derive(Clone, Default, PartialEq, Debug)]
pub struct TileRows {
    /// Rows of `voxels`.
    pub voxels: Vec<VoxelRow>,
    /// Rows of `labels`.
    pub labels: Vec<LabelRow>,
}

/// Totals of the rows of a tile.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub struct Totals {
    /// Rows of `voxels`.
    pub rows: i128,
    /// Sum of their counts; 0 where none are kept.
    pub points: i128,
    /// Rows of `labels`.
    pub label_rows: i128,
    /// Sum of their counts.
    pub labelled_points: i128,
}

impl Totals {
    /// Adds rows of `voxels` with the sum of their counts.
    pub fn add_voxels(&mut self, rows: i64, points: i64) {
        self.rows += i128::from(rows);
        self.points += i128::from(points);
    }

    /// Adds rows of `labels` with the sum of their counts.
    pub fn add_labels(&mut self, rows: i64, points: i64) {
        self.label_rows += i128::from(rows);
        self.labelled_points += i128::from(points);
    }

    /// Adds the totals of another part.
    pub fn add(&mut self, other: &Totals) {
        self.rows += other.rows;
        self.points += other.points;
        self.label_rows += other.label_rows;
        self.labelled_points += other.labelled_points;
    }
}

impl std::fmt::Display for Totals {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let (rows, points) = (self.rows, self.points);
        write!(f, "{rows} rows of {points} points")?;
        let (rows, points) = (self.label_rows, self.labelled_points);
        write!(f, " and {rows} labels of {points} points")
    }
}

impl TileRows {
    /// Sorts by cell, and labels of a cell by label.
    pub fn sort(&mut self) {
        self.voxels
            .sort_by_cached_key(|row| order_in_tile(row.cell));
        let key = |row: &LabelRow| (order_in_tile(row.cell), row.label);
        self.labels.sort_by_cached_key(key);
    }

    /// Totals of the rows.
    pub fn totals(&self) -> Totals {
        let mut totals = Totals::default();
        for row in &self.voxels {
            totals.add_voxels(1, row.sums.map_or(0, |[count, ..]| count));
        }
        for row in &self.labels {
            totals.add_labels(1, row.n);
        }
        totals
    }

    /// The largest count of points; 0 where none are kept.
    pub fn max_count(&self) -> i64 {
        let counts = self.voxels.iter().filter_map(|row| row.sums);
        counts.map(|[count, ..]| count).max().unwrap_or(0)
    }

    /// The rows of `voxels` as Arrow.
    pub fn voxel_batch(&self, tile: Tile) -> Result<RecordBatch> {
        let rows = &self.voxels;
        let mut columns: Vec<ArrayRef> = vec![Arc::new(Int64Array::from(vec![tile; rows.len()]))];
        for axis in 0..3 {
            columns.push(column(rows.iter().map(|row| Some(row.cell[axis]))));
        }
        for number in 0..4 {
            columns.push(column(rows.iter().map(|row| Some(row.sums?[number]))));
        }
        for end in 0..2 {
            columns.push(column(rows.iter().map(|row| Some(row.stamps_ns?[end]))));
        }
        Ok(RecordBatch::try_new(schema::voxels(), columns)?)
    }

    /// The rows of `labels` as Arrow.
    pub fn label_batch(&self, tile: Tile) -> Result<RecordBatch> {
        let rows = &self.labels;
        let mut columns: Vec<ArrayRef> = vec![Arc::new(Int64Array::from(vec![tile; rows.len()]))];
        for axis in 0..3 {
            columns.push(column(rows.iter().map(|row| Some(row.cell[axis]))));
        }
        columns.push(column(rows.iter().map(|row| Some(row.label))));
        columns.push(column(rows.iter().map(|row| Some(row.n))));
        Ok(RecordBatch::try_new(schema::labels(), columns)?)
    }
}

fn column(values: impl Iterator<Item = Option<i64>>) -> ArrayRef {
    Arc::new(values.collect::<Int64Array>())
}

/// The rows of a map, tile by tile in ascending order.
pub fn of_map(map: &MapColumns) -> Result<Vec<(Tile, TileRows)>> {
    let mut rows = std::collections::BTreeMap::<Tile, TileRows>::new();
    for (number, key) in map.keys.iter().enumerate() {
        let cell = absolute(map.datum_index, *key);
        let tile = cell.and_then(|cell| Some((cell, tile_of(cell)?)));
        let Some((cell, tile)) = tile else {
            let (datum, w) = (map.datum_index, key.unpack());
            return Err(format!(
                "cell {w:?} of datum {datum:?} is more than 2^28 cells from the origin of the map, the limit of tables"
            )
            .into());
        };
        let rows = rows.entry(tile).or_default();
        let voxel = map.voxels.as_ref().and_then(|voxels| voxels.get(number));
        let stamps = map.stamps.as_ref().and_then(|stamps| stamps.get(number));
        rows.voxels.push(VoxelRow {
            cell,
            sums: voxel.map(|v| [i64::from(v.count), v.sum[0], v.sum[1], v.sum[2]]),
            stamps_ns: stamps
                .filter(|stamps| **stamps != Stamps::NONE)
                .map(|stamps| [stamps.first_ns, stamps.last_ns]),
        });
        let labels = map.labels.iter().filter_map(|labels| labels.get(number));
        rows.labels.extend(labels.flatten().map(|known| LabelRow {
            cell,
            label: known.label.into(),
            n: known.count.into(),
        }));
    }
    rows.values_mut().for_each(TileRows::sort);
    Ok(rows.into_iter().collect())
}

fn absolute(datum: [i64; 3], key: MortonKey) -> Option<[i64; 3]> {
    let w = key.unpack();
    let [x, y, z] = [0, 1, 2].map(|i: usize| datum[i].checked_add(w[i].into()));
    Some([x?, y?, z?])
}

/// Columns of a map, to which tiles are added.
pub struct MapOfTiles {
    map: MapColumns,
    /// Rows and their cells, in no order yet.
    rows: Vec<(MortonKey, VoxelRow)>,
    labels: Vec<(MortonKey, LabelRow)>,
}

impl MapOfTiles {
    /// Starts with a map without rows, which has empty columns for counts, stamps and labels that are kept.
    pub fn new(map: MapColumns) -> MapOfTiles {
        MapOfTiles {
            map,
            rows: Vec::new(),
            labels: Vec::new(),
        }
    }

    /// Adds the rows of a tile.
    pub fn add(&mut self, tile: &TileRows) -> Result {
        for row in &tile.voxels {
            self.rows.push((self.key_of(row.cell)?, *row));
        }
        for row in &tile.labels {
            self.labels.push((self.key_of(row.cell)?, *row));
        }
        Ok(())
    }

    fn key_of(&self, cell: [i64; 3]) -> Result<MortonKey> {
        let datum = self.map.datum_index;
        let w = [0, 1, 2].map(|i: usize| {
            let difference = cell[i].checked_sub(datum[i])?;
            i32::try_from(difference).ok()
        });
        let key = match w {
            [Some(x), Some(y), Some(z)] => MortonKey::pack([x, y, z]),
            _ => None,
        };
        key.ok_or_else(|| {
            format!(
                "cell {cell:?} is more than 2^20 cells from datum {datum:?}, the limit of a map file"
            )
            .into()
        })
    }

    /// The columns. Counts are clamped to 2^32 - 1, which stands for that or more in a map file.
    pub fn finish(mut self) -> Result<MapColumns> {
        self.rows.sort_unstable_by_key(|(key, _)| *key);
        self.labels
            .sort_unstable_by_key(|(key, row)| (*key, row.label));
        let mut labels = self.labels.iter().peekable();
        let clamp = |value: i64| u32::try_from(value.max(0)).unwrap_or(u32::MAX);
        for (key, row) in &self.rows {
            self.map.keys.push(*key);
            if let Some(voxels) = &mut self.map.voxels {
                let lacks = || format!("cell {:?} lacks its count or a sum", row.cell);
                let [count, x, y, z] = row.sums.ok_or_else(lacks)?;
                let count = clamp(count);
                voxels.push(Voxel {
                    count,
                    sum: [x, y, z],
                });
            }
            if let Some(stamps) = &mut self.map.stamps {
                stamps.push(
                    row.stamps_ns
                        .map_or(Stamps::NONE, |[first_ns, last_ns]| Stamps {
                            first_ns,
                            last_ns,
                        }),
                );
            }
            let mut known = Vec::new();
            while let Some((_, row)) = labels.next_if(|(of, _)| of == key) {
                let label = u16::try_from(row.label).map_err(|_| {
                    format!(
                        "cell {:?}: label {} is outside 0..2^16",
                        row.cell, row.label
                    )
                })?;
                let count = clamp(row.n);
                known.push(LabelCount { label, count });
            }
            if let Some(column) = &mut self.map.labels {
                column.push(known);
            }
        }
        match labels.next() {
            Some((_, row)) => Err(format!(
                "label {} at cell {:?}, which has no voxel",
                row.label, row.cell
            )
            .into()),
            None => Ok(self.map),
        }
    }
}

/// Columns of a batch by their names, each of integers.
struct Columns<'a> {
    batch: &'a RecordBatch,
}

impl<'a> Columns<'a> {
    fn get(&self, name: &str) -> Result<&'a Int64Array> {
        let column = self.batch.column_by_name(name);
        let column = column.ok_or_else(|| format!("column {name:?} is missing"))?;
        let integers = column.as_primitive_opt::<Int64Type>();
        let wrong = || format!("column {name:?} is of {}, not Int64", column.data_type());
        Ok(integers.ok_or_else(wrong)?)
    }
}

fn value(array: &Int64Array, row: usize) -> Option<i64> {
    array.is_valid(row).then(|| array.value(row))
}

fn cell(array: [&Int64Array; 4], row: usize) -> Result<(Tile, [i64; 3])> {
    let [tile, x, y, z] = array.map(|column| value(column, row));
    match (tile, x, y, z) {
        (Some(tile), Some(x), Some(y), Some(z)) if tile_of([x, y, z]) == Some(tile) => {
            Ok((tile, [x, y, z]))
        }
        _ => Err(format!("row {row}: cell {x:?} {y:?} {z:?} is not of tile {tile:?}").into()),
    }
}

/// The rows of a batch of `voxels`, with their tiles.
pub fn voxels_of(batch: &RecordBatch, take: &mut dyn FnMut(Tile, VoxelRow) -> Result) -> Result {
    let columns = Columns { batch };
    let cells = [
        columns.get("tile")?,
        columns.get("ix")?,
        columns.get("iy")?,
        columns.get("iz")?,
    ];
    let sums = [
        columns.get("count")?,
        columns.get("sum_x")?,
        columns.get("sum_y")?,
        columns.get("sum_z")?,
    ];
    let stamps = [columns.get("first_ns")?, columns.get("last_ns")?];
    for row in 0..batch.num_rows() {
        let (tile, cell) = cell(cells, row)?;
        let all = sums.map(|column| value(column, row));
        let sums = match all {
            [Some(count), Some(x), Some(y), Some(z)] => Some([count, x, y, z]),
            [None, None, None, None] => None,
            _ => return Err(format!("cell {cell:?} lacks its count or a sum").into()),
        };
        let stamps_ns = match stamps.map(|column| value(column, row)) {
            [Some(first), Some(last)] => Some([first, last]),
            [None, None] => None,
            _ => return Err(format!("cell {cell:?} lacks one of its stamps").into()),
        };
        take(
            tile,
            VoxelRow {
                cell,
                sums,
                stamps_ns,
            },
        )?;
    }
    Ok(())
}

/// The rows of a batch of `labels`, with their tiles.
pub fn labels_of(batch: &RecordBatch, take: &mut dyn FnMut(Tile, LabelRow) -> Result) -> Result {
    let columns = Columns { batch };
    let cells = [
        columns.get("tile")?,
        columns.get("ix")?,
        columns.get("iy")?,
        columns.get("iz")?,
    ];
    let (label, n) = (columns.get("label")?, columns.get("n")?);
    for row in 0..batch.num_rows() {
        let (tile, cell) = cell(cells, row)?;
        let (Some(label), Some(n)) = (value(label, row), value(n, row)) else {
            return Err(format!("row {row}: a label or its count is null").into());
        };
        take(tile, LabelRow { cell, label, n })?;
    }
    Ok(())
}

/// The number of input rows and the sum in column `points` of each row of a merge, with its tile.
pub fn totals_of(
    batch: &RecordBatch,
    points: &str,
    mut take: impl FnMut(Tile, i64, i64),
) -> Result {
    let columns = Columns { batch };
    let (tile, rows) = (columns.get("tile")?, columns.get("merged_rows")?);
    let points = columns.get(points)?;
    for row in 0..batch.num_rows() {
        let number = |column| value(column, row).unwrap_or(0);
        take(number(tile), number(rows), number(points));
    }
    Ok(())
}
