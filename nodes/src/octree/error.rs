//! Error of an octree.

use thiserror::Error;

/// Reason for a tree that cannot be made.
#[derive(Clone, PartialEq, Debug, Error)]
pub enum OctreeError {
    /// Cell outside the tree, which has 65536 voxels per edge, centred at the origin.
    #[error(
        "the cell at {center_m:.1?} m is outside an octree of these cells, which reaches {limit_m} m from the \
         origin of the map: take larger cells, or a part of the map by `lattice map crop`"
    )]
    Outside {
        /// Centre of a cell.
        center_m: [f64; 3],
        /// Half the edge of the tree.
        limit_m: f64,
    },
    /// More bytes than the caller allows.
    #[error(
        "the octree has more than {max_bytes} bytes: take larger cells, or shorter rays (`rays.max_range_m`)"
    )]
    TooLarge {
        /// Limit of the nodes.
        max_bytes: usize,
    },
}
