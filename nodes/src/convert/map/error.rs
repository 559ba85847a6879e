//! Error of a map message.

use lattice_core::voxels::codec;
use lattice_msgs::lattice::LatticeMap;
use thiserror::Error;

/// Supported key encoding: Morton-sorted 21-bit indices, LEB128 varints of differences.
pub const KEY_ENCODING: &str = LatticeMap::KEY_ENCODING_MORTON21;
/// The same with the mean colours of the voxels after the keys.
pub const COLOR_ENCODING: &str = LatticeMap::KEY_ENCODING_MORTON21_COLORS;

/// Reason for rejecting a `LatticeMap` or `LatticeMapUpdate`.
#[derive(Debug, Error)]
pub enum MapMessageError {
    /// Invalid lattice or cell volume.
    #[error("lattice '{lattice}' with cell volume {cell_volume_m3} m^3: {reason}")]
    Lattice {
        /// Name as sent.
        lattice: String,
        /// Cell volume as sent.
        cell_volume_m3: f64,
        /// Fault of the lattice or the volume.
        reason: String,
    },
    /// Unsupported key encoding.
    #[error(
        "key encoding '{0}' is unknown, expected '{KEY_ENCODING}' or '{COLOR_ENCODING}': install one version of Lattice on both sides"
    )]
    Encoding(String),
    /// Invalid keys.
    #[error("voxel keys: {0}")]
    Keys(#[from] codec::CodecError),
    /// Column length that does not match the keys.
    #[error("{column} has {found} entries for {voxels} voxels, expected {expected}")]
    Length {
        /// Name of the column.
        column: &'static str,
        /// Number of keys.
        voxels: usize,
        /// Expected number of entries.
        expected: usize,
        /// Number of entries.
        found: usize,
    },
    /// Chunk index outside the number of chunks.
    #[error("chunk {chunk} is outside 0..{chunks}")]
    Chunk {
        /// Number of the chunk in the message, from 0.
        chunk: u32,
        /// Number of chunks in the message.
        chunks: u32,
    },
    /// Invalid lattice frame.
    #[error("`map_from_lattice` is not a pose: a number is not finite or the quaternion is zero")]
    Frame,
}
