//! Merging lists.

use thiserror::Error;

use crate::lattice::{BlockKey, MortonKey};
use crate::voxels::store::fixed_point::offsets_in;
use crate::voxels::store::payload_columns::Columns;
use crate::voxels::store::shard::{SHARDS, shard_of};
use crate::voxels::{Voxel, VoxelList, VoxelStore};

/// Two stores that do not go together. The receiving one is as before.
#[derive(Clone, PartialEq, Debug, Error)]
pub enum MergeError {
    /// The cells are different.
    #[error("{theirs} does not go with {ours}: make both maps with one lattice and cell volume")]
    Lattice {
        /// The lattice of the receiving list.
        ours: String,
        /// The lattice of the other list.
        theirs: String,
    },
    /// The same lattice, counted from different points.
    #[error(
        "a map with datum {theirs:?} m does not go with one with datum {ours:?} m: give both the same datum"
    )]
    Datum {
        /// Datum of the receiving list, map frame, metres.
        ours: [f64; 3],
        /// Datum of the other list, map frame, metres.
        theirs: [f64; 3],
    },
    /// The union has too many voxels.
    #[error(
        "the merged map has {voxels} voxels, but at most {max_voxels} are allowed: raise max_voxels"
    )]
    Full {
        /// Voxels in the union.
        voxels: usize,
        /// Limit of the receiving list.
        max_voxels: usize,
    },
    /// The union takes too much memory.
    #[error("the merged map takes {bytes} B, but at most {max_bytes} are allowed: raise max_bytes")]
    FullBytes {
        /// Memory for the union.
        bytes: usize,
        /// Limit of the receiving list.
        max_bytes: usize,
    },
}

impl VoxelList {
    /// Adds all voxels and statistics of `other`, exactly; order and grouping of merges do not
    /// matter. Fails, changing nothing, for another lattice or datum or if the union is too large,
    /// whatever [`crate::voxels::WhenFull`] says.
    pub fn merge(&mut self, other: &VoxelList) -> Result<(), MergeError> {
        self.expect_cells_of(other)?;
        let new = other
            .shards
            .iter()
            .zip(&self.shards)
            .map(|(theirs, ours)| {
                theirs
                    .iter()
                    .filter(|(code, _)| ours.get(*code).is_none())
                    .count()
            })
            .sum();
        let (voxels, max_voxels) = (self.len().saturating_add(new), self.max_voxels);
        if voxels > max_voxels {
            return Err(MergeError::Full { voxels, max_voxels });
        }
        let now = self.advance();
        for (ours, theirs) in self.shards.iter_mut().zip(&other.shards) {
            for (their_number, (code, entry)) in theirs.iter().enumerate() {
                if let Some(number) = ours.find_or_add(code, usize::MAX, now) {
                    ours.add_offsets(number, &theirs.offsets(code, entry), now);
                    if !self.payload.is_plain() {
                        ours.columns
                            .add(number as usize, &theirs.columns.get(their_number));
                    }
                }
            }
        }
        self.sums.add(&other.sums);
        Ok(())
    }

    /// Adds cells of which none is in the list, with the further columns row by row, until the list
    /// is full. Keys of one block should come together.
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
