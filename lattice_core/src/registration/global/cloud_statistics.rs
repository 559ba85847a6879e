//! Range, density and noise of clouds, which identify the kind of sensor.

use nalgebra::{Matrix3, Point3, Vector3};
use rustc_hash::FxHashMap;

use super::super::likelihood::quantile;
use super::source_cloud::SourceCloud;

/// Maximum number of sampled points.
const POINTS: usize = 200_000;
/// Side of the counting cells, metres.
const CELL_M: f64 = 0.1;
/// Minimum number of points in a cell for a plane fit.
const MIN_PLANE_POINTS: f64 = 12.0;
/// Quantile of the cell distances that defines the range.
const WITHIN: f64 = 0.9;
/// Maximum coordinate of a point, metres.
const FARTHEST_M: f64 = 1e6;

/// Range, density and noise of clouds.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(super) struct CloudStatistics {
    /// Distance from the sensor, or from the centroid, that contains 90 % of the surfaces, metres.
    pub range_m: f64,
    /// Median number of points per cell of 10 cm.
    pub points_of_cell: f64,
    /// Median RMS distance of points from the plane of their cell, metres; 0 if there are too few points.
    pub noise_m: f64,
}

#[derive(Clone, Copy, Default)]
struct Cell {
    points: f64,
    sum_m: Vector3<f64>,
    squares: Matrix3<f64>,
    distance_m: f64,
}

impl CloudStatistics {
    /// Computes the statistics of clouds, each seen from its own sensor.
    pub fn of(scans: &[SourceCloud]) -> CloudStatistics {
        let all: usize = scans.iter().map(|scan| scan.cloud.len()).sum();
        let stride = all.div_ceil(POINTS).max(1);
        let (mut distances_m, mut counts, mut noises_m) = (Vec::new(), Vec::new(), Vec::new());
        for scan in scans {
            for cell in cells(scan, stride) {
                distances_m.push(cell.distance_m);
                counts.push(cell.points * stride as f64);
                noises_m.extend(cell.noise_m());
            }
        }
        CloudStatistics {
            range_m: quantile(&mut distances_m, WITHIN),
            points_of_cell: quantile(&mut counts, 0.5),
            noise_m: quantile(&mut noises_m, 0.5),
        }
    }
}

/// Sampled points of a cloud, summed by cell.
fn cells(scan: &SourceCloud, stride: usize) -> Vec<Cell> {
    let usable = |p: &&Point3<f64>| p.iter().all(|c| c.abs() <= FARTHEST_M);
    let points = || scan.cloud.points_m.iter().step_by(stride).filter(usable);
    let sum = points().fold(Vector3::zeros(), |sum, p| sum + p.coords);
    let centroid = Point3::from(sum / (points().count().max(1)) as f64);
    let from = scan.sensor_m.unwrap_or(centroid);
    let mut cells: FxHashMap<[i32; 3], Cell> = FxHashMap::default();
    for point in points() {
        let key = [point.x, point.y, point.z].map(|c| (c / CELL_M).floor() as i32);
        let cell = cells.entry(key).or_insert_with(|| Cell {
            distance_m: nalgebra::distance(point, &from),
            ..Cell::default()
        });
        // Coordinates relative to the cell's corner: squares of large coordinates lose digits.
        let place = point.coords - Vector3::from(key.map(|c| f64::from(c) * CELL_M));
        cell.points += 1.0;
        cell.sum_m += place;
        cell.squares += place * place.transpose();
    }
    cells.into_values().collect()
}

impl Cell {
    /// RMS distance of the points from their plane; `None` if there are too few.
    fn noise_m(&self) -> Option<f64> {
        if self.points < MIN_PLANE_POINTS {
            return None;
        }
        let centroid = self.sum_m / self.points;
        let spread = self.squares / self.points - centroid * centroid.transpose();
        Some(spread.symmetric_eigenvalues().min().max(0.0).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registration::SemanticCloud;

    /// A floor of 2 m by 2 m below a sensor, a point each centimetre, every other moved up by `noise_m`.
    fn floor(noise_m: f64) -> SourceCloud {
        let places = (0..200).flat_map(|x| (0..200).map(move |y| (x, y)));
        let point = |(x, y): (i32, i32)| {
            let up_m = noise_m * f64::from((x + y) % 2);
            Point3::new(
                0.01 * f64::from(x) - 0.995,
                0.01 * f64::from(y) - 0.995,
                up_m + 0.05,
            )
        };
        SourceCloud {
            cloud: SemanticCloud::unlabelled(places.map(point).collect()),
            sensor_m: Some(Point3::new(0.0, 0.0, 1.5)),
        }
    }

    #[test]
    fn range_density_and_noise_of_a_floor_are_seen() {
        let found = CloudStatistics::of(&[floor(0.0)]);
        assert!((found.range_m - 1.8).abs() < 0.1, "{found:?}");
        assert_eq!(found.points_of_cell, 100.0);
        assert!(found.noise_m < 1e-6);
        let noisy = CloudStatistics::of(&[floor(0.02)]);
        assert!((noisy.noise_m - 0.01).abs() < 1e-3, "{noisy:?}");
    }

    #[test]
    fn what_is_no_cloud_has_no_range() {
        let mut broken = floor(0.0);
        broken.cloud.points_m = vec![
            Point3::new(f64::NAN, 0.0, 0.0),
            Point3::new(1e300, 0.0, 0.0),
        ];
        assert_eq!(CloudStatistics::of(&[broken]), CloudStatistics::default());
        assert_eq!(CloudStatistics::of(&[]), CloudStatistics::default());
    }
}
