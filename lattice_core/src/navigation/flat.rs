//! Projection of a height band, the rule of octomap_server.

use nalgebra::Vector3;

use super::ProjectionError;
use super::columns::Columns;
use super::grid::{Cell, Grid};
use super::tiles::Column;
use crate::lattice::{Lattice, MortonKey};

/// Part of a cell's edge by which it has to reach into a column.
const SLACK: f64 = 1e-6;

/// Free cells of a lattice.
#[derive(Clone, Debug)]
pub struct FreeCells {
    /// The lattice.
    pub lattice: Lattice,
    /// Point of the map frame that keys count from, metres.
    pub datum_m: Vector3<f64>,
    /// The cells.
    pub keys: Vec<MortonKey>,
}

/// Grid of a band of heights, metres; voxels and free cells count as cubes of their volume.
pub(super) fn grid(
    columns: &Columns,
    [min_m, max_m]: [f64; 2],
    free: Option<&FreeCells>,
) -> Result<Grid, ProjectionError> {
    let is_in = |z_m: f64| (min_m..=max_m).contains(&z_m);
    let occupied = || {
        let inside = columns.samples().filter(|sample| is_in(sample.at_m.z));
        inside.filter_map(|sample| columns.column_of(sample.at_m.x, sample.at_m.y))
    };
    let free_cells = || {
        free.into_iter().flat_map(|free| {
            let side_m = free.lattice.cell_side_m();
            let centers = free
                .keys
                .iter()
                .map(|key| free.datum_m + free.lattice.center(key.unpack()));
            let inside = centers.filter(|center| is_in(center.z));
            inside.flat_map(move |center_m| covered(columns, center_m, side_m))
        })
    };
    let known = columns
        .samples()
        .filter_map(|s| columns.column_of(s.at_m.x, s.at_m.y));
    let mut grid = Grid::around(known.chain(free_cells()), columns.resolution_m)?;
    let mut mark = |column: Column, state: Cell| {
        if let Some(cell) = grid.index(column).and_then(|i| grid.cells.get_mut(i)) {
            *cell = state;
        }
    };
    free_cells().for_each(|column| mark(column, Cell::Free));
    occupied().for_each(|column| mark(column, Cell::Occupied));
    Ok(grid)
}

/// Columns that a cube reaches into.
fn covered(columns: &Columns, center_m: Vector3<f64>, side_m: f64) -> impl Iterator<Item = Column> {
    let half_m = (0.5 - SLACK) * side_m;
    let low = columns.column_of(center_m.x - half_m, center_m.y - half_m);
    let high = columns.column_of(center_m.x + half_m, center_m.y + half_m);
    low.zip(high).into_iter().flat_map(|(low, high)| {
        (low[1]..=high[1]).flat_map(move |y| (low[0]..=high[0]).map(move |x| [x, y]))
    })
}
