//! Errors of clouds that cannot be registered.

use thiserror::Error;

/// A cloud that cannot be prepared for registration.
#[derive(Clone, Debug, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum RegistrationError {
    /// Too few points for the neighbourhoods asked for.
    #[error("{points} points, at least {least} are needed")]
    TooFewPoints { points: usize, least: usize },
    /// More points than can be numbered.
    #[error("{points} points, at most {most} are taken")]
    TooManyPoints { points: usize, most: usize },
    /// A coordinate is not a number or beyond [`MAX_COORDINATE_M`](super::MAX_COORDINATE_M).
    #[error("point {index} is not finite or too far away")]
    NotFinite { index: usize },
    /// All points are equal or on one line, up to rounding.
    #[error("all points are on one line")]
    Collinear,
    /// There must be a label for each point or none at all.
    #[error("{labels} labels for {points} points")]
    LabelCount { labels: usize, points: usize },
    /// Neighbours of a neighbourhood out of range.
    #[error("{neighbors} neighbours, from 3 to {most} are taken")]
    Neighbors { neighbors: usize, most: usize },
    /// The plane regularisation must be over 0 and at most 1.
    #[error("a plane epsilon of {plane_epsilon} is not in (0, 1]")]
    PlaneEpsilon { plane_epsilon: f64 },
    /// The side of a map's cells is not a length.
    #[error("a cell side of {cell_side_m} m is not a positive length")]
    CellSide { cell_side_m: f64 },
}
