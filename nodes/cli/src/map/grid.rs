//! Occupancy grid and elevation of a map file.

use std::path::Path;

use clap::Args;
use lattice_core::navigation::{Cell, Grid, MAX_ELEVATION_CELLS, ProjectionError};
use lattice_core::voxels::VoxelList;
use lattice_nodes::files::atomic_write;
use lattice_nodes::files::export::{write_elevation_tiff, write_grid_pgm, write_grid_yaml};
use nalgebra::Vector3;

use super::robot::RobotOptions;
use crate::CliResult;

/// Robot for which a grid or elevation is made, and its place.
#[derive(Args)]
pub struct GridOptions {
    #[command(flatten)]
    limits: RobotOptions,
    /// Position of the robot, map frame, m: the ground below it is that of the grid; default: the lowest large surface
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true, requires = "ground")]
    robot: Option<Vec<f64>>,
}

impl GridOptions {
    /// Writes the grid of a map as YAML, and its image beside it.
    pub fn write(&self, list: &VoxelList, yaml: &Path) -> CliResult {
        if !has_extension(yaml, &["yaml", "yml"]) {
            let yaml = yaml.display();
            return Err(
                format!("{yaml}: --grid writes a .yaml file, with a .pgm file beside it").into(),
            );
        }
        let mut projector = self.limits.projector(list)?;
        let grid = projector.grid(self.robot_m(), None)?;
        let free = free_cells(&grid)?;
        let image = yaml.with_extension("pgm");
        let name = image.file_name().unwrap_or_default().to_string_lossy();
        atomic_write::write(&image, |out| write_grid_pgm(&grid, out))?;
        atomic_write::write(yaml, |out| write_grid_yaml(&grid, &name, out))?;
        let (width, height) = (grid.width, grid.height);
        println!(
            "{width} x {height} cells of {:.3} m: {free} free, {} occupied, {} unknown",
            grid.resolution_m,
            grid.count(Cell::Occupied),
            grid.count(Cell::Unknown)
        );
        Ok(())
    }
    /// Writes the ground of a map as GeoTIFF.
    pub fn write_elevation(&self, list: &VoxelList, tif: &Path) -> CliResult {
        if !has_extension(tif, &["tif", "tiff"]) {
            let tif = tif.display();
            return Err(format!("{tif}: --elevation-map writes a GeoTIFF, a .tif file").into());
        }
        let mut projector = self.limits.projector(list)?;
        let (grid, elevation) = projector.grid_and_elevation(self.robot_m(), None)?;
        free_cells(&grid)?;
        let elevation = elevation.map_err(|error| match error {
            ProjectionError::TooManyHeights { width, height } => format!(
                "{width} x {height} cells exceed {MAX_ELEVATION_CELLS} cells: set a larger --resolution, or crop the map"
            ),
            other => other.to_string(),
        })?;
        atomic_write::write(tif, |out| write_elevation_tiff(&elevation, out))?;
        let known = elevation.elevation_m.iter().filter(|z_m| !z_m.is_nan());
        println!(
            "{} x {} cells of {:.3} m: {} with a height",
            elevation.width,
            elevation.height,
            elevation.resolution_m,
            known.count()
        );
        Ok(())
    }

    fn robot_m(&self) -> Option<Vector3<f64>> {
        let robot = self.robot.as_deref();
        robot
            .and_then(|robot| <[f64; 3]>::try_from(robot).ok())
            .map(Vector3::from)
    }
}

/// Number of free cells; an error without any.
fn free_cells(grid: &Grid) -> CliResult<usize> {
    match grid.count(Cell::Free) {
        0 => Err(
            "no free cell: no ground is below --robot, or it is steeper or rougher than the limits"
                .into(),
        ),
        free => Ok(free),
    }
}

fn has_extension(file: &Path, known: &[&str]) -> bool {
    let extension = file.extension().unwrap_or_default().to_string_lossy();
    known.contains(&&*extension.to_ascii_lowercase())
}
