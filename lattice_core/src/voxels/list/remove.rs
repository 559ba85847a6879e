//! Removing many voxels at once.

use rayon::prelude::*;

use super::VoxelList;
use crate::lattice::BlockKey;
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
