//! Log-odds of cells, in blocks of 8 x 8 x 8 lattice indices.

use super::evidence::{Steps, UNKNOWN};
use super::masks::{Mask, ScanMasks};
use super::packed::Packed;
use crate::voxels::store::block_mask::bits;
use crate::voxels::store::hash_table::{Row, Table};

pub(super) const CELLS: usize = 512;
/// Number of blocks allocated at once.
const PAGE: usize = 64;
/// Slot of a missing block.
const NONE: u32 = u32::MAX;

/// Packed index of the first cell of a block.
#[derive(Clone, Copy)]
struct Block(u64);

impl Row for Block {
    #[inline(always)]
    fn code(&self) -> u64 {
        self.0
    }
}

/// Log-odds of cells, looked up by block.
#[derive(Clone)]
pub(super) struct Blocks {
    table: Table<Block>,
    pages: Vec<Box<[[i8; CELLS]]>>,
    most: usize,
    /// Slots of the blocks of a scan; kept to save the allocation.
    slots: Vec<u32>,
}

impl Blocks {
    /// Maximum memory per block, bytes: cells, row, and twice the slot of a scan for the growth of vectors.
    pub(super) const BYTES_PER_BLOCK: usize = CELLS + Table::<Block>::ROW_BYTES + 2 * 4;

    pub(super) fn new(most: usize) -> Blocks {
        Blocks {
            table: Table::new(),
            pages: Vec::new(),
            // Whole pages, so that the last one is full.
            most: (most / PAGE * PAGE).min(NONE as usize),
            slots: Vec::new(),
        }
    }

    pub(super) fn bytes(&self) -> usize {
        self.table.bytes()
            + self.slots.capacity() * size_of::<u32>()
            + self.pages.capacity() * size_of::<Box<[[i8; CELLS]]>>()
            + self.pages.len() * PAGE * CELLS
    }

    /// Cells of a block; `None` if the block is unknown.
    pub(super) fn block(&self, block: u64) -> Option<&[i8; CELLS]> {
        self.cells(self.table.find(block)?)
    }

    pub(super) fn known(&self) -> impl Iterator<Item = (Packed, i8)> {
        (0..)
            .zip(self.table.rows())
            .flat_map(|(slot, &Block(block))| {
                let cells = self.cells(slot).into_iter().flatten().enumerate();
                cells
                    .filter(|(_, value)| **value != UNKNOWN)
                    .map(move |(place, value)| (Packed::at(block, place), *value))
            })
    }

    fn cells(&self, slot: u32) -> Option<&[i8; CELLS]> {
        let slot = slot as usize;
        self.pages.get(slot / PAGE)?.get(slot % PAGE)
    }

    fn cells_mut(&mut self, slot: u32) -> Option<&mut [i8; CELLS]> {
        let slot = slot as usize;
        self.pages.get_mut(slot / PAGE)?.get_mut(slot % PAGE)
    }

    /// Adds a missing block, within the limit.
    fn add(&mut self, block: u64) -> u32 {
        let slot = self.table.len() as u32;
        let _ = self.table.find_or_add(block, self.most, || Block(block));
        if self.pages.len() * PAGE < self.table.len() {
            self.pages
                .push(vec![[UNKNOWN; CELLS]; PAGE].into_boxed_slice());
        }
        slot
    }

    /// Calls `update` with the cells of each block and its masks.
    ///
    /// Missing blocks are added if `wanted`. Beyond the limit, those with the lowest indices are added; the number of
    /// refused ones is returned.
    pub(super) fn apply<'a>(
        &mut self,
        scan: impl Iterator<Item = (u64, &'a Mask, &'a Mask)> + Clone,
        wanted: impl Fn(&Mask, &Mask) -> bool,
        mut update: impl FnMut(&mut [i8; CELLS], &Mask, &Mask),
    ) -> u64 {
        // All lookups come first: they are independent, so their cache misses overlap.
        let mut slots = std::mem::take(&mut self.slots);
        slots.clear();
        let slot = |block: u64| self.table.find(block).unwrap_or(NONE);
        slots.extend(scan.clone().map(|(block, ..)| slot(block)));
        let room = self.most.saturating_sub(self.table.len());
        let wanted_new = scan
            .clone()
            .zip(&slots)
            .filter(|((_, passed, hit), slot)| **slot == NONE && wanted(passed, hit))
            .map(|((block, ..), _)| block);
        let new = wanted_new.clone().count();
        let mut last = u64::MAX;
        if new > room {
            let mut blocks: Vec<u64> = wanted_new.collect();
            blocks.sort_unstable();
            last = room
                .checked_sub(1)
                .and_then(|i| blocks.get(i))
                .map_or(0, |b| *b);
        }
        let full = room == 0;
        for ((block, passed, hit), slot) in scan.zip(&slots) {
            let mut slot = *slot;
            if slot == NONE && wanted(passed, hit) && block <= last && !full {
                slot = self.add(block);
            }
            if let Some(cells) = self.cells_mut(slot) {
                update(cells, passed, hit);
            }
        }
        self.slots = slots;
        new.saturating_sub(room) as u64
    }
}

/// Adds one hit to each cell that a scan hit, and one miss to each other traversed cell that was hit before: for maps
/// without free cells. Returns the number of refused blocks.
pub(super) fn apply_to_hit(steps: &Steps, scan: &ScanMasks, cells: &mut Blocks) -> u64 {
    cells.apply(
        scan.blocks(),
        |_, hit| *hit != Mask::default(),
        |cells, passed, hit| {
            let mut known = Mask::default();
            for (i, value) in cells.iter().enumerate() {
                known.0[i >> 6] |= u64::from(*value != UNKNOWN) << (i & 63);
            }
            for (known, passed) in known.0.iter_mut().zip(&passed.0) {
                *known &= passed;
            }
            add_evidence(steps, cells, &known, hit);
        },
    )
}

/// Adds one hit to each cell that was hit, one miss to each other traversed cell.
#[inline]
pub(super) fn add_evidence(steps: &Steps, cells: &mut [i8; CELLS], passed: &Mask, hit: &Mask) {
    for (word, (&passed, &hit)) in passed.0.iter().zip(&hit.0).enumerate() {
        let Some(cells) = cells.get_mut(64 * word..64 * word + 64) else {
            return;
        };
        bits(passed & !hit).for_each(|i| steps.miss(&mut cells[i]));
        bits(hit).for_each(|i| steps.hit(&mut cells[i]));
    }
}
