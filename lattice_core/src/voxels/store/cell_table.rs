//! Table of voxels, looked up by block.

use super::block_mask::{self, BlockMask};
use super::entry::Entry;
use super::growth;
use super::hash_table::{Place, Row, Table};
use crate::lattice::BlockKey;
use crate::prefetch::prefetch;

/// Initial voxel capacity of a block.
const FIRST_NUMBERS: usize = 8;

/// Voxels of a block.
#[derive(Clone)]
struct Block {
    code: u64,
    /// One bit per cell, by position.
    leaf: BlockMask,
    /// Number of voxels before each word of the mask.
    before: [u16; 8],
    /// Indices of the voxels, by position.
    numbers: Vec<u32>,
}

impl Row for Block {
    #[inline(always)]
    fn code(&self) -> u64 {
        self.code
    }
}

impl Block {
    fn new(code: u64) -> Block {
        Block {
            code,
            leaf: [0; 8],
            before: [0; 8],
            numbers: Vec::new(),
        }
    }

    /// Occupancy of a position, and its rank among the occupied ones.
    #[inline(always)]
    fn rank(&self, place: usize) -> (bool, usize) {
        let (word, bit) = (place >> 6 & 7, place & 63);
        let below = self.leaf[word] & ((1 << bit) - 1);
        let rank = usize::from(self.before[word]) + below.count_ones() as usize;
        (self.leaf[word] >> bit & 1 != 0, rank)
    }

    #[inline(always)]
    fn find(&self, place: usize) -> Option<u32> {
        let (taken, rank) = self.rank(place);
        if taken {
            self.numbers.get(rank).copied()
        } else {
            None
        }
    }

    fn insert(&mut self, place: usize, number: u32) {
        let (_, rank) = self.rank(place);
        if self.numbers.len() == self.numbers.capacity() {
            self.numbers
                .reserve_exact(self.numbers.len().max(FIRST_NUMBERS));
        }
        self.numbers.insert(rank, number);
        self.leaf[place >> 6 & 7] |= 1 << (place & 63);
        for before in self.before.iter_mut().skip((place >> 6 & 7) + 1) {
            *before += 1;
        }
    }

    fn remove(&mut self, place: usize) -> Option<u32> {
        let (taken, rank) = self.rank(place);
        if !taken {
            return None;
        }
        self.leaf[place >> 6 & 7] &= !(1 << (place & 63));
        for before in self.before.iter_mut().skip((place >> 6 & 7) + 1) {
            *before -= 1;
        }
        Some(self.numbers.remove(rank))
    }
}

/// Voxels in insertion order, looked up by their codes.
///
/// A scan fills few blocks repeatedly: they stay in the cache for any size of the map. A hash table over all cells
/// would access a distant cache line for each.
pub(crate) struct CellTable {
    blocks: Table<Block>,
    rows: Vec<Entry>,
    /// Bytes of all `Block::numbers`.
    number_bytes: usize,
    /// Block of the last lookup.
    last: (u64, u32),
}

impl Clone for CellTable {
    fn clone(&self) -> CellTable {
        let blocks = self.blocks.clone();
        // Copies of vectors have no spare capacity.
        let capacities = blocks.rows().iter().map(|block| block.numbers.capacity());
        CellTable {
            number_bytes: capacities.sum::<usize>() * size_of::<u32>(),
            blocks,
            rows: self.rows.clone(),
            last: self.last,
        }
    }
}

impl CellTable {
    /// Maximum bytes per voxel: one alone in its block.
    pub(crate) const VOXEL_BYTES: usize = growth::most_bytes::<Entry>()
        + Table::<Block>::ROW_BYTES
        + FIRST_NUMBERS * size_of::<u32>();
    /// Maximum bytes besides voxels.
    pub(crate) const FIRST_BYTES: usize =
        Table::<Block>::FIRST_BYTES + growth::FIRST * size_of::<Entry>();

    pub(crate) fn new() -> CellTable {
        CellTable {
            blocks: Table::new(),
            rows: Vec::new(),
            number_bytes: 0,
            last: (u64::MAX, 0),
        }
    }

    /// Reserves space for more voxels.
    pub(crate) fn reserve(&mut self, voxels: usize) {
        self.rows.reserve_exact(voxels);
    }

    /// Number of voxels.
    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    /// All voxels by index.
    pub(crate) fn rows(&self) -> &[Entry] {
        &self.rows
    }

    /// All voxels by index. Their codes must not change.
    pub(crate) fn rows_mut(&mut self) -> &mut [Entry] {
        &mut self.rows
    }

    /// Voxel of an index.
    #[inline(always)]
    pub(crate) fn row_mut(&mut self, number: u32) -> Option<&mut Entry> {
        self.rows.get_mut(number as usize)
    }

    /// Non-empty blocks, each with one bit per voxel.
    pub(crate) fn blocks(&self) -> impl Iterator<Item = (u64, &BlockMask)> {
        let blocks = self.blocks.rows().iter();
        blocks.map(|block| (block.code, &block.leaf))
    }

    pub(crate) fn bytes(&self) -> usize {
        self.blocks.bytes() + self.number_bytes + self.rows.capacity() * size_of::<Entry>()
    }

    /// Index of a cell.
    #[inline]
    pub(crate) fn find(&self, code: BlockKey) -> Option<u32> {
        let block = self.blocks.find(code.block())?;
        self.blocks.rows().get(block as usize)?.find(code.place())
    }

    /// Cells of a block that have a voxel.
    pub(crate) fn block_mask(&self, block: u64) -> BlockMask {
        let number = self.blocks.find(block);
        let block = number.and_then(|number| self.blocks.rows().get(number as usize));
        block.map_or([0; 8], |block| block.leaf)
    }

    /// Tests whether a cell has a voxel.
    #[inline]
    pub(crate) fn holds(&self, code: BlockKey) -> bool {
        let block = self.blocks.find(code.block());
        let block = block.and_then(|block| self.blocks.rows().get(block as usize));
        block.is_some_and(|block| block_mask::is_set(&block.leaf, code.place()))
    }

    /// Prefetches the block of a cell.
    #[inline(always)]
    pub(crate) fn prefetch_block(&self, code: BlockKey) {
        if let Some(block) = self.blocks.likely(code.block()) {
            prefetch::<2, _>(block);
        }
    }

    /// Block of a cell, for [`CellTable::find_in`]; prefetches the index of its voxel.
    #[inline(always)]
    pub(crate) fn block_of(&self, code: BlockKey) -> Option<u32> {
        let at = self.blocks.find(code.block())?;
        let block = self.blocks.rows().get(at as usize)?;
        let (_, rank) = block.rank(code.place());
        if let Some(number) = block.numbers.get(rank) {
            prefetch::<1, _>(number);
        }
        Some(at)
    }

    /// Index of a cell of a block; prefetches its voxel.
    #[inline(always)]
    pub(crate) fn find_in(&self, block: u32, code: BlockKey) -> Option<u32> {
        let block = self.blocks.rows().get(block as usize)?;
        let number = block.find(code.place())?;
        if let Some(row) = self.rows.get(number as usize) {
            prefetch::<1, _>(row);
        }
        Some(number)
    }

    /// Index of a cell; a row is added if it is new and there are fewer than `limit`.
    #[inline(always)]
    pub(crate) fn find_or_add(
        &mut self,
        code: BlockKey,
        limit: usize,
        row: impl FnOnce() -> Entry,
    ) -> Option<Place> {
        let (last, mut number) = self.last;
        if last != code.block() {
            number = match self.blocks.find(code.block()) {
                Some(number) => number,
                None => return self.add(code, limit, row()),
            };
            self.last = (code.block(), number);
        }
        let block = self.blocks.rows().get(number as usize)?;
        match block.find(code.place()) {
            Some(number) => Some(Place::Known(number)),
            None => self.add(code, limit, row()),
        }
    }

    #[inline(never)]
    fn add(&mut self, code: BlockKey, limit: usize, row: Entry) -> Option<Place> {
        let number = self.rows.len();
        if number >= limit.min(u32::MAX as usize - 1) {
            return None;
        }
        let number = number as u32;
        let empty = || Block::new(code.block());
        let (Place::Known(at) | Place::New(at)) =
            self.blocks.find_or_add(code.block(), usize::MAX, empty)?;
        self.last = (code.block(), at);
        let block = self.blocks.row_mut(at)?;
        let before = block.numbers.capacity();
        block.insert(code.place(), number);
        self.number_bytes += (block.numbers.capacity() - before) * size_of::<u32>();
        growth::push(&mut self.rows, row);
        Some(Place::New(number))
    }

    /// Removes a voxel, and returns its index, now that of the last voxel.
    pub(crate) fn remove(&mut self, code: BlockKey) -> Option<(u32, Entry)> {
        let at = self.blocks.find(code.block())?;
        let block = self.blocks.row_mut(at)?;
        let number = block.remove(code.place())?;
        if block.numbers.is_empty() {
            self.number_bytes -= block.numbers.capacity() * size_of::<u32>();
            self.blocks.remove(code.block());
            self.last = (u64::MAX, 0);
        }
        let entry = self.rows.swap_remove(number as usize);
        if let Some(moved) = self.rows.get(number as usize)
            && let Some(moved) = BlockKey::from_raw(moved.code)
            && let Some(at) = self.blocks.find(moved.block())
            && let Some(block) = self.blocks.row_mut(at)
        {
            let (_, rank) = block.rank(moved.place());
            if let Some(renamed) = block.numbers.get_mut(rank) {
                *renamed = number;
            }
        }
        Some((number, entry))
    }

    pub(crate) fn clear(&mut self) {
        *self = CellTable::new();
    }

    /// Validates that every row is found and nothing else is in the blocks.
    pub(crate) fn validate(&self) -> Result<(), String> {
        self.blocks.validate()?;
        for (number, row) in self.rows.iter().enumerate() {
            let found = BlockKey::from_raw(row.code).and_then(|code| self.find(code));
            if found != Some(number as u32) {
                return Err(format!("cell {:#x} is not found under {number}", row.code));
            }
        }
        let blocks = self.blocks.rows();
        let listed: usize = blocks.iter().map(|block| block.numbers.len()).sum();
        let set = blocks.iter().flat_map(|block| &block.leaf);
        let set: usize = set.map(|word| word.count_ones() as usize).sum();
        let capacities = blocks.iter().map(|block| block.numbers.capacity());
        let bytes = capacities.sum::<usize>() * size_of::<u32>();
        if bytes != self.number_bytes {
            return Err(format!(
                "{} bytes are counted for the blocks, their lists have {bytes}",
                self.number_bytes
            ));
        }
        if listed == self.rows.len() && set == listed {
            Ok(())
        } else {
            Err(format!(
                "blocks list {listed} cells and have {set} bits set, expected {} of each, one per voxel",
                self.rows.len()
            ))
        }
    }
}
