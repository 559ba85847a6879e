//! Options of a map of free space, and their errors.

use thiserror::Error;

use super::evidence::{Evidence, EvidenceError};
use super::scan::Reach;
use crate::lattice::LatticeError;
use crate::voxels::DatumError;

/// Maximum free level: cells 8 times as wide.
pub const MAX_FREE_LEVEL: u32 = 3;
/// Minimum memory of a map, bytes.
pub const MIN_MAP_BYTES: usize = 1 << 20;

/// Sensor model, range, resolution and memory of a [`super::FreeSpaceMap`].
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct FreeSpaceOptions {
    /// Sensor model.
    pub evidence: Evidence,
    /// Range of the rays.
    pub reach: Reach,
    /// Counts no miss of voxels that the scan grazes, where the scan is held against a store of voxels.
    pub spare_touching: bool,
    /// Level of the free cells, `2^free_level` as wide, at most [`MAX_FREE_LEVEL`]; `None` keeps only cells that were
    /// hit.
    pub free_level: Option<u32>,
    /// Maximum memory, bytes, at least [`MIN_MAP_BYTES`]; at the limit, existing blocks of cells are updated and no
    /// new ones added.
    pub max_bytes: usize,
}

impl Default for FreeSpaceOptions {
    fn default() -> FreeSpaceOptions {
        FreeSpaceOptions {
            evidence: Evidence::default(),
            reach: Reach::default(),
            spare_touching: true,
            free_level: Some(0),
            max_bytes: 1 << 30,
        }
    }
}

/// Option out of range.
#[derive(Clone, PartialEq, Debug, Error)]
#[non_exhaustive]
pub enum FreeSpaceError {
    /// Inconsistent probabilities.
    #[error(transparent)]
    Evidence(#[from] EvidenceError),
    /// Datum out of range.
    #[error(transparent)]
    Datum(#[from] DatumError),
    /// Free level without a coarse lattice.
    #[error("free level: {0}")]
    Coarse(#[from] LatticeError),
    /// Range limit that is not positive.
    #[error("max range {0} m is not above 0 (`max_range_m`)")]
    Range(f64),
    /// Free level out of range.
    #[error("free level {0} is above {MAX_FREE_LEVEL} (`free_level`)")]
    FreeLevel(u32),
    /// Memory limit out of range.
    #[error("memory limit {0} bytes is below {MIN_MAP_BYTES} (`max_bytes`)")]
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
