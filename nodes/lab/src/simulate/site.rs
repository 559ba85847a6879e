//! The earth-moving site: ground, obstacles and an index over both.

use super::ground::ground_height_m;
use super::height_field::{HeightField, leave};
use super::layout::earth_moving_obstacles;
use super::obstacles::Obstacle;
use nalgebra::{Vector2, Vector3};

/// Extent of the site along east and north, m; the map's origin is its middle.
const EXTENT_M: [f64; 2] = [140.0, 170.0];
/// Side of the triangulated ground's squares, m.
const SPACING_M: f64 = 0.25;
/// Squares of ground along the side of one cell of the index.
const SQUARES_PER_CELL: usize = 16;
/// Greatest deviation of the rough ground from the smooth one, m.
const ROUGHNESS_M: f64 = 0.025;
const SOIL_REFLECTIVITY: f64 = 0.3;

/// Point at which a ray meets the site.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    pub range_m: f64,
    /// Cosine of the angle between ray and surface normal, 0..1.
    pub cos_incidence: f64,
    /// Diffuse reflectivity of the surface, 0..1.
    pub reflectivity: f64,
}

/// Ground and obstacles of one place, always the same.
#[derive(Clone, Debug)]
pub struct Site {
    ground: HeightField,
    obstacles: Vec<Obstacle>,
    cells: Vec<Cell>,
    cell_columns: usize,
    cell_rows: usize,
}

/// One column of the index.
#[derive(Clone, Debug, Default)]
struct Cell {
    highest_ground_m: f64,
    highest_m: f64,
    obstacles: Vec<u32>,
}

impl Site {
    /// About 140 m x 170 m: undulating ground, spoil piles, a pit with a ramp, berms, a building, fences,
    /// containers, barriers and posts. It does not depend on a seed, so that logs of it can be compared.
    pub fn earth_moving() -> Self {
        let origin = Vector2::new(-0.5 * EXTENT_M[0], -0.5 * EXTENT_M[1]);
        let squares = EXTENT_M.map(|extent| (extent / SPACING_M) as usize);
        let ground = HeightField::from_fn(origin, SPACING_M, squares, |column, row, p| {
            ground_height_m(p.x, p.y) + ROUGHNESS_M * roughness(column, row)
        });
        Self::new(ground, earth_moving_obstacles())
    }

    fn new(ground: HeightField, obstacles: Vec<Obstacle>) -> Self {
        let [cell_columns, cell_rows] = ground.squares().map(|n| n.div_ceil(SQUARES_PER_CELL));
        let mut cells = vec![Cell::default(); cell_columns * cell_rows];
        for (i, cell) in cells.iter_mut().enumerate() {
            let from = [
                i % cell_columns * SQUARES_PER_CELL,
                i / cell_columns * SQUARES_PER_CELL,
            ];
            cell.highest_ground_m = ground.max_height_m(from, from.map(|n| n + SQUARES_PER_CELL));
            cell.highest_m = cell.highest_ground_m;
        }
        let mut site = Self {
            ground,
            obstacles,
            cells,
            cell_columns,
            cell_rows,
        };
        site.index_obstacles();
        site
    }

    fn index_obstacles(&mut self) {
        let size_m = self.cell_size_m();
        for (id, obstacle) in (0u32..).zip(&self.obstacles) {
            let [low, high] = obstacle.bounds_m();
            let cell_of = |v: f64, origin: f64, n: usize| {
                (((v - origin) / size_m).max(0.0) as usize).min(n - 1)
            };
            let columns = [low.x - 1e-6, high.x + 1e-6]
                .map(|x| cell_of(x, self.ground.origin_m().x, self.cell_columns));
            let rows = [low.y - 1e-6, high.y + 1e-6]
                .map(|y| cell_of(y, self.ground.origin_m().y, self.cell_rows));
            for row in rows[0]..=rows[1] {
                for column in columns[0]..=columns[1] {
                    if let Some(cell) = self.cells.get_mut(row * self.cell_columns + column) {
                        cell.obstacles.push(id);
                        cell.highest_m = cell.highest_m.max(high.z);
                    }
                }
            }
        }
    }

    #[cfg(test)]
    pub fn ground(&self) -> &HeightField {
        &self.ground
    }

    #[cfg(test)]
    pub fn obstacles(&self) -> &[Obstacle] {
        &self.obstacles
    }

    /// First surface along a ray from `origin` (metres, map frame) in the unit vector `direction` within
    /// `max_range_m`; `None` outside the site.
    pub fn cast(
        &self,
        origin: &Vector3<f64>,
        direction: &Vector3<f64>,
        max_range_m: f64,
    ) -> Option<Hit> {
        let size_m = self.cell_size_m();
        let start = (origin.xy() - self.ground.origin_m()) / size_m;
        let step = direction.xy() / size_m;
        let (mut column, mut row) = (start.x.floor(), start.y.floor());
        let mut at_m = 0.0;
        while column >= 0.0
            && row >= 0.0
            && column < self.cell_columns as f64
            && row < self.cell_rows as f64
        {
            let leave = [leave(start.x, step.x, column), leave(start.y, step.y, row)];
            let leave_m = leave[0].min(leave[1]).min(max_range_m).max(at_m);
            let cell = self
                .cells
                .get(row as usize * self.cell_columns + column as usize)?;
            if let Some(hit) = self.cast_in_cell(cell, origin, direction, [at_m, leave_m]) {
                return Some(hit);
            }
            if leave_m >= max_range_m {
                return None;
            }
            if leave[0] <= leave[1] {
                column += step.x.signum();
            } else {
                row += step.y.signum();
            }
            at_m = leave_m;
        }
        None
    }

    fn cast_in_cell(
        &self,
        cell: &Cell,
        origin: &Vector3<f64>,
        direction: &Vector3<f64>,
        [from_m, to_m]: [f64; 2],
    ) -> Option<Hit> {
        let lowest_m = origin.z + (direction.z * from_m).min(direction.z * to_m);
        if lowest_m > cell.highest_m {
            return None;
        }
        let mut nearest: Option<Hit> = None;
        // A face on the border belongs to both cells: a hit a hair beyond this one is as good here.
        let mut limit_m = to_m + 1e-9;
        for &id in &cell.obstacles {
            let obstacle = self.obstacles.get(id as usize);
            if let Some((range_m, normal, reflectivity)) =
                obstacle.and_then(|o| o.cast(origin, direction))
                && range_m <= limit_m
            {
                limit_m = range_m;
                nearest = Some(Hit {
                    range_m,
                    cos_incidence: -normal.dot(direction),
                    reflectivity,
                });
            }
        }
        if lowest_m <= cell.highest_ground_m
            && let Some(range_m) = self
                .ground
                .cast(origin, direction, from_m, limit_m.min(to_m))
        {
            let point = origin + direction * range_m;
            let normal = self.ground.normal(point.x, point.y);
            let normal = normal.unwrap_or_else(Vector3::z);
            nearest = Some(Hit {
                range_m,
                cos_incidence: (-normal.dot(direction)).max(0.0),
                reflectivity: SOIL_REFLECTIVITY,
            });
        }
        nearest
    }

    /// Distance from a point to the nearest surface (ground: vertically), m.
    #[cfg(test)]
    pub fn surface_distance_m(&self, point: &Vector3<f64>) -> f64 {
        let ground = self
            .ground
            .height_m(point.x, point.y)
            .map_or(f64::INFINITY, |h| (point.z - h).abs());
        self.obstacles
            .iter()
            .map(|o| o.surface_distance_m(point))
            .fold(ground, f64::min)
    }

    fn cell_size_m(&self) -> f64 {
        self.ground.spacing_m() * SQUARES_PER_CELL as f64
    }
}

/// A fixed value in -1..1 for a node of the ground's grid (a mix of its indices).
fn roughness(column: usize, row: usize) -> f64 {
    let mut bits = (column as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        ^ (row as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
    bits ^= bits >> 29;
    bits = bits.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits ^= bits >> 32;
    (bits & 0xffff) as f64 / 32_767.5 - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::sync::LazyLock;

    static SITE: LazyLock<Site> = LazyLock::new(Site::earth_moving);

    /// The nearest of all surfaces, without the index.
    fn cast_all(
        site: &Site,
        origin: &Vector3<f64>,
        direction: &Vector3<f64>,
        max_range_m: f64,
    ) -> Option<f64> {
        let ground = site.ground.cast(origin, direction, 0.0, max_range_m);
        let others = site.obstacles.iter();
        let others = others.filter_map(|o| Some(o.cast(origin, direction)?.0));
        let all = others.chain(ground).filter(|&m| m <= max_range_m);
        all.min_by(f64::total_cmp)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn the_index_changes_no_hit(
            x in -64.0f64..64.0, y in -78.0f64..78.0, up in 0.3f64..4.0, azimuth in 0.0f64..6.3, elevation in -1.5f64..0.7
        ) {
            let origin = Vector3::new(x, y, SITE.ground.height_m(x, y).unwrap() + up);
            let direction = Vector3::new(
                elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin());
            let hit = SITE.cast(&origin, &direction, 80.0);
            match (hit, cast_all(&SITE, &origin, &direction, 80.0)) {
                (Some(hit), Some(expected)) => {
                    prop_assert!((hit.range_m - expected).abs() < 1e-6, "{} against {expected}", hit.range_m);
                    prop_assert!(SITE.surface_distance_m(&(origin + direction * hit.range_m)) < 1e-6);
                    prop_assert!((0.0..=1.0 + 1e-9).contains(&hit.cos_incidence));
                }
                (None, None) => {}
                (hit, expected) => prop_assert!(false, "{hit:?} against {expected:?}"),
            }
        }
    }

    #[test]
    fn rays_see_ground_below_and_nothing_in_the_sky() {
        let origin = Vector3::new(0.0, 0.0, 10.0);
        assert!(SITE.cast(&origin, &-Vector3::z(), 80.0).is_some());
        assert_eq!(SITE.cast(&origin, &Vector3::z(), 80.0), None);
        let outside = Vector3::new(500.0, 0.0, 1.0);
        assert_eq!(SITE.cast(&outside, &-Vector3::x(), 80.0), None);
    }

    #[test]
    fn the_fence_stops_a_level_ray() {
        let y = 75.0;
        let z = SITE.ground.height_m(65.0, y).unwrap() + 1.0;
        let hit = SITE.cast(&Vector3::new(60.0, y, z), &Vector3::x(), 80.0);
        let hit = hit.unwrap();
        assert!((hit.range_m - 5.98).abs() < 0.05, "{}", hit.range_m);
    }
}
