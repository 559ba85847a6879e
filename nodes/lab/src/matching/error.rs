//! Why a scan is not matched.

use thiserror::Error;

use super::{MAX_LEVELS, MAX_POINTS};
use crate::options::OutOfRange;
use lattice_core::lattice::LatticeError;
use lattice_core::voxels::DatumError;

/// Why a list is not made or a scan not matched.
#[derive(Clone, PartialEq, Debug, Error)]
pub enum MatchError {
    /// No levels, or too many.
    #[error("{levels} levels, from 1 to {MAX_LEVELS} are taken")]
    Levels {
        /// Levels asked for.
        levels: usize,
    },
    /// The cells of a level are too large.
    #[error(transparent)]
    Lattice(#[from] LatticeError),
    /// The datum is too far away or not finite.
    #[error(transparent)]
    Datum(#[from] DatumError),
    /// An option out of its range.
    #[error(transparent)]
    Option(#[from] OutOfRange),
    /// A number of the pose that a search begins with is NaN or infinite.
    #[error("the pose to begin with is not finite")]
    Pose,
    /// The map has no voxel.
    #[error("the map is empty")]
    EmptyMap,
    /// No point of the scan has a cell.
    #[error("none of {points} points is finite and near enough to its datum")]
    NoPoints {
        /// Points of the scan.
        points: usize,
    },
    /// More points than can be numbered.
    #[error("{points} points, at most {MAX_POINTS} are taken")]
    TooManyPoints {
        /// Points of the scan.
        points: usize,
    },
    /// The grid of a search has too many poses.
    #[error("{poses} poses on the coarsest grid, at most {most} are allowed")]
    TooManyPoses {
        /// Poses of the grid.
        poses: f64,
        /// Poses allowed.
        most: usize,
    },
}
