//! Queries of the occupied voxels of a store: nearest cells, clearance and shortest paths.
//!
//! Everything is in the map frame, metres. Two distances are defined:
//! - `nearest`: to the centres of occupied cells
//! - `clearance`: to the cells themselves, convex polyhedra
//!
//! Results are exact up to the rounding of f64 and independent of the number of threads and of earlier queries. Of
//! equal distances the lower key wins.

mod bounds;
mod cell_search;
mod center_tree;
mod clearance;
mod corridor;
mod error;
mod free_places;
mod gjk;
mod limits;
mod map_query;
mod nearest;
mod path;
mod path_error;
mod search;
mod segment;
mod shells;
mod stencil;
mod step_length;
mod straight_path;
mod tree;

use std::sync::{Arc, OnceLock};

use nalgebra::Vector3;

use crate::lattice::MortonKey;
use crate::voxels::VoxelStore;

pub use bounds::Bounds;
pub use center_tree::PreparedNearest;
pub use clearance::Clearance;
pub use error::QueryError;
pub use limits::MAX_ROBOT_CELLS;
pub use nearest::Neighbor;
pub use path::{Path, PathError, PathOptions, Steps};
pub use segment::Segment;
pub use shells::Shells;

pub use limits::MAX_COORDINATE_M;
pub use map_query::Query;
use search::Search;
use tree::Tree;

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
