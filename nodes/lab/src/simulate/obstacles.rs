//! Solid things that stand on the ground.

use nalgebra::{Vector2, Vector3};

/// A box turned about the vertical.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    center_m: Vector3<f64>,
    half_m: Vector3<f64>,
    cos_yaw: f64,
    sin_yaw: f64,
}

impl Block {
    /// A box of full `size_m` (length along its heading, width, height) with its middle at `center_m`.
    pub fn new(center_m: Vector3<f64>, size_m: Vector3<f64>, yaw_rad: f64) -> Self {
        let (sin_yaw, cos_yaw) = yaw_rad.sin_cos();
        Self {
            center_m,
            half_m: size_m * 0.5,
            cos_yaw,
            sin_yaw,
        }
    }

    /// Distance (m) to the first face entered and its outward normal; None from inside.
    pub fn cast(
        &self,
        origin: &Vector3<f64>,
        direction: &Vector3<f64>,
    ) -> Option<(f64, Vector3<f64>)> {
        let from = self.turn_in(&(origin - self.center_m));
        let along = self.turn_in(direction);
        let (mut enter, mut leave, mut face) = (f64::NEG_INFINITY, f64::INFINITY, Vector3::zeros());
        for axis in 0..3 {
            if along[axis] == 0.0 {
                if from[axis].abs() > self.half_m[axis] {
                    return None;
                }
                continue;
            }
            let side = -along[axis].signum();
            let near = (side * self.half_m[axis] - from[axis]) / along[axis];
            let far = (-side * self.half_m[axis] - from[axis]) / along[axis];
            if near > enter {
                enter = near;
                face = Vector3::zeros();
                face[axis] = side;
            }
            leave = leave.min(far);
        }
        (enter > 0.0 && enter <= leave).then(|| (enter, self.turn_out(&face)))
    }

    /// Distance from a point to the surface, m.
    #[cfg(test)]
    pub fn surface_distance_m(&self, point: &Vector3<f64>) -> f64 {
        let excess = self.turn_in(&(point - self.center_m)).abs() - self.half_m;
        let outside = excess.map(|e| e.max(0.0)).norm();
        if outside > 0.0 {
            outside
        } else {
            -excess.max()
        }
    }

    /// Distance on the ground from a point to the footprint, zero inside, m.
    #[cfg(test)]
    pub fn ground_clearance_m(&self, point: &Vector2<f64>) -> f64 {
        let offset = Vector3::new(point.x - self.center_m.x, point.y - self.center_m.y, 0.0);
        let excess = self.turn_in(&offset).xy().abs() - self.half_m.xy();
        excess.map(|e| e.max(0.0)).norm()
    }

    /// Corners of the upright bounding box, m.
    pub fn bounds_m(&self) -> [Vector3<f64>; 2] {
        let (c, s) = (self.cos_yaw.abs(), self.sin_yaw.abs());
        let half = Vector3::new(
            c * self.half_m.x + s * self.half_m.y,
            s * self.half_m.x + c * self.half_m.y,
            self.half_m.z,
        );
        [self.center_m - half, self.center_m + half]
    }

    fn turn_in(&self, v: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(
            self.cos_yaw * v.x + self.sin_yaw * v.y,
            self.cos_yaw * v.y - self.sin_yaw * v.x,
            v.z,
        )
    }

    fn turn_out(&self, v: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(
            self.cos_yaw * v.x - self.sin_yaw * v.y,
            self.sin_yaw * v.x + self.cos_yaw * v.y,
            v.z,
        )
    }
}

/// An upright cylinder; its top is open to rays, being far smaller than the gap between two beams.
#[derive(Clone, Copy, Debug)]
pub struct Post {
    /// Middle of the axis on the ground plan, m.
    pub center_m: Vector2<f64>,
    pub radius_m: f64,
    /// Heights of foot and top in the map, m.
    pub span_m: [f64; 2],
}

impl Post {
    /// Distance (m) to the mantle from outside and its outward normal.
    pub fn cast(
        &self,
        origin: &Vector3<f64>,
        direction: &Vector3<f64>,
    ) -> Option<(f64, Vector3<f64>)> {
        let from = origin.xy() - self.center_m;
        let along = direction.xy();
        let a = along.norm_squared();
        let b = from.dot(&along);
        let c = from.norm_squared() - self.radius_m * self.radius_m;
        let discriminant = b * b - a * c;
        if a == 0.0 || c <= 0.0 || discriminant < 0.0 {
            return None;
        }
        let distance = (-b - discriminant.sqrt()) / a;
        let z = origin.z + direction.z * distance;
        let hit = distance > 0.0 && z >= self.span_m[0] && z <= self.span_m[1];
        let normal = (from + along * distance) / self.radius_m;
        hit.then(|| (distance, normal.push(0.0)))
    }

    /// Distance from a point to the mantle, m.
    #[cfg(test)]
    pub fn surface_distance_m(&self, point: &Vector3<f64>) -> f64 {
        let radial = (point.xy() - self.center_m).norm() - self.radius_m;
        let axial = (self.span_m[0] - point.z)
            .max(point.z - self.span_m[1])
            .max(0.0);
        radial.hypot(axial)
    }
}

/// Something that rays hit.
#[derive(Clone, Copy, Debug)]
pub enum Obstacle {
    Block(Block, f64),
    Post(Post, f64),
}

impl Obstacle {
    /// Distance (m), outward normal and reflectivity of the first surface that the ray enters.
    pub fn cast(
        &self,
        origin: &Vector3<f64>,
        direction: &Vector3<f64>,
    ) -> Option<(f64, Vector3<f64>, f64)> {
        let (hit, reflectivity) = match self {
            Self::Block(block, reflectivity) => (block.cast(origin, direction), *reflectivity),
            Self::Post(post, reflectivity) => (post.cast(origin, direction), *reflectivity),
        };
        hit.map(|(distance_m, normal)| (distance_m, normal, reflectivity))
    }

    /// Distance from a point to the surface, m.
    #[cfg(test)]
    pub fn surface_distance_m(&self, point: &Vector3<f64>) -> f64 {
        match self {
            Self::Block(block, _) => block.surface_distance_m(point),
            Self::Post(post, _) => post.surface_distance_m(point),
        }
    }

    /// Distance on the ground plan from a point to the footprint, zero inside, m.
    #[cfg(test)]
    pub fn ground_clearance_m(&self, point: &Vector2<f64>) -> f64 {
        match self {
            Self::Block(block, _) => block.ground_clearance_m(point),
            Self::Post(post, _) => ((point - post.center_m).norm() - post.radius_m).max(0.0),
        }
    }

    /// Corners of the upright bounding box, m.
    pub fn bounds_m(&self) -> [Vector3<f64>; 2] {
        match self {
            Self::Block(block, _) => block.bounds_m(),
            Self::Post(post, _) => {
                let reach = Vector2::repeat(post.radius_m);
                [
                    (post.center_m - reach).push(post.span_m[0]),
                    (post.center_m + reach).push(post.span_m[1]),
                ]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn direction(azimuth: f64, elevation: f64) -> Vector3<f64> {
        Vector3::new(
            elevation.cos() * azimuth.cos(),
            elevation.cos() * azimuth.sin(),
            elevation.sin(),
        )
    }

    proptest! {
        #[test]
        fn hits_lie_on_the_surface_and_face_the_ray(
            x in -9.0f64..9.0, y in -9.0f64..9.0, z in -1.0f64..6.0, azimuth in 0.0f64..6.3, elevation in -1.5f64..1.5
        ) {
            let obstacles = [
                Obstacle::Block(Block::new(Vector3::new(1.0, -2.0, 1.5), Vector3::new(6.0, 2.4, 2.6), 0.6), 0.5),
                Obstacle::Post(Post { center_m: Vector2::new(-1.0, 0.5), radius_m: 0.4, span_m: [0.0, 3.0] }, 0.5),
            ];
            let (origin, direction) = (Vector3::new(x, y, z), direction(azimuth, elevation));
            for obstacle in obstacles {
                if let Some((distance_m, normal, _)) = obstacle.cast(&origin, &direction) {
                    let point = origin + direction * distance_m;
                    prop_assert!(obstacle.surface_distance_m(&point) < 1e-9);
                    prop_assert!(normal.dot(&direction) <= 0.0 && (normal.norm() - 1.0).abs() < 1e-9);
                    let [low, high] = obstacle.bounds_m();
                    for axis in 0..3 {
                        prop_assert!(point[axis] > low[axis] - 1e-9 && point[axis] < high[axis] + 1e-9);
                    }
                }
            }
        }
    }

    #[test]
    fn rays_towards_the_middle_hit_and_rays_away_miss() {
        let from = |x: f64, z: f64| Vector3::new(x, 0.0, z);
        let block = Block::new(from(5.0, 1.0), Vector3::repeat(2.0), 0.0);
        let hit = block.cast(&from(0.0, 1.0), &Vector3::x());
        assert_eq!(hit, Some((4.0, -Vector3::x())));
        assert_eq!(block.cast(&from(0.0, 1.0), &-Vector3::x()), None);
        assert_eq!(block.cast(&from(5.0, 1.0), &Vector3::x()), None);
        let wide = Block::new(from(0.0, 1.0), Vector3::new(4.0, 2.0, 2.0), 0.0);
        assert_eq!(wide.ground_clearance_m(&Vector2::new(5.0, 0.0)), 3.0);
        let post = Post {
            center_m: Vector2::new(5.0, 0.0),
            radius_m: 0.5,
            span_m: [0.0, 2.0],
        };
        let hit = post.cast(&from(0.0, 1.0), &Vector3::x());
        assert_eq!(hit.unwrap().0, 4.5);
        assert_eq!(post.cast(&from(0.0, 3.0), &Vector3::x()), None);
    }
}
