//! Cells of the grid from reached surfaces and matter.

use nalgebra::Vector3;

use super::GroundOptions;
use super::grid::{Cell, Grid};
use super::reach::Reached;
use super::surface_graph::{CORNERS, EDGES, beside, linked};
use super::surfaces::ColumnState;
use super::tiles::{Column, Tiles};

/// Paints the grid.
pub(super) fn paint(
    states: &Tiles<ColumnState>,
    reached: &Reached,
    ground: &GroundOptions,
) -> Grid {
    let mut grid = reached.grid.clone();
    for (column, state) in states.iter() {
        let Some(i) = grid.index(column) else {
            continue;
        };
        let cell = match reached.drawn.get(i) {
            Some(Some(_)) if is_edge(states, reached, column, i, ground) => Cell::Occupied,
            Some(Some(_)) => Cell::Free,
            _ => of_matter(state, reached, i, ground),
        };
        if let Some(place) = grid.cells.get_mut(i) {
            *place = cell;
        }
    }
    paint_drops(&mut grid, states, reached, ground);
    grid
}

/// Cell of a column where nothing is reached. What is above a robot on the next cell says nothing of the ground.
fn of_matter(state: &ColumnState, reached: &Reached, i: usize, ground: &GroundOptions) -> Cell {
    let beside = EDGES
        .into_iter()
        .filter_map(|step| beside(&reached.grid, i, step));
    let beside = beside.filter_map(|i| reached.drawn.get(i).copied().flatten());
    let floor_m = beside.map(|at_m| at_m.z).reduce(f64::max);
    let is_low = |z_m: f64| floor_m.is_none_or(|floor_m| z_m - floor_m <= ground.robot_height_m);
    let is_tall = state.tall_m.iter().any(|[low_m, _]| is_low(*low_m));
    let mut low = state
        .surfaces
        .iter()
        .filter(|surface| is_low(surface.at_m.z));
    match is_tall || low.any(|surface| floor_m.is_some() || !surface.is_standable) {
        true => Cell::Occupied,
        false => Cell::Unknown,
    }
}

/// Tests whether the surface of a cell ends beside a lower one, or at a wall that goes down.
fn is_edge(
    states: &Tiles<ColumnState>,
    reached: &Reached,
    column: Column,
    i: usize,
    ground: &GroundOptions,
) -> bool {
    let drawn = |i: usize| reached.drawn.get(i).copied().flatten();
    let Some(at_m) = drawn(i) else {
        return false;
    };
    let link_m = ground.max_link_m(reached.grid.resolution_m);
    let goes_down =
        |[low, high]: &[f64; 2]| (high - at_m.z).abs() <= link_m && at_m.z - low > link_m;
    let is_lower = |other_m: &Vector3<f64>| other_m.z < at_m.z && !linked(&at_m, other_m, ground);
    EDGES.into_iter().chain(CORNERS).any(|[dx, dy]| {
        match beside(&reached.grid, i, [dx, dy]).and_then(drawn) {
            Some(other_m) => is_lower(&other_m),
            None => states
                .get([column[0] + dx, column[1] + dy])
                .is_some_and(|state| {
                    state.surfaces.iter().any(|low| is_lower(&low.at_m))
                        || state.tall_m.iter().any(goes_down)
                }),
        }
    })
}

/// Paints unknown cells between a reached surface and lower ground, and the end of that surface, where the mean slope
/// between them is too steep.
fn paint_drops(
    grid: &mut Grid,
    states: &Tiles<ColumnState>,
    reached: &Reached,
    ground: &GroundOptions,
) {
    let lowest_m = lowest(grid, states);
    let (width, height) = (grid.width, grid.height);
    let rows = (0..height).map(|y| (y * width, 1, width));
    let columns = (0..width).map(|x| (x, width, height));
    for (begin, stride, length) in rows.chain(columns) {
        let line = |k: usize| begin + k * stride;
        let mut known: Option<usize> = None;
        for k in 0..length {
            let height_m = |k: usize| lowest_m.get(line(k)).copied().unwrap_or(f64::NAN);
            let is_drawn = matches!(reached.drawn.get(line(k)), Some(Some(_)));
            // A ceiling over ground that was not seen.
            let is_above = |before: usize| height_m(k) - height_m(before) > ground.robot_height_m;
            if height_m(k).is_nan() || !is_drawn && known.is_some_and(is_above) {
                continue;
            }
            if let Some(before) = known.replace(k)
                && k - before > 1
            {
                let [a, b] = [line(before), line(k)];
                let apart_m = (k - before) as f64 * grid.resolution_m;
                let is_drop = |from: usize, to: usize| {
                    let from_m = reached.drawn.get(from).copied().flatten();
                    let to_m = lowest_m.get(to).copied().unwrap_or(f64::NAN);
                    from_m.is_some_and(|from_m| from_m.z - to_m > ground.max_link_m(apart_m))
                };
                let is_upper =
                    |cell: usize| cell == a && is_drop(a, b) || cell == b && is_drop(b, a);
                if is_drop(a, b) || is_drop(b, a) {
                    for end in (before..=k).map(line) {
                        if let Some(cell) = grid.cells.get_mut(end)
                            && (*cell == Cell::Unknown || is_upper(end))
                        {
                            *cell = Cell::Occupied;
                        }
                    }
                }
            }
        }
    }
}

/// Lowest surface of each cell, metres; NaN where there is none.
fn lowest(grid: &Grid, states: &Tiles<ColumnState>) -> Vec<f64> {
    let mut lowest_m = vec![f64::NAN; grid.cells.len()];
    for (column, state) in states.iter() {
        let cell = grid.index(column).and_then(|i| lowest_m.get_mut(i));
        if let (Some(cell), Some(surface)) = (cell, state.surfaces.first()) {
            *cell = surface.at_m.z;
        }
    }
    lowest_m
}
