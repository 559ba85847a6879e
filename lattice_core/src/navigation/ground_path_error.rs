//! Errors of paths on the ground.

use thiserror::Error;

use super::options::ProjectionError;

/// End of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathEnd {
    /// The robot.
    Start,
    /// Destination.
    Goal,
}

impl std::fmt::Display for PathEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            PathEnd::Start => "start",
            PathEnd::Goal => "goal",
        })
    }
}

/// Failure of a path search on the ground.
#[derive(Clone, Debug, PartialEq, Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum GroundPathError {
    /// Map that cannot be projected.
    #[error(transparent)]
    Projection(#[from] ProjectionError),
    /// Rule without surfaces.
    #[error("paths need ground that is found: set `ground: found`")]
    FlatRule,
    /// Length that is out of range for the cells.
    #[error("{value} m is outside 0..={max:.2} m for cells of {resolution_m:.3} m (`{name}`)")]
    Length {
        name: &'static str,
        value: f64,
        max: f64,
        resolution_m: f64,
    },
    /// End beside the map.
    #[error("the {end} [{:.2}, {:.2}, {:.2}] is outside of the map", .at_m[0], .at_m[1], .at_m[2])]
    Outside { end: PathEnd, at_m: [f64; 3] },
    /// End without ground.
    #[error(
        "no ground within {tolerance_m} m of the {end} [{:.2}, {:.2}, {:.2}]: map it, or set a larger tolerance",
        .at_m[0], .at_m[1], .at_m[2]
    )]
    NoGround {
        end: PathEnd,
        at_m: [f64; 3],
        tolerance_m: f64,
    },
    /// End where the robot would touch something.
    #[error(
        "no room for a radius of {radius_m} m within {tolerance_m} m of the {end} [{:.2}, {:.2}, {:.2}]: \
         obstacles, edges or unseen ground are too near",
        .at_m[0], .at_m[1], .at_m[2]
    )]
    NoRoom {
        end: PathEnd,
        at_m: [f64; 3],
        radius_m: f64,
        tolerance_m: f64,
    },
    /// Goal on other ground than the robot's.
    #[error(
        "no path: the goal is not among the {expanded} places that the robot reaches with its radius, step and slope"
    )]
    NoWay { expanded: usize },
    /// Search that was stopped.
    #[error("no path found among {expanded} places: the search limit is reached")]
    Limit { expanded: usize },
}
