//! Checksum of a list, without sorting its voxels.

use rayon::prelude::*;

use super::VoxelList;
use crate::lattice::MortonKey;
use crate::voxels::Voxel;
use crate::voxels::store::shard::Shard;

impl VoxelList {
    /// Checksum of the keys, counts and offset sums of all voxels.
    ///
    /// Lists of the same points have the same checksum, whatever the order of the points and the number of threads.
    pub fn checksum(&self) -> u64 {
        let sum = |shard: &Shard| {
            shard
                .iter()
                .filter_map(|(code, entry)| Some(of_voxel(code.key()?, &shard.voxel(code, entry))))
                .fold(0, u64::wrapping_add)
        };
        (self.shards.par_iter().map(sum)).reduce(|| 0, u64::wrapping_add)
    }
}

fn of_voxel(key: MortonKey, voxel: &Voxel) -> u64 {
    let [x, y, z] = voxel.sum.map(i64::cast_unsigned);
    [u64::from(voxel.count), x, y, z]
        .into_iter()
        .fold(mix(key.raw()), |sum, value| mix(sum ^ value))
}

/// The finalizer of splitmix64 (Steele, Lea & Flood 2014).
fn mix(z: u64) -> u64 {
    let z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::cloud::Cloud;
    use crate::lattice::{Lattice, LatticeKind};

    fn list_of(points_m: impl Iterator<Item = Vector3<f64>>) -> VoxelList {
        let lattice = Lattice::new(LatticeKind::Bcc, 0.5).unwrap();
        let mut list = VoxelList::new(lattice, Vector3::zeros(), 1_000_000).unwrap();
        let points_m: Vec<_> = points_m.collect();
        list.insert(&Cloud::from_points(0, Vector3::zeros(), &points_m));
        list
    }

    #[test]
    fn depends_on_points_and_not_on_their_order() {
        let point = |i: u32| {
            let turn = f64::from(i) * 0.377;
            Vector3::new(20.0 * turn.sin(), 20.0 * turn.cos(), turn % 7.0)
        };
        let wanted = list_of((0..5000).map(point)).checksum();
        assert_eq!(list_of((0..5000).rev().map(point)).checksum(), wanted);
        assert_ne!(list_of((0..4999).map(point)).checksum(), wanted);
        let moved = |i| point(i) + Vector3::x() * if i == 17 { 1e-3 } else { 0.0 };
        assert_ne!(list_of((0..5000).map(moved)).checksum(), wanted);
        assert_eq!(list_of(std::iter::empty()).checksum(), 0);
    }
}
