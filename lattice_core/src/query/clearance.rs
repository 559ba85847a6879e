//! Distance from a shape to the occupied cells.

use nalgebra::Vector3;

use super::error::check_distance;
use super::search::Search;
use super::{ConvexShape, Query, QueryError, gjk};
use crate::lattice::{MortonKey, VoronoiCell};
use crate::voxels::VoxelStore;

/// The occupied cell that limits a shape.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Clearance {
    /// Distance from the shape to the cell, metres; 0 if they touch or overlap.
    pub distance_m: f64,
    /// The cell.
    pub key: MortonKey,
}

impl<S: VoxelStore> Query<'_, S> {
    /// Distance from a shape (a point, [`super::Segment`] or your own) to the nearest
    /// occupied cell, taken as the polyhedron that it is; `None` if that is more than `max_m`.
    pub fn clearance(
        &self,
        shape: &impl ConvexShape,
        max_m: f64,
    ) -> Result<Option<Clearance>, QueryError> {
        shape.check()?;
        check_distance(max_m)?;
        Ok(self.clearance_of(&shape.moved(&-self.store.datum_m()), max_m))
    }

    /// True if no occupied cell touches the shape widened by `radius_m`.
    pub fn is_free(&self, shape: &impl ConvexShape, radius_m: f64) -> Result<bool, QueryError> {
        Ok(self.clearance(shape, radius_m)?.is_none())
    }

    /// [`Query::clearance`] in the frame of the datum, of a valid shape.
    pub(super) fn clearance_of(&self, local: &impl ConvexShape, max_m: f64) -> Option<Clearance> {
        if self.store.is_empty() {
            return None;
        }
        let lattice = self.store.lattice();
        let mut search = ClearanceSearch {
            shape: local,
            cell: lattice.cell(),
            covering_radius_m: lattice.covering_radius_m(),
            best: Best::new(max_m),
        };
        self.run(&mut search);
        search.best.clearance
    }
}

/// Distance between a shape and a cell around a centre, in one frame.
pub(super) fn cell_distance_m(
    shape: &impl ConvexShape,
    cell: &VoronoiCell,
    center_m: &Vector3<f64>,
) -> f64 {
    gjk::distance_m(|direction| {
        let mut lowest = (f64::INFINITY, Vector3::zeros());
        for vertex in &cell.vertices {
            let height = vertex.dot(direction);
            if height < lowest.0 {
                lowest = (height, *vertex);
            }
        }
        shape.support_m(direction) - center_m - lowest.1
    })
}

/// The least clearance so far.
struct Best {
    /// Cells that are farther do not matter.
    limit_m: f64,
    clearance: Option<Clearance>,
}

impl Best {
    fn new(limit_m: f64) -> Best {
        Best {
            limit_m,
            clearance: None,
        }
    }

    fn take(&mut self, other: Option<Clearance>) {
        let Some(other) = other.filter(|other| other.distance_m <= self.limit_m) else {
            return;
        };
        let better = self
            .clearance
            .is_none_or(|best| (other.distance_m, other.key) < (best.distance_m, best.key));
        if better {
            self.limit_m = other.distance_m;
            self.clearance = Some(other);
        }
    }
}

struct ClearanceSearch<'a, C> {
    shape: &'a C,
    cell: &'a VoronoiCell,
    covering_radius_m: f64,
    best: Best,
}

impl<C: ConvexShape> Search for ClearanceSearch<'_, C> {
    fn ball(&self) -> (Vector3<f64>, f64) {
        self.shape.ball_m()
    }

    fn distance_m(&self, point_m: &Vector3<f64>) -> f64 {
        self.shape.distance_below_m(point_m)
    }

    fn reach_m(&self) -> f64 {
        self.best.limit_m + self.covering_radius_m
    }

    fn visit(&mut self, key: MortonKey, center_m: &Vector3<f64>) {
        // In contact with a lower key already: no cell can do better.
        let settled = |best: Clearance| best.distance_m == 0.0 && best.key < key;
        let slack_m = 1e-9 * self.covering_radius_m;
        if self.best.clearance.is_some_and(settled)
            || self.distance_m(center_m) > self.reach_m() + slack_m
        {
            return;
        }
        let distance_m = cell_distance_m(self.shape, self.cell, center_m);
        self.best.take(Some(Clearance { distance_m, key }));
    }

    fn restart(&mut self) {}
}
