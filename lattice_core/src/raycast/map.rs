//! The map of free space.

use nalgebra::Vector3;

use super::blocks::{Blocks, add_evidence, apply_to_hit};
use super::clear::ClearReport;
use super::coarse::Coarse;
use super::evidence::{Evidence, Steps, UNKNOWN};
use super::masks::{Cursor, Mask, ScanMasks};
use super::options::{FreeSpaceError, FreeSpaceOptions};
use super::packed::Packed;
use super::scan::{self, RayBundle, Reach, ScanReport};
use super::traversal::Traversal;
use crate::lattice::{Lattice, MortonKey};
use crate::voxels::{DatumError, VoxelStore};

/// Cells that are marked at once where many are known to be occupied; bounds the memory for it.
const SEED_CELLS: usize = 1 << 14;

/// The occupied, free and unknown cells of a lattice, from scans with their origins.
///
/// Each scan gives one hit to every cell that holds a point, and one miss to every other cell that a
/// ray passes through before its end, however many rays do; one ray is followed to the lattice point
/// of every cell that holds a point, through exactly the cells that it crosses. Evidence is in
/// integers, so that the order of the points of a scan does not change a bit.
///
/// With `free_level` 0 every cell has its log-odds, a byte. With another only cells that were hit do,
/// in blocks of 512; with a higher one free space is kept in the cells of a lattice `2^free_level` as
/// wide, which has the same datum. A scan gives a coarse cell one miss if a ray of it passes through a fine
/// cell that belongs to it and no fine cell that was hit overlaps it. A coarse cell is free if its
/// log-odds are below the threshold and no occupied fine cell overlaps it.
#[derive(Clone)]
pub struct FreeSpaceMap {
    traversal: Traversal,
    datum_index: [i64; 3],
    datum_m: Vector3<f64>,
    options: FreeSpaceOptions,
    steps: Steps,
    masks: ScanMasks,
    cells: Blocks,
    free: Free,
}

#[derive(Clone)]
enum Free {
    /// None but those that were hit.
    Hit,
    /// Those of the map.
    Fine,
    /// Wider ones.
    Coarse(Box<Coarse>),
}

impl FreeSpaceMap {
    /// An empty map with the datum at the lattice point nearest to `datum_near_m` (map frame,
    /// metres), as that of a [`crate::voxels::VoxelList`] of the same lattice, so that both speak of
    /// the same keys.
    pub fn new(
        lattice: Lattice,
        datum_near_m: Vector3<f64>,
        options: FreeSpaceOptions,
    ) -> Result<FreeSpaceMap, FreeSpaceError> {
        options.check()?;
        let steps = Steps::new(&options.evidence)?;
        let [x, y, z] = datum_near_m.into();
        let index = lattice.quantize_wide(&datum_near_m);
        let datum_index = index.ok_or(DatumError { x, y, z })?;
        // A quarter of the memory is for the marks of one scan; with a free level half of everything
        // is for the coarse lattice.
        let share = match options.free_level {
            None | Some(0) => options.max_bytes,
            Some(_) => options.max_bytes / 2,
        };
        let share = share - (1 << 16);
        let free = match options.free_level {
            None => Free::Hit,
            Some(0) => Free::Fine,
            Some(level) => Free::Coarse(Box::new(Coarse::new(&lattice, level, share)?)),
        };
        Ok(FreeSpaceMap {
            datum_m: lattice.center_wide(datum_index),
            datum_index,
            traversal: Traversal::new(&lattice),
            options,
            steps,
            masks: ScanMasks::new(share / 4 / ScanMasks::BYTES_PER_BLOCK),
            cells: Blocks::new(share / 4 * 3 / Blocks::BYTES_PER_BLOCK),
            free,
        })
    }

    /// Adds a scan: one hit for each cell with a point, one miss for each other cell that a ray
    /// passes through.
    ///
    /// The outcome does not depend on the order of the points of a bundle. Points that are not
    /// finite or out of range are counted and left out; if the origin is, the bundle is.
    pub fn insert_scan(&mut self, scan: &[RayBundle]) -> ScanReport {
        let mut report = scan::mark(
            &self.traversal,
            &mut self.masks,
            &self.datum_m,
            scan,
            self.options.reach,
        );
        let missed = |(_, passed, hit): (u64, &Mask, &Mask)| -> u64 {
            let words = passed.without(hit).0;
            words.iter().map(|word| u64::from(word.count_ones())).sum()
        };
        report.misses = self.masks.blocks().map(missed).sum();
        report.blocks_refused = self.apply_marks();
        report
    }

    /// Adds the marks of a scan; returns the number of blocks refused.
    fn apply_marks(&mut self) -> u64 {
        let steps = &self.steps;
        match &mut self.free {
            Free::Hit => apply_to_hit(steps, &self.masks, &mut self.cells),
            Free::Fine => self.cells.apply(
                self.masks.blocks(),
                |_, _| true,
                |cells, passed, hit| add_evidence(steps, cells, passed, hit),
            ),
            Free::Coarse(coarse) => coarse.apply(steps, &self.masks, &mut self.cells),
        }
    }

    /// Adds a scan whose points are in `store` already, and removes the voxels from it that the scan
    /// has hit or passed through and that are not occupied by the evidence.
    ///
    /// Nothing happens to a store of another lattice or datum.
    pub fn clear(&mut self, store: &mut dyn VoxelStore, scan: &[RayBundle]) -> ClearReport {
        let mut report = ClearReport::default();
        if store.lattice() != self.lattice() || store.datum_index() != self.datum_index {
            return report;
        }
        report.scan = self.insert_scan(scan);
        let is_free = |value: i8| value != UNKNOWN && value < self.steps.threshold;
        for (block, passed, hit) in self.masks.blocks() {
            let Some(cells) = self.cells.block(block) else {
                continue;
            };
            for place in passed.or(hit).places() {
                if cells.get(place).is_some_and(|value| is_free(*value)) {
                    report.removed.extend(Packed::at(block, place).key());
                }
            }
        }
        report.removed.sort_unstable();
        report.removed.retain(|key| store.remove(*key));
        report.missed = report.removed.len() as u64;
        report
    }

    /// Counts cells as hit once, such as those of a map that was loaded.
    pub fn insert_occupied(&mut self, keys: &[MortonKey]) {
        for part in keys.chunks(SEED_CELLS) {
            let mut cursor = Cursor::NONE;
            self.masks.clear();
            for cell in part.iter().filter_map(|key| Packed::new(key.unpack())) {
                self.masks.hit(cell, &mut cursor);
            }
            self.apply_marks();
        }
    }

    /// Forgets everything; keeps lattice, datum and options.
    pub fn reset(&mut self) {
        let (lattice, options) = (self.lattice().clone(), self.options);
        // A map that could be made once can be made again.
        if let Ok(empty) = Self::new(lattice, self.datum_m, options) {
            *self = empty;
        }
    }

    /// Goes on with other weights and reach; cells keep their evidence.
    pub fn set_weights(&mut self, evidence: Evidence, reach: Reach) -> Result<(), FreeSpaceError> {
        self.steps = Steps::new(&evidence)?;
        (self.options.evidence, self.options.reach) = (evidence, reach);
        Ok(())
    }

    /// All occupied cells in ascending order.
    pub fn occupied_keys(&self) -> Vec<MortonKey> {
        self.sorted(|value| value >= self.steps.threshold)
    }

    /// All free cells of [`FreeSpaceMap::free_lattice`] in ascending order; without a free level
    /// those that were hit once.
    pub fn free_keys(&self) -> Vec<MortonKey> {
        match &self.free {
            Free::Hit | Free::Fine => self.sorted(|value| value < self.steps.threshold),
            Free::Coarse(coarse) => coarse.free_keys(&self.steps, &self.cells),
        }
    }

    fn sorted(&self, wanted: impl Fn(i8) -> bool) -> Vec<MortonKey> {
        let known = self.cells.known();
        let wanted = known.filter(|(_, value)| wanted(*value));
        let mut keys: Vec<MortonKey> = wanted.filter_map(|(cell, _)| cell.key()).collect();
        keys.sort_unstable();
        keys
    }

    /// The lattice.
    pub fn lattice(&self) -> &Lattice {
        &self.traversal.lattice
    }

    /// The lattice of the free cells; its lattice point 0 is the datum, too.
    pub fn free_lattice(&self) -> &Lattice {
        match &self.free {
            Free::Hit | Free::Fine => self.lattice(),
            Free::Coarse(coarse) => coarse.lattice(),
        }
    }

    /// The lattice point that keys count from, map frame, metres.
    pub fn datum_m(&self) -> Vector3<f64> {
        self.datum_m
    }

    /// The options.
    pub fn options(&self) -> &FreeSpaceOptions {
        &self.options
    }

    /// Memory that the map holds, with what it keeps for the next scan, bytes; at most `max_bytes`.
    pub fn bytes(&self) -> usize {
        let coarse = match &self.free {
            Free::Hit | Free::Fine => 0,
            Free::Coarse(coarse) => coarse.bytes(),
        };
        self.cells.bytes() + self.masks.bytes() + coarse
    }
}
