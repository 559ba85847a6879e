//! Occupancy list: a store of one bit per voxel.

use std::fmt;

use nalgebra::Vector3;
use rayon::prelude::*;

use recent_cells::Recent;

use super::region::{CellsInside, Region};
use super::store::block_mask::{self, BlockMask};
use super::store::hash_table::{Place, Row, Table};
use super::{DatumError, InsertReport, VoxelStore};
use crate::cloud::Cloud;
use crate::lattice::{BlockKey, Lattice, LatticeIndex, MortonKey};

/// Maximum memory per block, including the growth of the vectors and of the table.
const BLOCK_BYTES: usize = Table::<Block>::ROW_BYTES;
/// Maximum memory besides blocks.
const FIRST_BYTES: usize = Table::<Block>::FIRST_BYTES + Recent::BYTES;

impl Row for Block {
    #[inline(always)]
    fn code(&self) -> u64 {
        self.code
    }
}

impl OccupancyList {
    /// Creates an empty list of at most `max_bytes`, with the datum at the lattice point nearest to `datum_near_m`
    /// (map frame, metres).
    pub fn new(
        lattice: Lattice,
        datum_near_m: Vector3<f64>,
        max_bytes: usize,
    ) -> Result<OccupancyList, DatumError> {
        let index = lattice.quantize_wide(&datum_near_m);
        let [x, y, z] = datum_near_m.into();
        let datum_index = index.ok_or(DatumError { x, y, z })?;
        Ok(Self::at_datum(lattice, datum_index, max_bytes))
    }

    /// Creates an empty list of at most `max_bytes`, with its datum at a lattice point.
    pub fn at_datum(lattice: Lattice, datum_index: [i64; 3], max_bytes: usize) -> OccupancyList {
        OccupancyList {
            datum_m: lattice.center_wide(datum_index),
            lattice,
            datum_index,
            max_blocks: max_bytes.saturating_sub(FIRST_BYTES) / BLOCK_BYTES,
            blocks: Table::new(),
            len: 0,
            recent: Recent::new(),
        }
    }

    /// Creates a list of the cells that fit into `max_bytes`; fast for sorted keys, which are added by block.
    pub fn from_keys(
        lattice: Lattice,
        datum_index: [i64; 3],
        keys: impl IntoIterator<Item = MortonKey>,
        max_bytes: usize,
    ) -> OccupancyList {
        let mut list = Self::at_datum(lattice, datum_index, max_bytes);
        let (mut block, mut leaf) = (u64::MAX, [0; 8]);
        for key in keys {
            let its_block = key.raw() >> 9;
            if its_block != block {
                list.add_block(block, &leaf);
                (block, leaf) = (its_block, [0; 8]);
            }
            block_mask::set(&mut leaf, key);
        }
        list.add_block(block, &leaf);
        list
    }

    /// Adds the cells of a block, given by the bits of their keys; no effect if the list is full.
    fn add_block(&mut self, morton: u64, leaf: &BlockMask) {
        let Some(first) = morton.checked_mul(512).and_then(MortonKey::from_raw) else {
            return;
        };
        let code = BlockKey::from(first).block();
        let empty = || Block { code, leaf: [0; 8] };
        let place = self.blocks.find_or_add(code, self.max_blocks, empty);
        let Some(Place::Known(number) | Place::New(number)) = place else {
            return;
        };
        for (to, from) in (self.blocks.row_mut(number).into_iter())
            .flat_map(|row| &mut row.leaf)
            .zip(leaf)
        {
            self.len += (from & !*to).count_ones() as usize;
            *to |= from;
        }
    }

    /// Maximum number of voxels of a list of `max_bytes`, if all blocks are full.
    pub fn max_voxels_within(max_bytes: usize) -> usize {
        (max_bytes.saturating_sub(FIRST_BYTES) / BLOCK_BYTES).saturating_mul(BlockKey::BLOCK_CELLS)
    }

    /// Memory limit, bytes.
    pub fn max_bytes(&self) -> usize {
        self.max_blocks
            .saturating_mul(BLOCK_BYTES)
            .saturating_add(FIRST_BYTES)
    }

    /// Marks a cell as occupied; false if the list is full.
    pub fn add(&mut self, key: MortonKey) -> bool {
        self.set(BlockKey::from(key), &mut Last::default())
    }

    /// Removes all voxels; keeps lattice, datum and limit.
    pub fn clear(&mut self) {
        self.blocks.clear();
        self.len = 0;
        self.recent.forget_all();
    }

    /// Sets the bit of a cell; false if its block is new and the list is full.
    #[inline(always)]
    fn set(&mut self, code: BlockKey, last: &mut Last) -> bool {
        let block = code.block();
        let number = if block == last.block {
            last.number
        } else {
            let empty = || Block {
                code: block,
                leaf: [0; 8],
            };
            match self.blocks.find_or_add(block, self.max_blocks, empty) {
                Some(Place::Known(number) | Place::New(number)) => number,
                None => return false,
            }
        };
        *last = Last { block, number };
        let row = self.blocks.row_mut(number);
        if let Some(word) = row.and_then(|row| row.leaf.get_mut(code.place() >> 6)) {
            let bit = 1 << (code.place() & 63);
            self.len += usize::from(*word & bit == 0);
            *word |= bit;
        }
        true
    }

    /// Validates all invariants; returns the first violation.
    pub fn validate(&self) -> Result<(), String> {
        self.blocks.validate()?;
        let bits = |block: &Block| {
            block
                .leaf
                .iter()
                .map(|w| w.count_ones() as usize)
                .sum::<usize>()
        };
        if self.blocks.rows().iter().any(|block| bits(block) == 0) {
            return Err("a block has no cells".to_owned());
        }
        let counted: usize = self.blocks.rows().iter().map(bits).sum();
        if counted != self.len {
            return Err(format!("{counted} cells are set, {} counted", self.len));
        }
        if self.blocks.len() > self.max_blocks {
            return Err(format!(
                "{} blocks, {} allowed",
                self.blocks.len(),
                self.max_blocks
            ));
        }
        self.recent.validate(|code| self.has(code))
    }

    pub(super) fn has(&self, code: BlockKey) -> bool {
        let number = self.blocks.find(code.block());
        let block = number.and_then(|number| self.blocks.rows().get(number as usize));
        block.is_some_and(|block| block_mask::is_set(&block.leaf, code.place()))
    }
}

impl VoxelStore for OccupancyList {
    fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    fn datum_index(&self) -> [i64; 3] {
        self.datum_index
    }

    fn datum_m(&self) -> Vector3<f64> {
        self.datum_m
    }

    fn len(&self) -> usize {
        self.len
    }

    fn contains(&self, key: MortonKey) -> bool {
        self.has(BlockKey::from(key))
    }

    #[inline]
    fn holds(&self, w: LatticeIndex) -> bool {
        BlockKey::pack(w).is_some_and(|code| self.has(code))
    }

    fn block_mask(&self, block: u64) -> BlockMask {
        let number = self.blocks.find(block);
        let block = number.and_then(|number| self.blocks.rows().get(number as usize));
        block.map_or([0; 8], |block| block.leaf)
    }

    fn sorted_keys(&self) -> Vec<MortonKey> {
        let blocks = self.blocks.rows().iter();
        block_mask::sorted_keys(blocks.map(|block| (block.code, &block.leaf)), self.len)
    }

    /// The result does not depend on the number of threads of the current rayon pool.
    fn insert(&mut self, cloud: &Cloud) -> InsertReport {
        self.insert_cloud(cloud)
    }

    fn remove(&mut self, key: MortonKey) -> bool {
        let code = BlockKey::from(key);
        let Some(number) = self.blocks.find(code.block()) else {
            return false;
        };
        let Some(block) = self.blocks.row_mut(number) else {
            return false;
        };
        if !block_mask::is_set(&block.leaf, code.place()) {
            return false;
        }
        if let Some(word) = block.leaf.get_mut(code.place() >> 6) {
            *word &= !(1 << (code.place() & 63));
        }
        if block.leaf == [0; 8] {
            self.blocks.remove(code.block());
        }
        self.recent.forget(code);
        self.len -= 1;
        true
    }

    fn keys_in(&self, region: &Region) -> Vec<MortonKey> {
        let inside = CellsInside::new(region, &self.lattice, self.datum_m);
        let of_block = |block: &Block| inside.of_block(block.code, &block.leaf);
        let cells = self.blocks.rows().par_iter().flat_map_iter(of_block);
        cells.filter_map(BlockKey::key).collect()
    }

    fn bytes(&self) -> usize {
        self.blocks.bytes() + Recent::BYTES
    }
}

impl fmt::Debug for OccupancyList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let datum: [f64; 3] = self.datum_m.into();
        write!(
            f,
            "OccupancyList({:?}, datum {datum:?} m, {} voxels)",
            self.lattice, self.len
        )
    }
}

mod insert;
mod last_block;
mod neighbors;
mod overlap;
mod recent_cells;
mod state;
use last_block::Last;
pub(super) use state::Block;
pub use state::OccupancyList;
#[cfg(test)]
mod tests;
