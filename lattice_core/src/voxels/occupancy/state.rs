//! Blocks of occupied cells.

use nalgebra::Vector3;

use super::recent_cells::Recent;
use crate::lattice::Lattice;
use crate::voxels::store::block_mask::BlockMask;
use crate::voxels::store::hash_table::Table;

#[derive(Clone)]
pub(crate) struct Block {
    pub(super) code: u64,
    pub(super) leaf: BlockMask,
}

/// Occupied voxels without payload: blocks of 8 x 8 x 8 indices with one bit per cell.
///
/// The fastest and smallest store, 2 to 4 bytes per voxel on surfaces. When `max_bytes` is reached, points in new
/// blocks are refused and counted; existing blocks still accept points.
#[derive(Clone)]
pub struct OccupancyList {
    pub(super) lattice: Lattice,
    pub(super) datum_index: [i64; 3],
    pub(super) datum_m: Vector3<f64>,
    pub(super) max_blocks: usize,
    pub(super) blocks: Table<Block>,
    pub(super) len: usize,
    pub(super) recent: Recent,
}
