//! Occupancy grid of a map file.

use std::path::Path;

use clap::Args;
use lattice_core::navigation::Cell;
use lattice_core::voxels::VoxelList;
use lattice_nodes::files::atomic_write;
use lattice_nodes::files::export::{write_grid_pgm, write_grid_yaml};
use nalgebra::Vector3;

use super::robot::RobotOptions;
use crate::CliResult;

/// Robot for which a grid is made, and its place.
#[derive(Args)]
pub struct GridOptions {
    #[command(flatten)]
    limits: RobotOptions,
    /// Position of the robot, map frame, m: the ground below it is that of the grid; default: the lowest large surface
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true, requires = "grid")]
    robot: Option<Vec<f64>>,
}

impl GridOptions {
    /// Writes the grid of a map as YAML, and its image beside it.
    pub fn write(&self, list: &VoxelList, yaml: &Path) -> CliResult {
        let extension = yaml.extension().unwrap_or_default().to_string_lossy();
        if !["yaml", "yml"].contains(&&*extension.to_ascii_lowercase()) {
            let yaml = yaml.display();
            return Err(
                format!("{yaml}: --grid writes a .yaml file, with a .pgm file beside it").into(),
            );
        }
        let mut projector = self.limits.projector(list)?;
        let robot_m = self
            .robot
            .as_deref()
            .and_then(|robot| <[f64; 3]>::try_from(robot).ok());
        let grid = projector.grid(robot_m.map(Vector3::from), None)?;
        let free = grid.count(Cell::Free);
        if free == 0 {
            return Err("no free cell: no ground is below --robot, or it is steeper or rougher than the limits".into());
        }
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
}
