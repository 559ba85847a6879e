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

/// Entry of a table of blocks.
#[derive(Clone, Copy, Debug, Default)]
struct Entry {
    /// Block, with the stamp of a scan in place of a position; the entry is empty if the stamp differs.
    tag: u64,
    slot: u32,
}

/// Blocks of one scan; cleared in constant time.
///
/// A cell's block is looked up at each step of a ray: a branch for "still in the same block" could not be predicted.
#[derive(Clone, Debug)]
pub(super) struct ScanMasks {
    /// Open addressing, at most a quarter full, so that the first place is nearly always the right one.
    table: Vec<Entry>,
    /// 64 less the bits of a place in the table.
    shift: u32,
    multiplier: u64,
    /// Position in a block, packed; never 0.
    stamp: Packed,
    /// Masks by slot; slot 0 collects the cells of refused blocks.
    blocks: Vec<u64>,
    passed: Vec<Mask>,
    hit: Vec<Mask>,
    most: usize,
    refusals: u64,
}

impl ScanMasks {
    pub(super) fn new(most: usize) -> ScanMasks {
        ScanMasks {
            table: vec![Entry::default(); 1 << 8],
            shift: 64 - 8,
            multiplier: random_multiplier(),
            stamp: Packed::at(0, 1),
            blocks: vec![1],
            passed: vec![Mask::default()],
            hit: vec![Mask::default()],
            most: most.min(u32::MAX as usize - 1),
            refusals: 0,
        }
    }

    /// Maximum memory per block, bytes: twice masks and block for the growth of vectors, and a table at least an eighth
    /// full.
    pub(super) const BYTES_PER_BLOCK: usize =
        2 * (2 * size_of::<Mask>() + 8) + 8 * size_of::<Entry>();

    pub(super) fn bytes(&self) -> usize {
        self.table.capacity() * size_of::<Entry>()
            + (self.passed.capacity() + self.hit.capacity()) * size_of::<Mask>()
            + self.blocks.capacity() * 8
    }

    pub(super) fn clear(&mut self) {
        self.blocks.truncate(1);
        self.passed.truncate(1);
        self.hit.truncate(1);
        self.refusals = 0;
        self.stamp = Packed::at(0, (self.stamp.place() + 1) & 0o777);
        if self.stamp.place() == 0 {
            self.table.fill(Entry::default());
            self.stamp = Packed::at(0, 1);
        }
    }

    /// Number of cells of rays and ends in blocks refused for lack of memory.
    pub(super) fn refusals(&self) -> u64 {
        self.refusals
    }

    /// Every block with its traversed and its hit cells.
    pub(super) fn blocks(&self) -> impl Iterator<Item = (u64, &Mask, &Mask)> + Clone {
        let masks = self.passed.iter().zip(&self.hit);
        let blocks = self.blocks.iter().zip(masks).skip(1);
        blocks.map(|(block, (passed, hit))| (*block, passed, hit))
    }

    /// Marks a cell as traversed; returns the slot of its block, and its place there.
    #[inline(always)]
    pub(super) fn pass(&mut self, cell: Packed) -> (usize, usize) {
        let (slot, place) = (self.slot_of(cell), cell.place());
        if let Some(mask) = self.passed.get_mut(slot) {
            mask.set(place);
        }
        (slot, place)
    }

    /// Takes the mark of a traversed cell back.
    pub(super) fn spare(&mut self, cell: Packed) {
        let slot = self.find(cell).ok();
        if let Some(mask) = slot.and_then(|slot| self.passed.get_mut(slot)) {
            mask.remove(cell.place());
        }
    }

    /// Marks a cell as hit; true if it was not yet, or if its block is refused.
    #[inline]
    pub(super) fn hit(&mut self, cell: Packed) -> bool {
        let slot = self.slot_of(cell);
        let new = self.hit.get_mut(slot);
        new.is_some_and(|mask| mask.set(cell.place())) || slot == 0
    }

    pub(super) fn is_hit(&self, cell: Packed) -> bool {
        let mask = self.find(cell).ok().and_then(|slot| self.hit.get(slot));
        mask.is_some_and(|mask| mask.has(cell.place()))
    }

    /// Hit cells of a block.
    pub(super) fn hits_of(&self, block: u64) -> Mask {
        let slot = self.find(Packed(block)).ok();
        let hits = slot.and_then(|slot| self.hit.get(slot));
        hits.copied().unwrap_or_default()
    }

    /// Blocks from a slot on; that of slot 0 is none.
    pub(super) fn blocks_from(&self, slot: usize) -> &[u64] {
        self.blocks.get(slot..).unwrap_or_default()
    }

    /// Marks the traversed cells of other masks as well.
    pub(super) fn unite(&mut self, other: &ScanMasks) {
        for (block, passed, _) in other.blocks() {
            let slot = self.slot_of(Packed(block));
            if let Some(mask) = self.passed.get_mut(slot) {
                *mask = mask.or(passed);
            }
        }
    }

    fn tag(&self, block: u64) -> u64 {
        block | self.stamp.0
    }

    /// First place of a block in the table.
    #[inline(always)]
    fn place(&self, tag: u64) -> usize {
        // Folded, since neighbouring blocks differ in few bits, which some multipliers bring to the same places.
        let folded = tag ^ tag >> 32;
        (folded.wrapping_mul(self.multiplier) >> self.shift) as usize
    }

    /// Slot of the block of a cell, or the place in the table where it is missing.
    #[inline(always)]
    fn find(&self, cell: Packed) -> Result<usize, usize> {
        let tag = self.tag(cell.block());
        let mut at = self.place(tag);
        while let Some(entry) = self.table.get(at) {
            if entry.tag == tag {
                return Ok(entry.slot as usize);
            }
            if !self.is_taken(entry) {
                break;
            }
            at = (at + 1) & (self.table.len() - 1);
        }
        Err(at)
    }

    fn is_taken(&self, entry: &Entry) -> bool {
        Packed(entry.tag).place() == self.stamp.place()
    }

    /// Slot of the block of a cell, created if missing; 0 if it is refused.
    #[inline(always)]
    pub(super) fn slot_of(&mut self, cell: Packed) -> usize {
        match self.find(cell) {
            Ok(slot) => slot,
            Err(at) => self.add(cell.block(), at),
        }
    }

    #[inline(never)]
    fn add(&mut self, block: u64, at: usize) -> usize {
        let slot = self.blocks.len();
        if slot > self.most {
            self.refusals += 1;
            return 0;
        }
        self.blocks.push(block);
        self.passed.push(Mask::default());
        self.hit.push(Mask::default());
        let tag = self.tag(block);
        if let Some(entry) = self.table.get_mut(at) {
            let slot = slot as u32;
            *entry = Entry { tag, slot };
        }
        if self.blocks.len() * 4 > self.table.len() {
            self.grow();
        }
        slot
    }

    fn grow(&mut self) {
        self.shift -= 1;
        let places = 2 * self.table.len();
        self.table.clear();
        self.table.resize(places, Entry::default());
        for (slot, &block) in (0..).zip(&self.blocks).skip(1) {
            let tag = self.tag(block);
            let mut at = self.place(tag);
            while self.table.get(at).is_some_and(|entry| entry.tag != 0) {
                at = (at + 1) & (places - 1);
            }
            if let Some(entry) = self.table.get_mut(at) {
                *entry = Entry { tag, slot };
            }
        }
    }
}
