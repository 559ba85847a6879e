//! Errors of paths.

use thiserror::Error;

use super::QueryError;
use super::limits::MAX_ROBOT_CELLS;

/// Failure of a path search.
#[derive(Clone, PartialEq, Debug, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum PathError {
    /// Invalid query.
    #[error(transparent)]
    Query(#[from] QueryError),
    /// Ball too large for the cells.
    #[error(
        "radius {radius_m} m covers some {cells:.0} cells, at most {MAX_ROBOT_CELLS}: use larger cells"
    )]
    Radius { radius_m: f64, cells: f64 },
    /// Start or goal out of the bounds or of the range of keys.
    #[error("the cell of {end} {point_m:?} m is out of bounds")]
    OutOfBounds {
        end: &'static str,
        point_m: [f64; 3],
    },
    /// Ball that does not fit at the start or goal.
    #[error("the cell of {end} {point_m:?} m is not passable with radius {radius_m} m")]
    Blocked {
        end: &'static str,
        point_m: [f64; 3],
        radius_m: f64,
    },
    /// All reachable cells were expanded.
    #[error("no path: the goal is not among the {expanded} cells that can be reached")]
    NoPath { expanded: usize },
    /// The limit of expanded cells was reached.
    #[error("no path found among {expanded} cells: allow more, or set tighter bounds")]
    Limit { expanded: usize },
}
