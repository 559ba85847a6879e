//! Numbers of a mount, and options of their estimate.

/// Options of [`estimate_mount`](super::estimate_mount).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MountOptions {
    /// Largest standard deviation of an excited rotation, radians.
    pub max_sigma_rad: f64,
    /// Largest standard deviation of an excited coordinate of the lever arm, metres.
    pub max_sigma_m: f64,
    /// Largest standard deviation of an excited time offset, seconds.
    pub max_sigma_s: f64,
    /// True to estimate the time offset; else it is 0.
    pub with_time: bool,
    /// Standard deviation of the positions of a segment of the log, metres.
    pub pose_sigma_m: f64,
    /// Standard deviation of the attitudes of a segment of the log, radians.
    pub pose_sigma_rad: f64,
}

impl Default for MountOptions {
    fn default() -> MountOptions {
        MountOptions {
            max_sigma_rad: 0.3_f64.to_radians(),
            max_sigma_m: 0.05,
            max_sigma_s: 0.005,
            with_time: true,
            pose_sigma_m: 0.02,
            pose_sigma_rad: 0.05_f64.to_radians(),
        }
    }
}

/// One number of a mount: rad, m or s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MountNumber {
    /// Correction to the stated value; 0 unless the motion excited it.
    pub value: f64,
    /// Standard deviation of the correction, limited by the range of the search.
    pub sigma: f64,
    /// True if the motion excited the number, so that the log determines it.
    pub is_observable: bool,
}
