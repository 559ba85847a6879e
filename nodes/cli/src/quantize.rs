//! `lattice quantize`: quantization statistics of a point file on each lattice.

use std::path::PathBuf;

use clap::Args;
use lattice_core::lattice::{Lattice, Orientation};
use lattice_core::voxels::file::write_map;
use serde::Serialize;

use super::cell_size::CellSize;
use super::points::{Columns, Points};
use super::{CliResult, Lattices, init_logging};
use lattice_nodes::files::atomic_write;

/// Quantize a point file
#[derive(Args)]
pub struct Quantize {
    /// ply, pcd, las, laz, e57, bt or ot (octomap), xyz or txt (also .bz2), or KITTI bin, with the labels of
    /// SemanticKITTI from its .label file
    file: PathBuf,
    /// cubic, bcc, fcc, mcc, hex, hexopt, several separated by commas, paper, or all
    #[arg(long, default_value = "all")]
    lattice: Lattices,
    #[command(flatten)]
    cells: CellSize,
    /// Orientation of the cells: paper, ground (flattest), or a crystal direction that points up, such as 110-up
    #[arg(long, default_value = "paper")]
    orientation: Orientation,
    /// Limit of points
    #[arg(long, default_value_t = 500_000_000)]
    max_points: usize,
    #[command(flatten)]
    columns: Columns,
    /// Limit of voxels
    #[arg(long, default_value_t = 200_000_000)]
    max_voxels: usize,
    /// File for the map of the first lattice, for `lattice map`
    #[arg(long, value_name = "FILE")]
    map_out: Option<PathBuf>,
    /// Print the numbers as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Row {
    lattice: &'static str,
    cell_volume_m3: f64,
    cell_size_m: f64,
    points: u64,
    refused_not_finite: u64,
    refused_out_of_range: u64,
    /// Removed points at 0 0 0.
    no_returns: u64,
    voxels: usize,
    mse_per_dimension_m2: f64,
    mean_distance_m: f64,
    rms_m: f64,
    max_distance_m: f64,
}

impl Quantize {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        init_logging();
        let options = self.columns.options(self.max_points, &[&self.file])?;
        let points = Points::read(&self.file, &options)?;
        let cell_volume_m3 = self.cells.volume_m3().unwrap_or(0.125);
        let mut rows = Vec::new();
        for (i, kind) in self.lattice.0.iter().enumerate() {
            let lattice = Lattice::new(*kind, cell_volume_m3)?;
            let lattice = lattice.with_orientation(self.orientation)?;
            // Only the written map has labels.
            let keep_labels = i == 0 && self.map_out.is_some();
            let (list, report) = points.quantize(lattice, self.max_voxels, keep_labels)?;
            let distortion = list.distortion();
            rows.push(Row {
                lattice: kind.name(),
                cell_volume_m3,
                cell_size_m: list.lattice().cell_side_m(),
                points: report.inserted,
                refused_not_finite: report.not_finite + points.not_finite,
                refused_out_of_range: report.out_of_range,
                no_returns: points.no_returns,
                voxels: list.len(),
                mse_per_dimension_m2: distortion.mse_per_dimension_m2,
                mean_distance_m: distortion.mean_distance_m,
                rms_m: distortion.rms_m,
                max_distance_m: distortion.max_distance_m,
            });
            if let (0, Some(path)) = (i, &self.map_out) {
                atomic_write::write(path, |out| write_map(&list, out))?;
            }
        }
        if self.json {
            println!("{}", serde_json::to_string_pretty(&rows)?);
        } else {
            print(&rows);
        }
        Ok(())
    }
}

fn print(rows: &[Row]) {
    println!(
        "{:<8}{:>10}{:>10}{:>10}{:>16}{:>12}{:>10}{:>10}",
        "lattice", "points", "refused", "voxels", "MSE/dim (m^2)", "mean (m)", "RMS (m)", "max (m)"
    );
    for row in rows {
        let refused = row.refused_not_finite + row.refused_out_of_range;
        println!(
            "{:<8}{:>10}{:>10}{:>10}{:>16.6}{:>12.5}{:>10.5}{:>10.4}",
            row.lattice,
            row.points,
            refused,
            row.voxels,
            row.mse_per_dimension_m2,
            row.mean_distance_m,
            row.rms_m,
            row.max_distance_m
        );
    }
}
