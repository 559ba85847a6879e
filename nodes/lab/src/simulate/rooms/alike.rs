//! Rooms that look alike from several places: adversarial scenes of a registration without an initial guess.

use lattice_core::registration::{LabelDistribution, SemanticCloud, SourceCloud};
use nalgebra::{Isometry3, Point3, Vector3};

use super::flat::{FLOOR, Flat, WALL};

const HEIGHT_M: f64 = 2.7;
const EYE_M: f64 = 1.6;

impl Flat {
    /// Creates an empty room of `x_m` by `y_m` about the origin, with floor and ceiling.
    pub fn room(x_m: f64, y_m: f64) -> Flat {
        let mut room = Flat::empty();
        room.add_room([0.0, 0.0], x_m, y_m);
        room
    }

    /// Creates `n` equal square rooms in a row along x, without doors.
    pub fn row_of_rooms(n: usize, side_m: f64) -> Flat {
        let mut row = Flat::empty();
        for i in 0..n {
            row.add_room([i as f64 * (side_m + 0.3), 0.0], side_m, side_m);
        }
        row
    }

    /// Creates a round room of flat panels.
    pub fn silo(radius_m: f64, panels: usize) -> Flat {
        let mut silo = Flat::empty();
        let corner = |i: usize| {
            let at = i as f64 * std::f64::consts::TAU / panels as f64;
            [radius_m * at.cos(), radius_m * at.sin()]
        };
        for i in 0..panels {
            let ([ax, ay], [bx, by]) = (corner(i), corner(i + 1));
            silo.add(
                [ax, ay, 0.0],
                [bx - ax, by - ay, 0.0],
                [0.0, 0.0, HEIGHT_M],
                WALL,
            );
        }
        silo
    }

    /// Creates stairs of `n` steps about the origin that rise along x between two walls.
    pub fn stairs(n: usize) -> Flat {
        const RUN: f64 = 0.3;
        const RISE: f64 = 0.17;
        const WIDTH: f64 = 1.6;
        let mut stairs = Flat::empty();
        let first = -(n as f64) / 2.0;
        for i in 0..n {
            let step = first + i as f64;
            let ([x, z], y) = ([step * RUN, step * RISE], -WIDTH / 2.0);
            stairs.add([x, y, z], [RUN, 0.0, 0.0], [0.0, WIDTH, 0.0], FLOOR);
            stairs.add([x, y, z - RISE], [0.0, WIDTH, 0.0], [0.0, 0.0, RISE], WALL);
            for side in [y, -y] {
                stairs.add([x, side, z], [RUN, 0.0, 0.0], [0.0, 0.0, HEIGHT_M], WALL);
            }
        }
        stairs
    }

    /// Adds a box of the given size to the floor, with a corner at the given x and y, metres.
    #[must_use]
    pub fn with_box(mut self, [x, y]: [f64; 2], [a, b, c]: [f64; 3]) -> Flat {
        self.add_box([x, y, 0.0], [a, b, c], 5);
        self
    }

    fn add_room(&mut self, [cx, cy]: [f64; 2], x_m: f64, y_m: f64) {
        let (x, y) = (cx - x_m / 2.0, cy - y_m / 2.0);
        for z in [0.0, HEIGHT_M] {
            self.add([x, y, z], [x_m, 0.0, 0.0], [0.0, y_m, 0.0], FLOOR);
        }
        for ([x, y], [u, v]) in [
            ([x, y], [x_m, 0.0]),
            ([x, y + y_m], [x_m, 0.0]),
            ([x, y], [0.0, y_m]),
            ([x + x_m, y], [0.0, y_m]),
        ] {
            self.add([x, y, 0.0], [u, v, 0.0], [0.0, 0.0, HEIGHT_M], WALL);
        }
    }

    /// Map of the room in cells of 5 cm, with errors of a few millimetres of the centroids; `uniform` returns numbers
    /// in [0, 1).
    pub fn noisy_map(&self, uniform: &mut impl FnMut() -> f64) -> SemanticCloud {
        let mut map = self.map();
        let points = map.points_m.iter_mut();
        points.for_each(|p| *p += off(0.008, uniform));
        map
    }

    /// Labelled scan of all directions from `x_m`, `y_m`, 1.6 m above the floor.
    pub fn all_around(
        &self,
        [x_m, y_m]: [f64; 2],
        map_from_headset: &Isometry3<f64>,
        uniform: &mut impl FnMut() -> f64,
    ) -> SourceCloud {
        let eye = Point3::new(x_m, y_m, EYE_M);
        let headset_from_map = map_from_headset.inverse();
        let mut cloud = SemanticCloud::default();
        for i in 0..180 {
            for j in -30..30 {
                let (az, el) = (f64::from(i) * 0.035, f64::from(j) * 0.035);
                let way = Vector3::new(az.cos() * el.cos(), az.sin() * el.cos(), el.sin());
                if let Some((distance, label)) = self.hit(&eye, &way, 15.0) {
                    let place = eye + way * distance + off(0.012, uniform);
                    cloud.points_m.push(headset_from_map * place);
                    cloud.labels.push(LabelDistribution::hard(label));
                }
            }
        }
        SourceCloud {
            cloud,
            sensor_m: Some(headset_from_map * eye),
        }
    }
}

/// Random point of a cube about 0.
fn off(half_side_m: f64, uniform: &mut impl FnMut() -> f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| (2.0 * uniform() - 1.0) * half_side_m)
}
