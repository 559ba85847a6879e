//! Random poses of views, and sectors of them.

use lattice_core::registration::SourceCloud;
use nalgebra::{Isometry3, Vector3};

use crate::random::Stream;

/// Random upright pose within a few metres.
pub fn any_pose(random: &mut Stream) -> Isometry3<f64> {
    let place = Vector3::new(3.0 * signed(random), 3.0 * signed(random), 1.5);
    Isometry3::new(place, Vector3::z() * std::f64::consts::PI * signed(random))
}

/// Uniform in [-1, 1).
pub fn signed(random: &mut Stream) -> f64 {
    2.0 * random.uniform() - 1.0
}

/// Keeps the points within `half_rad` of a random heading.
pub fn keep_sector(scan: &mut SourceCloud, half_rad: f64, random: &mut Stream) {
    let Some(eye) = scan.sensor_m else { return };
    let turn = std::f64::consts::PI * signed(random);
    let heading = Vector3::new(turn.cos(), turn.sin(), 0.0);
    scan.cloud.retain(|p| {
        let way = p - eye;
        Vector3::new(way.x, way.y, 0.0).angle(&heading) < half_rad
    });
}
