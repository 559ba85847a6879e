//! A part: the tables of one map, in a folder of its own that never changes.

use std::fs::File;
use std::path::{Path, PathBuf};

use datafusion::arrow::array::RecordBatch;
use lattice_core::voxels::DistortionSums;
use lattice_core::voxels::file::{LatticeFigures, MapColumns};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::file::metadata::ParquetMetaData;
use parquet::file::statistics::Statistics as ColumnStatistics;
use serde::{Deserialize, Serialize};

use crate::files::{FileId, at, read_manifest, write_whole};
use crate::rows::{TileRows, labels_of, voxels_of};
use crate::tile::Tile;
use crate::{Result, schema};

/// Cells of a tile, 2^8 along each axis.
const TILE_CELLS: u64 = 1 << 24;

/// Version of the tables.
pub const VERSION: u32 = 2;

/// Contents and source of a part: the file `part.json`.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartInfo {
    /// Version of the tables.
    pub version: u32,
    /// SHA-256 of the file with an empty digest.
    pub digest: String,
    /// Its source.
    pub source: Source,
    /// The map besides its rows.
    pub map: MapInfo,
    /// Its tiles, ascending.
    pub tiles: Vec<TileInfo>,
}

/// Source of a part; its digest is the name of the part.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// `map` for a map file, `log` for a replay.
    pub kind: String,
    /// Path that was given; not part of the name.
    pub path: String,
    /// SHA-256 of the map file, or of the files of the log.
    pub sha256: String,
    /// The first log time of the slice, s; the second, none up to the end.
    pub slice_s: (f64, Option<f64>),
    /// Options of the replay.
    pub settings: Vec<String>,
    /// Version of the program that made the map from a log.
    pub program: String,
}

/// A map besides its rows.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapInfo {
    /// Name of the lattice.
    pub lattice: String,
    /// Volume of a cell, m^3.
    pub cell_volume_m3: f64,
    /// `map_from_lattice` as w, x, y, z.
    pub orientation: [f64; 4],
    /// Generator in the lattice frame, column after column, m.
    pub generator_m: [f64; 9],
    /// Index of the datum that a map file counts from.
    pub datum_index: [i64; 3],
    /// Latitude and longitude in degrees and ellipsoidal height in m of the map's origin, where known.
    pub origin: Option<[f64; 3]>,
    /// True if there are counts and sums.
    pub counts: bool,
    /// True if there are stamps.
    pub stamps: bool,
    /// True if there are labels.
    pub labels: bool,
    /// Statistics of all points.
    pub statistics: Statistics,
}

/// Statistics as in the head of a map file; the wide ones in decimal digits.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "named as in docs/map_file.md")]
pub struct Statistics {
    pub points: u64,
    pub squares: String,
    pub distances: String,
    pub largest_square: u64,
}

/// Files of a tile.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TileInfo {
    /// The tile.
    pub tile: Tile,
    /// Rows of `voxels`.
    pub rows: u64,
    /// Rows of `labels`.
    pub label_rows: u64,
    /// Largest count of points in a row.
    pub max_count: i64,
    /// `voxels.parquet`.
    pub voxels: FileId,
    /// `labels.parquet`, if labels are kept.
    pub labels: Option<FileId>,
}

impl PartInfo {
    /// Reads the manifest of a part; fails, with its path, if it is damaged or contradicts itself.
    pub fn read(path: &Path) -> Result<PartInfo> {
        let info: PartInfo = read_manifest(path, |info: &PartInfo| &info.digest)?;
        let tiles = info.tiles.iter();
        if let Some(reason) = contradiction_of(tiles, &info.map) {
            return Err(at(path, reason));
        }
        Ok(info)
    }
}

/// The reason why no map has such tiles, if there is one.
pub fn contradiction_of<'a>(
    tiles: impl Iterator<Item = &'a TileInfo>,
    map: &MapInfo,
) -> Option<String> {
    let mut before: Option<Tile> = None;
    for tile in tiles {
        let name = tile.tile;
        if let Some(before) = before.filter(|before| *before >= name) {
            return Some(format!(
                "tile {name} follows tile {before}: each comes once, ascending"
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
            || (tile.max_count > 0) != map.counts
        {
            let (rows, labels, count) = (tile.rows, tile.label_rows, tile.max_count);
            return Some(format!(
                "tile {name} has {rows} rows of at most {count} points with {labels} labels: no tile of {TILE_CELLS} cells has"
            ));
        }
    }
    None
}

impl MapInfo {
    /// Of a map.
    pub fn of(map: &MapColumns, origin: Option<[f64; 3]>) -> MapInfo {
        let figures = LatticeFigures::from(&map.lattice);
        let sums = &map.statistics;
        MapInfo {
            lattice: figures.kind.name().to_owned(),
            cell_volume_m3: figures.cell_volume_m3,
            orientation: figures.orientation,
            generator_m: figures.generator_m,
            datum_index: map.datum_index,
            origin,
            counts: map.voxels.is_some(),
            stamps: map.stamps.is_some(),
            labels: map.labels.is_some(),
            statistics: Statistics {
                points: sums.points,
                squares: sums.squares.to_string(),
                distances: sums.distances.to_string(),
                largest_square: sums.largest_square,
            },
        }
    }

    /// The map without rows; fails if the figures of the lattice contradict each other.
    pub fn columns(&self) -> Result<MapColumns> {
        let figures = LatticeFigures {
            kind: LatticeFigures::kind_of(&self.lattice)?,
            cell_volume_m3: self.cell_volume_m3,
            orientation: self.orientation,
            generator_m: self.generator_m,
        };
        let wide = |digits: &str| {
            let number = digits.parse::<u128>();
            number.map_err(|error| format!("statistics {digits:?}: {error}"))
        };
        let sums = &self.statistics;
        Ok(MapColumns {
            lattice: figures.lattice()?,
            datum_index: self.datum_index,
            keys: Vec::new(),
            voxels: self.counts.then(Vec::new),
            stamps: self.stamps.then(Vec::new),
            labels: self.labels.then(Vec::new),
            statistics: DistortionSums {
                points: sums.points,
                squares: wide(&sums.squares)?,
                distances: wide(&sums.distances)?,
                largest_square: sums.largest_square,
            },
        })
    }

    /// Says with the numbers why two maps cannot be one.
    pub fn contradiction(&self, other: &MapInfo) -> Option<String> {
        let cells = |map: &MapInfo| {
            let (volume, turned) = (map.cell_volume_m3, map.orientation);
            let (lattice, generator) = (&map.lattice, map.generator_m);
            format!(
                "{lattice} cells of {volume} m^3, orientation {turned:?}, generator {generator:?}"
            )
        };
        let kept = |map: &MapInfo| {
            let yes = |kept: bool| if kept { "with" } else { "without" };
            let (counts, stamps, labels) = (yes(map.counts), yes(map.stamps), yes(map.labels));
            format!("{counts} counts, {stamps} stamps, {labels} labels")
        };
        let origins = match (self.origin, other.origin) {
            (Some(ours), Some(theirs)) if ours != theirs => {
                Some((format!("origin {ours:?}"), format!("origin {theirs:?}")))
            }
            _ => None,
        };
        let pairs = [
            Some((cells(self), cells(other))),
            Some((kept(self), kept(other))),
            origins,
        ];
        let mut pairs = pairs.into_iter().flatten();
        let (ours, theirs) = pairs.find(|(ours, theirs)| ours != theirs)?;
        Some(format!("one map has {ours}, the other {theirs}"))
    }
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
    let of_labels = folder.join("labels.parquet");
    let labels = match labels {
        true => Some(write_batch(&of_labels, &rows.label_batch(tile)?)?),
        false => None,
    };
    Ok(TileInfo {
        tile,
        rows: rows.voxels.len() as u64,
        label_rows: rows.labels.len() as u64,
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
    /// Files of the tile with what they must be.
    pub fn files(&self, folder: &Path) -> Vec<(PathBuf, &FileId)> {
        let folder = tile_folder(folder, self.tile);
        let voxels = (folder.join("voxels.parquet"), &self.voxels);
        let labels = self.labels.as_ref();
        let labels = labels.map(|id| (folder.join("labels.parquet"), id));
        std::iter::once(voxels).chain(labels).collect()
    }

    /// Fails, naming the file, unless the files are those that were written.
    pub fn verify(&self, folder: &Path) -> Result {
        let files = self.files(folder);
        files.iter().try_for_each(|(path, id)| id.verify(path))
    }

    /// Fails, naming the file, unless the footers of verified files have the rows, the tile and the largest count
    /// that are promised.
    pub fn check_footers(&self, folder: &Path) -> Result {
        for (path, _) in self.files(folder) {
            let of_labels = path.ends_with("labels.parquet");
            let promised = if of_labels {
                self.label_rows
            } else {
                self.rows
            };
            let check = || -> Result {
                let reader = ParquetRecordBatchReaderBuilder::try_new(File::open(&path)?)?;
                let metadata = reader.metadata();
                let rows = metadata.file_metadata().num_rows();
                if u64::try_from(rows) != Ok(promised) {
                    return Err(format!("{rows} rows, its manifest promises {promised}").into());
                }
                if rows > 0 && range_of(metadata, "tile")? != [self.tile; 2] {
                    return Err(format!("rows of other tiles than {}", self.tile).into());
                }
                if !of_labels && self.max_count > 0 {
                    let [_, most] = range_of(metadata, "count")?;
                    if most != self.max_count {
                        let promised = self.max_count;
                        return Err(format!(
                            "a count of {most}, its manifest promises at most {promised}"
                        )
                        .into());
                    }
                }
                Ok(())
            };
            check().map_err(|error| at(&path, error))?;
        }
        Ok(())
    }

    /// Reads the rows of a verified tile.
    pub fn read(&self, folder: &Path) -> Result<TileRows> {
        self.verify(folder)?;
        let mut rows = TileRows::default();
        for (path, _) in self.files(folder) {
            let of_labels = path.ends_with("labels.parquet");
            let mut read = || -> Result {
                let file = File::open(&path)?;
                for batch in ParquetRecordBatchReaderBuilder::try_new(file)?.build()? {
                    let batch = batch?;
                    if of_labels {
                        labels_of(&batch, |tile, row| self.own(tile, &mut rows.labels, row))?;
                    } else {
                        voxels_of(&batch, |tile, row| self.own(tile, &mut rows.voxels, row))?;
                    }
                }
                Ok(())
            };
            read().map_err(|error| at(&path, error))?;
        }
        let counted = (rows.voxels.len() as u64, rows.label_rows());
        if counted != (self.rows, self.label_rows) {
            let folder = tile_folder(folder, self.tile);
            return Err(at(
                &folder,
                format!("{counted:?} rows, not those of its manifest"),
            ));
        }
        Ok(rows)
    }

    fn own<T>(&self, tile: Tile, rows: &mut Vec<T>, row: T) -> Result {
        if tile != self.tile {
            return Err(format!("a row of tile {tile} in tile {}", self.tile).into());
        }
        rows.push(row);
        Ok(())
    }
}

/// The least and the largest value of a column by the footer.
fn range_of(metadata: &ParquetMetaData, name: &str) -> Result<[i64; 2]> {
    let mut range: Option<[i64; 2]> = None;
    for group in metadata.row_groups() {
        let column = group
            .columns()
            .iter()
            .find(|column| column.column_descr().name() == name);
        let statistics = match column.and_then(|column| column.statistics()) {
            Some(ColumnStatistics::Int64(statistics)) => statistics,
            _ => return Err(format!("no statistics of column {name:?}").into()),
        };
        if let (Some(&least), Some(&most)) = (statistics.min_opt(), statistics.max_opt()) {
            let [low, high] = range.unwrap_or([least, most]);
            range = Some([low.min(least), high.max(most)]);
        }
    }
    range.ok_or_else(|| format!("no statistics of column {name:?}").into())
}

impl TileRows {
    fn label_rows(&self) -> u64 {
        self.labels.len() as u64
    }
}
