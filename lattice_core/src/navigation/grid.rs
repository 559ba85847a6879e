//! Occupancy grid.

use super::ProjectionError;
pub use super::grid_limit::MAX_GRID_CELLS;
use super::tiles::Column;

/// State of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Cell {
    /// Never seen, or not reached.
    #[default]
    Unknown,
    /// The robot can drive here.
    Free,
    /// Obstacle, drop-off, or too steep.
    Occupied,
}

/// Cells of a rectangle of columns, row by row from the lowest y, x fastest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Grid {
    /// Edge of a cell, metres.
    pub resolution_m: f64,
    /// Column of the first cell; times the resolution it is the grid's origin in the map frame.
    pub corner: [i32; 2],
    /// Cells along x.
    pub width: usize,
    /// Cells along y.
    pub height: usize,
    /// The cells.
    pub cells: Vec<Cell>,
}

impl Grid {
    /// Unknown cells of the smallest rectangle with these columns; empty without any.
    pub(super) fn around(
        columns: impl Iterator<Item = Column>,
        resolution_m: f64,
    ) -> Result<Grid, ProjectionError> {
        match Grid::bounds(columns)? {
            Some((low, [width, height])) => Grid::unknown(low, width, height, resolution_m),
            None => Ok(Grid {
                resolution_m,
                ..Grid::default()
            }),
        }
    }

    /// Lowest column and size of the smallest rectangle with these columns; an error if it is too large for a grid.
    pub(super) fn bounds(
        columns: impl Iterator<Item = Column>,
    ) -> Result<Option<(Column, [u64; 2])>, ProjectionError> {
        let none = ([i32::MAX; 2], [i32::MIN; 2]);
        let (low, high) = columns.fold(none, |(low, high), column| {
            let bound =
                |f: fn(i32, i32) -> i32, a: Column| [f(a[0], column[0]), f(a[1], column[1])];
            (bound(i32::min, low), bound(i32::max, high))
        });
        if low[0] > high[0] {
            return Ok(None);
        }
        let length = |axis: usize| (i64::from(high[axis]) - i64::from(low[axis]) + 1) as u64;
        let (width, height) = (length(0), length(1));
        if width.saturating_mul(height) > MAX_GRID_CELLS {
            return Err(ProjectionError::TooLarge { width, height });
        }
        Ok(Some((low, [width, height])))
    }

    /// Unknown cells of a rectangle.
    pub(super) fn unknown(
        corner: [i32; 2],
        width: u64,
        height: u64,
        resolution_m: f64,
    ) -> Result<Grid, ProjectionError> {
        let cells = width.saturating_mul(height);
        if cells > MAX_GRID_CELLS {
            return Err(ProjectionError::TooLarge { width, height });
        }
        Ok(Grid {
            resolution_m,
            corner,
            width: width as usize,
            height: height as usize,
            cells: vec![Cell::Unknown; cells as usize],
        })
    }

    /// The same cells in another rectangle; those outside this one are unknown.
    pub fn within(
        &self,
        corner: [i32; 2],
        width: usize,
        height: usize,
    ) -> Result<Grid, ProjectionError> {
        let mut grid = Grid::unknown(corner, width as u64, height as u64, self.resolution_m)?;
        for (i, cell) in grid.cells.iter_mut().enumerate() {
            let (x, y) = ((i % width) as i64, (i / width) as i64);
            let column = [i64::from(corner[0]) + x, i64::from(corner[1]) + y];
            *cell = self.at(column).unwrap_or_default();
        }
        Ok(grid)
    }

    /// Position of the lower-left corner of the first cell in the map frame, metres: multiples of the resolution.
    pub fn origin_m(&self) -> [f64; 2] {
        self.corner.map(|i| f64::from(i) * self.resolution_m)
    }

    /// Column of a cell.
    pub(super) fn column(&self, i: usize) -> Column {
        let width = self.width.max(1);
        let along = |corner: i32, k: usize| corner.saturating_add(k as i32);
        [
            along(self.corner[0], i % width),
            along(self.corner[1], i / width),
        ]
    }

    /// Index of a column's cell, if it is inside.
    pub(super) fn index(&self, column: Column) -> Option<usize> {
        self.index_wide(column.map(i64::from))
    }

    fn index_wide(&self, column: [i64; 2]) -> Option<usize> {
        let x = usize::try_from(column[0] - i64::from(self.corner[0])).ok()?;
        let y = usize::try_from(column[1] - i64::from(self.corner[1])).ok()?;
        (x < self.width && y < self.height).then_some(y * self.width + x)
    }

    fn at(&self, column: [i64; 2]) -> Option<Cell> {
        self.cells.get(self.index_wide(column)?).copied()
    }

    /// Cell at a position of the map frame, metres; unknown outside.
    pub fn at_m(&self, x_m: f64, y_m: f64) -> Cell {
        let column = [x_m, y_m].map(|value| (value / self.resolution_m).floor() as i64);
        self.at(column).unwrap_or_default()
    }

    /// Number of cells in a state.
    pub fn count(&self, state: Cell) -> usize {
        self.cells.iter().filter(|cell| **cell == state).count()
    }
}
