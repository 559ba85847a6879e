//! Counters of corrections.

use serde::{Deserialize, Serialize};

/// Counters of corrections.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CorrectionCounts {
    /// Clouds rejected: no corrections yet.
    pub clouds_no_corrections: u64,
    /// Clouds rejected: of another drive than the map.
    pub clouds_other_drive: u64,
    /// Clouds in submaps whose place in the map is unknown now.
    pub clouds_unplaced: u64,
    /// Clouds that were mapped and not kept, beyond `max_kept_bytes`.
    pub clouds_not_kept: u64,
    /// Points beside a kept one in its cell of a quarter of the edge, which are not mapped.
    pub points_thinned: u64,
    /// Messages of corrections that are malformed.
    pub corrections_refused: u64,
    /// Maps made anew.
    pub maps_corrected: u64,
}
