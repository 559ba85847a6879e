//! Map files: lattice, datum, sorted keys and, optionally, the payload of each voxel.
//!
//! `docs/map_file.md` specifies the format and has a reader in Python.

mod column_error;
mod column_values;
mod columns;
mod contents;
mod error;
mod head;
mod lattice_figures;
mod operations;
mod options;
mod read;
mod source;
mod write;

#[cfg(test)]
mod tests;

use std::io::{Read, Write};

use super::{OccupancyList, VoxelList, VoxelStore};

pub use columns::{ColumnsError, MapColumns};
pub use contents::MapContents;
pub use error::FileError;
pub use lattice_figures::{Figure, FiguresError, LatticeFigures};
pub use operations::OperationError;
pub use options::{MAX_EXPANSION, WriteOptions, max_voxels_of};

/// Writes a list with its payload, not packed; equal maps give equal bytes.
pub fn write_map(list: &VoxelList, writer: impl Write) -> Result<(), FileError> {
    MapContents::from_list(list).write(writer, &WriteOptions::default())
}

/// Tests whether data start as a map file of any version.
pub fn is_map(mut reader: impl Read) -> bool {
    let mut magic = [0; 8];
    reader.read_exact(&mut magic).is_ok() && [head::MAGIC, head::OLD_MAGIC].contains(&&magic)
}

/// Reads a map of at most `max_voxels`, which becomes its bound; all voxels count as changed.
///
/// A map without payload becomes one of a point at each centre. See [`MapContents::read`].
pub fn read_map(reader: impl Read, max_voxels: usize) -> Result<VoxelList, FileError> {
    Ok(MapContents::read(reader, max_voxels)?.into_list(max_voxels))
}

/// Reads the occupied cells of a map into a list of at most `max_bytes`, whatever else the map holds.
///
/// Fails with [`FileError::TooLarge`] if they do not fit. See [`MapContents::read`].
pub fn read_occupancy(reader: impl Read, max_bytes: usize) -> Result<OccupancyList, FileError> {
    let most = OccupancyList::max_voxels_within(max_bytes);
    let too_large = |voxels| FileError::TooLarge { voxels, max_bytes };
    let contents = match MapContents::read_keys(reader, most) {
        Err(FileError::TooManyVoxels { voxels, .. }) => return Err(too_large(voxels)),
        other => other?,
    };
    let voxels = contents.keys.len();
    let list = contents.into_occupancy(max_bytes);
    match list.len() == voxels {
        true => Ok(list),
        false => Err(too_large(voxels as u64)),
    }
}
