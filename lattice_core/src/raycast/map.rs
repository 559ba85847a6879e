//! Map of free space.

use nalgebra::Vector3;

use super::blocks::{Blocks, add_evidence, apply_to_hit};
use super::clear::ClearReport;
use super::coarse::Coarse;
use super::evidence::{Evidence, Steps, UNKNOWN};
use super::free_space_options::{FreeSpaceError, FreeSpaceOptions};
use super::marks::{MarkBytes, Marks};
use super::masks::Mask;
use super::packed::Packed;
use super::scan::{RayBundle, Reach, ScanReport};
use super::traversal::Traversal;
use crate::lattice::{Lattice, MortonKey};
use crate::voxels::{DatumError, VoxelStore};

/// Cells marked at once when many are known to be occupied; bounds the memory.
const SEED_CELLS: usize = 1 << 14;

/// Occupancy map of a lattice (occupied, free, unknown) from scans with their origins.
///
/// Each scan adds one hit to every cell that contains a point, and one miss to every other cell that a ray traverses
/// before its end, however many rays do. One ray goes to the lattice point of every hit cell, through exactly the
/// cells that it crosses. Evidence is integer, so the order of the points of a scan does not change a bit.
///
/// Free space depends on `free_level`:
/// - 0: every cell has its log-odds, one byte.
/// - none: only cells that were hit have log-odds, in blocks of 512.
/// - above 0: free space is kept in the cells of a lattice `2^free_level` as wide with the same datum.
///
/// A coarse cell gets one miss per scan if a ray traverses a fine cell that belongs to it and no hit fine cell
/// overlaps it. It is free if its log-odds are below the threshold and no occupied fine cell overlaps it.
///
/// ```
/// use lattice_core::cloud::Cloud;
/// use lattice_core::lattice::{Lattice, LatticeKind};
/// use lattice_core::nalgebra::Vector3;
/// use lattice_core::raycast::{FreeSpaceMap, FreeSpaceOptions, RayBundle};
///
/// let lattice = Lattice::new(LatticeKind::Cubic, 1.0)?;
/// let mut map = FreeSpaceMap::new(lattice, Vector3::zeros(), FreeSpaceOptions::default())?;
/// let ends = Cloud::from_points(0, Vector3::zeros(), &[Vector3::new(5.0, 0.0, 0.0)]);
/// map.insert_scan(&[RayBundle { origin_m: Vector3::zeros(), ends: &ends }]);
/// assert_eq!((map.occupied_keys().len(), map.free_keys().len()), (1, 5));
/// // One hit adds 0.844, in steps of 1/32.
/// assert_eq!(map.log_odds(map.occupied_keys()[0]), Some(27));
/// assert_eq!(map.known_keys().count(), 6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct FreeSpaceMap {
    traversal: Traversal,
    datum_index: [i64; 3],
    datum_m: Vector3<f64>,
    options: FreeSpaceOptions,
    steps: Steps,
    marks: Marks,
    cells: Blocks,
    free: Free,
}

#[derive(Clone)]
enum Free {
    /// Only cells that were hit.
    Hit,
    /// Cells of the map.
    Fine,
    /// Wider cells.
    Coarse(Box<Coarse>),
}

impl FreeSpaceMap {
    /// Creates an empty map with the datum at the lattice point nearest to `datum_near_m` (map frame, metres), as a
    /// [`crate::voxels::VoxelList`] of the same lattice, so that their keys agree.
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
        // A quarter of the memory is for the masks of one scan, an eighth for those of the voxels that it traverses; with
        // a free level, half of it is for the coarse lattice.
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
        let bytes = MarkBytes {
            masks: share / 4,
            surfaces: share / 8,
        };
        Ok(FreeSpaceMap {
            datum_m: lattice.center_wide(datum_index),
            datum_index,
            traversal: Traversal::new(&lattice),
            options,
            steps,
            marks: Marks::new(&lattice, bytes),
            cells: Blocks::new(share / 8 * 5 / Blocks::BYTES_PER_BLOCK),
            free,
        })
    }

    /// Adds a scan: one hit for each cell with a point, one miss for each other traversed cell.
    ///
    /// The result does not depend on the order of the points of a bundle. Points that are not finite or out of range
    /// are counted and dropped; if the origin is, the whole bundle.
    pub fn insert_scan(&mut self, scan: &[RayBundle]) -> ScanReport {
        self.add(scan, None).scan
    }

    /// Adds a scan. Voxels of `store` that it grazes get no miss; they are counted in `kept`.
    fn add(&mut self, scan: &[RayBundle], store: Option<&dyn VoxelStore>) -> ClearReport {
        let (marks, reach) = (&mut self.marks, self.options.reach);
        let mut report = marks.mark(&self.traversal, &self.datum_m, scan, reach, store);
        let mut kept = 0;
        if let Some(store) = store {
            kept = marks.spare_voxels(store);
        }
        let missed = |(_, passed, hit): (u64, &Mask, &Mask)| -> u64 {
            let words = passed.without(hit).0;
            words.iter().map(|word| u64::from(word.count_ones())).sum()
        };
        report.misses = marks.masks().blocks().map(missed).sum();
        report.blocks_refused = self.apply_marks();
        ClearReport {
            scan: report,
            kept: kept as u64,
            ..ClearReport::default()
        }
    }

    /// Adds the masks of a scan; returns the number of refused blocks.
    fn apply_marks(&mut self) -> u64 {
        let (steps, masks) = (&self.steps, self.marks.masks());
        match &mut self.free {
            Free::Hit => apply_to_hit(steps, masks, &mut self.cells),
            Free::Fine => self.cells.apply(
                masks.blocks(),
                |_, _| true,
                |cells, passed, hit| add_evidence(steps, cells, passed, hit),
            ),
            Free::Coarse(coarse) => coarse.apply(steps, masks, &mut self.cells),
        }
    }

    /// Adds a scan whose points are already in `store`, and removes from it the hit or traversed voxels that are not
    /// occupied by the evidence.
    ///
    /// With `spare_touching`, voxels that the scan grazes get no miss, see [`super::RayClearer`].
    /// A store of another lattice or datum is not changed.
    pub fn clear(&mut self, store: &mut dyn VoxelStore, scan: &[RayBundle]) -> ClearReport {
        if store.lattice() != self.lattice() || store.datum_index() != self.datum_index {
            return ClearReport::default();
        }
        let grazed = self.options.spare_touching.then_some(&*store);
        let mut report = self.add(scan, grazed);
        let is_free = |value: i8| value != UNKNOWN && value < self.steps.threshold;
        for (block, passed, hit) in self.marks.masks().blocks() {
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

    /// Adds one hit to each cell, such as those of a loaded map.
    pub fn insert_occupied(&mut self, keys: &[MortonKey]) {
        for part in keys.chunks(SEED_CELLS) {
            self.marks
                .set_hits(part.iter().filter_map(|key| Packed::new(key.unpack())));
            self.apply_marks();
        }
    }

    /// Clears the map; keeps lattice, datum and options.
    pub fn reset(&mut self) {
        let (lattice, options) = (self.lattice().clone(), self.options);
        // A map that was created once can be created again.
        if let Ok(empty) = Self::new(lattice, self.datum_m, options) {
            *self = empty;
        }
    }

    /// Sets another sensor model, range and rule of grazed voxels; cells keep their evidence.
    pub fn set_weights(
        &mut self,
        evidence: Evidence,
        reach: Reach,
        spare_touching: bool,
    ) -> Result<(), FreeSpaceError> {
        self.steps = Steps::new(&evidence)?;
        let options = &mut self.options;
        (options.evidence, options.reach) = (evidence, reach);
        options.spare_touching = spare_touching;
        Ok(())
    }

    /// All occupied cells in ascending order.
    pub fn occupied_keys(&self) -> Vec<MortonKey> {
        self.sorted(|value| value >= self.steps.threshold)
    }

    /// All free cells of [`FreeSpaceMap::free_lattice`] in ascending order; without a free level only those that were
    /// hit once.
    pub fn free_keys(&self) -> Vec<MortonKey> {
        match &self.free {
            Free::Hit | Free::Fine => self.sorted(|value| value < self.steps.threshold),
            Free::Coarse(coarse) => coarse.free_keys(&self.steps, &self.cells),
        }
    }

    /// Log-odds of a cell in steps of [`super::LOG_ODDS_STEP`]; `None` for a cell without evidence.
    pub fn log_odds(&self, key: MortonKey) -> Option<i8> {
        let cell = Packed::new(key.unpack())?;
        let value = *self.cells.block(cell.block())?.get(cell.place())?;
        (value != UNKNOWN).then_some(value)
    }

    /// Smallest log-odds of an occupied cell, in steps of [`super::LOG_ODDS_STEP`].
    pub fn occupied_log_odds(&self) -> i8 {
        self.steps.threshold
    }

    /// Keys of all cells with log-odds, in no particular order.
    pub fn known_keys(&self) -> impl Iterator<Item = MortonKey> + '_ {
        self.cells.known().filter_map(|(cell, _)| cell.key())
    }

    fn sorted(&self, wanted: impl Fn(i8) -> bool) -> Vec<MortonKey> {
        let known = self.cells.known();
        let wanted = known.filter(|(_, value)| wanted(*value));
        let mut keys: Vec<MortonKey> = wanted.filter_map(|(cell, _)| cell.key()).collect();
        keys.sort_unstable();
        keys
    }

    /// Lattice of the map.
    pub fn lattice(&self) -> &Lattice {
        &self.traversal.lattice
    }

    /// Lattice of the free cells, with the datum at its lattice point 0.
    pub fn free_lattice(&self) -> &Lattice {
        match &self.free {
            Free::Hit | Free::Fine => self.lattice(),
            Free::Coarse(coarse) => coarse.lattice(),
        }
    }

    /// Datum: lattice point that keys count from, map frame, metres.
    pub fn datum_m(&self) -> Vector3<f64> {
        self.datum_m
    }

    /// Options of the map.
    pub fn options(&self) -> &FreeSpaceOptions {
        &self.options
    }

    /// Memory of the map including buffers for the next scan, bytes; at most `max_bytes`.
    pub fn bytes(&self) -> usize {
        let coarse = match &self.free {
            Free::Hit | Free::Fine => 0,
            Free::Coarse(coarse) => coarse.bytes(),
        };
        self.cells.bytes() + self.marks.bytes() + coarse
    }
}
