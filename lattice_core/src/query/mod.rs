//! Queries of the occupied voxels of a store: nearest cells, clearance and shortest paths.
//!
//! Everything is in the map frame, metres. Two distances are defined:
//! - `nearest`: to the centres of occupied cells
//! - `clearance`: to the cells themselves, convex polyhedra
//!
//! Results are exact up to the rounding of f64 and independent of the number of threads and of earlier queries. Of
//! equal distances the lower key wins.

mod center_tree;
mod clearance;
mod corridor;
mod error;
mod gjk;
mod nearest;
mod path;
mod search;
mod segment;
mod shells;
mod tree;

use std::sync::{Arc, OnceLock};

use nalgebra::Vector3;

use crate::lattice::MortonKey;
use crate::voxels::VoxelStore;

pub use center_tree::PreparedNearest;
pub use clearance::Clearance;
pub use corridor::MAX_ROBOT_CELLS;
pub use error::QueryError;
pub use nearest::Neighbor;
pub use path::{Bounds, Path, PathError, PathOptions, Steps};
pub use segment::Segment;
pub use shells::Shells;

use search::Search;
use tree::Tree;

/// Maximum coordinate and distance, metres: a thousand times the largest map.
pub const MAX_COORDINATE_M: f64 = 1e12;

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
    store: &'a S,
    shells: Arc<Shells>,
    tree: OnceLock<Tree>,
    /// See [`Query::prepare_nearest`]; `None` if the cells exceed 32-bit indices.
    prepared: OnceLock<Option<PreparedNearest>>,
}

impl<'a, S: VoxelStore> Query<'a, S> {
    /// Creates queries of the current state of `store`.
    pub fn new(store: &'a S) -> Query<'a, S> {
        Query::with_shells(store, Arc::new(Shells::new(store.lattice())))
    }

    /// Creates queries with [`Shells`] made earlier for the same lattice, which saves a millisecond if the store
    /// changes between queries. Shells of another lattice are replaced.
    pub fn with_shells(store: &'a S, shells: Arc<Shells>) -> Query<'a, S> {
        let shells = if shells.are_of(store.lattice()) {
            shells
        } else {
            Arc::new(Shells::new(store.lattice()))
        };
        Query {
            store,
            shells,
            tree: OnceLock::new(),
            prepared: OnceLock::new(),
        }
    }

    /// Uses a tree from [`Query::prepare_nearest`] of this state of the store.
    #[must_use]
    pub fn with_prepared(self, prepared: PreparedNearest) -> Query<'a, S> {
        Query {
            prepared: OnceLock::from(Some(prepared)),
            ..self
        }
    }

    /// Store of the queries.
    pub fn store(&self) -> &'a S {
        self.store
    }

    /// Key of the cell that contains a point (map frame, metres), if it is occupied.
    pub fn occupied(&self, point_m: &Vector3<f64>) -> Option<MortonKey> {
        let key = self.store.key_of(point_m)?;
        self.store.contains(key).then_some(key)
    }

    /// Runs a search by the faster method; the result is the same.
    fn run(&self, search: &mut impl Search) {
        let few = self.store.len() <= self.shells.len();
        if self.tree.get().is_none() && !few {
            if self.shells.search(self.store, search) {
                return;
            }
            search.restart();
        }
        self.tree().search(search);
    }

    fn tree(&self) -> &Tree {
        self.tree
            .get_or_init(|| Tree::new(self.store.lattice().clone(), self.store.sorted_keys()))
    }

    /// Converts a point from the map frame to the datum.
    fn local(&self, point_m: &Vector3<f64>) -> Result<Vector3<f64>, QueryError> {
        let local = point_m - self.store.datum_m();
        error::check_point(point_m)?;
        Ok(local)
    }
}
