//! Removing voxels that rays pass through.

use rustc_hash::FxHashMap;

use super::masks::ScanMasks;
use super::packed::{Packed, difference};
use super::scan::{self, RayBundle, Reach, ScanReport};
use super::traversal::Traversal;
use crate::lattice::{Lattice, LatticeIndex, MortonKey};
use crate::voxels::VoxelStore;

/// Conditions under which a voxel is removed.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ClearOptions {
    /// Scans that must pass through a voxel, with none between that hits it, to remove it.
    pub misses: u32,
    /// Parts of rays that remove voxels.
    pub reach: Reach,
    /// True: voxels that touch a cell which the scan hit are spared.
    pub spare_touching: bool,
    /// Most memory for the marks of a scan, bytes; cells beyond it are not cleared.
    pub max_bytes: usize,
}

impl Default for ClearOptions {
    fn default() -> ClearOptions {
        ClearOptions {
            misses: 1,
            reach: Reach::default(),
            spare_touching: true,
            max_bytes: 1 << 28,
        }
    }
}

/// Voxels that a scan removed, and those that it passed through.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct ClearReport {
    /// The rays; `hits` and `misses` count cells whether they are occupied or not.
    pub scan: ScanReport,
    /// Occupied voxels that rays passed through and that nothing kept.
    pub missed: u64,
    /// Occupied voxels that rays passed through, kept since they touch a cell that the scan hit.
    pub kept: u64,
    /// The voxels that were removed, in ascending order.
    pub removed: Vec<MortonKey>,
}

/// Removes from a store what rays pass through, for scenes in which things move.
///
/// A voxel is passed through if a ray to the lattice point of a cell with a point crosses it more
/// than [`Reach::keep_m`] before that end. Voxels that the scan hits and, with `spare_touching`, those that
/// touch one in at least a vertex are safe from it: a surface seen at a flat angle does not clear
/// itself.
#[derive(Clone, Debug)]
pub struct RayClearer {
    traversal: Traversal,
    options: ClearOptions,
    touching: Vec<LatticeIndex>,
    masks: ScanMasks,
    missed: FxHashMap<MortonKey, u32>,
}

impl RayClearer {
    /// For stores of this lattice; use one for each store, since it counts misses.
    pub fn new(lattice: &Lattice, options: ClearOptions) -> RayClearer {
        RayClearer {
            traversal: Traversal::new(lattice),
            options,
            touching: lattice.touching_neighbors().to_vec(),
            masks: ScanMasks::new(options.max_bytes / ScanMasks::BYTES_PER_BLOCK),
            missed: FxHashMap::default(),
        }
    }

    /// Goes on with other conditions; the memory for marks stays as it is.
    pub fn set_options(&mut self, options: ClearOptions) {
        self.options = options;
    }

    /// Clears along the rays of a scan. The points themselves are not inserted; do that before or
    /// after.
    ///
    /// The outcome does not depend on the order of the points of a bundle. Nothing happens to a
    /// store of another lattice than that of the clearer.
    pub fn clear(&mut self, store: &mut dyn VoxelStore, scan: &[RayBundle]) -> ClearReport {
        let mut report = ClearReport::default();
        if *store.lattice() != self.traversal.lattice {
            return report;
        }
        let reach = self.options.reach;
        let datum_m = store.datum_m();
        report.scan = scan::mark(&self.traversal, &mut self.masks, &datum_m, scan, reach);
        self.forget_hits(store);
        let mut keys: Vec<MortonKey> = Vec::new();
        for (block, passed, hit) in self.masks.blocks() {
            for place in passed.without(hit).places() {
                let cell = Packed::at(block, place);
                let Some(key) = cell.key().filter(|key| store.contains(*key)) else {
                    continue;
                };
                if self.options.spare_touching && self.touches_hit(cell) {
                    report.kept += 1;
                } else {
                    keys.push(key);
                }
            }
        }
        keys.sort_unstable();
        report.missed = keys.len() as u64;
        keys.retain(|key| self.is_enough(*key) && store.remove(*key));
        report.removed = keys;
        report
    }

    fn touches_hit(&self, cell: Packed) -> bool {
        let mut around = self.touching.iter().map(|n| cell.plus(difference(*n)));
        around.any(|cell| self.masks.is_hit(cell))
    }

    /// Counts a miss; true if the voxel is to be removed.
    fn is_enough(&mut self, key: MortonKey) -> bool {
        if self.options.misses <= 1 {
            return true;
        }
        let count = self.missed.entry(key).or_default();
        *count += 1;
        let enough = *count >= self.options.misses;
        if enough {
            self.missed.remove(&key);
        }
        enough
    }

    /// Forgets the misses of what the scan hits, and of what others have removed if it is much.
    fn forget_hits(&mut self, store: &dyn VoxelStore) {
        if self.missed.is_empty() {
            return;
        }
        for (block, _, hit) in self.masks.blocks() {
            for key in hit.places().filter_map(|i| Packed::at(block, i).key()) {
                self.missed.remove(&key);
            }
        }
        if self.missed.len() > store.len() {
            self.missed.retain(|key, _| store.contains(*key));
        }
    }
}
