//! The map of free space.

use std::fmt;

use nalgebra::Vector3;

use super::blocks::{Blocks, add_evidence};
use super::coarse::Coarse;
use super::evidence::{Steps, UNKNOWN, log_odds_of};
use super::masks::{Mask, ScanMasks};
use super::options::{FreeSpaceError, FreeSpaceOptions};
use super::packed::Packed;
use super::scan::{self, Reach, ScanReport};
use super::traversal::Traversal;
use crate::cloud::Cloud;
use crate::lattice::{Lattice, MortonKey};
use crate::voxels::DatumError;

/// What is known of a cell.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum CellState {
    /// No ray came here, or too few to say.
    Unknown,
    /// Rays passed through.
    Free,
    /// Points were seen here.
    Occupied,
}

/// Which cells of a lattice are occupied, free or unknown, from scans with their origins.
///
/// Each scan gives one hit to every cell that holds a point, and one miss to every other cell that a
/// ray passes through before its end, however many rays do; one ray is followed to the lattice point
/// of every cell that holds a point, through exactly the cells that it crosses. Evidence is in
/// integers, so that the order of the points of a scan does not change a bit.
///
/// With `free_level` 0 every cell has its log-odds, a byte. With a higher level only cells that were
/// hit do, in blocks of 512; free space is kept in the cells of a lattice `2^free_level` as wide,
/// which has the same datum. A scan gives a coarse cell one miss if a ray of it passes through a fine
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
    coarse: Option<Box<Coarse>>,
}

/// Numbers of known cells.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct CellCounts {
    /// Occupied cells.
    pub occupied: u64,
    /// Free cells, of the coarse lattice if the free level is not 0.
    pub free: u64,
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
        let share = if options.free_level == 0 {
            options.max_bytes
        } else {
            options.max_bytes / 2
        };
        let share = share - (1 << 16);
        let coarse = match options.free_level {
            0 => None,
            level => Some(Box::new(Coarse::new(&lattice, level, share)?)),
        };
        Ok(FreeSpaceMap {
            datum_m: lattice.center_wide(datum_index),
            datum_index,
            traversal: Traversal::new(&lattice),
            options,
            steps,
            masks: ScanMasks::new(share / 4 / ScanMasks::BYTES_PER_BLOCK),
            cells: Blocks::new(share / 4 * 3 / Blocks::BYTES_PER_BLOCK),
            coarse,
        })
    }

    /// Adds a scan (map frame) that was taken from `origin_m` (map frame, metres): one hit for each
    /// cell with a point, one miss for each other cell that a ray passes through.
    ///
    /// The outcome does not depend on the order of the points. Points that are not finite or out of
    /// range are counted and left out; if the origin is, the scan is.
    pub fn insert_scan(&mut self, origin_m: Vector3<f64>, scan: &Cloud) -> ScanReport {
        let mut report = scan::mark(
            &self.traversal,
            &mut self.masks,
            &(origin_m - self.datum_m),
            &(scan.datum_m - self.datum_m),
            scan,
            Reach {
                max_range_m: self.options.max_range_m,
                keep_m: 0.0,
            },
        );
        let missed = |(_, passed, hit): (u64, &Mask, &Mask)| {
            let words = passed.0.iter().zip(&hit.0);
            words
                .map(|(p, h)| u64::from((p & !h).count_ones()))
                .sum::<u64>()
        };
        report.misses = self.masks.blocks().map(missed).sum();
        let steps = &self.steps;
        report.blocks_refused = match &mut self.coarse {
            None => self.cells.apply(
                self.masks.blocks(),
                |_, _| true,
                |cells, passed, hit| add_evidence(steps, cells, passed, hit),
            ),
            Some(coarse) => coarse.apply(steps, &self.masks, &mut self.cells),
        };
        report
    }

    /// What is known of a cell of the lattice.
    ///
    /// With a free level, a cell that was never hit is free if the coarse cell that it belongs to is.
    pub fn state(&self, key: MortonKey) -> CellState {
        let Some(cell) = Packed::new(key.unpack()) else {
            return CellState::Unknown;
        };
        match (self.cells.get(cell), &self.coarse) {
            (UNKNOWN, None) => CellState::Unknown,
            (UNKNOWN, Some(coarse)) => {
                if coarse.is_free(&self.steps, &self.cells, coarse.cell_of(cell)) {
                    CellState::Free
                } else {
                    CellState::Unknown
                }
            }
            (value, _) if value >= self.steps.threshold => CellState::Occupied,
            _ => CellState::Free,
        }
    }

    /// The log-odds of a cell of the lattice, `None` if it has none.
    pub fn log_odds(&self, key: MortonKey) -> Option<f64> {
        log_odds_of(self.cells.get(Packed::new(key.unpack())?))
    }

    /// The probability that a cell of the lattice is occupied, `None` if nothing is known of it.
    pub fn probability(&self, key: MortonKey) -> Option<f64> {
        let odds = self.log_odds(key)?.exp();
        Some(odds / (1.0 + odds))
    }

    /// All occupied cells in ascending order.
    pub fn occupied_keys(&self) -> Vec<MortonKey> {
        self.sorted(|value| value >= self.steps.threshold)
    }

    /// All free cells of [`FreeSpaceMap::free_lattice`] in ascending order.
    pub fn free_keys(&self) -> Vec<MortonKey> {
        match &self.coarse {
            None => self.sorted(|value| value < self.steps.threshold),
            Some(coarse) => coarse.free_keys(&self.steps, &self.cells),
        }
    }

    fn sorted(&self, wanted: impl Fn(i8) -> bool) -> Vec<MortonKey> {
        let known = self.cells.known();
        let wanted = known.filter(|(_, value)| wanted(*value));
        let mut keys: Vec<MortonKey> = wanted.filter_map(|(cell, _)| cell.key()).collect();
        keys.sort_unstable();
        keys
    }

    /// How many cells are occupied and free; goes through the whole map.
    pub fn counts(&self) -> CellCounts {
        let threshold = self.steps.threshold;
        let (mut occupied, mut free) = (0, 0);
        for (_, value) in self.cells.known() {
            *(if value >= threshold {
                &mut occupied
            } else {
                &mut free
            }) += 1;
        }
        if self.coarse.is_some() {
            free = self.free_keys().len() as u64;
        }
        CellCounts { occupied, free }
    }

    /// The lattice.
    pub fn lattice(&self) -> &Lattice {
        self.traversal.lattice()
    }

    /// The lattice of the free cells; its lattice point 0 is the datum, too.
    pub fn free_lattice(&self) -> &Lattice {
        match &self.coarse {
            None => self.lattice(),
            Some(coarse) => coarse.lattice(),
        }
    }

    /// The lattice point that keys count from, map frame, metres.
    pub fn datum_m(&self) -> Vector3<f64> {
        self.datum_m
    }

    /// Index of the datum in the lattice of the map frame.
    pub fn datum_index(&self) -> [i64; 3] {
        self.datum_index
    }

    /// The options.
    pub fn options(&self) -> &FreeSpaceOptions {
        &self.options
    }

    /// The cell of a point (map frame, metres), `None` if not finite or out of the range of keys.
    pub fn key_of(&self, point_m: &Vector3<f64>) -> Option<MortonKey> {
        MortonKey::pack(self.lattice().quantize(&(point_m - self.datum_m))?)
    }

    /// Memory that the map holds, with what it keeps for the next scan, bytes; at most `max_bytes`.
    pub fn bytes(&self) -> usize {
        let coarse = self.coarse.as_ref().map_or(0, |coarse| coarse.bytes());
        self.cells.bytes() + self.masks.bytes() + coarse
    }
}

impl fmt::Debug for FreeSpaceMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let datum: [f64; 3] = self.datum_m.into();
        write!(
            f,
            "FreeSpaceMap({:?}, datum {datum:?} m, {} blocks)",
            self.lattice(),
            self.cells.len()
        )
    }
}
