//! Filling a list with voxels that were read.

use crate::lattice::{BlockKey, MortonKey};
use crate::voxels::store::fixed_point::offsets_in;
use crate::voxels::store::payload_columns::Columns;
use crate::voxels::store::shard::{SHARDS, shard_of};
use crate::voxels::{Voxel, VoxelList};

impl VoxelList {
    /// Adds cells of which none is in the list, with those further columns that the list keeps, until
    /// it is full. Keys of one block should come together.
    pub(crate) fn fill(
        &mut self,
        cells: impl Iterator<Item = (MortonKey, Voxel)>,
        columns: &Columns,
    ) {
        let room = self.max_voxels.saturating_sub(self.len());
        let now = self.sequence.max(1);
        self.sequence = now;
        let expected = cells.size_hint().0.min(room) / SHARDS;
        for shard in &mut self.shards {
            // Shards differ by a few blocks.
            shard.voxels.reserve(expected + expected / 16);
        }
        for (row, (key, voxel)) in cells.take(room).enumerate() {
            let code = BlockKey::from(key);
            let Some(shard) = self.shards.get_mut(shard_of(code)) else {
                continue;
            };
            let Some(number) = shard.find_or_add(code, usize::MAX, now) else {
                continue;
            };
            shard.add_offsets(number, &offsets_in(&voxel), now);
            if !self.payload.is_plain() {
                shard.columns.add(number as usize, &columns.get(row));
            }
        }
    }
}
