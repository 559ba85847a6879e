//! Removing many voxels at once.

use rayon::prelude::*;

use super::VoxelList;
use crate::lattice::{BlockKey, LatticeIndex, MortonKey};
use crate::voxels::store::block_mask::{first_index, places};
use crate::voxels::store::shard::{Entry, Shard};

impl VoxelList {
    /// Removes the voxels that `goes` wants, by shard, number in the shard and row.
    pub(crate) fn remove_where(
        &mut self,
        goes: impl Fn(&Shard, usize, &Entry) -> bool + Sync,
    ) -> usize {
        let select = |shard: &Shard| {
            let rows = shard.iter().enumerate();
            let gone = rows.filter(|(number, (_, entry))| goes(shard, *number, entry));
            gone.map(|(_, (code, _))| code).collect()
        };
        let gone = self.shards.par_iter().map(select).collect();
        self.remove_all(gone)
    }

    pub(crate) fn retain_in_blocks(
        &mut self,
        keep_block: &(dyn Fn(LatticeIndex) -> Option<bool> + Sync),
        keep: &(dyn Fn(MortonKey) -> bool + Sync),
    ) -> usize {
        let goes = |code: &BlockKey| code.key().is_some_and(|key| !keep(key));
        let select = |shard: &Shard| {
            let mut gone = Vec::new();
            for (block, leaf) in shard.voxels.blocks() {
                let cells =
                    places(leaf).filter_map(|place| BlockKey::from_raw(block << 9 | place as u64));
                match first_index(block).and_then(keep_block) {
                    Some(true) => {}
                    Some(false) => gone.extend(cells),
                    None => gone.extend(cells.filter(goes)),
                }
            }
            gone
        };
        let gone = self.shards.par_iter().map(select).collect();
        self.remove_all(gone)
    }

    /// Removes the voxels of these cells, listed by shard, as one change of state.
    fn remove_all(&mut self, gone: Vec<Vec<BlockKey>>) -> usize {
        let now = self.advance();
        self.remove_at(gone, now)
    }

    /// Removes the voxels of these cells, listed by shard, as part of state `now`.
    pub(crate) fn remove_at(&mut self, gone: Vec<Vec<BlockKey>>, now: u32) -> usize {
        let shards = self.shards.par_iter_mut().zip(gone);
        let removed = shards.map(|(shard, gone)| {
            let cells = gone.into_iter();
            cells.filter(|&code| shard.remove(code, now)).count()
        });
        let removed = removed.sum();
        self.bound_removed();
        removed
    }
}
