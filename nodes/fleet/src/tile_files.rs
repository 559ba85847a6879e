//! Files of one tile: writing, and reading with every row held against the manifest.

use std::fs::File;
use std::path::{Path, PathBuf};

use datafusion::arrow::array::RecordBatch;
use datafusion::arrow::datatypes::{Schema, SchemaRef};
use lattice_core::voxels::file::MapColumns;
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde::{Deserialize, Serialize};

use crate::files::{FileId, at, write_whole};
use crate::part::MapInfo;
use crate::rows::{LabelRow, TileRows, Totals, VoxelRow, labels_of, voxels_of};
use crate::tile::{Tile, order_in_tile};
use crate::{Result, schema};

/// Cells of a tile, 2^8 along each axis.
const TILE_CELLS: u64 = 1 << 24;

/// Name of the file of `labels`.
const LABELS: &str = "labels.parquet";

/// Contents and files of a tile.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TileInfo {
    /// The tile.
    pub tile: Tile,
    /// Rows of `voxels`.
    pub rows: u64,
    /// Points: the sum of the counts of all rows; 0 where none are kept.
    pub points: u64,
    /// Rows of `labels`.
    pub label_rows: u64,
    /// Labelled points: the sum of the counts of all labels.
    pub labelled_points: u64,
    /// Largest count of points in a row.
    pub max_count: i64,
    /// `voxels.parquet`.
    pub voxels: FileId,
    /// `labels.parquet`, if labels are kept.
    pub labels: Option<FileId>,
}

/// The reason why a map cannot have such tiles, if there is one.
pub fn contradiction_of<'a>(
    tiles: impl Iterator<Item = &'a TileInfo>,
    map: &MapInfo,
) -> Option<String> {
    let mut before: Option<Tile> = None;
    for tile in tiles {
        let name = tile.tile;
        if let Some(before) = before.filter(|before| *before >= name) {
            return Some(format!(
                "tile {name} follows tile {before}: tiles must be unique and ascend"
            ));
        }
        before = Some(name);
        if tile.labels.is_some() != map.labels {
            return Some(format!(
                "tile {name} and the map differ in whether there are labels"
            ));
        }
        let rows = 1..=TILE_CELLS;
        let label_rows = 0..=tile.rows.saturating_mul(1 << 16);
        if !rows.contains(&tile.rows)
            || !label_rows.contains(&tile.label_rows)
            || tile.labelled_points < tile.label_rows
            || (tile.max_count > 0) != map.counts
            || (map.counts && tile.points < tile.rows)
        {
            return Some(format!(
                "tile {name} promises {} with counts up to {}: a tile has 1..={TILE_CELLS} rows, and each has points \
                 where counts are kept",
                tile.totals(),
                tile.max_count
            ));
        }
    }
    None
}

/// Folder of a tile below a part or a merged map.
pub fn tile_folder(folder: &Path, tile: Tile) -> PathBuf {
    folder.join(format!("tile={tile}"))
}

/// Writes the files of a tile.
pub fn write_tile(folder: &Path, tile: Tile, rows: &TileRows, labels: bool) -> Result<TileInfo> {
    let folder = tile_folder(folder, tile);
    std::fs::create_dir_all(&folder).map_err(|error| at(&folder, error))?;
    let voxels = write_batch(&folder.join("voxels.parquet"), &rows.voxel_batch(tile)?)?;
    let of_labels = folder.join(LABELS);
    let labels = match labels {
        true => Some(write_batch(&of_labels, &rows.label_batch(tile)?)?),
        false => None,
    };
    let totals = rows.totals();
    let points = |sum: i128| {
        u64::try_from(sum).map_err(|_| format!("tile {tile}: {sum} points are outside 0..2^64"))
    };
    Ok(TileInfo {
        tile,
        rows: rows.voxels.len() as u64,
        points: points(totals.points)?,
        label_rows: rows.labels.len() as u64,
        labelled_points: points(totals.labelled_points)?,
        max_count: rows.max_count(),
        voxels,
        labels,
    })
}

fn write_batch(path: &Path, batch: &RecordBatch) -> Result<FileId> {
    write_whole(path, |file| {
        let properties = Some(schema::properties());
        let mut writer = ArrowWriter::try_new(file, batch.schema(), properties)?;
        writer.write(batch)?;
        writer.close()?;
        Ok(())
    })?;
    FileId::of(path).map_err(|error| at(path, error))
}

impl TileInfo {
    /// Totals of the rows, as the manifest promises them.
    pub fn totals(&self) -> Totals {
        Totals {
            rows: self.rows.into(),
            points: self.points.into(),
            label_rows: self.label_rows.into(),
            labelled_points: self.labelled_points.into(),
        }
    }

    /// Files of the tile with size and digest.
    pub fn files(&self, folder: &Path) -> Vec<(PathBuf, &FileId)> {
        let folder = tile_folder(folder, self.tile);
        let voxels = (folder.join("voxels.parquet"), &self.voxels);
        let labels = self.labels.as_ref();
        let labels = labels.map(|id| (folder.join(LABELS), id));
        std::iter::once(voxels).chain(labels).collect()
    }

    /// Fails, naming the file, unless all files have the size and digest of the manifest.
    pub fn verify(&self, folder: &Path) -> Result {
        let files = self.files(folder);
        files.iter().try_for_each(|(path, id)| id.verify(path))
    }

    /// Fails, naming the file, unless the files have the digests of the manifest, and their rows its numbers.
    pub fn check(&self, folder: &Path, map: &MapInfo) -> Result {
        self.visit(folder, map, |_| (), |_| ())
    }

    /// Reads the rows of a tile as `check` does.
    pub fn read(&self, folder: &Path, map: &MapInfo) -> Result<TileRows> {
        let (mut voxels, mut labels) = (Vec::new(), Vec::new());
        self.visit(folder, map, |row| voxels.push(row), |row| labels.push(row))?;
        Ok(TileRows { voxels, labels })
    }

    fn visit(
        &self,
        folder: &Path,
        map: &MapInfo,
        mut voxel: impl FnMut(VoxelRow),
        mut label: impl FnMut(LabelRow),
    ) -> Result {
        self.verify(folder)?;
        let columns = map.columns().map_err(|error| at(folder, error))?;
        let reach = i128::from(MapColumns::offset_reach(&columns.lattice));
        let (mut found, mut max_count) = (Totals::default(), 0);
        let mut last: Option<u64> = None;
        let of_voxels = |tile: Tile, row: VoxelRow| -> Result {
            self.own(tile)?;
            ascend(&mut last, order_in_tile(row.cell), row.cell)?;
            check_voxel(&row, map, reach)?;
            let count = row.sums.map_or(0, |[count, ..]| count);
            max_count = max_count.max(count);
            found.add_voxels(1, count);
            voxel(row);
            Ok(())
        };
        let voxels = tile_folder(folder, self.tile).join("voxels.parquet");
        read_rows(&voxels, schema::voxels(), of_voxels, voxels_of)?;
        let mut last: Option<(u64, i64)> = None;
        let of_labels = |tile: Tile, row: LabelRow| -> Result {
            self.own(tile)?;
            ascend(&mut last, (order_in_tile(row.cell), row.label), row.cell)?;
            if row.n < 1 || u16::try_from(row.label).is_err() {
                let (cell, label, n) = (row.cell, row.label, row.n);
                return Err(format!("cell {cell:?}: label {label} with {n} points").into());
            }
            found.add_labels(1, row.n);
            label(row);
            Ok(())
        };
        let labels = tile_folder(folder, self.tile).join(LABELS);
        if self.labels.is_some() {
            read_rows(&labels, schema::labels(), of_labels, labels_of)?;
        }
        let promised = self.totals();
        let wrong_voxels = (found.rows, found.points) != (promised.rows, promised.points);
        if wrong_voxels || found != promised {
            let path = if wrong_voxels { &voxels } else { &labels };
            return Err(at(
                path,
                format!("{found}, its manifest promises {promised}"),
            ));
        }
        if max_count != self.max_count {
            let promised = self.max_count;
            let reason =
                format!("a count of {max_count}, its manifest promises at most {promised}");
            return Err(at(&voxels, reason));
        }
        Ok(())
    }

    fn own(&self, tile: Tile) -> Result {
        match tile == self.tile {
            true => Ok(()),
            false => Err(format!(
                "a row of tile {tile}: rows of other tiles than {}",
                self.tile
            )
            .into()),
        }
    }
}

/// Reads the rows of a file. Fails, with its path, for other columns than those of the table.
fn read_rows<Row>(
    path: &Path,
    schema: SchemaRef,
    mut take: impl FnMut(Tile, Row) -> Result,
    rows_of: impl Fn(&RecordBatch, &mut dyn FnMut(Tile, Row) -> Result) -> Result,
) -> Result {
    let mut read = || -> Result {
        let reader = ParquetRecordBatchReaderBuilder::try_new(File::open(path)?)?;
        let names = |schema: &Schema| -> Vec<_> {
            let fields = schema.fields().iter();
            fields
                .map(|field| format!("{} {}", field.name(), field.data_type()))
                .collect()
        };
        let (found, expected) = (names(reader.schema()), names(&schema));
        if found != expected {
            let (found, expected) = (found.join(", "), expected.join(", "));
            return Err(format!("columns {found}; they must be {expected}").into());
        }
        for batch in reader.build()? {
            rows_of(&batch?, &mut take)?;
        }
        Ok(())
    };
    read().map_err(|error| at(path, error))
}

fn ascend<Key: Ord>(last: &mut Option<Key>, key: Key, cell: [i64; 3]) -> Result {
    if last.as_ref().is_some_and(|last| *last >= key) {
        return Err(format!("cell {cell:?} comes twice or out of order").into());
    }
    *last = Some(key);
    Ok(())
}

/// Refuses a row whose values no points have.
fn check_voxel(row: &VoxelRow, map: &MapInfo, reach: i128) -> Result {
    let cell = row.cell;
    if row.sums.is_some() != map.counts {
        let kept = if map.counts { "lacks" } else { "has" };
        return Err(format!("cell {cell:?} {kept} its count or a sum").into());
    }
    if row.stamps_ns.is_some() && !map.stamps {
        return Err(format!("cell {cell:?} has stamps, its map has none").into());
    }
    if let Some([count, sums @ ..]) = row.sums {
        let bound = i128::from(count) * reach;
        if count < 1 || sums.iter().any(|sum| i128::from(*sum).abs() > bound) {
            return Err(format!(
                "cell {cell:?}: count {count} with offset sums {sums:?}: a count is at least 1, and a sum within \
                 {reach} units for each point"
            )
            .into());
        }
    }
    Ok(())
}
