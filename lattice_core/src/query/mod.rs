//! Questions about the occupied voxels of any store: the nearest ones, the clearance of a shape, and
//! the shortest way around them.
//!
//! Everything is in the map frame, metres. Two distances are in use, by name:
//! - `nearest` measures to the centres of occupied cells;
//! - `clearance` measures to the cells themselves, convex polyhedra, which no point in them can beat.
//!
//! Answers are exact up to the rounding of f64, do not depend on the number of threads or on earlier
//! questions, and go to the lower key where distances are equal.

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

/// Coordinates and distances beyond this are refused, metres: a thousand times the largest map.
pub const MAX_COORDINATE_M: f64 = 1e12;

/// Questions about one state of a store.
///
/// Points near the surface are answered by probing cells in order of distance. The first question
/// that this cannot settle sorts the keys (8 bytes each, kept), after which a search in the octree
/// that sorted Morton keys form answers in logarithmic time.
pub struct Query<'a, S> {
    store: &'a S,
    shells: Arc<Shells>,
    tree: OnceLock<Tree>,
    /// See [`Query::prepare_nearest`]; none of more cells than it numbers.
    prepared: OnceLock<Option<PreparedNearest>>,
}

impl<'a, S: VoxelStore> Query<'a, S> {
    /// Questions about `store` as it is now.
    pub fn new(store: &'a S) -> Query<'a, S> {
        Query::with_shells(store, Arc::new(Shells::new(store.lattice())))
    }

    /// As [`Query::new`] with what [`Shells::new`] made of the same lattice earlier, which saves
    /// a millisecond where the store changes between questions. Other shells are replaced.
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

    /// The same with what [`Query::prepare_nearest`] gave of this state of the store.
    pub fn with_prepared(self, prepared: PreparedNearest) -> Query<'a, S> {
        Query {
            prepared: OnceLock::from(Some(prepared)),
            ..self
        }
    }

    /// The store that is asked.
    pub fn store(&self) -> &'a S {
        self.store
    }

    /// The key of the cell that holds a point (map frame, metres), if it is occupied.
    pub fn occupied(&self, point_m: &Vector3<f64>) -> Option<MortonKey> {
        let key = self.store.key_of(point_m)?;
        self.store.contains(key).then_some(key)
    }

    /// Runs a search by whichever way suits; the answer is the same.
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

    /// A point of the map frame in the frame of the datum.
    fn local(&self, point_m: &Vector3<f64>) -> Result<Vector3<f64>, QueryError> {
        let local = point_m - self.store.datum_m();
        error::check_point(point_m)?;
        Ok(local)
    }
}
