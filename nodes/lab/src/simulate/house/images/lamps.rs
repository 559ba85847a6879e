//! Lamps below the ceilings of a house, and how they light a surface.

use super::light::{Light, color};
use crate::simulate::house::House;
use crate::simulate::random::Stream;
use nalgebra::{Point3, Vector3};

/// Free floor for one lamp, m^2, and most lamps.
const FLOOR_M2: f64 = 7.0;
const MAX_LAMPS: usize = 60;
/// Area of a cell of free floor, m^2.
const CELL_M2: f64 = 0.125 * 0.125;
/// Heights of lamps above the floor, metres.
const HEIGHTS_M: [f64; 2] = [1.9, 2.35];
/// Light of a lamp ends here, metres.
const REACH_M: f64 = 5.5;
/// Distance from a surface at which its shadows begin, metres.
const BIAS_M: f64 = 2e-3;
/// Exponent of the spot that a gloss shows of a lamp.
const SHINE: i32 = 30;

/// A surface that is looked at.
pub(super) struct Surface {
    pub place_m: Point3<f64>,
    /// On the side that is seen.
    pub normal: Vector3<f64>,
    /// From the camera.
    pub way: Vector3<f64>,
    pub albedo: Light,
    pub gloss: f32,
}

/// All light in a house.
pub(super) struct Lamps {
    lamps: Vec<(Point3<f64>, Light)>,
    /// Light from everywhere, from above and from below.
    ambient: [Light; 2],
}

impl Lamps {
    pub(super) fn new(house: &House, stream: &mut Stream) -> Lamps {
        let floor_m2 = house.free.cells_m.len() as f64 * CELL_M2;
        let count = ((floor_m2 / FLOOR_M2) as usize).clamp(1, MAX_LAMPS);
        let places = house.free.spread_m(count, || stream.uniform());
        let mut between = |[low, high]: [f64; 2]| low + (high - low) * stream.uniform();
        let warmth = between([0.0, 0.35]);
        let lamp = |cell_m: [f64; 2]| {
            let height_m = between(HEIGHTS_M);
            let tint = color(35.0, warmth * between([0.5, 1.0]), 1.0);
            let power = between([0.5, 2.5]) as f32;
            (house.free.above_m(cell_m, height_m), tint * power)
        };
        let lamps = places.into_iter().map(lamp).collect();
        let strength = between([0.12, 0.4]) as f32;
        let tint = color(between([0.0, 360.0]), between([0.0, 0.15]), 1.0);
        Lamps {
            lamps,
            ambient: [
                tint * strength,
                tint * (strength * between([0.3, 0.8]) as f32),
            ],
        }
    }

    /// Light that comes from everywhere.
    pub(super) fn unshaded(&self, surface: &Surface) -> Light {
        let up = (0.5 + 0.5 * surface.normal.z) as f32;
        self.ambient[0] * up + self.ambient[1] * (1.0 - up)
    }

    /// Light from a surface to the camera: what its colour scatters, with shadows, and the shine of its gloss.
    pub(super) fn lit(&self, house: &House, surface: &Surface) -> Light {
        let mut scattered = self.unshaded(surface);
        let mut shine = Light::zeros();
        let start_m = surface.place_m + surface.normal * BIAS_M;
        for (place_m, light) in &self.lamps {
            let to = place_m - start_m;
            let distance_m = to.norm();
            if !(1e-3..REACH_M).contains(&distance_m) {
                continue;
            }
            let to = to / distance_m;
            let facing = surface.normal.dot(&to);
            if facing <= 0.0 || house.depth_m(&start_m, &to, distance_m).is_some() {
                continue;
            }
            // Ends softly.
            let end = 1.0 - (distance_m / REACH_M).powi(4);
            let fall = end * end / (0.3 + distance_m * distance_m);
            scattered += light * (facing * fall) as f32;
            let half = (to - surface.way).try_normalize(1e-9);
            let spot = half.map_or(0.0, |half| half.dot(&surface.normal).max(0.0));
            shine += light * (fall * spot.powi(SHINE)) as f32;
        }
        surface.albedo.component_mul(&scattered) + shine * (4.0 * surface.gloss)
    }
}
