//! Line segments, for clearance queries.

use nalgebra::Vector3;

use super::QueryError;
use super::error::check_point;

/// Line segment between two points of the map frame, metres; they may be equal.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Segment {
    /// First end.
    pub from_m: Vector3<f64>,
    /// Second end.
    pub to_m: Vector3<f64>,
}

impl Segment {
    /// Creates a segment of one point.
    pub fn point(at_m: Vector3<f64>) -> Segment {
        Segment {
            from_m: at_m,
            to_m: at_m,
        }
    }

    /// End of the segment that is farther in a direction (of any length).
    pub(super) fn support_m(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        if (self.to_m - self.from_m).dot(direction) > 0.0 {
            self.to_m
        } else {
            self.from_m
        }
    }

    /// Centre and radius of the enclosing ball.
    pub(super) fn ball_m(&self) -> (Vector3<f64>, f64) {
        let half = 0.5 * (self.to_m - self.from_m);
        (self.from_m + half, half.norm())
    }

    pub(super) fn moved(&self, by_m: &Vector3<f64>) -> Segment {
        Segment {
            from_m: self.from_m + by_m,
            to_m: self.to_m + by_m,
        }
    }

    pub(super) fn check(&self) -> Result<(), QueryError> {
        check_point(&self.from_m)?;
        check_point(&self.to_m)
    }

    /// Distance to a point, subject to rounding.
    pub(super) fn distance_m(&self, point_m: &Vector3<f64>) -> f64 {
        let along = self.to_m - self.from_m;
        let to_point = point_m - self.from_m;
        let length_squared = along.norm_squared();
        if length_squared == 0.0 {
            return to_point.norm();
        }
        let t = (to_point.dot(&along) / length_squared).clamp(0.0, 1.0);
        (to_point - along * t).norm()
    }
}
