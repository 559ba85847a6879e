//! Removing voxels that rays traverse.

use rustc_hash::FxHashMap;

use super::marks::{MarkBytes, Marks};
use super::packed::Packed;
use super::scan::{RayBundle, Reach, ScanReport};
use super::traversal::Traversal;
use crate::lattice::{Lattice, MortonKey};
use crate::voxels::VoxelStore;

/// Conditions to remove a voxel.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ClearOptions {
    /// Number of scans without a hit in between that must traverse a voxel to remove it.
    pub misses: u32,
    /// Range of the rays that clear.
    pub reach: Reach,
    /// Keeps voxels that the scan grazes: those that touch a hit cell, and those whose surface no ray passes through.
    pub spare_touching: bool,
    /// Maximum memory for the masks of a scan, bytes; cells beyond it are not cleared.
    pub max_bytes: usize,
}

impl Default for ClearOptions {
    fn default() -> ClearOptions {
        ClearOptions {
            misses: 2,
            reach: Reach::default(),
            spare_touching: true,
            max_bytes: 1 << 28,
        }
    }
}

/// Voxels that a scan traversed and removed.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct ClearReport {
    /// Counts of the scan; `hits` and `misses` include unoccupied cells.
    pub scan: ScanReport,
    /// Number of occupied voxels that rays traversed, except kept ones.
    pub missed: u64,
    /// Number of occupied voxels that rays traversed, kept because the scan grazes them.
    pub kept: u64,
    /// Removed voxels in ascending order.
    pub removed: Vec<MortonKey>,
}

/// Clears voxels of a store that rays traverse, for dynamic scenes.
///
/// A voxel is traversed if a ray to the lattice point of a hit cell crosses it more than [`Reach::keep_m`] before the
/// end. Voxels that the scan hits are kept. With `spare_touching`, a surface at a grazing angle does not clear itself:
/// voxels that touch a hit cell in at least a vertex are kept, and voxels whose surface no ray passes through. The surface
/// is the plane or line of the means of the touching voxels, and a ray goes to the mean of the voxel that it ends in.
#[derive(Clone, Debug)]
pub struct RayClearer {
    traversal: Traversal,
    options: ClearOptions,
    marks: Marks,
    missed: FxHashMap<MortonKey, u32>,
}

impl RayClearer {
    /// Creates a clearer for stores of a lattice; each store needs its own, since it counts misses.
    pub fn new(lattice: &Lattice, options: ClearOptions) -> RayClearer {
        RayClearer {
            traversal: Traversal::new(lattice),
            options,
            marks: Marks::new(
                lattice,
                MarkBytes {
                    masks: options.max_bytes / 2,
                    surfaces: options.max_bytes / 2,
                },
            ),
            missed: FxHashMap::default(),
        }
    }

    /// Replaces the options except `max_bytes`, which [`RayClearer::new`] sets.
    pub fn set_options(&mut self, options: ClearOptions) {
        self.options = options;
    }

    /// Clears along the rays of a scan, whose points are inserted separately, before or after.
    ///
    /// The result does not depend on the order of the points of a bundle. A store of another lattice is not changed.
    pub fn clear(&mut self, store: &mut dyn VoxelStore, scan: &[RayBundle]) -> ClearReport {
        let mut report = ClearReport::default();
        if *store.lattice() != self.traversal.lattice {
            return report;
        }
        let reach = self.options.reach;
        let datum_m = store.datum_m();
        let spares = self.options.spare_touching;
        let probed = spares.then_some(&*store);
        let marks = &mut self.marks;
        report.scan = marks.mark(&self.traversal, &datum_m, scan, reach, probed);
        let mut traversed = marks.traversed_voxels(store);
        let occupied = traversed.len();
        if spares {
            traversed = marks.passed().to_vec();
        }
        report.kept = (occupied - traversed.len()) as u64;
        self.forget_hits(store);
        let mut keys: Vec<MortonKey> = traversed.iter().filter_map(|cell| cell.key()).collect();
        keys.sort_unstable();
        report.missed = keys.len() as u64;
        keys.retain(|key| self.is_enough(*key) && store.remove(*key));
        report.removed = keys;
        report
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

    /// Drops the misses of hit voxels, and, if there are many, those of voxels removed elsewhere.
    fn forget_hits(&mut self, store: &dyn VoxelStore) {
        if self.missed.is_empty() {
            return;
        }
        for (block, _, hit) in self.marks.masks().blocks() {
            for key in hit.places().filter_map(|i| Packed::at(block, i).key()) {
                self.missed.remove(&key);
            }
        }
        if self.missed.len() > store.len() {
            self.missed.retain(|key, _| store.contains(*key));
        }
    }
}
