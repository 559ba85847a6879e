//! Reasons for which clouds are not mapped.

use thiserror::Error;

/// Reason for which a cloud was not mapped. The map is as it was before.
#[derive(Debug, Error)]
pub enum CloudRefusal {
    /// In another frame than the map's.
    #[error(
        "cloud in frame '{found}', expected '{expected}': is enu_transformer between the sensor and the mapper?"
    )]
    Frame {
        /// As sent.
        found: String,
        /// The mapper's `map_frame`.
        expected: String,
    },
    /// The bytes are not what the header says.
    #[error("malformed cloud: {0}")]
    Malformed(#[from] lattice_core::cloud::CloudError),
    /// Of another time than the clouds before, by which voxels grow old.
    #[error(
        "cloud of {stamp_ns} ns, {:.1} s from the one before: is a clock wrong?",
        *step_ns as f64 * 1e-9
    )]
    Stamp {
        /// As sent.
        stamp_ns: i64,
        /// From the stamp of the cloud before.
        step_ns: i64,
    },
}
