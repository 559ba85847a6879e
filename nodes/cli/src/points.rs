//! Point files for quantization.

use std::path::Path;

use clap::Args;
use lattice_core::cloud::Cloud;
use lattice_core::lattice::Lattice;
use lattice_core::voxels::{InsertReport, Payload, VoxelList};
use nalgebra::Vector3;

use crate::CliResult;
use lattice_nodes::files::points::{BinLayout, PointFileOptions, read_points, why_empty};

/// Limit of cells along the diagonal for an automatic cell size.
#[cfg(feature = "viewer")]
const MOST_CELLS: f64 = 400.0;

/// Columns of raw binary files.
#[derive(Args, Clone, Copy, Default)]
pub struct Columns {
    /// Numbers per point in a .bin file, x, y and z first: 3 to 64 floats, or doubles, such as 3d [default: 4, as in KITTI]
    #[arg(long, value_name = "N")]
    columns: Option<BinLayout>,
}

impl Columns {
    /// Options for reading files; columns require a .bin file among them.
    pub fn options(self, max_points: usize, paths: &[&Path]) -> CliResult<PointFileOptions> {
        let is_bin = |path: &&Path| {
            let name = path.to_string_lossy().to_ascii_lowercase();
            name.strip_suffix(".bz2").unwrap_or(&name).ends_with(".bin")
        };
        if self.columns.is_some() && !paths.iter().any(is_bin) {
            let names: Vec<String> = paths
                .iter()
                .map(|path| path.display().to_string())
                .collect();
            let names = names.join(", ");
            return Err(format!("--columns is for .bin files, not for {names}").into());
        }
        Ok(PointFileOptions {
            max_points,
            columns: self.columns,
        })
    }
}

/// Points of a file, at least one.
pub struct Points {
    cloud: Cloud,
    labels: Vec<u16>,
    datum_m: Vector3<f64>,
    /// Skipped points that are not finite.
    pub not_finite: u64,
    /// Removed points at 0 0 0.
    pub no_returns: u64,
    /// Voxel edge of an octree, whose points are voxel centres, m.
    voxel_m: Option<f64>,
}

impl Points {
    /// Reads a file; errors name it.
    pub fn read(path: &Path, options: &PointFileOptions) -> CliResult<Points> {
        let file = read_points(path, options).map_err(|e| format!("{}: {e}", path.display()))?;
        if file.points_m.is_empty() {
            let why = why_empty(file.skipped_not_finite, file.no_returns);
            return Err(format!("{}: {why}", path.display()).into());
        }
        let points: Vec<Vector3<f64>> = file.points_m.into_iter().map(Vector3::from).collect();
        // Offsets from the median keep the precision of distant coordinates, robust to outliers.
        let datum_m = middle_m(&points);
        Ok(Points {
            cloud: Cloud::from_points(0, datum_m, &points),
            labels: file.labels,
            datum_m,
            not_finite: file.skipped_not_finite as u64,
            no_returns: file.no_returns as u64,
            voxel_m: file.voxel_m,
        })
    }

    /// Quantizes the points, optionally with labels.
    pub fn quantize(
        &self,
        lattice: Lattice,
        max_voxels: usize,
        keep_labels: bool,
    ) -> CliResult<(VoxelList, InsertReport)> {
        if let Some(edge_m) = self.voxel_m
            && lattice.cell_side_m() < 1.99 * edge_m
        {
            log::warn!(
                "cells of {:.3} m have holes between the voxels of {edge_m} m of an octree: use a cell size of \
                 {} m or more",
                lattice.cell_side_m(),
                2.0 * edge_m
            );
        }
        let kind = lattice.kind();
        let list = VoxelList::new(lattice, self.datum_m, max_voxels)?;
        let mut list = list.with_payload(Payload {
            labels: keep_labels && !self.labels.is_empty(),
            ..Payload::default()
        });
        let report = list.insert_labelled(&self.cloud, &self.labels);
        if report.list_full > 0 {
            return Err(format!(
                "{} points exceed --max-voxels {max_voxels} on {kind}: raise it, or use larger cells",
                report.list_full
            )
            .into());
        }
        Ok((list, report))
    }

    /// Automatic cell size, m, and the reason for it.
    ///
    /// Two voxels of an octree; else 1, 2 or 5 times a power of ten, such that a surface as large as the cloud has about as
    /// many cells as there are points, with at most 400 cells along the diagonal.
    #[cfg(feature = "viewer")]
    pub fn usual_cell_m(&self) -> (f64, &'static str) {
        if let Some(edge_m) = self.voxel_m {
            return ((2.0 * edge_m).clamp(1e-3, 1e3), "two voxels of the octree");
        }
        let extent_m = Vector3::from_fn(|axis, _| {
            let coordinate = |p: &[f32; 3]| p.get(axis).copied().unwrap_or_default();
            let mut values: Vec<f32> = self.cloud.offsets_m.iter().map(coordinate).collect();
            // Without the outer hundredth, so that outliers do not stretch it.
            let low = values.len() / 100;
            let high = values.len().saturating_sub(low + 1);
            let mut nth = |n| *values.select_nth_unstable_by(n, f32::total_cmp).1;
            f64::from(nth(high)) - f64::from(nth(low))
        });
        let along = (self.cloud.offsets_m.len() as f64).sqrt().min(MOST_CELLS);
        let size_m = round_up(extent_m.norm() / along).clamp(1e-3, 1e3);
        (size_m, "chosen by extent and number of points")
    }
}

/// Next larger 1, 2 or 5 times a power of ten.
#[cfg(feature = "viewer")]
fn round_up(size_m: f64) -> f64 {
    let exponent = size_m.max(1e-3).log10().floor() as i32;
    let digits = [1, 2, 5, 10].map(|digit| format!("{digit}e{exponent}").parse());
    let mut steps = digits.into_iter().filter_map(Result::<f64, _>::ok);
    steps.find(|step| *step >= size_m).unwrap_or(size_m)
}

/// Median of each coordinate in whole kilometres; zero for files near their origin.
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

#[cfg(all(test, feature = "viewer"))]
mod tests {
    use super::*;

    fn points(points_m: &[[f64; 3]], voxel_m: Option<f64>) -> Points {
        let points_m: Vec<_> = points_m.iter().copied().map(Vector3::from).collect();
        Points {
            cloud: Cloud::from_points(0, Vector3::zeros(), &points_m),
            labels: Vec::new(),
            datum_m: Vector3::zeros(),
            not_finite: 0,
            no_returns: 0,
            voxel_m,
        }
    }

    #[test]
    fn sizes_are_rounded_up_to_decimals() {
        for (size_m, expected_m) in [
            (0.013, 0.02),
            (0.05, 0.05),
            (0.3, 0.5),
            (0.7, 1.0),
            (5.1, 10.0),
        ] {
            assert_eq!(round_up(size_m), expected_m);
        }
    }

    #[test]
    fn the_cell_size_follows_extent_and_number_of_points() {
        let square = |n: u32, side_m: f64| -> Vec<[f64; 3]> {
            let place = |i: u32| side_m * f64::from(i) / f64::from(n - 1);
            (0..n * n)
                .map(|i| [place(i % n), place(i / n), 0.0])
                .collect()
        };
        // 70 m along the diagonal in 100 cells.
        assert_eq!(points(&square(100, 50.0), None).usual_cell_m().0, 1.0);
        // Stray points change nothing.
        let mut stray = square(100, 50.0);
        stray.extend([[1e5; 3]; 50]);
        assert_eq!(points(&stray, None).usual_cell_m().0, 1.0);
        assert_eq!(points(&square(20, 0.1), None).usual_cell_m().0, 0.01);
        assert_eq!(points(&[[1.0; 3]], None).usual_cell_m().0, 1e-3);
        assert_eq!(points(&square(20, 9.0), Some(0.08)).usual_cell_m().0, 0.16);
    }
}
