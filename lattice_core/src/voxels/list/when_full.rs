//! Full lists: refuse new voxels or evict the oldest.

use super::state::{VoxelList, WhenFull};
use crate::lattice::BlockKey;
use crate::voxels::store::shard::Shard;

impl VoxelList {
    /// Sets the policy of [`VoxelList::insert`].
    #[must_use]
    pub fn with_when_full(mut self, when_full: WhenFull) -> VoxelList {
        self.when_full = when_full;
        self
    }

    /// Sets another limit and policy; voxels above the limit stay until the next eviction.
    pub fn set_bound(&mut self, max_voxels: usize, when_full: WhenFull) {
        (self.max_voxels, self.when_full) = (max_voxels, when_full);
    }

    /// Policy when the list is full.
    pub fn when_full(&self) -> WhenFull {
        self.when_full
    }

    /// Number of voxels evicted at once.
    fn portion(&self) -> usize {
        self.max_voxels.div_ceil(8).max(1)
    }

    /// Number of points inserted at once.
    pub(crate) fn wave_points(&self, wave: usize) -> usize {
        match self.when_full {
            WhenFull::Refuse => wave,
            WhenFull::ForgetOldest => wave.min(self.portion()),
        }
    }

    /// Evicts voxels, if that is the policy and `points` may not fit; returns their number.
    pub(crate) fn make_room(&mut self, points: usize, now: u32) -> usize {
        let len = self.len();
        if self.when_full == WhenFull::Refuse || len.saturating_add(points) <= self.max_voxels {
            return 0;
        }
        let left = self.max_voxels.saturating_sub(self.portion());
        self.forget_oldest(len.saturating_sub(left), now)
    }

    fn forget_oldest(&mut self, count: usize, now: u32) -> usize {
        let Some(last) = count.checked_sub(1) else {
            return 0;
        };
        let rows = || self.shards.iter().flat_map(|shard| shard.voxels.rows());
        let mut states: Vec<u32> = rows().map(|entry| entry.life.touched).collect();
        if last >= states.len() {
            return 0;
        }
        let (older, &mut state, _) = states.select_nth_unstable(last);
        let older = older.iter().filter(|touched| **touched < state).count();
        let mut equal: Vec<u64> = rows()
            .filter(|entry| entry.life.touched == state)
            .filter_map(|entry| Some(BlockKey::from_raw(entry.code)?.key()?.raw()))
            .collect();
        let (_, &mut last_key, _) = equal.select_nth_unstable(last - older);
        let select = |shard: &Shard| {
            let goes = |code: BlockKey, touched: u32| {
                let upto = || code.key().is_some_and(|key| key.raw() <= last_key);
                touched < state || (touched == state && upto())
            };
            let gone = shard.iter().filter(|(code, e)| goes(*code, e.life.touched));
            gone.map(|(code, _)| code).collect()
        };
        let gone = self.shards.iter().map(select).collect();
        self.remove_at(gone, now)
    }
}
