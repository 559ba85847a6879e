//! Counters of corrections.

use serde::{Deserialize, Serialize};

/// Counters of corrections.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CorrectionCounts {
    /// Clouds rejected: no corrections yet.
    pub clouds_no_corrections: u64,
    /// Clouds rejected: of another drive than the map.
    pub clouds_other_drive: u64,
    /// Clouds in submaps without a known pose in the map at present.
    pub clouds_unplaced: u64,
    /// Mapped clouds that were not kept because of `max_kept_bytes`.
    pub clouds_not_kept: u64,
    /// Points not mapped because their cube, of a quarter of the cell size, has a point already.
    pub points_thinned: u64,
    /// Malformed correction messages.
    pub corrections_refused: u64,
    /// Maps replaced after corrections.
    pub maps_corrected: u64,
}
