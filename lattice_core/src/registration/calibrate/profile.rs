//! Options by the kind of sensor that made a cloud.

use std::fmt;

use super::types::CalibrationOptions;

/// Kind of sensor; what it sets is the default of every option.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Profile {
    /// The mesh of a mixed-reality headset, upright.
    #[default]
    Headset,
    /// A laser scanner, outdoors, that may lean.
    Lidar,
    /// A depth camera with an IMU.
    DepthCamera,
}

impl Profile {
    /// All profiles.
    pub const ALL: [Profile; 3] = [Profile::Headset, Profile::Lidar, Profile::DepthCamera];

    /// Name in options and parameters.
    pub fn name(self) -> &'static str {
        match self {
            Profile::Headset => "headset",
            Profile::Lidar => "lidar",
            Profile::DepthCamera => "depth_camera",
        }
    }

    /// The options that it stands for.
    pub fn options(self) -> CalibrationOptions {
        let profile = self;
        let headset = CalibrationOptions::default();
        match self {
            Profile::Headset => headset,
            Profile::Lidar => CalibrationOptions {
                profile,
                noise_m: 0.03,
                region_m: 4.0,
                scale_sigma: 0.0,
                gravity_sigma_rad: f64::INFINITY,
                start_radius_m: 30.0,
                // Right poses of scans 30 m apart have 0.28 and more; wrong ones lack the margin.
                min_inliers: 0.2,
                max_sigma_m: 0.15,
                ..headset
            },
            Profile::DepthCamera => CalibrationOptions {
                profile,
                noise_m: 0.03,
                region_m: 0.5,
                scale_sigma: 0.01,
                gravity_sigma_rad: 0.02,
                ..headset
            },
        }
    }
}

impl fmt::Display for Profile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
