//! How far shapes and swept paths are from occupied cells.

use nalgebra::{Isometry3, Vector3};

use super::error::check_distance;
use super::search::Search;
use super::shape::BoxHull;
use super::{ConvexShape, OrientedBox, Query, QueryError, Segment, gjk};
use crate::lattice::{MortonKey, VoronoiCell};
use crate::voxels::VoxelStore;

/// Most convex pieces that a swept path may need.
pub const MAX_PIECES: usize = 1 << 16;

/// The occupied cell that limits a shape.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Clearance {
    /// Distance from the shape to the cell, metres; 0 if they touch or overlap.
    pub distance_m: f64,
    /// The cell.
    pub key: MortonKey,
}

impl<S: VoxelStore> Query<'_, S> {
    /// Distance from a shape (a point, [`Segment`], [`OrientedBox`] or your own) to the nearest
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

    /// Bounds of the clearance of a point from centres alone, some times cheaper: lower and upper,
    /// metres, apart by the covering less the packing radius; `None` in an empty store.
    pub fn clearance_bounds(
        &self,
        point_m: &Vector3<f64>,
    ) -> Result<Option<(f64, f64)>, QueryError> {
        let lattice = self.store.lattice();
        let nearest = self.nearest_to(self.local(point_m)?, 1, f64::INFINITY);
        Ok(nearest.first().map(|found| {
            let to_cell = |radius_m: f64| (found.distance_m - radius_m).max(0.0);
            (
                to_cell(lattice.covering_radius_m()),
                to_cell(lattice.packing_radius_m()),
            )
        }))
    }

    /// [`Query::clearance`] of a line through points; subtract the radius of a ball that moves on it.
    /// On contact the key is one of the first leg that touches.
    pub fn path_clearance(
        &self,
        path_m: &[Vector3<f64>],
        max_m: f64,
    ) -> Result<Option<Clearance>, QueryError> {
        if let [point_m] = path_m {
            return self.clearance(point_m, max_m);
        }
        if path_m.is_empty() {
            return Err(QueryError::EmptyPath);
        }
        check_distance(max_m)?;
        let mut best = Best::new(max_m);
        for (&from_m, &to_m) in path_m.iter().zip(path_m.iter().skip(1)) {
            let leg = Segment { from_m, to_m };
            leg.check()?;
            if !best.is_contact() {
                let local = leg.moved(&-self.store.datum_m());
                best.take(self.clearance_of(&local, best.limit_m));
            }
        }
        Ok(best.clearance)
    }

    /// Clearance of a box that moves through poses (map from box), centre along straight lines and
    /// turning evenly.
    ///
    /// The box between two poses is replaced by hulls that hold it, so that the distance is never
    /// too large, and too small by at most 1/10 of the packing radius.
    pub fn swept_box_clearance(
        &self,
        half_extents_m: &Vector3<f64>,
        poses: &[Isometry3<f64>],
        max_m: f64,
    ) -> Result<Option<Clearance>, QueryError> {
        let at = |pose: &Isometry3<f64>| OrientedBox {
            pose: *pose,
            half_extents_m: *half_extents_m,
        };
        if let [pose] = poses {
            return self.clearance(&at(pose), max_m);
        }
        if poses.is_empty() {
            return Err(QueryError::EmptyPath);
        }
        check_distance(max_m)?;
        let mut hulls = Vec::with_capacity(poses.len());
        let mut pieces = 0.0;
        for (from, to) in poses.iter().zip(poses.iter().skip(1)) {
            let hull = BoxHull {
                from: at(from),
                to: at(to),
            };
            hull.check()?;
            pieces += 2.0 * excess_m(&hull) / self.allowed_excess_m() + 1.0;
            hulls.push(hull);
        }
        if pieces > MAX_PIECES as f64 {
            return Err(QueryError::TooManyPieces(pieces));
        }
        let mut best = Best::new(max_m);
        for hull in hulls {
            self.sweep(hull, &mut best);
        }
        Ok(best.clearance)
    }

    fn allowed_excess_m(&self) -> f64 {
        0.1 * self.store.lattice().packing_radius_m()
    }

    /// Halves the motion until its hull is good enough; each half has half of the excess or less.
    fn sweep(&self, hull: BoxHull, best: &mut Best) {
        if best.is_contact() {
            return;
        }
        if excess_m(&hull) > self.allowed_excess_m() {
            let middle = halfway(&hull);
            self.sweep(BoxHull { to: middle, ..hull }, best);
            let second = BoxHull {
                from: middle,
                ..hull
            };
            return self.sweep(second, best);
        }
        let bulge_m = bulge_m(&hull);
        let local = hull.moved(&-self.store.datum_m());
        let found = self.clearance_of(&local, best.limit_m + bulge_m);
        best.take(found.map(|found| Clearance {
            distance_m: (found.distance_m - bulge_m).max(0.0),
            ..found
        }));
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

/// No point of the moving box is farther than this from the hull of its first and last place.
///
/// A point at most r from the centre runs, but for the shared straight motion, on an arc with angle
/// theta in unit time; its distance from the even motion between its ends is at most
/// max |acceleration| / 8 = r theta^2 / 8.
fn bulge_m(hull: &BoxHull) -> f64 {
    let theta = turn_at_most(hull);
    hull.from.half_extents_m.norm() * theta * theta / 8.0
}

/// How much less than the true clearance that of the hull less its bulge may be.
///
/// A point of the hull is (1 - t) R0 x + t R1 y. With z = (1 - t) x + t y it differs from R(t) z, which
/// the box reaches, by at most a bulge and t (1 - t) |R1 - R0| |x - y| <= r theta / 2.
fn excess_m(hull: &BoxHull) -> f64 {
    0.5 * hull.from.half_extents_m.norm() * turn_at_most(hull) + 2.0 * bulge_m(hull)
}

/// An upper bound of the angle between the two poses, radians.
fn turn_at_most(hull: &BoxHull) -> f64 {
    let (a, b) = (hull.from.pose.rotation.coords, hull.to.pose.rotation.coords);
    // Both signs of a quaternion are the same rotation.
    let chord_squared = (a - b).norm_squared().min((a + b).norm_squared());
    // chord = 2 sin(theta / 4), and asin x <= x (1 + x^2) for x <= 0.9; here x <= 1 / sqrt 2.
    let x_squared = 0.25 * chord_squared;
    4.0 * x_squared.sqrt() * (1.0 + x_squared)
}

/// The box in the middle of the motion; the mean of two quaternions is half of the turn exactly.
fn halfway(hull: &BoxHull) -> OrientedBox {
    let (from, to) = (&hull.from.pose, &hull.to.pose);
    let (a, b) = (from.rotation.coords, to.rotation.coords);
    let sum = if a.dot(&b) < 0.0 { a - b } else { a + b };
    let rotation = nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::from(sum));
    let center = 0.5 * (from.translation.vector + to.translation.vector);
    OrientedBox {
        pose: Isometry3::from_parts(center.into(), rotation),
        half_extents_m: hull.from.half_extents_m,
    }
}

/// The least clearance so far.
struct Best {
    /// What is farther does not matter.
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

    fn is_contact(&self) -> bool {
        self.clearance.is_some_and(|best| best.distance_m == 0.0)
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
