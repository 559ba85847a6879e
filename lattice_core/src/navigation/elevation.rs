//! Heights of the ground for legged robots.

use std::collections::VecDeque;

use nalgebra::Vector3;

use super::elevation_limit::MAX_ELEVATION_CELLS;
use super::grid::{Cell, Grid};
use super::options::{GroundOptions, ProjectionError};
use super::reach::Reached;
use super::surface_graph::{EDGES, beside};
use super::surfaces::{ColumnState, Surface};
use super::tiles::Tiles;

/// Square of the map frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Square {
    /// Centre, metres.
    pub center_m: [f64; 2],
    /// Edge, metres.
    pub length_m: f64,
}

/// Ground of a rectangle of columns, row by row from the lowest y, x fastest; NaN is unknown.
///
/// Cells that the robot reaches have the surface of [`super::Grid`]. From there on others have the surface nearest in height
/// to that of the cell before, at most the robot's height above or below. Cells of a step that is too high have none.
#[derive(Clone, Debug, Default)]
pub struct Elevation {
    /// Edge of a cell, metres.
    pub resolution_m: f64,
    /// Column of the first cell, as in [`super::Grid`].
    pub corner: [i32; 2],
    /// Cells along x.
    pub width: usize,
    /// Cells along y.
    pub height: usize,
    /// Height of the surface, map frame, metres.
    pub elevation_m: Vec<f32>,
    /// Inclination, radians; that of the ground on either side for a step that the robot drives over.
    pub slope_rad: Vec<f32>,
    /// Height of the step at the cell, metres.
    pub step_m: Vec<f32>,
    /// Distance from the surface to the lowest sample above it, metres; NaN where nothing was seen above.
    pub clearance_m: Vec<f32>,
    /// From 0 for occupied cells to 1 for free ones without slope and step; NaN for unknown cells.
    pub traversability: Vec<f32>,
}

impl Elevation {
    /// Layers with the names that messages have.
    pub fn layers(&self) -> [(&'static str, &[f32]); 5] {
        [
            ("elevation", &self.elevation_m),
            ("slope", &self.slope_rad),
            ("step", &self.step_m),
            ("clearance", &self.clearance_m),
            ("traversability", &self.traversability),
        ]
    }

    /// Index of the cell at a position of the map frame, if it is inside.
    pub fn index_at_m(&self, x_m: f64, y_m: f64) -> Option<usize> {
        let along = |value_m: f64, corner: i32, count: usize| {
            let i = (value_m / self.resolution_m).floor() - f64::from(corner);
            (0.0..count as f64).contains(&i).then_some(i as usize)
        };
        let x = along(x_m, self.corner[0], self.width)?;
        Some(along(y_m, self.corner[1], self.height)? * self.width + x)
    }
}

/// Unknown cells of a square, or of the whole grid.
fn window(grid: &Grid, square: Option<Square>) -> Result<Grid, ProjectionError> {
    let (corner, width, height) = match square {
        None => (grid.corner, grid.width as u64, grid.height as u64),
        Some(square) => {
            // Saturates for what is no number or too large, and is refused below.
            let count = (square.length_m / grid.resolution_m).ceil().max(1.0) as u32;
            let first = |center_m: f64| {
                let center = (center_m / grid.resolution_m).round() as i32;
                center.saturating_sub_unsigned(count / 2)
            };
            (
                square.center_m.map(first),
                u64::from(count),
                u64::from(count),
            )
        }
    };
    if width.saturating_mul(height) > MAX_ELEVATION_CELLS {
        return Err(ProjectionError::TooManyHeights { width, height });
    }
    Grid::unknown(corner, width, height, grid.resolution_m)
}

/// Elevation of a square, or of the whole grid.
pub(super) fn of(
    states: &Tiles<ColumnState>,
    reached: &Reached,
    grid: &Grid,
    ground: &GroundOptions,
    square: Option<Square>,
) -> Result<Elevation, ProjectionError> {
    let window = window(grid, square)?;
    let cells = window.cells.len();
    let unknown = || vec![f32::NAN; cells];
    let mut elevation = Elevation {
        resolution_m: window.resolution_m,
        corner: window.corner,
        width: window.width,
        height: window.height,
        elevation_m: unknown(),
        slope_rad: unknown(),
        step_m: unknown(),
        clearance_m: unknown(),
        traversability: unknown(),
    };
    let surfaces = chosen(states, reached, ground, &window);
    for (i, surface) in surfaces.into_iter().enumerate() {
        let cell = grid.index(window.column(i));
        let cell = cell.and_then(|i| grid.cells.get(i).copied());
        let set = |layer: &mut Vec<f32>, value: f64| {
            if let Some(cell) = layer.get_mut(i) {
                *cell = value as f32;
            }
        };
        let traversability = match (cell.unwrap_or_default(), surface) {
            (Cell::Unknown, _) | (Cell::Free, None) => f64::NAN,
            (Cell::Occupied, _) => 0.0,
            (Cell::Free, Some(surface)) => {
                let slope = surface.slope.atan() / ground.max_slope_deg.to_radians();
                let step = surface.step_m / ground.max_step_m;
                (1.0 - slope.max(step)).clamp(0.0, 1.0)
            }
        };
        set(&mut elevation.traversability, traversability);
        let Some(surface) = surface else {
            continue;
        };
        set(&mut elevation.elevation_m, surface.at_m.z);
        set(&mut elevation.slope_rad, surface.slope.atan());
        set(&mut elevation.step_m, surface.step_m);
        let clearance_m = surface.clearance_m;
        if clearance_m.is_finite() {
            set(&mut elevation.clearance_m, clearance_m);
        }
    }
    Ok(elevation)
}

/// Surface of each cell of a window: the reached one, else the one that continues its neighbours.
fn chosen<'a>(
    states: &'a Tiles<ColumnState>,
    reached: &Reached,
    ground: &GroundOptions,
    window: &Grid,
) -> Vec<Option<&'a Surface>> {
    let drawn = |i: usize| -> Option<&'a Surface> {
        let column = window.column(i);
        let at_m: Vector3<f64> = (*reached.drawn.get(reached.grid.index(column)?)?)?;
        let mut surfaces = states.get(column)?.surfaces.iter();
        surfaces.find(|surface| surface.at_m == at_m)
    };
    let mut chosen: Vec<_> = (0..window.cells.len()).map(drawn).collect();
    let mut is_seen: Vec<bool> = chosen.iter().map(Option::is_some).collect();
    let begin = chosen.iter().enumerate();
    let begin = begin.filter_map(|(i, surface)| surface.map(|surface| (i, surface.at_m.z)));
    let mut open: VecDeque<(usize, f64)> = begin.collect();
    while let Some((i, z_m)) = open.pop_front() {
        let rise_m = |surface: &&Surface| (surface.at_m.z - z_m).abs();
        for i in EDGES.into_iter().filter_map(|step| beside(window, i, step)) {
            // Matter without a surface, such as a wall, is passed; what was never seen is not.
            let state = states.get(window.column(i));
            let (Some(state), Some(seen @ false)) = (state, is_seen.get_mut(i)) else {
                continue;
            };
            *seen = true;
            let nearest = state.surfaces.iter();
            let nearest = nearest.min_by(|a, b| rise_m(a).total_cmp(&rise_m(b)));
            let near = nearest.filter(|surface| rise_m(surface) <= ground.robot_height_m);
            if let (Some(_), Some(cell)) = (near, chosen.get_mut(i)) {
                *cell = near;
            }
            open.push_back((i, near.map_or(z_m, |surface| surface.at_m.z)));
        }
    }
    chosen
}
