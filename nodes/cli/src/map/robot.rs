//! Robot for which the ground of a map file is found.

use clap::Args;
use lattice_core::navigation::{
    GroundOptions, ProjectionError, ProjectionRule, Projector, ProjectorOptions,
};
use lattice_core::voxels::VoxelList;

/// Robot on the ground.
#[derive(Args)]
pub struct RobotOptions {
    /// Edge of the grid's cells, m; default: cell size of the map
    #[arg(long, value_name = "M", requires = "ground")]
    resolution: Option<f64>,
    /// Height of the robot, m
    #[arg(long, value_name = "M", default_value_t = 1.5, requires = "ground")]
    robot_height: f64,
    /// Highest step that the robot drives over, m
    #[arg(long, value_name = "M", default_value_t = 0.1, requires = "ground")]
    max_step: f64,
    /// Steepest ground that the robot drives on, degrees
    #[arg(long, value_name = "DEG", default_value_t = 20.0, requires = "ground")]
    max_slope: f64,
}

impl RobotOptions {
    /// Projector with all voxels of a map.
    pub fn projector(&self, list: &VoxelList) -> Result<Projector, ProjectionError> {
        let options = ProjectorOptions {
            resolution_m: self.resolution.unwrap_or_default(),
            rule: ProjectionRule::Ground(GroundOptions {
                robot_height_m: self.robot_height,
                max_step_m: self.max_step,
                max_slope_deg: self.max_slope,
            }),
        };
        let mut projector = Projector::new(list.lattice(), list.datum_m(), options)?;
        for (key, voxel) in list.sorted() {
            projector.set(key, Some(voxel.mean_offset_m().into()));
        }
        Ok(projector)
    }
}
