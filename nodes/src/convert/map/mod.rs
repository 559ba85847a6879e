//! Conversion of voxel lists to `LatticeMap` keyframes and `LatticeMapUpdate` deltas of bounded size.

mod checksum;
mod chunks;
mod colors;
mod error;
mod lattice_info;
mod voxels;

pub use checksum::{History, changes_sum, sign};
pub use chunks::{keyframe, keyframe_of_cells, update, update_of_cells, voxel_bytes};
pub use colors::{VoxelColor, keys_with_colors, part_colors, plain_keys};
pub use error::{COLOR_ENCODING, KEY_ENCODING, MapMessageError};
pub use lattice_info::{MapStamp, info_of, lattice_from};
pub use voxels::{Decoded, VoxelColumns, VoxelState, keys_from, main_label, voxels_from};

#[cfg(test)]
mod tests;
