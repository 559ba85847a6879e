//! Scans for other programs.

use super::measure::Prepared;
use crate::labelled_ply::write_cloud;
use crate::{AnyError, at};
use lattice_core::registration::SemanticCloud;
use std::fs;
use std::path::Path;

/// Writes each scan as `scan_N.ply`, and thinned as `thinned_N.ply`: points with their most probable
/// classes, sensor frame.
pub fn write_scans(folder: &Path, names: &[String], scans: &[Prepared]) -> Result<(), AnyError> {
    fs::create_dir_all(folder).map_err(at(folder))?;
    for (number, (name, scan)) in names.iter().zip(scans).enumerate() {
        let write = |kind: &str, cloud: &SemanticCloud| {
            let path = folder.join(format!("{kind}_{number}.ply"));
            let comment = format!("{kind} at {name}, metres, sensor frame");
            write_cloud(&path, &cloud.points_m, |i| cloud.label(i), &comment)
        };
        write("scan", &scan.whole)?;
        write("thinned", &scan.thinned)?;
    }
    Ok(())
}
