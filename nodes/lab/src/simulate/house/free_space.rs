//! Free floor of a house, to stand on.

use crate::AnyError;
use crate::mesh::{LabelledMesh, MeshScene};
use nalgebra::{Point3, Vector3};

/// Side of a cell of the floor plan, metres.
const CELL_M: f64 = 0.125;
/// Error of a house without a place to stand.
pub(super) const NO_FREE_SPACE: &str = "there is no free floor within walls; the mesh must have a floor, walls and room to stand between them";
/// Heights above the floor between which things are in the way, metres.
const BODY_M: [f64; 2] = [0.12, 2.0];
/// A body keeps away from things by this, metres.
const RADIUS_M: f64 = 0.3;
/// Smaller places are no rooms, m^2.
const ROOM_M2: f64 = 1.5;
/// Directions in which walls are looked for, and how many must have one.
const SIDES: usize = 12;
const WALLED: usize = 10;

/// Middles of the cells of the floor where a body fits.
#[derive(Clone, Debug)]
pub(super) struct FreeSpace {
    /// x and y, house frame, metres.
    pub(super) cells_m: Vec<[f64; 2]>,
    /// Height of the floor, metres.
    pub(super) floor_m: f64,
}

struct Plan {
    low_m: [f64; 2],
    columns: usize,
    rows: usize,
}

impl Plan {
    fn cell(&self, x: f64, y: f64) -> Option<usize> {
        let column = ((x - self.low_m[0]) / CELL_M) as usize;
        let row = ((y - self.low_m[1]) / CELL_M) as usize;
        (column < self.columns && row < self.rows).then_some(row * self.columns + column)
    }

    fn middle_m(&self, cell: usize) -> [f64; 2] {
        let (row, column) = (cell / self.columns, cell % self.columns);
        [
            self.low_m[0] + (column as f64 + 0.5) * CELL_M,
            self.low_m[1] + (row as f64 + 0.5) * CELL_M,
        ]
    }

    /// Cells at a distance of up to `reach` cells along each axis.
    fn around(&self, cell: usize, reach: usize) -> impl Iterator<Item = usize> + use<> {
        let (row, column) = (cell / self.columns, cell % self.columns);
        let columns = self.columns;
        let rows = row.saturating_sub(reach)..(row + reach + 1).min(self.rows);
        let across = column.saturating_sub(reach)..(column + reach + 1).min(columns);
        rows.flat_map(move |r| across.clone().map(move |c| r * columns + c))
    }
}

impl FreeSpace {
    pub(super) fn new(mesh: &LabelledMesh, scene: &MeshScene) -> Result<FreeSpace, AnyError> {
        let mut low_m = [f64::INFINITY; 3];
        let mut high_m = [f64::NEG_INFINITY; 3];
        for point in mesh.corners_m().flatten() {
            for axis in 0..3 {
                low_m[axis] = low_m[axis].min(point[axis].into());
                high_m[axis] = high_m[axis].max(point[axis].into());
            }
        }
        if mesh.is_empty() {
            return Err(NO_FREE_SPACE.into());
        }
        let cells = |axis: usize| ((high_m[axis] - low_m[axis]) / CELL_M) as usize + 1;
        let plan = Plan {
            low_m: [low_m[0], low_m[1]],
            columns: cells(0),
            rows: cells(1),
        };
        let floor_m = low_m[2];
        let taken = taken(mesh, &plan, floor_m);
        let reach = (RADIUS_M / CELL_M) as usize;
        let fits = |cell: usize| {
            let [x, y] = plan.middle_m(cell);
            let near = |other: &usize| {
                let [ox, oy] = plan.middle_m(*other);
                (x - ox).hypot(y - oy) <= RADIUS_M && taken.get(*other) == Some(&true)
            };
            !plan.around(cell, reach).any(|other| near(&other)) && indoors(scene, [x, y], floor_m)
        };
        let mut free: Vec<bool> = (0..plan.columns * plan.rows).map(fits).collect();
        keep_rooms(&mut free, &plan);
        let cells = free.iter().enumerate().filter(|(_, free)| **free);
        let cells_m: Vec<_> = cells.map(|(cell, _)| plan.middle_m(cell)).collect();
        match cells_m.is_empty() {
            true => Err(NO_FREE_SPACE.into()),
            false => Ok(FreeSpace { cells_m, floor_m }),
        }
    }

    /// A point above a cell, house frame, metres.
    pub(super) fn above_m(&self, [x, y]: [f64; 2], height_m: f64) -> Point3<f64> {
        Point3::new(x, y, self.floor_m + height_m)
    }

    /// Cells in random order that keep as far from each other as that many can, in the order of a
    /// walk from one to the next nearest.
    pub(super) fn spread_m(&self, count: usize, mut uniform: impl FnMut() -> f64) -> Vec<[f64; 2]> {
        let mut order = self.cells_m.clone();
        for i in (1..order.len()).rev() {
            order.swap(i, (uniform() * (i + 1) as f64) as usize);
        }
        let mut chosen: Vec<[f64; 2]> = Vec::new();
        let mut apart_m = 4.0;
        while chosen.len() < count && apart_m > CELL_M / 2.0 {
            for cell in &order {
                let far = |other: &[f64; 2]| distance_m(*cell, *other) >= apart_m;
                if chosen.len() < count && chosen.iter().all(far) {
                    chosen.push(*cell);
                }
            }
            apart_m *= 0.9;
        }
        let mut walk: Vec<[f64; 2]> = Vec::with_capacity(chosen.len());
        let mut here = chosen.first().copied().unwrap_or_default();
        while !chosen.is_empty() {
            let to = |cell: &[f64; 2]| distance_m(here, *cell);
            let nearest =
                (0..chosen.len()).min_by(|&a, &b| to(&chosen[a]).total_cmp(&to(&chosen[b])));
            here = chosen.swap_remove(nearest.unwrap_or_default());
            walk.push(here);
        }
        walk
    }
}

fn distance_m(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Cells with something between the heights of a body.
fn taken(mesh: &LabelledMesh, plan: &Plan, floor_m: f64) -> Vec<bool> {
    let mut taken = vec![false; plan.columns * plan.rows];
    let [low_m, high_m] = BODY_M.map(|height_m| floor_m + height_m);
    for corners in mesh.corners_m() {
        let [a, b, c] = corners.map(|p| Vector3::from(p.map(f64::from)));
        let heights = [a.z, b.z, c.z];
        if heights.iter().all(|z| *z < low_m) || heights.iter().all(|z| *z > high_m) {
            continue;
        }
        let longest_m = (b - a).norm().max((c - a).norm()).max((c - b).norm());
        let steps = (longest_m / (CELL_M / 2.0)).ceil().max(1.0) as usize;
        for i in 0..=steps {
            for j in 0..=steps - i {
                let (u, v) = (i as f64 / steps as f64, j as f64 / steps as f64);
                let p = a + (b - a) * u + (c - a) * v;
                let cell = plan
                    .cell(p.x, p.y)
                    .filter(|_| (low_m..=high_m).contains(&p.z));
                if let Some(taken) = cell.and_then(|cell| taken.get_mut(cell)) {
                    *taken = true;
                }
            }
        }
    }
    taken
}

/// True with floor below and walls on nearly all sides.
fn indoors(scene: &MeshScene, [x, y]: [f64; 2], floor_m: f64) -> bool {
    let knee = Point3::new(x, y, floor_m + 0.5);
    if scene.cast(&knee, &-Vector3::z(), 0.6).is_none() {
        return false;
    }
    let chest = Point3::new(x, y, floor_m + 1.2);
    let walled = (0..SIDES).filter(|side| {
        let angle = (*side as f64 + 0.3) * std::f64::consts::TAU / SIDES as f64;
        let direction = Vector3::new(angle.cos(), angle.sin(), 0.0);
        scene.cast(&chest, &direction, 30.0).is_some()
    });
    walled.count() >= WALLED
}

/// Drops places that are too small.
fn keep_rooms(free: &mut [bool], plan: &Plan) {
    let mut seen = vec![false; free.len()];
    for start in 0..free.len() {
        if !free[start] || seen[start] {
            continue;
        }
        let mut room = vec![start];
        seen[start] = true;
        let mut next = 0;
        while let Some(&cell) = room.get(next) {
            next += 1;
            for other in plan.around(cell, 1) {
                if free[other] && !seen[other] {
                    seen[other] = true;
                    room.push(other);
                }
            }
        }
        if (room.len() as f64) * CELL_M * CELL_M < ROOM_M2 {
            room.iter().for_each(|&cell| free[cell] = false);
        }
    }
}
