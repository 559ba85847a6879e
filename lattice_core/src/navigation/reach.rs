//! Surfaces that the robot reaches.

use nalgebra::Vector3;

use super::GroundOptions;
use super::grid::Grid;
use super::surface_graph::SurfaceGraph;

/// Reached surface of each column, nearest in height to that of the robot.
pub(super) struct Reached {
    /// Rectangle of all columns, unknown.
    pub(super) grid: Grid,
    /// Position of the reached surface in each cell of the grid.
    pub(super) drawn: Vec<Option<Vector3<f64>>>,
}

impl Reached {
    pub(super) fn new(
        graph: &SurfaceGraph,
        ground: &GroundOptions,
        robot_m: Option<Vector3<f64>>,
    ) -> Reached {
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
        Reached {
            drawn: drawn.collect(),
            grid: graph.grid.clone(),
        }
    }
}
