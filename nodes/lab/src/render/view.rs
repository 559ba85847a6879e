//! Parallel projection.

use crate::evaluate::extent;
use nalgebra::Vector3;

/// Part of the picture that stays free around the map.
const MARGIN: f64 = 0.03;

/// A direction of view and where the map is on the screen.
///
/// Screen coordinates are in samples, x to the right, y down, the depth in metres towards the
/// viewer; map coordinates are relative to the datum.
#[derive(Clone, Debug)]
pub struct View {
    pub right: Vector3<f64>,
    pub up: Vector3<f64>,
    pub toward: Vector3<f64>,
    /// Width and height, samples.
    pub size: [usize; 2],
    /// Samples a metre.
    pub scale: f64,
    /// Middle of the screen, along right, up and toward, metres.
    middle_m: [f64; 3],
}

impl View {
    /// A view from a camera at this compass direction and height seen from the map.
    pub fn new(azimuth_deg: f64, elevation_deg: f64, size: [usize; 2]) -> View {
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

    /// Moves and scales so that all cells are seen: their centres, and their largest extent from these.
    pub fn fit(mut self, centers: impl Iterator<Item = Vector3<f64>>, radius_m: f64) -> View {
        let centers: Vec<[f64; 3]> = centers.map(|c| self.along(&c)).collect();
        if centers.is_empty() {
            return self;
        }
        let sides = [self.size[0], self.size[1], usize::MAX];
        self.scale = f64::MAX;
        for (axis, side) in sides.into_iter().enumerate() {
            let [low, high] = extent(centers.iter().map(|c| c[axis]));
            self.middle_m[axis] = 0.5 * (low + high);
            let extent = high - low + 2.0 * radius_m;
            let scale = side as f64 * (1.0 - 2.0 * MARGIN) / extent;
            self.scale = self.scale.min(scale);
        }
        self
    }

    /// Puts a point, relative to the datum, in the middle of a screen that is so wide.
    pub fn at(mut self, center_m: &Vector3<f64>, width_m: f64) -> View {
        self.middle_m = self.along(center_m);
        self.scale = self.size[0] as f64 / width_m;
        self
    }

    fn along(&self, p: &Vector3<f64>) -> [f64; 3] {
        [self.right.dot(p), self.up.dot(p), self.toward.dot(p)]
    }

    /// Screen coordinates and depth of a point.
    pub fn project(&self, p: &Vector3<f64>) -> [f64; 3] {
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
    pub fn unproject(&self, [x, y, z]: [f64; 3]) -> Vector3<f64> {
        let [width, height] = self.size.map(|side| side as f64);
        let [mid_x, mid_y, mid_z] = self.middle_m;
        self.right * ((x - 0.5 * width) / self.scale + mid_x)
            + self.up * (mid_y - (y - 0.5 * height) / self.scale)
            + self.toward * (z + mid_z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axes_are_those_of_a_map_on_a_table() {
        let south = View::new(180.0, 0.0, [1, 1]);
        let near = |a: Vector3<f64>, b: Vector3<f64>| (a - b).norm() < 1e-12;
        assert!(near(south.toward, -Vector3::y()));
        assert!(near(south.right, Vector3::x()));
        assert!(near(south.up, Vector3::z()));
        let above = View::new(180.0, 90.0, [1, 1]);
        assert!(near(above.toward, Vector3::z()));
        assert!(near(above.up, Vector3::y()));
        let east = View::new(90.0, 0.0, [1, 1]);
        assert!(near(east.toward, Vector3::x()));
        assert!(near(east.right, Vector3::y()));
    }

    #[test]
    fn unproject_is_the_inverse_of_project() {
        let mut view = View::new(215.0, 35.0, [400, 300]);
        view.scale = 7.5;
        view.middle_m = [3.0, -2.0, 11.0];
        for p in [Vector3::new(1.0, 2.0, 3.0), Vector3::new(-40.0, 0.5, 6.0)] {
            assert!((view.unproject(view.project(&p)) - p).norm() < 1e-12);
        }
    }
}
