//! Parameters of the projector.

use std::time::Duration;

use lattice_core::navigation::GroundPathOptions;

use super::MapProjectorOptions;
use crate::compute::ComputeLimits;
use crate::options::FRAME;
use crate::{options, report};
use lattice_runtime::about;
use lattice_runtime::params::{About, ParamError, Params};

const ABOUT: &[About] = about! {
    "resolution_m": "Edge of the grid's cells; 0: cell size of the lattice.";
    "ground" fixed("free cells are subscribed to for it"): "Rule: found (steps, slopes and headroom are judged from the robot on) or flat (height band, as octomap_server).";
    "robot_height_m": "Height of the robot: what is higher above the ground is no obstacle.";
    "max_step_m": "Highest step that the robot drives over, up or down.";
    "max_slope_deg": "Steepest ground that the robot drives on.";
    "occupancy_min_z_m": "With ground: flat, lower bound of the height band in the map frame.";
    "occupancy_max_z_m": "With ground: flat, upper bound of the height band in the map frame.";
    "base_frame" fixed(FRAME): "Frame of the robot, whose position by /tf selects the ground; without it: the lowest large surface.";
    "plan" fixed("its action is made at the start"): "Whether the action compute_path_to_pose plans paths on the ground, in place of Nav2's planner_server; not with ground: flat.";
    "robot_radius_m": "Radius of the robot: paths keep it away from obstacles, edges and unseen ground.";
    "plan_tolerance_m": "Distance by which start and goal of a path may move to ground with room for the robot.";
    "elevation_length_m": "Edge of the square about the robot that elevation has; 0: the whole grid.";
    "room_m": "Room on each side of a grid that has to grow.";
    "update_period_s": "Shortest time between two changes of the grid.";
    "grid_period_s": "Shortest time between two whole grids where a subscriber of projected_map takes no updates.";
};

/// Settings from the parameters of the node.
pub(super) struct Settings {
    pub projector: MapProjectorOptions,
    pub plan: bool,
    pub path: GroundPathOptions,
    pub limits: ComputeLimits,
    pub base_frame: String,
    pub update_period: Duration,
    pub grid_period: Duration,
    pub mapper: String,
    pub report_file: String,
}

impl Settings {
    /// Reads the parameters of the node.
    pub(super) fn from_params(params: &Params) -> Result<Self, ParamError> {
        params.describe(ABOUT);
        params.describe(options::COMMON);
        Ok(Self {
            projector: MapProjectorOptions::from_params(params)?,
            plan: params.bool("plan", false)?,
            path: MapProjectorOptions::path_from_params(params)?,
            limits: options::compute_limits(params, 4096, 64 << 20, options::threads(params, 1)?)?,
            base_frame: options::frame(params, "base_frame", "base_link")?,
            update_period: options::period(params, "update_period_s", 0.5)?,
            grid_period: options::period(params, "grid_period_s", 2.0)?,
            mapper: params.string("mapper", "lattice_mapper")?,
            report_file: report::file(params)?,
        })
    }
}

/// Declares all parameters of the node, as at its start.
pub fn declare(params: &Params) -> Result<(), ParamError> {
    Settings::from_params(params).map(drop)
}
