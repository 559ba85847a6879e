//! Full lists: refuse new voxels or forget the oldest.

use super::VoxelList;
use crate::lattice::BlockKey;
use crate::voxels::store::shard::Shard;

/// Policy of a full list for points in new cells.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum WhenFull {
    /// Refuses them; points in known cells still count.
    #[default]
    Refuse,
    /// Forgets the voxels that no point has touched for longest until 7/8 of the limit are left.
    ///
    /// Points are taken in portions of at most 1/8 of the limit. Before a portion that may not fit,
    /// the voxels go in the order of the state in which they last changed, those of one state in the
    /// order of their cells: the same on any number of threads. No point is refused, except by a
    /// list of at most 0 voxels.
    ForgetOldest,
}

impl VoxelList {
    /// The same list with another policy for [`VoxelList::insert`].
    pub fn with_when_full(mut self, when_full: WhenFull) -> VoxelList {
        self.when_full = when_full;
        self
    }

    /// Goes on with another bound and policy; voxels beyond the bound stay until room is made.
    pub fn set_bound(&mut self, max_voxels: usize, when_full: WhenFull) {
        (self.max_voxels, self.when_full) = (max_voxels, when_full);
    }

    /// Policy when the list is full.
    pub fn when_full(&self) -> WhenFull {
        self.when_full
    }

    /// Room that is made at once.
    fn portion(&self) -> usize {
        self.max_voxels.div_ceil(8).max(1)
    }

    /// Points to insert at once.
    pub(crate) fn wave_points(&self, wave: usize) -> usize {
        match self.when_full {
            WhenFull::Refuse => wave,
            WhenFull::ForgetOldest => wave.min(self.portion()),
        }
    }

    /// Forgets voxels, if it is the policy and `points` may not fit; gives their number.
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
