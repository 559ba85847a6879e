//! Interface of all stores of occupied voxels.

use nalgebra::Vector3;

use super::{InsertReport, Region};
use crate::cloud::Cloud;
use crate::lattice::{BlockKey, Lattice, LatticeIndex, MortonKey};

/// Store of occupied voxels of a lattice whose indices count from a datum in the map frame.
///
/// Implementations: [`super::VoxelList`] with a payload per voxel, `OccupancyList` with one bit. Queries, set
/// operations and files use this trait.
pub trait VoxelStore: Sync {
    /// Lattice; its indices count from [`VoxelStore::datum_index`].
    fn lattice(&self) -> &Lattice;

    /// Index of the datum in the lattice of the map frame.
    fn datum_index(&self) -> [i64; 3];

    /// Datum: lattice point that keys count from, map frame, metres.
    fn datum_m(&self) -> Vector3<f64>;

    /// Number of occupied voxels.
    fn len(&self) -> usize;

    /// Tests whether a cell is occupied.
    fn contains(&self, key: MortonKey) -> bool;

    /// Tests whether the cell of an index is occupied.
    #[inline]
    fn holds(&self, w: LatticeIndex) -> bool {
        MortonKey::pack(w).is_some_and(|key| self.contains(key))
    }

    /// Occupied cells of a block by its number ([`BlockKey::block`]): bit `place % 64` of word `place / 64` for each
    /// [`BlockKey::place`].
    fn block_mask(&self, block: u64) -> [u64; 8] {
        let mut mask = [0; 8];
        for (first, word) in (0..).step_by(64).zip(&mut mask) {
            for bit in 0..64 {
                let code =
                    BlockKey::from_raw(block.saturating_mul(512).saturating_add(first + bit));
                let key = code.and_then(BlockKey::key);
                *word |= u64::from(key.is_some_and(|key| self.contains(key))) << bit;
            }
        }
        mask
    }

    /// All occupied cells in ascending (Morton) order.
    fn sorted_keys(&self) -> Vec<MortonKey>;

    /// Adds every finite point in range to its cell.
    fn insert(&mut self, cloud: &Cloud) -> InsertReport;

    /// Removes a voxel; false if the cell was not occupied.
    fn remove(&mut self, key: MortonKey) -> bool;

    /// Keys of the voxels with their centre in a region, unordered.
    fn keys_in(&self, region: &Region) -> Vec<MortonKey>;

    /// Memory of the store, bytes.
    fn bytes(&self) -> usize;

    /// Tests whether there is no voxel.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Centre of a cell, map frame, metres.
    fn center_m(&self, key: MortonKey) -> Vector3<f64> {
        self.datum_m() + self.lattice().center(key.unpack())
    }

    /// Mean of the points of a voxel, map frame, metres: the centre of its cell where means are not kept; `None` if the
    /// cell is not occupied.
    fn mean_m(&self, key: MortonKey) -> Option<Vector3<f64>> {
        self.contains(key).then(|| self.center_m(key))
    }

    /// Cell of a point (map frame, metres); `None` if not finite or out of the range of keys.
    fn key_of(&self, point_m: &Vector3<f64>) -> Option<MortonKey> {
        let w = self.lattice().quantize(&(point_m - self.datum_m()))?;
        MortonKey::pack(w)
    }

    /// Removes the voxels with their centre in a region; returns their number.
    fn remove_region(&mut self, region: &Region) -> usize {
        let keys = self.keys_in(region);
        keys.into_iter().filter(|key| self.remove(*key)).count()
    }
}
