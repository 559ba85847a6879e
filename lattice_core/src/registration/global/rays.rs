//! Lines of sight of a headset: a right pose does not look through walls.

use nalgebra::{Isometry3, Point3, Vector3};

use super::super::PreparedCloud;
use super::super::search::OccupiedGrid;

/// Rays that are looked at, at most.
const RAYS: usize = 300;
/// Places of a ray that are looked at, at most, however far a point claims to be.
const STEPS: usize = 1000;
/// Distance between them, in cells.
const STRIDE: f64 = 0.7;

/// Share of the rays to the points that go through a surface on their way.
///
/// The way ends before the point by `clear_m`, and begins as far after the sensor.
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

/// Distance at which a ray goes through a surface, within a part of its way, metres.
pub(super) fn crossing_m(
    occupied: &OccupiedGrid,
    from_m: &Point3<f64>,
    direction: &Vector3<f64>,
    way_m: std::ops::Range<f64>,
) -> Option<f64> {
    // Less than a cell, so that none is passed over but at its corners.
    let stride = STRIDE * occupied.cell_m();
    let steps = ((way_m.end - way_m.start) / stride) as usize;
    (0..=steps.min(STEPS)).find_map(|i| {
        let place = from_m + direction * (way_m.start + i as f64 * stride);
        let crossing = occupied.crossing_m(&place, from_m, direction);
        crossing.filter(|along_m| *along_m > way_m.start && *along_m < way_m.end)
    })
}
