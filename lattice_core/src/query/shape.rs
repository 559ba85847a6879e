//! Convex shapes that can be asked for their clearance.

use nalgebra::Vector3;

use super::QueryError;
use super::error::check_point;

/// A convex, bounded shape in the map frame, metres.
pub trait ConvexShape: Sync + Sized {
    /// A point of the shape that is farthest in a direction (of any length).
    fn support_m(&self, direction: &Vector3<f64>) -> Vector3<f64>;

    /// Centre and radius of a ball around the shape.
    fn ball_m(&self) -> (Vector3<f64>, f64);

    /// The shape moved by a vector.
    fn moved(&self, by_m: &Vector3<f64>) -> Self;

    /// Fails if a number in it is not finite, too large or senseless.
    fn check(&self) -> Result<(), QueryError>;

    /// A lower bound of the distance from the shape to a point, tight where a search is to be fast.
    fn distance_below_m(&self, point_m: &Vector3<f64>) -> f64 {
        let (middle, radius_m) = self.ball_m();
        (point_m - middle).norm() - radius_m
    }
}

/// A point.
impl ConvexShape for Vector3<f64> {
    fn support_m(&self, _: &Vector3<f64>) -> Vector3<f64> {
        *self
    }

    fn ball_m(&self) -> (Vector3<f64>, f64) {
        (*self, 0.0)
    }

    fn moved(&self, by_m: &Vector3<f64>) -> Self {
        self + by_m
    }

    fn check(&self) -> Result<(), QueryError> {
        check_point(self)
    }
}

/// A straight line between two points; they may be equal.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Segment {
    /// One end, map frame, metres.
    pub from_m: Vector3<f64>,
    /// The other end, map frame, metres.
    pub to_m: Vector3<f64>,
}

impl ConvexShape for Segment {
    fn support_m(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        if (self.to_m - self.from_m).dot(direction) > 0.0 {
            self.to_m
        } else {
            self.from_m
        }
    }

    fn ball_m(&self) -> (Vector3<f64>, f64) {
        let half = 0.5 * (self.to_m - self.from_m);
        (self.from_m + half, half.norm())
    }

    fn moved(&self, by_m: &Vector3<f64>) -> Self {
        Segment {
            from_m: self.from_m + by_m,
            to_m: self.to_m + by_m,
        }
    }

    fn check(&self) -> Result<(), QueryError> {
        check_point(&self.from_m)?;
        check_point(&self.to_m)
    }

    fn distance_below_m(&self, point_m: &Vector3<f64>) -> f64 {
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
