//! A pinhole camera in the house, and its image of regions.

use super::House;
use super::regions::NO_REGION;
use crate::simulate::random::Stream;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

/// Width and height in pixels and the tangent of half the horizontal field of view.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Camera {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) tan_half: f64,
}

impl Camera {
    pub(super) fn new(width: usize, height: usize, hfov_deg: f64) -> Camera {
        Camera {
            width,
            height,
            tan_half: (hfov_deg.to_radians() / 2.0).tan(),
        }
    }

    pub(super) fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// Direction through the middle of a pixel in the camera, with x = 1.
    pub(super) fn direction(&self, pixel: usize) -> Vector3<f64> {
        let (row, column) = (pixel / self.width, pixel % self.width);
        let half = self.width as f64 / 2.0;
        let y = (half - column as f64 - 0.5) / half * self.tan_half;
        let z = (self.height as f64 / 2.0 - row as f64 - 0.5) / half * self.tan_half;
        Vector3::new(1.0, y, z)
    }

    /// The pixel of a point in the camera, if it is in front and in the image.
    pub(super) fn pixel(&self, point: &Vector3<f64>) -> Option<usize> {
        if point.x <= 0.0 {
            return None;
        }
        let half = self.width as f64 / 2.0;
        let column = half - point.y / point.x / self.tan_half * half;
        let row = self.height as f64 / 2.0 - point.z / point.x / self.tan_half * half;
        let inside =
            column >= 0.0 && row >= 0.0 && column < self.width as f64 && row < self.height as f64;
        inside.then(|| row as usize * self.width + column as usize)
    }
}

/// The pose of a camera that looks along yaw and pitch (up), radians.
pub(super) fn looking(position_m: Point3<f64>, yaw: f64, pitch: f64) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw)
        * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -pitch);
    Isometry3::from_parts(Translation3::from(position_m.coords), rotation)
}

/// A picture of a camera: depth along its x axis (infinite where nothing is) and region of each pixel.
pub(super) struct Image {
    pub(super) camera: Camera,
    pub(super) depths_m: Vec<f64>,
    pub(super) regions: Vec<u16>,
}

impl Image {
    pub(super) fn take(
        house: &House,
        house_from_camera: &Isometry3<f64>,
        camera: Camera,
        max_m: f64,
    ) -> Image {
        let origin = Point3::from(house_from_camera.translation.vector);
        let mut depths_m = Vec::with_capacity(camera.pixels());
        let mut regions = Vec::with_capacity(camera.pixels());
        for pixel in 0..camera.pixels() {
            let ray = camera.direction(pixel);
            let direction = house_from_camera.rotation * ray;
            let hit = house.cast(&origin, &direction, max_m);
            depths_m.push(hit.map_or(f64::INFINITY, |hit| hit.distance_m / ray.norm()));
            regions.push(hit.map_or(NO_REGION, |hit| hit.region));
        }
        Image {
            camera,
            depths_m,
            regions,
        }
    }

    /// The regions as a segmenter sees them whose boundaries waver by up to some `pixels`.
    pub(super) fn bled(&self, pixels: f64, stream: &mut Stream) -> Vec<u16> {
        if pixels.is_nan() || pixels <= 0.0 {
            return self.regions.clone();
        }
        let wave = |stream: &mut Stream| {
            let angle = std::f64::consts::TAU * stream.uniform();
            let rate = std::f64::consts::TAU / (10.0 + 25.0 * stream.uniform());
            let phase = std::f64::consts::TAU * stream.uniform();
            move |x: f64, y: f64| (rate * (x * angle.cos() + y * angle.sin()) + phase).sin()
        };
        let [a, b, c, d] = [(); 4].map(|()| wave(stream));
        let (width, height) = (self.camera.width, self.camera.height);
        let shifted = |pixel: usize| {
            let (x, y) = ((pixel % width) as f64, (pixel / width) as f64);
            let shift = |f: f64, g: f64| (f + g) / 2.0 * pixels;
            let column = (x + shift(a(x, y), b(x, y)))
                .round()
                .clamp(0.0, width as f64 - 1.0);
            let row = (y + shift(c(x, y), d(x, y)))
                .round()
                .clamp(0.0, height as f64 - 1.0);
            let at = row as usize * width + column as usize;
            self.regions.get(at).copied().unwrap_or(NO_REGION)
        };
        (0..self.regions.len()).map(shifted).collect()
    }
}
