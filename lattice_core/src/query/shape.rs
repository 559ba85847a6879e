//! Convex shapes that can be asked for their clearance.

use nalgebra::{Isometry3, Vector3};

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

/// A box of any orientation.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct OrientedBox {
    /// Map from box: the centre of the box and its axes.
    pub pose: Isometry3<f64>,
    /// Half of each side, metres.
    pub half_extents_m: Vector3<f64>,
}

impl OrientedBox {
    fn into_box(self, v: &Vector3<f64>) -> Vector3<f64> {
        self.pose.rotation.inverse_transform_vector(v)
    }
}

impl ConvexShape for OrientedBox {
    fn support_m(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let toward = self.into_box(direction);
        let corner = self
            .half_extents_m
            .zip_map(&toward, |half, d| if d < 0.0 { -half } else { half });
        self.pose.translation.vector + self.pose.rotation * corner
    }

    fn ball_m(&self) -> (Vector3<f64>, f64) {
        (self.pose.translation.vector, self.half_extents_m.norm())
    }

    fn moved(&self, by_m: &Vector3<f64>) -> Self {
        let mut moved = *self;
        moved.pose.translation.vector += by_m;
        moved
    }

    fn check(&self) -> Result<(), QueryError> {
        check_point(&self.pose.translation.vector)?;
        check_point(&self.half_extents_m)?;
        let unit = (self.pose.rotation.norm() - 1.0).abs() < 1e-6;
        if unit && self.half_extents_m.iter().all(|half| *half >= 0.0) {
            Ok(())
        } else {
            Err(QueryError::Box(self.half_extents_m.into()))
        }
    }

    fn distance_below_m(&self, point_m: &Vector3<f64>) -> f64 {
        let local = self.into_box(&(point_m - self.pose.translation.vector));
        let outside = local.zip_map(&self.half_extents_m, |x, half| (x.abs() - half).max(0.0));
        outside.norm()
    }
}

/// The convex hull of a box in two poses.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoxHull {
    pub(super) from: OrientedBox,
    pub(super) to: OrientedBox,
}

impl ConvexShape for BoxHull {
    fn support_m(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let (a, b) = (self.from.support_m(direction), self.to.support_m(direction));
        if (b - a).dot(direction) > 0.0 { b } else { a }
    }

    fn ball_m(&self) -> (Vector3<f64>, f64) {
        let (middle, half_length_m) = self.axis().ball_m();
        (middle, half_length_m + self.from.ball_m().1)
    }

    fn moved(&self, by_m: &Vector3<f64>) -> Self {
        BoxHull {
            from: self.from.moved(by_m),
            to: self.to.moved(by_m),
        }
    }

    fn check(&self) -> Result<(), QueryError> {
        self.from.check()?;
        self.to.check()
    }

    fn distance_below_m(&self, point_m: &Vector3<f64>) -> f64 {
        self.axis().distance_below_m(point_m) - self.from.ball_m().1
    }
}

impl BoxHull {
    /// The way of the centre.
    fn axis(&self) -> Segment {
        Segment {
            from_m: self.from.pose.translation.vector,
            to_m: self.to.pose.translation.vector,
        }
    }
}
