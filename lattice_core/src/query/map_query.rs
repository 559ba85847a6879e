//! A map prepared for queries.

use std::sync::{Arc, OnceLock};

use super::center_tree::PreparedNearest;
use super::shells::Shells;
use super::tree::Tree;

/// Queries of one state of a store.
///
/// Points near the surface are resolved by probing cells in order of distance. The first query that this cannot
/// resolve sorts the keys (8 bytes each, kept). Later ones search the octree of the sorted Morton keys in logarithmic
/// time.
///
/// ```
/// use lattice_core::cloud::Cloud;
/// use lattice_core::lattice::{Lattice, LatticeKind};
/// use lattice_core::nalgebra::Vector3;
/// use lattice_core::query::{Query, Segment};
/// use lattice_core::voxels::VoxelList;
///
/// let lattice = Lattice::new(LatticeKind::Cubic, 1.0)?;
/// let mut map = VoxelList::new(lattice, Vector3::zeros(), 1000)?;
/// map.insert(&Cloud::from_points(0, Vector3::zeros(), &[Vector3::zeros()]));
///
/// let query = Query::new(&map);
/// let point_m = Vector3::new(2.0, 0.0, 0.0);
/// assert_eq!(query.nearest(&point_m, 1)?[0].distance_m, 2.0); // to the centre
/// let clearance = query.clearance(&Segment::point(point_m), 10.0)?;
/// assert_eq!(clearance.map(|found| found.distance_m), Some(1.5)); // to the cube
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Query<'a, S> {
    pub(super) store: &'a S,
    pub(super) shells: Arc<Shells>,
    pub(super) tree: OnceLock<Tree>,
    /// See [`Query::prepare_nearest`]; `None` if the cells exceed 32-bit indices.
    pub(super) prepared: OnceLock<Option<PreparedNearest>>,
}
