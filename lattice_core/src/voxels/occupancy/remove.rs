//! Removing many cells at once.

use rayon::prelude::*;

use super::{Block, OccupancyList};
use crate::lattice::{BlockKey, LatticeIndex, MortonKey};
use crate::voxels::store::block_mask::{BlockMask, first_index, places};

impl OccupancyList {
    pub(super) fn retain_in_blocks(
        &mut self,
        keep_block: &(dyn Fn(LatticeIndex) -> Option<bool> + Sync),
        keep: &(dyn Fn(MortonKey) -> bool + Sync),
    ) -> usize {
        let kept = |block: &Block| -> BlockMask {
            match first_index(block.code).and_then(keep_block) {
                Some(true) => block.leaf,
                Some(false) => [0; 8],
                None => {
                    let mut leaf = block.leaf;
                    for place in places(&block.leaf) {
                        let key = cell(block.code, place).and_then(BlockKey::key);
                        if key.is_some_and(|key| !keep(key))
                            && let Some(word) = leaf.get_mut(place >> 6)
                        {
                            *word &= !(1 << (place & 63));
                        }
                    }
                    leaf
                }
            }
        };
        let rows = self.blocks.rows().par_iter().enumerate();
        let changed: Vec<(usize, BlockMask)> = rows
            .map(|(number, block)| (number, block, kept(block)))
            .filter(|(_, block, leaf)| *leaf != block.leaf)
            .map(|(number, _, leaf)| (number, leaf))
            .collect();
        let before = self.len;
        // From the last: the block that takes the number of a removed one has had its turn.
        for (number, leaf) in changed.into_iter().rev() {
            self.reduce(number, leaf);
        }
        before - self.len
    }

    /// Leaves a block only some of its cells.
    fn reduce(&mut self, number: usize, leaf: BlockMask) {
        let Some(block) = self.blocks.row_mut(number as u32) else {
            return;
        };
        let code = block.code;
        let mut gone = block.leaf;
        gone.iter_mut()
            .zip(&leaf)
            .for_each(|(word, left)| *word &= !left);
        block.leaf = leaf;
        for place in places(&gone) {
            self.len -= 1;
            if let Some(cell) = cell(code, place) {
                self.recent.forget(cell);
            }
        }
        if leaf == [0; 8] {
            self.blocks.remove(code);
        }
    }
}

fn cell(block: u64, place: usize) -> Option<BlockKey> {
    BlockKey::from_raw(block << 9 | place as u64)
}
