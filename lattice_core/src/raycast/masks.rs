//! Cells that one scan hits and traverses.

use std::hash::{BuildHasher, RandomState};

use super::packed::Packed;
use crate::lattice::BlockKey;
use crate::voxels::VoxelStore;
use crate::voxels::store::block_mask::places;

/// One bit per cell of a block, one cache line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(align(64))]
pub(super) struct Mask(pub(super) [u64; 8]);

impl Mask {
    /// Occupied cells of a store in a block.
    pub(super) fn of_voxels(store: &dyn VoxelStore, block: u64) -> Mask {
        let mut mask = Mask::default();
        let Some(code) = BlockKey::pack(Packed::at(block, 0).unpack()) else {
            return mask;
        };
        // Places of a block key count the last axis fastest.
        for place in places(&store.block_mask(code.block())) {
            mask.set(place >> 6 & 7 | place & 0o70 | (place & 7) << 6);
        }
        mask
    }

    #[inline(always)]
    fn set(&mut self, place: usize) -> bool {
        let bit = 1 << (place & 63);
        let word = &mut self.0[place >> 6 & 7];
        let new = *word & bit == 0;
        *word |= bit;
        new
    }

    #[inline(always)]
    pub(super) fn has(&self, place: usize) -> bool {
        self.0[place >> 6 & 7] >> (place & 63) & 1 == 1
    }

    pub(super) fn remove(&mut self, place: usize) {
        self.0[place >> 6 & 7] &= !(1 << (place & 63));
    }

    /// Cells that are not in another mask.
    pub(super) fn without(&self, other: &Mask) -> Mask {
        Mask(std::array::from_fn(|word| self.0[word] & !other.0[word]))
    }

    /// Cells of both masks.
    pub(super) fn and(&self, other: &Mask) -> Mask {
        Mask(std::array::from_fn(|word| self.0[word] & other.0[word]))
    }

    /// Cells of either mask.
    pub(super) fn or(&self, other: &Mask) -> Mask {
        Mask(std::array::from_fn(|word| self.0[word] | other.0[word]))
    }

    pub(super) fn places(&self) -> impl Iterator<Item = usize> + '_ {
        places(&self.0)
    }
}

/// Odd random multiplier, so that senders of points cannot force collisions.
fn random_multiplier() -> u64 {
    RandomState::new().hash_one(0) | 1
}

/// Slot of a hash in a table with a power of two of slots.
#[inline(always)]
fn spread(block: u64, multiplier: u64, bits: u32) -> usize {
    // The low three bits of a block are zero, so both halves are rotated.
    let mixed = (block ^ block >> 32).wrapping_mul(multiplier);
    (mixed >> (64 - bits)) as usize
}

#[derive(Clone, Copy, Debug, Default)]
struct Entry {
    block: u64,
    slot: u32,
    /// Stamp of the scan; the entry is empty if it differs.
    stamp: u32,
}

/// Blocks of one scan; cleared in constant time.
#[derive(Clone, Debug)]
pub(super) struct ScanMasks {
    table: Vec<Entry>,
    bits: u32,
    multiplier: u64,
    stamp: u32,
    /// Masks by slot; slot 0 collects the cells of refused blocks.
    blocks: Vec<u64>,
    passed: Vec<Mask>,
    hit: Vec<Mask>,
    most: usize,
    entries_refused: u64,
}

/// Block of the last cell; a ray stays in one for several cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cursor {
    block: u64,
    pub(super) slot: usize,
}

impl Cursor {
    /// No block: the low bits of a block are zero.
    pub(super) const NONE: Cursor = Cursor { block: 1, slot: 0 };

    #[inline(always)]
    pub(super) fn is_in_block_of(&self, cell: Packed) -> bool {
        cell.block() == self.block
    }
}

impl ScanMasks {
    pub(super) fn new(most: usize) -> ScanMasks {
        let bits = 8;
        ScanMasks {
            table: vec![Entry::default(); 1 << bits],
            bits,
            multiplier: random_multiplier(),
            stamp: 1,
            blocks: vec![1],
            passed: vec![Mask::default()],
            hit: vec![Mask::default()],
            most: most.min(u32::MAX as usize - 1),
            entries_refused: 0,
        }
    }

    /// Maximum memory per block, bytes: twice masks and block for the growth of vectors, and a table at least 3/8
    /// full beside the one that it replaces.
    pub(super) const BYTES_PER_BLOCK: usize = 2 * (2 * size_of::<Mask>() + 8) + 4 * 16;

    pub(super) fn bytes(&self) -> usize {
        self.table.capacity() * size_of::<Entry>()
            + (self.passed.capacity() + self.hit.capacity()) * size_of::<Mask>()
            + self.blocks.capacity() * 8
    }

    pub(super) fn clear(&mut self) {
        self.blocks.truncate(1);
        self.passed.truncate(1);
        self.hit.truncate(1);
        self.entries_refused = 0;
        self.stamp = self.stamp.wrapping_add(1);
        if self.stamp == 0 {
            self.table.fill(Entry::default());
            self.stamp = 1;
        }
    }

    /// Number of times that a ray or end entered a block refused for lack of memory.
    pub(super) fn entries_refused(&self) -> u64 {
        self.entries_refused
    }

    /// Every block with its traversed and its hit cells.
    pub(super) fn blocks(&self) -> impl Iterator<Item = (u64, &Mask, &Mask)> + Clone {
        let masks = self.passed.iter().zip(&self.hit);
        let blocks = self.blocks.iter().zip(masks).skip(1);
        blocks.map(|(block, (passed, hit))| (*block, passed, hit))
    }

    #[inline(always)]
    pub(super) fn pass(&mut self, cell: Packed, cursor: &mut Cursor) {
        if !cursor.is_in_block_of(cell) {
            *cursor = self.enter(cell.block());
        }
        if let Some(mask) = self.passed.get_mut(cursor.slot) {
            mask.set(cell.place());
        }
    }

    /// Takes the mark of a traversed cell back.
    pub(super) fn spare(&mut self, cell: Packed) {
        let mask = self.find(cell.block()).filter(|slot| *slot != 0);
        if let Some(mask) = mask.and_then(|slot| self.passed.get_mut(slot)) {
            mask.remove(cell.place());
        }
    }

    /// Marks a cell as hit; true if it was not yet, or if its block is refused.
    #[inline]
    pub(super) fn hit(&mut self, cell: Packed, cursor: &mut Cursor) -> bool {
        if !cursor.is_in_block_of(cell) {
            *cursor = self.enter(cell.block());
        }
        let new = self.hit.get_mut(cursor.slot);
        new.is_some_and(|mask| mask.set(cell.place())) || cursor.slot == 0
    }

    pub(super) fn is_hit(&self, cell: Packed) -> bool {
        let mask = self.find(cell.block()).and_then(|slot| self.hit.get(slot));
        mask.is_some_and(|mask| mask.has(cell.place()))
    }

    /// Blocks from a slot on, each with its hit cells; slot 0 has none.
    pub(super) fn blocks_from(&self, slot: usize) -> impl Iterator<Item = (u64, &Mask)> {
        let blocks = self.blocks.iter().zip(&self.hit).skip(slot);
        blocks.map(|(block, hit)| (*block, hit))
    }

    fn find(&self, block: u64) -> Option<usize> {
        let mask = self.table.len() - 1;
        let mut at = spread(block, self.multiplier, self.bits);
        loop {
            let entry = self.table.get(at)?;
            if entry.stamp != self.stamp {
                return None;
            }
            if entry.block == block {
                return Some(entry.slot as usize);
            }
            at = (at + 1) & mask;
        }
    }

    /// Slot of a block, created if missing. Kept out of the inner loop, which is compiled into its caller then.
    #[inline(never)]
    pub(super) fn enter(&mut self, block: u64) -> Cursor {
        let mask = self.table.len() - 1;
        let mut at = spread(block, self.multiplier, self.bits);
        while let Some(entry) = self.table.get(at) {
            if entry.stamp != self.stamp {
                break;
            }
            if entry.block == block {
                let slot = entry.slot as usize;
                return Cursor { block, slot };
            }
            at = (at + 1) & mask;
        }
        self.add(block, at)
    }

    #[inline(never)]
    fn add(&mut self, block: u64, at: usize) -> Cursor {
        let slot = self.blocks.len();
        if slot > self.most {
            self.entries_refused += 1;
            return Cursor { block, slot: 0 };
        }
        self.blocks.push(block);
        self.passed.push(Mask::default());
        self.hit.push(Mask::default());
        if let Some(entry) = self.table.get_mut(at) {
            *entry = Entry {
                block,
                slot: slot as u32,
                stamp: self.stamp,
            };
        }
        if self.blocks.len() * 2 > self.table.len() {
            self.grow();
        }
        Cursor { block, slot }
    }

    fn grow(&mut self) {
        self.bits += 1;
        let mask = (1 << self.bits) - 1;
        self.table.clear();
        self.table.resize(mask + 1, Entry::default());
        for (slot, &block) in self.blocks.iter().enumerate().skip(1) {
            let mut at = spread(block, self.multiplier, self.bits);
            while self.table.get(at).is_some_and(|e| e.stamp == self.stamp) {
                at = (at + 1) & mask;
            }
            if let Some(entry) = self.table.get_mut(at) {
                *entry = Entry {
                    block,
                    slot: slot as u32,
                    stamp: self.stamp,
                };
            }
        }
    }
}
