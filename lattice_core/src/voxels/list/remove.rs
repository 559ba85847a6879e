//! Removing many voxels at once.

use rayon::prelude::*;
use thiserror::Error;

use super::VoxelList;
use crate::lattice::BlockKey;
use crate::voxels::region::{CellsInside, Region};
use crate::voxels::store::shard::{Entry, Shard};

/// List without stamps.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Error)]
#[error("the map keeps no stamps: make it with_payload(Payload {{ stamps: true, .. }})")]
pub struct NoStamps;

impl VoxelList {
    /// Removes the voxels whose last point is older than `stamp_ns`; returns their number.
    ///
    /// Voxels without a stamp, from lists that kept none, are removed too. Fails, without a change, if this list
    /// keeps no stamps.
    pub fn forget_before(&mut self, stamp_ns: i64) -> Result<usize, NoStamps> {
        if !self.payload.stamps {
            return Err(NoStamps);
        }
        Ok(self.remove_where(|shard, number, _| {
            let stamps = shard.columns.stamps.get(number);
            stamps.is_some_and(|stamps| stamps.last_ns < stamp_ns)
        }))
    }

    /// Removes the voxels for which `is_removed` is true, given shard, index in the shard and row.
    pub(super) fn remove_where(
        &mut self,
        is_removed: impl Fn(&Shard, usize, &Entry) -> bool + Sync,
    ) -> usize {
        let select = |shard: &Shard| {
            let rows = shard.iter().enumerate();
            let gone = rows.filter(|(number, (_, entry))| is_removed(shard, *number, entry));
            gone.map(|(_, (code, _))| code).collect()
        };
        let gone = self.shards.par_iter().map(select).collect();
        let now = self.advance();
        self.remove_at(gone, now)
    }

    /// Cells with their centre in a region, by shard.
    pub(super) fn cells_in(&self, region: &Region) -> Vec<Vec<BlockKey>> {
        let inside = CellsInside::new(region, &self.lattice, self.datum_m);
        let select = |shard: &Shard| {
            let blocks = shard.voxels.blocks();
            blocks
                .flat_map(|(block, leaf)| inside.of_block(block, leaf))
                .collect()
        };
        self.shards.par_iter().map(select).collect()
    }

    /// Removes the voxels of these cells, by shard, as part of state `now`.
    pub(super) fn remove_at(&mut self, gone: Vec<Vec<BlockKey>>, now: u32) -> usize {
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
