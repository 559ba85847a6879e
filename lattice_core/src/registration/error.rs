//! Errors of the preparation of clouds for registration.

use thiserror::Error;

/// Reason that a cloud cannot be prepared for registration.
#[derive(Clone, Debug, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum RegistrationError {
    /// Fewer points than a neighbourhood needs.
    #[error("point count {points} is below {least}")]
    TooFewPoints { points: usize, least: usize },
    /// More points than an index can number.
    #[error("point count {points} is above {most}")]
    TooManyPoints { points: usize, most: usize },
    /// A coordinate is not finite or exceeds [`MAX_COORDINATE_M`](super::MAX_COORDINATE_M).
    #[error("point {index} has a coordinate that is not finite or beyond 1e8 m")]
    NotFinite { index: usize },
    /// All points are equal or collinear, up to rounding.
    #[error("all points are collinear")]
    Collinear,
    /// Neither one label per point nor none.
    #[error("label count {labels} differs from point count {points}")]
    LabelCount { labels: usize, points: usize },
    /// Size of a neighbourhood out of range.
    #[error("neighbour count {neighbors} is outside 3..={most} (`neighbors`)")]
    Neighbors { neighbors: usize, most: usize },
    /// Plane regularization out of range.
    #[error("plane epsilon {plane_epsilon} is outside (0, 1] (`plane_epsilon`)")]
    PlaneEpsilon { plane_epsilon: f64 },
    /// Cell size of a map out of range.
    #[error("cell size {cell_side_m} m is not positive and finite")]
    CellSide { cell_side_m: f64 },
}
