//! What every store of occupied voxels can do.

use nalgebra::Vector3;

use super::InsertReport;
use crate::cloud::Cloud;
use crate::lattice::{Key, Lattice};

/// Occupied voxels of a lattice whose indices count from a datum in the map frame.
///
/// Two stores implement it: [`super::VoxelList`] keeps a payload for each voxel,
/// `OccupancyList` keeps one bit. Queries, set operations and files are written against this trait.
pub trait VoxelStore: Sync {
    /// The lattice; its indices count from [`VoxelStore::datum_index`].
    fn lattice(&self) -> &Lattice;

    /// Index of the datum in the lattice of the map frame.
    fn datum_index(&self) -> [i64; 3];

    /// The lattice point that keys count from, map frame, metres.
    fn datum_m(&self) -> Vector3<f64>;

    /// Number of occupied voxels.
    fn len(&self) -> usize;

    /// True if the cell is occupied.
    fn contains(&self, key: Key) -> bool;

    /// All occupied cells in ascending (Morton) order.
    fn sorted_keys(&self) -> Vec<Key>;

    /// Adds every finite point in range to its cell.
    fn insert(&mut self, cloud: &Cloud) -> InsertReport;

    /// Removes a voxel; false if the cell was not occupied.
    fn remove(&mut self, key: Key) -> bool;

    /// Memory that the store holds, bytes.
    fn bytes(&self) -> usize;

    /// True if no voxel is occupied.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Centre of a cell, map frame, metres.
    fn center_m(&self, key: Key) -> Vector3<f64> {
        self.datum_m() + self.lattice().center(key.unpack())
    }

    /// The cell of a point (map frame, metres), `None` if not finite or out of the range of keys.
    fn key_of(&self, point_m: &Vector3<f64>) -> Option<Key> {
        let w = self.lattice().quantize(&(point_m - self.datum_m()))?;
        Key::pack(w)
    }
}
