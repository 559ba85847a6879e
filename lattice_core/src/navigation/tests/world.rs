//! Worlds of planes whose truth is known everywhere.

use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::cloud::Cloud;
use crate::lattice::{Lattice, LatticeKind};
use crate::navigation::{Cell, Grid, Projector, ProjectorOptions};
use crate::voxels::VoxelList;

/// Points of a surface, per square metre.
const DENSITY: f64 = 2500.0;
/// Largest error of a point, metres.
const NOISE_M: f64 = 0.01;

/// Truth of a position for a robot.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Truth {
    Free,
    Obstacle,
    /// Neither is asked of the grid.
    Open,
}

/// Numbers from 0 to 1 of a seed (SplitMix64).
pub(super) struct Random(pub u64);

impl Random {
    pub(super) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Parallelograms: a corner and two edges.
#[derive(Default)]
pub(super) struct World {
    patches: Vec<[Vector3<f64>; 3]>,
}

pub(super) fn v(x: f64, y: f64, z: f64) -> Vector3<f64> {
    Vector3::new(x, y, z)
}

impl World {
    pub(super) fn patch(mut self, corner: [f64; 3], a: [f64; 3], b: [f64; 3]) -> World {
        self.patches.push([corner, a, b].map(Vector3::from));
        self
    }

    /// Level rectangle at a height.
    pub(super) fn floor(self, [x0, y0]: [f64; 2], [x1, y1]: [f64; 2], z: f64) -> World {
        self.patch([x0, y0, z], [x1 - x0, 0.0, 0.0], [0.0, y1 - y0, 0.0])
    }

    /// Vertical rectangle above a line.
    pub(super) fn wall(self, [x0, y0]: [f64; 2], [x1, y1]: [f64; 2], [z0, z1]: [f64; 2]) -> World {
        self.patch([x0, y0, z0], [x1 - x0, y1 - y0, 0.0], [0.0, 0.0, z1 - z0])
    }

    /// Sides, top and bottom of a box.
    pub(super) fn solid(self, low: [f64; 3], high: [f64; 3]) -> World {
        let [a, b, z] = [[low[0], low[1]], [high[0], high[1]], [low[2], high[2]]];
        let (c, d) = ([b[0], a[1]], [a[0], b[1]]);
        let sides = self.wall(a, c, z).wall(c, b, z).wall(b, d, z).wall(d, a, z);
        sides.floor(a, b, low[2]).floor(a, b, high[2])
    }

    fn points(&self, random: &mut Random, map_from_world: &Isometry3<f64>) -> Vec<Vector3<f64>> {
        let mut points = Vec::new();
        for [corner, a, b] in &self.patches {
            let count = (a.cross(b).norm() * DENSITY) as usize;
            for _ in 0..count {
                let p = corner + random.next() * a + random.next() * b;
                let noise = v(random.next(), random.next(), random.next()) * 2.0 - v(1.0, 1.0, 1.0);
                points.push(map_from_world * nalgebra::Point3::from(p + NOISE_M * noise));
            }
        }
        points.into_iter().map(|p| p.coords).collect()
    }
}

/// Map of a world that lies somehow on the grid.
pub(super) struct Mapped {
    pub(super) list: VoxelList,
    pub(super) map_from_world: Isometry3<f64>,
}

impl Mapped {
    pub(super) fn new(world: &World, kind: LatticeKind, side_m: f64, seed: u64) -> Mapped {
        let mut random = Random(seed);
        let yaw = std::f64::consts::TAU * random.next();
        let map_from_world = Isometry3::from_parts(
            Translation3::new(9.0 * random.next(), 9.0 * random.next(), random.next()),
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_axis_angle(
                &Vector3::z_axis(),
                yaw,
            )),
        );
        let lattice = Lattice::new(kind, side_m.powi(3)).unwrap();
        let mut list = VoxelList::new(lattice, Vector3::zeros(), 10_000_000).unwrap();
        let points_m = world.points(&mut random, &map_from_world);
        list.insert(&Cloud::from_points(0, Vector3::zeros(), &points_m));
        Mapped {
            list,
            map_from_world,
        }
    }

    pub(super) fn projector(&self, options: ProjectorOptions) -> Projector {
        let list = &self.list;
        let mut projector = Projector::new(list.lattice(), list.datum_m(), options).unwrap();
        for (key, voxel) in list.sorted() {
            projector.set(key, Some(voxel.mean_offset_m().into()));
        }
        projector
    }

    /// Grid for a robot at a position of the world.
    pub(super) fn grid(&self, options: ProjectorOptions, robot: [f64; 3]) -> Grid {
        let robot_m = self.map_from_world * nalgebra::Point3::from(robot);
        self.projector(options)
            .grid(Some(robot_m.coords), None)
            .unwrap()
    }

    /// Positions of the world of the free cells that are connected, also by corners, with one of them.
    pub(super) fn flood(
        &self,
        grid: &Grid,
        start: [f64; 2],
        within: impl Fn(f64, f64) -> bool,
    ) -> Vec<[f64; 2]> {
        let r = grid.resolution_m;
        let world_from_map = self.map_from_world.inverse();
        let start = self.map_from_world * nalgebra::Point3::new(start[0], start[1], 0.0);
        let start = [start.x, start.y].map(|value| (value / r).floor() as i32);
        let (mut seen, mut open) = (std::collections::BTreeSet::new(), vec![start]);
        let mut found = Vec::new();
        while let Some([x, y]) = open.pop() {
            let [map_x, map_y] = [x, y].map(|i| (f64::from(i) + 0.5) * r);
            let at = world_from_map * nalgebra::Point3::new(map_x, map_y, 0.0);
            if grid.at_m(map_x, map_y) == Cell::Free && within(at.x, at.y) && seen.insert([x, y]) {
                found.push([at.x, at.y]);
                open.extend((-1..=1).flat_map(|dx| (-1..=1).map(move |dy| [x + dx, y + dy])));
            }
        }
        found
    }

    /// Compares a grid with the truth at positions of the world.
    pub(super) fn score(&self, grid: &Grid, truth: impl Fn(f64, f64) -> Truth) -> Score {
        let world_from_map = self.map_from_world.inverse();
        let r = grid.resolution_m;
        let at = |x: f64, y: f64| {
            let p = world_from_map * nalgebra::Point3::new(x, y, 0.0);
            truth(p.x, p.y)
        };
        // Positions of a square about a place, its border included.
        let all = |x: f64, y: f64, half_m: f64, wanted: Truth| {
            let steps = (2.0 * half_m / (0.24 * r)).ceil() as i32;
            let place = |i: i32| half_m * (2.0 * f64::from(i) / f64::from(steps) - 1.0);
            (0..=steps).all(|i| (0..=steps).all(|j| at(x + place(i), y + place(j)) == wanted))
        };
        let mut score = Score::default();
        for (i, cell) in grid.cells.iter().enumerate() {
            let [x, y] = [i % grid.width, i / grid.width];
            let [x, y] = [(grid.corner[0], x), (grid.corner[1], y)]
                .map(|(corner, k)| (f64::from(corner) + k as f64 + 0.5) * r);
            if all(x, y, MARGIN_CELLS * r, Truth::Free) {
                score.drivable += 1;
                score.found += usize::from(*cell == Cell::Free);
            }
            let steps = [-0.49, -0.24, 0.0, 0.24, 0.49].map(|step| step * r);
            let is_blocked = steps
                .iter()
                .any(|dx| steps.iter().any(|dy| at(x + dx, y + dy) == Truth::Obstacle));
            if is_blocked {
                score.obstacles += 1;
                score.called_free += usize::from(*cell == Cell::Free);
                if *cell == Cell::Free {
                    let p = world_from_map * nalgebra::Point3::new(x, y, 0.0);
                    println!("called free: {:.3} {:.3}", p.x, p.y);
                }
            }
        }
        score
    }
}

/// Cells from the centre of a cell within which all is drivable before it is asked to be free.
const MARGIN_CELLS: f64 = 2.5;

/// Cells of a grid against the truth.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Score {
    pub(super) drivable: usize,
    pub(super) found: usize,
    pub(super) obstacles: usize,
    pub(super) called_free: usize,
}

impl std::ops::AddAssign for Score {
    fn add_assign(&mut self, other: Score) {
        self.drivable += other.drivable;
        self.found += other.found;
        self.obstacles += other.obstacles;
        self.called_free += other.called_free;
    }
}

impl Score {
    /// 98 % of the drivable cells are found, and 0.1 % of the obstacles at most are called free.
    pub(super) fn check(&self, name: &str) {
        let found = self.found as f64 / self.drivable.max(1) as f64;
        let wrong = self.called_free as f64 / self.obstacles.max(1) as f64;
        println!(
            "{name}: drivable {} found {found:.4}, obstacles {} called free {wrong:.4}",
            self.drivable, self.obstacles
        );
        assert!(
            self.drivable == 0 || found >= 0.98,
            "{name}: found {found}: {self:?}"
        );
        assert!(
            wrong <= 0.001,
            "{name}: obstacles called free {wrong}: {self:?}"
        );
    }
}
