//! The list itself.

use std::fmt;

use nalgebra::Vector3;
use rayon::slice::ParallelSliceMut;
use rustc_hash::{FxHashMap, FxHashSet};
use thiserror::Error;

use super::distortion::{Distortion, DistortionSums};
use super::{InsertReport, OFFSET_UNIT_M, Voxel, VoxelStore};
use crate::cloud::Cloud;
use crate::lattice::{Key, Lattice};

/// The datum is not finite or too many cells from the origin of the map frame.
#[derive(Clone, Copy, PartialEq, Debug, Error)]
#[error("datum ({x}, {y}, {z}) m is not finite or more than 2^48 cells from the map origin")]
pub struct DatumError {
    /// East, metres.
    pub x: f64,
    /// North, metres.
    pub y: f64,
    /// Up, metres.
    pub z: f64,
}

/// A voxel and what the consumer of changes knows of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slot {
    pub(super) sum: [i64; 3],
    pub(super) count: u32,
    /// The key waits in `VoxelList::changed`.
    pub(super) changed: bool,
    /// The key was in an earlier `take_changes`.
    pub(super) announced: bool,
}

impl Slot {
    pub(super) fn voxel(&self) -> Voxel {
        Voxel {
            count: self.count,
            sum: self.sum,
        }
    }
}

/// Occupied voxels of a lattice whose indices count from a datum in the map frame.
///
/// The datum is a lattice point of the map frame, so that lists with one lattice and datum speak of
/// the same cells, and points far from the map origin keep all their digits.
#[derive(Clone)]
pub struct VoxelList {
    pub(super) lattice: Lattice,
    pub(super) datum_index: [i64; 3],
    pub(super) datum_m: Vector3<f64>,
    pub(super) max_voxels: usize,
    pub(super) slots: FxHashMap<Key, Slot>,
    pub(super) sums: DistortionSums,
    pub(super) changed: Vec<Key>,
    pub(super) removed: FxHashSet<Key>,
}

impl VoxelList {
    /// An empty list of at most `max_voxels`, with the datum at the lattice point nearest to
    /// `datum_near_m` (map frame, metres).
    pub fn new(
        lattice: Lattice,
        datum_near_m: Vector3<f64>,
        max_voxels: usize,
    ) -> Result<VoxelList, DatumError> {
        let index = lattice.quantize_wide(&datum_near_m);
        let [x, y, z] = datum_near_m.into();
        let datum_index = index.ok_or(DatumError { x, y, z })?;
        Ok(VoxelList::at_datum(lattice, datum_index, max_voxels))
    }

    pub(super) fn at_datum(
        lattice: Lattice,
        datum_index: [i64; 3],
        max_voxels: usize,
    ) -> VoxelList {
        VoxelList {
            datum_m: lattice.center_wide(datum_index),
            lattice,
            datum_index,
            max_voxels,
            slots: FxHashMap::default(),
            sums: DistortionSums::default(),
            changed: Vec::new(),
            removed: FxHashSet::default(),
        }
    }

    /// The lattice.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// The lattice point that keys count from, map frame, metres.
    pub fn datum_m(&self) -> Vector3<f64> {
        self.datum_m
    }

    /// Index of the datum in the lattice of the map frame: `datum_m` is the generator times this.
    pub fn datum_index(&self) -> [i64; 3] {
        self.datum_index
    }

    /// Most voxels that the list takes.
    pub fn max_voxels(&self) -> usize {
        self.max_voxels
    }

    /// Number of occupied voxels.
    pub fn len(&self) -> usize {
        self.slots.len()
    }

    /// True if no voxel is occupied.
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// The voxel of a cell, if occupied.
    pub fn get(&self, key: Key) -> Option<Voxel> {
        self.slots.get(&key).map(Slot::voxel)
    }

    /// True if the cell is occupied.
    pub fn contains(&self, key: Key) -> bool {
        self.slots.contains_key(&key)
    }

    /// Centre of a cell, map frame, metres.
    pub fn center_m(&self, key: Key) -> Vector3<f64> {
        self.datum_m + self.lattice.center(key.unpack())
    }

    /// All voxels in Morton order.
    pub fn sorted(&self) -> Vec<(Key, Voxel)> {
        let mut voxels: Vec<_> = self
            .slots
            .iter()
            .map(|(&key, slot)| (key, slot.voxel()))
            .collect();
        voxels.par_sort_unstable_by_key(|&(key, _)| key);
        voxels
    }

    /// Quantization error over all inserted points.
    pub fn distortion(&self) -> Distortion {
        self.sums.summary()
    }

    /// Empties the list and its statistics; keeps lattice, datum and bound.
    pub fn clear(&mut self) {
        let announced = self
            .slots
            .iter()
            .filter(|(_, slot)| slot.announced)
            .map(|(&key, _)| key);
        self.removed.extend(announced);
        self.slots.clear();
        self.changed.clear();
        self.sums = DistortionSums::default();
    }

    /// No point is farther from its lattice point than this, in `OFFSET_UNIT_M`, roundings included.
    pub(super) fn reach(&self) -> u64 {
        (self.lattice.covering_radius_m() / OFFSET_UNIT_M) as u64 + 2
    }

    /// Checks everything that must hold between calls; says what does not.
    pub fn validate(&self) -> Result<(), String> {
        let reach = self.reach();
        if self.len() > self.max_voxels {
            return Err(format!(
                "{} voxels, but at most {} allowed",
                self.len(),
                self.max_voxels
            ));
        }
        for (key, slot) in &self.slots {
            if let Some(fault) = slot.voxel().fault(reach) {
                return Err(format!("voxel {:?}: {fault}", key.unpack()));
            }
        }
        if let Some(fault) = self.sums.fault(reach) {
            return Err(fault);
        }
        let counted: u64 = self.slots.values().map(|slot| u64::from(slot.count)).sum();
        if counted > self.sums.points {
            return Err(format!(
                "voxels hold {counted} points, statistics {}",
                self.sums.points
            ));
        }
        self.validate_changes()
    }
}

impl VoxelStore for VoxelList {
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
        self.slots.len()
    }

    fn contains(&self, key: Key) -> bool {
        self.slots.contains_key(&key)
    }

    fn sorted_keys(&self) -> Vec<Key> {
        let mut keys: Vec<Key> = self.slots.keys().copied().collect();
        keys.par_sort_unstable();
        keys
    }

    fn insert(&mut self, cloud: &Cloud) -> InsertReport {
        VoxelList::insert(self, cloud)
    }

    fn remove(&mut self, key: Key) -> bool {
        let Some(slot) = self.slots.remove(&key) else {
            return false;
        };
        if slot.changed {
            self.changed.retain(|k| *k != key);
        }
        if slot.announced {
            self.removed.insert(key);
        }
        true
    }

    fn bytes(&self) -> usize {
        self.slots.capacity() * (size_of::<(Key, Slot)>() + 1)
    }
}

impl fmt::Debug for VoxelList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let datum: [f64; 3] = self.datum_m.into();
        write!(
            f,
            "VoxelList({:?}, datum {datum:?} m, {} voxels)",
            self.lattice,
            self.len()
        )
    }
}
