//! Options of the projector.

use lattice_core::navigation::{
    GroundOptions, GroundPathOptions, ProjectionRule, ProjectorOptions, Square,
};
use nalgebra::Vector3;

use crate::options::one_of;
use lattice_runtime::params::{ParamError, Params};

/// Options of [`super::MapProjector`].
#[derive(Clone, Debug, PartialEq)]
pub struct MapProjectorOptions {
    /// Projection of the core.
    pub projector: ProjectorOptions,
    /// Room around a grid that has to grow, m.
    pub room_m: f64,
    /// Edge of the square about the robot that elevation has, m; 0: the whole grid.
    pub elevation_length_m: f64,
    /// Voxel limit of the followed map.
    pub max_voxels: usize,
}

impl Default for MapProjectorOptions {
    fn default() -> Self {
        Self {
            projector: ProjectorOptions::default(),
            room_m: 20.0,
            elevation_length_m: 20.0,
            max_voxels: 20_000_000,
        }
    }
}

impl MapProjectorOptions {
    /// Reads the parameters of the node.
    pub fn from_params(params: &Params) -> Result<Self, ParamError> {
        let defaults = Self::default();
        let ground = GroundOptions::default();
        let is_flat = one_of(params, "ground", &[("found", false), ("flat", true)])?;
        let lengths = 0.01..=100.0;
        let ground = GroundOptions {
            robot_height_m: params.f64_in("robot_height_m", ground.robot_height_m, lengths)?,
            max_step_m: params.f64_in("max_step_m", ground.max_step_m, 0.001..=100.0)?,
            max_slope_deg: params.f64_in("max_slope_deg", ground.max_slope_deg, 0.1..=80.0)?,
        };
        let heights = -1e6..=1e6;
        let min_z_m = params.f64_in("occupancy_min_z_m", 0.2, heights.clone())?;
        let max_z_m = params.f64_in("occupancy_max_z_m", 2.0, heights)?;
        if min_z_m > max_z_m {
            return Err(params.invalid("occupancy_min_z_m", "at most `occupancy_max_z_m`"));
        }
        Ok(Self {
            projector: ProjectorOptions {
                resolution_m: params.f64_in("resolution_m", 0.0, 0.0..=1000.0)?,
                rule: match is_flat {
                    true => ProjectionRule::Flat { min_z_m, max_z_m },
                    false => ProjectionRule::Ground(ground),
                },
            },
            room_m: params.f64_in("room_m", defaults.room_m, 0.0..=10_000.0)?,
            elevation_length_m: params.f64_in(
                "elevation_length_m",
                defaults.elevation_length_m,
                0.0..=10_000.0,
            )?,
            max_voxels: params.positive("max_voxels", defaults.max_voxels)?,
        })
    }

    /// Reads the parameters of the planner.
    pub(super) fn path_from_params(params: &Params) -> Result<GroundPathOptions, ParamError> {
        let defaults = GroundPathOptions::default();
        let lengths = 0.0..=100.0;
        Ok(GroundPathOptions {
            robot_radius_m: params.f64_in(
                "robot_radius_m",
                defaults.robot_radius_m,
                lengths.clone(),
            )?,
            tolerance_m: params.f64_in("plan_tolerance_m", defaults.tolerance_m, lengths)?,
            ..defaults
        })
    }

    /// True if the rule finds ground; the other one needs free cells.
    pub fn has_ground(&self) -> bool {
        matches!(self.projector.rule, ProjectionRule::Ground(_))
    }

    /// Square that elevation has, or the whole grid; `None` while the robot's position is missing for it.
    pub(super) fn elevation_square(&self, robot_m: Option<Vector3<f64>>) -> Option<Option<Square>> {
        let length_m = self.elevation_length_m;
        if length_m == 0.0 {
            return Some(None);
        }
        robot_m.map(|robot_m| {
            let center_m = [robot_m.x, robot_m.y];
            Some(Square { center_m, length_m })
        })
    }
}
