//! Reading of map files.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use lattice_core::voxels::file::{MapContents, max_voxels_of};
use lattice_core::voxels::label_names::{LabelNames, read_label_names};

use crate::CliResult;

/// Reads a map with the names of its labels.
pub fn read_named(path: &Path) -> CliResult<(MapContents, LabelNames)> {
    let (map, _) = read(path)?;
    let here = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    let file = File::open(path).map_err(|e| here(&e))?;
    let names = read_label_names(BufReader::new(file)).map_err(|e| here(&e))?;
    Ok((map, names))
}

/// Reads a map with the size of its file, which bounds the voxels.
pub fn read(path: &Path) -> CliResult<(MapContents, u64)> {
    let here = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    let file = File::open(path).map_err(|e| here(&e))?;
    let bytes = file.metadata().map_err(|e| here(&e))?.len();
    let map =
        MapContents::read(BufReader::new(file), max_voxels_of(bytes)).map_err(|e| here(&e))?;
    Ok((map, bytes))
}
