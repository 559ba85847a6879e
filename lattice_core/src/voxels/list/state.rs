//! Shards of a voxel list.

use nalgebra::Vector3;

use crate::lattice::Lattice;
use crate::voxels::distortion::DistortionSums;
use crate::voxels::store::payload_columns::Payload;
use crate::voxels::store::shard::Shard;

/// Policy of a full list for points in new cells.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum WhenFull {
    /// Refuses them; points in existing cells still count.
    #[default]
    Refuse,
    /// Evicts the least recently changed voxels until 7/8 of the limit are left.
    ///
    /// Points are inserted in portions of at most 1/8 of the limit. Before a portion that may not fit, voxels are
    /// evicted in the order of the state of their last change, then of their cells: the same on any number of
    /// threads. No point is refused, except by a list of at most 0 voxels.
    ForgetOldest,
}

/// Occupied voxel list of a lattice whose indices count from a datum in the map frame.
///
/// The datum is a lattice point of the map frame. Lists with one lattice and datum have the same cells, and points
/// far from the map origin keep their precision.
///
/// ```
/// use lattice_core::cloud::Cloud;
/// use lattice_core::lattice::{Lattice, LatticeKind};
/// use lattice_core::nalgebra::Vector3;
/// use lattice_core::voxels::VoxelList;
///
/// let lattice = Lattice::new(LatticeKind::Cubic, 1.0)?;
/// let mut list = VoxelList::new(lattice, Vector3::zeros(), 1000)?;
/// let points_m = [0.1, 0.2, 2.0].map(|x| Vector3::new(x, 0.0, 0.0));
/// let report = list.insert(&Cloud::from_points(0, Vector3::zeros(), &points_m));
/// assert_eq!((report.inserted, report.new_voxels), (3, 2));
/// let counts: Vec<_> = list.sorted().iter().map(|(_, voxel)| voxel.count).collect();
/// assert_eq!(counts, [2, 1]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct VoxelList {
    pub(crate) lattice: Lattice,
    pub(crate) datum_index: [i64; 3],
    pub(crate) datum_m: Vector3<f64>,
    pub(crate) max_voxels: usize,
    pub(crate) when_full: WhenFull,
    pub(crate) payload: Payload,
    pub(crate) shards: Vec<Shard>,
    pub(crate) sums: DistortionSums,
    /// State counter.
    pub(crate) sequence: u32,
    /// State at the last `take_changes`.
    pub(crate) taken: u32,
}
