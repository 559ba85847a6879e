//! Scores of source points by their position in the map.

use nalgebra::{Point3, Vector3};

use super::grid::Grid;

/// Score of a point in an occupied cell with the same surface orientation.
pub(super) const FULL: u8 = 100;

/// Scores by channel: horizontal surfaces and ranges of azimuth of vertical ones, or classes of source points.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub grid: Grid,
    /// Scores of all cells for each channel.
    pub channels: Vec<Vec<u8>>,
}

/// Ranges of azimuth (modulo half a turn) of vertical surfaces.
const AZIMUTHS: usize = 8;

/// Orientation of the surface at a point.
#[derive(Clone, Copy, Debug)]
pub(super) enum Facing {
    Level,
    /// Azimuth of the normal, radians.
    Upright(f64),
}

impl Facing {
    pub fn of(normal: &Vector3<f64>) -> Facing {
        match normal.z.abs() > std::f64::consts::FRAC_1_SQRT_2 {
            true => Facing::Level,
            false => Facing::Upright(normal.y.atan2(normal.x)),
        }
    }

    /// Channel of the surface rotated by `yaw_rad`.
    pub fn channel(self, yaw_rad: f64) -> usize {
        match self {
            Facing::Level => 0,
            Facing::Upright(azimuth) => {
                let turn = (azimuth + yaw_rad).rem_euclid(std::f64::consts::PI);
                1 + (turn / std::f64::consts::PI * AZIMUTHS as f64) as usize % AZIMUTHS
            }
        }
    }
}

impl Field {
    /// Scores by orientation: the full score for equal orientation, a fraction for others, half in adjacent cells.
    pub fn of_surfaces(grid: Grid, points_m: &[Point3<f64>], normals: &[Vector3<f64>]) -> Field {
        let facing: Vec<usize> = (normals.iter())
            .map(|normal| Facing::of(normal).channel(0.0))
            .collect();
        let score = |own: usize, channel: usize| -> u8 {
            let apart = own.abs_diff(channel);
            match apart.min(AZIMUTHS.abs_diff(apart)) {
                _ if (own == 0) != (channel == 0) => FULL / 5,
                0 => FULL,
                1 => FULL / 10 * 7,
                2 => FULL / 5 * 2,
                _ => FULL / 5,
            }
        };
        Field::build(grid, points_m, 1 + AZIMUTHS, |i, channel| {
            facing.get(i).map_or(FULL, |own| score(*own, channel))
        })
    }

    /// Scores of `channels` channels: `score(i, channel)` in the cell of map point `i`, half of it in the six
    /// adjacent cells.
    pub fn build(
        grid: Grid,
        points_m: &[Point3<f64>],
        channels: usize,
        score: impl Fn(usize, usize) -> u8 + Sync,
    ) -> Field {
        use rayon::prelude::*;
        let cells: Vec<[i64; 3]> = points_m.iter().map(|p| grid.cell_of(&p.coords)).collect();
        let channels = (0..channels)
            .into_par_iter()
            .map(|channel| {
                let mut own = vec![0_u8; grid.len()];
                for (i, cell) in cells.iter().enumerate() {
                    if let Some(slot) = grid.index(*cell).and_then(|at| own.get_mut(at)) {
                        *slot = (*slot).max(score(i, channel));
                    }
                }
                spread(&grid, &own)
            })
            .collect();
        Field { grid, channels }
    }

    /// Score of a channel at a position; 0 outside the grid.
    #[inline]
    pub fn at(&self, channel: usize, place_m: &Vector3<f64>) -> u32 {
        let index = self.grid.index(self.grid.cell_of(place_m));
        let score = index.and_then(|at| self.channels.get(channel)?.get(at));
        u32::from(score.copied().unwrap_or(0))
    }
}

/// Raises each cell to half of the largest score of its six neighbours.
fn spread(grid: &Grid, own: &[u8]) -> Vec<u8> {
    let mut out = own.to_vec();
    let [nx, ny, _] = grid.dims;
    for step in [1, nx, nx * ny] {
        // Rows end in empty margins, so an overrun into the next row adds zero.
        for (i, &score) in own.iter().enumerate() {
            if score == 0 {
                continue;
            }
            for at in [i.wrapping_sub(step), i + step] {
                if let Some(slot) = out.get_mut(at) {
                    *slot = (*slot).max(score / 2);
                }
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_scores_points_on_walls_that_run_its_way() {
        let points: Vec<_> = (0..20)
            .map(|i| Point3::new(0.0, f64::from(i) * 0.2, 1.0))
            .collect();
        let normals = vec![Vector3::x(); 20];
        let grid = Grid::around(&points, 0.2, 1).unwrap();
        let field = Field::of_surfaces(grid, &points, &normals);
        let at = |facing: Facing, yaw, place| field.at(facing.channel(yaw), &place);
        let on = Vector3::new(0.0, 1.0, 1.0);
        let along = Facing::of(&-Vector3::x());
        assert_eq!(at(along, 0.01, on), u32::from(FULL));
        assert!(at(Facing::of(&Vector3::y()), 0.0, on) < 50);
        assert_eq!(
            at(Facing::of(&Vector3::y()), std::f64::consts::FRAC_PI_2, on),
            100
        );
        assert!(at(Facing::Level, 0.0, on) < 50);
        assert_eq!(at(along, 0.01, on + Vector3::new(0.2, 0.0, 0.0)), 50);
        assert_eq!(at(along, 0.01, on + Vector3::new(0.4, 0.0, 0.0)), 0);
    }
}
