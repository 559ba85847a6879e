//! Octrees of OctoMap: voxels of a lattice, and the encoder of files and messages.

mod encode;
mod voxels;

pub use encode::{EncodedTree, LOG_ODDS_OCCUPIED, OctreeForm, UNKNOWN};
pub use voxels::{OctreeError, OctreeVoxels};

/// Levels of a tree below its root.
pub const LEVELS: u32 = 16;
/// Voxels on each side of the centre of a tree.
pub const HALF: i64 = 1 << (LEVELS - 1);
/// Class of the written trees, as files and messages name it.
pub const CLASS: &str = "OcTree";

#[cfg(test)]
mod tests;
