//! Sunlight with shadows, and skylight.

use super::raster::{NOTHING, Scene, Screen};
use super::view::View;
use nalgebra::Vector3;

/// Azimuth of the sun: degrees clockwise from the camera, seen from the map.
const SUN_FROM_CAMERA_DEG: f64 = 62.0;
/// Elevation of the sun, degrees.
const SUN_ELEVATION_DEG: f64 = 48.0;
/// Most samples of the shadow map along a side.
const MAX_SHADOW_SIDE: usize = 8192;
/// Directions in which the horizon is looked for.
const DIRECTIONS: usize = 8;
/// Distances at which it is looked for, parts of the reach.
const STEPS: [f64; 4] = [0.1, 0.3, 0.6, 1.0];
/// Reach of the dimming by surroundings, radii of a cell.
const REACH_CELLS: f64 = 5.0;
/// Longest reach, samples.
const MAX_REACH: f64 = 160.0;

/// The sun and the map as the sun sees it.
pub(super) struct Sun {
    view: View,
    screen: Screen,
    radius_m: f64,
}

impl Sun {
    pub(super) fn new(scene: &Scene, camera_azimuth_deg: f64, size: [usize; 2]) -> Sun {
        let side = size[0].max(size[1]).min(MAX_SHADOW_SIDE);
        let azimuth_deg = camera_azimuth_deg + SUN_FROM_CAMERA_DEG;
        let view = View::new(azimuth_deg, SUN_ELEVATION_DEG, [side; 2])
            .fit(scene.centers(), scene.radius_m);
        Sun {
            screen: scene.draw(&view),
            view,
            radius_m: scene.radius_m,
        }
    }

    pub(super) fn direction(&self) -> Vector3<f64> {
        self.view.toward
    }

    /// Part of the sun that is seen from a point on a face, 0 to 1.
    pub(super) fn seen_from(&self, p: &Vector3<f64>, normal: &Vector3<f64>) -> f64 {
        // Off the face, lest it shades itself.
        let sample_m = 1.0 / self.view.scale;
        let lifted = p + normal * (0.1 * self.radius_m + 1.5 * sample_m);
        let [x, y, z] = self.view.project(&lifted);
        let margin_m = 0.05 * self.radius_m + 0.5 * sample_m;
        let mut lit = 0.0;
        for dy in -2..=2 {
            for dx in -2..=2 {
                let depth = self.screen.depth_at(x + f64::from(dx), y + f64::from(dy));
                if f64::from(depth) <= z + margin_m {
                    lit += 1.0;
                }
            }
        }
        lit / 25.0
    }
}

/// Part of the skylight that reaches a sample, 0 to 1, by what stands around it on the screen.
pub(super) fn openness(
    screen: &Screen,
    view: &View,
    [column, row]: [usize; 2],
    normal: &Vector3<f64>,
    radius_m: f64,
) -> f64 {
    let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
    let depth = f64::from(screen.depth_at(x, y));
    let reach = (REACH_CELLS * radius_m * view.scale).clamp(3.0, MAX_REACH);
    let reach_m = reach / view.scale;
    // Neighbouring samples look in different directions and are averaged later.
    let turn = ((column & 1) + 2 * (row & 1)) as f64 / 4.0;
    let mut closed = 0.0;
    for direction in 0..DIRECTIONS {
        let angle = (direction as f64 + turn) / DIRECTIONS as f64 * std::f64::consts::TAU;
        let (sin, cos) = angle.sin_cos();
        let mut horizon: f64 = 0.0;
        for step in STEPS {
            let (dx, dy) = (cos * reach * step, sin * reach * step);
            let other = screen.depth_at(x + dx, y + dy);
            if other == NOTHING {
                continue;
            }
            let dz = f64::from(other) - depth;
            let offset =
                view.right * (dx / view.scale) - view.up * (dy / view.scale) + view.toward * dz;
            let distance = offset.norm();
            let rise = normal.dot(&offset) / distance.max(1e-12) - 0.15;
            let nearness = (1.0 - distance / (1.6 * reach_m)).max(0.0);
            horizon = horizon.max(rise * nearness);
        }
        closed += horizon;
    }
    (1.0 - 1.8 * closed / DIRECTIONS as f64).max(0.0)
}
