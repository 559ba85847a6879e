//! A part of a voxel list that one thread fills.

use rustc_hash::FxHashMap;

use super::cells::CellTable;
use super::columns::Columns;
use super::gather::Partial;
use super::table::Place;
use crate::lattice::CellCode;

/// Number of parts of a list.
pub(super) const SHARDS: usize = 16;

/// Cells that are searched together.
pub(super) const BATCH: usize = 64;

/// Fixed-point position of a point from the datum, in `OFFSET_UNIT_M`, and 1.
pub(super) type Point = [i64; 4];

/// When a voxel came and when it last changed, as states of the list.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Life {
    pub(super) born: u32,
    pub(super) touched: u32,
}

impl Life {
    fn ended(self, now: u32) -> Life {
        Life {
            born: self.born,
            touched: now,
        }
    }
}

/// A voxel.
#[derive(Clone)]
pub(super) struct Entry {
    pub(super) code: u64,
    /// Sums of positions and the count. They wrap, which differences to a cell centre undo.
    pub(super) points: Point,
    pub(super) life: Life,
}

/// The voxels of some blocks, in the order of their arrival.
#[derive(Clone)]
pub(super) struct Shard {
    pub(super) voxels: CellTable,
    pub(super) columns: Columns,
    /// Voxels that went: when they had come, and when they went.
    pub(super) removed: FxHashMap<u64, Life>,
}

/// Which shard a cell belongs to: all cells of a block to one.
#[inline(always)]
pub(super) fn shard_of(code: CellCode) -> usize {
    (code.block().wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 60) as usize
}

impl Shard {
    pub(super) fn new(columns: Columns) -> Shard {
        Shard {
            voxels: CellTable::new(),
            columns,
            removed: FxHashMap::default(),
        }
    }

    pub(super) fn len(&self) -> usize {
        self.voxels.len()
    }

    pub(super) fn bytes(&self) -> usize {
        self.voxels.bytes()
            + self.columns.bytes()
            + self.removed.capacity() * (size_of::<(u64, Life)>() + 1)
    }

    /// The voxel of a cell, with its number.
    #[inline]
    pub(super) fn get(&self, code: CellCode) -> Option<(u32, &Entry)> {
        let number = self.voxels.find(code)?;
        Some((number, self.voxels.rows().get(number as usize)?))
    }

    /// The number of a cell, which becomes a voxel if fewer than `limit` are there.
    #[inline(always)]
    pub(super) fn find_or_add(&mut self, code: CellCode, limit: usize, now: u32) -> Option<u32> {
        let empty = || Entry {
            code: code.raw(),
            points: [0; 4],
            life: Life {
                born: now,
                touched: now,
            },
        };
        match self.voxels.find_or_add(code, limit, empty)? {
            Place::Known(number) => Some(number),
            Place::New(number) => {
                self.columns.push();
                self.remember(code.raw(), number);
                Some(number)
            }
        }
    }

    /// Who knew of a voxel before it went need not be told that it went when it comes back.
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

    /// Adds points to a voxel.
    #[inline(always)]
    pub(super) fn add(&mut self, number: u32, point: &Point, now: u32) {
        if let Some(entry) = self.voxels.row_mut(number) {
            for (sum, term) in entry.points.iter_mut().zip(point) {
                *sum = sum.wrapping_add(*term);
            }
            entry.life.touched = now;
        }
    }

    /// [`Shard::find_or_add`] without limit for a voxel that is added to soon.
    #[inline(always)]
    pub(super) fn find_soon(&mut self, code: CellCode, now: u32) -> Option<u32> {
        let number = self.find_or_add(code, usize::MAX, now)?;
        self.voxels.prefetch_row(number);
        Some(number)
    }

    /// Adds the gathered points of cells of this shard in steps, so that the waits for memory of
    /// one step overlap.
    pub(super) fn add_batch(&mut self, batch: &[Partial], now: u32) {
        for partial in batch {
            self.voxels.prefetch_block(partial.code);
        }
        let mut numbers = [None; BATCH];
        for (number, partial) in numbers.iter_mut().zip(batch) {
            *number = self.find_soon(partial.code, now);
        }
        for (number, partial) in numbers.iter().zip(batch) {
            if let Some(number) = *number {
                self.add(number, &partial.points, now);
            }
        }
    }

    /// Removes a voxel; false if it was not there.
    pub(super) fn remove(&mut self, code: CellCode, now: u32) -> bool {
        let Some((number, entry)) = self.voxels.remove(code) else {
            return false;
        };
        self.columns.swap_remove(number as usize);
        self.removed.insert(code.raw(), entry.life.ended(now));
        true
    }

    /// Removes all voxels.
    pub(super) fn clear(&mut self, now: u32) {
        for entry in self.voxels.rows() {
            self.removed.insert(entry.code, entry.life.ended(now));
        }
        self.voxels.clear();
        self.columns.clear();
    }

    /// Every voxel with its cell.
    pub(super) fn iter(&self) -> impl Iterator<Item = (CellCode, &Entry)> {
        let rows = self.voxels.rows().iter();
        rows.filter_map(|entry| Some((CellCode::from_raw(entry.code)?, entry)))
    }

    pub(super) fn validate(&self) -> Result<(), String> {
        self.voxels.validate()?;
        if !self.columns.fits(self.len()) {
            return Err("the columns of a shard differ in length".to_owned());
        }
        let rows = self.voxels.rows();
        if rows
            .iter()
            .any(|entry| entry.life.born > entry.life.touched)
        {
            return Err("a voxel changed before it came".to_owned());
        }
        match rows
            .iter()
            .find(|entry| self.removed.contains_key(&entry.code))
        {
            Some(entry) => Err(format!("removed voxel {:#x} is in the list", entry.code)),
            None => Ok(()),
        }
    }
}
