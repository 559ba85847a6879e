//! Where something is, for lines of sight.

use nalgebra::Point3;

use super::grid::Grid;

/// Occupied cells of a map.
#[derive(Clone, Debug)]
pub struct OccupiedGrid {
    grid: Grid,
    cells: Vec<bool>,
}

impl OccupiedGrid {
    /// Of points in cells of `cell_m`, or larger ones if the map is vast. None without points.
    pub fn new(points_m: &[Point3<f64>], cell_m: f64) -> Option<OccupiedGrid> {
        let grid = Grid::around(points_m, cell_m, 0)?;
        let mut cells = vec![false; grid.len()];
        for point in points_m {
            let at = grid.index(grid.cell_of(&point.coords));
            if let Some(cell) = at.and_then(|at| cells.get_mut(at)) {
                *cell = true;
            }
        }
        Some(OccupiedGrid { grid, cells })
    }

    /// Side of a cell, metres.
    pub fn cell_m(&self) -> f64 {
        self.grid.cell_m
    }

    /// Whether the cell of a place is occupied.
    pub fn contains(&self, place_m: &Point3<f64>) -> bool {
        let at = self.grid.index(self.grid.cell_of(&place_m.coords));
        at.and_then(|at| self.cells.get(at))
            .copied()
            .unwrap_or(false)
    }
}
