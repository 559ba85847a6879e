//! Parts: the tables of one map each, in a folder that never changes.

use std::path::Path;

use lattice_core::voxels::DistortionSums;
use lattice_core::voxels::file::{LatticeFigures, MapColumns};
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::files::{at, read_manifest};
use crate::tile_files::{TileInfo, contradiction_of};

/// Version of the tables.
pub const VERSION: u32 = 3;

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
    /// Path of the file or the log; not part of the name.
    pub path: String,
    /// SHA-256 of the map file, or of the files of the log.
    pub sha256: String,
    /// First log time of the slice and the time after it, s; none: up to the end.
    pub slice_s: (f64, Option<f64>),
    /// Options of the replay, or of `lattice map to-table`.
    pub settings: Vec<String>,
    /// Version of the program that made the map from a log.
    pub program: String,
    /// True if a corrections file has an entry for the log, so that its map frame is that of the merged map; not part
    /// of the name.
    pub placed: bool,
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
    /// Index of the datum, from which a map file counts.
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

impl PartInfo {
    /// Reads the manifest of a part. Fails, with its path, if it is damaged or contradicts itself.
    pub fn read(path: &Path) -> Result<PartInfo> {
        let info: PartInfo = read_manifest(path, |info: &PartInfo| &info.digest)?;
        let tiles = info.tiles.iter();
        if let Some(reason) = contradiction_of(tiles, &info.map) {
            return Err(at(path, reason));
        }
        Ok(info)
    }
}

impl MapInfo {
    /// Describes a map.
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

    /// The map without rows. Fails if the values of the lattice contradict each other.
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
            // Tables have no colours.
            colors: None,
            statistics: DistortionSums {
                points: sums.points,
                squares: wide(&sums.squares)?,
                distances: wide(&sums.distances)?,
                largest_square: sums.largest_square,
            },
        })
    }

    /// Length of the shortest column of the generator, m.
    pub fn shortest_step_m(&self) -> f64 {
        let columns = self.generator_m.chunks(3);
        let lengths = columns.map(|step| step.iter().map(|m| m * m).sum::<f64>().sqrt());
        lengths.fold(f64::INFINITY, f64::min)
    }

    /// The reason why two maps cannot be merged, with the values of both.
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
