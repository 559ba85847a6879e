//! Part of a voxel list that one thread fills.

use rustc_hash::{FxHashMap, FxHashSet};

use super::block_mask::BlockMask;
use super::cell_table::CellTable;
pub(crate) use super::entry::{Entry, Life};
use super::fixed_point::{Offsets, Point, most_points, offsets_of, points_of, voxel_of};
use super::hash_table::Place;
use super::payload_columns::Columns;
use super::point_gather::Partial;
use super::touched::Touched;
use super::wide_sums::WideSums;
use crate::lattice::{BlockKey, Lattice};
use crate::voxels::Voxel;

/// Number of shards of a list.
pub(crate) const SHARDS: usize = 16;

/// Number of cells searched together.
pub(crate) const BATCH: usize = 128;

/// Voxels of some blocks, in insertion order.
#[derive(Clone)]
pub(crate) struct Shard {
    pub(crate) voxels: CellTable,
    pub(crate) columns: Columns,
    lattice: Lattice,
    most_points: u32,
    wide: WideSums,
    pub(crate) touched: Touched,
    /// Removed voxels: states in which they were added and removed.
    pub(crate) removed: FxHashMap<u64, Life>,
}

/// Shard index of a cell; all cells of a block belong to one.
#[inline(always)]
pub(crate) fn shard_of(code: BlockKey) -> usize {
    (code.block().wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 60) as usize
}

impl Shard {
    /// Maximum bytes per voxel, including its columns and its record after removal.
    pub(crate) const VOXEL_BYTES: usize =
        CellTable::VOXEL_BYTES + WideSums::ROW_BYTES + Touched::VOXEL_BYTES;
    /// Maximum bytes besides voxels.
    pub(crate) const FIRST_BYTES: usize =
        CellTable::FIRST_BYTES + WideSums::FIRST_BYTES + Touched::FIRST_BYTES;

    pub(crate) fn new(lattice: &Lattice, columns: Columns) -> Shard {
        Shard {
            voxels: CellTable::new(),
            columns,
            lattice: lattice.clone(),
            most_points: most_points(lattice),
            wide: WideSums::new(),
            touched: Touched::default(),
            removed: FxHashMap::default(),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.voxels.len()
    }

    pub(crate) fn bytes(&self) -> usize {
        self.voxels.bytes()
            + self.columns.bytes()
            + self.wide.bytes()
            + self.touched.bytes()
            + self.removed.capacity() * (size_of::<(u64, Life)>() + 1)
    }

    /// Voxel of a cell, with its index.
    #[inline]
    pub(crate) fn get(&self, code: BlockKey) -> Option<(u32, &Entry)> {
        let number = self.voxels.find(code)?;
        Some((number, self.voxels.rows().get(number as usize)?))
    }

    /// Occupied cells of a block.
    pub(crate) fn block_mask(&self, block: u64) -> BlockMask {
        self.voxels.block_mask(block)
    }

    /// Index of a cell, added as a voxel if there are fewer than `limit`.
    #[inline(always)]
    pub(crate) fn find_or_add(&mut self, code: BlockKey, limit: usize, now: u32) -> Option<u32> {
        let empty = || Entry {
            code: code.raw(),
            points: Point::ZERO,
            life: Life {
                born: now,
                touched: now,
            },
        };
        match self.voxels.find_or_add(code, limit, empty)? {
            Place::Known(number) => Some(number),
            Place::New(number) => {
                if !self.columns.payload().is_plain() {
                    self.columns.push();
                }
                self.remember(code.raw(), number);
                self.touched.list(number, self.voxels.len());
                Some(number)
            }
        }
    }

    /// Cancels the removal of a voxel that reappears, for consumers that still have it.
    #[inline]
    fn remember(&mut self, code: u64, number: u32) {
        if self.removed.is_empty() {
            return;
        }
        if let Some(before) = self.removed.remove(&code)
            && let Some(entry) = self.voxels.row_mut(number)
        {
            entry.life.born = before.born;
        }
    }

    /// Adds up to [`most_points`] to a voxel.
    #[inline(always)]
    pub(crate) fn add(&mut self, number: u32, points: &Point, now: u32) {
        let voxels = self.voxels.len();
        let Some(entry) = self.voxels.row_mut(number) else {
            return;
        };
        self.touched.note(number, entry.life.touched, voxels);
        entry.life.touched = now;
        if entry.count().saturating_add(points.as_array()[3]) > self.most_points {
            self.add_wide(number, |lattice, code| offsets_of(lattice, code, points));
            return;
        }
        entry.points += *points;
    }

    /// Adds any number of points to a voxel.
    pub(crate) fn add_offsets(&mut self, number: u32, offsets: &Offsets, now: u32) {
        let voxels = self.voxels.len();
        match self.voxels.row_mut(number) {
            Some(entry) if offsets[3] <= i64::from(self.most_points) => {
                let code = BlockKey::from_raw(entry.code).unwrap_or(BlockKey::NONE);
                self.add(number, &points_of(&self.lattice, code, offsets), now);
            }
            Some(entry) => {
                self.touched.note(number, entry.life.touched, voxels);
                entry.life.touched = now;
                self.add_wide(number, |_, _| *offsets);
            }
            None => {}
        }
    }

    #[cold]
    fn add_wide(&mut self, number: u32, more: impl FnOnce(&Lattice, BlockKey) -> Offsets) {
        let Some(entry) = self.voxels.row_mut(number) else {
            return;
        };
        let code = BlockKey::from_raw(entry.code).unwrap_or(BlockKey::NONE);
        let wide = if entry.count() <= self.most_points {
            self.wide
                .put(offsets_of(&self.lattice, code, &entry.points))
        } else {
            entry.wide()
        };
        let count = self.wide.add(wide, &more(&self.lattice, code));
        let count = u32::try_from(count).unwrap_or(u32::MAX);
        entry.points = Point::new([wide, 0, 0, count]);
    }

    /// Offset sums of the points of a voxel.
    #[inline]
    pub(crate) fn offsets(&self, code: BlockKey, entry: &Entry) -> Offsets {
        if entry.count() <= self.most_points {
            offsets_of(&self.lattice, code, &entry.points)
        } else {
            self.wide.get(entry.wide())
        }
    }

    /// Public form of a voxel.
    #[inline]
    pub(crate) fn voxel(&self, code: BlockKey, entry: &Entry) -> Voxel {
        voxel_of(self.offsets(code, entry))
    }

    /// Adds the gathered points of cells of this shard in stages, so that the cache misses of one stage overlap.
    pub(crate) fn add_batch(&mut self, batch: &[Partial], now: u32) {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("popcnt") {
            // SAFETY: the instruction was detected.
            #[allow(unsafe_code)]
            return unsafe { self.add_batch_popcnt(batch, now) };
        }
        self.add_batch_anywhere(batch, now);
    }

    /// Compiled with an instruction that counts bits, for the ranks of voxels in their blocks.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "popcnt")]
    fn add_batch_popcnt(&mut self, batch: &[Partial], now: u32) {
        self.add_batch_anywhere(batch, now);
    }

    #[inline(always)]
    fn add_batch_anywhere(&mut self, batch: &[Partial], now: u32) {
        for partial in batch {
            self.voxels.prefetch_block(partial.code);
        }
        let mut places = [None; BATCH];
        for (place, partial) in places.iter_mut().zip(batch) {
            *place = self.voxels.block_of(partial.code);
        }
        // From the indices of blocks to those of voxels.
        for (place, partial) in places.iter_mut().zip(batch) {
            let known = place.and_then(|block| self.voxels.find_in(block, partial.code));
            *place = match known {
                Some(number) => Some(number),
                None => self.find_or_add(partial.code, usize::MAX, now),
            };
        }
        for (place, partial) in places.iter().zip(batch) {
            if let Some(number) = *place {
                self.add(number, &partial.points, now);
            }
        }
    }

    /// Removes a voxel; false if it does not exist.
    pub(crate) fn remove(&mut self, code: BlockKey, now: u32) -> bool {
        let Some((number, entry)) = self.voxels.remove(code) else {
            return false;
        };
        if entry.count() > self.most_points {
            self.wide.free(entry.wide());
        }
        self.columns.swap_remove(number as usize);
        // The last voxel has this index now.
        let moved = self.voxels.rows().get(number as usize);
        if moved.is_some_and(|moved| self.touched.is_new(moved.life.touched)) {
            self.touched.list(number, self.voxels.len());
        }
        self.removed.insert(code.raw(), entry.life.ended(now));
        true
    }

    /// Removes all voxels.
    pub(crate) fn clear(&mut self, now: u32) {
        for entry in self.voxels.rows() {
            self.removed.insert(entry.code, entry.life.ended(now));
        }
        self.voxels.clear();
        self.wide.clear();
        self.columns.clear();
    }

    /// Cells that changed since the changes were last taken, in no order, some more than once.
    pub(crate) fn changed(&self) -> Vec<BlockKey> {
        let rows = self.voxels.rows();
        let is_changed = |entry: &&Entry| self.touched.is_new(entry.life.touched);
        let code = |entry: &Entry| BlockKey::from_raw(entry.code);
        match self.touched.numbers() {
            Some(numbers) => {
                let listed = numbers.iter().filter_map(|i| rows.get(*i as usize));
                listed.filter(is_changed).filter_map(code).collect()
            }
            None => rows.iter().filter(is_changed).filter_map(code).collect(),
        }
    }

    /// Every voxel with its cell.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (BlockKey, &Entry)> {
        let rows = self.voxels.rows().iter();
        rows.filter_map(|entry| Some((BlockKey::from_raw(entry.code)?, entry)))
    }

    pub(crate) fn validate(&self) -> Result<(), String> {
        self.voxels.validate()?;
        if !self.columns.fits(self.len()) {
            return Err("the columns of a shard differ in length".to_owned());
        }
        let rows = || self.voxels.rows().iter();
        if let Some(listed) = self.touched.numbers() {
            let listed: FxHashSet<u32> = listed.iter().copied().collect();
            let mut numbered = (0..).zip(rows());
            if numbered.any(|(i, e)| self.touched.is_new(e.life.touched) && !listed.contains(&i)) {
                return Err("a changed voxel is not listed".to_owned());
            }
        }
        let is_wide = |entry: &&Entry| entry.count() > self.most_points;
        if rows().filter(is_wide).count() != self.wide.used() {
            return Err("sums of many points are lost or belong to no voxel".to_owned());
        }
        if rows().any(|entry| entry.life.born > entry.life.touched) {
            return Err("a voxel changed before it came".to_owned());
        }
        match rows().find(|entry| self.removed.contains_key(&entry.code)) {
            Some(entry) => Err(format!("removed voxel {:#x} is in the list", entry.code)),
            None => Ok(()),
        }
    }
}
