//! Options of a map of free space, and the reasons for which they are refused.

use thiserror::Error;

use super::evidence::{Evidence, EvidenceError};
use crate::lattice::LatticeError;
use crate::voxels::DatumError;

/// Coarsest free level: cells 8 times as wide.
pub const MAX_FREE_LEVEL: u32 = 3;
/// Least memory of a map, bytes.
pub const MIN_MAP_BYTES: usize = 1 << 20;

/// Evidence, range, resolution and memory of a [`super::FreeSpaceMap`].
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct FreeSpaceOptions {
    /// Weights of hits and misses.
    pub evidence: Evidence,
    /// Rays of points that are farther than this are followed to this range, metres, and give no
    /// hit; infinite for no limit.
    pub max_range_m: f64,
    /// The last part of each ray that gives no miss, metres, and as a fraction of the ray: rays that
    /// graze a surface pass through its cells.
    pub keep_m: f64,
    /// See `keep_m`; the longer of the two counts.
    pub keep_ratio: f64,
    /// Free cells are kept in cells `2^free_level` as wide, at most [`MAX_FREE_LEVEL`]; `None`: only
    /// cells that were hit are kept.
    pub free_level: Option<u32>,
    /// Most memory, bytes, at least [`MIN_MAP_BYTES`]. When it is used up, known blocks of cells are
    /// still updated, and no new ones are added.
    pub max_bytes: usize,
}

impl Default for FreeSpaceOptions {
    fn default() -> FreeSpaceOptions {
        FreeSpaceOptions {
            evidence: Evidence::default(),
            max_range_m: f64::INFINITY,
            keep_m: 0.0,
            keep_ratio: 0.0,
            free_level: Some(0),
            max_bytes: 1 << 30,
        }
    }
}

/// An option that a map of free space cannot have.
#[derive(Clone, PartialEq, Debug, Error)]
pub enum FreeSpaceError {
    /// The probabilities do not go together.
    #[error(transparent)]
    Evidence(#[from] EvidenceError),
    /// The datum is out of reach.
    #[error(transparent)]
    Datum(#[from] DatumError),
    /// The coarse lattice of the free level cannot be made.
    #[error("free level: {0}")]
    Coarse(#[from] LatticeError),
    /// The range limit is not positive.
    #[error("max_range_m {0} is not above 0")]
    Range(f64),
    /// The free level is too coarse.
    #[error("free_level {0} is above {MAX_FREE_LEVEL}")]
    FreeLevel(u32),
    /// The limit of memory is too low.
    #[error("max_bytes {0} is below {MIN_MAP_BYTES}")]
    Memory(usize),
}

impl FreeSpaceOptions {
    pub(super) fn check(&self) -> Result<(), FreeSpaceError> {
        if self.max_range_m.is_nan() || self.max_range_m <= 0.0 {
            return Err(FreeSpaceError::Range(self.max_range_m));
        }
        if let Some(level) = self.free_level.filter(|level| *level > MAX_FREE_LEVEL) {
            return Err(FreeSpaceError::FreeLevel(level));
        }
        if self.max_bytes < MIN_MAP_BYTES {
            return Err(FreeSpaceError::Memory(self.max_bytes));
        }
        Ok(())
    }
}
