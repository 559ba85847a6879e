//! A flat of labelled rectangles, its map, and scans of it.

use lattice_core::registration::{LabelDistribution, SemanticCloud};
use nalgebra::{Isometry3, Point3, Vector3};

/// Labelled rectangle: corner, sides, label.
type Patch = (Vector3<f64>, Vector3<f64>, Vector3<f64>, u16);

pub(super) const WALL: u16 = 1;
pub(super) const FLOOR: u16 = 2;

/// Corner, size and class of the furniture.
const FURNITURE: [([f64; 3], [f64; 3], u16); 8] = [
    ([0.1, 0.1, 0.0], [0.6, 1.9, 0.8], 4),
    ([2.3, 0.1, 0.0], [1.5, 0.4, 1.9], 9),
    ([1.4, 2.5, 0.0], [1.4, 0.9, 0.75], 6),
    ([0.1, 4.5, 0.0], [2.0, 0.9, 0.45], 8),
    ([3.8, 5.3, 0.0], [0.9, 0.6, 1.1], 4),
    ([5.3, 0.2, 0.0], [0.8, 1.6, 0.7], 5),
    ([8.2, 2.1, 0.0], [0.6, 2.1, 2.1], 9),
    ([6.1, 4.2, 0.0], [1.6, 1.5, 0.5], 8),
];

/// Positions and headings of views in the flat; the last view sees only a bare wall.
pub const LOOKS: [([f64; 3], f64); 6] = [
    ([3.5, 3.8, 1.6], -2.2),
    ([1.0, 3.9, 1.6], -0.6),
    ([7.5, 3.0, 1.6], 2.2),
    ([6.5, 3.0, 1.6], -0.4),
    ([4.2, 4.3, 1.6], 3.0),
    ([3.5, 3.0, 1.6], 1.6),
];

/// Flat of two rooms of 9 m x 6 m with a door between.
#[derive(Clone, Debug)]
pub struct Flat(Vec<Patch>);

impl Default for Flat {
    fn default() -> Self {
        let mut flat = Self::empty();
        flat.add([0., 0., 0.], [9., 0., 0.], [0., 6., 0.], FLOOR);
        for (corner, along) in [
            ([0., 0.], [9., 0.]),
            ([0., 6.], [9., 0.]),
            ([0., 0.], [0., 6.]),
            ([9., 0.], [0., 6.]),
            ([5., 0.], [0., 3.8]),
            ([5., 4.8], [0., 1.2]),
        ] {
            let ([x, y], [u, v]) = (corner, along);
            flat.add([x, y, 0.], [u, v, 0.], [0., 0., 2.6], WALL);
        }
        for (corner, size, label) in FURNITURE {
            flat.add_box(corner, size, label);
        }
        flat
    }
}

impl Flat {
    /// Creates a flat without surfaces.
    pub(super) fn empty() -> Flat {
        Flat(Vec::new())
    }

    /// Adds the top and the four sides of a box.
    pub(super) fn add_box(&mut self, [x, y, z]: [f64; 3], [a, b, c]: [f64; 3], label: u16) {
        self.add([x, y, z + c], [a, 0., 0.], [0., b, 0.], label);
        self.add([x, y, z], [a, 0., 0.], [0., 0., c], label);
        self.add([x, y + b, z], [a, 0., 0.], [0., 0., c], label);
        self.add([x, y, z], [0., b, 0.], [0., 0., c], label);
        self.add([x + a, y, z], [0., b, 0.], [0., 0., c], label);
    }

    pub(super) fn add(&mut self, corner: [f64; 3], u: [f64; 3], v: [f64; 3], label: u16) {
        self.0.push((corner.into(), u.into(), v.into(), label));
    }

    /// Points every `step_m` on all surfaces, with their classes.
    pub fn points(&self, step_m: f64) -> Vec<(Vector3<f64>, u16)> {
        let mut points = Vec::new();
        for (corner, u, v, label) in &self.0 {
            let steps = |side: &Vector3<f64>| (side.norm() / step_m).ceil() as usize;
            for i in 0..steps(u) {
                for j in 0..steps(v) {
                    let s = (i as f64 + 0.5) / steps(u) as f64;
                    let t = (j as f64 + 0.5) / steps(v) as f64;
                    points.push((corner + u * s + v * t, *label));
                }
            }
        }
        points
    }

    /// Map of the flat in cells of 5 cm.
    pub fn map(&self) -> SemanticCloud {
        let (points_m, labels) = (self.points(0.05).into_iter())
            .map(|(p, label)| (Point3::from(p), LabelDistribution::hard(label)))
            .unzip();
        SemanticCloud { points_m, labels }
    }

    /// Scan of a headset that stands at `eye` in the map and looks along `yaw`, 80 x 60 rays, in its
    /// own frame: x forward, y left, z up.
    pub fn look(
        &self,
        eye: Point3<f64>,
        yaw: f64,
        map_from_headset: &Isometry3<f64>,
    ) -> SemanticCloud {
        let headset_from_map = map_from_headset.inverse();
        let mut cloud = SemanticCloud::default();
        for i in -40..40_i32 {
            for j in -30..30_i32 {
                let (az, el) = (yaw + f64::from(i) * 0.012, -0.25 + f64::from(j) * 0.012);
                let way = Vector3::new(az.cos() * el.cos(), az.sin() * el.cos(), el.sin());
                if let Some((distance, label)) = self.hit(&eye, &way, 8.0) {
                    // A few millimetres off, other ones for each ray.
                    let off = 0.004 * f64::from((i * 7 + j * 13).rem_euclid(11) - 5) / 5.0;
                    let place = eye + way * (distance + off);
                    cloud.points_m.push(headset_from_map * place);
                    cloud.labels.push(LabelDistribution::hard(label));
                }
            }
        }
        cloud
    }

    /// Distance and class of the first surface along a ray, within `range_m`.
    pub(super) fn hit(
        &self,
        eye: &Point3<f64>,
        way: &Vector3<f64>,
        range_m: f64,
    ) -> Option<(f64, u16)> {
        let hits = self.0.iter().filter_map(|(corner, u, v, label)| {
            let normal = u.cross(v);
            let distance = normal.dot(&(corner - eye.coords)) / normal.dot(way);
            let off = eye.coords + way * distance - corner;
            let within =
                |side: &Vector3<f64>| (0.0..1.0).contains(&(off.dot(side) / side.norm_squared()));
            let is_hit = distance > 0.05 && distance < range_m && within(u) && within(v);
            is_hit.then_some((distance, *label))
        });
        hits.min_by(|a, b| a.0.total_cmp(&b.0))
    }
}
