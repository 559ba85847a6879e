//! Options of a map of free space, and the reasons for which they are refused.

use thiserror::Error;

use super::evidence::{Evidence, EvidenceError};
use super::scan::Reach;
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
    /// Parts of rays that count.
    pub reach: Reach,
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
            reach: Reach::default(),
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
        let max_range_m = self.reach.max_range_m;
        if max_range_m.is_nan() || max_range_m <= 0.0 {
            return Err(FreeSpaceError::Range(max_range_m));
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
