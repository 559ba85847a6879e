//! Options of a projection and their errors.

use thiserror::Error;

use super::elevation_limit::MAX_ELEVATION_CELLS;
use super::grid_limit::MAX_GRID_CELLS;
use crate::lattice::Lattice;

/// Bounds of the resolution, in cell sizes of the lattice.
const RESOLUTION_SIDES: [f64; 2] = [0.25, 64.0];
/// Maximum of the lengths of [`GroundOptions`], metres.
const MAX_LENGTH_M: f64 = 100.0;
/// Maximum of [`GroundOptions::max_slope_deg`].
const MAX_SLOPE_DEG: f64 = 80.0;

/// Error of a projection.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ProjectionError {
    /// Resolution too fine or too coarse for the lattice.
    #[error(
        "resolution {found_m} m is outside {min_m:.4}..={max_m:.4} m for cells of {side_m:.4} m (`resolution_m`): \
         0 takes the cell size"
    )]
    #[expect(missing_docs, reason = "the message names the fields")]
    Resolution {
        found_m: f64,
        min_m: f64,
        max_m: f64,
        side_m: f64,
    },
    /// Option that is out of range.
    #[error("{value} is outside {min}..={max} (`{name}`)")]
    #[expect(missing_docs, reason = "the message names the fields")]
    Option {
        name: &'static str,
        value: f64,
        min: f64,
        max: f64,
    },
    /// Lower bound above the upper one.
    #[error("height band {min_m}..={max_m} m is empty (`occupancy_min_z_m`, `occupancy_max_z_m`)")]
    #[expect(missing_docs, reason = "the message names the fields")]
    Band { min_m: f64, max_m: f64 },
    /// Map too wide for its resolution.
    #[error(
        "a grid of {width} x {height} cells exceeds {MAX_GRID_CELLS} cells: set a larger `resolution_m`, or crop the map"
    )]
    #[expect(missing_docs, reason = "the message names the fields")]
    TooLarge { width: u64, height: u64 },
    /// Elevation map with too many cells for a message.
    #[error(
        "an elevation map of {width} x {height} cells exceeds {MAX_ELEVATION_CELLS} cells: set a smaller \
         `elevation_length_m`, or a larger `resolution_m`"
    )]
    #[expect(missing_docs, reason = "the message names the fields")]
    TooManyHeights { width: u64, height: u64 },
    /// Rule without surfaces.
    #[error("elevation needs ground that is found: set `ground: found`")]
    FlatRule,
}

/// Robot on the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundOptions {
    /// Height of the robot above the ground, metres.
    pub robot_height_m: f64,
    /// Maximum height of a step that the robot drives over, metres.
    pub max_step_m: f64,
    /// Maximum inclination of ground, degrees.
    pub max_slope_deg: f64,
}

impl Default for GroundOptions {
    fn default() -> GroundOptions {
        GroundOptions {
            robot_height_m: 1.5,
            max_step_m: 0.1,
            max_slope_deg: 20.0,
        }
    }
}

impl GroundOptions {
    /// Maximum rise per horizontal metre.
    pub(super) fn max_rise(&self) -> f64 {
        self.max_slope_deg.to_radians().tan()
    }

    /// Maximum difference in height between two surfaces that are linked, this far apart.
    pub(super) fn max_link_m(&self, apart_m: f64) -> f64 {
        self.max_step_m + self.max_rise() * apart_m
    }
}

/// Rule that makes columns of voxels cells of a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ProjectionRule {
    /// Ground that is found, with steps, slopes and headroom.
    Ground(GroundOptions),
    /// Height band (map frame), as octomap_server: occupied if a voxel is in it, else free if a free cell is.
    Flat {
        /// Lower bound, metres.
        min_z_m: f64,
        /// Upper bound, metres.
        max_z_m: f64,
    },
}

/// Options of a [`super::Projector`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProjectorOptions {
    /// Edge of the cells of the grid, metres, rounded to single precision; 0: cell size of the lattice.
    pub resolution_m: f64,
    /// Rule of the projection.
    pub rule: ProjectionRule,
}

impl Default for ProjectorOptions {
    fn default() -> ProjectorOptions {
        ProjectorOptions {
            resolution_m: 0.0,
            rule: ProjectionRule::Ground(GroundOptions::default()),
        }
    }
}

impl ProjectorOptions {
    /// Resolution for a lattice, metres.
    pub(super) fn resolution_of(&self, lattice: &Lattice) -> f64 {
        let resolution_m = match self.resolution_m == 0.0 {
            true => lattice.cell_side_m(),
            false => self.resolution_m,
        };
        f64::from(resolution_m as f32)
    }

    pub(super) fn check(&self, lattice: &Lattice) -> Result<(), ProjectionError> {
        let found_m = self.resolution_of(lattice);
        let side_m = lattice.cell_side_m();
        let [min_m, max_m] = RESOLUTION_SIDES.map(|sides| sides * side_m);
        if !(min_m..=max_m).contains(&found_m) {
            return Err(ProjectionError::Resolution {
                found_m,
                min_m,
                max_m,
                side_m,
            });
        }
        match self.rule {
            ProjectionRule::Flat { min_z_m, max_z_m } => {
                let (min_m, max_m) = (min_z_m, max_z_m);
                let is_band = min_m <= max_m;
                is_band
                    .then_some(())
                    .ok_or(ProjectionError::Band { min_m, max_m })
            }
            ProjectionRule::Ground(ground) => [
                ("robot_height_m", ground.robot_height_m, 0.01, MAX_LENGTH_M),
                ("max_step_m", ground.max_step_m, 0.001, MAX_LENGTH_M),
                ("max_slope_deg", ground.max_slope_deg, 0.1, MAX_SLOPE_DEG),
            ]
            .into_iter()
            .find(|(_, value, min, max)| !(min..=max).contains(&value))
            .map_or(Ok(()), |(name, value, min, max)| {
                Err(ProjectionError::Option {
                    name,
                    value,
                    min,
                    max,
                })
            }),
        }
    }
}
