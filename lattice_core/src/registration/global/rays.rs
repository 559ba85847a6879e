//! Lines of sight of a sensor: at a correct pose they pass through free space.

use nalgebra::{Isometry3, Point3, Vector3};

use super::super::PreparedCloud;
use super::super::search::OccupiedGrid;

/// Maximum number of sampled rays.
const RAYS: usize = 300;
/// Maximum number of samples along a ray.
const STEPS: usize = 1000;
/// Distance between samples, in cells.
const STRIDE: f64 = 0.7;

/// Fraction of the rays to the points that pass through a surface.
///
/// The first and last `clear_m` of each ray are ignored.
pub(super) fn blocked_fraction(
    occupied: &OccupiedGrid,
    source: &PreparedCloud,
    sensor_m: &Point3<f64>,
    target_from_source: &Isometry3<f64>,
    clear_m: f64,
) -> f64 {
    let points = source.points_m();
    let from = target_from_source * sensor_m;
    let step = points.len().div_ceil(RAYS).max(1);
    let (mut rays, mut blocked) = (0_u32, 0_u32);
    for point in points.iter().step_by(step) {
        let to = target_from_source * point;
        let length = nalgebra::distance(&from, &to);
        if length < 3.0 * clear_m {
            continue;
        }
        rays += 1;
        let direction = (to - from) / length;
        let way = clear_m..length - clear_m;
        blocked += u32::from(crossing_m(occupied, &from, &direction, way).is_some());
    }
    f64::from(blocked) / f64::from(rays.max(1))
}

/// Distance at which a ray passes through a surface within `way_m`, metres.
pub(super) fn crossing_m(
    occupied: &OccupiedGrid,
    from_m: &Point3<f64>,
    direction: &Vector3<f64>,
    way_m: std::ops::Range<f64>,
) -> Option<f64> {
    // Less than a cell, so that a ray skips cells only at their corners.
    let stride = STRIDE * occupied.cell_m();
    let steps = ((way_m.end - way_m.start) / stride) as usize;
    (0..=steps.min(STEPS)).find_map(|i| {
        let place = from_m + direction * (way_m.start + i as f64 * stride);
        let crossing = occupied.crossing_m(&place, from_m, direction);
        crossing.filter(|along_m| *along_m > way_m.start && *along_m < way_m.end)
    })
}
