//! Errors in questions to a map.

use nalgebra::Vector3;
use thiserror::Error;

use super::MAX_COORDINATE_M;

/// Error in a question.
#[derive(Clone, PartialEq, Debug, Error)]
pub enum QueryError {
    /// A coordinate or extent is not a number or beyond [`MAX_COORDINATE_M`].
    #[error("point or extent {0:?} m is not finite or beyond {MAX_COORDINATE_M} m")]
    Point([f64; 3]),
    /// The minimum of a box exceeds its maximum.
    #[error("box with extents {0:?} m is inside out")]
    Box([f64; 3]),
    /// A distance is not a number or negative.
    #[error("distance {0} m is not 0 or more")]
    Distance(f64),
    /// A path has no points.
    #[error("a path needs at least one point")]
    EmptyPath,
}

/// Fails for what is not finite or too far away.
pub(super) fn check_point(point_m: &Vector3<f64>) -> Result<(), QueryError> {
    let near = |x: &f64| x.abs() <= MAX_COORDINATE_M;
    if point_m.iter().all(near) {
        Ok(())
    } else {
        Err(QueryError::Point((*point_m).into()))
    }
}

/// Fails for a NaN or negative distance; infinity is fine.
pub(super) fn check_distance(distance_m: f64) -> Result<(), QueryError> {
    if distance_m >= 0.0 {
        Ok(())
    } else {
        Err(QueryError::Distance(distance_m))
    }
}
