//! Errors of map queries.

use nalgebra::Vector3;
use thiserror::Error;

use super::MAX_COORDINATE_M;

/// Error of a query.
#[derive(Clone, PartialEq, Debug, Error)]
#[non_exhaustive]
pub enum QueryError {
    /// Coordinate or extent that is not finite or exceeds [`MAX_COORDINATE_M`].
    #[error("point or extent {0:?} m is not finite or beyond {MAX_COORDINATE_M} m")]
    Point([f64; 3]),
    /// Box whose minimum exceeds its maximum.
    #[error("box with extents {0:?} m is inside out")]
    Box([f64; 3]),
    /// Negative or NaN distance.
    #[error("distance {0} m is not 0 or more")]
    Distance(f64),
    /// Path without points.
    #[error("path without points: at least 1 is needed")]
    EmptyPath,
}

/// Rejects coordinates that are not finite or too large.
pub(super) fn check_point(point_m: &Vector3<f64>) -> Result<(), QueryError> {
    let near = |x: &f64| x.abs() <= MAX_COORDINATE_M;
    if point_m.iter().all(near) {
        Ok(())
    } else {
        Err(QueryError::Point((*point_m).into()))
    }
}

/// Rejects NaN or negative distances; infinity is accepted.
pub(super) fn check_distance(distance_m: f64) -> Result<(), QueryError> {
    if distance_m >= 0.0 {
        Ok(())
    } else {
        Err(QueryError::Distance(distance_m))
    }
}
