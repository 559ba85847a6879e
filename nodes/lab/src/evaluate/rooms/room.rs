//! A room, what a robot maps of it, and what a headset sees.

use lattice_core::registration::{SemanticCloud, SourceCloud, voxel_downsample};
use nalgebra::{Isometry3, Point3, Vector3};
use std::f64::consts::{PI, TAU};
use std::ops::Range;

use crate::AnyError;
use crate::evaluate::quantile;
use crate::evaluate::views::signed;
use crate::mesh::{LabelledMesh, MeshScene};
use crate::random::Stream;

/// Side of a cell of the map, metres.
pub const CELL_SIDE_M: f64 = 0.05;
/// Places of the robot, rays in all directions at each, and their noise, metres.
const STANDS: usize = 12;
const RAYS: usize = 15_000;
const ROBOT_NOISE_M: f64 = 0.02;
/// Rays of the headset's look, its fields of view, and its noise, metres.
const LOOK_RAYS: usize = 8_000;
const FIELD_DEG: [f64; 2] = [120.0, 66.0];
const LOOK_NOISE_M: f64 = 0.015;
/// Height of the headset's wearer's eyes, metres.
const EYES_M: f64 = 1.6;
/// Farthest surface that is measured, metres.
const REACH_M: f64 = 8.0;
/// Free space about a stand, and above the floor, metres.
const CLEAR_M: f64 = 0.2;
const HEADROOM_M: f64 = 1.7;
/// Largest step of the floor at a stand, metres.
const STEP_M: f64 = 0.1;
/// Directions to the sides of a stand, and how many of them must end at a surface.
const SIDES: usize = 16;
const CLOSED: usize = 12;
/// Places that are tried for a stand.
const TRIES: usize = 10_000;

/// A room to calibrate in.
pub struct Room {
    /// Name, as of its file.
    pub name: String,
    scene: MeshScene,
    low_m: [f64; 3],
    high_m: [f64; 3],
    floor_m: f64,
}

impl Room {
    /// Prepares a mesh: metres, z up.
    pub fn new(name: String, mesh: &LabelledMesh) -> Result<Room, AnyError> {
        let (mut low_m, mut high_m) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for vertex in mesh.vertices_m() {
            for ((low, high), c) in low_m.iter_mut().zip(&mut high_m).zip(vertex) {
                *low = low.min(f64::from(*c));
                *high = high.max(f64::from(*c));
            }
        }
        let mut room = Room {
            scene: MeshScene::new(mesh)?,
            name,
            low_m,
            high_m,
            floor_m: low_m[2],
        };
        let random = &mut Stream::numbered(0, 0);
        let middle_m = 0.5 * (low_m[2] + high_m[2]);
        let heights: Vec<f64> = (0..1000)
            .filter_map(|_| {
                let [x, y] = room.place(random);
                let below_m = room.distance_m(&Point3::new(x, y, middle_m), &-Vector3::z())?;
                Some(middle_m - below_m)
            })
            .collect();
        room.floor_m = quantile(heights, 0.1).ok_or("the room has no floor")?;
        Ok(room)
    }

    /// Map of a robot whose sensor is at a height, metres, above the floor at some places.
    pub fn map(
        &self,
        heights_m: Range<f64>,
        random: &mut Stream,
    ) -> Result<SemanticCloud, AnyError> {
        let height_m = heights_m.start + (heights_m.end - heights_m.start) * random.uniform();
        let mut points_m = Vec::new();
        for _ in 0..STANDS {
            let stand = self.stand(height_m, random)?;
            for _ in 0..RAYS {
                let direction = random.rotation() * Vector3::x();
                points_m.extend(self.measure(&stand, &direction, ROBOT_NOISE_M, random));
            }
        }
        Ok(voxel_downsample(
            &SemanticCloud::unlabelled(points_m),
            CELL_SIDE_M,
        ))
    }

    /// One look of a headset that stands somewhere, in the headset's frame.
    pub fn look(
        &self,
        map_from_headset: &Isometry3<f64>,
        random: &mut Stream,
    ) -> Result<SourceCloud, AnyError> {
        let eyes = self.stand(EYES_M + 0.1 * signed(random), random)?;
        let (yaw, pitch) = (PI * signed(random), 0.2 + 0.2 * signed(random));
        let turn = nalgebra::UnitQuaternion::from_euler_angles(0.0, pitch, yaw);
        let reach = FIELD_DEG.map(|field| (0.5 * field).to_radians().tan());
        let headset_from_map = map_from_headset.inverse();
        let mut points_m = Vec::new();
        for _ in 0..LOOK_RAYS {
            let [y, z] = reach.map(|reach| reach * signed(random));
            let direction = turn * Vector3::new(1.0, y, z).normalize();
            let point = self.measure(&eyes, &direction, LOOK_NOISE_M, random);
            points_m.extend(point.map(|p| headset_from_map * p));
        }
        Ok(SourceCloud {
            cloud: SemanticCloud::unlabelled(points_m),
            sensor_m: Some(headset_from_map * eyes),
        })
    }

    /// Point on the first surface along a ray, with an error along it.
    fn measure(
        &self,
        from: &Point3<f64>,
        direction: &Vector3<f64>,
        noise_m: f64,
        random: &mut Stream,
    ) -> Option<Point3<f64>> {
        let noise_m = noise_m * random.normal();
        Some(from + direction * (self.distance_m(from, direction)? + noise_m))
    }

    fn distance_m(&self, from: &Point3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        Some(self.scene.cast(from, direction, REACH_M)?.distance_m)
    }

    /// Place within the bounds of the mesh.
    fn place(&self, random: &mut Stream) -> [f64; 2] {
        let ([x0, y0, _], [x1, y1, _]) = (self.low_m, self.high_m);
        let ([x, y], [u, v]) = ([x0, y0], [(); 2].map(|()| random.uniform()));
        [x + u * (x1 - x0), y + v * (y1 - y0)]
    }

    /// Position at a height above free floor inside the room.
    fn stand(&self, height_m: f64, random: &mut Stream) -> Result<Point3<f64>, AnyError> {
        let mut tries = (0..TRIES).map(|_| self.place(random));
        let stand = tries.find_map(|[x, y]| {
            let stand = Point3::new(x, y, self.floor_m + height_m);
            self.is_free(&stand, height_m).then_some(stand)
        });
        stand.ok_or_else(|| format!("{} has no room to stand", self.name).into())
    }

    fn is_free(&self, stand: &Point3<f64>, height_m: f64) -> bool {
        let below_m = self.distance_m(stand, &-Vector3::z());
        let above_m = self.distance_m(stand, &Vector3::z());
        let side = |i: usize| {
            let (sin, cos) = (TAU * i as f64 / SIDES as f64).sin_cos();
            self.distance_m(stand, &Vector3::new(cos, sin, 0.0))
        };
        let sides: Vec<f64> = (0..SIDES).filter_map(side).collect();
        below_m.is_some_and(|below_m| (below_m - height_m).abs() < STEP_M)
            && above_m.is_some_and(|above_m| height_m + above_m > HEADROOM_M)
            && sides.len() >= CLOSED
            && sides.iter().all(|side_m| *side_m > CLEAR_M)
    }
}
