//! Reasons for rejecting clouds.

use thiserror::Error;

/// Reason for rejecting a cloud. The map is unchanged.
#[derive(Debug, Error)]
pub enum CloudRefusal {
    /// Frame other than the map's.
    #[error(
        "cloud in frame '{found}', expected '{expected}': is enu_transformer between the sensor and the mapper?"
    )]
    Frame {
        /// Frame of the message.
        found: String,
        /// The mapper's `map_frame`.
        expected: String,
    },
    /// The data do not match the header.
    #[error("malformed cloud: {0}")]
    Malformed(#[from] lattice_core::cloud::CloudError),
    /// Corrections are followed, and none has come.
    #[error(
        "no corrections of the cloud's frame yet: set `map_frame` of lidar_odometry, or `follow_corrections: false`"
    )]
    NoCorrections,
    /// Cloud of another drive than the map.
    #[error(
        "the odometry has begun another drive, whose place in the map is unknown: save the map, then call ~/reset"
    )]
    OtherDrive,
    /// Stamp of another time, which would make voxels expire.
    #[error(
        "cloud stamp {stamp_ns} ns is {:.1} s from the previous one: check the clocks",
        *step_ns as f64 * 1e-9
    )]
    Stamp {
        /// Stamp of the message.
        stamp_ns: i64,
        /// Difference to the stamp of the previous cloud.
        step_ns: i64,
    },
}
