//! `lattice map`: map files.

mod combine;
mod export;
mod grid;
mod info;
mod output;
mod query;
mod read;
mod robot;
mod save;

use clap::Subcommand;

use super::{CliResult, fleet, init_logging};
pub use read::{read, read_named};

/// Inspect, export, merge, compare, crop, query and save map files
#[derive(Subcommand)]
pub enum Map {
    /// Show lattice, size, extent and statistics
    Info(info::Info),
    /// Export as PLY or PCD (cell centres), PLY mesh of exposed cell faces, octree of octomap (.bt, .ot), PNG image,
    /// or occupancy grid for Nav2 (--grid)
    Export(export::Export),
    /// Merge the voxels of several maps with the same cells; with one map, convert its form
    Merge(combine::Merge),
    /// Count voxels in either map and in both; optionally write those only in the first
    Diff(combine::Diff),
    /// Write the voxels with their centre in a box
    Crop(combine::Crop),
    /// Find the nearest voxels, the clearance of a point, or a short path of a ball or of a robot on the ground
    Query(query::Query),
    /// Have a running mapper write its map
    Save(save::Save),
    /// Add map files to a folder of Parquet tables; needs the program lattice-fleet
    ToTable(fleet::Fleet),
    /// Write one map file from a folder of Parquet tables; needs the program lattice-fleet
    FromTable(fleet::Fleet),
}

impl Map {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        init_logging();
        match self {
            Self::Info(command) => command.run(),
            Self::Export(command) => command.run(),
            Self::Merge(command) => command.run(),
            Self::Diff(command) => command.run(),
            Self::Crop(command) => command.run(),
            Self::Query(command) => command.run(),
            Self::Save(command) => command.run(),
            Self::ToTable(command) => command.run_as("to-table"),
            Self::FromTable(command) => command.run_as("from-table"),
        }
    }
}
