//! Images of a house as cameras see it: colours, depth and true labels, by rays on its mesh.
//!
//! [`RoomImages`] gives each thing in a house a material and each room lamps, all drawn by one seed;
//! [`RoomCamera`] is a pinhole camera with its exposure, noise and vignetting. Everything is a function of
//! house, seeds and pose, on any number of threads.
//!
//! ```
//! use lattice_lab::simulate::house::{House, RoomCamera, RoomImages, robot_views};
//!
//! let house = House::generated(1)?;
//! let rooms = RoomImages::new(&house, 7);
//! let view = robot_views(&house, 8, 3)?[0];
//! let image = rooms.take(&RoomCamera::ROBOT.sized(64, 48), &view.truth, 0);
//! assert_eq!(image.rgb.len(), 3 * 64 * 48);
//! # Ok::<(), lattice_lab::AnyError>(())
//! ```

mod lamps;
mod light;
mod material;
mod optics;
mod pattern;
mod recipes;
mod sensor;
#[cfg(test)]
mod tests;
mod views;

pub use optics::RoomCamera;
pub use views::look_views;

use super::House;
use super::robot::{RANGE_M, depth_noise_m};
use crate::simulate::random::{Purpose, Stream};
use lamps::Lamps;
use lattice_core::registration::UNLABELED;
use light::Light;
use material::Material;
use nalgebra::{Isometry3, Point3, Vector3};
use rayon::prelude::*;

/// Farthest surface that is seen, metres.
const MAX_M: f64 = 60.0;

/// A house with the look of everything in it: materials and lamps.
pub struct RoomImages<'a> {
    house: &'a House,
    /// Material of each thing.
    materials: Vec<Material>,
    lamps: Lamps,
    /// Light from above and below where there is nothing.
    sky: [Light; 2],
}

/// An image of a camera in a house, row by row.
#[derive(Clone, PartialEq, Debug)]
pub struct RoomImage {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Red, green and blue of each pixel, sRGB.
    pub rgb: Vec<u8>,
    /// Distance of each pixel's surface along the axis of the camera, metres; infinite where nothing is.
    pub depth_m: Vec<f32>,
    /// True class of each pixel; 65535 where nothing is.
    pub labels: Vec<u16>,
}

/// A pixel before the sensor.
#[derive(Clone, Copy)]
struct Seen {
    light: Light,
    depth_m: f32,
    label: u16,
}

impl<'a> RoomImages<'a> {
    /// Materials and lamps of a house, by a seed alone.
    pub fn new(house: &'a House, seed: u64) -> RoomImages<'a> {
        let mut stream = Stream::new(seed, Purpose::Lamps, 0, 0);
        let lamps = Lamps::new(house, &mut stream);
        let hue_deg = 360.0 * stream.uniform();
        let above = light::color(200.0 + 40.0 * stream.uniform(), 0.3 * stream.uniform(), 0.9);
        let below = light::color(hue_deg, 0.2 * stream.uniform(), 0.3 * stream.uniform());
        RoomImages {
            house,
            materials: material::of_things(house, seed),
            lamps,
            sky: [above, below],
        }
    }

    /// The house.
    pub fn house(&self) -> &'a House {
        self.house
    }

    /// The image of a camera at a pose: x forward, y left, z up, house frame. `seed` is that of its exposure
    /// and noise.
    pub fn take(
        &self,
        camera: &RoomCamera,
        house_from_camera: &Isometry3<f64>,
        seed: u64,
    ) -> RoomImage {
        let rows = (0..camera.height).into_par_iter();
        let row = |row: usize| {
            let pixel = |column: usize| self.see(house_from_camera, &camera.ray(column, row));
            (0..camera.width).map(pixel).collect::<Vec<Seen>>()
        };
        let seen: Vec<Seen> = rows.flat_map_iter(row).collect();
        let light: Vec<Light> = seen.iter().map(|seen| seen.light).collect();
        RoomImage {
            width: camera.width,
            height: camera.height,
            rgb: sensor::developed(camera, &light, seed),
            depth_m: seen.iter().map(|seen| seen.depth_m).collect(),
            labels: seen.iter().map(|seen| seen.label).collect(),
        }
    }

    /// Light, depth and class along a ray of the camera, whose x is 1.
    fn see(&self, house_from_camera: &Isometry3<f64>, ray: &Vector3<f64>) -> Seen {
        let origin_m = Point3::from(house_from_camera.translation.vector);
        let way = house_from_camera.rotation * ray.normalize();
        let Some(hit) = self.house.scene.cast(&origin_m, &way, MAX_M) else {
            let up = (way.z as f32).max(0.0);
            return Seen {
                light: self.sky[0] * up + self.sky[1] * (1.0 - up),
                depth_m: f32::INFINITY,
                label: UNLABELED,
            };
        };
        let place_m = origin_m + way * hit.distance_m;
        let normal = self.normal(hit.triangle, &way);
        let thing = self.house.regions.thing_of.get(hit.triangle);
        let thing = thing.map_or(0, |&thing| thing as usize);
        let light = match (
            self.materials.get(thing),
            self.house.regions.things.get(thing),
        ) {
            (Some(material), Some(thing)) => {
                let local_m = place_m.coords - Vector3::from(thing.low_m);
                let albedo = material.albedo(&local_m.cast::<f32>(), &normal.cast::<f32>());
                let surface = lamps::Surface {
                    place_m,
                    normal,
                    way,
                    albedo,
                    gloss: material.gloss,
                };
                self.lamps.lit(self.house, &surface) + albedo * material.glow
            }
            _ => Light::zeros(),
        };
        let label = self.house.mesh().labels().get(hit.triangle);
        Seen {
            light,
            depth_m: (hit.distance_m / ray.norm()) as f32,
            label: label.copied().unwrap_or(UNLABELED),
        }
    }

    /// Normal of a triangle, on the side that is seen along a way.
    fn normal(&self, triangle: usize, way: &Vector3<f64>) -> Vector3<f64> {
        let mesh = self.house.mesh();
        let vertex = |v: u32| mesh.vertices_m().get(v as usize).copied();
        let corners = mesh.triangles().get(triangle).copied();
        let corners = corners.map(|t| t.map(|v| vertex(v).unwrap_or_default()));
        let [a, b, c] = corners
            .unwrap_or_default()
            .map(|p| Vector3::from(p.map(f64::from)));
        let normal = (b - a).cross(&(c - a));
        let normal = normal.try_normalize(1e-20).unwrap_or(-way);
        match normal.dot(way) > 0.0 {
            true => -normal,
            false => normal,
        }
    }
}

impl RoomImage {
    /// The depths as a camera with structured light measures them (Nguyen, Izadi & Lovell 2012), metres: 0 where
    /// nothing is, and nearer than 0.4 m or farther than 4.5 m.
    pub fn measured_depth_m(&self, seed: u64) -> Vec<f32> {
        let mut stream = Stream::new(seed, Purpose::DepthNoise, 0, 0);
        let measured = |&depth_m: &f32| {
            let noise = stream.normal();
            let depth_m = f64::from(depth_m);
            match RANGE_M.contains(&depth_m) {
                true => (depth_m + noise * depth_noise_m(depth_m)) as f32,
                false => 0.0,
            }
        };
        self.depth_m.iter().map(measured).collect()
    }
}
