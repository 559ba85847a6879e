//! Distance from a point or line to the occupied cells.

use nalgebra::Vector3;

use super::error::check_distance;
use super::search::Search;
use super::{Query, QueryError, Segment, gjk};
use crate::lattice::{MortonKey, VoronoiCell};
use crate::voxels::VoxelStore;

/// Occupied cell nearest to a segment.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Clearance {
    /// Distance from the segment to the cell, metres; 0 if they touch or overlap.
    pub distance_m: f64,
    /// Key of the cell.
    pub key: MortonKey,
}

impl<S: VoxelStore> Query<'_, S> {
    /// Distance from a point or segment to the nearest occupied cell as a polyhedron; `None` if it exceeds `max_m`.
    pub fn clearance(
        &self,
        segment: &Segment,
        max_m: f64,
    ) -> Result<Option<Clearance>, QueryError> {
        segment.check()?;
        check_distance(max_m)?;
        if self.store.is_empty() {
            return Ok(None);
        }
        let lattice = self.store.lattice();
        let mut search = ClearanceSearch {
            segment: segment.moved(&-self.store.datum_m()),
            cell: lattice.cell(),
            covering_radius_m: lattice.covering_radius_m(),
            limit_m: max_m,
            best: None,
        };
        self.run(&mut search);
        Ok(search.best)
    }

    /// Tests whether no occupied cell touches the segment inflated by `radius_m`.
    pub fn is_free(&self, segment: &Segment, radius_m: f64) -> Result<bool, QueryError> {
        Ok(self.clearance(segment, radius_m)?.is_none())
    }
}

/// Distance between a segment and a cell at a centre, in one frame.
pub(super) fn cell_distance_m(
    segment: &Segment,
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
        segment.support_m(direction) - center_m - lowest.1
    })
}

struct ClearanceSearch<'a> {
    segment: Segment,
    cell: &'a VoronoiCell,
    covering_radius_m: f64,
    /// Farther cells do not matter.
    limit_m: f64,
    best: Option<Clearance>,
}

impl Search for ClearanceSearch<'_> {
    fn ball(&self) -> (Vector3<f64>, f64) {
        self.segment.ball_m()
    }

    fn distance_m(&self, point_m: &Vector3<f64>) -> f64 {
        self.segment.distance_m(point_m)
    }

    fn reach_m(&self) -> f64 {
        self.limit_m + self.covering_radius_m
    }

    fn visit(&mut self, key: MortonKey, center_m: &Vector3<f64>) {
        // Contact with a lower key cannot be improved.
        let settled = |best: Clearance| best.distance_m == 0.0 && best.key < key;
        let slack_m = 1e-9 * self.covering_radius_m;
        if self.best.is_some_and(settled) || self.distance_m(center_m) > self.reach_m() + slack_m {
            return;
        }
        let distance_m = cell_distance_m(&self.segment, self.cell, center_m);
        let better = |best: Clearance| (distance_m, key) < (best.distance_m, best.key);
        if distance_m <= self.limit_m && self.best.is_none_or(better) {
            self.limit_m = distance_m;
            self.best = Some(Clearance { distance_m, key });
        }
    }

    fn restart(&mut self) {}
}
