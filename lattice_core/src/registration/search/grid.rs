//! Dense grid of cubic cells around a map.

use nalgebra::{Point3, Vector3};

/// Maximum number of cells, which bounds memory and time for any map.
const MAX_CELLS: usize = 4_000_000;

/// Grid of cubic cells; cell `[x, y, z]` has index `(z * ny + y) * nx + x`.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    /// Centre of the first cell, metres.
    pub origin_m: Vector3<f64>,
    /// Side of a cell, metres.
    pub cell_m: f64,
    /// Cells along x, y and z.
    pub dims: [usize; 3],
}

impl Grid {
    /// Smallest grid around points with at least `margin` cells on all sides; `None` without points.
    ///
    /// Cells are `cell_m` or larger, to limit their number.
    pub fn around(points_m: &[Point3<f64>], cell_m: f64, margin: usize) -> Option<Grid> {
        let first = points_m.first()?.coords;
        let (low, high) = points_m.iter().fold((first, first), |(low, high), p| {
            (low.inf(&p.coords), high.sup(&p.coords))
        });
        let mut cell_m = cell_m;
        loop {
            let dims = ((high - low) / cell_m).map(|d| d.round() + 1.0 + 2.0 * margin as f64);
            if dims.product() <= MAX_CELLS as f64 {
                let margin_m = Vector3::repeat(margin as f64 * cell_m);
                return Some(Grid {
                    origin_m: low - margin_m,
                    cell_m,
                    dims: dims.map(|d| d as usize).into(),
                });
            }
            cell_m *= 1.25;
        }
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.dims.iter().product()
    }

    /// Cell coordinates of a position, rounded; may lie outside the grid.
    pub fn cell_of(&self, place_m: &Vector3<f64>) -> [i64; 3] {
        let cell = (place_m - self.origin_m) / self.cell_m;
        [cell.x, cell.y, cell.z].map(rounded)
    }

    /// Index of a cell, if it is in the grid.
    pub fn index(&self, cell: [i64; 3]) -> Option<usize> {
        let [nx, ny, nz] = self.dims;
        let [x, y, z] = cell.map(|c| usize::try_from(c).unwrap_or(usize::MAX));
        (x < nx && y < ny && z < nz).then(|| (z * ny + y) * nx + x)
    }

    /// Centre of a cell, metres.
    pub fn center_m(&self, cell: [usize; 3]) -> Vector3<f64> {
        self.origin_m + Vector3::from(cell.map(|c| c as f64)) * self.cell_m
    }
}

/// Rounds to the nearest integer, half away from zero, as `round` does.
///
/// Faster where the processor has no instruction for it.
#[inline(always)]
pub(super) fn rounded(value: f64) -> i64 {
    const HALF: f64 = 0.5 - f64::EPSILON / 4.0;
    (value + HALF.copysign(value)) as i64
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rounded_is_round(value in prop_oneof![-1e17..1e17_f64, -9.0..9.0, (-9i32..9).prop_map(|i| f64::from(i) / 2.0)]) {
            for value in [value, f64::next_up(value), f64::next_down(value)] {
                prop_assert_eq!(rounded(value), value.round() as i64);
            }
        }
    }

    #[test]
    fn the_box_holds_its_points_and_a_margin() {
        let points = [Point3::new(-1.0, 2.0, 0.5), Point3::new(3.0, 2.5, 0.5)];
        let grid = Grid::around(&points, 0.25, 2).unwrap();
        assert_eq!(grid.dims, [21, 7, 5]);
        assert_eq!(grid.cell_of(&points[0].coords), [2, 2, 2]);
        assert_eq!(grid.cell_of(&points[1].coords), [18, 4, 2]);
        assert!((grid.center_m([2, 2, 2]) - points[0].coords).norm() < 1e-12);
        assert_eq!(grid.index([21, 0, 0]), None);
        assert_eq!(grid.index([-1, 0, 0]), None);
        assert_eq!(grid.index([20, 6, 4]), Some(grid.len() - 1));
    }

    #[test]
    fn a_vast_map_gets_larger_cells() {
        let points = [Point3::origin(), Point3::new(5e4, 5e4, 100.0)];
        let grid = Grid::around(&points, 0.2, 1).unwrap();
        assert!(grid.len() <= MAX_CELLS && grid.cell_m > 0.2);
        assert!(Grid::around(&[], 0.2, 1).is_none());
    }
}
