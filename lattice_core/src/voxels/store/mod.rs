//! Memory of a voxel list, from a point to its row.
//!
//! To be read in this order: [`fixed_point`] turns positions into integers, [`point_gather`] adds up
//! the points of a cell, [`shard`] keeps the voxels of one of 16 parts of a list, [`cell_table`] finds
//! the row of a cell by its block ([`block_mask`] says which cells of a block are occupied,
//! [`hash_table`] finds the block), [`payload_columns`] holds what is kept besides count and sum,
//! [`wide_sums`] the sums that a row has no room for, [`growth`] how vectors grow.

pub(crate) mod block_mask;
mod cell_table;
pub(super) mod fixed_point;
pub(super) mod growth;
pub(crate) mod hash_table;
pub(super) mod payload_columns;
pub(super) mod point_gather;
pub(super) mod shard;
mod wide_sums;
