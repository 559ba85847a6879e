//! Map with `payload: occupancy`: one bit per voxel, and the changes since the last update.

use std::collections::hash_map::Entry;

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, MortonKey};
use lattice_core::voxels::{Changes, InsertReport, OccupancyList, Region, VoxelStore};
use nalgebra::Vector3;
use rustc_hash::FxHashMap;

/// Occupied cells with a change record.
pub(super) struct OccupancyMap {
    list: OccupancyList,
    /// Cells of one cloud; kept to reuse the allocation.
    cloud: OccupancyList,
    max_voxels: usize,
    /// Cells that differ from the last update: true if occupied since, false if freed.
    changes: FxHashMap<MortonKey, bool>,
    sequence: u64,
}

impl OccupancyMap {
    /// Empty map for the lattice and datum of `store`; `max_bytes` 0: limited by `max_voxels` only.
    pub(super) fn new(store: &dyn VoxelStore, max_voxels: usize, max_bytes: usize) -> Self {
        let max_bytes = if max_bytes == 0 {
            usize::MAX
        } else {
            max_bytes
        };
        let empty =
            |bytes| OccupancyList::at_datum(store.lattice().clone(), store.datum_index(), bytes);
        Self {
            list: empty(max_bytes),
            cloud: empty(usize::MAX),
            max_voxels,
            changes: FxHashMap::default(),
            sequence: 0,
        }
    }

    /// Sequence of the state, incremented by every change.
    pub(super) fn sequence(&self) -> u64 {
        self.sequence
    }

    /// Changes the voxel limit.
    pub(super) fn set_max_voxels(&mut self, max_voxels: usize) {
        self.max_voxels = max_voxels;
    }

    /// Memory limit, bytes.
    pub(super) fn max_bytes(&self) -> usize {
        self.list.max_bytes()
    }

    /// Replaces all voxels.
    pub(super) fn replace(&mut self, list: OccupancyList) {
        self.list = list;
        self.sequence += 1;
    }

    /// Removes all voxels.
    pub(super) fn clear(&mut self) {
        self.list.clear();
        self.sequence += 1;
    }

    /// Sorted changes since the last call.
    pub(super) fn take_changes(&mut self) -> Changes {
        let mut changes = Changes::default();
        for (key, occupied) in self.changes.drain() {
            if occupied {
                changes.changed.push(key);
            } else {
                changes.removed.push(key);
            }
        }
        changes.changed.sort_unstable();
        changes.removed.sort_unstable();
        changes
    }

    /// Records that a cell became occupied or free.
    fn note(&mut self, key: MortonKey, occupied: bool) {
        match self.changes.entry(key) {
            // Back to the state of the last update.
            Entry::Occupied(entry) if *entry.get() != occupied => {
                entry.remove();
            }
            entry => {
                entry.insert_entry(occupied);
            }
        }
        self.sequence += 1;
    }
}

impl VoxelStore for OccupancyMap {
    fn lattice(&self) -> &Lattice {
        self.list.lattice()
    }

    fn datum_index(&self) -> [i64; 3] {
        self.list.datum_index()
    }

    fn datum_m(&self) -> Vector3<f64> {
        self.list.datum_m()
    }

    fn len(&self) -> usize {
        self.list.len()
    }

    fn contains(&self, key: MortonKey) -> bool {
        self.list.contains(key)
    }

    fn sorted_keys(&self) -> Vec<MortonKey> {
        self.list.sorted_keys()
    }

    fn insert(&mut self, cloud: &Cloud) -> InsertReport {
        self.cloud.clear();
        let mut report = self.cloud.insert(cloud);
        report.new_voxels = 0;
        let mut refused = false;
        for key in self.cloud.sorted_keys() {
            if self.list.contains(key) {
                continue;
            }
            if self.list.len() < self.max_voxels && self.list.add(key) {
                self.note(key, true);
                report.new_voxels += 1;
            } else {
                refused = true;
            }
        }
        if refused {
            let outside = |p: &Vector3<f64>| self.key_of(p).is_some_and(|key| !self.contains(key));
            report.list_full = cloud.points_m().filter(outside).count() as u64;
            report.inserted -= report.list_full.min(report.inserted);
        }
        report
    }

    fn remove(&mut self, key: MortonKey) -> bool {
        let removed = self.list.remove(key);
        if removed {
            self.note(key, false);
        }
        removed
    }

    fn keys_in(&self, region: &Region) -> Vec<MortonKey> {
        self.list.keys_in(region)
    }

    fn bytes(&self) -> usize {
        self.list.bytes() + self.cloud.bytes()
    }
}

#[cfg(test)]
mod tests {
    use lattice_core::lattice::LatticeKind;

    use super::*;

    fn cloud(points: &[[f32; 3]]) -> Cloud {
        Cloud {
            stamp_ns: 0,
            datum_m: Vector3::zeros(),
            offsets_m: points.to_vec(),
        }
    }

    fn map(max_voxels: usize) -> OccupancyMap {
        let lattice = Lattice::new(LatticeKind::Bcc, 0.125).unwrap();
        let like = OccupancyList::at_datum(lattice, [0; 3], 0);
        OccupancyMap::new(&like, max_voxels, 0)
    }

    #[test]
    fn a_cell_that_comes_and_goes_between_updates_is_no_change() {
        let mut map = map(usize::MAX);
        map.insert(&cloud(&[[0.0; 3], [5.0, 0.0, 0.0]]));
        let keys = map.sorted_keys();
        assert!(map.remove(keys[0]) && !map.remove(keys[0]));
        assert_eq!(map.take_changes().changed, [keys[1]]);
        map.remove(keys[1]);
        map.insert(&cloud(&[[0.0; 3], [5.0, 0.0, 0.0]]));
        assert_eq!(
            map.take_changes(),
            Changes {
                changed: vec![keys[0]],
                removed: vec![]
            }
        );
        let (low, high) = (Vector3::new(1.0, -1.0, -1.0), Vector3::repeat(9.0));
        assert_eq!(map.remove_region(&Region::cuboid(low, high).unwrap()), 1);
        assert_eq!(map.take_changes().removed, [keys[1]]);
        assert_eq!(map.take_changes(), Changes::default());
    }

    #[test]
    fn a_full_map_refuses_points_of_new_cells_only() {
        let mut map = map(1);
        let report = map.insert(&cloud(&[[0.0; 3], [5.0, 0.0, 0.0], [0.01, 0.0, 0.0]]));
        assert_eq!((map.len(), report.points), (1, 3));
        assert_eq!(report.inserted + report.list_full, 3);
        let full = map.insert(&cloud(&[[9.0, 0.0, 0.0]]));
        assert_eq!((full.inserted, full.list_full, map.len()), (0, 1, 1));
    }
}
