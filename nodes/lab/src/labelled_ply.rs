//! Labelled clouds as PLY files.

use crate::AnyError;
use lattice_core::registration::{LabelDistribution, UNLABELED};
use lattice_nodes::files::atomic_write;
use lattice_nodes::files::export::write_labelled_ply;
use nalgebra::Point3;
use std::path::Path;

/// Writes points, metres, with their most probable classes.
pub fn write_cloud(
    path: &Path,
    points_m: &[Point3<f64>],
    label: impl Fn(usize) -> LabelDistribution,
    comment: &str,
) -> Result<(), AnyError> {
    let labels = (0..points_m.len()).map(|i| label(i).top().unwrap_or(UNLABELED));
    let labels: Vec<u16> = labels.collect();
    atomic_write::write(path, |file| {
        write_labelled_ply(points_m, &labels, comment, file)
    })
}
