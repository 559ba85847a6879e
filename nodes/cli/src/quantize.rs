//! `lattice quantize`: statistics of a point file on each lattice.

use std::path::PathBuf;

use clap::Args;
use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, Orientation};
use lattice_core::voxels::file::write_map;
use lattice_core::voxels::{Payload, VoxelList};
use nalgebra::Vector3;
use serde::Serialize;

use super::{CliResult, Lattices, init_logging};
use lattice_nodes::files::points::{PointFileLimits, read_points};
use lattice_nodes::files::whole;

/// Quantize a point file
#[derive(Args)]
pub struct Quantize {
    /// ply, pcd, xyz or txt (also .bz2), or KITTI bin, with the labels of SemanticKITTI from its .label file
    file: PathBuf,
    /// cubic, bcc, fcc, mcc, hex, hexopt, several with commas, paper, or all
    #[arg(long, default_value = "all")]
    lattice: Lattices,
    /// Volume of one cell in m^3
    #[arg(long, default_value_t = 0.125)]
    cell_volume: f64,
    /// Orientation of the cells: paper, ground (flattest), or a crystal direction that points up, as 110-up
    #[arg(long, default_value = "paper")]
    orientation: Orientation,
    /// Most points to read
    #[arg(long, default_value_t = 500_000_000)]
    max_points: usize,
    /// Most voxels to keep
    #[arg(long, default_value_t = 200_000_000)]
    max_voxels: usize,
    /// Write the map of the first lattice here, for `lattice map`
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
    points: u64,
    refused_not_finite: u64,
    refused_out_of_range: u64,
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
        let limits = PointFileLimits {
            max_points: self.max_points,
        };
        let file = read_points(&self.file, &limits)
            .map_err(|e| format!("{}: {e}", self.file.display()))?;
        let skipped = file.skipped_not_finite as u64;
        if file.points_m.is_empty() {
            let why = match skipped {
                0 => "the file has no points".to_owned(),
                n => format!("none of its {n} points is finite"),
            };
            return Err(format!("{}: {why}", self.file.display()).into());
        }
        let labels = file.labels;
        let points: Vec<Vector3<f64>> = file.points_m.into_iter().map(Vector3::from).collect();
        // Offsets from the middle keep the digits of far-away coordinates, whatever strays.
        let datum_m = middle_m(&points);
        let cloud = Cloud::from_points(0, datum_m, &points);
        drop(points);
        let mut rows = Vec::new();
        for (i, kind) in self.lattice.0.iter().enumerate() {
            let lattice = Lattice::new(*kind, self.cell_volume)?;
            let lattice = lattice.with_orientation(self.orientation)?;
            let list = VoxelList::new(lattice, datum_m, self.max_voxels)?;
            let mut list = list.with_payload(Payload {
                // Only the map that is written keeps them.
                labels: i == 0 && self.map_out.is_some() && !labels.is_empty(),
                ..Payload::default()
            });
            let report = list.insert_labelled(&cloud, &labels);
            if report.list_full > 0 {
                let (left, most) = (report.list_full, self.max_voxels);
                return Err(format!(
                    "{left} points are beyond --max-voxels {most} on {}: allow more, or take larger cells",
                    kind.name()
                )
                .into());
            }
            let distortion = list.distortion();
            rows.push(Row {
                lattice: kind.name(),
                cell_volume_m3: self.cell_volume,
                points: report.inserted,
                refused_not_finite: report.not_finite + skipped,
                refused_out_of_range: report.out_of_range,
                voxels: list.len(),
                mse_per_dimension_m2: distortion.mse_per_dimension_m2,
                mean_distance_m: distortion.mean_distance_m,
                rms_m: distortion.rms_m,
                max_distance_m: distortion.max_distance_m,
            });
            if let (0, Some(path)) = (i, &self.map_out) {
                whole::write(path, |out| write_map(&list, out))?;
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

/// Median of each coordinate in whole kilometres, so that files about their origin keep it.
fn middle_m(points: &[Vector3<f64>]) -> Vector3<f64> {
    if points.is_empty() {
        return Vector3::zeros();
    }
    Vector3::from_fn(|axis, _| {
        let mut values: Vec<f64> = points.iter().map(|p| p[axis]).collect();
        let middle = values.len() / 2;
        let (_, median, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
        (*median / 1000.0).round() * 1000.0
    })
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
