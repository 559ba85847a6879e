//! Octrees of OctoMap: voxels of a lattice, and the encoder of files and messages.

mod encode;
mod error;
mod voxels;

pub use encode::{EncodedTree, LEVELS, LOG_ODDS_OCCUPIED, OctreeForm, UNKNOWN};
pub use error::OctreeError;
pub use voxels::{HALF, OctreeVoxels};

/// Class of the written trees, as files and messages name it.
pub const CLASS: &str = "OcTree";

#[cfg(test)]
mod tests;
