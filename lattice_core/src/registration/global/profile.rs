//! Options by the kind of sensor that made a cloud.

use std::fmt;

use super::cloud_statistics::CloudStatistics;
use super::request::{CalibrationOptions, SourceCloud};

/// Range beyond which a laser scanner outdoors is at work, metres.
const LIDAR_M: f64 = 15.0;
/// Range beyond which what is noisy is the scan of a laser in rooms, metres: depth cameras see less far.
const INDOOR_LIDAR_M: f64 = 5.5;
/// Points of a cell of 10 cm from which on a depth camera may be at work: meshes of headsets have up to 16.
const DENSE: f64 = 24.0;
/// Noise within such a cell from which on it is no mesh, metres.
const NOISY_M: f64 = 1.5e-3;

/// Kind of sensor; what it sets is the default of every option.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Profile {
    /// The mesh of a mixed-reality headset, upright.
    #[default]
    Headset,
    /// A laser scanner that may lean.
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

    /// The profile of the sensor that clouds look like, by their range, density and noise.
    pub fn of(scans: &[SourceCloud]) -> Profile {
        let cloud = CloudStatistics::of(scans);
        let is_noisy = cloud.noise_m >= NOISY_M;
        match cloud.range_m {
            range_m if range_m > LIDAR_M => Profile::Lidar,
            _ if is_noisy && cloud.points_of_cell >= DENSE => Profile::DepthCamera,
            range_m if is_noisy && range_m > INDOOR_LIDAR_M => Profile::Lidar,
            _ => Profile::Headset,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::SemanticCloud;
    use nalgebra::Point3;

    /// Points `apart_m` from each other on a wall of `side_m`, with up to `noise_m` across it, seen from as far away.
    fn wall(side_m: f64, apart_m: f64, noise_m: f64) -> SourceCloud {
        let n = (side_m / apart_m) as u32;
        let places = (0..n).flat_map(|y| (0..n).map(move |z| (y, z)));
        let point = |(y, z): (u32, u32)| {
            let across_m = noise_m * f64::from((7 * y + 3 * z) % 11) / 11.0;
            let [y, z] = [y, z].map(|i| apart_m * (f64::from(i) + 0.5) - 0.5 * side_m);
            Point3::new(side_m + 0.03 + across_m, y, z)
        };
        SourceCloud {
            cloud: SemanticCloud::unlabelled(places.map(point).collect()),
            sensor_m: Some(Point3::origin()),
        }
    }

    #[test]
    fn the_sensor_is_told_by_range_density_and_noise() {
        assert_eq!(Profile::of(&[wall(30.0, 0.2, 0.02)]), Profile::Lidar);
        assert_eq!(Profile::of(&[wall(2.0, 0.01, 0.01)]), Profile::DepthCamera);
        // Fewer points than of a camera, from farther away.
        assert_eq!(Profile::of(&[wall(6.0, 0.025, 0.02)]), Profile::Lidar);
        // A mesh, however finely its faces were filled with points.
        assert_eq!(Profile::of(&[wall(2.0, 0.01, 0.0)]), Profile::Headset);
        assert_eq!(Profile::of(&[wall(2.0, 0.05, 0.02)]), Profile::Headset);
        assert_eq!(Profile::of(&[]), Profile::Headset);
    }
}
