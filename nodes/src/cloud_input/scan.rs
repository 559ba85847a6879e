//! Laser scans as clouds: one point for each ray or echo, in the plane z = 0 of the scan's frame.
//!
//! Rays without a valid range (REP 117, or outside of `range_min` to `range_max`) are NaN.

use lattice_msgs::sensor_msgs::{
    LaserEcho, LaserScan, MultiEchoLaserScan, PointCloud2, PointField,
};
use lattice_msgs::std_msgs::Header;

use super::error::{CloudInputError, check_count};
use super::records::{Records, TIME_FIELD};

/// Field of the intensities.
const INTENSITY: &str = "intensity";

/// Rays of a scan.
struct Rays {
    angle_min: f64,
    angle_increment: f64,
    /// From ray to ray; zero: all at once.
    time_increment_ns: f64,
    range_min: f32,
    range_max: f32,
}

/// One echo of a ray.
struct Echo {
    ray: usize,
    range_m: f32,
    intensity: Option<f32>,
}

/// Cloud of a scan: point i is that of ray i.
///
/// The fields are x, y, z, `intensity` if there is one for each ray, and [`TIME_FIELD`] unless `time_increment` is 0.
/// `scan_time` is the time between scans, not that of their rays: nodes that make scans of depth
/// images and clouds set it too.
pub fn cloud_of_scan(scan: &LaserScan) -> Result<PointCloud2, CloudInputError> {
    let rays = Rays::new(
        [scan.angle_min, scan.angle_increment, scan.time_increment],
        [scan.range_min, scan.range_max],
    )?;
    let (ranges, intensities) = (&scan.ranges, &scan.intensities);
    let has_intensity = !ranges.is_empty() && intensities.len() == ranges.len();
    let echoes = ranges.iter().enumerate().map(|(ray, range_m)| Echo {
        ray,
        range_m: *range_m,
        intensity: intensities.get(ray).copied(),
    });
    rays.cloud(&scan.header, ranges.len(), has_intensity, echoes)
}

/// Cloud of all echoes of a scan, ray by ray. Its fields are those of [`cloud_of_scan`].
pub fn cloud_of_echoes(scan: &MultiEchoLaserScan) -> Result<PointCloud2, CloudInputError> {
    let rays = Rays::new(
        [scan.angle_min, scan.angle_increment, scan.time_increment],
        [scan.range_min, scan.range_max],
    )?;
    let (ranges, intensities) = (&scan.ranges, &scan.intensities);
    let length = |of: &LaserEcho| of.echoes.len();
    let count = ranges.iter().map(length).fold(0, usize::saturating_add);
    let has_intensity = count > 0 && ranges.iter().map(length).eq(intensities.iter().map(length));
    let echoes = ranges.iter().enumerate().flat_map(|(ray, echoes)| {
        let intensities = intensities.get(ray);
        echoes
            .echoes
            .iter()
            .enumerate()
            .map(move |(i, range_m)| Echo {
                ray,
                range_m: *range_m,
                intensity: intensities.and_then(|of| of.echoes.get(i).copied()),
            })
    });
    rays.cloud(&scan.header, count, has_intensity, echoes)
}

impl Rays {
    fn new(
        [angle_min, angle_increment, time_increment]: [f32; 3],
        [range_min, range_max]: [f32; 2],
    ) -> Result<Self, CloudInputError> {
        for (field, value, unit) in [
            ("angle_min", angle_min, "the angle of the first ray, rad"),
            (
                "angle_increment",
                angle_increment,
                "the angle from ray to ray, rad",
            ),
            (
                "time_increment",
                time_increment,
                "the time from ray to ray, s; 0 if all are measured at once",
            ),
        ] {
            if !value.is_finite() {
                return Err(CloudInputError::NotFinite { field, value, unit });
            }
        }
        // A limit that is not set is 0 or NaN.
        let is_set = range_max > range_min.max(0.0);
        Ok(Self {
            angle_min: f64::from(angle_min),
            angle_increment: f64::from(angle_increment),
            time_increment_ns: f64::from(time_increment) * 1e9,
            range_min: range_min.max(0.0),
            range_max: if is_set { range_max } else { f32::INFINITY },
        })
    }

    fn cloud(
        &self,
        header: &Header,
        count: usize,
        has_intensity: bool,
        echoes: impl Iterator<Item = Echo>,
    ) -> Result<PointCloud2, CloudInputError> {
        check_count(count)?;
        let has_time = self.time_increment_ns != 0.0;
        let fields = [
            has_intensity.then_some((INTENSITY, PointField::FLOAT32)),
            has_time.then_some((TIME_FIELD, PointField::FLOAT64)),
        ];
        let fields: Vec<_> = fields.into_iter().flatten().collect();
        let mut records = Records::new(count, &fields);
        for echo in echoes {
            records.begin(self.point_m(&echo));
            if has_intensity {
                records.put(echo.intensity.unwrap_or(f32::NAN).to_le_bytes());
            }
            if has_time {
                records.put((echo.ray as f64 * self.time_increment_ns).to_le_bytes());
            }
        }
        Ok(records.finish(header.clone()))
    }

    fn point_m(&self, echo: &Echo) -> [f32; 3] {
        let range_m = echo.range_m;
        if !(range_m.is_finite() && (self.range_min..=self.range_max).contains(&range_m)) {
            return [f32::NAN; 3];
        }
        let angle = self.angle_min + echo.ray as f64 * self.angle_increment;
        let (sin, cos) = angle.sin_cos();
        let range_m = f64::from(range_m);
        [(range_m * cos) as f32, (range_m * sin) as f32, 0.0]
    }
}
