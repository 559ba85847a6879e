//! Changes of a list since the last query for them.

use super::VoxelList;
use crate::lattice::{BlockKey, MortonKey};
use crate::voxels::store::shard::{Life, Shard};

/// Keys that differ from an earlier state, sorted.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Changes {
    /// Voxels that are new or have more points.
    pub changed: Vec<MortonKey>,
    /// Voxels of the earlier state that were removed.
    pub removed: Vec<MortonKey>,
}

impl VoxelList {
    /// State counter: every call that may change voxels increments it.
    pub fn sequence(&self) -> u32 {
        self.sequence
    }

    /// Changes since the previous call (since the start for the first).
    ///
    /// The memory is bounded by the number of voxels at that call.
    pub fn take_changes(&mut self) -> Changes {
        let changes = self.changes();
        self.taken = self.sequence;
        for shard in &mut self.shards {
            shard.removed.clear();
            shard.touched.take(self.taken);
        }
        changes
    }

    fn changes(&self) -> Changes {
        let taken = self.taken;
        let shards = || self.shards.iter();
        let changed = shards().flat_map(Shard::changed);
        let mut changed: Vec<MortonKey> = changed.filter_map(BlockKey::key).collect();
        let known = |life: &Life| life.born <= taken && life.touched > taken;
        let removed = shards().flat_map(|shard| shard.removed.iter());
        let mut removed: Vec<MortonKey> = removed
            .filter(|(_, life)| known(life))
            .filter_map(|(code, _)| BlockKey::from_raw(*code)?.key())
            .collect();
        changed.sort_unstable();
        changed.dedup();
        removed.sort_unstable();
        Changes { changed, removed }
    }

    /// Increments the state and returns its number.
    pub(crate) fn advance(&mut self) -> u32 {
        if self.sequence == u32::MAX {
            self.renumber();
        }
        self.sequence += 1;
        self.sequence
    }

    /// Restarts the state counter; changes already taken stay taken.
    fn renumber(&mut self) {
        let taken = self.taken;
        let new = |state: u32| u32::from(state > taken);
        for shard in &mut self.shards {
            let lives = shard
                .voxels
                .rows_mut()
                .iter_mut()
                .map(|entry| &mut entry.life);
            for life in lives.chain(shard.removed.values_mut()) {
                (life.born, life.touched) = (new(life.born), new(life.touched));
            }
            shard.touched.renumber();
        }
        (self.taken, self.sequence) = (0, 1);
    }

    /// Bounds the memory for removed voxels: above `max_voxels`, only those of the last `take_changes` are kept.
    pub(crate) fn bound_removed(&mut self) {
        let remembered: usize = self.shards.iter().map(|shard| shard.removed.len()).sum();
        if remembered > self.max_voxels {
            let taken = self.taken;
            for shard in &mut self.shards {
                shard.removed.retain(|_, life| life.born <= taken);
            }
        }
    }
}
