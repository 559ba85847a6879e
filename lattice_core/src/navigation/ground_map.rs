//! Paths of a robot on the ground.

use std::sync::Arc;

use nalgebra::Vector3;

use super::ground_path_error::{GroundPathError, PathEnd};
use super::options::GroundOptions;
use super::path_ends::{EndSearch, checked};
use super::robot_room::open_nodes;
use super::surface_graph::SurfaceGraph;
use super::surface_steps::Steps;
use super::{ground_search, path_points};

/// Maximum of the expanded places of [`GroundPathOptions::default`].
const MAX_EXPANDED: usize = 4_000_000;

/// Options of a path on the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundPathOptions {
    /// Radius of the robot, metres: centres of cells nearer than that to a cell without ground are not passed.
    pub robot_radius_m: f64,
    /// Distance by which start and goal may move to a place with room, metres.
    pub tolerance_m: f64,
    /// Maximum number of expanded places.
    pub max_expanded: usize,
}

impl Default for GroundPathOptions {
    fn default() -> GroundPathOptions {
        GroundPathOptions {
            robot_radius_m: 0.3,
            tolerance_m: 0.5,
            max_expanded: MAX_EXPANDED,
        }
    }
}

/// Path of a robot on the ground.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundPath {
    /// Start, corners and goal: centres of cells on their surfaces, map frame, metres.
    pub corners_m: Vec<Vector3<f64>>,
    /// Points along the path, at most a diagonal of a cell apart, at the height of the ground.
    pub points_m: Vec<Vector3<f64>>,
    /// Length from corner to corner, metres.
    pub length_m: f64,
    /// Number of expanded places.
    pub expanded: usize,
}

/// Ground of a map, on which paths are searched.
#[derive(Clone, Debug)]
pub struct GroundMap {
    graph: Arc<SurfaceGraph>,
    ground: GroundOptions,
}

impl GroundMap {
    pub(super) fn new(graph: Arc<SurfaceGraph>, ground: GroundOptions) -> GroundMap {
        GroundMap { graph, ground }
    }

    /// Finds a short path from surface to surface; stops at the limit, and once `go_on` returns false, which is called
    /// before each expansion.
    ///
    /// Start and goal select the nearest ground below them, or without any the lowest above. The shortest path in eight
    /// directions is shortened by lines of sight. All cells that it touches are ground that the robot reaches, with their
    /// centres at least the radius from each cell without ground. Equal maps and options give equal paths.
    pub fn path_while(
        &self,
        start_m: &Vector3<f64>,
        goal_m: &Vector3<f64>,
        options: &GroundPathOptions,
        mut go_on: impl FnMut() -> bool,
    ) -> Result<GroundPath, GroundPathError> {
        checked(&self.graph, options.robot_radius_m, options.tolerance_m)?;
        let stopped = |expanded| GroundPathError::Limit { expanded };
        let open = open_nodes(
            &self.graph,
            &self.ground,
            options.robot_radius_m,
            &mut go_on,
        )
        .ok_or(stopped(0))?;
        let steps = Steps {
            graph: &self.graph,
            ground: &self.ground,
            open: &open,
        };
        let ends = EndSearch {
            steps,
            radius_m: options.robot_radius_m,
            tolerance_m: options.tolerance_m,
        };
        let start = ends.find(PathEnd::Start, start_m, None)?;
        let component = self.graph.component_of(start.node as usize);
        let goal = ends.find(PathEnd::Goal, goal_m, Some(component))?;
        if self.graph.component_of(goal.node as usize) != component {
            return Err(GroundPathError::NoWay { expanded: 0 });
        }
        let (way, expanded) =
            ground_search::search(&steps, [start, goal], options.max_expanded, &mut go_on)?;
        let corners = path_points::corners(&steps, &way, &mut go_on).ok_or(stopped(expanded))?;
        let corners_m: Vec<_> = corners.iter().map(|at| steps.point_m(*at)).collect();
        let pairs = corners_m.iter().zip(corners_m.iter().skip(1));
        Ok(GroundPath {
            length_m: pairs.map(|(a, b)| (b - a).norm()).sum(),
            points_m: path_points::points(&steps, &corners),
            corners_m,
            expanded,
        })
    }

    /// As [`GroundMap::path_while`], without a callback.
    pub fn path(
        &self,
        start_m: &Vector3<f64>,
        goal_m: &Vector3<f64>,
        options: &GroundPathOptions,
    ) -> Result<GroundPath, GroundPathError> {
        self.path_while(start_m, goal_m, options, || true)
    }

    /// Edge of the cells, metres.
    pub fn resolution_m(&self) -> f64 {
        self.graph.grid.resolution_m
    }
}
