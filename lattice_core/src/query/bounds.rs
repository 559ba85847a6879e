//! Box that limits a search.

use nalgebra::Vector3;

use super::QueryError;
use super::error::check_point;

/// Axis-aligned box in the map frame, metres.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Bounds {
    /// Lowest corner.
    pub min_m: Vector3<f64>,
    /// Highest corner.
    pub max_m: Vector3<f64>,
}

impl Bounds {
    /// Tests whether a point is inside the box or on its surface.
    pub fn contains(&self, point_m: &Vector3<f64>) -> bool {
        (0..3).all(|i| (self.min_m[i]..=self.max_m[i]).contains(&point_m[i]))
    }

    pub(super) fn check(&self) -> Result<(), QueryError> {
        check_point(&self.min_m)?;
        check_point(&self.max_m)?;
        let extents = self.max_m - self.min_m;
        if extents.iter().all(|x| *x >= 0.0) {
            Ok(())
        } else {
            Err(QueryError::Box(extents.into()))
        }
    }

    pub(super) fn moved(&self, by_m: &Vector3<f64>) -> Bounds {
        Bounds {
            min_m: self.min_m + by_m,
            max_m: self.max_m + by_m,
        }
    }
}
