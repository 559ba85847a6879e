//! Scans for other programs.

use super::Prepared;
use crate::{AnyError, at};
use lattice_core::registration::{SemanticCloud, UNLABELED};
use lattice_nodes::files::export::write_labelled_ply;
use lattice_nodes::files::whole;
use std::fs;
use std::path::Path;

/// Writes each scan as `scan_N.ply`, and thinned as `thinned_N.ply`: points with their most probable
/// classes, sensor frame.
pub fn write_scans(folder: &Path, names: &[String], scans: &[Prepared]) -> Result<(), AnyError> {
    fs::create_dir_all(folder).map_err(at(folder))?;
    for (number, (name, scan)) in names.iter().zip(scans).enumerate() {
        let write = |kind: &str, cloud: &SemanticCloud| {
            let path = folder.join(format!("{kind}_{number}.ply"));
            let labels: Vec<u16> = (0..cloud.len())
                .map(|i| cloud.label(i).top().unwrap_or(UNLABELED))
                .collect();
            let comment = format!("{kind} at {name}, metres, sensor frame");
            whole::write(&path, |file| {
                write_labelled_ply(&cloud.points_m, &labels, &comment, file)
            })
        };
        write("scan", &scan.whole)?;
        write("thinned", &scan.thinned)?;
    }
    Ok(())
}
