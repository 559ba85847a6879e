//! Parallel projection.

use nalgebra::Vector3;

use super::raster::Scene;

/// Part of the picture that stays free around the map.
const MARGIN: f64 = 0.03;

/// A direction of view and where the map is on the screen.
///
/// Screen coordinates are in samples, x to the right, y down, the depth in metres towards the
/// viewer; map coordinates are relative to the datum.
#[derive(Clone, Debug)]
pub(super) struct View {
    pub(super) right: Vector3<f64>,
    pub(super) up: Vector3<f64>,
    pub(super) toward: Vector3<f64>,
    /// Width and height, samples.
    pub(super) size: [usize; 2],
    /// Samples a metre.
    pub(super) scale: f64,
    /// What is in the middle of the screen, along right, up and toward, metres.
    middle_m: [f64; 3],
}

impl View {
    /// From a camera at this compass direction and height seen from the map.
    pub(super) fn new(azimuth_deg: f64, elevation_deg: f64, size: [usize; 2]) -> View {
        let (sin_a, cos_a) = azimuth_deg.to_radians().sin_cos();
        let (sin_e, cos_e) = elevation_deg.to_radians().sin_cos();
        let toward = Vector3::new(sin_a * cos_e, cos_a * cos_e, sin_e);
        let right = Vector3::new(-cos_a, sin_a, 0.0);
        View {
            right,
            up: toward.cross(&right),
            toward,
            size,
            scale: 1.0,
            middle_m: [0.0; 3],
        }
    }

    /// Moves and scales so that the whole scene is seen, or a part of it if `zoom` is above 1.
    pub(super) fn fit(mut self, scene: &Scene, zoom: f64) -> View {
        let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
        for center in scene.centers() {
            let along = self.along(&center);
            for ((low, high), c) in low.iter_mut().zip(&mut high).zip(along) {
                *low = low.min(c);
                *high = high.max(c);
            }
        }
        if low[0] > high[0] {
            return self;
        }
        let mut scale = f64::MAX;
        for (((low, high), middle), side) in low.iter().zip(high).zip(&mut self.middle_m).zip([
            self.size[0],
            self.size[1],
            usize::MAX,
        ]) {
            *middle = 0.5 * (low + high);
            let extent = high - low + 2.0 * scene.radius_m;
            scale = scale.min(side as f64 * (1.0 - 2.0 * MARGIN) / extent);
        }
        self.scale = scale * zoom;
        self
    }

    fn along(&self, p: &Vector3<f64>) -> [f64; 3] {
        [self.right.dot(p), self.up.dot(p), self.toward.dot(p)]
    }

    /// Screen coordinates and depth of a point.
    pub(super) fn project(&self, p: &Vector3<f64>) -> [f64; 3] {
        let [x, y, z] = self.along(p);
        let [width, height] = self.size.map(|side| side as f64);
        let [mid_x, mid_y, mid_z] = self.middle_m;
        [
            (x - mid_x) * self.scale + 0.5 * width,
            (mid_y - y) * self.scale + 0.5 * height,
            z - mid_z,
        ]
    }

    /// The point at screen coordinates and depth; inverse of [`View::project`].
    pub(super) fn unproject(&self, [x, y, z]: [f64; 3]) -> Vector3<f64> {
        let [width, height] = self.size.map(|side| side as f64);
        let [mid_x, mid_y, mid_z] = self.middle_m;
        self.right * ((x - 0.5 * width) / self.scale + mid_x)
            + self.up * (mid_y - (y - 0.5 * height) / self.scale)
            + self.toward * (z + mid_z)
    }
}
