//! Random occupied voxels.

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind, MortonKey};
use lattice_core::voxels::VoxelList;
use nalgebra::Vector3;
use proptest::prelude::*;

/// A lattice, a datum and points about it, metres.
#[derive(Clone, Debug)]
pub struct World {
    pub kind: LatticeKind,
    pub cell_volume_m3: f64,
    pub datum_m: Vector3<f64>,
    pub offsets_m: Vec<Vector3<f64>>,
}

impl World {
    /// The voxels that hold the points.
    pub fn voxels(&self) -> VoxelList {
        let lattice = Lattice::new(self.kind, self.cell_volume_m3).unwrap();
        let mut voxels = VoxelList::new(lattice, self.datum_m, usize::MAX).unwrap();
        let points: Vec<_> = self.offsets_m.iter().map(|o| self.datum_m + o).collect();
        voxels.insert(&Cloud::from_points(0, self.datum_m, &points));
        voxels
    }
}

/// A point in a cube around 0.
pub fn any_offset(half_side_m: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-half_side_m..half_side_m).prop_map(Vector3::from)
}

/// Up to `most` points in clusters a few cells wide and far apart, near or far from the origin.
pub fn any_world(most: usize) -> impl Strategy<Value = World> {
    let datum = prop_oneof![
        Just(Vector3::zeros()),
        any_offset(100.0),
        any_offset(1e6),
        any_offset(3e7),
    ];
    let point = prop_oneof![
        6 => any_offset(1.5),
        3 => any_offset(8.0),
        1 => any_offset(300.0),
    ];
    let kind = prop::sample::select(&LatticeKind::ALL[..]);
    let volume = prop_oneof![Just(0.125), 0.02..3.0];
    let points = prop::collection::vec(point, 0..most);
    (kind, volume, datum, points).prop_map(|(kind, cell_volume_m3, datum_m, offsets_m)| World {
        kind,
        cell_volume_m3,
        datum_m,
        offsets_m,
    })
}

/// More voxels than are ever probed, so that searches start with shells: a block of ground.
pub fn ground(kind: LatticeKind, datum_m: Vector3<f64>) -> VoxelList {
    let step = |i: usize| i as f64 * 0.3 - 15.0;
    let offset = |i: usize| Vector3::new(step(i % 100), step(i / 100), 0.3 * step(i % 37).sin());
    World {
        kind,
        cell_volume_m3: 0.027,
        datum_m,
        offsets_m: (0..10_000).map(offset).collect(),
    }
    .voxels()
}

/// Every occupied cell with its centre in the frame of the datum.
pub fn cells(voxels: &VoxelList) -> Vec<(MortonKey, Vector3<f64>)> {
    let all = voxels.sorted().into_iter();
    all.map(|(key, _)| (key, voxels.lattice().center(key.unpack())))
        .collect()
}
