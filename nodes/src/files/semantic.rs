//! Labelled clouds from map files and point files.

use std::error::Error;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use lattice_core::registration::{LabelDistribution, SemanticCloud};
use lattice_core::voxels::file::{max_voxels_of, read_map};
use nalgebra::Point3;

use super::points::{PointFileOptions, read_points, why_empty};

impl SemanticFile {
    /// Checks that the cloud has points; the error names the file and the reason.
    pub fn with_points(self, path: &Path) -> Result<SemanticFile, String> {
        match self.cloud.is_empty() {
            false => Ok(self),
            true => {
                let why = why_empty(self.skipped_not_finite, self.no_returns);
                Err(format!("{}: {why}", path.display()))
            }
        }
    }
}

/// First bytes of every map file, of any version.
const MAP_MAGIC: &[u8; 7] = b"LATTICE";

/// Labelled cloud of a file.
#[derive(Clone, PartialEq, Debug)]
pub struct SemanticFile {
    /// Points in the frame of the file, with labels if the file has any.
    pub cloud: SemanticCloud,
    /// Cell size (edge of the cube of equal volume), metres, of a map or octree.
    pub cell_side_m: Option<f64>,
    /// Skipped points with a NaN or infinite coordinate.
    pub skipped_not_finite: usize,
    /// Removed points at 0 0 0.
    pub no_returns: usize,
}

/// Reads a map file or an octree, with one point per voxel, or a point file with or without a `label` property.
///
/// Errors name the file.
pub fn read_semantic(
    path: &Path,
    options: &PointFileOptions,
) -> Result<SemanticFile, Box<dyn Error + Send + Sync>> {
    let here = |e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    if is_map(path).map_err(|e| here(&e))? {
        let file = File::open(path).map_err(|e| here(&e))?;
        let bytes = file.metadata().map_err(|e| here(&e))?.len();
        let most = max_voxels_of(bytes).min(options.max_points);
        let map = read_map(BufReader::new(file), most).map_err(|e| here(&e))?;
        return Ok(SemanticFile {
            cell_side_m: Some(map.lattice().cell_volume_m3().cbrt()),
            cloud: SemanticCloud::from_voxels(&map),
            skipped_not_finite: 0,
            no_returns: 0,
        });
    }
    let file = read_points(path, options).map_err(|e| here(&e))?;
    Ok(SemanticFile {
        cloud: SemanticCloud {
            points_m: file.points_m.into_iter().map(Point3::from).collect(),
            labels: (file.labels.into_iter())
                .map(LabelDistribution::hard)
                .collect(),
        },
        cell_side_m: file.voxel_m,
        skipped_not_finite: file.skipped_not_finite,
        no_returns: file.no_returns,
    })
}

fn is_map(path: &Path) -> std::io::Result<bool> {
    let mut start = Vec::with_capacity(MAP_MAGIC.len());
    let file = File::open(path)?;
    file.take(MAP_MAGIC.len() as u64).read_to_end(&mut start)?;
    Ok(start == MAP_MAGIC)
}
