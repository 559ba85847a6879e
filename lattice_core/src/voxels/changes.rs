//! What became different since it was last asked.

use rustc_hash::FxHashSet;

use super::list::Slot;
use super::{Voxel, VoxelList};
use crate::lattice::Key;

/// Keys that differ from the call before, sorted.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Changes {
    /// Voxels that are new or have more points.
    pub changed: Vec<Key>,
    /// Voxels of earlier calls that are no longer there.
    pub removed: Vec<Key>,
}

impl VoxelList {
    /// What changed since the call before (since the beginning for the first).
    ///
    /// The memory for this is bounded by the number of voxels, however rarely it is called.
    pub fn take_changes(&mut self) -> Changes {
        let mut changed = std::mem::take(&mut self.changed);
        let mut removed: Vec<Key> = self.removed.drain().collect();
        changed.sort_unstable();
        removed.sort_unstable();
        for key in &changed {
            if let Some(slot) = self.slots.get_mut(key) {
                (slot.changed, slot.announced) = (false, true);
            }
        }
        Changes { changed, removed }
    }

    /// Adds points to a cell; false if the cell is new and the list is full.
    pub(super) fn add(&mut self, key: Key, points: &Voxel) -> bool {
        let full = self.slots.len() >= self.max_voxels;
        let slot = match self.slots.entry(key) {
            std::collections::hash_map::Entry::Occupied(slot) => slot.into_mut(),
            std::collections::hash_map::Entry::Vacant(_) if full => return false,
            std::collections::hash_map::Entry::Vacant(slot) => {
                let announced = !self.removed.is_empty() && self.removed.remove(&key);
                slot.insert(Slot {
                    sum: [0; 3],
                    count: 0,
                    changed: false,
                    announced,
                })
            }
        };
        let mut voxel = slot.voxel();
        voxel.add(points);
        (slot.count, slot.sum) = (voxel.count, voxel.sum);
        if !slot.changed {
            slot.changed = true;
            self.changed.push(key);
        }
        true
    }

    pub(super) fn validate_changes(&self) -> Result<(), String> {
        let waiting: FxHashSet<Key> = self.changed.iter().copied().collect();
        if waiting.len() != self.changed.len() {
            return Err("a changed voxel is listed twice".to_owned());
        }
        for (key, slot) in &self.slots {
            if slot.changed != waiting.contains(key) || !(slot.changed || slot.announced) {
                return Err(format!("the changes do not match voxel {:?}", key.unpack()));
            }
        }
        match self.changed.iter().find(|key| !self.contains(**key)) {
            Some(key) => Err(format!(
                "changed voxel {:?} is not in the list",
                key.unpack()
            )),
            None if self.removed.iter().any(|key| self.contains(*key)) => {
                Err("a removed voxel is in the list".to_owned())
            }
            None => Ok(()),
        }
    }
}
