//! Report of a `voxel_marker_publisher` at its end.

use serde::{Deserialize, Serialize};

use super::MarkerCounts;

/// The end of a `voxel_marker_publisher`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MarkerReport {
    /// Everything counted by the state machine.
    pub counts: MarkerCounts,
    /// Voxels of the map that it followed.
    pub voxels: usize,
    /// Bytes of all current markers as CDR: what a viewer that joins now receives.
    pub marker_bytes: usize,
    /// Bytes given out over the whole run.
    pub published_bytes: u64,
    /// Arrays that could not be given to the publisher.
    pub arrays_not_published: u64,
}
