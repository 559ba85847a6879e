//! The manifest of a merged map.

use std::path::Path;

use lattice_core::voxels::file::MapContents;
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::files::{at, read_manifest};
use crate::part::MapInfo;
use crate::tables::read_map;
use crate::tile_files::{TileInfo, contradiction_of};

/// Name of the manifest of a merged map.
pub const MERGED_FILE: &str = "merged.json";

/// Contents of a merged map, and the source of each tile.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Merged {
    /// Version of the tables.
    pub version: u32,
    /// SHA-256 of the file with an empty digest.
    pub digest: String,
    /// The map besides its rows.
    pub map: MapInfo,
    /// Names of the parts.
    pub parts: Vec<String>,
    /// Its tiles, ascending.
    pub tiles: Vec<MergedTile>,
}

impl Merged {
    /// Reads the manifest of a merged map. Fails, with its path, if it is damaged or contradicts itself.
    pub fn read(folder: &Path) -> Result<Merged> {
        let place = folder.join(MERGED_FILE);
        let merged: Merged = read_manifest(&place, |merged: &Merged| &merged.digest)?;
        let tiles = merged.tiles.iter().map(|tile| &tile.files);
        match contradiction_of(tiles, &merged.map) {
            Some(reason) => Err(at(&place, reason)),
            None => Ok(merged),
        }
    }
}

/// A tile of a merged map.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MergedTile {
    /// Digest of the names and files of its parts.
    pub made_from: String,
    /// Its files.
    pub files: TileInfo,
}

/// Reads the merged map of a folder.
pub fn read_merged(folder: &Path) -> Result<MapContents> {
    let merged = Merged::read(folder)?;
    let tiles: Vec<_> = merged.tiles.iter().map(|tile| tile.files.clone()).collect();
    read_map(folder, &merged.map, &tiles)
}
