//! A flat of a few rooms for tests: rectangles that are sampled as a map and looked at from inside.

use nalgebra::{Isometry3, Point3, Vector3};

use super::{HeadsetScan, LabelDistribution, SemanticCloud};

/// Distance between two poses, metres, and the angle between them, radians.
pub fn distance(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    let apart = (a.translation.vector - b.translation.vector).norm();
    (apart, a.rotation.angle_to(&b.rotation))
}

/// Numbers from a seed.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Random {
        Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x1234_5678_9abc_def1)
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in [-1, 1).
    pub fn signed(&mut self) -> f64 {
        2.0 * self.uniform() - 1.0
    }
}

/// A rectangle with a class.
#[derive(Clone, Copy)]
struct Patch {
    corner: Vector3<f64>,
    u: Vector3<f64>,
    v: Vector3<f64>,
    label: u16,
}

/// Rectangles.
pub struct Flat(Vec<Patch>);

/// Classes of the flat.
pub const WALL: u16 = 0;
pub const FLOOR: u16 = 1;
pub const FURNITURE: [u16; 5] = [4, 5, 6, 8, 9];

impl Flat {
    /// 9 m x 6 m, two rooms with a door between and furniture.
    pub fn new() -> Flat {
        let mut flat = Flat(Vec::new());
        flat.patch([0., 0., 0.], [9., 0., 0.], [0., 6., 0.], FLOOR);
        flat.patch([0., 0., 0.], [9., 0., 0.], [0., 0., 2.6], WALL);
        flat.patch([0., 6., 0.], [9., 0., 0.], [0., 0., 2.6], WALL);
        flat.patch([0., 0., 0.], [0., 6., 0.], [0., 0., 2.6], WALL);
        flat.patch([9., 0., 0.], [0., 6., 0.], [0., 0., 2.6], WALL);
        flat.patch([5., 0., 0.], [0., 3.8, 0.], [0., 0., 2.6], WALL);
        flat.patch([5., 4.8, 0.], [0., 1.2, 0.], [0., 0., 2.6], WALL);
        let boxes: [([f64; 3], [f64; 3], u16); 9] = [
            ([0.1, 0.1, 0.0], [0.6, 1.8, 0.8], 4),
            ([2.2, 0.1, 0.0], [1.6, 0.4, 1.9], 9),
            ([1.5, 2.6, 0.0], [1.4, 0.9, 0.75], 6),
            ([0.1, 4.6, 0.0], [2.1, 0.9, 0.45], 8),
            ([3.9, 5.3, 0.0], [0.9, 0.6, 1.1], 4),
            ([5.2, 0.2, 0.0], [0.8, 1.7, 0.7], 5),
            ([8.3, 2.0, 0.0], [0.6, 2.2, 2.1], 9),
            ([6.2, 4.3, 0.0], [1.5, 1.5, 0.5], 8),
            ([6.9, 0.1, 0.0], [0.5, 0.4, 1.3], 6),
        ];
        for (corner, size, label) in boxes {
            flat.cuboid(corner, size, label);
        }
        flat
    }

    fn patch(&mut self, corner: [f64; 3], u: [f64; 3], v: [f64; 3], label: u16) {
        let (corner, u, v) = (corner.into(), u.into(), v.into());
        self.0.push(Patch {
            corner,
            u,
            v,
            label,
        });
    }

    fn cuboid(&mut self, [x, y, z]: [f64; 3], [a, b, c]: [f64; 3], label: u16) {
        self.patch([x, y, z + c], [a, 0., 0.], [0., b, 0.], label);
        for (corner, u) in [
            ([x, y, z], [a, 0., 0.]),
            ([x, y + b, z], [a, 0., 0.]),
            ([x, y, z], [0., b, 0.]),
            ([x + a, y, z], [0., b, 0.]),
        ] {
            self.patch(corner, u, [0., 0., c], label);
        }
    }

    /// Points every 5 cm on all surfaces, a few millimetres off.
    pub fn map(&self, seed: u64) -> SemanticCloud {
        let mut random = Random::new(seed);
        let mut cloud = SemanticCloud::default();
        for patch in &self.0 {
            let (nu, nv) = (
                (patch.u.norm() / 0.05) as usize,
                (patch.v.norm() / 0.05) as usize,
            );
            for i in 0..nu {
                for j in 0..nv {
                    let (s, t) = ((i as f64 + 0.5) / nu as f64, (j as f64 + 0.5) / nv as f64);
                    let off = Vector3::from_fn(|_, _| 0.004 * random.signed());
                    cloud
                        .points_m
                        .push((patch.corner + patch.u * s + patch.v * t + off).into());
                    cloud.labels.push(LabelDistribution::hard(patch.label));
                }
            }
        }
        cloud
    }

    /// A headset's scan from a place, in its own frame.
    pub fn headset_scan(
        &self,
        eye: Point3<f64>,
        yaw: f64,
        map_from_headset: &Isometry3<f64>,
        seed: u64,
    ) -> HeadsetScan {
        let mut random = Random::new(seed);
        let headset_from_map = map_from_headset.inverse();
        let mut cloud = SemanticCloud::default();
        for i in 0..80 {
            for j in 0..60 {
                let (az, el) = (
                    yaw + f64::from(i - 40) * 0.012,
                    -0.25 + f64::from(j - 30) * 0.012,
                );
                let way = Vector3::new(az.cos() * el.cos(), az.sin() * el.cos(), el.sin());
                let Some((distance, label)) = self.hit(&eye, &way) else {
                    continue;
                };
                let place = eye + way * (distance + 0.008 * random.signed());
                cloud.points_m.push(headset_from_map * place);
                cloud.labels.push(LabelDistribution::hard(label));
            }
        }
        HeadsetScan {
            cloud,
            sensor_m: Some(headset_from_map * eye),
        }
    }

    fn hit(&self, eye: &Point3<f64>, way: &Vector3<f64>) -> Option<(f64, u16)> {
        let hits = self.0.iter().filter_map(|p| {
            let normal = p.u.cross(&p.v);
            let distance = normal.dot(&(p.corner - eye.coords)) / normal.dot(way);
            let off = eye.coords + way * distance - p.corner;
            let inside =
                |axis: &Vector3<f64>| (0.0..1.0).contains(&(off.dot(axis) / axis.norm_squared()));
            (distance > 0.05 && distance < 8.0 && inside(&p.u) && inside(&p.v))
                .then_some((distance, p.label))
        });
        hits.min_by(|a, b| a.0.total_cmp(&b.0))
    }
}
