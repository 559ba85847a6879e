//! `lattice map info`.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::read;
use crate::CliResult;

/// Options of `lattice map info`.
#[derive(Args)]
pub struct Info {
    /// Map file, as written by `--map-out`
    map: PathBuf,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Summary {
    lattice: &'static str,
    cell_volume_m3: f64,
    /// Edge of the cube of equal volume.
    cell_size_m: f64,
    datum_m: [f64; 3],
    datum_index: [i64; 3],
    voxels: usize,
    /// True if the file has a count and an offset sum for each voxel.
    counts: bool,
    /// True if each voxel has the stamps of its first and last point.
    stamps: bool,
    /// True if each voxel has the numbers of its points by label.
    labels: bool,
    /// True if each voxel has the sums of the colours of its points.
    colors: bool,
    points: u64,
    min_m: Option<[f64; 3]>,
    max_m: Option<[f64; 3]>,
    mse_per_dimension_m2: f64,
    mean_distance_m: f64,
    rms_m: f64,
    max_distance_m: f64,
    file_bytes: u64,
    bytes_per_voxel: f64,
}

impl Info {
    /// Runs the command.
    pub fn run(self) -> CliResult {
        let (map, file_bytes) = read(&self.map)?;
        let mut bounds: Option<([f64; 3], [f64; 3])> = None;
        for key in map.keys() {
            let center: [f64; 3] = map.center_m(*key).into();
            let (min, max) = bounds.get_or_insert((center, center));
            for axis in 0..3 {
                min[axis] = min[axis].min(center[axis]);
                max[axis] = max[axis].max(center[axis]);
            }
        }
        let distortion = map.distortion();
        let kept = map.payload();
        let voxels = map.keys().len();
        let summary = Summary {
            lattice: map.lattice().kind().name(),
            cell_volume_m3: map.lattice().cell_volume_m3(),
            cell_size_m: map.lattice().cell_side_m(),
            datum_m: map.datum_m().into(),
            datum_index: map.datum_index(),
            voxels,
            counts: map.voxels().is_some(),
            stamps: kept.stamps,
            labels: kept.labels,
            colors: kept.color,
            points: distortion.points,
            min_m: bounds.map(|(min, _)| min),
            max_m: bounds.map(|(_, max)| max),
            mse_per_dimension_m2: distortion.mse_per_dimension_m2,
            mean_distance_m: distortion.mean_distance_m,
            rms_m: distortion.rms_m,
            max_distance_m: distortion.max_distance_m,
            file_bytes,
            bytes_per_voxel: file_bytes as f64 / (voxels.max(1)) as f64,
        };
        if self.json {
            println!("{}", serde_json::to_string_pretty(&summary)?);
            return Ok(());
        }
        println!(
            "lattice        {}, cells of {} m^3 (cell size {:.4} m)",
            summary.lattice, summary.cell_volume_m3, summary.cell_size_m
        );
        let without = if summary.counts {
            ""
        } else {
            ", without counts"
        };
        println!("voxels         {}{without}", summary.voxels);
        let columns = [
            (kept.stamps, "stamps"),
            (kept.labels, "labels"),
            (kept.color, "colours"),
        ];
        let columns: Vec<_> = columns.iter().filter(|(kept, _)| *kept).collect();
        if !columns.is_empty() {
            let names: Vec<_> = columns.iter().map(|(_, name)| *name).collect();
            println!("columns        {}", names.join(", "));
        }
        if let (Some(min), Some(max)) = (summary.min_m, summary.max_m) {
            println!("extent (m)     {min:.1?} to {max:.1?}");
        }
        println!("datum (m)      {:.3?}", summary.datum_m);
        if summary.points > 0 {
            println!("points         {}", summary.points);
            println!("MSE per dim    {:.6} m^2", summary.mse_per_dimension_m2);
            println!("mean distance  {:.5} m", summary.mean_distance_m);
            println!("RMS distance   {:.5} m", summary.rms_m);
            println!("largest        {:.4} m", summary.max_distance_m);
        }
        println!(
            "file           {} bytes, {:.2} a voxel",
            summary.file_bytes, summary.bytes_per_voxel
        );
        Ok(())
    }
}
