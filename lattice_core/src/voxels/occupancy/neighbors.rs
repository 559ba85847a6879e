//! Counting the occupied neighbours of all voxels.

use super::OccupancyList;
use crate::lattice::{BlockKey, LatticeIndex};
use crate::voxels::store::block_mask::{BlockMask, places};

/// Number of blocks around a block, itself included.
const AROUND: usize = 27;

/// Positions of the neighbours of a block's cells in the surrounding blocks, as block of `AROUND` * 512 + position.
///
/// One entry per position of the block and index difference.
fn targets(stencil: &[LatticeIndex]) -> Vec<u16> {
    let targets = (0..BlockKey::BLOCK_CELLS as i32).flat_map(|place| {
        stencil.iter().map(move |d| {
            let at = [
                (place >> 6) + d[0],
                (place >> 3 & 7) + d[1],
                (place & 7) + d[2],
            ];
            let block = at.iter().fold(0, |sum, i| 3 * sum + (i >> 3) + 1);
            let place = at.iter().fold(0, |sum, i| 8 * sum + (i & 7));
            (block * BlockKey::BLOCK_CELLS as i32 + place) as u16
        })
    });
    targets.collect()
}

impl OccupancyList {
    /// Visits every voxel with the number of its occupied neighbours, in memory order; the index differences
    /// `stencil` are at most 8.
    ///
    /// A block and those around it are fetched once for all of their cells, so that a neighbour costs a bit test, not
    /// a search.
    pub fn count_neighbors(&self, stencil: &[LatticeIndex], mut visit: impl FnMut(BlockKey, u32)) {
        debug_assert!(stencil.iter().flatten().all(|i| (-8..=8).contains(i)));
        let targets = targets(stencil);
        let mut around = [0_u64; AROUND * 8];
        for block in self.blocks.rows() {
            self.fetch_around(block.code, &mut around);
            for place in places(&block.leaf) {
                let begin = place * stencil.len();
                let targets = targets.get(begin..begin + stencil.len());
                let bit = |target: &u16| {
                    let word = around.get(usize::from(target >> 6)).copied().unwrap_or(0);
                    (word >> (target & 63)) as u32 & 1
                };
                let count: u32 = targets.unwrap_or_default().iter().map(bit).sum();
                let Some(code) = BlockKey::from_raw(block.code << 9 | place as u64) else {
                    continue;
                };
                visit(code, count);
            }
        }
    }

    /// Bits of the blocks around a block; empty beyond the range of indices.
    fn fetch_around(&self, block: u64, around: &mut [u64; AROUND * 8]) {
        let Some(first) = BlockKey::from_raw(block << 9) else {
            return;
        };
        let [x, y, z] = first.unpack();
        for (number, leaf) in around.as_chunks_mut::<8>().0.iter_mut().enumerate() {
            let step = |place: usize| 8 * ((number / place % 3) as i32 - 1);
            let code = BlockKey::pack([x + step(9), y + step(3), z + step(1)]);
            *leaf = code.map_or([0; 8], |code| self.leaf(code.block()));
        }
    }

    fn leaf(&self, block: u64) -> BlockMask {
        let number = self.blocks.find(block);
        let row = number.and_then(|number| self.blocks.rows().get(number as usize));
        row.map_or([0; 8], |row| row.leaf)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use proptest::prelude::*;

    use super::*;
    use crate::lattice::{Lattice, LatticeKind, MortonKey};
    use crate::voxels::VoxelStore;

    proptest! {
        #[test]
        fn counts_are_those_of_a_search(
            kind in 0..LatticeKind::ALL.len(),
            cells in prop::collection::btree_set(prop::array::uniform3(-12..12_i32), 1..300),
            edge in any::<bool>(),
            far in prop::collection::vec(prop::array::uniform3(-8..9_i32), 0..3),
        ) {
            // At the end of the range of indices too.
            let shift = if edge { (1 << 20) - 12 } else { 0 };
            let cells: BTreeSet<LatticeIndex> = cells.iter().map(|w| w.map(|i| i + shift)).collect();
            let lattice = Lattice::new(LatticeKind::ALL[kind], 1.0).unwrap();
            let keys = cells.iter().map(|w| MortonKey::pack(*w).unwrap());
            let list = OccupancyList::from_keys(lattice.clone(), [0; 3], keys, 1 << 20);
            let mut stencil = lattice.touching_neighbors().to_vec();
            stencil.extend(far);
            let mut visited = BTreeSet::new();
            list.count_neighbors(&stencil, |code, count| {
                let w = code.unpack();
                let neighbor = |d: &&LatticeIndex| cells.contains(&[w[0] + d[0], w[1] + d[1], w[2] + d[2]]);
                assert_eq!(count as usize, stencil.iter().filter(neighbor).count());
                assert!(visited.insert(w));
            });
            prop_assert_eq!(visited, cells);
            prop_assert_eq!(list.len(), list.sorted_keys().len());
        }
    }
}
