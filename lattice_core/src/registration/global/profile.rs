//! Sensor profiles: default options by the kind of sensor.

use std::fmt;

use super::cloud_statistics::CloudStatistics;
use super::source_cloud::SourceCloud;

/// Range above which a cloud is from an outdoor lidar, metres.
const LIDAR_M: f64 = 15.0;
/// Range above which a noisy cloud is from an indoor lidar, metres; depth cameras have a shorter range.
const INDOOR_LIDAR_M: f64 = 5.5;
/// Density from which a noisy cloud is from a depth camera, points per cell of 10 cm; meshes of headsets have up to
/// 16.
const DENSE: f64 = 24.0;
/// Noise within a cell from which a cloud is not a mesh, metres.
const NOISY_M: f64 = 1.5e-3;

/// Kind of sensor, which sets the defaults of all options.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Profile {
    /// Mesh of a mixed-reality headset, gravity-aligned.
    #[default]
    Headset,
    /// Laser scanner with unknown tilt.
    Lidar,
    /// Depth camera with an IMU.
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

    /// Estimates the profile from the range, density and noise of clouds.
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
