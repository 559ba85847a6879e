//! Surfaces that the robot reaches.

use nalgebra::Vector3;
use rustc_hash::FxHashMap;

use super::columns::Column;
use super::grid::Grid;
use super::surface_graph::SurfaceGraph;
use super::surfaces::ColumnState;
use super::{GroundOptions, ProjectionError};

/// Reached surface of each column, nearest in height to that of the robot.
pub(super) struct Reached {
    /// Rectangle of all columns, unknown.
    pub(super) grid: Grid,
    /// Position of the reached surface in each cell of the grid.
    pub(super) drawn: Vec<Option<Vector3<f64>>>,
}

impl Reached {
    pub(super) fn new(
        states: &FxHashMap<Column, ColumnState>,
        resolution_m: f64,
        ground: &GroundOptions,
        robot_m: Option<Vector3<f64>>,
    ) -> Result<Reached, ProjectionError> {
        let graph = SurfaceGraph::new(states, resolution_m, ground)?;
        let start = graph.start(ground, robot_m);
        let drawn = (0..graph.grid.cells.len()).map(|cell| {
            let (component, height_m) = start?;
            let reached = graph
                .of_cell(cell)
                .filter(|node| graph.component_of(*node) == component);
            let reached = reached.filter_map(|node| graph.at_m.get(node).copied());
            let from_robot_m = |at: &Vector3<f64>| (at.z - height_m).abs();
            reached.min_by(|a, b| from_robot_m(a).total_cmp(&from_robot_m(b)))
        });
        Ok(Reached {
            drawn: drawn.collect(),
            grid: graph.grid,
        })
    }
}
