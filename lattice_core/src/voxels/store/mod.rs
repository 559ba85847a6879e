//! Memory of a voxel list, from a point to its row.
//!
//! Reading order:
//! - [`fixed_point`] converts positions to integers.
//! - [`point_gather`] sums the points of a cell.
//! - [`shard`] holds the voxels of one of 16 parts of a list.
//! - [`cell_table`] finds the row of a cell by its block ([`block_mask`] for its occupied cells, [`hash_table`] for
//!   the block).
//! - [`payload_columns`] holds the optional columns, [`color_sum`] the row of one of them.
//! - [`touched`] lists the voxels that changed since their changes were taken.
//! - [`wide_sums`] holds sums that do not fit a row.
//! - [`growth`] controls the growth of vectors.

pub(crate) mod block_mask;
mod cell_table;
pub(super) mod color_sum;
mod entry;
pub(super) mod fixed_point;
pub(super) mod growth;
pub(crate) mod hash_table;
pub(super) mod payload_columns;
pub(super) mod point_gather;
pub(super) mod shard;
mod touched;
mod wide_sums;
