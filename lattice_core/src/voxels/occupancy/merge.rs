//! Merging another store into an occupancy list.

use super::{BLOCK_BYTES, Last, OccupancyList};
use crate::lattice::BlockKey;
use crate::voxels::{MergeError, VoxelStore};

impl OccupancyList {
    /// Adds the cells of another store of either sort; order and grouping of merges do not matter.
    /// Gives the number of new cells.
    ///
    /// Fails, changing nothing, for another lattice or datum or if the union is too large.
    pub fn merge(&mut self, other: &dyn VoxelStore) -> Result<usize, MergeError> {
        self.expect_cells_of(other)?;
        // Cells of one block are next to each other.
        let keys = other.sorted_keys();
        let mut blocks = self.blocks.len();
        let mut last = u64::MAX;
        for &key in &keys {
            let block = BlockKey::from(key).block();
            if block != last {
                last = block;
                blocks += usize::from(self.blocks.find(block).is_none());
            }
        }
        if blocks > self.max_blocks {
            return Err(MergeError::FullBytes {
                bytes: blocks.saturating_mul(BLOCK_BYTES),
                max_bytes: self.max_bytes(),
            });
        }
        let before = self.len;
        let mut last = Last::default();
        for key in keys {
            self.set(BlockKey::from(key), &mut last);
        }
        Ok(self.len - before)
    }
}
